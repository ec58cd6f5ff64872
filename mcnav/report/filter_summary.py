"""Entries of ``summary.json`` on a filter; over time it is in ``epochs.parquet`` and ``filter.parquet``."""

from __future__ import annotations

from collections.abc import Mapping
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


def filter_entries(found: FilterConsistency) -> dict[str, Any]:
    """Return the entries of a summary on a filter.

    ``covariance_filter`` is the mean of what the samples' filters state at the end, after the last update, and
    ``sigma_filter`` the root of its diagonal. ``nees_filter_mean`` is the mean NEES of the navigation errors at the
    end, whose expected value is ``nees_filter_dimension``; ``nis_mean`` is over the whole flight.
    """
    whole = next((group for group in found.groups if group.name == "navigation"), next(iter(found.groups), None))
    covariance = found.covariance
    return {
        "covariance_filter": covariance,
        "sigma_filter": None if covariance is None else np.sqrt(np.maximum(np.diag(covariance), 0.0)),
        "nees_filter_mean": None if whole is None else float(whole.nees.value[-1]),
        "nees_filter_dimension": None if whole is None else whole.size,
        "nis_mean": {sensor.name: sensor.nis_whole for sensor in found.sensors},
        "filter_verdict": sentence(found),
        "filter": _table(found),
    }


def _table(found: FilterConsistency) -> dict[str, Any]:
    """Return the verdict, and of every table what holds at the end or over the whole flight."""
    return {
        "verdict": found.verdict.value,
        "group": found.group,
        "output": found.output,
        "factor": found.factor,
        "factor_interval": found.interval,
        "time": found.label,
        "begin": found.begin,
        "end": found.end,
        "worst": found.worst,
        "samples": found.samples,
        "tolerance": found.tolerance,
        "confidence": found.confidence,
        "samples_needed": found.samples_needed,
        "neglected": [asdict(each) for each in found.neglected],
        "neglected_at": found.neglected_at,
        "neglected_output": found.neglected_output,
        "remarks": list(found.remarks),
        "verdict_groups": found.on_groups.value,
        "verdict_outputs": found.on_outputs.value,
        "departures": [_departure(each) for each in found.departures],
        "groups": {group.name: _group(group, found) for group in found.groups},
        "outputs": {output.name: _sigma(output, found) for output in found.outputs},
        "states": {state.name: _sigma(state, found) for state in found.states},
        "sensors": {sensor.name: _sensor(sensor) for sensor in found.sensors},
    }


def _departure(each: CertainDeparture) -> dict[str, Any]:
    return {
        "verdict": each.verdict.value,
        "of": "group" if each.size else "output",
        "name": each.name,
        "factor": each.factor,
        "factor_interval": each.interval,
        "begin": each.begin,
        "end": each.end,
        "worst": each.worst,
    }


def _finding(finding: Finding, found: FilterConsistency) -> dict[str, Any]:
    times = {
        key: None if epoch is None else float(found.times[epoch])
        for key, epoch in (("begin", finding.begin), ("end", finding.end), ("worst", finding.worst))
    }
    verdict = {"verdict": finding.verdict.value, "factor": finding.factor, "factor_interval": finding.interval}
    return verdict | times | {"samples_needed": finding.samples_needed, "remark": finding.remark}


def _group(group: GroupConsistency, found: FilterConsistency) -> dict[str, Any]:
    return {
        "size": group.size,
        "nees_mean": group.nees.value[-1],
        "nees_interval": group.nees.each[-1],
        "nees_bounds": group.bounds_each,
        "ratio": group.ratio.value[-1],
        "ratio_interval": group.ratio.each[-1],
        "ratio_linear": None if group.linear is None else group.linear[-1],
        **_finding(group.finding, found),
    }


def _sigma(each: SigmaConsistency, found: FilterConsistency) -> dict[str, Any]:
    linear = each.linear
    shares: Mapping[str, Any] = {}
    if each.within_1 is not None and each.within_3 is not None:
        shares = {
            "within_1": each.within_1.value[-1],
            "within_1_bounds": each.bounds_1,
            "within_3": each.within_3.value[-1],
            "within_3_bounds": each.bounds_3,
        }
    return {
        "unit": each.unit,
        "sigma_true": each.true[-1],
        "sigma_filter": each.filter[-1],
        "ratio": each.ratio.value[-1],
        "ratio_interval": each.ratio.each[-1],
        "ratio_linear": None if linear is None else linear[-1],
        **shares,
        **_finding(each.finding, found),
    }


def _sensor(sensor: SensorConsistency) -> dict[str, Any]:
    accepted, rejected = sensor.updates
    white = sensor.whiteness
    return {
        "size": sensor.size,
        "accepted": accepted,
        "rejected": rejected,
        "nis_mean": sensor.nis_whole,
        "nis_interval": sensor.interval_whole,
        "nis_bounds": sensor.bounds_whole,
        "nis_beyond": sensor.beyond,
        "correlation": white.correlation,
        "correlation_interval": white.interval,
        "correlation_bound": white.bound,
        "correlation_beyond": white.beyond,
        "verdict": sensor.finding.verdict.value,
        "factor": sensor.finding.factor,
        "factor_interval": sensor.finding.interval,
        "samples_needed": sensor.finding.samples_needed,
        "remark": sensor.finding.remark,
    }
