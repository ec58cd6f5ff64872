"""Spectra of the processes of an instrument's noise, as the cosine transform of a record sees them.

A record of n readings, each the mean of a rate over an interval Δ, has the orthonormal cosine transform (DCT-II)
``c_j`` at the angles ``ω_j = π j / n``, j = 1 … n − 1; j = 0 is its mean. With ``s = 4 sin²(ω/2)`` the variances are

    white noise              N²/Δ
    rate random walk         K² Δ (1/s − 1/6)
    quantization             (Q/Δ)² (s + (4/n) cos²(ω/2))
    flicker (1/f) noise      B² s r_j [ζ(3, x) + ζ(3, 1 − x)] / (2π)³,  x = ω/2π
    Gauss-Markov process     σ² h(ω; ρ),  ρ = exp(−Δ/τ)

White noise and a random walk have uncorrelated ``c_j``: the differences of their readings have a tridiagonal Toeplitz
covariance, which the sine transform diagonalizes. Of the others the variances are exact, ends of the record included
(of flicker noise in the limit of many readings), and the correlations of the order 1/n; of flicker noise the first and
the third coefficient have −0.12, others less.

Units: a gyro's N is in rad/sqrt(s), K in rad/s/sqrt(s), σ and B in rad/s, Q in rad; an accelerometer's in m/s/sqrt(s),
m/s²/sqrt(s), m/s², m/s; τ in s.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from scipy.special import sici, zeta

from mcnav.arrays.types import Array


@dataclass(frozen=True)
class Grid:
    """Angles of a record's cosine transform at which variances are wanted.

    Attributes
    ----------
    interval : float
        Δ between readings, s.
    count : int or ndarray, shape (m,)
        n readings; by angle where several records stand one behind the other.
    order : ndarray, shape (m,)
        j of each angle; a mean of several where ordinates are taken together.
    """

    interval: float
    count: int | Array
    order: Array

    @cached_property
    def half(self) -> Array:
        """``ω / 2`` of each angle."""
        return np.asarray(0.5 * np.pi * self.order / self.count)

    @cached_property
    def sine_squared(self) -> Array:
        """``sin²(ω / 2)`` of each angle."""
        return np.asarray(np.sin(self.half) ** 2)

    @cached_property
    def alternating(self) -> Array:
        """``(−1)^j`` of each angle; zero for a mean of several."""
        whole = self.order == np.round(self.order)
        return np.where(whole, 1.0 - 2.0 * (np.round(self.order) % 2.0), 0.0)

    @cached_property
    def flicker(self) -> Array:
        """Variances of `flicker`, which no parameter changes."""
        turns, angle = self.half / np.pi, np.pi * self.order
        ends = 2.0 / np.pi * (sici(angle)[0] - (1.0 - self.alternating) / angle)
        ratio = np.where(self.alternating == 0.0, 1.0 - 2.0 / (np.pi * angle), ends)
        endless = 4.0 * self.sine_squared * (zeta(3.0, turns) + zeta(3.0, 1.0 - turns)) / (2.0 * np.pi) ** 3
        return np.asarray(ratio * endless)

    @property
    def frequency(self) -> Array:
        """Frequency of each angle, Hz."""
        return np.asarray(0.5 * self.order / (self.count * self.interval))

    @property
    def duration(self) -> float:
        """Length of the record, or of the longest, s."""
        return float(np.max(self.count)) * self.interval


def white_noise(grid: Grid) -> Array:
    """Variance of c for N = 1."""
    return np.full(len(grid.order), 1.0 / grid.interval)


def random_walk(grid: Grid) -> Array:
    """Variance of c for K = 1."""
    return np.asarray(grid.interval * (0.25 / grid.sine_squared - 1.0 / 6.0))


def quantization(grid: Grid) -> Array:
    """Variance of c for Q = 1: of differences of white errors of the accumulated angle or velocity."""
    squared = grid.sine_squared
    return np.asarray(4.0 * (squared + (1.0 - squared) / grid.count) / grid.interval**2)


def flicker(grid: Grid) -> Array:
    """Variance of c for B = 1, the bias instability of IEEE Std 952: the two-sided density of the rate is B²/(2π f).

    Its Allan deviation is B sqrt(2 ln 2/π) = 0.664 B at every cluster time. Means over Δ of an endless record have the
    density above with r = 1, by aliasing. With ``cos(π j t/T)`` over a record of the length T, the covariance
    ``−(B²/π) ln t`` gives ``r_j = (2/π) [Si(π j) − (1 − (−1)^j)/(π j)]``, about 1 − 2/(π² j).
    """
    return grid.flicker


def gauss_markov(grid: Grid, correlation_time: float | Array) -> Array:
    """Variance of c for σ = 1: a first-order Gauss-Markov process, stationary from before the record.

    Correlation times of shape (..., 1) give variances of shape (..., m).

    Means over Δ have the autocovariances ``γ_0 = 2 (a − 1 + ρ)/a²`` and ``γ_k = ((1 − ρ)/a)² ρ^(k−1)`` with
    ``a = Δ/τ``, ``ρ = exp(−a)``. Over an endless record their sum is ``γ_0 − γ_1/ρ + (γ_1/ρ)(1 − ρ²)/d`` with
    ``d = 1 − 2 ρ cos ω + ρ²``; what lies beyond both ends, ``(4/n)(γ_1/ρ) ρ (1 − ρ)² cos²(ω/2)/d²``, is taken off.
    """
    ratio = grid.interval / correlation_time
    less, rho = -np.expm1(-ratio), np.exp(-ratio)  # 1 - rho without cancellation
    squared = grid.sine_squared
    distance = less * less + 4.0 * rho * squared  # 1 - 2 rho cos w + rho^2
    at_lag = (less / ratio) ** 2 / rho  # gamma_k = at_lag rho^k
    # gamma_0 - at_lag, by a series where the difference cancels
    series = -ratio * ratio / 12.0 - ratio / 3.0
    same = np.where(ratio > 1e-3, 2.0 * (ratio - less) / ratio**2 - at_lag, series)
    endless = same + at_lag * less * (1.0 + rho) / distance
    parity = 1.0 - grid.alternating * rho**grid.count
    beyond = 4.0 / grid.count * at_lag * rho * less * less * (1.0 - squared) / distance**2 * parity
    return np.asarray(endless - beyond)


@dataclass(frozen=True)
class Process:
    """A process: its parameters, and its variance for sizes of one.

    Attributes
    ----------
    words : str
        What it is called.
    size : str
        Name of its size.
    timed : bool
        Whether it has a correlation time, too.
    """

    words: str
    size: str
    spectrum: Callable[..., Array]
    timed: bool = False

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of its parameters."""
        return (self.size, CORRELATION_TIME) if self.timed else (self.size,)


CORRELATION_TIME: Final = "correlation_time"

WHITE: Final = Process("white noise", "random_walk", white_noise)
QUANTIZATION: Final = Process("quantization", "quantization", quantization)
RATE_RANDOM_WALK: Final = Process("rate random walk", "rate_random_walk", random_walk)
FLICKER: Final = Process("flicker noise", "flicker", flicker)
GAUSS_MARKOV: Final = Process("Gauss-Markov process", "instability", gauss_markov, timed=True)
"""The processes, with the names of `mcnav.systems.ins.imu.instruments.Noise`."""


@dataclass(frozen=True)
class Model:
    """A sum of processes. Parameters are logarithms, in the order of `parameters`.

    >>> str(Model((WHITE, RATE_RANDOM_WALK)))
    'white noise, rate random walk'
    """

    processes: tuple[Process, ...]

    def __str__(self) -> str:
        """Name the processes."""
        return ", ".join(process.words for process in self.processes)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters in order."""
        return tuple(name for process in self.processes for name in process.parameters)

    def variances(self, grid: Grid, logs: Array) -> tuple[Array, Array]:
        """Compute the variances of c and their derivatives by the parameters.

        Parameters
        ----------
        logs : ndarray, shape (..., parameters)

        Returns
        -------
        variances : ndarray, shape (..., m)
        derivatives : ndarray, shape (..., m, parameters)
        """
        total, columns, at = np.zeros((*logs.shape[:-1], len(grid.order))), [], 0
        for process in self.processes:
            squared = np.exp(2.0 * logs[..., at, None])
            if process.timed:
                step, times = 1e-4, np.exp(logs[..., at + 1, None])
                value = squared * process.spectrum(grid, times)
                ahead, behind = (process.spectrum(grid, times * np.exp(sign * step)) for sign in (1.0, -1.0))
                columns += [2.0 * value, squared * (ahead - behind) / (2.0 * step)]
            else:
                value = squared * process.spectrum(grid)
                columns.append(2.0 * value)
            total += value
            at += len(process.parameters)
        return total, np.stack(columns, axis=-1)
