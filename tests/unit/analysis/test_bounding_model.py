"""The bounding Gauss-Markov model and its price: a constant behind a drift of 20 to 200 s, by scalar recursions.

A constant of 100 m is measured 600 times, once a second, with white noise of 1 m and Gauss-Markov noise of at most 2 m.
The recursions are of their own: the filter's covariance of (constant, noise), and that of its true errors.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mcnav.analysis.tuning import bounding_model
from mcnav.arrays.types import Array
from mcnav.config.read import campaign_from
from mcnav.contract.members import ready_engine
from mcnav.contract.samples import Batch
from mcnav.studies.linear_answers import answer_linearly

SIGMA, WHITE, START, COUNT = 2.0, 1.0, 100.0, 600
DRIFT = """
name = "A constant behind a drift"
samples = 100
seed = 1
[scenario]
type = "ranging.py:Ranging"
[errors]
constant = "100 m"
[processes]
drift = {{ sigma = "2 m", correlation_time = "200 s" }}
[measurements]
range = "1 m"
[filter.believes.processes.drift]
sigma = "2 m"
correlation_time = "{time} s"
"""

TIMES = np.geomspace(20.0, 200.0, 25)


def claimed_and_ratios(time: float, stationary: float, initial: float) -> tuple[Array, Array]:
    """Return the sigma of the constant that a filter claims, (n,), and true over claimed for all true times, (n, k)."""
    keep, true_keep = np.exp(-1.0 / time), np.exp(-1.0 / TIMES)
    own, true = np.diag([START**2, initial]), np.zeros((len(TIMES), 3, 3))
    true[:, 0, 0], true[:, 2, 2] = START**2, SIGMA**2
    claimed, ratios = [], []
    for number in range(COUNT):
        if number:
            moved = np.diag([1.0, keep])
            own = moved @ own @ moved + np.diag([0.0, stationary * (1.0 - keep**2)])
            moving = np.zeros((len(TIMES), 3, 3))
            moving[:, 0, 0], moving[:, 1, 1], moving[:, 2, 2] = 1.0, keep, true_keep
            true = moving @ true @ moving
            true[:, 2, 2] += SIGMA**2 * (1.0 - true_keep**2)
        gain = own.sum(axis=1) / (own.sum() + WHITE**2)
        own = own - np.outer(gain, own.sum(axis=0))
        closed = np.eye(3)
        closed[:2] += np.outer(gain, [-1.0, -1.0, 1.0])
        true = closed @ true @ closed.T
        true[:, :2, :2] += WHITE**2 * np.outer(gain, gain)
        claimed.append(np.sqrt(own[0, 0]))
        ratios.append(np.sqrt(true[:, 0, 0]) / claimed[-1])
    return np.array(claimed), np.array(ratios)


def test_the_bounding_model() -> None:
    """It claims 2.439 m, and true over claimed is at most 0.778; its three numbers are those of the publication."""
    model = bounding_model(SIGMA, 20.0, 200.0)
    assert (model.sigma**2, model.initial**2, model.correlation_time) == pytest.approx((40.0, 8.0 / 1.1, 200.0))
    claimed, ratios = claimed_and_ratios(model.correlation_time, model.sigma**2, model.initial**2)
    assert claimed[-1] == pytest.approx(2.439, abs=5e-4)
    assert ratios.max() == pytest.approx(0.778, abs=5e-4)


@pytest.mark.parametrize(("time", "optimistic"), [(20.0, 2.642), (110.0, 1.230)])
def test_filters_tuned_in_the_middle_are_optimistic(time: float, optimistic: float) -> None:
    _, ratios = claimed_and_ratios(time, SIGMA**2, SIGMA**2)
    assert ratios.max() == pytest.approx(optimistic, abs=5e-4)


def test_the_upper_ends_bound_the_errors_for_less() -> None:
    """The longest memory with the largest sigma is a ratio of at most one, and claims half of the bounding model."""
    claimed, ratios = claimed_and_ratios(200.0, SIGMA**2, SIGMA**2)
    assert ratios.max() <= 1.0 + 1e-9
    assert claimed[-1] == pytest.approx(1.272, abs=5e-4)


@pytest.mark.parametrize("time", [20.0, 110.0, 200.0])
def test_a_loop_claims_what_its_filter_believes(time: float, tmp_path: Path) -> None:
    """A closed loop whose filter believes another correlation time: sigmas of the recursions, and of own gains.

    A step's error of the fourth order is (1 / 20)^5 / 120, 3e-9.
    """
    code = (Path(__file__).parents[3] / "campaigns" / "ranging.py").read_text(encoding="utf-8")
    (tmp_path / "ranging.py").write_text(
        code.replace("cycle, end = 1.0, 120.0", "cycle, end = 1.0, 600.0"), encoding="utf-8"
    )
    (tmp_path / "drift.toml").write_text(DRIFT.format(time=time))
    campaign = campaign_from(tmp_path / "drift.toml")
    claimed, ratios = claimed_and_ratios(time, SIGMA**2, SIGMA**2)
    answer = answer_linearly(campaign)
    assert answer.filter is not None
    assert answer.sigma[0] == pytest.approx(ratios[-1, -1] * claimed[-1], rel=1e-7)
    assert answer.filter.ratios[-1, 0] == pytest.approx(ratios[-1, -1], rel=1e-7)
    engine = ready_engine(campaign.scenario, campaign.scenario.engines[0], campaign.errors.mean[None])
    drawn = engine.simulate(Batch(np.arange(8), campaign.errors.draw("random", 1, 8, 0, 8), 1))
    assert drawn.linear_values is not None
    np.testing.assert_allclose(drawn.values, drawn.linear_values, atol=1e-6)
