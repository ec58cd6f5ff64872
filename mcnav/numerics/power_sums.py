"""Sums of powers of samples' errors at many epochs, computed from histories."""

from __future__ import annotations

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.power_sums import PowerSums, sums_of


def sum_powers(histories: Array, pivot: Array) -> PowerSums:
    """Sum the powers of histories, shape (n, m, k), about a pivot, shape (m, k)."""
    from mcnav.numerics.power_sum_kernel import add_powers  # numba, which reading sums does not need

    epochs, outputs = pivot.shape
    sums = np.zeros((sums_of(outputs), epochs))
    add_powers(np.ascontiguousarray(histories), np.ascontiguousarray(pivot), sums)
    return PowerSums(len(histories), pivot, np.ascontiguousarray(sums.T))


def sum_powers_about_zero(histories: Array) -> PowerSums:
    """Sum the powers of histories, shape (n, m, k), that are finite throughout, about zero."""
    known = np.isfinite(histories).all(axis=(1, 2))
    return sum_powers(histories if known.all() else histories[known], np.zeros(histories.shape[1:]))
