"""Logs of NMEA 0183 sentences: GGA (position), GST (its sigmas), RMC (date, speed, course)."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from datetime import UTC, date, datetime
from functools import reduce
from pathlib import Path
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.logs.log_error import LogError
from mcnav.logs.log_table import LogTable, table_of
from mcnav.logs.times import rows

SENTENCE: Final = re.compile(r"\$([A-Z]{2})(GGA|GST|RMC),([^*$]*)(?:\*([0-9A-Fa-f]{2}))?")
LOOK: Final = re.compile(rb"\A\s*(\\[^\\\n]*\\)?[$!](P[A-Z]{3}|[A-Z]{2}[A-Z0-9]{3})[A-Z0-9]*,")
KNOT: Final = 1852.0 / 3600.0
DAY: Final = 86_400.0


@dataclass
class _Epoch:
    """Content of the sentences of one time of day; NaN where they say nothing."""

    position: tuple[float, float, float] | None = None
    quality: int = 0
    sigmas: tuple[float, float, float] | None = None
    motion: tuple[float, float] | None = None
    day: date | None = None


@dataclass
class _Log:
    """Epochs in order, and what was noticed.

    Attributes
    ----------
    talker : str
        Whose positions are read; empty for the only one.
    kept : frozenset of int
        Qualities of `NO_FIXES` that are read as well.
    talkers, no_fixes : Counter
        Sentences with a position by talker; those left out by quality.
    """

    talker: str = ""
    kept: frozenset[int] = frozenset()
    talkers: Counter[str] = field(default_factory=Counter)
    no_fixes: Counter[int] = field(default_factory=Counter)
    epochs: dict[tuple[int, float], _Epoch] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)
    days: int = 0
    last: float = -1.0

    def at(self, text: str) -> _Epoch:
        """Return the epoch of a time of day, `hhmmss.ss`; times that fall by half a day are of the next."""
        time = int(text[:2]) * 3600.0 + int(text[2:4]) * 60.0 + float(text[4:])
        if time < self.last - DAY / 2.0:
            self.days += 1
        self.last = time
        return self.epochs.setdefault((self.days, time), _Epoch())


NO_FIXES: Final = {6: "dead reckoning", 7: "typed in", 8: "simulated"}
"""Qualities of GGA that are positions and no fixes."""


def open_nmea(path: Path, topic: str | None = None) -> LogTable:
    """Read a log: positions of GGA with what GST and RMC say of the same time.

    Parameters
    ----------
    topic : str, optional
        The talker, such as GP or GN, whose positions are read; "+6" behind it keeps those of quality 6 (dead
        reckoning), which are no fixes and are left out, as are 7 and 8.

    Altitudes are above the ellipsoid: that of GGA and its separation of the geoid. Sentences with a wrong checksum, and
    those without a position, are left out with a note.
    """
    talker, *qualities = (topic or "").split("+")
    if not all(quality in map(str, NO_FIXES) for quality in qualities):
        raise LogError(
            path, f'got "{topic}"; expected a talker such as GN, with +6, +7 or +8 behind it', "columns.topic"
        )
    log = _Log(talker, frozenset(map(int, qualities)))
    with path.open(encoding="ascii", errors="replace") as file:
        for line in file:
            _read_sentence(log, line)
    if not talker and len(log.talkers) > 1:
        counted = " and ".join(f"{name} ({count:,})" for name, count in log.talkers.most_common())
        choices = " or ".join(f'"{name}"' for name in log.talkers)
        raise LogError(
            path, f"has positions of several talkers, {counted}; name one: columns = {{ topic = {choices} }}"
        )
    kept = {key: epoch for key, epoch in log.epochs.items() if epoch.position is not None and epoch.quality > 0}
    if not kept:
        raise LogError(path, "; ".join(["has no GGA sentence with a position", *_left_out(log)]))
    epochs = list(kept.values())
    time, note = _times(list(kept), epochs)
    columns = {"time": time}
    position = np.array([epoch.position for epoch in epochs])
    columns |= dict(zip(("latitude [deg]", "longitude [deg]", "altitude [m]"), position.T, strict=True))
    columns["quality"] = np.array([epoch.quality for epoch in epochs], dtype=float)
    if all(epoch.sigmas is not None for epoch in epochs):
        sigmas = np.array([epoch.sigmas for epoch in epochs])
        columns |= dict(zip(("sigma_north [m]", "sigma_east [m]", "sigma_down [m]"), sigmas.T, strict=True))
    if all(epoch.motion is not None for epoch in epochs):
        motion = np.array([epoch.motion for epoch in epochs])
        columns |= dict(zip(("speed [m/s]", "course [deg]"), motion.T, strict=True))
    return table_of(path, columns, {"time": "s"}, (note, *_notes(log, kept, epochs)))


def _read_sentence(log: _Log, line: str) -> None:
    result = SENTENCE.search(line)
    if result is None:
        return
    kind, body = result[2], result[3]
    if result[4] is not None:
        checksum = reduce(lambda total, sign: total ^ ord(sign), f"{result[1]}{kind},{body}", 0)
        if checksum != int(result[4], 16):
            log.counts["checksum"] += 1
            return
    else:
        log.counts["without"] += 1
    cells = body.strip().split(",")
    try:
        if kind == "GGA":
            _read_gga(log, cells, result[1])
        elif kind == "GST":
            _read_gst(log, cells)
        else:
            _read_rmc(log, cells)
    except (ValueError, IndexError):
        log.counts["unreadable"] += 1


def _angle(text: str, hemisphere: str) -> float:
    """Return an angle in deg from degrees and minutes.

    >>> _angle("4807.038", "N"), _angle("01131.000", "W")
    (48.1173, -11.516666666666667)
    """
    degrees, _, fraction = text.partition(".")
    minutes = float(f"{degrees[-2:]}.{fraction or 0}")
    return (int(degrees[:-2]) + minutes / 60.0) * (-1.0 if hemisphere in "SW" else 1.0)


def _read_gga(log: _Log, cells: list[str], talker: str) -> None:
    if not cells[5] or int(cells[5]) == 0:
        log.counts["no fix"] += 1
        return
    log.talkers[talker] += 1
    if log.talker and talker != log.talker:
        log.counts["other"] += 1
        return
    if int(cells[5]) in NO_FIXES and int(cells[5]) not in log.kept:
        log.no_fixes[int(cells[5])] += 1
        return
    latitude, longitude = _angle(cells[1], cells[2]), _angle(cells[3], cells[4])
    separation = float(cells[10]) if cells[10] else 0.0
    if not cells[10]:
        log.counts["sea level"] += 1
    altitude = float(cells[8]) + separation
    epoch = log.at(cells[0])
    epoch.position, epoch.quality = (latitude, longitude, altitude), int(cells[5])


def _read_gst(log: _Log, cells: list[str]) -> None:
    north, east, up = (float(cell) for cell in cells[5:8])
    log.at(cells[0]).sigmas = (north, east, up)


def _read_rmc(log: _Log, cells: list[str]) -> None:
    epoch = log.at(cells[0])
    if cells[8]:
        epoch.day = datetime.strptime(cells[8], "%d%m%y").replace(tzinfo=UTC).date()
    if cells[1] == "A" and cells[6]:
        epoch.motion = (float(cells[6]) * KNOT, float(cells[7] or 0.0))


def _times(keys: list[tuple[int, float]], epochs: list[_Epoch]) -> tuple[Array, str]:
    """Return times in s since 1970, or of the day where no sentence has a date."""
    time = np.array([days * DAY + seconds for days, seconds in keys])
    dated = next((place for place, epoch in enumerate(epochs) if epoch.day is not None), None)
    if dated is None:
        return time, "no RMC sentence has a date: times are seconds of the day, UTC"
    day = epochs[dated].day
    assert day is not None
    first = (day - date(1970, 1, 1)).days - keys[dated][0]
    return time + first * DAY, "times are UTC, s since 1970-01-01"


def _left_out(log: _Log) -> list[str]:
    """Say which positions are no fixes, and how they are kept."""
    return [
        f"{rows(count)} of quality {quality} ({NO_FIXES[quality]}) left out: no fixes; columns = {{ topic = "
        f'"{log.talker}+{quality}" }} keeps them'
        for quality, count in sorted(log.no_fixes.items())
    ]


def _notes(log: _Log, kept: dict[tuple[int, float], _Epoch], epochs: list[_Epoch]) -> tuple[str, ...]:
    notes = _left_out(log)
    for count, words in (
        (log.counts["checksum"], "of a wrong checksum left out"),
        (log.counts["unreadable"], "left out, not to be read"),
        (log.counts["no fix"], "without a position left out"),
        (log.counts["without"], "without a checksum"),
        (log.counts["other"], "of other talkers left out"),
    ):
        if count:
            notes.append(f"{count:,} sentence{'' if count == 1 else 's'} {words}")
    if log.counts["sea level"]:
        notes.append(f"{rows(log.counts['sea level'])} without a separation of the geoid: altitudes above sea level")
    if 0 < sum(epoch.sigmas is None for epoch in epochs) < len(epochs):
        notes.append("sigmas (GST) are missing at some times, and are not used")
    return tuple(notes)
