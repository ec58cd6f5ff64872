"""Recorded flights: read from files, and written as such from a simulated sample."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.config.read import Campaign
from mcnav.contract.recorded import MeasurementFile, RecordedMeasurements, RecordedTrack, Recording
from mcnav.contract.scenario import RecordingScenario, can_be_recorded
from mcnav.errors import CampaignError, Problem, suggestion
from mcnav.files.lines import place_of_row
from mcnav.files.whole import write_texts
from mcnav.logs.imu_log import read_imu_log, remark_on_axes
from mcnav.logs.log_error import LogError
from mcnav.logs.tables import read_table
from mcnav.logs.track import Track, read_track
from mcnav.physics.units import UnitError, conversion
from mcnav.runner.draws import DrawPlan

if TYPE_CHECKING:
    import pandas as pd

IMU, REFERENCE, START = "imu.csv", "reference.csv", "start.csv"

ANGLES: Final = ("roll", "pitch", "heading")
POSITION: Final = ("latitude", "longitude", "altitude")
LEVEL: Final = ("north", "east", "down")

COLUMNS: Final[Mapping[str, tuple[tuple[str, str], ...]]] = {
    "position": (("latitude", "rad"), ("longitude", "rad"), ("altitude", "m")),
    "velocity": tuple((f"velocity_{axis}", "m/s") for axis in LEVEL),
    "altitude": (("altitude", "m"),),
    "attitude": tuple((name, "rad") for name in ANGLES),
    "body_velocity": tuple((f"velocity_{axis}", "m/s") for axis in "xyz"),
    "heading": (("heading", "rad"),),
}
"""Columns of a recorded quantity and their SI units."""

SIGMAS: Final[Mapping[str, tuple[tuple[str, str], ...]]] = {
    "position": tuple((f"sigma_{axis}", "m") for axis in LEVEL),
    "velocity": tuple((f"velocity_sigma_{axis}", "m/s") for axis in LEVEL),
}
"""Columns of the sigmas of a quantity."""


@dataclass(frozen=True)
class RecordingFiles:
    """Files of a recorded flight, by their paths, which may be given as text.

    Attributes
    ----------
    measurements : mapping of str to Path
        By the names of the sensors; those of the campaign's logs are read as well.
    columns, units : mapping of str to str
        Of the readings, as `read_imu_log` takes them.
    begin, end : float or None
        Part of the record that is judged, s after its first reading; by default all.

    Examples
    --------
    >>> import mcnav as mc
    >>> files = mc.RecordingFiles("imu.csv", {"gnss": "fixes.csv"}, units={"gyro": "deg/s"})
    >>> files.imu.name, sorted(files.measurements)
    ('imu.csv', ['gnss'])
    """

    imu: Path
    measurements: Mapping[str, Path] = field(default_factory=dict)
    reference: Path | None = None
    start: Path | None = None
    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    begin: float | None = None
    end: float | None = None

    def __post_init__(self) -> None:
        for name in ("imu", "reference", "start"):
            if (file := getattr(self, name)) is not None:
                object.__setattr__(self, name, Path(file))
        object.__setattr__(self, "measurements", {name: Path(file) for name, file in self.measurements.items()})


def recordable(campaign: Campaign) -> RecordingScenario:
    """Return the scenario of a campaign whose filter can be taken through recorded flights."""
    scenario = campaign.scenario
    if not can_be_recorded(scenario):
        message = 'its flights cannot be recorded; expected type = "ins" with [[aiding]] and [filter]'
        raise CampaignError([Problem(campaign.file, "scenario.type", message)])
    return scenario


def read_recording(campaign: Campaign, files: RecordingFiles) -> tuple[Recording, tuple[str, ...]]:
    """Read a recorded flight; return it and what was noticed in its files, a line each."""
    scenario = recordable(campaign)
    names = list(scenario.filter_schema.sensors) if scenario.filter_schema is not None else []
    if unknown := [name for name in files.measurements if name not in names]:
        message = f"no sensor of the campaign is named {unknown[0]!r}{suggestion(unknown[0], names)}"
        raise CampaignError([Problem("--measurements", "", message)])
    measured_in = {**scenario.logs, **{name: MeasurementFile(path) for name, path in files.measurements.items()}}
    if not measured_in:
        known = " or ".join(f"--measurements {name}=FILE" for name in names)
        raise LogError(files.imu, f'has no measurements beside it; expected {known}, or log = "FILE" in [[aiding]]')
    log = read_imu_log(files.imu, files.columns, files.units)
    if log.gyro is None or log.accelerometer is None:
        raise LogError(files.imu, "lacks gyros or accelerometers; a navigator needs both")
    notes = [f"{files.imu.name}: {note}" for note in log.notes]
    begin = files.begin or 0.0
    kept = (log.time >= begin - 0.5 * log.interval) & (log.time <= (np.inf if files.end is None else files.end))
    if np.sum(kept) < 2:
        between = f"{begin:g} to {log.time[-1] if files.end is None else files.end:g} s"
        raise LogError(files.imu, f"has no readings from {between}; it has {log.time[-1]:.6g} s")
    if begin > 0.0 and files.start is None:
        raise LogError(
            files.imu, "navigation starts within the record with --from; give its state there by --start FILE"
        )
    zero = log.start - log.interval + float(log.time[kept][0])
    ends = log.time[kept] - log.time[kept][0] + log.interval
    measurements = {}
    for name, file in measured_in.items():
        measured, noticed = _read_measurements(file, zero)
        _check_overlap(file.path, measured.times, ends, files.imu)
        measured = _part(measured, (measured.times > 0.0) & (measured.times <= ends[-1] + log.interval))
        measurements[name] = measured
        notes += noticed
    reference = start = None
    if files.reference is not None:
        track = read_track(files.reference)
        reference = _recorded_track(track, zero)
        _check_overlap(files.reference, reference.times, ends, files.imu)
        notes += [f"{files.reference.name}: {note}" for note in track.notes]
    level = scenario.start_level
    if files.start is not None:
        start = _start(files.start, zero)
        level = level if start.attitude is None else tuple(start.attitude[0, :2])
    else:
        notes.append("navigation starts where the campaign's trajectory does; --start FILE gives another state")
    gyro, force = log.gyro[kept], log.accelerometer[kept]
    if wrong := remark_on_axes(replace(log, time=log.time[kept], gyro=gyro, accelerometer=force), *level):
        raise LogError(files.imu, wrong)
    return Recording(ends, gyro, force, measurements, start, reference), tuple(notes)


def _recorded_track(track: Track, zero: float) -> RecordedTrack:
    position = np.stack([track.latitude, track.longitude, track.altitude], axis=1)
    return RecordedTrack(
        track.time + (track.start - zero), position, track.velocity, track.attitude, track.position_sigma,
        track.velocity_sigma,
    )  # fmt: skip


def moved_back(recording: Recording, delays: Mapping[str, tuple[float, float]]) -> Recording:
    """Return a recording with the stamps of sensors moved back by delays: s at the start, and s per s."""
    measurements = {}
    for name, measured in recording.measurements.items():
        start, rate = delays.get(name, (0.0, 0.0))
        measurements[name] = replace(measured, times=measured.times - start - rate * measured.times)
    return replace(recording, measurements=measurements)


def _part(measured: RecordedMeasurements, kept: NDArray[np.bool_]) -> RecordedMeasurements:
    """Return some of the rows of a sensor's measurements."""
    values, sigmas = ({name: rows[kept] for name, rows in each.items()} for each in (measured.values, measured.sigmas))
    return RecordedMeasurements(measured.times[kept], values, sigmas)


CLOCKS: Final = (
    (604_800.0, "GPS week", "seconds of the week beside seconds since 1980"),
    (3_600.0, "hour", "another time zone"),
)
"""Periods by multiples of which clocks differ, s, their names, and why."""

SINCE_1970: Final = 315_964_800.0
"""1980-01-06, in s since 1970."""


def _check_overlap(path: Path, times: Array, ends: Array, imu: Path) -> None:
    """Refuse a file whose times are not those of the readings, with what their clocks seem to differ by."""
    if times[-1] >= ends[0] and times[0] <= ends[-1]:
        return
    between = f"{times[0]:.9g} to {times[-1]:.9g} s after the first reading of {imu.name}"
    message = f"lasts from {between}, which has {ends[-1]:.6g} s; both must have the same clock"
    raise LogError(path, message + _clocks(times, float(ends[-1])), "time")


def _clocks(times: Array, last: float) -> str:
    """Say by what two clocks differ, where the tracks would lie on each other without it."""
    middle = 0.5 * (float(times[0]) + float(times[-1]) - last)
    allowed = 0.5 * abs(float(times[-1] - times[0]) - last) + 30.0
    if abs(abs(middle) - SINCE_1970) < allowed + 30.0:
        return ": one counts from 1970, the other from 1980 (GPS)"
    for period, name, why in CLOCKS:
        count = round(abs(middle) / period)
        if count and abs(abs(middle) - count * period) < min(allowed, 0.1 * period):
            return f"; they differ by {count:,} {name}{'' if count == 1 else 's'}: {why}"
    return ""


def _read_measurements(file: MeasurementFile, zero: float) -> tuple[RecordedMeasurements, list[str]]:
    """Read the measurements of a sensor: a track, or a table with the columns of `COLUMNS`."""
    path = file.path
    try:
        track = read_track(path, file.columns, file.units)
    except LogError:
        named = _by_plain_name(read_table(path))
        if "latitude" in named or file.columns:
            raise
        return _tabulated(path, named, zero), []
    recorded = _recorded_track(track, zero)
    values = {"position": recorded.position, "altitude": recorded.position[:, 2:]}
    if track.velocity is not None:
        values["velocity"] = track.velocity
    if track.attitude is not None:
        values |= {"attitude": track.attitude, "heading": track.attitude[:, 2:]}
    sigmas = {}
    if track.position_sigma is not None:
        sigmas = {"position": track.position_sigma, "altitude": track.position_sigma[:, 2:]}
    if track.velocity_sigma is not None:
        sigmas["velocity"] = track.velocity_sigma
    return RecordedMeasurements(recorded.times, values, sigmas), [f"{path.name}: {note}" for note in track.notes]


def _by_plain_name(table: pd.DataFrame) -> dict[str, tuple[Array, str]]:
    """Return columns and their units by names without units."""
    result = {}
    for name in table.columns:
        plain, _, unit = str(name).partition("[")
        result[plain.strip().lower().replace(" ", "_")] = (table[name].to_numpy(), unit.strip(" ]"))
    return result


def _tabulated(path: Path, named: Mapping[str, tuple[Array, str]], zero: float) -> RecordedMeasurements:
    """Read quantities from columns with the names of `COLUMNS`."""
    if "time" not in named:
        raise LogError(path, "has no column time")
    values = {}
    for quantity, columns in COLUMNS.items():
        if all(name in named for name, _ in columns):
            values[quantity] = np.stack([_in_si(path, name, *named[name], unit) for name, unit in columns], axis=1)
    if not values:
        known = "; ".join(", ".join(name for name, _ in columns) for columns in COLUMNS.values())
        raise LogError(path, f"has no measurements; expected the columns {known}")
    times = _in_si(path, "time", *named["time"], "s")
    rising = np.diff(times) > 0.0
    if not np.all(rising):
        place = place_of_row(path, int(np.argmin(rising)) + 1)
        raise LogError(path, f"falls or repeats in {place}; expected rising times", "time")
    return RecordedMeasurements(times - zero, values)


def _in_si(path: Path, name: str, values: Array, unit: str, wanted: str) -> Array:
    try:
        factor = conversion(unit, wanted) if unit else 1.0
        numbers = np.asarray(values, dtype=float)
    except (UnitError, ValueError) as problem:
        raise LogError(path, str(problem), name) from None
    if not np.all(np.isfinite(numbers)):
        raise LogError(path, f"has no number in {place_of_row(path, int(np.argmin(np.isfinite(numbers))))}", name)
    return factor * numbers


def _start(path: Path, zero: float) -> RecordedTrack:
    """Read the state at the start: of the row nearest to it."""
    named = _by_plain_name(read_table(path))
    names = [*COLUMNS["position"], *COLUMNS["velocity"], *COLUMNS["attitude"]]
    if absent := [name for name, _ in names if name not in named]:
        raise LogError(path, f"lacks {absent[0]}; the state at the start needs {', '.join(name for name, _ in names)}")
    columns = [_in_si(path, name, *named[name], unit) for name, unit in names]
    row = 0
    if "time" in named:
        row = int(np.argmin(np.abs(_in_si(path, "time", *named["time"], "s") - zero)))
    state = np.array([column[row] for column in columns])
    return RecordedTrack(np.zeros(1), state[None, :3], state[None, 3:6], state[None, 6:])


def record_sample(campaign: Campaign, index: int, interval: float) -> Recording:
    """Record one sample of a campaign, with readings over intervals, s."""
    scenario = recordable(campaign)
    if not 0 <= index < campaign.samples:
        message = f"got sample {index}; they run from 0 to {campaign.samples - 1}"
        raise CampaignError([Problem(campaign.file, "samples", message)])
    draws = DrawPlan(campaign.errors, campaign.design, campaign.seed, campaign.samples)
    errors = draws.batch(index, index + 1).errors[0]
    return scenario.simulate_recording(errors, campaign.seed, index, interval)


def write_recording(campaign: Campaign, index: int, interval: float, folder: Path) -> list[Path]:
    """Write a recorded sample: readings, measurements of each sensor, the truth as reference, the indicated start.

    Stamps are those of the ends of the readings' intervals, s after the start of navigation.
    """
    recording = record_sample(campaign, index, interval)
    axes = [f"{name}_{axis}" for name in ("gyro", "accelerometer") for axis in "xyz"]
    units = ["rad/s"] * 3 + ["m/s^2"] * 3
    readings = np.column_stack([recording.ends, recording.gyro, recording.accelerometer])
    texts = {IMU: _csv(["time [s]", *(f"{a} [{u}]" for a, u in zip(axes, units, strict=True))], readings)}
    for name, measured in recording.measurements.items():
        columns, values = ["time [s]"], [measured.times[:, None]]
        of_quantities = [(COLUMNS[quantity], value) for quantity, value in measured.values.items()]
        of_quantities += [(SIGMAS[quantity], sigma) for quantity, sigma in measured.sigmas.items()]
        for names, each in of_quantities:
            columns += [f"{column} [{unit}]" for column, unit in names]
            values.append(each)
        texts[f"{name}.csv"] = _csv(columns, np.concatenate(values, axis=1))
    for file, track in ((REFERENCE, recording.reference), (START, recording.start)):
        if track is not None:
            texts[file] = _csv(*_columns_of(track))
    return write_texts(folder, texts)


def _columns_of(track: RecordedTrack) -> tuple[list[str], Array]:
    names, values = ["time [s]"], [track.times[:, None]]
    for quantity, each in (("position", track.position), ("velocity", track.velocity), ("attitude", track.attitude)):
        if each is not None:
            names += [f"{name} [{unit}]" for name, unit in COLUMNS[quantity]]
            values.append(each)
    return names, np.concatenate(values, axis=1)


def _csv(names: Sequence[str], values: Array) -> str:
    return "\n".join(_rows(names, values)) + "\n"


def _rows(names: Sequence[str], values: Array) -> Iterator[str]:
    yield ",".join(names)
    for row in values:
        yield ",".join(f"{value:.15g}" for value in row)
