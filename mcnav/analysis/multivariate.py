"""The outputs together: tests of the whole covariance, of the bias and of normality, and how correlations differ."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import chain, combinations
from typing import Final

import numpy as np

from mcnav._subprocess import side_threads
from mcnav._types import Array, IndexArray
from mcnav.statistics.chi_square import Containment, containment, distribution_test, mean_interval
from mcnav.statistics.chunked import scatter, squared_distances, stretches_of_blocks
from mcnav.statistics.covariance_tests import covariance_likelihood_ratio
from mcnav.statistics.estimates import Estimate, block_begins, blocked_mean
from mcnav.statistics.hotelling import hotelling
from mcnav.statistics.hypothesis_test import HypothesisTest
from mcnav.statistics.mardia import Mardia, mardia
from mcnav.statistics.shape import skewness_and_kurtosis
from mcnav.statistics.whitening import Whitening, whitening

ROUNDING: Final = 1e-9
"""Differences between flown and linear errors, as shares of a sigma, that are taken for rounding."""

FEWEST_PAIRS: Final = 5_000
"""Antithetic pairs below which the paired covariance is not tested.

What is true was measured to be rejected at a level of 5 % in 8.8 % of campaigns with 1,000 pairs, 6.9 % with 2,500 and
6.0 % with 5,000 or 10,000, each within 0.4; single samples give 5.8 % at 1,000. The odd part of the differences cancels
within a pair, and a skewed rest is left.
"""


@dataclass(frozen=True)
class CorrelationDifference:
    """Paired estimate of one correlation less the linear one.

    Attributes
    ----------
    between : (int, int)
        The outputs' numbers.
    linear, paired : float
        The two correlation coefficients.
    difference : Estimate
    """

    between: tuple[int, int]
    linear: float
    paired: float
    difference: Estimate


@dataclass(frozen=True)
class MultivariateTests:
    """What the flown errors say of the linear covariance as a whole.

    The tests of the plain sample need draws that are independent one by one, and are none for other designs; those of
    its covariance and of NEES need normal sources besides (with Student's t of ten degrees of freedom the likelihood
    ratio was measured to reject 11 % of what is true at a level of 5 %). Those of the paired differences hold for every
    design, given enough independent blocks (that of the covariance of antithetic pairs: `FEWEST_PAIRS`).

    Attributes
    ----------
    covariance : HypothesisTest or None
        Likelihood ratio of the plain sample covariance against the linear one; it takes the errors for normal.
    covariance_paired : HypothesisTest or None
        Hotelling's T-squared of all distinct elements of cov(y) - cov(z), y and z whitened by the linear covariance.
    bias : HypothesisTest or None
        Hotelling's T-squared of the plain mean against the linear one.
    bias_paired : HypothesisTest or None
        The same of the differences y - z.
    nees : HypothesisTest or None
        Kolmogorov-Smirnov test of the flown errors' NEES against chi-square.
    nees_expected : (float, float) or None
        Where the plain mean NEES lies with the confidence asked for, if the errors are as linear analysis has them.
    contained : tuple of Containment
        Shares of the samples within the linear ellipsoids; empty for designs without independent draws.
    normality : Mardia or None
    skewness, excess_kurtosis : tuple of Estimate
        Of each output.
    correlations : tuple of CorrelationDifference
        Of each pair of outputs with dispersion.
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
    linear: Array,
    centre: Array,
    flown: Array,
    predicted: Array,
    paired: Array,
    blocks: IndexArray,
    fewest: float,
    confidence: float,
    normal: bool,
) -> MultivariateTests:
    """Test the outputs of flights, all of which succeeded, against the linear covariance.

    Parameters
    ----------
    linear : ndarray, shape (outputs, outputs)
        P S P^T.
    centre : ndarray, shape (outputs,)
        Linear mean.
    flown, predicted : ndarray, shape (n, outputs)
        y, and the linear errors z of the same draws.
    paired : ndarray, shape (outputs, outputs)
        Paired estimate of the covariance.
    blocks : ndarray of int, shape (n,)
    fewest : float
        Independent blocks below which nothing is claimed.
    confidence : float
        Of each interval.
    normal : bool
        Whether the sources are normal: tests that take the outputs of linear analysis for normal are made only then.
    """
    given = whitening(linear)
    count = len(flown)
    begins = block_begins(blocks)
    single, enough = len(begins) == count, len(begins) >= fewest
    distances = squared_distances(flown, centre, given)
    plain = single and enough
    with side_threads(1) as beside:  # what takes longest
        pairs = beside.submit(_paired, given, flown, predicted, begins) if enough else None
        shapes = [beside.submit(skewness_and_kurtosis, column, blocks, fewest) for column in flown.T]
        return MultivariateTests(
            covariance=covariance_likelihood_ratio(scatter(flown) / (count - 1), count, linear)
            if plain and normal
            else None,
            bias=hotelling(flown, centre, given) if plain else None,
            nees=distribution_test(distances, given.rank) if plain and normal else None,
            nees_expected=mean_interval(count, given.rank, confidence) if plain and normal else None,
            contained=containment(distances, given.rank, confidence) if plain and given.rank else (),
            normality=mardia(flown) if plain else None,
            correlations=tuple(
                _correlation((i, j), linear, paired, flown, predicted, blocks, fewest)
                for i, j in combinations(range(len(linear)), 2)
                if min(linear[i, i], linear[j, j], paired[i, i], paired[j, j]) > 0.0
            ),
            skewness=tuple(shape.result()[0] for shape in shapes),
            excess_kurtosis=tuple(shape.result()[1] for shape in shapes),
            bias_paired=pairs.result()[0] if pairs else None,
            covariance_paired=pairs.result()[1] if pairs and covariance_testable(len(begins), count) else None,
        )


def covariance_testable(blocks: int, samples: int) -> bool:
    """Whether that many blocks are enough to test the paired covariance; see `FEWEST_PAIRS`."""
    pairs = blocks < samples <= 2 * blocks
    return not pairs or blocks >= FEWEST_PAIRS


def joint_of_blocks(sums: Array) -> HypothesisTest | None:
    """T-squared of a mean of zero, from sums over independent blocks, shape (b, k)."""
    return hotelling(sums, np.zeros(sums.shape[1]))


def _paired(
    given: Whitening, flown: Array, predicted: Array, begins: IndexArray
) -> tuple[HypothesisTest | None, HypothesisTest | None]:
    """T-squared of mean(y) - mean(z), and of the distinct elements of cov(y) - cov(z), in whitened coordinates.

    From sums over blocks; a quantity that holds nothing but rounding counts as zeros.
    """
    means = given.matrix.T @ flown.mean(axis=0), given.matrix.T @ predicted.mean(axis=0)
    elements = list(zip(*np.triu_indices(given.rank), strict=True))
    sums = np.empty((given.rank + len(elements), len(begins)))
    squares = np.zeros(len(sums))
    for rows, own in stretches_of_blocks(begins, len(flown)):
        u, v = (given.matrix.T @ values[rows].T for values in (flown, predicted))
        starts = begins[own] - rows.start
        y, z = u - means[0][:, None], v - means[1][:, None]
        quantities = chain(u - v, (y[a] * y[b] - z[a] * z[b] for a, b in elements))
        for k, quantity in enumerate(quantities):
            squares[k] += quantity @ quantity
            sums[k, own] = np.add.reduceat(quantity, starts)
    sums[np.sqrt(squares / len(flown)) <= ROUNDING] = 0.0
    return joint_of_blocks(sums[: given.rank].T), joint_of_blocks(sums[given.rank :].T)


def _correlation(
    pair: tuple[int, int],
    linear: Array,
    paired: Array,
    flown: Array,
    predicted: Array,
    blocks: IndexArray,
    fewest: float,
) -> CorrelationDifference:
    """Difference of one correlation, its error by the influence function of r = C_ij / sqrt(C_ii C_jj).

    With d_ij what a sample adds to cov(y) - cov(z), that is ``d_ij / sqrt(C_ii C_jj) - r/2 (d_ii/C_ii + d_jj/C_jj)``.
    """
    i, j = pair
    (y_i, y_j), (z_i, z_j) = ([values[:, k] - values[:, k].mean() for k in pair] for values in (flown, predicted))
    root = float(np.sqrt(paired[i, i] * paired[j, j]))
    found = float(paired[i, j]) / root
    own = (y_i * y_i - z_i * z_i) / paired[i, i] + (y_j * y_j - z_j * z_j) / paired[j, j]
    influence = blocked_mean((y_i * y_j - z_i * z_j) / root - 0.5 * found * own, blocks, fewest)
    before = float(linear[i, j] / np.sqrt(linear[i, i] * linear[j, j]))
    difference = replace(influence, value=found - before)
    return CorrelationDifference(pair, before, found, difference)
