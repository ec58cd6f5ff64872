"""Does linear hold: sigma ratios against the tolerance and magnified, their convergence, NEES against chi-square."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from mcnav.arrays.types import IndexArray
from mcnav.report.drawing.figure import HALF, Figure, side_by_side
from mcnav.report.drawing.marks import Axis, Band, Interval, Line, Mark, Panel, Points, Rule, Series, Span, Steps, Text
from mcnav.report.drawing.palette import AREA, BAND, FLOWN, LINEAR, MUTED
from mcnav.report.results.model import RunAnalysis
from mcnav.report.results.worst_components import foremost_outputs

PAIRED, PLAIN = "Monte Carlo (paired)", "Monte Carlo (plain)"
RATIOS: Final = {"paired": Series("paired", PAIRED, FLOWN, "dot"), "plain": Series("plain", PLAIN, MUTED, "square")}
RUNNING: Final = {"paired": Series("paired", PAIRED, FLOWN), "plain": Series("plain", PLAIN, MUTED)}
TOLERANCE: Final = Series("tolerance", "tolerance", BAND, "area")
QUANTILES: Final = 121
"""Points of a quantile plot."""
BINS: Final = 60
"""Bins of the histogram of NEES."""


Ratio = tuple[float | None, ...]
"""A ratio and the ends of its interval; none where there is none."""


def forest(series: Series, places: ArrayLike, judged: Sequence[Ratio], names: Sequence[str]) -> list[Mark]:
    """Return points and intervals of ratios, each with its limits, in per cent from one; without an interval none."""
    marks: list[Mark] = []
    values = 100.0 * (np.array(judged, dtype=float).reshape(-1, 3) - 1.0)
    for place, name, (ratio, low, high) in zip(np.asarray(places, dtype=float), names, values.tolist(), strict=True):
        if np.isfinite([ratio, low, high]).all():
            text = f"{name}, {series.label}: {ratio:+.3g} %, {low:+.3g} to {high:+.3g} %".replace("-", "−")
            points = Points(series, [ratio], [place], 7.5, texts=[text])
            marks += [Interval(series, float(place), low, high, text), points]
    return marks


def sigma_ratios(content: RunAnalysis) -> Figure:
    """Draw a forest plot of the sigma ratios against the tolerance, and the paired ones magnified.

    Of a closed loop those are drawn that matter most.
    """
    picked = foremost_outputs(content)
    names, rows = [content.output_names[i] for i in picked], np.arange(len(picked))
    judged: dict[str, list[Ratio]] = {}
    for kind in RATIOS:
        figure = [getattr(content.comparison.outputs[i], kind) for i in picked]
        judged[kind] = [(each.ratio, *(each.interval or (None, None))) for each in figure]
    tolerance = 100.0 * content.criterion.tolerance
    even, span = Rule(0.0, colour=LINEAR, width=1.6), Span(TOLERANCE, -tolerance, tolerance)
    both = [mark for kind, shift in (("paired", -0.165), ("plain", 0.165))
            for mark in forest(RATIOS[kind], rows + shift, judged[kind], names)]  # fmt: skip
    alone = forest(RATIOS["paired"], rows, judged["paired"], names)
    ends, own = (
        np.array([end for mark in marks if isinstance(mark, Interval) for end in (mark.low, mark.high)])
        for marks in (both, alone)
    )
    low, high = ends.min(initial=-1.2 * tolerance), ends.max(initial=1.2 * tolerance)
    margin, across = 0.04 * (high - low), Axis("Monte Carlo σ relative to linear σ", "%")
    whole = replace(across, low=low - margin * (low < -1.2 * tolerance), high=high + margin * (high > 1.2 * tolerance))
    columns: dict[str, Sequence[object]] = {"output": names}
    for kind, values in judged.items():
        headings = (f"{kind} sigma ratio", f"{kind} interval from", f"{kind} interval to")
        columns |= dict(zip(headings, np.array(values, dtype=float).T.tolist(), strict=True))
    return Figure(
        name="ratios",
        title="Monte Carlo sigma over linear sigma",
        description="Difference between Monte Carlo and linear sigma of each output with its interval, and the "
        "tolerance around zero.",
        panels=[
            Panel("Both estimates", whole, Axis(names=names), [span, even, *both]),
            Panel("Paired estimate, magnified", across, Axis(names=names),
                  [*([span] if tolerance < np.abs(own).max(initial=0.0) else []), even, *alone]),
        ],
        key=(*RATIOS.values(), TOLERANCE),
        columns=columns,
        size=(HALF[0], 82.0 + 40.0 * len(names)),
    )  # fmt: skip


def ratio_panel(title: str, across: Axis, upward: Axis, tolerance: float, marks: Sequence[Mark]) -> Panel:
    """Return a panel of sigma ratios around one, with the tolerance."""
    span = Span(TOLERANCE, 1.0 - tolerance, 1.0 + tolerance, level=True)
    return Panel(title, across, upward, [span, Rule(1.0, level=True, colour=LINEAR), *marks])


def running_ratios(content: RunAnalysis) -> Figure | None:
    """Draw plain and paired sigma ratios against the number of samples; none when there is nothing to show."""
    convergence, names, tolerance = content.convergence, content.output_names, content.criterion.tolerance
    if convergence is None or len(convergence.sizes) < 2:
        return None
    shown = [i for i in range(len(names)) if np.isfinite(convergence.paired.ratio[-1, i])]
    if not shown:
        return None
    sizes, runs = convergence.sizes.astype(float), {"plain": convergence.plain, "paired": convergence.paired}
    columns, panels = {"samples": sizes}, []
    for i in shown:
        marks: list[Mark] = []
        for kind, run in runs.items():
            ratio, low, high = (getattr(run, side)[:, i] for side in ("ratio", "low", "high"))
            sides = {"ratio": ratio, "from": low, "to": high}
            columns |= {f"{names[i]}, {kind} {side}": values for side, values in sides.items()}
            marks += [Band(RUNNING[kind], sizes, low, high, 0.25), Line(RUNNING[kind], sizes, ratio)]
        ends = np.concatenate([getattr(run, side)[:, i] for run in runs.values() for side in ("low", "high")])
        reach = max(float(np.nanmax(np.abs(ends - 1.0))), tolerance)
        end = 1.0 + min(reach, 10.0) * 1.05
        upward = Axis("σ ratio", log=True, low=1.0 / end, high=end)
        panels.append(ratio_panel(names[i], Axis("samples", log=True, link="samples"), upward, tolerance, marks))
    return Figure(
        name="convergence",
        title="Convergence of the sigma ratios",
        description="Plain and paired sigma ratio of each output against the number of samples, with intervals.",
        panels=panels,
        key=(*RUNNING.values(), TOLERANCE),
        columns=columns,
        size=side_by_side(len(shown), 225.0),
    )


def nees(content: RunAnalysis) -> Figure | None:
    """Draw NEES against the chi-square distribution of linear analysis: histogram and quantiles.

    The histogram is logarithmic where the median exceeds what linear analysis expects.
    """
    ellipsoid = content.comparison.ellipsoid
    if ellipsoid is None:
        return None
    dimension, values = ellipsoid.dimension, np.sort(ellipsoid.values)
    expected = float(special.chdtri(dimension, 5e-4))
    log = bool(np.median(values) > expected)
    if log:
        least = float(special.chdtri(dimension, 0.99))
        edges = np.geomspace(least, 1.01 * float(values[-1]), BINS + 1)
    else:
        top = min(max(expected, float(np.quantile(values, 0.98))), 10.0 * expected)
        edges = np.linspace(0.0, top, BINS + 1)
    counts, _ = np.histogram(values, edges)
    outside = len(values) - int(counts.sum())
    flown = Series("flown", "Monte Carlo", AREA, "area")
    theory = Series("linear", f"chi-square, {dimension} degrees", LINEAR)
    by_theory = len(values) * np.diff(special.chdtr(dimension, edges))
    centres = np.sqrt(edges[1:] * edges[:-1]) if log else 0.5 * (edges[1:] + edges[:-1])
    left_out = [Text(f"{outside:,} of {len(values):,}\nbeyond the plot", corner=True)] if outside else []
    places = _places(len(values))
    x, y = special.chdtri(dimension, 1.0 - (places + 0.5) / len(values)), values[places]
    quantiles = Series("quantiles", "sample quantiles", FLOWN, "dot")
    return Figure(
        name="nees",
        title="Distance to the linear covariance",
        description="Histogram and quantile plot of the normalized estimation error squared, with the chi-square "
        f"distribution of {dimension} degrees of freedom.",
        panels=[
            Panel("Distribution", Axis("squared distance to the linear covariance", log=log, margin=0.0),
                  Axis("samples", low=0.0),
                  [Steps(flown, edges, counts), Line(theory, centres, by_theory, 2.1), *left_out]),
            Panel("Quantiles", Axis(f"quantile of chi-square, {dimension} degrees"), Axis("squared distance"),
                  [Line(theory, [0.0, x[-1]], [0.0, x[-1]], 1.6), Points(quantiles, x, y, 3.5)]),
        ],
        key=(flown, theory, quantiles),
        columns={"NEES from": edges[:-1], "to": edges[1:], "samples": counts, "expected": by_theory},
    )  # fmt: skip


def _places(count: int) -> IndexArray:
    """Return the ranks shown of ``count`` sorted values: evenly spaced normal quantiles, and both ends."""
    reach = float(special.ndtri((count - 0.5) / count)) if count > 1 else 0.0
    ranks = special.ndtr(np.linspace(-reach, reach, QUANTILES)) * count - 0.5
    return np.unique(np.clip(np.rint(ranks), 0, count - 1).astype(np.int64))


def normal_quantiles(content: RunAnalysis) -> Figure | None:
    """Draw quantiles of each output against those of the linear Gaussian."""
    flown, scale, names, units = content.flown, content.output_scale, content.output_names, content.output_units
    sigma = np.sqrt(np.diag(content.comparison.covariance_linear)) * scale
    centre = content.model.outcome_mean * scale
    shown = [i for i in content.moving if sigma[i] > 0.0]
    if not shown or len(flown) < 2:
        return None
    places = _places(len(flown))
    expected = special.ndtri((places + 0.5) / len(flown))
    figure = {i: np.sort(flown[:, i])[places] for i in shown}
    dots, straight = Series("flown", "Monte Carlo", FLOWN, "dot"), Series("linear", "linear Gaussian", LINEAR)
    return Figure(
        name="quantiles",
        title="Normal quantile plots",
        description=f"Quantiles of the Monte Carlo {content.ends.many} against normal quantiles; the straight line is "
        "the normal distribution of linear analysis.",
        panels=[
            Panel(names[i], Axis("quantile of a normal distribution", "σ"), Axis(names[i], units[i]),
                  [Line(straight, expected, centre[i] + sigma[i] * expected, 1.6),
                   Points(dots, expected, figure[i], 3.5)])
            for i in shown
        ],
        key=(dots, straight),
        columns={"normal quantile": expected} | {f"{names[i]} [{units[i]}]": figure[i] for i in shown},
        size=side_by_side(len(shown), 240.0),
    )  # fmt: skip
