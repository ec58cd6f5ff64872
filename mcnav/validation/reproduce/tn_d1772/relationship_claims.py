"""Conclusions of NASA TN D-1772 that it draws from trajectory 4, examined on all seven.

The report ends: "these error relationships should also exist for any realistic reentry trajectory". Every number in
these sentences is computed when they are written.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.physics.constants import EARTH_RADIUS, GRAVITATIONAL_PARAMETER
from mcnav.systems.reentry.instruments import Error
from mcnav.systems.reentry.table_i import ALL_ERRORS, ERRORS, TABLE_I
from mcnav.validation.reproduce.findings import Finding
from mcnav.validation.reproduce.tn_d1772.printed import NAMES
from mcnav.validation.reproduce.tn_d1772.starting import (
    ADVISED,
    COORDINATES,
    INITIAL,
    MEASURES,
    SHRUNK,
    TRACKED,
    Starts,
    combine,
    starts,
    sum_at,
    time_in_words,
)
from mcnav.validation.reproduce.tn_d1772.tables import in_words, linear_model, propagator, table_i_scenario

EXAMPLE: Final = 4
EQUIPMENT: Final = (Error.GYRO_DRIFT, Error.BIAS_X, Error.BIAS_Z)
"""The most significant equipment errors, in the report's words."""

QUIET: Final = 30.0
"""Minutes over which the report sees small errors."""

SHORTLY: Final = 3.0
"""Seconds before reentry at which the sums are stated as well: they still fall."""

JUST_BEFORE: Final = 10.0
"""Minutes before reentry that still count as just before it."""


def relationship_claims() -> list[Finding]:
    """Examine the report's general conclusions."""
    return [
        any_realistic_trajectory(),
        what_predominates_everywhere(),
        superposition(),
        ten_times_everywhere(),
        hundred_times(),
        same_order_of_magnitude(),
        worst_on_every_trajectory(),
        other_coordinates(),
        shrinking_altitude_error(),
        radio_tracking(),
        altitude_most_significant(),
        equipment_most_significant(),
        unstable_below_circular_speed(),
        first_thirty_minutes(),
    ]


def _ahead(minutes: Sequence[float]) -> str:
    """List start times as minutes before reentry."""
    return f"{in_words([f'{abs(start):g}' for start in minutes])} min before reentry"


def _best(computed: Starts, curve: Array) -> float:
    return float(computed.minutes[int(curve.argmin())])


def any_realistic_trajectory() -> Finding:
    """Compare the report's advice with the best start of each trajectory by its own measure."""
    curves = {number: starts(number).curve(COORDINATES[0], MEASURES[0]) for number in TABLE_I}
    best = {number: _best(starts(number), curve) for number, curve in curves.items()}
    at_reentry = [number for number in TABLE_I if best[number] == 0.0 and number != EXAMPLE]
    earlier = [number for number in TABLE_I if best[number] < ADVISED[0]]
    within = [number for number in TABLE_I if ADVISED[0] <= best[number] <= ADVISED[1]]
    sums = {
        "then": [f"{curves[number][-1]:.1f}" for number in at_reentry],
        "early": [f"{curves[number][starts(number).at(-22.0)]:.1f}" for number in at_reentry],
        "just before": [f"{sum_at(number, -SHORTLY):.1f}" for number in at_reentry],
    }
    return Finding(
        "These error relationships should also exist for any realistic reentry trajectory: start 20 to 30 minutes "
        "before reentry.",
        f"Trajectories {in_words(at_reentry)} are best started at reentry. The sum of absolute altitude errors is then "
        f"{in_words(sums['then'])} km, and with a start at −22 min {in_words(sums['early'])} km. It still falls in the "
        f"last seconds: {SHORTLY:g} s before reentry it is {in_words(sums['just before'])} km. Trajectory "
        f"{in_words(within)} is best started {_ahead([best[number] for number in within])}, trajectories "
        f"{in_words(earlier)} {_ahead([best[number] for number in earlier])}. On trajectory {EXAMPLE}, a start at "
        f"reentry ({curves[EXAMPLE][-1]:.1f} km) is no worse than one at −22 min "
        f"({curves[EXAMPLE][starts(EXAMPLE).at(-22.0)]:.1f} km).",
        "does not hold",
    )


def what_predominates_everywhere() -> Finding:
    """Compare initial conditions and equipment, for altitude, at the first start and at reentry of each trajectory."""
    early, late = [], []
    for number in TABLE_I:
        effects = np.abs(starts(number).effects)[[0, -1]]
        share = effects[:, :INITIAL].sum(axis=1) / effects.sum(axis=1)
        early.append(100.0 * float(share[0]))
        late.append(100.0 * float(share[1]))
    return Finding(
        "Started just before reentry, initial conditions predominate; started well before, equipment errors do.",
        "In final altitude this holds on all seven trajectories. Initial conditions make "
        f"{min(early):.0f} to {max(early):.0f} % of the sum of absolute errors with the first start, and "
        f"{min(late):.0f} to {max(late):.0f} % with a start at reentry.",
        "holds" if max(early) < 50.0 < min(late) else "in part",
    )


def _departures(number: int, multiple: float) -> Array:
    """Return the largest departures of runs with a multiple of one error, % of the largest effect, shape (4,)."""
    scenario, runs = table_i_scenario(number), multiple * np.diag(ERRORS)
    effects = runs @ linear_model(scenario).partials.T
    flown = propagator(scenario, "ensemble", runs)(runs).values
    return np.asarray(100.0 * np.abs(flown - effects).max(axis=0) / np.abs(effects).max(axis=0))


def ten_times_everywhere() -> Finding:
    """Fly ten times each error alone on every trajectory, and compare with the linear effects."""
    largest = np.array([_departures(number, 10.0) for number in TABLE_I])
    worst = ", ".join(f"{name} {share:.2g} %" for name, share in zip(NAMES, largest.max(axis=0), strict=True))
    example = ", ".join(f"{name} {share:.2g} %" for name, share in zip(NAMES, largest[EXAMPLE - 1], strict=True))
    return Finding(
        "With ten times the errors a linear analysis is still approximately right, on any of the seven trajectories.",
        f"With ten times one error, trajectory {EXAMPLE} departs by at most: {example}. On the worst of the seven: "
        f"{worst}. Shares are of the largest effect of the ten errors.",
        "holds" if largest.max() < 10.0 else "in part",
    )


def worst_on_every_trajectory() -> Finding:
    """Find the worst start for an altitude error alone on each trajectory, in both coordinates."""
    worst = {
        coordinates: [
            float(starts(n).minutes[np.abs(starts(n).effects_in(coordinates)[:, Error.ALTITUDE]).argmax()])
            for n in TABLE_I
        ]
        for coordinates in COORDINATES
    }
    polar, converted = (_ahead(worst[coordinates]) for coordinates in COORDINATES)
    early = [number for number, minutes in zip(TABLE_I, worst[COORDINATES[0]], strict=True) if minutes < -JUST_BEFORE]
    return Finding(
        "The worst possible time to start with an altitude error only is just before the atmosphere is reached.",
        f"Of starts up to reentry, the worst on trajectories 1 to 7 are {polar}. On trajectories {in_words(early)} "
        f"that is not just before the atmosphere. With speed and flight-path angle kept they are {converted}.",
        "in part",
    )


def other_coordinates() -> Finding:
    """Compare an altitude error with polar rates kept and with speed and flight-path angle kept."""
    shown = starts(EXAMPLE)
    polar, converted = (shown.effects_in(coordinates)[-1, Error.ALTITUDE] for coordinates in COORDINATES)
    best = [_best(shown, shown.curve(coordinates, MEASURES[1])) for coordinates in COORDINATES]
    return Finding(
        "Different coordinates give the same results, since errors that are uncorrelated in one set are correlated in "
        "the other. No one knows what the correlation will be.",
        "The transformation is right, but the answer depends on which errors are uncorrelated. An altitude error of 5 "
        f"km at reentry on trajectory {EXAMPLE} ends at {polar:.1f} km if the polar rates are kept. It ends at "
        f"{converted:.1f} km if speed and flight-path angle are kept. The best starts for independent errors are "
        f"{time_in_words(best[0])} and {time_in_words(best[1])}. Whoever gives the initial conditions must give their "
        "covariance matrix.",
        "in part",
    )


def _scaled(shares: Callable[[Starts], Array]) -> tuple[list[float], list[str]]:
    """Scale the initial errors by shares, shape (n, 4): best starts, and sums there and at −22 min."""
    best, words = [], []
    for number in TABLE_I:
        computed = starts(number)
        effects = computed.effects.copy()
        effects[:, :INITIAL] *= shares(computed)
        curve = combine(effects, MEASURES[0])
        best.append(_best(computed, curve))
        words.append(f"{curve.min():.1f} km, and {curve[computed.at(-22.0)]:.1f} km with a start at −22 min")
    return best, words


def shrinking_altitude_error() -> Finding:
    """Let the altitude error fall linearly from an hour before reentry to reentry."""

    def shares(computed: Starts) -> Array:
        share = np.interp(computed.minutes, [-60.0, 0.0], [1.0, SHRUNK])
        return np.column_stack([share, *[np.ones_like(share)] * (INITIAL - 1)])

    best, words = _scaled(shares)
    return Finding(
        "If the altitude error is several times smaller near reentry than an hour before, starting less than 20 "
        "minutes before reentry reduces final errors.",
        f"Let the altitude error fall linearly from 5 km to {5.0 * SHRUNK:.1f} km. The best starts of trajectories 1 "
        f"to 7 are then {_ahead(best)}. On trajectory {EXAMPLE} the sum of altitude errors is {words[EXAMPLE - 1]}.",
        "holds" if max(-minutes for minutes in best) < 20.0 else "in part",
    )


def radio_tracking() -> Finding:
    """Start with initial errors of a tenth."""
    best, words = _scaled(lambda computed: np.full((len(computed.minutes), INITIAL), TRACKED))
    return Finding(
        "Errors of radio tracking are roughly an order of magnitude smaller than the initial errors assumed.",
        "A statement about tracking cannot be recomputed; a tenth of the initial errors can. The best starts of "
        f"trajectories 1 to 7 are then {_ahead(best)}. On trajectory {EXAMPLE} the sum of altitude errors is "
        f"{words[EXAMPLE - 1]}. The advice to start early rests on the 5 km.",
        "not tested",
    )


def altitude_most_significant() -> Finding:
    """Compare the effects of the four initial errors on every output of every trajectory."""
    effects = np.array([np.abs(linear_model(table_i_scenario(n)).partials * ERRORS)[:, :INITIAL] for n in TABLE_I])
    exceptions: dict[tuple[str, str], list[int]] = {}
    for number, rows in zip(TABLE_I, effects, strict=True):
        for output, sizes in enumerate(rows):
            if sizes.argmax() != Error.ALTITUDE:
                larger = NAMES[output], NAMES[int(sizes.argmax())]
                exceptions.setdefault(larger, []).append(number)
    share = float((effects[:, :3, 0] / effects[:, :3].sum(axis=2)).min())
    others = " ".join(
        f"In {output} on trajectories {in_words(numbers)} the initial {larger} error has a larger effect."
        for (output, larger), numbers in exceptions.items()
    )
    return Finding(
        "Initial altitude error is the most significant initial condition error.",
        "In final altitude, range and altitude rate it is on all seven trajectories, with at least "
        f"{100 * share:.0f} % of the sum of the four effects. {others}".strip(),
        "in part" if exceptions else "holds",
    )


def equipment_most_significant() -> Finding:
    """Compare gyro drift and biases with the rest of the equipment errors."""
    effects = np.array([np.abs(linear_model(table_i_scenario(n)).partials * ERRORS)[:, INITIAL:] for n in TABLE_I])
    chief = effects[..., [error - INITIAL for error in EQUIPMENT]].sum(axis=2) / effects.sum(axis=2)
    number, output = np.unravel_index(int(chief.argmin()), chief.shape)
    return Finding(
        "Accelerometer bias and gyro drift are the most significant equipment errors.",
        f"They make {100 * chief.min():.0f} % or more of the sum of the six equipment effects, in every output of "
        f"every trajectory. The least is in {NAMES[int(output)]} on trajectory {number + 1}.",
        "holds" if chief.min() > 0.5 else "in part",
    )


def growth_rate(share: float) -> float:
    """Return the growth rate of the altitude error in level flight, in units of sqrt(mu / r^3).

    The navigator's linearized equations at a speed of ``share`` times the circular speed have the characteristic
    polynomial ``s^4 + (2 u - 1) s^2 - (u + 2) (1 - u)``, u = share^2 (see `mcnav.systems.steady.linearized`).

    >>> round(growth_rate(0.0) ** 2, 12), growth_rate(1.0)
    (2.0, 0.0)
    """
    u = share * share
    square = 0.5 * (1.0 - 2.0 * u + np.sqrt((2.0 * u - 1.0) ** 2 + 4.0 * (u + 2.0) * (1.0 - u)))
    return float(np.sqrt(max(square, 0.0)))


def unstable_below_circular_speed() -> Finding:
    """Compute the growth rate of level flight by speed, and when trajectories fall below circular speed."""
    radius = EARTH_RADIUS + 60e3
    minutes = [1.0 / (growth_rate(share) * np.sqrt(GRAVITATIONAL_PARAMETER / radius**3)) / 60.0 for share in (0.0, 0.9)]
    spent = []
    for number in TABLE_I:
        trajectory = table_i_scenario(number).trajectory
        times = np.linspace(trajectory.reentry_time, trajectory.final_time, 2_000)
        states = trajectory.states(times)
        below = (states[:, 0] * states[:, 3]) ** 2 < GRAVITATIONAL_PARAMETER / states[:, 0]
        spent.append(float(below.mean() * (times[-1] - times[0]) / 60.0))
    return Finding(
        "Below circular velocity the altitude error becomes unstable.",
        "True, and circular velocity is the limit exactly. In level flight the navigator's altitude error grows at "
        "every lower speed, and at circular speed and above it does not. It grows e-fold in "
        f"{minutes[0]:.1f} min at rest and in {minutes[1]:.0f} min at 90 % of circular speed. The seven trajectories "
        f"spend {in_words([f'{time:.0f}' for time in spent])} min below circular speed. The longest ones therefore "
        "suffer most.",
        "holds",
    )


def first_thirty_minutes() -> Finding:
    """Compare errors after thirty minutes with the final ones, all of the report's errors at once."""
    scenario = table_i_scenario(EXAMPLE)
    trajectory = scenario.trajectory
    times = np.array([60.0 * QUIET, trajectory.final_time]) - trajectory.reentry_time
    earlier, later = np.abs(scenario.error_histories(ALL_ERRORS[None, :], times)[2][:, 0])
    return Finding(
        "Errors change slowly and remain small for the first 30 minutes, and then change more rapidly.",
        f"After 30 minutes on trajectory {EXAMPLE}, with all errors at once, altitude is wrong by "
        f"{earlier[0] / 1e3:.1f} km and range by {earlier[1] / 1e3:.1f} km. At the end they are wrong by "
        f"{later[0] / 1e3:.1f} and {later[1] / 1e3:.1f} km. Altitude rate goes from {earlier[2]:.1f} to "
        f"{later[2]:.1f} m/s, range rate from {earlier[3]:.1f} to {later[3]:.1f} m/s.",
        "holds",
    )


def superposition() -> Finding:
    """Compare the sum of ten runs with the run that has all errors, and negated errors with their negatives."""
    apart, negated = np.zeros((2, len(TABLE_I), len(NAMES)))
    for place, number in enumerate(TABLE_I):
        runs = np.vstack([np.diag(ERRORS), ERRORS])
        propagate = propagator(table_i_scenario(number), "ensemble", runs)
        flown, reversed_runs = propagate(runs).values, propagate(-runs).values
        largest = np.abs(flown[:-1]).max(axis=0)
        apart[place] = 100.0 * np.abs(flown[:-1].sum(axis=0) - flown[-1]) / largest
        negated[place] = 100.0 * np.abs(flown + reversed_runs).max(axis=0) / largest
    sums, signs = (
        ", ".join(f"{name} {share:.2g} %" for name, share in zip(NAMES, shares.max(axis=0), strict=True))
        for shares in (apart, negated)
    )
    return Finding(
        "Final errors can be added up: run 11 is the sum of runs 1 to 10, and negative errors give the negatives.",
        f"On the worst of the seven trajectories the sum departs from run 11 by: {sums}. Negated errors depart from "
        f"the negatives by: {signs}. Shares are of the largest effect of the ten errors.",
        "holds" if max(apart.max(), negated.max()) < 5.0 else "in part",
    )


def hundred_times() -> Finding:
    """Fly a hundred times each error alone on trajectory 4, and compare with the linear effects."""
    departures = ", ".join(
        f"{name} {share:.0f} %" for name, share in zip(NAMES, _departures(EXAMPLE, 100.0), strict=True)
    )
    return Finding(
        "With a hundred times the errors a linear analysis is no longer valid.",
        f"With a hundred times one error, trajectory {EXAMPLE} departs by up to: {departures}. Shares are of the "
        "largest effect of the ten errors.",
        "holds",
    )


def same_order_of_magnitude() -> Finding:
    """Compare the sums of Table III with those of trajectory 4."""
    sums = np.array([np.abs(linear_model(table_i_scenario(n)).partials * ERRORS)[:2].sum(axis=1) for n in TABLE_I])
    altitude, distance = (sums / sums[EXAMPLE - 1]).T
    return Finding(
        f"Errors of trajectory {EXAMPLE} are of the order of magnitude of those of any other reasonable trajectory.",
        f"The sums of absolute errors are {altitude.min():.1f} to {altitude.max():.1f} times as large in altitude, and "
        f"{distance.min():.1f} to {distance.max():.1f} times in range.",
        "holds" if max(sums.max(axis=0) / sums[EXAMPLE - 1]) < 10.0 else "in part",
    )
