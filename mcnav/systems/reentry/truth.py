"""The actual motion of the vehicle: NASA TN D-1772, eqs. (1)-(4), integrated phase by phase.

Within one *phase* the atmosphere has one layer, the lift law one regime and the accelerometers one switch position, so
that the equations are smooth, and the altitude only rises or only falls. Phases end where the truth crosses a layer
boundary, reaches or leaves the limit of the lift law, passes the accelerometers' switching altitude, or turns; the
instant is found as a root of the integrator's dense output, and the integration starts afresh behind it. Altitude being
monotone within a phase, no crossing hides between two steps. Kinks therefore cost no accuracy, and everything that is
later integrated along this truth (navigator, variational equations, linear response) restarts with the same phases.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import compiled
from mcnav.numerics.dense_output import DenseOutput
from mcnav.numerics.integration import integrate
from mcnav.physics.constants import EARTH_RADIUS, EARTH_RATE, GRAVITATIONAL_PARAMETER, REENTRY_ALTITUDE
from mcnav.systems.reentry.atmosphere import LAYER_BOUNDARIES, LAYERS, Layer, layer_density
from mcnav.systems.reentry.vehicle import ConstantLift, LiftLaw, Vehicle, aerodynamic_force

RELATIVE_TOLERANCE: Final = 1e-12
ABSOLUTE_TOLERANCE: Final = np.array([1e-5, 1e-12, 1e-8, 1e-15])
"""DOP853's tolerances for (r, theta, r_dot, theta_dot): m, rad, m/s, rad/s."""

LONGEST_FLIGHT: Final = 86_400.0
"""A truth that has not come down after this time (s) is refused."""

ALTITUDE_HYSTERESIS: Final = 1e-6
RATE_HYSTERESIS: Final = 1e-9
"""A phase ends this far (m, m/s) beyond its boundary: above rounding, so that the next phase starts inside its own
bounds, and without effect on the physics."""


class NoReentry(ValueError):
    """The trajectory does not reach its final altitude; the message says what it does instead."""


@dataclass(frozen=True)
class Phase:
    """A stretch of the truth with smooth equations.

    Attributes
    ----------
    coefficients : ndarray, shape (7,)
        Layer base (m), temperature (K), lapse (K/m), density (kg/m^3); C_D A / m (m^2/kg); L/D as ``a + b r_dot``:
        a, b (s/m).
    accelerometers_on : bool
        Whether the accelerometers' outputs are used.
    start, end : float
        Time since the first point of the trajectory, s.
    solution : DenseOutput
        Dense output of the polar state on [start, end].
    """

    coefficients: Array
    accelerometers_on: bool
    start: float
    end: float
    solution: DenseOutput


@compiled
def truth_force(state: Array, coefficients: Array) -> tuple[float, float]:
    """Compute the horizontal and vertical (down) specific force on the vehicle in one phase, m/s^2."""
    base, temperature, lapse, base_density, ballistic, lift, lift_per_rate = coefficients
    radius, _, radius_rate, angle_rate = state
    air = layer_density(radius - EARTH_RADIUS, base, temperature, lapse, base_density)
    return aerodynamic_force(radius, radius_rate, angle_rate, air, ballistic, lift + lift_per_rate * radius_rate)


@compiled
def motion(state: Array, force_x: float, force_z: float, rates: Array) -> None:
    """Compute rates of a polar state under gravity and a specific force (TN D-1772, eq. 1) into ``rates``.

    ``r'' = r theta'^2 - f_z - mu/r^2`` and ``r theta'' = f_x - 2 r' theta'``. The truth obeys it with the actual
    force, the navigator (eq. 5) with the indicated one.
    """
    radius, _, radius_rate, angle_rate = state
    rates[0] = radius_rate
    rates[1] = angle_rate
    rates[2] = radius * angle_rate * angle_rate - force_z - GRAVITATIONAL_PARAMETER / (radius * radius)
    rates[3] = (force_x - 2.0 * radius_rate * angle_rate) / radius


@compiled
def truth_rates(time: float, state: Array, coefficients: Array) -> Array:
    """Compute the rates of the truth's polar state in one phase (NASA TN D-1772, eqs. 1-4)."""
    rates = np.empty(4)
    force_x, force_z = truth_force(state, coefficients)
    motion(state, force_x, force_z, rates)
    return rates


@dataclass(frozen=True)
class Trajectory:
    """An integrated truth.

    Attributes
    ----------
    phases : tuple of Phase
        In order of time, without gaps, from the first point to the final altitude.
    reentry_time : float
        When the altitude first falls through 121.92 km, s from the first point (zero if it starts below).
    """

    phases: tuple[Phase, ...]
    reentry_time: float

    @property
    def final_time(self) -> float:
        """Instant at which the final altitude is reached, s from the first point."""
        return self.phases[-1].end

    @cached_property
    def _ends(self) -> list[float]:
        return [phase.end for phase in self.phases]

    def _numbers(self, times: Array) -> Array:
        """Find the numbers of the phases that hold times (s), shape (n,), as `phase_at` does."""
        return np.minimum(np.searchsorted(self._ends, times, side="right"), len(self.phases) - 1)

    def phase_at(self, time: float) -> Phase:
        """Find the phase that holds a time (s); a boundary belongs to the later one."""
        return self.phases[min(bisect_right(self._ends, time), len(self.phases) - 1)]

    def state(self, time: float) -> Array:
        """Evaluate the polar state (r, theta, r_dot, theta_dot) at a time: m, rad, m/s, rad/s; shape (4,)."""
        return np.asarray(self.phase_at(time).solution(time), dtype=float)

    def departure(self, time: float) -> Array:
        """Integrate the state at a time from which a simulation starts, shape (4,).

        Integrated from the last step's beginning, not interpolated: a skip magnifies what the interpolation leaves.
        """
        phase = self.phase_at(time)
        known = phase.solution.ts
        node = float(known[known <= time].max(initial=phase.start))
        if node == time:
            return self.state(time)
        solution = integrate(
            truth_rates,
            (node, time),
            phase.solution(node),
            (RELATIVE_TOLERANCE, ABSOLUTE_TOLERANCE),
            (phase.coefficients,),
        )
        return np.asarray(solution.y[:, -1])

    def states(self, times: Array) -> Array:
        """Evaluate the polar states at many times, shape (n, 4)."""
        states, numbers = np.empty((len(times), 4)), self._numbers(times)
        for number in np.unique(numbers):
            within = numbers == number
            states[within] = self.phases[number].solution(times[within]).T
        return states

    def forces(self, times: Array) -> Array:
        """Compute the specific forces (f_x, f_z) at many times, m/s^2, shape (n, 2); f_z is positive down."""
        coefficients = np.array([phase.coefficients for phase in self.phases])[self._numbers(times)]
        return np.array([truth_force(*pair) for pair in zip(self.states(times), coefficients, strict=True)])

    def shared(self, begin: float, phase: Phase, states: Array) -> Array:
        """Move states integrated along this truth, shape (4 n,), together: the first is the truth where a phase begins.

        An integrator of its own leaves the truth by its own error, which a skip magnifies. Differences of states from
        the truth, which are what is wanted, stay as they are.
        """
        if begin != phase.start:
            return states
        drift = np.asarray(phase.solution(begin)) - states[:4]
        return np.asarray(states + np.tile(drift, len(states) // 4))

    def navigated(self, start: float) -> tuple[tuple[float, float, Phase], ...]:
        """List the stretches (begin, end, phase) that remain when navigation starts at a time (s)."""
        return tuple((max(start, phase.start), phase.end, phase) for phase in self.phases if phase.end > start)


def airspeed_and_angle(state: Array) -> tuple[float, float]:
    """Compute speed relative to the air (m/s) and its flight-path angle (rad, positive up), NASA TN D-1772, eq. (4)."""
    radius, _, radius_rate, angle_rate = state
    eastward = radius * (angle_rate - EARTH_RATE)
    return float(np.hypot(radius_rate, eastward)), float(np.arctan2(radius_rate, eastward))


@dataclass(frozen=True)
class _Regime:
    """A stretch of the lift law: L/D = ``fixed + per_rate * r_dot`` between two altitude rates."""

    fixed: float
    per_rate: float
    slowest: float
    fastest: float


def _regimes(law: LiftLaw) -> tuple[_Regime, ...]:
    """List the regimes of a lift law in order of rising altitude rate."""
    if isinstance(law, ConstantLift):
        return (_Regime(law.lift_to_drag, 0.0, -np.inf, np.inf),)
    corner = law.limiting_rate
    return (
        _Regime(law.limit, 0.0, -np.inf, -corner),
        _Regime(0.0, -law.gain, -corner, corner),
        _Regime(-law.limit, 0.0, corner, np.inf),
    )


@dataclass(frozen=True)
class Band:
    """A stretch of altitude: one layer of the atmosphere, accelerometers on or off; bounds are radii, m."""

    layer: Layer
    accelerometers_on: bool
    bottom: float
    top: float


def altitude_bands(switching_altitude: float | None) -> tuple[Band, ...]:
    """List the altitude bands in rising order."""
    edges = sorted({*LAYER_BOUNDARIES, *(() if switching_altitude is None else (switching_altitude,))})
    radii = [-np.inf, *(EARTH_RADIUS + edge for edge in edges), np.inf]
    bands = []
    for number, (bottom, top) in enumerate(pairwise(radii)):
        layer = LAYERS[sum(edge in LAYER_BOUNDARIES for edge in edges[:number])]
        on = switching_altitude is None or top <= EARTH_RADIUS + switching_altitude
        bands.append(Band(layer, on, bottom, top))
    return tuple(bands)


Event = Callable[[float, Array, Array], float]


def _crossing(component: int, level: float, direction: int) -> Event:
    """Make a terminal event of `solve_ivp`: a component of the state passes a level, rising (+1) or falling (-1)."""

    def event(time: float, state: Array, coefficients: Array) -> float:
        return float(state[component]) - level

    event.terminal = True  # type: ignore[attr-defined]
    event.direction = float(direction)  # type: ignore[attr-defined]
    return event


def fly_truth(
    start: Array, vehicle: Vehicle, final_altitude: float, switching_altitude: float | None = None,
    relative_tolerance: float = RELATIVE_TOLERANCE,
) -> Trajectory:  # fmt: skip
    """Fly the truth from its first point until the altitude falls through the final one.

    Parameters
    ----------
    start : ndarray, shape (4,)
        Polar state of the first point, at time zero.
    final_altitude : float
        m; the flight ends where the altitude first falls through it.
    switching_altitude : float, optional
        Above it the accelerometers' outputs are taken as zero, m (NASA TN D-1772, Table VI).
    relative_tolerance : float
        Of DOP853.

    Raises
    ------
    NoReentry
        When the start is not above the final altitude, or a day of flight does not reach it.
    """
    if start[0] <= EARTH_RADIUS + final_altitude:
        raise NoReentry(
            f"the flight starts at {_kilometres(start[0])}, which is not above its final altitude of "
            f"{final_altitude / 1e3:.2f} km"
        )
    bands, regimes = altitude_bands(switching_altitude), _regimes(vehicle.lift_law)
    band = next(i for i, candidate in enumerate(bands) if start[0] < candidate.top)
    regime = next(i for i, candidate in enumerate(regimes) if start[2] < candidate.fastest)
    time, state, end = 0.0, np.array(start, dtype=float), EARTH_RADIUS + final_altitude
    phases: list[Phase] = []
    rising: bool | None = None
    while True:
        air, law = bands[band], regimes[regime]
        coefficients = _coefficients(air.layer, vehicle, law)
        if rising is None:
            rising = bool(state[2] > 0.0 or (state[2] == 0.0 and truth_rates(time, state, coefficients)[2] > 0.0))
        # where the altitude may leave this phase: above when it rises, below (the end included) when it falls
        level = air.top + ALTITUDE_HYSTERESIS if rising else max(air.bottom - ALTITUDE_HYSTERESIS, end)
        direction = 1 if rising else -1
        events, span = _ends_of_phase(level, direction, law), (time, LONGEST_FLIGHT)
        tolerances = (relative_tolerance, ABSOLUTE_TOLERANCE)
        solution = integrate(truth_rates, span, state, tolerances, (coefficients,), dense_output=True, events=events)
        if solution.status != 1:
            raise NoReentry(_what_it_does_instead(phases, solution.y, final_altitude))
        crossed, turned, slower, faster = (trajectory.size > 0 for trajectory in solution.t_events)
        until = float(solution.t[-1])
        if not crossed and direction * (solution.y[0, -1] - level) > 0.0:
            # beyond the level and back within one step, which shows at its turning point alone
            until = _when(solution.sol, level, float(solution.t[-2]), until)
            crossed, turned, slower, faster = True, False, False, False
        phases.append(Phase(coefficients, air.accelerometers_on, time, until, solution.sol))
        time, state = until, np.asarray(solution.sol(until))
        if crossed and level == end:
            return Trajectory(tuple(phases), _reentry_time(phases))
        band += direction if crossed else 0
        regime += int(faster) - int(slower)
        rising = rising != turned


def _coefficients(layer: Layer, vehicle: Vehicle, law: _Regime) -> Array:
    """Return the coefficients of a `Phase`."""
    of_layer = (layer.base, layer.temperature, layer.lapse, layer.density)
    return np.array([*of_layer, vehicle.ballistic_coefficient, law.fixed, law.per_rate])


def _ends_of_phase(level: float, direction: int, law: _Regime) -> list[Event]:
    """List the events that end a phase: the altitude's level, its turning, and the ends of the lift law's regime."""
    return [
        _crossing(0, level, direction),
        _crossing(2, -direction * RATE_HYSTERESIS, -direction),
        _crossing(2, law.slowest - RATE_HYSTERESIS, -1),
        _crossing(2, law.fastest + RATE_HYSTERESIS, +1),
    ]


def _when(solution: DenseOutput, radius: float, begin: float, end: float) -> float:
    """Find when a solution whose radius is monotone on [begin, end] passes a radius there, s."""
    from scipy.optimize import brentq  # slow to import: a tenth of a second

    return float(brentq(lambda time: float(solution(time)[0]) - radius, begin, end, xtol=1e-12))


def _reentry_time(phases: list[Phase]) -> float:
    """Find when the altitude first falls through 121.92 km, s; zero when it starts below."""
    level = EARTH_RADIUS + REENTRY_ALTITUDE
    if phases[0].solution(phases[0].start)[0] <= level:
        return 0.0
    for phase in phases:
        if phase.solution(phase.end)[0] <= level < phase.solution(phase.start)[0]:
            return _when(phase.solution, level, phase.start, phase.end)
    return phases[-1].end


def _kilometres(radius: float) -> str:
    return f"{(radius - EARTH_RADIUS) / 1e3:.2f} km"


def _what_it_does_instead(phases: list[Phase], last: Array, final_altitude: float) -> str:
    """Explain why a flight was given up, by the altitudes that it did reach."""
    radii = np.concatenate([*(phase.solution(phase.solution.ts)[0] for phase in phases), last[0]])
    return (
        f"the trajectory never comes down to {final_altitude / 1e3:.2f} km: in {LONGEST_FLIGHT / 3600:.0f} h its "
        f"altitude falls no lower than {_kilometres(radii.min())} and ends at {_kilometres(radii[-1])}"
    )
