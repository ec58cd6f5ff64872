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

from mcnav.arrays.types import Array, IndexArray
from mcnav.errors import NumericalError
from mcnav.statistics.adaptive_quadrature import integrals
from mcnav.statistics.bisection import root_between
from mcnav.statistics.normal_size import probabilities_within

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

WIDTH: Final = 1e-6
"""Width of the last bracket of an error that is looked for, in sigmas of the innovation: three digits are printed."""

PLACES: Final = 17
"""Places at which the largest value of a function is looked for first."""

PLACES_NEAR: Final = 9
"""Places in each finer grid around the best one: each is four times as fine as the one before."""

FINER: Final = 3
"""Finer grids: the last one is 64 times as fine as the first one. A parabola through its best places follows."""

SEARCHED: Final = 1e-4
"""Error of the probability of an unnoticed error to search with, as a share of it."""

CONFIRMED: Final = 1e-3
"""Largest relative difference between the exact probability of acceptance and the wanted one.

At most a bracket of `WIDTH` wide, in sigmas, times the slope of the logarithm, up to `EDGE` or so, and 1e-6.
"""

LEAST: Final = 1e-300
"""Smallest probability whose logarithm is taken."""


def acceptance(limit: float, means: Array, covariance: Array, rough: bool = False) -> Array:
    """Compute the probabilities that normal innovations of one covariance are accepted, shape (n,).

    Parameters
    ----------
    limit : float
        T.
    means, covariance : ndarray, shapes (n, M), (M, M)
    rough : bool
        To 1e-6, to search with; as `mcnav.statistics.normal_size.probabilities_within`.

    >>> acceptance(10.827566, np.array([[6.0 / 2.618034**0.5], [0.0]]), np.eye(1)).round(6)
    array([0.338092, 0.999   ])
    """
    if not np.isfinite(limit):
        return np.ones(len(means))
    return probabilities_within(float(np.sqrt(limit)), means, covariance, rough)


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


@dataclass(frozen=True)
class GatedError:
    """Innovations of M components in n cases, and one error after the measurement, jointly normal.

    Attributes
    ----------
    limit : float
        T.
    means, covariance, cross : ndarray, shapes (n, M), (M, M), (M,)
        Of the innovation, whitened by what the filter believes; its covariance with the error.
    errors, sigma : ndarray, shape (n,), float
        Means and sigma of the error.
    """

    limit: float
    means: Array
    covariance: Array
    cross: Array
    errors: Array
    sigma: float

    def unnoticed_beyond(self, size: float, rough: bool = False) -> Array:
        """Compute the probabilities that the measurement is accepted and the error is larger than a size, shape (n,).

        Roughly, to `SEARCHED`, where it is to search with.

        >>> one = np.array([[6.0 / 2.618034**0.5]]), np.eye(1), np.zeros(1), np.array([3.708204]), 0.786151
        >>> GatedError(10.827566, *one).unnoticed_beyond(4.0 * 0.786151).round(6)
        array([0.25806])
        """
        if self.sigma <= 0.0:
            return acceptance(self.limit, self.means, self.covariance, rough) * (np.abs(self.errors) > size)
        ends = (size - self.errors) / self.sigma, (-size - self.errors) / self.sigma
        if np.linalg.norm(self.cross) < ROUNDED * self.sigma:
            beyond = special.ndtr(-ends[0]) + special.ndtr(ends[1])
            return np.asarray(acceptance(self.limit, self.means, self.covariance, rough) * beyond)
        slope = self.cross / self.sigma
        left = self.covariance - np.outer(slope, slope)

        def density(cases: IndexArray, z: Array) -> Array:
            means = self.means[cases % len(self.means), None] + z[:, :, None] * slope
            passed = acceptance(self.limit, means.reshape(-1, len(slope)), left, rough)
            return np.asarray(np.exp(-0.5 * z**2) / np.sqrt(2.0 * np.pi) * passed.reshape(z.shape))

        edges = self._edges(slope, left)
        # both tails of each case, the second ones behind the first ones
        begin = np.concatenate([np.maximum(ends[0], -TAIL), np.full(len(edges), -TAIL)])[:, None]
        end = np.concatenate([np.full(len(edges), TAIL), np.minimum(ends[1], TAIL)])[:, None]
        breaks = np.concatenate([begin, np.tile(edges, (2, 1)), np.maximum(begin, end)], axis=1)
        breaks = np.sort(np.clip(breaks, begin, np.maximum(begin, end)), axis=1)
        tails = integrals(density, breaks, SEARCHED if rough else ACCURACY)
        return np.asarray(tails.reshape(2, -1).sum(axis=0))

    def _edges(self, slope: Array, left: Array) -> Array:
        """Return the errors, in sigmas from their mean, near which the gate opens or closes; shape (n, 6).

        It does so for the mean innovation.
        """
        square = float(slope @ slope)
        nearest = -(self.means @ slope) / square
        apart = np.sum((self.means + nearest[:, None] * slope) ** 2, axis=1)
        half = np.sqrt(np.maximum(self.limit - apart, 0.0) / square)
        width = EDGE * np.sqrt(max(float(np.linalg.eigvalsh(left)[-1]), 0.0) / square)
        offsets = width * np.array([-1.0, 0.0, 1.0])
        return np.concatenate([(nearest + side * half)[:, None] + offsets for side in (-1.0, 1.0)], axis=1)


def smallest_stopped(accepted: Callable[[float], float], probability: float) -> float:
    """Find the smallest error of a measurement, in sigmas of an innovation, that is stopped with a probability.

    It is looked for in the logarithm of what is accepted, which is smooth where that is small.

    Parameters
    ----------
    accepted : callable
        Probability that an error is accepted; infinite where none is stopped.
    """
    wanted = np.log(1.0 - probability)

    def left(size: float) -> float:
        return float(np.log(max(accepted(size), LEAST)) - wanted)

    if left(0.0) <= 0.0:
        return 0.0
    low, high = 0.0, 1.0
    while left(high) > 0.0:
        low, high = high, 2.0 * high
        if high > LARGEST:
            return float("inf")
    ends = root_between(left, (low, left(low)), (high, left(high)), WIDTH * high)
    return 0.5 * (ends[0] + ends[1])


def check_stopped(accepted: float, probability: float) -> None:
    """Refuse an error that was searched for roughly where the exact probability to be accepted is another one.

    Raises
    ------
    NumericalError
        With the two.
    """
    if not abs(accepted - (1.0 - probability)) <= CONFIRMED * (1.0 - probability):
        raise NumericalError(
            f"an error that a gate should accept with {1.0 - probability:g} is accepted with {accepted:g}"
        )


def largest_of(function: Callable[[Array], Array], high: float) -> float:
    """Find where a function between zero and a limit is largest: on a grid, on finer ones, and along a parabola.

    Parameters
    ----------
    function : callable
        Of places, shape (n,).

    >>> round(largest_of(lambda x: 1.0 - (x - 0.3) ** 2, 2.0), 9)
    0.3
    """
    places = np.linspace(0.0, high, PLACES)
    values = function(places)
    for _ in range(FINER):
        best, step = float(places[np.argmax(values)]), float(places[1] - places[0])
        places = np.linspace(max(best - step, 0.0), min(best + step, high), PLACES_NEAR)
        values = function(places)
    at = min(max(int(np.argmax(values)), 1), len(places) - 2)
    below, above = values[at] - values[at - 1], values[at] - values[at + 1]
    if not below + above > 0.0:
        return float(places[np.argmax(values)])
    aside = 0.5 * (below - above) / (below + above)
    return float(places[at] + min(max(aside, -1.0), 1.0) * (places[1] - places[0]))
