"""Checks of a user-defined scenario's noise before samples are simulated: repeatable, and with a linear response."""

from __future__ import annotations

from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.contract.scenario import ScenarioError
from mcnav.systems.user.sample_noise import CHECKED, ScaledNoise, sample_noise
from mcnav.systems.user.soundness import FLOWN_TWICE, LARGEST, SEED, SHARE, Unsettled, same, small_errors
from mcnav.systems.user.stochastic_engine import SCALE
from mcnav.systems.user.stochastic_scenario import NOISE, StochasticUserScenario

LONGER: Final = 3.0 * SCALE
"""Scale of the noise in the differences that must confirm those at `SCALE`: their third-order term is nine times
larger, 1e-3 of that of the whole noise."""

RESPONSES: Final = 8
"""Samples of noise whose linear response is checked."""


class NoisyEngine(Protocol):
    """An engine with noise, or one that runs it in a process of its own."""

    def simulate(self, batch: Batch) -> SimulationResult:
        """Simulate samples with noise."""


def check_noise(engine: NoisyEngine, sizes: Array) -> None:
    """Simulate a few samples twice, in the opposite order, and alone.

    Parameters
    ----------
    sizes : ndarray, shape (sources,)
        One sigma of each source, SI.

    Raises
    ------
    ScenarioError
        When a sample's outcome depends on anything but its errors and its noise.
    """
    batch = Batch(np.arange(FLOWN_TWICE), small_errors(sizes), SEED)
    whole, backwards = engine.simulate(batch), np.arange(FLOWN_TWICE)[::-1]
    again = engine.simulate(batch[backwards])
    restored = SimulationResult(
        again.values[backwards], {FLOWN_TWICE - 1 - row: failure for row, failure in again.failures.items()}
    )
    if not same(whole, restored):
        raise ScenarioError(
            "type",
            "answers identical calls with identical noise differently: is something random drawn elsewhere than from "
            "noise, or kept from one call to the next? mcnav check says more",
        )


def check_without_noise(scenario: StochasticUserScenario) -> None:
    """Simulate no errors with two samples of noise scaled to zero.

    Raises
    ------
    ScenarioError
        When the outcomes differ: noise has come from elsewhere than the methods that can be scaled.
    """
    none = np.zeros(len(scenario.sources))
    one, other = (scenario.flight(none, ScaledNoise(SEED, index, 0.0, CHECKED)) for index in range(2))
    if not np.array_equal(one, other, equal_nan=True):
        raise ScenarioError(
            "type",
            "is random without noise: draw all noise with the generator that fly is given. Use its standard_normal, "
            "normal, multivariate_normal, random or uniform, not its bits, and not in compiled code",
        )


def find_unsettled_noise(
    scenario: StochasticUserScenario, engine: NoisyEngine, varied: NDArray[np.bool_], tolerance: float
) -> Unsettled | None:
    """Find the output whose linear response to the noise is least settled, or farthest from ``fly_linear``.

    Parameters
    ----------
    varied : ndarray of bool, shape (sources,)
        Sources that a campaign disturbs.
    tolerance : float
        Share of sigma that the campaign tolerates.

    Returns
    -------
    Unsettled or None
        None where all is settled.

    Raises
    ------
    ScenarioError
        When the scenario is not a function of errors and noise; see `check_noise`, `check_without_noise`.
    """
    if not scenario.noisy:
        return None
    check_noise(engine, scenario.sizes)
    check_without_noise(scenario)
    model, limit = scenario.linear().end, min(LARGEST, SHARE * tolerance)
    responses = [_final(scenario.response(SEED, index, CHECKED)) for index in range(RESPONSES)]
    longer = [_final(scenario.response(SEED, index, CHECKED, LONGER)) for index in range(RESPONSES)]
    contributions = model.partials * np.where(varied, scenario.sizes, 0.0)
    sigma = np.sqrt(np.sum(contributions**2, axis=1) + np.mean(np.square(responses), axis=0))
    kind, gaps = "response", np.abs(np.subtract(longer, responses))
    if scenario.own_linear and not _exceeds(gaps, sigma, limit):
        sizes = np.where(varied, scenario.sizes, 0.0)
        errors = np.random.default_rng(SEED).standard_normal((RESPONSES, len(sizes))) * sizes
        finals = [
            _final(scenario.linear_flight(errors[index], sample_noise(SEED, index, CHECKED)))
            for index in range(RESPONSES)
        ]
        kind, gaps = "fly_linear", np.abs(finals - model.nominal - errors @ model.partials.T - responses)
    if not _exceeds(gaps, sigma, limit):
        return None
    shares = gaps.max(axis=0) / np.where(sigma > 0.0, sigma, 1.0)
    output = int(np.argmax(shares))
    name = scenario.outputs[output].name
    return Unsettled(NOISE, name, float(shares[output]), limit, kind == "fly_linear", kind)


def _final(over_time: Array) -> Array:
    return np.asarray(over_time[-1])


def _exceeds(gaps: Array, sigma: Array, limit: float) -> bool:
    """Return whether a gap, shape (n, outputs), exceeds its share of sigma; a gap where there is no sigma does."""
    return bool(np.any(gaps > limit * sigma))
