"""The verdict on one record: whether it is at odds with its campaign, which number is wrong, and what could be seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.recorded import FilteredRecord, Part
from mcnav.judgement.assessment import FACTORS, LEVEL, SHARE, Assessment, Tell, assess
from mcnav.judgement.likelihood import Factor, estimate_factor
from mcnav.judgement.simulation import Innovations, beside, recorded, simulate
from mcnav.judgement.statistics import SensorStatistics, mean_nees, sensor_statistics

if TYPE_CHECKING:
    import pandas as pd

SIMULATED: Final = 1000
"""Simulated records."""

TRIALS: Final = 100
"""Simulated records for each size whose power is computed."""

MOST_NUMBERS: Final = 3
"""Numbers that are named one after another."""

TOLD_APART: Final = float(np.log(20.0))
"""Difference of log-likelihoods below which two candidates are not told apart: a ratio of twenty."""

MANY_STAGES: Final = 1500
"""Measurements above which factors are estimated only of numbers that are named."""

RANGE: Final = (0.025, 0.975)
"""Probabilities of the ends of the ranges of simulated records."""


@dataclass(frozen=True)
class Statistic:
    """A statistic of the record, and the range of 95 % of simulated records."""

    value: float
    low: float
    high: float

    @property
    def usual(self) -> bool:
        """Return whether it is within the range."""
        return self.low <= self.value <= self.high


@dataclass(frozen=True)
class SensorVerdict:
    """A sensor: updates, rejected ones, mean NIS over its components, autocorrelation and correlation length, s."""

    name: str
    updates: int
    rejected: int
    expected_rejected: float | None
    nis: Statistic
    autocorrelation: Statistic
    correlation_length: Statistic


@dataclass(frozen=True)
class NeesVerdict:
    """Mean NEES over three of a group of navigation errors, against the reference."""

    group: str
    nees: Statistic


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


@dataclass(frozen=True)
class OffsetVerdict:
    """A constant error that the campaign does not have: estimates and their sigmas, and what is noticed, by axis."""

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


@dataclass(frozen=True, repr=False)
class Judgement:
    """The verdict on a record.

    Attributes
    ----------
    probability : float
        Share of simulated records that are as unusual.
    findings : tuple of Finding
        What is wrong, the foremost first; empty where nothing is, or no number of the campaign explains it.
    predicted : ndarray, shape (m, 9)
        Sigmas of the navigation errors less the reference's in simulated records, at the stages with a read-out.

    Examples
    --------
    A record whose fixes scatter three times as much as the campaign says; ``mcnav judge --record`` writes such files.

    >>> import mcnav as mc
    >>> judgement = mc.judge("flight.toml", mc.RecordingFiles("imu.csv", {"gnss": "gnss.csv"}, "reference.csv"), 200)
    >>> judgement.alarm, list(judgement.frame.query("named").index)
    (True, ['gnss_position_noise'])
    """

    duration: float
    measurements: int
    simulated: int
    probability: float
    findings: tuple[Finding, ...]
    sensors: tuple[SensorVerdict, ...]
    nees: tuple[NeesVerdict, ...]
    causes: tuple[CauseVerdict, ...]
    offsets: tuple[OffsetVerdict, ...]
    notes: tuple[str, ...]
    predicted: Array

    @property
    def alarm(self) -> bool:
        """Return whether the record is at odds with the campaign, at a probability of a false alarm of 5 %."""
        return self.probability <= LEVEL

    @property
    def frame(self) -> pd.DataFrame:
        """The numbers of the campaign, a row a ``number``.

        ``size`` and its ``unit``, SI; ``factor`` by which it is wrong with ``factor_from`` and ``factor_to`` at 95 %,
        NaN where it was not estimated; ``noticed``, the least factor that would be noticed in 9 of 10 records;
        ``named``, whether it is what is wrong.
        """
        import pandas as pd

        named = {finding.number.name for finding in self.findings}
        rows = [
            {"number": cause.name, "size": cause.size, "unit": cause.unit,
             "factor": np.nan if cause.factor is None else cause.factor.value,
             "factor_from": np.nan if cause.factor is None else cause.factor.low,
             "factor_to": np.nan if cause.factor is None else cause.factor.high,
             "noticed": np.nan if cause.noticed is None else cause.noticed, "named": cause.name in named}
            for cause in self.causes
        ]  # fmt: skip
        return pd.DataFrame(rows).set_index("number")

    def __repr__(self) -> str:
        """Write the verdict and the numbers as a table."""
        at_odds = "is at odds" if self.alarm else "is not at odds"
        named = ", ".join(finding.number.name for finding in self.findings)
        words = (
            f"{named} would explain it" if named else "no single number explains it" if self.alarm else "nothing named"
        )
        share = f"{self.probability:.1%} of {self.simulated:,} simulated records are as unusual"
        return f"The record {at_odds} with the campaign ({share}); {words}.\n\n{self.frame.to_string()}"


def judge(
    record: FilteredRecord, count: int = SIMULATED, trials: int = TRIALS, seed: int = 0,
    tell: Tell = lambda seconds: None,
) -> Judgement:  # fmt: skip
    """Judge one record by records of the same campaign simulated.

    Parameters
    ----------
    count : int
        Simulated records.
    trials : int
        Simulated records for each size whose power is computed.
    tell : callable
        Told how long the verdict will take, s, where no number is named.
    """
    given = recorded(record)
    estimates = 2.0 if len(record.stages) <= MANY_STAGES else 1.0  # factors of all numbers take as long as their gains
    assessment = assess(record, given, count, trials, seed, lambda seconds: tell(estimates * seconds))
    causes = _causes(record, given, assessment)
    offsets = _offsets(record, assessment)
    probability = float(assessment.probability(assessment.scores.max(axis=0))[0])
    findings = _findings(record, assessment, (*causes, *offsets), (count, trials, seed)) if probability <= LEVEL else ()
    simulated = simulate(record, count, np.random.default_rng((seed, 1)))
    sensors, nees = _of_filter(record, beside([given, simulated]))
    return Judgement(
        record.duration, len(record.stages), count, probability, findings, sensors, nees, causes, offsets,
        record.notes, simulated.errors.std(axis=2),
    )  # fmt: skip


def _causes(record: FilteredRecord, given: Innovations, assessment: Assessment) -> tuple[CauseVerdict, ...]:
    critical = assessment.critical
    foremost = int(assessment.foremost[0])
    result = []
    for number, cause in enumerate(record.causes):
        factor = None
        if len(record.stages) <= MANY_STAGES or number == foremost:
            factor = estimate_factor(record, given, number, float(assessment.drops[number]))
        found = np.mean(assessment.power[number] > critical, axis=-1)
        named = np.mean((assessment.power[number] > critical) & (assessment.named[number] == number), axis=-1)
        noticed = next((size for size, share in zip(FACTORS, found, strict=True) if share >= SHARE), None)
        verdict = CauseVerdict(
            cause.name, cause.key, cause.size, cause.unit, cause.shown_in, factor, float(assessment.gains[number, 0]),
            noticed, tuple(found.tolist()), tuple(named.tolist()), cause.log_factor,
        )  # fmt: skip
        result.append(verdict)
    return tuple(result)


def _offsets(record: FilteredRecord, assessment: Assessment) -> tuple[OffsetVerdict, ...]:
    result = []
    gains = assessment.gains[len(record.causes) :, 0]
    for number, offset in enumerate(record.offsets):
        estimate, covariance = assessment.offsets[number]
        result.append(
            OffsetVerdict(
                offset.name, offset.key, offset.axes, offset.unit, offset.shown_in, tuple(estimate[:, 0].tolist()),
                tuple(np.sqrt(np.maximum(np.diag(covariance), 0.0)).tolist()),
                None if offset.used is None else tuple(offset.used.tolist()), float(gains[number]),
                tuple(assessment.sensitivity[number].tolist()),
            )
        )  # fmt: skip
    return tuple(result)


def _findings(
    record: FilteredRecord, assessment: Assessment, numbers: Sequence[CauseVerdict | OffsetVerdict],
    settings: tuple[int, int, int],
) -> tuple[Finding, ...]:  # fmt: skip
    """Name numbers one after another, each with those before it changed, until nothing is unusual."""
    findings: list[Finding] = []
    while len(findings) < MOST_NUMBERS:
        critical = assessment.critical
        if not np.any(assessment.scores[-assessment.candidates :, 0] > min(critical, 1.0)):
            break
        foremost = int(assessment.foremost[0])
        net = assessment.gains[:, 0] - assessment.freedom
        rivals = tuple(
            numbers[n].name for n in np.argsort(-net) if n != foremost and net[foremost] - net[n] < TOLD_APART
        )
        number = numbers[foremost]
        if findings:
            number = _again(record, assessment, foremost, number)
        record = _changed(record, foremost, number)
        assessment = assess(record, recorded(record), *settings)
        left = float(assessment.probability(assessment.scores.max(axis=0))[0])
        findings.append(Finding(number, rivals, left))
        if left > LEVEL or any(each.number.name == number.name for each in findings[:-1]):
            break
    return tuple(findings)


def _again(
    record: FilteredRecord, assessment: Assessment, foremost: int, number: CauseVerdict | OffsetVerdict
) -> CauseVerdict | OffsetVerdict:
    """Estimate a number again, with others changed before it."""
    if isinstance(number, CauseVerdict):
        return replace(
            number, factor=estimate_factor(record, recorded(record), foremost, float(assessment.drops[foremost]))
        )
    estimate = assessment.offsets[foremost - len(record.causes)][0]
    return replace(number, estimate=tuple(estimate[:, 0].tolist()))


def _changed(record: FilteredRecord, foremost: int, number: CauseVerdict | OffsetVerdict) -> FilteredRecord:
    """Return the record of a campaign with a number changed to its estimate."""
    if isinstance(number, OffsetVerdict):
        mean = record.mean.copy()
        mean[record.offsets[foremost - len(record.causes)].states] += number.estimate
        return replace(record, mean=mean)
    if number.factor is None:
        return record
    factor = number.factor.value

    def scaled(parts: tuple[Part, ...]) -> tuple[Part, ...]:
        return tuple(
            replace(part, covariance=part.covariance * factor**2) if part.cause == foremost else part for part in parts
        )

    scale = np.where(record.initial_causes == foremost, factor, 1.0)
    stages = tuple(
        replace(stage, processes=scaled(stage.processes), noise=scaled(stage.noise)) for stage in record.stages
    )
    return replace(record, initial=record.initial * np.outer(scale, scale), stages=stages)


def _of_filter(record: FilteredRecord, both: Innovations) -> tuple[tuple[SensorVerdict, ...], tuple[NeesVerdict, ...]]:
    """Return the statistics of the filter with the ranges of simulated records."""
    sensors = tuple(
        _sensor(record, number, statistics) for number, statistics in enumerate(sensor_statistics(record, both))
    )
    nees = tuple(NeesVerdict(group, _statistic(values)) for group, values in mean_nees(record, both).items())
    return sensors, nees


def _sensor(record: FilteredRecord, number: int, statistics: SensorStatistics) -> SensorVerdict:
    sensor = record.sensors[number]
    stages = [stage for stage in record.stages if stage.sensor == number]
    expected = None if sensor.gate is None else (1.0 - sensor.gate) * len(stages)
    return SensorVerdict(
        sensor.name, len(stages), sum(not stage.accepted for stage in stages), expected, _statistic(statistics.nis),
        _statistic(statistics.autocorrelations[0]), _statistic(statistics.correlation_length),
    )  # fmt: skip


def _statistic(values: Array) -> Statistic:
    """Compare the first of some values with the others."""
    low, high = np.quantile(values[1:], RANGE)
    return Statistic(float(values[0]), float(low), float(high))
