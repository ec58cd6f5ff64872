"""Truth and navigation of a closed loop: sigmas of both over time, and ellipses at the end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.contract.quantities import Output
from mcnav.report.drawing.figure import THIRD, Figure, side_by_side
from mcnav.report.drawing.gapped import upward
from mcnav.report.drawing.marks import Axis, Line, Mark, Panel, Points, Rule, Series, axis
from mcnav.report.drawing.palette import FILTER, FLOWN, LINEAR, POINT
from mcnav.report.names import humanize, scale_of
from mcnav.report.results.kinds import Quantity, planes, quantities
from mcnav.store.manifest import Variable

if TYPE_CHECKING:
    from mcnav.report.results.model import RunAnalysis

KINDS: Final = {
    "true": ("true dispersion", "line"),
    "navigated": ("navigation dispersion", "dashed"),
    "error": ("navigation error", "dotted"),
    "own": ("navigation error by the filter", "dotted"),
}
"""Words of each kind, and its lines; their colours are those of the methods."""

ROUTES: Final = {"Monte Carlo": FLOWN, "linear": LINEAR}
"""Colour of each method."""

WIDTHS: Final = {"Monte Carlo": 3.0, "linear": 1.6}
"""Widths of the lines: of two on one another, both are seen."""

SMALLEST: Final = 1e-5
"""Share of the largest sigma of a panel up to which a sigma is not drawn: a logarithmic axis would show rounding."""

PROBABILITY: Final = 0.95
"""Probability of an ellipse."""

SCATTERED: Final = 2_000
"""Samples drawn at most."""

SAMPLES: Final = Series("samples", "true deviations of samples", POINT, "dot")

Curves = dict[tuple[str, str], Array]
"""Values by kind and route."""


def series_of(kind: str, route: str) -> Series:
    """Return the entry of the key for a kind and a route."""
    words, line = KINDS[kind]
    colour = FILTER if kind == "own" else ROUTES[route]
    return Series(f"{kind}-{route.split()[0].lower()}", f"{words}, {route}", colour, line)


@dataclass(frozen=True)
class SigmasOverTime:
    """Sigmas of all outputs at some times, SI, shapes (times, outputs), by route; those of the filter with NaN.

    Attributes
    ----------
    label : str
        Of the times.
    times : ndarray
    events : mapping of str to float
        Named instants.
    sigma, own : mapping of str to ndarray
        By `ROUTES`; own are those that the filter states of the navigation errors.
    remark : str
        What else the caption says.
    """

    label: str
    times: Array
    events: Mapping[str, float]
    sigma: Mapping[str, Array]
    own: Mapping[str, Array]
    remark: str = ""


def dispersion_over_time(content: RunAnalysis) -> Figure | None:
    """Draw one sigma of the truth, of what is navigated, and of the navigation error; none without them over time."""
    known, outputs = content.envelopes, content.manifest.model.outputs
    if known is None or not quantities(outputs):
        return None
    own, remark = dict[str, Array](), ""
    if content.filter is not None and np.array_equal(content.filter.times, known.times):
        stated = {output.name: output for output in content.filter.outputs}
        for route, attribute in (("Monte Carlo", "filter"), ("linear", "filter_linear")):
            values = [getattr(stated.get(output.name), attribute, None) for output in outputs]
            nothing = np.full(len(known.times), np.nan)
            own[route] = np.column_stack([nothing if value is None else value for value in values])
        remark = "By the filter: root of the mean variance over all samples."
    sigma = {"Monte Carlo": known.sigma, "linear": known.linear_sigma}
    return over_time(outputs, SigmasOverTime(known.label, known.times, known.events, sigma, own, remark))


def over_time(outputs: Sequence[Variable | Output], known: SigmasOverTime) -> Figure | None:
    """Draw the sigmas of each quantity that has an output of truth, a panel each; none where nothing is dispersed."""
    drawn = {quantity: _curves(outputs, known, quantity) for quantity in quantities(outputs)}
    drawn = {
        drawn_curve: curves
        for drawn_curve, curves in drawn.items()
        if any(np.nanmax(curve, initial=0.0) > 0.0 for curve in curves.values())
    }
    if not drawn:
        return None
    columns: dict[str, NDArray[Any]] = {known.label: known.times}
    for drawn_curve, curves in drawn.items():
        name, unit = humanize(drawn_curve.name), outputs[drawn_curve.true].shown_in
        columns |= {f"{name}, {series_of(*key).label}, 1σ [{unit}]": curve for key, curve in curves.items()}
    listed = {key for curves in drawn.values() for key in curves}
    return Figure(
        name="dispersion-over-time",
        title="Truth and navigation over time, 1σ",
        description="Standard deviation over time: of the truth and the navigated state about the nominal, and of the "
        f"navigation error. Methods: {' and '.join(known.sigma)}.",
        panels=[
            _panel(known, drawn_curve, outputs[drawn_curve.true].shown_in, curves)
            for drawn_curve, curves in drawn.items()
        ],
        key=[series_of(kind, route) for route in ROUTES for kind in KINDS if (kind, route) in listed],
        columns=columns,
        size=side_by_side(len(drawn)),
        caption=known.remark,
    )


def _curves(outputs: Sequence[Variable | Output], known: SigmasOverTime, quantity: Quantity) -> Curves:
    """Return the sigmas of a quantity over time in the unit in which its truth is shown."""
    scale, curves = scale_of(outputs)[quantity.true], Curves()
    for kind, place in (("true", quantity.true), ("navigated", quantity.navigated), ("error", quantity.error)):
        if place is not None:
            curves |= {(kind, route): values[:, place] * scale for route, values in known.sigma.items()}
    if quantity.error is not None:
        stated = {("own", route): values[:, quantity.error] * scale for route, values in known.own.items()}
        curves |= {key: values for key, values in stated.items() if np.isfinite(values).any()}
    return curves


def _panel(known: SigmasOverTime, quantity: Quantity, unit: str, curves: Mapping[tuple[str, str], Array]) -> Panel:
    largest = max(float(np.nanmax(curve, initial=0.0)) for curve in curves.values())
    seen = {key: np.where(curve > SMALLEST * largest, curve, np.nan) for key, curve in curves.items()}
    marks: list[Mark] = [Line(series_of(*key), known.times, part, WIDTHS[key[1]]) for key, part in seen.items()]
    shown_events = [(at, name) for name, at in known.events.items() if known.times[0] < at < known.times[-1]]
    marks += [Rule(at, name=name) for at, name in shown_events]
    reach = np.concatenate([*seen.values()])
    return Panel(humanize(quantity.name), axis(known.label, margin=0.0, link=True), upward("1σ", unit, reach), marks)


def ellipses_at_end(content: RunAnalysis) -> Figure | None:
    """Draw the 95 % ellipses of truth and navigation at the end; none without two directions of a plane."""
    pairs = planes(content.manifest.model.outputs)
    if not pairs or len(content.flown) < 2:
        return None
    rows: list[tuple[object, ...]] = []
    panels, listed = [], dict[Series, None]()
    for right, up in pairs:
        marks, entries = _ellipses(content, right, up)
        listed |= dict.fromkeys(line.series for lines in marks.values() for line in lines)
        rows += entries
        points = content.flown[:: -(-len(content.flown) // SCATTERED), [right.true, up.true]]
        x, y = (Axis(humanize(drawn_curve.name), content.output_units[drawn_curve.true]) for drawn_curve in (right, up))
        samples = Points(SAMPLES, points[:, 0], points[:, 1], 1.8, 0.6)
        panels += [
            Panel(KINDS[kind][0], x, y, [*([samples] if kind == "true" else []), *lines])
            for kind, lines in marks.items()
        ]
    headings = ("pair", "of", "mean x", "mean y", "σ x", "σ y", "correlation", "x unit", "y unit")
    return Figure(
        name="landing-ellipses",
        title="Ellipses of truth and navigation at the end",
        description="Ellipses of 95 % at the end: true dispersion, navigation dispersion and navigation error. "
        "Methods: linear analysis and Monte Carlo, with samples of the true dispersion.",
        panels=panels,
        key=[SAMPLES, *listed],
        columns=dict(zip(headings, zip(*rows, strict=True), strict=True)),
        size=THIRD,
        caption=f"Ellipses hold {100.0 * PROBABILITY:g} % of a normal distribution. Axes are scaled separately.",
    )


def _ellipses(
    content: RunAnalysis, right: Quantity, up: Quantity
) -> tuple[dict[str, list[Line]], list[tuple[object, ...]]]:
    """Return the ellipses of a pair by kind, and the numbers behind them."""
    comparison, marks, rows = content.comparison, dict[str, list[Line]](), list[tuple[object, ...]]()
    moments = {
        "Monte Carlo": (comparison.mean_sample, comparison.covariance_sample),
        "linear": (content.model.outcome_mean, comparison.covariance_linear),
    }
    units = content.output_units[right.true], content.output_units[up.true]
    for kind in ("true", "navigated", "error"):
        places = [getattr(right, kind), getattr(up, kind)]
        if None in places:
            continue
        scale, pick = content.output_scale[[right.true, up.true]], np.ix_(places, places)
        for route, (mean, covariance) in moments.items():
            centre, square = mean[places] * scale, covariance[pick] * np.outer(scale, scale)
            sigmas = np.sqrt(np.diag(square))
            if not np.isfinite(square).all() or not sigmas.any():
                continue
            words, colour = KINDS[kind][0], ROUTES[route]
            x, y = ellipse(centre, square)
            marks.setdefault(kind, []).append(
                Line(Series(route.split()[0].lower(), route, colour), x, y, WIDTHS[route])
            )
            related = square[0, 1] / np.prod(sigmas) if sigmas.all() else np.nan
            pair = f"{humanize(right.name)} and {humanize(up.name)}"
            rows.append((pair, f"{words}, {route}", *map(float, (*centre, *sigmas, related)), *units))
    return marks, rows


def ellipse(centre: Array, covariance: Array) -> Array:
    """Return points of the ellipse that holds `PROBABILITY` of a normal distribution of two, shape (2, points).

    It is where the squared distance from the mean, which is chi-square of two degrees of freedom, is −2 ln(1 − p).
    """
    values, vectors = np.linalg.eigh(covariance)
    angle = np.linspace(0.0, 2.0 * np.pi, 121)
    circle = np.sqrt(np.maximum(values, 0.0))[:, None] * np.array([np.cos(angle), np.sin(angle)])
    return np.asarray(centre[:, None] + np.sqrt(-2.0 * np.log1p(-PROBABILITY)) * vectors @ circle)
