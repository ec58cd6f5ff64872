"""Sizes by axis: one for all axes, a list of all, or a table of some."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Final, get_args, get_origin

import numpy as np
from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, ValidatorFunctionWrapHandler
from pydantic_core.core_schema import (
    CoreSchema,
    no_info_plain_validator_function,
    no_info_wrap_validator_function,
)

from mcnav.arrays.types import Array
from mcnav.entries.mistakes import Mistake, Place, refuse
from mcnav.entries.quantities import UNIT, JsonSchema, Table
from mcnav.physics.units import UnitError, quantity

SIZED_AXES: Final = "x-axes"
"""Key of a JSON schema that stands for sizes by axis: the names of the axes; see `mcnav.entries.quantities.UNIT`."""

ONE_BY_ONE: Final = "x-one-by-one"
"""Key of such a schema whose axes have no size in common."""

LARGEST_SIZE: Final = 1e15
"""Size in SI units above which it is refused: a slip of the pen, and a risk of overflow."""

Fault = Callable[[float], str]
"""Returns what is wrong with a value, as the end of a message; nothing when it is right."""


def fault_of_size(size: float) -> str:
    """Return what is wrong with the size of an error."""
    if size < 0.0:
        return "a size must not be negative"
    return f"at most {LARGEST_SIZE:g} in SI units makes sense" if size > LARGEST_SIZE else ""


def within(least: float, most: float, unit: str, words: str = "a size must not be negative") -> Fault:
    """Return the `Fault` of values beyond two limits in an SI unit; ``words`` are about those at or below zero."""
    shown = "" if unit == "1" else f" {unit}"

    def fault(value: float) -> str:
        if value < min(least, 0.0) or (value == 0.0 < least):
            return words
        if value < least:
            return f"at least {least:.3g}{shown} makes sense"
        return f"at most {most:.3g}{shown} makes sense" if value > most else ""

    return fault


@dataclass(frozen=True)
class AxisSizes:
    """Annotation of a field with sizes by axis: an array, shape (axes,), SI, with NaN where none is given.

    Attributes
    ----------
    unit : str
        SI unit.
    axes : tuple of str
        Names; a quantity without axes has one, without a name.
    fault : callable
        Returns what is wrong with a size.
    complete : bool
        Whether each axis needs one.
    one_by_one : str
        What is expected in place of one size for all axes, if that is refused.
    shares : bool
        Whether an angle may be a share; see `mcnav.physics.units.quantity`.
    """

    unit: str
    axes: tuple[str, ...]
    fault: Fault = fault_of_size
    complete: bool = False
    one_by_one: str = ""
    shares: bool = False

    def read(self, entry: object) -> Array:
        """Read an entry; `ValidationError` lists its mistakes."""
        if self.one_by_one and not isinstance(entry, (dict, list)):
            raise refuse([Mistake(f"got {entry!r}; {self.one_by_one}")])
        result, mistakes = np.full(len(self.axes), np.nan), list[Mistake]()
        for number, (value, place) in self._values(entry, mistakes).items():
            try:
                size = quantity(value, self.unit, self.shares)
            except UnitError as wrong:
                mistakes.append(Mistake(str(wrong), place))
            else:
                if wrong_size := self.fault(size):
                    mistakes.append(Mistake(f"got {value!r}; {wrong_size}", place))
                result[number] = size or 0.0  # no negative zero
            if mistakes:
                break
        missing = [axis for axis, size in zip(self.axes, result, strict=True) if np.isnan(size)]
        if self.complete and missing and not mistakes:
            mistakes.append(Mistake(f"has none for {', '.join(missing)}; expected one for each axis"))
        if mistakes:
            raise refuse(mistakes)
        return result

    def _values(self, entry: object, mistakes: list[Mistake]) -> Mapping[int, tuple[object, Place]]:
        """Return the value of each axis that has one, by its number, and where it is written."""
        if isinstance(entry, dict) and len(self.axes) > 1:
            names = ", ".join(self.axes)
            mistakes += [Mistake(f"unknown axis; expected {names}", (axis,)) for axis in entry if axis not in self.axes]
            return {self.axes.index(axis): (value, (axis,)) for axis, value in entry.items() if axis in self.axes}
        if isinstance(entry, list) and len(self.axes) > 1:
            if len(entry) != len(self.axes):
                message = f"got a list of {len(entry)}; expected {len(self.axes)}, for {', '.join(self.axes)}"
                mistakes.append(Mistake(message))
                return {}
            return {number: (value, (number,)) for number, value in enumerate(entry)}
        return dict.fromkeys(range(len(self.axes)), (entry, ()))

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchema:
        required = {"required": list(self.axes)} if self.complete else {}
        marks = {ONE_BY_ONE: True} if self.one_by_one else {}
        return {UNIT: self.unit, SIZED_AXES: list(self.axes), **marks, **required}


@dataclass(frozen=True)
class OrSizes:
    """Annotation of a table that sizes by axis may stand for: those of its first key."""

    sizes: AxisSizes

    def __get_pydantic_core_schema__(self, source: type[Table], handler: GetCoreSchemaHandler) -> CoreSchema:
        def read(entry: object, table: ValidatorFunctionWrapHandler) -> Any:
            if isinstance(entry, dict) and not entry.keys() & set(self.sizes.axes):
                return table(entry)
            first = next(iter(source.model_fields))
            return source.model_construct({first}, **{first: self.sizes.read(entry)})

        return no_info_wrap_validator_function(read, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchema:
        node = handler.resolve_ref_schema(handler(schema))
        return {**node, UNIT: self.sizes.unit, SIZED_AXES: list(self.sizes.axes)}


def units_of(table: type[Table], above: str = "") -> dict[str, str]:
    """Return the SI units of a table's sizes by axis, by their keys; those of tables inside it after a dot as well."""
    units: dict[str, str] = {}
    for name, field in table.model_fields.items():
        for annotation in (*field.metadata, *_parts(field.annotation)):
            if isinstance(annotation, OrSizes):
                units[f"{above}{name}"] = annotation.sizes.unit
            elif isinstance(annotation, AxisSizes):
                units[f"{above}{name}"] = annotation.unit
            elif isinstance(annotation, type) and issubclass(annotation, Table):
                units |= units_of(annotation, f"{above}{name}.")
    return units


def _parts(annotation: Any) -> Iterator[Any]:
    """Yield the types and marks that an annotation consists of."""
    if get_origin(annotation) is Annotated:
        yield from (annotation.__metadata__)
        annotation = annotation.__origin__
    inside = () if isinstance(annotation, type) else get_args(annotation)
    yield annotation
    for each in inside:
        yield from _parts(each)
