"""Two or more runs over each other: sigmas over time, and the difference of their error budgets as a waterfall."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.analysis.envelopes import Envelopes
from mcnav.analysis.summary import Summary
from mcnav.arrays.types import Array
from mcnav.report.drawing.figure import HALF, Figure, side_by_side
from mcnav.report.drawing.marks import Axis, Bars, Line, Mark, Panel, Rule, Series, axis
from mcnav.report.drawing.palette import FILTER, FLOWN, INK, LINEAR
from mcnav.report.format import number
from mcnav.report.names import humanize, labels_in, shown_units
from mcnav.report.statements.means import large_means_of

RUNS: Final = ("line", "dashed", "dotted", "dashdot", "long")
"""Lines of runs; their colours are those of the methods."""

LISTED: Final = 8
"""Causes of a waterfall that are named; the others stand together."""

NEGLIGIBLE: Final = 5e-3
"""Change of a cause, as a share of the first run's variance, below which it is one of the others."""

CROSS: Final = "correlations"
"""Name of what correlated errors have in common, which is no cause's own."""

TOTAL = Series("total", "a run", LINEAR, "area")
MORE, LESS = Series("more", "larger part", FLOWN, "area"), Series("less", "smaller part", FILTER, "area")


def curves(titles: Sequence[str], summaries: Sequence[Summary], known: Sequence[Envelopes | None]) -> Figure | None:
    """Draw sigmas over time of every output that the first run shares with another, linear and by Monte Carlo.

    Runs whose histories have other times, such as the altitude of a reentry, are left out; none where one is left.
    """
    first = known[0]
    if first is None:
        return None
    series, panels, columns = dict[int, tuple[Series, Series]](), list[Panel](), dict[str, Array]()
    for name in summaries[0].names:
        marks, reached = list[Mark](), 0
        for run, (summary, over_time) in enumerate(zip(summaries, known, strict=True)):
            if over_time is None or over_time.label != first.label or not _shares(summaries[0], summary, name):
                continue
            at, (scale, unit) = summary.names.index(name), shown_units(summaries[0])[name]
            linear, flown = over_time.linear_sigma[:, at] * scale, over_time.sigma[:, at] * scale
            if not (linear.any() or flown.any()):
                continue
            series.setdefault(run, _of_run(run, titles[run]))
            by_samples, by_linear = series[run]
            marks += [Line(by_samples, over_time.times, flown, 3.0), Line(by_linear, over_time.times, linear, 1.6)]
            reached += 1
        if reached > 1:
            panels.append(
                Panel(humanize(name), axis(first.label, margin=0.0, link=True), Axis("1σ", unit, low=0.0), marks)
            )
            columns |= _columns(panels[-1], first)
    if not panels:
        return None
    return Figure(
        name="curves",
        title="Sigmas over time",
        description="Linear and Monte Carlo sigma of each output over time, of each run.",
        panels=panels,
        key=[entry for of_run in series.values() for entry in of_run],
        columns=columns,
        size=side_by_side(len(panels)),
        caption="Sigmas alone: mean errors, which exceed one sigma at the end of a run, are not in them."
        if any(map(large_means_of, summaries))
        else "",
    )


def _of_run(run: int, title: str) -> tuple[Series, Series]:
    """Return the entries of the key for the Monte Carlo and the linear sigma of a run."""
    line = RUNS[run % len(RUNS)]
    return (
        Series(f"run-{run}-flown", f"{title}, Monte Carlo", FLOWN, line),
        Series(f"run-{run}", f"{title}, linear", LINEAR, line),
    )


def _shares(first: Summary, other: Summary, name: str) -> bool:
    """Return whether both runs have an output of that name and unit."""
    units = [{output.name: output.unit for output in summary.outputs} for summary in (first, other)]
    return name in units[1] and units[0][name] == units[1][name]


def _columns(panel: Panel, first: Envelopes) -> Mapping[str, Array]:
    """Return the numbers behind a panel at the times of the first run."""
    lines = [mark for mark in panel.marks if isinstance(mark, Line)]
    return {first.label: first.times} | {
        f"{panel.title}, {line.series.label} [{panel.y.unit}]": np.interp(
            first.times, np.asarray(line.x), np.asarray(line.y), left=np.nan, right=np.nan
        )
        for line in lines
    }


@dataclass(frozen=True)
class Part:
    """Variances of a cause in two runs, as shares of the variance of the first run."""

    name: str
    before: float
    after: float

    @property
    def change(self) -> float:
        """Difference of the variances."""
        return self.after - self.before


def variance_parts(first: Summary, second: Summary, name: str) -> tuple[list[Part], float]:
    """Return what every cause adds to the linear variance of an output in two runs, and the unit of these, SI squared.

    What is left over, because errors are correlated, is a part of its own. The sums of the parts are the linear
    variances of the runs. Parts come in the order of their change, the largest first.
    """
    unit = max(_variance(first, name), 0.0) or _variance(second, name)
    variances_of_runs = [_variances(summary, name) for summary in (first, second)]
    names = dict.fromkeys([*variances_of_runs[0], *variances_of_runs[1]])
    parts = (
        [Part(cause, *(variances.get(cause, 0.0) / unit for variances in variances_of_runs)) for cause in names]
        if unit
        else []
    )
    return sorted(parts, key=lambda part: -abs(part.change)), unit


def _variance(summary: Summary, name: str) -> float:
    return float(summary.sigma_linear[summary.names.index(name)] ** 2)


def _variances(summary: Summary, name: str) -> dict[str, float]:
    """Return the variance of an output by cause, SI squared."""
    labels = [*labels_in(summary), *(humanize(process.name) for process in summary.processes)]
    squares = summary.budget.contributions[summary.names.index(name)] ** 2
    result = dict(zip(labels, squares.tolist(), strict=True))
    return result | {CROSS: _variance(summary, name) - float(squares.sum())}


def waterfall(titles: tuple[str, str], first: Summary, second: Summary, label: str) -> Figure | None:
    """Draw for each output of both runs the way from the linear variance of the first to that of the second run.

    Parameters
    ----------
    label : str
        Name of the figure.
    """
    panels, columns = list[Panel](), dict[str, list[object]]()
    for name in first.names:
        if not _shares(first, second, name):
            continue
        parts, unit = variance_parts(first, second, name)
        if not parts:
            continue
        scale, shown = shown_units(first)[name]
        panels.append(_steps(humanize(name), titles, parts, scale * np.sqrt(unit), shown))
        for part in parts:
            for heading, value in (
                ("output", humanize(name)),
                ("cause", part.name),
                (f"{titles[0]}, %", 100.0 * part.before),
                (f"{titles[1]}, %", 100.0 * part.after),
                ("change, %", 100.0 * part.change),
            ):
                columns.setdefault(heading, []).append(value)
    if not panels:
        return None
    most = max(len(panel.y.names) for panel in panels)
    return Figure(
        name=label,
        title=f"From the variance of {titles[0]} to that of {titles[1]}",
        description="What each cause adds to the linear variance of each output, or takes from it, by size.",
        panels=panels,
        key=(TOTAL, MORE, LESS),
        columns=columns,
        size=(HALF[0], 82.0 + 24.0 * most),
        caption="Variances add up, sigmas do not. Point at a bar for sigmas.",
    )


def _together(name: str, parts: Sequence[Part]) -> Part:
    """Add parts up."""
    return Part(name, sum(part.before for part in parts), sum(part.after for part in parts))


def _steps(name: str, titles: tuple[str, str], parts: Sequence[Part], scale: float, unit: str) -> Panel:
    """Return the bars of a waterfall; ``scale`` is the unit of the parts as a sigma, in the unit shown."""
    total = _together(name, parts)
    named = [part for part in parts[:LISTED] if abs(part.change) > NEGLIGIBLE]
    if others := [part for part in parts if part not in named]:
        named.append(_together(f"{len(others)} other{'s' if len(others) > 1 else ''}", others))

    def sigma(variance: float) -> str:
        size = number(scale * np.sqrt(abs(variance)), 3)
        return f"{'−' if variance < 0.0 else ''}{size} {unit}"

    rows = [titles[0], *(part.name for part in named), titles[1]]
    ends = 100.0 * np.cumsum([total.before, *(part.change for part in named)])
    sizes = (total.before, total.after)
    texts = [f"{title}: {sigma(size)}" for title, size in zip(titles, sizes, strict=True)]
    marks: list[Mark] = [Bars(TOTAL, [0, len(rows) - 1], [0.0, 0.0], [100.0 * size for size in sizes], texts)]
    for series, sign in ((MORE, 1.0), (LESS, -1.0)):
        at = np.array([k for k, part in enumerate(named) if sign * part.change > 0.0], dtype=int)
        low, high = np.minimum(ends[at], ends[at + 1]), np.maximum(ends[at], ends[at + 1])
        texts = [f"{named[k].name}: {sigma(named[k].before)} to {sigma(named[k].after)}" for k in at]
        marks.append(Bars(series, at + 1, low, high, texts))
    marks.append(Rule(100.0 * total.before, kind="dotted", colour=INK))
    across = Axis("variance, that of the first run = 100", "%", low=0.0)
    return Panel(name, across, Axis(names=rows), marks)
