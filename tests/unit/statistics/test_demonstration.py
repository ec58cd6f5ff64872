"""Runs that show a probability by counting."""

import pytest
from scipy import stats

from mcnav.statistics.demonstration import runs_to_show


@pytest.mark.parametrize(("probability", "confidence", "runs"), [
    (0.95, 0.95, [59, 93, 124]), (0.9973, 0.90, [852, 1440, 1970]), (0.9999, 0.95, [29956, 47437, 62956]),
])  # fmt: skip
def test_numbers_that_boards_ask_for(probability, confidence, runs):
    assert [runs_to_show(probability, confidence, failures) for failures in range(3)] == runs


@pytest.mark.parametrize("failures", [0, 1, 5])
def test_they_are_the_smallest(failures):
    runs = runs_to_show(0.99, 0.9, failures)
    assert stats.binom.cdf(failures, runs, 0.01) <= 0.1 < stats.binom.cdf(failures, runs - 1, 0.01)


def test_none_beyond_a_billion_and_no_impossible_probability():
    assert runs_to_show(1.0 - 1e-12, 0.95) is None
    with pytest.raises(ValueError, match="between 0 and 1"):
        runs_to_show(1.0, 0.95)
