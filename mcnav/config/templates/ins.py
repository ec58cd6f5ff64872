"""New campaigns of inertial navigation: any unit of the catalogue, any sensors, a trajectory of the user's or none."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, Literal

import numpy as np

from mcnav.config.read import parse_campaign
from mcnav.config.templates import fill_in, place_of, write_new
from mcnav.config.templates.ins_flight import TEMPLATES, Flight, from_file, mistake, round_below, segments, time_text
from mcnav.config.templates.ins_tables import fault_table, filter_states, instrument_values, sensor_table
from mcnav.errors import suggestion
from mcnav.physics.constants import STANDARD_GRAVITY
from mcnav.physics.units import quantity
from mcnav.systems.ins.scenario import Ins
from mcnav.systems.ins.sensors.registry import SENSOR_TYPES
from mcnav.systems.ins.tables.imu_catalogue import ALLAN_MINIMUM, INSTABILITY, CatalogueUnit, catalogue_units

Platform = Literal["strapdown", "inertial", "level"]

COMMENT: Final = 36
"""Column of the comments."""

LARGEST_TURN: Final = 0.3
"""Error of the attitude due to the gyros' bias, rad, at which navigation without such sensors ends."""

EARTH_RATE: Final = 7.292115e-5
"""rad/s."""

TILTS: Final = (0.03, 10.0)
HEADINGS: Final = (0.3, 10.0)
"""Smallest and largest initial errors of attitude, mrad."""


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
        raise mistake("--aid", f"no type of sensor {unknown[0]!r}{suggestion(unknown[0], list(SENSOR_TYPES))}")
    if twice := next((aid for aid in wanted.aids if wanted.aids.count(aid) > 1), None):
        raise mistake("--aid", f"got {twice} twice; write a second [[aiding]] table with a name of its own")
    flight = segments(str(path)) if wanted.trajectory is None else from_file(wanted.trajectory, wanted.columns, folder)
    text, times = _campaign(stem, unit, wanted, flight)
    scenario = parse_campaign(tomllib.loads(text), str(path), stem).scenario
    if isinstance(scenario, Ins) and scenario.navigation.sensors:
        text += fault_table(scenario.navigation.sensors[0])
    return write_new(folder, {path.name: _aligned(text + fill_in(f"{TEMPLATES}/requirement.toml", times))})


def _find_unit(name: str) -> CatalogueUnit:
    units = {unit.name: unit for unit in catalogue_units()}
    if name not in units:
        raise mistake("--imu", f"no grade or unit {name!r}{suggestion(name, list(units))}")
    return units[name]


def _campaign(stem: str, unit: CatalogueUnit, wanted: NewIns, flight: Flight) -> tuple[str, dict[str, str]]:
    """Fill in the templates of the campaign, its sensors and its filter; return the text, and times by name."""
    tilt = _size(unit, "accelerometer", "m/s^2") / STANDARD_GRAVITY * 1e3
    drift = _size(unit, "gyro", "rad/s")
    heading, whole = drift / EARTH_RATE * 1e3, flight.last
    bounded = any(SENSOR_TYPES[aid].bounds_attitude for aid in wanted.aids)
    if drift * (flight.last - flight.first) > 2.0 * LARGEST_TURN and not bounded:
        flight = replace(flight, longest=round_below(LARGEST_TURN / drift))
    end = f'# end = "{time_text(np.floor(whole * 1e3) / 1e3)}"  # of navigation, s'
    if flight.last < whole:
        end = f'end = "{time_text(flight.last)}"  # of navigation, s: the gyros turn by {LARGEST_TURN} rad'
    times = {"FIRST": time_text(np.ceil(flight.first * 1e3) / 1e3), "END": end}
    times |= {"MIDDLE": time_text(flight.at(0.4)), "LATER": time_text(flight.at(0.6))}
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
            "GYRO": instrument_values(unit, "gyro"),
            "ACCELEROMETER": instrument_values(unit, "accelerometer"),
            "TILT": _angle(tilt, TILTS),
            "HEADING": _angle(heading, HEADINGS),
            **times,
        },
    )
    for aid in wanted.aids:
        text += sensor_table(SENSOR_TYPES[aid], flight, times)
    if wanted.aids:
        text += fill_in(f"{TEMPLATES}/filter.toml", filter_states(unit, wanted.aids))
    return text, times


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


def _aligned(text: str) -> str:
    """Align the comments behind values.

    >>> _aligned("a = 1  # first")
    'a = 1                               # first'
    """
    lines = (line.partition("  # ") for line in text.split("\n"))
    return "\n".join(
        f"{value:{COMMENT - 2}}  # {comment}" if mark else value for value, mark, comment in lines
    )  # fmt: skip
