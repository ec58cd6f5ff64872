"""Dispersion: scatter of each pair of outputs with ellipses, and the distribution of each output."""

from __future__ import annotations

from itertools import combinations
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mcnav.analysis.comparison import correlations
from mcnav.arrays.types import Array
from mcnav.report.drawing.figure import THIRD, Figure, side_by_side
from mcnav.report.drawing.marks import Axis, Line, Mark, Panel, Points, Series, Steps, Text
from mcnav.report.drawing.palette import AREA, FLOWN, INK, LINEAR, POINT
from mcnav.report.results.model import RunAnalysis

SCATTERED: Final = 3_000
"""Points in a scatter plot; statistics always use every sample."""

PAIRS: Final = 10
"""Pairs with so many points; of more pairs, each has fewer."""

NOTABLE: Final = 6
"""Pairs shown first, of more than `PAIRS`: half those that differ most from linear, half the most correlated."""

MOST: Final = 36
"""Pairs drawn at most, those of nine outputs: each takes some 12 kB of a page."""

LABELLED: Final = 3
"""Farthest samples of a pair that carry their index."""

BINS: Final = 63
"""Bins of a histogram."""

FLIGHTS: Final = Series("flights", "samples", POINT, "dot")
ELLIPSES_LINEAR: Final = Series("linear", "linear, 1 and 3 sigma", LINEAR)
ELLIPSES_FLOWN: Final = Series("flown", "Monte Carlo (plain), 1 and 3 sigma", FLOWN)
FARTHEST: Final = Series("farthest", "largest errors, with sample index", INK, "dot")
FARTHEST_OF_KINDS: Final = Series("farthest", "farthest from the mean, with sample index", INK, "dot")


def ordered_pairs(content: RunAnalysis) -> list[tuple[int, int]]:
    """Return the pairs of outputs, of many the `MOST` most different or most correlated ones.

    Of more than `PAIRS` the notable ones come first.
    """
    pairs = list(combinations(content.moving, 2))
    if len(pairs) <= PAIRS:
        return pairs
    linear, flown = (
        np.nan_to_num(correlations(matrix))
        for matrix in (content.comparison.covariance_linear, content.comparison.covariance_paired)
    )
    notable = sorted(pairs, key=lambda pair: -abs(flown[pair] - linear[pair]))[: NOTABLE // 2]
    others = sorted(set(pairs) - set(notable), key=lambda pair: (-abs(flown[pair]), pair))
    notable = sorted(notable + others[: NOTABLE - len(notable)])
    kept = set([pair for pair in [*notable, *others] if pair not in notable][: MOST - len(notable)])
    return notable + [pair for pair in pairs if pair in kept and pair not in notable]


def scatter(content: RunAnalysis) -> Figure | None:
    """Draw final errors of pairs of outputs with the linear and the sample ellipses; none without a pair."""
    pairs, flown, names, units = ordered_pairs(content), content.flown, content.output_names, content.output_units
    if not pairs or len(flown) < 2:
        return None
    most = SCATTERED * PAIRS // max(PAIRS, len(pairs))
    points = flown[:: max(1, -(-len(flown) // most))]
    numbers = content.index[np.isfinite(content.outputs).all(axis=1)]
    rows: list[tuple[object, ...]] = []
    panels = []
    for i, j in pairs:
        far = _farthest(content, flown, [i, j])
        panels.append(_pair(content, points, (i, j), [(int(numbers[k]), flown[k, [i, j]]) for k, _ in far]))
        rows += [
            (f"{names[i]} and {names[j]}", int(numbers[k]), distance, float(flown[k, i]), units[i], float(flown[k, j]),
             units[j])
            for k, distance in far
        ]  # fmt: skip
    every = len(list(combinations(content.moving, 2)))
    left_out = (
        f" Of {every:,} pairs, the {len(pairs)} most different or most correlated are drawn." if every > MOST else ""
    )
    headings = ("pair", "sample", "distance, linear σ", "x", "x unit", "y", "y unit")
    return Figure(
        name="scatter",
        title="Pairs of outputs at the end" if content.several_kinds else "Final errors of pairs of outputs",
        description=f"{len(points):,} of {len(flown):,} samples with linear and Monte Carlo ellipses of one and three "
        "sigma. Labelled: the samples farthest from the mean by the linear covariance.",
        panels=panels,
        key=(FLIGHTS, ELLIPSES_LINEAR, ELLIPSES_FLOWN, FARTHEST_OF_KINDS if content.several_kinds else FARTHEST),
        columns=dict(zip(headings, zip(*rows, strict=True), strict=True)),
        size=THIRD,
        caption=f"{len(points):,} of {len(flown):,} samples are drawn; ellipses use all. The table lists the samples "
        f"farthest from the mean.{left_out}",
        shown=NOTABLE if len(pairs) > PAIRS else 0,
    )


def _farthest(content: RunAnalysis, flown: Array, pair: list[int]) -> list[tuple[int, float]]:
    """Find the samples farthest from the mean in a pair of outputs, as rows and distances in linear sigmas."""
    scale = content.output_scale[pair]
    covariance = content.comparison.covariance_linear[np.ix_(pair, pair)] * np.outer(scale, scale)
    deviations = flown[:, pair] - content.model.outcome_mean[pair] * scale
    inverse = np.linalg.pinv(covariance, hermitian=True)
    distances = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", deviations, inverse, deviations), 0.0))
    count = min(LABELLED, len(flown))
    rows = np.argpartition(-distances, count - 1)[:count]
    return [(int(k), float(distances[k])) for k in rows[np.lexsort((rows, -distances[rows]))]]


def _pair(content: RunAnalysis, points: Array, pair: tuple[int, int], marked: list[tuple[int, Array]]) -> Panel:
    i, j = pair
    scale, comparison = content.output_scale[[i, j]], content.comparison
    square, pick = np.outer(scale, scale), np.ix_([i, j], [i, j])
    linear, flown = content.model.outcome_mean[[i, j]] * scale, comparison.mean_sample[[i, j]] * scale
    far = np.array([place for _, place in marked])
    x, y = (Axis(content.output_names[k], content.output_units[k]) for k in pair)
    return Panel(
        "", x, y,
        [
            Points(FLIGHTS, points[:, i], points[:, j], 1.8, 0.6),
            *ellipses(ELLIPSES_LINEAR, linear, comparison.covariance_linear[pick] * square),
            *ellipses(ELLIPSES_FLOWN, flown, comparison.covariance_sample[pick] * square),
            Points(FARTHEST, far[:, 0], far[:, 1], 4.0, texts=[f"sample {number}" for number, _ in marked],
                   names=[str(number) for number, _ in marked]),
        ],
        about=[content.manifest.model.outputs[k].name for k in pair],
    )  # fmt: skip


def ellipses(series: Series, centre: Array, covariance: Array) -> list[Mark]:
    """Return the ellipses of one and three sigma of a two-dimensional distribution."""
    values, vectors = np.linalg.eigh(covariance)
    angle = np.linspace(0.0, 2.0 * np.pi, 121)
    circle = vectors @ (np.sqrt(np.maximum(values, 0.0))[:, None] * np.array([np.cos(angle), np.sin(angle)]))
    marks = [centre[:, None] + sigma * circle for sigma in (1.0, 3.0)]
    return [Line(series, x, y, 2.0) for x, y in marks]


def histograms(content: RunAnalysis) -> Figure:
    """Draw the distribution of each output against the linear Gaussian, in samples per bin."""
    names, units, scale = content.output_names, content.output_units, content.output_scale
    flown = content.flown
    sigma = np.sqrt(np.diag(content.comparison.covariance_linear)) * scale
    centre = content.model.outcome_mean * scale
    counted, normal = Series("flown", "Monte Carlo", AREA, "area"), Series("linear", "linear Gaussian", LINEAR)
    columns: dict[str, NDArray[Any]] = {}
    panels = []
    for i in content.moving:
        reach = 4.5 * sigma[i] if sigma[i] > 0.0 else np.ptp(flown[:, i]) + 1.0
        edges = np.linspace(centre[i] - reach, centre[i] + reach, BINS + 1)
        counts, _ = np.histogram(flown[:, i], edges)
        columns |= {f"{names[i]} from [{units[i]}]": edges[:-1], f"{names[i]} to [{units[i]}]": edges[1:],
                    f"{names[i]}, samples": counts}  # fmt: skip
        marks: list[Mark] = [Steps(counted, edges, counts)]
        if sigma[i] > 0.0:
            expected = len(flown) * np.diff(special.ndtr((edges - centre[i]) / sigma[i]))
            marks.append(Line(normal, 0.5 * (edges[1:] + edges[:-1]), expected, 2.1))
        outside = len(flown) - int(counts.sum())
        if outside:
            marks.append(Text(f"{outside:,} beyond\nthe plot", corner=True))
        about = (content.manifest.model.outputs[i].name,)
        panels.append(Panel(names[i], Axis(names[i], units[i]), Axis("samples", low=0.0), marks, about=about))
    return Figure(
        name="histograms",
        title="Distribution of each output",
        description=f"Histograms of the Monte Carlo {content.ends.many} with the normal density of linear analysis.",
        panels=panels,
        key=(counted, normal),
        columns=columns,
        size=side_by_side(len(panels), 230.0),
    )
