"""Settings of a user's class: keys of ``[scenario]`` with the types that the class declares.

A unit such as ``"s"`` declares a quantity (a float, SI), ``["m/s^2"]`` several (an array, shape (n,)); ``str``,
``bool`` and ``int`` declare values of these types, ``[str]``, ``[bool]`` and ``[int]`` lists of them; ``pathlib.Path``
declares a file, with a path relative to the campaign file.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from mcnav.contract.scenario import ScenarioError
from mcnav.entries.inputs import InputFile
from mcnav.entries.values import SettingError, display
from mcnav.physics.units import UnitError, conversion, quantity

WORDS: Final[Mapping[type, str]] = {str: "text in quotes", bool: "true or false", int: "a whole number"}
LISTS: Final[Mapping[type, str]] = {
    str: 'a list of texts such as ["a", "b"]',
    bool: "a list such as [true, false]",
    int: "a list of whole numbers such as [1, 2]",
}
LARGEST: Final = 2**63 - 1
"""Largest whole number: TOML has 64 bits."""

NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")

Plain = str | bool | int
Kind = str | type
Declared = Kind | list[Kind]
"""A unit, a type, or a list of one of these."""


@dataclass(frozen=True)
class Vector:
    """Several quantities, SI."""

    values: tuple[float, ...]


Value = float | Plain | Vector | tuple[Plain, ...] | InputFile


def settings_of(kind: type) -> Mapping[str, Declared]:
    """Return the settings that a class declares; `ScenarioError` when the declaration is wrong."""
    settings, where = getattr(kind, "settings", {}), f"{kind.__name__}.settings"
    if not isinstance(settings, Mapping):
        raise ScenarioError("type", f"{where} must give a unit for each name, such as {{'time': 's'}}, or a type")
    for name, declared in settings.items():
        if not isinstance(name, str) or not NAME.fullmatch(name) or name == "type":
            raise ScenarioError("type", f"{where}: {name!r} is not a name of letters, digits and _, or is 'type'")
        inner = declared[0] if isinstance(declared, list) and len(declared) == 1 else declared
        if inner is Path and not isinstance(declared, list):
            continue
        if isinstance(inner, str):
            check_unit(where, inner, inner)
        elif not isinstance(inner, type) or inner not in WORDS:
            expected = "a unit such as 's', str, bool, int, a list of one of them, or pathlib.Path"
            raise ScenarioError("type", f"{where}: {name!r} must be {expected}; got {declared!r:.80}")
    return settings


def check_unit(where: str, unit: object, shown_in: object) -> None:
    """Raise `ScenarioError` when a unit is unknown, or cannot be shown in another."""
    try:
        factor = conversion(str(unit), str(shown_in))
        alone = conversion(str(unit), str(unit))
    except UnitError as wrong:
        raise ScenarioError("type", f"{where}: {unit!r} shown in {shown_in!r}: {wrong}") from None
    if not (factor > 0.0 and alone == 1.0):
        raise ScenarioError("type", f"{where}: {unit!r} cannot be shown in {shown_in!r}")


def read_value(value: object, declared: Declared) -> Value:
    """Read a value of a campaign file as the class declares it; the caller reads files.

    Raises `SettingError` when the type or dimension is wrong, or a quantity is not finite.

    Examples
    --------
    >>> read_value(["1 km", "20 m"], ["m"])
    Vector(values=(1000.0, 20.0))
    >>> read_value(True, int)
    Traceback (most recent call last):
    ...
    mcnav.entries.values.SettingError: got true; expected a whole number
    """
    if not isinstance(declared, list):
        return _read_one(value, declared)
    inner = declared[0]
    if not isinstance(value, list):
        expected = f"a list of quantities in units such as {inner!r}" if isinstance(inner, str) else LISTS[inner]
        raise SettingError(f"got {display(value)}; expected {expected}")
    entries: list[Any] = []
    for number, entry in enumerate(value):
        try:
            entries.append(_read_one(entry, inner))
        except SettingError as wrong:
            raise SettingError(str(wrong), number) from None
    return Vector(tuple(entries)) if isinstance(inner, str) else tuple(entries)


def _read_one(value: object, declared: Kind) -> float | Plain:
    if isinstance(declared, str):
        try:
            return quantity(value, declared)
        except UnitError as wrong:
            raise SettingError(str(wrong)) from None
    if type(value) is not declared:  # neither true nor 1.0 is a whole number
        raise SettingError(f"got {display(value)}; expected {WORDS[declared]}")
    if isinstance(value, int) and abs(value) > LARGEST:
        raise SettingError(f"got a number beyond {LARGEST}; expected {WORDS[declared]}")
    return value  # type: ignore[return-value]


def to_argument(value: Value) -> object:
    """Convert a value to an argument of ``__init__``: vectors to arrays, shape (n,), files to paths."""
    if isinstance(value, Vector):
        return np.array(value.values, dtype=float)
    if isinstance(value, InputFile):
        return Path(value.path)
    return list(value) if isinstance(value, tuple) else value
