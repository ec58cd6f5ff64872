"""Folders in which examples of the package run that read runs or the record of a flight."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

CAMPAIGN = {"samples": 200, "scenario": {"type": "reentry", "trajectory": 1},
            "errors": {"altitude": "5 km", "misalignment": "0.2 mrad"}}  # fmt: skip


@pytest.fixture(scope="session")
def folder_of_examples(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run one campaign with two seeds."""
    import mcnav as mc

    folder = tmp_path_factory.mktemp("examples")
    for number, name in enumerate(("first", "second"), start=1):
        mc.run({**CAMPAIGN, "seed": number}, folder / "reports" / name, jobs=1)
    return folder


@pytest.fixture
def folder_of_record(tmp_path: Path) -> Path:
    """Write a campaign, and the record of a flight whose fixes scatter three times as much as it says."""
    from mcnav.config.read import read_campaign
    from mcnav.studies.recordings import write_recording
    from tests.recorded_flights import SHORT

    file = tmp_path / "flight.toml"
    described = re.sub(r"segments = .*", 'segments = [{ hold = "12 s" }]', SHORT)
    file.write_text(described.replace('position = "1 m"', 'position = "3 m"'))
    write_recording(read_campaign(file), 0, 0.02, tmp_path)
    file.write_text(described)
    return tmp_path


@pytest.fixture(autouse=True)
def examples_in_their_folder(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let an example that names files or folders run where they are, or may be written."""
    example = getattr(request.node, "dtest", None)
    if example is None:
        return
    if "reports/first" in example.docstring:
        monkeypatch.chdir(request.getfixturevalue("folder_of_examples"))
    elif '"flight.toml"' in example.docstring:
        monkeypatch.chdir(request.getfixturevalue("folder_of_record"))
    elif any(name in example.docstring for name in ('"reports/', ".csv")):
        monkeypatch.chdir(request.getfixturevalue("tmp_path"))
