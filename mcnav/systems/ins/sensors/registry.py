"""Quantities and types of sensors: everything that the program knows of them, from the files of this folder."""

from __future__ import annotations

from importlib import import_module
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
)
"""Files that define a quantity, a type of sensor, or both. A new one comes last: the order numbers the quantities."""


def _read(file: str) -> tuple[QuantityDefinition | None, SensorType | None]:
    module = import_module(f"mcnav.systems.ins.sensors.{file}")
    quantity, sensor = getattr(module, "QUANTITY", None), getattr(module, "SENSOR", None)
    for name, of in ((quantity, QuantityDefinition), (sensor, SensorType)):
        if name is not None and not isinstance(name, of):
            raise TypeError(f"{module.__name__}: expected a {of.__name__}, got {name!r}")
    if quantity is None and sensor is None:
        raise TypeError(f"{module.__name__} defines no QUANTITY and no SENSOR; expected one of them, or both")
    return quantity, sensor


_ALL: Final = tuple(_read(file) for file in FILES)

QUANTITIES: Final = {quantity.name: quantity for quantity, _ in _ALL if quantity is not None}
"""Quantities by name; their order numbers the kinds of measurements in kernels, and the streams of variates."""

SENSOR_TYPES: Final = {sensor.name: sensor for _, sensor in _ALL if sensor is not None}
"""Types of sensors by the ``type`` of ``[[aiding]]``."""

KINDS: Final = {name: number for number, name in enumerate(QUANTITIES)}
"""Numbers by quantity."""


def check_sensor_types() -> None:
    """Raise ValueError when a type of sensor measures a quantity that no file defines."""
    for sensor in SENSOR_TYPES.values():
        if unknown := [name for name in sensor.quantities.values() if name not in QUANTITIES]:
            known = ", ".join(QUANTITIES)
            raise ValueError(f"sensor {sensor.name!r} measures {unknown[0]}, which no file defines; known are {known}")


check_sensor_types()
