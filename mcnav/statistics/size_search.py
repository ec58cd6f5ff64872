"""Quantiles of the sizes of many normal vectors, searched for together: see `mcnav.statistics.normal_size`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import special

from mcnav.arrays.types import Array
from mcnav.errors import NumericalError
from mcnav.statistics.bisection import roots_between
from mcnav.statistics.generalized_chi_square import LEAST
from mcnav.statistics.size_tails import AGREEMENT, refuse, size_tails

ROUNDING: Final = 1e-15
"""What rounding of squares leaves of a normal score, in the largest |b|."""

RADIUS: Final = 1e-13
"""Width of the last bracket of a quantile, as a share of the first one."""

WIDER: Final = 1e-9
"""Share by which the first bracket of a quantile is widened: what rounding of its ends may take."""


@dataclass(frozen=True)
class SizeSearch:
    """Quantiles of n sizes of vectors that vary along equally many axes.

    Attributes
    ----------
    variances, centres, fixed : ndarray, shapes (n, k), (n, k), (n,)
        As in `mcnav.statistics.normal_size.NormalSize`.
    probabilities : ndarray, shape (n,)
    """

    variances: Array
    centres: Array
    fixed: Array
    probabilities: Array

    def quantiles(self) -> list[float | NumericalError]:
        """Find the quantiles, and an error for each that cannot be trusted.

        Along the first path the score rises within a bracket; at its ends, the score along the second path must be on
        either side of the wanted one.
        """
        rounding = AGREEMENT + ROUNDING * np.max(np.abs(self.centres) / np.sqrt(self.variances), axis=1)
        low, high = self._first_brackets()
        everyone = range(len(self.fixed))
        lows, highs = (zip(sizes.tolist(), self._scores(everyone, sizes), strict=True) for sizes in (low, high))
        brackets = roots_between(self._scores, lows, highs, (RADIUS * (high - low)).tolist(), rounding.tolist())
        return self._checked(brackets, rounding)

    def _checked(
        self, brackets: Sequence[tuple[float, float] | NumericalError], rounding: Array
    ) -> list[float | NumericalError]:
        """Return the middle of each bracket whose ends the second route confirms, or an error."""
        found = {row: bracket for row, bracket in enumerate(brackets) if not isinstance(bracket, NumericalError)}
        scores = (self._scores([*found], ends, 1) for ends in zip(*found.values(), strict=True))
        confirmed = {
            row for row, below, above in zip(found, *scores, strict=False)
            if below <= rounding[row] and above >= -rounding[row]
        }  # fmt: skip
        return [
            bracket if isinstance(bracket, NumericalError)
            else 0.5 * sum(bracket) if row in confirmed
            else refuse(f"size at the probability {self.probabilities[row]:g}", self.variances[row], self.centres[row])
            for row, bracket in enumerate(brackets)
        ]  # fmt: skip

    def _first_brackets(self) -> tuple[Array, Array]:
        """Return sizes below and above the quantiles.

        A size is at most that of the mean and of what an isotropic vector of the largest variance adds with the
        probability, and at least the difference of such sizes.
        """
        greatest, half = np.sqrt(self.variances[:, -1]), 0.5 * self.variances.shape[1]
        offset = np.hypot(self.fixed, np.linalg.norm(self.centres, axis=1))
        within, beyond = self.probabilities, 1.0 - self.probabilities
        reach, back = greatest * _chi(half, within, beyond), greatest * _chi(half, beyond, within)
        return np.maximum(self.fixed, offset - back) * (1.0 - WIDER), (offset + reach) * (1.0 + WIDER)

    def _scores(self, rows: Sequence[int], sizes: Sequence[float] | Array, path: int = 0) -> list[float]:
        """Return the scores of some sizes along a path, less the wanted ones."""
        some, within = np.array(rows, dtype=int), self.probabilities[rows]
        tails = size_tails(self.variances[some], self.centres[some], self.fixed[some], np.asarray(sizes), path)
        scores: list[float] = (_score(*tails) - _score(within, 1.0 - within)).tolist()
        return scores


def _chi(half: float, within: Array, beyond: Array) -> Array:
    """Return quantiles of a chi variable of ``2 half`` degrees of freedom with these probabilities on its sides."""
    squares = np.where(within < beyond, special.gammaincinv(half, within), special.gammainccinv(half, beyond))
    return np.asarray(np.sqrt(2.0 * squares))


def _score(within: Array, beyond: Array) -> Array:
    """Return the standard normal variables with these probabilities below and above, by the smaller of them."""
    smaller = special.ndtri(np.maximum(np.minimum(within, beyond), LEAST))
    return np.asarray(np.where(within < beyond, smaller, -smaller))
