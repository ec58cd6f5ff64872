"""Claims of the report with the navigator in three dimensions: planar and spatial numbers, linear and simulated.

Both navigators get the same samples of the report's ten errors; the spatial one has errors across the plane as well.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np
import pandas as pd

from mcnav.arrays.products import transform, transformed_variances
from mcnav.arrays.types import Array
from mcnav.contract.engine import without_noise
from mcnav.physics.constants import REENTRY_ALTITUDE
from mcnav.statistics.mean_square import mean_square_intervals
from mcnav.systems.ins.imu.instruments import CONSTANTS, OUTPUTS
from mcnav.systems.ins.scenario import Ins
from mcnav.systems.reentry.instruments import Error
from mcnav.systems.reentry.scenario import Reentry
from mcnav.systems.reentry.table_i import ALL_ERRORS, COLUMNS, TABLE_I
from mcnav.validation.reproduce.tn_d1772.globe import (
    ACROSS,
    ACROSS_INITIAL,
    ALTITUDE,
    CROSSRANGE,
    RANGE,
    RESULTS,
    Globe,
    draw,
    simulate,
)
from mcnav.validation.reproduce.tn_d1772.tables import absolute_sums, table_i_scenario

EXAMPLE: Final = 4
SAMPLES: Final = 1_000
UPDATED_SAMPLES: Final = 400
PLANAR_PROBES: Final = 64
SEED: Final = 1772
CONFIDENCE: Final = 0.999
"""Confidence of each interval."""

KILOMETRE: Final = 1e3
START_MINUTES: Final = (-np.inf, -31.0, -21.7, -10.0, 0.0)
"""Starts at which samples are simulated, min from reentry: the first point, and the best ones by planar analysis."""

UPDATE_MINUTES: Final = (-60.0, -45.0, -30.0, -20.0, -10.0, -5.0)
CURVE_POINTS: Final = 33
UPDATE_POINTS: Final = np.arange(-60.0, 0.0, 4.0)


TIME: Final = "time from reentry [min]"


@dataclass(frozen=True)
class Comparison:
    """One final error by four computations, km; NaN where one does not apply.

    Attributes
    ----------
    part, case, result : str
        Claim, case, and which of `mcnav.validation.reproduce.tn_d1772.globe.RESULTS`.
    planar, planar_simulated : float
        By the planar navigator: linear, and of samples.
    linear, simulated, low, high : float
        By the navigator in three dimensions: linear, and of samples with the interval.
    departure : float
        Share by which the samples' root mean square departs from that of their linear outcomes.
    own : float
        Sigma that the filter states, by linear analysis.
    """

    part: str
    case: str
    result: str
    planar: float
    planar_simulated: float
    linear: float
    simulated: float
    low: float
    high: float
    departure: float = np.nan
    own: float = np.nan


@lru_cache
def example() -> Globe:
    """Lay trajectory 4 on the report's sphere."""
    return Globe.of(EXAMPLE)


def spread(errors: Array) -> tuple[float, float, float]:
    """Return the root mean square of errors, shape (n,), and its interval, km."""
    squares = (errors / KILOMETRE) ** 2
    count, mean, error = len(squares), squares.mean(), squares.std(ddof=1) / np.sqrt(len(squares))
    low, high = mean_square_intervals(mean, error, np.array(count), np.array(count), CONFIDENCE)
    return float(np.sqrt(mean)), float(np.sqrt(low)), float(np.sqrt(high))


def of_samples(values: Array, linear: Array) -> tuple[float, float, float, float]:
    """Return `spread` of samples and the share by which it departs from that of their linear outcomes."""
    return (*spread(values), float(np.sqrt((values**2).sum() / (linear**2).sum()) - 1.0))


def _sigmas(planar: Array, across: Array) -> Array:
    """Add effects, each shape (3, sources), to sigmas, km."""
    return np.asarray(np.sqrt((planar**2).sum(axis=1) + (across**2).sum(axis=1)) / KILOMETRE)


def _planar_sigmas(scenario: Reentry) -> Array:
    """Return the linear sigmas of altitude and range by the planar navigator, and none of crossrange, km."""
    effects = scenario.linear().end.partials[:2] * ALL_ERRORS
    return np.append(np.sqrt((effects**2).sum(axis=1)) / KILOMETRE, np.nan)


def _planar_spread(scenario: Reentry, planar: Array) -> list[float]:
    """Return the root mean square of samples by the planar navigator, km; none of crossrange."""
    planar_spread = (
        without_noise(scenario.engine("ensemble", planar[:PLANAR_PROBES]))(planar).values
        - scenario.linear().end.nominal
    )
    return [spread(planar_spread[:, result])[0] for result in (ALTITUDE, RANGE)] + [np.nan]


def start_comparisons() -> list[Comparison]:
    """Compare the dispersion of final errors for some starts."""
    globe, (planar, across), result = example(), draw(SAMPLES, SEED), []
    for minutes in START_MINUTES:
        time = globe.time(minutes)
        scenario = globe.navigation.started_at(time, "start")
        flat = table_i_scenario(EXAMPLE)
        flat = flat if np.isinf(minutes) else flat.started_at(60.0 * minutes, "start")
        linear = _sigmas(*globe.results(scenario.linear().end.partials, time))
        known, sampled = _planar_sigmas(flat), _planar_spread(flat, planar)
        values, outcomes = (each @ globe.to_results.T
                            for each in simulate(scenario, globe.errors(time, planar, across), SEED))  # fmt: skip
        case = f"start at {(time - globe.reentry) / 60.0:.1f} min"
        result += [
            Comparison("start", case, name, known[row], sampled[row], linear[row],
                       *of_samples(values[:, row], outcomes[:, row]))
            for row, name in enumerate(RESULTS)
        ]  # fmt: skip
    return result


def start_curves() -> pd.DataFrame:
    """Compute final errors of trajectory 4 against start time, by the planar navigator and in three dimensions, km."""
    globe = example()
    times = np.linspace(globe.navigation.navigation.start, globe.reentry, CURVE_POINTS)
    spatial = globe.navigation.partials_at(times)
    flat = table_i_scenario(EXAMPLE).partials_at(times - globe.reentry, "start")[:, :2] * ALL_ERRORS / KILOMETRE
    effects = [globe.results(partials, time) for partials, time in zip(spatial, times, strict=True)]
    sigmas = np.array([_sigmas(*effect) for effect in effects])
    conditions = np.array([np.sqrt((across[CROSSRANGE, :ACROSS_INITIAL] ** 2).sum()) for _, across in effects])
    sums = [absolute_sums(effect[0][ALTITUDE, COLUMNS] / KILOMETRE)["all"] for effect in effects]
    frame = {TIME: (times - globe.reentry) / 60.0}
    for row, name in enumerate(RESULTS[:2]):
        frame[f"{name}, planar [km]"] = np.sqrt((flat[:, row] ** 2).sum(axis=1))
        frame[f"{name} [km]"] = sigmas[:, row]
    frame["crossrange [km]"] = sigmas[:, CROSSRANGE]
    frame["crossrange by initial conditions [km]"] = conditions / KILOMETRE
    frame["altitude, sum of |all| [km]"] = np.array(sums, dtype=float)
    frame["position [km]"] = np.sqrt((sigmas**2).sum(axis=1))
    return pd.DataFrame(frame)


def switching_comparisons() -> list[Comparison]:
    """Compare the navigator whose accelerometers are off above the atmosphere with the one whose are on.

    Trajectory 4 stays in the atmosphere after reentry. In three dimensions the navigator coasts to reentry without
    accelerometers, and goes on from there with its errors and with the platform as it was; drag above is left out.
    """
    globe, (planar, across) = example(), draw(SAMPLES, SEED)
    alone = np.diag(ALL_ERRORS)[list(BIASES)]
    planar, across = np.vstack([planar, alone]), np.vstack([across, np.zeros((len(BIASES), len(ACROSS)))])
    errors = globe.errors(globe.navigation.navigation.start, planar, across)
    coasting = _until(globe.navigation, globe.reentry).linear().end.partials
    later = globe.navigation.started_at(globe.reentry, "trajectory").linear().end.partials
    on, off = globe.navigation.linear().end.partials, _joined(coasting, later)
    flat_off = table_i_scenario(EXAMPLE, accelerometers_off_above=REENTRY_ALTITUDE)
    return [
        *_switched("on", table_i_scenario(EXAMPLE), planar, on, errors, simulate(globe.navigation, errors, SEED)[0]),
        *_switched("off", flat_off, planar, off, errors, _coast(globe, errors)),
    ]


def _switched(
    words: str, flat: Reentry, planar: Array, partials: Array, errors: Array, flown: Array
) -> list[Comparison]:
    """Compare both navigators; the last samples, shape (n, planar errors), have one of `BIASES` each."""
    globe = example()
    effects, across = globe.results(partials, globe.navigation.navigation.start)
    model, values, outcomes = flat.linear().end, flown @ globe.to_results.T, errors @ (globe.to_results @ partials).T
    known = model.partials * ALL_ERRORS / KILOMETRE
    planar_values = without_noise(flat.engine("ensemble", planar[:PLANAR_PROBES]))(planar).values - model.nominal
    switched = [
        Comparison(
            "switching", f"{name} alone, accelerometers {words}", RESULTS[result], known[result, error],
            planar_values[row, result] / KILOMETRE, effects[result, error] / KILOMETRE,
            values[row, result] / KILOMETRE, np.nan, np.nan,
        )
        for row, (error, name) in enumerate(BIASES.items(), start=SAMPLES)
        for result in (ALTITUDE, RANGE)
    ]  # fmt: skip
    linear, sigmas = _sigmas(effects, across), _planar_sigmas(flat)
    sampled = [*(spread(planar_values[:SAMPLES, result])[0] for result in (ALTITUDE, RANGE)), np.nan]
    return switched + [
        Comparison("switching", f"all errors, accelerometers {words}", name, sigmas[row], sampled[row], linear[row],
                   *of_samples(values[:SAMPLES, row], outcomes[:SAMPLES, row]))
        for row, name in enumerate(RESULTS)
    ]  # fmt: skip


BIASES: Final = {Error.BIAS_X: "bias x", Error.BIAS_Z: "bias z"}
"""Errors of the accelerometers that the report names in its claim."""

ACCELEROMETERS: Final = [number for number, name in enumerate(CONSTANTS) if name.startswith("accelerometer")]


def _until(navigation: Ins, end: float) -> Ins:
    """Return a navigation that ends earlier."""
    return Ins(replace(navigation.navigation, end=end))


def _joined(coasting: Array, later: Array) -> Array:
    """Join partial derivatives of a navigation without accelerometers and of one that goes on with them."""
    silent = coasting.copy()
    silent[:, ACCELEROMETERS] = 0.0
    joined = later[:, : len(OUTPUTS)] @ silent
    joined[:, len(OUTPUTS) :] += later[:, len(OUTPUTS) :]
    return np.asarray(joined)


def _coast(globe: Globe, errors: Array) -> Array:
    """Simulate samples that coast to reentry without accelerometers, and navigate from there: shape (n, 9)."""
    silent = errors.copy()
    silent[:, ACCELEROMETERS] = 0.0
    middle, _ = simulate(_until(globe.navigation, globe.reentry), silent, SEED)
    rest = np.hstack([middle, errors[:, len(OUTPUTS) :]])
    return simulate(globe.navigation.started_at(globe.reentry, "trajectory"), rest, SEED)[0]


@dataclass(frozen=True)
class Crossing:
    """Coupling of crossrange to the motion in the plane, on one trajectory.

    Attributes
    ----------
    number : int
    by_conditions, by_gyros, by_accelerometer : float
        Final crossrange by initial conditions and alignment, by both gyros, and by the accelerometer, linear, km.
    mixed : float
        Largest effect of an error on the other side of the plane, as a share of the largest effect there.
    """

    number: int
    by_conditions: float
    by_gyros: float
    by_accelerometer: float
    mixed: float


@lru_cache
def crossing(number: int) -> tuple[Crossing, Comparison]:
    """Examine crossrange on a trajectory, navigated from its first point; samples have all errors."""
    globe = example() if number == EXAMPLE else Globe.of(number)
    start = globe.navigation.navigation.start
    planar, across = globe.results(globe.navigation.linear().end.partials, start)
    row = across[CROSSRANGE] / KILOMETRE
    gyros = slice(ACROSS_INITIAL, ACROSS_INITIAL + 2)
    parts = (row[:ACROSS_INITIAL], row[gyros], row[gyros.stop :])
    inside = np.abs(planar[: RANGE + 1]).max(axis=1)
    mixed = max(
        float(np.abs(planar[CROSSRANGE]).max() / np.abs(across[CROSSRANGE]).max()),
        float((np.abs(across[: RANGE + 1]).max(axis=1) / inside).max()),
    )
    by_conditions, by_gyros, by_accelerometer = (float(np.sqrt((each**2).sum())) for each in parts)
    errors = globe.errors(start, *draw(SAMPLES, SEED))
    values, outcomes = (each @ globe.to_results[CROSSRANGE] for each in simulate(globe.navigation, errors, SEED))
    linear = float(_sigmas(planar, across)[CROSSRANGE])
    compared = Comparison(
        "crossrange", f"trajectory {number}", "crossrange", np.nan, np.nan, linear, *of_samples(values, outcomes)
    )  # fmt: skip
    return Crossing(number, by_conditions, by_gyros, by_accelerometer, mixed), compared


def correlations(multiple: float) -> Array:
    """Return the correlations of crossrange with altitude and range, of samples of trajectory 4, shape (2,)."""
    globe = example()
    planar, across = draw(SAMPLES, SEED)
    errors = globe.errors(globe.navigation.navigation.start, multiple * planar, multiple * across)
    values = simulate(globe.navigation, errors, SEED)[0] @ globe.to_results.T
    return np.asarray(np.corrcoef(values.T))[CROSSRANGE, : RANGE + 1]


def crossrange_history() -> pd.DataFrame:
    """Compute the sigma of crossrange over the flight of trajectory 4, by initial conditions and by all errors, km."""
    globe = example()
    known = globe.navigation.linear_over_time(CURVE_POINTS)
    effects = known.partials[:, OUTPUTS.index("position_north")][:, [CONSTANTS.index(name) for name in ACROSS]]
    effects = effects * np.array(list(ACROSS.values())) / KILOMETRE
    return pd.DataFrame(
        {
            TIME: known.times - globe.reentry / 60.0,
            "crossrange by initial conditions [km]": np.sqrt((effects[:, :ACROSS_INITIAL] ** 2).sum(axis=1)),
            "crossrange [km]": np.sqrt((effects**2).sum(axis=1)),
        }
    )


def _updated_sigmas(scenario: Ins) -> tuple[Array, Array]:
    """Return the linear sigmas of an updated navigation, and those that its filter states, shape (3,) each, km."""
    globe, model = example(), scenario.linear().end
    prediction = scenario.filter_prediction()
    if prediction is None:
        raise ValueError("a navigation without aiding has no filter")
    partials = model.partials[:, : len(CONSTANTS)]
    constant = transform(partials, globe.covariance(scenario.navigation.start))
    covariance = np.asarray(sum(model.processes.values(), constant))
    true, own = (
        np.sqrt(transformed_variances(globe.to_results, each)) / KILOMETRE
        for each in (covariance, prediction.covariance[-1])
    )
    return true, own


def update_comparisons() -> list[Comparison]:
    """Compare a navigator that is updated once with the planar one that starts at that time, in the same axes."""
    globe, (planar, across), result = example(), draw(UPDATED_SAMPLES, SEED), []
    errors = globe.errors(globe.navigation.navigation.start, planar, across)
    cases = [(minutes, True) for minutes in UPDATE_MINUTES] + [(-30.0, False)]
    for minutes, stars in cases:
        scenario = globe.updated(globe.time(minutes), stars)
        linear, own = _updated_sigmas(scenario)
        flat = _planar_sigmas(table_i_scenario(EXAMPLE).started_at(60.0 * minutes, "trajectory"))
        values, outcomes = (each @ globe.to_results.T for each in simulate(scenario, errors, SEED))
        case = f"update at {minutes:.0f} min{'' if stars else ', no stars'}"
        result += [
            Comparison("update", case, name, flat[row], np.nan, linear[row],
                       *of_samples(values[:, row], outcomes[:, row]), own[row])
            for row, name in enumerate(RESULTS)
        ]  # fmt: skip
    return result


def update_curves() -> pd.DataFrame:
    """Compute final errors of trajectory 4 against the time of its only update, linear, km."""
    globe = example()
    sigmas = np.array([_updated_sigmas(globe.updated(globe.time(minutes)))[0] for minutes in UPDATE_POINTS])
    columns = {f"{name} [km]": sigmas[:, row] for row, name in enumerate(RESULTS)}
    return pd.DataFrame({TIME: UPDATE_POINTS} | columns)


@lru_cache
def comparisons() -> tuple[Comparison, ...]:
    """Compute all comparisons."""
    crossrange = [crossing(number)[1] for number in TABLE_I]
    return (*start_comparisons(), *switching_comparisons(), *crossrange, *update_comparisons())


@lru_cache
def figure_14() -> pd.DataFrame:
    """Compute final errors against the time of the start and of the only update, linear and of samples, km."""
    parts = {"start": start_curves(), "update": update_curves()}
    for part in ("start", "update"):
        rows: dict[str, dict[str, float]] = {}
        for comparison in comparisons():
            if comparison.part == part and not comparison.case.endswith("stars"):
                minutes = float(comparison.case.split()[2])
                rows.setdefault(comparison.case, {TIME: minutes})[f"{comparison.result} [km]"] = comparison.simulated
        parts[f"{part}, samples"] = pd.DataFrame(list(rows.values()))
    return pd.concat([frame.assign(curve=name) for name, frame in parts.items()], ignore_index=True)
