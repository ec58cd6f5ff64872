"""Figures 1 to 12 of NASA TN D-1772, and one more, drawn from their tables (`mcnav.reproduce.tn_d1772.curves`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from mcnav.report.figures.figure import HALF, THIRD, Figure, Plot, Series, axis_label, mark, numbered, plainly
from mcnav.report.figures.start_times import START
from mcnav.report.model import humanize
from mcnav.report.svg import BAND, FLOWN, INK, LINEAR, MUTED
from mcnav.reproduce.tn_d1772.tables import INITIAL_CONDITIONS, TN_SOURCES
from mcnav.scenarios.protocol import source_labels
from mcnav.scenarios.reentry import OUTPUTS
from mcnav.scenarios.table_i import ERRORS

LABELS: Final = source_labels([source.name for source in TN_SOURCES], [output.name for output in OUTPUTS])
"""Names of the sources for people."""

TIME: Final = "time from reentry (min)"
TO_REENTRY: Final = "time from 121.92 km (min)"

ODD: Final = Series("odd", "constant L/D (odd numbers)", LINEAR)
EVEN: Final = Series("even", "variable L/D (even numbers)", FLOWN, "dashed")
ONE: Final = Series("one", "", LINEAR)
INERTIAL: Final = Series("inertial", "inertial", LINEAR)
AIR: Final = Series("air", "relative to the air", FLOWN, "dashed")
FLOWN_ERROR: Final = Series("flown", "flown", FLOWN)
LINEAR_ERROR: Final = Series("linear", "linear", LINEAR, "dashed")
LEAST: Final = Series("least", "least", INK, "triangle")


def figure_1(frame: pd.DataFrame) -> Figure:
    """Draw altitude against range, the whole and the atmosphere."""

    def draw(axes: Axes, air: bool) -> None:
        for number, flight in frame.groupby("trajectory"):
            series = ODD if int(str(number)) % 2 else EVEN
            series.on(axes, flight["range [km]"] / 1e3, flight["altitude [km]"])
            if air:
                last = flight.iloc[-1]
                axes.annotate(f"{number}", (last["range [km]"] / 1e3, last["altitude [km]"]), xytext=(2, -10),
                              textcoords="offset points", color=series.colour, fontsize=9)  # fmt: skip
        if air:
            axes.set(xlim=(-1.5, None), ylim=(0.0, 260.0))
        else:
            axes.set_yscale("log")
            plainly(axes.yaxis)
        axes.axhline(121.92, color=MUTED, linewidth=1.0, linestyle=":")
        axes.set(xlabel="range from 121.92 km (1000 km)", ylabel="altitude (km)")

    return Figure(
        key="tn-1",
        title="Altitude against range",
        description="Altitude against range of the seven trajectories.",
        plots=[
            Plot("The whole flight", partial(draw, air=False)),
            Plot("In the atmosphere, by number", partial(draw, air=True)),
        ],
        series=(ODD, EVEN),
        data=frame,
        caption="The seven trajectories. The dotted line is 121.92 km.",
        file="figure_01.csv",
    )


def _histories(axes: Axes, frame: pd.DataFrame, columns: Mapping[str, Series], label: str) -> None:
    """Draw columns against the first one, which is time."""
    for column, series in columns.items():
        series.on(axes, frame.iloc[:, 0], frame[column])
    axes.set(xlabel=TIME, ylabel=label)
    mark(axes, 0.0, "reentry")


def figure_2(frame: pd.DataFrame) -> Figure:
    """Draw position, rates, speed, angle and force."""
    groups: dict[str, dict[str, Series]] = {
        column: {column: INERTIAL}
        for column in ("altitude [km]", "range [km]", "altitude rate [km/s]", "range rate [km/s]")
    }
    groups |= {
        "speed [km/s]": {"inertial speed [km/s]": INERTIAL, "airspeed [km/s]": AIR},
        "flight-path angle [deg]": {"inertial flight-path angle [deg]": INERTIAL,
                                    "flight-path angle to the air [deg]": AIR},
        "force per unit mass [m/s^2]": {"force per unit mass [m/s^2]": INERTIAL},
    }  # fmt: skip
    return Figure(
        key="tn-2",
        title="Trajectory 4 over time",
        description="Position, rates, speed, flight-path angle and force per unit mass of trajectory 4 against time.",
        plots=[
            Plot("", partial(_histories, frame=frame, columns=columns, label=axis_label(label)))
            for label, columns in groups.items()
        ],
        series=(INERTIAL, AIR),
        data=frame,
        size=(HALF[0], 2.3),
        caption="Position, rates, speed, angle, force.",
        file="figure_02.csv",
    )


def figure_3(frame: pd.DataFrame) -> Figure:
    """Draw error histories."""
    return Figure(
        key="tn-3",
        title="Error histories of trajectory 4",
        description="Navigation errors of trajectory 4 against time, with all of the report's errors at once.",
        plots=[
            Plot("", partial(_histories, frame=frame, columns={column: ONE}, label=axis_label(column)))
            for column in frame.columns[1:]
        ],
        series=(),
        data=frame,
        size=(HALF[0], 2.3),
        caption="Navigation errors with all of the report's errors at once; the last points are run 11 of Table II(d).",
        file="figure_03.csv",
    )


def figure_4(frame: pd.DataFrame) -> Figure:
    """Draw sums of absolute errors against range: range and altitude, and lift laws."""
    kinds = {
        "initial conditions": Series("initial", "initial conditions", LINEAR, "dashed"),
        "equipment": Series("equipment", "equipment", FLOWN, "dashdot"),
        "all": Series("all", "all", INK),
    }
    printed, computed = Series("printed", "printed", MUTED, "box"), Series("computed", "computed", MUTED, "dot")
    reach = "final range [km]"

    def draw(axes: Axes, name: str, law: str) -> None:
        own = frame[frame["kind"] == law].sort_values(reach)
        for words, series in kinds.items():
            column = f"{name}, {words} [km]"
            for source, looks in (("between", series), ("computed", computed), ("printed", printed)):
                found = own[own["source"] == source]
                each = Series(looks.name, looks.label, series.colour, looks.kind)
                each.on(axes, found[reach] / 1e3, found[column])
        axes.set(xlabel="final range (1000 km)", ylabel=f"sum of |{name} errors| (km)", ylim=(0.0, None))

    return Figure(
        key="tn-4",
        title="Sums of absolute final errors against final range",
        description="Sums of absolute final range and altitude errors against the final range, of constant and "
        "variable lift-to-drag ratio; printed, computed, and on flights between.",
        plots=[
            Plot(f"{name}, {law}", partial(draw, name=name, law=law))
            for name in ("range", "altitude")
            for law in ("constant L/D", "variable L/D")
        ],
        series=(*kinds.values(), printed, computed),
        data=frame,
        caption="Squares are printed (Table III), dots computed; the lines are flights between and beyond, to 28 km "
        "altitude.",
        file="figure_04.csv",
    )


def figure_5(frame: pd.DataFrame) -> Figure:
    """Draw final altitude error against initial altitude and range errors."""

    def draw(axes: Axes, source: str) -> None:
        own = frame[frame["initial error in"] == source]
        initial = own["initial error [km]"]
        FLOWN_ERROR.on(axes, initial, own["final altitude error, flown [km]"])
        LINEAR_ERROR.on(axes, initial, own["final altitude error, linear [km]"])
        axes.set(xlabel=f"initial {source} error (km)", ylabel="final altitude error (km)")

    return Figure(
        key="tn-5",
        title="Range of linearity",
        description="Final altitude error against the initial altitude and range error, flown and linear.",
        plots=[
            Plot(f"By {source}", partial(draw, source=source)) for source in frame["initial error in"].drop_duplicates()
        ],
        series=(FLOWN_ERROR, LINEAR_ERROR),
        data=frame,
        caption="Final altitude error of trajectory 4 up to a hundred times the report's initial errors.",
        file="figure_05.csv",
    )


def figures_6_to_9(frame: pd.DataFrame, output: int) -> Figure:
    """Draw partials of an output against start time, times the report's errors; two conventions of axes."""
    shown = OUTPUTS[output]
    scale, name, count = 1e-3 if shown.shown_in == "km" else 1.0, humanize(shown.name), len(TN_SOURCES)
    start, partials = frame.iloc[:, 0], frame.iloc[:, 1:].to_numpy()
    effects = partials * scale * np.tile(ERRORS, 2)
    series = [numbered(j, label) for j, label in enumerate(LABELS)]

    def draw(axes: Axes, members: Sequence[int], first: bool) -> None:
        for j in members:
            series[j].on(axes, start, effects[:, j + first * count])
        axes.set(xlabel=START, ylabel=f"final {name} ({shown.shown_in})")
        mark(axes, 0.0, "reentry")

    equipment = range(INITIAL_CONDITIONS, count)
    return Figure(
        key=f"tn-{6 + output}",
        title=f"Partial derivatives of final {name} against start time",
        description=f"Partial derivatives of final {name} against start time, times the report's errors.",
        plots=[
            Plot("Initial conditions", partial(draw, members=range(INITIAL_CONDITIONS), first=False)),
            Plot("Equipment, axes of that start", partial(draw, members=equipment, first=False)),
            Plot("Equipment, axes of the first start", partial(draw, members=equipment, first=True)),
        ],
        series=series,
        data=frame,
        size=THIRD,
        caption="Trajectory 4; the curves are partial derivatives times the report's errors, the table has the "
        "derivatives.",
        file=f"figure_{6 + output:02}.csv",
    )


def figure_10(frame: pd.DataFrame) -> Figure:
    """Draw perigee partials in (r, r', theta'): closed form, flown without atmosphere, and trajectory 4."""
    ways = {
        "closed form": Series("closed", "perigee, eq. (27)", LINEAR),
        "flown without atmosphere": Series("flown", "perigee, flown without atmosphere", INK, "dot"),
        "trajectory 4": Series("final", "final altitude, trajectory 4", FLOWN, "dashed"),
    }

    def draw(axes: Axes, words: str) -> None:
        for way, series in ways.items():
            own = frame[:: 20 if series.kind == "dot" else 1]
            series.on(axes, own.iloc[:, 0], own[f"by {words}, {way}"])
        axes.set_xlabel(TO_REENTRY)

    columns = {"r [1]": "by r (1)", "r' [s]": "by r′ (s)", "theta' [1e6 km s/rad]": "by θ′ (10⁶ km s/rad)"}
    return Figure(
        key="tn-10",
        title="Partial derivatives of the perigee radius in r, r′ and θ′",
        description="Partial derivatives of the perigee radius in r, r′ and θ′ by closed form and by flights without "
        "atmosphere, and those of the final altitude of trajectory 4, against time.",
        plots=[Plot(title, partial(draw, words=words)) for words, title in columns.items()],
        series=list(ways.values()),
        data=frame,
        size=THIRD,
        caption="Closed forms of the appendix on the printed ellipse, a flight without atmosphere, trajectory 4's "
        "altitude.",
        file="figure_10.csv",
    )


def figure_11(frame: pd.DataFrame) -> Figure:
    """Draw perigee partials in (r, V, gamma)."""

    def draw(axes: Axes, column: str) -> None:
        ONE.on(axes, frame.iloc[:, 0], frame[column])
        axes.set_xlabel(TO_REENTRY)

    columns = {"by r [1]": "by r (1)", "by V [s]": "by V (s)", "by gamma [km/rad]": "by γ (km/rad)"}
    return Figure(
        key="tn-11",
        title="Partial derivatives of the perigee radius in r, V and γ",
        description="Partial derivatives of the perigee radius in r, V and γ against time.",
        plots=[Plot(title, partial(draw, column=column)) for column, title in columns.items()],
        series=(),
        data=frame,
        size=THIRD,
        caption="Closed forms of the appendix on the printed ellipse.",
        file="figure_11.csv",
    )


def figure_12(frame: pd.DataFrame) -> Figure:
    """Draw final altitude and range errors against start time."""
    start = frame.iloc[:, 0]
    shown = {
        j: numbered(j, LABELS[j])
        for j, source in enumerate(TN_SOURCES)
        if source.name in ("altitude", "gyro_drift", "bias_x", "bias_z")
    }
    together = {
        "sum of |equipment|": Series("equipment", "sum of |equipment|", MUTED, "dashed"),
        "sum of |all|": Series("sum", "sum of |all|", INK),
        "root sum square of all": Series("rss", "root sum square of all", INK, "dashdot"),
    }
    advised = Series("advised", "start that the report advises", BAND, "area")

    def draw(axes: Axes, name: str) -> None:
        axes.axvspan(-30.0, -20.0, color=BAND, zorder=0, gid=advised.gid)
        for j, series in shown.items():
            series.on(axes, start, np.abs(frame[f"{name} for {TN_SOURCES[j].name} [km]"]), linewidth=1.2)
        for words, series in together.items():
            column = frame[f"{name}, {words} [km]"]
            series.on(axes, start, column, linewidth=2.0)
            if "all" in words:
                best = int(column[start <= 0.0].argmin())
                LEAST.on(axes, start[best], column[best] + 0.04 * frame[f"{name}, sum of |all| [km]"].max())
        axes.set(xlabel=START, ylabel=f"|{name} error| (km)", ylim=(0.0, None))
        mark(axes, 0.0, "reentry")

    return Figure(
        key="tn-12",
        title="Final altitude and range errors against start time",
        description="Final altitude and range errors against start time, of single sources and of all; triangles "
        "point at the least up to reentry.",
        plots=[Plot(f"final {name}", partial(draw, name=name)) for name in ("altitude", "range")],
        series=(*shown.values(), *together.values(), LEAST, advised),
        data=frame,
        size=(HALF[0], 3.2),
        caption="Trajectory 4, the report's errors at whatever time navigation starts.",
        file="figure_12.csv",
    )


def figure_13(frame: pd.DataFrame) -> Figure:
    """Draw dispersion and missed drag against the switching altitude."""
    alone = Series("sigma", "dispersion", LINEAR, "dashed")
    whole = Series("rms", "with the drag that is missed", FLOWN)
    shown = frame[frame["off above [km]"] >= 85.0]

    def draw(axes: Axes, name: str) -> None:
        sigma, rms = frame[f"{name}, sigma [km]"], frame[f"{name}, rms [km]"]
        low, high = 0.96 * sigma[shown.index].min(), 1.1 * sigma.max()
        for series, values in ((whole, rms), (alone, sigma)):
            series.on(axes, shown["off above [km]"], values[shown.index])
        least = int(rms.argmin())
        LEAST.on(axes, frame.iloc[least, 0], rms[least] + 0.04 * (high - low))
        axes.set(xlabel="accelerometers off above (km)", ylabel="1σ (km)", ylim=(low, high))

    return Figure(
        key="tn-13",
        title="Switching altitude of the accelerometers",
        description="Dispersion of final altitude and range against the accelerometers' switching altitude, and the "
        "root mean square with the drag that is missed; triangles point at the least.",
        plots=[Plot(f"final {name}", partial(draw, name=name)) for name in ("altitude", "range")],
        series=(alone, whole, LEAST),
        data=frame,
        caption="Not in the report: trajectory 4 with the outputs taken as zero above an altitude, which it tried at "
        "one only.",
        file="figure_13.csv",
    )
