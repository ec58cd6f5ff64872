"""Does linear hold: sigma ratios against the tolerance and magnified, their convergence, NEES against chi-square."""

from __future__ import annotations

from functools import partial

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from scipy import special

from mcnav._types import Array, IndexArray
from mcnav.analysis.convergence import Convergence, RunningRatio
from mcnav.report.figures.figure import HALF, Figure, Plot, Series, dots, plainly
from mcnav.report.model import RunAnalysis
from mcnav.report.svg import AREA, BAND, FLOWN, LINEAR, MUTED

PAIRED, PLAIN = "Monte Carlo, paired estimate", "Monte Carlo, plain sample"
RATIOS = {"paired": Series("paired", PAIRED, FLOWN, "dot"), "plain": Series("plain", PLAIN, MUTED, "square")}
RUNNING = {"paired": Series("paired", PAIRED, FLOWN), "plain": Series("plain", PLAIN, MUTED, "dashed")}
TOLERANCE = Series("tolerance", "tolerance", BAND, "area")
QUANTILES = 121
"""Points of a quantile plot."""


def sigma_ratios(content: RunAnalysis) -> Figure:
    """Forest plot of the sigma ratios against the tolerance, and the paired ones magnified."""
    outputs, names = content.comparison.outputs, content.output_names
    kinds = {"paired": [output.paired for output in outputs], "plain": [output.plain for output in outputs]}
    frame: dict[str, list[object]] = {"output": list(names)}
    for kind, judged in kinds.items():
        frame[f"{kind} sigma ratio"] = [_number(each.ratio) for each in judged]
        for side in (0, 1):
            bounds = [each.interval[side] if each.interval else None for each in judged]
            frame[f"{kind} interval {('from', 'to')[side]}"] = [_number(bound) for bound in bounds]
    data = pd.DataFrame(frame)
    tolerance = 100.0 * content.criterion.tolerance

    def whole(axes: Axes) -> None:
        _ratios(axes, data, ("paired", "plain"))
        axes.axvspan(-tolerance, tolerance, color=BAND, zorder=0, gid=TOLERANCE.gid)
        low, high = axes.get_xlim()
        axes.set_xlim(min(low, -1.2 * tolerance), max(high, 1.2 * tolerance))

    def magnified(axes: Axes) -> None:
        _ratios(axes, data, ("paired",))
        if tolerance < max(map(abs, axes.get_xlim())):
            axes.axvspan(-tolerance, tolerance, color=BAND, zorder=0, gid=TOLERANCE.gid)

    return Figure(
        key="ratios",
        title="Monte Carlo sigma over linear sigma",
        description="Difference between Monte Carlo and linear sigma of each output with its interval, and the "
        "tolerance around zero.",
        plots=[Plot("Compared with the tolerance", whole), Plot("Paired estimate, magnified", magnified)],
        series=(*RATIOS.values(), TOLERANCE),
        data=data,
        size=(HALF[0], 1.1 + 0.42 * len(names)),
    )


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)


def _ratios(axes: Axes, data: pd.DataFrame, kinds: tuple[str, ...]) -> None:
    axes.axvline(0.0, color=LINEAR, linewidth=1.2)
    for place, kind in enumerate(kinds):
        shift, series = 0.33 * (place - 0.5 * (len(kinds) - 1)), RATIOS[kind]
        for row, (ratio, low, high) in enumerate(
            data[[f"{kind} sigma ratio", f"{kind} interval from", f"{kind} interval to"]].to_numpy(dtype=float)
        ):
            if not np.isfinite([ratio, low, high]).all():
                continue
            ends = [100.0 * (low - 1.0), 100.0 * (high - 1.0)]
            axes.plot(ends, [row + shift] * 2, color=series.colour, linewidth=2.0, gid=series.gid)
            series.on(axes, 100.0 * (ratio - 1.0), row + shift, markersize=5.5)
    axes.set_yticks(range(len(data)), list(data["output"]))
    axes.set_ylim(len(data) - 0.5, -0.5)
    axes.grid(axis="y", visible=False)
    axes.locator_params(axis="x", nbins=6)
    axes.set_xlabel("Monte Carlo σ relative to linear σ (%)")


def running_ratios(content: RunAnalysis) -> Figure | None:
    """Plain and paired sigma ratios from the first samples on; none when there is nothing to show."""
    found, names = content.convergence, content.output_names
    if found is None or len(found.sizes) < 2:
        return None
    shown = [i for i in range(len(names)) if np.isfinite(found.paired.ratio[-1, i])]
    if not shown:
        return None
    frame: dict[str, Array] = {"samples": found.sizes.astype(float)}
    for i in shown:
        for kind, run in (("plain", found.plain), ("paired", found.paired)):
            frame |= {
                f"{names[i]}, {kind} ratio": run.ratio[:, i],
                f"{names[i]}, {kind} from": run.low[:, i],
                f"{names[i]}, {kind} to": run.high[:, i],
            }
    tolerance = content.criterion.tolerance
    return Figure(
        key="convergence",
        title="Convergence of the sigma ratios",
        description="Plain and paired sigma ratio of each output against the number of samples, with intervals.",
        plots=[Plot(names[i], partial(_running, found=found, i=i, tolerance=tolerance)) for i in shown],
        series=(*RUNNING.values(), TOLERANCE),
        data=pd.DataFrame(frame),
        size=(HALF[0], 2.3),
        caption="Sigma ratio of the first n samples against n, with individual intervals.",
    )


def _running(axes: Axes, found: Convergence, i: int, tolerance: float) -> None:
    axes.axhspan(1.0 - tolerance, 1.0 + tolerance, color=BAND, zorder=0, gid=TOLERANCE.gid)
    axes.axhline(1.0, color=LINEAR, linewidth=1.0)
    _band(axes, found.sizes.astype(float), found.plain, i, RUNNING["plain"])
    _band(axes, found.sizes.astype(float), found.paired, i, RUNNING["paired"])
    axes.set_xscale("log")
    plainly(axes.xaxis)
    ends = [getattr(run, side)[:, i] for run in (found.plain, found.paired) for side in ("low", "high")]
    reach = max(float(np.nanmax(np.abs(np.concatenate(ends) - 1.0))), tolerance)
    axes.set_ylim(1.0 - min(reach, 1.0) * 1.05, 1.0 + min(reach, 10.0) * 1.05)
    axes.set_xlabel("samples")


def _band(axes: Axes, sizes: Array, run: RunningRatio, i: int, series: Series) -> None:
    series.band(axes, sizes, run.low[:, i], run.high[:, i], 0.25)
    series.on(axes, sizes, run.ratio[:, i])


def nees(content: RunAnalysis) -> Figure | None:
    """NEES against the chi-square distribution that linear analysis expects: histogram and quantiles."""
    ellipsoid = content.comparison.ellipsoid
    if ellipsoid is None:
        return None
    dimension, values = ellipsoid.dimension, np.sort(ellipsoid.values)
    expected = float(special.chdtri(dimension, 5e-4))
    top = min(max(expected, float(np.quantile(values, 0.98))), 10.0 * expected)
    edges = np.linspace(0.0, top, 61)
    counts, _ = np.histogram(values, edges)
    outside = len(values) - int(counts.sum())
    centres = 0.5 * (edges[1:] + edges[:-1])
    flown = Series("flown", "Monte Carlo", AREA, "area")
    theory = Series("linear", f"chi-square, {dimension} degrees", LINEAR)

    def density(x: Array) -> Array:
        half = 0.5 * dimension
        log = special.xlogy(half - 1.0, x) - 0.5 * x - special.gammaln(half) - half * np.log(2.0)
        return np.asarray(np.exp(log))

    def histogram(axes: Axes) -> None:
        axes.stairs(counts / (len(values) * np.diff(edges)), edges, fill=True, color=AREA, gid=flown.gid)
        x = np.linspace(0.25 * edges[1], top, 200)  # with one degree the density has a pole at zero
        axes.plot(x, density(x), color=LINEAR, linewidth=1.6, gid=theory.gid)
        axes.set(xlabel="NEES against the linear covariance", yticks=[], ylim=(0.0, None))
        if outside:
            axes.annotate(f"{outside:,} of {len(values):,}\nbeyond the plot", (0.98, 0.9), ha="right", va="top",
                          xycoords="axes fraction", fontsize=8)  # fmt: skip

    def quantiles(axes: Axes) -> None:
        places = _places(len(values))
        x, y = special.chdtri(dimension, 1.0 - (places + 0.5) / len(values)), values[places]
        dots(axes, np.column_stack((x, y)), FLOWN, 2.6, "series-quantiles")
        reach = [0.0, float(x[-1])]
        axes.plot(reach, reach, color=LINEAR, linewidth=1.2, gid=theory.gid)
        axes.set(xlabel=f"quantile of chi-square, {dimension} degrees", ylabel="NEES")

    return Figure(
        key="nees",
        title="NEES of the Monte Carlo errors",
        description=f"Histogram and quantile plot of the normalized estimation error squared, with the chi-square "
        f"distribution of {dimension} degrees of freedom.",
        plots=[Plot("Distribution", histogram), Plot("Quantiles", quantiles)],
        series=(flown, theory, Series("quantiles", "sample quantiles", FLOWN, "dot")),
        data=pd.DataFrame({"NEES from": edges[:-1], "to": edges[1:], "samples": counts,
                           "expected": len(values) * np.diff(edges) * density(centres)}),
        caption="NEES follows the chi-square distribution if the errors are normally distributed.",
    )  # fmt: skip


def _places(count: int) -> IndexArray:
    """Ranks shown of so many sorted values: evenly spaced on the scale of a normal quantile, and both ends."""
    reach = float(special.ndtri((count - 0.5) / count)) if count > 1 else 0.0
    ranks = special.ndtr(np.linspace(-reach, reach, QUANTILES)) * count - 0.5
    return np.unique(np.clip(np.rint(ranks), 0, count - 1).astype(np.int64))


def normal_quantiles(content: RunAnalysis) -> Figure | None:
    """Quantiles of each output against those of the linear Gaussian."""
    flown, scale, names, units = content.flown, content.output_scale, content.output_names, content.output_units
    sigma = np.sqrt(np.diag(content.comparison.covariance_linear)) * scale
    centre = content.model.outcome_mean * scale
    shown = [i for i in content.moving if sigma[i] > 0.0]
    if not shown or len(flown) < 2:
        return None
    places = _places(len(flown))
    expected = special.ndtri((places + 0.5) / len(flown))
    found = {i: np.sort(flown[:, i])[places] for i in shown}

    def draw(axes: Axes, i: int) -> None:
        axes.plot(expected, centre[i] + sigma[i] * expected, color=LINEAR, linewidth=1.2, gid="series-linear")
        dots(axes, np.column_stack((expected, found[i])), FLOWN, 2.6, "series-flown")
        axes.set(xlabel="quantile of a normal distribution (σ)", ylabel=f"{names[i]} ({units[i]})")

    frame = {"normal quantile": expected} | {f"{names[i]} [{units[i]}]": found[i] for i in shown}
    return Figure(
        key="quantiles",
        title="Normal quantile plots",
        description="Quantiles of the Monte Carlo final errors against normal quantiles; the straight line is the "
        "normal distribution of linear analysis.",
        plots=[Plot(names[i], partial(draw, i=i)) for i in shown],
        series=(Series("flown", "Monte Carlo", FLOWN, "dot"), Series("linear", "linear Gaussian", LINEAR)),
        data=pd.DataFrame(frame),
        size=(HALF[0], 2.5),
    )
