"""Quantities and types of sensors: everything that the program knows of them, from the files of this folder."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from importlib import import_module
from types import ModuleType
from typing import Final

from mcnav.systems.ins.sensors.quantity import QuantityDefinition, SensorType

FILES: Final = (
    "gnss",
    "position",
    "velocity",
    "altitude",
    "attitude",
    "body_velocity",
    "heading",
    "magnetometer",
    "master",
    "beam_velocity",
    "beam_range",
    "landmark_direction",
    "landmark_range",
)
"""Files that define a quantity, a type of sensor, or both. A new one comes last: the order numbers the quantities."""


DEFINED: Final[Mapping[str, type]] = {"QUANTITY": QuantityDefinition, "SENSOR": SensorType}
"""Definitions of a file, by their names."""


def read_definitions(module: ModuleType) -> tuple[QuantityDefinition | None, SensorType | None]:
    """Return the quantity and the type of sensor that a module of this folder defines.

    Raises `TypeError` when it defines neither, or one under another name.
    """
    for name, value in vars(module).items():
        wanted = next((wanted for wanted, of in DEFINED.items() if isinstance(value, of)), name)
        if name in DEFINED and not isinstance(value, DEFINED[name]):
            raise TypeError(f"{module.__name__}: {name} must be a {DEFINED[name].__name__}; got {value!r:.80}")
        if name != wanted:
            raise TypeError(f"{module.__name__}: got a {type(value).__name__} named {name}; its name must be {wanted}")
    quantity, sensor = getattr(module, "QUANTITY", None), getattr(module, "SENSOR", None)
    if quantity is None and sensor is None:
        raise TypeError(f"{module.__name__} defines no QUANTITY and no SENSOR; expected one of them, or both")
    return quantity, sensor


_ALL: Final = tuple(read_definitions(import_module(f"mcnav.systems.ins.sensors.{file}")) for file in FILES)

QUANTITIES: Final = {quantity.name: quantity for quantity, _ in _ALL if quantity is not None}
"""Quantities by name; their order numbers the kinds of measurements in kernels, and the streams of variates."""

SENSOR_TYPES: Final = {sensor.name: sensor for _, sensor in _ALL if sensor is not None}
"""Types of sensors by the ``type`` of ``[[aiding]]``."""

KINDS: Final = {name: number for number, name in enumerate(QUANTITIES)}
"""Numbers by quantity."""


def check_sensor_types(kinds: Iterable[SensorType]) -> None:
    """Raise ValueError when a type of sensor measures what no file defines, or estimates an error that it has not."""
    for sensor in kinds:
        if unknown := [name for name in sensor.quantities.values() if name not in QUANTITIES]:
            known = ", ".join(QUANTITIES)
            raise ValueError(f"sensor {sensor.name!r} measures {unknown[0]}, which no file defines; known are {known}")
        errors = [sensor.key(measured, "bias") for measured in sensor.quantities if sensor.errors]
        errors += [
            sensor.key(key, "scale_factor") for key, name in sensor.quantities.items() if QUANTITIES[name].scaled
        ]
        errors += ["lever_arm"] if sensor.lever_arm else []
        errors += ["flexure"] if sensor.flexure else []
        errors += sensor.offsets
        if unknown := [name for name in sensor.estimated if name not in errors]:
            known = ", ".join(errors) or "none"
            raise ValueError(f"sensor {sensor.name!r}: estimated has {unknown[0]!r}; its errors are {known}")


def check_names(names: Iterable[str]) -> None:
    """Raise ValueError when two files define a quantity, or a type of sensor, of one name."""
    if twice := [name for name, count in Counter(names).items() if count > 1]:
        raise ValueError(f"{twice[0]!r} is defined twice in mcnav/systems/ins/sensors; give one another name")


check_names(quantity.name for quantity, _ in _ALL if quantity is not None)
check_names(sensor.name for _, sensor in _ALL if sensor is not None)
check_sensor_types(SENSOR_TYPES.values())
