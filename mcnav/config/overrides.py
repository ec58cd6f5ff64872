"""Keys of a campaign set to other values before it is read, by their paths such as ``imu.gyro.bias``.

A path has the names of tables and of a key. Besides, it may have

- the name of a sensor, ``aiding.gnss.position``, or the number of an entry from one on, ``accept.r95.1.below``, also of
  a list in a list: ``aiding.gnss.outages.1.2`` is the end of the first outage. ``length`` of an outage moves its end,
  ``begin`` moves both;
- an axis, ``imu.gyro.bias.x``: the others keep their values.

A quantity for a key that holds a table sets what gives the table its size: ``sigma``, ``half_width``, ``value`` … of a
distribution, ``sigma`` of a process. For a list or a table of axes it sets each axis that is there. Values of the
catalogue that ``grade`` names count as values of the file.

``absent`` takes a sensor away, ``aiding.gnss``, with its faults, the filter's states of its errors and what the filter
believes of it, or a state of the filter, ``filter.estimates.gyro_bias``; ``present`` leaves it, or puts a state there.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from mcnav.config.campaign import Campaign
from mcnav.config.distributions import SCIPY
from mcnav.config.documents import UNNAMED, Description, Document, document_of
from mcnav.config.read import parse_campaign
from mcnav.config.table_of_values import TABLE
from mcnav.config.toml import Content
from mcnav.errors import CampaignError, Problem, suggestion
from mcnav.physics.units import UnitError, quantity
from mcnav.systems.ins.imu.instruments import AXES, CROSS_AXES, NEGLECTED
from mcnav.systems.ins.sensors.quantity import LEVEL_AXES
from mcnav.systems.ins.tables.imu_catalogue import NAMES, catalogue

Value = str | int | float | bool | list[Any] | Content
"""A value as a campaign file has it: a quantity is text with its unit."""

SIZES: Final = ("sigma", "allan_minimum", "density", "step", "half_width", "value", "scale")
"""Keys that give a table its size, of which it has one."""

ALL_AXES: Final = (AXES, CROSS_AXES, LEVEL_AXES)

PRESENT: Final = "present"
PRESENCE: Final = (PRESENT, "absent")
"""Values of a sensor or a state."""

PROCESSES: Final = (
    "bias_instability", "quantization", "correlated", "position_correlated", "velocity_correlated",
    "attitude_correlated", "flexure", "deflection",
    "anomaly",
)  # fmt: skip
"""Keys whose tables have a ``sigma``."""


class _Mistake(Exception):
    """A path that leads nowhere."""


def override(document: Mapping[str, Any], values: Mapping[str, Value], file: str = UNNAMED) -> Content:
    """Return the content of a campaign file with some keys set to other values; the rest is the same.

    Unknown keys and wrong units are found when the result is read.

    Parameters
    ----------
    values : mapping of str to Value
        By path.
    file : str
        Name of the campaign file, for messages.

    Raises
    ------
    CampaignError
        When a path does not lead to a key, or the key holds a table without a size.

    Examples
    --------
    >>> override({"errors": {"altitude": {"sigma": "5 km"}}}, {"errors.altitude": "1 km"})
    {'errors': {'altitude': {'sigma': '1 km'}}}
    """
    result = copy.deepcopy(dict(document))
    for path, value in values.items():
        names = path.split(".")
        try:
            if not all(name.strip() == name != "" for name in names):
                raise _Mistake("expected the names of tables and a key with dots between, such as imu.gyro.bias")
            _set(result, names, value, ())
        except _Mistake as wrong:
            raise CampaignError([Problem(file, path, str(wrong))]) from None
    return result


class VariedCampaign:
    """A campaign that is read with many values of some keys; its file is read once.

    Raises `CampaignError` when it cannot be read as it is.

    Parameters
    ----------
    campaign : str, Path, Campaign or mapping
        Relative paths in it start from its own folder, those in a mapping from the current one. The file of a
        `Campaign` is read again.

    Attributes
    ----------
    campaign : Campaign
        As it is.
    """

    def __init__(self, campaign: Description) -> None:
        self._document = document_of(campaign)
        self.campaign = self.at({})

    def at(self, values: Mapping[str, Value]) -> Campaign:
        """Read it with some keys set to other values, by path; `CampaignError` as `vary`."""
        return parse_document(self._document, values)


def parse_document(document: Document, values: Mapping[str, Value]) -> Campaign:
    """Read a document with some keys set to other values, by path; see `vary`. Ranges stand for their upper ends."""
    content = override(document.content, values, document.file)
    campaign = parse_campaign(content, document.file, document.stem, code=document.code)
    return campaign if values else replace(campaign, ranges=document.ranges)


def _set(table: Content, names: list[str], value: Value, above: tuple[str, ...]) -> None:
    """Set a key in a table that itself is at ``above``."""
    name, rest, here = names[0], names[1:], (*above, names[0])
    if value in PRESENCE and _set_presence(table, names, value == PRESENT, above):
        return
    if above[-1:] == ("imu",) and name in NAMES:
        table[name] = _with_grade(table, name, above)
    if not rest:
        for key in _keys_of(table, name, above):
            table[key] = _resized(table.get(key), value, key)
        return
    inside = table.get(name)
    if inside is None and here == ("aiding",):
        raise _Mistake("the campaign has no [[aiding]]")
    if inside is None:
        inside = table[name] = {}
    if isinstance(inside, dict):
        _set(inside, rest, value, here)
    elif isinstance(inside, list) and (rest[0].isdecimal() or any(isinstance(entry, dict) for entry in inside)):
        _set_entry(inside, rest, value, here)
    elif len(rest) == 1:
        table[name] = _with_part(inside, rest[0], value)
    else:
        raise _Mistake(f"{'.'.join(here)} is not a table")


def _set_presence(table: Content, names: list[str], present: bool, above: tuple[str, ...]) -> bool:
    """Take a sensor or a state of the filter away, or put a state there; return whether the path leads to one."""
    inside = table.get(names[0])
    if (*above, *names[:-1]) == ("aiding",) and isinstance(inside, list):
        place = _place(inside, names[1], ("aiding",))
        if not present:
            taken = _sensor_name(inside.pop(place))
            if not inside:
                del table["aiding"]
            faults = [fault for fault in table.get("faults", []) if fault.get("sensor") != taken]
            table.pop("faults", None)
            table.update({"faults": faults} if faults else {})
            _forget_sensor(table.get("filter", {}), taken, [_sensor_name(entry) for entry in inside])
        return True
    if above == ("filter",) and len(names) == 2 and isinstance(inside, list):
        kept = [entry for entry in inside if entry != names[1]]
        table[names[0]] = inside if present and names[1] in inside else [*kept, names[1]] if present else kept
        return True
    return False


def _forget_sensor(settings: Content, taken: str, others: list[str]) -> None:
    """Take from ``[filter]`` what it believes of a sensor, and the states of its errors: ``NAME_…``, not of others."""
    settings.get("believes", {}).get("aiding", {}).pop(taken, None)
    for key in ("estimates", "considers"):
        if isinstance(settings.get(key), list):
            owners = {
                state: max((name for name in (taken, *others) if state.startswith(f"{name}_")), key=len, default="")
                for state in map(str, settings[key])
            }
            settings[key] = [state for state in settings[key] if owners[str(state)] != taken]


def _sensor_name(entry: Mapping[str, Any]) -> str:
    """Return the name of a sensor by its entry."""
    return str(entry.get("name", str(entry.get("type", "")).replace("-", "_")))


def _set_outage(outage: list[Any], name: str, value: Value) -> bool:
    """Set the length of an outage, which moves its end, or its begin, which moves both; return whether it is one."""
    if name not in ("length", "begin") or len(outage) != 2:
        return False
    try:
        begin, end, given = (quantity(time, "s") for time in (*outage, value))
    except UnitError as wrong:
        raise _Mistake(str(wrong)) from None
    moved = (begin, begin + given) if name == "length" else (given, given + end - begin)
    outage[:] = [f"{time!r} s" for time in moved]
    return True


def _set_entry(entries: list[Any], names: list[str], value: Value, above: tuple[str, ...]) -> None:
    """Set an entry of a list, or a key or an entry in it."""
    if above[-2:-1] == ("outages",) and len(names) == 1 and _set_outage(entries, names[0], value):
        return
    place, rest, here = _place(entries, names[0], above), names[1:], (*above, names[0])
    inside = entries[place]
    if isinstance(inside, dict) and rest:
        _set(inside, rest, value, here)
    elif isinstance(inside, dict):
        raise _Mistake("expected a key of this entry as well")
    elif isinstance(inside, list) and rest:
        _set_entry(inside, rest, value, here)
    elif isinstance(inside, list):
        raise _Mistake(f"has several entries; expected the number of one, such as {'.'.join(here)}.1")
    elif rest:
        raise _Mistake(f"{'.'.join(here)} is not a table")
    else:
        entries[place] = value


def _with_grade(imu: Mapping[str, Any], name: str, above: tuple[str, ...]) -> Any:
    """Return ``[imu.gyro]`` or ``[imu.accelerometer]`` with the values of the catalogue spelled out below its own."""
    grade, own = imu.get("grade"), imu.get(name, {})
    known = catalogue()
    if not isinstance(own, dict) or not isinstance(grade, str) or grade not in known:
        return own
    below = copy.deepcopy(known[grade].get(name, {}))
    if "filter" in above:
        below = {key: entry for key, entry in below.items() if key not in NEGLECTED}
    return {**below, **own}


def _keys_of(table: Mapping[str, Any], name: str, above: tuple[str, ...]) -> list[str]:
    """Return the keys that a name stands for: of errors, it may be a group whose sources have entries of their own."""
    if above[-1:] != ("errors",):
        return [name]
    single = [f"{name}_{axis}" for axes in ALL_AXES for axis in axes if f"{name}_{axis}" in table]
    return [*([name] if name in table or not single else []), *single]


def _place(entries: list[Any], name: str, above: tuple[str, ...]) -> int:
    """Return the place of an entry in a list: by its number from one on, or by the name of a sensor."""
    if name.isdecimal() and 1 <= int(name) <= len(entries):
        return int(name) - 1
    if above[-1:] == ("aiding",):
        named = [_sensor_name(entry) for entry in entries]
        if name in named:
            return named.index(name)
        raise _Mistake(f"no sensor of [[aiding]] is named {name!r}{suggestion(name, named)}")
    raise _Mistake(f"got {name!r}; expected the number of an entry, from 1 to {len(entries)}")


def _resized(present: object, value: Value, key: str) -> Value:
    """Return what a key holds after its size is set."""
    if isinstance(value, (dict, list)):
        return value
    if isinstance(present, dict):
        if any(set(present) <= set(axes) for axes in ALL_AXES if present):
            return dict.fromkeys(present, value)
        size = _size_key(present)
        return {**present, size: _resized(present.get(size), value, size)}
    if isinstance(present, list):
        if any(isinstance(entry, (dict, list)) for entry in present):
            raise _Mistake(f"has several entries; expected the number of one, such as {key}.1")
        return [value] * len(present)
    return {"sigma": value} if present is None and key in PROCESSES else value


def _size_key(table: Mapping[str, Any]) -> str:
    """Return the key that gives a table its size."""
    kind = str(table.get("distribution", ""))
    sized = [name for name in SIZES if name in table]
    if kind == TABLE:
        raise _Mistake("takes its values from a file; it has no size to set")
    if kind.startswith(SCIPY) and sized != ["scale"]:
        raise _Mistake(f"is {kind!r} without a scale to set; name one of its keys")
    if len(sized) != 1:
        raise _Mistake(f"is a table; name one of its keys: {', '.join(table)}")
    return sized[0]


def _with_part(present: object, name: str, value: Value) -> Value:
    """Return what a key without a table holds after one of its axes is set, or a key of the table it stands for."""
    axes = next((axes for axes in ALL_AXES if name in axes), None)
    if axes is None:
        return {"sigma": present, name: value}  # a quantity alone is a sigma
    if not isinstance(present, list):
        return {axis: value if axis == name else present for axis in axes}
    if len(present) != len(axes):
        raise _Mistake(f"the list has {len(present)} entries; expected {len(axes)}, for {', '.join(axes)}")
    return [value if axis == name else component for axis, component in zip(axes, present, strict=True)]
