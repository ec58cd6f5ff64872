"""Linear outcomes of samples with noise against the covariance that the linear model states for the noise.

A paired estimate needs linear outcomes whose covariance is that of the linear model. Where both come from a user's
class, their agreement is tested: with another covariance the estimate would agree with it, whatever the samples do.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import special

from mcnav.analysis.model import Model
from mcnav.arrays.types import Array
from mcnav.statistics.whitening import whitening

FALSE_ALARM: Final = 1e-6
"""Probability with which a campaign is doubted whose covariance of noise is right and whose noise is normal."""


@dataclass(frozen=True)
class NoiseDoubt:
    """A disagreement: the output concerned, and how far the sigma of the noise is off, as a share of the stated one."""

    output: int
    disagreement: float


def doubt_noise(model: Model, errors: Array, linear: Array, limit: float) -> NoiseDoubt | None:
    """Test the covariance of the noise in linear outcomes.

    What remains of ``linear`` without the effect of the errors must have the covariance ``sum Q_j``: along each output,
    and in coordinates in which it is the identity along each, and along the sum and the difference of any two. A
    variance estimated from n normal values is distributed as chi-square with n degrees of freedom; the limits are
    Bonferroni's.

    Parameters
    ----------
    errors, linear : ndarray, shapes (n, sources) and (n, outputs)
        Constant errors and linear outcomes of samples that succeeded, SI.
    limit : float
        Share of sigma by which the covariance may be off.

    Returns
    -------
    NoiseDoubt or None
        None when no sigma is farther off than the limit, beyond chance.
    """
    size = len(model.nominal)
    covariance = sum(model.processes.values(), np.zeros((size, size)))
    noise = linear - model.nominal - errors @ model.partials.T
    sigmas = np.sqrt(np.diag(covariance))
    largest = np.abs(noise).max(axis=0, initial=0.0)
    silent = np.flatnonzero((sigmas == 0.0) & (largest > model.rounding))
    if len(silent):
        return NoiseDoubt(int(silent[0]), np.inf)
    scale = np.divide(1.0, sigmas, out=np.zeros(size), where=sigmas > 0.0)
    white = whitening(covariance).matrix
    pairs = np.triu_indices(white.shape[1], 1)
    sums, differences = (white[:, pairs[0]] + sign * white[:, pairs[1]] for sign in (1.0, -1.0))
    axes = np.hstack([np.diag(scale), white, np.sqrt(0.5) * sums, np.sqrt(0.5) * differences])
    axes = axes[:, np.any(axes != 0.0, axis=0)]
    count = len(noise)
    if count == 0 or axes.shape[1] == 0:
        return None
    squares = np.sum((noise @ axes) ** 2, axis=0)
    tail = 0.5 * FALSE_ALARM / axes.shape[1]
    low, high = np.sqrt(squares / special.chdtri(count, tail)), np.sqrt(squares / special.chdtri(count, 1.0 - tail))
    beyond = np.maximum(low - 1.0, 1.0 - high)  # the least departure of a sigma from the stated one
    worst = int(np.argmax(beyond))
    if beyond[worst] <= limit:
        return None
    output = int(np.argmax(np.abs(axes[:, worst]) * sigmas))
    return NoiseDoubt(output, float(abs(np.sqrt(squares[worst] / count) - 1.0)))
