"""The flight deck as a figure: track, ellipses, altitude, their size over time, a strip of sensors, and causes."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from mcnav.analysis.filter_remarks import instant
from mcnav.arrays.types import Array
from mcnav.physics.constants import EARTH_RADIUS
from mcnav.report.drawing.coastline import Box, coast, grid
from mcnav.report.drawing.figure import THIRD, Figure, MovedFigure
from mcnav.report.drawing.gapped import upward
from mcnav.report.drawing.marks import Axis, Bars, Line, Mark, Panel, Points, Rule, Series, Text, axis
from mcnav.report.drawing.palette import FILTER, FLOWN, GRID, INK, LINEAR, MUTED, OUTAGE, POINT, SOURCE_COLOURS
from mcnav.report.drawing.svg import plot_area
from mcnav.report.figures.truth import KINDS, ROUTES, SMALLEST
from mcnav.report.pages.run.deck import SUBJECTS, Deck, Dispersion, deck_of
from mcnav.report.results.model import RunAnalysis

SIZE: Final = THIRD
"""Size of a panel, px."""

WIDEST: Final = 7.0
"""The longest ellipse on the track is at most so small a part of the map's smaller side."""

SHAPE: Final = 72
"""Points of an ellipse."""

NARROW: Final = 0.15
"""Smallest height of a map over its width."""

RING: Final = 1.12
"""Half side of the panel of ellipses, in radii of its ring."""

TRACK: Final = Series("track", "nominal track", MUTED)
COAST: Final = Series("coast", "coastline", POINT)
SURFACE: Final = Series("coast", "surface of the earth", POINT)
GRATICULE: Final = Series("graticule", "", GRID)
HERE: Final = Series("here", "nominal at the instant", INK, "dot")
NOW: Final = Series("now", "", INK)
HEIGHT: Final = Series("height", "", MUTED)
RINGS: Final = Series("ring-scale", "", GRID)

HAPPENINGS: Final = {
    "updates": Series("updates", "updates", FILTER, "area"), "outage": Series("silent", "outage", OUTAGE, "area"),
    "fault": Series("fault", "fault", FLOWN, "area"), "turn": Series("turn", "turn", SOURCE_COLOURS[1], "area"),
    "climb": Series("climb", "climb", SOURCE_COLOURS[5], "area"),
    "descent": Series("descent", "descent", SOURCE_COLOURS[7], "area"),
    "requirement": Series("window", "requirement holds", LINEAR, "area"),
}  # fmt: skip
REJECTED: Final = Series("rejected", "rejected updates", FLOWN, "dot")


def series_of(dispersion: Dispersion, truth: bool) -> Series:
    """Return the entry of the key for an ellipse: colour is the method, line style the kind of a dispersed truth."""
    kind, route = dispersion.kind, dispersion.route
    name = f"{kind}-{route.split()[0].lower()}"
    if route == "filter":
        line = KINDS["own"][1] if truth else "line"
        return Series(name, f"{SUBJECTS[kind]}, filter" if truth else "filter", FILTER, line)
    if truth:
        return Series(name, f"{SUBJECTS[kind]}, {route}", ROUTES[route], KINDS[kind][1])
    return Series(name, route, ROUTES[route])


def deck(content: RunAnalysis) -> Figure | None:
    """Draw the flight deck at its worst instant; none where there is nothing to move."""
    known = deck_of(content)
    if known is None:
        return None
    truth = any(dispersion.kind == "true" for dispersion in known.dispersions)
    series = [series_of(dispersion, truth) for dispersion in known.dispersions]
    factor, rings = 1.0, ring_radii(known)
    panels: dict[str, Panel] = {}
    if known.place.moves:
        panels["track"], factor = _track(known, series)
    panels["ellipses"] = _ellipses(known, series, rings)
    if known.height is not None:
        panels["height"] = _height(known)
    panels["sizes"] = _sizes(known, series)
    if known.lanes:
        panels["strip"] = _strip(known)
    if known.shares.size:
        panels["causes"] = _causes(known)
    places = {name: number for number, name in enumerate(panels)}
    columns: dict[str, Any] = {known.label: known.times}
    for dispersion, entry in zip(known.dispersions, series, strict=True):
        axes = np.array([dispersion.axes_at(k) for k in range(len(known.times))])
        columns |= {
            f"{entry.label}, longer semi-axis [m]": axes[:, 0],
            f"shorter semi-axis [m], {entry.label}": axes[:, 1],
        }
    return MovedFigure(
        name="deck",
        title="Flight deck",
        description="The nominal flight at one time: its track to scale, with the ellipses that hold 95 % of the "
        "errors by each method. Below: size of errors over time, sensors, manoeuvres, and the causes at that time.",
        panels=list(panels.values()),
        key=[*series, *([HERE] if known.place.moves else [])],
        columns=columns,
        size=SIZE,
        caption=_caption(known, factor),
        shows=known.words_at(known.worst),
        json=_json(known, series, rings, factor, places),
    )


def ring_radii(known: Deck) -> Array:
    """Return for each instant the radius of the ring around its ellipses, m: 1, 2 or 5 times a power of ten."""
    reach = np.zeros(len(known.times))
    for dispersion in known.dispersions:
        sigma = np.sqrt(np.maximum(np.diagonal(dispersion.covariance, axis1=1, axis2=2), 0.0))
        reach = np.maximum(reach, np.hypot(*(dispersion.reach * sigma + np.abs(dispersion.mean)).T))
    longest = np.maximum(reach, 1e-6)
    power = 10.0 ** np.floor(np.log10(longest))
    return np.select(
        [longest <= f * power for f in (1.0, 2.0, 5.0)], [f * power for f in (1.0, 2.0, 5.0)], 10.0 * power
    )


def _rounded_down(value: float) -> float:
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(f * power for f in (1.0, 2.0, 5.0) if f * power <= value))


def ellipse_of(dispersion: Dispersion, k: int, axes: Array | None = None) -> Array:
    """Return points of the ellipse at an instant about the nominal, m, shape (points, 2).

    With the Cholesky factor L of the covariance they are mean + r L (cos a, sin a).
    """
    mean, covariance = dispersion.mean[k], dispersion.covariance[k]
    first = np.sqrt(max(covariance[0, 0], 0.0))
    across = covariance[0, 1] / first if first > 0.0 else 0.0
    factor = np.array([[first, 0.0], [across, np.sqrt(max(covariance[1, 1] - across**2, 0.0))]])
    angle = np.linspace(0.0, 2.0 * np.pi, SHAPE + 1)
    points = mean[:, None] + dispersion.reach * factor @ np.array([np.cos(angle), np.sin(angle)])
    return np.asarray((points if axes is None else axes @ points).T)


def _caption(known: Deck, factor: float) -> str:
    place, said = known.place, []
    of_coast = "; coastline: Natural Earth" if place.projection is not None and place.projection.earth else ""
    if place.moves:
        on = {
            "map": f"The track is to scale (azimuthal equidistant{of_coast})",
            "descent": "The descent is to scale about the round earth", "plane": "The track is to scale",
        }[place.kind]  # fmt: skip
        enlarged = f"; ellipses on it are {factor:,.0f} times as large" if factor > 1.0 else ""
        said.append(f"{on}{enlarged}.")
    said.append(
        "Ellipses hold 95 % of a normal distribution; sizes are half of their longer axes. Causes are shares of the "
        "linear mean square of both directions."
    )
    return " ".join(said)


def _track(known: Deck, series: Sequence[Series]) -> tuple[Panel, float]:
    place = known.place
    reach = place.track[np.isfinite(place.track).all(axis=1)]
    low, high = reach.min(axis=0), reach.max(axis=0)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    half = np.maximum(1.12 * half, NARROW * float(half.max()))
    east, north = {"map": ("east", "north"), "descent": ("across", "up")}.get(place.kind, place.names)
    axes = Axis(east, "km"), Axis(north, "km")
    _, box = to_scale(axes, middle, half)
    sizes = np.array(
        [max(dispersion.axes_at(k)[0] for dispersion in known.dispersions) for k in range(len(known.times))]
    )
    room = 1e3 * min(box[2] - box[0], box[3] - box[1]) / WIDEST
    factor = max(1.0, _rounded_down(room / float(sizes.max()))) if sizes.max() > 0.0 else 1.0
    around = factor / 1e3 * sizes[:, None]
    low = np.fmin(middle - half, np.nanmin(place.at - around, axis=0))  # the ellipses are within the axes
    high = np.fmax(middle + half, np.nanmax(place.at + around, axis=0))
    (left, _, right, _), box = to_scale(axes, 0.5 * (low + high), 0.5 * (high - low))
    axes = replace(axes[0], low=box[0], high=box[2]), replace(axes[1], low=box[1], high=box[3])
    finest = 0.4 * (box[2] - box[0]) / (right - left)
    marks: list[Mark] = []
    if place.projection is not None:
        lines = grid(place.projection, box, finest)
        marks += [_curve(GRATICULE, line, 0.8) for line, _ in lines]
        marks += _merged(COAST, coast(place.projection, box, finest))
        marks += [Text(name, *edge, colour=MUTED) for line, name in lines for edge in _edge(line, box)]
    elif place.kind == "descent":
        angle = np.linspace(-np.pi, np.pi, 721)
        marks.append(_curve(SURFACE, EARTH_RADIUS / 1e3 * np.stack([np.sin(angle), np.cos(angle)], axis=-1), 1.4))
    marks.append(_curve(TRACK, place.track, 1.8))
    ends = Points(TRACK.of_kind("ring"), place.track[[0, -1], 0], place.track[[0, -1], 1], 6.0, names=["start", "end"])
    k = known.worst
    for entry, dispersion in zip(series, known.dispersions, strict=True):
        points = place.at[k] + factor / 1e3 * ellipse_of(dispersion, k, place.axes[k])
        marks.append(_curve(entry, points, 1.9))
    marks += [ends, Points(HERE, place.at[k, :1], place.at[k, 1:], 7.0)]
    return Panel(_titled(known, "Track"), *axes, marks, even=True), factor


def _curve(series: Series, points: Array, width: float) -> Line:
    """Return a curve that the pointer does not read: its values have no meaning without its magnification."""
    return Line(series, points[:, 0], points[:, 1], width, silent=True)


def _merged(series: Series, lines: Sequence[Array]) -> list[Mark]:
    """Return many lines as one with gaps."""
    gap = np.full((1, 2), np.nan)
    points = np.concatenate([part for line in lines for part in (line, gap)]) if lines else np.empty((0, 2))
    return [_curve(series, points, 1.1)] if len(points) else []


def _edge(line: Array, box: Box) -> list[tuple[float, float]]:
    """Return where a line of the grid has its name: where it enters the box, if it does."""
    left, bottom, right, top = box
    visible = line[(line[:, 0] >= left) & (line[:, 0] <= right) & (line[:, 1] >= bottom) & (line[:, 1] <= top)]
    return [(float(visible[0, 0]), float(visible[0, 1]))] if len(visible) else []


def to_scale(axes: tuple[Axis, Axis], middle: Array, half: Array) -> tuple[Box, Box]:
    """Return the plot's box, px, and limits with one scale for both axes around a rectangle."""
    limits = [middle[0] - half[0], middle[1] - half[1], middle[0] + half[0], middle[1] + half[1]]
    for _ in range(3):  # the room depends on the ticks, which depend on the limits
        x, y = replace(axes[0], low=limits[0], high=limits[2]), replace(axes[1], low=limits[1], high=limits[3])
        left, top, right, bottom = plot_area(Panel(" ", x, y, []), *SIZE)
        scale = max(2.0 * half[0] / (right - left), 2.0 * half[1] / (bottom - top))
        wide, high = 0.5 * scale * (right - left), 0.5 * scale * (bottom - top)
        limits = [float(each) for each in (middle[0] - wide, middle[1] - high, middle[0] + wide, middle[1] + high)]
    return (left, top, right, bottom), (limits[0], limits[1], limits[2], limits[3])


def _titled(known: Deck, words: str) -> str:
    return f"{words} at {instant(float(known.times[known.worst]), known.label)}"


def _ellipses(known: Deck, series: Sequence[Series], rings: Array) -> Panel:
    """Draw the ellipses about the nominal, at their own scale, which is that of two rings."""
    place, k = known.place, known.worst
    axes = Axis(place.names[0], bare=True), Axis(place.names[1], bare=True)
    _, box = to_scale(axes, np.zeros(2), np.full(2, RING))
    axes = replace(axes[0], low=box[0], high=box[2]), replace(axes[1], low=box[1], high=box[3])
    angle = np.linspace(0.0, 2.0 * np.pi, SHAPE + 1)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    marks: list[Mark] = [
        *(_curve(RINGS, size * circle, 0.9) for size in (0.5, 1.0)),
        Line(RINGS, [box[0], box[2]], [0.0, 0.0], 0.9, silent=True),
        Line(RINGS, [0.0, 0.0], [box[1], box[3]], 0.9, silent=True),
        *(_curve(entry, ellipse_of(dispersion, k) / rings[k], 2.0)
          for entry, dispersion in zip(series, known.dispersions, strict=True)),
        Text(ring_words(rings[k]), float(np.sqrt(0.5)), float(np.sqrt(0.5)), colour=MUTED),
    ]  # fmt: skip
    return Panel(_titled(known, "Errors about the nominal"), *axes, marks, even=True)


def ring_words(radius: float) -> str:
    """Name the radius of a ring, m.

    >>> ring_words(0.2), ring_words(1e6)
    ('0.2 m', '1,000 km')
    """
    return f"{radius / 1e3:,g} km" if radius >= 1e3 else f"{radius:g} m"


def thickness(rows: int) -> float:
    """Return the thickness of bars in so many rows, which are not to be blocks where there are few."""
    return min(0.66, 0.14 * rows)


def _now(known: Deck) -> Rule:
    return Rule(float(known.times[known.worst]), colour=INK, width=1.2, series=NOW)


def _events(known: Deck) -> list[Mark]:
    """Return the named instants within the flight that no row of the strip has."""
    visible = (
        known.events if not known.lanes else {name: at for name, at in known.events.items() if "outage" not in name}
    )
    first, last = known.times[0], known.times[-1]
    return [Rule(at, name=name) for name, at in visible.items() if first < at < last]


def _height(known: Deck) -> Panel:
    name, values = known.height or ("", np.empty(0))
    marks: list[Mark] = [Line(HEIGHT, known.flown, values, 1.9), *_events(known), _now(known)]
    return Panel("Altitude", axis(known.label, margin=0.0, link=True), axis(name), marks)


def _sizes(known: Deck, series: Sequence[Series]) -> Panel:
    sizes = [np.array([dispersion.axes_at(k)[0] for k in range(len(known.times))]) for dispersion in known.dispersions]
    largest = max(float(size.max()) for size in sizes)
    scale, unit = (1e-3, "km") if largest >= 1e4 else (1.0, "m")
    shown = [np.where(size > SMALLEST * largest, size, np.nan) * scale for size in sizes]
    marks: list[Mark] = [Line(entry, known.times, each, 1.9) for entry, each in zip(series, shown, strict=True)]
    marks += _events(known)
    up = upward("longer semi-axis", unit, np.concatenate(shown))
    return Panel("Size of the 95 % ellipse", axis(known.label, margin=0.0, link=True), up, [*marks, _now(known)])


def _strip(known: Deck) -> Panel:
    marks, listed = list[Mark](), dict[Series, None]()
    for row, lane in enumerate(known.lanes):
        for kind, entry in HAPPENINGS.items():
            some = [interval for interval in lane.intervals if interval.kind == kind]
            if some:
                listed[entry] = None
                begins, ends = [each.begin for each in some], [each.end for each in some]
                texts = [each.words for each in some]
                marks.append(Bars(entry, [row] * len(some), begins, ends, texts, thickness=thickness(len(known.lanes))))
        if lane.rejections:
            listed[REJECTED] = None
            times, shares = zip(*((rejection.time, rejection.share) for rejection in lane.rejections), strict=True)
            texts = [f"{lane.name}: {100.0 * share:.2g} % rejected" for share in shares]
            marks.append(
                Points(REJECTED, times, [row + 0.5 * thickness(len(known.lanes)) + 0.08] * len(times), 3.4, texts=texts)
            )
    first, last = float(known.times[0]), float(known.times[-1])
    across = replace(axis(known.label, margin=0.0, link=True), low=first, high=last)
    return Panel("What happens", across, Axis(names=[lane.name for lane in known.lanes]), [*marks, _now(known)],
                 list(listed))  # fmt: skip


def _causes(known: Deck) -> Panel:
    k = known.worst
    marks: list[Mark] = [
        Bars(Series(f"deck-{cause.series.name}", cause.label, cause.series.colour, "area"), [j], [0.0],
             [100.0 * known.shares[k, j]], [f"{cause.label}: {100.0 * known.shares[k, j]:.3g} %"],
             thickness=thickness(len(known.causes)))
        for j, cause in enumerate(known.causes)
    ]  # fmt: skip
    names = [cause.label for cause in known.causes]
    return Panel(_titled(known, f"Causes of the {known.caused}"), Axis("share", "%", low=0.0, high=100.0),
                 Axis(names=names), marks)  # fmt: skip


def _packed(values: Array) -> str:
    """Write numbers as base64 of single precision."""
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode()


def _json(known: Deck, series: Sequence[Series], rings: Array, factor: float, places: dict[str, int]) -> str:
    """Return what the script needs at every instant, with four digits."""

    def short(values: Array, digits: int = 4) -> Any:
        return [float(f"{each:.{digits}g}") for each in np.asarray(values, dtype=float).ravel()]

    upper = np.array([0, 1, 3])
    content = {
        "link": known.label,
        "at": known.worst,
        "times": short(known.times, 9),
        "instants": [instant(float(time), known.label) for time in known.times],
        "words": [known.words_at(k) for k in range(len(known.times))],
        "panels": places,
        "factor": factor,
        "place": short(known.place.at, 6) if known.place.moves else [],
        "axes": short(known.place.axes) if known.place.moves else [],
        "ellipses": [
            {"series": entry.name, "reach": dispersion.reach, "mean": short(dispersion.mean),
             "covariance": short(dispersion.covariance.reshape(-1, 4)[:, upper], 5)}
            for entry, dispersion in zip(series, known.dispersions, strict=True)
        ],
        "rings": short(rings),
        "ringWords": [ring_words(float(ring)) for ring in rings],
        "half": 0.5 * thickness(len(known.causes)),
        "causes": [[f"deck-{cause.series.name}", cause.label] for cause in known.causes],
        "shares": [round(1000.0 * float(each)) for each in known.shares.ravel()],
        "terms": [[term.group, term.first, term.second, _packed(term.values)] for term in known.terms],
    }  # fmt: skip
    text = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")
