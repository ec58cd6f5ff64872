"""What the contract asks of scenarios and engines, and what is said of one that lacks some of it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from mcnav.config.read import parse_campaign
from mcnav.contract.engine import Engine, HistoryEngine
from mcnav.contract.members import PROTOCOLS, lacks, lacks_engine, lacks_scenario, members, ready_engine
from mcnav.contract.samples import SimulationResult
from mcnav.contract.scenario import Capability, Scenario, ScenarioError
from mcnav.errors import CampaignError
from mcnav.systems.registry import SCENARIO_TYPES
from mcnav.systems.user.conformance import check_conformance
from tests.conftest import reentry

ENGINE = {
    "parallel": "threads", "chunk": 4, "accuracy": "", "epochs": None, "noisy": False, "filter": None,
    "simulate": lambda batch, noise=True: SimulationResult(batch.errors @ np.ones((12, 4))),
}  # fmt: skip


class Partial:
    """A reentry of no further capability with an engine of one's own, and without a member."""

    def __init__(self, engine: dict[str, Any], missing: str = "") -> None:
        kept = [name for name in members(cast(type, Scenario)) if name not in (missing, "engine")]
        self.__dict__ = {name: getattr(reentry(4), name) for name in kept}
        if missing != "can":
            self.__dict__["can"] = frozenset()
        if missing != "engine":
            self.__dict__["engine"] = lambda engine_name, probes: SimpleNamespace(**engine)


def scenario(engine: dict[str, Any], missing: str = "") -> Scenario:
    return cast(Scenario, Partial(engine, missing))


def without(member: str) -> dict[str, Any]:
    return {name: value for name, value in ENGINE.items() if name != member}


def failed(of: Scenario) -> list[str]:
    """Return what is told of the checks that fail."""
    return [check.told for check in check_conformance(of, np.ones(12)) if not check.passed]


@pytest.mark.parametrize("member", members(cast(type, Engine)))
def test_a_missing_member_of_an_engine_is_one_line(member: str) -> None:
    of = scenario(without(member))
    (told,) = failed(of)
    assert told.startswith(f"SimpleNamespace lacks {member}: ")
    with pytest.raises(ScenarioError, match=f"its engine 'ensemble' is not complete: SimpleNamespace lacks {member}"):
        ready_engine(of, "ensemble", np.zeros((1, 12)))


@pytest.mark.parametrize("member", members(cast(type, Scenario)))
def test_a_missing_member_of_a_scenario_is_one_line(member: str) -> None:
    (told,) = failed(scenario(ENGINE, member))
    assert told.startswith(f"Partial lacks {member}: ")


def test_every_missing_member_has_a_line() -> None:
    assert len(failed(scenario({}))) == len(members(cast(type, Engine)))


@pytest.mark.parametrize("simulate", [lambda batch: None, lambda batch, with_noise=True: None, lambda: None])
def test_a_method_must_take_what_it_is_called_with(simulate: Any) -> None:
    wrong = ENGINE | {"simulate": simulate}
    assert failed(scenario(wrong)) == ["SimpleNamespace.simulate must have the parameters (batch, noise=…)"]


def test_histories_need_their_sums() -> None:
    (line,) = lacks_engine(cast(Engine, SimpleNamespace(**ENGINE, histories=lambda errors: errors)))
    assert line.startswith("SimpleNamespace lacks history_sums: Power sums over the samples")
    assert members(cast(type, HistoryEngine)).keys() > members(cast(type, Engine)).keys()


@pytest.mark.parametrize("capability", PROTOCOLS)
def test_what_a_scenario_says_that_it_can_it_must_have(capability: Capability) -> None:
    of = scenario(ENGINE)
    of.__dict__["can"] = frozenset({capability})
    lines = lacks(of, PROTOCOLS[capability])
    assert lines
    assert lacks_scenario(of) == lines


def test_an_incomplete_type_of_scenario_is_refused_when_it_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    kind = SCENARIO_TYPES["reentry"]

    def read(*arguments: Any) -> Any:
        described = kind.read(*arguments)
        assert described is not None
        return replace(described, scenario=scenario(ENGINE, "nominal"))

    monkeypatch.setitem(SCENARIO_TYPES, "reentry", replace(kind, read=read))
    content = {"scenario": {"type": "reentry", "trajectory": 4}, "errors": {"altitude": "1 km"}}
    with pytest.raises(CampaignError, match=r"^mine.toml: scenario.type: Partial lacks nominal: Return the truth over"):
        parse_campaign(content, "mine.toml", "mine")


@pytest.mark.parametrize(
    "table",
    [
        {"type": "reentry", "trajectory": 4},
        {"type": "cruise", "speed": "250 m/s", "duration": "1 h"},
        {"type": "hover", "duration": "20 min"},
    ],
    ids=lambda table: str(table["type"]),
)
def test_built_in_scenarios_and_their_reference_engines_are_complete(table: dict[str, Any]) -> None:
    of = parse_campaign({"scenario": table, "errors": {"bias_x": "100 ug"}}, "mine.toml", "mine").scenario
    assert lacks_scenario(of) == []
    assert lacks_engine(of.engine("reference", np.zeros((1, len(of.sources))))) == []
