"""Comparison of the whole matrix: NEES, mean error, and the combinations of outputs that differ most."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from mcnav.analysis.block_moments import ReducedSamples
from mcnav.analysis.combinations import Combination, combine
from mcnav.analysis.decision_rule import DecisionRule
from mcnav.analysis.verdict import Judgement, Verdict, combine_verdicts
from mcnav.arrays.products import transform
from mcnav.arrays.types import Array
from mcnav.statistics.estimates import Estimate
from mcnav.statistics.whitening import Whitening


class Cause(StrEnum):
    """Part of the joint distribution that is not the linear one."""

    UNPREDICTED = "unpredicted"
    MEAN = "mean"
    DISPERSION = "dispersion"


@dataclass(frozen=True)
class Ellipsoid:
    """Comparison of the whole matrix: the simulated errors normalised by the linear covariance.

    Attributes
    ----------
    dimension : int
        Rank of the linear covariance: the expected NEES.
    values : ndarray, shape (n,)
        NEES of each stored sample against the linear mean and covariance.
    nees : Estimate
        Mean normalised estimation error squared of the simulated errors.
    nees_paired : Estimate
        The same mean with the linear errors' NEES, whose mean is the dimension exactly, as control variate.
    judgement : Judgement
        Judgement of ``sqrt(mean NEES / dimension)``, the sigma ratio averaged over all directions; a mean error counts.
    nees_about_mean : float
        Paired estimate of the mean NEES about the sample mean: of the dispersion without the mean error.
    dispersion : Judgement or None
        Judgement of its root over the dimension; none where that of the mean NEES agrees.
    directions : ndarray, shape (dimension, outputs)
        Weights, on outputs in units of their linear sigmas, of the combinations in which the paired covariance differs
        least to most from the linear one; each of unit length.
    direction_ratios : ndarray, shape (dimension,)
        Sigma ratio of each combination, rising; NaN where the paired variance is negative.
    differing : Combination or None
        Combination whose sigma ratio is farthest from one.
    shifted : Combination or None
        Combination in which the mean error is largest in linear sigmas; none without a mean error.
    mean_error : float
        Mean error there, in linear sigmas: the root of what it adds to the mean NEES.
    unpredicted : tuple of Combination
        Those that linear analysis holds fixed, or nearly so, and that are dispersed otherwise, the most dispersed
        first, in sigmas of its lead output.
    """

    dimension: int
    values: Array
    nees: Estimate
    nees_paired: Estimate
    judgement: Judgement
    nees_about_mean: float
    dispersion: Judgement | None
    directions: Array
    direction_ratios: Array
    differing: Combination | None = None
    shifted: Combination | None = None
    mean_error: float = 0.0
    unpredicted: tuple[Combination, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """Verdict on the joint distribution: on the mean NEES, and on what linear analysis holds fixed."""
        fixed = [combination.judgement.verdict for combination in self.unpredicted if combination.judgement is not None]
        return combine_verdicts([self.judgement.verdict, *fixed])

    @property
    def cause(self) -> Cause | None:
        """Cause of the verdict; none where the joint distribution agrees.

        A mean error counts if it adds more to the mean NEES than the dispersion does.
        """
        if self.verdict == Verdict.AGREES:
            return None
        if self.unpredicted and (self.judgement.verdict != self.verdict or self.surprised):
            return Cause.UNPREDICTED
        by_dispersion = abs(self.nees_about_mean - self.dimension)
        return Cause.MEAN if self.mean_error**2 > by_dispersion else Cause.DISPERSION

    @property
    def surprised(self) -> bool:
        """Return whether something is dispersed that linear analysis holds fixed."""
        return any(
            combination.judgement.verdict == Verdict.DIFFERS
            for combination in self.unpredicted
            if combination.judgement
        )

    @property
    def foremost(self) -> Combination | None:
        """Combination that shows the cause; none where the joint distribution agrees."""
        match self.cause:
            case Cause.UNPREDICTED:
                return self.unpredicted[0]
            case Cause.MEAN:
                return self.shifted
            case Cause.DISPERSION:
                return self.differing
            case None:
                return None

    @property
    def farthest(self) -> int:
        """Combination whose sigma ratio is farthest from one."""
        return int(np.argmax(np.abs(np.nan_to_num(self.direction_ratios, nan=0.0) - 1.0)))


def compare_ellipsoid(given: Whitening, samples: ReducedSamples, paired: Array, rule: DecisionRule) -> Ellipsoid:
    """Compare the NEES, and the paired covariance, with the linear covariance in its range."""
    moments, dimension = samples.moments, given.rank
    nees, difference = (rule.mean(sums, moments.counts) for sums in moments.nees())
    controlled = replace(difference, value=dimension + difference.value)
    judgement, dispersion = rule.judge(controlled, float(dimension)), None
    if judgement.verdict != Verdict.AGREES:
        about = rule.mean(moments.unbiased * moments.nees_about_means(), moments.counts)
        dispersion = rule.judge(replace(about, value=dimension + about.value), float(dimension))
    whitened = transform(given.matrix.T, paired)
    ratios, rotations = np.linalg.eigh(whitened)
    directions = given.directions @ rotations
    directions = directions / np.linalg.norm(directions, axis=0)
    return Ellipsoid(
        dimension,
        samples.stored.distances,
        nees,
        controlled,
        judgement,
        float(np.trace(whitened)),
        dispersion,
        directions.T,
        np.sqrt(np.where(ratios >= 0.0, ratios, np.nan)),
    )


def name_combinations(
    ellipsoid: Ellipsoid,
    given: Whitening,
    linear: Array,
    paired: Array,
    bias: Array,
    unpredicted: tuple[Combination, ...],
) -> Ellipsoid:
    """Describe the combinations of outputs in which dispersion and mean differ most, and those not predicted.

    Parameters
    ----------
    given : Whitening
        That of the linear covariance.
    linear, paired : ndarray, shape (outputs, outputs)
    bias : ndarray, shape (outputs,)
        Simulated less linear means.
    """
    sigma, whitened = np.sqrt(np.diag(linear)), given.matrix.T @ bias
    away = given.directions @ whitened
    return replace(
        ellipsoid,
        differing=combine(ellipsoid.directions[ellipsoid.farthest], sigma, linear, paired, bias),
        shifted=combine(away, sigma, linear, paired, bias) if np.any(away) else None,
        mean_error=float(np.linalg.norm(whitened)),
        unpredicted=unpredicted,
    )
