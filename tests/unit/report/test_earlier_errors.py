"""Requirements that hold at the end, beside errors before it, and faults that make a filter optimistic."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.analysis.summary import Summary
from mcnav.report.columns.requirements import requirement_rows
from mcnav.report.statements.fields import faults_before, initial
from mcnav.report.statements.requirements import larger_before_the_end, requirement_in_brief
from mcnav.report.statements.words import listed
from tests import summaries

QUANTILE = {"kind": "quantile", "outputs": ["x"], "probability": 0.95, "limits": [10.0], "estimate": 0.9}


def run(requirement: dict[str, object], of: str = "navigation") -> Summary:
    outputs = [{"name": "x", "unit": "m", "of": of}, {"name": "y", "unit": "m", "of": of}]
    entry = summaries.requirement("met", interval=[0.8, 1.0], **requirement)
    return summaries.summary(outputs=outputs, requirements=[entry], sigma_linear=[1.0] * 2)


def over_time(sigma: float, mean: float = 0.0) -> dict[str, np.ndarray]:
    """Errors of x at 0, 25 and 60 min, those at 25 min as told; none of y."""
    middle = {"mean x [m]": mean, "sigma x [m]": sigma, "mean y [m]": 0.0, "sigma y [m]": 0.1}
    ends = {"mean x [m]": 0.0, "sigma x [m]": 0.46, "mean y [m]": 0.0, "sigma y [m]": 0.1}
    columns = {name: np.array([ends[name], middle[name], ends[name]]) for name in middle}
    return {"time [min]": np.array([0.0, 25.0, 60.0]), **columns}


def test_a_limit_that_is_met_at_the_end_may_be_exceeded_before_it() -> None:
    """95 % of normal errors of 6.15 m lie within 12.05 m."""
    (row,) = requirement_rows(run(QUANTILE), "shown", "min")
    known = larger_before_the_end(row, over_time(6.15))
    assert known is not None
    assert known == pytest.approx((25.0, 1.959964 * 6.15), rel=1e-6)
    assert requirement_in_brief(row, over_time(6.15)) == "x, 95 %, at 60 min: 0.900 m, limit 10 m; ≈ 12.1 m at 25 min"


def test_a_mean_is_no_sigma() -> None:
    """A mean of 6 m with a sigma of 0.44 m has 95 % within 6.72 m: 1.96 times its root mean square would be 11.8 m."""
    (row,) = requirement_rows(run(QUANTILE), "shown", "min")
    assert larger_before_the_end(row, over_time(0.44, 6.0)) is None
    assert requirement_in_brief(row, over_time(0.44, 6.0)) == "x, 95 %, at 60 min: 0.900 m, limit 10 m"


def test_a_radius_is_at_least_its_largest_component() -> None:
    (row,) = requirement_rows(run({**QUANTILE, "kind": "r95", "outputs": ["x", "y"]}), "shown", "min")
    known = larger_before_the_end(row, over_time(6.15))
    assert known is not None
    assert known[1] == pytest.approx(1.959964 * 6.15, rel=1e-6)


@pytest.mark.parametrize("held", [{"epochs": [1]}, {"when": "during outages"}, {"about": "nominal"}])
def test_what_holds_at_other_times_is_no_matter_of_the_end(held: dict[str, object]) -> None:
    (row,) = requirement_rows(run({**QUANTILE, **held}), "shown", "min")
    assert larger_before_the_end(row, over_time(6.15)) is None


def test_the_spread_of_a_vehicle_is_no_error_of_its_navigation() -> None:
    (row,) = requirement_rows(run(QUANTILE, "truth"), "shown", "min")
    assert larger_before_the_end(row, over_time(6.15)) is None


def test_shares_above_the_whole_are_said_to_be_correlated() -> None:
    assert listed([("x", 0.649), ("v", 0.303), ("w", 0.148)]).endswith("(above 100 %: correlated)")
    assert listed([("x", 0.6), ("v", 0.404)]) == "x 60 %, v 40.4 %"


FAULT = {
    "sensor": "gnss", "kind": "spike", "component": "position_north", "unit": "m", "shown_in": "m", "begin": 900.0,
    "end": 900.0, "size": 12.0, "measurements": 1, "rejected": 0.5, "rejected_interval": None, "expected": 0.5,
    "alarm": 0.5,
}  # fmt: skip


def with_faults(*faults: dict[str, object], worst: float = 41.0) -> Summary:
    departure = {"of": "output", "name": "x", "verdict": "optimistic", "factor": 13.6, "worst": worst,
                 "factor_interval": None, "begin": worst, "end": worst}  # fmt: skip
    of_filter = {"verdict": "optimistic", "time": "time [min]", "departures": [departure]}
    return summaries.summary(faults=list(faults), filter=of_filter)


def test_the_cause_is_the_last_fault_that_began_before_the_worst_time() -> None:
    """Of a spike at 15 min, a ramp from 40 to 41 min and a later one, the filter is the most optimistic at 41 min."""
    ramp = FAULT | {"kind": "ramp", "component": "position_east", "begin": 2400.0, "end": 2460.0}
    later = ramp | {"begin": 3000.0, "end": 3060.0}
    summary = with_faults(FAULT, ramp, later)
    assert faults_before(summary) == "gnss position east: 12.0 m ramp, 40 to 41 min"
    assert faults_before(with_faults(FAULT, ramp, worst=20.0)) == "gnss position north: 12.0 m spike, 15 min"
    assert faults_before(with_faults(later, worst=20.0)) == ""
    assert faults_before(with_faults()) == ""


def test_an_initial_error_is_called_so() -> None:
    assert initial("altitude", ["altitude", "range"]) == "initial_altitude"
    assert initial("bias", ["altitude", "range"]) == "bias"
