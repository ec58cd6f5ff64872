"""Sizes of errors as a campaign's file and the catalogue give them: the numbers of a data sheet, and their multiples.

A number is a key with its entry: one quantity, quantities by axis, a distribution, or a process with its sigma.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, cast

from mcnav.config.overrides import ALL_AXES, SIZES, Value
from mcnav.contract.quantities import Source
from mcnav.physics.units import UnitError, multiplied, quantity
from mcnav.systems.ins.tables.imu_catalogue import (
    ALLAN_MINIMUM,
    INSTABILITY,
    NAMES,
    CatalogueUnit,
    catalogue,
    catalogue_units,
    units_of_values,
)

if TYPE_CHECKING:
    from mcnav.systems.ins.sensors.quantity import SensorType

SCALED: Final = (*SIZES, "limit", "loc", "mean")
"""Keys of a distribution that are multiplied with its size."""

OF_LOOPS: Final = ("processes", "measurements")
"""Tables of a closed loop that give sizes by the names that are causes, too."""

GRADE: Final = "Grade:"
"""Beginning of the titles of the catalogue's grades."""

DIGITS: Final = 3
"""Significant digits of a number that is proposed."""


@dataclass(frozen=True)
class DataSheetNumber:
    """A key that gives the size of errors.

    Attributes
    ----------
    path : str
        Such as ``imu.gyro.bias``, ``errors.position``, ``aiding.gnss.position``, ``measurements.ranging``.
    entry : Value
        As the file or the catalogue has it.
    causes : frozenset of str
        Names of the sources and processes that it sizes; those of the unit and of sensors without the axis or the beam.
    kept : mapping of str to Value
        Entries that a change of this one must leave as they are, by path.
    """

    path: str
    entry: Value
    causes: frozenset[str]
    kept: Mapping[str, Value]

    def covers(self, cause: str) -> bool:
        """Return whether it sizes a source or process."""
        kind, _, axis = cause.rpartition("_")
        named = axis.isdecimal() or any(axis in axes for axes in ALL_AXES)
        of_axis = named and self.path.startswith(("imu.", "aiding."))
        return cause in self.causes or (of_axis and kind in self.causes)

    def multiplied(self, factor: float) -> dict[str, Value]:
        """Return the values to be set for a multiple of it, by path."""
        return {self.path: _multiplied(self.entry, factor), **self.kept}

    @property
    def text(self) -> str:
        """The size in words."""
        return shown(self.entry)

    def rounded(self, factor: float, up: bool = False) -> float:
        """Round a factor so that the number, or with several sizes the factor itself, has three digits."""
        rounding, size = round_up if up else round_down, _single(self.entry)
        if size is None:
            return rounding(factor)
        return rounding(size * factor) / size


def round_down(value: float) -> float:
    """Round a positive number down to three significant digits.

    >>> round_down(0.123987), round_down(99.99), round_down(0.0025)
    (0.123, 99.9, 0.0025)
    """
    if value <= 0.0 or not math.isfinite(value):
        return value
    exponent = DIGITS - 1 - math.floor(math.log10(value))
    return math.floor(value * 10.0**exponent * (1.0 + 1e-12)) / 10.0**exponent


def round_up(value: float) -> float:
    """Round a positive number up to three significant digits.

    >>> round_up(0.123187), round_up(99.91), round_up(0.0025)
    (0.124, 100.0, 0.0025)
    """
    if value <= 0.0 or not math.isfinite(value):
        return value
    exponent = DIGITS - 1 - math.floor(math.log10(value))
    return math.ceil(value * 10.0**exponent * (1.0 - 1e-12)) / 10.0**exponent


def _single(entry: Value) -> float | None:
    """Return the number of a quantity, or of a table's only size; none where there are several."""
    if isinstance(entry, bool):
        return None
    if isinstance(entry, (int, float)):
        return float(entry) or None
    if isinstance(entry, str):
        try:
            return float(multiplied(entry, 1.0).split()[0]) or None
        except UnitError:
            return None
    sizes = [name for name in SIZES if isinstance(entry, dict) and name in entry]
    return _single(entry[sizes[0]]) if isinstance(entry, dict) and len(sizes) == 1 else None


def _multiplied(entry: Value, factor: float) -> Value:
    if isinstance(entry, bool):
        return entry
    if isinstance(entry, (int, float)):
        return float(f"{entry * factor:.9g}")
    if isinstance(entry, str):
        return multiplied(entry, factor)
    if isinstance(entry, list):
        return [_multiplied(item, factor) for item in entry]
    if is_by_axis(entry):
        return {axis: _multiplied(item, factor) for axis, item in entry.items()}
    return {name: _multiplied(item, factor) if name in SCALED else item for name, item in entry.items()}


def is_by_axis(entry: Mapping[str, Any]) -> bool:
    """Return whether a table has sizes by axis."""
    return any(set(entry) <= set(axes) for axes in ALL_AXES)


def shown(entry: Value) -> str:
    """Write the size of an entry, with all keys that are multiplied where a table has more than its size.

    >>> shown({"sigma": "0.003 deg/h", "correlation_time": "1 h"}), shown({"x": "1 m", "y": "2 m"})
    ('0.003 deg/h', 'x 1 m, y 2 m')
    >>> shown({"mean": "3 m", "sigma": "1 m"})
    'sigma 1 m, mean 3 m'
    """
    if isinstance(entry, list):
        return ", ".join(shown(item) for item in entry)
    if not isinstance(entry, dict):
        return str(entry)
    if is_by_axis(entry):
        return ", ".join(f"{axis} {shown(item)}" for axis, item in entry.items())
    scaled = [name for name in SCALED if name in entry]
    if len(scaled) > 1:
        return ", ".join(f"{name} {shown(entry[name])}" for name in scaled)
    return shown(entry[scaled[0]]) if scaled else str(entry)


def data_sheet_numbers(content: Mapping[str, Any], sources: tuple[Source, ...]) -> list[DataSheetNumber]:
    """List the numbers of a campaign file that are not zero; columns of files have no size to change.

    Parameters
    ----------
    content : mapping
        Of the file.
    sources : tuple of Source
        Of its scenario.
    """
    gravity = content.get("gravity", {}).items()
    numbers = [*_of_imu(content.get("imu", {})), *_of_errors(content.get("errors", {}), sources)]
    numbers += [DataSheetNumber(f"gravity.{key}", entry, frozenset([f"gravity_{key}"]), {}) for key, entry in gravity]
    if "aiding" in content:
        numbers += _of_aiding(content["aiding"])
    for table in OF_LOOPS:
        entries = content.get(table, {}).items()
        numbers += [DataSheetNumber(f"{table}.{name}", entry, frozenset([name]), {}) for name, entry in entries]
    return [number for number in numbers if _multiplied(number.entry, 0.0) != _multiplied(number.entry, 1.0)]


def _of_aiding(sensors: Sequence[Mapping[str, Any]]) -> list[DataSheetNumber]:
    from mcnav.systems.ins.sensors.registry import SENSOR_TYPES  # only aided navigation needs all types of sensors
    from mcnav.systems.ins.tables.sensors import keys_of_errors

    numbers = []
    for sensor in sensors:
        name, kind = sensor.get("name", sensor["type"].replace("-", "_")), SENSOR_TYPES[sensor["type"]]
        keys = [key for key in keys_of_errors(kind) if key in sensor and key != "lever_arm"]
        numbers += [
            DataSheetNumber(f"aiding.{name}.{key}", sensor[key], frozenset([f"{name}_{_error(kind, key)}"]), {})
            for key in keys
        ]
    return numbers


def _error(kind: SensorType, key: str) -> str:
    """Return the kind of a sensor's errors that a key of its table sizes.

    >>> from mcnav.systems.ins.sensors.registry import SENSOR_TYPES
    >>> _error(SENSOR_TYPES["gnss"], "position"), _error(SENSOR_TYPES["altimeter"], "altitude")
    ('position_noise', 'noise')
    >>> _error(SENSOR_TYPES["gnss"], "lever_arm_error")
    'lever_arm'
    """
    return kind.key(key, "noise") if key in kind.quantities else key.removesuffix("_error")


def owners_of(causes: Sequence[str], numbers: Sequence[DataSheetNumber]) -> list[DataSheetNumber | None]:
    """Return the number that sizes each cause: of two, the one of ``[errors]``, which names some axes of another table.

    Numbers are looked up by kind of error: time is linear in the causes, where each has a number of its own.
    """
    places = dict[str, list[int]]()
    for place, number in enumerate(numbers):
        for kind in number.causes:
            places.setdefault(kind, []).append(place)
    owners = list[DataSheetNumber | None]()
    for cause in causes:
        alike = {*places.get(cause, ()), *places.get(cause.rpartition("_")[0], ())}
        covering = [numbers[place] for place in sorted(alike) if numbers[place].covers(cause)]
        stated = [number for number in covering if number.path.startswith("errors.")]
        owners.append(next(iter(stated or covering), None))
    return owners


def believed_numbers(content: Mapping[str, Any]) -> list[DataSheetNumber]:
    """List the sizes that a filter believes in place of the true ones: they are settings, and change no error."""
    believes = content.get("filter", {}).get("believes", {})
    tables = {f"imu.{name}": believes.get("imu", {}).get(name, {}) for name in NAMES}
    tables |= {name: believes.get(name, {}) for name in ("gravity", "errors", *OF_LOOPS)}
    tables |= {f"aiding.{name}": entries for name, entries in believes.get("aiding", {}).items()}
    numbers = [
        DataSheetNumber(f"filter.believes.{table}.{key}", entry, frozenset(), {})
        for table, entries in tables.items()
        for key, entry in entries.items()
        if key != "lever_arm"
    ]
    return [number for number in numbers if _multiplied(number.entry, 0.0) != _multiplied(number.entry, 1.0)]


def _of_imu(entries: Mapping[str, Any]) -> list[DataSheetNumber]:
    below = catalogue().get(entries.get("grade", ""), {})
    numbers = []
    for instrument in NAMES:
        for key, entry in {**below.get(instrument, {}), **entries.get(instrument, {})}.items():
            returns = key == "rate_random_walk" and isinstance(entry, dict) and "correlation_time" in entry
            causes = frozenset([f"{instrument}_{INSTABILITY if returns else key}"])
            numbers.append(DataSheetNumber(f"imu.{instrument}.{key}", entry, causes, {}))
    return numbers


def _of_errors(entries: Mapping[str, Any], sources: tuple[Source, ...]) -> list[DataSheetNumber]:
    numbers = []
    for key, entry in entries.items():
        members = [source.name for source in sources if key in (source.name, source.group)]
        own = [name for name in members if name in entries and name != key]
        causes = frozenset(name for name in members if name not in own)
        kept = {f"errors.{name}": entries[name] for name in own}
        numbers.append(DataSheetNumber(f"errors.{key}", entry, causes, kept))
    return numbers


@dataclass(frozen=True)
class GradedValue:
    """A value of a grade of the catalogue, for a number."""

    grade: str
    entry: Value


def grades() -> list[CatalogueUnit]:
    """Return the grades of the catalogue, the finest first."""
    return [unit for unit in catalogue_units() if unit.title.startswith(GRADE)]


def next_grade(number: DataSheetNumber, finer: bool) -> GradedValue | None:
    """Return the next finer value of a number of the unit among the catalogue's grades, or the next coarser one.

    None where no grade states one.
    """
    root, _, rest = number.path.partition(".")
    instrument, _, key = rest.partition(".")
    present = largest_size(number.entry, instrument, key) if root == "imu" else None
    if present is None:
        return None
    for unit in reversed(grades()) if finer else grades():
        entry: Value | None = unit.table[instrument].get(key)
        size = None if entry is None else largest_size(entry, instrument, key)
        if entry is None or size is None:
            continue
        if size < present * (1.0 - 1e-9) if finer else size > present * (1.0 + 1e-9):
            return GradedValue(unit.name, _moved(number.entry, entry, finer, instrument, key))
    return None


def _moved(present: Any, graded: Value, finer: bool, instrument: str, key: str) -> Value:
    """Return an entry moved to the value of a grade; axes that are as fine already, or as coarse, keep their own."""
    if isinstance(present, list):
        moved = [_moved(item, graded, finer, instrument, key) for item in present]
        return graded if all(item == graded for item in moved) else moved
    if isinstance(present, dict) and is_by_axis(present):
        return {axis: _moved(item, graded, finer, instrument, key) for axis, item in present.items()}
    own, new = (largest_size(entry, instrument, key) for entry in (present, graded))
    if own is None or new is None or (new < own if finer else new > own):
        return graded
    return cast("Value", present)


def largest_size(entry: Any, instrument: str, key: str) -> float | None:
    """Return the largest size of an entry over its axes, SI; none where it has no single kind of size."""
    if isinstance(entry, dict) and not is_by_axis(entry):
        sizes = [name for name in SIZES if name in entry]
        largest = largest_size(entry[sizes[0]], instrument, f"{key}.{sizes[0]}") if len(sizes) == 1 else None
        allan = key == INSTABILITY and sizes == ["allan_minimum"]
        return largest / ALLAN_MINIMUM if allan and largest is not None else largest
    parts = entry if isinstance(entry, list) else list(entry.values()) if isinstance(entry, dict) else [entry]
    units = units_of_values()[instrument]
    unit = units.get(key) or units.get(f"{key}.sigma")
    if unit is None:
        return None
    try:
        return max(abs(quantity(component, unit, key == "misalignment")) for component in parts)
    except UnitError:
        return None
