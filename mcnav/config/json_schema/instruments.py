"""Schema of ``[imu]``, and of ``[filter.believes.imu]``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from mcnav.config.json_schema.axes import by_axes
from mcnav.config.json_schema.nodes import Node, choice, table
from mcnav.systems.ins.imu.instruments import AXES, CROSS_AXES
from mcnav.systems.ins.tables.imu_catalogue import INSTABILITY, KINDS, catalogue_units
from mcnav.systems.ins.tables.quantization import QUANTIZATION

MEANINGS: Final[Mapping[str, str]] = {
    "bias": "Sigma of the constant bias.",
    "scale_factor": "Sigma of the scale factor.",
    "misalignment": "Sigma of the share of an input along another axis.",
    "g_sensitivity": "Sigma of the rate per specific force along the axis.",
    "nonlinearity": "Sigma of the error per square of the specific force along the axis.",
    "angle_random_walk": "White noise of the rates, N: the angle has the sigma N sqrt(t).",
    "velocity_random_walk": "White noise of the specific force, N: the velocity has the sigma N sqrt(t).",
    "rate_random_walk": "Random walk of the bias, K: its sigma is K sqrt(t).",
    INSTABILITY: "Gauss-Markov process of the bias.",
    QUANTIZATION: "White error of each reading of the accumulated angle or velocity.",
    f"{INSTABILITY}.sigma": "Sigma of the process.",
    f"{INSTABILITY}.allan_minimum": "Bias instability of a data sheet, in place of sigma: 0.617 of it.",
    f"{INSTABILITY}.correlation_time": "Correlation time of the process.",
    f"{QUANTIZATION}.sigma": "Sigma of the error of a reading.",
    f"{QUANTIZATION}.step": "Smallest increment, in place of sigma: sqrt(12) times it.",
    f"{QUANTIZATION}.interval": "Interval between readings.",
}  # fmt: skip
"""Meaning of each value of a data sheet, by its key."""

EXAMPLES: Final = {"correlation_time": "1 h", "interval": "0.01 s"}
"""Examples that the dimension alone does not give, by the last part of the key."""


def imu_schema(description: str, believed: bool = False) -> Node:
    """Return the schema of ``[imu]``.

    Parameters
    ----------
    believed : bool
        Whether it is the filter's, which replaces values one by one and has no quantization.
    """
    grades = choice([unit.name for unit in catalogue_units()], "Grade or unit of the catalogue; mcnav imu lists it.")
    instruments = {
        instrument: _instrument(units, believed, f"Errors of the {instrument}s, in place of the grade's.")
        for instrument, units in KINDS.items()
    }
    return table({"grade": grades, **instruments}, description=description)


def _instrument(units: Mapping[str, str], believed: bool, description: str) -> Node:
    simple = {key: unit for key, unit in units.items() if "." not in key}
    properties = {
        key: by_axes(unit, CROSS_AXES if key == "misalignment" else AXES, MEANINGS[key]) for key, unit in simple.items()
    }
    properties[INSTABILITY] = _process(INSTABILITY, units, () if believed else ("correlation_time",), believed)
    if not believed:
        properties[QUANTIZATION] = _quantization(units)
    return table(properties, description=description)


def _process(key: str, units: Mapping[str, str], required: tuple[str, ...] = (), believed: bool = False) -> Node:
    """Return the schema of a process: one of two sizes, and a time."""
    parts = [name.partition(".")[2] for name in units if name.startswith(f"{key}.")]
    values = {
        part: by_axes(units[f"{key}.{part}"], AXES, MEANINGS[f"{key}.{part}"], EXAMPLES.get(part)) for part in parts
    }
    node = table(values, required, MEANINGS[key])
    sizes = [part for part in parts if part not in EXAMPLES]
    one_size: Node = {"oneOf": [{"required": [part]} for part in sizes]}
    return {**node, **({"minProperties": 1, "not": {"required": sizes}} if believed else one_size)}


def _quantization(units: Mapping[str, str]) -> Node:
    """Return the schema of the quantization: a size by axis, or a table with a size and an interval."""
    size = by_axes(units[f"{QUANTIZATION}.sigma"], AXES, MEANINGS[QUANTIZATION])
    reading = _process(QUANTIZATION, units)
    parts = list(reading["properties"])
    told = f"{size['description']} Or a table with {parts[0]} or {parts[1]}, and {parts[2]}."
    return {
        **size,
        "description": told,
        "properties": {**reading["properties"], **size["properties"]},
        "if": {"type": "object", "anyOf": [{"required": [part]} for part in parts]},
        "then": {"oneOf": reading["oneOf"], "not": {"anyOf": [{"required": [axis]} for axis in AXES]}},
    }
