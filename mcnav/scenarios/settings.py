"""Settings of a user's class: further keys of ``[scenario]``, each with the type that the class declares.

A unit such as ``"s"`` declares a quantity (a float, SI), ``["m/s^2"]`` several (an array, shape (n,)); ``str``,
``bool`` and ``int`` declare values of these types, ``[str]``, ``[bool]`` and ``[int]`` lists of them; ``pathlib.Path``
declares a file, found relative to the campaign file.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from mcnav.scenarios.inputs import InputFile
from mcnav.scenarios.protocol import ScenarioError
from mcnav.scenarios.sample_loop import format_exception
from mcnav.units import UnitError, conversion, printable, quantity

WORDS: Final[Mapping[type, str]] = {str: "text in quotes", bool: "true or false", int: "a whole number"}
LISTS: Final[Mapping[type, str]] = {
    str: 'a list of texts such as ["a", "b"]',
    bool: "a list such as [true, false]",
    int: "a list of whole numbers such as [1, 2]",
}
LARGEST: Final = 2**63 - 1
"""Whole numbers are those of TOML, of 64 bits."""

_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")

Plain = str | bool | int
Kind = str | type
Declared = Kind | list[Kind]
"""A unit, a type, or a list of one of these."""


@dataclass(frozen=True)
class Vector:
    """Several quantities, SI."""

    values: tuple[float, ...]


Value = float | Plain | Vector | tuple[Plain, ...] | InputFile


class SettingError(ValueError):
    """A value that is not as its class declares; for one of a list ``entry`` counts from zero."""

    def __init__(self, message: str, entry: int | None = None) -> None:
        super().__init__(message)
        self.entry = entry


def settings_of(kind: type) -> Mapping[str, Declared]:
    """Further keys of ``[scenario]`` that a class takes, and what each must be.

    Raises
    ------
    ScenarioError
        When the declaration is not of that form.
    """
    found, where = getattr(kind, "settings", {}), f"{kind.__name__}.settings"
    if not isinstance(found, Mapping):
        raise ScenarioError("type", f"{where} must give a unit for each name, such as {{'time': 's'}}, or a type")
    for name, declared in found.items():
        if not isinstance(name, str) or not _NAME.fullmatch(name) or name == "type":
            raise ScenarioError("type", f"{where}: {name!r} is no name: letters, digits and _ make one, but not 'type'")
        inner = declared[0] if isinstance(declared, list) and len(declared) == 1 else declared
        if inner is Path and not isinstance(declared, list):
            continue
        if isinstance(inner, str):
            check_unit(where, inner, inner)
        elif not isinstance(inner, type) or inner not in WORDS:
            raise ScenarioError(
                "type",
                f"{where}: {name!r} must be a unit such as 's', str, bool, int, a list of one of them, or "
                f"pathlib.Path; got {declared!r:.80}",
            )
    return found


def check_unit(where: str, unit: object, shown_in: object) -> None:
    """Raise `ScenarioError` when a unit is none, or cannot be shown in another."""
    try:
        factor = conversion(str(unit), str(shown_in))
        alone = conversion(str(unit), str(unit))
    except (UnitError, Exception) as wrong:  # pint has kinds of its own for units that do not convert
        raise ScenarioError("type", f"{where}: {unit!r} shown in {shown_in!r}: {format_exception(wrong, '')}") from None
    if not (factor > 0.0 and alone == 1.0):
        raise ScenarioError("type", f"{where}: {unit!r} cannot be shown in {shown_in!r}")


def read_value(value: object, declared: Declared) -> Value:
    """Read a value of a campaign file as its class declares it; files are read by the caller.

    Raises
    ------
    SettingError
        When it is of another type, or a quantity of another dimension or not finite.

    Examples
    --------
    >>> read_value(["1 km", "20 m"], ["m"])
    Vector(values=(1000.0, 20.0))
    >>> read_value(True, int)
    Traceback (most recent call last):
    ...
    mcnav.scenarios.settings.SettingError: got true; expected a whole number
    """
    if not isinstance(declared, list):
        return _one(value, declared, _expected(declared))
    inner = declared[0]
    if not isinstance(value, list):
        raise SettingError(f"got {shown(value)}; expected {_expected(declared)}")
    entries: list[Any] = []
    for number, entry in enumerate(value):
        try:
            entries.append(_one(entry, inner, _expected(inner)))
        except SettingError as wrong:
            raise SettingError(str(wrong), number) from None
    return Vector(tuple(entries)) if isinstance(inner, str) else tuple(entries)


def _one(value: object, declared: Kind, expected: str) -> float | Plain:
    if isinstance(declared, str):
        try:
            return quantity(value, declared)
        except UnitError as wrong:
            raise SettingError(str(wrong)) from None
    if type(value) is not declared:  # true is no whole number, 1.0 neither
        raise SettingError(f"got {shown(value)}; expected {expected}")
    if isinstance(value, int) and abs(value) > LARGEST:
        raise SettingError(f"got a number beyond {LARGEST}; expected {expected}")
    return value  # type: ignore[return-value]


def _expected(declared: Declared) -> str:
    """What would do, in words."""
    if isinstance(declared, list):
        inner = declared[0]
        return f"a list of quantities in units such as {inner!r}" if isinstance(inner, str) else LISTS[inner]
    return "" if isinstance(declared, str) else WORDS[declared]


def shown(value: object) -> str:
    """A value as the file has it, cut to what fits a line."""
    if isinstance(value, (list, dict)):
        return "a list" if isinstance(value, list) else "a table"
    return printable(str(value).lower() if isinstance(value, bool) else repr(value))


def given(value: Value) -> object:
    """A value as ``__init__`` gets it: vectors as arrays, shape (n,), lists as lists, files as paths."""
    if isinstance(value, Vector):
        return np.array(value.values, dtype=float)
    if isinstance(value, InputFile):
        return Path(value.path)
    return list(value) if isinstance(value, tuple) else value
