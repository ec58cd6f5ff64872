"""Contributors to the error budget of a run: which sources have a colour, and which are told together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from mcnav.analysis.filter_consistency import FilterConsistency
from mcnav.arrays.products import transformed_variances
from mcnav.arrays.types import Array
from mcnav.report.drawing.axis_groups import stem
from mcnav.report.drawing.marks import Series, numbered
from mcnav.report.drawing.palette import OTHER, SOURCE_COLOURS
from mcnav.report.names import humanize

if TYPE_CHECKING:
    from mcnav.report.results.model import RunAnalysis

SHOWN: Final = len(SOURCE_COLOURS)
"""Contributors with a colour. Of more sources, those that differ only in their axis are one contributor."""

SMALL: Final = 0.01
"""Share of every output's variance below which contributors are combined."""

INSTRUMENTS: Final = {"gyros": "gyro_", "accelerometers": "accelerometer_"}
"""Beginnings of the names of the instruments' errors."""


@dataclass(frozen=True)
class Contributor:
    """One source, or several that are drawn and listed together; ``other`` are all the small ones."""

    series: Series
    members: tuple[int, ...]
    other: bool = False

    @property
    def label(self) -> str:
        """Name for people."""
        return self.series.label


def groups(labels: Sequence[str], active: Sequence[int]) -> list[tuple[str, tuple[int, ...]]]:
    """Group sources that differ only in their axis, where there are more than have a colour.

    >>> groups(["bias x", "bias y", "drift"], [0, 1, 2])
    [('bias x', (0,)), ('bias y', (1,)), ('drift', (2,))]
    >>> groups([f"{name} {axis}" for name in "abcdef" for axis in "xyz"], range(18))[:2]
    [('a (3)', (0, 1, 2)), ('b (3)', (3, 4, 5))]
    """
    if len(active) <= SHOWN:
        return [(labels[j], (j,)) for j in active]
    result: dict[str, list[int]] = {}
    for j in active:
        result.setdefault(stem(labels[j]), []).append(j)
    return [
        (f"{kind} ({len(members)})", tuple(members)) if len(members) > 1 else (labels[members[0]], tuple(members))
        for kind, members in result.items()
    ]


def contributors(content: RunAnalysis) -> list[Contributor]:
    """Return all contributors, the largest mean share first; those that are small for every output are the last one.

    Small ones are so in the linear budget, by Monte Carlo and over time.
    """
    labels, shares = content.cause_names, np.nan_to_num(content.budget.shares)
    flown = flown_shares(content)
    sizes = shares if flown is None else np.maximum(shares, flown)
    sources = np.diag(content.model.covariance)
    active = [j for j in range(len(labels)) if j >= len(sources) or sources[j] > 0.0]
    grouped = groups(labels, active)
    mean = [float(shares[:, members].sum(axis=1).mean()) for _, members in grouped]
    largest = np.array([sizes[:, members].sum(axis=1).max(initial=0.0) for _, members in grouped])
    largest = np.maximum(largest, _largest_over_time(content, [members for _, members in grouped]))
    few = len(labels) <= SHOWN  # then a source has the same colour in every run
    return ranked(grouped, mean, largest, few)


def ranked(
    grouped: Sequence[tuple[str, tuple[int, ...]]], mean: Sequence[float], largest: Array, few: bool
) -> list[Contributor]:
    """Return groups of causes with a colour each, the largest mean share first, and the small ones together.

    Parameters
    ----------
    mean, largest : sequence of float
        Mean and largest share of each group.
    few : bool
        Whether every cause has a colour of its own, whatever its rank.
    """
    falling = np.argsort(-largest, kind="stable")
    kept = {int(k) for place, k in enumerate(falling) if largest[k] >= SMALL and place < SHOWN}
    small = [k for k in range(len(grouped)) if k not in kept]
    if len(small) == 1 and len(kept) < SHOWN:
        kept, small = kept | set(small), []
    chosen = sorted(kept, key=lambda k: (-mean[k], k))
    result = [
        Contributor(numbered(grouped[k][1][0] if few else place, grouped[k][0]), grouped[k][1])
        for place, k in enumerate(chosen)
    ]
    if not small:
        return result
    rest = tuple(j for k in small for j in grouped[k][1])
    return [*result, Contributor(Series("others", f"other {len(rest)} causes", OTHER), rest, other=True)]


def origins(content: RunAnalysis, consistency: FilterConsistency) -> list[Contributor]:
    """Return contributors by the origin of errors: the start, gyros, accelerometers, each sensor; others by kind."""
    record = content.manifest.model
    outputs = {output.name for output in record.outputs}
    names = [*(source.name for source in record.sources), *content.model.processes]
    sigmas = np.diag(content.model.covariance)
    first = ("initial errors", *INSTRUMENTS, *(humanize(sensor.name) for sensor in consistency.sensors))
    members: dict[str, list[int]] = {origin: [] for origin in first}
    for j, (name, label) in enumerate(zip(names, content.cause_names, strict=True)):
        if j < len(sigmas) and not sigmas[j] > 0.0:
            continue
        instrument = next((title for title, prefix in INSTRUMENTS.items() if name.startswith(prefix)), None)
        sensors = [sensor.name for sensor in consistency.sensors if name.startswith(f"{sensor.name}_")]
        origin = "initial errors" if name in outputs else instrument or humanize(max(sensors, key=len, default=""))
        members.setdefault(origin or stem(label), []).append(j)
    listed = [(origin, member) for origin, member in members.items() if member]
    rest = tuple(j for _, listed_source in listed[SHOWN:] for j in listed_source)
    others = [Contributor(Series("others", f"other {len(rest)} causes", OTHER), rest, other=True)] if rest else []
    return [
        *(
            Contributor(numbered(place, name), tuple(listed_source))
            for place, (name, listed_source) in enumerate(listed[:SHOWN])
        ),
        *others,
    ]


def _largest_over_time(content: RunAnalysis, members: Sequence[tuple[int, ...]]) -> Array:
    """Return each group's share of the largest linear sigma over the flight, in the output where it is largest."""
    known, largest = content.development, np.zeros(len(members))
    if known is None or not len(known.partials):
        return largest
    whole = np.sqrt(variance_over_time(content).max(axis=0))
    for k, member in enumerate(members):
        part = np.sqrt(variance_over_time(content, member).max(axis=0))
        shares = np.divide(part, whole, out=np.zeros_like(part), where=whole > 0.0) ** 2
        largest[k] = shares[content.moving].max(initial=0.0)
    return largest


def variance_over_time(content: RunAnalysis, members: Sequence[int] = ()) -> Array:
    """Compute the linear variance over time due to some causes, or all, shape (times, outputs), SI."""
    known, covariance = content.development, content.model.covariance
    partials = np.empty((0, *content.model.partials.shape)) if known is None else known.partials
    noise = [] if known is None else list(known.processes.values())
    if members:
        noise = [noise[j - len(covariance)] for j in members if j >= len(covariance)]
        sources = [j for j in members if j < len(covariance)]
        partials, covariance = partials[:, :, sources], covariance[np.ix_(sources, sources)]
    variance: Array = transformed_variances(partials, covariance)
    return np.maximum(variance + sum(noise, np.zeros_like(variance)), 0.0)


def flown_shares(content: RunAnalysis) -> Array | None:
    """Return the variance of each output with one source alone over the linear one; none where it is not known."""
    flown = content.manifest.model.budget
    if not flown or "failed" in flown["alone"]:
        return None
    variances = np.diag(content.comparison.covariance_linear)
    alone = np.array(flown["alone"]["alone"]["variance"], dtype=float)
    divisor = np.where(variances > 0.0, variances, np.nan)
    return np.asarray(np.nan_to_num(alone / divisor[:, None]))
