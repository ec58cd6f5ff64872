"""A guided reentry in cartesian inertial axes by scipy's `solve_ivp`: an independent route, for tests.

Gravity, air, lift, platform and instruments are written down once more; only constants, the temperatures of the
atmosphere and the polynomials of a law that follows the nominal flight are those of the package.
"""

from __future__ import annotations

from collections.abc import Callable
from math import atan2, cos, exp, hypot, log, sin
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from mcnav.physics.constants import EARTH_RADIUS, EARTH_RATE, GRAVITATIONAL_PARAMETER
from mcnav.systems.reentry.atmosphere import BREAKPOINTS
from mcnav.systems.reentry.guided.description import FollowingLaw, GuidedNavigation
from mcnav.systems.reentry.vehicle import ConstantLift

HEIGHTS, TEMPERATURES = np.array(BREAKPOINTS).T
SCALE_OF_HEIGHT = 9.80665 * 28.966 / 8314.39
GEOPOTENTIAL = 6_356_766.0
EDGES = GEOPOTENTIAL * HEIGHTS / (GEOPOTENTIAL - HEIGHTS)

BEYOND = 1e-6
"""Time by which the next phase begins after a kink, s: one step of Euler, which leaves 1e-11 m."""

State = np.ndarray
"""Actual x, y, vx, vy, then indicated ones; x points to where the range angle is zero."""


def _lapses() -> np.ndarray:
    return np.asarray(np.diff(TEMPERATURES) / np.diff(HEIGHTS))


def _log_pressures() -> list[float]:
    """Integrate the hydrostatic equation to the bottom of each layer."""
    known = [log(101_325.0)]
    for layer, lapse in enumerate(_lapses()):
        thickness = HEIGHTS[layer + 1] - HEIGHTS[layer]
        known.append(known[-1] - _fall(layer, lapse, thickness))
    return known


def _fall(layer: int, lapse: float, rise: float) -> float:
    """Fall of the logarithm of pressure over a rise from the bottom of a layer, m of geopotential altitude."""
    if lapse == 0.0:
        return float(SCALE_OF_HEIGHT * rise / TEMPERATURES[layer])
    return float(SCALE_OF_HEIGHT / lapse * log(1.0 + lapse * rise / TEMPERATURES[layer]))


LAPSES, PRESSURES = _lapses(), _log_pressures()


def _density(altitude: float, layer: int) -> float:
    """Density of an ideal gas, kg/m^3."""
    rise = GEOPOTENTIAL * altitude / (GEOPOTENTIAL + altitude) - HEIGHTS[layer]
    pressure = exp(PRESSURES[layer] - _fall(layer, LAPSES[layer], rise))
    return float(pressure * 28.966 / (8314.39 * (TEMPERATURES[layer] + LAPSES[layer] * rise)))


def _polar(state: State) -> np.ndarray:
    """Radius, range angle, their rates."""
    x, y, vx, vy = state
    radius = hypot(x, y)
    return np.array([radius, atan2(y, x), (x * vx + y * vy) / radius, (x * vy - y * vx) / radius**2])


def _cartesian(polar: np.ndarray) -> State:
    radius, angle, radius_rate, angle_rate = polar
    up, east = np.array([cos(angle), sin(angle)]), np.array([-sin(angle), cos(angle)])
    return np.concatenate([radius * up, radius_rate * up + radius * angle_rate * east])


def _followed(law: FollowingLaw, polar: np.ndarray) -> float:
    radius, angle, radius_rate, angle_rate = polar
    if angle < law.knots[0]:
        return law.lift_before
    interval = min(int(np.searchsorted(law.knots, angle, side="right")) - 1, len(law.polynomials) - 1)
    along = min(angle, float(law.knots[-1])) - float(law.knots[interval])
    values = [np.polynomial.polynomial.polyval(along, each) for each in law.polynomials[interval]]
    return float(values @ np.array([1.0, radius, radius_rate, EARTH_RADIUS * angle_rate]))


class CartesianFlight:
    """One sample of a guided reentry, with errors in the order of `GuidedError`."""

    def __init__(self, navigation: GuidedNavigation, errors: np.ndarray) -> None:
        self.navigation, self.errors = navigation, errors
        self.fed = slice(4, 8) if navigation.guidance.input == "indicated" else slice(0, 4)
        self.ending = slice(4, 8) if navigation.guidance.final == "indicated" else slice(0, 4)
        angle = navigation.theta_axes
        self.platform = np.array([[-sin(angle), cos(angle)], [-cos(angle), -sin(angle)]])  # x east, z down

    def start(self) -> State:
        nominal, errors = self.navigation.nominal_start, self.errors
        arcs = np.array([1.0, nominal[0], 1.0, nominal[0]])
        true = nominal + errors[12:16] / arcs
        told = true if self.navigation.guidance.navigator_start == "truth" else nominal
        return np.concatenate([_cartesian(true), _cartesian(told + errors[:4] / arcs)])

    def command(self, state: State) -> float:
        """L/D before its limit."""
        law, own, polar = self.navigation.guidance.law, self.navigation.vehicle.lift_law, _polar(state[self.fed])
        if law is not None:
            return _followed(law, polar)
        return own.lift_to_drag if isinstance(own, ConstantLift) else float(-own.gain * polar[2])

    @property
    def limit(self) -> float:
        law, own = self.navigation.guidance.law, self.navigation.vehicle.lift_law
        return law.limit if law is not None else np.inf if isinstance(own, ConstantLift) else own.limit

    def force(self, state: State, layer: int, side: int) -> np.ndarray:
        """Specific force in inertial axes, m/s^2; ``side`` is that of the limit at which L/D is, or zero."""
        x, y, vx, vy = state[:4]
        density, lift_to_drag, drag = 1.0 + self.errors[16:19]
        through = np.array([vx + EARTH_RATE * y, vy - EARTH_RATE * x])  # the air turns with the earth
        pressure = 0.5 * density * _density(hypot(x, y) - EARTH_RADIUS, layer) * hypot(*through)
        lift = lift_to_drag * (side * self.limit if side else self.command(state))
        upward = np.array([through[1], -through[0]])
        scaled = pressure * drag * self.navigation.vehicle.ballistic_coefficient
        return np.asarray(scaled * (lift * upward - through))

    def rates(self, time: float, state: State, layer: int, on: bool, side: int) -> np.ndarray:
        force, e = self.force(state, layer, side), self.errors
        along_x, along_z = self.platform @ force
        turn = e[4] + e[5] * (time - self.navigation.start)
        felt_x = along_x * cos(turn) + along_z * sin(turn)
        felt_z = along_z * cos(turn) - along_x * sin(turn)
        read_x = (felt_x + e[6]) * (1.0 + e[8]) + e[10] * felt_z
        read_z = (felt_z + e[7]) * (1.0 + e[9]) + e[11] * felt_x
        read = self.platform.T @ [read_x, read_z] if on else np.zeros(2)
        gravity = [-GRAVITATIONAL_PARAMETER / hypot(*at) ** 3 * at for at in (state[:2], state[4:6])]
        return np.concatenate([state[2:4], gravity[0] + force, state[6:8], gravity[1] + read])

    def _phase(self, state: State) -> tuple[int, bool, int]:
        """Layer, accelerometers on, side of the lift's limit."""
        altitude = _polar(state[:4])[0] - EARTH_RADIUS
        off, command = self.navigation.switching_altitude, self.command(state)
        side = 0 if abs(command) <= self.limit else int(np.sign(command))
        return int(np.searchsorted(EDGES[1:-1], altitude)), off is None or altitude < off, side

    def _events(self) -> list[Callable[..., float]]:
        """Kinks, and the end of the flight, last; all end a phase."""
        off, law = self.navigation.switching_altitude, self.navigation.guidance.law
        levels = [*EDGES[1:-1], *([] if off is None else [off])]
        functions: list[Callable[[State], float]] = [
            lambda s: _polar(s[:4])[2],
            *(lambda s, level=level: _polar(s[:4])[0] - EARTH_RADIUS - level for level in levels),
            *(lambda s, knot=knot: _polar(s[self.fed])[1] - knot for knot in (() if law is None else law.knots)),
            *(lambda s, side=side: self.command(s) - side * self.limit for side in (-1, 1) if self.limit < np.inf),
        ]
        events: list[Any] = [lambda t, s, *rest, each=each: each(s) for each in functions]
        final = EARTH_RADIUS + self.navigation.final_altitude
        events.append(lambda t, s, *rest: _polar(s[self.ending])[0] - final)
        events[-1].direction = -1
        for event in events:
            event.terminal = True
        return events

    def fly(self) -> tuple[float, np.ndarray, np.ndarray, float]:
        """Time (s from the first point), actual and indicated polar state at the end, largest force at 17 times a step.

        Range angles are between plus and minus pi.
        """
        time, state, largest, arrived = self.navigation.start, self.start(), 0.0, False
        phase, events = self._phase(state), self._events()
        while not arrived:
            solution = solve_ivp(
                self.rates, (time, 86_400.0), state, "DOP853", rtol=1e-12, atol=np.tile([1e-6, 1e-6, 1e-9, 1e-9], 2),
                args=phase, events=events, dense_output=True,
            )  # fmt: skip
            assert solution.status == 1, solution.message
            steps = np.concatenate([np.linspace(*ends, 17) for ends in zip(solution.t, solution.t[1:], strict=False)])
            forces = [hypot(*self.force(solution.sol(t), phase[0], phase[2])) for t in steps]
            largest = max(largest, *forces)
            time, state = float(solution.t[-1]), solution.y[:, -1]
            arrived = len(solution.t_events[-1]) > 0
            if not arrived:  # a little beyond the kink, so that it is not met again at once
                phase = self._phase(state + BEYOND * self.rates(time, state, *phase))
                time, state = time + BEYOND, state + BEYOND * self.rates(time, state, *phase)
        return time, _polar(state[:4]), _polar(state[4:]), largest
