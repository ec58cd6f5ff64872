"""Tests of all outputs together: of the covariance, the bias, normality and correlations."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mcnav.analysis.block_moments import BlockMoments, ReducedSamples
from mcnav.analysis.model import Model
from mcnav.arrays.types import Array
from mcnav.execution.child_processes import side_threads
from mcnav.sampler.designs import SamplingDesign
from mcnav.statistics.chi_square import Containment, containment, distribution_test, mean_interval
from mcnav.statistics.chunked import STRETCH, RunningScatter
from mcnav.statistics.covariance_tests import covariance_likelihood_ratio
from mcnav.statistics.estimates import Estimate, summed_means
from mcnav.statistics.hotelling import hotelling
from mcnav.statistics.hypothesis_test import HypothesisTest
from mcnav.statistics.mardia import Mardia, mardia
from mcnav.statistics.shape import shape_of_sums

ROUNDING: Final = 1e-9
"""Root mean square difference between simulated and linear errors, in sigmas, that counts as rounding."""

MOST_ELEMENTS: Final = 2_000
"""Distinct elements of a covariance matrix above which they are not tested together: those of 62 outputs.

Their scatter has the square of as many elements, and its decomposition takes the cube: 32 MB and seconds.
"""

FEWEST_PAIRS: Final = 5_000
"""Antithetic pairs below which the paired covariance is not tested.

At a level of 5 % the test was measured to reject a true hypothesis in 8.8 % of campaigns with 1,000 pairs, 6.9 % with
2,500 and 6.0 % with 5,000 or 10,000, each within 0.4; with single samples in 5.8 % at 1,000. The odd part of the
differences cancels within a pair, and a skewed remainder is left.
"""


@dataclass(frozen=True)
class CorrelationDifference:
    """Paired estimate of the correlation coefficient of two outputs, by their indices, less the linear one."""

    between: tuple[int, int]
    linear: float
    paired: float
    difference: Estimate


@dataclass(frozen=True)
class MultivariateTests:
    """Tests of the simulated errors against the linear covariance.

    The tests of the plain sample need draws that are independent one by one, and are none for other designs; those of
    its covariance and of NEES also need normal sources (with Student's t of ten degrees of freedom the likelihood ratio
    was measured to reject 11 % of true hypotheses at a level of 5 %). Those of the paired differences hold for every
    design, given enough independent blocks (for the covariance of antithetic pairs: `FEWEST_PAIRS`).

    Attributes
    ----------
    covariance : HypothesisTest or None
        Likelihood ratio of the plain sample covariance against the linear one; assumes normal errors.
    covariance_paired : HypothesisTest or None
        Hotelling's T-squared of all distinct elements of cov(y) - cov(z), y and z whitened by the linear covariance.
    bias : HypothesisTest or None
        Hotelling's T-squared of the plain mean against the linear one.
    bias_paired : HypothesisTest or None
        Hotelling's T-squared of the differences y - z.
    nees : HypothesisTest or None
        Kolmogorov-Smirnov test of the stored samples' NEES against chi-square.
    nees_expected : (float, float) or None
        Interval of the plain mean NEES at the confidence required, if the errors are normal with the linear covariance.
    contained : tuple of Containment
        Shares of the samples inside the linear ellipsoids; empty for designs without independent draws.
    normality : Mardia or None
        Mardia's tests of the stored samples.
    skewness, excess_kurtosis : tuple of Estimate
        One for each output.
    correlations : tuple of CorrelationDifference
        One for each pair of outputs with dispersion.
    """

    covariance: HypothesisTest | None
    covariance_paired: HypothesisTest | None
    bias: HypothesisTest | None
    bias_paired: HypothesisTest | None
    nees: HypothesisTest | None
    nees_expected: tuple[float, float] | None
    contained: tuple[Containment, ...]
    normality: Mardia | None
    skewness: tuple[Estimate, ...]
    excess_kurtosis: tuple[Estimate, ...]
    correlations: tuple[CorrelationDifference, ...]


def compare_jointly(
    samples: ReducedSamples, model: Model, confidence: float, design: SamplingDesign
) -> MultivariateTests:
    """Test the outputs that are judged together against P S P^T, with a confidence for each interval."""
    linear, judged, rank = model.judged_covariance, model.judged, model.whitened.rank
    moments, stored = samples.moments, samples.stored
    count, blocks, fewest = moments.samples, len(moments.counts), design.fewest_blocks
    sample, predicted = (np.where(np.outer(judged, judged), covariance, 0.0) for covariance in moments.covariances)
    paired = sample - predicted + linear
    plain = design.independent and blocks >= fewest
    counted = bool(judged.all()) or moments is stored  # a stored summary has the counts for all outputs together
    ranked = design.independent and stored.samples >= fewest
    with side_threads(1 if count > STRETCH else 0) as executor:  # for the slowest part
        elements = _covariance_testable(blocks, count, rank)
        tests = executor.submit(_hotelling_tests, moments, rank, elements) if blocks >= fewest else None
        shapes = [
            executor.submit(
                lambda i: shape_of_sums(moments.powers(i), moments.counts, fewest if judged[i] else np.inf), i
            )
            for i in range(len(linear))
        ]
        return MultivariateTests(
            covariance=covariance_likelihood_ratio(sample, count, linear) if plain and design.normal else None,
            nees=distribution_test(stored.distances, rank) if ranked and design.normal else None,
            nees_expected=mean_interval(count, rank, confidence) if plain and design.normal else None,
            contained=containment(moments.within(), count, confidence) if plain and counted else (),
            normality=mardia(stored.y[:, judged]) if ranked else None,
            correlations=tuple(_correlations(linear, paired, moments, fewest)),
            skewness=tuple(shape.result()[0] for shape in shapes),
            excess_kurtosis=tuple(shape.result()[1] for shape in shapes),
            bias=tests.result()[0] if tests and plain else None,
            bias_paired=tests.result()[1] if tests else None,
            covariance_paired=tests.result()[2] if tests else None,
        )


def _covariance_testable(blocks: int, samples: int, rank: int) -> bool:
    """Return whether the blocks are enough to test the paired covariance, and its elements few enough.

    See `FEWEST_PAIRS` and `MOST_ELEMENTS`.
    """
    pairs = blocks < samples <= 2 * blocks
    enough = not pairs or blocks >= FEWEST_PAIRS
    return enough and rank * (rank + 1) // 2 < min(blocks, MOST_ELEMENTS)


def _hotelling_tests(moments: BlockMoments, rank: int, elements: bool) -> list[HypothesisTest | None]:
    """Test the mean of y, that of y - z, and the distinct elements of cov(y) - cov(z), in whitened coordinates.

    Without ``elements`` the last is none.

    A difference that is only rounding counts as zero.
    """
    groups = (slice(0, rank), slice(rank, 2 * rank), slice(2 * rank, None))
    gathered, squares = [RunningScatter() for _ in groups], np.zeros(1)
    for sums, own in moments.whitened(elements):
        squares = squares + own
        for group, running in zip(groups, gathered, strict=True):
            running.add(sums[group])
    held = np.sqrt(squares / moments.samples) > ROUNDING
    held[groups[0]] = True
    return [
        hotelling(
            running.count,
            np.where(held[group], running.mean, 0.0),
            np.where(np.outer(held[group], held[group]), running.scatter / (running.count - 1), 0.0),
        )
        for group, running in zip(groups, gathered, strict=True)
    ]


def _correlations(
    linear: Array, paired: Array, moments: BlockMoments, fewest: float
) -> Iterator[CorrelationDifference]:
    """Estimate the differences of all correlations, their errors by the influence function of r.

    With ``r = C_ij / sqrt(C_ii C_jj)`` and d_ij the contribution of a sample to cov(y) - cov(z), that is ``d_ij /
    sqrt(C_ii C_jj) - r/2 (d_ii/C_ii + d_jj/C_jj)``. One row of pairs at a time: memory grows with their outputs alone.
    """
    dispersed = np.flatnonzero((np.diag(linear) > 0.0) & (np.diag(paired) > 0.0))
    if len(dispersed) < 2:
        return
    own = np.stack([moments.products(i, i)[1] / paired[i, i] for i in dispersed.tolist()])
    for place, i in enumerate(dispersed[:-1].tolist()):
        others = dispersed[place + 1 :]
        roots = np.sqrt(paired[i, i] * paired[others, others])
        coefficients = paired[i, others] / roots
        influences = moments.paired_products(i, others) / roots[:, None]
        influences -= 0.5 * coefficients[:, None] * (own[place] + own[place + 1 :])
        before = linear[i, others] / np.sqrt(linear[i, i] * linear[others, others])
        estimates = summed_means(influences, moments.counts, fewest)
        columns = others.tolist(), before.tolist(), coefficients.tolist(), estimates
        for j, known, simulated, estimate in zip(*columns, strict=True):
            yield CorrelationDifference((i, j), known, simulated, replace(estimate, value=simulated - known))
