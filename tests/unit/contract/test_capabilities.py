"""Scenarios can what they name, and engines have what the contract asks for."""

from __future__ import annotations

from typing import Final

import numpy as np
import pytest

from mcnav.config.read import read_campaign
from mcnav.contract.engine import has_histories
from mcnav.contract.linear import LinearSystem
from mcnav.contract.members import lacks_engine, lacks_scenario
from mcnav.contract.samples import Batch
from mcnav.contract.scenario import Scenario
from mcnav.entries.examples import example
from tests.scalar_filter import ScalarFilter

EXAMPLES: Final = [
    "01_tn_d1772_trajectory_4",
    "11_cruise",
    "12_hover",
    "14_polar",
    "19_flight_with_gnss",
    "24_rendezvous",
    "26_reentry_to_a_landing_site",
]


def scenario(name: str) -> Scenario:
    return ScalarFilter() if name == "scalar" else read_campaign(example(name)).scenario


@pytest.mark.parametrize("name", [*EXAMPLES, "scalar"])
def test_a_scenario_has_what_it_names(name: str) -> None:
    assert lacks_scenario(scenario(name)) == []


@pytest.mark.parametrize("name", ["01_tn_d1772_trajectory_4", "11_cruise", "14_polar", "scalar"])
def test_an_engine_simulates_with_and_without_noise(name: str) -> None:
    """The shapes are those of the contract; without noise, samples without errors have the nominal outcome."""
    of = scenario(name)
    errors = np.zeros((2, len(of.sources)))
    engine = of.engine(of.engines[0], errors)
    assert lacks_engine(engine) == []
    batch = Batch(np.arange(2), errors, 1)
    for noise in (True, False):
        assert engine.simulate(batch, noise).values.shape == (2, len(of.outputs))
    quiet = engine.simulate(batch, noise=False).values
    np.testing.assert_allclose(quiet[0], of.linear().end.nominal, atol=1e-6)
    if has_histories(engine):
        assert engine.epochs is not None
        assert engine.histories(errors).shape == (2, len(engine.epochs.times), len(of.outputs))


def test_a_linear_system_of_one_end() -> None:
    system = LinearSystem.at_end(np.eye(2), np.ones(2), {"noise": np.eye(2)})
    np.testing.assert_array_equal(system.covariance(4.0 * np.eye(2)), 5.0 * np.eye(2)[None])
    np.testing.assert_array_equal(system.end.nominal, np.ones(2))
    assert system.updates == (None,)
