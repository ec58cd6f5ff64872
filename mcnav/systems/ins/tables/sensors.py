"""Sizes of the errors of aiding sensors.

The same keys give the errors in ``[[aiding]]`` and what a filter believes of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array
from mcnav.entries.context import FileContext
from mcnav.entries.quantities import Table
from mcnav.systems.ins.sensors.quantity import SensorType
from mcnav.systems.ins.sensors.registry import QUANTITIES
from mcnav.systems.ins.tables.sensor_tables import SENSORS, CorrelatedTable, SensorTable


def keys_of_errors(kind: SensorType) -> list[str]:
    """Return the keys of a sensor's errors."""
    others = {*SensorTable.model_fields, *kind.further}
    return [key for key in SENSORS[kind.name].model_fields if key not in others]


@dataclass(frozen=True)
class ErrorSizes:
    """Sizes of the errors of a quantity's measurements by axis; NaN where none is given."""

    noise: Array
    bias: Array
    scale_factor: Array
    correlated: Array
    correlation_time: Array


@dataclass(frozen=True)
class SensorErrors:
    """Sizes of a sensor's errors.

    Attributes
    ----------
    sizes : mapping of str to ErrorSizes
        By the key of the quantity's noise.
    lever_arm, lever_arm_error : ndarray, shape (3,)
        NaN where none is given.
    """

    sizes: Mapping[str, ErrorSizes]
    lever_arm: Array
    lever_arm_error: Array


def errors_of(table: Table, kind: SensorType) -> SensorErrors:
    """Return the sizes of a sensor's errors from its table, or from what a filter believes of it."""

    def given(key: str, count: int) -> Array:
        sizes = getattr(table, key, None)
        return np.full(count, np.nan) if sizes is None else np.asarray(sizes)

    sizes = {}
    for measured, name in kind.quantities.items():
        count = len(QUANTITIES[name].axes)
        noise, bias, scale = (
            given(key, count) for key in (measured, kind.key(measured, "bias"), kind.key(measured, "scale_factor"))
        )
        process = getattr(table, kind.key(measured, "correlated"), None) or CorrelatedTable()
        none = np.full(count, np.nan)
        sigma, time = (none if each is None else each for each in (process.sigma, process.correlation_time))
        sizes[measured] = ErrorSizes(noise, bias, scale, sigma, time)
    return SensorErrors(sizes, given("lever_arm", 3), given("lever_arm_error", 3))


def check_measured(
    entry: Mapping[str, Any],
    kind: SensorType,
    measured: Mapping[str, NDArray[np.bool_]],
    key: str,
    context: FileContext,
) -> None:
    """Add a mistake for each error of a quantity, or of an axis, that is not measured.

    Parameters
    ----------
    measured : mapping of str to ndarray of bool, shape (axes,)
        Measured components by the key of the quantity's noise.
    """
    for quantity, axes in measured.items():
        for error in ("", "bias", "scale_factor", "correlated"):
            name = kind.key(quantity, error) if error else quantity
            if name not in entry:
                continue
            at = f"{key}.{name}"
            if not axes.any():
                context.problem(at, f"{quantity} is not measured; leave it out")
                continue
            names = QUANTITIES[kind.quantities[quantity]].axes
            value = entry[name]
            tables = list(value.values()) if error == "correlated" and isinstance(value, dict) else [value]
            unmeasured = {axis for axis, known in zip(names, axes, strict=True) if not known}
            for axis in sorted(unmeasured & {each for table in tables if isinstance(table, dict) for each in table}):
                context.problem(f"{at}.{axis}", f"{quantity} {axis} is not measured; leave it out")
