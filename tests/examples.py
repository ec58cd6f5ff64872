"""Folder in which examples of the package run that read runs: ``reports/first`` and ``reports/second``."""

from __future__ import annotations

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


@pytest.fixture(autouse=True)
def examples_in_their_folder(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let an example that names files or folders run where they are, or may be written."""
    example = getattr(request.node, "dtest", None)
    if example is None:
        return
    if "reports/first" in example.docstring:
        monkeypatch.chdir(request.getfixturevalue("folder_of_examples"))
    elif any(name in example.docstring for name in ('"reports/', ".csv")):
        monkeypatch.chdir(request.getfixturevalue("tmp_path"))
