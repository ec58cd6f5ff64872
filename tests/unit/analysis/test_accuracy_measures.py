"""Measures of accuracy: values of closed forms, requirements, and one line for each mistake."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.analysis.accuracy_measures import MeasureError, read_measure, requirement_measures, usual_measures
from mcnav.analysis.requirements import Requirement
from mcnav.contract.linear import CovarianceReadings
from mcnav.contract.quantities import Output
from mcnav.physics.units import conversion
from mcnav.systems.ins.scenario import NAVIGATION_ERRORS

PLANE = (Output("range", "m", "km"), Output("cross_range", "m", "km"), Output("range_rate", "m/s", "m/s"))
ROUND = CovarianceReadings(
    np.array([0.0, 1.0]),
    np.zeros((2, 3)),
    np.stack([np.diag([16.0, 16.0, 1.0]), np.diag([4.0, 4.0, 9.0])]),
    np.stack([np.eye(3), np.eye(3)]),
)
"""Equal sigmas of the first two outputs: 4 m, then 2 m; 1 m as the filter states them."""


def value(written: str, number: int = 1) -> float:
    return read_measure(written, PLANE).at_reading(number).value(ROUND)


def test_values_of_a_round_distribution() -> None:
    """Radii of a circular normal distribution are its sigma times sqrt(-2 ln(1 - p))."""
    assert value("range_rate") == 3.0
    assert value("drms(range, cross_range)") == pytest.approx(2.0 * np.sqrt(2.0))
    assert value("position_horizontal") == value("drms(range, cross_range)")
    assert value("cep(range, cross_range)") == pytest.approx(2.0 * np.sqrt(2.0 * np.log(2.0)), rel=1e-9)
    assert value("r95(position_horizontal)", 0) == pytest.approx(4.0 * np.sqrt(2.0 * np.log(20.0)), rel=1e-9)


def test_the_filter_has_values_of_its_own() -> None:
    measure = read_measure("position_horizontal", PLANE).at_reading(1)
    assert measure.own_value(ROUND) == pytest.approx(np.sqrt(2.0))
    without = CovarianceReadings(ROUND.times, ROUND.mean, ROUND.covariance)
    assert np.isnan(measure.own_value(without))


def test_mean_errors_count_in_root_mean_squares_and_distances() -> None:
    shifted = CovarianceReadings(np.zeros(1), np.array([[3.0, 4.0, 5.0]]), np.diag([16.0, 0.0, 0.0])[None])
    assert read_measure("range", PLANE).at_reading(0).value(shifted) == pytest.approx(5.0)
    assert read_measure("range", PLANE).at_reading(0).mean_error(shifted) == 3.0
    shifted = CovarianceReadings(np.zeros(1), np.array([[3.0, 4.0, 5.0]]), np.zeros((1, 3, 3)))
    assert read_measure("drms(range, cross_range)", PLANE).at_reading(0).value(shifted) == pytest.approx(5.0)


def test_limits_are_quantities() -> None:
    measure = read_measure("drms(range, cross_range) < 2 km", PLANE)
    assert measure.limits == (2000.0,)
    assert measure.bound == 2000.0
    assert measure.name == "drms(range, cross_range) < 2 km"


def test_requirements_are_measures_with_limits_and_epochs() -> None:
    requirements = [
        Requirement("sigma_ratio", (0, 1, 2), (0.05,), None),
        Requirement("quantile", (0,), (6.0,), 0.9973),
        Requirement("r95", (0, 1), (9.0,), 0.95, "during outages", (0, 1)),
        Requirement("box", (0, 1), (4.0, 4.0), 0.9),
        Requirement("box", (0, 1), (4.0, 4.0), 0.9),
    ]
    quantile, radius, box, again = requirement_measures(requirements, PLANE)
    assert [each.requirement for each in (quantile, radius, box, again)] == [1, 2, 3, 4]
    assert quantile.at_reading(1).value(ROUND) == pytest.approx(6.0, rel=1e-4)  # three sigmas of 2 m
    assert radius.at_reading(1).value(ROUND) == pytest.approx(
        4.0 * np.sqrt(2.0 * np.log(20.0)), rel=1e-9
    )  # the largest
    within = 2.0 * 0.9772498680518208 - 1.0  # of a normal variable within two sigmas
    assert box.at_reading(1).value(ROUND) == pytest.approx(within**2, abs=1e-6)  # that of scipy's integral
    assert box.falls
    assert box.bound == 0.9
    assert box.name != again.name


def test_requirements_on_one_output_are_told_apart_by_their_limits() -> None:
    limits = (22.0, 17.6, 17.6)
    requirements = [Requirement("quantile", (0,), (limit,), 0.9973) for limit in limits]
    requirements.append(Requirement("quantile", (0,), (22.0,), 0.9))
    unit = PLANE[0].shown_in
    size = [f"{limit / conversion(unit, PLANE[0].unit):.6g} {unit}" for limit in limits]
    of = "quantile(range, 0.9973) below"
    assert [each.name for each in requirement_measures(requirements, PLANE)] == [
        f"{of} {size[0]}", f"{of} {size[1]}", f"{of} {size[2]} #3", "quantile(range, 0.9)",
    ]  # fmt: skip


def test_measures_without_requirements() -> None:
    names = [each.name for each in usual_measures(NAVIGATION_ERRORS)]
    assert names == ["position_horizontal", "position_down", "velocity_horizontal", "heading"]
    assert [each.name for each in usual_measures(PLANE)] == ["range", "cross_range", "range_rate"]


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ("rang", "unknown output or measure 'rang'; did you mean 'range'?"),
        ("position", "unknown output or measure 'position'"),
        ("cepp(range, cross_range)", "did you mean 'cep'?"),
        ("cep(range)", "cep: got range; expected 2 different outputs"),
        ("cep(range, range)", "expected 2 different outputs"),
        ("sep(range, cross_range)", "expected 3 different outputs"),
        ("drms(range, range_rate)", "have different units"),
        ("drms(range, height)", "drms: unknown output 'height'"),
        ("range < 5 m/s", "range: got '5 m/s', which is a speed; expected a length"),
        ("range < 0 m", "expected a limit above zero"),
        ("range <", "range: got ''"),
    ],
)
def test_mistakes(written: str, message: str) -> None:
    with pytest.raises(MeasureError) as caught:
        read_measure(written, PLANE)
    assert message in str(caught.value)
