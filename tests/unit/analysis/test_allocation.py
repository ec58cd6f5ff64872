"""Multiples at which a requirement is just met: errors that add up, and gains that change with them."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from mcnav.analysis.allocation import MOST, NARROW, PRECISION, critical_multiple, nearest_multiple, worst_of
from mcnav.analysis.linear_answer import LinearRequirement
from mcnav.analysis.requirements import Requirement
from mcnav.config.data_sheet import round_down

CASES: dict[str, tuple[Callable[[float], float], float]] = {
    "tightened": (lambda k: math.sqrt(0.3 + 0.9 * k * k), math.sqrt(0.7 / 0.9)),
    "loosened": (lambda k: math.sqrt(0.3 + 0.1 * k * k), math.sqrt(7.0)),
    "alone": (lambda k: 4.0 * k, 0.25),
    "a Kalman update": (lambda k: 1.5 * k / math.hypot(0.5, k), 0.5 / math.sqrt(1.25)),
    "a slow power": (lambda k: 1.5 * k**0.1, 1.5**-10),
    "a high power": (lambda k: 0.1 + k**6, 0.9 ** (1.0 / 6.0)),
}
"""Size over its limit by the multiple of a number, and the multiple at which it is one."""


@pytest.mark.parametrize("name", CASES)
def test_root(name: str) -> None:
    size, expected = CASES[name]
    found = critical_multiple(lambda k: 1.0 / size(k) if size(k) > 0.0 else math.inf)
    assert size(found) <= 1.0
    assert found == pytest.approx(expected, rel=2.0 * PRECISION)


def test_errors_that_add_up_take_three_answers() -> None:
    """At one, at zero, and at the root of a line."""
    asked = list[float]()

    def margin(multiple: float) -> float:
        asked.append(multiple)
        return 1.0 / math.sqrt(0.3 + 0.9 * multiple**2)

    critical_multiple(margin)
    assert len(asked) == 3


def test_what_others_leave_is_too_much() -> None:
    assert math.isnan(critical_multiple(lambda k: 1.0 / math.sqrt(1.1 + k * k)))


def test_a_number_that_does_not_matter() -> None:
    assert math.isinf(critical_multiple(lambda k: 2.0 - 0.5 * k / MOST))


def test_the_least_multiple_stands_for_none() -> None:
    """A sensor's noise cannot be zero."""
    found = critical_multiple(lambda k: math.nan if k == 0.0 else 0.5 / k, least=1e-3)
    assert found == pytest.approx(0.5, rel=2.0 * PRECISION)


@pytest.mark.parametrize("peak", [9.0, 0.11, 16.0])
def test_a_goal_that_is_met_in_a_narrow_range_of_multiples(peak: float) -> None:
    """``1.01 exp(-log(k / k_0)^2)`` is above one within a tenth of its maximum: neither at zero nor at one."""

    def margin(multiple: float) -> float:
        return 1.01 * math.exp(-(math.log(max(multiple, 1e-3) / peak) ** 2))

    width = math.sqrt(math.log(1.01))
    expected = peak * math.exp(-width if peak > 1.0 else width)
    found, closest = nearest_multiple(margin)
    assert found == closest
    assert margin(found) >= 1.0
    assert found == pytest.approx(expected, rel=2.0 * PRECISION)


def test_where_no_multiple_does_the_closest_is_known() -> None:
    found, closest = nearest_multiple(lambda k: 0.99 * math.exp(-(math.log(max(k, 1e-3) / 30.0) ** 2)))
    assert math.isnan(found)
    assert closest == pytest.approx(30.0, rel=0.02)


@pytest.mark.parametrize(("ends", "expected"), [(3.0, 3.0), (100.0, 100.0), (math.inf, math.inf)])
def test_a_number_may_grow_as_far_as_there_are_answers(ends: float, expected: float) -> None:
    """Where the margin ceases to be known before the goal ceases to be met, larger numbers are not claimed."""
    multiple = critical_multiple(lambda k: 1e6 / k if k < ends else math.nan)
    assert multiple < ends or math.isinf(ends)
    assert multiple == pytest.approx(expected, rel=2.0 * NARROW)


def test_a_requirement_that_cannot_be_judged_is_the_worst() -> None:
    requirement = Requirement("quantile", (0,), (1.0,), 0.9)
    known, unknown = (LinearRequirement(requirement, value, margin) for value, margin in ((0.5, 2.0), (math.nan,) * 2))
    assert worst_of((known, unknown), (0, 1)) is unknown
    assert worst_of((unknown, known), (0, 1)) is unknown


@pytest.mark.parametrize("power", [0.5, 0.8, 1.2, 1.5, 2.0])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_the_largest_number_that_can_be_proposed_takes_few_answers(power: float, share: float) -> None:
    """Errors that grow as a mixture of powers, as they do with a filter: exact to the last of three digits."""
    asked = []

    def size(multiple: float) -> float:
        return 0.6 * (1.0 - share + share * (0.7 * math.pow(multiple, power) + 0.3 * math.pow(multiple, 0.6 * power)))

    def margin(multiple: float) -> float:
        asked.append(multiple)
        return 1.0 / math.sqrt(size(multiple))

    found = critical_multiple(margin, rounded=round_down)
    step = 10.0 ** (math.floor(math.log10(found)) - 2)
    assert found == round_down(found)
    assert size(found) <= 1.0 < size(found + step)
    assert len(asked) <= 5  # regula falsi takes 6 to 11, and one more for the number that is proposed
