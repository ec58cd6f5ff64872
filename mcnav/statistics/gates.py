"""Gates on normal innovations: an innovation n of M components is accepted where ``|n|^2 <= T``.

n is whitened by what the filter believes. ``|n|`` has the law of `mcnav.statistics.normal_size`. Where the filter
believes the truth, n has the covariance one, and the error e after an accepted measurement is independent of n.
Otherwise n given e is normal with ::

    mean m + c (e - mu) / s^2        covariance C - c c^T / s^2

where e has the mean mu and the sigma s, and n the mean m, the covariance C and the covariance c with e.

A good measurement is rejected where ``|n|^2 > T`` of a standard normal n. Two such events are functions of chi-square
variables ``|n|^2 = 2 x`` and ``2 y``, whose joint law has an expansion in Laguerre polynomials (Lancaster, *The
Chi-Squared Distribution*, 1969, chapter VI) ::

    E[L_j(x) L_j(y)] = h_j      sum h_j t^j = prod (1 - t rho_i^2)^(-1/2)

with the canonical correlations rho_i of the two vectors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import special

from mcnav._types import Array, IndexArray
from mcnav.statistics.adaptive_quadrature import integrals
from mcnav.statistics.bisection import root_between
from mcnav.statistics.normal_size import NormalSize

ROUNDED: Final = 1e-9
"""Correlation of innovation and error that is rounding."""

EDGE: Final = 6.0
"""Sigmas of an innovation, given the error, within which the gate opens or closes."""

TAIL: Final = 9.0
"""Sigmas of an error at which its tails end."""

LARGEST: Final = 1e6
"""Sigmas of an innovation beyond which no error of a measurement is looked for."""

ACCURACY: Final = 1e-7
"""Error of the probability of an unnoticed error, as a share of it."""

NEGLIGIBLE: Final = 1e-12
"""Last term of an expansion in powers of a squared correlation."""

MOST_TERMS: Final = 4096

WIDTH: Final = 1e-10
"""Width of the last bracket of an error that is looked for, in sigmas of the innovation."""


def acceptance(limit: float, mean: Array, covariance: Array) -> float:
    """Compute the probability that a normal innovation is accepted.

    Parameters
    ----------
    limit : float
        T.
    mean, covariance : ndarray, shapes (M,), (M, M)

    >>> round(acceptance(10.827566, np.array([6.0 / 2.618034**0.5]), np.eye(1)), 6)
    0.338092
    """
    if not np.isfinite(limit):
        return 1.0
    return NormalSize.of(mean, covariance).probability(float(np.sqrt(limit)))


def rejected_square(limit: float, size: int) -> float:
    """Compute the mean of ``|n|^2 / M`` of good innovations of M components that are rejected.

    >>> round(rejected_square(6.6348966, 1), 4)
    8.4492
    """
    return float(special.chdtrc(size + 2.0, limit) / special.chdtrc(float(size), limit))


def rejected_again(limit: float, correlations: Array) -> Array:
    """Compute the probability that a good innovation is rejected, given that another one is.

    The expansion ends where its terms are negligible. With correlations so near to one that they are not, half of what
    is left of the probability is added: the error is at most that.

    Parameters
    ----------
    correlations : ndarray, shape (k, M)
        Canonical correlations of k pairs of innovations of M components.

    Returns
    -------
    ndarray, shape (k,)

    >>> rejected_again(4.605170186, np.array([[0.0, 0.0], [1.0, 1.0]])).round(6)
    array([0.1, 1. ])
    """
    size, squares = correlations.shape[1], np.asarray(correlations**2)
    rejected, result = float(special.chdtrc(float(size), limit)), np.zeros(len(correlations))
    largest = squares.max(axis=1, initial=0.0)
    with np.errstate(divide="ignore"):
        terms = np.log(NEGLIGIBLE) / np.log(np.clip(largest, 1e-3, None))
    counts = 2 ** np.ceil(np.log2(np.clip(terms, 8, MOST_TERMS))).astype(int)
    for count in np.unique(counts):
        pairs, weights = np.flatnonzero(counts == count), _weights(limit, size, int(count))
        shares = _joint_moments(squares[pairs], int(count)) / _moments(0.5 * size, int(count))
        left = max(rejected * (1.0 - rejected) - float(weights[1:].sum()), 0.0)
        result[pairs] = rejected + (shares[:, 1:] @ weights[1:] + 0.5 * left * shares[:, -1]) / rejected
    # equal vectors are rejected together
    return np.asarray(np.where(squares.min(axis=1, initial=1.0) >= 1.0, 1.0, np.minimum(result, 1.0)))


def _moments(power: float, count: int) -> Array:
    """Return the coefficients of ``(1 - t)^-power``."""
    j = np.arange(1, count)
    return np.concatenate([[1.0], np.cumprod((power + j - 1.0) / j)])


def _joint_moments(squares: Array, count: int) -> Array:
    """Return the first h_j, shape (k, count), of squared correlations, shape (k, M)."""
    powers, half, length = np.arange(count), _moments(0.5, count), 2 * count
    spectrum = np.ones((len(squares), count + 1), dtype=complex)
    for column in squares.T:
        spectrum *= np.fft.rfft(half * column[:, None] ** powers, length)
        spectrum = np.fft.rfft(np.fft.irfft(spectrum, length)[:, :count], length)
    return np.asarray(np.fft.irfft(spectrum, length)[:, :count])


def _weights(limit: float, size: int, count: int) -> Array:
    """Return the squared coefficients of the indicator of an acceptance in normed Laguerre polynomials.

    The integral of ``x^a e^-x L_j^a`` from zero to y is ``y^(a + 1) e^-y L_(j - 1)^(a + 1)(y) / j``.
    """
    half, y = 0.5 * size, 0.5 * limit
    polynomials = np.ones(count)
    for j in range(1, count):
        before = polynomials[j - 2] if j > 1 else 0.0
        polynomials[j] = ((2 * j - 1 + half - y) * polynomials[j - 1] - (j - 1 + half) * before) / j
    lead = np.exp(half * np.log(y) - y - special.gammaln(half))
    coefficients = np.append(1.0 - special.chdtrc(float(size), limit), lead * polynomials[:-1] / np.arange(1, count))
    return np.asarray(coefficients**2 / _moments(half, count))


def run_acceptance(limit: float, means: Array, covariance: Array, usual: float = 1.0) -> float:
    """Compute the probability that all innovations of a run are accepted, shape (u, M), each independent of the others.

    It ends where it is less than 1e-12.

    Parameters
    ----------
    usual : float
        Probability by which that of each innovation is divided.
    """
    accepted = 1.0
    for mean in means[np.argsort(-np.sum(means**2, axis=1))]:
        accepted *= acceptance(limit, mean, covariance) / usual
        if accepted < 1e-12:
            return 0.0
    return accepted


@dataclass(frozen=True)
class GatedError:
    """An innovation of M components and one error after its measurement, jointly normal.

    Attributes
    ----------
    limit : float
        T.
    mean, covariance, cross : ndarray, shapes (M,), (M, M), (M,)
        Of the innovation, whitened by what the filter believes; its covariance with the error.
    error, sigma : float
        Mean and sigma of the error.
    """

    limit: float
    mean: Array
    covariance: Array
    cross: Array
    error: float
    sigma: float

    def unnoticed_beyond(self, size: float) -> float:
        """Compute the probability that the measurement is accepted and the error is larger than a size.

        >>> law = GatedError(10.827566, np.array([6.0 / 2.618034**0.5]), np.eye(1), np.zeros(1), 3.708204, 0.786151)
        >>> round(law.unnoticed_beyond(4.0 * 0.786151), 6)
        0.25806
        """
        if self.sigma <= 0.0:
            return acceptance(self.limit, self.mean, self.covariance) if abs(self.error) > size else 0.0
        if np.linalg.norm(self.cross) < ROUNDED * self.sigma:
            beyond = special.ndtr((-size - self.error) / self.sigma) + special.ndtr((self.error - size) / self.sigma)
            return acceptance(self.limit, self.mean, self.covariance) * float(beyond)
        slope = self.cross / self.sigma
        left = self.covariance - np.outer(slope, slope)

        def density(_: IndexArray, z: Array) -> Array:
            passed = [acceptance(self.limit, self.mean + slope * place, left) for place in z.ravel()]
            return np.asarray(np.exp(-0.5 * z**2) / np.sqrt(2.0 * np.pi) * np.reshape(passed, z.shape))

        high, low = max((size - self.error) / self.sigma, -TAIL), min((-size - self.error) / self.sigma, TAIL)
        edges = self._edges(slope, left)
        tails = [
            np.sort(np.clip(np.append(edges, [begin, end]), begin, max(begin, end)))
            for begin, end in ((high, TAIL), (-TAIL, low))
        ]
        return float(np.sum(integrals(density, np.array(tails), ACCURACY)))

    def _edges(self, slope: Array, left: Array) -> Array:
        """Return the errors, in sigmas from their mean, near which the gate opens or closes for the mean innovation."""
        square = float(slope @ slope)
        nearest = -float(self.mean @ slope) / square
        apart = float(np.sum((self.mean + nearest * slope) ** 2))
        half = np.sqrt(max(self.limit - apart, 0.0) / square)
        width = EDGE * np.sqrt(max(float(np.linalg.eigvalsh(left)[-1]), 0.0) / square)
        return np.array([nearest + side * half + k * width for side in (-1.0, 1.0) for k in (-1.0, 0.0, 1.0)])


def smallest_stopped(accepted: Callable[[float], float], probability: float) -> float:
    """Find the smallest error of a measurement, in sigmas of an innovation, that is stopped with a probability.

    Parameters
    ----------
    accepted : callable
        Probability that an error is accepted; infinite where none is stopped.
    """

    def left(size: float) -> float:
        return accepted(size) - (1.0 - probability)

    if left(0.0) <= 0.0:
        return 0.0
    high = 1.0
    while left(high) > 0.0:
        high *= 2.0
        if high > LARGEST:
            return float("inf")
    low = 0.0 if high == 1.0 else 0.5 * high
    ends = root_between(left, (low, left(low)), (high, left(high)), WIDTH * high)
    return 0.5 * (ends[0] + ends[1])


def largest_of(function: Callable[[float], float], high: float) -> tuple[float, float]:
    """Find where a function between zero and a limit is largest, and its value: on a grid, then by golden sections."""
    grid = np.linspace(0.0, high, 33)
    best = int(np.argmax([function(float(each)) for each in grid]))
    low, up = float(grid[max(best - 1, 0)]), float(grid[min(best + 1, len(grid) - 1)])
    share = 0.5 * (np.sqrt(5.0) - 1.0)
    inner, outer = up - share * (up - low), low + share * (up - low)
    of_inner, of_outer = function(inner), function(outer)
    for _ in range(24):
        if of_inner > of_outer:
            up, outer, of_outer = outer, inner, of_inner
            inner = up - share * (up - low)
            of_inner = function(inner)
        else:
            low, inner, of_inner = inner, outer, of_outer
            outer = low + share * (up - low)
            of_outer = function(outer)
    return (inner, of_inner) if of_inner > of_outer else (outer, of_outer)
