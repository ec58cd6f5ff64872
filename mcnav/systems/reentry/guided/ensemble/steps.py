"""Steps of a guided reentry: how long a series holds, where it must end, and what changes there.

Within a step the equations are smooth: one layer of the atmosphere, one side of the lift law's limit, one switch
position of the accelerometers. A step ends where the sample's own flight leaves them, at a root of its series, and
the next one begins there. The altitude turns at the end of a step, too, so that it only rises or only falls within
one.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import allocation_free_part
from mcnav.compiled.vectors import PART, Vector, load_part, store_part
from mcnav.physics.constants import EARTH_RADIUS
from mcnav.systems.reentry.guided.description import Ending, GuidedError
from mcnav.systems.reentry.guided.ensemble.series import (
    ANGLE,
    COMMAND,
    COSINE,
    FIXED,
    FX,
    FY,
    INDICATED,
    MOST_TURN,
    ORDER,
    RR,
    SHARE,
    SINE,
    TURNS,
    VX,
    VY,
    R,
    X,
    Y,
)
from mcnav.systems.reentry.guided.ensemble.tables import CONSTANT, FOLLOWING, Flags, Tables
from mcnav.systems.reentry.instruments import Error
from mcnav.systems.reentry.navigator import LOWEST_RADIUS

BAND, REGIME, RISING, TURNS_TRUE, TURNS_INDICATED, KNOT, RISING_INDICATED, ENDING, SAMPLE, STEPS, EVENT = range(11)
"""Rows of whole numbers of the lanes: band of the atmosphere; -1, 0 or 1 for L/D at minus the limit, within, at the
limit; 1 where the altitude rises, -1 where it falls; whole turns of the earth; interval of knots; the navigator's
rising; how the flight has ended; number of the sample; steps taken; event that ends the step."""
MODES: Final = 11

FLYING: Final = -1
IDLE: Final = -2
"""Entries of `ENDING` before the end, and of a lane without a sample."""

TIME, PEAK, LENGTH, BEFORE = range(4)
"""Rows of numbers of the lanes: s from the start of navigation; largest square of the specific force; step, s; X
before it."""
CLOCKS: Final = 4

SMALLEST_TERM: Final = 1e-16
"""Size of the last terms of a velocity's series at the end of a step, as a share of the velocity."""

POINTS: Final = 4
"""Points of a step, evenly spaced, between which a root is sought where a function's sign differs."""

WATCHED: Final = 8
"""Rows of values at the points: radius and its rate, true and indicated; command; range angle; half the rate of
f^2, and f^2."""

RESOLUTION: Final = 1e-15
"""Width of a root, as a share of its time since the begin of the step."""

MOST_TRIALS: Final = 100

MOST_STEPS: Final = 50_000
"""Steps after which a flight is given up."""

NONE, TURN, LEVEL, TURN_INDICATED, FINAL_INDICATED, ABOVE, BELOW, NEXT_KNOT, GIVEN_UP = range(9)
"""Events that end a step."""


@allocation_free_part
def value_at(series: Array, row: int, time: Vector) -> Vector:
    """Sum a series at a time since the begin of the step."""
    total = load_part(series, (row, ORDER))
    for n in range(ORDER - 1, -1, -1):
        total = total * time + load_part(series, (row, n))
    return total


@allocation_free_part
def value_of(series: Array, row: int, lane: int, time: float) -> float:
    """Sum the series of one lane."""
    total = 0.0
    for n in range(ORDER, -1, -1):
        total = total * time + series[row, n, lane]
    return total


@allocation_free_part
def rate_of(series: Array, row: int, lane: int, time: float) -> float:
    """Sum the derivative of the series of one lane."""
    total = 0.0
    for n in range(ORDER, 0, -1):
        total = total * time + n * series[row, n, lane]
    return total


@allocation_free_part
def root(series: Array, row: int, lane: int, level: float, begin: float, end: float) -> float:
    """Find where a series passes a level between two times, by Newton's method within bisection."""
    rising, time, resolution = value_of(series, row, lane, end) > level, 0.5 * (begin + end), RESOLUTION * end
    for _ in range(MOST_TRIALS):
        # value and derivative by nested sums, the derivative's taking the value's last one
        value, slope = series[row, ORDER, lane], 0.0
        for n in range(ORDER - 1, -1, -1):
            slope = slope * time + value
            value = value * time + series[row, n, lane]
        if (value > level) == rising:
            end = time
        else:
            begin = time
        better = time - (value - level) / slope if slope != 0.0 else begin
        if not begin <= better <= end:
            better = 0.5 * (begin + end)
        if abs(better - time) <= resolution:
            return better
        time = better
    return time


@allocation_free_part
def set_lengths(series: Array, errors: Array, clocks: Array, modes: Flags, tables: Tables) -> None:
    """Write the lengths for which the series hold (Jorba and Zou, Experimental Mathematics 14, 2005), s.

    At most to the time, s, that the lengths hold before.
    """
    for lane in range(PART):
        length = min(tables.longest, clocks[LENGTH, lane]) - clocks[TIME, lane]
        speed = abs(series[VX, 0, lane]) + abs(series[VY, 0, lane])
        indicated_speed = abs(series[INDICATED + VX, 0, lane]) + abs(series[INDICATED + VY, 0, lane])
        for n in (ORDER, ORDER + 1):
            share = (abs(series[VX, n, lane]) + abs(series[VY, n, lane])) / speed
            indicated_term = abs(series[INDICATED + VX, n, lane]) + abs(series[INDICATED + VY, n, lane])
            share = max(share, indicated_term / indicated_speed)
            if share > 0.0:
                length = min(length, (SMALLEST_TERM / share) ** (1.0 / n))
        drift = abs(errors[Error.GYRO_DRIFT, lane])
        if drift * length > MOST_TURN:
            length = MOST_TURN / drift
        clocks[LENGTH, lane] = length if modes[ENDING, lane] == FLYING else 0.0


@allocation_free_part
def watch(series: Array, clocks: Array, seen: Array, tables: Tables) -> None:
    """Write what decides on events at the points of a step, shape (WATCHED, POINTS, PART)."""
    length = load_part(clocks, (LENGTH,))
    for point in range(POINTS):
        time = ((point + 1.0) / POINTS) * length
        store_part(seen, (0, point), value_at(series, R, time))
        store_part(seen, (1, point), value_at(series, RR, time))
        if tables.final_indicated:
            store_part(seen, (2, point), value_at(series, INDICATED + R, time))
            store_part(seen, (3, point), value_at(series, INDICATED + RR, time))
        if tables.law != CONSTANT:
            store_part(seen, (4, point), value_at(series, COMMAND, time))
        if tables.law == FOLLOWING:
            store_part(seen, (5, point), value_at(series, ANGLE, time))


@allocation_free_part
def first_passage(
    series: Array, row: int, seen: Array, watched: int, lane: int, level: float, direction: float, end: float,
    length: float,
) -> float:  # fmt: skip
    """Find when a row first passes a level in a direction before ``end``, or infinity; it starts on the near side."""
    before = 0.0
    for point in range(POINTS):
        time = (point + 1.0) / POINTS * length
        if time > end:
            break
        if direction * (seen[watched, point, lane] - level) > 0.0:
            return root(series, row, lane, level, before, time)
        before = time
    if before < end and direction * (value_of(series, row, lane, end) - level) > 0.0:
        return root(series, row, lane, level, before, end)
    return np.inf


@allocation_free_part
def first_event(
    series: Array, clocks: Array, modes: Flags, seen: Array, lane: int, tables: Tables
) -> tuple[int, float]:
    """Find the first event of a lane within its step: which, and when, s since its begin."""
    length = clocks[LENGTH, lane]
    event, end = NONE, length
    # the altitude turns, or passes the bound of its band on the way
    rising = float(modes[RISING, lane])
    time = first_passage(series, RR, seen, 1, lane, 0.0, -rising, end, length)
    if time < end:
        event, end = TURN, time
    time = first_passage(series, R, seen, 0, lane, level_of(modes, lane, tables), rising, end, length)
    if time <= end:
        event, end = LEVEL, time
    if tables.final_indicated:
        rising = float(modes[RISING_INDICATED, lane])
        time = first_passage(series, INDICATED + RR, seen, 3, lane, 0.0, -rising, end, length)
        if time < end:
            event, end = TURN_INDICATED, time
        if rising < 0.0:
            time = first_passage(series, INDICATED + R, seen, 2, lane, tables.final_radius, -1.0, end, length)
            if time <= end:
                event, end = FINAL_INDICATED, time
    # L/D reaches its limit or leaves it
    if tables.law != CONSTANT:
        regime = modes[REGIME, lane]
        if regime < 1:
            level = tables.limit if regime == 0 else -tables.limit
            time = first_passage(series, COMMAND, seen, 4, lane, level, 1.0, end, length)
            if time < end:
                event, end = ABOVE, time
        if regime > -1:
            level = -tables.limit if regime == 0 else tables.limit
            time = first_passage(series, COMMAND, seen, 4, lane, level, -1.0, end, length)
            if time < end:
                event, end = BELOW, time
    if tables.law == FOLLOWING and modes[KNOT, lane] < len(tables.polynomials):
        number = modes[KNOT, lane]
        ahead = tables.knots[number + 1] - tables.knots[max(number, 0)]
        time = first_passage(series, ANGLE, seen, 5, lane, ahead, 1.0, end, length)
        if time < end:
            event, end = NEXT_KNOT, time
    return event, end


@allocation_free_part
def level_of(modes: Flags, lane: int, tables: Tables) -> float:
    """Return the radius at which a lane leaves its band of the atmosphere, or ends, m."""
    band = modes[BAND, lane]
    if modes[RISING, lane] > 0:
        return float(tables.tops[band])
    return float(max(tables.bottoms[band], EARTH_RADIUS if tables.final_indicated else tables.final_radius))


@allocation_free_part
def add_peak(series: Array, clocks: Array, lane: int, time: float) -> None:
    """Let the square of the specific force at a time count for its largest value."""
    along_x, along_y = value_of(series, FX, lane, time), value_of(series, FY, lane, time)
    clocks[PEAK, lane] = max(clocks[PEAK, lane], along_x * along_x + along_y * along_y)


@allocation_free_part
def growth_of_force(series: Array, lane: int, time: float) -> float:
    """Compute half the rate of f^2 of a lane."""
    return value_of(series, FX, lane, time) * rate_of(series, FX, lane, time) + value_of(
        series, FY, lane, time
    ) * rate_of(series, FY, lane, time)


@allocation_free_part
def find_peaks(series: Array, clocks: Array, modes: Flags, seen: Array) -> None:
    """Let the largest specific force of a step count: at its ends, and where the force stops growing within it."""
    length = load_part(clocks, (LENGTH,))
    for point in range(POINTS + 1):
        time = (point * (1.0 / POINTS)) * length
        x, y = load_part(series, (FX, ORDER)), load_part(series, (FY, ORDER))
        slope_x, slope_y = 0.0 * x, 0.0 * y
        for n in range(ORDER - 1, -1, -1):
            # the derivative's nested sum takes the value's last one
            slope_x, slope_y = slope_x * time + x, slope_y * time + y
            x, y = x * time + load_part(series, (FX, n)), y * time + load_part(series, (FY, n))
        store_part(seen, (6, point), x * slope_x + y * slope_y)
        store_part(seen, (7, point), x * x + y * y)
    for lane in range(PART):
        if modes[ENDING, lane] != FLYING:
            continue
        clocks[PEAK, lane] = max(clocks[PEAK, lane], seen[7, 0, lane], seen[7, POINTS, lane])
        for point in range(POINTS):
            if seen[6, point, lane] > 0.0 and seen[6, point + 1, lane] < 0.0:
                begin, end = point * clocks[LENGTH, lane] / POINTS, (point + 1.0) * clocks[LENGTH, lane] / POINTS
                for _ in range(60):
                    middle = 0.5 * (begin + end)
                    if growth_of_force(series, lane, middle) > 0.0:
                        begin = middle
                    else:
                        end = middle
                add_peak(series, clocks, lane, 0.5 * (begin + end))


@allocation_free_part
def advance(series: Array, clocks: Array, modes: Flags) -> None:
    """Move positions, velocities and the platform to the end of the step."""
    length = load_part(clocks, (LENGTH,))
    for of in (0, INDICATED):
        for lane in range(PART):
            clocks[BEFORE, lane] = series[of + X, 0, lane]
        x, y = value_at(series, of + X, length), value_at(series, of + Y, length)
        vx, vy = value_at(series, of + VX, length), value_at(series, of + VY, length)
        store_part(series, (of + X, 0), x)
        store_part(series, (of + Y, 0), y)
        store_part(series, (of + VX, 0), vx)
        store_part(series, (of + VY, 0), vy)
        # whole turns: X changes its sign below the earth's centre
        turns = TURNS_TRUE if of == 0 else TURNS_INDICATED
        for lane in range(PART):
            before, after = clocks[BEFORE, lane], series[of + X, 0, lane]
            if series[of + Y, 0, lane] < 0.0 and (before < 0.0) != (after < 0.0):
                modes[turns, lane] += 1 if before >= 0.0 else -1
    store_part(clocks, (TIME,), load_part(clocks, (TIME,)) + length)
    cosine, sine = load_part(series, (COSINE, TURNS - 1)), load_part(series, (SINE, TURNS - 1))
    for n in range(TURNS - 2, -1, -1):
        cosine = cosine * length + load_part(series, (COSINE, n))
        sine = sine * length + load_part(series, (SINE, n))
    store_part(series, (COSINE, 0), cosine)
    store_part(series, (SINE, 0), sine)


@allocation_free_part
def set_lift(constants: Array, errors: Array, modes: Flags, lane: int, tables: Tables) -> None:
    """Write how Lambda depends on the command: proportional within the limit, else constant."""
    factor, regime = 1.0 + errors[GuidedError.LIFT_TO_DRAG, lane], modes[REGIME, lane]
    constants[SHARE, lane] = factor if regime == 0 and tables.law != CONSTANT else 0.0
    constants[FIXED, lane] = 0.0 if regime == 0 else regime * factor * tables.limit
    if tables.law == CONSTANT:
        constants[FIXED, lane] = factor * tables.lift


@allocation_free_part
def turn_over(
    series: Array, constants: Array, clocks: Array, errors: Array, modes: Flags, lane: int, event: int, tables: Tables
) -> None:
    """Change what an event changes of a lane."""
    if event == TURN:
        modes[RISING, lane] = -modes[RISING, lane]
    elif event == TURN_INDICATED:
        modes[RISING_INDICATED, lane] = -modes[RISING_INDICATED, lane]
    elif event == LEVEL:
        band, falling = modes[BAND, lane], modes[RISING, lane] < 0
        lowest = EARTH_RADIUS if tables.final_indicated else tables.final_radius
        if falling and lowest >= tables.bottoms[band]:
            modes[ENDING, lane] = Ending.GROUND if tables.final_indicated else Ending.ARRIVED
        else:
            modes[BAND, lane] = band - 1 if falling else band + 1
    elif event == FINAL_INDICATED:
        modes[ENDING, lane] = Ending.ARRIVED
    elif event in (ABOVE, BELOW):
        modes[REGIME, lane] += 1 if event == ABOVE else -1
        set_lift(constants, errors, modes, lane, tables)
    elif event == NEXT_KNOT:
        modes[KNOT, lane] += 1
    modes[STEPS, lane] += 1
    if modes[ENDING, lane] != FLYING:
        return
    # the navigator near the earth's centre; not a number; out of time
    square = series[INDICATED + X, 0, lane] ** 2 + series[INDICATED + Y, 0, lane] ** 2
    both = square + series[X, 0, lane] ** 2 + series[Y, 0, lane] ** 2
    if square < LOWEST_RADIUS * LOWEST_RADIUS:
        modes[ENDING, lane] = Ending.CENTRE
    elif not np.isfinite(both) or modes[STEPS, lane] > MOST_STEPS:
        modes[ENDING, lane] = Ending.BROKEN
    elif clocks[TIME, lane] >= tables.longest:
        modes[ENDING, lane] = Ending.ALOFT
