"""Combinations of outputs in which simulation and linear analysis differ, and those that linear analysis holds fixed.

A combination is ``c = sum w_i y_i``, SI. Its *lead* is the output of the largest term in linear sigmas, whose weight is
one, so that c has the unit of that output.

The linear covariance C of dependent outputs is singular: in its null space it predicts no dispersion. With outputs in
units of their linear sigmas, the correlation matrix is ``F F^T``, where F stacks ``P S^(1/2)`` and the square roots of
the processes' covariances. A QR factorization of F^T with column pivoting splits the outputs into independent and
dependent ones; each dependent output less its combination of independent ones is one basis vector of the null space
(Golub and Van Loan, *Matrix Computations*, 2013, section 5.4.2). F has the weights of such a combination to 1e-16, its
square C only to 1e-8.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from mcnav.analysis.block_moments import BlockMoments
from mcnav.analysis.decision_rule import DecisionRule
from mcnav.analysis.floor import SIMULATED
from mcnav.analysis.verdict import Judgement
from mcnav.arrays.types import Array, IndexArray


@dataclass(frozen=True)
class Combination:
    """Combination of outputs, and its moments by both methods, SI.

    Attributes
    ----------
    lead : int
        Output of the largest term.
    weights : ndarray, shape (outputs,)
        Weights w, that of the lead one.
    shares : ndarray, shape (outputs,)
        Terms in linear sigmas (of an output without any, in simulated ones), that of the lead one.
    sigma_linear, sigma_paired : float
        Sigmas of the combination; the second is NaN where its paired variance is negative.
    offset : float
        Simulated less linear mean.
    judgement : Judgement or None
        Of a combination in the null space of the linear covariance.
    """

    lead: int
    weights: Array
    shares: Array
    sigma_linear: float
    sigma_paired: float
    offset: float
    judgement: Judgement | None = None


def combine(
    scaled: Array, sigma: Array, linear: Array, paired: Array, bias: Array, lead: int | None = None
) -> Combination:
    """Describe a combination by its weights on outputs in linear sigmas, shape (outputs,).

    Parameters
    ----------
    sigma : ndarray, shape (outputs,)
        Sigmas of the outputs, by which the weights are scaled; terms of outputs without any are left out.
    lead : int, optional
        Lead output; by default that of the largest weight.
    linear, paired : ndarray, shape (outputs, outputs)
        Covariances.
    bias : ndarray, shape (outputs,)
        Simulated less linear means.
    """
    lead = int(np.argmax(np.abs(scaled))) if lead is None else lead
    shares = scaled / scaled[lead]
    weights = np.divide(shares, sigma, out=np.zeros_like(shares), where=sigma > 0.0) * sigma[lead]
    own, simulated = (float(weights @ covariance @ weights) for covariance in (linear, paired))
    return Combination(lead, weights, shares, _root(own), _root(simulated), float(weights @ bias))


def _root(variance: float) -> float:
    return math.sqrt(variance) if variance >= 0.0 else math.nan


def covariance_factor(partials: Array, covariance: Array, processes: Sequence[Array], sigma: Array) -> Array:
    """Return F of the correlation matrix ``F F^T`` of outputs with the sigmas given, shape (outputs, columns)."""
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    inverse = np.divide(1.0, spread, out=np.zeros_like(spread), where=spread > 0.0)
    own = (partials * spread) @ _square_root(covariance * np.outer(inverse, inverse)) / sigma[:, None]
    noise = [_square_root(process / np.outer(sigma, sigma)) for process in processes]
    return np.hstack([own, *noise])


def _square_root(covariance: Array) -> Array:
    """Return a matrix whose product with its transpose is a positive semidefinite covariance."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def null_combinations(factor: Array, rank: int) -> tuple[Array, IndexArray]:
    """Return a basis of the null space, shape (outputs - rank, outputs), on outputs in linear sigmas.

    Each row has a one for a dependent output, which is returned beside it, and zeros for the other dependent ones.

    Parameters
    ----------
    factor : ndarray, shape (outputs, columns)
        F.
    rank : int
        Dimension of the range that counts as dispersed.

    >>> null_combinations(np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), 2)
    (array([[-1.,  1.,  0.]]), array([1]))
    """
    outputs = len(factor)
    if rank >= outputs:
        return np.empty((0, outputs)), np.empty(0, dtype=np.int64)
    _, upper, order = linalg.qr(factor.T, mode="economic", pivoting=True)
    columns = linalg.solve_triangular(upper[:rank, :rank], upper[:rank, rank:])
    basis = np.zeros((outputs - rank, outputs))
    basis[:, order[:rank]] = -columns.T + 0.0
    dependent = order[rank:].astype(np.int64)
    basis[np.arange(outputs - rank), dependent] = 1.0
    return basis, dependent


@dataclass(frozen=True)
class FixedCombination:
    """Combination to which linear analysis gives no dispersion, or next to none.

    Attributes
    ----------
    terms : ndarray, shape (outputs,)
        Weights on outputs in linear sigmas.
    lead : int
        Dependent output, whose weight is one.
    variance, floor : float
        Linear variance in the square of that sigma, and the one up to which a difference counts as agreement.
    """

    terms: Array
    lead: int
    variance: float
    floor: float


def fixed_combinations(
    partials: Array, covariance: Array, processes: Sequence[Array], sigma: Array, rank: int, floor: Array,
    least: float = SIMULATED,
) -> tuple[FixedCombination, ...]:  # fmt: skip
    """List the combinations of outputs outside the range of the linear covariance, of so many dimensions.

    Parameters
    ----------
    sigma, floor : ndarray, shape (outputs,)
        Linear sigmas, and the sigma up to which each counts as none (`mcnav.analysis.floor`). Outputs without a sigma
        are left out.
    least : float
        Share of each sigma that is rounding in any case, at least `SIMULATED`.
    """
    dispersed = np.flatnonzero(sigma > 0.0)
    noise = [process[np.ix_(dispersed, dispersed)] for process in processes]
    factor = covariance_factor(partials[dispersed], covariance, noise, sigma[dispersed])
    shares, combinations = np.maximum(floor[dispersed] / sigma[dispersed], max(least, SIMULATED)), []
    for own, dependent in zip(*null_combinations(factor, rank), strict=True):
        terms = np.zeros(len(sigma))
        terms[dispersed] = own
        variance, square = float(np.sum((factor.T @ own) ** 2)), float(np.abs(own) @ shares) ** 2
        combinations.append(FixedCombination(terms, int(dispersed[dependent]), variance, square))
    return tuple(combinations)


def compare_fixed(
    fixed: FixedCombination, sigma: Array, moments: BlockMoments, bias: Array, rule: DecisionRule
) -> Combination:
    """Compare the dispersion of a combination with the linear one; where both are within the floor they agree.

    Parameters
    ----------
    sigma, bias : ndarray, shape (outputs,)
        Linear sigmas, and simulated less linear means.
    """
    scaled = np.divide(fixed.terms, sigma, out=np.zeros_like(sigma), where=sigma > 0.0)
    estimate, difference = (rule.mean(moments.unbiased * sums, moments.counts) for sums in moments.combined(scaled))
    expected = fixed.variance if fixed.variance > fixed.floor else 0.0
    if expected:
        estimate = replace(difference, value=expected + difference.value)
    judgement, unit = rule.judge(estimate, expected, fixed.floor), float(sigma[fixed.lead])
    return Combination(
        fixed.lead, unit * scaled, fixed.terms, unit * _root(expected), unit * _root(estimate.value),
        unit * float(scaled @ bias), judgement,
    )  # fmt: skip
