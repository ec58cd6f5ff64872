"""The verdict on one record: whether it is at odds with its campaign, which number is wrong, and what could be seen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.recorded import FilteredRecord
from mcnav.judgement.assessment import LEVEL, assess
from mcnav.judgement.findings import Again, CauseVerdict, Changes, Finding, OffsetVerdict, find_numbers
from mcnav.judgement.numbers import list_numbers, with_intervals
from mcnav.judgement.reduction import present, with_causes
from mcnav.judgement.simulation import Innovations, beside, recorded, simulate
from mcnav.judgement.statistics import SensorStatistics, mean_nees, sensor_statistics
from mcnav.judgement.whitened_records import Tell

if TYPE_CHECKING:
    import pandas as pd

SIMULATED: Final = 1000
"""Simulated records."""

TRIALS: Final = 100
"""Simulated records for each size whose power is computed."""

MANY_STAGES: Final = 1500
"""Measurements above which factors are estimated only of the numbers whose likelihood gains most."""

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
    def explained(self) -> bool:
        """Return whether what is named explains the record: of the changed campaign's records some are as unusual."""
        return bool(self.findings) and self.findings[-1].left * (self.simulated + 1.0) >= 1.5

    @property
    def frame(self) -> pd.DataFrame:
        """The numbers of the campaign, a row a ``number``.

        ``size`` and its ``unit``, SI; ``factor`` by which it is wrong with ``factor_from`` and ``factor_to`` at 95 %,
        NaN where it was not estimated; ``noticed``, the least factor that would be noticed in 9 of 10 records;
        ``named``, whether it is what is wrong; none is where what comes nearest does not explain the record.
        """
        import pandas as pd

        named = {finding.number.name for finding in self.findings if self.explained}
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
            f"{named} would explain it"
            if named and self.explained
            else "no single number explains it"
            if self.alarm
            else "nothing named"
        )
        share = f"{self.probability:.1%} of {self.simulated:,} simulated records are as unusual"
        return f"The record {at_odds} with the campaign ({share}); {words}.\n\n{self.frame.to_string()}"


def judge(
    record: FilteredRecord, count: int = SIMULATED, trials: int = TRIALS, seed: int = 0,
    tell: Tell = lambda seconds: None, again: Again | None = None,
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
    again : callable, optional
        Takes the filter through the record again, its sensors' stamps moved back by delays, s; without it a delay is
        known to first order.
    """
    own = present(record)
    of_campaign = with_causes(record, own)
    given = recorded(of_campaign)
    assessment = assess(of_campaign, given, count, trials, seed, tell)
    causes, offsets = list_numbers(of_campaign, assessment)
    probability = float(assessment.probability(assessment.scores.max(axis=0))[0])
    drops = dict(zip(own, assessment.drops.tolist(), strict=True))
    findings: tuple[Finding, ...] = ()
    changes = Changes(record)
    if probability <= LEVEL:
        findings, changes = find_numbers(record, (*causes, *offsets), (count, seed), again, drops)
    many, foremost = len(record.stages) > MANY_STAGES, int(assessment.foremost[0])
    wanted = {number: drop for place, (number, drop) in enumerate(drops.items()) if not many or place == foremost}
    causes, offsets = with_intervals(causes, offsets, findings, changes, wanted)
    simulated = simulate(of_campaign, count, np.random.default_rng((seed, 1)))
    sensors, nees = _of_filter(of_campaign, beside([given, simulated]))
    return Judgement(
        record.duration, len(record.stages), count, probability, findings, sensors, nees, causes, offsets,
        record.notes, simulated.errors.std(axis=2),
    )  # fmt: skip


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
