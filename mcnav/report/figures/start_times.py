"""Figures of start times: dispersion and the effect of each source against the start of navigation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.analysis.comparison import Comparison
from mcnav.lincov.start_times import StartTimeStudy
from mcnav.report.figures.figure import HALF, Figure
from mcnav.report.figures.marks import Axis, Line, Mark, Panel, Points, Rule, Series, numbered
from mcnav.report.figures.palette import FLOWN, INK, LINEAR
from mcnav.report.model import humanize
from mcnav.scenarios.protocol import Output

START: Final = Axis("start of navigation", "min from reentry", margin=0.02, link="start of navigation")
REENTRY: Final = Rule(0.0, kind="dotted", name="reentry")
INITIAL_CONDITIONS: Final = 4
"""The first sources are initial conditions, the others equipment; each kind has a plot of its own."""

SIGMA: Final = Series("linear", "linear, P·S·Pᵀ", LINEAR)
BEST: Final = Series("best", "best start", INK, "triangle")
CHECKED: Final = Series("flown", "Monte Carlo", FLOWN, "ring")


def dispersion(
    study: StartTimeStudy, checks: Mapping[float, Comparison], scale: Array, outputs: Sequence[Output]
) -> Figure:
    """Draw sigma of each output against the start, linear and Monte Carlo.

    ``checks`` are by start time, s; SI values are multiplied by ``scale``, shape (outputs,).
    """
    starts, sigma = study.times / 60.0, study.sigma * scale

    def panel(name: str, i: int) -> Panel:
        marks: list[Mark] = [Line(SIGMA, starts, sigma[:, i], 2.1)]
        known = [(time / 60.0, c.outputs[i].sigma_paired * scale[i]) for time, c in checks.items() if c.outputs]
        if known:
            at, found = np.array(known).T
            marks.append(Points(CHECKED, at, found, 7.5))
        # above the curve, where it hides no Monte Carlo value
        marks.append(Points(BEST, [starts[study.best[i]]], [sigma[study.best[i], i] + 0.02 * sigma[:, i].max()], 9.0))
        return Panel(f"final {name}", START, Axis("1σ", outputs[i].shown_in, low=0.0), [*marks, REENTRY])

    names = [humanize(output.name) for output in outputs]
    columns = [f"{name}, 1σ [{output.shown_in}]" for name, output in zip(names, outputs, strict=True)]
    table = {"start [min from reentry]": starts} | dict(zip(columns, sigma.T, strict=True))
    return Figure(
        name="dispersion",
        title="Dispersion by start of navigation",
        description="Sigma of each final error against the start time, linear and Monte Carlo; a triangle marks the "
        "best start up to reentry.",
        panels=[panel(name, i) for i, name in enumerate(names)],
        key=(SIGMA, *([CHECKED] if checks else []), BEST),
        columns=table | {"all, weighted [1]": study.weighted},
        file="start_times.csv",
    )


def effects(study: StartTimeStudy, i: int, scale: float, labels: Sequence[str], output: Output) -> Figure:
    """Draw the effect of one sigma of each source on one output against the start time.

    ``labels`` name the sources.
    """
    starts, values, name = study.times / 60.0, study.effects[:, i] * scale, humanize(output.name)
    series = [numbered(j, label) for j, label in enumerate(labels)]

    def panel(title: str, members: Sequence[int]) -> Panel:
        lines = [Line(series[j], starts, values[:, j]) for j in members]
        return Panel(title, START, Axis(f"final {name}", output.shown_in), [*lines, REENTRY])

    frame = {f"{each.label} [{output.shown_in}]": values[:, j] for j, each in enumerate(series)}
    return Figure(
        name=f"effects-{output.name}".replace("_", "-"),
        title=f"Final {name} for one sigma of each source",
        description="Partial derivative times one sigma of each source, against the start of navigation.",
        panels=[
            panel("Initial conditions", range(INITIAL_CONDITIONS)),
            panel("Equipment", range(INITIAL_CONDITIONS, len(labels))),
        ],
        key=series,
        columns={"start [min from reentry]": starts} | frame,
        size=(HALF[0], 280.0),
        caption=f"Final error in {name} for one sigma of each source: partial derivative times sigma.",
        file="start_times.csv",
    )
