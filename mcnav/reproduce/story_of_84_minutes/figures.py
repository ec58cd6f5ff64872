"""Figures, drawn from the tables of `mcnav.reproduce.story_of_84_minutes.curves`."""

from __future__ import annotations

from typing import Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from mcnav.report.figures.figure import Figure, Plot, Series, plainly
from mcnav.report.format import number
from mcnav.report.svg import FLOWN, INK, LINEAR, MUTED

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
AT_REST: Final = Series("rest", "simulated at rest", INK, "dot")
CRUISING: Final = Series("cruising", "simulated cruising", FLOWN, "dashed")
INERTIAL: Final = Series("inertial", "simulated cruising, inertial platform", FLOWN, "dashdot")

CLOSED: Final = Series("closed", "closed form", LINEAR)
UP: Final = Series("up", "simulated, upward", FLOWN, "dashed")
DOWN: Final = Series("down", "simulated, downward (sign reversed)", FLOWN, "dashdot")

EVERY: Final = 4
"""Rows from one dot to the next."""


def error(name: str, curves: pd.DataFrame) -> Figure:
    """Draw one error: flat and spherical closed forms, and the spherical one with simulations."""
    known = curves[curves["error"] == name]
    time, spherical = known["time [min]"], known["spherical earth [ft]"]
    resting = known["flown at rest [ft]"]
    level, inertial = (known[f"flown cruising, {platform} platform [ft]"] for platform in ("level", "inertial"))
    at_rest = name != "azimuth"  # a wrong launch direction has no effect at rest
    apart = bool(np.abs(inertial - level).max() > 0.01 * np.abs(level).max())

    def closed(axes: Axes) -> None:
        FLAT.on(axes, time, known["flat earth [ft]"] / 1e3, linewidth=1.8)
        SPHERICAL.on(axes, time, spherical / 1e3)
        axes.set(xlabel="time (min)", ylabel="position error (1000 ft)")

    def simulated(axes: Axes) -> None:
        SPHERICAL.on(axes, time, spherical)
        if at_rest:
            AT_REST.on(axes, time[::EVERY], resting[::EVERY], markersize=3.5)
        CRUISING.on(axes, time, level)
        if apart:
            INERTIAL.on(axes, time, inertial)
        axes.set(xlabel="time (min)", ylabel="position error (ft)")

    return Figure(
        key=f"error-{name}".replace(" ", "-"),
        title=TITLES[name],
        description="Position error over two periods, closed forms and simulations.",
        plots=[Plot("Closed forms", closed), Plot("Simulation", simulated)],
        series=(FLAT, SPHERICAL, *([AT_REST] if at_rest else []), CRUISING, *([INERTIAL] if apart else [])),
        data=known.drop(columns="error"),
        file="curves.csv",
    )


def periods(measured: pd.DataFrame) -> Figure:
    """Draw the period in level flight by speed."""
    formula = Series("closed", "2π √(r / g_eff)", LINEAR)
    points = Series("flown", "simulated", FLOWN, "dot")
    share = np.linspace(0.0, 0.985, 200)
    still = measured["2 pi sqrt(r / g_eff) [min]"][0]

    def draw(axes: Axes) -> None:
        formula.on(axes, share, still / np.sqrt(1.0 - share**2))
        points.on(axes, np.sqrt(measured["V^2 / g r"]), measured["period along the track, flown [min]"])
        axes.set(xlabel="speed / orbital speed", ylabel="period (min)", ylim=(0.0, None))

    return Figure(
        key="periods",
        title="Period in level flight",
        description="Simulated periods and closed form against speed.",
        plots=[Plot("Level flight", draw)],
        series=(formula, points),
        data=measured,
        caption="Footnote (b). Simulated periods agree with 2π √(r / g_eff) within a relative difference of "
        f"{number(float(measured['difference, share'].abs().max()), 1)}.",
        file="periods.csv",
    )


def climb(found: pd.DataFrame) -> Figure:
    """Draw the momentary period along a climb."""
    momentary = Series("flown", "simulated", FLOWN, "dot")

    def draw(axes: Axes) -> None:
        momentary.on(axes, found["time [s]"], found["period [min]"], linestyle="-")
        axes.set(xlabel="time of climb (s)", ylabel="period (min)", ylim=(0.0, None))

    return Figure(
        key="climb",
        title="Period during a climb at 9 g",
        description="Momentary period against the time of climb.",
        plots=[Plot("Climb at 9 g", draw)],
        series=(),
        data=found,
        caption="Footnote (b).",
        file="climb.csv",
    )


def hover(growth: pd.DataFrame, departure: pd.DataFrame) -> tuple[Figure, Figure]:
    """Draw the height error of hovering without an altimeter, over time and relative to the linear one."""
    at = growth["time [min]"]

    def over_time(axes: Axes) -> None:
        CLOSED.on(axes, at, growth["closed form, 1e-4 g [mi]"])
        UP.on(axes, at, growth["flown, +1e-04 g [mi]"])
        DOWN.on(axes, at, -growth["flown, -1e-04 g [mi]"])
        axes.set(xlabel="time (min)", ylabel="height error (miles)")

    def over_size(axes: Axes) -> None:
        for series, name in ((UP, "pushed up"), (DOWN, "pushed down")):
            series.on(axes, departure["error [g]"], departure[f"{name}, flown / linear"])
        axes.axhline(1.0, color=LINEAR, linewidth=1.0)
        axes.set_xscale("log")
        plainly(axes.xaxis)
        axes.set(xlabel="accelerometer error (g)", ylabel="simulated / linear")

    return (
        Figure(
            key="hover",
            title="Hovering without an altimeter",
            description="Height error over time, for accelerometer errors of both signs.",
            plots=[Plot("Accelerometer error of 10⁻⁴ g", over_time)],
            series=(CLOSED, UP, DOWN),
            data=growth,
            caption="Gravity decreases upwards and increases downwards, so that the two errors depart from the linear "
            "cosh(√2 ωt) − 1 in opposite directions.",
            file="hover.csv",
        ),
        Figure(
            key="departure",
            title="Nonlinearity of the height error",
            description="Simulated over linear height error after 84 minutes against the accelerometer error.",
            plots=[Plot("After 84 minutes", over_size)],
            series=(UP, Series("down", "simulated, downward", FLOWN, "dashdot")),
            data=departure,
            file="hover_departure.csv",
        ),
    )
