"""Causes of an error at one instant: shares of each source, its mean and each process in the mean square."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.analysis.filter_consistency import MEAN
from mcnav.arrays.types import Array

LEAST: Final = 0.001
"""Smallest share that is listed."""


@dataclass(frozen=True)
class Cause:
    """Share of a cause in the mean square of an error; ``mean_of_`` and the name where it is the mean of a source."""

    name: str
    share: float


def causes_of(variances: Mapping[str, Array], means: Mapping[str, Array], total: float) -> tuple[Cause, ...]:
    """List causes by their share in a mean square, the largest first.

    Parameters
    ----------
    variances, means : mapping of str to ndarray, shape (outputs,)
        What each cause adds to the variance, and what the mean of each adds to the mean error, over the same units.
    total : float
        The mean square; what correlations between sources contribute has no cause of its own.
    """
    if not (np.isfinite(total) and total > 0.0):
        return ()
    mean = sum(means.values(), np.zeros(()))
    parts = {name: float(np.sum(values)) for name, values in variances.items()}
    parts |= {f"{MEAN}{name}": float(np.sum(values * mean)) for name, values in means.items()}
    causes = [Cause(name, part / total) for name, part in parts.items() if abs(part) >= LEAST * total]
    return tuple(sorted(causes, key=lambda cause: -cause.share))
