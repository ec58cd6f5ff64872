"""Quantities of a loop by name: scalars and vectors, their places in X, and the values that users' methods see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from typing import Any, Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.scenario import ScenarioError
from mcnav.errors import suggestion
from mcnav.systems.closed_loop.declarations import Attitude
from mcnav.systems.closed_loop.rotations import Side, from_matrix, to_matrix
from mcnav.systems.user.returned import real_numbers
from mcnav.systems.user.settings import NAME, check_unit

MOST_AXES: Final = 100

ORTHOGONAL: Final = 1e-6
"""Departure from one of a rotation matrix times its transpose, of matrices that users return."""


@dataclass(frozen=True)
class Quantity:
    """A scalar, without axes, or a vector; an attitude where `turns` says in which axes its deviations are."""

    name: str
    unit: str
    axes: tuple[str, ...] = ()
    turns: Side | None = None

    @property
    def size(self) -> int:
        """Numbers of it."""
        return len(self.axes) or 1

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its components.

        >>> Quantity("position", "m", ("x", "z")).names
        ('position_x', 'position_z')
        """
        return tuple(f"{self.name}_{axis}" for axis in self.axes) or (self.name,)


def read_axes(where: str, axes: Any) -> tuple[str, ...]:
    """Read axes: their number, letters, or names.

    >>> read_axes("truth", 3), read_axes("truth", "xz"), read_axes("truth", ["north", "east"])
    (('x', 'y', 'z'), ('x', 'z'), ('north', 'east'))
    """
    if isinstance(axes, int) and not isinstance(axes, bool) and 1 <= axes <= MOST_AXES:
        return tuple("xyz"[:axes]) if axes <= 3 else tuple(str(number) for number in range(1, axes + 1))
    listed = tuple(axes) if isinstance(axes, (str, Sequence)) else ()
    if not all(isinstance(axis, str) and axis.isidentifier() for axis in listed) or len(set(listed)) < len(listed):
        raise ScenarioError("type", f"{where}: axes must be a number, letters such as 'xz', or names; got {axes!r:.80}")
    return listed


def read_quantities(where: str, entries: Any) -> tuple[Quantity, ...]:
    """Read a mapping of names to units, or to units with axes; `ScenarioError` when it is none."""
    if not isinstance(entries, Mapping):
        raise ScenarioError("type", f"{where} must give a unit for each name; got {entries!r:.80}")
    quantities = []
    for name, entry in entries.items():
        if isinstance(entry, Attitude) and isinstance(name, str):
            quantities.append(read_attitude(f"{where}: {name}", name, entry))
            continue
        unit, axes = entry if isinstance(entry, tuple) and len(entry) == 2 else (entry, ())
        if not isinstance(name, str) or not NAME.fullmatch(name):
            raise ScenarioError("type", f"{where}: {name!r} is not a name of letters, digits and _")
        if not isinstance(unit, str):
            raise ScenarioError("type", f"{where}: {name} needs a unit, or a unit and axes; got {entry!r:.80}")
        check_unit(where, unit, unit)
        quantities.append(Quantity(name, unit, read_axes(f"{where}: {name}", axes)))
    return tuple(quantities)


def read_attitude(where: str, name: str, declared: Attitude) -> Quantity:
    """Read an attitude; `ScenarioError` when its errors or axes are none."""
    if declared.errors not in ("reference", "body"):
        raise ScenarioError("type", f"{where}: errors are in 'reference' or 'body' axes; got {declared.errors!r:.40}")
    axes = read_axes(where, declared.axes)
    if len(axes) != 3:
        raise ScenarioError("type", f"{where}: an attitude has three axes; got {declared.axes!r:.80}")
    return Quantity(name, "rad", axes, declared.errors)


@dataclass(frozen=True)
class Block:
    """Quantities that follow each other in X, from a place on."""

    what: str
    quantities: tuple[Quantity, ...]
    begin: int = 0

    @cached_property
    def size(self) -> int:
        """Numbers of all."""
        return sum(quantity.size for quantity in self.quantities)

    @cached_property
    def whole(self) -> slice:
        """Their place in X."""
        return slice(self.begin, self.begin + self.size)

    def places(self) -> tuple[tuple[Quantity, slice], ...]:
        """Return the quantities, each with its place in X."""
        return self._places

    @cached_property
    def _places(self) -> tuple[tuple[Quantity, slice], ...]:
        ends = list(accumulate(quantity.size for quantity in self.quantities))
        return tuple(
            (quantity, slice(self.begin + end - quantity.size, self.begin + end))
            for quantity, end in zip(self.quantities, ends, strict=True)
        )

    def of(self, name: str) -> slice | None:
        """Return the place of a quantity; none when there is no such name."""
        return next((place for quantity, place in self.places() if quantity.name == name), None)

    @property
    def attitudes(self) -> tuple[tuple[slice, Side], ...]:
        """Places of attitudes, and the axes of their deviations."""
        return tuple((place, quantity.turns) for quantity, place in self.places() if quantity.turns is not None)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the quantities."""
        return tuple(quantity.name for quantity in self.quantities)

    @cached_property
    def name_set(self) -> frozenset[str]:
        """The same as a set."""
        return frozenset(self.names)

    @cached_property
    def rows(self) -> tuple[tuple[str, Quantity, slice], ...]:
        """Names and quantities with their places in the block."""
        return tuple(
            (quantity.name, quantity, slice(place.start - self.begin, place.stop - self.begin))
            for quantity, place in self._places
        )

    @cached_property
    def views(self) -> dict[str, View]:
        """Views of the quantities in users' methods, by name."""
        return {
            quantity.name: View(place, bool(quantity.axes), quantity.turns is not None)
            for quantity, place in self._places
        }


@dataclass(frozen=True)
class View:
    """View of a quantity in a user's method: its place in an array, or zeros of so many numbers; see `as_seen`."""

    place: slice | int
    vector: bool
    attitude: bool = False

    def of(self, array: Array) -> Array:
        """Return the quantity in an array, shape (size, n)."""
        place = self.place
        numbers = np.zeros((place, array.shape[1])) if isinstance(place, int) else array[place]
        return as_seen(numbers, self.vector, self.attitude)


class Values:
    """Values of quantities by name, for users' methods; a name that there is not is refused.

    Parameters
    ----------
    parts : tuple of mapping of str to View, and ndarray
        Quantities of arrays, shape (size, n), each made when it is first asked for.
    """

    def __init__(self, what: str, *parts: tuple[Mapping[str, View], Array]) -> None:
        own = self.__dict__
        own["_what"], own["_parts"] = what, parts

    @classmethod
    def given(cls, what: str, values: Mapping[str, Array]) -> Values:
        """Return values that are there already."""
        result = cls(what)
        result.__dict__.update(values)
        return result

    def __getattr__(self, name: str) -> Array:
        if name.startswith("__") or "_parts" not in self.__dict__:
            raise AttributeError(name)
        for views, array in self._parts:
            if name in views:
                value: Array = views[name].of(array)
                self.__dict__[name] = value
                return value
        known = [key for key in self.__dict__ if key not in ("_what", "_parts")]
        known += [key for views, _ in self._parts for key in views if key not in known]
        raise AttributeError(f"{self._what} has no {name!r}{suggestion(name, known)}")

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"{self._what}.{name} cannot be set; return what changes")


def as_seen(numbers: Array, vector: bool, attitude: bool = False) -> Array:
    """Return numbers of X, shape (size, n), as users' methods see them: (n,), (n, axes) or (n, 3, 3); not writable."""
    seen = to_matrix(numbers) if attitude else numbers.T if vector else numbers[0]
    seen.setflags(write=False)
    return seen


def as_kept(returned: Any, quantity: Quantity, count: int, where: str) -> Array:
    """Return what a user's method returned, as numbers of X, shape (size, n) or (size, 1).

    Raises `ValueError` when the shape is wrong.
    """
    values = real_numbers(returned, where)
    shape, size = values.shape, len(quantity.axes)
    if size:
        if shape == (count, size):
            return values.T
        if shape == (size,):
            return values[:, None]
        wanted = f"({count}, {size})"
    else:
        if shape in ((count,), ()):
            return values.reshape(1, -1)
        wanted = f"({count},)"
    raise ValueError(f"{where} must have shape {wanted}, for {count} samples; got {shape}")


def attitude_kept(returned: Any, count: int, where: str) -> Array:
    """Return rotation matrices that a user's method returned as rotation vectors, shape (3, n) or (3, 1).

    Raises `ValueError` when they are no rotations; what is not finite stays so.
    """
    matrices = real_numbers(returned, where)
    if matrices.shape not in ((count, 3, 3), (3, 3)):
        raise ValueError(f"{where} must have shape ({count}, 3, 3), for {count} samples; got {matrices.shape}")
    matrices = matrices.reshape(-1, 3, 3)
    gaps = np.abs(matrices @ matrices.swapaxes(1, 2) - np.eye(3)).max(axis=(1, 2))
    if np.any(gaps > ORTHOGONAL) or np.any(np.linalg.det(matrices) < 0.0):
        raise ValueError(f"{where} must be rotation matrices; theirs times their transpose departs from one")
    return from_matrix(matrices)


def spread(
    block: Block, returned: Any, count: int, where: str, before: Array | None = None, into: Array | None = None
) -> Array:
    """Return a mapping of names to values as numbers of a block, shape (size, n).

    The values are states where ``before`` gives those of what is left out; else rates, and what is left out is zero.
    They are written into an array of zeros, where one is given.

    Raises `ValueError` when a name is unknown, or a shape is wrong.
    """
    result = np.zeros((block.size, count)) if into is None else into
    if before is not None:
        result[:] = before
    if not isinstance(returned, Mapping):
        raise ValueError(f"{where} must return a mapping of names to values; got {type(returned).__name__}")
    taken = 0
    for name, quantity, place in block.rows:
        if name in returned:
            taken += 1
            is_attitude = quantity.turns is not None and before is not None
            kept = attitude_kept(returned[name], count, f"{name} of {where}") if is_attitude else None
            result[place] = as_kept(returned[name], quantity, count, f"{name} of {where}") if kept is None else kept
    if taken < len(returned):
        unknown = next(name for name in returned if name not in block.names)
        raise ValueError(
            f"{where} returned {unknown!r}, which is no {block.what}{suggestion(str(unknown), block.names)}"
        )
    return result
