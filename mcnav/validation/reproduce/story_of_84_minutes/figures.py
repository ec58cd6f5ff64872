"""Figures, drawn from the tables of `mcnav.validation.reproduce.story_of_84_minutes.curves`."""

from __future__ import annotations

from typing import Final

import numpy as np
import pandas as pd

from mcnav.report.drawing.figure import Figure
from mcnav.report.drawing.marks import Axis, Line, Mark, Panel, Points, Rule, Series, numbered
from mcnav.report.drawing.palette import FLOWN, INK, LINEAR, MUTED
from mcnav.report.format import number
from mcnav.validation.reproduce.story_of_84_minutes.reduction import CLAIMED

TITLES: Final = {
    "tilt": "Platform tilt of 0.01 deg",
    "launch velocity": "Launch velocity error of 1 ft/s",
    "accelerometer": "Accelerometer error of 10⁻⁴ g",
    "gyro drift": "Gyro drift of 0.01 deg/h",
    "azimuth": "Launch azimuth error of 0.01 deg (cross-range)",
    "roll tilt": "Platform roll tilt of 0.01 deg (cross-range)",
}
"""Titles of the error plots."""

FLAT: Final = Series("flat", "closed form, flat earth", MUTED, "dotted")
SPHERICAL: Final = Series("spherical", "closed form, spherical earth", LINEAR)
AT_REST: Final = Series("rest", "simulated at rest", FLOWN, "dot")
CRUISING: Final = Series("cruising", "simulated cruising", FLOWN, "dashed")
INERTIAL: Final = Series("inertial", "simulated cruising, inertial platform", FLOWN, "dashdot")

CLOSED: Final = Series("closed", "closed form", LINEAR)
UP: Final = Series("up", "simulated, upward", FLOWN, "dashed")
DOWN: Final = Series("down", "simulated, downward (sign reversed)", FLOWN, "dashdot")

TIME: Final = Axis("time", "min", margin=0.02, link="time")

EVERY: Final = 4
"""Rows from one dot to the next."""

EVERY_POINT: Final = 10
"""Rows of the reductions from one point of a line to the next."""


def error(name: str, curves: pd.DataFrame) -> Figure:
    """Draw one error: flat and spherical closed forms, and the spherical one with simulations."""
    known = curves[curves["error"] == name]
    time, spherical = known["time [min]"], known["spherical earth [ft]"]
    resting = known["flown at rest [ft]"]
    level, inertial = (known[f"flown cruising, {platform} platform [ft]"] for platform in ("level", "inertial"))
    at_rest = name != "azimuth"  # a wrong launch direction has no effect at rest
    apart = bool(np.abs(inertial - level).max() > 0.01 * np.abs(level).max())

    closed: list[Mark] = [Line(FLAT, time, known["flat earth [ft]"] / 1e3, 2.4), Line(SPHERICAL, time, spherical / 1e3)]
    simulated: list[Mark] = [Line(SPHERICAL, time, spherical)]
    if at_rest:
        simulated.append(Points(AT_REST, time[::EVERY], resting[::EVERY], 4.7))
    simulated.append(Line(CRUISING, time, level))
    if apart:
        simulated.append(Line(INERTIAL, time, inertial))
    return Figure(
        name=f"error-{name}".replace(" ", "-"),
        title=TITLES[name],
        description="Position error over two periods, closed forms and simulations.",
        panels=[
            Panel("Closed forms", TIME, Axis("position error", "1000 ft"), closed),
            Panel("Simulation", TIME, Axis("position error", "ft"), simulated),
        ],
        key=(FLAT, SPHERICAL, *([AT_REST] if at_rest else []), CRUISING, *([INERTIAL] if apart else [])),
        columns=dict(known.drop(columns="error").items()),
        file="curves.csv",
    )


def periods(measured: pd.DataFrame) -> Figure:
    """Draw the period in level flight by speed."""
    formula = Series("closed", "2π √(r / g_eff)", LINEAR)
    points = Series("flown", "simulated", FLOWN, "dot")
    share = np.linspace(0.0, 0.985, 200)
    still = measured["2 pi sqrt(r / g_eff) [min]"][0]

    marks: list[Mark] = [
        Line(formula, share, still / np.sqrt(1.0 - share**2)),
        Points(points, np.sqrt(measured["V^2 / g r"]), measured["period along the track, flown [min]"]),
    ]
    return Figure(
        name="periods",
        title="Period in level flight",
        description="Simulated periods and closed form against speed.",
        panels=[Panel("Level flight", Axis("speed / orbital speed"), Axis("period", "min", low=0.0), marks)],
        key=(formula, points),
        columns=dict(measured.items()),
        caption="Footnote (b). Simulated periods agree with 2π √(r / g_eff) within a relative difference of "
        f"{number(float(measured['difference, share'].abs().max()), 1)}.",
        file="periods.csv",
    )


def climb(figure: pd.DataFrame) -> Figure:
    """Draw the momentary period along a climb."""
    momentary = Series("flown", "simulated", FLOWN, "dot")
    at, period = figure["time [s]"], figure["period [min]"]
    marks: list[Mark] = [Line(momentary, at, period, kind="line"), Points(momentary, at, period)]
    return Figure(
        name="climb",
        title="Period during a climb at 9 g",
        description="Momentary period against the time of climb.",
        panels=[Panel("Climb at 9 g", Axis("time of climb", "s"), Axis("period", "min", low=0.0), marks)],
        key=(),
        columns=dict(figure.items()),
        caption="Footnote (a).",
        file="climb.csv",
    )


def hover(growth: pd.DataFrame, departure: pd.DataFrame) -> tuple[Figure, Figure]:
    """Draw the height error of hovering without an altimeter, over time and relative to the linear one."""
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
            panels=[Panel("Accelerometer error of 10⁻⁴ g", TIME, Axis("height error", "miles"), over_time)],
            key=(CLOSED, UP, DOWN),
            columns=dict(growth.items()),
            caption="Gravity decreases upwards and increases downwards, so that the two errors depart from the linear "
            "cosh(√2 ωt) − 1 in opposite directions.",
            file="hover.csv",
        ),
        Figure(
            name="departure",
            title="Nonlinearity of the height error",
            description="Simulated over linear height error after 84 minutes against the accelerometer error.",
            panels=[
                Panel(
                    "After 84 minutes",
                    Axis("accelerometer error", "g", log=True),
                    Axis("simulated / linear"),
                    over_size,
                )
            ],
            key=(UP, Series("down", "simulated, downward", FLOWN, "dashdot")),
            columns=dict(departure.items()),
            file="hover_departure.csv",
        ),
    )


def reduction(frame: pd.DataFrame) -> Figure:
    """Draw the reduction by the pendulum against flight time, by error source and together."""
    names = [column.removesuffix(" [1]") for column in frame.columns[1:]]
    # every other colour: those between are paler
    alone = [name for name in names if not name.startswith("all")]
    single = [numbered(2 * place, name) for place, name in enumerate(alone)]
    together = [
        Series(name.replace(", ", "-").replace(" ", "-"), name, INK, kind)
        for name, kind in zip((name for name in names if name.startswith("all")), ("line", "dotted"), strict=True)
    ]
    at = frame["flight time [min]"][::EVERY_POINT]
    lines: list[Mark] = [
        Line(series, at, frame[f"{series.label} [1]"][::EVERY_POINT]) for series in (*single, *together)
    ]
    claimed = Rule(CLAIMED, level=True, kind="dotted", name="claimed: 100")
    reduced = Axis("flat over spherical", log=True, low=0.9, high=200.0)
    return Figure(
        name="reduction",
        title="Reduction by the pendulum",
        description="Flat-earth error over the error on a spherical earth against flight time, by error source.",
        panels=[
            Panel("Reduction by the pendulum", Axis("flight time", "min", margin=0.02), reduced, [*lines, claimed])
        ],
        key=(*single, *together),
        columns=dict(frame.items()),
        caption="The horizontal line is the claimed factor of 100, which no curve reaches. Tilt and accelerometer are "
        "nearly the same curve.",
        file="reduction.csv",
    )


def detuned(frame: pd.DataFrame) -> Figure:
    """Draw the error of the cruising missile over time by gear ratio."""
    lines = [
        (numbered(2 * place, column.removesuffix(" [mi]")), frame[column].abs())
        for place, column in enumerate(frame.columns[1:])
    ]
    marks: list[Mark] = [Line(series, frame["time [min]"][1:], error[1:]) for series, error in lines]
    return Figure(
        name="detuned",
        title="A wrong gear ratio",
        description="Size of the distance error of the cruising missile over time, by the error of the gear ratio.",
        panels=[Panel("Cruising missile", TIME, Axis("|distance error|", "miles", log=True, low=1e-3), marks)],
        key=tuple(series for series, _ in lines),
        columns=dict(frame.items()),
        caption="Simulated with an accelerometer error of 10⁻⁴ g. A tuned loop returns to zero every period.",
        file="detuned.csv",
    )
