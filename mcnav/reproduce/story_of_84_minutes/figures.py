"""The plots of "The Story of 84 Minutes" drawn from their tables (`mcnav.reproduce.story_of_84_minutes.curves`)."""

from __future__ import annotations

from typing import Final

import numpy as np
import pandas as pd

from mcnav.report.figures.figure import Figure
from mcnav.report.figures.marks import Axis, Line, Mark, Panel, Points, Rule, Series
from mcnav.report.figures.palette import FLOWN, INK, LINEAR, MUTED
from mcnav.report.format import number

TITLES: Final = {
    "tilt": "A platform 0.01 deg out of level",
    "launch velocity": "A launch velocity 1 ft/s off",
    "accelerometer": "An accelerometer 10⁻⁴ g off",
    "gyro drift": "A gyro that drifts 0.01 deg/h",
    "azimuth": "A launch 0.01 deg off in azimuth (across the track)",
    "roll tilt": "A platform 0.01 deg out of level in roll (across the track)",
}
"""Of each error plotted."""

FLAT: Final = Series("flat", "closed form, flat earth", MUTED, "dotted")
SPHERICAL: Final = Series("spherical", "closed form, spherical earth", LINEAR)
AT_REST: Final = Series("rest", "flown at rest", INK, "dot")
CRUISING: Final = Series("cruising", "flown cruising", FLOWN, "dashed")
INERTIAL: Final = Series("inertial", "flown cruising, inertial platform", FLOWN, "dashdot")

CLOSED: Final = Series("closed", "closed form", LINEAR)
UP: Final = Series("up", "flown, pushed up", FLOWN, "dashed")
DOWN: Final = Series("down", "flown, pushed down (sign reversed)", FLOWN, "dashdot")

TIME: Final = Axis("time", "min", margin=0.02, link="time")

EVERY: Final = 4
"""Rows from one dot to the next on a curve that flights lie on."""


def error(name: str, curves: pd.DataFrame) -> Figure:
    """One error: flat against spherical, and the spherical one with what was flown."""
    known = curves[curves["error"] == name]
    time, spherical = known["time [min]"], known["spherical earth [ft]"]
    resting = known["flown at rest [ft]"]
    level, inertial = (known[f"flown cruising, {platform} platform [ft]"] for platform in ("level", "inertial"))
    at_rest = name != "azimuth"  # a launch in a wrong direction takes a motion
    apart = bool(np.abs(inertial - level).max() > 0.01 * np.abs(level).max())

    closed: list[Mark] = [Line(FLAT, time, known["flat earth [ft]"] / 1e3, 2.4), Line(SPHERICAL, time, spherical / 1e3)]
    flown: list[Mark] = [Line(SPHERICAL, time, spherical)]
    if at_rest:
        flown.append(Points(AT_REST, time[::EVERY], resting[::EVERY], 4.7))
    flown.append(Line(CRUISING, time, level))
    if apart:
        flown.append(Line(INERTIAL, time, inertial))
    return Figure(
        name=f"error-{name}".replace(" ", "-"),
        title=TITLES[name],
        description="Position error over two periods, by closed forms and flown.",
        panels=[
            Panel("Closed forms", TIME, Axis("position error", "1000 ft"), closed),
            Panel("Flown, with no formula put in", TIME, Axis("position error", "ft"), flown),
        ],
        key=(FLAT, SPHERICAL, *([AT_REST] if at_rest else []), CRUISING, *([INERTIAL] if apart else [])),
        columns=dict(known.drop(columns="error").items()),
        file="curves.csv",
    )


def periods(measured: pd.DataFrame) -> Figure:
    """Draw the period in level flight against speed."""
    formula = Series("closed", "2π √(r / g_eff)", LINEAR)
    points = Series("flown", "measured on flights", FLOWN, "dot")
    share = np.linspace(0.0, 0.985, 200)
    still = measured["2 pi sqrt(r / g_eff) [min]"][0]

    marks: list[Mark] = [
        Line(formula, share, still / np.sqrt(1.0 - share**2)),
        Points(points, np.sqrt(measured["V^2 / g r"]), measured["period along the track, flown [min]"]),
    ]
    return Figure(
        name="periods",
        title="The period in level flight",
        description="Measured periods against speed, beside the closed form.",
        panels=[Panel("Level flight", Axis("speed / orbital speed"), Axis("period", "min", low=0.0), marks)],
        key=(formula, points),
        columns=dict(measured.items()),
        caption="Footnote (a). Measured periods are those of 2π √(r / g_eff) to "
        f"{number(float(measured['difference, share'].abs().max()), 1)} of themselves.",
        file="periods.csv",
    )


def climb(found: pd.DataFrame) -> Figure:
    """Draw the momentary period along a climb."""
    momentary = Series("flown", "measured along the climb", FLOWN, "dot")
    at, period = found["time [s]"], found["period [min]"]
    marks: list[Mark] = [Line(momentary, at, period, kind="line"), Points(momentary, at, period)]
    return Figure(
        name="climb",
        title="The period along a climb with nine times gravity as thrust",
        description="The momentary period against the time of climb.",
        panels=[
            Panel(
                "A climb with nine times gravity as thrust",
                Axis("time of climb", "s"),
                Axis("period", "min", low=0.0),
                marks,
            )
        ],
        key=(),
        columns=dict(found.items()),
        caption="Footnote (b).",
        file="climb.csv",
    )


def hover(growth: pd.DataFrame, departure: pd.DataFrame) -> tuple[Figure, Figure]:
    """Hovering without an altimeter: height error over time, and how far from linear it ends."""
    at = growth["time [min]"]

    over_time = [
        Line(CLOSED, at, growth["closed form, 1e-4 g [mi]"]),
        Line(UP, at, growth["flown, +1e-04 g [mi]"]),
        Line(DOWN, at, -growth["flown, -1e-04 g [mi]"]),
    ]
    over_size: list[Mark] = [
        Rule(1.0, level=True, colour=LINEAR),
        *(
            Line(series, departure["error [g]"], departure[f"{name}, flown / linear"])
            for series, name in ((UP, "pushed up"), (DOWN, "pushed down"))
        ),
    ]
    return (
        Figure(
            name="hover",
            title="Hovering without an altimeter",
            description="Height error over time, for accelerometer errors of both signs.",
            panels=[Panel("An accelerometer 10⁻⁴ g off", TIME, Axis("height error", "miles"), over_time)],
            key=(CLOSED, UP, DOWN),
            columns=dict(growth.items()),
            caption="Upwards gravity falls off, downwards it rises: the linear cosh(√2 ωt) − 1 is left in opposite "
            "directions.",
            file="hover.csv",
        ),
        Figure(
            name="departure",
            title="How far from linear the height error ends",
            description="Flown over linear height error after 84 minutes against the accelerometer's error.",
            panels=[
                Panel("After 84 minutes", Axis("accelerometer error", "g", log=True), Axis("flown / linear"), over_size)
            ],
            key=(UP, Series("down", "flown, pushed down", FLOWN, "dashdot")),
            columns=dict(departure.items()),
            file="hover_departure.csv",
        ),
    )
