"""Keys and sizes of the errors of aiding sensors.

The same keys give the errors in ``[[aiding]]`` and what a filter believes of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array
from mcnav.entries.axes import read_axes, within
from mcnav.entries.context import FileContext
from mcnav.errors import suggestion
from mcnav.systems.ins.imu.instruments import AXES
from mcnav.systems.ins.sensors.quantity import QuantityDefinition, SensorType
from mcnav.systems.ins.sensors.registry import QUANTITIES
from mcnav.systems.ins.sensors.sources import LEVER_ARM, SCALE_FACTOR
from mcnav.units import dimension_of, printable

MULTIPLE: Final = 1e9
"""Multiple of an error's usual size, and share of it, beyond which a size is refused: a slip of the pen."""

SHORTEST_CORRELATION: Final = 1e-15
"""Correlation time, s; its reciprocal is the longest one."""

LONGEST_LEVER_ARM: Final = 1e5
"""m."""


def keys_of_errors(kind: SensorType) -> list[str]:
    """Return the keys of a sensor's errors."""
    keys = list(kind.quantities)
    for measured, quantity in kind.quantities.items():
        scaled = ("scale_factor",) if QUANTITIES[quantity].scaled else ()
        keys += [kind.key(measured, error) for error in (*(("bias", "correlated") if kind.errors else ()), *scaled)]
    return keys + (["lever_arm", "lever_arm_error"] if kind.lever_arm else [])


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


def read_sensor_errors(
    entry: Mapping[str, Any], kind: SensorType, key: str, context: FileContext, believed: bool = False
) -> SensorErrors:
    """Read the errors of a sensor; mistakes are added to the context.

    Parameters
    ----------
    believed : bool
        Whether they replace those of the sensor itself, one by one.
    """
    sizes = {measured: _read_sizes(entry, kind, measured, key, context, believed) for measured in kind.quantities}
    arm, error = np.full(3, np.nan), np.full(3, np.nan)
    if kind.lever_arm and "lever_arm" in entry:
        if isinstance(entry["lever_arm"], (list, dict)):
            longest = f"at most {LONGEST_LEVER_ARM:.3g} m makes sense"
            fault = within(-LONGEST_LEVER_ARM, LONGEST_LEVER_ARM, "m", longest)
            arm = read_axes(entry["lever_arm"], "m", AXES, f"{key}.lever_arm", context, np.nan, fault)
        else:
            expected = 'expected lengths forward, right and down such as ["1 m", "0 m", "-0.5 m"]'
            context.problem(f"{key}.lever_arm", f"got {entry['lever_arm']!r}; {expected}")
    if kind.lever_arm and "lever_arm_error" in entry:
        fault = within(0.0, MULTIPLE * LEVER_ARM[2], "m")
        error = read_axes(entry["lever_arm_error"], "m", AXES, f"{key}.lever_arm_error", context, np.nan, fault)
    return SensorErrors(sizes, arm, error)


def _read_sizes(
    entry: Mapping[str, Any], kind: SensorType, measured: str, key: str, context: FileContext, believed: bool
) -> ErrorSizes:
    quantity = QUANTITIES[kind.quantities[measured]]
    axes, unit = quantity.axes, quantity.unit
    least, most = quantity.usual / MULTIPLE, quantity.usual * MULTIPLE
    none = np.full(len(axes), np.nan)

    def read(name: str, unit: str, least: float, most: float, words: str = "a size must not be negative") -> Array:
        if name not in entry:
            return none
        return read_axes(entry[name], unit, axes, f"{key}.{name}", context, np.nan, within(least, most, unit, words))

    noise = read(measured, unit, least, most, "expected a sigma above zero")
    if not kind.errors:
        return ErrorSizes(noise, none, none, none, none)
    bias = read(kind.key(measured, "bias"), unit, 0.0, most)
    scale = none
    if quantity.scaled:
        scale = read(kind.key(measured, "scale_factor"), "1", 0.0, MULTIPLE * SCALE_FACTOR[2])
    name = kind.key(measured, "correlated")
    sigma, time = none, none
    if name in entry:
        sigma, time = _read_correlated(entry[name], quantity, f"{key}.{name}", context, believed)
    return ErrorSizes(noise, bias, scale, sigma, time)


def _read_correlated(
    entry: object, quantity: QuantityDefinition, key: str, context: FileContext, believed: bool
) -> tuple[Array, Array]:
    """Read a first-order Gauss-Markov error: sigma and correlation time."""
    axes, unit, names = quantity.axes, quantity.unit, ("sigma", "correlation_time")
    none = np.full(len(axes), np.nan)
    example = printable(entry, 20) if isinstance(entry, str) else dimension_of(unit).example
    expected = f'expected {{ sigma = "{example}", correlation_time = "100 s" }}'
    if not isinstance(entry, dict):
        context.problem(key, f"got {entry!r}; {expected}")
        return none, none
    for name in entry.keys() - set(names):
        context.problem(f"{key}.{name}", f"unknown key{suggestion(name, list(names))}")
    given = entry.keys() & set(names)
    if len(given) < (1 if believed else 2):
        context.problem(key, f"got {', '.join(sorted(entry)) or 'nothing'}; {expected}")
        return none, none
    above_zero = "expected a time above zero"
    limits = {
        "sigma": (unit, within(0.0, quantity.usual * MULTIPLE, unit)),
        "correlation_time": ("s", within(SHORTEST_CORRELATION, 1.0 / SHORTEST_CORRELATION, "s", above_zero)),
    }
    correlated = dict.fromkeys(names, none)
    for name in given:
        of, fault = limits[name]
        correlated[name] = read_axes(entry[name], of, axes, f"{key}.{name}", context, np.nan, fault)
    return correlated["sigma"], correlated["correlation_time"]


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
