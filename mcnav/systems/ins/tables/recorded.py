"""``log`` of ``[[aiding]]``: instants, sigmas and outages of a recorded sensor in place of an interval and one sigma.

log = "gnss.pos"
log = "gnss.csv", columns = { time = "tow", latitude = "phi", longitude = "lambda", altitude = "h" }
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.caches.recent import Recent
from mcnav.contract.recorded import MeasurementFile
from mcnav.entries.context import FileContext
from mcnav.entries.files import read_file
from mcnav.entries.inputs import InputFile
from mcnav.entries.values import SettingError
from mcnav.errors import CampaignError
from mcnav.logs.track import Instants, Track, read_instants, read_track
from mcnav.systems.ins.scenario import Navigation
from mcnav.systems.ins.sensors.quantity import SensorType
from mcnav.systems.ins.tables.instants import DECIMALS, InstantsTable, Span, same_times, seconds, within

LONG_GAP: Final = 5.0
"""Intervals without a measurement that are an outage, at whose end errors are read out."""

MOST_GAPS: Final = 20
"""Outages of a log at whose ends errors are read out, the longest ones."""

MICROSECONDS: Final = 6
"""Decimals of the difference of two time stamps, which are known to 2.4e-7 s."""

_RECENT: Final = Recent[Track | Instants](most=4)
"""Logs read last, which variations of a campaign share."""

SIGMAS: Final[Mapping[str, str]] = {
    "position": "position_sigma",
    "altitude": "position_sigma",
    "velocity": "velocity_sigma",
}
"""Parts of a track that have the sigmas of a quantity."""


@dataclass(frozen=True)
class Recorded:
    """Measurements of a sensor by a log.

    Attributes
    ----------
    file : InputFile
    times : ndarray, shape (u,)
        Instants within the navigation, in the trajectory's time, s.
    sigmas : mapping of str to ndarray, shape (u, axes)
        Sigmas of each measurement, by the name of the quantity, of those that the log has.
    outages : tuple of Span
        Gaps of the log, and the outages that the table states.
    remarks : tuple of str
        What was noticed, a clause each.
    """

    file: InputFile
    times: Array
    sigmas: Mapping[str, Array]
    outages: tuple[Span, ...]
    remarks: tuple[str, ...]

    def log_of(self, table: InstantsTable) -> MeasurementFile:
        """Return the file, as a table reads it."""
        return MeasurementFile(Path(self.file.path), table.columns, table.units, table.log_factor)

    def at(self, times: Array) -> IndexArray:
        """Return the places of some of its instants."""
        return np.searchsorted(self.times, times)


def read_recorded(
    table: InstantsTable, kind: SensorType, navigation: Navigation, origin: float, key: str, context: FileContext
) -> Recorded | None:
    """Read the log of a sensor; mistakes are added to the context.

    Parameters
    ----------
    origin : float
        Time stamp at time zero of the trajectory, s; zero of one that has none.
    """
    try:
        file = read_file(table.log, f"{key}.log", context)
        log = _read(Path(file.path), file.digest, table, kind)
    except SettingError as wrong:
        context.problem(f"{key}.log", str(wrong))
        return None
    except CampaignError as wrong:
        context.problems.extend(wrong.problems)
        return None
    stamps, remark = _in_trajectory(log, table, navigation, origin, str(table.log))
    inside = (stamps > navigation.start + same_times(navigation)) & (stamps <= navigation.end + same_times(navigation))
    for begin, end in table.outages:
        inside &= ~within(stamps, begin, end, same_times(navigation))
    if not inside.any():
        first, last = seconds(float(stamps[0])), seconds(float(stamps[-1]))
        context.problem(
            f"{key}.log", f"has no measurement from {seconds(navigation.start)} to {seconds(navigation.end)}; it has "
            f"those from {first} to {last} in the trajectory's time; log_start sets the time of the first",
        )  # fmt: skip
        return None
    places = np.flatnonzero(inside)
    sigmas = _sigmas(log, kind, table, places, key, context)
    times = np.minimum(np.round(stamps[places], DECIMALS), navigation.end)
    remarks = (*([remark] if remark else []), *(f"{table.log}: {note}" for note in log.notes))
    return Recorded(file, times, sigmas, (*table.outages, *_gaps(times, navigation)), remarks)


def _read(path: Path, digest: str, table: InstantsTable, kind: SensorType) -> Track | Instants:
    """Read positions where the sensor may take sigmas from them, and otherwise times alone."""
    given = tuple(sorted(table.columns.items())), tuple(sorted(table.units.items()))
    if any(name in SIGMAS for name in kind.quantities.values()):
        return _RECENT.get(("track", digest, *given), lambda: read_track(path, table.columns, table.units))
    return _RECENT.get(("times", digest, *given), lambda: read_instants(path, table.columns, table.units))


def _in_trajectory(
    log: Track | Instants, table: InstantsTable, navigation: Navigation, origin: float, name: str
) -> tuple[Array, str]:
    """Return the instants of a log in the trajectory's time, and what is assumed of it.

    Stamps that lie in the trajectory's time are taken as they are; the first of others is taken for its beginning.
    """
    first, last = (float(time) for time in navigation.truth.times[[0, -1]])
    if table.log_start is not None:
        return log.time + table.log_start, ""
    begin = round(log.start - origin, MICROSECONDS)
    if begin <= last and begin + float(log.time[-1]) >= first:
        return log.time + begin, ""
    return log.time + first, (
        f"{name}: its first time stamp, {log.start:.10g} s, is taken for the beginning of the trajectory at "
        f"{seconds(first)}; log_start states another"
    )


def _sigmas(
    log: Track | Instants, kind: SensorType, table: InstantsTable, places: IndexArray, key: str, context: FileContext
) -> dict[str, Array]:
    """Return the sigmas of each measurement by quantity; a mistake where one is zero."""
    result = {}
    for measured, quantity in kind.quantities.items():
        values = getattr(log, SIGMAS.get(quantity, ""), None)
        if values is None or getattr(table, measured, None) is not None:
            continue
        chosen = values[places][:, 2:] if quantity == "altitude" else values[places]
        zero = np.flatnonzero(np.any(chosen <= 0.0, axis=1))
        if len(zero):
            since = seconds(float(log.time[places[zero[0]]]))
            came = f"{table.log} has a sigma of zero {since} after its first time, one of {len(zero)}"
            context.problem(f"{key}.log", f'{came}; state a sigma instead: {measured} = "…"')
        result[quantity] = chosen * table.log_factor
    return result


def _gaps(times: Array, navigation: Navigation) -> list[Span]:
    """Return the longest gaps between measurements, from where the next one is due."""
    if len(times) < 3:
        return []
    steps = np.diff(times)
    interval = float(np.median(steps))
    gaps = np.flatnonzero(steps > LONG_GAP * interval)
    longest = np.sort(gaps[np.argsort(steps[gaps])[-MOST_GAPS:]])
    return [(float(times[place]) + interval, float(times[place + 1])) for place in longest]
