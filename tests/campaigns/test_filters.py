"""Kinds of filters compared: one table of runs with the same samples, and from which value on each is optimistic."""

from __future__ import annotations

import json
from pathlib import Path
from typing import cast

import numpy as np
import pytest
import tomli_w

from mcnav.analysis.filter_kinds import KindComparison, KindResult
from mcnav.analysis.summary import FilterRatio, Summary
from mcnav.analysis.sweep import Variable
from mcnav.config.read import parse_campaign
from mcnav.report.document.parts import Verdict
from mcnav.report.pages.filter_kinds import terminal
from mcnav.studies.compare_filters import KindPace, _tell_time
from tests.commands import invoke
from tests.filter_kinds import CAMPAIGN

VALUES = (1.0, 3.0, 10.0, 30.0)


class _Found:
    """What a run says of its filter, without the run."""

    def __init__(self, verdict: str) -> None:
        self.verdict, self.factor, self.factor_interval = verdict, 1.5, (1.2, 1.9)
        self.group, self.output = "attitude", ""
        self.groups: dict[str, FilterRatio] = {}
        self.outputs: dict[str, FilterRatio] = {}
        self.filter, self.samples, self.failed = self, 100, 0
        self.mean_error, self.units_shown, self.sigma_paired, self.sigma_linear, self.mean_linear = (), (), (), (), ()
        self.beyond_range = None


def _results(kind: str, verdicts: str) -> list[KindResult]:
    names = {"c": "consistent", "o": "optimistic", "u": "undecided"}
    summaries = [cast(Summary, _Found(names[each])) for each in verdicts]
    return [
        KindResult(kind, value, "", each, 12.0) for value, each in zip((1.0, 3.0, 10.0, 30.0), summaries, strict=True)
    ]


def test_a_kind_is_optimistic_from_the_value_on_from_which_it_always_is() -> None:
    variable = Variable("errors.heading", np.array(VALUES), "deg", True)
    results = (*_results("ekf", "couo"), *_results("iterated", "cooo"), *_results("ukf", "cooc"))
    comparison = KindComparison("Alignment", ("ekf", "iterated", "ukf"), variable, tuple(results))
    assert comparison.optimistic_from == {"ekf": 30.0, "iterated": 3.0, "ukf": None}
    verdict = terminal(comparison)[0]
    assert isinstance(verdict, Verdict)
    assert "ekf: optimistic from 30 deg on" in verdict.headline
    assert "ukf: nowhere certainly optimistic" in verdict.headline


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("filters")
    (folder / "kinds.toml").write_text(tomli_w.dumps(CAMPAIGN), encoding="utf-8")
    return folder


def test_one_command_gives_one_table(folder: Path) -> None:
    """Its runs are those of ``mcnav run``, with their sigmas and NEES."""
    asked = ("filters", "kinds.toml", "--kind", "right-invariant", "--samples", 20)
    finished = invoke(*asked, "--out", "out", cwd=folder)
    assert (finished.returncode, finished.stderr) == (0, "")
    assert "right-invariant is " in finished.stdout
    table = json.loads((folder / "out" / "filters.json").read_text(encoding="utf-8"))
    rows = table["filters"]
    assert [row["kind"] for row in rows] == ["right-invariant"]
    for row in rows:
        summary = json.loads((folder / "out" / row["folder"] / "summary.json").read_text(encoding="utf-8"))
        assert summary["engine"] == "ensemble"
        assert row["nees_navigation"] == summary["filter"]["groups"]["navigation"]["nees_mean"]
        assert row["sigma_heading"] == summary["filter"]["outputs"]["heading"]["sigma_true"]
        assert row["nees_navigation_low"] < row["nees_navigation"] < row["nees_navigation_high"]
        assert row["milliseconds"] > 0.0
    page = (folder / "out" / "filters.html").read_text(encoding="utf-8")
    first, _ = page.split('<details class="fold"', 1)
    assert "right-invariant: " in first  # with its accuracy and cost
    assert " ms a sample" in first


def test_the_time_of_long_comparisons_is_told_beforehand(capsys: pytest.CaptureFixture[str]) -> None:
    """Two workers take 150 samples in chunks of 100 as long as one chunk; comparisons of seconds are not told.

    What the first run takes beside its samples, 5 s of 55, every run takes.
    """
    campaigns = [parse_campaign(CAMPAIGN | {"samples": 150}, "kinds.toml", "kinds")] * 2
    _tell_time(campaigns, [KindPace(9.0, 0.5, 100), KindPace(9.0, 0.25, 100)], 2, 55.0)
    told = "note: 1 more run of 150 samples: about 30 s with --jobs 2, less what is stored already\n"
    assert capsys.readouterr().err == told
    _tell_time(campaigns, [KindPace(9.0, 0.005, 100)] * 2, 2, 1.0)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--kind", "invariant"), "invariant"),
        (("--vary", "errors.heading=1, 2 deg", "--vary", "errors.tilt=1, 2 deg"), "got 2 keys; expected one"),
    ],
)
def test_what_cannot_be_compared_is_told_in_one_line(folder: Path, arguments: tuple[str, ...], message: str) -> None:
    finished = invoke("filters", "kinds.toml", *arguments, cwd=folder)
    assert finished.returncode != 0
    assert message in finished.stderr
    assert "Traceback" not in finished.stderr


def test_a_campaign_without_a_filter_is_refused(folder: Path) -> None:
    (folder / "free.toml").write_text(
        tomli_w.dumps({key: each for key, each in CAMPAIGN.items() if key not in ("aiding", "filter")}),
        encoding="utf-8",
    )
    finished = invoke("filters", "free.toml", cwd=folder)
    assert finished.returncode != 0
    assert "has no filter whose kinds could be compared; expected type = " in finished.stderr
    assert len(finished.stderr.strip().splitlines()) == 1
