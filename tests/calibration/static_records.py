"""Simulated static records of an instrument: exact means over an interval of white noise and slow processes.

Nothing is shared with `mcnav.identification`: a Gauss-Markov process is propagated together with its integral, whose
joint covariance over one interval is known in closed form, and a random walk as the sum of its increments. Flicker
noise is white noise that was summed half a time (Kasdin 1995), at an eighth of the interval.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.signal import fftconvolve, lfilter

from mcnav.arrays.types import Array

FINER: Final = 8
"""Values of flicker noise within an interval, whose mean a reading has."""

BEFORE: Final = 7
"""Records of flicker noise, of the same length, that go before and are left out: it starts from nothing."""


@dataclass(frozen=True)
class TrueNoise:
    """Noise of one axis, in the units of `mcnav.systems.ins.imu.instruments.Noise`; zero where there is none."""

    random_walk: float
    instability: float = 0.0
    correlation_time: float = 3600.0
    rate_random_walk: float = 0.0
    quantization: float = 0.0
    flicker: float = 0.0


def simulate_record(generator: np.random.Generator, count: int, interval: float, noise: TrueNoise) -> Array:
    """Simulate ``count`` readings, each the mean over an interval (s), without a constant bias; shape (count,)."""
    readings: Array = generator.standard_normal(count) * (noise.random_walk / np.sqrt(interval))
    if noise.rate_random_walk > 0.0:
        readings += noise.rate_random_walk * _means_of_walk(generator, count, interval)
    if noise.instability > 0.0:
        readings += noise.instability * _means_of_gauss_markov(generator, count, interval / noise.correlation_time)
    if noise.flicker > 0.0:
        readings += noise.flicker * _means_of_flicker(generator, count)
    if noise.quantization > 0.0:
        readings += np.diff(generator.standard_normal(count + 1)) * (noise.quantization / interval)
    return readings


def _means_of_walk(generator: np.random.Generator, count: int, interval: float) -> Array:
    """Return means of a Wiener process: half of an increment w and an independent part of variance interval / 12."""
    steps = generator.standard_normal(count) * np.sqrt(interval)
    within = generator.standard_normal(count) * np.sqrt(interval / 12.0)
    return np.asarray(np.cumsum(steps) - 0.5 * steps + within)


def _means_of_gauss_markov(generator: np.random.Generator, count: int, ratio: float) -> Array:
    """Return means of x with dx = -x dt + sqrt(2) dw, stationary, over steps of ``ratio`` of its correlation time a.

    Given x at the begin of a step, x at its end has the variance 1 - ρ² and the mean over it (2a - 3 + 4ρ - ρ²)/a²;
    their covariance is (1 - ρ)²/a.
    """
    rho, less = np.exp(-ratio), -np.expm1(-ratio)
    ends, cross = -np.expm1(-2.0 * ratio), less**2 / ratio
    mean = (2.0 * ratio - 3.0 + 4.0 * rho - rho**2) / ratio**2 if ratio > 1e-3 else 2.0 / 3.0 * ratio
    driven = generator.standard_normal((2, count))
    inputs = np.sqrt(ends) * driven[0]
    within = cross / np.sqrt(ends) * driven[0] + np.sqrt(max(mean - cross**2 / ends, 0.0)) * driven[1]
    begin = np.concatenate([[generator.standard_normal()], inputs[:-1]])
    return np.asarray(less / ratio * lfilter([1.0], [1.0, -rho], begin) + within)


def _means_of_flicker(generator: np.random.Generator, count: int) -> Array:
    """Return means of noise with the density 1/(2π f), the same at every interval: ``(1 − z⁻¹)^(−1/2)`` of white noise.

    The density of the fine values is ``1/(2 sin(ω/2))``, which is 1/ω where means over `FINER` of them have any.
    """
    fine = count * FINER * (BEFORE + 1)
    order = np.arange(1.0, fine)
    response = np.concatenate([[1.0], np.cumprod((order - 0.5) / order)])
    summed = fftconvolve(generator.standard_normal(fine), response)[:fine]
    return np.asarray(summed[-count * FINER :].reshape(count, FINER).mean(axis=1))
