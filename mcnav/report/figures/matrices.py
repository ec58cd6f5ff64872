"""Heat maps of the final covariance and correlation, linear beside Monte Carlo."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from mcnav._types import Array
from mcnav.analysis.comparison import Comparison, correlations
from mcnav.report.figures.figure import THIRD, Figure, Plot, Series
from mcnav.report.format import fixed, number
from mcnav.report.model import RunAnalysis
from mcnav.report.svg import FLOWN, LINEAR

Mask = NDArray[np.bool_]

FEW = 4
"""Outputs whose numbers are as large as other text; those of more shrink."""

NIL = 5e-4
"""Covariances below this share of their sigmas' product are told as being nearly zero; the table has them."""

DEEPEST = 0.5
"""Opacity of a cell of one: ink must read on it, on light paper and on dark."""


def matrices(content: RunAnalysis) -> Figure:
    """Covariances scaled by the linear sigmas, and correlations: linear, Monte Carlo (paired), and their difference."""
    comparison, names = content.comparison, content.output_names
    square = np.outer(content.output_scale, content.output_scale)
    linear, flown = comparison.covariance_linear, comparison.covariance_paired
    sigma = np.sqrt(np.diag(linear))
    scaled = np.outer(sigma, sigma)
    relative = [np.divide(each, scaled, out=np.zeros_like(each), where=scaled > 0.0) for each in (linear, flown)]
    both = [correlations(linear), correlations(flown)]
    rows = []
    for i, j in product(range(len(names)), repeat=2):
        rows.append(
            {"row": names[i], "column": names[j],
             "unit": f"{content.output_units[i]}·{content.output_units[j]}",
             "covariance, linear": float(linear[i, j] * square[i, j]),
             "covariance, Monte Carlo": float(flown[i, j] * square[i, j]),
             "correlation, linear": float(both[0][i, j]), "correlation, Monte Carlo": float(both[1][i, j])}
        )  # fmt: skip
    nil = np.abs(relative) < NIL
    change = 100.0 * (relative[1] - relative[0])
    apart = 1000.0 * (both[1] - both[0])
    np.fill_diagonal(apart, 0.0)
    certain = certain_differences(content.comparison, content.criterion.confidence)

    def plot(title: str, colours: Array, values: Array, shown: Callable[[float], str]) -> Plot:
        return Plot(title, lambda axes: _heat_map(axes, colours, names, [[shown(v) for v in row] for row in values]))

    each, together = (f"{100.0 * level:.4g} %" for level in (comparison.confidence_each, content.criterion.confidence))
    plots = [
        plot("Covariance, linear", relative[0], np.where(nil[0], 0.0, linear * square), lambda value: number(value, 3)),
        plot("Covariance, paired", relative[1], np.where(nil[1], 0.0, flown * square), lambda value: number(value, 3)),
        plot("Difference, % of σᵢσⱼ", _magnified(change, certain[0]), change, lambda value: number(value, 2)),
        plot("Correlation, linear", both[0], both[0], _coefficient),
        plot("Correlation, paired", both[1], both[1], _coefficient),
        plot("Difference, thousandths", _magnified(apart, certain[1]), apart, lambda value: number(value, 2)),
    ]
    return Figure(
        key="matrices",
        title="Covariances and correlations of the final errors",
        description="Covariance and correlation matrices of the outputs: linear, paired Monte Carlo estimate, and "
        "difference, as numbers on coloured squares.",
        plots=plots,
        series=(Series("positive", "positive", FLOWN, "area"), Series("negative", "negative", LINEAR, "area")),
        data=pd.DataFrame(rows),
        size=THIRD,
        caption="Colours of covariances are in units of the linear sigmas. Differences are scaled to their largest "
        f"entry and coloured only if their interval excludes zero (sigmas at {each} each, correlations jointly at "
        f"{together}). Covariances below 0.0005 σᵢσⱼ are shown as zero.",
    )  # fmt: skip


def _coefficient(value: float) -> str:
    return "0" if abs(value) < NIL else fixed(value, 3)


def certain_differences(comparison: Comparison, confidence: float) -> tuple[Mask, Mask]:
    """Find the entries of the covariance and of the correlation matrix whose difference is more than chance.

    Correlations take intervals that hold together at the confidence (Bonferroni over all pairs), sigmas those of their
    verdicts. A covariance in units of the linear sigmas is the product of two sigma ratios and a correlation, which
    differs for certain when no values within their three intervals give the linear correlation.
    """
    ends = [output.paired.interval or (1.0, 1.0) for output in comparison.outputs]
    covariance = np.diag([output.paired.certain for output in comparison.outputs])
    correlation = np.zeros_like(covariance)
    pairs = comparison.joint.correlations if comparison.joint else ()
    for pair in pairs:
        (i, j), found = pair.between, pair.difference
        low, high = (pair.linear + end for end in found.interval(1.0 - (1.0 - confidence) / len(pairs)))
        if not np.isfinite((*ends[i], *ends[j], low, high)).all():
            continue
        correlation[i, j] = correlation[j, i] = not low <= pair.linear <= high
        products = [a * b * c for a, b, c in product(ends[i], ends[j], (low, high))]
        covariance[i, j] = covariance[j, i] = not min(products) <= pair.linear <= max(products)
    return covariance, correlation


def _magnified(matrix: Array, certain: Mask) -> Array:
    """Scale a matrix by its largest entry, zero where it is not significant."""
    largest = float(np.nanmax(np.abs(matrix), initial=0.0, where=certain))
    return np.where(certain, matrix / largest if largest > 0.0 else matrix, 0.0)


def _heat_map(axes: Axes, colours: Array, names: list[str], shown: list[list[str]]) -> None:
    """Squares whose opacity says how large an entry is and whose colour its sign, with the entry as number."""
    largest = 8.0 if len(names) <= FEW else 6.0
    for (row, column), share in np.ndenumerate(colours):
        if not np.isfinite(share):
            continue
        colour, gid = (FLOWN, "series-positive") if share >= 0.0 else (LINEAR, "series-negative")
        opacity = DEEPEST * min(abs(float(share)), 1.0)
        axes.add_artist(Rectangle((column - 0.5, row - 0.5), 1.0, 1.0, facecolor=colour, alpha=opacity, gid=gid))
        text = shown[row][column]
        axes.text(column, row, text, ha="center", va="center", fontsize=largest * min(1.0, 6.5 / len(text)))
    axes.set_xticks(range(len(names)), names, rotation=30, ha="right", rotation_mode="anchor")
    axes.set_yticks(range(len(names)), names)
    axes.set(xlim=(-0.5, len(names) - 0.5), ylim=(len(names) - 0.5, -0.5))
    axes.grid(visible=False)
    axes.tick_params(length=0.0)
    axes.spines[:].set_visible(False)
