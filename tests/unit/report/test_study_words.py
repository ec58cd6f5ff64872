"""Studies answer their questions in a sentence: by what factor errors may grow, and when to start."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mcnav.analysis.linearity import DispersionRange
from mcnav.contract.history import StartClock
from mcnav.contract.quantities import Output
from mcnav.linear.start_times import StartTimeStudy
from mcnav.report.statements.linearity import answer
from mcnav.report.statements.start_times import answer as start_answer

OUTPUTS = (Output("range", "m", "km"), Output("altitude", "m", "km"))


def ranges(agrees: list[float]) -> DispersionRange:
    """Return a range of linearity of two outputs and their joint distribution, tried from 0.1 to 50."""
    steps, until = np.array([0.1, 1.0, 50.0]), np.array(agrees)
    ones = np.ones((3, 3))
    return DispersionRange(steps, ones, ones, ones, until, until, until)


@pytest.mark.parametrize(
    ("agrees", "words"),
    [
        ([2.5, np.inf, 3.0], "may grow by a factor of 2.5: up to it every sigma is shown to be within ±5 % of the "
         "linear one. With larger errors range is the first to fail. The full covariance matrix agrees up to a factor "
         "of 3."),
        ([np.inf, np.inf, np.inf], "may grow by a factor of 50, the largest tried: every sigma is shown to be within "
         "±5 % of the linear one. The full covariance matrix agrees at all multiples tried."),
        ([2.0, 0.5, 0.3], "are too large: only up to 0.5 times them is every sigma shown to be within ±5 % of the "
         "linear one. First beyond: altitude. The full covariance matrix agrees only up to 0.3 times "
         "the stated"),
        ([0.1, np.nan, 0.1], "At no multiple is every sigma shown to be within ±5 % of the linear one: range is not at "
         "the smallest multiple tried, 0.1. The full covariance matrix is not shown to agree even at 0.1 times"),
        ([np.nan, np.inf, np.nan], "may grow by a factor of 50, the largest tried: every"),
        ([np.nan, np.nan, np.nan], "No error source acts on any output"),
    ],
)  # fmt: skip
def test_by_what_factor(agrees: list[float], words: str) -> None:
    assert words in answer(["range", "altitude"], ranges(agrees), 0.05)


def study(weighted: list[float]) -> StartTimeStudy:
    """Return a study of three starts before an event and one after it; the second output is best at the first start."""
    sigma = np.stack([np.array([*weighted, 0.0]), np.array([1.0, 2.0, 3.0, 4.0])], axis=1)
    times, none = 60.0 * np.array([-30.0, -20.0, -10.0, 10.0]), np.zeros((4, 2, 1))
    clock = StartClock("min from reentry", "reentry")
    return StartTimeStudy("start", times, none, none, sigma, np.array([1.0, 0.0]), clock)


def test_when() -> None:
    middle = start_answer(study([4.0, 1.0, 2.0]), {}, OUTPUTS)
    assert middle.startswith("Start at −20.0 min from reentry. Of the starts compared it has the smallest weighted")
    assert "0.25 times that of the earliest start." in middle
    assert middle.endswith("Single outputs have their best starts from −30.0 (altitude) to −20.0 (range).")
    first, last = (start_answer(study(weighted), {}, OUTPUTS) for weighted in ([1.0, 2.0, 3.0], [3.0, 2.0, 1.0]))
    assert first.startswith("Start at the first point, −30.0 min from reentry")
    assert "An earlier start was not compared." in first
    assert "It is the latest compared; starts after reentry do not count." in last


def test_a_start_with_the_smallest_sigma_is_not_the_best_where_its_mean_error_is_large() -> None:
    means = np.array([[1.0, 0.0], [5.0, 0.0], [0.5, 0.0], [0.0, 0.0]])
    ranked = replace(study([4.0, 1.0, 2.0]), means=means)
    assert study([4.0, 1.0, 2.0]).best_weighted == 1
    assert ranked.best_weighted == 2
    assert list(ranked.best) == [2, 0]
    told = start_answer(ranked, {}, OUTPUTS)
    assert told.startswith("At 1 of 3 start times a mean error exceeds its sigma. Worst: the mean error of range for")
    assert "Start at −10.0 min from reentry. Of the starts compared it has the smallest weighted root mean" in told


def test_when_errors_are_beyond_the_range_of_linear_analysis() -> None:
    limited = (Output("range", "m", "km", limit=1.5), Output("altitude", "m", "km"))
    within = start_answer(study([4.0, 1.0, 2.0]), {}, limited)
    assert within == start_answer(study([4.0, 1.0, 2.0]), {}, OUTPUTS)
    at_the_best = start_answer(study([4.0, 1.6, 1.4]), {}, limited)
    assert "range exceeds" not in at_the_best
    best_beyond = replace(study([4.0, 1.4, 2.0]), weights=np.array([0.0, 1.0]))
    assert start_answer(best_beyond, {}, limited).endswith(
        "Errors of that start are beyond the range of linear analysis (range exceeds 0.001500 km): do not rely on it."
    )
    assert start_answer(study([4.0, 1.6, 2.0]), {}, limited) == (
        "At every start errors are beyond the range of linear analysis (range exceeds 0.001500 km): it does not say "
        "when to start."
    )
