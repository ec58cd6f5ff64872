"""Fuzzed campaigns of inertial navigation and trajectory files: a share with fixed seeds, and what fuzzing found."""

from __future__ import annotations

import random
from collections import Counter
from pathlib import Path

import pytest

from mcnav.config.read import read_campaign
from mcnav.errors import CampaignError
from tests.faults import grammar
from tests.faults.fuzz_navigation import OWN, flights, fuzz, read, read_trajectory


def share_read(counted: Counter[tuple[str, str]], kind: str) -> float:
    """Share of the files of a kind that are read."""
    return counted[kind, "read"] / sum(count for (each, _), count in counted.items() if each == kind)


def test_campaign_files_of_the_grammar(tmp_path: Path) -> None:
    """All are read or refused in words; most of the valid ones are read, and few of the hostile ones."""
    flights(tmp_path)
    counted, findings = fuzz(120, 5, grammar.campaign_file, lambda each: read(each, tmp_path / "own.toml"), "campaigns")
    assert findings == []
    assert share_read(counted, "valid") > 0.6
    assert share_read(counted, "hostile") < 0.2


def test_trajectory_files_of_the_grammar(tmp_path: Path) -> None:
    made = grammar.trajectory_file
    counted, findings = fuzz(80, 5, made, lambda each: read_trajectory(each, tmp_path), "trajectories")
    assert findings == []
    assert share_read(counted, "valid") > 0.6
    assert share_read(counted, "csv") < 0.2


@pytest.mark.parametrize("number", range(grammar.BOMBS))
def test_large_things_are_refused(number: int, tmp_path: Path) -> None:
    """Nesting of thousands of levels, a key of ten megabytes, a measurement each nanosecond, rows without end."""
    text = grammar.bomb(number, grammar.campaign(random.Random(2)))
    flights(tmp_path)
    assert read(text.encode(), tmp_path / "own.toml") == "refused"


def test_a_name_that_is_too_long_is_told(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(OWN.replace("TRAJECTORY", "m" * 400))
    with pytest.raises(CampaignError, match=r"own\.toml: scenario\.trajectory: got "):
        read_campaign(path)


@pytest.mark.parametrize(("key", "shown"), [("", '""'), (" ", '" "')])
def test_a_key_of_blanks_is_named(key: str, shown: str, tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(f'"{key}" = 1\n' + OWN.replace("TRAJECTORY", "flight.csv"))
    flights(tmp_path)
    with pytest.raises(CampaignError, match=f"own\\.toml: {shown}: unknown key"):
        read_campaign(path)
