"""Strata of half-spaces: those of few lines each are drawn together, those of many have lines of their own."""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray

STRATA: Final = 16
"""Groups of half-spaces, each with lines in proportion."""


def strata_of(shares: Array) -> IndexArray:
    """Return the stratum of each half-space, shape (facets,): consecutive by their shares, with equal sums, about."""
    order = np.argsort(-shares, kind="stable")
    middle = np.cumsum(shares[order]) - 0.5 * shares[order]
    groups = np.minimum((middle * STRATA).astype(np.int64), STRATA - 1)
    strata = np.empty(len(shares), dtype=np.int64)
    strata[order] = np.unique(groups, return_inverse=True)[1]
    return strata


def draw_members(stratum: IndexArray, strata: IndexArray, shares: Array, generator: np.random.Generator) -> IndexArray:
    """Draw a half-space for each line from those of its stratum by their shares, shape (n,).

    Parameters
    ----------
    stratum, strata : ndarray of int, shapes (n,), (facets,)
        Of each line, and of each half-space.
    """
    order = np.argsort(strata, kind="stable")
    heaped = np.cumsum(shares[order])
    ends = heaped[np.searchsorted(strata[order], np.arange(strata.max() + 1), side="right") - 1]
    begins = np.append(0.0, ends[:-1])
    at = begins[stratum] + generator.random(len(stratum)) * (ends - begins)[stratum]
    place = np.minimum(np.searchsorted(heaped, at, side="right"), len(shares) - 1)
    return np.asarray(order[place])
