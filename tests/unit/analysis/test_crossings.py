"""Values at which a limit is just met: roots of known functions, several of them, and keys of whole numbers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mcnav.analysis.crossings import TOLERANCE, find_crossings
from mcnav.analysis.sweep import JustMet, Variable
from mcnav.errors import CampaignError, Problem
from mcnav.statistics.bisection import SPARE, root_between

RANGE = Variable("key", np.linspace(0.0, 10.0, 11), "m", False)
DECADES = Variable("key", np.geomspace(0.01, 100.0, 9), "m", True)


def crossings(variable: Variable, margin: Callable[[float], float]) -> JustMet:
    return find_crossings(variable, np.array([margin(value) for value in variable.values]), margin, 0)


def test_one_crossing_between_points() -> None:
    found = crossings(RANGE, lambda value: value**2 - 20.0)
    assert found.values == pytest.approx((np.sqrt(20.0),), abs=10.0 * TOLERANCE)
    assert found.met == ((None, found.values[0]),)
    assert not found.throughout


def test_on_a_logarithmic_axis_to_a_share_of_the_value() -> None:
    found = crossings(DECADES, lambda value: float(np.log(value / 0.37)))
    assert found.values == pytest.approx((0.37,), rel=TOLERANCE)


def test_several_crossings_and_intervals() -> None:
    found = crossings(RANGE, lambda value: -(value - 2.5) * (value - 5.5) * (value - 8.5))
    assert found.values == pytest.approx((2.5, 5.5, 8.5), abs=10.0 * TOLERANCE)
    assert found.met == ((found.values[0], found.values[1]), (found.values[2], None))


def test_met_throughout_or_nowhere() -> None:
    everywhere, nowhere = (crossings(RANGE, lambda _, sign=sign: sign) for sign in (-1.0, 1.0))
    assert everywhere.throughout
    assert everywhere.values == nowhere.values == nowhere.met == ()


def test_a_point_on_the_limit_meets_it() -> None:
    found = crossings(RANGE, lambda value: value - 5.0)
    assert found.values == pytest.approx((5.0,), abs=10.0 * TOLERANCE)


def test_points_without_an_answer_are_skipped() -> None:
    margins = np.array([-1.0, np.nan, 1.0])
    variable = Variable("key", np.array([0.0, 1.0, 2.0]), "", False)
    found = find_crossings(variable, margins, lambda value: value - 0.75, 0)
    assert found.values == pytest.approx((0.75,), abs=2.0 * TOLERANCE)
    assert find_crossings(variable, np.full(3, np.nan), lambda _: 1.0, 0).met == ()


def test_a_key_of_whole_numbers_has_the_last_one_that_meets_the_limit() -> None:
    def margin(value: float) -> float:
        raise CampaignError([Problem("", "key", f"got {value}; expected a whole number")])

    rising = find_crossings(RANGE, RANGE.values - 3.5, margin, 0)
    assert rising.values == (3.0,)
    falling = find_crossings(RANGE, 3.5 - RANGE.values, margin, 0)
    assert falling.values == (4.0,)
    assert falling.met == ((4.0, None),)


def dip(value: float) -> float:
    """Return a margin that is below zero within a factor of 1.5 of 0.7 alone: a parabola of the logarithm."""
    return float(np.log(value / 0.7) ** 2 - np.log(1.5) ** 2)


@pytest.mark.parametrize("points", [2, 3, 4, 10, 40])
def test_what_is_between_the_points_of_a_grid_does_not_depend_on_the_grid(points: int) -> None:
    """The limit is met in part of the range, however few points are asked for."""
    found = crossings(Variable("key", np.geomspace(0.01, 100.0, points), "m", True), dip)
    assert found.values == pytest.approx((0.7 / 1.5, 0.7 * 1.5), rel=2.0 * TOLERANCE)
    assert found.met == ((found.values[0], found.values[1]),)
    assert found.whole


@pytest.mark.parametrize("depth", [0.02, -0.02])
def test_a_curve_that_nearly_touches_its_limit(depth: float) -> None:
    """On a linear axis, of 3 points, with its minimum apart from every sixteenth of the range."""
    found = crossings(Variable("key", np.linspace(0.0, 10.0, 3), "m", False), lambda x: (x - 6.27) ** 2 + depth)
    assert len(found.values) == (0 if depth > 0.0 else 2)
    assert found.closest is not None
    if depth > 0.0:  # closest to the minimum to the bend that is not followed up, 0.1 % of the limit
        assert found.closest[1] == pytest.approx(depth, abs=0.02)
    assert found.looked_at > 3


def test_values_that_cannot_be_computed_are_admitted() -> None:
    def margin(value: float) -> float:
        raise CampaignError([Problem("", "key", "expected a whole number")])

    found = find_crossings(Variable("key", np.array([1.0, 4.0, 7.0]), "", False), np.ones(3), margin, 0)
    assert not found.whole
    assert found.looked_at == 3
    assert found.met == ()


HALVINGS = int(np.ceil(np.log2(1e9)))


@pytest.mark.parametrize(
    ("function", "most"),
    [
        (lambda x: x**9 - 1e-3, HALVINGS + SPARE),
        (lambda x: np.tanh(50.0 * (x - 0.9)), HALVINGS + SPARE),
        (lambda x: -1.0 if x < 0.123 else 5.0, HALVINGS + SPARE),
        (lambda x: -1e-300 if x < 0.123 else 1e300, HALVINGS + SPARE),
        (lambda x: x - 0.5, HALVINGS + SPARE),
        (lambda x: x**3 - 0.3, HALVINGS // 2),
    ],
)
def test_the_bracket_of_a_root_holds_it_and_takes_few_steps(function: Callable[[float], float], most: int) -> None:
    """No function takes more evaluations than halving and a spare one; a smooth one takes far fewer."""
    calls = 0

    def counted(x: float) -> float:
        nonlocal calls
        calls += 1
        return float(function(x))

    low, high = root_between(counted, (0.0, counted(0.0)), (1.0, counted(1.0)), 1e-9)
    assert high - low <= 1e-9
    assert (function(low) <= 0.0) != (function(high) <= 0.0)
    assert calls <= 2 + most
