"""Mean, sigma, mean NEES and law of the outputs to second order, with how well each is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.statistics.quadratic_tail import QuadraticForm


@dataclass(frozen=True)
class CorrectedMoments:
    """Moments of the outputs to fourth order in sigma, SI.

    Attributes
    ----------
    mean, mean_error : ndarray, shape (outputs,)
        With its uncertainty.
    sigma, error : ndarray, shape (outputs,)
    covariance : ndarray, shape (outputs, outputs)
    cubic : ndarray, shape (outputs,)
        Share of each sigma that third derivatives add or take.
    nees, nees_error : float
        Mean NEES of all outputs with the linear covariance; NaN where no output varies.
    laws : tuple of QuadraticForm
        Of each output.
    added_by_pairs : ndarray, shape (outputs, r, r)
        What pairs of principal directions of the sources add to the linear variances.
    """

    mean: Array
    mean_error: Array
    sigma: Array
    error: Array
    covariance: Array
    cubic: Array
    nees: float
    nees_error: float
    laws: tuple[QuadraticForm, ...]
    added_by_pairs: Array

    def improves(self, linear: Array) -> NDArray[np.bool_]:
        """Tell which sigmas are known to less than half of their correction of the linear ones, shape (outputs,)."""
        return np.asarray(self.error < 0.5 * np.abs(self.sigma - linear))

    def improves_mean(self, linear: Array) -> NDArray[np.bool_]:
        """Tell the same of means, shape (outputs,)."""
        return np.asarray(self.mean_error < 0.5 * np.abs(self.mean - linear))

    def improves_nees(self, rank: int) -> bool:
        """Tell the same of the mean NEES, which linear analysis has equal to the rank of its covariance."""
        return self.nees_error < 0.5 * abs(self.nees - rank)
