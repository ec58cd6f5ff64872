"""The table ``[imu]``: sizes of the instruments' constant errors and processes, from a catalogue or a data sheet.

A value holds for each axis. A list gives the axes one by one (three, or for misalignments six, in the order of
`mcnav.systems.ins.imu.instruments.CROSS_AXES`), and a table such as ``{ x = "1 deg/h" }`` some of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Annotated, Any, Final

import numpy as np
from pydantic import Field

from mcnav.arrays.types import Array
from mcnav.entries.context import FileContext
from mcnav.entries.quantities import OneOf, Table
from mcnav.entries.validation import validate
from mcnav.systems.description import FurtherTable
from mcnav.systems.ins.imu.instruments import AXES, CROSS_AXES, Imu, Noise
from mcnav.systems.ins.tables.imu_catalogue import ALLAN_MINIMUM, catalogue, catalogue_units
from mcnav.systems.ins.tables.instrument_tables import (
    AccelerometerTable,
    BelievedAccelerometerTable,
    BelievedGyroTable,
    GyroErrors,
    GyroTable,
    InstabilityTable,
    QuantizationTable,
    WalkTable,
)

STEP: Final = np.sqrt(12.0)
"""Step in which an angle or a velocity is counted, over the sigma of the error that is even within a step."""

CONSTANTS: Final = ("bias", "scale_factor", "misalignment", "g_sensitivity", "nonlinearity")
"""Keys of the constant errors; of a gyro one is missing, of an accelerometer another."""

Grade = Annotated[
    str,
    OneOf(tuple(unit.name for unit in catalogue_units()), "; mcnav docs imu lists them"),
]
OfGrade = Field(description="Grade or unit of the catalogue; mcnav docs imu lists it.")
OfGyros = Field(description="Errors of the gyros, in place of the grade's.")
OfAccelerometers = Field(description="Errors of the accelerometers, in place of the grade's.")


class ImuTable(Table):
    """``[imu]``."""

    grade: Annotated[Grade | None, OfGrade] = None
    gyro: Annotated[GyroTable, OfGyros] = GyroTable()
    accelerometer: Annotated[AccelerometerTable, OfAccelerometers] = AccelerometerTable()


class BelievedImuTable(Table):
    """``[filter.believes.imu]``: it replaces values of the instruments one by one, and has no quantization."""

    grade: Annotated[Grade | None, OfGrade] = None
    gyro: Annotated[BelievedGyroTable, OfGyros] = BelievedGyroTable()
    accelerometer: Annotated[BelievedAccelerometerTable, OfAccelerometers] = BelievedAccelerometerTable()


IMU: Final = FurtherTable(
    ImuTable,
    "Inertial measurement unit of type ins, or of a closed loop's Strapdown: a grade, or a data sheet.",
    "this scenario has no inertial measurement unit",
)
"""The table of the campaign file."""

Instrument = GyroTable | AccelerometerTable | BelievedGyroTable | BelievedAccelerometerTable


@dataclass(frozen=True)
class ImuSizes:
    """Sizes of an inertial measurement unit's errors.

    Attributes
    ----------
    sigmas : mapping of str to float
        Of the constant errors, by source, SI.
    processes : Imu
    """

    sigmas: Mapping[str, float]
    processes: Imu


def read_imu(entries: object, context: FileContext, place: str = "imu", replaced: Imu | None = None) -> ImuSizes | None:
    """Read ``[imu]``, or a table like it at another place; mistakes are added to the context.

    Parameters
    ----------
    replaced : Imu, optional
        Processes whose values the table replaces, one by one. The sigmas read are then of the axes that it names.
    """
    model: type[ImuTable] | type[BelievedImuTable] = ImuTable if replaced is None else BelievedImuTable
    table = validate(model, entries, context, place)
    if table is None:
        return None
    gyro, accelerometer = _above_grade("gyro", table), _above_grade("accelerometer", table)
    before = len(context.problems)
    for name, each in (("gyro", gyro), ("accelerometer", accelerometer)):
        _check_one_process(each, f"{place}.{name}.rate_random_walk", context)
    if len(context.problems) > before:
        return None
    if replaced is None:
        return _sizes(gyro, accelerometer)
    for name, each, below in (("gyro", gyro, replaced.gyro), ("accelerometer", accelerometer, replaced.accelerometer)):
        _check_instability(each, below, f"{place}.{name}.bias_instability", context)
    if len(context.problems) > before:
        return None
    sigmas = _sigmas("gyro", gyro, np.nan) | _sigmas("accelerometer", accelerometer, np.nan)
    stated = {source: size for source, size in sigmas.items() if not np.isnan(size)}
    return ImuSizes(stated, Imu(_noise(gyro, replaced.gyro), _noise(accelerometer, replaced.accelerometer)))


def grade_sizes(grade: str) -> ImuSizes:
    """Return the sizes of a grade or unit of the catalogue."""
    table = ImuTable(grade=grade)
    return _sizes(_above_grade("gyro", table), _above_grade("accelerometer", table))


def _sizes(gyro: Instrument, accelerometer: Instrument) -> ImuSizes:
    sigmas = _sigmas("gyro", gyro, 0.0) | _sigmas("accelerometer", accelerometer, 0.0)
    return ImuSizes(sigmas, Imu(_noise(gyro), _noise(accelerometer)))


def _above_grade(instrument: str, table: ImuTable | BelievedImuTable) -> Instrument:
    """Return the values of an instrument above those of the catalogue's grade."""
    own: Instrument = getattr(table, instrument)
    if table.grade is None:
        return own
    known = {key: entry for key, entry in catalogue()[table.grade][instrument].items() if key not in own.refused}
    below = type(own).model_validate(known)
    return below.model_copy(update={key: getattr(own, key) for key in own.model_fields_set})


def _sigmas(instrument: str, table: Instrument, missing: float) -> dict[str, float]:
    """Return the sigmas of the constant errors by source, with a value for axes that are missing."""
    stated = {key: getattr(table, key, None) for key in CONSTANTS}
    return {
        f"{instrument}_{key}_{axis}": missing if np.isnan(size) else float(size)
        for key, sizes in stated.items()
        if sizes is not None
        for axis, size in zip(CROSS_AXES if key == "misalignment" else AXES, sizes, strict=True)
    }


def _noise(table: Instrument, replaced: Noise | None = None) -> Noise:
    """Return the processes of an instrument; what is missing is that of another one, or none."""
    walk = table.angle_random_walk if isinstance(table, GyroErrors) else table.velocity_random_walk
    quantization = table.quantization if isinstance(table, (GyroTable, AccelerometerTable)) else None
    missing = np.full(3, np.nan)
    stated = Noise(missing if walk is None else walk, *_processes_of_bias(table), *_quantization(quantization))
    below = replaced or Noise()
    pairs = ((getattr(stated, attribute.name), getattr(below, attribute.name)) for attribute in fields(Noise))
    return Noise(*(np.where(np.isnan(result), other, result) for result, other in pairs))


def _processes_of_bias(table: Instrument) -> tuple[Array, Array, Array]:
    """Return sigma and correlation time of a Gauss-Markov process, and a random walk; each of shape (3,), or NaN."""
    (sigma, time), walk = _instability(table.bias_instability), _rate_random_walk(table.rate_random_walk)
    returns = ~np.isnan(walk.returning)
    none = np.where(returns, 0.0, walk.density)
    return np.where(returns, walk.returning, sigma), np.where(returns, walk.correlation_time, time), none


@dataclass(frozen=True)
class _RateWalk:
    """Density of a rate random walk; with a correlation time, the sigma of the process, or NaN; shapes (3,), SI."""

    density: Array
    correlation_time: Array

    @property
    def returning(self) -> Array:
        """K sqrt(tau / 2), the stationary sigma of db/dt = -b / tau + K w with white noise w of unit density."""
        return np.asarray(self.density * np.sqrt(self.correlation_time / 2.0))


def _rate_random_walk(table: WalkTable[Any] | None) -> _RateWalk:
    missing = np.full(3, np.nan)
    if table is None or table.density is None:
        return _RateWalk(missing, missing)
    return _RateWalk(table.density, missing if table.correlation_time is None else table.correlation_time)


def _instability(table: InstabilityTable[Any] | None) -> tuple[Array, Array]:
    """Return sigma and correlation time of a Gauss-Markov process, each of shape (3,); NaN where missing."""
    missing = np.full(3, np.nan)
    if table is None:
        return missing, missing
    sigma = table.sigma if table.allan_minimum is None else table.allan_minimum / ALLAN_MINIMUM
    return missing if sigma is None else sigma, missing if table.correlation_time is None else table.correlation_time


def _check_one_process(table: Instrument, key: str, context: FileContext) -> None:
    """Add a mistake where an axis has two Gauss-Markov processes: a walk with a correlation time is one as well."""
    sigma, _ = _instability(table.bias_instability)
    if np.any((sigma > 0.0) & (_rate_random_walk(table.rate_random_walk).returning > 0.0)):
        message = "with a correlation time stands beside bias_instability; give one of them, as an axis has one process"
        context.problem(key, f"{message} (a grade's is left out by bias_instability with a sigma of zero)")


def _check_instability(table: Instrument, replaced: Noise, key: str, context: FileContext) -> None:
    """Add a mistake where a filter believes in a process without a time, and the instrument has none."""
    sigma, correlation = _instability(table.bias_instability)
    if np.any((sigma > 0.0) & (replaced.instability == 0.0) & np.isnan(correlation)):
        message = "is missing, and the instrument itself has no such process; give it"
        context.problem(f"{key}.correlation_time", message)


def _quantization(table: QuantizationTable[Any] | None) -> tuple[Array, Array]:
    """Return the sigma of the accumulated angle or velocity, and the interval between readings, each of shape (3,)."""
    missing = np.full(3, np.nan)
    if table is None:
        return missing, missing
    sigma = table.sigma if table.step is None else table.step / STEP
    return missing if sigma is None else sigma, missing if table.interval is None else table.interval
