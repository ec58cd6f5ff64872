"""Linear beside Monte Carlo: the same draws through the nonlinear flights and through P.

With s the start errors of a sample, y its flown final errors and ``z = y0 + P s`` the linear ones, the plain sample
covariance is cov(y). The *paired* estimate ``cov(y) - cov(z) + P S P^T`` has the same mean, but the sampling noise that
y and z share cancels (z is a control variate whose covariance is known). Its error is that of y's difference from z.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.verdict import Judgement, Verdict, judge, worst
from mcnav.linear.covariance import propagated_covariance
from mcnav.sampling.designs import FEWEST_BLOCKS
from mcnav.statistics.estimates import Estimate, blocked_mean

Array = NDArray[np.float64]

LARGEST_FAILED_SHARE: Final = 1e-3
"""When a larger share of the samples failed, the agreement of those that are left says nothing and is not claimed."""

ROUNDING: Final = 1e-10
"""A sigma below this share of the terms that make it up is rounding, and counts as zero."""

LARGEST_EXPONENT: Final = 700.0
"""The exponential of more is infinite in double precision."""

RANK_TOLERANCE: Final = 1e-9
"""Eigenvalues of the linear correlation matrix below this share of the largest count as zero."""


@dataclass(frozen=True)
class Model:
    """The linear model and the statistics of the start errors, SI.

    Attributes
    ----------
    partials : ndarray, shape (outputs, sources)
    nominal : ndarray, shape (outputs,)
        Final errors without errors.
    mean : ndarray, shape (sources,)
        Mean start errors.
    covariance : ndarray, shape (sources, sources)
        Start covariance S.
    """

    partials: Array
    nominal: Array
    mean: Array
    covariance: Array

    @property
    def outcome_mean(self) -> Array:
        """Mean of the final errors by the linear model, shape (outputs,)."""
        return self.nominal + self.partials @ self.mean

    @property
    def outcome_covariance(self) -> Array:
        """P S P^T, shape (outputs, outputs); zero in the rows and columns of outputs whose sigma is only rounding."""
        covariance = propagated_covariance(self.partials, self.covariance)
        dispersed = np.diag(covariance) > self.rounding**2
        return np.asarray(np.where(np.outer(dispersed, dispersed), covariance, 0.0), dtype=float)

    @property
    def rounding(self) -> Array:
        """The sigma that rounding alone may leave in each output, shape (outputs,)."""
        terms = np.abs(self.partials) * np.sqrt(np.diag(self.covariance))
        return np.asarray(ROUNDING * np.maximum(terms.max(axis=1, initial=0.0), np.abs(self.outcome_mean)))


@dataclass(frozen=True)
class Criterion:
    """What counts as agreement: a tolerance on sigma ratios, and the confidence of all verdicts together."""

    tolerance: float = 0.05
    confidence: float = 0.95


@dataclass(frozen=True)
class OutputComparison:
    """One output, linear beside Monte Carlo.

    Attributes
    ----------
    sigma_linear, sigma_sample, sigma_paired : float
        SI; the last is NaN when the paired variance comes out negative.
    plain, paired : Judgement
        Of the two Monte Carlo estimates over the linear sigma; the verdict is that of the paired one.
    bias : Estimate
        Mean of the flown less the linear final errors, SI.
    """

    sigma_linear: float
    sigma_sample: float
    sigma_paired: float
    plain: Judgement
    paired: Judgement
    bias: Estimate


@dataclass(frozen=True)
class Ellipsoid:
    """The whole matrix: the flown errors measured by the linear covariance.

    Attributes
    ----------
    dimension : int
        Rank of the linear covariance: the expected NEES.
    values : ndarray, shape (n,)
        NEES of each flown sample against the linear mean and covariance.
    nees : Estimate
        Mean normalised estimation error squared of the flown errors.
    nees_paired : Estimate
        The same with the linear errors' NEES, whose mean is the dimension exactly, as control variate.
    judgement : Judgement
        Of ``sqrt(mean NEES / dimension)``, the sigma ratio averaged over all directions.
    directions : ndarray, shape (dimension, outputs)
        Weights, on outputs in units of their linear sigmas, of the combinations in which the paired covariance differs
        least to most from the linear one; each of unit length.
    direction_ratios : ndarray, shape (dimension,)
        Sigma ratio of each combination, rising; NaN where the paired variance is negative.
    """

    dimension: int
    values: Array
    nees: Estimate
    nees_paired: Estimate
    judgement: Judgement
    directions: Array
    direction_ratios: Array

    @property
    def farthest(self) -> int:
        """The combination whose sigma ratio is farthest from one."""
        return int(np.argmax(np.abs(np.nan_to_num(self.direction_ratios, nan=0.0) - 1.0)))


@dataclass(frozen=True)
class Comparison:
    """The result of a campaign; arrays in the order of the scenario's outputs, SI.

    ``verdict`` is that on the outputs' sigmas. The whole matrix has a judgement of its own (`Ellipsoid`), which is the
    harder one to pass: the thin directions of the ellipsoid show nonlinearity first.
    """

    samples: int
    failed: int
    confidence_each: float
    mean_sample: Array
    covariance_linear: Array
    covariance_sample: Array
    covariance_paired: Array
    outputs: tuple[OutputComparison, ...]
    ellipsoid: Ellipsoid | None
    verdict: Verdict


def correlations(covariance: Array) -> Array:
    """Correlation matrix of a covariance; NaN in rows and columns without dispersion."""
    sigma = np.sqrt(np.where(np.diag(covariance) > 0.0, np.diag(covariance), np.nan))
    return np.asarray(covariance / np.outer(sigma, sigma))


def compare(
    model: Model,
    errors: Array,
    outcomes: Array,
    blocks: NDArray[np.int64],
    criterion: Criterion,
    fewest: int = FEWEST_BLOCKS["random"],
) -> Comparison:
    """Compare the flights of a campaign with the linear model.

    Parameters
    ----------
    model : Model
    errors : ndarray, shape (n, sources)
        Start errors of every sample.
    outcomes : ndarray, shape (n, outputs)
        Final errors; NaN in the row of a sample that failed. Failed samples are left out.
    blocks : ndarray of int, shape (n,)
        Independent block of each sample (`mcnav.sampling.designs`).
    criterion : Criterion
        Tolerance, and the confidence that holds for all verdicts together (Bonferroni).
    fewest : int
        Independent blocks below which nothing is decided.
    """
    flown = np.asarray(np.isfinite(outcomes).all(axis=1))
    errors, outcomes, blocks = errors[flown], outcomes[flown], blocks[flown]
    count = len(outcomes)
    linear = model.outcome_covariance
    each = 1.0 - (1.0 - criterion.confidence) / (len(linear) + 1)
    if count < 2:
        unknown = np.full_like(linear, np.nan)
        return Comparison(
            count, int((~flown).sum()), each, np.full(len(linear), np.nan), linear, unknown, unknown, (), None,
            Verdict.UNDECIDED,
        )  # fmt: skip
    predicted = model.nominal + np.einsum("nj,ij->ni", errors, model.partials)
    mean = outcomes.mean(axis=0)
    sample = _covariance(outcomes)
    paired = sample - _covariance(predicted) + linear
    blocked = _Blocked(blocks, fewest, criterion.tolerance, each)
    floors = model.rounding**2
    outputs = tuple(
        _compare_output(outcomes[:, i], predicted[:, i], float(linear[i, i]), float(floors[i]), blocked)
        for i in range(len(linear))
    )
    ellipsoid = _compare_ellipsoid(model, outcomes, predicted, paired, blocked)
    verdict = worst([output.paired.verdict for output in outputs])
    failed = int((~flown).sum())
    nothing_to_compare = all(output.paired.ratio is None for output in outputs) and verdict == Verdict.AGREES
    if nothing_to_compare or (verdict == Verdict.AGREES and failed > LARGEST_FAILED_SHARE * len(flown)):
        verdict = Verdict.UNDECIDED
    return Comparison(count, failed, each, mean, linear, sample, paired, outputs, ellipsoid, verdict)


@dataclass(frozen=True)
class _Blocked:
    """How estimates are formed and judged throughout one comparison."""

    blocks: NDArray[np.int64]
    fewest: int
    tolerance: float
    confidence: float

    def mean(self, values: Array) -> Estimate:
        return blocked_mean(values, self.blocks, self.fewest)

    def judged(self, estimate: Estimate, expected: float, floor: float = 0.0) -> Judgement:
        """Judge the square root of an estimated variance over the expected one."""
        if expected <= 0.0:
            agrees = estimate.value <= floor
            return Judgement(Verdict.AGREES if agrees else Verdict.DIFFERS, None, None, certain=not agrees)
        share = estimate.value / expected
        half = estimate.half_width(self.confidence) / expected
        ratio = float(np.sqrt(max(share, 0.0)))
        if not np.isfinite(half):
            interval = (0.0, float("inf"))
        elif share > 0.0:  # on the scale of the logarithm, where a variance's error is nearly symmetric
            spread = float(np.exp(min(0.5 * half / share, LARGEST_EXPONENT)))
            interval = (ratio / spread, ratio * spread)
        else:
            interval = (0.0, float(np.sqrt(max(share + half, 0.0))))
        return judge(ratio, interval, self.tolerance, len(self.blocks))


def _covariance(values: Array) -> Array:
    """Unbiased sample covariance, shape (k, k)."""
    centred = values - values.mean(axis=0)
    return np.asarray(centred.T @ centred / (len(values) - 1))


def _compare_output(
    flown: Array, predicted: Array, variance: float, floor: float, blocked: _Blocked
) -> OutputComparison:
    count = len(flown)
    unbiased = count / (count - 1.0)
    flown_squares = unbiased * (flown - flown.mean()) ** 2
    predicted_squares = unbiased * (predicted - predicted.mean()) ** 2
    plain = blocked.mean(flown_squares)
    difference = blocked.mean(flown_squares - predicted_squares)
    paired = Estimate(variance + difference.value, difference.standard_error, difference.degrees_of_freedom)
    return OutputComparison(
        sigma_linear=float(np.sqrt(variance)),
        sigma_sample=float(np.sqrt(plain.value)),
        sigma_paired=float(np.sqrt(paired.value)) if paired.value >= 0.0 else float("nan"),
        plain=blocked.judged(plain, variance, floor),
        paired=blocked.judged(paired, variance, floor),
        bias=blocked.mean(flown - predicted),
    )


def _compare_ellipsoid(
    model: Model, flown: Array, predicted: Array, paired: Array, blocked: _Blocked
) -> Ellipsoid | None:
    """NEES against the linear covariance, on the subspace where that has dispersion."""
    covariance, centre = model.outcome_covariance, model.outcome_mean
    sigma = np.sqrt(np.diag(covariance))
    if not (sigma > 0.0).any():
        return None
    scale = np.divide(1.0, sigma, out=np.zeros_like(sigma), where=sigma > 0.0)
    values, vectors = np.linalg.eigh(covariance * np.outer(scale, scale))
    kept = values > RANK_TOLERANCE * values[-1]
    whiten = scale[:, None] * vectors[:, kept] / np.sqrt(values[kept])
    dimension = int(kept.sum())
    flown_nees = np.sum(((flown - centre) @ whiten) ** 2, axis=1)
    predicted_nees = np.sum(((predicted - centre) @ whiten) ** 2, axis=1)
    difference = blocked.mean(flown_nees - predicted_nees)
    controlled = Estimate(dimension + difference.value, difference.standard_error, difference.degrees_of_freedom)
    ratios, rotations = np.linalg.eigh(whiten.T @ paired @ whiten)
    directions = (vectors[:, kept] / np.sqrt(values[kept])) @ rotations
    directions = directions / np.linalg.norm(directions, axis=0)
    return Ellipsoid(
        dimension,
        flown_nees,
        blocked.mean(flown_nees),
        controlled,
        blocked.judged(controlled, float(dimension)),
        directions.T,
        np.sqrt(np.where(ratios >= 0.0, ratios, np.nan)),
    )
