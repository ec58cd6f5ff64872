"""Linear beside Monte Carlo from sums over blocks of samples, when the samples themselves are not kept.

The estimates are those of `mcnav.analysis.comparison`: means of products of flown and linear errors about the mean of
all, which block sums give whatever that mean is. Standard errors come from larger blocks, so that they differ by their
own sampling error. Tests that need every sample are made on those that are kept.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy import special

from mcnav._types import Array
from mcnav.analysis.comparison import (
    Comparison,
    Criterion,
    DecisionRule,
    Ellipsoid,
    Model,
    OutputComparison,
    overall_verdict,
)
from mcnav.analysis.convergence import Convergence, convergence_of_blocks
from mcnav.analysis.failed_samples import FailureBias, failure_bias_of_sums
from mcnav.analysis.multivariate import (
    ROUNDING,
    CorrelationDifference,
    MultivariateTests,
    covariance_testable,
    joint_of_blocks,
)
from mcnav.lincov.block_sums import BlockSums, Normalization, block_size
from mcnav.statistics.chi_square import LEVELS, Containment, mean_interval
from mcnav.statistics.covariance_tests import covariance_likelihood_ratio
from mcnav.statistics.estimates import Estimate, summed_mean
from mcnav.statistics.hypothesis_test import HypothesisTest
from mcnav.statistics.proportions import probability_interval
from mcnav.statistics.shape import shape_of_sums
from mcnav.statistics.whitening import Whitening, whitening


def normalization_of(model: Model, samples: int, of_design: int) -> Normalization:
    """How a campaign's samples are to be reduced.

    Parameters
    ----------
    model : Model
    samples : int
    of_design : int
        Samples of an independent block of the design.
    """
    linear = model.outcome_covariance
    sigma = np.sqrt(np.diag(linear))
    scale = np.where(sigma > 0.0, sigma, 1.0)
    given = whitening(linear)
    radii = np.array([special.chdtri(given.rank, 1.0 - level) for level in LEVELS]) if given.rank else np.zeros(0)
    return Normalization(
        model.partials,
        model.mean,
        model.outcome_mean,
        scale,
        np.ascontiguousarray(scale[:, None] * given.matrix),
        radii,
        block_size(samples, of_design),
    )


@dataclass(frozen=True)
class _Sums:
    """Block sums, SI, of a campaign's flown errors y and linear errors z about the linear mean.

    ``counts`` has shape (b,), ``y`` and ``z`` (b, outputs), ``yy`` and ``zz`` (b, outputs, outputs), ``thirds`` and
    ``fourths``, of y in linear sigmas, (b, outputs).
    """

    counts: Array
    y: Array
    z: Array
    yy: Array
    zz: Array
    thirds: Array
    fourths: Array

    @property
    def total(self) -> float:
        """Samples."""
        return float(self.counts.sum())

    @property
    def centred(self) -> tuple[Array, Array]:
        """Sums of products about the means of all samples, times n / (n - 1), each shape (b, outputs, outputs)."""
        unbiased = self.total / (self.total - 1.0)
        found = []
        for first, second in ((self.y, self.yy), (self.z, self.zz)):
            mean = first.sum(axis=0) / self.total
            crossed = first[:, :, None] * mean
            about = second - crossed - crossed.swapaxes(1, 2) + self.counts[:, None, None] * np.outer(mean, mean)
            found.append(unbiased * about)
        return found[0], found[1]


def _sums(frame: Normalization, found: BlockSums) -> _Sums:
    blocks, outputs = found.blocks[found.blocks[:, 0] > 0.0], len(frame.scale)
    products = outputs * (outputs + 1) // 2
    cuts = np.cumsum([1, outputs, outputs, products, products, outputs])
    counts, y, z, yy, zz, thirds, fourths = np.split(blocks, cuts, axis=1)
    rows, columns = np.triu_indices(outputs)

    def matrix(flat: Array) -> Array:
        full = np.empty((len(flat), outputs, outputs))
        full[:, rows, columns] = full[:, columns, rows] = flat
        return full * np.outer(frame.scale, frame.scale)

    return _Sums(counts[:, 0], y * frame.scale, z * frame.scale, matrix(yy), matrix(zz), thirds, fourths)


@dataclass(frozen=True)
class Summed:
    """A campaign of which sums are kept, compared.

    Attributes
    ----------
    comparison : Comparison
        Its ellipsoid's ``values``, and the joint tests ``nees`` and ``normality``, are of the samples that are kept.
    convergence : Convergence or None
    drawn : ndarray, shape (sources, sources)
        Covariance of the errors of the samples that did not fail, SI.
    left_out : FailureBias or None
    """

    comparison: Comparison
    convergence: Convergence | None
    drawn: Array
    left_out: FailureBias | None


def compare_sums(
    model: Model,
    frame: Normalization,
    found: BlockSums,
    samples: int,
    kept: Comparison,
    criterion: Criterion,
    fewest: float,
    single: bool,
    normal: bool,
) -> Summed:
    """Compare a campaign by its sums.

    Parameters
    ----------
    model : Model
    frame : Normalization
        With which the samples were reduced.
    found : BlockSums
    samples : int
        All that were drawn; those not in the sums failed.
    kept : Comparison
        Of the samples that are kept.
    criterion : Criterion
    fewest : float
        Independent blocks below which nothing is decided.
    single : bool
        Whether the design draws samples that are independent one by one.
    normal : bool
        Whether the sources are normal.
    """
    sums = _sums(frame, found)
    count = int(sums.total)
    drawn = np.full_like(model.covariance, np.nan)
    left_out = failure_bias_of_sums(
        model, (samples, found.errors + found.lost, found.squares + found.lost_squares),
        (count, found.errors, found.squares),
    )  # fmt: skip
    if count < 2 or not kept.outputs:
        return Summed(replace(kept, samples=count, failed=samples - count), None, drawn, left_out)
    away = found.errors / count
    drawn = (found.squares - count * np.outer(away, away)) / (count - 1.0)
    linear, each = model.outcome_covariance, kept.confidence_each
    judging = DecisionRule(count, criterion.tolerance, each)
    yy, zz = sums.centred
    sample, predicted = yy.sum(axis=0) / count, zz.sum(axis=0) / count
    paired = sample - predicted + linear

    def mean(totals: Array) -> Estimate:
        return summed_mean(totals, sums.counts, fewest)

    outputs = tuple(
        OutputComparison.judged(
            float(linear[i, i]),
            float(model.rounding[i] ** 2),
            mean(yy[:, i, i]),
            mean(yy[:, i, i] - zz[:, i, i]),
            mean(sums.y[:, i] - sums.z[:, i]),
            judging,
        )
        for i in range(len(linear))
    )
    comparison = Comparison(
        count,
        samples - count,
        each,
        model.outcome_mean + sums.y.sum(axis=0) / count,
        linear,
        sample,
        paired,
        outputs,
        _ellipsoid(model, sums, paired, kept.ellipsoid, judging, fewest),
        _joint(frame, found, sums, linear, sample, paired, kept, fewest, single, normal),
        overall_verdict(outputs, samples - count, samples),
    )
    unscaled = np.diagonal(yy, axis1=1, axis2=2), np.diagonal(zz, axis1=1, axis2=2)
    running = convergence_of_blocks(sums.counts, *unscaled, np.diag(linear), each, fewest)
    return Summed(comparison, running, drawn, left_out)


def _ellipsoid(
    model: Model, sums: _Sums, paired: Array, kept: Ellipsoid | None, judging: DecisionRule, fewest: float
) -> Ellipsoid | None:
    """NEES is a linear function of the products of outputs about the linear mean."""
    if kept is None:
        return None
    given = whitening(model.outcome_covariance)
    weights = given.matrix @ given.matrix.T
    flown, predicted = (np.einsum("bij,ij->b", products, weights) for products in (sums.yy, sums.zz))
    return Ellipsoid.judged(
        kept.values,
        given,
        summed_mean(flown, sums.counts, fewest),
        summed_mean(flown - predicted, sums.counts, fewest),
        paired,
        judging,
    )


def _joint(
    frame: Normalization, found: BlockSums, sums: _Sums, linear: Array, sample: Array, paired: Array, kept: Comparison,
    fewest: float, single: bool, normal: bool,
) -> MultivariateTests | None:  # fmt: skip
    if kept.joint is None:
        return None
    given, count, each = whitening(linear), int(sums.total), kept.confidence_each
    enough = len(sums.counts) >= fewest
    powers = [np.stack([sums.y[:, i] / frame.scale[i], sums.yy[:, i, i] / frame.scale[i] ** 2, sums.thirds[:, i],
                        sums.fourths[:, i]]) for i in range(len(linear))]  # fmt: skip
    shapes = [shape_of_sums(each_output, sums.counts, fewest) for each_output in powers]
    yy, zz = sums.centred
    contained = [
        Containment(level, hits / count, probability_interval(int(hits), count, each))
        for level, hits in zip(LEVELS, found.within, strict=False)
    ]
    plain = single and enough
    return MultivariateTests(
        covariance=covariance_likelihood_ratio(sample, count, linear) if plain and normal else None,
        covariance_paired=_of_blocks(_whitened(given, yy - zz), sums)
        if enough and covariance_testable(len(sums.counts), int(sums.counts.sum()))
        else None,
        bias=joint_of_blocks(sums.y @ given.matrix) if plain else None,
        bias_paired=_of_blocks((sums.y - sums.z) @ given.matrix, sums) if enough else None,
        nees=kept.joint.nees,
        nees_expected=mean_interval(count, given.rank, each) if plain and normal else None,
        contained=tuple(contained) if plain else (),
        normality=kept.joint.normality,
        skewness=tuple(skewed for skewed, _ in shapes),
        excess_kurtosis=tuple(tailed for _, tailed in shapes),
        correlations=tuple(
            _correlation(i, j, linear, paired, (yy - zz) * (1.0 - 1.0 / count), sums, fewest)
            for i, j in combinations(range(len(linear)), 2)
            if min(linear[i, i], linear[j, j], paired[i, i], paired[j, j]) > 0.0
        ),
    )


def _whitened(given: Whitening, products: Array) -> Array:
    """Distinct elements of products in whitened coordinates, shape (b, elements)."""
    first, second = np.triu_indices(given.rank)
    return np.asarray((given.matrix.T @ products @ given.matrix)[:, first, second])


def _of_blocks(totals: Array, sums: _Sums) -> HypothesisTest | None:
    """T-squared of a mean of zero; differences that hold nothing but rounding are zero."""
    size = np.sqrt(np.sum(totals**2, axis=0) / sums.total)
    return joint_of_blocks(np.where(size > ROUNDING, totals, 0.0))


def _correlation(
    i: int, j: int, linear: Array, paired: Array, difference: Array, sums: _Sums, fewest: float
) -> CorrelationDifference:
    """As for samples (`mcnav.analysis.multivariate`), the influence function summed over blocks."""
    root = float(np.sqrt(paired[i, i] * paired[j, j]))
    found = float(paired[i, j]) / root
    own = difference[:, i, i] / paired[i, i] + difference[:, j, j] / paired[j, j]
    influence = summed_mean(difference[:, i, j] / root - 0.5 * found * own, sums.counts, fewest)
    before = float(linear[i, j] / np.sqrt(linear[i, i] * linear[j, j]))
    value = replace(influence, value=found - before)
    return CorrelationDifference((i, j), before, found, value)
