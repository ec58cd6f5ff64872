"""Dispersion: scatter of each pair of outputs with ellipses, and the distribution of each output."""

from __future__ import annotations

from functools import partial
from itertools import combinations
from typing import Any, Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import Ellipse
from numpy.typing import NDArray

from mcnav._types import Array
from mcnav.report.figures.figure import HALF, THIRD, Figure, Plot, Series, dots
from mcnav.report.model import RunAnalysis
from mcnav.report.svg import AREA, FLOWN, INK, LINEAR, POINT

SCATTERED: Final = 3_000
"""Points in a scatter plot; statistics always use every sample."""

PAIRS: Final = 15
"""Scatter plots, at most: every pair of six outputs."""

LABELLED: Final = 3
"""Farthest samples of a pair that carry their index."""

FLIGHTS = Series("flights", "samples", POINT, "dot")
ELLIPSES_LINEAR = Series("linear", "linear, 1 and 3 sigma", LINEAR)
ELLIPSES_FLOWN = Series("flown", "Monte Carlo (plain), 1 and 3 sigma", FLOWN, "dashed")
FARTHEST = Series("farthest", "largest errors, with sample index", INK, "dot")


def scatter(content: RunAnalysis) -> Figure | None:
    """Flown final errors of each pair of outputs with the linear and the sample ellipses; none without a pair."""
    pairs = list(combinations(content.moving, 2))[:PAIRS]
    flown, names, units = content.flown, content.output_names, content.output_units
    if not pairs or len(flown) < 2:
        return None
    points = flown[:: max(1, -(-len(flown) // SCATTERED))]
    numbers = content.index[np.isfinite(content.outputs).all(axis=1)]
    frame = []
    plots = []
    for i, j in pairs:
        far = _farthest(content, flown, [i, j])
        frame += [
            {"pair": f"{names[i]} and {names[j]}", "sample": int(numbers[k]), "distance, linear σ": float(distance),
             "x": float(flown[k, i]), "x unit": units[i], "y": float(flown[k, j]), "y unit": units[j]}
            for k, distance in far
        ]  # fmt: skip
        marked = [(int(numbers[k]), flown[k, [i, j]]) for k, _ in far]
        plots.append(Plot("", partial(_pair, content=content, points=points, pair=(i, j), marked=marked)))
    return Figure(
        key="scatter",
        title="Final errors of pairs of outputs",
        description=f"{len(points):,} of {len(flown):,} samples with linear and Monte Carlo ellipses of one and three "
        "sigma; the samples farthest from the mean by the linear covariance are labelled.",
        plots=plots,
        series=(FLIGHTS, ELLIPSES_LINEAR, ELLIPSES_FLOWN, FARTHEST),
        data=pd.DataFrame(frame),
        size=THIRD,
        caption=f"{len(points):,} of {len(flown):,} samples are drawn; ellipses use all. The table lists the samples "
        "farthest from the mean.",
    )


def _farthest(content: RunAnalysis, flown: Array, pair: list[int]) -> list[tuple[int, float]]:
    """Rows of the flights farthest out in a pair of outputs by the linear covariance, and how far; farthest first."""
    scale = content.output_scale[pair]
    covariance = content.comparison.covariance_linear[np.ix_(pair, pair)] * np.outer(scale, scale)
    deviations = flown[:, pair] - content.model.outcome_mean[pair] * scale
    inverse = np.linalg.pinv(covariance, hermitian=True)
    distances = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", deviations, inverse, deviations), 0.0))
    count = min(LABELLED, len(flown))
    rows = np.argpartition(-distances, count - 1)[:count]
    return [(int(k), float(distances[k])) for k in rows[np.lexsort((rows, -distances[rows]))]]


def _pair(
    axes: Axes, content: RunAnalysis, points: Array, pair: tuple[int, int], marked: list[tuple[int, Array]]
) -> None:
    i, j = pair
    scale, comparison = content.output_scale[[i, j]], content.comparison
    square, pick = np.outer(scale, scale), np.ix_([i, j], [i, j])
    dots(axes, points[:, [i, j]], POINT, 1.3, FLIGHTS.gid, 0.6)
    _ellipses(axes, content.model.outcome_mean[[i, j]] * scale, comparison.covariance_linear[pick] * square,
              ELLIPSES_LINEAR, "-")  # fmt: skip
    _ellipses(axes, comparison.mean_sample[[i, j]] * scale, comparison.covariance_sample[pick] * square,
              ELLIPSES_FLOWN, "--")  # fmt: skip
    for number, place in marked:
        axes.plot(*place, "o", color=INK, markersize=3.0, gid=f"tip-sample {number}")
        axes.annotate(
            f"{number}",
            (float(place[0]), float(place[1])),
            xytext=(3, 2),
            textcoords="offset points",
            fontsize=7,
            gid=FARTHEST.gid,
        )
    axes.autoscale_view()
    axes.locator_params(nbins=5)
    axes.set_xlabel(f"{content.output_names[i]} ({content.output_units[i]})")
    axes.set_ylabel(f"{content.output_names[j]} ({content.output_units[j]})")


def _ellipses(axes: Axes, centre: Array, covariance: Array, series: Series, style: str) -> None:
    """Ellipses of one and three sigma."""
    values, vectors = np.linalg.eigh(covariance)
    angle = float(np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1])))
    for sigma in (1.0, 3.0):
        height, width = 2.0 * sigma * np.sqrt(np.maximum(values, 0.0))
        axes.add_patch(
            Ellipse((float(centre[0]), float(centre[1])), width, height, angle=angle, fill=False,
                    edgecolor=series.colour, linestyle=style, linewidth=1.5, gid=series.gid)
        )  # fmt: skip


def histograms(content: RunAnalysis) -> Figure:
    """Distribution of each output against the linear Gaussian."""
    names, units, scale = content.output_names, content.output_units, content.output_scale
    flown = content.flown
    sigma = np.sqrt(np.diag(content.comparison.covariance_linear)) * scale
    centre = content.model.outcome_mean * scale
    bins = {}
    for i in content.moving:
        reach = 4.5 * sigma[i] if sigma[i] > 0.0 else np.ptp(flown[:, i]) + 1.0
        edges = np.linspace(centre[i] - reach, centre[i] + reach, 64)
        bins[i] = (edges, np.histogram(flown[:, i], edges)[0])

    def draw(axes: Axes, i: int) -> None:
        edges, counts = bins[i]
        axes.stairs(counts / (len(flown) * np.diff(edges)), edges, fill=True, color=AREA, gid="series-flown")
        if sigma[i] > 0.0:
            x = np.linspace(edges[0], edges[-1], 150)
            bell = np.exp(-0.5 * ((x - centre[i]) / sigma[i]) ** 2) / (sigma[i] * np.sqrt(2.0 * np.pi))
            axes.plot(x, bell, color=LINEAR, linewidth=1.6, gid="series-linear")
        axes.set_xlabel(f"{names[i]} ({units[i]})")
        axes.locator_params(axis="x", nbins=7)
        axes.set_yticks([])
        axes.set_ylim(bottom=0.0)
        outside = len(flown) - int(counts.sum())
        if outside:
            axes.annotate(f"{outside:,} beyond\nthe plot", (0.99, 0.95), ha="right", va="top",
                          xycoords="axes fraction", fontsize=8)  # fmt: skip

    frame: dict[str, NDArray[Any]] = {}
    for i, (edges, counts) in bins.items():
        frame |= {f"{names[i]} from [{units[i]}]": edges[:-1], f"{names[i]} to [{units[i]}]": edges[1:],
                  f"{names[i]}, samples": counts}  # fmt: skip
    return Figure(
        key="histograms",
        title="Distribution of each output",
        description="Histograms of the Monte Carlo final errors with the normal density of linear analysis.",
        plots=[Plot(names[i], partial(draw, i=i)) for i in content.moving],
        series=(Series("flown", "Monte Carlo", AREA, "area"), Series("linear", "linear Gaussian", LINEAR)),
        data=pd.DataFrame(frame),
        size=(HALF[0], 2.4),
    )
