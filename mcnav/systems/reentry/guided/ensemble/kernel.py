"""The ensemble kernel of the guided reentry: each sample with its own truth, navigator and steps.

Truth and navigator of a sample are integrated together by Taylor series of order `ORDER`, to rounding: the force and
the lift law of each sample have kinks at instants of its own, at which its steps end (`steps`), so that no kink costs
accuracy. `PART` samples are in the lanes of a register; each has its own time and length of a step, and where one
ends, the next sample takes its lane. What a sample does therefore does not depend on its neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.compiled.jit import allocation_free, allocation_free_part
from mcnav.compiled.shapes import check_shape
from mcnav.compiled.vectors import PART, room_of_parts
from mcnav.physics.constants import EARTH_RADIUS
from mcnav.systems.reentry.guided.description import Ending, GuidedNavigation, start_states
from mcnav.systems.reentry.guided.ensemble.series import (
    CONSTANTS,
    COSINE,
    INDICATED,
    ORDER,
    ROWS,
    SINE,
    VX,
    VY,
    X,
    Y,
    extend,
)
from mcnav.systems.reentry.guided.ensemble.steps import (
    BAND,
    CLOCKS,
    ENDING,
    EVENT,
    FLYING,
    IDLE,
    KNOT,
    LENGTH,
    MODES,
    MOST_STEPS,
    PEAK,
    POINTS,
    REGIME,
    RISING,
    RISING_INDICATED,
    SAMPLE,
    STEPS,
    TIME,
    TURNS_INDICATED,
    TURNS_TRUE,
    WATCHED,
    advance,
    find_peaks,
    first_event,
    set_lengths,
    set_lift,
    turn_over,
    watch,
)
from mcnav.systems.reentry.guided.ensemble.tables import Flags, Tables, tables_of
from mcnav.systems.reentry.instruments import Error

SOURCES: Final = 19
NUMBERS: Final = 12
"""Numbers of a flight at an instant: X, Y and their rates, true and indicated; whole turns of each; time; f^2 peak."""


@allocation_free_part
def _begin(
    lane: int, row: int, start: Array, errors: Array, series: Array, constants: Array, clocks: Array, own: Array,
    modes: Flags, tables: Tables,
) -> None:  # fmt: skip
    """Put a sample into a lane: its state at the start, shape (10,), and the band and regime that hold it."""
    for source in range(SOURCES):
        own[source, lane] = errors[row, source]
    for of in (0, INDICATED):
        begin = 0 if of == 0 else 4
        series[of + X, 0, lane], series[of + Y, 0, lane] = start[row, begin], start[row, begin + 1]
        series[of + VX, 0, lane], series[of + VY, 0, lane] = start[row, begin + 2], start[row, begin + 3]
    modes[TURNS_TRUE, lane], modes[TURNS_INDICATED, lane] = int(start[row, 8]), int(start[row, 9])
    modes[SAMPLE, lane], modes[STEPS, lane], modes[ENDING, lane] = row, 0, FLYING
    clocks[TIME, lane] = clocks[PEAK, lane] = 0.0
    series[COSINE, 0, lane] = np.cos(errors[row, Error.MISALIGNMENT])
    series[SINE, 0, lane] = np.sin(errors[row, Error.MISALIGNMENT])
    radius = np.hypot(start[row, 0], start[row, 1])
    band = 0
    while radius >= tables.tops[band]:
        band += 1
    modes[BAND, lane] = band
    indicated_radius = np.hypot(start[row, 4], start[row, 5])
    rate = (start[row, 0] * start[row, 2] + start[row, 1] * start[row, 3]) / radius
    indicated_rate = (start[row, 4] * start[row, 6] + start[row, 5] * start[row, 7]) / indicated_radius
    modes[RISING, lane] = 1 if rate > 0.0 else -1
    modes[RISING_INDICATED, lane] = 1 if indicated_rate > 0.0 else -1
    # regime of the lift law; before the first knot the command does not depend on the state
    modes[REGIME, lane], modes[KNOT, lane] = 0, -1
    input_rate = indicated_rate if tables.input_indicated else rate
    if tables.law == 1:
        command = tables.gain * input_rate
        modes[REGIME, lane] = 1 if command > tables.limit else (-1 if command < -tables.limit else 0)
    set_lift(constants, own, modes, lane, tables)
    final = indicated_radius if tables.final_indicated else radius
    if not np.isfinite(radius + indicated_radius):
        modes[ENDING, lane] = Ending.BROKEN
    elif final <= tables.final_radius:
        modes[ENDING, lane] = Ending.STARTS_BELOW
    elif tables.final_indicated and radius <= EARTH_RADIUS:
        modes[ENDING, lane] = Ending.GROUND


@allocation_free_part
def _note(lane: int, series: Array, clocks: Array, modes: Flags, numbers: Array) -> None:
    """Write the numbers of a flight."""
    for of in (0, INDICATED):
        begin = 0 if of == 0 else 4
        numbers[begin], numbers[begin + 1] = series[of + X, 0, lane], series[of + Y, 0, lane]
        numbers[begin + 2], numbers[begin + 3] = series[of + VX, 0, lane], series[of + VY, 0, lane]
    numbers[8], numbers[9] = float(modes[TURNS_TRUE, lane]), float(modes[TURNS_INDICATED, lane])
    numbers[10], numbers[11] = clocks[TIME, lane], clocks[PEAK, lane]


@allocation_free
def _simulate(
    start: Array, errors: Array, tables: Tables, epochs: Array, series: Array, constants: Array, clocks: Array,
    own: Array, seen: Array, modes: Flags, next_epoch: Flags, numbers: Array, endings: Flags, steps: Array,
) -> int:  # fmt: skip
    """Fly samples: the numbers of each at the epochs and at its end, shape (n, epochs + 1, NUMBERS), and its ending.

    Of the first sample, the numbers and modes at the begins of its steps are written as well, as many as there is
    room for in ``steps``, shape (m, NUMBERS + MODES); returns how many.
    """
    count, last, given, noted = errors.shape[0], epochs.shape[0], 0, 0
    for lane in range(PART):
        modes[ENDING, lane] = IDLE
    while True:
        busy = 0
        for lane in range(PART):
            # a flight that has ended makes room for the next sample
            while modes[ENDING, lane] != FLYING:
                if modes[ENDING, lane] != IDLE:
                    row = modes[SAMPLE, lane]
                    endings[row] = modes[ENDING, lane]
                    for epoch in range(next_epoch[lane], last + 1):
                        _note(lane, series, clocks, modes, numbers[row, epoch])
                    modes[ENDING, lane] = IDLE
                if given == count:
                    break
                _begin(lane, given, start, errors, series, constants, clocks, own, modes, tables)
                next_epoch[lane] = 0
                given += 1
            busy += modes[ENDING, lane] == FLYING
            # an epoch ends a step
            stop = np.inf
            while next_epoch[lane] < last and modes[ENDING, lane] == FLYING:
                stop = epochs[next_epoch[lane]]
                if stop > clocks[TIME, lane]:
                    break
                _note(lane, series, clocks, modes, numbers[modes[SAMPLE, lane], next_epoch[lane]])
                next_epoch[lane] += 1
                stop = np.inf
            clocks[LENGTH, lane] = stop
        if busy == 0:
            return noted
        extend(series, constants, own, modes, tables)
        set_lengths(series, own, clocks, modes, tables)
        watch(series, clocks, seen, tables)
        for lane in range(PART):
            if modes[ENDING, lane] == FLYING:
                event, clocks[LENGTH, lane] = first_event(series, clocks, modes, seen, lane, tables)
                modes[EVENT, lane] = event
                if modes[SAMPLE, lane] == 0 and noted < steps.shape[0]:
                    _note(lane, series, clocks, modes, steps[noted])
                    for mode in range(MODES):
                        steps[noted, NUMBERS + mode] = float(modes[mode, lane])
                    noted += 1
        find_peaks(series, clocks, modes, seen)
        advance(series, clocks, modes)
        for lane in range(PART):
            if modes[ENDING, lane] == FLYING:
                turn_over(series, constants, clocks, own, modes, lane, modes[EVENT, lane], tables)


@dataclass(frozen=True)
class Flights:
    """Flights of samples at instants.

    Attributes
    ----------
    actual, indicated : ndarray, shape (n, m, 4)
        Polar states, the last at the sample's end; range angles from the zero of the trajectory.
    times : ndarray, shape (n, m)
        s from the start of navigation.
    peaks : ndarray, shape (n, m)
        Largest specific force so far, m/s^2.
    endings : ndarray, shape (n,)
        See `Ending`.
    """

    actual: Array
    indicated: Array
    times: Array
    peaks: Array
    endings: NDArray[np.int64]


def _to_cartesian(polar: Array, theta_axes: float) -> tuple[Array, Array]:
    """Convert polar states, shape (n, 4), to X, Y and their rates, and whole turns, shape (n,)."""
    radius, angle, radius_rate, angle_rate = polar.T
    angle = angle - theta_axes
    sine, cosine, across = np.sin(angle), np.cos(angle), radius * angle_rate
    x, y = radius * sine, radius * cosine
    states = np.stack([x, y, radius_rate * sine + across * cosine, radius_rate * cosine - across * sine], axis=1)
    return states, np.rint((angle - np.arctan2(x, y)) / (2.0 * np.pi))


def _to_polar(states: Array, turns: Array, theta_axes: float) -> Array:
    """Convert X, Y and their rates, shape (..., 4), to polar states."""
    x, y, rate_x, rate_y = np.moveaxis(states, -1, 0)
    radius = np.hypot(x, y)
    angle = np.arctan2(x, y) + 2.0 * np.pi * turns + theta_axes
    return np.stack(
        [radius, angle, (x * rate_x + y * rate_y) / radius, (y * rate_x - x * rate_y) / (radius * radius)], axis=-1
    )


def _simulate_all(navigation: GuidedNavigation, errors: Array, epochs: Array, room: int) -> tuple[Flights, Array]:
    """Fly samples; return the rows of the first one's steps, shape (steps, NUMBERS + MODES), too."""
    errors = np.ascontiguousarray(errors, dtype=float)
    check_shape("errors", errors, (None, SOURCES))
    true, indicated = start_states(navigation, errors)
    with np.errstate(all="ignore"):
        (first, turns), (second, further) = (_to_cartesian(each, navigation.theta_axes) for each in (true, indicated))
    start = np.concatenate([first, second, turns[:, None], further[:, None]], axis=1)
    numbers, endings = np.zeros((len(errors), len(epochs) + 1, NUMBERS)), np.zeros(len(errors), dtype=np.int64)
    series = room_of_parts(ROWS, ORDER + 2)
    for of in (0, INDICATED):  # of lanes that never have a sample
        series[of + Y, 0], series[of + VX, 0] = 2.0 * EARTH_RADIUS, 1e3
    modes, next_epoch = np.zeros((MODES, PART), dtype=np.int64), np.zeros(PART, dtype=np.int64)
    steps = np.zeros((room, NUMBERS + MODES))
    count = _simulate(
        start, errors, tables_of(navigation), np.ascontiguousarray(epochs, dtype=float), series,
        room_of_parts(CONSTANTS), room_of_parts(CLOCKS), room_of_parts(SOURCES), room_of_parts(WATCHED, POINTS + 1),
        modes, next_epoch, numbers, endings, steps,
    )  # fmt: skip
    return _flights(numbers, endings, navigation.theta_axes), steps[:count]


def _flights(numbers: Array, endings: NDArray[np.int64], theta_axes: float) -> Flights:
    """Return flights from their numbers, shape (n, m, NUMBERS)."""
    actual = _to_polar(numbers[..., 0:4], numbers[..., 8], theta_axes)
    indicated = _to_polar(numbers[..., 4:8], numbers[..., 9], theta_axes)
    return Flights(actual, indicated, numbers[..., 10], np.sqrt(numbers[..., 11]), endings)


def simulate_flights(navigation: GuidedNavigation, errors: Array, epochs: Array | None = None) -> Flights:
    """Fly samples from the start of navigation to their ends.

    Parameters
    ----------
    errors : ndarray, shape (n, sources)
        In the order of `GuidedError`.
    epochs : ndarray, shape (m,), optional
        Rising, s from the start of navigation; a sample that has ended stays at its end.
    """
    return _simulate_all(navigation, errors, np.zeros(0) if epochs is None else epochs, 0)[0]


@dataclass(frozen=True)
class Steps:
    """One flight by the begins of its steps, and its end.

    Attributes
    ----------
    flight : Flights
        Of shape (1, m + 1): at the begins of m steps, and at the end.
    modes : ndarray of int, shape (MODES, m)
        In each step; see `mcnav.systems.reentry.guided.ensemble.steps`.
    """

    flight: Flights
    modes: Flags


def simulate_steps(navigation: GuidedNavigation, errors: Array) -> Steps:
    """Fly one sample, shape (sources,)."""
    flights, rows = _simulate_all(navigation, errors[None], np.zeros(0), MOST_STEPS)
    before = _flights(rows[None, :, :NUMBERS], flights.endings, navigation.theta_axes)
    joined = Flights(
        np.concatenate([before.actual, flights.actual], axis=1),
        np.concatenate([before.indicated, flights.indicated], axis=1),
        np.concatenate([before.times, flights.times], axis=1),
        np.concatenate([before.peaks, flights.peaks], axis=1),
        flights.endings,
    )
    return Steps(joined, rows[:, NUMBERS:].T.astype(np.int64))
