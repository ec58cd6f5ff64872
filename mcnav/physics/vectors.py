"""Vectors of `LANES` numbers in compiled code: one sample in each lane, and a processor's vector instructions for them.

A loop over the lanes of arrays is vectorised by the compiler only after it has checked, each time, that the arrays do
not overlap. Here a vector is a value: `load` and `store` take it from and to an array whose last axis is the lanes, and
between them the operators ``+ - * /`` and comparisons, `numpy.sqrt`, `numpy.rint`, `numpy.abs`, `fma` and `where` work
lane by lane. A scalar next to a vector stands for equal lanes. An `inlined` function of numbers takes vectors as well.

`Lanes` holds doubles, `Words` unsigned integers of 64 bits, and `Mask` truth values.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from math import prod
from typing import Any, Final, TypeAlias

import numpy as np
from llvmlite import ir
from numba.core import cgutils
from numba.core import types as numba_types
from numba.core.extending import (
    intrinsic,
    lower_builtin,
    lower_cast,
    models,
    register_model,
)
from numba.core.typeconv import Conversion
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature

from mcnav._types import Array

LANES: Final = 32
"""Samples that are simulated together."""

DOUBLES: Final = 8
"""Doubles of a cache line, at which the rooms of `room` begin."""

Vector: TypeAlias = Any
"""`Lanes`, as a type checker sees it."""

_INDEX: Final = ir.IntType(32)
_DOUBLES: Final = ir.VectorType(ir.DoubleType(), LANES)
_WORDS: Final = ir.VectorType(ir.IntType(64), LANES)
_MASK: Final = ir.VectorType(ir.IntType(1), LANES)


types: Any = numba_types


class _Vector(numba_types.Type):
    """Numba's type of a vector."""

    scalars: tuple[type, ...] = ()

    def __init__(self, name: str) -> None:
        super().__init__(name=f"{name}[{LANES}]")

    def can_convert_from(self, typingctx: Any, other: Any) -> Conversion | None:
        return Conversion.safe if isinstance(other, self.scalars) else None

    def unify(self, typingctx: Any, other: Any) -> Any:
        return self if isinstance(other, self.scalars) else None


class Lanes(_Vector):
    """Doubles."""

    scalars = (types.Float, types.Integer)


class Words(_Vector):
    """Unsigned integers of 64 bits."""

    scalars = (types.Integer,)


class Mask(_Vector):
    """Truth values."""


lanes, words, mask = Lanes("Lanes"), Words("Words"), Mask("Mask")


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, of: Any) -> None:
        super().__init__(manager, of, _DOUBLES)


@register_model(Words)
class _WordsModel(models.PrimitiveModel):
    def __init__(self, manager: Any, of: Any) -> None:
        super().__init__(manager, of, _WORDS)


@register_model(Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, of: Any) -> None:
        super().__init__(manager, of, _MASK)


def _spread(builder: Any, scalar: Any, of: ir.VectorType) -> Any:
    """Return the vector whose lanes are all a scalar."""
    one = builder.insert_element(ir.Constant(of, ir.Undefined), scalar, ir.Constant(_INDEX, 0))
    return builder.shuffle_vector(one, ir.Constant(of, ir.Undefined), ir.Constant(ir.VectorType(_INDEX, LANES), None))


@lower_cast(types.Float, lanes)
@lower_cast(types.Integer, lanes)
def _lanes_of_scalar(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    return _spread(builder, context.cast(builder, value, source, types.float64), _DOUBLES)


@lower_cast(types.Integer, words)
def _words_of_scalar(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    return _spread(builder, context.cast(builder, value, source, types.uint64), _WORDS)


def _define(symbol: Any, result: Any, operands: tuple[Any, ...], method: str, *first: str) -> None:
    """Define an operator by the instruction that a method of the builder makes."""

    @infer_global(symbol)
    class _Template(ConcreteTemplate):
        cases = (signature(result, *operands),)

    @lower_builtin(symbol, *operands)
    def _lower(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        return getattr(builder, method)(*first, *given)


for _symbol, _in_place, _name in (
    (operator.add, operator.iadd, "fadd"),
    (operator.sub, operator.isub, "fsub"),
    (operator.mul, operator.imul, "fmul"),
    (operator.truediv, operator.itruediv, "fdiv"),
):
    _define(_symbol, lanes, (lanes, lanes), _name)
    _define(_in_place, lanes, (lanes, lanes), _name)
_define(operator.neg, lanes, (lanes,), "fneg")
for _symbol, _sign in ((operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">=")):
    _define(_symbol, mask, (lanes, lanes), "fcmp_ordered", _sign)
for _symbol, _in_place, _name in (
    (operator.add, operator.iadd, "add"),
    (operator.sub, operator.isub, "sub"),
    (operator.mul, operator.imul, "mul"),
    (operator.and_, operator.iand, "and_"),
    (operator.or_, operator.ior, "or_"),
    (operator.xor, operator.ixor, "xor"),
    (operator.rshift, operator.irshift, "lshr"),
    (operator.lshift, operator.ilshift, "shl"),
):
    _define(_symbol, words, (words, words), _name)
    _define(_in_place, words, (words, words), _name)
_define(operator.eq, mask, (words, words), "icmp_unsigned", "==")
_define(operator.and_, mask, (mask, mask), "and_")
_define(operator.iand, mask, (mask, mask), "and_")
_define(operator.invert, mask, (mask,), "not_")


def _define_function(function: Any, name: str) -> None:
    """Define a function of numpy by one of LLVM's."""

    @infer_global(function)
    class _Template(ConcreteTemplate):
        cases = (signature(lanes, lanes),)

    @lower_builtin(function, lanes)
    def _lower(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        kind = ir.FunctionType(_DOUBLES, [_DOUBLES])
        called = cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{LANES}f64")
        return builder.call(called, given)


for _symbol, _name in ((np.sqrt, "sqrt"), (np.rint, "rint"), (np.abs, "fabs")):
    _define_function(_symbol, _name)


@intrinsic
def _fma(context: Any, one: Any, other: Any, third: Any) -> Any:
    """Return ``one * other + third``, rounded once, whatever the compiler may contract."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        kind = ir.FunctionType(_DOUBLES, [_DOUBLES] * 3)
        called = cgutils.get_or_insert_function(builder.module, kind, f"llvm.fma.v{LANES}f64")
        return builder.call(called, given)

    return lanes(lanes, lanes, lanes), generate


@intrinsic
def _where(context: Any, condition: Any, one: Any, other: Any) -> Any:
    """Choose lane by lane: of one where the condition holds, of the other elsewhere."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        return builder.select(*given)

    result = words if words in (one, other) else lanes
    return result(mask, result, result), generate


@intrinsic
def _bits(context: Any, value: Any) -> Any:
    """Return the bits of doubles as words."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        return builder.bitcast(given[0], _WORDS)

    return words(lanes), generate


@intrinsic
def _doubles(context: Any, value: Any) -> Any:
    """Return the doubles that have the bits of words."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        return builder.bitcast(given[0], _DOUBLES)

    return lanes(words), generate


def _pointer(context: Any, builder: Any, array_type: Any, array: Any, place: Any, of: ir.VectorType) -> Any:
    """Return the pointer to a vector within an array in C order whose last axis has LANES numbers."""
    view = context.make_array(array_type)(context, builder, array)
    shape = cgutils.unpack_tuple(builder, view.shape, array_type.ndim)
    index = place[0]
    for axis, at in enumerate(place[1:], 1):
        index = builder.add(builder.mul(index, shape[axis]), at)
    first = builder.gep(view.data, [builder.mul(index, ir.Constant(index.type, LANES))])
    return builder.bitcast(first, of.as_pointer())


def _place_type(array: Any, place: Any) -> Any:
    """Return the type of a place, and check that it leaves the last axis of the array alone."""
    count = len(place) if isinstance(place, types.BaseTuple) else 1
    if not isinstance(array, types.Array) or array.layout != "C" or array.ndim != count + 1:
        raise TypeError(f"a vector of {array} has no place {place}")
    return types.UniTuple(types.intp, count) if isinstance(place, types.BaseTuple) else types.intp


def _unpack(builder: Any, place: Any, of: Any) -> Any:
    return cgutils.unpack_tuple(builder, place, len(of)) if isinstance(of, types.BaseTuple) else [place]


@intrinsic
def _load(context: Any, array: Any, place: Any) -> Any:
    """Return the vector of an array, shape (..., LANES), at a place."""
    of, result = (_WORDS, words) if array.dtype is types.uint64 else (_DOUBLES, lanes)

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        indices = _unpack(builder, given[1], signature.args[1])
        value = builder.load(_pointer(context, builder, signature.args[0], given[0], indices, of))
        value.align = 8
        return value

    return result(array, _place_type(array, place)), generate


@intrinsic
def _store(context: Any, array: Any, place: Any, value: Any) -> Any:
    """Write a vector to an array, shape (..., LANES), at a place."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        indices = _unpack(builder, given[1], signature.args[1])
        stored = builder.store(given[2], _pointer(context, builder, signature.args[0], given[0], indices, _DOUBLES))
        stored.align = 8
        return context.get_dummy_value()

    return types.void(array, _place_type(array, place), lanes), generate


load: Final[Callable[..., Vector]] = _load
store: Final[Callable[..., None]] = _store
fma: Final[Callable[..., Vector]] = _fma
where: Final[Callable[..., Vector]] = _where
bits: Final[Callable[..., Any]] = _bits
doubles: Final[Callable[..., Vector]] = _doubles


Rooms: TypeAlias = Callable[..., Array]
"""Makes a room as `room` does."""


def room(rows: int, *columns: int) -> Array:
    """Return zeros of shape (rows, ..., LANES) that begin at a cache line."""
    size = prod((rows, *columns)) * LANES
    buffer = np.zeros(size + DOUBLES)
    begin = -(buffer.__array_interface__["data"][0] // buffer.itemsize) % DOUBLES
    return buffer[begin : begin + size].reshape((rows, *columns, LANES))


class Store:
    """One array that holds rooms, so that all of them can be copied together.

    Attributes
    ----------
    rows : ndarray, shape (rows, LANES)
        Of all rooms made so far.
    """

    def __init__(self, most: int = 1 << 14) -> None:
        self._all, self._used = room(most), 0

    def __call__(self, rows: int, *columns: int) -> Array:
        """Make a room as `room` does."""
        begin, shape = self._used, (rows, *columns, LANES)
        self._used += prod((rows, *columns))
        if self._used > len(self._all):
            raise ValueError(f"{len(self._all)} rows are too few")
        return self._all[begin : self._used].reshape(shape)

    @property
    def rows(self) -> Array:
        """Return the rows of all rooms made so far."""
        return self._all[: self._used]
