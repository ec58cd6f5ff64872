"""Description of a trajectory for the terminal and as a page."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mcnav.analysis.heading import APART, compare_with_track, heading_remark
from mcnav.arrays.types import Array
from mcnav.contract.history import History
from mcnav.physics.constants import STANDARD_GRAVITY
from mcnav.report.document.parts import Note, Page, Part, Section, Verdict
from mcnav.report.document.table import Column, Table, counted
from mcnav.report.figures.flight import flight
from mcnav.report.format import number

FACTS: Final = (
    "Ranges and largest values at the rows of the trajectory. Specific force and turn rate are those of the body, with "
    "gravity and the rotation of the earth."
)

ROUGHNESS: Final = (
    "Roughness: difference of the specific force at a row from the mean at its neighbours. The force is the second "
    "derivative of positions, and amplifies their noise. Where positions have few decimals, the spline keeps within "
    "one unit of the last one instead of passing through every row."
)


@dataclass(frozen=True)
class Extreme:
    """A largest value and when it occurs, s."""

    value: float
    time: float


@dataclass(frozen=True)
class TrajectoryReport:
    """Description of a trajectory.

    Attributes
    ----------
    name : str
        File, or what the trajectory is.
    times : ndarray, shape (rows,)
        s.
    latitude, longitude, altitude, speed : (float, float)
        Smallest and largest: deg, deg (continued beyond 180), m, m/s.
    distance : float
        Length of the path over the earth, m.
    force, turn_rate : Extreme
        Largest specific force, m/s^2, and inertial angular rate, rad/s, of the body.
    roughness : float
        Rms of what the specific force at a row departs from the mean of its neighbours, m/s^2: digits and noise.
    disagreement : Extreme, optional
        Largest difference of given velocities from the derivative of the positions, m/s.
    disagreement_rms : float, optional
        The same, rms.
    departure : float, optional
        Largest distance of the file's positions from the spline, m.
    """

    name: str
    times: Array
    latitude: tuple[float, float]
    longitude: tuple[float, float]
    altitude: tuple[float, float]
    speed: tuple[float, float]
    distance: float
    force: Extreme
    turn_rate: Extreme
    roughness: float
    history: History
    disagreement: Extreme | None = None
    disagreement_rms: float | None = None
    departure: float | None = None


@dataclass(frozen=True)
class FactRow:
    """A fact with its unit and, of largest and smallest values, when it is, s; as CSV and JSON have it."""

    fact: str
    value: float
    unit: str
    time: float | None = None


def fact_rows(report: TrajectoryReport) -> list[FactRow]:
    """List the facts."""
    steps = np.diff(report.times)
    shortest, longest = (float(report.times[int(find(steps))]) for find in (np.argmin, np.argmax))
    rows = [
        FactRow("rows", float(len(report.times)), ""),
        FactRow("first instant", float(report.times[0]), "s"),
        FactRow("last instant", float(report.times[-1]), "s"),
        FactRow("median step", float(np.median(steps)), "s"),
        FactRow("shortest step", float(steps.min()), "s", shortest),
        FactRow("longest step", float(steps.max()), "s", longest),
        FactRow("lowest latitude", report.latitude[0], "deg"),
        FactRow("highest latitude", report.latitude[1], "deg"),
        FactRow("westernmost longitude", report.longitude[0], "deg"),
        FactRow("easternmost longitude", report.longitude[1], "deg"),
        FactRow("lowest altitude", report.altitude[0], "m"),
        FactRow("highest altitude", report.altitude[1], "m"),
        FactRow("lowest speed", report.speed[0], "m/s"),
        FactRow("highest speed", report.speed[1], "m/s"),
        FactRow("length of the path", report.distance / 1e3, "km"),
        FactRow("largest specific force", report.force.value / STANDARD_GRAVITY, "g", report.force.time),
        FactRow("roughness of the force (rms)", report.roughness / STANDARD_GRAVITY, "g"),
        FactRow("largest turn rate", math.degrees(report.turn_rate.value), "deg/s", report.turn_rate.time),
    ]
    if (compared := compare_with_track(report.history)) is not None:
        rows.append(FactRow(f"motion with heading and track {APART:g}° apart", float(100.0 * compared.apart), "%"))
    if report.departure is not None:
        rows.append(FactRow("largest distance of rows from the spline", report.departure, "m"))
    if report.disagreement is not None and report.disagreement_rms is not None:
        largest = report.disagreement
        rows.append(FactRow("disagreement of the velocities (rms)", report.disagreement_rms, "m/s"))
        rows.append(FactRow("largest disagreement of the velocities", largest.value, "m/s", largest.time))
    return rows


def _plain(value: float | None) -> str:
    """Format a number with six digits, without zeros at its end; nothing for a missing one."""
    if value is None:
        return ""
    return number(value, 6) if value != 0.0 and not 1e-4 <= abs(value) < 1e8 else f"{value:,.6g}".replace("-", "−")


def fact_table(report: TrajectoryReport) -> Table[FactRow]:
    """Tabulate the facts."""
    columns: list[Column[FactRow]] = [
        Column("Fact", lambda row: row.fact, "trajectory", "label"),
        Column("value", lambda row: counted(row.value) if row.fact == "rows" else row.value, form=_plain),
        Column("unit", lambda row: row.unit, kind="label"),
        Column("at, s", lambda row: row.time, form=_plain),
    ]
    return Table(FACTS, columns, fact_rows(report), report.name)


def terminal(report: TrajectoryReport) -> list[Part]:
    """List what the terminal shows: the facts, with a remark on a heading that can hardly be right."""
    remark = heading_remark(report.history)
    return [fact_table(report), *([Verdict(remark, "undecided")] if remark else [])]


def page(report: TrajectoryReport) -> Page:
    """Return the page."""
    remark, figure = heading_remark(report.history), flight(report.history)
    sections = [Section("facts", "Facts", [fact_table(report), Note(ROUGHNESS)])]
    if figure is not None:
        sections.append(Section("flight", "Flight", [replace(figure, title=f"Trajectory: {report.name}")]))
    head = [Verdict(remark, "undecided")] if remark else []
    return Page(report.name, "Trajectory", report.name, head, sections)
