"""Logs of PX4 (ULog), read by pyulog. Times are microseconds since the controller started."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any, Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.logs.log_error import LogError, listed
from mcnav.logs.log_table import LogTable, Values, table_of
from mcnav.logs.times import rows
from mcnav.physics.units import printable

MAGIC: Final = b"ULog\x01\x12\x35"

INERTIAL: Final = ("sensor_combined", "vehicle_imu", "sensor_gyro", "sensor_accel")
"""Topics with readings of inertial sensors, the better first."""

POSITIONS: Final = ("vehicle_gps_position", "sensor_gps", "vehicle_global_position")
"""Topics with positions, the better first."""

PARTS: Final = {"sensor_gyro": "gyro_", "sensor_accel": "accelerometer_"}
"""Beginning of the names of axes, before `x`, `y`, `z`, in topics of one instrument."""

RATES: Final = {"delta_angle": "gyro_rad", "delta_velocity": "accelerometer_m_s2"}
"""Names of the mean rates over the integration time of increments."""

UNITS: Final = {
    "delta_angle[0]": "rad", "delta_angle[1]": "rad", "delta_angle[2]": "rad",
    "delta_velocity[0]": "m/s", "delta_velocity[1]": "m/s", "delta_velocity[2]": "m/s",
    **{f"gyro_rad[{axis}]": "rad/s" for axis in range(3)}, **{f"gyro_{axis}": "rad/s" for axis in "xyz"},
    **{f"accelerometer_m_s2[{axis}]": "m/s^2" for axis in range(3)},
    **{f"accelerometer_{axis}": "m/s^2" for axis in "xyz"},
}  # fmt: skip
"""Units of PX4's messages."""

FIX: Final = 3
"""`fix_type` of a position in three dimensions."""


def open_ulog(path: Path, topic: str | None, preferred: Sequence[str]) -> LogTable:
    """Read a topic of a log: the one that is named, as `sensor_gyro` or `sensor_gyro.1`, or the first preferred."""
    name, _, instance = (topic or "").partition(".")
    log = _load(path, [name] if name else list(preferred) or None)
    datasets = {(dataset.name, dataset.multi_id): dataset.data for dataset in log.data_list}
    wanted = (name, int(instance or 0) if (instance or "0").isdigit() else -1)
    if not name:
        choices = [key for key in ((topic, 0) for topic in preferred) if key in datasets] or list(datasets)
        if preferred and not any(choice[0] in preferred for choice in choices):
            choices = []
        if len(choices) != 1 and not (preferred and choices):
            what = f"none of {listed(preferred)}" if preferred else "several topics"
            raise LogError(path, f'has {what}; name one: columns = {{ topic = "…" }}, of {_topics(path)}')
        wanted = choices[0]
    if wanted not in datasets:
        raise LogError(path, f"has no topic {printable(topic or '', 60)!r}; it has {_topics(path)}", "columns.topic")
    instances = sorted(dataset for dataset in datasets if dataset[0] == wanted[0])
    if not instance and len(instances) > 1:
        choices_of = " or ".join(f'"{topic}.{number}"' for topic, number in instances)
        raise LogError(
            path, f"has {len(instances)} instances of {wanted[0]}; name one: columns = {{ topic = {choices_of} }}"
        )
    if "timestamp" not in datasets[wanted]:
        raise LogError(path, f"has no times of {wanted[0]}")
    columns, notes = _columns(datasets[wanted], wanted[0])
    if not name and wanted[0] in PARTS:
        other = next(name for name in PARTS if name != wanted[0])
        others = [dataset for dataset in datasets if dataset[0] == other]
        if len(others) > 1:
            choices_of = " or ".join(f'"{topic}.{number}"' for topic, number in others)
            raise LogError(path, f"has {len(others)} instances of {other} beside {wanted[0]}; name one of {choices_of}")
        if others:
            columns, notes = _joined(columns, _columns(datasets[others[0]], other)[0], wanted[0], other)
    if wanted[0] == "vehicle_global_position":
        columns |= _attitude(path, columns["timestamp"])
    if not len(columns["timestamp"]):
        raise LogError(path, f"has no {wanted[0]} with a position")
    units = {column: UNITS.get(column, "") for column in columns}
    notes = (f"topic {wanted[0]}, times since the controller started", *_dropouts(log), *notes)
    return table_of(path, columns, {**units, "timestamp": "us", "timestamp_sample": "us"}, notes)


def _load(path: Path, topics: list[str] | None) -> Any:
    try:
        from pyulog import ULog
    except ImportError:
        raise LogError(path, "is a PX4 log; reading it needs pyulog: pip install 'mcnav[logs]'") from None
    try:
        # pyulog leaves the file open where it fails, and prints what is wrong
        with path.open("rb") as file, redirect_stdout(StringIO()):
            return ULog(file, topics)
    except Exception as failure:  # pyulog raises many types for damaged files
        told = printable(str(failure) or type(failure).__name__, 120)
        raise LogError(path, f"is no PX4 log that can be read: {told}") from None


def _topics(path: Path) -> str:
    """List the topics of a log, those with readings and positions first."""
    keys = [(dataset.name, dataset.multi_id) for dataset in _load(path, None).data_list]
    keys.sort(key=lambda key: (key[0] not in (*INERTIAL, *POSITIONS), key))
    return listed([name if not instance else f"{name}.{instance}" for name, instance in keys]) or "no topic"


def _dropouts(log: Any) -> tuple[str, ...]:
    lost = sum(dropout.duration for dropout in log.dropouts)
    return (f"{len(log.dropouts)} dropouts of the logger, {lost / 1e3:.3g} s in all",) if log.dropouts else ()


def _columns(data: dict[str, Values], topic: str) -> tuple[dict[str, Values], tuple[str, ...]]:
    """Return the columns of a topic; positions in deg and m, from a fix in three dimensions."""
    columns = {PARTS.get(topic, "") + name if name in "xyz" else name: column for name, column in data.items()}
    columns["timestamp"] = columns["timestamp"].astype(np.int64)
    if topic in INERTIAL:
        # the time at which samples were taken is the better one, where it is logged
        if "timestamp_sample" in columns and np.all(columns["timestamp_sample"] > 0):
            columns["timestamp"] = columns.pop("timestamp_sample").astype(np.int64)
        columns.pop("timestamp_sample", None)
        return _rates(columns)
    columns.pop("timestamp_sample", None)
    return (_positions(columns)) if topic in POSITIONS else (columns, ())


def _joined(
    columns: dict[str, Values], others: dict[str, Values], topic: str, other: str
) -> tuple[dict[str, Values], tuple[str, ...]]:  # fmt: skip
    """Join gyros and accelerometers of two topics at the times of the first, where both have readings."""
    times, of_others = columns["timestamp"], others["timestamp"]
    both = (times >= of_others[0]) & (times <= of_others[-1])
    joined = {name: values[both] for name, values in columns.items()}
    for name, values in others.items():
        if name.startswith(PARTS[other]):
            joined[name] = np.interp(times[both].astype(float), of_others.astype(float), values.astype(float))
    return joined, (f"{other} is interpolated to the times of {topic}",)


def _rates(columns: dict[str, Values]) -> tuple[dict[str, Values], tuple[str, ...]]:
    """Divide increments by the integration time of each message, us, where the log has it."""
    divided = []
    for increment in ("delta_angle", "delta_velocity"):
        duration = columns.pop(f"{increment}_dt", None)
        names = [f"{increment}[{axis}]" for axis in range(3)]
        if duration is None or not np.all(duration > 0) or not all(name in columns for name in names):
            continue
        rate = RATES[increment]
        for axis, name in enumerate(names):
            columns[f"{rate}[{axis}]"] = columns.pop(name) / (duration * 1e-6)
        divided.append(increment)
    return columns, (f"{' and '.join(divided)} are divided by the integration time of each message",) if divided else ()


def _positions(data: dict[str, Values]) -> tuple[dict[str, Values], tuple[str, ...]]:
    """Return positions in deg and m above the ellipsoid, velocities, and their sigmas.

    Older messages have integers of 1e-7 deg and mm. The accuracies `eph`, `epv` and `s_variance_m_s` are taken as
    sigmas of each axis, as PX4's filter takes them.
    """
    fixed = data["fix_type"] >= FIX if "fix_type" in data else np.ones(len(data["timestamp"]), dtype=np.bool_)
    scaled = data.get("lat", np.zeros(0)).dtype.kind in "iu"
    sources = {
        "latitude [deg]": (("latitude_deg", 1.0), ("lat", 1e-7 if scaled else 1.0)),
        "longitude [deg]": (("longitude_deg", 1.0), ("lon", 1e-7 if scaled else 1.0)),
        "altitude [m]": (
            ("altitude_ellipsoid_m", 1.0), ("alt_ellipsoid", 1e-3 if scaled else 1.0), ("altitude_msl_m", 1.0),
            ("alt", 1e-3 if scaled else 1.0),
        ),
        "velocity_north [m/s]": (("vel_n_m_s", 1.0), ("vel_n", 1.0)),
        "velocity_east [m/s]": (("vel_e_m_s", 1.0), ("vel_e", 1.0)),
        "velocity_down [m/s]": (("vel_d_m_s", 1.0), ("vel_d", 1.0)),
        **dict.fromkeys(("sigma_north [m]", "sigma_east [m]"), (("eph", 1.0),)),
        "sigma_down [m]": (("epv", 1.0),),
    }  # fmt: skip
    if "vel_n_m_s" in data:
        sigmas = (f"velocity_sigma_{axis} [m/s]" for axis in ("north", "east", "down"))
        sources |= dict.fromkeys(sigmas, (("s_variance_m_s", 1.0),))
    result: dict[str, Values] = {"timestamp": data["timestamp"][fixed]}
    used = set()
    for name, candidates in sources.items():
        for source, factor in candidates:
            if source in data:
                result[name] = data[source][fixed] * factor
                used.add(source)
                break
    notes = []
    if not fixed.all():
        notes.append(f"{rows(int(np.sum(~fixed)))} without a fix in three dimensions left out")
    if used & {"altitude_msl_m", "alt"}:
        notes.append("altitudes are above sea level")
    if "eph" in used:
        notes.append("eph and epv are taken as the sigmas of each axis")
    return result, tuple(notes)


def _attitude(path: Path, timestamp: Values) -> dict[str, Array]:
    """Return roll, pitch, heading of `vehicle_attitude` at some times, interpolated as rotations; none without it."""
    log = _load(path, ["vehicle_attitude"])
    if not log.data_list or not len(timestamp):
        return {}
    from scipy.spatial.transform import Rotation, Slerp

    data = log.data_list[0].data
    time, first = np.unique(data.get("timestamp", np.zeros(0)).astype(np.int64), return_index=True)
    if len(time) < 2 or "q[3]" not in data or timestamp[0] < time[0] or timestamp[-1] > time[-1]:
        return {}
    body_to_local = Rotation.from_quat(np.stack([data[f"q[{number}]"] for number in (1, 2, 3, 0)], axis=1)[first])
    turned = Slerp(time.astype(float), body_to_local)(timestamp.astype(float))
    heading, pitch, roll = np.degrees(turned.as_euler("ZYX")).T
    return {"roll [deg]": roll, "pitch [deg]": pitch, "heading [deg]": heading}
