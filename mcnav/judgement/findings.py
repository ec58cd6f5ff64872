"""Numbers that are named, one after another, each with those before it changed, until nothing is unusual."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.recorded import FilteredRecord
from mcnav.judgement.assessment import LEVEL, assess
from mcnav.judgement.likelihood import DROP, Factor, estimate_factor
from mcnav.judgement.naming import Candidate, Naming
from mcnav.judgement.reduction import present, with_causes, with_error, with_size
from mcnav.judgement.simulation import recorded

MOST_NUMBERS: Final = 3
"""Numbers that are named one after another."""

NOT_SEPARATE: Final = 5.0
"""Ratio of sigmas, with an arm free beside a delay and without, from which the record does not separate them."""

DELAY: Final = "_delay"

Again: TypeAlias = Callable[[Mapping[str, float]], FilteredRecord]
"""Takes a filter through a record again, the stamps of sensors moved back by delays, s."""


@dataclass(frozen=True)
class CauseVerdict:
    """A size of the campaign.

    Attributes
    ----------
    factor : Factor or None
        Estimated; none where it was not.
    gain : float
        Of the log-likelihood.
    log_factor : float or None
        That of the campaign, where the size is the root mean square of the sigmas of a log.
    absent : bool
        Whether the campaign does not have it.
    correlation_time : float
        For which it was looked for, s; zero of others.
    noticed : float or None
        Smallest of `FACTORS` that is noticed in 9 of 10 records; none for none of them.
    found, named : tuple of float
        Shares of simulated records in which each of `FACTORS` raises an alarm, and is named.
    """

    name: str
    key: str
    size: float
    unit: str
    shown_in: str
    factor: Factor | None
    gain: float
    noticed: float | None
    found: tuple[float, ...]
    named: tuple[float, ...]
    log_factor: float | None = None
    absent: bool = False
    correlation_time: float = 0.0


@dataclass(frozen=True)
class OffsetVerdict:
    """A constant error that the campaign does not have: estimates and their sigmas, and what is noticed, by axis.

    Attributes
    ----------
    beside_arm : tuple of float, optional
        Of a delay, the estimate and its sigma with the lever arm free as well.
    """

    name: str
    key: str
    axes: tuple[str, ...]
    unit: str
    shown_in: str
    estimate: tuple[float, ...]
    sigma: tuple[float, ...]
    used: tuple[float, ...] | None
    gain: float
    noticed: tuple[float, ...]
    beside_arm: tuple[float, float] | None = None


@dataclass(frozen=True)
class Finding:
    """A number that is named.

    Attributes
    ----------
    number : CauseVerdict or OffsetVerdict
    rivals : tuple of str
        Candidates from which it is not told apart.
    left : float
        Probability of a record as unusual as this one once it is changed.
    """

    number: CauseVerdict | OffsetVerdict
    rivals: tuple[str, ...]
    left: float


def find_numbers(
    record: FilteredRecord, numbers: Sequence[CauseVerdict | OffsetVerdict], settings: tuple[int, int],
    again: Again | None,
) -> tuple[Finding, ...]:  # fmt: skip
    """Name numbers one after another.

    Parameters
    ----------
    record : FilteredRecord
        With the processes that the campaign does not have.
    numbers : sequence of CauseVerdict or OffsetVerdict
        Of all that the campaign has, and constant errors that it does not have.
    settings : tuple of int
        Simulated records by which a changed campaign is judged, and their seed.
    """
    verdicts = {number.name: number for number in numbers}
    findings: list[Finding] = []
    while len(findings) < MOST_NUMBERS:
        found = _named(record, verdicts, again)
        if found is None or any(finding.number.name == found[0].name for finding in findings):
            break
        number, rivals, record = found
        of_campaign = with_causes(record, present(record))
        left = assess(of_campaign, recorded(of_campaign), settings[0], 1, settings[1])
        probability = float(left.probability(left.scores.max(axis=0))[0])
        findings.append(Finding(number, rivals, probability))
        if probability > LEVEL:
            break
    return tuple(findings)


def find_first(record: FilteredRecord, again: Again | None) -> Finding | None:
    """Name the foremost number alone, without asking what is left once it is changed: that probability is NaN."""
    found = _named(record, {}, again)
    return None if found is None else Finding(found[0], found[1], np.nan)


def _named(
    record: FilteredRecord, verdicts: Mapping[str, CauseVerdict | OffsetVerdict], again: Again | None
) -> tuple[CauseVerdict | OffsetVerdict, tuple[str, ...], FilteredRecord] | None:
    """Return what is named, what is not told apart from it, and the record of the campaign changed to it."""
    naming = Naming(record)
    named = naming.foremost()
    if named is None:
        return None
    number, changed = _changed(naming, named.candidate, verdicts.get(named.candidate.name), again)
    return number, tuple(rival.name for rival in named.rivals), changed


def _changed(
    naming: Naming, candidate: Candidate, verdict: CauseVerdict | OffsetVerdict | None, again: Again | None
) -> tuple[CauseVerdict | OffsetVerdict, FilteredRecord]:
    """Estimate a number, and return it with the record of the campaign changed to it."""
    if candidate.cause is not None:
        return _size(naming.record, candidate.cause, verdict, candidate.gain)
    assert candidate.offset is not None
    record, number = naming.record, candidate.offset
    known = record.offsets[number]
    if not isinstance(verdict, OffsetVerdict):
        used = None if known.used is None else tuple(known.used.tolist())
        verdict = OffsetVerdict(known.name, known.key, known.axes, known.unit, known.shown_in, (), (), used, 0.0, ())
    values, sigmas = _estimates(naming, candidate.free)
    moved_by = np.zeros_like(values)
    if candidate.name.endswith(DELAY) and again is not None:
        # to second order: what is left of the delay once the stamps are moved
        moved_by = values
        moved = again({candidate.name.removesuffix(DELAY): float(moved_by[0])})
        record = replace(moved, mean=moved.mean + record.mean)
        naming = Naming(record)
        values, sigmas = _estimates(naming, candidate.free)
    arm = naming.beside(number)
    together, errors = _estimates(naming, np.concatenate([candidate.free, arm]))
    count = len(candidate.free)
    beside_arm = None
    if len(arm) and np.all(errors[:count] < NOT_SEPARATE * sigmas):
        if naming.stands_beside(arm, candidate.free):
            values, sigmas = together[:count], errors[:count]
        elif count == 1:
            beside_arm = (float(moved_by[0] + together[0]), float(errors[0]))
    record = with_error(record, record.offsets[number].states, values)
    estimate = tuple((moved_by + values).tolist())
    changed = replace(
        verdict, estimate=estimate, sigma=tuple(sigmas.tolist()), gain=candidate.gain, beside_arm=beside_arm
    )
    return changed, record


def _estimates(naming: Naming, free: IndexArray) -> tuple[Array, Array]:
    sums = naming.scan.base
    return sums.estimate(free), np.sqrt(np.maximum(np.diag(sums.inverse(free)), 0.0))


def _size(
    record: FilteredRecord, number: int, verdict: CauseVerdict | OffsetVerdict | None, gain: float
) -> tuple[CauseVerdict, FilteredRecord]:
    """Estimate a size with its interval, of the campaign or of a process that it does not have."""
    kept = sorted({*present(record), number})
    small, cause = with_causes(record, kept), record.causes[number]
    factor: Factor = estimate_factor(small, recorded(small), kept.index(number), DROP)
    if isinstance(verdict, CauseVerdict):
        changed = replace(verdict, factor=factor)
    else:
        changed = CauseVerdict(
            cause.name, cause.key, cause.size, cause.unit, cause.shown_in, factor, gain, None, (), (),
            absent=True, correlation_time=cause.correlation_time,
        )  # fmt: skip
    return changed, with_size(record, number, factor.value)
