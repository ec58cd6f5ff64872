"""Verdict of linear analysis on a filter: true over stated sigma at every reading, without a sample and its error.

Both covariances are known: the filter's own P, and the mean squares T of the true errors about zero, so that a mean
error counts as it does for a filter, which knows of none. The ratio of an output is ``sqrt(T_ii / P_ii)``; that of a
group of d outputs is the root of its expected NEES over d, ``sqrt(trace(P^-1 T) / d)``.

The filter is *consistent* where every output and every group is within the tolerance at every reading, before and after
updates. It is *optimistic* where one lies above it, else *pessimistic*.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from mcnav.analysis.filter_causes import NEARLY, Departure, neglected_errors
from mcnav.analysis.filter_consistency import Honesty, NeglectedError
from mcnav.analysis.filter_decision import deciding_names, outputs_of
from mcnav.analysis.filter_evidence import LinearFilter, singular
from mcnav.analysis.linear_covariance import NOMINAL, LinearCovariance
from mcnav.arrays.types import Array, IndexArray


@dataclass(frozen=True)
class LinearVerdict:
    """Verdict of linear analysis on a filter.

    Attributes
    ----------
    verdict : Honesty
        Undecided where it would be consistent if gates did not reject good measurements.
    tolerance : float
        Of the ratio of true to stated sigma.
    label : str
        What the times are, as ``name [unit]``.
    times : ndarray, shape (r,)
        Readings that were judged.
    ratios : ndarray, shape (r, outputs)
        True over stated sigma; NaN where both are zero, infinite where the filter believes in no error that there is.
    groups : mapping of str to ndarray, shape (r,)
        Of groups of outputs together; NaN where the filter's covariance is singular.
    output, group : str
        What departs the most: one output, or, where none alone does, a group; both empty of a consistent filter.
    factor : float
        Its ratio at the worst reading; of a consistent filter the ratio farthest from one.
    worst : float
        Time of this reading.
    begin, end : float or None
        First and last time at which an output or group departs in the direction of the verdict.
    departing : ndarray of int
        Numbers of the readings at which one does.
    neglected : tuple of NeglectedError
        What makes that output optimistic at that reading, the largest share first; of a group nothing is known.
    floors : mapping of str to float
        Outputs of which neither the error nor the filter's sigma is above the floor at some reading with an error, and
        their floors, SI (`mcnav.analysis.floor`).
    """

    verdict: Honesty
    tolerance: float
    label: str
    times: Array = field(repr=False)
    ratios: Array = field(repr=False)
    groups: Mapping[str, Array] = field(repr=False)
    output: str
    group: str
    factor: float
    worst: float
    begin: float | None = None
    end: float | None = None
    departing: tuple[int, ...] = field(default=(), repr=False)
    neglected: tuple[NeglectedError, ...] = ()
    floors: Mapping[str, float] = field(default_factory=dict)

    @property
    def largest(self) -> tuple[float, float]:
        """The largest ratio of any output or group, and the first time at which it is reached; NaN without a ratio."""
        ratios = np.column_stack([self.ratios, *self.groups.values()])
        at_readings = np.where(np.isnan(ratios), -np.inf, ratios).max(axis=1, initial=-np.inf)
        if np.isneginf(at_readings).all():
            return np.nan, np.nan
        reading = int(np.argmax(at_readings))
        return float(at_readings[reading]), float(self.times[reading])

    @property
    def together(self) -> tuple[str, float] | None:
        """The group that is farther above its sigma than the output that is named, and its ratio."""
        if not self.output or self.verdict != Honesty.OPTIMISTIC:
            return None
        largest = {group: float(np.nanmax(ratios, initial=0.0)) for group, ratios in self.groups.items()}
        group = max(largest, key=largest.__getitem__, default="")
        if not group or largest[group] <= self.factor:
            return None
        return group, largest[group]

    @property
    def throughout(self) -> bool:
        """Return whether all readings from the first to the last departure depart."""
        return not self.departing or self.departing[-1] - self.departing[0] + 1 == len(self.departing)


def judge_filter(
    covariances: Sequence[LinearCovariance], outputs: Sequence[str], groups: Mapping[str, int], sources: Sequence[str],
    covariance: Array, tolerance: float, units: Sequence[str] = (), floor: Array | None = None,
    scales: Array | None = None,
) -> LinearVerdict | None:  # fmt: skip
    """Judge a filter by linear covariances over time; none without a filter.

    Parameters
    ----------
    covariances : sequence of LinearCovariance
        At one or more lists of readings.
    groups : mapping of str to int
        The filter's groups of states and their sizes; see `FilterSchema`. Judged are those on which the verdict of
        samples is (`deciding_names`), where all their states are outputs.
    sources : sequence of str
        Names, in the order of the columns of the partials.
    covariance : ndarray, shape (sources, sources)
        Of the sources.
    units, floor, scales
        As those of `LinearFilter`.
    """
    verdict = [_evidence(each, sources, covariance) for each in covariances if each.readings.own is not None]
    verdict = [each for each in verdict if len(each.covariance)]
    if not verdict:
        return None
    times = np.concatenate(
        [covariance.readings.times for covariance in covariances if covariance.readings.own is not None]
    )
    evidence = replace(
        _joined(verdict, np.argsort(times, kind="stable")), units=tuple(units), floor=floor, scales=scales
    )
    ratios = output_ratios(evidence)
    stated = np.asarray(np.isfinite(np.diagonal(evidence.covariance, axis1=1, axis2=2)).all(axis=0))
    members = {group: [i for i in outputs_of(group, outputs) if stated[i]] for group in deciding_names(groups)}
    together = {
        group: group_ratios(evidence, picked) for group, picked in members.items() if len(picked) == groups[group]
    }
    reached = _verdict(evidence, np.sort(times, kind="stable"), covariances[0].readings.label, outputs, ratios,
                       together, tolerance)  # fmt: skip
    return replace(reached, floors={outputs[i]: size for i, size in evidence.negligible.items()})


def _evidence(linear_covariance: LinearCovariance, sources: Sequence[str], covariance: Array) -> LinearFilter:
    """Return what `neglected_errors` asks for at the readings."""
    readings, mean = linear_covariance.readings, linear_covariance.mean
    assert readings.own is not None
    crossed = readings.partials * (readings.partials @ covariance)
    contributions = {name: crossed[:, :, k] for k, name in enumerate(sources) if np.any(crossed[:, :, k])}
    contributions |= {name: np.diagonal(added, axis1=1, axis2=2) for name, added in readings.processes.items()}
    nothing = np.zeros((len(mean), 0))
    true = linear_covariance.covariance + mean[:, :, None] * mean[:, None, :]
    by_mean = {name: values * mean for name, values in linear_covariance.means.items()}
    believed = {NOMINAL: 0.0} | dict(readings.believed)
    return LinearFilter(readings.own, nothing, true, nothing, contributions, believed, by_mean)


def _joined(filters: Sequence[LinearFilter], order: IndexArray) -> LinearFilter:
    """Put readings of several lists into one, in the order of time."""

    def joined(parts: Sequence[Array | None]) -> Array:
        return np.asarray(np.concatenate([part for part in parts if part is not None])[order])

    first = filters[0]
    return LinearFilter(
        joined([each.covariance for each in filters]),
        joined([each.state_variance for each in filters]),
        joined([each.true for each in filters]),
        joined([each.state_true for each in filters]),
        {name: joined([each.contributions[name] for each in filters]) for name in first.contributions},
        first.believed,
        {name: joined([each.squared_means[name] for each in filters]) for name in first.squared_means},
    )


def output_ratios(evidence: LinearFilter) -> Array:
    """Return true over stated sigma of each output, shape (r, outputs)."""
    true, own = evidence.sigmas
    ratio = np.divide(true, own, out=np.full_like(true, np.nan), where=own > 0.0)
    return np.where((own <= 0.0) & (true > 0.0), np.inf, ratio)


def group_ratios(evidence: LinearFilter, outputs: Sequence[int]) -> Array:
    """Return the root of the expected NEES of a group over its size, shape (r,)."""
    assert evidence.true is not None
    picked = np.ix_(range(len(evidence.true)), outputs, outputs)
    own, true, size = evidence.covariance[picked], evidence.true[picked], len(outputs)
    sigma = evidence.sigmas[1][:, list(outputs)]
    regular = np.asarray((sigma > 0.0).all(axis=1))
    scale = np.where(regular[:, None], sigma, 1.0)
    scales = scale[:, :, None] * scale[:, None, :]
    correlation = np.where(regular[:, None, None], own / scales, np.eye(size))
    regular &= ~singular(correlation)
    correlation[~regular] = np.eye(size)
    nees = np.trace(np.linalg.solve(correlation, true / scales), axis1=1, axis2=2)
    return np.asarray(np.where(regular, np.sqrt(np.maximum(nees, 0.0) / size), np.nan))


def _verdict(
    evidence: LinearFilter, times: Array, label: str, outputs: Sequence[str], ratios: Array,
    groups: Mapping[str, Array], tolerance: float,
) -> LinearVerdict:  # fmt: skip
    """Find the direction of the verdict, and the output or group that departs the most."""
    names = [*outputs, *groups]
    everything = np.column_stack([ratios, *groups.values()])
    known = np.nan_to_num(everything, nan=1.0, posinf=np.inf)
    above, below = known > 1.0 + tolerance, known < 1.0 - tolerance
    if not (above.any() or below.any()):
        away = np.abs(known - 1.0)
        farthest = int(np.argmax(away.max(axis=1)))
        factor = float(known[farthest, np.argmax(away[farthest])])
        return LinearVerdict(Honesty.CONSISTENT, tolerance, label, times, ratios, groups, "", "", factor,
                             float(times[farthest]))  # fmt: skip
    verdict, departs = (Honesty.OPTIMISTIC, above) if above.any() else (Honesty.PESSIMISTIC, below)
    away = known if verdict == Honesty.OPTIMISTIC else np.divide(1.0, known, out=np.full_like(known, np.inf),
                                                                 where=known > 0.0)  # fmt: skip
    single = departs[:, : len(outputs)].any()
    away = np.where(departs, away, 0.0)[:, : len(outputs) if single else None]
    largest = away.max(axis=1)
    reading = int(np.flatnonzero(largest >= NEARLY * largest.max())[-1])
    place = int(np.argmax(away[reading]))
    neglected: tuple[NeglectedError, ...] = ()
    if single and verdict == Honesty.OPTIMISTIC:
        neglected = neglected_errors(evidence, Departure(reading, place))
    departing = np.flatnonzero(departs.any(axis=1))
    return LinearVerdict(
        verdict, tolerance, label, times, ratios, groups,
        output=names[place] if single else "", group="" if single else names[place],
        factor=float(known[reading, place]), worst=float(times[reading]),
        begin=float(times[departing[0]]), end=float(times[departing[-1]]),
        departing=tuple(int(number) for number in departing), neglected=neglected,
    )  # fmt: skip
