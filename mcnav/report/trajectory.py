"""Description of a trajectory for the terminal and as a page."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from mcnav._types import Array
from mcnav.analysis.heading import APART, compare_with_track, heading_remark
from mcnav.constants import STANDARD_GRAVITY
from mcnav.contract.history import History
from mcnav.report.figures.flight import flight
from mcnav.report.fitted_table import FittedTable, numbers, texts
from mcnav.report.format import number
from mcnav.report.html import filled


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


def fact_rows(report: TrajectoryReport) -> list[dict[str, Any]]:
    """Tabulate the facts: what, value, unit, and when."""
    steps = np.diff(report.times)

    def row(fact: str, value: float, unit: str, time: float | None = None) -> dict[str, Any]:
        return {"fact": fact, "value": float(value), "unit": unit, "time": time}

    place = int(np.argmax(steps))
    rows = [
        row("rows", len(report.times), ""),
        row("first instant", report.times[0], "s"),
        row("last instant", report.times[-1], "s"),
        row("median step", np.median(steps), "s"),
        row("shortest step", steps.min(), "s", float(report.times[int(np.argmin(steps))])),
        row("longest step", steps[place], "s", float(report.times[place])),
        row("lowest latitude", report.latitude[0], "deg"),
        row("highest latitude", report.latitude[1], "deg"),
        row("westernmost longitude", report.longitude[0], "deg"),
        row("easternmost longitude", report.longitude[1], "deg"),
        row("lowest altitude", report.altitude[0], "m"),
        row("highest altitude", report.altitude[1], "m"),
        row("lowest speed", report.speed[0], "m/s"),
        row("highest speed", report.speed[1], "m/s"),
        row("length of the path", report.distance / 1e3, "km"),
        row("largest specific force", report.force.value / STANDARD_GRAVITY, "g", report.force.time),
        row("roughness of the force (rms)", report.roughness / STANDARD_GRAVITY, "g"),
        row("largest turn rate", math.degrees(report.turn_rate.value), "deg/s", report.turn_rate.time),
    ]
    if (compared := compare_with_track(report.history)) is not None:
        rows.append(row(f"motion with heading and track {APART:g}° apart", 100.0 * compared.apart, "%"))
    if report.departure is not None:
        rows.append(row("largest distance of rows from the spline", report.departure, "m"))
    if report.disagreement is not None and report.disagreement_rms is not None:
        rows.append(row("disagreement of the velocities (rms)", report.disagreement_rms, "m/s"))
        rows.append(
            row("largest disagreement of the velocities", report.disagreement.value, "m/s", report.disagreement.time)
        )
    return rows


def _texts(row: dict[str, Any]) -> tuple[str, str, str, str]:
    count = row["fact"] == "rows"
    value = f"{row['value']:,.0f}" if count else _plain(row["value"])
    return row["fact"], value, row["unit"], "" if row["time"] is None else _plain(row["time"])


def _plain(value: float) -> str:
    """Format a number with six digits, without zeros at its end."""
    return number(value, 6) if value != 0.0 and not 1e-4 <= abs(value) < 1e8 else f"{value:,.6g}".replace("-", "−")


def lines(report: TrajectoryReport) -> RenderableType:
    """Tabulate the facts for the terminal, with a remark on a heading that can hardly be right."""
    table = FittedTable(report.name, [*texts("trajectory"), *numbers("value"), *texts("unit"), *numbers("at, s")])
    for row in fact_rows(report):
        table.add(*_texts(row))
    remark = heading_remark(report.history)
    return Group(table, Text(remark, style="bold yellow")) if remark else table


def page(report: TrajectoryReport) -> str:
    """Render the HTML page."""
    figure = flight(report.history)
    title = f"Trajectory: {report.name}"
    return filled(
        "trajectory.html",
        name=report.name,
        remark=heading_remark(report.history),
        facts=[_texts(row) for row in fact_rows(report)],
        flight=None if figure is None else replace(figure, title=title),
    )
