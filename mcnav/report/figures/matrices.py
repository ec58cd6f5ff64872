"""Heat maps of the final covariance and correlation, linear beside Monte Carlo."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.comparison import Comparison, correlations
from mcnav.analysis.verdict import NUMERICAL
from mcnav.arrays.types import Array, IndexArray
from mcnav.report.drawing.figure import HALF, THIRD, Figure
from mcnav.report.drawing.marks import Axis, Cells, Panel, Series
from mcnav.report.drawing.palette import FLOWN, LINEAR
from mcnav.report.format import fixed, number

if TYPE_CHECKING:
    from mcnav.report.results.model import RunAnalysis

Mask = NDArray[np.bool_]

FEW: Final = 5
"""Outputs with six matrices, three side by side; of more, three large ones are drawn, whose numbers can be read."""

NUMBERED: Final = 15
"""Most outputs whose squares have room for numbers; those of more are lower."""

MOST: Final = 50
"""Outputs that are drawn at most: those whose correlations differ most from the linear ones."""

NIL: Final = 5e-4
"""Covariances below this share of their sigmas' product are shown as zero; the table has their values."""

DEEPEST: Final = 0.5
"""Opacity of a cell of one: ink must read on it, on light paper and on dark."""

SEEN: Final = 1e-3
"""Share of a cell's deepest colour that is seen."""

POSITIVE: Final = Series("positive", "positive", FLOWN, "area")
NEGATIVE: Final = Series("negative", "negative", LINEAR, "area")


def matrices(content: RunAnalysis) -> Figure:
    """Draw covariances over the linear sigmas and correlations: linear, Monte Carlo (paired), and difference.

    Of more outputs than `FEW` the correlations are drawn, linear and Monte Carlo in one matrix, and the differences.
    """
    levels = (content.comparison.confidence_each, content.criterion.confidence)
    each, together = (f"{100.0 * level:.4g} %" for level in levels)
    drawn = _drawn(content.comparison)
    panels = _panels(content, drawn)
    count, few = len(drawn), len(drawn) <= FEW
    left_out = f" Of {len(content.output_names)} outputs it has the {count} whose correlations differ most."
    return Figure(
        name="matrices",
        title=f"Covariances and correlations of the {content.ends.many}",
        description="Covariance and correlation matrices of the outputs: linear, paired Monte Carlo estimate, and "
        "difference, as numbers on coloured squares.",
        panels=panels,
        key=signs_of(panels),
        columns=_columns(content),
        size=THIRD if few else (HALF[0], 60.0 + (36.0 if count <= NUMBERED else 16.0) * count),
        caption=("Colours of covariances are in units of the linear sigmas. " if few else "")
        + ("Columns are in the order of the rows. " if count > NUMBERED else "")
        + "Differences are scaled to their largest entry and coloured only if their interval excludes zero (sigmas at "
        f"{each} each, correlations jointly at {together}). "
        + ("Covariances below 0.0005 σᵢσⱼ are shown as zero." if few else "The table has the covariances.")
        + (left_out if count < len(content.output_names) else ""),
    )


def signs_of(panels: Sequence[Panel]) -> tuple[Series, ...]:
    """Return the key of panels of cells: the signs that one of them shows."""
    shares = [mark.shares for panel in panels for mark in panel.marks if isinstance(mark, Cells)]
    shown = {
        POSITIVE: any((some >= SEEN).any() for some in shares),
        NEGATIVE: any((some <= -SEEN).any() for some in shares),
    }
    return tuple(sign for sign, seen in shown.items() if seen)


def _drawn(comparison: Comparison) -> IndexArray:
    """Return the outputs that are drawn, in their order."""
    paired, linear = (correlations(each) for each in (comparison.covariance_paired, comparison.covariance_linear))
    farthest = np.abs(np.nan_to_num(paired - linear)).max(axis=1)
    return np.sort(np.argsort(-farthest, kind="stable")[:MOST])


def _panels(content: RunAnalysis, drawn: IndexArray) -> list[Panel]:
    """Return the matrices as coloured squares."""
    comparison, names = content.comparison, [content.output_names[i] for i in drawn]
    few, square = len(names) <= FEW, np.outer(content.output_scale, content.output_scale)
    linear, flown = comparison.covariance_linear, comparison.covariance_paired
    sigma = np.sqrt(np.diag(linear))
    scaled = np.outer(sigma, sigma)
    relative = [np.divide(each, scaled, out=np.zeros_like(each), where=scaled > 0.0) for each in (linear, flown)]
    both = [correlations(linear), correlations(flown)]
    change, apart = 100.0 * (relative[1] - relative[0]), 1000.0 * (both[1] - both[0])
    np.fill_diagonal(apart, 0.0)
    certain = certain_differences(comparison, content.criterion.confidence)

    def panel(title: str, colours: Array, values: Array, shown: Callable[[float], str]) -> Panel:
        some = np.ix_(drawn, drawn)
        texts = [[shown(value) for value in row] for row in values[some]]
        axis = Axis(names=names)
        return Panel(title, axis, axis, [Cells(POSITIVE, NEGATIVE, colours[some], texts, DEEPEST)])

    def coefficient(value: float) -> str:
        return "0" if abs(value) < NIL else fixed(value, 3 if few else 2)

    def difference(value: float) -> str:
        return number(value, 2) if few else "0" if abs(value) < 0.05 else fixed(value, 1)

    def covariance(title: str, k: int) -> Panel:
        values = np.where(np.abs(relative[k]) < NIL, 0.0, (linear, flown)[k] * square)
        return panel(title, relative[k], values, lambda value: number(value, 3))

    of_covariances = panel("Difference, % of σᵢσⱼ" if few else "Covariance: difference, % of σᵢσⱼ",
                           _magnified(change, certain[0]), change, difference)  # fmt: skip
    of_correlations = panel("Difference, thousandths" if few else "Correlation: difference, thousandths",
                            _magnified(apart, certain[1]), apart, difference)  # fmt: skip
    if few:
        return [
            covariance("Covariance, linear", 0), covariance("Covariance, paired", 1), of_covariances,
            panel("Correlation, linear", both[0], both[0], coefficient),
            panel("Correlation, paired", both[1], both[1], coefficient), of_correlations,
        ]  # fmt: skip
    halves = np.tril(both[0]) + np.triu(both[1], 1)
    title = "Correlation: linear below, paired above"
    return [panel(title, halves, halves, coefficient), of_correlations, of_covariances]


def _columns(content: RunAnalysis) -> Mapping[str, Sequence[str] | Array]:
    """Return covariances, in the units shown, and correlations of each pair of outputs."""
    names, units, square = content.output_names, content.output_units, np.outer(*2 * [content.output_scale])
    linear, flown = content.comparison.covariance_linear, content.comparison.covariance_paired
    pairs = list(product(range(len(names)), repeat=2))
    rows, across = np.transpose(pairs)
    return {
        "row": [names[i] for i in rows],
        "column": [names[j] for j in across],
        "unit": [f"{units[i]}·{units[j]}" for i, j in pairs],
        "covariance, linear": (linear * square)[rows, across],
        "covariance, Monte Carlo": (flown * square)[rows, across],
        "correlation, linear": correlations(linear)[rows, across],
        "correlation, Monte Carlo": correlations(flown)[rows, across],
    }


def certain_differences(comparison: Comparison, confidence: float) -> tuple[Mask, Mask]:
    """Find the entries of the covariance and of the correlation matrix whose difference is more than chance.

    Correlations take intervals that hold together at the confidence (Bonferroni over all pairs), sigmas those of their
    verdicts. A covariance in units of the linear sigmas is the product of two sigma ratios and a correlation, which
    differs for certain when no values within their three intervals give the linear correlation. What may be numerical
    is no difference.
    """
    ends = [output.paired.interval or (1.0, 1.0) for output in comparison.outputs]
    covariance = np.diag([output.paired.certain for output in comparison.outputs])
    correlation = np.zeros_like(covariance)
    pairs = comparison.joint.correlations if comparison.joint else ()
    for pair in pairs:
        (i, j), difference = pair.between, pair.difference
        low, high = (pair.linear + end for end in difference.interval(1.0 - (1.0 - confidence) / len(pairs)))
        if not np.isfinite((*ends[i], *ends[j], low, high)).all():
            continue
        correlation[i, j] = correlation[j, i] = not low - NUMERICAL <= pair.linear <= high + NUMERICAL
        products = [a * b * c for a, b, c in product(ends[i], ends[j], (low, high))]
        covariance[i, j] = covariance[j, i] = not min(products) - NUMERICAL <= pair.linear <= max(products) + NUMERICAL
    return covariance, correlation


def _magnified(matrix: Array, certain: Mask) -> Array:
    """Scale a matrix by its largest entry, zero where it is not significant."""
    largest = float(np.nanmax(np.abs(matrix), initial=0.0, where=certain))
    return np.where(certain, matrix / largest if largest > 0.0 else matrix, 0.0)
