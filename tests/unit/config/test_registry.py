"""A type of scenario is described in one place: what names types, keys, sources and outputs follows from it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest
from jsonschema import Draft7Validator
from pydantic import Field

from mcnav.cli.shell_completion import outputs
from mcnav.config.json_schema.campaign import campaign_schema
from mcnav.config.read import parse_campaign
from mcnav.contract.quantities import Output, Source
from mcnav.entries.context import FileContext
from mcnav.entries.quantities import Length, Speed
from mcnav.errors import CampaignError
from mcnav.systems import registry
from mcnav.systems.description import ScenarioSpec, ScenarioType
from mcnav.systems.steady.scenario import SOURCES
from mcnav.systems.steady.table import HOVER, HoverTable
from mcnav.systems.templates import templates


class BalloonTable(HoverTable):
    """``[scenario]`` of type balloon: a hover by another name."""

    type: Annotated[Literal["balloon"], Field(description="A balloon.")]  # type: ignore[assignment]
    volume: Annotated[Length, Field(description="Volume, as the side of a cube.")]
    wind: Annotated[Speed | None, Field(description="Wind.")] = None


def _read(table: BalloonTable, entries: Mapping[str, Any], context: FileContext) -> ScenarioSpec | None:
    return HOVER.read(table, entries, context)


BALLOON = ScenarioType(BalloonTable, _read, SOURCES, (Output("altitude", "m", "m"), Output("swing", "rad", "mrad")))

CAMPAIGN: dict[str, Any] = {
    "scenario": {"type": "balloon", "volume": "10 m", "duration": "1 h"},
    "errors": {"altitude": "1 m"},
}


@pytest.fixture
def _with_balloons(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(registry.SCENARIO_TYPES, "balloon", BALLOON)


@pytest.mark.usefixtures("_with_balloons")
def test_another_type_is_read_and_described() -> None:
    validator = Draft7Validator(campaign_schema())
    assert [error.message for error in validator.iter_errors(CAMPAIGN)] == []
    assert parse_campaign(CAMPAIGN, "a.toml", "a").scenario.sources
    for wrong in (
        {"errors": {"gyro_bias": "1 deg/h"}},
        {"imu": {}},
        {"scenario": {**CAMPAIGN["scenario"], "volum": "1 m"}},
    ):
        assert not validator.is_valid(CAMPAIGN | wrong), wrong
        with pytest.raises(CampaignError):
            parse_campaign(CAMPAIGN | wrong, "a.toml", "a")


@pytest.mark.usefixtures("_with_balloons")
def test_its_outputs_are_completed(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('[scenario]\ntype = "balloon"\n')

    class Words:
        params: dict[str, Any] = {"campaign": path}  # noqa: RUF012
        args: list[str] = []  # noqa: RUF012

    assert outputs(Words(), "") == ["altitude", "swing"]


def test_templates_are_of_known_types() -> None:
    """Each is found in the folder of its system; those of type ins are written by a command of their own."""
    assert templates().keys() == registry.SCENARIO_TYPES.keys() - {"ins"}


def test_further_tables_are_those_of_all_types() -> None:
    kinds = (*registry.SCENARIO_TYPES.values(), registry.user_type())
    assert {name for kind in kinds for name in kind.tables} == {*registry.FURTHER_NAMES}
    assert registry.is_code("mine.py:Loop")
    assert not any(registry.is_code(name) for name in (*registry.SCENARIO_TYPES, "mine.py", None))


def test_sources_have_units_of_their_own() -> None:
    for kind in registry.SCENARIO_TYPES.values():
        assert all(isinstance(source, Source) for source in kind.sources or ())
        assert kind.outputs
