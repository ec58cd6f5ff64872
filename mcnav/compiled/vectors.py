"""Vectors of `LANES` numbers in compiled code: one sample in each lane, and a processor's vector instructions for them.

A loop over the lanes of arrays is vectorised by the compiler only after it has checked, each time, that the arrays do
not overlap. Here a vector is a value: `load` and `store` take it from and to an array whose last axis is the lanes, and
between them the operators ``+ - * /`` and comparisons, `numpy.sqrt`, `numpy.rint`, `numpy.abs`, `fma` and `where` work
lane by lane. A scalar next to a vector stands for equal lanes. An `inlined` function of numbers takes vectors as well.

`Lanes` holds doubles, `Singles` numbers of single precision, `Words` unsigned integers of 64 bits, and `Mask` truth
values. A `Part` holds the doubles of PART lanes, as many as a register of 512 bits does: with `load_part` and
`store_part`, code that works on many vectors at once keeps them in registers.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from itertools import repeat
from math import prod
from typing import Any, Final, TypeAlias

import numpy as np
from llvmlite import ir
from numba import types as numba_types
from numba.extending import (
    intrinsic,
    lower_builtin,
    lower_cast,
    models,
    register_model,
    type_callable,
)

from mcnav.arrays.types import Array
from mcnav.compiled.shapes import check_shape

LANES: Final = 32
"""Samples that are simulated together."""

PART: Final = 8
"""Lanes of a part."""

PARTS: Final = LANES // PART

DOUBLES: Final = 8
"""Doubles of a cache line, at which the rooms of `room` begin."""

Vector: TypeAlias = Any
"""`Lanes`, as a type checker sees it."""

_INDEX: Final = ir.IntType(32)
_DOUBLES: Final = ir.VectorType(ir.DoubleType(), LANES)
PART_OF_DOUBLES: Final = ir.VectorType(ir.DoubleType(), PART)
"""A part, for the compiler."""

_SINGLES: Final = ir.VectorType(ir.FloatType(), LANES)
_WORDS: Final = ir.VectorType(ir.IntType(64), LANES)
_MASK: Final = ir.VectorType(ir.IntType(1), LANES)


types: Any = numba_types


class _Vector(numba_types.Type):
    """Numba's type of a vector."""

    scalars: tuple[type, ...] = ()
    size = LANES

    def __init__(self, name: str) -> None:
        super().__init__(name=f"{name}[{self.size}]")

    def unify(self, typingctx: Any, other: Any) -> Any:
        return self if isinstance(other, self.scalars) else None


class Lanes(_Vector):
    """Doubles."""

    scalars = (types.Float, types.Integer)


class Part(_Vector):
    """Doubles of some of the lanes."""

    scalars = (types.Float, types.Integer)
    size = PART


class Singles(_Vector):
    """Numbers of single precision."""

    scalars = (types.Float, types.Integer)


class Words(_Vector):
    """Unsigned integers of 64 bits."""

    scalars = (types.Integer,)


class Mask(_Vector):
    """Truth values."""


lanes, part, singles, words, mask = Lanes("Lanes"), Part("Part"), Singles("Singles"), Words("Words"), Mask("Mask")


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, of: Any) -> None:
        super().__init__(manager, of, _DOUBLES)


@register_model(Part)
class _PartModel(models.PrimitiveModel):
    def __init__(self, manager: Any, of: Any) -> None:
        super().__init__(manager, of, PART_OF_DOUBLES)


@register_model(Singles)
class _SinglesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, of: Any) -> None:
        super().__init__(manager, of, _SINGLES)


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
    equal = ir.Constant(ir.VectorType(_INDEX, of.count), None)
    return builder.shuffle_vector(one, ir.Constant(of, ir.Undefined), equal)


@lower_cast(types.Float, lanes)
@lower_cast(types.Integer, lanes)
def _lanes_of_scalar(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    return _spread(builder, context.cast(builder, value, source, types.float64), _DOUBLES)


@lower_cast(types.Float, part)
@lower_cast(types.Integer, part)
def _part_of_scalar(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    return _spread(builder, context.cast(builder, value, source, types.float64), PART_OF_DOUBLES)


@lower_cast(types.Float, singles)
@lower_cast(types.Integer, singles)
def _singles_of_scalar(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    return _spread(builder, context.cast(builder, value, source, types.float32), _SINGLES)


@lower_cast(types.Integer, words)
def _words_of_scalar(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    return _spread(builder, context.cast(builder, value, source, types.uint64), _WORDS)


def _define(symbol: Any, result: Any, operands: tuple[Any, ...], method: str, *first: str) -> None:
    """Define an operator by the instruction that a method of the builder makes: of vectors, or of one and a scalar."""

    @type_callable(symbol)
    def _type(context: Any) -> Any:
        def typer(*given: Any) -> Any:
            fits = len(given) == len(operands) and all(
                of is operand or isinstance(of, operand.scalars) for of, operand in zip(given, operands, strict=True)
            )
            return result if fits and any(map(operator.is_, given, operands)) else None

        return typer

    def _lower(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        vectors = map(context.cast, repeat(builder), given, signature.args, operands)
        return getattr(builder, method)(*first, *vectors)

    lower_builtin(symbol, *operands)(_lower)
    if len(operands) > 1:
        for scalar in operands[0].scalars:
            lower_builtin(symbol, scalar, operands[1])(_lower)
            lower_builtin(symbol, operands[0], scalar)(_lower)


for _symbol, _in_place, _name in (
    (operator.add, operator.iadd, "fadd"),
    (operator.sub, operator.isub, "fsub"),
    (operator.mul, operator.imul, "fmul"),
    (operator.truediv, operator.itruediv, "fdiv"),
):
    for _kind in (lanes, part, singles):
        _define(_symbol, _kind, (_kind, _kind), _name)
        _define(_in_place, _kind, (_kind, _kind), _name)
for _kind in (lanes, part, singles):
    _define(operator.neg, _kind, (_kind,), "fneg")
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


_FLOATS: Final = {
    lanes: (_DOUBLES, f"v{LANES}f64"),
    part: (PART_OF_DOUBLES, f"v{PART}f64"),
    singles: (_SINGLES, f"v{LANES}f32"),
}
"""Types of vectors of floating point numbers, for the compiler, and how its functions call them."""


def _call(builder: Any, name: str, kind: Any, given: Any) -> Any:
    """Call one of LLVM's functions for vectors of a kind."""
    vector, suffix = _FLOATS[kind]
    of = ir.FunctionType(vector, [vector] * len(given))
    name = f"llvm.{name}.{suffix}"
    return builder.call(builder.module.globals.get(name) or ir.Function(builder.module, of, name), given)


def _define_function(function: Any, name: str) -> None:
    """Define a function of numpy by one of LLVM's."""

    @type_callable(function)
    def _type(context: Any) -> Any:
        return lambda given: given(given) if given in _FLOATS else None

    for kind in _FLOATS:

        @lower_builtin(function, kind)
        def _lower(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            return _call(builder, name, signature.return_type, given)


for _symbol, _name in ((np.sqrt, "sqrt"), (np.rint, "rint"), (np.abs, "fabs")):
    _define_function(_symbol, _name)


@intrinsic
def _fma(context: Any, one: Any, other: Any, third: Any) -> Any:
    """Return ``one * other + third``, rounded once, whatever the compiler may contract."""
    kind = singles if singles in (one, other, third) else lanes

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        return _call(builder, "fma", kind, given)

    return kind(kind, kind, kind), generate


@intrinsic
def _where(context: Any, condition: Any, one: Any, other: Any) -> Any:
    """Choose lane by lane: of one where the condition holds, of the other elsewhere."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        return builder.select(*given)

    result = words if words in (one, other) else lanes
    return result(mask, result, result), generate


def _define_conversion(result: Any, given: Any, instruction: str, of: ir.VectorType) -> Callable[..., Any]:
    """Define the conversion of vectors of one type to another by a method of the builder."""

    @intrinsic
    def _convert(context: Any, value: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            return getattr(builder, instruction)(values[0], of)

        return result(given), generate

    converted: Callable[..., Any] = _convert
    return converted


def pointer(context: Any, builder: Any, array_type: Any, array: Any, place: Any, of: ir.VectorType) -> Any:
    """Return the pointer to a vector within an array in C order whose last axis has as many numbers."""
    view = context.make_array(array_type)(context, builder, array)
    shape = [builder.extract_value(view.shape, axis) for axis in range(array_type.ndim)]
    index = place[0]
    for axis, at in enumerate(place[1:], 1):
        index = builder.add(builder.mul(index, shape[axis]), at)
    first = builder.gep(view.data, [builder.mul(index, ir.Constant(index.type, of.count))])
    return builder.bitcast(first, of.as_pointer())


def place_type(array: Any, place: Any) -> Any:
    """Return the type of a place; TypeError unless it leaves the last axis alone of an array of numbers of 64 bits."""
    count = len(place) if isinstance(place, types.BaseTuple) else 1
    fits = isinstance(array, types.Array) and array.layout == "C" and array.ndim == count + 1
    if not fits or array.dtype not in (types.float64, types.uint64):
        raise TypeError(f"a vector of {array} has no place {place}")
    return types.UniTuple(types.intp, count) if isinstance(place, types.BaseTuple) else types.intp


def unpack(builder: Any, place: Any, of: Any) -> Any:
    """Return the indices of a place of a type."""
    if not isinstance(of, types.BaseTuple):
        return [place]
    return [builder.extract_value(place, axis) for axis in range(len(of))]


def _make_load(array: Any, place: Any, of: ir.VectorType, result: Any) -> Any:
    """Return the signature of loading a vector, and what generates it."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        indices = unpack(builder, given[1], signature.args[1])
        value = builder.load(pointer(context, builder, signature.args[0], given[0], indices, of))
        value.align = 8
        return value

    return result(array, place_type(array, place)), generate


def _make_store(array: Any, place: Any, of: ir.VectorType, value: Any) -> Any:
    """Return the signature of storing a vector, and what generates it."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        indices = unpack(builder, given[1], signature.args[1])
        stored = builder.store(given[2], pointer(context, builder, signature.args[0], given[0], indices, of))
        stored.align = 8
        return context.get_dummy_value()

    return types.void(array, place_type(array, place), value), generate


@intrinsic
def _load(context: Any, array: Any, place: Any) -> Any:
    """Return the vector of an array, shape (..., LANES), at a place."""
    of, result = (_WORDS, words) if array.dtype is types.uint64 else (_DOUBLES, lanes)
    return _make_load(array, place, of, result)


@intrinsic
def _store(context: Any, array: Any, place: Any, value: Any) -> Any:
    """Write a vector to an array, shape (..., LANES), at a place."""
    return _make_store(array, place, _DOUBLES, lanes)


@intrinsic
def _load_part(context: Any, array: Any, place: Any) -> Any:
    """Return the part of an array, shape (..., PART), at a place."""
    return _make_load(array, place, PART_OF_DOUBLES, part)


@intrinsic
def _store_part(context: Any, array: Any, place: Any, value: Any) -> Any:
    """Write a part to an array, shape (..., PART), at a place."""
    return _make_store(array, place, PART_OF_DOUBLES, part)


load: Final[Callable[..., Vector]] = _load
store: Final[Callable[..., None]] = _store
load_part: Final[Callable[..., Vector]] = _load_part
store_part: Final[Callable[..., None]] = _store_part
fma: Final[Callable[..., Vector]] = _fma
where: Final[Callable[..., Vector]] = _where
bits: Final[Callable[..., Any]] = _define_conversion(words, lanes, "bitcast", _WORDS)
"""The bits of doubles, as words."""

doubles: Final[Callable[..., Vector]] = _define_conversion(lanes, words, "bitcast", _DOUBLES)
"""The doubles that have the bits of words."""

narrow: Final[Callable[..., Vector]] = _define_conversion(singles, lanes, "fptrunc", _SINGLES)
"""Doubles as numbers of single precision."""

widen: Final[Callable[..., Vector]] = _define_conversion(lanes, singles, "fpext", _DOUBLES)
"""Numbers of single precision as doubles."""


Rooms: TypeAlias = Callable[..., Array]
"""Makes a room as `room` does."""


def room(rows: int, *columns: int) -> Array:
    """Return zeros of shape (rows, ..., LANES) that begin at a cache line."""
    return _zeros((rows, *columns, LANES))


def room_of_parts(*shape: int) -> Array:
    """Return zeros of shape (..., PART) that begin at a cache line."""
    return _zeros((*shape, PART))


def _zeros(shape: tuple[int, ...]) -> Array:
    if min(shape) < 0:
        raise ValueError(f"shape: got {shape}, expected lengths of at least zero")
    size = prod(shape)
    buffer = np.zeros(size + DOUBLES)
    begin = -(buffer.__array_interface__["data"][0] // buffer.itemsize) % DOUBLES
    return buffer[begin : begin + size].reshape(shape)


def parts_of(lanes: Array) -> Array:
    """Return rows of lanes, shape (..., LANES), as rows of their parts, shape (..., PARTS, PART)."""
    check_shape("lanes", lanes, (*lanes.shape[:-1], LANES))
    return lanes.reshape(*lanes.shape[:-1], PARTS, PART)


STORED: Final = 1 << 14
"""Rows of lanes for which a `Store` has room unless it is told."""


class Store:
    """One array that holds rooms, so that all of them can be copied together.

    Attributes
    ----------
    rows : ndarray, shape (rows, LANES)
        Of all rooms made so far.
    """

    def __init__(self, most: int = STORED) -> None:
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
