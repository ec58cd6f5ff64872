"""Filters of one's own: what a scalar filter with a wrong model says of itself, against its closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import mcnav
from mcnav.config.read import read_campaign
from mcnav.contract.samples import Batch
from mcnav.errors import CampaignError
from tests.runs import simulate

SAMPLES = 2_000
STEPS = 60

BELIEVED, TRUE, NEES, NIS = 0.8827822185, 2.0427120591, 2.313948, 1.372104
"""Steady state of a random walk of variance 1 per step, measured with variance 4, by a filter that believes 0.25: its
variance after the update, the true one, mean NEES and NIS. All are solutions of a scalar Riccati equation."""

CODE = """
import numpy as np
from mcnav import Epochs, Simulated, Innovations, Output, Source

class Mine:
    sources = (Source("a", "m", "m", 1.0),)
    outputs = (Output("b", "m", "m"), Output("c", "m", "m"))
    epochs = Epochs("time [s]", np.arange(61.0))
    groups = {"first": ("b",)}
    believed = {"walk": 0.25}

    def __init__(self):
        self.q, self.r, believed = 1.0, 4.0, 0.25
        prior = 0.5 * (believed + np.sqrt(believed**2 + 4.0 * believed * self.r))
        self.gain, self.variance, self.innovation = prior / (prior + self.r), prior - believed, prior + self.r

    def fly(self, errors, noise):
        error, found, innovations = errors[0], [errors[0]], []
        for walk, measured in noise.standard_normal((60, 2)) * [np.sqrt(self.q), np.sqrt(self.r)]:
            error = error - walk
            innovations.append(measured - error)
            error = error + self.gain * innovations[-1]
            found.append(error)
        second = errors[0] * np.ones(61)
        covariance = np.zeros((61, 2, 2))
        covariance[:, 0, 0], covariance[:, 1, 1] = self.variance, VARIANCE
        position = Innovations(np.arange(1.0, 61.0), innovations, np.full(60, self.innovation))
        return Simulated(np.column_stack([found, second]), covariance, {"position": position})

    def noise_covariance(self):
        shares = {"walk": (1.0 - self.gain) ** 2 * self.q, "measurement": self.gain**2 * self.r}
        found = {name: np.zeros((61, 2, 2)) for name in shares}
        for name, share in shares.items():
            for step in range(60):
                found[name][step + 1, 0, 0] = (1.0 - self.gain) ** 2 * found[name][step, 0, 0] + share
        return found
"""


def _written(folder: Path, variance: str = "1.0", samples: int = 200) -> Path:
    (folder / "mine.py").write_text(CODE.replace("VARIANCE", variance))
    path = folder / "mine.toml"
    path.write_text(f'samples = {samples}\nseed = 3\n[scenario]\ntype = "mine.py:Mine"\n[errors]\na = "1 m"\n')
    return path


def test_the_mismatched_scalar_filter(tmp_path: Path) -> None:
    """Steady after sixty steps, to (1 - gain)^120 = 1e-13. Means within five standard errors of chi-square variates."""
    scenario = read_campaign(_written(tmp_path)).scenario
    assert scenario.parts.filter
    engine = scenario.engine("single", np.zeros((1, 1)))
    schema = engine.filter
    assert schema is not None
    assert schema == scenario.filter_schema
    assert (dict(schema.groups), dict(schema.sensors)) == ({"all": 2, "first": 1}, {"position": 1})
    assert scenario.linear().end.processes["walk"][0, 0] + scenario.linear().end.processes["measurement"][
        0, 0
    ] == pytest.approx(TRUE, abs=1e-10)

    errors = np.random.default_rng(1).standard_normal((SAMPLES, 1))
    found = engine.simulate(Batch(np.arange(SAMPLES), errors, 1))
    assert not found.failures
    assert found.filter_values is not None
    assert found.filter_values.shape == (SAMPLES, STEPS + 1, schema.width)
    last = found.filter_values[:, -1]
    np.testing.assert_allclose(schema.covariance(last)[:, 0, 0], BELIEVED, rtol=1e-10)
    five = 5.0 * np.sqrt(2.0 / SAMPLES)
    assert found.values[:, 0].var() == pytest.approx(TRUE, rel=five)
    assert last[:, schema.places["nees"].start + 1].mean() == pytest.approx(NEES, rel=five)
    nis, accepted, rejected, lag, lags = found.filter_values[..., schema.places["sensor:position"]].transpose(2, 0, 1)
    assert nis[:, -1].mean() == pytest.approx(NIS, rel=five)
    assert (accepted[:, 1:] == 1.0).all()
    assert not rejected.any()
    assert not accepted[:, 0].any()
    assert (lags[:, 2:] == 1.0).all()
    gain, innovation = BELIEVED / 4.0, BELIEVED + 0.25 + 4.0
    following = ((1.0 - gain) * (TRUE + 1.0) - gain * 4.0) / innovation  # of consecutive innovations
    means = lag[:, -20:].mean(axis=1)
    assert means.mean() == pytest.approx(following, abs=5.0 * means.std() / np.sqrt(SAMPLES))
    within = last[:, schema.places["within_1"].start].mean()
    assert within == pytest.approx(0.4890, abs=5.0 * np.sqrt(0.25 / SAMPLES))  # erf(sqrt(0.5 / NEES))


def test_the_prediction_is_the_filter_along_the_truth(tmp_path: Path) -> None:
    scenario = read_campaign(_written(tmp_path)).scenario
    assert scenario.parts.filter
    prediction = scenario.filter_prediction()
    assert prediction is not None
    np.testing.assert_allclose(prediction.covariance[:, 0, 0], BELIEVED, rtol=1e-10)
    assert prediction.label == "time [s]"
    assert prediction.state_variance.shape == (STEPS + 1, 0)


def test_a_campaign_of_it(tmp_path: Path) -> None:
    """Linear covariance is right about the filter that is wrong about itself."""
    summary = simulate(read_campaign(_written(tmp_path)), tmp_path / "run", None, 1).summary
    assert summary["verdict"] == "agrees"
    assert summary["sigma_linear"][0] == pytest.approx(np.sqrt(TRUE), rel=1e-9)
    assert [process["name"] for process in summary["processes"]] == ["walk", "measurement"]
    found = summary["filter"]
    assert (found["verdict"], found["output"]) == ("optimistic", "b")
    assert found["factor"] == pytest.approx(np.sqrt(NEES), rel=5.0 * np.sqrt(0.5 / 200))
    assert found["neglected"][0]["name"] == "walk"


@pytest.mark.parametrize("believed", ['{"nothing": 1.0}', '{"walk": -1.0}', '"walk"', '{"walk": None}'])
def test_beliefs_that_are_wrong_are_told(believed: str, tmp_path: Path) -> None:
    path = _written(tmp_path)
    code = (tmp_path / "mine.py").read_text().replace('{"walk": 0.25}', believed)
    (tmp_path / "mine.py").write_text(code)
    with pytest.raises(CampaignError, match=r"Mine.believed must give a share of variance, from zero on, for names"):
        simulate(read_campaign(path), tmp_path / "run", None, 1)


def test_a_filter_that_loses_definiteness_is_told_in_words(tmp_path: Path) -> None:
    """In the rows of the samples, and before the run where it happens without errors."""
    lost = "np.where(errors[0] > 0.5, -1.0, 1.0)"
    summary = simulate(read_campaign(_written(tmp_path, lost)), tmp_path / "run", None, 1).summary
    (status,) = summary["failures"]
    assert status == "failed: the filter's covariance is not positive definite at time [s] = 0"
    samples = mcnav.samples_of(tmp_path / "run")
    assert ((samples["status"] == status) == (samples["error a [m]"] > 0.5)).all()
    with pytest.raises(CampaignError, match="its flight without any error: the filter's covariance is not positive"):
        simulate(read_campaign(_written(tmp_path, "-1.0")), tmp_path / "other", None, 1)
