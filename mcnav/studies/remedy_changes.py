"""Changes of a campaign file that may help: what its filter models, its numbers, its sensors, and their outages."""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import tomli_w

from mcnav.analysis.improvements import Improvement
from mcnav.config.data_sheet import data_sheet_numbers, shown
from mcnav.config.overrides import override
from mcnav.config.toml import Content
from mcnav.contract.quantities import Source
from mcnav.errors import CampaignError
from mcnav.physics.units import UnitError, quantity

MOST_KINDS: Final = 4
"""Kinds of errors that are given to a filter one by one, the largest first."""

SHORTER: Final = 0.5
"""Factor of an outage."""

OFFERED: Final = ("altimeter", "position-fix", "velocity", "heading", "star-tracker", "gnss")
"""Types of sensors that a campaign is offered, with the numbers of their templates."""


@dataclass(frozen=True)
class Change:
    """A change: in words, the entries that change as a file has them, the whole content; ``path`` of a number."""

    words: str
    lines: str
    content: Content
    path: str = ""


def written(content: Content) -> str:
    """Write the content of a campaign file."""
    return tomli_w.dumps(content)


def changes_of_filter(content: Mapping[str, Any], kinds: Sequence[str]) -> Iterator[Change]:
    """Yield filters that model more, all kinds first: estimated, then considered one by one."""
    table = content.get("filter", {})
    estimates, considers = list(table.get("estimates", ())), list(table.get("considers", ()))

    def entry(name: str, value: list[str], words: str) -> Change:
        own = copy.deepcopy(dict(content))
        own["filter"] = {**table, name: value}
        return Change(words, f"{name} = {_listed(value)}", own)

    if len(kinds) > 1:
        yield entry("estimates", [*estimates, *kinds], f"estimate all {len(kinds)} unmodelled errors")
    for kind in kinds[:MOST_KINDS]:
        name = kind.replace("_", " ")
        yield entry("estimates", [*estimates, kind], f"estimate {name}")
        yield entry("considers", [*considers, kind], f"consider {name}")
    if "believes" in table:
        own = copy.deepcopy(dict(content))
        own["filter"].pop("believes")
        yield Change("let the filter believe the true sizes", "# without [filter.believes]", own)


def _listed(names: Sequence[str]) -> str:
    return "[{}]".format(", ".join(f'"{name}"' for name in names))


def changes_of_numbers(
    content: Mapping[str, Any], sources: tuple[Source, ...], better: Sequence[Improvement]
) -> Iterator[Change]:
    """Yield numbers one grade finer, or half as large."""
    numbers = {number.path: number for number in data_sheet_numbers(content, sources)}
    for each in better:
        number = numbers.get(each.slider.path)
        if number is None:
            continue
        values = number.multiplied(each.factor)
        try:
            own = override(content, values)
        except CampaignError:
            continue
        size = shown(values[number.path])
        beside = ", ".join([*([f"{each.grade} grade"] if each.grade else []), f"now {shown(number.entry)}"])
        yield Change(f"{number.path} at {size} ({beside})", f"{number.path} = {size}", own, number.path)


def changes_of_sensors(content: Mapping[str, Any]) -> Iterator[Change]:
    """Yield shorter outages, then further sensors; none of a navigation without a filter."""
    if "filter" not in content:
        return
    for place, sensor in enumerate(content.get("aiding", ())):
        outages = [_shortened(outage) for outage in sensor.get("outages", ())]
        if outages and all(outages):
            own = copy.deepcopy(dict(content))
            own["aiding"][place]["outages"] = outages
            name = sensor.get("name", sensor["type"])
            yield Change(f"halve the {'outage' if len(outages) == 1 else 'outages'} of {name}",
                         f"outages = {outages}", own)  # fmt: skip
    yield from _sensors(content)


def _shortened(outage: Any) -> list[str] | None:
    """Return an outage of half the length; none of a form that is not known."""
    try:
        begin, end = (quantity(time, "s") if isinstance(time, str) else float(time) for time in outage)
    except (UnitError, TypeError, ValueError):
        return None
    return [f"{begin:g} s", f"{begin + SHORTER * (end - begin):g} s"]


def _sensors(content: Mapping[str, Any]) -> Iterator[Change]:
    from mcnav.systems.ins.sensors.registry import SENSOR_TYPES  # only aided navigation needs them

    present = {sensor["type"] for sensor in content.get("aiding", ())}
    for name in OFFERED:
        kind = SENSOR_TYPES.get(name)
        if kind is None or kind.interval is None or name in present:
            continue
        table = tomllib.loads(f'type = "{name}"\ninterval = "{kind.interval:g} s"\n{kind.template}')
        own = copy.deepcopy(dict(content))
        own["aiding"] = [*own.get("aiding", ()), table]
        states = [f"{name.replace('-', '_')}_{error}" for error in kind.estimated]
        own["filter"]["estimates"] = [*own["filter"]["estimates"], *states]
        sizes = ", ".join(shown(table[key]) for key in kind.quantities if key in table)
        lines = tomli_w.dumps({"aiding": [table]}).strip()
        yield Change(f"add {_named(name)} ({sizes})", lines, own)


def _named(name: str) -> str:
    """Name a type of sensor with its article.

    >>> _named("altimeter"), _named("velocity")
    ('an altimeter', 'a velocity sensor')
    """
    words = name.replace("-", " ") + (" sensor" if name in ("velocity", "heading") else "")
    return f"{'an' if words[0] in 'aeiou' else 'a'} {words}"
