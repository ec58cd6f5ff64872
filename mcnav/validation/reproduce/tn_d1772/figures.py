"""Figures 1 to 12 of NASA TN D-1772, and three more, drawn from their tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import pandas as pd

from mcnav.contract.quantities import source_labels
from mcnav.report.drawing.figure import HALF, THIRD, Figure
from mcnav.report.drawing.marks import Axis, Line, Mark, Panel, Points, Rule, Series, Span, Text, axis, numbered
from mcnav.report.drawing.palette import BAND, FLOWN, INK, LINEAR, MUTED
from mcnav.report.figures.start_times import REENTRY, START
from mcnav.report.names import humanize
from mcnav.systems.reentry.outputs import DEVIATIONS
from mcnav.systems.reentry.table_i import ERRORS
from mcnav.validation.reproduce.tn_d1772.tables import INITIAL_CONDITIONS, TN_SOURCES

LABELS: Final = source_labels([source.name for source in TN_SOURCES], [output.name for output in DEVIATIONS])
"""Names of the sources for people."""

TIME: Final = axis("time from reentry [min]", margin=0.02, link=True)
TO_REENTRY: Final = axis("time from 121.92 km [min]", margin=0.02, link=True)

ODD: Final = Series("odd", "constant L/D (odd numbers)", INK)
EVEN: Final = Series("even", "variable L/D (even numbers)", MUTED, "dashed")
ONE: Final = Series("one", "", INK)
INERTIAL: Final = Series("inertial", "inertial", INK)
AIR: Final = Series("air", "relative to the air", MUTED, "dashed")
FLOWN_ERROR: Final = Series("flown", "simulated", FLOWN)
LINEAR_ERROR: Final = Series("linear", "linear", LINEAR)
LEAST: Final = Series("least", "least", INK, "triangle")

LOWEST_SHOWN, HIGHEST_SHOWN = 75.0, 130.0
"""Switching altitudes that are drawn, km: above them the curves are flat."""

SMALLEST_SHOWN: Final = 0.1
"""Errors (km) from here on are drawn."""


def figure_1(frame: pd.DataFrame) -> Figure:
    """Draw altitude against range, the whole and the atmosphere."""
    flights = [
        (ODD if int(str(number)) % 2 else EVEN, str(number), flight) for number, flight in frame.groupby("trajectory")
    ]
    lines: list[Mark] = [
        Line(series, flight["range [km]"] / 1e3, flight["altitude [km]"]) for series, _, flight in flights
    ]
    lines.append(Rule(121.92, level=True, kind="dotted"))
    numbers = [
        Text(number, last["range [km]"] / 1e3, last["altitude [km]"], colour=series.colour)
        for series, number, flight in flights
        for last in [flight.iloc[-1]]
    ]
    reach, low = "range from 121.92 km", Axis("altitude", "km", low=0.0, high=260.0)

    return Figure(
        name="tn-1",
        title="Altitude against range",
        description="Altitude against range of the seven trajectories.",
        panels=[
            Panel("The whole flight", Axis(reach, "1000 km"), Axis("altitude", "km", log=True), lines),
            Panel("In the atmosphere, by number", Axis(reach, "1000 km", low=-1.5), low, [*lines, *numbers]),
        ],
        key=(ODD, EVEN),
        columns=dict(frame.items()),
        caption="The dotted line is 121.92 km.",
        file="figure_01.csv",
    )


def _histories(frame: pd.DataFrame, columns: Mapping[str, Series], label: str) -> Panel:
    """Draw columns against the first one, which is time."""
    lines = [Line(series, frame.iloc[:, 0], frame[column]) for column, series in columns.items()]
    return Panel("", TIME, axis(label), [*lines, REENTRY])


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
        name="tn-2",
        title="Trajectory 4 over time",
        description="Position, rates, speed, flight-path angle and force per unit mass of trajectory 4 against time.",
        panels=[_histories(frame, columns, label) for label, columns in groups.items()],
        key=(INERTIAL, AIR),
        columns=dict(frame.items()),
        size=(HALF[0], 225.0),
        caption="",
        file="figure_02.csv",
    )


def figure_3(frame: pd.DataFrame) -> Figure:
    """Draw error histories."""
    return Figure(
        name="tn-3",
        title="Error histories of trajectory 4",
        description="Navigation errors of trajectory 4 against time, with all of the report's errors at once.",
        panels=[_histories(frame, {column: ONE}, column) for column in frame.columns[1:]],
        key=(),
        columns=dict(frame.items()),
        size=(HALF[0], 225.0),
        caption="Navigation errors with all of the report's errors at once; the last points are run 11 of Table II(d).",
        file="figure_03.csv",
    )


def figure_4(frame: pd.DataFrame) -> Figure:
    """Draw sums of absolute errors against range: range and altitude, and lift laws."""
    kinds = {
        "initial conditions": Series("initial", "initial conditions", MUTED, "dashed"),
        "equipment": Series("equipment", "equipment", MUTED, "dashdot"),
        "all": Series("all", "all", INK),
    }
    printed, computed = Series("printed", "printed", MUTED, "box"), Series("computed", "computed", MUTED, "dot")
    reach = "final range [km]"

    def panel(name: str, law: str) -> Panel:
        own = frame[frame["kind"] == law].sort_values(reach)
        marks: list[Mark] = []
        for words, series in kinds.items():
            column = f"{name}, {words} [km]"
            for source, looks in (("between", series), ("computed", computed), ("printed", printed)):
                result = own[own["source"] == source]
                each = Series(looks.name, looks.label, series.colour, looks.kind)
                x, y = result[reach] / 1e3, result[column]
                size = 9.0 if source == "printed" else 5.0
                marks.append(Line(each, x, y) if source == "between" else Points(each, x, y, size))
        marks.sort(key=lambda mark: -getattr(mark, "size", 99.0))
        upward = Axis(f"sum of |{name} errors|", "km", low=0.0)
        return Panel(f"{name}, {law}", Axis("final range", "1000 km"), upward, marks)

    return Figure(
        name="tn-4",
        title="Sums of absolute final errors against final range",
        description="Sums of absolute final range and altitude errors against the final range, of constant and "
        "variable lift-to-drag ratio; printed, computed, and on flights between.",
        panels=[panel(name, law) for name in ("range", "altitude") for law in ("constant L/D", "variable L/D")],
        key=(*kinds.values(), printed, computed),
        columns=dict(frame.items()),
        caption="Squares are printed (Table III), dots computed; the lines are flights between and beyond, to 28 km "
        "altitude.",
        file="figure_04.csv",
    )


def figure_5(frame: pd.DataFrame) -> Figure:
    """Draw final altitude error against initial altitude and range errors."""

    def panel(source: str) -> Panel:
        own = frame[frame["initial error in"] == source]
        initial = own["initial error [km]"]
        flown, linear = (own[f"final altitude error, {way} [km]"] for way in ("flown", "linear"))
        across, upward = Axis(f"initial {source} error", "km"), Axis("final altitude error", "km")
        return Panel(
            f"By {source}", across, upward, [Line(FLOWN_ERROR, initial, flown), Line(LINEAR_ERROR, initial, linear)]
        )

    return Figure(
        name="tn-5",
        title="Range of linearity",
        description="Final altitude error against the initial altitude and range error, flown and linear.",
        panels=[panel(source) for source in frame["initial error in"].drop_duplicates()],
        key=(FLOWN_ERROR, LINEAR_ERROR),
        columns=dict(frame.items()),
        caption="Final altitude error of trajectory 4 up to a hundred times the report's initial errors.",
        file="figure_05.csv",
    )


def figures_6_to_9(frame: pd.DataFrame, output: int) -> Figure:
    """Draw partials of an output against start time, times the report's errors; two conventions of axes."""
    shown = DEVIATIONS[output]
    scale, name, count = 1e-3 if shown.shown_in == "km" else 1.0, humanize(shown.name), len(TN_SOURCES)
    start, partials = frame.iloc[:, 0], frame.iloc[:, 1:].to_numpy()
    effects = partials * scale * np.tile(ERRORS, 2)
    series = [numbered(j, label) for j, label in enumerate(LABELS)]

    def panel(title: str, members: Sequence[int], first: bool = False) -> Panel:
        lines = [Line(series[j], start, effects[:, j + first * count]) for j in members]
        return Panel(title, START, Axis(f"final {name}", shown.shown_in), [*lines, REENTRY])

    equipment = range(INITIAL_CONDITIONS, count)
    return Figure(
        name=f"tn-{6 + output}",
        title=f"Partial derivatives of final {name} against start time",
        description=f"Partial derivatives of final {name} against start time, times the report's errors.",
        panels=[
            panel("Initial conditions", range(INITIAL_CONDITIONS)),
            panel("Equipment, axes of that start", equipment),
            panel("Equipment, axes of the first start", equipment, first=True),
        ],
        key=series,
        columns=dict(frame.items()),
        size=THIRD,
        caption="Trajectory 4; the curves are partial derivatives times the report's errors, the table has the "
        "derivatives.",
        file=f"figure_{6 + output:02}.csv",
    )


def figure_10(frame: pd.DataFrame) -> Figure:
    """Draw perigee partials in (r, r', theta'): closed form, flown without atmosphere, and trajectory 4."""
    ways = {
        "closed form": Series("closed", "perigee, eq. (27)", LINEAR),
        "flown without atmosphere": Series("flown", "perigee, simulated without atmosphere", FLOWN, "dot"),
        "trajectory 4": Series("final", "final altitude, trajectory 4", FLOWN, "dashed"),
    }

    def panel(words: str, title: str) -> Panel:
        marks: list[Mark] = []
        for way, series in ways.items():
            dots = series.kind == "dot"
            own = frame[:: 20 if dots else 1]
            marks.append((Points if dots else Line)(series, own.iloc[:, 0], own[f"by {words}, {way}"]))
        return Panel(title, TO_REENTRY, Axis(), marks)

    columns = {"r [1]": "by r (1)", "r' [s]": "by r′ (s)", "theta' [1e6 km s/rad]": "by θ′ (10⁶ km s/rad)"}
    return Figure(
        name="tn-10",
        title="Partial derivatives of the perigee radius in r, r′ and θ′",
        description="Partial derivatives of the perigee radius in r, r′ and θ′ against time: by closed form, and by "
        "flights without atmosphere. Beside them those of the final altitude of trajectory 4.",
        panels=[panel(words, title) for words, title in columns.items()],
        key=list(ways.values()),
        columns=dict(frame.items()),
        size=THIRD,
        caption="Closed forms of the appendix on the printed ellipse, a flight without atmosphere, trajectory 4's "
        "altitude.",
        file="figure_10.csv",
    )


def figure_11(frame: pd.DataFrame) -> Figure:
    """Draw perigee partials in (r, V, gamma)."""
    columns = {"by r [1]": "by r (1)", "by V [s]": "by V (s)", "by gamma [km/rad]": "by γ (km/rad)"}
    return Figure(
        name="tn-11",
        title="Partial derivatives of the perigee radius in r, V and γ",
        description="Partial derivatives of the perigee radius in r, V and γ against time.",
        panels=[
            Panel(title, TO_REENTRY, Axis(), [Line(ONE, frame.iloc[:, 0], frame[column])])
            for column, title in columns.items()
        ],
        key=(),
        columns=dict(frame.items()),
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

    def panel(name: str) -> Panel:
        marks: list[Mark] = [Span(advised, -30.0, -20.0)]
        marks += [
            Line(series, start, np.abs(frame[f"{name} for {TN_SOURCES[j].name} [km]"]), 1.6)
            for j, series in shown.items()
        ]
        for words, series in together.items():
            column = frame[f"{name}, {words} [km]"]
            marks.append(Line(series, start, column, 2.7))
            if "all" in words:
                best = int(column[start <= 0.0].argmin())
                marks.append(
                    Points(LEAST, [start[best]], [column[best] + 0.02 * frame[f"{name}, sum of |all| [km]"].max()], 9.0)
                )
        return Panel(f"final {name}", START, Axis(f"|{name} error|", "km", low=0.0), [*marks, REENTRY])

    return Figure(
        name="tn-12",
        title="Final altitude and range errors against start time",
        description="Final altitude and range errors against start time, of single sources and of all; triangles "
        "point at the least up to reentry.",
        panels=[panel(name) for name in ("altitude", "range")],
        key=(*shown.values(), *together.values(), LEAST, advised),
        columns=dict(frame.items()),
        size=(HALF[0], 307.0),
        caption="Trajectory 4, the report's errors at whatever time navigation starts.",
        file="figure_12.csv",
    )


def figure_13(frame: pd.DataFrame) -> Figure:
    """Draw mean, dispersion and root mean square against the switching altitude."""
    mean = Series("mean", "mean, by the drag missed", MUTED, "dashdot")
    alone = Series("sigma", "sigma", MUTED, "dashed")
    whole = Series("rms", "root mean square", INK)
    shown = frame[frame["off above [km]"].between(LOWEST_SHOWN, HIGHEST_SHOWN)]

    def panel(name: str) -> Panel:
        switched = shown["off above [km]"]
        missed, rms = shown[f"{name}, drag missed [km]"].abs(), shown[f"{name}, rms [km]"]
        marks: list[Mark] = [
            Line(whole, switched, rms),
            Line(alone, switched, shown[f"{name}, sigma [km]"]),
            Line(mean, switched, missed),
        ]
        least = int(rms.to_numpy().argmin())
        marks.append(Points(LEAST, [switched.iloc[least]], [1.15 * rms.iloc[least]], 9.0))
        error = Axis("error", "km", log=True, low=SMALLEST_SHOWN, high=1e3)
        return Panel(f"final {name}", Axis("accelerometers off above", "km"), error, marks)

    return Figure(
        name="tn-13",
        title="Switching altitude of the accelerometers",
        description="Mean, sigma and root mean square of final altitude and range errors against the accelerometers' "
        "switching altitude; triangles point at the least.",
        panels=[panel(name) for name in ("altitude", "range")],
        key=(whole, alone, mean, LEAST),
        columns=dict(frame.items()),
        caption="Not in the report: trajectory 4 with the outputs taken as zero above an altitude, which it tried at "
        "one only. Sigma falls where the mean grows: below the best altitude the drag that is not measured decides.",
        file="figure_13.csv",
    )


def figure_14(frame: pd.DataFrame) -> Figure:
    """Draw final errors in three dimensions against the time of the start and of the only update."""
    shown = {
        "altitude": Series("altitude", "altitude", LINEAR),
        "range": Series("range", "range", LINEAR, "dashed"),
        "crossrange": Series("crossrange", "crossrange", LINEAR, "dashdot"),
    }
    flown = Series("flown", "Monte Carlo", FLOWN, "ring")

    def panel(curve: str, title: str, words: str) -> Panel:
        lines, points = (frame[frame["curve"] == name] for name in (curve, f"{curve}, samples"))
        marks: list[Mark] = [
            Line(series, lines["time from reentry [min]"], lines[f"{name} [km]"]) for name, series in shown.items()
        ]
        marks += [Points(flown, points["time from reentry [min]"], points[f"{name} [km]"], 6.0) for name in shown]
        return Panel(title, Axis(words, "min from reentry", margin=0.02), Axis("1σ", "km", low=0.0), marks)

    return Figure(
        name="tn-14",
        title="Start or update in three dimensions",
        description="Sigma of final altitude, range and crossrange in three dimensions. Left: against the start of "
        "navigation. Right: against the time of the only update of a navigator that runs from the first point.",
        panels=[
            panel("start", "navigation starts", "start of navigation"),
            panel("update", "navigation is updated once", "update"),
        ],
        key=(*shown.values(), flown),
        columns=dict(frame.items()),
        caption="Not in the report: trajectory 4 in three dimensions. Updates by tracking and a star tracker are as "
        "accurate as the report's initial conditions and alignment. The filter also learns the instrument errors.",
        file="figure_14.csv",
    )


def figure_15(frame: pd.DataFrame) -> Figure:
    """Draw the dispersion of the landing point, and navigation errors, against the start of navigation."""
    landing = {
        "accelerometers on": Series("on", "landing point", LINEAR),
        "accelerometers off": Series("off", "accelerometers off above 121.92 km", LINEAR, "dashdot"),
    }
    errors = {
        "altitude error": Series("altitude", "altitude error", LINEAR),
        "range error": Series("range", "range error", LINEAR, "dashed"),
    }
    flown = Series("flown", "Monte Carlo", FLOWN, "ring")
    known, sampled = "accelerometers on", frame[frame["curve"] == "samples"]

    def panel(title: str, lines: Mapping[tuple[str, str], Series]) -> Panel:
        marks: list[Mark] = []
        for (curve, name), series in lines.items():
            shown = frame[frame["curve"] == curve]
            marks.append(Line(series, shown["time from reentry [min]"], shown[f"{name} [km]"]))
            if curve == known:
                marks.append(Points(flown, sampled["time from reentry [min]"], sampled[f"{name} [km]"], 6.0))
        start = Axis("start of navigation", "min from reentry", margin=0.02)
        return Panel(title, start, Axis("1σ", "km", low=0.0), marks)

    return Figure(
        name="tn-15",
        title="Start of navigation in the closed loop",
        description="Sigma of the landing point of trajectory 2 and of the final navigation errors, against the start "
        "of navigation. The navigator feeds the lift law.",
        panels=[
            panel("landing point", {(curve, "landing point"): series for curve, series in landing.items()}),
            panel("navigation errors", {(known, name): series for name, series in errors.items()}),
        ],
        key=(*landing.values(), *errors.values(), flown),
        columns=dict(frame.items()),
        caption="Not in the report: trajectory 2 with its lift law fed by the indicated altitude rate. Fed by the true "
        "one, navigation errors do not move the landing point.",
        file="figure_15.csv",
    )
