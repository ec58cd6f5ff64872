"""Blocks of 3 x 3 numbers in compiled code: one such matrix for each lane of a part, or one that all lanes share.

Quantities of space come in threes, and a covariance of nine and more states is a matrix of blocks. A block is a tuple
of nine, by rows: of parts (`mcnav.compiled.vectors`), which a product keeps in registers, or of numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeAlias

import numpy as np
from llvmlite import ir
from numba import types as numba_types
from numba.extending import intrinsic

from mcnav.arrays.types import Array
from mcnav.compiled.jit import allocation_free_part, inlined
from mcnav.compiled.vectors import PART_OF_DOUBLES, Vector, part, place_type, pointer, unpack

types: Any = numba_types

THREE: Final = 3

ENTRIES: Final = 9
"""Parts or numbers of a block."""

_NUMBER: Final = ir.IntType(32)

Block: TypeAlias = Any
"""Nine parts or numbers, as a type checker sees them."""


def blocks_of(matrices: Array) -> Array:
    """Return matrices, shape (..., 3 a, 3 b), as blocks, shape (..., a, b, 9); other sizes are filled up with zeros.

    >>> blocks_of(np.eye(4)).shape
    (2, 2, 9)
    """
    *more, rows, columns = matrices.shape
    a, b = count_threes(rows), count_threes(columns)
    filled = np.zeros((*more, THREE * a, THREE * b))
    filled[..., :rows, :columns] = matrices
    parted = filled.reshape(*more, a, THREE, b, THREE).swapaxes(-3, -2)
    return np.ascontiguousarray(parted).reshape(*more, a, b, ENTRIES)


def count_threes(states: int) -> int:
    """Return how many threes hold so many states."""
    return -(-states // THREE)


def _pointers(context: Any, builder: Any, signature: Any, given: Any) -> list[Any]:
    """Return the pointers to the parts of a block of an array, shape (..., ENTRIES, PART), at a place."""
    indices = [*unpack(builder, given[1], signature.args[1]), ir.Constant(ir.IntType(64), 0)]
    first = pointer(context, builder, signature.args[0], given[0], indices, PART_OF_DOUBLES)
    return [builder.gep(first, [ir.Constant(_NUMBER, number)]) for number in range(ENTRIES)]


def _place_of_block(array: Any, place: Any) -> Any:
    """Return the type of a place that leaves the two last axes of an array alone."""
    return place_type(array.copy(ndim=array.ndim - 1), place)


@intrinsic
def _load_block(context: Any, array: Any, place: Any) -> Any:
    """Return the block of an array, shape (..., ENTRIES, PART), at a place."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        values = [builder.load(pointer) for pointer in _pointers(context, builder, signature, given)]
        for value in values:
            value.align = 8
        return context.make_tuple(builder, signature.return_type, values)

    return types.UniTuple(part, ENTRIES)(array, _place_of_block(array, place)), generate


@intrinsic
def _store_block(context: Any, array: Any, place: Any, values: Any) -> Any:
    """Write a block to an array, shape (..., ENTRIES, PART), at a place."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        parts = [builder.extract_value(given[2], number) for number in range(ENTRIES)]
        for value, at in zip(parts, _pointers(context, builder, signature, given), strict=True):
            builder.store(value, at).align = 8
        return context.get_dummy_value()

    return types.void(array, _place_of_block(array, place), types.UniTuple(part, ENTRIES)), generate


@intrinsic
def _load_numbers(context: Any, array: Any, place: Any) -> Any:
    """Return the block of numbers of an array, shape (..., ENTRIES), at a place."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        indices = unpack(builder, given[1], signature.args[1])
        first = pointer(context, builder, signature.args[0], given[0], indices, ir.VectorType(ir.DoubleType(), ENTRIES))
        first = builder.bitcast(first, ir.DoubleType().as_pointer())
        values = [builder.load(builder.gep(first, [ir.Constant(_NUMBER, number)])) for number in range(ENTRIES)]
        return context.make_tuple(builder, signature.return_type, values)

    return types.UniTuple(types.float64, ENTRIES)(array, place_type(array, place)), generate


load_block: Final[Callable[..., Block]] = _load_block
store_block: Final[Callable[..., None]] = _store_block
load_numbers: Final[Callable[..., Block]] = _load_numbers


@allocation_free_part
def add(a: Block, b: Block) -> Block:
    """Compute ``A + B``."""
    return (
        a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5], a[6] + b[6], a[7] + b[7],
        a[8] + b[8],
    )  # fmt: skip


@allocation_free_part
def subtract(a: Block, b: Block) -> Block:
    """Compute ``A - B``."""
    return (
        a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3], a[4] - b[4], a[5] - b[5], a[6] - b[6], a[7] - b[7],
        a[8] - b[8],
    )  # fmt: skip


@inlined
def scale(a: Block, f: Vector) -> Block:
    """Compute ``f A``."""
    return f * a[0], f * a[1], f * a[2], f * a[3], f * a[4], f * a[5], f * a[6], f * a[7], f * a[8]


@allocation_free_part
def scale_rows(a: Block, factors: Array, at: int) -> Block:
    """Multiply the rows of a block by numbers: the three at a place among so many threes."""
    x, y, z = factors[THREE * at], factors[THREE * at + 1], factors[THREE * at + 2]
    return x * a[0], x * a[1], x * a[2], y * a[3], y * a[4], y * a[5], z * a[6], z * a[7], z * a[8]


@inlined
def _choose(condition: float, one: Vector, other: Vector) -> Vector:
    return one if condition > 0.0 else other


@allocation_free_part
def choose(conditions: Block, a: Block, b: Block) -> Block:
    """Return entries of A where numbers are above zero, and of B elsewhere."""
    return (
        _choose(conditions[0], a[0], b[0]), _choose(conditions[1], a[1], b[1]), _choose(conditions[2], a[2], b[2]),
        _choose(conditions[3], a[3], b[3]), _choose(conditions[4], a[4], b[4]), _choose(conditions[5], a[5], b[5]),
        _choose(conditions[6], a[6], b[6]), _choose(conditions[7], a[7], b[7]), _choose(conditions[8], a[8], b[8]),
    )  # fmt: skip


@inlined
def transpose(a: Block) -> Block:
    """Return the transpose of a block."""
    return a[0], a[3], a[6], a[1], a[4], a[7], a[2], a[5], a[8]


@allocation_free_part
def multiply(a: Block, b: Block) -> Block:
    """Compute ``A B``."""
    return (
        a[0] * b[0] + a[1] * b[3] + a[2] * b[6],
        a[0] * b[1] + a[1] * b[4] + a[2] * b[7],
        a[0] * b[2] + a[1] * b[5] + a[2] * b[8],
        a[3] * b[0] + a[4] * b[3] + a[5] * b[6],
        a[3] * b[1] + a[4] * b[4] + a[5] * b[7],
        a[3] * b[2] + a[4] * b[5] + a[5] * b[8],
        a[6] * b[0] + a[7] * b[3] + a[8] * b[6],
        a[6] * b[1] + a[7] * b[4] + a[8] * b[7],
        a[6] * b[2] + a[7] * b[5] + a[8] * b[8],
    )


@allocation_free_part
def add_product(x: Block, a: Block, b: Block) -> Block:
    """Compute ``X + A B``."""
    return (
        x[0] + a[0] * b[0] + a[1] * b[3] + a[2] * b[6],
        x[1] + a[0] * b[1] + a[1] * b[4] + a[2] * b[7],
        x[2] + a[0] * b[2] + a[1] * b[5] + a[2] * b[8],
        x[3] + a[3] * b[0] + a[4] * b[3] + a[5] * b[6],
        x[4] + a[3] * b[1] + a[4] * b[4] + a[5] * b[7],
        x[5] + a[3] * b[2] + a[4] * b[5] + a[5] * b[8],
        x[6] + a[6] * b[0] + a[7] * b[3] + a[8] * b[6],
        x[7] + a[6] * b[1] + a[7] * b[4] + a[8] * b[7],
        x[8] + a[6] * b[2] + a[7] * b[5] + a[8] * b[8],
    )


@allocation_free_part
def subtract_product(x: Block, a: Block, b: Block) -> Block:
    """Compute ``X - A B``."""
    return (
        x[0] - a[0] * b[0] - a[1] * b[3] - a[2] * b[6],
        x[1] - a[0] * b[1] - a[1] * b[4] - a[2] * b[7],
        x[2] - a[0] * b[2] - a[1] * b[5] - a[2] * b[8],
        x[3] - a[3] * b[0] - a[4] * b[3] - a[5] * b[6],
        x[4] - a[3] * b[1] - a[4] * b[4] - a[5] * b[7],
        x[5] - a[3] * b[2] - a[4] * b[5] - a[5] * b[8],
        x[6] - a[6] * b[0] - a[7] * b[3] - a[8] * b[6],
        x[7] - a[6] * b[1] - a[7] * b[4] - a[8] * b[7],
        x[8] - a[6] * b[2] - a[7] * b[5] - a[8] * b[8],
    )


@allocation_free_part
def load_symmetric(p: Array, t: int, r: int, c: int) -> Block:
    """Return a block of a symmetric matrix of blocks of which the lower triangle counts."""
    block = load_block(p, (t, r, c)) if r >= c else transpose(load_block(p, (t, c, r)))
    return block


@allocation_free_part
def store_symmetric(p: Array, t: int, r: int, c: int, x: Block) -> None:
    """Write a block of a symmetric matrix of blocks to its lower triangle; on the diagonal the block's own counts."""
    if r == c:
        store_block(p, (t, r, c), (x[0], x[3], x[6], x[3], x[4], x[7], x[6], x[7], x[8]))
    elif r > c:
        store_block(p, (t, r, c), x)
    else:
        store_block(p, (t, c, r), transpose(x))
