"""Change of each output's dispersion and mean from one campaign to another.

Where a mean error exceeds one sigma, root mean squares are compared in place of sigmas.

The paired estimates are compared, sigma^2 = (P S P^T)_ii + mean(q) with q the square of a simulated less that of the
linear error. With q / sigma^2 of both runs, the logarithm of the sigma ratio has the error of half the difference
of their means. Where both runs drew the same samples, by seed and index, the difference is formed sample by sample, and
common sampling noise cancels again; otherwise the two errors add in squares, with Welch's degrees of freedom. Intervals
reach further where the skewness of the blocks requires it (`mcnav.statistics.estimates`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from mcnav.analysis.decision_rule import spread_of
from mcnav.analysis.mean_errors import Quantity, departures
from mcnav.analysis.model import Model
from mcnav.arrays.types import Array, IndexArray
from mcnav.sampler.designs import SamplingDesign
from mcnav.statistics.estimates import Estimate, blocked_mean, paired_squares


@dataclass(frozen=True)
class SampleSet:
    """Successful samples of one run: index, shape (n,), errors, shape (n, sources), and outputs, shape (n, outputs).

    Samples with noise have linear outcomes of their own, shape (n, outputs); those of others follow from their errors.
    ``quantities`` say what the outputs are of.
    """

    model: Model
    index: IndexArray
    errors: Array
    outputs: Array
    design: SamplingDesign
    linear: Array | None = None
    quantities: tuple[Quantity, ...] = ()

    @property
    def blocks(self) -> IndexArray:
        """Independent block of each sample."""
        return self.design.blocks(self.index)


@dataclass(frozen=True)
class Change:
    """Change of one output from a run to a later one, SI, with common draws or without.

    The paired sigmas before and after have a ratio, NaN where either is zero; ``mean`` is the later mean less the
    earlier one. Where ``about_zero``, they are root mean squares of the errors.
    """

    before: float
    after: float
    ratio: float
    interval: tuple[float, float]
    mean: Estimate
    common: bool
    about_zero: bool = False

    @property
    def certain(self) -> bool:
        """Return whether the interval of the ratio excludes one."""
        return bool(np.isfinite(self.interval).all()) and not self.interval[0] <= 1.0 <= self.interval[1]


def change(
    before: SampleSet, after: SampleSet, outputs: tuple[int, int], common: bool, confidence: float,
    about_zero: bool = False,
) -> Change:  # fmt: skip
    """Estimate the change of one output, given by its index in each run; samples of one index may be common draws.

    ``about_zero`` compares root mean squares of the errors in place of sigmas.
    """
    squares, deviations, sigmas, means = [], [], [], []
    for samples, i in ((before, outputs[0]), (after, outputs[1])):
        square, deviation, linear, centre = _controlled(samples, i, about_zero)
        variance = linear + float(np.mean(square))
        variance = variance if variance > samples.model.floor[i] ** 2 else 0.0
        sigmas.append(float(np.sqrt(variance)) if variance > 0.0 else 0.0)
        squares.append(square / variance if variance > 0.0 else square)
        deviations.append(deviation)
        means.append(centre)
    withheld = outputs[0] in before.model.withheld or outputs[1] in after.model.withheld
    fewest = math.inf if withheld else max(before.design.fewest_blocks, after.design.fewest_blocks)
    spread = _difference(before, after, squares, common, fewest)
    mean = _difference(before, after, deviations, common, fewest)
    shifted = Estimate(means[1] - means[0] + mean.value, mean.standard_error, mean.degrees_of_freedom)
    if not all(sigmas):
        unknown = float("nan"), float("nan")
        return Change(sigmas[0], sigmas[1], float("nan"), unknown, shifted, common, about_zero)
    ratio, (low, high) = sigmas[1] / sigmas[0], spread.interval(confidence)
    down, up = 0.5 * (spread.value - low), 0.5 * (high - spread.value)
    interval = ratio / spread_of(down), ratio * spread_of(up)
    return Change(sigmas[0], sigmas[1], ratio, interval, shifted, common, about_zero)


def _controlled(samples: SampleSet, i: int, about_zero: bool) -> tuple[Array, Array, float, float]:
    """Return squares and deviations of simulated less linear errors, and the variance and mean that they correct.

    Squares ``about_zero`` correct the mean square: with z the linear error, ``E[y^2] = E[z^2] + mean(y^2 - z^2)``.
    """
    model, simulated = samples.model, samples.outputs[:, i]
    if samples.linear is not None:
        linear = samples.linear[:, i]
    else:
        linear = model.nominal[i] + samples.errors @ model.partials[i]
    variance, mean = float(model.outcome_covariance[i, i]), float(model.outcome_mean[i])
    if about_zero:
        moved = float(departures([samples.quantities[i]], np.zeros(1), model.nominal[[i]])[0])
        squares = (simulated + moved) ** 2 - (linear + moved) ** 2
        return squares, simulated - linear, variance + (mean + moved) ** 2, mean
    return paired_squares(simulated, linear), simulated - linear, variance, mean


def _difference(
    before: SampleSet, after: SampleSet, values: list[Array], common: bool, fewest: float
) -> Estimate:  # fmt: skip
    """Estimate the mean of the later values less that of the earlier ones; without an interval of fewer blocks."""
    value = float(np.mean(values[1]) - np.mean(values[0]))
    if common:
        _, first, second = np.intersect1d(before.index, after.index, assume_unique=True, return_indices=True)
        if len(first) == len(before.index) == len(after.index):
            return blocked_mean(values[1][second] - values[0][first], before.blocks[first], fewest)
        if len(first):
            error = blocked_mean(*_weighted(before, after, values), fewest)
            return replace(error, value=value, degrees_of_freedom=min(len(first), len(second)) - 1.0)
    one, two = (blocked_mean(v, f.blocks, fewest) for v, f in zip(values, (before, after), strict=True))
    return _welch(value, one, two)


def _weighted(before: SampleSet, after: SampleSet, values: list[Array]) -> tuple[Array, IndexArray]:
    """Return differences, and their blocks, of runs with partly common samples, each weighted as in its own mean."""
    index = np.union1d(before.index, after.index)
    weighted, blocks = np.zeros(len(index)), np.zeros(len(index), dtype=np.int64)
    for sign, samples, own in ((-1.0, before, values[0]), (1.0, after, values[1])):
        place = np.searchsorted(index, samples.index)
        weighted[place] += sign * (own - own.mean()) * len(index) / len(own)
        blocks[place] = samples.blocks
    return weighted, blocks


def _welch(value: float, one: Estimate, two: Estimate) -> Estimate:
    """Estimate a difference of independent means; its third moment is the difference of theirs."""
    errors, degrees = (one.standard_error, two.standard_error), (one.degrees_of_freedom, two.degrees_of_freedom)
    error = float(np.hypot(*errors))
    if not np.isfinite(error):
        return Estimate(value, float("inf"), 0.0)
    if error == 0.0:
        return Estimate(value, 0.0, min(degrees))
    pooled = error**4 / sum(s**4 / d for s, d in zip(errors, degrees, strict=True) if s > 0.0)
    asymmetry = (two.asymmetry * errors[1] ** 3 - one.asymmetry * errors[0] ** 3) / error**3
    return Estimate(value, error, float(pooled), float(asymmetry))
