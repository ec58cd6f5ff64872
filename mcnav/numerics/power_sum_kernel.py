"""Sums of powers of many samples' errors, with nothing in memory but the sums."""

from __future__ import annotations

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import uncontracted


@uncontracted
def add_powers(histories: Array, pivot: Array, sums: Array) -> None:
    """Add powers of histories about a pivot, sample after sample, epochs side by side in the processor's vectors.

    Parameters
    ----------
    histories : ndarray, shape (n, m, k)
    pivot : ndarray, shape (m, k)
    sums : ndarray, shape (mcnav.numerics.power_sums.sums_of(k), m)
    """
    epochs, outputs = pivot.shape
    away, square = np.empty((outputs, epochs)), np.empty((outputs, epochs))
    cubes = len(sums) - 2 * outputs
    for sample in range(len(histories)):
        for i in range(outputs):
            for epoch in range(epochs):
                away[i, epoch] = histories[sample, epoch, i] - pivot[epoch, i]
        column = outputs
        # sums of d, d^3 and d^4 of each output, and of d_i d_j of two
        for i in range(outputs):
            for epoch in range(epochs):
                square[i, epoch] = away[i, epoch] * away[i, epoch]
                sums[i, epoch] += away[i, epoch]
                sums[cubes + i, epoch] += square[i, epoch] * away[i, epoch]
                sums[cubes + outputs + i, epoch] += square[i, epoch] * square[i, epoch]
            for j in range(i, outputs):
                for epoch in range(epochs):
                    sums[column, epoch] += away[i, epoch] * away[j, epoch]
                column += 1
