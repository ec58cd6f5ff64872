"""The flight deck as data: where the nominal flies, with errors, causes and what happens at each instant.

`mcnav.report.figures.deck` draws it, and the page's script moves it through time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Literal

import numpy as np
from scipy import special

from mcnav.analysis.envelopes import Envelopes
from mcnav.analysis.filter_remarks import instant
from mcnav.analysis.what_if import GroupTerm, SizedSystem, WhatIf, grouped_terms
from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.quantities import NAVIGATED, TRUE
from mcnav.physics.constants import EARTH_RADIUS
from mcnav.physics.units import UnitError, quantity
from mcnav.report.drawing.coastline import RADIUS, Projection
from mcnav.report.exports.arrays import filter_covariances, linear_covariances
from mcnav.report.figures.sources import Contributor, contributors, origins, variance_over_time
from mcnav.report.format import rounded
from mcnav.report.names import humanize
from mcnav.report.pages.run.deck_lanes import Lane, lanes
from mcnav.report.results.model import RunAnalysis

PROBABILITY: Final = 0.95
"""Probability of an ellipse, for a normal distribution."""

RADII: Final = float(np.sqrt(special.chdtri(2, 1.0 - PROBABILITY)))
"""Its semi-axes over the sigmas along them."""

BODIES: Final = {"wgs84": RADIUS, "moon": 1737.4, "mars": 3389.5}
"""Mean radii of the bodies that campaigns of type ins name, km."""

ALIKE: Final = 0.05
"""Difference of the radius up to which a sphere is the earth."""

AT_REST: Final = 1e-6
"""Extent of a track up to which nothing moves, km: that of a base at rest is rounding of its latitude, 1e-12."""

MOST_INSTANTS: Final = 160
"""Instants of a page; of more epochs, some are left out."""

LEAST: Final = 1e-9
"""Share of a mean square below which a part is left out: a hundred times as large, its number adds 1e-5."""

NAMED: Final = 3
"""Causes that a sentence names."""

Kind = Literal["true", "navigated", "error"]
Route = Literal["Monte Carlo", "linear", "filter"]

SUBJECTS: Final[dict[Kind, str]] = {
    "true": "true dispersion", "navigated": "navigation dispersion", "error": "navigation error"
}  # fmt: skip


@dataclass(frozen=True)
class Dispersion:
    """Moments to the right and upward, m, shapes (m, 2) and (m, 2, 2); of a ``single`` one, one direction has none."""

    kind: Kind
    route: Route
    mean: Array
    covariance: Array
    single: bool = False

    @property
    def reach(self) -> float:
        """Semi-axes that hold `PROBABILITY` over the sigmas along them."""
        return float(special.ndtri(0.5 + 0.5 * PROBABILITY)) if self.single else RADII

    def axes_at(self, k: int) -> tuple[float, float]:
        """Return the semi-axes of the ellipse at an instant, m, the larger first."""
        small, large = np.sqrt(np.maximum(np.linalg.eigvalsh(self.covariance[k]), 0.0))
        return self.reach * float(large), self.reach * float(small)


@dataclass(frozen=True)
class Place:
    """Position of the nominal in a plane, km.

    Attributes
    ----------
    kind : str
        ``map``, ``descent`` about a round earth, or ``plane``.
    right, up : str
        Names of the two directions of errors.
    track : ndarray, shape (n, 2)
    at : ndarray, shape (m, 2)
        At the instants.
    axes : ndarray, shape (m, 2, 2)
        How a metre of error to the right, and one upward, is drawn, m, as columns.
    projection : Projection, optional
        Of a map.
    """

    kind: Literal["map", "descent", "plane"]
    right: str
    up: str
    track: Array
    at: Array
    axes: Array
    projection: Projection | None = None

    @property
    def flips(self) -> bool:
        """Return whether the second direction is drawn against its sign, because it is downward."""
        return self.up.endswith("_down")

    @property
    def names(self) -> tuple[str, str]:
        """Names of the two directions, to the right and upward, for people."""
        return humanize(self.right), humanize(self.up.removesuffix("_down") + "_up" if self.flips else self.up)

    @property
    def moves(self) -> bool:
        """Return whether there is a track to be drawn."""
        return bool(np.ptp(self.track, axis=0).max(initial=0.0) > AT_REST)


@dataclass(frozen=True)
class Deck:
    """Everything at m instants.

    Attributes
    ----------
    label : str
        What the times are, as ``name [unit]``.
    times : ndarray, shape (m,)
    flown : ndarray, shape (n,)
        Times of the track's points and of the heights.
    height : (str, ndarray), optional
        Column ``name [unit]`` of the altitude, shape (n,).
    place : Place
    dispersions : tuple of Dispersion
        The foremost one first.
    lanes : tuple of Lane
        What happens over time.
    events : mapping of str to float
        Named instants.
    causes : tuple of Contributor
    shares : ndarray, shape (m, causes)
        Share of each in the linear mean square of the two outputs, without means; empty where it is not known.
    caused : str
        What they are shares of.
    terms : tuple of GroupTerm
        Their parts by number of the data sheet, as shares of the whole; empty where no number can be changed.
    """

    label: str
    times: Array
    flown: Array
    height: tuple[str, Array] | None
    place: Place
    dispersions: tuple[Dispersion, ...]
    lanes: tuple[Lane, ...]
    events: Mapping[str, float]
    causes: tuple[Contributor, ...]
    shares: Array
    caused: str
    terms: tuple[GroupTerm, ...] = ()

    @cached_property
    def worst(self) -> int:
        """The instant after the first one at which the foremost ellipse is longest."""
        if len(self.times) < 2:
            return 0
        return 1 + int(np.argmax([self.dispersions[0].axes_at(k)[0] for k in range(1, len(self.times))]))

    def words_at(self, k: int) -> str:
        """Say what there is at an instant: ellipses by each method, largest causes, and what happens then."""
        ellipses = [
            (f"{what} of the {SUBJECTS[kind]}", sizes) for kind in SUBJECTS for what, sizes in self._ellipses(kind, k)
        ]
        when = f" at {instant(float(self.times[k]), self.label)}"
        sentences = [f"{subject}{'' if number else when}: {sizes}." for number, (subject, sizes) in enumerate(ellipses)]
        if self.shares.size and self.shares[k].any():
            largest = [j for j in np.argsort(-self.shares[k], kind="stable")[:NAMED] if self.shares[k, j] >= 0.005]
            listed = ", ".join(f"{self.causes[j].label} {100.0 * self.shares[k, j]:.0f} %" for j in largest)
            sentences.append(f"Largest causes of the {self.caused}: {listed}.")
        happening = [words for lane in self.lanes if (words := lane.words_at(float(self.times[k])))]
        if happening:
            sentences.append(f"Then: {', '.join(happening)}.")
        return " ".join(sentences)

    def _ellipses(self, kind: Kind, k: int) -> list[tuple[str, str]]:
        """Return what is drawn of a kind of errors, and its sizes by method; nothing where there is none."""
        routes = [dispersion for dispersion in self.dispersions if dispersion.kind == kind]
        if not routes:
            return []
        sizes = ", ".join(f"{_size(*dispersion.axes_at(k))} ({dispersion.route})" for dispersion in routes)
        return [("95 % interval" if routes[0].single else "95 % ellipse", sizes)]


def _size(large: float, small: float) -> str:
    """Put semi-axes in words.

    >>> _size(14.92, 8.0), _size(12_345.0, 0.0)
    ('±14.9 m × ±8.00 m', '±12.3 km')
    """
    if small <= 1e-6 * large:
        return f"±{_length(large)}"
    return f"±{_length(large)} × ±{_length(small)}"


def _length(metres: float) -> str:
    if metres < 1e-6:
        return "0"
    return f"{rounded(metres / 1e3)} km" if metres >= 1e3 else f"{rounded(metres)} m"


def deck_of(content: RunAnalysis) -> Deck | None:
    """Return the deck of a run; none where errors over the flight, or two directions of a plane, are not known."""
    known = content.envelopes
    if known is None or not content.dispersed or next(iter(content.history.columns), "") != known.label:
        return None
    chosen = _chosen(len(known.times))
    times = known.times[chosen]
    place = _place(content, times)
    if place is None:
        return None
    dispersions = _dispersions(content, known, place, chosen)
    if not dispersions:
        return None
    causes, shares, caused, terms = _causes(content, place, times)
    columns = content.history.columns
    height = next((name for name in columns if name.startswith("altitude [")), None)
    return Deck(
        known.label, times, columns[known.label], None if height is None else (height, columns[height]), place,
        tuple(dispersions), tuple(lanes(content, known.times)), known.events, causes, shares, caused,
        terms,
    )  # fmt: skip


def _chosen(count: int) -> IndexArray:
    return np.unique(np.linspace(0, count - 1, min(count, MOST_INSTANTS)).round().astype(np.int64))


def _place(content: RunAnalysis, times: Array) -> Place | None:
    """Choose the plane: a map, a descent about the earth, or the two directions in which a loop moves most."""
    columns, names = content.history.columns, {output.name for output in content.manifest.model.outputs}
    flown = columns[next(iter(columns))]
    if {"latitude [deg]", "longitude [deg]"} <= set(columns) and {"position_north", "position_east"} <= names:
        place = np.radians(columns["latitude [deg]"]), np.radians(columns["longitude [deg]"])
        return _map(*place, flown, times, *_body(content))
    if {"range [km]", "altitude [km]"} <= set(columns) and {"range", "altitude"} <= names:
        return _descent(columns["range [km]"], columns["altitude [km]"], flown, times)
    return _plane(content, flown, times)


def _body(content: RunAnalysis) -> tuple[float, bool]:
    """Return the radius of the body, km, and whether it is the earth; a sphere of its size is."""
    scenario = content.manifest.identity.campaign.get("scenario", {})
    named = scenario.get("earth", "wgs84") if scenario.get("type") == "ins" else "wgs84"
    try:
        radius = BODIES[named] if isinstance(named, str) else quantity(named["radius"], "m") / 1e3
    except (KeyError, UnitError):
        return RADIUS, False
    return radius, abs(radius / RADIUS - 1.0) < ALIKE


def _map(latitude: Array, longitude: Array, flown: Array, times: Array, radius: float, earth: bool) -> Place:
    points = np.stack([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)])
    low, high = points.min(axis=1), points.max(axis=1)
    middle = 0.5 * (low + high)
    if np.linalg.norm(middle) < 1e-3:
        middle = points[:, len(flown) // 2]
    x, y, z = map(float, middle)
    projection = Projection(math.atan2(z, math.hypot(x, y)), math.atan2(y, x), radius, earth)
    here = np.interp(times, flown, latitude), np.interp(times, flown, np.unwrap(longitude))
    return Place(
        "map", "position_east", "position_north", projection(latitude, longitude), projection(*here),
        projection.directions(*here), projection,
    )  # fmt: skip


def _descent(reach: Array, altitude: Array, flown: Array, times: Array) -> Place:
    """Draw range and altitude about a round earth, the middle of the range on top."""
    earth = EARTH_RADIUS / 1e3
    middle = 0.5 * (reach.min() + reach.max())

    def drawn(reach: Array, altitude: Array) -> tuple[Array, Array]:
        angle, radius = (reach - middle) / earth, earth + altitude
        return np.stack([np.sin(angle), np.cos(angle)], axis=-1), radius

    directions, radii = drawn(reach, altitude)
    upward, radius = drawn(np.interp(times, flown, reach), np.interp(times, flown, altitude))
    onward = np.stack([upward[:, 1], -upward[:, 0]], axis=-1) * (radius / earth)[:, None]
    axes = np.stack([onward, upward], axis=-1)
    return Place("descent", "range", "altitude", directions * radii[:, None], upward * radius[:, None], axes)


def _plane(content: RunAnalysis, flown: Array, times: Array) -> Place | None:
    columns, samples = content.history.columns, dict[str, Array]()
    for output in content.manifest.model.outputs:
        name = output.name.removeprefix(TRUE).removeprefix(NAVIGATED)
        column = f"{humanize(name)} [{output.unit}]"
        if output.unit == "m" and column in columns:
            samples[name] = columns[column]
    pairs = [
        (one, other)
        for place, one in enumerate(samples)
        for other in list(samples)[place + 1 :]
        if one.rpartition("_")[0] == other.rpartition("_")[0] or {one, other} == {"range", "cross_range"}
    ]
    if not pairs:
        return None
    spans = {name: float(np.ptp(values)) for name, values in samples.items()}
    right, up = max(pairs, key=lambda pair: (spans[pair[0]] + spans[pair[1]], min(spans[pair[0]], spans[pair[1]])))
    if right.endswith(("_north", "_down", "_z", "_up")) and not up.endswith(("_down", "_z", "_up")):
        right, up = up, right
    sign = -1.0 if up.endswith("_down") else 1.0
    track = np.column_stack([samples[right], sign * samples[up]]) / 1e3
    at = np.column_stack([np.interp(times, flown, coordinate) for coordinate in track.T])
    return Place("plane", right, up, track, at, np.tile(np.eye(2), (len(times), 1, 1)))


def _dispersions(content: RunAnalysis, known: Envelopes, place: Place, chosen: IndexArray) -> list[Dispersion]:
    """Return the moments of the two outputs by each kind and method, those of the truth first."""
    outputs = {output.name: number for number, output in enumerate(content.manifest.model.outputs)}
    routes: list[tuple[Route, Array, Array | None]] = [
        ("Monte Carlo", known.mean, known.covariance),
        ("linear", known.linear_mean, _linear(content, known)),
        ("filter", np.zeros_like(known.mean), filter_covariances(content)),
    ]
    listed = []
    kinds: dict[Kind, str] = {"true": TRUE, "navigated": NAVIGATED, "error": ""}
    for kind, prefix in kinds.items():
        places = [outputs.get(f"{prefix}{name}", -1) for name in (place.right, place.up)]
        for route, mean, covariance in routes:
            if covariance is None or max(places) < 0 or (route == "filter" and kind != "error"):
                continue
            picked = covariance[chosen][:, places][:, :, places].copy()
            centre = mean[chosen][:, places].copy()
            for missing in (k for k, number in enumerate(places) if number < 0):
                picked[:, missing, :] = picked[:, :, missing] = centre[:, missing] = 0.0
            if place.flips:
                centre[:, 1] *= -1.0
                picked[:, [0, 1], [1, 0]] *= -1.0
            if np.isfinite(picked).all() and picked.any():
                listed.append(Dispersion(kind, route, centre, picked, min(places) < 0))
    return listed


def _linear(content: RunAnalysis, known: Envelopes) -> Array | None:
    """Return the linear covariances at the epochs; correlations are interpolated where others times are known."""
    covariances, development = linear_covariances(content), content.development
    if covariances is None or development is None or not len(development.times):
        return None
    sigma = np.sqrt(np.maximum(np.diagonal(covariances, axis1=1, axis2=2), 0.0))
    scale = sigma[:, :, None] * sigma[:, None, :]
    correlation = np.divide(covariances, scale, out=np.zeros_like(covariances), where=scale > 0.0)
    after = np.clip(np.searchsorted(development.times, known.times), 1, max(len(development.times) - 1, 1))
    if len(development.times) == 1:
        return None
    begin, end = development.times[after - 1], development.times[after]
    share = np.clip((known.times - begin) / np.where(end > begin, end - begin, 1.0), 0.0, 1.0)[:, None, None]
    between = (1.0 - share) * correlation[after - 1] + share * correlation[after]
    return np.asarray(between * known.linear_sigma[:, :, None] * known.linear_sigma[:, None, :])


def _causes(
    content: RunAnalysis, place: Place, times: Array
) -> tuple[tuple[Contributor, ...], Array, str, tuple[GroupTerm, ...]]:
    """Return the causes of the foremost outputs with their shares over time, also by number of the data sheet.

    Where numbers can be changed on the page, a cause that is small now has its place as well.
    """
    development, nothing = content.development, np.empty((len(times), 0))
    if development is None or not len(development.times):
        return (), nothing, "", ()
    outputs = {output.name: number for number, output in enumerate(content.manifest.model.outputs)}
    prefix, words = (
        (TRUE, SUBJECTS["true"])
        if {f"{TRUE}{place.right}", f"{TRUE}{place.up}"} & outputs.keys()
        else ("", SUBJECTS["error"])
    )
    picked = [outputs[name] for name in (f"{prefix}{place.right}", f"{prefix}{place.up}") if name in outputs]
    listed = contributors(content) if content.filter is None else origins(content, content.filter)
    whole = variance_over_time(content)[:, picked].sum(axis=1)
    parts = [variance_over_time(content, contributor.members)[:, picked].sum(axis=1) for contributor in listed]
    shares = np.array([np.divide(part, whole, out=np.zeros_like(part), where=whole > 0.0) for part in parts]).T
    nearest = np.abs(development.times - times[:, None]).argmin(axis=1)
    if content.what_if is None:
        kept = [j for j in range(len(listed)) if shares[:, j].max(initial=0.0) >= 0.01]
        return tuple(listed[j] for j in kept), shares[nearest][:, kept], words, ()
    terms = _terms(
        content, content.what_if, [contributor.members for contributor in listed], picked, nearest, whole[nearest]
    )
    return tuple(listed), shares[nearest], words, terms


def _terms(
    content: RunAnalysis, what_if: WhatIf, groups: Sequence[Sequence[int]], outputs: Sequence[int],
    readings: IndexArray, whole: Array,
) -> tuple[GroupTerm, ...]:  # fmt: skip
    """Split the mean square of some outputs, ``whole``, at some readings; small terms are left out."""
    known, model, campaign = content.development, content.model, what_if.campaign
    if known is None:
        return ()
    system = SizedSystem(
        known.partials[readings][:, outputs], np.zeros((len(readings), len(outputs))),
        {name: process[readings][:, outputs] for name, process in known.processes.items()},
        model.mean, model.covariance, campaign.source_numbers, campaign.process_numbers,
    )  # fmt: skip
    split = [
        replace(term, values=np.divide(term.values, whole, out=np.zeros_like(whole), where=whole > 0.0))
        for term in grouped_terms(system, groups)
    ]
    return tuple(term for term in split if np.abs(term.values).max(initial=0.0) > LEAST)
