"""Figures 1 to 12 of NASA TN D-1772 drawn from their tables (`mcnav.reproduce.tn_figures`)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Final

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mcnav.report.content import spoken
from mcnav.report.svg import FLOWN, INK, LINEAR, MUTED, SOURCE_COLOURS, STYLE, new, svg
from mcnav.reproduce.tn_d1772 import INITIAL_CONDITIONS
from mcnav.scenarios.reentry import OUTPUTS, SOURCES
from mcnav.scenarios.tn_d1772 import ERRORS

TIME: Final = "time from reentry (min)"
START: Final = "start of navigation (min from reentry)"
ODD, EVEN = LINEAR, FLOWN


@contextmanager
def _styled(height: float, rows: int, columns: int) -> Iterator[tuple[Figure, list[Axes]]]:
    with mpl.rc_context(STYLE):
        figure, grid = new(9.0, height, rows, columns)
        yield figure, list(grid.flat)


def _unit_of(column: str) -> str:
    """The column's name with its unit in round brackets."""
    return column.replace("[", "(").replace("]", ")")


def _mark_reentry(axes: Axes) -> None:
    axes.axvline(0.0, color=MUTED, linewidth=0.8, linestyle="--")


def _histories(frame: pd.DataFrame, panels: Sequence[Sequence[str]], key: str, title: str, about: str) -> str:
    """Columns against the first one, a panel for each group."""
    with _styled(2.5 * -(-len(panels) // 2), -(-len(panels) // 2), 2) as (figure, axes_list):
        for axes, columns in zip(axes_list, panels, strict=False):
            for number, column in enumerate(columns):
                label = column if len(columns) > 1 else None
                axes.plot(frame.iloc[:, 0], frame[column], color=(LINEAR, FLOWN)[number % 2], label=label)
            axes.set(xlabel=TIME, ylabel=_unit_of(columns[0]) if len(columns) == 1 else "")
            _mark_reentry(axes)
            if len(columns) > 1:
                axes.legend(fontsize=8)
        for axes in axes_list[len(panels) :]:
            axes.set_visible(False)
        return svg(figure, key, title, about)


def draw_1(frame: pd.DataFrame) -> str:
    """Altitude against range, the whole and the atmosphere."""
    with _styled(3.6, 1, 2) as (figure, (whole, air)):
        for number, flight in frame.groupby("trajectory"):
            colour = ODD if int(str(number)) % 2 else EVEN
            for axes in (whole, air):
                axes.plot(flight["range [km]"] / 1e3, flight["altitude [km]"], color=colour, linewidth=1.2)
            last = flight.iloc[-1]
            air.annotate(f"{number}", (last["range [km]"] / 1e3, last["altitude [km]"]), xytext=(2, -9),
                         textcoords="offset points", color=colour, fontsize=8)  # fmt: skip
        whole.set_yscale("log")
        whole.yaxis.set_major_formatter(lambda value, _: f"{value:,.10g}")
        whole.axhline(121.92, color=MUTED, linewidth=0.8, linestyle="--")
        air.set_ylim(0.0, 260.0)
        air.set_xlim(-1.5, None)
        air.plot([], [], color=ODD, label="constant L/D (odd)")
        air.plot([], [], color=EVEN, label="variable L/D (even)")
        air.legend(fontsize=8)
        for axes in (whole, air):
            axes.set(xlabel="range from 121.92 km (1000 km)", ylabel="altitude (km)")
        return svg(figure, "tn-1", "Altitude against range", "Altitude against range of the seven trajectories.")


def draw_2(frame: pd.DataFrame) -> str:
    """Position, rates, speed, angle and force."""
    panels = [
        ["altitude [km]"], ["range [km]"], ["altitude rate [km/s]"], ["range rate [km/s]"],
        ["inertial speed [km/s]", "airspeed [km/s]"],
        ["inertial flight-path angle [deg]", "flight-path angle to the air [deg]"],
        ["force per unit mass [m/s^2]"],
    ]  # fmt: skip
    return _histories(frame, panels, "tn-2", "Histories of trajectory 4", "Position, rates, speed, angle and force.")


def draw_3(frame: pd.DataFrame) -> str:
    """Error histories."""
    panels = [[column] for column in frame.columns[1:]]
    return _histories(frame, panels, "tn-3", "Error histories of trajectory 4", "Navigation errors against time.")


def draw_4(frame: pd.DataFrame) -> str:
    """Sums of absolute errors against range: rows range and altitude, columns lift laws."""
    colours = {"initial conditions": LINEAR, "equipment": FLOWN, "all": INK}
    with _styled(5.8, 2, 2) as (figure, axes_list):
        places = [(name, kind) for name in ("range", "altitude") for kind in ("constant L/D", "variable L/D")]
        for axes, (name, kind) in zip(axes_list, places, strict=True):
            own = frame[frame["kind"] == kind].sort_values("final range [km]")
            for words, colour in colours.items():
                column = f"{name}, {words} [km]"
                between, computed, printed = (
                    own[own["source"] == source] for source in ("between", "computed", "printed")
                )
                reach = "final range [km]"
                axes.plot(between[reach] / 1e3, between[column], color=colour, linewidth=1.1, label=words)
                axes.plot(computed[reach] / 1e3, computed[column], "o", color=colour, markersize=4)
                axes.plot(printed[reach] / 1e3, printed[column], "s", color=colour, markersize=8, fillstyle="none")
            axes.set(title=f"{name}, {kind}", xlabel="final range (1000 km)", ylabel=f"sum of |{name} errors| (km)")
            axes.set_ylim(bottom=0.0)
        axes_list[0].plot([], [], "s", color=MUTED, fillstyle="none", label="printed")
        axes_list[0].plot([], [], "o", color=MUTED, markersize=4, label="computed")
        axes_list[0].legend(fontsize=8)
        return svg(figure, "tn-4", "Sums of absolute errors", "Sums of absolute final errors against final range.")


def draw_5(frame: pd.DataFrame) -> str:
    """Final altitude error against initial altitude and range errors."""
    with _styled(3.4, 1, 2) as (figure, axes_list):
        for axes, (source, own) in zip(axes_list, frame.groupby("initial error in", sort=False), strict=True):
            initial = own["initial error [km]"]
            axes.plot(initial, own["final altitude error, flown [km]"], color=FLOWN, label="flown")
            axes.plot(initial, own["final altitude error, linear [km]"], "--", color=LINEAR, label="linear")
            axes.set(xlabel=f"initial {source} error (km)", ylabel="final altitude error (km)")
            axes.legend(fontsize=8)
        return svg(figure, "tn-5", "Range of linearity", "Final altitude error against initial errors.")


def draw_6_to_9(frame: pd.DataFrame, output: int) -> str:
    """Partial derivatives of an output against start time, each times the report's error; two conventions of axes."""
    shown = OUTPUTS[output]
    scale = 1e-3 if shown.shown_in == "km" else 1.0
    name = spoken(shown.name)
    start = frame.iloc[:, 0]
    partials = frame.iloc[:, 1:].to_numpy()
    count = len(SOURCES)
    with _styled(3.4, 1, 2) as (figure, (conditions, equipment)):
        for j, source in enumerate(SOURCES):
            axes = conditions if j < INITIAL_CONDITIONS else equipment
            effect = scale * ERRORS[j]
            axes.plot(start, partials[:, j] * effect, color=SOURCE_COLOURS[j], label=spoken(source.name))
            if j >= INITIAL_CONDITIONS + 2:
                axes.plot(start, partials[:, count + j] * effect, "--", color=SOURCE_COLOURS[j], linewidth=1.0)
        for axes, title in (
            (conditions, "initial conditions"),
            (equipment, "equipment (dashed: axes of the first start)"),
        ):
            axes.set(title=title, xlabel=START)
            axes.legend(fontsize=8)
            _mark_reentry(axes)
        conditions.set_ylabel(f"final {name} for the report's error ({shown.shown_in})")
        return svg(figure, f"tn-{6 + output}", f"Partial derivatives of final {name}",
                   f"Partial derivatives of final {name} against start time, times the report's errors.")  # fmt: skip


def draw_10(frame: pd.DataFrame) -> str:
    """Perigee partials in (r, r', theta'), closed form, flown without atmosphere, and trajectory 4."""
    with _styled(3.2, 1, 3) as (figure, axes_list):
        for axes, words in zip(axes_list, ("r [1]", "r' [s]", "theta' [1e6 km s/rad]"), strict=True):
            minutes = frame.iloc[:, 0]
            axes.plot(minutes, frame[f"by {words}, closed form"], color=LINEAR, label="perigee, eq. (27)")
            axes.plot(minutes[::20], frame[f"by {words}, flown without atmosphere"][::20], ".", color=INK,
                      label="flown, no atmosphere")  # fmt: skip
            axes.plot(
                minutes, frame[f"by {words}, trajectory 4"], "--", color=FLOWN, label="final altitude, trajectory 4"
            )
            axes.set(title=f"by {_unit_of(words)}", xlabel="time from 121.92 km (min)")
        figure.legend(*axes_list[0].get_legend_handles_labels(), loc="outside upper left", ncols=3)
        return svg(figure, "tn-10", "Perigee partials in r, r', theta'", "Partial derivatives of the perigee radius.")


def draw_11(frame: pd.DataFrame) -> str:
    """Perigee partials in (r, V, gamma)."""
    with _styled(2.8, 1, 3) as (figure, axes_list):
        for axes, column in zip(axes_list, ("by r [1]", "by V [s]", "by gamma [km/rad]"), strict=True):
            axes.plot(frame.iloc[:, 0], frame[column], color=LINEAR)
            axes.set(title=_unit_of(column), xlabel="time from 121.92 km (min)")
        return svg(figure, "tn-11", "Perigee partials in r, V, gamma", "Partial derivatives of the perigee radius.")


def draw_12(frame: pd.DataFrame) -> str:
    """Final altitude and range errors against start time."""
    before = frame.iloc[:, 0] <= 0.0
    with _styled(3.8, 1, 2) as (figure, axes_list):
        for axes, name in zip(axes_list, ("altitude", "range"), strict=True):
            for source in ("altitude", "gyro_drift", "bias_x", "bias_z"):
                j = next(k for k, entry in enumerate(SOURCES) if entry.name == source)
                column = np.abs(frame[f"{name} for {source} [km]"])
                axes.plot(frame.iloc[:, 0], column, color=SOURCE_COLOURS[j], label=spoken(source), linewidth=1.1)
            for words, style, colour in (("sum of |equipment|", "--", INK), ("sum of |all|", "-", INK),
                                         ("root sum square of all", "-", LINEAR)):  # fmt: skip
                column = frame[f"{name}, {words} [km]"]
                axes.plot(frame.iloc[:, 0], column, style, color=colour, label=words, linewidth=1.8)
                if words != "sum of |equipment|":
                    best = int(column[before].argmin())
                    axes.plot(frame.iloc[best, 0], column[best], "v", color=FLOWN, markersize=7)
            axes.set(title=f"final {name}", xlabel=START, ylabel=f"|{name} error| (km)")
            axes.set_ylim(bottom=0.0)
            _mark_reentry(axes)
        axes_list[0].axvspan(-30.0, -20.0, color="#eef1f4", zorder=0)
        figure.legend(*axes_list[0].get_legend_handles_labels(), loc="outside upper left", ncols=4, fontsize=8)
        return svg(figure, "tn-12", "Final errors against start time",
                   "Final altitude and range errors against start time; triangles mark the least, shaded is the start "
                   "time that the report advises.")  # fmt: skip


def draw_switching(frame: pd.DataFrame) -> str:
    """Dispersion and missed drag against the switching altitude."""
    with _styled(3.2, 1, 2) as (figure, axes_list):
        for axes, name in zip(axes_list, ("altitude", "range"), strict=True):
            shown = frame[frame["off above [km]"] >= 85.0]
            for words, style, colour in (("sigma", "--", LINEAR), ("rms", "-", FLOWN)):
                axes.plot(shown["off above [km]"], shown[f"{name}, {words} [km]"], style, color=colour,
                          label={"sigma": "dispersion", "rms": "with the drag that is missed"}[words])  # fmt: skip
            least = int(frame[f"{name}, rms [km]"].argmin())
            axes.plot(frame.iloc[least, 0], frame[f"{name}, rms [km]"][least], "v", color=INK, markersize=7)
            sigma = frame[f"{name}, sigma [km]"]
            axes.set_ylim(0.96 * sigma[shown.index].min(), 1.1 * sigma.max())
            axes.set(title=f"final {name}", xlabel="accelerometers off above (km)", ylabel="one sigma (km)")
        axes_list[0].legend(fontsize=8)
        return svg(figure, "tn-13", "Switching altitude", "Dispersion against the accelerometers' switching altitude.")
