"""New campaigns of inertial navigation: any unit of the catalogue, any sensors, a trajectory of the user's or none."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.config.read import parse_campaign
from mcnav.config.templates import fill_in, place_of, write_new
from mcnav.entries.context import FileContext
from mcnav.entries.files import is_inside
from mcnav.errors import CampaignError, Problem, suggestion
from mcnav.physics.constants import STANDARD_GRAVITY
from mcnav.physics.units import conversion, quantity
from mcnav.systems.ins.earth import WGS84
from mcnav.systems.ins.scenario import Ins
from mcnav.systems.ins.sensors.aiding import Sensor
from mcnav.systems.ins.sensors.quantity import SensorType
from mcnav.systems.ins.sensors.registry import QUANTITIES, SENSOR_TYPES
from mcnav.systems.ins.sensors.velocity import MOST_SPEED
from mcnav.systems.ins.tables.imu_catalogue import ALLAN_MINIMUM, INSTABILITY, CatalogueUnit, catalogue_units
from mcnav.systems.ins.tables.instrument_tables import INSTRUMENTS
from mcnav.systems.ins.tables.trajectories import read_trajectory
from mcnav.systems.ins.tables.trajectory_file import read_trajectory_file
from mcnav.systems.ins.truth.rows import TrajectoryError, TrajectoryRows

Platform = Literal["strapdown", "inertial", "level"]

TEMPLATES: Final = "systems/ins/templates"

COMMENT: Final = 36
"""Column of the comments."""

MOST_UPDATES: Final = 3_600
"""Measurements of a sensor at its usual interval; beyond it the interval is longer."""

AT_INTERVAL: Final = """\
interval = "INTERVAL"  # between measurements, s; or instants = ["MIDDLE", "LATER"]
# begin = "MIDDLE"  # first measurement, in the trajectory's time, s; end = … is the last one
# outages = [["MIDDLE", "LATER"]]  # without measurements: begin included, end not, s
"""

AT_REST: Final = """\
instants = [INSTANTS]  # times at rest, in the trajectory's time, s
"""

LATE: Final = """\
# delay = "20 ms"  # sigma of a constant delay: how late its measurements are stamped, s
# jitter = "2 ms"  # sigma of a further delay of each measurement, s
"""

GATE: Final = """\
# gate = 0.999  # probability with which an expected measurement is accepted
"""

IN_A_ROW: Final = 5
"""Errors of sensors in a row of what a filter estimates."""

ROUND: Final = (
    1.0,
    2.0,
    5.0,
    10.0,
    15.0,
    20.0,
    30.0,
    60.0,
    80.0,
    120.0,
    150.0,
    200.0,
    300.0,
    600.0,
    1200.0,
    1800.0,
    3600.0,
)
"""Intervals and instants to choose from, s."""

LARGEST_TURN: Final = 0.3
"""Error of the attitude due to the gyros' bias, rad, at which navigation without such sensors ends."""

CONSIDERED: Final = ("scale_factor", "misalignment", "g_sensitivity", "nonlinearity")
"""Errors of the instruments besides their biases: the filter has their covariance, and does not estimate them."""

EARTH_RATE: Final = 7.292115e-5
"""rad/s."""

TILTS: Final = (0.03, 10.0)
HEADINGS: Final = (0.3, 10.0)
"""Smallest and largest initial errors of attitude, mrad."""


@dataclass(frozen=True)
class Flight:
    """Description of a trajectory as a campaign needs it.

    Attributes
    ----------
    rows : TrajectoryRows
    text : str
        Entry of the campaign file.
    longest : float
        Longest navigation along it, s.
    """

    rows: TrajectoryRows
    text: str
    longest: float = np.inf

    @property
    def first(self) -> float:
        """First time, s."""
        return float(self.rows.time[0])

    @property
    def last(self) -> float:
        """End of navigation, s."""
        return min(float(self.rows.time[-1]), self.first + self.longest)

    def resting(self) -> Array:
        """Return up to three instants at which the vehicle is at rest, whole seconds where possible, s."""
        truth, times = self.rows.truth(WGS84), self.rows.time[1:]
        times = times[times <= self.last]

        def at_rest(times: Array) -> NDArray[np.bool_]:
            return np.asarray(np.linalg.norm(truth.earth_fixed(times)[1], axis=1) <= MOST_SPEED)

        times = times[at_rest(times)]
        times = times[np.unique(np.linspace(0, len(times), 5).astype(int))[1:-1]] if len(times) > 4 else times[:3]
        whole = np.maximum(np.floor(times), self.first)
        return np.unique(np.where((whole > self.first) & at_rest(whole), whole, times))

    def at(self, share: float) -> float:
        """Return a round time after a share of the flight, s."""
        duration = self.last - self.first
        step = _below(duration / 8.0)
        return float(self.first + step * np.floor(share * duration / step))


@dataclass(frozen=True)
class NewIns:
    """A campaign to write.

    Attributes
    ----------
    imu : str
        Grade or unit of the catalogue.
    aids : sequence of str
        Types of sensors.
    trajectory : Path, optional
        Trajectory file; a flight of segments without.
    columns : mapping of str to str
        Names of its columns; see `read_trajectory_file`.
    """

    imu: str
    aids: Sequence[str] = ()
    platform: Platform = "strapdown"
    trajectory: Path | None = None
    columns: Mapping[str, str] = field(default_factory=dict)


def new_ins(name: str, folder: Path, wanted: NewIns) -> list[Path]:
    """Write a campaign of inertial navigation that runs as it stands; return the path written, in a list.

    Raises `CampaignError` when the name, the unit, the trajectory or a sensor cannot be used, or the file exists.
    """
    folder, stem = place_of(name, folder)
    path = folder / f"{stem}.toml"
    unit = _find_unit(wanted.imu)
    if unknown := [aid for aid in wanted.aids if aid not in SENSOR_TYPES]:
        raise _mistake("--aid", f"no type of sensor {unknown[0]!r}{suggestion(unknown[0], list(SENSOR_TYPES))}")
    if twice := next((aid for aid in wanted.aids if wanted.aids.count(aid) > 1), None):
        raise _mistake("--aid", f"got {twice} twice; write a second [[aiding]] table with a name of its own")
    flight = _segments(str(path)) if wanted.trajectory is None else _file(wanted.trajectory, wanted.columns, folder)
    text, times = _campaign(stem, unit, wanted, flight)
    scenario = parse_campaign(tomllib.loads(text), str(path), stem).scenario
    if isinstance(scenario, Ins) and scenario.navigation.sensors:
        text += _fault(scenario.navigation.sensors[0])
    return write_new(folder, {path.name: _aligned(text + fill_in(f"{TEMPLATES}/requirement.toml", times))})


def _below(seconds: float) -> float:
    """Return the largest round time that is not longer than another, s."""
    return max((each for each in ROUND if each <= seconds), default=seconds)


def _mistake(place: str, message: str) -> CampaignError:
    return CampaignError([Problem(place, "", message)])


def _find_unit(name: str) -> CatalogueUnit:
    units = {unit.name: unit for unit in catalogue_units()}
    if name not in units:
        raise _mistake("--imu", f"no grade or unit {name!r}{suggestion(name, list(units))}")
    return units[name]


def _segments(name: str) -> Flight:
    """Return the flight of the template."""
    text = fill_in(f"{TEMPLATES}/segments.toml", {})
    context = FileContext(name, Path())
    built = read_trajectory(tomllib.loads(text)["scenario"]["trajectory"], WGS84, context)
    if built is None:
        raise context.error()
    return Flight(built.rows, text)


def _file(path: Path, columns: Mapping[str, str], folder: Path) -> Flight:
    """Read a trajectory file, which must lie in the folder of the campaign or below it."""
    try:
        rows = read_trajectory_file(path, columns)
    except TrajectoryError as wrong:
        raise _mistake(str(path), str(wrong)) from None
    within = path.resolve().is_relative_to(folder.resolve())
    written = path.resolve().relative_to(folder.resolve()).as_posix() if within else ""
    if not within or not is_inside(written):
        remedy = f"write the campaign there with --out {path.parent}"
        raise _mistake(str(path), f"must lie in the folder of the campaign, {folder}, or below it; {remedy}")
    first, last = float(rows.time[0]), float(rows.time[-1])
    named = ", ".join(f"{name} = {_quoted(column)}" for name, column in columns.items())
    text = f"trajectory = {_quoted(written)}  # {len(rows.time):,} rows, from {_time(first)} to {_time(last)}\n"
    text += f"columns = {{ {named} }}  # names of the file's columns\n" if columns else ""
    return Flight(rows, text)


def _campaign(stem: str, unit: CatalogueUnit, wanted: NewIns, flight: Flight) -> tuple[str, dict[str, str]]:
    """Fill in the templates of the campaign, its sensors and its filter; return the text, and times by name."""
    tilt = _size(unit, "accelerometer", "m/s^2") / STANDARD_GRAVITY * 1e3
    drift = _size(unit, "gyro", "rad/s")
    heading, whole = drift / EARTH_RATE * 1e3, flight.last
    bounded = any(SENSOR_TYPES[aid].bounds_attitude for aid in wanted.aids)
    if drift * (flight.last - flight.first) > 2.0 * LARGEST_TURN and not bounded:
        flight = replace(flight, longest=_below(LARGEST_TURN / drift))
    end = f'# end = "{_time(np.floor(whole * 1e3) / 1e3)}"  # of navigation, s'
    if flight.last < whole:
        end = f'end = "{_time(flight.last)}"  # of navigation, s: the gyros turn by {LARGEST_TURN} rad'
    times = {"FIRST": _time(np.ceil(flight.first * 1e3) / 1e3), "END": end}
    times |= {"MIDDLE": _time(flight.at(0.4)), "LATER": _time(flight.at(0.6))}
    text = fill_in(
        f"{TEMPLATES}/ins.toml",
        {
            "NAME": stem,
            "SAMPLES": "1_000" if wanted.aids else "2_000",
            "TOLERANCE": "20 %" if wanted.aids else "5 %",
            "PLATFORM": wanted.platform,
            "TRAJECTORY": flight.text,
            "GRADE": unit.name,
            "TITLE": unit.title[0].lower() + unit.title[1:] if unit.title.startswith("Grade") else unit.title,
            "GYRO": _values(unit, "gyro"),
            "ACCELEROMETER": _values(unit, "accelerometer"),
            "TILT": _angle(tilt, TILTS),
            "HEADING": _angle(heading, HEADINGS),
            **times,
        },
    )
    for aid in wanted.aids:
        text += _sensor(SENSOR_TYPES[aid], flight, times)
    if wanted.aids:
        text += fill_in(f"{TEMPLATES}/filter.toml", _states(unit, wanted.aids))
    return text, times


def _fault(sensor: Sensor) -> str:
    """Write a fault of a sensor as a comment: ten times the usual error of what it measures first, amid its flight."""
    component = sensor.components[0]
    measured = QUANTITIES[component.quantity]
    size = 10.0 * measured.usual * conversion(measured.unit, measured.shown_in)
    named = f'# component = "{component.name}"  # of what it measures\n' if len(sensor.components) > 1 else ""
    begin = _time(float(sensor.times[len(sensor.times) // 2]))
    written = {"SENSOR": sensor.name, "COMPONENT": named, "BEGIN": begin, "SIZE": f"{size:.3g} {measured.shown_in}"}
    return fill_in(f"{TEMPLATES}/faults.toml", written)


def _time(seconds: float) -> str:
    return f"{seconds:.10g} s"


def _angle(size: float, limits: tuple[float, float]) -> str:
    return f"{float(f'{np.clip(size, *limits):.1g}'):g} mrad"


def _size(unit: CatalogueUnit, instrument: str, si: str) -> float:
    """Return the size of an instrument's bias, SI: the constant one, or the bias instability of a unit without."""
    table = unit.table[instrument]
    if "bias" in table:
        return quantity(table["bias"], si)
    process = table.get(INSTABILITY)
    if not isinstance(process, dict):
        return 0.0
    if "sigma" in process:
        return quantity(process["sigma"], si)
    return quantity(process["allan_minimum"], si) / ALLAN_MINIMUM


def _values(unit: CatalogueUnit, instrument: str) -> str:
    """Write the values of an instrument as comments, each with its meaning and SI unit."""
    lines = []
    for key, entry in unit.table[instrument].items():
        units = {value.key: value.unit for value in unit.values if value.instrument == instrument}
        if isinstance(entry, dict):
            written = "{ " + ", ".join(f'{name} = "{text}"' for name, text in entry.items()) + " }"
            si = " and ".join(dict.fromkeys(units[f"{key}.{name}"] for name in entry))
        else:
            written, si = f'"{entry}"', units[key]
        described = INSTRUMENTS[instrument].model_fields[key].description or key
        meaning = described.partition(":")[0].rstrip(".")
        told = meaning[0].lower() + meaning[1:] + ("" if si == "1" else f", {si}")
        lines.append(f"# {key} = {written}  # {told}\n")
    return "".join(lines)


def _sensor(kind: SensorType, flight: Flight, times: Mapping[str, str]) -> str:
    """Write the table of a sensor."""
    words = kind.words[0].lower() + kind.words[1:].rstrip(".")
    instants = AT_REST if kind.interval is None else AT_INTERVAL
    late = LATE if kind.delays else ""
    text = f'\n[[aiding]]\ntype = "{kind.name}"  # {words}\n{instants}{kind.template}{late}{GATE}'
    for before, after in {**_instants(kind, flight), **times}.items():
        text = text.replace(before, after)
    return text


def _instants(kind: SensorType, flight: Flight) -> dict[str, str]:
    """Return when a sensor measures: at an interval, or at rest."""
    duration = flight.last - flight.first
    if kind.interval is not None:
        least = max(min(kind.interval, duration / 4.0), duration / MOST_UPDATES)
        return {"INTERVAL": _time(next((each for each in ROUND if least <= each <= duration / 4.0), least))}
    chosen = flight.resting()
    if not len(chosen):
        raise _mistake("--aid", f"{kind.name} needs a vehicle at rest, and this one always moves; leave it out")
    return {"INSTANTS": ", ".join(f'"{_time(time)}"' for time in chosen.tolist())}


def _states(unit: CatalogueUnit, aids: Sequence[str]) -> dict[str, str]:
    """Return what the filter estimates, and what it considers."""
    tables = unit.table
    biases = [f"{table}_bias" for table in tables if tables[table].keys() & {"bias", INSTABILITY}]
    of_sensors = [f"{aid.replace('-', '_')}_{error}" for aid in aids for error in SENSOR_TYPES[aid].estimated]
    some = [of_sensors[first : first + IN_A_ROW] for first in range(0, len(of_sensors), IN_A_ROW)]
    rows = [["position", "velocity", "attitude"], biases, *some]
    considered = [f"{table}_{kind}" for table in tables for kind in CONSIDERED if kind in tables[table]]
    return {
        "ESTIMATES": "\n".join(f"    {_listed(row)}," for row in rows if row),
        "CONSIDERS": "".join(f"    {_listed([name])},\n" for name in considered),
    }


def _listed(names: Sequence[str]) -> str:
    return ", ".join(f'"{name}"' for name in names)


def _quoted(text: str) -> str:
    """Write a text as TOML does."""
    import tomli_w

    return tomli_w.dumps({"text": text}).partition(" = ")[2].strip()


def _aligned(text: str) -> str:
    """Align the comments behind values.

    >>> _aligned("a = 1  # first")
    'a = 1                               # first'
    """
    lines = (line.partition("  # ") for line in text.split("\n"))
    return "\n".join(
        f"{value:{COMMENT - 2}}  # {comment}" if mark else value for value, mark, comment in lines
    )  # fmt: skip
