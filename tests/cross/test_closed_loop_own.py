"""Updates, covariances and outputs of the user's own in closed loops, against the filter and against closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mcnav.contract.samples import Batch
from mcnav.studies.linear_covariance import linear_covariance
from tests.cross.test_closed_loop import MATCHED, campaign, covariance, sigmas


def test_an_update_that_is_the_filter() -> None:
    """The Kalman filter written out by the user gives what `Filter` gives, at all epochs and for every sample."""
    own, other = campaign("Remembering"), campaign("DoubleIntegrator")
    read, expected = own.scenario.linear_over_time(1_000), other.scenario.linear_over_time(1_000)  # type: ignore[attr-defined]
    start, rows = own.errors.covariance, slice(0, 7)
    np.testing.assert_array_equal(read.times, expected.times)
    np.testing.assert_allclose(
        read.covariance(start)[:, rows, rows], expected.covariance(start)[:, rows, rows], rtol=1e-9, atol=1e-11
    )
    stated = [described.scenario.filter_prediction().covariance[:, :2, :2] for described in (own, other)]  # type: ignore[attr-defined]
    np.testing.assert_allclose(*stated, rtol=1e-10)
    errors = own.errors.draw("random", 5, 20, 0, 20)
    results = [
        each.scenario.engine("vectorised", errors).simulate(Batch(np.arange(20), errors, 5)) for each in (own, other)
    ]
    np.testing.assert_allclose(results[0].values[:, rows], results[1].values[:, rows], atol=1e-11)
    nees = [result.filter_values[:, :, 0] for result in results]  # type: ignore[index]
    np.testing.assert_allclose(*nees, rtol=1e-7, atol=1e-9)


def test_a_stated_covariance_is_judged_after_updates() -> None:
    """It is that of the filter; between updates nothing is stated."""
    verdicts = [linear_covariance(campaign(name)).filter for name in ("Remembering", "DoubleIntegrator")]
    own, other = (verdict for verdict in verdicts if verdict is not None)
    assert (own.verdict, other.verdict) == ("consistent", "consistent")
    np.testing.assert_allclose(own.ratios[:, :2], other.ratios[1::2, :2], rtol=1e-9)
    assert other.times[1::2].tolist() == own.times.tolist()


def test_constant_gains() -> None:
    """The steady state's gains give its dispersions; the covariance that is stated enters the verdict."""
    described = campaign("ConstantGain")
    np.testing.assert_allclose(list(sigmas(described).values())[:7], MATCHED, atol=6e-9)
    scenario: Any = described.scenario
    stated = scenario.filter_prediction().covariance[-1]
    np.testing.assert_allclose(np.sqrt(np.diag(stated)[:2]), MATCHED[:2], atol=6e-9)
    assert np.isnan(stated[2:]).all()
    errors = described.errors.draw("random", 5, 1_000, 0, 1_000)
    result = scenario.engine("vectorised", errors).simulate(Batch(np.arange(1_000), errors, 5))
    nees = result.filter_values[:, -1, scenario.filter_schema.places["nees"]]
    assert nees.mean() == pytest.approx(2.0, abs=3.9 * 2.0 / np.sqrt(1_000.0))


def test_outputs_of_ones_own() -> None:
    """Linear ones have the covariances of what they are made of; what they are of follows from their arguments."""
    described = campaign("ConstantGain")
    names, matrix = covariance(described)
    of = {output.name: (output.unit, output.of) for output in described.scenario.outputs}
    assert of["moved_x"] == of["moved_y"] == ("m", "navigation")
    assert of["fuel"] == ("m/s", "control")
    at = {name: number for number, name in enumerate(names)}
    for name, same in (("moved_x", "position"), ("moved_y", "true_velocity"), ("fuel", "true_velocity")):
        np.testing.assert_allclose(matrix[at[name]], matrix[at[same]], rtol=1e-9, atol=1e-12)
    assert described.scenario.linear().end.nominal[at["fuel"]] == 3.0
    assert [output.of for output in campaign("Remembering").scenario.outputs][-1] == "truth"
    errors = np.zeros((2, len(described.scenario.sources)))
    errors[1, 1] = 1.0  # true_velocity
    values = (
        described.scenario.engine("vectorised", errors).simulate(Batch(np.arange(2), errors, 5), noise=False).values
    )
    assert values[0, at["fuel"]] == 3.0
    assert values[1, at["fuel"]] == pytest.approx(3.0 + values[1, at["true_velocity"]], rel=1e-12)
