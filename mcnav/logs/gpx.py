"""Tracks in GPX 1.1 (and 1.0): points with latitude, longitude, elevation and time."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

import numpy as np

from mcnav.logs.log_error import LogError
from mcnav.logs.log_table import LogTable, table_of
from mcnav.physics.units import printable

LOOK: Final = re.compile(rb"<gpx[\s>]")


def open_gpx(path: Path) -> LogTable:
    """Read the points of all tracks of a file, in order.

    The altitude is the elevation, with `geoidheight` where it is given; receivers write elevations above sea level.
    """
    points: list[tuple[float, float, float, float]] = []
    segments = heights = 0
    try:
        with path.open("rb") as file:
            for _, element in ElementTree.iterparse(file, events=("end",)):
                kind = element.tag.rpartition("}")[2]
                if kind == "trkseg":
                    segments += 1
                elif kind == "trkpt":
                    point, above = _point(path, element, len(points) + 1)
                    points.append(point)
                    heights += above
                    element.clear()
    except ElementTree.ParseError as failure:
        raise LogError(path, f"is no XML: {printable(str(failure), 80)}") from None
    if not points:
        raise LogError(path, "has no track points")
    notes = ["times are UTC, s since 1970-01-01"]
    if heights < len(points):
        notes.append("altitudes are elevations as they are written, usually above sea level")
    if segments > 1:
        notes.append(f"{segments} segments follow each other")
    names = ("time", "latitude [deg]", "longitude [deg]", "altitude [m]")
    return table_of(path, dict(zip(names, np.array(points).T, strict=True)), {"time": "s"}, notes)


def _point(path: Path, element: ElementTree.Element, number: int) -> tuple[tuple[float, float, float, float], bool]:
    """Return time, latitude, longitude, altitude of a point, and whether its height is above the ellipsoid."""
    content = {child.tag.rpartition("}")[2]: (child.text or "").strip() for child in element}
    for name in ("time", "ele"):
        if not content.get(name):
            words = "no time" if name == "time" else "no elevation"
            raise LogError(path, f"has {words}; a trajectory needs it", f"point {number}")
    try:
        when = datetime.fromisoformat(content["time"])
        time = when.timestamp() if when.tzinfo else when.replace(tzinfo=UTC).timestamp()
        height = float(content["ele"]) + float(content.get("geoidheight") or 0.0)
        return (time, float(element.attrib["lat"]), float(element.attrib["lon"]), height), "geoidheight" in content
    except (KeyError, ValueError) as failure:
        raise LogError(path, f"cannot be read: {printable(str(failure), 80)}", f"point {number}") from None
