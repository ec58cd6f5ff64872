"""Gates and faults of a loop's sensors: linear analysis and samples against closed forms, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from mcnav.analysis.rejections import OnLinear
from mcnav.config.campaign import Campaign
from mcnav.config.read import parse_campaign
from mcnav.contract.samples import Batch
from mcnav.contract.scenario import has_gates
from mcnav.errors import CampaignError
from mcnav.studies.lincov import lincov_table
from mcnav.studies.linear_covariance import linear_covariance
from mcnav.workflow.run import run_campaign
from tests.closed_loops import FILE, tables

FALSE_ALARM = 1e-4
"""With which a count lies beyond its interval."""

SPIKE = {"kind": "spike", "sensor": "fix", "begin": "3 s", "size": "8 m"}


def still(*faults: dict[str, Any], gate: float | None = 0.99, until: float = 1.0, **changes: Any) -> Campaign:
    """Describe a constant of 5 m that is measured each second with 2 m."""
    given = {"filter": {"gate": gate}} if gate is not None else {}
    content = tables("Still", **{**given, **({"faults": list(faults)} if faults else {}), **changes})
    content["scenario"]["until"] = f"{until} s"
    content["samples"] = 4_000
    return parse_campaign(content, str(FILE.with_name("x.toml")), "x")


def test_one_measurement_is_exact_in_linear_analysis_and_in_samples(tmp_path: Path) -> None:
    """Two laws mixed, as of an inertial navigation at rest: one in a hundred keeps its 5 m."""
    campaign = still(accept={"quantile": [{"output": "x", "probability": 0.99, "below": "6 m"}]})
    answer = linear_covariance(campaign)
    rejections = answer.rejections
    assert rejections is not None
    assert (rejections.verdict, rejections.exact) == (OnLinear.FAILS, True)
    beyond = stats.chi2.sf(stats.chi2.ppf(0.99, 1), 3) / 0.01
    square = 0.99 * 100.0 / 29.0 + 0.01 * (25.0 + (beyond - 1.0) * 25.0**2 / 29.0)
    place = [output.name for output in campaign.scenario.outputs].index("x")
    assert rejections.rms_once is not None
    assert rejections.rms_once[place] == pytest.approx(np.sqrt(square), rel=1e-9)  # of differences
    rows: Any = lincov_table(answer)["gates"]["stops"]
    (row,) = (row for row in rows if row["component"] == "fix")
    limit = stats.chi2.ppf(0.99, 1)
    assert stats.ncx2.sf(limit, 1, row["spike"] ** 2 / 29.0) == pytest.approx(0.95, abs=1e-6)
    errors = campaign.errors.draw("random", 1, 200_000, 0, 200_000)
    result = campaign.scenario.engine("vectorised", errors[:8]).simulate(Batch(np.arange(200_000), errors, 1))
    squares = result.values[:, place] ** 2
    quantile = stats.norm.isf(0.5 * FALSE_ALARM)
    assert abs(squares.mean() - square) < quantile * squares.std() / np.sqrt(len(squares))
    summary = run_campaign(campaign, tmp_path, "vectorised", 1, report=False).summary
    rejected = summary["filter"]["sensors"]["fix"]["rejected"]  # of a flight, on average
    low, high = stats.binom.ppf([0.5 * FALSE_ALARM, 1.0 - 0.5 * FALSE_ALARM], campaign.samples, 0.01)
    assert low <= round(rejected * campaign.samples) <= high


def test_a_fault_in_linear_analysis_and_in_samples(tmp_path: Path) -> None:
    """A spike that the filter takes moves the mean by its gain; one that a gate stops is counted by its exact law."""
    taken = still(SPIKE, gate=None, until=3.0)
    assert has_gates(taken.scenario)
    nominal = taken.scenario.linear().end.nominal
    names = [output.name for output in taken.scenario.outputs]
    gain = 1.0 / 4.0 / (1.0 / 25.0 + 3.0 / 4.0)
    assert nominal[names.index("x")] == pytest.approx(8.0 * gain, rel=1e-9)
    nothing = np.zeros((1, len(taken.scenario.sources)))
    flown = taken.scenario.engine("vectorised", nothing).simulate(Batch(np.zeros(1, dtype=np.int64), nothing, 0), False)
    np.testing.assert_allclose(flown.values[0], nominal, rtol=1e-9, atol=1e-12)
    gated = still(SPIKE, until=6.0)
    (law,) = gated.scenario.fault_laws(gated.errors.mean, gated.errors.covariance)  # type: ignore[attr-defined]
    assert (law.first, law.last, law.before) == (3.0, 3.0, 2.0)
    believed = 1.0 / (1.0 / 25.0 + 2.0 / 4.0) + 4.0
    expected = float(stats.ncx2.sf(stats.chi2.ppf(0.99, 1), 1, 64.0 / believed))
    (fault,) = run_campaign(gated, tmp_path, "vectorised", 1, report=False).summary["faults"]
    assert fault["expected"] == pytest.approx(expected, rel=1e-6)
    # of the flights in which the two fixes before were accepted, as if all were: 0.98
    assert 0.2 < expected < 0.95
    low, high = stats.binom.ppf([0.5 * FALSE_ALARM, 1.0 - 0.5 * FALSE_ALARM], gated.samples, expected)
    assert low - 0.02 * gated.samples <= round(fault["rejected"] * gated.samples) <= high + 0.02 * gated.samples
    assert linear_covariance(gated).rejections.doubt == "faults"  # type: ignore[union-attr]


def test_a_gate_that_accepts_all_changes_no_bit() -> None:
    plain, gated = still(gate=None, until=6.0), still(gate=1.0 - 1e-12, until=6.0)
    errors = plain.errors.draw("random", 1, 64, 0, 64)
    values = [
        campaign.scenario.engine("vectorised", errors).simulate(Batch(np.arange(64), errors, 1)).history
        for campaign in (plain, gated)
    ]
    np.testing.assert_array_equal(*values)


@pytest.mark.parametrize(
    ("name", "doubt"), [("DoubleIntegrator", "steered"), ("Nominal", "planned")],
)  # fmt: skip
def test_what_linear_analysis_does_not_know(name: str, doubt: str) -> None:
    content = tables(name, filter={"gate": 0.99})
    answer = linear_covariance(parse_campaign(content, str(FILE.with_name("x.toml")), "x"))
    assert answer.rejections is not None
    assert (answer.rejections.verdict, answer.rejections.doubt) == (OnLinear.REFUSED, doubt)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"faults": [{**SPIKE, "sensor": "gps"}]}, "faults #1.sensor: got 'gps'; no sensor has this name"),
        ({"faults": [{**SPIKE, "begin": "9 s"}]}, "faults #1.begin: got '9 s'; fix has no measurement then"),
        ({"faults": [{**SPIKE, "size": "8 s"}]}, "faults #1.size"),
        ({"faults": [{**SPIKE, "component": "north"}]}, "faults #1.component: got 'north'; fix measures fix"),
        ({"faults": [{"kind": "outage", "sensor": "fix", "begin": "1 s", "end": "2 s"}]}, "faults #1.kind"),
        ({"filter": {"gate": 1.5}}, "filter.gate: got 1.5; expected a probability between 0 and 1"),
    ],
)  # fmt: skip
def test_mistakes_are_one_line(changes: dict[str, Any], told: str) -> None:
    with pytest.raises(CampaignError) as failed:
        still(until=3.0, **changes)
    assert told in str(failed.value)
