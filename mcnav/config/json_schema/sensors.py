"""Schema of ``[[aiding]]``, of ``[filter.believes.aiding]``, and of the names of the sensors' errors."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from mcnav.config.json_schema.axes import by_axes
from mcnav.config.json_schema.nodes import Node, by_type, choice, quantity, table
from mcnav.systems.ins.imu.instruments import AXES
from mcnav.systems.ins.sensors.quantity import FurtherKey, SensorType
from mcnav.systems.ins.sensors.registry import QUANTITIES, SENSOR_TYPES
from mcnav.systems.ins.sensors.sources import LEVER_ARM, SCALE_FACTOR
from mcnav.systems.ins.tables.aiding import MOST_SENSORS, NAME
from mcnav.systems.ins.tables.filter import GATE
from mcnav.systems.ins.tables.instants import MOST_OUTAGES


def aiding_schema() -> Node:
    """Return the schema of ``[[aiding]]``."""
    tables = {name: _sensor(kind) for name, kind in SENSOR_TYPES.items()}
    conditions = {name: choice([name]) for name in tables}
    return {
        "type": "array",
        "maxItems": MOST_SENSORS,
        "description": "Sensors that aid the navigation; needs [filter].",
        "items": by_type("type", conditions, tables, "A sensor, its instants, and the sizes of its errors."),
    }


def believed_sensors() -> Node:
    """Return the schema of ``[filter.believes.aiding]``; the types of the sensors are known to [[aiding]] alone."""
    every: dict[str, Node] = {}
    for kind in SENSOR_TYPES.values():
        for key, node in _errors(kind, believed=True).items():
            same = every.setdefault(key, node) == node
            if not same:
                every[key] = {"description": every[key]["description"]}
    every.pop("lever_arm")
    return {
        "type": "object",
        "description": "Believed errors of the sensors, by their names.",
        "patternProperties": {
            f"^{NAME.pattern}$": table(every, description="Errors that the filter takes others for.")
        },
        "additionalProperties": False,
    }


def _sensor(kind: SensorType) -> Node:
    times = "in the trajectory's time."
    outage: Node = {"type": "array", "items": quantity("s", example="1200 s"), "minItems": 2, "maxItems": 2}
    properties: dict[str, Node] = {
        "type": choice([kind.name], kind.words),
        "name": {
            "type": "string", "pattern": f"^{NAME.pattern}$", "description": "Name of its own; its type unless given."
        },
        "interval": quantity(
            "s", "Time between measurements; without begin, the first is one interval after the start.", example="1 s"
        ),
        "begin": quantity("s", f"First measurement at an interval, {times}", example="600 s"),
        "end": quantity("s", f"Last instant of measurements at an interval, {times}", example="1200 s"),
        "instants": {
            "type": "array",
            "items": quantity("s", example="600 s"),
            "minItems": 1,
            "description": f"Instants of measurements in place of an interval, {times}",
        },
        "outages": {
            "type": "array",
            "items": outage,
            "maxItems": MOST_OUTAGES,
            "description": "Pairs of begin, included, and end, not included, without measurements.",
        },
        "gate": quantity("1", GATE, {"gt": 0.0, "lt": 1.0}, 0.999),
        **_errors(kind),
        **{name: _further(key) for name, key in kind.further.items()},
    }  # fmt: skip
    node = table(properties, ["type"])
    node["oneOf"] = [{"required": ["interval"]}, {"required": ["instants"]}]
    node["dependencies"] = {"begin": ["interval"], "end": ["interval"]}
    node["anyOf"] = [{"required": [quantity_measured]} for quantity_measured in kind.quantities]
    return node


def _further(key: FurtherKey) -> Node:
    return choice(list(key.choices), key.meaning) if key.choices else quantity(key.unit, key.meaning)


def _errors(kind: SensorType, believed: bool = False) -> dict[str, Node]:
    """Return the schemas of the sizes of a sensor's errors."""
    nodes: dict[str, Node] = {}
    for measured, measures in kind.quantities.items():
        unit, names = QUANTITIES[measures].unit, QUANTITIES[measures].axes
        nodes[measured] = by_axes(unit, names, f"Sigma of the white noise of one measurement of the {measured}.")
        if kind.errors:
            bias, correlated = kind.key(measured, "bias"), kind.key(measured, "correlated")
            nodes[bias] = by_axes(unit, names, f"Sigma of the constant bias of the {measured}.")
            values = {
                "sigma": by_axes(unit, names, "Sigma of the process."),
                "correlation_time": by_axes("s", names, "Correlation time of the process.", "100 s"),
            }
            process = table(values, () if believed else values, f"First-order Gauss-Markov error of the {measured}.")
            nodes[correlated] = {**process, **({"minProperties": 1} if believed else {})}
        if QUANTITIES[measures].scaled:
            scale = kind.key(measured, "scale_factor")
            nodes[scale] = by_axes(SCALE_FACTOR[0], names, f"Sigma of the scale factor of the {measured}.")
    if kind.lever_arm:
        arm = "From the unit to the antenna, forward, right and down."
        nodes["lever_arm"] = by_axes(LEVER_ARM[0], AXES, arm, whole=False)
        nodes["lever_arm_error"] = by_axes(LEVER_ARM[0], AXES, "Sigma of the lever arm's error.", "1 cm")
    return nodes


def error_patterns() -> dict[str, str]:
    """Return patterns of the names of sensors' constant errors and of their kinds, by SI unit; empty for any unit."""
    units: dict[str, set[str]] = {}
    for suffix, unit in _suffixes():
        units.setdefault(suffix, set()).add(unit)
    patterns: dict[str, list[str]] = {}
    for suffix, several in units.items():
        patterns.setdefault(next(iter(several)) if len(several) == 1 else "", []).append(suffix)
    return {unit: _pattern(suffixes) for unit, suffixes in patterns.items()}


def error_pattern(kinds: bool = False) -> str:
    """Return the pattern of the names of all sensors' constant errors, or of their kinds alone."""
    return _pattern([suffix for suffix, _ in _suffixes(not kinds)])


def _pattern(suffixes: Iterable[str]) -> str:
    return f"^{NAME.pattern}_({'|'.join(dict.fromkeys(suffixes))})$"


def _suffixes(axes: bool = True) -> Iterator[tuple[str, str]]:
    """Yield what follows a sensor's name in those of its constant errors, with their SI units."""
    for kind in SENSOR_TYPES.values():
        for measured, measures in kind.quantities.items():
            of = QUANTITIES[measures]
            names = [f"_{axis}" for axis in of.axes if axis and axes]
            label = kind.label("", measured).removeprefix("_")
            errors = [("bias", of.unit), *([("scale_factor", SCALE_FACTOR[0])] if of.scaled else [])]
            for error, unit in errors:
                yield from ((f"{label}_{error}{axis}".removeprefix("_"), unit) for axis in ("", *names))
        if kind.lever_arm:
            yield from ((f"lever_arm{axis}", LEVER_ARM[0]) for axis in ("", *(f"_{each}" for each in AXES if axes)))
