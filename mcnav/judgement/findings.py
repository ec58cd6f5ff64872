"""Numbers that are named, one after another, each with those before it changed, until nothing is unusual."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final, TypeAlias

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.recorded import FilteredRecord
from mcnav.judgement.assessment import LEVEL, assess
from mcnav.judgement.naming import CLOCK, DELAY, Candidate, Named, Naming
from mcnav.judgement.profile import DROP, Factor
from mcnav.judgement.reduction import present, with_causes, with_error, with_size
from mcnav.judgement.simulation import recorded

MOST_NUMBERS: Final = 3
"""Numbers that are named one after another."""

NOT_SEPARATE: Final = 5.0
"""Ratio of sigmas, with an arm free beside a delay and without, from which the record does not separate them."""

UNSEEN: Final = 0.1
"""Sigma of a scale factor from which the record says nothing of it: no instrument is wrong by a tenth."""

PASSES: Final = 4
"""Times, at most, that stamps are moved until what is left of a delay is below its sigma."""

Again: TypeAlias = Callable[[Mapping[str, tuple[float, float]]], FilteredRecord]
"""Takes a filter through a record again, the stamps of sensors moved back by delays: s at the start, and s per s."""


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
    at_start : float
        Of a clock rate, the delay at the start of the record that is estimated with it, s.
    too_long : bool
        Of a delay, whether a campaign with it is at odds with the record: innovations are not linear in it. The record
        with its stamps moved back is not at odds.
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
    at_start: float = 0.0
    too_long: bool = False

    @property
    def seen(self) -> tuple[bool, ...]:
        """Axes of which the record says something: a scale factor needs motion along its axis."""
        return tuple(self.unit != "1" or sigma < UNSEEN for sigma in self.sigma)


@dataclass(frozen=True)
class Finding:
    """A number that is named.

    Attributes
    ----------
    number : CauseVerdict or OffsetVerdict
    rivals : tuple of CauseVerdict or OffsetVerdict
        Numbers from which it is not told apart, each estimated as if it were what is wrong.
    left : float
        Probability of a record as unusual as this one once it is changed.
    """

    number: CauseVerdict | OffsetVerdict
    rivals: tuple[CauseVerdict | OffsetVerdict, ...]
    left: float

    @property
    def alternatives(self) -> tuple[CauseVerdict | OffsetVerdict, ...]:
        """What may be wrong, the likeliest first."""
        return (self.number, *self.rivals)


@dataclass(frozen=True)
class Changes:
    """What is changed in a record for the numbers that are named.

    Attributes
    ----------
    record : FilteredRecord
        As the campaign has it, the stamps of sensors moved back by `delays`.
    delays : mapping of str to (float, float)
        Of sensors, s at the start of the record, and s per s.
    errors : mapping of str to ndarray
        Constant errors, beside these delays.
    sizes : mapping of int to float
        Factors of sizes.
    """

    record: FilteredRecord
    delays: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    errors: Mapping[str, Array] = field(default_factory=dict)
    sizes: Mapping[int, float] = field(default_factory=dict)

    @property
    def changed(self) -> FilteredRecord:
        """The record of the changed campaign."""
        record = self.record
        for number, factor in self.sizes.items():
            record = with_size(record, number, factor)
        for offset in record.offsets:
            if offset.name in self.errors:
                record = with_error(record, offset.states, self.errors[offset.name])
        return record

    @cached_property
    def naming(self) -> Naming:
        """The candidates of the changed campaign; the constant errors are free in everything."""
        return Naming(self.changed, tuple(self.errors))

    def moved(self, candidate: Candidate, again: Again | None) -> Changes:
        """Move the stamps of a sensor back by its delay, until what is left is an error of less than a sigma."""
        changes, sensor = self, candidate.sensor
        for _ in range(PASSES if again is not None and sensor else 0):
            assert again is not None
            values, sigmas = _estimates(changes.naming, candidate.free)
            if changes is not self and np.all(np.abs(values) < sigmas):
                break
            start, rate = changes.delays.get(sensor, (0.0, 0.0))
            clock = candidate.name.endswith(CLOCK)
            rate += float(values[0]) if clock else 0.0
            start += float(np.sum(values[1:])) if clock else float(values[0])
            delays = {**changes.delays, sensor: (start, rate)}
            changes = replace(changes, record=again(delays), delays=delays)
        return changes

    def with_error(self, name: str, values: Array) -> Changes:
        """Add a constant error."""
        return replace(self, errors={**self.errors, name: values})

    def with_size(self, number: int, factor: float) -> Changes:
        """Multiply a size."""
        return replace(self, sizes={**self.sizes, number: factor})

    def with_delays_in(self, record: FilteredRecord) -> Changes:
        """Return the changes of a record with its stamps as they were: delays are constant errors, to first order."""
        errors = dict(self.errors)
        for sensor, (start, _) in self.delays.items():
            errors[sensor + DELAY] = errors.get(sensor + DELAY, np.zeros(1)) + start
        return Changes(record, {}, errors, self.sizes)

    def left(self, simulated: int, seed: int) -> float:
        """Return the probability of a record as unusual as this one with everything changed."""
        record = self.changed
        of_campaign = with_causes(record, present(record))
        assessment = assess(of_campaign, recorded(of_campaign), simulated, 1, seed)
        return float(assessment.probability(assessment.scores.max(axis=0))[0])


def find_numbers(
    record: FilteredRecord, numbers: Sequence[CauseVerdict | OffsetVerdict], settings: tuple[int, int],
    again: Again | None, drops: Mapping[int, float] | None = None,
) -> tuple[tuple[Finding, ...], Changes]:  # fmt: skip
    """Name numbers one after another; return them, and what they change.

    Parameters
    ----------
    record : FilteredRecord
        With the processes that the campaign does not have.
    numbers : sequence of CauseVerdict or OffsetVerdict
        Of all that the campaign has, and constant errors that it does not have.
    settings : tuple of int
        Simulated records by which a changed campaign is judged, and their seed.
    drops : mapping of int to float
        Falls of the log-likelihood at the ends of the intervals of sizes, by cause; of others `DROP`.
    """
    verdicts = {number.name: number for number in numbers}
    findings, changes = list[Finding](), Changes(record)
    while len(findings) < MOST_NUMBERS:
        named = changes.naming.foremost()
        if named is None or any(finding.number.name == named.candidate.name for finding in findings):
            break
        rivals = _rivals(named, changes, verdicts, again, drops or {})
        number, changes = _estimated(named.candidate, changes, verdicts, again, drops or {})
        findings.append(Finding(number, rivals, changes.left(*settings)))
        if findings[-1].left > LEVEL:
            break
    if findings and findings[-1].left > LEVEL and any(finding.number.name.endswith(DELAY) for finding in findings):
        too_long = changes.with_delays_in(record).left(*settings) <= LEVEL
        findings = [_marked(finding, too_long) for finding in findings]
    return tuple(findings), changes


def _marked(finding: Finding, too_long: bool) -> Finding:
    number = finding.number
    if not isinstance(number, OffsetVerdict) or not number.name.endswith(DELAY):
        return finding
    return replace(finding, number=replace(number, too_long=too_long))


def find_first(record: FilteredRecord, again: Again | None) -> tuple[Finding, Changes] | None:
    """Name the foremost number alone, without asking what is left once it is changed: that probability is NaN."""
    changes = Changes(record)
    named = changes.naming.foremost()
    if named is None:
        return None
    rivals = _rivals(named, changes, {}, again, {})
    number, changes = _estimated(named.candidate, changes, {}, again, {})
    return Finding(number, rivals, np.nan), changes


def _rivals(
    named: Named, changes: Changes, verdicts: Mapping[str, CauseVerdict | OffsetVerdict],
    again: Again | None, drops: Mapping[int, float],
) -> tuple[CauseVerdict | OffsetVerdict, ...]:  # fmt: skip
    return tuple(_estimated(rival, changes, verdicts, again, drops)[0] for rival in named.rivals)


def _estimated(
    candidate: Candidate, changes: Changes, verdicts: Mapping[str, CauseVerdict | OffsetVerdict],
    again: Again | None, drops: Mapping[int, float],
) -> tuple[CauseVerdict | OffsetVerdict, Changes]:  # fmt: skip
    """Estimate a number, and return it with what it changes beside the others."""
    naming, verdict = changes.naming, verdicts.get(candidate.name)
    if candidate.cause is not None:
        factor = naming.scan.factors({candidate.cause: drops.get(candidate.cause, DROP)})[candidate.cause]
        cause = verdict if isinstance(verdict, CauseVerdict) else _absent_cause(naming.record, candidate)
        return replace(cause, factor=factor), changes.with_size(candidate.cause, factor.value)
    assert candidate.offset is not None
    offset = verdict if isinstance(verdict, OffsetVerdict) else _offset(naming.record, candidate)
    changes, count = changes.moved(candidate, again), len(offset.axes)
    start, rate = changes.delays.get(candidate.sensor, (0.0, 0.0))
    moved_by = rate if candidate.name.endswith(CLOCK) else start
    values, sigmas, beside_arm = _beside_arm(changes.naming, candidate, moved_by)
    estimates, errors, at_start = moved_by + values[:count], sigmas[:count], 0.0
    if candidate.name.endswith(CLOCK):  # from a share of the stamps to one of the time of the readings
        errors, estimates = errors / (1.0 - estimates) ** 2, estimates / (1.0 - estimates)
        at_start = start + float(np.sum(values[count:]))
    offset = replace(
        offset, estimate=tuple(estimates.tolist()), sigma=tuple(errors.tolist()), gain=candidate.gain,
        beside_arm=beside_arm, at_start=at_start,
    )  # fmt: skip
    if len(values) > count:
        changes = changes.with_error(candidate.sensor + DELAY, values[count:])
    return offset, changes.with_error(candidate.name, values[:count])


def _absent_cause(record: FilteredRecord, candidate: Candidate) -> CauseVerdict:
    assert candidate.cause is not None
    cause = record.causes[candidate.cause]
    return CauseVerdict(
        cause.name, cause.key, cause.size, cause.unit, cause.shown_in, None, candidate.gain, None, (), (),
        absent=cause.absent, correlation_time=cause.correlation_time,
    )  # fmt: skip


def _offset(record: FilteredRecord, candidate: Candidate) -> OffsetVerdict:
    assert candidate.offset is not None
    known = record.offsets[candidate.offset]
    used = None if known.used is None else tuple(known.used.tolist())
    return OffsetVerdict(known.name, known.key, known.axes, known.unit, known.shown_in, (), (), used, 0.0, ())


def _beside_arm(
    naming: Naming, candidate: Candidate, moved_by: float
) -> tuple[Array, Array, tuple[float, float] | None]:
    """Estimate a constant error with its sigmas; of a delay with the lever arm free as well, where that says more."""
    values, sigmas = _estimates(naming, candidate.free)
    arm = naming.beside(candidate.name)
    count = len(candidate.free)
    if len(arm):
        together, errors = _estimates(naming, np.concatenate([candidate.free, arm]))
        if np.all(errors[:count] < NOT_SEPARATE * sigmas):
            if naming.stands_beside(arm, candidate.free):
                return together[:count], errors[:count], None
            if count == 1:
                return values, sigmas, (moved_by + float(together[0]), float(errors[0]))
    return values, sigmas, None


def _estimates(naming: Naming, free: IndexArray) -> tuple[Array, Array]:
    """Estimate errors, with their sigmas; those that are named already are free as well."""
    together, count = naming.scan.with_settled(free), len(free)
    values, covariance = naming.scan.base.estimates(together)[0], naming.scan.base.covariances(together)[0]
    return values[:count], np.sqrt(np.maximum(np.diag(covariance), 0.0))[:count]
