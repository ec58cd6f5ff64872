"""Does linear hold: sigma ratios against the tolerance and magnified, their convergence, NEES against chi-square."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy import special

from mcnav._types import Array, IndexArray
from mcnav.analysis.running_ratios import Convergence, RunningRatio
from mcnav.report.figures.figure import HALF, Figure, side_by_side
from mcnav.report.figures.marks import Axis, Band, Interval, Line, Mark, Panel, Points, Rule, Series, Span, Steps, Text
from mcnav.report.figures.palette import AREA, BAND, FLOWN, LINEAR, MUTED
from mcnav.report.model import RunAnalysis

PAIRED, PLAIN = "Monte Carlo, paired estimate", "Monte Carlo, plain sample"
RATIOS: Final = {"paired": Series("paired", PAIRED, FLOWN, "dot"), "plain": Series("plain", PLAIN, MUTED, "square")}
RUNNING: Final = {"paired": Series("paired", PAIRED, FLOWN), "plain": Series("plain", PLAIN, MUTED, "dashed")}
TOLERANCE: Final = Series("tolerance", "tolerance", BAND, "area")
QUANTILES: Final = 121
"""Points of a quantile plot."""
BINS: Final = 60
"""Bins of the histogram of NEES."""


def sigma_ratios(content: RunAnalysis) -> Figure:
    """Draw a forest plot of the sigma ratios against the tolerance, and the paired ones magnified."""
    outputs, names = content.comparison.outputs, content.output_names
    kinds = {"paired": [output.paired for output in outputs], "plain": [output.plain for output in outputs]}
    columns: dict[str, list[object]] = {"output": list(names)}
    for kind, judged in kinds.items():
        columns[f"{kind} sigma ratio"] = [_number(each.ratio) for each in judged]
        for side in (0, 1):
            bounds = [each.interval[side] if each.interval else None for each in judged]
            columns[f"{kind} interval {('from', 'to')[side]}"] = [_number(bound) for bound in bounds]
    tolerance = 100.0 * content.criterion.tolerance
    both, paired = (_ratios(columns, shown) for shown in (("paired", "plain"), ("paired",)))
    reach = max(
        (abs(end) for mark in paired if isinstance(mark, Interval) for end in (mark.low, mark.high)), default=0.0
    )
    rows = Axis(names=names)
    across = Axis("Monte Carlo σ relative to linear σ", "%")
    span = Span(TOLERANCE, -tolerance, tolerance)
    wide = [
        -1.2 * tolerance,
        1.2 * tolerance,
        *(end for mark in both if isinstance(mark, Interval) for end in (mark.low, mark.high)),
    ]
    margin = 0.04 * (max(wide) - min(wide))
    whole = Axis(across.label, "%", low=min(wide) - margin * (min(wide) < -1.2 * tolerance),
                 high=max(wide) + margin * (max(wide) > 1.2 * tolerance))  # fmt: skip
    return Figure(
        name="ratios",
        title="Monte Carlo sigma over linear sigma",
        description="Difference between Monte Carlo and linear sigma of each output with its interval, and the "
        "tolerance around zero.",
        panels=[
            Panel("Compared with the tolerance", whole, rows, [span, *both]),
            Panel("Paired estimate, magnified", across, rows, [*([span] if tolerance < reach else []), *paired]),
        ],
        key=(*RATIOS.values(), TOLERANCE),
        columns=columns,
        size=(HALF[0], 82.0 + 40.0 * len(names)),
    )


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)


def _ratios(columns: dict[str, list[object]], kinds: tuple[str, ...]) -> list[Mark]:
    marks: list[Mark] = [Rule(0.0, colour=LINEAR, width=1.6)]
    for place, kind in enumerate(kinds):
        shift, series = 0.33 * (place - 0.5 * (len(kinds) - 1)), RATIOS[kind]
        found = np.array(
            [columns[f"{kind} {each}"] for each in ("sigma ratio", "interval from", "interval to")], dtype=float
        )
        for row, (ratio, low, high) in enumerate(100.0 * (found.T - 1.0)):
            if not np.isfinite([ratio, low, high]).all():
                continue
            text = f"{columns['output'][row]}, {series.label}: {ratio:+.3g} %, {low:+.3g} to {high:+.3g} %".replace(
                "-", "−"
            )
            marks.append(Interval(series, row + shift, float(low), float(high), text))
            marks.append(Points(series, [ratio], [row + shift], 7.5, texts=[text]))
    return marks


def running_ratios(content: RunAnalysis) -> Figure | None:
    """Draw plain and paired sigma ratios against the number of samples; none when there is nothing to show."""
    found, names = content.convergence, content.output_names
    if found is None or len(found.sizes) < 2:
        return None
    shown = [i for i in range(len(names)) if np.isfinite(found.paired.ratio[-1, i])]
    if not shown:
        return None
    columns: dict[str, Array] = {"samples": found.sizes.astype(float)}
    for i in shown:
        for kind, run in (("plain", found.plain), ("paired", found.paired)):
            columns |= {
                f"{names[i]}, {kind} ratio": run.ratio[:, i],
                f"{names[i]}, {kind} from": run.low[:, i],
                f"{names[i]}, {kind} to": run.high[:, i],
            }
    return Figure(
        name="convergence",
        title="Convergence of the sigma ratios",
        description="Plain and paired sigma ratio of each output against the number of samples, with intervals.",
        panels=[_running(names[i], found, i, content.criterion.tolerance) for i in shown],
        key=(*RUNNING.values(), TOLERANCE),
        columns=columns,
        size=side_by_side(len(shown), 225.0),
        caption="Sigma ratio of the first n samples against n, with individual intervals.",
    )


def _running(name: str, found: Convergence, i: int, tolerance: float) -> Panel:
    sizes = found.sizes.astype(float)
    ends = [getattr(run, side)[:, i] for run in (found.plain, found.paired) for side in ("low", "high")]
    reach = max(float(np.nanmax(np.abs(np.concatenate(ends) - 1.0))), tolerance)
    return Panel(
        name,
        Axis("samples", log=True, link="samples"),
        Axis("σ ratio", low=1.0 - min(reach, 1.0) * 1.05, high=1.0 + min(reach, 10.0) * 1.05),
        [
            Span(TOLERANCE, 1.0 - tolerance, 1.0 + tolerance, level=True),
            Rule(1.0, level=True, colour=LINEAR),
            *_band(sizes, found.plain, i, RUNNING["plain"]),
            *_band(sizes, found.paired, i, RUNNING["paired"]),
        ],
    )


def _band(sizes: Array, run: RunningRatio, i: int, series: Series) -> tuple[Mark, Mark]:
    return Band(series, sizes, run.low[:, i], run.high[:, i], 0.25), Line(series, sizes, run.ratio[:, i])


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
        title="NEES of the Monte Carlo errors",
        description="Histogram and quantile plot of the normalized estimation error squared, with the chi-square "
        f"distribution of {dimension} degrees of freedom.",
        panels=[
            Panel("Distribution", Axis("NEES against the linear covariance", log=log, margin=0.0),
                  Axis("samples", low=0.0),
                  [Steps(flown, edges, counts), Line(theory, centres, by_theory, 2.1), *left_out]),
            Panel("Quantiles", Axis(f"quantile of chi-square, {dimension} degrees"), Axis("NEES"),
                  [Line(theory, [0.0, x[-1]], [0.0, x[-1]], 1.6), Points(quantiles, x, y, 3.5)]),
        ],
        key=(flown, theory, quantiles),
        columns={"NEES from": edges[:-1], "to": edges[1:], "samples": counts, "expected": by_theory},
        caption="NEES follows the chi-square distribution if the errors are normally distributed.",
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
    found = {i: np.sort(flown[:, i])[places] for i in shown}
    dots, straight = Series("flown", "Monte Carlo", FLOWN, "dot"), Series("linear", "linear Gaussian", LINEAR)
    return Figure(
        name="quantiles",
        title="Normal quantile plots",
        description="Quantiles of the Monte Carlo final errors against normal quantiles; the straight line is the "
        "normal distribution of linear analysis.",
        panels=[
            Panel(names[i], Axis("quantile of a normal distribution", "σ"), Axis(names[i], units[i]),
                  [Line(straight, expected, centre[i] + sigma[i] * expected, 1.6),
                   Points(dots, expected, found[i], 3.5)])
            for i in shown
        ],
        key=(dots, straight),
        columns={"normal quantile": expected} | {f"{names[i]} [{units[i]}]": found[i] for i in shown},
        size=side_by_side(len(shown), 240.0),
    )  # fmt: skip
