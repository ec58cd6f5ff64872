"""Records of inertial sensors, in SI units, with what was noticed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.files.lines import place_of_row
from mcnav.logs import px4, ros_bags
from mcnav.logs.imu_columns import ACCELEROMETER, AXES, GYRO, ImuColumns, find_columns
from mcnav.logs.imu_units import check_force, check_interval, check_rates, saturations
from mcnav.logs.log_error import LogError
from mcnav.logs.log_table import LogTable
from mcnav.logs.mapping import Column, cannot_tell, factor_to, numbers
from mcnav.logs.tables import open_table
from mcnav.logs.times import Stamps, interval_of, notes_of_steps, refuse_falling, repeated, rows, seconds_of, unwrapped
from mcnav.physics.constants import STANDARD_GRAVITY

if TYPE_CHECKING:
    import pandas as pd

RATES: Final = {"gyro": ("rad/s", "rad"), "accelerometer": ("m/s^2", "m/s")}
"""Units of readings, and those of increments."""

MOST_MISSING: Final = 0.01
"""Share of rows without a reading that are left out with a note."""

LEVEL: Final = 0.8
"""Share of the specific force along one axis at rest, from which that axis is taken to be vertical."""

MOVING: Final = 0.1
"""Difference of the specific force's size from that of gravity, as a share, beyond which the vehicle accelerates."""

FIRST: Final = 1.0
"""Part of a log whose specific force is compared with gravity, s."""


@dataclass(frozen=True)
class ImuLog:
    """A record of inertial sensors.

    Attributes
    ----------
    time : ndarray, shape (n,)
        s from the first sample, rising.
    start : float
        Time stamp of the first sample as it is recorded (GPS seconds, seconds since 1970, ...), s.
    interval : float
        Nominal interval between samples, s: the median step.
    gyro : ndarray, shape (n, 3), or None
        Angular rate, rad/s.
    accelerometer : ndarray, shape (n, 3), or None
        Specific force, m/s^2.
    notes : tuple of str
        What was noticed, one line each: gaps, repeated stamps, saturation, units taken.

    Examples
    --------
    >>> import mcnav as mc
    >>> log = mc.ImuLog(np.array([0.0, 0.1]), 0.0, 0.1, gyro=np.zeros((2, 3)), accelerometer=None, notes=())
    >>> log.frame.columns.tolist(), log.frame.attrs["units"]["gyro_x"]
    (['gyro_x', 'gyro_y', 'gyro_z'], 'rad/s')
    """

    time: Array
    start: float
    interval: float
    gyro: Array | None
    accelerometer: Array | None
    notes: tuple[str, ...]

    @property
    def frame(self) -> pd.DataFrame:
        """The readings, a row a time (s) and a column an axis such as ``gyro_x``, SI; units in ``attrs["units"]``."""
        import pandas as pd

        known = {"gyro": self.gyro, "accelerometer": self.accelerometer}
        columns = {
            f"{name}_{axis}": readings[:, place]
            for name, readings in known.items() if readings is not None for place, axis in enumerate(AXES)
        }  # fmt: skip
        table = pd.DataFrame(columns, index=pd.Index(self.time, name="time"))
        table.attrs["units"] = {name: RATES[name.rpartition("_")[0]][0] for name in columns} | {"time": "s"}
        return table


def read_imu_log(
    path: str | Path, columns: Mapping[str, str] | None = None, units: Mapping[str, str] | None = None
) -> ImuLog:
    """Read a record of inertial sensors.

    Parameters
    ----------
    path : str or Path
        Of any format that `open_table` reads.
    columns : mapping, optional
        Columns of the file by `time`, `gyro_x`, ..., `accelerometer_z`; a minus sign before a name negates it.
        `interval = "0.01 s"` stands for a column of time, `topic` names a table of a log with several.
    units : mapping, optional
        Units by the same keys, or by `gyro` and `accelerometer`. Increments (rad, m/s) are divided by the interval.

    Raises
    ------
    LogError
        In one line: where the columns cannot be told, times fall or repeat, readings are missing, or sizes say that
        a unit which is not stated is another one.

    Examples
    --------
    >>> import mcnav as mc
    >>> import pandas as pd
    >>> rates = {f"gyro_{axis} [deg/s]": np.linspace(0.0, 1.0, 5) for axis in "xyz"}
    >>> pd.DataFrame({"time [s]": np.arange(5) / 10.0, **rates}).to_csv("static.csv", index=False)
    >>> mc.read_imu_log("static.csv").frame["gyro_x"].max().round(6)  # rad/s
    np.float64(0.017453)
    """
    path, columns, units = Path(path), columns or {}, units or {}
    table = open_table(path, columns.get("topic"), (*px4.INERTIAL, *ros_bags.INERTIAL))
    chosen = find_columns(table, columns, units)
    stamps, notes = _stamps(table, chosen)
    vectors = {name: _stacked(table, trio) for name, trio in chosen.vectors.items()}
    time, vectors, further = _sound_rows(table, chosen, stamps, vectors)
    stated_time = chosen.time is None or bool(chosen.time.unit)
    name = "interval" if chosen.time is None else chosen.time.name
    interval = interval_of(path, time, name)
    notes += further + check_interval(path, interval, stated_time) + notes_of_steps(time, interval)
    if chosen.guessed and not any(column.unit for trio in chosen.vectors.values() for column in trio):
        chosen, told = _told_by_gravity(table, chosen, vectors["accelerometer"], interval)
        notes += told
    for vector, trio in chosen.vectors.items():
        notes += _to_si(table, vector, trio, vectors[vector], interval)
    notes += _checked(path, chosen, vectors, time, interval) + saturations(time, vectors)
    start = float(time[0]) + (0.0 if stamps is None else stamps.start)
    return ImuLog(
        time - time[0], start, interval, vectors.get("gyro"), vectors.get("accelerometer"), (*table.notes, *notes)
    )


def _stamps(table: LogTable, chosen: ImuColumns) -> tuple[Stamps | None, tuple[str, ...]]:
    """Return the time stamps of a record; none where an interval stands for them."""
    column = chosen.time
    if column is None:
        return None, ()
    values = table.read([column.name])[column.name]
    if not len(values):
        raise LogError(table.path, "has no rows")
    return unwrapped(seconds_of(table.path, values, column.unit or "s", column.name))


def _stacked(table: LogTable, trio: tuple[Column, ...]) -> Array:
    """Read three columns as they are, shape (n, 3)."""
    read = dict(table.read([column.name for column in trio]))
    first = read[trio[0].name]
    result = np.empty((len(first), len(trio)))
    for axis, column in enumerate(trio):
        result[:, axis] = numbers(table, read[column.name], column.name)
        if column.sign < 0.0:
            result[:, axis] *= -1.0
    return result


def _sound_rows(
    table: LogTable, chosen: ImuColumns, stamps: Stamps | None, vectors: dict[str, Array]
) -> tuple[Array, dict[str, Array], tuple[str, ...]]:
    """Leave out rows without a reading and repeated ones, with notes; refuse times that fall."""
    count = len(next(iter(vectors.values())))
    time = np.asarray(np.arange(count) * (chosen.interval or 0.0), dtype=float) if stamps is None else stamps.time
    name = "time" if chosen.time is None else chosen.time.name
    remedy = ', or give columns = { interval = "…" } in place of time'
    notes: tuple[str, ...] = ()
    missing = np.zeros(count, dtype=np.bool_)
    for values in vectors.values():
        missing |= ~np.isfinite(values).all(axis=1)
    if missing.any():
        notes += (_missing_note(table, chosen, vectors, missing),)
    refuse_falling(table.path, time, name, remedy)
    left_out = missing
    if np.any(np.diff(time) == 0.0):
        same = np.ones(count - 1, dtype=np.bool_)
        for values in vectors.values():
            same &= (np.diff(values, axis=0) == 0.0).all(axis=1)
        again = repeated(table.path, time, same, name, remedy)
        notes += (f"{rows(int(again.sum()))} left out, the same as the one before",)
        left_out = missing | again
    if not left_out.any():
        return time, vectors, notes
    return time[~left_out], {vector: values[~left_out] for vector, values in vectors.items()}, notes


def _missing_note(table: LogTable, chosen: ImuColumns, vectors: Mapping[str, Array], missing: NDArray[np.bool_]) -> str:
    """Say how many rows lack a reading; `LogError` where they are too many."""
    row = int(np.flatnonzero(missing)[0])
    column = next(
        column.name for vector, trio in chosen.vectors.items() for axis, column in enumerate(trio)
        if not np.isfinite(vectors[vector][row, axis])
    )  # fmt: skip
    count = int(missing.sum())
    if count > MOST_MISSING * len(missing):
        raise LogError(
            table.path, f"has no number, like {rows(count)} of {len(missing):,}; leave them out",
            f"{place_of_row(table.path, row)}, {column}",
        )  # fmt: skip
    first = place_of_row(table.path, row)
    return f"{rows(count)} of {len(missing):,} left out, without a reading (first {first}, {column})"


def _told_by_gravity(
    table: LogTable, chosen: ImuColumns, force: Array, interval: float
) -> tuple[ImuColumns, tuple[str, ...]]:
    """Tell rates from increments where columns have no names: by the size of the specific force.

    Raises `LogError` where it is neither.
    """
    size = float(np.median(np.linalg.norm(force, axis=1)))
    for place, words in enumerate(("rates: rad/s and m/s^2", "increments (as KF-GINS has them): rad and m/s")):
        expected = STANDARD_GRAVITY * (interval if place else 1.0)
        if abs(size / expected - 1.0) < 0.2:
            units = {vector: RATES[vector][place] for vector in chosen.vectors}
            vectors = {
                vector: tuple(Column(column.name, units[vector], column.sign) for column in trio)
                for vector, trio in chosen.vectors.items()
            }
            note = f"columns without names are taken for time, gyros x, y, z, accelerometers x, y, z, of {words}"
            return ImuColumns(chosen.time, chosen.interval, vectors, chosen.guessed), (note,)
    keys = ", ".join(f'{key} = "{place}"' for place, key in enumerate(("time", *GYRO, *ACCELEROMETER), start=1))
    raise cannot_tell(
        table, f"the last three are {size:.4g} in the median, neither gravity nor its increment of an interval of "
        f"{interval:.4g} s", f'columns = {{ {keys} }}, units = {{ gyro = "rad/s", accelerometer = "m/s^2" }}',
    )  # fmt: skip


def _to_si(table: LogTable, vector: str, trio: tuple[Column, ...], values: Array, interval: float) -> tuple[str, ...]:
    """Convert the components of a vector to SI units in place; increments are divided by the interval."""
    notes: tuple[str, ...] = ()
    for axis, (name, column) in enumerate(zip(AXES, trio, strict=True)):
        factor, target = factor_to(table.path, column.unit or RATES[vector][0], RATES[vector], f"{vector}_{name}")
        if target == RATES[vector][1]:
            factor /= interval
            notes = (f"increments of the {vector} are divided by the interval of {interval:.6g} s",)
        if factor != 1.0:
            values[:, axis] *= factor
    if not any(column.unit for column in trio):
        notes = (f"the unit of the {vector} is not stated; it is taken as {RATES[vector][0]}",)
    return notes


def _checked(
    path: Path, chosen: ImuColumns, vectors: Mapping[str, Array], time: Array, interval: float
) -> tuple[str, ...]:
    """Refuse or note sizes that belong to other units."""
    notes: tuple[str, ...] = ()
    force = vectors.get("accelerometer")
    if force is not None:
        stated = any(column.unit for column in chosen.vectors["accelerometer"])
        notes += check_force(path, force, interval, stated)
    if "gyro" in vectors:
        stated = any(column.unit for column in chosen.vectors["gyro"])
        notes += check_rates(path, vectors["gyro"], force, time - time[0], stated)
    return notes


def remark_on_axes(log: ImuLog, roll: float = 0.0, pitch: float = 0.0) -> str | None:
    """Say that a log begins with gravity along another axis than forward, right, down have it; nothing if it does not.

    A specific force that is as large as gravity to a tenth is that of gravity, and of less than half of it across.

    Parameters
    ----------
    roll, pitch : float
        Those that are declared, rad.

    Examples
    --------
    >>> flu = np.tile([0.0, 0.0, 9.8], (100, 1))
    >>> remark_on_axes(ImuLog(np.arange(100) / 100, 0.0, 0.01, None, flu, ()))
    'the specific force begins along +z, for axes forward, right, down it is along -z; name columns so that it is'
    """
    if log.accelerometer is None:
        return None
    expected = -np.array([-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)])
    mean = log.accelerometer[log.time < log.time[0] + FIRST].mean(axis=0)
    size = float(np.linalg.norm(mean))
    if abs(size / STANDARD_GRAVITY - 1.0) > MOVING or float(mean @ expected) > LEVEL * size:
        return None
    came, wanted = _axis(mean), _axis(expected)
    return (
        f"the specific force begins along {came}, for axes forward, right, down it is along {wanted}; "
        "name columns so that it is"
    )


def _axis(vector: Array) -> str:
    """Return the axis along which a vector is largest, with its sign."""
    largest = int(np.argmax(np.abs(vector)))
    return ("+" if vector[largest] > 0.0 else "-") + AXES[largest]
