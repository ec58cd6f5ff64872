"""A flight as files of other viewers: CZML for Cesium, MCAP for Foxglove and PlotJuggler."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping
from datetime import UTC, datetime, timedelta
from typing import Any, Final

import numpy as np

from mcnav.arrays.products import transformed_variances
from mcnav.report.exports.flight import Flight, quaternions, timed

MISSING: Final = "{} needs {}: pip install 'mcnav[viewers]'"

EPOCH: Final = datetime(2000, 1, 1, 12, tzinfo=UTC)
"""Date of time zero, J2000: a flight has none of its own."""

REACH: Final = 3.0
"""Sigmas of an ellipsoid's semi-axes."""

POSE: Final = {
    "type": "object", "title": "foxglove.PoseInFrame",
    "properties": {
        "timestamp": {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}},
        "frame_id": {"type": "string"},
        "pose": {"type": "object", "properties": {
            "position": {"type": "object", "properties": {name: {"type": "number"} for name in "xyz"}},
            "orientation": {"type": "object", "properties": {name: {"type": "number"} for name in "xyzw"}},
        }},
    },
}  # fmt: skip
SCENE: Final = {
    "type": "object", "title": "foxglove.SceneUpdate",
    "properties": {
        "deletions": {"type": "array", "items": {"type": "object"}},
        "entities": {"type": "array", "items": {"type": "object"}},
    },
}  # fmt: skip
NUMBERS: Final = {
    "type": "object", "title": "mcnav.PositionError",
    "description": "Navigated less true position and its sigma, m, along east, north and up at the first position.",
    "properties": {f"{what}_{axis}": {"type": "number"} for what in ("error", "sigma") for axis in ("e", "n", "u")},
}  # fmt: skip
"""JSON schemas of messages; the first two are Foxglove's."""


def as_czml(flight: Flight) -> bytes:
    """Write a flight as CZML: paths of the true and the navigated vehicle, and the ellipsoid of three sigma.

    Raises
    ------
    ImportError
        Where czml3 is not installed.
    """
    try:
        from czml3 import Document, Packet
        from czml3.properties import (
            Clock,
            Color,
            Ellipsoid,
            EllipsoidRadii,
            Material,
            Orientation,
            Path,
            Point,
            PolylineMaterial,
            Position,
            SolidColorMaterial,
        )
        from czml3.types import IntervalValue, TimeInterval
    except ImportError:
        raise ImportError(MISSING.format("CZML", "czml3")) from None
    ends = [EPOCH + timedelta(seconds=float(time)) for time in flight.times[[0, -1]]]
    semi, directions = flight.ellipsoids

    def solid(*rgba: int) -> Any:
        return SolidColorMaterial(color=Color(rgba=list(rgba)))

    def vehicle(name: str, positions: Any, colour: tuple[int, ...]) -> Any:
        return Packet(
            id=name, name=f"{flight.name}: {name}",
            position=Position(cartesian=timed(flight.times, positions), epoch=EPOCH, referenceFrame="FIXED"),
            path=Path(material=PolylineMaterial(solidColor=solid(*colour)), width=2),
            point=Point(pixelSize=8, color=Color(rgba=list(colour))),
        )  # fmt: skip

    clock = Clock(currentTime=ends[0], multiplier=10.0)
    packets = [
        Packet(id="document", name=flight.name, version="1.0",
               clock=IntervalValue(start=ends[0], end=ends[1], value=clock)),
        vehicle("true", flight.true, (11, 95, 165, 255)),
        vehicle("navigated", flight.navigated, (194, 78, 0, 255)),
        Packet(
            id="covariance", name=f"{flight.name}: {REACH:g} sigma of {flight.samples} samples",
            availability=TimeInterval(start=ends[0], end=ends[1]),
            position=Position(cartesian=timed(flight.times, flight.true), epoch=EPOCH, referenceFrame="FIXED"),
            orientation=Orientation(unitQuaternion=timed(flight.times, quaternions(directions)), epoch=EPOCH),
            ellipsoid=Ellipsoid(radii=EllipsoidRadii(cartesian=timed(flight.times, REACH * semi), epoch=EPOCH),
                                material=Material(solidColor=solid(194, 78, 0, 90))),
        ),
    ]  # fmt: skip
    return str(Document(packets=packets).dumps(indent=1)).encode()


def as_mcap(flight: Flight) -> bytes:
    """Write a flight as MCAP with messages in JSON: poses, an ellipsoid of three sigma, errors with their sigmas.

    Positions are along east, north and up at the first one, m.

    Raises
    ------
    ImportError
        Where mcap is not installed.
    """
    try:
        from mcap.writer import CompressionType, Writer
    except ImportError:
        raise ImportError(MISSING.format("MCAP", "mcap")) from None
    buffer = io.BytesIO()
    writer = Writer(buffer, compression=CompressionType.NONE)
    writer.start(profile="", library="mcnav")
    channels = {}
    for topic, schema in {"/true": POSE, "/navigated": POSE, "/covariance": SCENE, "/position_error": NUMBERS}.items():
        known = writer.register_schema(str(schema["title"]), "jsonschema", json.dumps(schema).encode())
        channels[topic] = writer.register_channel(topic, "json", known)
    begin = int(EPOCH.timestamp()) * 1_000_000_000
    for k, messages in enumerate(_messages(flight)):
        stamp = begin + round(1e9 * float(flight.times[k]))
        for topic, made in messages.items():
            content = json.dumps(made({"sec": stamp // 1_000_000_000, "nsec": stamp % 1_000_000_000})).encode()
            writer.add_message(channels[topic], log_time=stamp, publish_time=stamp, data=content)
    writer.finish()  # type: ignore[no-untyped-call]
    return buffer.getvalue()


Message = Callable[[Mapping[str, int]], Mapping[str, Any]]
"""A message, once its time is known."""


def _messages(flight: Flight) -> list[dict[str, Message]]:
    """Return the messages of each time by topic."""
    semi, directions = flight.ellipsoids
    turned = quaternions(flight.axes @ directions)
    places = {name: flight.local(positions - flight.true[0]) for name, positions in
              (("/true", flight.true), ("/navigated", flight.navigated))}  # fmt: skip
    errors = flight.local(flight.error)
    spread = np.sqrt(transformed_variances(flight.axes, flight.covariance))
    return [
        {
            **{topic: _pose(values[k]) for topic, values in places.items()},
            "/covariance": _ellipsoid(places["/true"][k], turned[k], 2.0 * REACH * semi[k]),
            "/position_error": _numbers(errors[k], spread[k]),
        }
        for k in range(len(flight.times))
    ]


def _named(names: str, values: Any) -> dict[str, float]:
    return dict(zip(names, map(float, values), strict=True))


def _pose(position: Any) -> Message:
    pose = {"position": _named("xyz", position), "orientation": _named("xyzw", (0.0, 0.0, 0.0, 1.0))}
    return lambda stamp: {"timestamp": stamp, "frame_id": "start", "pose": pose}


def _ellipsoid(position: Any, quaternion: Any, size: Any) -> Message:
    sphere = {
        "pose": {"position": _named("xyz", position), "orientation": _named("xyzw", quaternion)},
        "size": _named("xyz", size), "color": _named("rgba", (0.76, 0.31, 0.0, 0.35)),
    }  # fmt: skip
    return lambda stamp: {
        "deletions": [],
        "entities": [{"timestamp": stamp, "frame_id": "start", "id": "covariance", "spheres": [sphere]}],
    }


def _numbers(error: Any, sigma: Any) -> Message:
    content = {f"error_{axis}": float(value) for axis, value in zip("enu", error, strict=True)}
    content |= {f"sigma_{axis}": float(value) for axis, value in zip("enu", sigma, strict=True)}
    return lambda _: content


WRITERS: Final[Mapping[str, Callable[[Flight], bytes]]] = {".czml": as_czml, ".mcap": as_mcap}
"""What writes a flight, by the ending of the file."""
