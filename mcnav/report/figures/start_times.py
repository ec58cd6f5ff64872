"""Figures of start times: dispersion and the effect of each source against the start of navigation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.analysis.checked_starts import simulated_rms
from mcnav.analysis.comparison import Comparison
from mcnav.arrays.types import Array
from mcnav.contract.history import StartClock
from mcnav.contract.quantities import Output, end_words
from mcnav.linear.start_times import StartTimeStudy
from mcnav.report.drawing.figure import HALF, Figure
from mcnav.report.drawing.marks import Axis, Line, Mark, Panel, Points, Rule, Series, numbered
from mcnav.report.drawing.palette import FLOWN, INK, LINEAR
from mcnav.report.names import humanize


def start_axis(label: str) -> Axis:
    """Return the axis of start times, in minutes by a scenario's clock."""
    return Axis("start of navigation", label, margin=0.02, link="start of navigation")


START: Final = start_axis("min from reentry")
REENTRY: Final = Rule(0.0, name="reentry")
WITH_NOISE: Final = Series("linear", "linear, P·S·Pᵀ + Q", LINEAR)
SIGMA: Final = Series("linear", "linear, P·S·Pᵀ", LINEAR)
RMS: Final = Series("linear", "linear, root mean square", LINEAR)
BEST: Final = Series("best", "best start", INK, "triangle")
CHECKED: Final = Series("flown", "Monte Carlo", FLOWN, "ring")


@dataclass(frozen=True)
class Effects:
    """Effects of one sigma of a source, or of a group of sources, by start time.

    Attributes
    ----------
    sizes : ndarray, shape (n, outputs)
        SI.
    initial : bool
        Whether these are initial conditions, which have a plot of their own, or equipment.
    combined : bool
        Whether these are root sum squares, without a sign.
    """

    label: str
    sizes: Array
    initial: bool
    combined: bool = False


def _event(clock: StartClock) -> list[Mark]:
    """Return the line at the clock's event, if it has one."""
    return [Rule(0.0, name=clock.event)] if clock.event else []


def dispersion(
    study: StartTimeStudy, checks: Mapping[float, Comparison], scale: Array, outputs: Sequence[Output]
) -> Figure:
    """Draw sigma of each output against the start, linear and Monte Carlo.

    ``checks`` are by start time, s; SI values are multiplied by ``scale``, shape (outputs,).
    """
    starts, sigma = study.times / 60.0, study.rms * scale
    one, what = ("rms", "Root mean square") if study.means_matter else ("1σ", "Sigma")
    axis, event = start_axis(study.clock.label), _event(study.clock)
    linear = RMS if study.means_matter else SIGMA if study.noise is None else WITH_NOISE

    def panel(name: str, i: int) -> Panel:
        marks: list[Mark] = [Line(linear, starts, sigma[:, i], 2.1)]
        known = [(time / 60.0, simulated_rms(study, time, c)[i] * scale[i]) for time, c in checks.items() if c.outputs]
        if known:
            at, result = np.array(known).T
            marks.append(Points(CHECKED, at, result, 7.5))
        # above the curve, where it hides no Monte Carlo value
        marks.append(Points(BEST, [starts[study.best[i]]], [sigma[study.best[i], i] + 0.02 * sigma[:, i].max()], 9.0))
        return Panel(f"final {name}", axis, Axis(one, outputs[i].shown_in, low=0.0), [*marks, *event])

    names = [humanize(output.name) for output in outputs]
    drawn = [
        i for i, output in enumerate(outputs) if not study.clock.weighs or (sigma[:, i].any() and not output.size_of)
    ]
    columns = [f"{name}, {one} [{output.shown_in}]" for name, output in zip(names, outputs, strict=True)]
    table = {f"start [{study.clock.label}]": starts} | dict(zip(columns, sigma.T, strict=True))
    return Figure(
        name="dispersion",
        title="Root mean square by start of navigation" if study.means_matter else "Dispersion by start of navigation",
        description=f"{what} of each {end_words(outputs).one} against the start time, linear and Monte Carlo; a "
        f"triangle marks the best start{f' up to {study.clock.event}' if study.clock.event else ''}.",
        panels=[panel(names[i], i) for i in drawn],
        key=(linear, *([CHECKED] if checks else []), BEST),
        columns=table | {"all, weighted [1]": study.weighted},
        file="start_times.csv",
    )


def weighted(study: StartTimeStudy, checks: Mapping[float, Comparison], outputs: Sequence[Output]) -> Figure:
    """Draw what the best start is the best of: the weighted sigma, or root mean square, against the start.

    ``checks`` are Monte Carlo comparisons by start time, s.
    """
    starts, best = study.times / 60.0, study.best_weighted
    linear = RMS if study.means_matter else SIGMA if study.noise is None else WITH_NOISE
    top = float(study.weighted.max(initial=0.0))
    marks: list[Mark] = [
        Line(linear, starts, study.weighted, 2.1),
        Points(BEST, [starts[best]], [study.weighted[best] + 0.02 * top], 9.0),
        *_event(study.clock),
    ]
    known = [
        (time / 60.0, float(np.sqrt(np.nansum((simulated_rms(study, time, check) * study.weights) ** 2))))
        for time, check in checks.items() if check.outputs
    ]  # fmt: skip
    if known:
        at, simulated = np.array(known).T
        marks.append(Points(CHECKED, at, simulated, 7.5))
    one = "rms" if study.means_matter else "σ"
    upward = Axis(f"weighted {one}", low=0.0)
    return Figure(
        name="weighted",
        title="Weighted size of all outputs by start of navigation",
        description=f"Root sum square of the weighted {end_words(outputs).many} against the start time; a triangle "
        "marks the best start.",
        panels=[Panel("all outputs, weighted", start_axis(study.clock.label), upward, marks)],
        key=(linear, *([CHECKED] if known else []), BEST),
        columns={f"start [{study.clock.label}]": starts, "all, weighted [1]": study.weighted},
        file="start_times.csv",
    )


def effects(study: StartTimeStudy, i: int, scale: float, known: Sequence[Effects], output: Output) -> Figure:
    """Draw the effect of one sigma of each source on output i against the start time."""
    starts, name = study.times / 60.0, humanize(output.name)
    values = np.stack([contributor.sizes[:, i] for contributor in known], axis=1) * scale
    series = [numbered(j, contributor.label) for j, contributor in enumerate(known)]
    axis, event = start_axis(study.clock.label), _event(study.clock)
    combined = (
        "; root sum square over the sources of a group" if any(contributor.combined for contributor in known) else ""
    )
    kinds = {
        "Initial conditions": [j for j, contributor in enumerate(known) if contributor.initial],
        "Equipment": [j for j, contributor in enumerate(known) if not contributor.initial],
    }

    def panel(title: str, members: Sequence[int]) -> Panel:
        lines = [Line(series[j], starts, values[:, j]) for j in members]
        return Panel(title, axis, Axis(f"final {name}", output.shown_in), [*lines, *event])

    what = "Final error in" if output.of == "navigation" else "Final"
    frame = {f"{contributor.label} [{output.shown_in}]": values[:, j] for j, contributor in enumerate(series)}
    return Figure(
        name=f"effects-{output.name}".replace("_", "-"),
        title=f"Final {name} for one sigma of each source",
        description="Partial derivative times one sigma of each source, against the start of navigation.",
        panels=[panel(title, members) for title, members in kinds.items() if members],
        key=series,
        columns={f"start [{study.clock.label}]": starts} | frame,
        size=(HALF[0], 280.0),
        caption=f"{what} {name} for one sigma of each source: partial derivative times sigma{combined}.",
        file="start_times.csv",
    )
