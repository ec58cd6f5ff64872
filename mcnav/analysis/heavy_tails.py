"""Outputs that depend on a source with heavy tails, by the samples themselves.

Intervals of second moments are unreliable where an output has heavy tails, and a partial derivative of zero does not
show that it has none: a square, or a product with another error, has one as well. Flights of the same samples with the
source moved far out show a dependence directly (`mcnav.workflow.heavy_tails`); here is what the samples of the run add.
With d = y - z, simulated less linear outcomes, an output that does not depend on the source has a remainder whose size
has no rank correlation with the size of the source: Spearman's, over all samples and over those with a remainder.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array

UNCORRELATED: Final = 5.0
"""Spearman's correlation times the root of the samples that independent sizes exceed with a probability of 6e-7."""

FEWEST: Final = 30
"""Samples of which a rank correlation is judged."""


def outputs_felt(source: Array, remainders: Array, floor: Array) -> NDArray[np.bool_]:
    """Return in which outputs samples show a nonlinear dependence on a source, shape (outputs,).

    Parameters
    ----------
    source : ndarray, shape (n,)
        Its errors less their mean.
    remainders : ndarray, shape (n, outputs)
        Simulated less linear outcomes.
    floor : ndarray, shape (outputs,)
        Size up to which a remainder counts as none.
    """
    felt = np.zeros(remainders.shape[1], dtype=bool)
    for number, (remainder, least) in enumerate(zip(np.abs(remainders.T), floor, strict=True)):
        bent = remainder > least
        if bent.any():
            felt[number] = _correlated(np.abs(source), remainder) or _correlated(np.abs(source[bent]), remainder[bent])
    return felt


def _correlated(one: Array, other: Array) -> bool:
    """Return whether two samples of sizes are correlated in rank."""
    if len(one) < FEWEST:
        return False
    order = np.stack([np.argsort(np.argsort(each, kind="stable"), kind="stable") for each in (one, other)])
    correlation = np.corrcoef(order.astype(float))[0, 1]
    return bool(abs(correlation) * np.sqrt(len(one) - 1.0) > UNCORRELATED)
