"""The reproduction of "The Story of 84 Minutes" as one HTML page and CSV files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
import pandas as pd
from markupsafe import Markup

from mcnav.report.numbers import number
from mcnav.report.page import filled
from mcnav.report.svg import FLOWN, INK, LINEAR, MUTED, STYLE, new, svg
from mcnav.reproduce import story_curves
from mcnav.reproduce.story_of_84_minutes import Number, Standing, all_numbers

TITLE: Final = "The Story of 84 Minutes"

KINDS: Final = {Standing.DIGITS: "digits", Standing.SLIDE_RULE: "tolerance", Standing.MISPRINT: "inconsistent"}
"""Classes of the style sheet."""

PHRASES: Final = {
    Standing.DIGITS: "agree to the printed digits",
    Standing.SLIDE_RULE: "agree to a slide rule's accuracy",
    Standing.MISPRINT: "are misprinted or miscalculated",
}

SHOWN: Final = {
    "tilt": "A platform 0.01 deg out of level",
    "launch velocity": "A launch velocity 1 ft/s off",
    "accelerometer": "An accelerometer 1e-4 g off",
    "gyro drift": "A gyro that drifts 0.01 deg/h",
    "azimuth": "A launch 0.01 deg off in azimuth (across the track)",
    "roll tilt": "A platform 0.01 deg out of level in roll (across the track)",
}


def table(numbers: Sequence[Number]) -> pd.DataFrame:
    """One row a printed number."""
    return pd.DataFrame(
        [
            {
                "place": each.place,
                "quantity": each.quantity,
                "unit": each.unit,
                "printed": each.printed,
                "formula": each.formula,
                "closed form": each.closed,
                "linear": each.linear,
                "flown at rest": each.flown,
                "flown cruising": each.cruising,
                "standing": each.standing.value,
                "remark": each.remark,
            }
            for each in numbers
        ]
    )


def _error_figure(name: str, curves: pd.DataFrame) -> str:
    """One error: flat against spherical, and the spherical one with what was flown."""
    known = curves[curves["error"] == name]
    time = known["time [min]"]
    key = name.replace(" ", "-")
    with mpl.rc_context(STYLE):
        figure, axes_array = new(9.0, 2.9, 1, 2)
        both, close = axes_array[0]
        both.plot(time, known["flat earth [ft]"] / 1e3, color=MUTED, label="flat earth")
        both.plot(time, known["spherical earth [ft]"] / 1e3, color=LINEAR, label="spherical earth")
        both.set(xlabel="time (min)", ylabel="position error (1000 ft)", title="Closed forms")
        close.plot(time, known["spherical earth [ft]"], color=LINEAR, label="closed form, spherical")
        if name != "azimuth":
            dots = known["flown at rest [ft]"][::4]
            close.plot(time[::4], dots, "o", color=INK, markersize=3.5, label="flown at rest")
        moving = known["flown cruising, level platform [ft]"]
        close.plot(time, moving, color=FLOWN, linewidth=1.1, label="flown cruising")
        inertial = known["flown cruising, inertial platform [ft]"]
        if np.abs(inertial - moving).max() > 0.01 * np.abs(moving).max():
            close.plot(time, inertial, "--", color=FLOWN, linewidth=1.1, label="the same, inertial platform")
        close.set(xlabel="time (min)", ylabel="position error (ft)", title="Flown, with no formula put in")
        both.legend(fontsize=8)
        close.legend(fontsize=8)
        return svg(figure, key, SHOWN[name], "Position error over two periods, by closed forms and flown.")


def _period_figure(periods: pd.DataFrame, climb: pd.DataFrame) -> str:
    with mpl.rc_context(STYLE):
        figure, axes_array = new(9.0, 2.9, 1, 2)
        speed, rising = axes_array[0]
        share = np.linspace(0.0, 0.985, 200)
        still = periods["2 pi sqrt(r / g_eff) [min]"][0]
        speed.plot(share, still / np.sqrt(1.0 - share**2), color=LINEAR, label="2π √(r / g_eff)")
        measured = periods["period along the track, flown [min]"]
        speed.plot(np.sqrt(periods["V^2 / g r"]), measured, "o", color=FLOWN, label="measured on flights")
        speed.set(xlabel="speed / orbital speed", ylabel="period (min)", title="Level flight", ylim=(0.0, None))
        speed.legend(fontsize=8)
        rising.plot(climb["time [s]"], climb["period [min]"], "o-", color=FLOWN, markersize=3.5)
        rising.set(xlabel="time of climb (s)", ylabel="period (min)", title="A climb with nine times gravity as thrust")
        rising.set_ylim(bottom=0.0)
        return svg(figure, "periods", "The period of the pendulum", "Measured periods against speed and along a climb.")


def _hover_figure(growth: pd.DataFrame, departure: pd.DataFrame) -> str:
    with mpl.rc_context(STYLE):
        figure, axes_array = new(9.0, 2.9, 1, 2)
        time, size = axes_array[0]
        at = growth["time [min]"]
        time.plot(at, growth["closed form, 1e-4 g [mi]"], color=LINEAR, label="closed form")
        time.plot(at, growth["flown, +1e-04 g [mi]"], color=FLOWN, label="flown, pushed up")
        time.plot(at, -growth["flown, -1e-04 g [mi]"], "--", color=FLOWN, label="flown, pushed down (sign reversed)")
        time.set(xlabel="time (min)", ylabel="height error (miles)", title="An accelerometer 1e-4 g off")
        time.legend(fontsize=8)
        for name, style in (("pushed up", "-"), ("pushed down", "--")):
            size.plot(departure["error [g]"], departure[f"{name}, flown / linear"], style, color=FLOWN, label=name)
        size.axhline(1.0, color=LINEAR, linewidth=1.0)
        size.set_xscale("log")
        size.xaxis.set_major_formatter(lambda value, _: f"{value:.0e}")
        size.set(xlabel="accelerometer error (g)", ylabel="flown / linear", title="After 84 minutes")
        size.legend(fontsize=8)
        return svg(figure, "hover", "Hovering without an altimeter", "Height error over time and against its cause.")


def _shown(each: Number) -> dict[str, Any]:
    """A number for the template: one digit more than printed."""

    def text(value: float | None) -> str:
        if value is None:
            return ""
        if "e" in each.printed:
            return f"{value:,.0f}"
        decimals = len(each.printed.partition(".")[2]) + 1
        return f"{value:,.{decimals}f}".replace("-", "−") if abs(value) >= 0.5 * 10.0**-decimals else "0"

    return {
        "place": each.place,
        "quantity": each.quantity,
        "unit": "" if each.unit == "1" else each.unit,
        "printed": each.printed,
        "formula": each.formula,
        "closed": text(each.closed),
        "linear": text(each.linear),
        "flown": text(each.flown),
        "cruising": text(each.cruising),
        "kind": KINDS[each.standing],
        "standing": each.standing.value,
        "remark": each.remark,
    }


def write(folder: Path) -> list[Path]:
    """Write the page and its tables into a folder; the paths written, the page first."""
    numbers, curves, periods = all_numbers(), story_curves.curves(), story_curves.periods()
    climb, growth = story_curves.climb(), story_curves.hover_growth()
    departure = story_curves.hover_departure()
    tables = {
        "numbers.csv": table(numbers),
        "curves.csv": curves,
        "periods.csv": periods,
        "climb.csv": climb,
        "hover.csv": growth,
        "hover_departure.csv": departure,
    }
    figures = [(SHOWN[name], Markup(_error_figure(name, curves))) for name in SHOWN]
    counted = Counter(each.standing for each in numbers)
    across, expected = story_curves.across()
    page = filled(
        "story.html",
        title=TITLE,
        total=len(numbers),
        counts=[(PHRASES[standing], counted[standing]) for standing in Standing if counted[standing]],
        misprints=[_shown(each) for each in numbers if each.standing is Standing.MISPRINT],
        numbers=[_shown(each) for each in numbers],
        figures=figures,
        periods=Markup(_period_figure(periods, climb)),
        largest_gap=f"{periods['difference, share'].abs().max():.0e}",
        cruising=number(float(periods["period along the track, flown [min]"][1]), 5),
        across=number(across, 5),
        expected_across=number(expected, 5),
        correction=f"{100.0 * periods['V^2 / g r'][1]:.2f}",
        hover=Markup(_hover_figure(growth, departure)),
        tables=list(tables),
    )
    folder.mkdir(parents=True, exist_ok=True)
    written = [folder / "story.html"]
    written[0].write_text(page, encoding="utf-8")
    for name, frame in tables.items():
        frame.to_csv(folder / name, index=False)
        written.append(folder / name)
    return written
