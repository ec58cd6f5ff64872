"""Linear covariance of a campaign over time, without any simulation."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from threadpoolctl import threadpool_limits

from mcnav._types import Array
from mcnav.analysis.linear_covariance import LinearCovariance, linear_covariance
from mcnav.config.read import Campaign
from mcnav.errors import CampaignError, Problem
from mcnav.files import to_json, write_texts
from mcnav.scenarios.protocol import HasLinearReadings, ScenarioError
from mcnav.units import UnitError, quantity

FILE: Final = "lincov.json"


def lincov(campaign: Campaign, times: Array | None = None) -> LinearCovariance:
    """Compute the linear covariance of a campaign.

    Parameters
    ----------
    times : ndarray, shape (r,), optional
        In the trajectory's time, s; by default the campaign's epochs.

    Raises
    ------
    CampaignError
        When the scenario has no linear covariance over time, or a time lies outside its navigation.
    """
    scenario = campaign.scenario
    if not isinstance(scenario, HasLinearReadings):
        message = "has a linear covariance at its end alone; mcnav partials shows it"
        raise CampaignError([Problem(campaign.file, "scenario.type", message)])
    wanted = None if times is None else np.unique(times)
    with threadpool_limits(1):
        try:
            readings = scenario.linear_readings(wanted)
        except ScenarioError as wrong:
            raise CampaignError([Problem(campaign.file, f"scenario.{wrong.key}", str(wrong))]) from None
        names = tuple(source.name for source in scenario.sources)
        return linear_covariance(readings, names, campaign.errors.covariance)


def read_times(written: str) -> Array:
    """Read times separated by commas, such as ``600 s, 25 min``; `CampaignError` when one is none."""
    try:
        return np.array([quantity(each.strip(), "s") for each in written.split(",")])
    except UnitError as wrong:
        raise CampaignError([Problem("--at", "", str(wrong))]) from None


def write_lincov(campaign: Campaign, path: Path, times: Array | None = None) -> tuple[LinearCovariance, list[Path]]:
    """Write the linear covariance of a campaign as ``lincov.json``; see `lincov`."""
    found = lincov(campaign, times)
    return found, write_texts(path, {FILE: json.dumps(to_json(lincov_table(campaign, found)), indent=1) + "\n"})


def lincov_table(campaign: Campaign, found: LinearCovariance) -> Mapping[str, Any]:
    """Arrange a linear covariance as ``lincov.json`` has it: SI units, and two rows where an update falls on a time."""
    rows = []
    for number, time in enumerate(found.readings.times):
        own = None if found.sigma_filter is None else found.sigma_filter[number]
        rows.append({
            "time": float(time),
            "update": found.readings.updates[number],
            "sigma": found.sigma[number],
            "sigma_filter": own,
            "variance_by_cause": {name: variance[number] for name, variance in found.variances.items()},
            "variance_by_correlations": found.correlations[number],
        })  # fmt: skip
    return {"campaign": campaign.name, "outputs": [output.name for output in campaign.scenario.outputs], "rows": rows}
