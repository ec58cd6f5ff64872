"""Requirements over time: the epochs of each, and one line for each mistake."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcnav.config.read import parse_campaign
from mcnav.config.requirement_times import with_epochs
from mcnav.config.requirements import check_requirements, read_requirements
from mcnav.config.schema import AcceptTable
from mcnav.contract.scenario import Scenario
from mcnav.entries.context import FileContext
from mcnav.entries.examples import examples_folder
from mcnav.entries.validation import validate
from mcnav.store.manifest import RequirementRecord
from mcnav.systems.ins.imu.instruments import Imu
from mcnav.systems.ins.scenario import Ins, Navigation
from mcnav.systems.ins.sensors.aiding import Component, Sensor
from tests.conftest import reentry
from tests.flights import rest

POSITION = ["position_north", "position_east", "position_down"]


def sensor(name: str, *outages: tuple[float, float]) -> Sensor:
    components = (Component("altitude", 0, 1.0, 0.0, 1.0, name),)
    return Sensor(name, "altimeter", np.arange(1.0, 3600.0), components, outages=outages)


def hour(*sensors: Sensor) -> Ins:
    """Navigate for an hour from ten minutes on, with epochs a minute apart."""
    navigation = Navigation(rest(duration=4200.0), "strapdown", 600.0, 4200.0, Imu())
    return Ins(replace(navigation, sensors=sensors))


def accept(kind: str, scenario: Scenario, **entry: Any) -> tuple[list[RequirementRecord], list[str]]:
    context = FileContext("mine.toml", Path())
    of_kind = {"output": "position_north", "probability": 0.95} if kind == "quantile" else {"outputs": POSITION[:2]}
    entries = {kind: [{**of_kind, "below": "10 m", **entry}]}
    table = validate(AcceptTable, entries, context, "accept")
    check_requirements(entries, scenario.outputs, context)
    if table is not None:
        scenario = with_epochs(scenario, table)
    found = [] if table is None else read_requirements(table, scenario, context)
    return found, [str(problem) for problem in context.problems]


@pytest.mark.parametrize(
    ("entry", "words", "epochs"),
    [
        ({"after": "20 min"}, "from 1200 s on", range(10, 61)),
        ({"after": "1201 s"}, "from 1201 s on", range(11, 62)),
        ({"after": "600 s"}, "from 600 s on", range(61)),
        ({"during": ["1200 s", "1500 s"]}, "from 1200 s to 1500 s", range(10, 16)),
        ({"during": ["1199 s", "1501 s"]}, "from 1199 s to 1501 s", range(10, 17)),
        ({"at": "1500 s"}, "at 1500 s", [15]),
        ({"at": "70 min"}, "at 4200 s", [60]),
        ({"at": "1510 s"}, "at 1510 s", [16]),
    ],
)
@pytest.mark.parametrize("kind", ["quantile", "cep", "r95"])
def test_epochs_in_a_span(kind: str, entry: dict[str, Any], words: str, epochs: range) -> None:
    """A begin is included, an end is not, as those of outages."""
    (found,), problems = accept(kind, hour(), **entry)
    assert not problems
    assert (found.when, found.epochs) == (words, tuple(epochs))


def test_epochs_of_outages() -> None:
    """Those of any sensor within the navigation, from a begin to just before an end."""
    outages = (1200.0, 1380.0), (1800.0, 1810.0), (9e3, 1e4)
    scenario = hour(sensor("a", *outages), sensor("b", (1250.0, 1440.0), (0.0, 500.0)))
    (found,), problems = accept("quantile", scenario, during="outages")
    assert not problems
    assert found.when == "during outages"
    assert found.epochs is not None
    times = scenario.navigation.times[list(found.epochs)]
    assert {1200.0, 1250.0, 1260.0, 1320.0, 1380.0, 1800.0} <= set(times.tolist())
    assert not {1140.0, 1440.0, 1500.0, 1740.0, 1860.0} & set(times.tolist())
    assert times[times < 1440.0].max() > 1438.0
    assert 1809.0 < times.max() < 1810.0


def test_epochs_that_are_not_whole_in_binary() -> None:
    """An epoch is found by the time that a person writes for it, whatever its rounding."""
    scenario = Ins(Navigation(rest(), "strapdown", 0.1, 0.1 + 60 * 0.7, Imu()))
    assert scenario.navigation.times[3] != 2.2
    (found,), problems = accept("quantile", scenario, at="2.2 s")
    assert not problems
    assert found.epochs == (3,)


def test_a_requirement_at_the_end_is_recorded_as_before() -> None:
    (found,), _ = accept("quantile", hour())
    assert found.to_json() == {
        "kind": "quantile", "outputs": ["position_north"], "limits": [10.0], "probability": 0.95,
    }  # fmt: skip


def test_a_sphere_has_three_outputs() -> None:
    (found,), problems = accept("sep", hour(), outputs=POSITION, at="4200 s")
    assert not problems
    assert (found.kind, found.outputs, found.limits, found.probability) == ("sep", tuple(POSITION), (10.0,), 0.5)
    assert RequirementRecord.model_validate_json(found.model_dump_json()) == found


@pytest.mark.parametrize(
    ("kind", "entry", "line"),
    [
        ("quantile", {"after": "5000 s"}, "quantile #1.after: got 5000 s; navigation is from 600 s to 4200 s"),
        ("quantile", {"after": "0 s"}, "quantile #1.after: got 0 s; navigation is from 600 s to 4200 s"),
        ("quantile", {"after": "1 km"}, "quantile #1.after: got '1 km', which is a length; expected a time"),
        ("quantile", {"after": "700 s", "at": "900 s"}, "quantile #1: has after and at; expected one of them"),
        ("cep", {"at": "4201 s"}, "cep #1.at: got 4201 s; navigation is from 600 s to 4200 s"),
        ("r95", {"during": ["1500 s", "1200 s"]}, "r95 #1.during: got 1500 s to 1200 s; expected an end after its"),
        ("r95", {"during": ["1500 s", "9000 s"]}, "r95 #1.during: got 9000 s; navigation is from 600 s to 4200 s"),
        ("r95", {"during": ["1200 s", "soon"]}, "r95 #1.during #2: got 'soon'; expected a time"),
        ("r95", {"during": ["1200 s"]}, 'r95 #1.during: expected a begin and an end such as ["1200 s", "1500 s"], or'),
        ("r95", {"during": "landing"}, "r95 #1.during: expected a begin and an end"),
        ("r95", {"during": "outages"}, "r95 #1.during: got 'outages'; no sensor has an outage"),
        ("sep", {"outputs": POSITION[:2]}, "sep #1.outputs: got a list of length 2; expected at least 3 entries"),
        ("sep", {"outputs": [*POSITION[:2], "heading"]}, "sep #1.outputs: position_north and heading have different"),
        ("sep", {"outputs": [*POSITION[:2], POSITION[0]]}, "sep #1.outputs: got 'position_north' twice; expected"),
        ("quantile", {"durin": 3}, "quantile #1.durin: unknown key; did you mean 'during'?"),
    ],
)  # fmt: skip
def test_one_mistake_is_one_line(kind: str, entry: dict[str, Any], line: str) -> None:
    _, (found,) = accept(kind, hour(), **entry)
    assert found.startswith(f"mine.toml: accept.{line}"), found


def test_a_reentry_has_the_times_of_its_requirements_among_its_epochs() -> None:
    scenario = reentry(4)
    (record,), problems = accept("quantile", scenario, output="altitude", at="-123.4 s")
    assert not problems
    further = scenario.with_epochs((-123.4,))
    assert record.epochs == (int(np.flatnonzero(further.reading_times == -123.4)[0]),)
    assert len(further.reading_times) == len(scenario.reading_times) + 1
    epochs = further.engine("ensemble", np.zeros((1, 12))).epochs
    assert epochs is not None
    np.testing.assert_allclose(epochs.times * 60.0, further.reading_times, rtol=1e-15)


def test_a_function_of_the_errors_at_the_end_has_no_requirements_over_time() -> None:
    content = {"scenario": {"type": "polar.py:Target"}, "errors": {"range": "1 m"}}
    target = parse_campaign(content, str(examples_folder() / "mine.toml"), "mine").scenario
    _, (found,) = accept("quantile", target, output="x", after="600 s")
    assert found == (
        "mine.toml: accept.quantile #1.after: the system returns its errors at the end alone; declare epochs to have "
        "them over time"
    )
