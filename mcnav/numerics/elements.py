"""Matrices from their elements."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mcnav.arrays.types import Array


def stack_elements(rows: Sequence[Sequence[Array | float]]) -> Array:
    """Form matrices from elements, each of shape (...) or a number for all: shape (..., r, c).

    The first element has the shape of all. `numpy.stack` of rows takes several times as long where there is one matrix.

    >>> stack_elements([[np.array([1.0, 2.0]), 0.0]])
    array([[[1., 0.]],
    <BLANKLINE>
           [[2., 0.]]])
    """
    elements = np.empty((*np.shape(rows[0][0]), len(rows), len(rows[0])))
    for i, row in enumerate(rows):
        for j, element in enumerate(row):
            elements[..., i, j] = element
    return elements
