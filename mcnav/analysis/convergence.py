"""How the sigma ratios settle as samples are added."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.analysis.comparison import Comparison, Model, ratio_interval
from mcnav.statistics.estimates import Estimate, block_begins, block_sums

POINTS: Final = 40
"""Sample sizes looked at, evenly spaced on the scale of their logarithm."""


@dataclass(frozen=True)
class RunningRatio:
    """Sigma ratios of one kind from the first so many samples.

    Attributes
    ----------
    ratio, low, high : ndarray, shape (sizes, outputs)
        NaN for an output without linear dispersion.
    """

    ratio: Array
    low: Array
    high: Array


@dataclass(frozen=True)
class Convergence:
    """Sigma ratios against the number of samples.

    Attributes
    ----------
    sizes : ndarray of int, shape (sizes,)
        Whole blocks each.
    plain, paired : RunningRatio
        Each interval at the confidence of the final one, by itself: together, over all sizes, they hold at less.
    """

    sizes: IndexArray
    plain: RunningRatio
    paired: RunningRatio


def convergence(
    model: Model,
    errors: Array,
    outcomes: Array,
    blocks: IndexArray,
    comparison: Comparison,
    fewest: float,
) -> Convergence | None:
    """Sigma ratios from growing parts of a campaign.

    The blocks' sums of powers are added up once; squares are about the mean of all samples, which takes nothing from
    the intervals and makes the curves end where the report's ratios are.

    Parameters
    ----------
    model : Model
    errors : ndarray, shape (n, sources)
        Of the samples that did not fail.
    outcomes : ndarray, shape (n, outputs)
    blocks : ndarray of int, shape (n,)
    comparison : Comparison
        Of the same samples.
    fewest : float
        Independent blocks below which there is no interval.

    Returns
    -------
    Convergence or None
        None with too few blocks to show anything.
    """
    if not comparison.outputs:
        return None
    unbiased = len(outcomes) / (len(outcomes) - 1.0)
    variance = np.diag(comparison.covariance_linear)
    sizes = np.diff(block_begins(blocks), append=len(blocks)).astype(float)
    plain, paired = np.empty((2, len(variance), len(sizes))).swapaxes(1, 2)
    for i, row in enumerate(model.partials):
        linear = errors @ row
        squares, expected = (unbiased * (each - each.mean()) ** 2 for each in (outcomes[:, i], linear))
        plain[:, i], paired[:, i] = (block_sums(each, blocks) for each in (squares, squares - expected))
    return _converging(sizes, plain, paired, variance, comparison.confidence_each, fewest)


def convergence_of_blocks(
    sizes: Array, flown: Array, predicted: Array, variance: Array, confidence: float, fewest: float
) -> Convergence | None:
    """As `convergence`, from sums over blocks of the squares of flown and linear errors, both shape (b, outputs)."""
    return _converging(sizes, flown, flown - predicted, variance, confidence, fewest)


def _converging(
    sizes: Array, plain: Array, paired: Array, variance: Array, confidence: float, fewest: float
) -> Convergence | None:
    ends = np.cumsum(sizes).astype(np.int64)
    number = len(ends)
    if number < 2 * fewest:
        return None
    picked = np.unique(np.geomspace(fewest, number, POINTS).round().astype(int)) - 1
    runs = {}
    for key, sums, known in (("plain", plain, 0.0), ("paired", paired, variance)):
        runs[key] = _running(_added(sums, sizes, picked + 1), ends[picked], picked + 1, known, variance, confidence)
    return Convergence(ends[picked], runs["plain"], runs["paired"])


def _added(sums: Array, sizes: Array, ends: IndexArray) -> list[Array]:
    """Sums of T, T^2, T n, n^2, T^3, T^2 n, T n^2 and n^3 over the first so many blocks, a row each.

    T, shape (b, k), is a block's sum and n, shape (b,), its size.
    """
    rows = []
    for begin, end in pairwise([0, *ends]):
        total, size = sums[begin:end], sizes[begin:end, None]
        square, crossed, squared = total * total, total * size, size * size
        powers = (total, square, crossed, squared, square * total, square * size, crossed * size, squared * size)
        rows.append([each.sum(axis=0) for each in powers])
    return [np.cumsum(each, axis=0) for each in zip(*rows, strict=True)]


def _running(
    added: list[Array],
    sizes: IndexArray,
    blocks: IndexArray,
    known: Array | float,
    variance: Array,
    confidence: float,
) -> RunningRatio:
    """Ratios and intervals from cumulative sums over blocks of T, T^2, T n, n^2, T^3, T^2 n, T n^2 and n^3.

    T is a block's sum and n its size. The ratio estimator's error is ``B / (B - 1) sum_b (T_b - m n_b)^2 / n^2``, and
    the asymmetry from the third powers (`mcnav.statistics.estimates`).
    """
    total, squares, crossed, counts, *third = added
    mean = total / sizes[:, None]
    spread = np.maximum(squares - 2.0 * mean * crossed + mean**2 * counts, 0.0)
    cubes = third[0] - 3.0 * mean * third[1] + 3.0 * mean**2 * third[2] - mean**3 * third[3]
    asymmetry = np.divide(cubes, spread**1.5, out=np.zeros_like(cubes), where=spread > 0.0)
    error = np.sqrt(spread * (blocks / (blocks - 1.0))[:, None]) / sizes[:, None]
    shape = (len(sizes), len(variance))
    ratio, low, high = np.full(shape, np.nan), np.full(shape, np.nan), np.full(shape, np.nan)
    for (row, i), value in np.ndenumerate(known + mean):
        if variance[i] > 0.0:
            estimate = Estimate(float(value), float(error[row, i]), float(blocks[row] - 1), float(asymmetry[row, i]))
            ratio[row, i], (low[row, i], high[row, i]) = ratio_interval(estimate, float(variance[i]), confidence)
    return RunningRatio(ratio, low, high)
