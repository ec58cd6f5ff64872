"""Checks before samples are simulated: whether a scenario can be compared with a linear model at all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.contract.linear import LinearModel
from mcnav.contract.samples import SimulationResult
from mcnav.contract.scenario import ScenarioError
from mcnav.linear.partials import Propagate
from mcnav.systems.finite_differences import differentiate
from mcnav.systems.user.scenario import UserScenario

LARGEST: Final = 1e-2
"""Disagreement of neighbouring steps, as a share of a row's largest one-sigma contribution, that is settled.

Where each of n independent sources has derivatives in doubt by a share d of the row's largest contribution, sigma is in
doubt by no more than d √n of itself: by the triangle inequality the rows P√S differ in length by no more than the
length of their difference, and the row is as long as its largest contribution at least. Ten sources at 1 % make 3 %, of
the 5 % that campaigns tolerate by default; `SHARE` keeps the proportion where they tolerate less.

Noise that depends on every error is refused from some 0.03 % of the dispersion on, because differences magnify it: by 7
at the two longest steps, by thousands at short ones. Noise that is the same to both sides cancels in differences and is
refused from 1 %. What passes adds less than 0.01 % to sigma. An integrator's noise of 1e-5 of the dispersion passes.
"""

SHARE: Final = 0.2
"""The same as a share of the campaign's tolerance, where that is less."""

SAME: Final = 1e-9
"""Share of an output's size by which a sample may depend on others in its chunk: the order of a library's sums."""

NEAR: Final = 0.01
"""Size of the errors that are simulated twice, as a share of sigma."""

FLOWN_TWICE: Final = 4
"""Samples, the one without any error among them."""

SEED: Final = 1966


@dataclass(frozen=True)
class Unsettled:
    """A partial derivative on which no linear model can be built.

    Attributes
    ----------
    disagreement : float
        Disagreement of neighbouring steps, or of the class's own derivative with differences, as a share of the largest
        one-sigma contribution to the output.
    limit : float
        The share that would do.
    own : bool
        Whether it is the class's own derivative that disagrees with differences, which are settled.
    noise : str
        What is in doubt about the noise, in place of a derivative: its ``response``, ``fly_linear`` or
        ``noise_covariance`` of the class. The disagreement is then a share of the output's linear sigma.
    """

    source: str
    output: str
    disagreement: float
    limit: float
    own: bool
    noise: str = ""

    def __str__(self) -> str:
        share = 100.0 * self.disagreement
        off = f"{share:,.0f}" if share >= 10.0 else f"{share:.2g}"
        off += " % of the output's largest one-sigma contribution"
        where = f"of output {self.output!r} to source {self.source!r}"
        most = f"(limit {100.0 * self.limit:g} %)"
        if self.noise == "fly_linear":
            return (
                f"fly_linear() differs from simulations with small errors and noise, in output {self.output!r} by "
                f"{100.0 * self.disagreement:.2g} % of its linear sigma {most}: correct it, omit it, or use --force"
            )
        if self.noise:
            return (
                f"the response of output {self.output!r} to the noise is not linear, so there is no linear model to "
                f"compare with: differences at two scales of the noise disagree by {100.0 * self.disagreement:.2g} % "
                f"of its linear sigma {most}; remove jumps, integrate more precisely, or use --force"
            )
        if self.own:
            return (
                f"the class's own partial derivative {where} is {off} away from the finite difference {most}: "
                "correct partials(), omit it, or use --force"
            )
        return (
            f"the partial derivative {where} does not converge, so there is no linear model to compare with: "
            f"differences at neighbouring steps, or to either side, disagree by {off} {most}; remove noise and jumps, "
            "integrate more precisely, or use --force"
        )


def same(one: SimulationResult, other: SimulationResult) -> bool:
    """Compare two simulations of the same errors: the same bits and the same failures."""
    return np.array_equal(one.values, other.values, equal_nan=True) and one.failures.keys() == other.failures.keys()


def apart(one: Array, other: Array, spread: Array | None = None) -> float:
    """Compute the largest difference of outcomes of the same samples, (n, outputs), as a share of an output's size.

    Infinite when a sample failed in one of them alone. The size is that of its largest outcome, or ``spread``, shape
    (outputs,), where that is larger.
    """
    if not np.array_equal(np.isnan(one), np.isnan(other)):
        return np.inf
    scale = np.nan_to_num(np.abs(one)).max(axis=0, initial=0.0)
    scale = scale if spread is None else np.maximum(scale, spread)
    gaps = np.nan_to_num(np.abs(one - other)).max(axis=0, initial=0.0)
    return float((gaps / np.where(scale > 0.0, scale, 1.0)).max(initial=0.0))


def small_errors(sizes: Array) -> Array:
    """Draw the errors that are simulated twice, a small share of their sigmas, shape (FLOWN_TWICE, sources), SI."""
    return np.asarray(NEAR * np.random.default_rng(SEED).standard_normal((FLOWN_TWICE, len(sizes))) * sizes)


def check_repeatable(simulate: Propagate, sizes: Array) -> None:
    """Simulate a few small errors twice, and once more in the opposite order.

    Parameters
    ----------
    simulate : callable
        Simulation of errors, shape (n, sources), without noise.
    sizes : ndarray, shape (sources,)
        One sigma of each source, SI.

    Raises
    ------
    ScenarioError
        When identical errors have other outcomes, or a sample depends on its place among others.
    """
    errors = small_errors(sizes)
    errors[0] = 0.0
    first, second = simulate(errors), simulate(errors)
    if not same(first, second):
        raise ScenarioError(
            "type",
            "answers identical calls differently: is something random, or kept from one call to the next? A sample "
            "must depend on its errors alone; mcnav check says more",
        )
    gap = apart(first.values, simulate(errors[::-1]).values[::-1])
    if gap > SAME:
        raise ScenarioError(
            "type",
            f"a sample's outcome changes by {gap:.1e} of the output's size with its place among others: is something "
            "random drawn for a whole chunk? A sample must depend on its errors alone; mcnav check says more",
        )


def find_unsettled(
    scenario: UserScenario, simulate: Propagate, varied: NDArray[np.bool_], tolerance: float
) -> Unsettled | None:
    """Find the partial derivative that is least settled, or farthest from finite differences.

    Parameters
    ----------
    simulate : callable
        Simulation of errors, shape (n, sources), without noise.
    varied : ndarray of bool, shape (sources,)
        Sources that a campaign disturbs.
    tolerance : float
        Share of sigma that the campaign tolerates.

    Returns
    -------
    Unsettled or None
        None where all is settled, and where the samples that would tell cannot all be simulated.

    Raises
    ------
    ScenarioError
        When the scenario is not a function of the errors; see `check_repeatable`.
    """
    check_repeatable(simulate, scenario.sizes)
    model = scenario.linear().end
    limit = min(LARGEST, SHARE * tolerance)
    if not varied.any():
        return None
    try:
        differences = differentiate(simulate, scenario.sizes) if scenario.own_partials else scenario.differences
    except ScenarioError:  # the class's own derivatives need no differences
        return None
    shares = differences.disagreement(varied)
    own = False
    if scenario.own_partials and shares.max() <= limit:
        shares, own = _off(model, differences.model, scenario.sizes, varied, differences.moved) - shares, True
    if shares.max() <= limit:
        return None
    output, source = (int(at) for at in np.unravel_index(np.argmax(shares), shares.shape))
    named = scenario.sources[source].name, scenario.outputs[output].name
    return Unsettled(*named, float(shares[output, source]), limit, own)


def _off(own: LinearModel, model: LinearModel, sizes: Array, varied: NDArray[np.bool_], moved: Array) -> Array:
    """Compare two linear models as a share of the largest one-sigma contribution, shape (outputs, sources)."""
    sizes = np.where(varied, sizes, 0.0)
    scale = np.maximum(np.abs(model.partials * sizes), moved.T * varied).max(axis=1)
    return np.asarray(np.abs((own.partials - model.partials) * sizes) / np.where(scale > 0.0, scale, 1.0)[:, None])
