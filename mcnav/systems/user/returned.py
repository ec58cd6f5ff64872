"""Numbers that a user's class returns: real ones, which no conversion has to leave anything out of."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from mcnav.arrays.types import Array

REAL: Final = "biuf"
"""Kinds of dtypes that are real numbers: booleans, integers, floating-point numbers."""


def numbers_of(returned: Any, method: str) -> Array:
    """Return what a method returned as floating-point numbers, in an array of its own; see `real_numbers`."""
    return np.array(real_numbers(returned, method))


def real_numbers(returned: Any, where: str) -> Array:
    """Return what a user's code returned as floating-point numbers, without a copy where they are.

    Raises
    ------
    ValueError
        When it has another dtype, of which numpy would drop the imaginary part, the mask, or read texts and dates; or
        when its rows are of different lengths.

    Examples
    --------
    >>> real_numbers([[1, 2]], "propagate")
    array([[1., 2.]])
    >>> real_numbers(np.array([1j]), "propagate")
    Traceback (most recent call last):
    ...
    ValueError: propagate must return real numbers; got dtype complex128
    """
    rows = returned if isinstance(returned, (list, tuple)) else (returned,)
    masked = next((row for row in rows if isinstance(row, np.ma.MaskedArray)), None)
    if masked is not None:
        lost = f"got a masked array of dtype {masked.dtype}, whose mask would be lost"
        raise ValueError(f"{where} must return real numbers; {lost}")
    try:
        values = np.asarray(returned)
    except ValueError:
        raise ValueError(f"{where} must return real numbers; got rows of different lengths") from None
    if values.dtype.kind not in REAL:
        raise ValueError(f"{where} must return real numbers; got dtype {values.dtype}")
    return np.asarray(values, dtype=float)
