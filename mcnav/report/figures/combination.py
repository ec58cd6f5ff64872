"""Samples along the combination of outputs in which their joint distribution is not that of linear analysis."""

from __future__ import annotations

from typing import Final

import numpy as np
from markupsafe import Markup
from scipy import special

from mcnav.analysis.combinations import Combination
from mcnav.arrays.types import Array
from mcnav.report.drawing.figure import Figure
from mcnav.report.drawing.marks import Axis, Line, Mark, Panel, Points, Rule, Series, Steps, Text
from mcnav.report.drawing.palette import AREA, LINEAR
from mcnav.report.figures.dispersion import ELLIPSES_LINEAR, FLIGHTS, SCATTERED, ellipses
from mcnav.report.results.model import RunAnalysis
from mcnav.report.statements.joint import combination_words, direction_words

COUNTED: Final = Series("flown", "Monte Carlo", AREA, "area")
NORMAL: Final = Series("normal", "linear Gaussian", LINEAR)

POINTS: Final = 161
"""Points of a density."""

BINS: Final = 60
"""Bins of the histogram."""

REACH: Final = 4.5
"""Linear sigmas that the histogram shows at least."""

LONGEST: Final = 28
"""Characters of an axis's label; a combination whose words are longer has the name of its direction there."""

TALLEST: Final = 1.3
"""Height of the histogram's panel over that of its highest bin: a density that is narrower ends beyond it."""


def combination(content: RunAnalysis) -> Figure | None:
    """Draw a histogram of the samples along the combination, and the output that best explains it beside it.

    None where the joint distribution agrees, or too few samples are stored.
    """
    ellipsoid, joint = content.comparison.ellipsoid, content.summary.joint
    entry = None if joint is None else joint.foremost
    figure = None if ellipsoid is None else ellipsoid.foremost
    if figure is None or entry is None or len(content.flown) < 2:
        return None
    scale, unit = float(content.output_scale[figure.lead]), content.output_units[figure.lead]
    label, direction = combination_words(entry, content.summary), direction_words(entry, content.summary)
    short = label if len(label) <= LONGEST else direction
    values = scale * (content.flown / content.output_scale) @ figure.weights
    centre, sigma = scale * float(content.model.outcome_mean @ figure.weights), scale * figure.sigma_linear
    edges, counts, expected = _histogram(values, centre, sigma)
    upward = Axis("samples", low=0.0, high=TALLEST * float(counts.max()))
    along = [Steps(COUNTED, edges, counts), *_linear(edges, len(values), centre, sigma)]
    panels, key = [Panel(f"Samples along the {direction}", Axis(short, unit), upward, along)], [COUNTED, NORMAL]
    beside = _explaining(content, figure, values)
    if beside is not None:
        panels.append(_scatter(content, figure, values, beside, Axis(short, unit)))
        key += [FLIGHTS, ELLIPSES_LINEAR]
    samples = f"{len(values):,} samples"
    if content.summary.kept:
        samples = f"the first {len(values):,} of {content.summary.samples:,} samples, which are stored"
    return Figure(
        name="combination",
        title=f"Samples along the {direction}",
        description="Histogram of the combination of outputs in which simulation and linear analysis differ most. Its "
        "curve is the normal density of linear analysis. Beside it: scatter against the output that best explains it.",
        panels=panels,
        key=key,
        columns={f"from [{unit}]": edges[:-1], f"to [{unit}]": edges[1:], "samples": counts, "expected": expected},
        caption=Markup("<code>{}</code>: {}.").format(label, samples),
    )


def _linear(edges: Array, count: int, centre: float, sigma: float) -> list[Mark]:
    """Return the density of linear analysis in samples per bin: a line across without dispersion."""
    if sigma <= 0.0:
        return [Rule(centre, colour=LINEAR, width=2.1, series=NORMAL), Text("linear: no dispersion", corner=True)]
    x = np.linspace(max(edges[0], centre - REACH * sigma), min(edges[-1], centre + REACH * sigma), POINTS)
    density = np.exp(-0.5 * ((x - centre) / sigma) ** 2) / (sigma * np.sqrt(2.0 * np.pi))
    return [Line(NORMAL, x, count * (edges[1] - edges[0]) * density, 2.1)]


def _histogram(values: Array, centre: float, sigma: float) -> tuple[Array, Array, Array]:
    """Return the edges of a histogram of values, and the counted and linear samples of its bins."""
    low, high = min(float(values.min()), centre - REACH * sigma), max(float(values.max()), centre + REACH * sigma)
    margin = 0.02 * (high - low) or 1.0
    edges = np.linspace(low - margin, high + margin, BINS + 1)
    counts, _ = np.histogram(values, edges)
    if sigma > 0.0:
        expected = len(values) * np.diff(special.ndtr((edges - centre) / sigma))
    else:
        expected = np.where((edges[:-1] <= centre) & (centre < edges[1:]), float(len(values)), 0.0)
    return edges, counts.astype(float), expected


def _explaining(content: RunAnalysis, explaining: Combination, values: Array) -> int | None:
    """Return the output of which the values are most nearly a quadratic function; none where there is one output."""
    several = [
        i for i in content.moving if not (explaining.weights[i] != 0.0 and np.count_nonzero(explaining.weights) == 1)
    ]
    best, least = None, np.inf
    for i in several:
        x = content.flown[:, i]
        x = (x - x.mean()) / (x.std() or 1.0)
        design = np.column_stack([np.ones_like(x), x, x * x])
        rest = values - design @ np.linalg.lstsq(design, values, rcond=None)[0]
        if (size := float(rest @ rest)) < least:
            best, least = i, size
    return best


def _scatter(content: RunAnalysis, panel: Combination, values: Array, i: int, upward: Axis) -> Panel:
    """Draw the combination against output i with the linear ellipses."""
    scale, own = content.output_scale[i], content.output_scale[panel.lead]
    covariance, mean = content.comparison.covariance_linear, content.model.outcome_mean
    crossed = float(covariance[i] @ panel.weights) * scale * own if panel.sigma_linear > 0.0 else 0.0
    variance = (panel.sigma_linear * own) ** 2
    both = np.array([[covariance[i, i] * scale**2, crossed], [crossed, variance]])
    centre = np.array([mean[i] * scale, float(mean @ panel.weights) * own])
    every = max(1, -(-len(values) // SCATTERED))
    points = Points(FLIGHTS, content.flown[::every, i], values[::every], 1.8, 0.6)
    across = Axis(content.output_names[i], content.output_units[i])
    return Panel("", across, upward, [points, *ellipses(ELLIPSES_LINEAR, centre, both)])
