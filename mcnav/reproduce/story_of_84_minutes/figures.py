"""The plots of "The Story of 84 Minutes" drawn from their tables (`mcnav.reproduce.story_of_84_minutes.curves`)."""

from __future__ import annotations

from typing import Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from mcnav.report.figures.figure import Figure, Plot, Series, plainly
from mcnav.report.format import number
from mcnav.report.svg import FLOWN, INK, LINEAR, MUTED

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

    def closed(axes: Axes) -> None:
        FLAT.on(axes, time, known["flat earth [ft]"] / 1e3, linewidth=1.8)
        SPHERICAL.on(axes, time, spherical / 1e3)
        axes.set(xlabel="time (min)", ylabel="position error (1000 ft)")

    def flown(axes: Axes) -> None:
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
        description="Position error over two periods, by closed forms and flown.",
        plots=[Plot("Closed forms", closed), Plot("Flown, with no formula put in", flown)],
        series=(FLAT, SPHERICAL, *([AT_REST] if at_rest else []), CRUISING, *([INERTIAL] if apart else [])),
        data=known.drop(columns="error"),
        file="curves.csv",
    )


def periods(measured: pd.DataFrame) -> Figure:
    """The period in level flight against speed."""
    formula = Series("closed", "2π √(r / g_eff)", LINEAR)
    points = Series("flown", "measured on flights", FLOWN, "dot")
    share = np.linspace(0.0, 0.985, 200)
    still = measured["2 pi sqrt(r / g_eff) [min]"][0]

    def draw(axes: Axes) -> None:
        formula.on(axes, share, still / np.sqrt(1.0 - share**2))
        points.on(axes, np.sqrt(measured["V^2 / g r"]), measured["period along the track, flown [min]"])
        axes.set(xlabel="speed / orbital speed", ylabel="period (min)", ylim=(0.0, None))

    return Figure(
        key="periods",
        title="The period in level flight",
        description="Measured periods against speed, beside the closed form.",
        plots=[Plot("Level flight", draw)],
        series=(formula, points),
        data=measured,
        caption="Footnote (a). Measured periods are those of 2π √(r / g_eff) to "
        f"{number(float(measured['difference, share'].abs().max()), 1)} of themselves.",
        file="periods.csv",
    )


def climb(found: pd.DataFrame) -> Figure:
    """The momentary period along a climb."""
    momentary = Series("flown", "measured along the climb", FLOWN, "dot")

    def draw(axes: Axes) -> None:
        momentary.on(axes, found["time [s]"], found["period [min]"], linestyle="-")
        axes.set(xlabel="time of climb (s)", ylabel="period (min)", ylim=(0.0, None))

    return Figure(
        key="climb",
        title="The period along a climb with nine times gravity as thrust",
        description="The momentary period against the time of climb.",
        plots=[Plot("A climb with nine times gravity as thrust", draw)],
        series=(),
        data=found,
        caption="Footnote (b).",
        file="climb.csv",
    )


def hover(growth: pd.DataFrame, departure: pd.DataFrame) -> tuple[Figure, Figure]:
    """Hovering without an altimeter: height error over time, and how far from linear it ends."""
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
        axes.set(xlabel="accelerometer error (g)", ylabel="flown / linear")

    return (
        Figure(
            key="hover",
            title="Hovering without an altimeter",
            description="Height error over time, for accelerometer errors of both signs.",
            plots=[Plot("An accelerometer 10⁻⁴ g off", over_time)],
            series=(CLOSED, UP, DOWN),
            data=growth,
            caption="Upwards gravity falls off, downwards it rises: the linear cosh(√2 ωt) − 1 is left in opposite "
            "directions.",
            file="hover.csv",
        ),
        Figure(
            key="departure",
            title="How far from linear the height error ends",
            description="Flown over linear height error after 84 minutes against the accelerometer's error.",
            plots=[Plot("After 84 minutes", over_size)],
            series=(UP, Series("down", "flown, pushed down", FLOWN, "dashdot")),
            data=departure,
            file="hover_departure.csv",
        ),
    )
