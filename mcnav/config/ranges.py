"""Ranges in a campaign file: a box of campaigns about a nominal one, in which every range is at its upper end.

A range ``"0.5..2 deg/h"`` may stand wherever errors, sensors, faults, processes or the scenario's settings have a size.
All of the program but the studies of boxes (`mcnav.studies.box`) sees the nominal campaign, which has plain values.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from mcnav.config.toml import Content
from mcnav.errors import CampaignError, Problem
from mcnav.physics.ranges import Range, is_range, read_range
from mcnav.physics.units import UnitError

RANGED: Final = ("scenario", "imu", "gravity", "aiding", "faults", "processes", "measurements", "errors")
"""Tables in which ranges may stand: what is true. A filter believes one value, and a requirement has one limit."""

Place = tuple[str | int, ...]
"""Keys of tables and numbers of list entries, from zero on, that lead to a value."""

Setting = Mapping[str, str | int | float]
"""Values of ranges by path, as a campaign file has them."""


@dataclass(frozen=True)
class SpecRange:
    """A range of a campaign file.

    Attributes
    ----------
    place : tuple of (str or int)
        Of its value in the file's content.
    path : str
        As `mcnav.config.overrides` reads it, such as ``aiding.gnss.outages.1.2``.
    span : Range
    text : str
        As written.
    """

    place: Place
    path: str
    span: Range
    text: str

    @property
    def upper(self) -> str | int | float:
        """The upper end as a campaign file has it: the nominal value."""
        return self.span.written(self.span.high)

    @property
    def lower(self) -> str | int | float:
        """The lower end as a campaign file has it."""
        return self.span.written(self.span.low)

    @property
    def keys(self) -> tuple[str, str]:
        """Names of its place in the messages of mistakes: by the names of sensors, and by their numbers."""
        numbered = "".join(f".{name}" if isinstance(name, str) else f" #{name + 1}" for name in self.place)
        return self.path, numbered.removeprefix(".")


def quote_ranges(problem: Problem, ranges: Iterable[SpecRange]) -> Problem:
    """Return a mistake at an end of a range with the range as written, where the end is quoted.

    >>> _, ranges = split_ranges({"errors": {"velocity": "1..5 kg"}}, "")
    >>> quote_ranges(Problem("", "errors.velocity", "got '5.0 kg', which is of dimension [mass]"), ranges).message
    "got '1..5 kg', which is of dimension [mass]"
    """
    for spec in ranges:
        if problem.key in spec.keys:
            message = problem.message.replace(repr(spec.upper), repr(spec.text))
            if repr(spec.lower) in message:  # without the value in SI units that nobody wrote
                message = message.replace(repr(spec.lower), repr(spec.text)).partition("; got ")[0]
            problem = replace(problem, message=message)
    return problem


def split_ranges(content: Mapping[str, Any], file: str) -> tuple[Content, tuple[SpecRange, ...]]:
    """Return the content of the nominal campaign, and the ranges of a file.

    Raises `CampaignError` when a range is empty, or its ends are of different dimensions.

    Examples
    --------
    >>> nominal, (bias,) = split_ranges({"imu": {"gyro": {"bias": "0.5..2 deg/h"}}}, "flight.toml")
    >>> nominal, bias.path, str(bias.span)
    ({'imu': {'gyro': {'bias': '2.0 deg/h'}}}, 'imu.gyro.bias', '0.5 to 2 deg/h')
    """
    problems, ranges = list[Problem](), list[SpecRange]()
    for place, text in _ranges_in({name: content[name] for name in RANGED if name in content}, ()):
        path = _path_of(content, place)
        try:
            ranges.append(SpecRange(place, path, read_range(text), text))
        except UnitError as wrong:
            problems.append(Problem(file, path, str(wrong)))
    if problems:
        raise CampaignError(problems)
    nominal = with_values(content, {spec.place: spec.upper for spec in ranges})
    return nominal, tuple(ranges)


def still_there(content: Mapping[str, Any], ranges: Iterable[SpecRange]) -> tuple[SpecRange, ...]:
    """Return the ranges whose upper end stands at their place in the content of a nominal campaign."""
    return tuple(spec for spec in ranges if _value_at(content, spec.place) == spec.upper)


def _value_at(entry: Any, place: Place) -> object:
    for name in place:
        try:
            entry = entry[name]
        except (KeyError, IndexError, TypeError):
            return None
    return entry


def with_values(content: Mapping[str, Any], values: Mapping[Place, object]) -> Content:
    """Return content with the values at some places replaced; what holds none of them is the same object."""
    result: Content = dict(content)
    for place, value in values.items():
        result = _with(result, place, value)
    return result


def _with(entry: Any, place: Place, value: object) -> Any:
    if not place:
        return value
    copied: Any = dict(entry) if isinstance(entry, Mapping) else list(entry)
    copied[place[0]] = _with(entry[place[0]], place[1:], value)
    return copied


def _ranges_in(entry: Any, place: Place) -> Iterator[tuple[Place, str]]:
    """Find the texts below an entry that are written as ranges."""
    if is_range(entry):
        yield place, entry
    parts = entry.items() if isinstance(entry, Mapping) else enumerate(entry) if isinstance(entry, list) else ()
    for name, item in parts:
        yield from _ranges_in(item, (*place, name))


def _path_of(content: Mapping[str, Any], place: Place) -> str:
    """Return the path of a place: sensors by their names, other entries of lists by their numbers from one on."""
    names = list[str]()
    entry: Any = content
    for name in place:
        entry = entry[name]
        if isinstance(name, str):
            names.append(name)
        elif names == ["aiding"] and isinstance(entry, Mapping):
            names.append(str(entry.get("name", str(entry.get("type", "")).replace("-", "_"))))
        else:
            names.append(str(name + 1))
    return ".".join(names)
