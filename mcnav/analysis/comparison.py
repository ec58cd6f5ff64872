"""Linear beside Monte Carlo: the same draws through the nonlinear flights and through P.

With s the start errors of a sample, y its flown final errors and ``z = y0 + P s`` the linear ones, the plain sample
covariance is cov(y). The *paired* estimate ``cov(y) - cov(z) + P S P^T`` has the same mean, but the sampling noise that
y and z share cancels (z is a control variate whose covariance is known). Its error is that of y's difference from z.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from mcnav._subprocess import side_threads
from mcnav._types import Array, IndexArray
from mcnav.analysis.multivariate import MultivariateTests, compare_jointly
from mcnav.analysis.verdict import Judgement, Verdict, combine_verdicts, judge
from mcnav.lincov.covariance import propagated_covariance
from mcnav.sampling.designs import FEWEST_BLOCKS
from mcnav.statistics.chunked import scatter, squared_distances
from mcnav.statistics.estimates import Estimate, blocked_mean
from mcnav.statistics.interim_analyses import confidence_of_each
from mcnav.statistics.power import detectable_ratio, samples_to_detect
from mcnav.statistics.whitening import Whitening, whitening

Number = TypeVar("Number", np.float64, np.int64)

LARGEST_FAILED_SHARE: Final = 1e-3
"""When a larger share of the samples failed, the agreement of those that are left says nothing and is not claimed."""

ROUNDING: Final = 1e-10
"""A sigma below this share of the terms that make it up is rounding, and counts as zero."""

LARGEST_EXPONENT: Final = 700.0
"""The exponential of more is infinite in double precision."""


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
    """What counts as agreement: a tolerance on sigma ratios, and the confidence of all verdicts together.

    ``looks`` is how often the results may be looked at before the samples are enough
    (`mcnav.statistics.interim_analyses`).
    """

    tolerance: float = 0.05
    confidence: float = 0.95
    looks: int = 1


@dataclass(frozen=True)
class DecisionRule:
    """How estimates are judged throughout one comparison, of so many samples."""

    samples: int
    tolerance: float
    confidence: float

    def judged(self, estimate: Estimate, expected: float, floor: float = 0.0) -> Judgement:
        """Judge the square root of an estimated variance over the expected one."""
        if expected <= 0.0:
            agrees = estimate.value <= floor
            return Judgement(Verdict.AGREES if agrees else Verdict.DIFFERS, None, None, certain=not agrees)
        ratio, interval = ratio_interval(estimate, expected, self.confidence)
        return judge(ratio, interval, self.tolerance, self.samples)

    def detectable(self, estimate: Estimate, expected: float) -> float:
        """The smallest departure of the sigma ratio from one that would have been found."""
        if expected <= 0.0 or estimate.value <= 0.0:
            return float("nan")
        error = 0.5 * estimate.standard_error / estimate.value
        return detectable_ratio(error, estimate.degrees_of_freedom, self.confidence)

    def samples_to_see(self, estimate: Estimate, expected: float) -> float:
        """Samples with which a departure as large as the tolerance would be found."""
        if expected <= 0.0 or estimate.value <= 0.0 or not np.isfinite(estimate.standard_error):
            return float("nan")
        error = 0.5 * estimate.standard_error / estimate.value
        return float(np.ceil(samples_to_detect(self.tolerance, error, self.samples, self.confidence)))


@dataclass(frozen=True)
class OutputComparison:
    """One output, linear beside Monte Carlo.

    Attributes
    ----------
    sigma_linear, sigma_sample, sigma_paired : float
        SI; the last is NaN when the paired variance comes out negative.
    plain, paired : Judgement
        Of the two Monte Carlo estimates over the linear sigma; the verdict is that of the paired one.
    paired_variance : Estimate
        The paired variance, SI.
    bias : Estimate
        Mean of the flown less the linear final errors, SI.
    detectable_plain, detectable_paired : float
        The smallest departure of the sigma ratio from one that so many samples find with a probability of 90 %; NaN
        where there is no ratio.
    samples_to_see : float
        Samples with which the paired estimate finds a departure as large as the tolerance, as often.
    """

    sigma_linear: float
    sigma_sample: float
    sigma_paired: float
    plain: Judgement
    paired: Judgement
    paired_variance: Estimate
    bias: Estimate
    detectable_plain: float
    detectable_paired: float
    samples_to_see: float

    @classmethod
    def judged(
        cls, variance: float, floor: float, plain: Estimate, difference: Estimate, bias: Estimate, judging: DecisionRule
    ) -> OutputComparison:
        """From the linear variance, the flown one, and the difference of flown and predicted ones."""
        paired = replace(difference, value=variance + difference.value)
        return cls(
            sigma_linear=float(np.sqrt(variance)),
            sigma_sample=float(np.sqrt(plain.value)),
            sigma_paired=float(np.sqrt(paired.value)) if paired.value >= 0.0 else float("nan"),
            plain=judging.judged(plain, variance, floor),
            paired=judging.judged(paired, variance, floor),
            paired_variance=paired,
            bias=bias,
            detectable_plain=judging.detectable(plain, variance),
            detectable_paired=judging.detectable(paired, variance),
            samples_to_see=judging.samples_to_see(paired, variance),
        )


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

    @classmethod
    def judged(
        cls, values: Array, given: Whitening, nees: Estimate, difference: Estimate, paired: Array, judging: DecisionRule
    ) -> Ellipsoid:
        """From the mean NEES of the flown errors, and the difference of it and the linear errors' NEES."""
        dimension = given.rank
        controlled = replace(difference, value=dimension + difference.value)
        ratios, rotations = np.linalg.eigh(given.matrix.T @ paired @ given.matrix)
        directions = given.directions @ rotations
        directions = directions / np.linalg.norm(directions, axis=0)
        return cls(
            dimension,
            values,
            nees,
            controlled,
            judging.judged(controlled, float(dimension)),
            directions.T,
            np.sqrt(np.where(ratios >= 0.0, ratios, np.nan)),
        )

    @property
    def farthest(self) -> int:
        """The combination whose sigma ratio is farthest from one."""
        return int(np.argmax(np.abs(np.nan_to_num(self.direction_ratios, nan=0.0) - 1.0)))


@dataclass(frozen=True)
class Comparison:
    """The result of a campaign; arrays in the order of the scenario's outputs, SI.

    ``joint`` holds the tests of all outputs together; it is none when there is nothing to test.
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
    joint: MultivariateTests | None
    verdict: Verdict


def correlations(covariance: Array) -> Array:
    """Correlation matrix of a covariance; NaN in rows and columns without dispersion."""
    sigma = np.sqrt(np.where(np.diag(covariance) > 0.0, np.diag(covariance), np.nan))
    return np.asarray(covariance / np.outer(sigma, sigma))


def compare(
    model: Model,
    errors: Array,
    outcomes: Array,
    blocks: IndexArray,
    criterion: Criterion,
    fewest: float = FEWEST_BLOCKS["random"],
    normal: bool = True,
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
    fewest : float
        Independent blocks below which nothing is decided; infinite when no interval can be promised.
    normal : bool
        Whether the sources are normal.
    """
    flown = np.asarray(np.isfinite(outcomes).all(axis=1))
    errors, blocks = successful(errors, flown), successful(blocks, flown)
    outcomes = np.asfortranarray(successful(outcomes, flown))  # what follows goes by columns
    count = len(outcomes)
    linear = model.outcome_covariance
    each = 1.0 - (1.0 - confidence_of_each(criterion.confidence, criterion.looks)) / (len(linear) + 1)
    if count < 2:
        unknown = np.full_like(linear, np.nan)
        return Comparison(
            count, int((~flown).sum()), each, np.full(len(linear), np.nan), linear, unknown, unknown, (), None,
            None, Verdict.UNDECIDED,
        )  # fmt: skip
    predicted = (model.partials @ errors.T).T
    predicted += model.nominal
    mean = outcomes.mean(axis=0)
    sample = _covariance(outcomes)
    paired = sample - _covariance(predicted) + linear
    blocked = _Blocked(blocks, fewest, DecisionRule(len(blocks), criterion.tolerance, each))
    with side_threads(2) as beside:
        judged = [
            beside.submit(_compare_output, outcomes[:, i], predicted[:, i], float(linear[i, i]), float(floor), blocked)
            for i, floor in enumerate(model.rounding**2)
        ]
        ellipsoid = beside.submit(_compare_ellipsoid, model, outcomes, predicted, paired, blocked)
        joint = None
        if np.any(linear):
            joint = compare_jointly(
                linear, model.outcome_mean, outcomes, predicted, paired, blocks, fewest, each, normal
            )
    outputs = tuple(each.result() for each in judged)
    failed = int((~flown).sum())
    return Comparison(
        count, failed, each, mean, linear, sample, paired, outputs, ellipsoid.result(), joint,
        overall_verdict(outputs, failed, len(flown)),
    )  # fmt: skip


def overall_verdict(outputs: Sequence[OutputComparison], failed: int, samples: int) -> Verdict:
    """The verdict on all outputs' sigmas."""
    verdict = combine_verdicts([output.paired.verdict for output in outputs])
    nothing_to_compare = all(output.paired.ratio is None for output in outputs) and verdict == Verdict.AGREES
    if nothing_to_compare or (verdict == Verdict.AGREES and failed > LARGEST_FAILED_SHARE * samples):
        return Verdict.UNDECIDED
    return verdict


def successful(values: NDArray[Number], flown: NDArray[np.bool_]) -> NDArray[Number]:
    """The rows of the samples that did not fail."""
    return values if flown.all() else values[flown]


@dataclass(frozen=True)
class _Blocked:
    """How estimates are formed and judged throughout one comparison."""

    blocks: IndexArray
    fewest: float
    judging: DecisionRule

    def mean(self, values: Array) -> Estimate:
        return blocked_mean(values, self.blocks, self.fewest)


def ratio_interval(estimate: Estimate, expected: float, confidence: float) -> tuple[float, tuple[float, float]]:
    """Square root of an estimated variance over the expected one, and its interval.

    The interval is formed on the scale of the logarithm, where a variance's error is nearly symmetric, and reaches
    further where the skewness of the blocks asks for it (`mcnav.statistics.estimates`).
    """
    share = estimate.value / expected
    half = estimate.half_width(confidence) / expected
    ratio = float(np.sqrt(max(share, 0.0)))
    if not np.isfinite(half):
        return ratio, (0.0, float("inf"))
    down, up = (reach / expected for reach in estimate.reach_of_skewness(confidence))
    low, high = (float(np.sqrt(max(each, 0.0))) for each in (share - down, share + up))
    if share > 0.0:
        spread = float(np.exp(min(0.5 * half / share, LARGEST_EXPONENT)))
        return ratio, (min(ratio / spread, low), max(ratio * spread, high))
    return ratio, (0.0, max(float(np.sqrt(max(share + half, 0.0))), high))


def _covariance(values: Array) -> Array:
    """Unbiased sample covariance, shape (k, k)."""
    return scatter(values) / (len(values) - 1)


def _compare_output(
    flown: Array, predicted: Array, variance: float, floor: float, blocked: _Blocked
) -> OutputComparison:
    count = len(flown)
    unbiased = count / (count - 1.0)
    flown_squares = unbiased * (flown - flown.mean()) ** 2
    predicted_squares = unbiased * (predicted - predicted.mean()) ** 2
    return OutputComparison.judged(
        variance,
        floor,
        blocked.mean(flown_squares),
        blocked.mean(flown_squares - predicted_squares),
        blocked.mean(flown - predicted),
        blocked.judging,
    )


def _compare_ellipsoid(
    model: Model, flown: Array, predicted: Array, paired: Array, blocked: _Blocked
) -> Ellipsoid | None:
    """NEES against the linear covariance, on the subspace where that has dispersion."""
    covariance, centre = model.outcome_covariance, model.outcome_mean
    if not np.any(covariance):
        return None
    given = whitening(covariance)
    flown_nees, predicted_nees = (squared_distances(values, centre, given) for values in (flown, predicted))
    nees, difference = blocked.mean(flown_nees), blocked.mean(flown_nees - predicted_nees)
    return Ellipsoid.judged(flown_nees, given, nees, difference, paired, blocked.judging)
