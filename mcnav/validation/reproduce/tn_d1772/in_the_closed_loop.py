"""Effect of navigation errors on the landing point: the report's lift law, fed by the truth and by the navigator.

The report feeds its variable lift, L/D = -k r', with the true altitude rate, and asks how wrong the navigator is. Fed
with the indicated one the same vehicle closes the loop, and the errors move it. Errors are the report's ten, linear and
as samples; of the air and of the vehicle, for comparison, density by 5 %, drag and L/D by 3 %.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import pandas as pd

from mcnav.arrays.types import Array
from mcnav.contract.samples import Batch
from mcnav.physics.constants import REENTRY_ALTITUDE
from mcnav.systems.reentry.guided.description import Guidance, GuidedError, Whose
from mcnav.systems.reentry.guided.following import Following
from mcnav.systems.reentry.guided.scenario import GuidedReentry
from mcnav.systems.reentry.scenario import Flight
from mcnav.systems.reentry.table_i import ALL_ERRORS, TABLE_I, start_state
from mcnav.systems.reentry.vehicle import Vehicle
from mcnav.validation.reproduce.tn_d1772.in_three_dimensions import (
    KILOMETRE,
    SAMPLES,
    SEED,
    TIME,
    of_samples,
)

GUIDED: Final = 2
"""Trajectory with the report's variable lift that stays in the atmosphere."""

SKIPPING: Final = (4, 6)
"""Those that leave it again."""

RESULTS: Final = {"altitude error": "altitude", "range error": "range", "landing point": "true_range"}
"""Quantities that are compared, with the names of outputs."""

FED: Final[tuple[Whose, ...]] = ("true", "indicated")

START_MINUTES: Final = (-np.inf, -31.0, -24.0, -21.7, -10.0, -8.0, 0.0)
"""Starts at which samples are simulated, min from reentry: the first point, and the best and worst ones."""

CURVE_POINTS: Final = 64
OFF_MINUTES: Final = np.array([-63.0, -50.0, -40.0, -30.0, -25.0, -20.0, -15.0, -10.0, -5.0, 0.0])
"""Starts at which the sigmas with accelerometers off are computed."""

SITE: Final = 4
"""Trajectory that a law which follows the nominal flight takes to its landing site."""

SITE_START: Final = -21.7
SITE_LIMIT: Final = 0.8
"""Start of navigation, min from reentry, and largest L/D; the nominal flight needs 0.5."""

SHARES: Final = (0.03, 0.1, 1.0)
"""Shares of the report's errors with which it is flown; the first is in the table."""

OF_NAVIGATION: Final = np.append(ALL_ERRORS, np.zeros(7))
OF_THE_AIR: Final = np.zeros(len(OF_NAVIGATION))
OF_THE_AIR[[GuidedError.DENSITY, GuidedError.LIFT_TO_DRAG, GuidedError.DRAG]] = 0.05, 0.03, 0.03
"""Sigmas of the sources, SI."""


@dataclass(frozen=True)
class LoopComparison:
    """One result by linear analysis and by samples, km.

    Attributes
    ----------
    part, case, fed, result : str
        Claim, case, whose altitude rate the lift law is fed with, and which of `RESULTS`.
    linear, simulated, low, high : float
        Sigma, and root mean square of samples about what a flight without errors has, with its interval.
    departure : float
        Share by which the samples' root mean square departs from that of their linear outcomes; NaN of zero.
    correlation : float
        Of the samples' result with their final altitude-rate error; NaN of zero.
    """

    part: str
    case: str
    fed: str
    result: str
    linear: float
    simulated: float
    low: float
    high: float
    departure: float
    correlation: float


@lru_cache
def guided(fed: Whose, minutes: float = -np.inf, off: bool = False, number: int = GUIDED) -> GuidedReentry:
    """Return a trajectory of Table I, its lift law fed with an altitude rate, navigation started at a time, min."""
    row, start = TABLE_I[number], None if np.isinf(minutes) else 60.0 * minutes
    switched = REENTRY_ALTITUDE if off else None
    flight = Flight(
        start_state(number), Vehicle(row.lift_law), row.final_altitude, start, accelerometers_off_above=switched
    )
    return GuidedReentry(flight, Guidance(fed, "true", "truth"))


@lru_cache
def to_site(fed: Whose) -> GuidedReentry:
    """Return `SITE` by a law that follows its nominal flight."""
    row = TABLE_I[SITE]
    flight = Flight(start_state(SITE), Vehicle(row.lift_law), row.final_altitude, 60.0 * SITE_START)
    return GuidedReentry(flight, Guidance(fed, "true", "truth"), Following(SITE_LIMIT))


def draws(sigmas: Array) -> Array:
    """Draw samples of errors, the same for all cases, shape (SAMPLES, sources)."""
    return np.asarray(np.random.default_rng(SEED).standard_normal((SAMPLES, len(sigmas))) * sigmas)


def _compare(part: str, case: str, fed: Whose, scenario: GuidedReentry, sigmas: Array) -> Iterator[LoopComparison]:
    """Compare the results of a case."""
    errors, model = draws(sigmas), scenario.linear().end
    simulated = scenario.engine("ensemble", errors[:64]).simulate(Batch(np.arange(SAMPLES), errors, SEED))
    if simulated.failures:
        raise ArithmeticError(f"{case}: {len(simulated.failures)} samples failed")
    names = [output.name for output in scenario.outputs]
    values, outcomes = simulated.values - model.nominal, errors @ model.partials.T
    rate = values[:, names.index("altitude_rate")]
    for result, name in RESULTS.items():
        at = names.index(name)
        linear = float(np.sqrt(((model.partials[at] * sigmas) ** 2).sum()) / KILOMETRE)
        if linear < UNMOVED:
            yield LoopComparison(part, case, fed, result, 0.0, 0.0, 0.0, 0.0, np.nan, np.nan)
            continue
        correlation = float(np.corrcoef(values[:, at], rate)[0, 1]) if rate.std() > 0.0 else np.nan
        yield LoopComparison(part, case, fed, result, linear, *of_samples(values[:, at], outcomes[:, at]), correlation)


UNMOVED: Final = 1e-6
"""A result of so few kilometres is none: the integration's rounding."""


@lru_cache
def loop_comparisons() -> tuple[LoopComparison, ...]:
    """Compute all comparisons."""
    found: list[LoopComparison] = []
    for minutes in START_MINUTES:
        for fed in FED:
            scenario = guided(fed, minutes)
            start = scenario.navigation.start - scenario.navigation.trajectory.reentry_time
            found += _compare("start", f"start at {start / 60.0:.1f} min", fed, scenario, OF_NAVIGATION)
    for minutes, words in ((-np.inf, "-63.3"), (-24.0, "-24.0")):
        for fed in FED:
            case = f"start at {words} min, accelerometers off"
            found += _compare("switching", case, fed, guided(fed, minutes, off=True), OF_NAVIGATION)
    for fed in FED:
        found += _compare("air", "density 5 %, drag and L/D 3 %", fed, guided(fed), OF_THE_AIR)
    for fed in FED:
        case = f"trajectory {SITE} to its site, {SHARES[0]:g} of the errors"
        found += _compare("site", case, fed, to_site(fed), SHARES[0] * OF_NAVIGATION)
    return tuple(found)


@lru_cache
def figure_15() -> pd.DataFrame:
    """Compute the sigma of landing point and navigation errors against start time, linear and of samples, km."""
    scenario = guided("indicated")
    trajectory = scenario.navigation.trajectory
    times = np.linspace(-trajectory.reentry_time, 0.0, CURVE_POINTS)
    sigmas = _sigmas(scenario.partials_at(times, "start"), scenario)
    curves = [pd.DataFrame({TIME: times / 60.0} | sigmas).assign(curve="accelerometers on")]
    off = [guided("indicated", minutes, off=True).linear().end.partials for minutes in OFF_MINUTES]
    curves.append(
        pd.DataFrame({TIME: OFF_MINUTES} | _sigmas(np.array(off), scenario)).assign(curve="accelerometers off")
    )
    rows: dict[str, dict[str, float]] = {}
    for loop_comparison in loop_comparisons():
        if loop_comparison.part == "start" and loop_comparison.fed == "indicated":
            rows.setdefault(loop_comparison.case, {TIME: float(loop_comparison.case.split()[2])})[
                f"{loop_comparison.result} [km]"
            ] = loop_comparison.simulated
    curves.append(pd.DataFrame(list(rows.values())).assign(curve="samples"))
    return pd.concat(curves, ignore_index=True)


def _sigmas(partials: Array, scenario: GuidedReentry) -> dict[str, Array]:
    """Return the sigma of each result from partial derivatives, shape (n, outputs, sources), km."""
    names = [output.name for output in scenario.outputs]
    sigma = np.sqrt(((partials * OF_NAVIGATION) ** 2).sum(axis=2)) / KILOMETRE
    return {f"{result} [km]": sigma[:, names.index(name)] for result, name in RESULTS.items()}


def _landing_effects(scenario: GuidedReentry) -> Array:
    """Return what one sigma of each of the report's errors moves the landing point, shape (sources,), km."""
    names = [output.name for output in scenario.outputs]
    return np.asarray(scenario.linear().end.partials[names.index("true_range")] * OF_NAVIGATION / KILOMETRE)


@dataclass(frozen=True)
class Miss:
    """Distance from the landing site with a share of the report's errors, km: linear sigma, and of samples."""

    linear: float
    median: float
    ninth: float


def misses(share: float) -> Miss:
    """Compute how far from its site `SITE` lands: linear sigma, and distances that half and nine in ten keep within."""
    scenario, sigmas = to_site("indicated"), share * OF_NAVIGATION
    errors = draws(sigmas)
    simulated = scenario.engine("ensemble", errors[:64]).simulate(Batch(np.arange(SAMPLES), errors, SEED))
    at = [output.name for output in scenario.outputs].index("true_range")
    distances = np.abs(np.where(np.isnan(simulated.values[:, at]), np.inf, simulated.values[:, at])) / KILOMETRE
    linear = np.sqrt(((scenario.linear().end.partials[at] * sigmas) ** 2).sum()) / KILOMETRE
    return Miss(float(linear), float(np.median(distances)), float(np.quantile(distances, 0.9, method="higher")))


def causes(off: bool = False) -> dict[str, float]:
    """Return what one sigma of each of the report's errors moves the landing point, km, the largest first."""
    scenario = guided("indicated", off=off)
    effects = _landing_effects(scenario).tolist()
    named = {source.name: effect for source, effect in zip(scenario.sources, effects, strict=True)}
    return dict(sorted(named.items(), key=lambda item: -abs(item[1])))


def linear_sigma(number: int) -> float:
    """Return the linear sigma of the landing point of a trajectory, km."""
    return float(np.sqrt((_landing_effects(guided("indicated", number=number)) ** 2).sum()))
