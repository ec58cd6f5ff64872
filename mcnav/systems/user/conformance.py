"""Conformance checks of a scenario: ``mcnav check``."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine, without_noise
from mcnav.contract.linear import LinearModel
from mcnav.contract.members import lacks_engine, lacks_scenario
from mcnav.contract.samples import SimulationResult
from mcnav.contract.scenario import Scenario, ScenarioError, runs_user_code
from mcnav.physics.units import conversion
from mcnav.systems.finite_differences import differentiate
from mcnav.systems.guard import raised_by
from mcnav.systems.histories import check_history
from mcnav.systems.sample_loop import format_exception
from mcnav.systems.user.noise_soundness import check_noise, check_without_noise, find_unsettled_noise
from mcnav.systems.user.scenario import is_users
from mcnav.systems.user.soundness import LARGEST, SAME, SEED, apart, same
from mcnav.systems.user.stochastic_engine import StochasticUserEngine
from mcnav.systems.user.stochastic_scenario import StochasticUserScenario, is_users_with_noise

TRIED: Final = 16
"""Samples that are simulated."""

AGREEMENT: Final = 1e-3
"""Share of a row's largest contribution, that of noise included, within which partial derivatives must agree with
differences."""

SMALL, SMALLER = 0.1, 0.01
"""Shares of sigma at which departures from linear are compared: ten times smaller errors must bend ten times less. A
kink at zero bends as much at any size."""

CHANCE: Final = 5.0
"""Standard errors by which a measured sigma may differ from the stated one: by chance one in two million does. Where
they are few, `LARGEST` is more."""

LISTED: Final = 4
"""Outputs whose nominal values are listed."""

LEAST: Final = 1e-4
"""Departures below this share of an output's dispersion are numerical noise, of whatever size."""


@dataclass(frozen=True)
class Check:
    """One check: its name, whether the scenario passed, and what was found."""

    name: str
    passed: bool
    told: str


class _Broken(Exception):
    """Finding of a check that failed."""


def check_conformance(scenario: Scenario, sizes: Array, thorough: bool = True) -> list[Check]:
    """Check a scenario.

    Parameters
    ----------
    sizes : ndarray, shape (sources,)
        One sigma of each source, SI; the usual size where it is zero, as far as the check is thorough.
    thorough : bool
        Whether a system of this package is checked as code of the user's always is. Otherwise it flies the errors that
        it is given alone, on its coarsest steps: that it is deterministic, keeps samples apart and agrees with
        differences does not depend on a campaign.
    """
    if lines := lacks_scenario(scenario):
        return [Check("contract", False, line) for line in lines]
    thorough = thorough or runs_user_code(scenario)
    nominal = np.array([source.nominal if thorough else 0.0 for source in scenario.sources])
    sizes = np.where(np.asarray(sizes) > 0.0, sizes, nominal)
    errors = np.random.default_rng(SEED).standard_normal((TRIED, len(sizes))) * sizes
    # halved steps of an aided navigator would take longer than all flights here
    probes = errors if thorough or scenario.filter_schema is None else errors[:0]
    checks: list[Check] = []

    def tried(name: str, check: Callable[[], str]) -> None:
        try:
            checks.append(Check(name, True, check()))
        except (_Broken, ScenarioError) as wrong:
            checks.append(Check(name, False, str(wrong)))
        except Exception as wrong:  # the scenario is someone else's code: whatever it raises is a finding
            checks.append(Check(name, False, format_exception(wrong, "")))

    tried("names and units", lambda: _names_and_units(scenario))
    try:
        prepared = scenario.engine(scenario.engines[0], probes)
    except Exception as wrong:
        return [*checks, Check("flies", False, str(raised_by(wrong)) or type(wrong).__name__)]
    if lines := lacks_engine(prepared):
        return [*checks, *(Check("contract", False, line) for line in lines)]
    checks.append(Check("contract", True, f"scenario and engine {scenario.engines[0]} have what is asked of them"))
    # a copy, as code may return the same array each time
    fly = cache(lambda: deepcopy(without_noise(prepared)(errors)))
    tried("shapes", lambda: _shapes(scenario, fly, errors))
    if not all(check.passed for check in checks):
        return checks
    if thorough:
        tried("determinism", lambda: _determinism(prepared, errors, fly()))
        tried(
            "each sample for itself",
            lambda: _independence(prepared, errors, fly().values, _spread(scenario.linear().end, sizes)),
        )
        tried("travels to workers", lambda: _travels(prepared, errors, fly()))
    tried("linear near zero", lambda: _linear_near_zero(scenario, prepared, errors, fly().values, sizes))
    if thorough:
        tried("partials against differences", lambda: _partials(scenario, prepared, sizes))
    tried("nominal outputs", lambda: _nominal_outputs(scenario, scenario.linear().end, sizes))
    tried("history", lambda: _history(scenario))
    if is_users_with_noise(scenario) and isinstance(prepared, StochasticUserEngine):
        tried("noise from its generator", lambda: _noise(scenario, prepared, sizes))
        tried("linear in the noise", lambda: _linear_in_noise(scenario, prepared, sizes))
        tried("covariance of the noise", lambda: _noise_covariance(scenario))
    return checks


def _names_and_units(scenario: Scenario) -> str:
    for entries in (scenario.sources, scenario.outputs):
        names = [entry.name for entry in entries]
        if len(set(names)) < len(names):
            raise _Broken(f"a name stands twice in {', '.join(names)}")
        for entry in entries:
            conversion(entry.unit, entry.shown_in)
    return f"{len(scenario.sources)} sources, {len(scenario.outputs)} outputs"


def _shapes(scenario: Scenario, fly: Callable[[], SimulationResult], errors: Array) -> str:
    before = errors.copy()
    outcomes = fly()
    if not np.array_equal(errors, before):
        raise _Broken("propagate changed the errors that it was given")
    wanted = (len(errors), len(scenario.outputs))
    if outcomes.values.shape != wanted:
        raise _Broken(f"expected outcomes of shape {wanted}; got {outcomes.values.shape}")
    lost = set(np.flatnonzero(~np.isfinite(outcomes.values).all(axis=1)).tolist())
    if lost != set(outcomes.failures):
        raise _Broken(f"rows {sorted(lost ^ set(outcomes.failures))} failed without a reason, or did not fail with one")
    if len(lost) == len(errors):
        raise _Broken(f"every sample failed: {outcomes.failures[0]}")
    return f"{wanted}, {len(lost)} failed"


def _determinism(prepared: Engine, errors: Array, flown: SimulationResult) -> str:
    if not same(flown, without_noise(prepared)(errors)):
        raise _Broken("the same errors flown twice gave different bits; is something random, or kept in between?")
    return "the same bits twice"


def _spread(model: LinearModel, sizes: Array) -> Array:
    """Return the linear sigma of each output with errors of these sizes and its noise, shape (outputs,)."""
    variance = np.sum((model.partials * sizes) ** 2, axis=1)
    noise = sum((np.diag(process) for process in model.processes.values()), np.zeros(len(variance)))
    return np.asarray(np.sqrt(variance + np.maximum(noise, 0.0)))


def _independence(prepared: Engine, errors: Array, together: Array, spread: Array) -> str:
    alone = np.vstack([without_noise(prepared)(row[None, :]).values for row in errors[::-1]])[::-1]
    worst = apart(together, alone, spread)
    if worst > SAME:
        raise _Broken(f"a sample flown alone differs by {worst:.1e} from the same among others")
    return f"alone as among others, to {worst:.1e}"


def _travels(prepared: Engine, errors: Array, flown: SimulationResult) -> str:
    copy = pickle.loads(pickle.dumps(prepared))
    if not same(flown, without_noise(copy)(errors)):
        raise _Broken("what arrives in a worker flies other bits")
    return "the same bits"


def _differentiable(scenario: Scenario, model: LinearModel) -> NDArray[np.bool_]:
    """Return which outputs have a derivative, shape (outputs,); sizes of what is zero in the nominal have none."""
    sizes = np.array([bool(output.size_of) for output in scenario.outputs])
    return np.asarray(~(sizes & (model.nominal == 0.0) & ~model.partials.any(axis=1)))


def _linear_near_zero(scenario: Scenario, prepared: Engine, errors: Array, flown: Array, sizes: Array) -> str:
    model = scenario.linear().end
    whole = flown - model.nominal
    effect = np.maximum(np.sqrt(np.sum((model.partials * sizes) ** 2, axis=1)), np.nanmax(np.abs(whole), axis=0))
    spread = np.maximum(effect, _spread(model, sizes))
    least = np.where(spread**2 > 2.0 * effect**2, AGREEMENT, LEAST)  # where noise disperses it more, gains are as exact
    moving = np.flatnonzero((spread > 0.0) & _differentiable(scenario, model))
    if not len(moving):
        return "no output depends on any error"
    by_output = []
    for scale in (SMALL, SMALLER):
        result = without_noise(prepared)(np.vstack([np.zeros_like(errors[:1]), scale * errors]))
        if result.failures:
            raise _Broken(f"a flight with {scale:g} of the errors failed: {next(iter(result.failures.values()))}")
        departure = np.abs(result.values[1:] - result.values[0] - scale * errors @ model.partials.T)
        by_output.append((departure[:, moving] / (scale * spread[moving])).max(axis=0))
    shares = [float(shares_of_output.max()) for shares_of_output in by_output]
    large_most, small_most = (float((shares_of_output / least[moving]).max()) for shares_of_output in by_output)
    if small_most > max(0.3 * large_most, 1.0):
        worst = int(np.argmax(by_output[1] / least[moving]))
        large, small = (float(shares_of_output[worst]) for shares_of_output in by_output)
        raise _Broken(
            f"{scenario.outputs[moving[worst]].name}: errors of {SMALLER:g} sigma depart from linear by {small:.1e} of "
            f"their effect, errors of {SMALL:g} sigma by {large:.1e}: there is a kink or a jump at zero, or noise"
        )
    return f"departs by {shares[0]:.1e} at {SMALL:g} sigma, {shares[1]:.1e} at {SMALLER:g}"


def _partials(scenario: Scenario, prepared: Engine, sizes: Array) -> str:
    model = scenario.linear().end
    if is_users(scenario) and not scenario.own_partials and np.array_equal(scenario.sizes, sizes):
        differences = scenario.differences
    else:
        differences = differentiate(without_noise(prepared), sizes)
    contributions = np.abs(differences.model.partials * sizes).max(axis=1)
    contributions = np.maximum(contributions, _spread(replace(model, partials=np.zeros_like(model.partials)), sizes))
    scale = np.where(contributions > 0.0, contributions, 1.0)
    gaps = np.abs((model.partials - differences.model.partials) * sizes).max(axis=1) / scale
    gaps = np.where(_differentiable(scenario, model), gaps, 0.0)
    worst = int(np.argmax(gaps))
    gap = float(gaps[worst])
    if differences.error > AGREEMENT:
        raise _Broken(f"no steps of differences agree to better than {differences.error:.1e}")
    if gap > AGREEMENT:
        name = scenario.outputs[worst].name
        raise _Broken(
            f"{name}: partial derivatives differ from differences by {gap:.1e} of their row's largest contribution"
        )
    return f"agree to {max(gap, differences.error):.1e}"


def _nominal_outputs(scenario: Scenario, model: LinearModel, sizes: Array) -> str:
    """Name the outputs of a flight without errors that are not zero; no fault, but requirements count them."""
    spread = np.sqrt(np.sum((model.partials * sizes) ** 2, axis=1))
    named = [
        f"{output.name} {nominal / conversion(output.shown_in, output.unit):.4g} {output.shown_in}".rstrip()
        for output, nominal, sigma in zip(scenario.outputs, model.nominal, spread, strict=True)
        if abs(nominal) > LEAST * sigma
    ]
    if not named:
        return "zero without errors"
    listed = ", ".join(named[:LISTED]) + (f" and {len(named) - LISTED} more" if len(named) > LISTED else "")
    return f"not zero without errors: {listed}; requirements limit the outputs themselves, and count this too"


def _noise(scenario: StochasticUserScenario, prepared: StochasticUserEngine, sizes: Array) -> str:
    check_noise(prepared, sizes)
    check_without_noise(scenario)
    return "the same bits for the same noise, none without it"


def _linear_in_noise(scenario: StochasticUserScenario, prepared: StochasticUserEngine, sizes: Array) -> str:
    doubt = find_unsettled_noise(scenario, prepared, sizes > 0.0, 1.0)
    if doubt is not None:
        raise _Broken(str(doubt))
    return "fly_linear agrees with differences" if scenario.own_linear else "differences at two scales agree"


def _noise_covariance(scenario: StochasticUserScenario) -> str:
    measured = scenario.measured_noise
    if not scenario.gives_noise_covariance:
        return f"{measured}; noise_covariance of the class would give its processes rows in the budget"
    model = scenario.linear().end
    expected = np.diag(sum(model.processes.values(), np.zeros((len(model.nominal),) * 2)))
    simulated = np.diag(measured.covariance[-1])
    unknown = np.where(simulated > 0.0, np.inf, 1.0)
    ratios = np.sqrt(np.divide(simulated, expected, out=unknown, where=expected > 0.0))
    chance = max(LARGEST, CHANCE * measured.sigma_error)
    for output, ratio in zip(scenario.outputs, ratios, strict=True):
        if abs(ratio - 1.0) > chance:
            raise _Broken(f"sigma of {output.name} by linear simulations is {ratio:.2f} of that of noise_covariance")
    return f"sigmas of {measured.simulations:,} linear simulations are {ratios.min():.2f} to {ratios.max():.2f} of it"


def _history(scenario: Scenario) -> str:
    history = check_history(scenario.nominal())
    return f"{len(history.columns)} columns, {len(history.panels)} panels"
