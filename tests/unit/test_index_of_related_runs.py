"""The index proposes to compare runs of one scenario alone; and the README counts the examples."""

from __future__ import annotations

import re
from pathlib import Path

from mcnav.cli.next_command import after_index
from mcnav.config.read import parse_campaign
from mcnav.workflow.index import write_index
from tests.conftest import ROOT
from tests.runs import simulate


def hover(drift: str, duration: str) -> dict[str, object]:
    return {
        "samples": 4, "scenario": {"type": "hover", "duration": duration}, "errors": {"gyro_drift": drift},
    }  # fmt: skip


def test_two_runs_of_one_scenario_are_proposed_and_none_of_two(tmp_path: Path) -> None:
    """The latest run is of another duration: the two before it are compared, and without them it is shown."""
    for name, content in (
        ("a", hover("0.1 deg/h", "5000 s")), ("b", hover("0.2 deg/h", "5000 s")), ("c", hover("0.1 deg/h", "900 s")),
    ):  # fmt: skip
        simulate(parse_campaign(content, f"{name}.toml", name), tmp_path / "all" / name, None, 1)
    _, count, foremost = write_index(tmp_path / "all")
    assert count == 3
    assert [run.name for run in foremost] == ["b", "a"]
    (tmp_path / "few").mkdir()
    for name in ("a", "c"):
        (tmp_path / "all" / name).rename(tmp_path / "few" / name)
    _, _, alone = write_index(tmp_path / "few")
    assert [run.name for run in alone] == ["c"]
    assert after_index(alone).startswith("mcnav show") or " show " in after_index(alone)


def test_the_readme_counts_the_examples() -> None:
    text = re.sub(r"\s+", " ", (ROOT / "README.md").read_text(encoding="utf-8"))
    stated = re.search(r"`campaigns/` holds (\d+) examples", text)
    assert stated is not None
    assert int(stated[1]) == len(list((ROOT / "campaigns").glob("*.toml")))
