"""Checks of the arrays that compiled code is given: it checks none itself, and would read or write beyond them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from numpy.typing import NDArray

from mcnav.arrays.types import IndexArray

Shape = tuple[int | None, ...]
"""Lengths of axes; none where any will do."""


def check_shape(name: str, array: NDArray[Any], shape: Shape) -> None:
    """Raise ValueError unless an array has a shape.

    >>> import numpy as np
    >>> check_shape("errors", np.zeros((7, 38)), (None, 39))
    Traceback (most recent call last):
    ...
    ValueError: errors: got an array of shape (7, 38), expected (any, 39)
    """
    fits = array.ndim == len(shape) and all(want in (None, has) for want, has in zip(shape, array.shape, strict=True))
    if not fits:
        expected = ", ".join("any" if length is None else str(length) for length in shape)
        raise ValueError(f"{name}: got an array of shape {array.shape}, expected ({expected})")


def check_shapes(arrays: Iterable[tuple[str, NDArray[Any], Shape]]) -> None:
    """Raise ValueError unless each array, with its name, has its shape."""
    for name, array, shape in arrays:
        check_shape(name, array, shape)


def check_numbers(name: str, numbers: IndexArray, count: int) -> None:
    """Raise ValueError unless all numbers are at least zero and below a count.

    >>> import numpy as np
    >>> check_numbers("epochs", np.array([0, 12]), 12)
    Traceback (most recent call last):
    ...
    ValueError: epochs: got the number 12, expected numbers from 0 to 11
    """
    if numbers.size and not 0 <= int(numbers.min()) <= int(numbers.max()) < count:
        wrong = int(numbers.min()) if numbers.min() < 0 else int(numbers.max())
        raise ValueError(f"{name}: got the number {wrong}, expected numbers from 0 to {count - 1}")
