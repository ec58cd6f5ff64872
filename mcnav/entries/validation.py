"""Validation of a table by pydantic, with mistakes in the words of the campaign file."""

from __future__ import annotations

import re
from functools import cache
from typing import Any, Final, TypeVar

from pydantic import TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from mcnav.entries.context import FileContext
from mcnav.entries.mistakes import TOLD
from mcnav.entries.quantities import Table
from mcnav.errors import MOST_PROBLEMS
from mcnav.physics.units import UnitError, conversion, parted, printable, si_unit

AnyTable = TypeVar("AnyTable", bound=Table)
AnyEntry = TypeVar("AnyEntry")

_BOUNDS: Final = {
    "greater_than": ("gt", "more than"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"),
}

_MESSAGES: Final = {
    "int_type": "expected a whole number",
    "string_type": "expected text in quotes",
    "string_pattern_mismatch": "expected some text without control characters",
    "model_type": "expected a table",
    "dict_type": "expected a table",
    "list_type": "expected a list",
    "model_attributes_type": "expected a table with a type",
    "union_tag_not_found": "expected a table with a type",
}
"""Messages by pydantic's error type, where pydantic's own words describe Python rather than TOML."""


def validate(table: type[AnyTable], content: object, context: FileContext, key: str = "") -> AnyTable | None:
    """Validate the content of the table at a key; when there are mistakes, add them to the context and return None."""
    return validate_entry(_form_of(table), content, context, key)


@cache
def _form_of(table: type[Table]) -> TypeAdapter[Any]:
    """Build the form of a table once: that takes longer than validating one."""
    return TypeAdapter(table)


def validate_entry(
    form: TypeAdapter[AnyEntry], content: object, context: FileContext, key: str = "", given: object = None
) -> AnyEntry | None:
    """Validate an entry of any type at a key; when there are mistakes, add them to the context and return None.

    ``given`` is what the form's annotations need besides the entry.
    """
    try:
        return form.validate_python(content, context=given)
    except ValidationError as invalid:
        for error in invalid.errors(include_url=False)[: MOST_PROBLEMS + 1]:
            at = key
            for place in error["loc"]:
                at += f" #{place + 1}" if isinstance(place, int) else f"{'.' if at else ''}{_named(place)}"
            context.problem(at, _message(error))
        return None


def _named(key: str) -> str:
    """Return a key as it is shown; one of blanks in quotes, as TOML writes it."""
    return key if key.strip() else f'"{key}"'


def _message(error: ErrorDetails) -> str:
    """Return the message for one of pydantic's errors: what came, and what is expected."""
    came, kind = error["input"], error["type"]
    if kind == TOLD:
        return error["msg"]
    if kind == "missing":
        return "is missing"
    if kind in ("too_short", "too_long"):
        limits = error["ctx"]
        bound = f"at least {limits['min_length']}" if kind == "too_short" else f"at most {limits['max_length']}"
        return f"got a list of length {len(came)}; expected {bound} entries"
    message = _MESSAGES.get(kind, str(error["msg"]).removeprefix("Value error, "))
    if kind == "value_error":
        return message
    message = _bound(error) or message
    shown = "a table" if isinstance(came, dict) else "a list" if isinstance(came, list) else printable(repr(came))
    message = re.sub(r"^[Ii]nput should be (?=greater|less)", "expected a number ", message)
    message = re.sub(r"^[Ii]nput should be ", "expected ", message)
    return f"got {shown}; {message[0].lower()}{message[1:]}"


def _bound(error: ErrorDetails) -> str:
    """Say the bound of a quantity in the unit in which it came; empty where it has none.

    >>> _bound({"type": "less_than", "loc": (), "msg": "", "input": "97 deg", "ctx": {"lt": 1.5707963267948966}})
    'expected less than 90 deg'
    """
    came = error["input"]
    if error["type"] not in _BOUNDS or not isinstance(came, int | float | str):
        return ""
    key, words = _BOUNDS[error["type"]]
    if not isinstance(came, str):
        per_cent = key == "lt" and error["ctx"][key] == 1.0 and came < 100.0
        return f'expected a number less than 1, such as "{came:g} %"' if per_cent else ""
    try:
        unit = parted(came)[1]
        bound = error["ctx"][key] * conversion(si_unit(unit), unit) if unit else error["ctx"][key]
    except UnitError:
        return ""
    return f"expected {words} {bound:.6g} {unit}".rstrip()
