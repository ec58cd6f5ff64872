"""Heat maps of the final covariance and correlation, linear beside Monte Carlo."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array
from mcnav.analysis.comparison import Comparison, correlations
from mcnav.report.figures.figure import HALF, THIRD, Figure
from mcnav.report.figures.marks import Axis, Cells, Panel, Series
from mcnav.report.figures.palette import FLOWN, LINEAR
from mcnav.report.format import fixed, number
from mcnav.report.model import RunAnalysis

Mask = NDArray[np.bool_]

FEW: Final = 5
"""Outputs whose matrices are three side by side; larger ones are two, so that their numbers can be read."""

NIL: Final = 5e-4
"""Covariances below this share of their sigmas' product are shown as zero; the table has their values."""

DEEPEST: Final = 0.5
"""Opacity of a cell of one: ink must read on it, on light paper and on dark."""

POSITIVE: Final = Series("positive", "positive", FLOWN, "area")
NEGATIVE: Final = Series("negative", "negative", LINEAR, "area")


def matrices(content: RunAnalysis) -> Figure:
    """Draw covariances over the linear sigmas and correlations: linear, Monte Carlo (paired), and difference."""
    comparison, names = content.comparison, content.output_names
    square = np.outer(content.output_scale, content.output_scale)
    linear, flown = comparison.covariance_linear, comparison.covariance_paired
    sigma = np.sqrt(np.diag(linear))
    scaled = np.outer(sigma, sigma)
    relative = [np.divide(each, scaled, out=np.zeros_like(each), where=scaled > 0.0) for each in (linear, flown)]
    both = [correlations(linear), correlations(flown)]
    columns: dict[str, list[object]] = {}
    for i, j in product(range(len(names)), repeat=2):
        row: dict[str, object] = (
            {"row": names[i], "column": names[j],
             "unit": f"{content.output_units[i]}·{content.output_units[j]}",
             "covariance, linear": float(linear[i, j] * square[i, j]),
             "covariance, Monte Carlo": float(flown[i, j] * square[i, j]),
             "correlation, linear": float(both[0][i, j]), "correlation, Monte Carlo": float(both[1][i, j])}
        )  # fmt: skip
        for heading, value in row.items():
            columns.setdefault(heading, []).append(value)
    nil = np.abs(relative) < NIL
    change = 100.0 * (relative[1] - relative[0])
    apart = 1000.0 * (both[1] - both[0])
    np.fill_diagonal(apart, 0.0)
    certain = certain_differences(content.comparison, content.criterion.confidence)

    def panel(title: str, colours: Array, values: Array, shown: Callable[[float], str]) -> Panel:
        texts = [[shown(value) for value in row] for row in values]
        axis = Axis(names=names)
        return Panel(title, axis, axis, [Cells(POSITIVE, NEGATIVE, colours, texts, DEEPEST)])

    def coefficient(value: float) -> str:
        return "0" if abs(value) < NIL else fixed(value, 3 if len(names) <= FEW else 2)

    each, together = (f"{100.0 * level:.4g} %" for level in (comparison.confidence_each, content.criterion.confidence))
    panels = [
        panel(
            "Covariance, linear", relative[0], np.where(nil[0], 0.0, linear * square), lambda value: number(value, 3)
        ),
        panel(
            "Covariance, paired",
            relative[1],
            np.where(nil[1], 0.0, flown * square),
            lambda value: number(value, 3),
        ),
        panel("Difference, % of σᵢσⱼ", _magnified(change, certain[0]), change, lambda value: number(value, 2)),
        panel("Correlation, linear", both[0], both[0], coefficient),
        panel("Correlation, paired", both[1], both[1], coefficient),
        panel("Difference, thousandths", _magnified(apart, certain[1]), apart, lambda value: number(value, 2)),
    ]
    return Figure(
        name="matrices",
        title="Covariances and correlations of the final errors",
        description="Covariance and correlation matrices of the outputs: linear, paired Monte Carlo estimate, and "
        "difference, as numbers on coloured squares.",
        panels=panels,
        key=(POSITIVE, NEGATIVE),
        columns=columns,
        size=THIRD if len(names) <= FEW else (HALF[0], 60.0 + 36.0 * len(names)),
        caption="Colours of covariances are in units of the linear sigmas. Differences are scaled to their largest "
        f"entry and coloured only if their interval excludes zero (sigmas at {each} each, correlations jointly at "
        f"{together}). Covariances below 0.0005 σᵢσⱼ are shown as zero.",
    )  # fmt: skip


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
