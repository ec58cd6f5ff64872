"""Sizes of the errors of aiding sensors.

The same keys give the errors in ``[[aiding]]`` and what a filter believes of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.entries.context import FileContext
from mcnav.entries.quantities import Table
from mcnav.systems.ins.imu.instruments import AXES
from mcnav.systems.ins.sensors.flexure import MOST_TURNS, OF_CRITICAL_DAMPING, Flexure
from mcnav.systems.ins.sensors.quantity import OFFSETS, SensorType
from mcnav.systems.ins.sensors.registry import QUANTITIES
from mcnav.systems.ins.tables.sensor_tables import SENSORS, CorrelatedTable, FlexureTable, SensorTable


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
    flexure : FlexureTable or None
    offsets : mapping of str to ndarray, shape (3,)
        Sigmas of the errors of `OFFSETS`; NaN where none is given.
    delay, jitter : float or None
        Sigmas, s; none where none is given.
    """

    sizes: Mapping[str, ErrorSizes]
    lever_arm: Array
    lever_arm_error: Array
    flexure: FlexureTable | None
    offsets: Mapping[str, Array]
    delay: float | None
    jitter: float | None

    def sigmas_of_sensor(self, name: str) -> dict[str, float]:
        """Return the sigmas that are given of a sensor's constant errors which are not of a quantity, by source."""
        arm = zip(AXES, self.lever_arm_error, strict=True)
        sigmas = {f"{name}_lever_arm_{axis}": float(size) for axis, size in arm if not np.isnan(size)}
        delay = {} if self.delay is None else {f"{name}_delay": self.delay}
        return (
            sigmas
            | delay
            | {
                f"{name}_{offset}_{axis}": float(size)
                for offset, sizes in self.offsets.items()
                for axis, size in zip(OFFSETS[offset][0], sizes, strict=True)
                if not np.isnan(size)
            }
        )

    def flexed(self, known: Flexure | None, duration: float, key: str, context: FileContext) -> Flexure | None:
        """Return the flexure, with the sizes of another one where none are given; mistakes go to the context.

        Parameters
        ----------
        known : Flexure or None
            The true one, of a filter's beliefs.
        duration : float
            Of navigation, s.
        """
        table = self.flexure
        if table is None:
            return known
        sigma = None if known is None else known.sigma
        frequency = None if known is None else known.frequency
        damping = 1.0 if known is None else known.damping
        if table.sigma is not None:
            sizes = np.nan_to_num(table.sigma)
            sigma = float(sizes[0]), float(sizes[1]), float(sizes[2])
        if table.correlation_time is not None:
            frequency, damping = OF_CRITICAL_DAMPING / table.correlation_time, 1.0
        if table.frequency is not None:
            frequency = 2.0 * np.pi * table.frequency
        if table.damping is not None:
            damping = table.damping
        if sigma is None or frequency is None:
            missing = "sigma" if sigma is None else "frequency"
            context.problem(f"{key}.flexure", f"{missing} is missing; {FlexureTable.expected}")
            return known
        flexure = Flexure(sigma, frequency, damping)
        if (turns := flexure.most_turns(duration)) > MOST_TURNS:
            message = f"is damped too near to 1 for {duration:.6g} s at this frequency ({turns:.2g} rad); "
            context.problem(f"{key}.flexure", f"{message}expected a damping of at most 0.999")
        return flexure


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
        sigma, time = (none if stated is None else stated for stated in (process.sigma, process.correlation_time))
        sizes[measured] = ErrorSizes(noise, bias, scale, sigma, time)
    return SensorErrors(
        sizes, given("lever_arm", 3), given("lever_arm_error", 3), getattr(table, "flexure", None),
        {offset: given(f"{offset}_error", 3) for offset in kind.offsets}, getattr(table, "delay", None),
        getattr(table, "jitter", None),
    )  # fmt: skip


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
            for axis in sorted(unmeasured & {key for table in tables if isinstance(table, dict) for key in table}):
                context.problem(f"{at}.{axis}", f"{quantity} {axis} is not measured; leave it out")
