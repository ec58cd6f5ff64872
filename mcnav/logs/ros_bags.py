"""Bags of ROS 1 (.bag) and ROS 2 (.db3, .mcap, or a folder), read by rosbags.

Fields of messages are named as in ROS: `angular_velocity.x`; a header's stamp is `stamp`, in ns.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from mcnav.logs.log_error import LogError, listed
from mcnav.logs.log_table import LogTable, Values, table_of
from mcnav.logs.times import rows
from mcnav.physics.units import printable

MAGIC: Final = (b"#ROSBAG V", b"SQLite format 3\0", b"\x89MCAP")
"""First bytes of the files of bags."""

INERTIAL: Final = ("sensor_msgs/msg/Imu",)
POSITIONS: Final = ("sensor_msgs/msg/NavSatFix",)
"""Types of messages that hold readings of inertial sensors, and positions."""

APPROXIMATED: Final = 1
"""`position_covariance_type` of a covariance that drivers fill with a dilution of precision squared."""

LARGEST_ARRAY: Final = 16
"""Elements of a field that are read as columns."""

UNITS: Final = {
    **{f"angular_velocity.{axis}": "rad/s" for axis in "xyz"},
    **{f"linear_acceleration.{axis}": "m/s^2" for axis in "xyz"},
    "latitude": "deg", "longitude": "deg", "altitude": "m", "stamp": "ns", "received": "ns",
}  # fmt: skip


def open_bag(path: Path, topic: str | None, preferred: Sequence[str]) -> LogTable:
    """Read a topic of a bag: the one that is named, or the only one of a preferred type."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise LogError(path, "is a ROS bag; reading it needs rosbags: pip install 'mcnav[logs]'") from None
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
            name = _choose(path, reader, topic, preferred)
            columns = _columns(path, reader, name)
    except LogError:
        raise
    except Exception as failure:  # rosbags raises many types for damaged files
        told = printable(str(failure) or type(failure).__name__, 120)
        raise LogError(path, f"is no ROS bag that can be read: {told}") from None
    columns, notes = _positions(path, columns) if "position_covariance[0]" in columns else (columns, ())
    return table_of(path, columns, {column: UNITS.get(column, "") for column in columns}, (f"topic {name}", *notes))


def _choose(path: Path, reader: Any, topic: str | None, preferred: Sequence[str]) -> str:
    """Return the name of the topic that is read."""
    topics: dict[str, str] = {name: info.msgtype for name, info in reader.topics.items() if info.msgcount}
    shown = listed([f"{name} ({kind})" for name, kind in sorted(topics.items())]) or "none"
    if topic is not None:
        if topic not in topics:
            raise LogError(path, f"has no topic {printable(topic, 60)!r}; it has {shown}", "columns.topic")
        return topic
    fitting: list[str] = [name for name, kind in topics.items() if kind in preferred or not preferred]
    if len(fitting) == 1:
        return fitting[0]
    wanted = f" of type {listed(preferred)}" if preferred else ""
    many = "no topic" if not fitting else f"{len(fitting)} topics"
    raise LogError(path, f'has {many}{wanted}; name one: columns = {{ topic = "…" }}, of {shown}')


def _columns(path: Path, reader: Any, topic: str) -> dict[str, Values]:
    """Return the numbers of all messages of a topic as columns."""
    connections = [connection for connection in reader.connections if connection.topic == topic]
    names: list[str] | None = None
    values: list[list[float]] = []
    stamps: list[int] = []
    for connection, received, raw in reader.messages(connections):
        message = reader.deserialize(raw, connection.msgtype)
        header = getattr(message, "header", None)
        stamps.append(received if header is None else header.stamp.sec * 1_000_000_000 + header.stamp.nanosec)
        fields = list(_numbers("", message))
        if names is None:
            names = [name for name, _ in fields]
        if len(fields) != len(names):
            raise LogError(
                path, f"has {len(fields)} numbers; expected {len(names)}, as the first", f"message {len(stamps)}"
            )
        values.append([value for _, value in fields])
    table = np.array(values).reshape(len(values), -1)
    return {"stamp": np.array(stamps, dtype=np.int64)} | {
        name: table[:, place] for place, name in enumerate(names or ())
    }


def _numbers(prefix: str, message: Any) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a message by their names; headers and long arrays are left out."""
    for name in getattr(message, "__dataclass_fields__", ()):
        value = getattr(message, name)
        if name in ("header", "__msgtype__"):
            continue
        if isinstance(value, (bool, int, float, np.number)):
            yield prefix + name, float(value)
        elif isinstance(value, np.ndarray) and value.size <= LARGEST_ARRAY and value.dtype.kind in "iufb":
            for place, entry in enumerate(value.reshape(-1)):
                yield f"{prefix}{name}[{place}]", float(entry)
        elif hasattr(value, "__dataclass_fields__"):
            yield from _numbers(f"{prefix}{name}.", value)


def _positions(path: Path, columns: dict[str, Values]) -> tuple[dict[str, Values], tuple[str, ...]]:
    """Return positions of NavSatFix with their sigmas: the roots of the covariances east, north, up.

    Positions without a fix are left out.
    """
    fixed = (columns["status.status"] >= 0) & np.isfinite(columns["altitude"]) & np.isfinite(columns["latitude"])
    if not fixed.any():
        raise LogError(path, "has no position with a fix")
    kept = {name: column[fixed] for name, column in columns.items() if "covariance[" not in name}
    notes = [] if fixed.all() else [f"{rows(int(np.sum(~fixed)))} without a fix left out"]
    types = kept.get("position_covariance_type", np.zeros(1))
    if np.all(types > 0):
        prefix = "approximated_" if np.any(types == APPROXIMATED) else ""
        for name, place in (("sigma_east", 0), ("sigma_north", 4), ("sigma_down", 8)):
            kept[prefix + name] = np.sqrt(columns[f"position_covariance[{place}]"][fixed])
        if prefix:
            wanted = ", ".join(f'sigma_{axis} = "{prefix}sigma_{axis}"' for axis in ("north", "east", "down"))
            notes.append(
                "the covariance type of the positions is 1, approximated by a dilution of precision: it is not a "
                f"variance in m^2, and no sigma is taken from it; columns = {{ {wanted} }} takes its root"
            )
    return kept, tuple(notes)
