"""Entries of a summary on a filter; over time it is in ``epochs.parquet`` and ``filter.parquet``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from mcnav.analysis.filter_consistency import (
    CertainDeparture,
    FilterConsistency,
    Finding,
    GroupConsistency,
    SensorConsistency,
    SigmaConsistency,
)
from mcnav.analysis.filter_remarks import sentence
from mcnav.analysis.summary import (
    Departure,
    FaultEntry,
    FilterRatio,
    FilterSummary,
    NeglectedEntry,
    SensorEntry,
)
from mcnav.statistics.proportions import probability_interval
from mcnav.store.manifest import FaultRecord


def filter_entries(consistency: FilterConsistency) -> Mapping[str, Any]:
    """Return the keys of a summary on a filter.

    ``covariance_filter`` is the mean of what the samples' filters state at the end, after the last update, and
    ``sigma_filter`` the root of its diagonal. ``nees_filter_mean`` is the mean NEES of the navigation errors at the
    end, whose expected value is ``nees_filter_dimension``; ``nis_mean`` is over the whole flight.
    """
    whole = next(
        (group for group in consistency.groups if group.name == "navigation"), next(iter(consistency.groups), None)
    )
    covariance = consistency.covariance
    return {
        "covariance_filter": covariance,
        "sigma_filter": None if covariance is None else np.sqrt(np.maximum(np.diag(covariance), 0.0)),
        "nees_filter_mean": None if whole is None else float(whole.nees.value[-1]),
        "nees_filter_dimension": None if whole is None else whole.size,
        "nis_mean": {sensor.name: sensor.nis_whole for sensor in consistency.sensors},
        "filter_verdict": sentence(consistency),
        "filter": _table(consistency),
    }


def smoother_entries(consistency: FilterConsistency) -> Mapping[str, Any]:
    """Return the keys of a summary on a smoother."""
    return {"smoother_verdict": sentence(consistency), "smoother": _table(consistency)}


def fault_entries(faults: Sequence[FaultRecord], consistency: FilterConsistency | None) -> list[FaultEntry]:
    """Return what the gates of sensors had of faults, beside what linear analysis expects.

    Of one measurement the interval is Clopper and Pearson's; of several none is stated: rejections follow one another.
    """
    return [_fault(fault, consistency) for fault in faults]


def _fault(fault: FaultRecord, consistency: FilterConsistency | None) -> FaultEntry:
    sensors = () if consistency is None else consistency.sensors
    rejected, ends = None, None
    if consistency is not None and (found := next((sensor for sensor in sensors if sensor.name == fault.sensor), None)):
        rejected = float(np.sum(found.rejected[fault.first + 1 : fault.last + 1]))
        if fault.measurements == 1:
            hits = round(rejected * consistency.samples)
            ends = probability_interval(hits, consistency.samples, consistency.confidence)
    kept = fault.model_dump(include={"sensor", "kind", "component", "unit", "shown_in", "begin", "end", "size"})
    return FaultEntry(
        **kept, measurements=fault.measurements, rejected=rejected, rejected_interval=ends, expected=fault.rejections,
        alarm=fault.alarm,
    )  # fmt: skip


def _table(consistency: FilterConsistency) -> FilterSummary:
    """Return the verdict, and of every table what holds at the end or over the whole flight."""
    return FilterSummary(
        verdict=consistency.verdict.value,
        group=consistency.group,
        output=consistency.output,
        factor=consistency.factor,
        factor_interval=consistency.interval,
        time=consistency.label,
        begin=consistency.begin,
        end=consistency.end,
        worst=consistency.worst,
        samples=consistency.samples,
        tolerance=consistency.tolerance,
        confidence=consistency.confidence,
        samples_needed=consistency.samples_needed,
        neglected=[NeglectedEntry(**asdict(judged)) for judged in consistency.neglected],
        neglected_at=consistency.neglected_at,
        neglected_output=consistency.neglected_output,
        remarks=list(consistency.remarks),
        verdict_groups=consistency.on_groups.value,
        verdict_outputs=consistency.on_outputs.value,
        departures=[_departure(departure) for departure in consistency.departures],
        groups={group.name: _group(group, consistency) for group in consistency.groups},
        outputs={output.name: _sigma(output, consistency) for output in consistency.outputs},
        states={state.name: _sigma(state, consistency) for state in consistency.states},
        sensors={sensor.name: _sensor(sensor) for sensor in consistency.sensors},
    )


def _departure(departure: CertainDeparture) -> Departure:
    return Departure(
        verdict=departure.verdict.value,
        of="group" if departure.size else "output",
        name=departure.name,
        factor=departure.factor,
        factor_interval=departure.interval,
        begin=departure.begin,
        end=departure.end,
        worst=departure.worst,
    )


def _finding(finding: Finding, consistency: FilterConsistency) -> Mapping[str, Any]:
    """Return the keys that a finding over time has in every table."""
    times = {
        key: None if epoch is None else float(consistency.times[epoch])
        for key, epoch in (("begin", finding.begin), ("end", finding.end), ("worst", finding.worst))
    }
    verdict = {"verdict": finding.verdict.value, "factor": finding.factor, "factor_interval": finding.interval}
    return {**verdict, **times, "samples_needed": finding.samples_needed, "remark": finding.remark}


def _group(group: GroupConsistency, consistency: FilterConsistency) -> FilterRatio:
    return FilterRatio(
        size=group.size,
        nees_mean=group.nees.value[-1],
        nees_interval=group.nees.each[-1],
        nees_bounds=group.bounds_each,
        ratio=group.ratio.value[-1],
        ratio_interval=group.ratio.each[-1],
        ratio_linear=None if group.linear is None else group.linear[-1],
        **_finding(group.finding, consistency),
    )


def _sigma(judged: SigmaConsistency, consistency: FilterConsistency) -> FilterRatio:
    linear = judged.linear
    shares: Mapping[str, Any] = {}
    if judged.within_1 is not None and judged.within_3 is not None:
        shares = {
            "within_1": judged.within_1.value[-1],
            "within_1_bounds": judged.bounds_1,
            "within_3": judged.within_3.value[-1],
            "within_3_bounds": judged.bounds_3,
        }
    return FilterRatio(
        unit=judged.unit,
        sigma_true=judged.true[-1],
        sigma_filter=judged.filter[-1],
        ratio=judged.ratio.value[-1],
        ratio_interval=judged.ratio.each[-1],
        ratio_linear=None if linear is None else linear[-1],
        **shares,
        **_finding(judged.finding, consistency),
    )


def _sensor(sensor: SensorConsistency) -> SensorEntry:
    accepted, rejected = sensor.updates
    white = sensor.whiteness
    return SensorEntry(
        size=sensor.size,
        accepted=accepted,
        rejected=rejected,
        nis_mean=sensor.nis_whole,
        nis_interval=sensor.interval_whole,
        nis_bounds=sensor.bounds_whole,
        nis_beyond=sensor.beyond,
        correlation=white.correlation,
        correlation_interval=white.interval,
        correlation_bound=white.bound,
        correlation_beyond=white.beyond,
        verdict=sensor.finding.verdict.value,
        factor=sensor.finding.factor,
        factor_interval=sensor.finding.interval,
        samples_needed=sensor.finding.samples_needed,
        remark=sensor.finding.remark,
    )
