"""The scale that carries a linear answer to what samples bound: closed forms, and what has none."""

from __future__ import annotations

import math
from typing import Any

import pytest
from scipy import special

from mcnav.analysis.simulated_requirements import Basis, least_margin, measured_scale
from mcnav.analysis.summary import RequirementEntry
from tests.summaries import requirement, summary


def entry(finding: str = "met", **keys: Any) -> RequirementEntry:
    (made,) = summary(requirements=[requirement(finding, **keys)]).requirements
    return made


def test_bound_over_linear_value() -> None:
    """Campaign 26 with 8,000 samples: the 99.73 % quantile is at most 10.04 km, and 8.806 km by linear analysis."""
    quantile = {"kind": "quantile", "outputs": ["y"], "limits": [1e4], "probability": 0.9973}
    assert measured_scale(entry(**quantile, linear=8806.0, interval=[9290.0, 10040.0])) == pytest.approx(
        1.1401, abs=1e-4
    )


@pytest.mark.parametrize("true", [0.8, 1.0, 1.3])
def test_box_and_rare_event_of_one_normal_output(true: float) -> None:
    """Errors are ``true`` times the linear ones, by the bound: the scale is that."""
    limit, probability = 2.5, 0.99
    within, bound = (float(special.erf(limit / scale / math.sqrt(2.0))) for scale in (1.0, true))
    box = entry(
        kind="box", outputs=["y"], limits=[limit], probability=probability, linear=within, interval=[bound, 1.0]
    )
    assert measured_scale(box) == pytest.approx(true, rel=1e-9)
    z = float(special.ndtri(0.5 + 0.5 * probability))
    flown = {"estimate": 0.5 * (1.0 - bound), "from": 0.0, "to": 1.0 - bound, "flights": 9, "method": "lines"}
    rare = entry(kind="quantile", outputs=["y"], limits=[limit], probability=probability, linear=z,
                 interval=[0.0, None], exceedance=flown)  # fmt: skip
    assert measured_scale(rare) == pytest.approx(true, rel=1e-9)


@pytest.mark.parametrize(
    "keys",
    [
        {"interval": [0.0, None]},
        {"linear": None},
        {"linear": 0.0},
        {"kind": "sigma_ratio"},
        {"kind": "box", "interval": [0.0, 1.0]},
    ],
)
def test_nothing_is_scaled_by_what_is_not_known(keys: dict[str, Any]) -> None:
    assert math.isnan(measured_scale(entry(**keys)))


def test_the_least_margin_is_the_worst_finding_first() -> None:
    met, close, missed = entry(interval=[0.1, 0.5]), entry(interval=[0.1, 0.99]), entry("not met", interval=[1.1, 1.2])
    assert least_margin([met, close]) is close
    assert least_margin([met, missed, close]) is missed
    basis = Basis.of(summary(requirements=[requirement("met"), requirement("not met", interval=[1.2, 1.5])]))
    assert basis.scales == pytest.approx((1.1, 1.5))
