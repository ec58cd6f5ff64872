"""The guided reentry in the form of the report: NASA TN D-1772, eqs. (1)-(10), in polar coordinates.

This is the reference path. Each sample has a truth of its own: actual and indicated motion are integrated together by
DOP853, with a restart at every kink of this very flight: where the true altitude crosses a boundary of the atmosphere's
layers or the accelerometers' switching altitude, or turns; where the altitude that ends the flight turns; where the
lift law reaches or leaves its limit, or passes a knot. The ensemble path shares none of these equations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from mcnav.arrays.types import Array
from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.history import Epochs
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.numerics.dop853 import LEFT, REACHED, Steps, integrate_compiled
from mcnav.physics.constants import EARTH_RADIUS
from mcnav.systems.reentry.guided.description import Ending, GuidedError, GuidedNavigation, start_states
from mcnav.systems.reentry.guided.polar import (
    advance_guided,
    guided_force,
    guided_rates,
    lift_command,
    lift_stretches,
)
from mcnav.systems.reentry.navigator import LIMITS, LOWEST_RADIUS, TOLERANCES, navigation_error
from mcnav.systems.reentry.outputs import SCALE, append_errors
from mcnav.systems.reentry.truth import ALTITUDE_HYSTERESIS, LONGEST_FLIGHT, RATE_HYSTERESIS, altitude_bands
from mcnav.systems.sample_loop import SampleFailed, simulate_each

REFERENCE_CHUNK: Final = 32

LIFT_HYSTERESIS: Final = 1e-11
"""A phase ends when the lift law is this far beyond its limit, or within it; see `ALTITUDE_HYSTERESIS`."""

NEAR_THE_PEAK: Final = 0.9
"""Share of the largest force at the ends of steps from which a step may contain a larger one."""

PEAK_TIME: Final = 1e-5
"""Accuracy of the time of a largest force, s: its second derivative leaves 1e-12 of it."""

UNLIMITED: Final = np.array([[-np.inf] * 8, [np.inf] * 8])


@dataclass(frozen=True)
class FlownPhase:
    """Steps of a flight in one phase, and the further arguments of `guided_rates` there."""

    steps: Steps
    args: tuple[Any, ...]

    def forces(self) -> Array:
        """Compute the size of the specific force at the end of each step, m/s^2, shape (m,)."""
        return np.array([self.force(state) for state in self.steps.states])

    def force(self, state: Array) -> float:
        """Compute the size of the specific force on the vehicle, m/s^2."""
        return float(np.hypot(*guided_force(state, *self.args[:4])))

    def state(self, step: int, time: float) -> Array:
        """Integrate the state at a time within a step, from its begin, shape (8,)."""
        begin = float(self.steps.times[step])
        if time <= begin:
            return np.asarray(self.steps.states[step])
        within = integrate_compiled(
            advance_guided, (begin, time), self.steps.states[step], TOLERANCES, UNLIMITED, self.args
        )
        return np.asarray(within.states[-1])


class _Flight:
    """One sample under way: its state, and the phase that it is in.

    Attributes
    ----------
    time : float
        s from the first point of the trajectory.
    state : ndarray, shape (8,)
        Actual and indicated polar state.
    band, stretch : int
        Of the true altitude, of the lift law.
    side : int
        1 or -1 where L/D is at its upper or lower limit, 0 between them.
    rising : dict
        Place of an altitude in the state to whether it rises: the true one, and the one that ends the flight.
    """

    def __init__(self, navigation: GuidedNavigation, errors: Array) -> None:
        guidance = navigation.guidance
        self.navigation, self.errors = navigation, np.ascontiguousarray(errors)
        self.time, self.state = navigation.start, np.concatenate(start_states(navigation, errors))
        self.fed = 4 if guidance.input == "indicated" else 0
        self.ending = 4 if guidance.final == "indicated" else 0
        self.end = EARTH_RADIUS + navigation.final_altitude
        self._check_start()
        self.bands = altitude_bands(navigation.switching_altitude)
        self.stretches, self.limit = lift_stretches(navigation)
        self.band = next(i for i, band in enumerate(self.bands) if self.state[0] < band.top)
        self.stretch = next(i for i, stretch in enumerate(self.stretches) if self.state[self.fed + 1] < stretch.end)
        self.side = self._side()
        args = self._args()
        rates = guided_rates(self.time, self.state, *args)
        self.rising = {}
        for place in {0, self.ending}:
            rate = self.state[place + 2]
            self.rising[place] = bool(rate > 0.0 or (rate == 0.0 and rates[place + 2] > 0.0))

    def fail(self, ending: Ending) -> SampleFailed:
        """Return the exception of a flight that ends so."""
        return SampleFailed(self.navigation.failure(ending))

    def _check_start(self) -> None:
        if not (np.isfinite(self.state).all() and np.isfinite(self.errors).all()):
            raise self.fail(Ending.BROKEN)
        if self.state[self.ending] <= self.end:
            raise self.fail(Ending.STARTS_BELOW)
        if self.state[4] <= LOWEST_RADIUS:
            raise self.fail(Ending.CENTRE)
        if self.state[0] <= EARTH_RADIUS:
            raise self.fail(Ending.GROUND)

    def _commands(self, states: Array) -> Array:
        """Compute L/D before its limit at states, shape (m, 8), as on this stretch."""
        now = self.stretches[self.stretch]
        return np.array([lift_command(state[self.fed : self.fed + 4], now.lift, now.knot) for state in states])

    def _side(self) -> int:
        command = self._commands(self.state[None])[0]
        return int(command > self.limit) - int(command < -self.limit)

    def _within(self, states: Array) -> Array:
        """Compute how far L/D before its limit is within this phase, shape (m,); negative beyond."""
        commands = self._commands(states)
        inside = self.limit - np.abs(commands) if self.side == 0 else self.side * commands - self.limit
        return np.asarray(inside + LIFT_HYSTERESIS)

    def _args(self) -> tuple[Any, ...]:
        """Return the further arguments of `guided_rates` in this phase."""
        navigation, errors, band = self.navigation, self.errors, self.bands[self.band]
        layer, now = band.layer, self.stretches[self.stretch]
        density = layer.density * (1.0 + errors[GuidedError.DENSITY])
        ballistic = navigation.vehicle.ballistic_coefficient * (1.0 + errors[GuidedError.DRAG])
        factor = 1.0 + errors[GuidedError.LIFT_TO_DRAG]
        air = np.array([layer.base, layer.temperature, layer.lapse, density, ballistic, factor])
        at_limit = self.side != 0
        lift = np.array([[self.side * self.limit], [0.0], [0.0], [0.0]]) if at_limit else now.lift
        on = float(band.accelerometers_on)
        return air, lift, now.knot, self.fed, on, errors, navigation.start, navigation.theta_axes

    def _limits(self) -> Array:
        """Return the limits of the state in this phase, shape (2, 8); see `integrate_compiled`."""
        band, limits = self.bands[self.band], LIMITS.copy()
        if self.rising[0]:
            limits[1, 0] = band.top + ALTITUDE_HYSTERESIS
        else:
            limits[0, 0] = max(band.bottom - ALTITUDE_HYSTERESIS, EARTH_RADIUS)
        limits[1, self.fed + 1] = self.stretches[self.stretch].end
        for place, rising in self.rising.items():
            if rising:
                limits[0, place + 2] = -RATE_HYSTERESIS
            else:
                limits[1, place + 2] = RATE_HYSTERESIS
        if not self.rising[self.ending]:
            limits[0, self.ending] = max(limits[0, self.ending], self.end)
        return limits

    def fly_phase(self) -> tuple[FlownPhase, bool]:
        """Fly to the end of this phase: its steps, and whether the flight has ended. Raises `SampleFailed`."""
        limits, args = self._limits(), self._args()
        steps = integrate_compiled(advance_guided, (self.time, LONGEST_FLIGHT), self.state, TOLERANCES, limits, args)
        flown = FlownPhase(steps, args)
        crossed = _first_beyond(flown, self._within)
        flown = flown if crossed is None else crossed
        self.time, self.state = float(flown.steps.times[-1]), flown.steps.states[-1]
        return flown, self._turn_to_next(flown, limits, crossed is not None)

    def _turn_to_next(self, flown: FlownPhase, limits: Array, at_limit_of_lift: bool) -> bool:
        """Turn to the phase that follows; return whether the flight has ended."""
        if at_limit_of_lift:
            self.side = 0 if self.side else (1 if self._commands(self.state[None])[0] > 0.0 else -1)
            return False
        if flown.steps.status != LEFT:
            raise self.fail(Ending.ALOFT if flown.steps.status == REACHED else Ending.BROKEN)
        margins = np.array([self.state - limits[0], limits[1] - self.state])
        upper, component = divmod(int(np.argmin(margins)), 8)
        if not upper and component == self.ending and limits[0, component] == self.end:
            return True
        if component == 4:
            raise self.fail(Ending.CENTRE)
        if not upper and component == 0 and limits[0, 0] == EARTH_RADIUS:
            raise self.fail(Ending.GROUND)
        if component == 0:
            self.band += 1 if upper else -1
        elif component == self.fed + 1:
            self.stretch += 1
            self.side = self._side()
        else:
            self.rising[component - 2] = not self.rising[component - 2]
        return False


def _first_beyond(flown: FlownPhase, within: Callable[[Array], Array]) -> FlownPhase | None:
    """Cut steps where ``within``, of states (m, 8), becomes negative; nothing where it does not."""
    beyond = np.flatnonzero(within(flown.steps.states) < 0.0)
    if len(beyond) == 0:
        return None
    last = max(int(beyond[0]) - 1, 0)

    def margin(time: float) -> float:
        return float(within(flown.state(last, time)[None])[0])

    begin, end = flown.steps.times[last : last + 2]
    when = float(brentq(margin, begin, end, xtol=1e-12))
    times = np.append(flown.steps.times[: last + 1], when)
    states = np.concatenate([flown.steps.states[: last + 1], flown.state(last, when)[None]])
    return FlownPhase(Steps(LEFT, times, states), flown.args)


def largest_force(flight: list[FlownPhase]) -> float:
    """Compute the largest size of the specific force over a flight, m/s^2, also between the ends of steps."""
    forces = [phase.forces() for phase in flight]
    largest = most = max(float(force.max()) for force in forces)
    for phase, sizes in zip(flight, forces, strict=True):
        padded = np.pad(sizes, 1, constant_values=-np.inf)
        top = (sizes >= padded[:-2]) & (sizes >= padded[2:]) & (sizes >= NEAR_THE_PEAK * largest)
        for step in np.flatnonzero(top[:-1] | top[1:]):
            most = max(most, _largest_within(phase, int(step)))
    return most


def _largest_within(phase: FlownPhase, step: int) -> float:
    begin, end = phase.steps.times[step : step + 2]
    within = minimize_scalar(
        lambda time: -phase.force(phase.state(step, time)),
        bounds=(begin, end),
        method="bounded",
        options={"xatol": PEAK_TIME},
    )
    return -float(within.fun)


def fly_guided(navigation: GuidedNavigation, errors: Array) -> list[FlownPhase]:
    """Fly one sample from the start of navigation until its altitude, true or indicated, falls through the final one.

    Parameters
    ----------
    errors : ndarray, shape (sources,)
        In the order of `Error` and `GuidedError`, SI.

    Raises
    ------
    SampleFailed
        With the `Ending` of a flight that does not arrive.
    """
    flight, flown, ended = _Flight(navigation, errors), list[FlownPhase](), False
    while not ended:
        phase, ended = flight.fly_phase()
        flown.append(phase)
    return flown


def simulate_guided(navigation: GuidedNavigation, errors: Array) -> Array:
    """Simulate one sample: its outputs in the order of the description, shape (outputs,), SI.

    Raises `SampleFailed` with the `Ending` of a flight that does not arrive.
    """
    flown = fly_guided(navigation, errors)
    time, final = float(flown[-1].steps.times[-1]), flown[-1].steps.states[-1]
    actual = final[:4]
    deviations = append_errors(navigation.further, navigation_error(actual, final[4:]), actual)
    dispersion = (actual - navigation.nominal_final) * SCALE
    first = 0 if navigation.guidance.final == "indicated" else 1  # the true altitude ends the flight: none
    since_reentry = time - navigation.trajectory.reentry_time
    return np.concatenate([deviations, dispersion[first:], [since_reentry, largest_force(flown)]])


@dataclass(frozen=True)
class GuidedReferenceEngine:
    """The polar equations of the report, truth and navigator of one sample at a time."""

    navigation: GuidedNavigation
    outputs: int
    parallel: str = "processes"
    chunk: int = REFERENCE_CHUNK
    accuracy: str = "polar equations of NASA TN D-1772, truth and navigator together, DOP853 at 1e-12"
    epochs: Epochs | None = None
    noisy: bool = False
    filter: FilterSchema | None = None

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        """Simulate samples."""
        errors = batch.errors
        values = np.empty((len(errors), self.outputs))
        failures = simulate_each(lambda row: simulate_guided(self.navigation, errors[row]), range(len(errors)), values)
        return SimulationResult(values, failures)
