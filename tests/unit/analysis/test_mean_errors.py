"""Mean errors: what of a mean is an error, what is rounding, and what exceeds one sigma."""

from __future__ import annotations

import numpy as np

from mcnav.analysis.mean_errors import departures, large_means, mean_errors, nominal_values, rounding_of_means
from mcnav.contract.quantities import Output, Source
from mcnav.report.statements.means import sentence_on

OUTPUTS = (
    Output("x", "m", "km"), Output("true_x", "m", "km", of="truth"), Output("burn", "m/s", "m/s", of="control"),
    Output("final_time", "s", "s", of="time"),
)  # fmt: skip
MEAN, NOMINAL = np.array([5.0, 7.0, 11.0, 13.0]), np.array([1.0, 2.0, 3.0, 4.0])


def test_a_flight_without_errors_has_navigation_errors_alone() -> None:
    """What it has of other outputs is their nominal value."""
    assert departures(OUTPUTS, MEAN, NOMINAL).tolist() == [5.0, 5.0, 8.0, 9.0]
    np.testing.assert_array_equal(mean_errors(OUTPUTS, MEAN, NOMINAL), [5.0, 5.0, np.nan, np.nan])
    np.testing.assert_array_equal(mean_errors(OUTPUTS, MEAN, None), [5.0, 7.0, np.nan, np.nan])
    origin = np.array([0.0, 100.0, 0.0, 0.0])
    np.testing.assert_array_equal(nominal_values(OUTPUTS, NOMINAL, origin, MEAN), [np.nan, 102.0, 3.0, 4.0])
    np.testing.assert_array_equal(nominal_values(OUTPUTS, 1e-12 * NOMINAL, None, MEAN), [np.nan, 0.0, 0.0, 0.0])


def test_a_mean_that_is_rounding_is_none() -> None:
    """Of an output that nothing acts on, beside another one of a kilometre."""
    outputs, sources = (Output("x", "m", "m"), Output("y", "m", "m")), (Source("a", "rad", "rad", 1e-3),)
    partials, mean, sigma = np.array([[1e6], [0.0]]), np.array([1e3, 1e-7]), np.zeros(2)
    floor = rounding_of_means(outputs, sources, partials, mean, sigma)
    assert [entry.output for entry in large_means(mean, sigma, floor)] == [0]
    mean[1] = 1.0
    assert [entry.output for entry in large_means(mean, sigma, floor)] == [0, 1]
    assert 0.0 < floor[0] < 1e-5
    assert large_means(np.array([1e-6, 0.0]), sigma, floor) == ()


def test_the_interval_decides() -> None:
    """An estimated mean of 1.1 sigma is said where its interval is beyond one sigma, too."""
    mean, sigma, floor = np.array([1.1, np.nan]), np.ones(2), np.zeros(2)
    assert large_means(mean, sigma, floor, np.array([0.9, np.nan])) == ()
    (large,) = large_means(mean, sigma, floor, np.array([1.05, np.nan]))
    assert large.ratio == 1.1


def test_sentences_name_the_largest_in_sigmas_first() -> None:
    named = [("x", "navigation", 1e-3, "km"), ("true_x", "truth", 1e-3, "km")]
    large = large_means(np.array([4e3, -9e3]), np.array([2e3, 3e3]), np.zeros(2))
    assert sentence_on(large, named).startswith(
        "The mean of true x off the nominal is −9.00 km, 3.00 times its sigma of 3.00 km. "
        "The mean of x exceeds its sigma too."
    )
    (alone,) = large_means(np.array([5.0]), np.zeros(1), np.zeros(1))
    assert "its sigma is zero" in sentence_on([alone], named)
    # 1e-8 mrad beside 10 mrad may be rounding: no ratio of twenty digits, and it does not stand before what spreads
    rounded = large_means(np.array([9e3, 10.0]), np.array([3e3, 1e-8]), np.zeros(2))
    assert rounded[0].output == 1
    assert "more than a million times its sigma." in sentence_on(rounded, named)
