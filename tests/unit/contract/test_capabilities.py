"""Scenarios can what they name, and engines have what the contract asks for."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import pytest

from mcnav.config.read import read_campaign
from mcnav.contract import scenario as contract
from mcnav.contract.engine import Engine, has_histories
from mcnav.contract.samples import Batch
from mcnav.contract.scenario import Capability, Scenario
from mcnav.entries.examples import example
from tests.scalar_filter import ScalarFilter

PROTOCOLS: Final[dict[Capability, type]] = {
    Capability.NOISE: contract.NoisyScenario,
    Capability.FILTER: contract.FilterScenario,
    Capability.LINEAR_OVER_TIME: contract.LinearOverTime,
    Capability.LINEAR_AT_ANY_TIME: contract.LinearAtAnyTime,
    Capability.COVARIANCE: contract.CovarianceScenario,
    Capability.START_TIMES: contract.VariableStart,
    Capability.EPOCHS: contract.EpochScenario,
    Capability.UPDATES: contract.ScenarioWithUpdates,
    Capability.REPLAY: contract.Replayable,
    Capability.REMARKS: contract.RemarkingScenario,
    Capability.SMOOTHER: contract.SmoothedScenario,
    Capability.GATES: contract.GatedScenario,
    Capability.RECORDING: contract.RecordingScenario,
    Capability.TRAJECTORY: Scenario,
    Capability.USER_CODE: Scenario,
    Capability.DIFFERENCED: Scenario,
}

EXAMPLES: Final = [
    "01_tn_d1772_trajectory_4",
    "11_cruise",
    "12_hover",
    "14_polar",
    "19_flight_with_gnss",
    "24_rendezvous",
    "26_reentry_to_a_landing_site",
]


def members(protocol: type) -> set[str]:
    """Names that a protocol and those it extends declare."""
    return {name for each in protocol.__mro__[:-1] for name in vars(each) if not name.startswith("_")}


def scenario(name: str) -> Scenario:
    return ScalarFilter() if name == "scalar" else read_campaign(example(name)).scenario


def test_every_capability_has_a_protocol() -> None:
    assert PROTOCOLS.keys() == set(Capability)


@pytest.mark.parametrize("name", [*EXAMPLES, "scalar"])
def test_a_scenario_has_what_it_names(name: str) -> None:
    of: Any = scenario(name)
    for capability in of.can:
        assert [member for member in members(PROTOCOLS[capability]) if not hasattr(of, member)] == [], capability


@pytest.mark.parametrize("name", ["01_tn_d1772_trajectory_4", "11_cruise", "14_polar", "scalar"])
def test_an_engine_simulates_with_and_without_noise(name: str) -> None:
    """The shapes are those of the contract; without noise, samples without errors have the nominal outcome."""
    of = scenario(name)
    errors = np.zeros((2, len(of.sources)))
    engine = of.engine(of.engines[0], errors)
    assert [member for member in members(Engine) if not hasattr(engine, member)] == []
    batch = Batch(np.arange(2), errors, 1)
    for noise in (True, False):
        assert engine.simulate(batch, noise).values.shape == (2, len(of.outputs))
    quiet = engine.simulate(batch, noise=False).values
    np.testing.assert_allclose(quiet[0], of.linear().end.nominal, atol=1e-6)
    if has_histories(engine):
        assert engine.epochs is not None
        assert engine.histories(errors).shape == (2, len(engine.epochs.times), len(of.outputs))


def test_a_linear_system_of_one_end() -> None:
    system = contract.LinearSystem.at_end(np.eye(2), np.ones(2), {"noise": np.eye(2)})
    np.testing.assert_array_equal(system.covariance(4.0 * np.eye(2)), 5.0 * np.eye(2)[None])
    np.testing.assert_array_equal(system.end.nominal, np.ones(2))
    assert system.updates == (None,)
