"""Typed records of the JSON files of a run folder: read and written as such, for a folder may come from anywhere."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from mcnav.arrays.types import Array
from mcnav.files.whole import to_json

Json = dict[str, Any]
"""A table of a JSON file."""

Number = Annotated[float, BeforeValidator(lambda value: math.nan if value is None else value)]
"""JSON has no value for what is not finite: null is read as NaN."""


def _unchanged(array: Array) -> Array:
    return array


@dataclass(frozen=True)
class _Nested:
    """Reads an array from nested lists of numbers, null being NaN; `Record.to_json` converts it back."""

    lists: Any

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        def read(value: Any, lists: core_schema.ValidatorFunctionWrapHandler) -> Array:
            return value if isinstance(value, np.ndarray) else np.array(lists(value), dtype=float)

        return core_schema.no_info_wrap_validator_function(
            read,
            handler.generate_schema(self.lists),
            serialization=core_schema.plain_serializer_function_ser_schema(_unchanged),
        )


Vector = Annotated[Array, _Nested(list[float | None])]
Matrix = Annotated[Array, _Nested(list[list[float | None]])]
Matrices = Annotated[Array, _Nested(list[list[list[float | None]]])]


class Record(BaseModel):
    """A table of a file; keys that it does not know are ignored, and only fields that were set are written."""

    model_config = ConfigDict(extra="ignore", frozen=True, strict=True, populate_by_name=True, defer_build=True)

    def completed(self, fields: Mapping[str, object]) -> Self:
        """Return the record with further fields, which are checked; those that are none stay unset."""
        given = {name: getattr(self, name) for name in self.model_fields_set}
        return type(self).model_validate(given | {name: value for name, value in fields.items() if value is not None})

    def to_json(self) -> Json:
        """Return the fields that were set, as JSON holds them."""
        content: Json = to_json(self.model_dump(exclude_unset=True, by_alias=True))
        return content
