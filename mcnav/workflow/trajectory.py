"""Description of a trajectory: of a file, or of a campaign of type ins."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.config.read import read_campaign
from mcnav.config.toml import load_file
from mcnav.contract.history import History, Panel
from mcnav.errors import CampaignError, Problem
from mcnav.physics.constants import STANDARD_GRAVITY
from mcnav.report.pages.trajectory import Extreme, TrajectoryReport
from mcnav.systems.ins.earth import WGS84
from mcnav.systems.ins.recognition import is_ins
from mcnav.systems.ins.tables.tracks import read_rows
from mcnav.systems.ins.tables.trajectory_tables import FileTable
from mcnav.systems.ins.truth.rows import TrajectoryError, TrajectoryRows, rows_from
from mcnav.systems.ins.truth.trajectory import Truth

DRAWN: Final = 2_000
"""Instants of the figures."""

BETWEEN: Final = 20_000
"""Instants, besides the rows, at which largest values are sought."""

VERTICAL: Final = 0.1
"""Angle from the vertical, deg, within which heading and roll are not drawn."""

TIME: Final = "time [s]"


def describe_file(path: Path, columns: Mapping[str, str] | None = None) -> TrajectoryReport:
    """Describe a trajectory file.

    Raises
    ------
    CampaignError
        When it cannot be read or describes no flight.
    """
    try:
        rows = read_rows(path, FileTable(file=str(path), columns=dict(columns or {})), otherwise="from-velocity").rows
    except TrajectoryError as wrong:
        raise CampaignError([Problem(str(path), "", str(wrong))]) from None
    truth = rows.truth(WGS84)
    return describe(path.name, truth, rows)


def describe_campaign(path: Path) -> TrajectoryReport:
    """Describe the trajectory of a campaign of type ins.

    Raises
    ------
    CampaignError
        When it cannot be read, or is of another type.
    """
    campaign = read_campaign(path)
    if not is_ins(campaign.scenario):
        message = "has no trajectory over the earth; expected a campaign of type ins, or a trajectory file"
        raise CampaignError([Problem(str(path), "scenario.type", message)])
    navigation = campaign.scenario.navigation
    truth, rows, name = navigation.truth, None, campaign.name
    for file in campaign.files:
        if file.setting != "trajectory":
            continue
        entries = load_file(path)["scenario"]
        entry = entries["trajectory"]
        given = entry if isinstance(entry, dict) else {"file": entry, "columns": entries.get("columns", {})}
        try:
            rows = read_rows(Path(file.path), FileTable(**given), truth.earth, file.digest).rows
        except TrajectoryError as wrong:
            raise CampaignError([Problem(str(path), "scenario.trajectory", f"{file.path}: {wrong}")]) from None
        name = f"{campaign.name}: {file.name}"
    events = {"start of navigation": navigation.start, "end of navigation": navigation.end}
    inside = {
        event: time for event, time in events.items() if not np.any(np.isclose(time, truth.times[[0, -1]], atol=1e-9))
    }
    return describe(name, truth, rows, inside)


def describe(
    name: str, truth: Truth, rows: TrajectoryRows | None = None, events: Mapping[str, float] | None = None
) -> TrajectoryReport:
    """Describe a truth.

    Parameters
    ----------
    rows : TrajectoryRows, optional
        Rows of the file that it comes from.
    events : mapping of str to float
        Instants to mark, s.
    """
    begin, end = truth.times[[0, -1]]
    disagreement = None if rows is None else rows.disagreement(truth)
    rows_only = len(truth.times) >= BETWEEN
    times = truth.times if rows_only else np.union1d(truth.times, np.linspace(begin, end, BETWEEN + 1))
    states = truth.states(times, "strapdown", float(begin))
    force, rate = (np.linalg.norm(vectors, axis=1) for vectors in (states.force, states.rate))
    latitude, longitude, altitude = truth.geodetic(times).T
    longitude = np.unwrap(longitude)
    speed = np.linalg.norm(truth.earth_fixed(times)[1], axis=1)
    heaviest, fastest = int(np.argmax(force)), int(np.argmax(rate))
    at_rows = truth.states(truth.times, "strapdown", float(begin)).force
    rough = at_rows[1:-1] - 0.5 * (at_rows[2:] + at_rows[:-2])
    shown = np.union1d(np.linspace(begin, end, DRAWN + 1), times[[heaviest, fastest]])
    return TrajectoryReport(
        name=name,
        times=truth.times,
        latitude=_range(np.degrees(latitude)),
        longitude=_range(np.degrees(longitude)),
        altitude=_range(np.round(altitude, 6)),
        speed=_range(np.round(speed, 6)),
        distance=float(np.sum(0.5 * (speed[1:] + speed[:-1]) * np.diff(times))),
        force=Extreme(float(force[heaviest]), float(times[heaviest])),
        turn_rate=Extreme(float(rate[fastest]), float(times[fastest])),
        roughness=float(np.sqrt(np.mean((rough**2).sum(axis=1)))),
        history=_history(truth, shown, dict(events or {})),
        departure=None if rows is None else round(rows.departure(truth), 6),
        disagreement=None if disagreement is None else Extreme(disagreement.largest, disagreement.time),
        disagreement_rms=None if disagreement is None else disagreement.rms,
    )


def _range(values: Array) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def _history(truth: Truth, times: Array, events: Mapping[str, float]) -> History:
    """Tabulate the flight, and arrange its diagrams: map, altitude, speed, attitude, force."""
    rows = rows_from(truth, times)
    heading, pitch, roll = np.degrees(np.unwrap(rows.angles, axis=0)).T
    first = heading[0] - heading[0] % 360.0
    vertical = np.abs(np.abs(pitch) - 90.0) < VERTICAL
    heading, roll = (np.where(vertical, np.nan, angle) for angle in (heading, roll))
    force = truth.states(times, "strapdown", float(times[0])).force / STANDARD_GRAVITY
    columns = {
        TIME: times,
        "latitude [deg]": np.degrees(rows.latitude),
        "longitude [deg]": np.degrees(np.unwrap(rows.longitude)),
        "altitude [km]": rows.altitude / 1e3,
        "speed [m/s]": np.linalg.norm(truth.earth_fixed(times)[1], axis=1),
        "heading [deg]": heading - first,
        "pitch [deg]": pitch,
        "roll [deg]": roll,
        **{f"force {axis} [g]": force[:, place] for place, axis in enumerate(("forward", "right", "down"))},
    }
    marks = tuple(events)
    panels = (
        Panel("Map", "longitude [deg]", ("latitude [deg]",)),
        Panel("Altitude", TIME, ("altitude [km]",), marks=marks),
        Panel("Speed over the earth", TIME, ("speed [m/s]",), marks=marks),
        Panel("Heading", TIME, ("heading [deg]",), marks=marks),
        Panel("Pitch and roll", TIME, ("pitch [deg]", "roll [deg]"), ("pitch", "roll"), "angle [deg]", marks=marks),
        Panel(
            "Specific force of the body", TIME, tuple(f"force {axis} [g]" for axis in ("forward", "right", "down")),
            ("forward", "right", "down"), "specific force [g]", marks=marks,
        ),
    )  # fmt: skip
    return History(columns, events, panels)
