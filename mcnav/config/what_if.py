"""Numbers of a campaign that a page lets its reader change, and the campaign file with them changed.

The filter of an aided navigation believes the true sizes unless the file has others, so that a changed number would
tune it anew. The campaign written here states under ``[filter.believes]`` what the filter took each changed number for.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import tomli_w

from mcnav.analysis.changeable_campaign import MARK, Belief, ChangeableCampaign, Size, Slider
from mcnav.analysis.filter_causes import kind_of
from mcnav.analysis.what_if import FIXED
from mcnav.arrays.types import Array
from mcnav.config.data_sheet import (
    OF_LOOPS,
    SCALED,
    DataSheetNumber,
    data_sheet_numbers,
    grades,
    is_by_axis,
    largest_size,
    owners_of,
)
from mcnav.config.overrides import ALL_AXES, SIZES, Value
from mcnav.config.ranges import SpecRange
from mcnav.config.toml import Content
from mcnav.contract.quantities import TRUE, Source
from mcnav.physics.units import UnitError, parted
from mcnav.systems.ins.imu.instruments import NEGLECTED
from mcnav.systems.ins.tables.filter import KINDS, OF_SENSORS
from mcnav.systems.ins.tables.imu_catalogue import catalogue
from mcnav.systems.registry import FURTHER_NAMES, is_code

OTHERS: Final = frozenset(SCALED) - frozenset(SIZES)
"""Keys of a distribution that are multiplied with its size, and are none."""


def changeable_campaign(
    content: Mapping[str, Any], sources: Sequence[Source], processes: Sequence[str], mean: Array, covariance: Array,
    believed: Mapping[str, float],
) -> ChangeableCampaign:  # fmt: skip
    """Find the numbers of a campaign file that size its errors.

    Parameters
    ----------
    content : mapping
        Of the file.
    sources, processes
        Of its scenario; processes by name.
    mean, covariance : ndarray, shapes (sources,) and (sources, sources)
        Of the sources.
    believed : mapping of str to float
        What the filter believes of the causes, as in `mcnav.contract.filter_record.FilterPrediction`; empty without it.
    """
    sized = (np.diag(covariance) > 0.0) | (mean != 0.0)
    known = [number for number in data_sheet_numbers(content, tuple(sources)) if _proportional(number.entry)]
    owners = owners_of([source.name for source in sources], known)
    owners = [owner if moves else None for owner, moves in zip(owners, sized, strict=True)]
    of_processes = dict(zip(processes, owners_of(processes, known), strict=True))
    owning = {id(owner) for owner in (*owners, *of_processes.values())}
    used = [number for number in known if id(number) in owning]
    places = {id(number): place for place, number in enumerate(used)}
    sigmas = _believed_sigmas(content, sources, mean, covariance)
    groups = {source.name: source.group for source in sources}
    tuned = is_tuned(content, sources, believed)
    return ChangeableCampaign(
        tuple(map(_slider, used)),
        np.array([FIXED if owner is None else places[id(owner)] for owner in owners]),
        {name: FIXED if owner is None else places[id(owner)] for name, owner in of_processes.items()},
        _text(content, used),
        tuple(_beliefs(content, used, sigmas, groups)) if tuned else (),
    )


def is_tuned(content: Mapping[str, Any], sources: Sequence[Source], believed: Mapping[str, float]) -> bool:
    """Return whether a filter takes what it believes from the campaign: not one that a class computes by itself."""
    kind = _type_of(content)
    if not is_code(kind):
        return "filter" in content
    loop = any(name in content for name in FURTHER_NAMES) or any(source.name.startswith(TRUE) for source in sources)
    return bool(believed) and loop


def _type_of(content: Mapping[str, Any]) -> str:
    return str(content.get("scenario", {}).get("type", ""))


def bands_of(campaign: ChangeableCampaign, ranges: Sequence[SpecRange]) -> dict[str, tuple[float, float]]:
    """Return the factors that lead to the ends of each number that is a range, by path; not of one axis of several."""
    bands = dict[str, tuple[float, float]]()
    for slider in campaign.sliders:
        size, places = slider.sizes[slider.shown].value, {slider.path, *(f"{slider.path}.{name}" for name in SIZES)}
        spans = [spec.span for spec in ranges if spec.path in places]
        if spans and slider.axes == 1 and size:
            bands[slider.path] = (spans[0].low / size, spans[0].high / size)
    return bands


def unsized_causes(campaign: ChangeableCampaign, sources: Sequence[Source], covariance: Array) -> list[str]:
    """List the causes that no number sizes, by name."""
    apart = (np.diag(covariance) > 0.0) & (campaign.source_numbers == FIXED)
    names = [source.name for source, is_apart in zip(sources, apart, strict=True) if is_apart]
    return [*names, *(name for name, number in campaign.process_numbers.items() if number == FIXED)]


def estimable_kinds(content: Mapping[str, Any], sources: Sequence[Source]) -> tuple[str, ...]:
    """List the kinds of errors that the filter of an aided navigation does not model, and could."""
    table = content.get("filter")
    if is_code(_type_of(content)) or not isinstance(table, Mapping):
        return ()
    modelled = {*table.get("estimates", ()), *table.get("considers", ())}
    sensors = {_name_of(sensor) for sensor in content.get("aiding", ())}

    def estimable(kind: str) -> bool:
        of_sensor = OF_SENSORS.fullmatch(kind)
        return kind in KINDS or (of_sensor is not None and of_sensor[1] in sensors)

    kinds = dict.fromkeys(kind_of(source.name) for source in sources)
    return tuple(kind for kind in kinds if kind not in modelled and estimable(kind))


def _proportional(entry: Value) -> bool:
    """Return whether the errors of an entry are proportional to its sizes: not with a location and no scale."""
    return not (isinstance(entry, dict) and "loc" in entry and "scale" not in entry)


def _slider(number: DataSheetNumber) -> Slider:
    placed = list(_sizes_in(number.entry))
    axes = [k for k, (place, _) in enumerate(placed) if not OTHERS & set(place)] or list(range(len(placed)))
    shown = max(axes, key=lambda k: abs(placed[k][1].value))
    return Slider(number.path, tuple(size for _, size in placed), shown, len(axes), tuple(_grades(number)))


def _grades(number: DataSheetNumber) -> Iterator[tuple[str, float]]:
    """Find the factors that lead to the values of the catalogue's grades."""
    root, _, rest = number.path.partition(".")
    instrument, _, key = rest.partition(".")
    present = largest_size(number.entry, instrument, key) if root == "imu" else None
    for unit in grades() if present else []:
        entry = unit.table[instrument].get(key)
        size = None if entry is None else largest_size(entry, instrument, key)
        if size and present:
            yield unit.name, size / present


def _sizes_in(entry: Value) -> Iterator[tuple[tuple[str | int, ...], Size]]:
    """Find the sizes of an entry, each with its place, as `DataSheetNumber.multiplied` changes them."""
    if isinstance(entry, bool):
        return
    if isinstance(entry, (int, float)):
        yield (), Size(float(entry), None)
    elif isinstance(entry, str):
        try:
            yield (), Size(*parted(entry))
        except UnitError:
            return
    elif isinstance(entry, list):
        for place, item in enumerate(entry):
            yield from (((place, *below), size) for below, size in _sizes_in(item))
    else:
        names = [name for name in entry if is_by_axis(entry) or name in SCALED]
        for name in names:
            yield from (((name, *below), size) for below, size in _sizes_in(entry[name]))


def _text(content: Mapping[str, Any], numbers: Sequence[DataSheetNumber]) -> str:
    """Write the file with a mark in the place of each size, and without what the filter believes."""
    marked: Content = _copied(content)
    for n, number in enumerate(numbers):
        entry = _copied(number.entry)
        for k, (place, _) in enumerate(_sizes_in(number.entry)):
            entry = _with(entry, place, f"{MARK}{n}.{k}{MARK}")
        _put(marked, number.path.split("."), entry)
    if isinstance(marked.get("filter"), dict):
        marked["filter"].pop("believes", None)
    return tomli_w.dumps(marked)


def _copied(entry: Any) -> Any:
    if isinstance(entry, Mapping):
        return {name: _copied(item) for name, item in entry.items()}
    return [_copied(item) for item in entry] if isinstance(entry, list) else entry


def _with(entry: Any, place: tuple[str | int, ...], mark: str) -> Any:
    if not place:
        return mark
    entry[place[0]] = _with(entry[place[0]], place[1:], mark)
    return entry


def _put(content: Content, names: Sequence[str], entry: Any) -> None:
    """Set a key of a table, of a sensor by its name."""
    if names[0] == "aiding":
        inside = next(sensor for sensor in content["aiding"] if _name_of(sensor) == names[1])
        inside[names[2]] = entry
        return
    for name in names[:-1]:
        content = content.setdefault(name, {})
    content[names[-1]] = entry


def _name_of(sensor: Mapping[str, Any]) -> str:
    return str(sensor.get("name", str(sensor["type"]).replace("-", "_")))


def _believed_sigmas(
    content: Mapping[str, Any], sources: Sequence[Source], mean: Array, covariance: Array
) -> dict[str, tuple[float, str]]:
    """Return the sigmas that a filter takes sources for, with their units, by name; a loop's are about zero."""
    sizes = np.sqrt(np.diag(covariance) + (mean**2 if is_code(_type_of(content)) else 0.0))
    return {source.name: (float(size), source.unit) for source, size in zip(sources, sizes, strict=True)}


def held_beliefs(
    content: Mapping[str, Any], numbers: Sequence[DataSheetNumber], sources: Sequence[Source], mean: Array,
    covariance: Array,
) -> Content:  # fmt: skip
    """Return the content with what the filter takes some numbers for stated below ``[filter.believes]``.

    Parameters
    ----------
    mean, covariance : ndarray, shapes (sources,) and (sources, sources)
        Of the sources.
    """
    sigmas = _believed_sigmas(content, sources, mean, covariance)
    result = _copied(content)
    for belief in _beliefs(content, numbers, sigmas, {source.name: source.group for source in sources}):
        table = result
        for name in belief.table:
            table = table.setdefault(name, {})
        table[belief.key] = tomllib.loads(f"entry = {belief.value}")["entry"]
    return dict(result)


def _beliefs(
    content: Mapping[str, Any], numbers: Sequence[DataSheetNumber], sigmas: Mapping[str, tuple[float, str]],
    groups: Mapping[str, str],
) -> list[Belief]:  # fmt: skip
    """List what the filter believes, and what it is to believe where a number changes."""
    believes = content.get("filter", {}).get("believes", {})
    lines: dict[tuple[tuple[str, ...], str], Belief] = {}

    def state(table: tuple[str, ...], key: str, entry: Any, number: int | None) -> None:
        lines.setdefault((table, key), Belief(("filter", "believes", *table), key, _inline(entry), number))

    for root, entries in believes.items():
        for name, entry in entries.items():
            if root in ("imu", "aiding") and isinstance(entry, dict):
                for key, value in entry.items():
                    state((root, name), key, value, None)
            else:
                state((root,), name, entry, None)
    stated = _Stated(believes)
    for n, number in enumerate(numbers):
        root, *rest = number.path.split(".")
        if root == "aiding" or (root == "imu" and rest[1] not in NEGLECTED and not stated.in_grade(*rest)):
            table, key = (root, rest[0]), rest[1]
            present = believes.get(root, {}).get(rest[0], {}).get(key)
            entry = stated.completed(present, number)
            if entry is not None and present is not None:
                lines[table, key] = Belief(("filter", "believes", *table), key, _inline(entry), None)
            elif entry is not None:
                state(table, key, entry, n)
        elif root in (*OF_LOOPS, "gravity") and rest[0] not in believes.get(root, {}):
            state((root,), rest[0], number.entry, n)
        elif root == "errors":
            for name in sorted(number.causes):
                sigma, unit = sigmas[name]
                if sigma > 0.0 and not stated.source(name, groups[name]):
                    state(("errors",), name, f"{sigma!r} {unit}", n)
    return sorted(lines.values(), key=lambda belief: belief.table)


@dataclass(frozen=True)
class _Stated:
    """Entries that the campaign has under ``[filter.believes]``."""

    believes: Mapping[str, Any]

    def source(self, name: str, group: str) -> bool:
        """Return whether it states the sigma of a source, in one table or another."""
        if {name, group} & self.believes.get("errors", {}).keys():
            return True
        stems = {name, name.rpartition("_")[0]}
        tables = {f"{one}_{key}" for root in ("imu", "aiding") for one, entries in self.believes.get(root, {}).items()
                  if isinstance(entries, dict) for key in entries}  # fmt: skip
        return bool(stems & tables)

    def in_grade(self, instrument: str, key: str) -> bool:
        """Return whether it states a grade that has a value of an instrument."""
        grade = self.believes.get("imu", {}).get("grade")
        return key in catalogue().get(grade, {}).get(instrument, {})

    def completed(self, present: Any, number: DataSheetNumber) -> Value | None:
        """Return what is to be stated so that the filter believes the present sizes; none where nothing is."""
        apart = {
            name.rpartition("_")[2]: None for name in self.believes.get("errors", {}) if number.covers(name)
        }  # axes of which [filter.believes.errors] has a sigma
        if set(number.causes) & self.believes.get("errors", {}).keys():
            return None
        if present is None and not apart:
            return number.entry
        if present is not None and not (isinstance(present, dict) and is_by_axis(present)):
            return None
        named = [*(present or {}), *apart]
        axes = next(axes for axes in ALL_AXES if set(named) <= set(axes))
        ours = _by_axes(number.entry, axes)
        return {axis: present[axis] if present and axis in present else ours[axis]
                for axis in axes if axis in ours and axis not in apart} or None  # fmt: skip


def _by_axes(entry: Value, axes: Sequence[str]) -> dict[str, Value]:
    """Return an entry by axis."""
    if isinstance(entry, list):
        return dict(zip(axes, entry, strict=True))
    return dict(entry) if isinstance(entry, dict) and is_by_axis(entry) else dict.fromkeys(axes, entry)


def _inline(entry: Any) -> str:
    """Write a value in one line of TOML."""
    if isinstance(entry, Mapping):
        return "{ " + ", ".join(f"{name} = {_inline(item)}" for name, item in entry.items()) + " }"
    if isinstance(entry, list):
        return f"[{', '.join(map(_inline, entry))}]"
    return tomli_w.dumps({"entry": entry}).partition(" = ")[2].strip()
