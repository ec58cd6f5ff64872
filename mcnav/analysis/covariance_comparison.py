"""Comparison of a covariance with samples of which nothing else is known: no draws, no linear outcomes.

The estimates are those of `mcnav.analysis.comparison` without their control variate, so that their intervals are as
wide as the sampling noise of a variance, ``sigma_ratio (1 +- 1.96 / sqrt(2 n))`` for n normal samples at 95 %.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mcnav.analysis.block_moments import SampleMoments
from mcnav.analysis.decision_rule import DecisionRule
from mcnav.analysis.verdict import LARGEST_FAILED_SHARE, Judgement, Verdict, combine_verdicts
from mcnav.arrays.products import transform
from mcnav.arrays.types import Array
from mcnav.sampler.designs import SamplingDesign
from mcnav.statistics.estimates import Estimate, block_begins
from mcnav.statistics.whitening import whitening


@dataclass(frozen=True)
class CovarianceComparison:
    """Samples against a covariance, SI.

    Attributes
    ----------
    samples, failed : int
    outputs : tuple of Judgement
        Sigma of the samples over that of the covariance, one for each output.
    nees : Estimate
        Mean normalised estimation error squared; its expectation is ``dimension``.
    dimension : int
        Rank of the covariance.
    together : Judgement or None
        Judgement of ``sqrt(mean NEES / dimension)``; none for a covariance of zero.
    direction : ndarray, shape (outputs,)
        Weights, on outputs in units of their sigmas, of the combination with the worst sigma ratio.
    direction_ratio : float
        Its sigma ratio; it is the largest of all directions, so that it has no interval.
    """

    samples: int
    failed: int
    sample: Array
    outputs: tuple[Judgement, ...]
    nees: Estimate
    dimension: int
    together: Judgement | None
    direction: Array
    direction_ratio: float

    @property
    def verdict(self) -> Verdict:
        """Verdict on the sigmas; agreement needs that hardly any sample failed."""
        verdict = combine_verdicts([output.verdict for output in self.outputs])
        too_many = self.failed > LARGEST_FAILED_SHARE * (self.samples + self.failed)
        return Verdict.UNDECIDED if verdict == Verdict.AGREES and too_many else verdict


def compare_covariance(
    covariance: Array, outcomes: Array, mean: Array | None, rule_of: tuple[float, float], design: SamplingDesign
) -> CovarianceComparison:
    """Compare samples with a covariance.

    Parameters
    ----------
    covariance : ndarray, shape (outputs, outputs)
    outcomes : ndarray, shape (n, outputs)
        NaN in the row of a sample that failed.
    mean : ndarray, shape (outputs,), optional
        About which NEES is formed; by default that of the samples.
    rule_of : (float, float)
        Tolerance on sigma ratios, and confidence of all verdicts together.
    """
    tolerance, confidence = rule_of
    finite = np.isfinite(outcomes).all(axis=1)
    y, blocks = np.asfortranarray(outcomes[finite]), design.blocks(np.flatnonzero(finite))
    given = whitening(covariance)
    centre = y.mean(axis=0) if mean is None else mean
    moments = SampleMoments(y, np.broadcast_to(centre, y.shape), block_begins(blocks), centre, given)
    each = 1.0 - (1.0 - confidence) / (len(covariance) + 1)
    rule = DecisionRule(len(y), tolerance, each, design.fewest_blocks)
    outputs = tuple(
        rule.judge(rule.mean(moments.unbiased * moments.products(i, i)[0], moments.counts), float(covariance[i, i]))
        for i in range(len(covariance))
    )
    nees = rule.mean(moments.nees()[0] * (moments.unbiased if mean is None else 1.0), moments.counts)
    together = rule.judge(nees, float(given.rank)) if given.rank else None
    sample = moments.covariances[0]
    ratios, rotations = np.linalg.eigh(transform(given.matrix.T, sample))
    sigmas = np.sqrt(np.maximum(ratios, 0.0))
    farthest = int(np.argmax(np.abs(sigmas - 1.0))) if given.rank else 0
    direction = given.directions @ rotations[:, farthest] if given.rank else np.zeros(len(covariance))
    size = float(np.linalg.norm(direction))
    return CovarianceComparison(
        len(y), int(np.count_nonzero(~finite)), sample, outputs, nees, given.rank, together,
        direction / size if size else direction, float(sigmas[farthest]) if given.rank else 1.0,
    )  # fmt: skip
