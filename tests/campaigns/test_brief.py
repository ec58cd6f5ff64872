"""The brief: what it says is what the run says, the board's question first, and each mistake is one line."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from mcnav.config.read import read_campaign
from mcnav.report.columns.requirements import requirement_rows
from mcnav.report.figures.brief import limit_to_causes
from mcnav.report.format import number, rounded
from mcnav.store.run_folder import RunFolder
from mcnav.studies.linear_answers import answer_linearly
from mcnav.workflow.analyse import analyse
from tests.commands import invoke
from tests.conftest import ROOT
from tests.runs import simulate

NEGLECTED = ROOT / "campaigns" / "20_flight_with_neglected_errors.toml"
HOVER = """
samples = 200
seed = 3
[scenario]
type = "hover"
duration = "5000 s"
[errors]
gyro_drift = "0.1 deg/h"
misalignment = "0.5 mrad"
[[accept.quantile]]
output = "range"
probability = 0.95
below = "8 km"
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("brief")
    (place / "hover.toml").write_text(HOVER, encoding="utf-8")
    simulate(read_campaign(place / "hover.toml"), place / "run", None, 1)
    return place


def test_the_question_of_the_board_first_on_one_slide_and_one_sheet(place: Path) -> None:
    """Requirement, margin and confidence; each PDF file is of one page, and has the same bytes again."""
    done = invoke("brief", "run", cwd=place)
    assert done.returncode == 0, done.stderr
    text = re.sub(r"\s+", " ", re.sub("<[^>]+>", " ", (place / "run_brief" / "brief.html").read_text("utf-8")))
    summary = RunFolder(place / "run").summary()
    (requirement,) = summary["requirements"]
    assert requirement["finding"] == "not met"
    margin, low = 8e3 / requirement["estimate"], requirement["interval"][0] / 1e3
    first = text.index("Requirements: 0 of 1 met, 1 not met.")
    margins = text.index(f"Errors may be × {rounded(margin)}; with 95 % confidence at least {number(low, 3)} km.")
    assert first < margins < text.index("Linear", margins)
    assert "mcnav replay run" in text
    sizes = {"slide.pdf": (960, 540), "brief.pdf": (595, 841)}  # points: 16:9, and A4
    invoke("brief", "run", "--out", "again", cwd=place)
    for name, size in sizes.items():
        content = (place / "run_brief" / name).read_bytes()
        (box,) = re.findall(rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", content)
        assert tuple(int(float(side)) for side in box) == pytest.approx(size, abs=1)
        assert content == (place / "again" / name).read_bytes()


def test_the_waterfall_goes_from_all_causes_to_nothing(place: Path) -> None:
    """Mean squares of the two sources are P² s² by the run's own partial derivatives."""
    content = analyse(RunFolder(place / "run"))
    (row,) = requirement_rows(content.summary, "shown", content.time_unit)
    figure = limit_to_causes(row)
    assert figure is not None
    output = content.summary.names.index("range")
    squares = np.diag(content.model.covariance) * content.model.partials[output] ** 2
    expected = dict(zip(content.source_names, 100.0 * squares / squares.sum(), strict=True))
    drawn = dict(zip(figure.columns["cause"], figure.columns["share, %"], strict=True))
    assert sum(drawn.values()) == pytest.approx(100.0, abs=1e-7)
    for name in drawn.keys() & expected.keys():
        assert drawn[name] == pytest.approx(expected[name], rel=1e-9)
    share = 100.0 * (row.entry.limits[0] / (row.entry.interval[1] or np.nan)) ** 2  # not the linear value
    assert f"the limit allows {share:.3g} %" in figure.shows


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["nowhere"], "there is no such folder"),
        (["hover.toml"], "it is a file"),
        (["run", "--campaign", "nowhere.toml"], "nowhere.toml"),
        (["run", "--campaign", str(NEGLECTED)], "is not the campaign that was flown"),
        (["run", "--out", "sheet.pdf"], "expected a folder"),
    ],
)
def test_mistakes_are_one_line(arguments: list[str], told: str, place: Path) -> None:
    done = invoke("brief", *arguments, cwd=place)
    assert done.returncode != 0
    assert done.stderr.count("\n") == 1
    assert told in done.stderr


def test_a_run_and_linear_covariance_name_the_same_causes(place: Path) -> None:
    """Sources are correlated: half of a cross-term is either's, so that shares add up to one in both."""
    correlated = HOVER + '[[correlations]]\nbetween = ["gyro_drift", "misalignment"]\ncoefficient = -0.5\n'
    (place / "correlated.toml").write_text(correlated, encoding="utf-8")
    campaign = read_campaign(place / "correlated.toml")
    simulate(campaign, place / "correlated", None, 1)
    (entry,) = analyse(RunFolder(place / "correlated")).summary.requirements
    expected = {cause.name: cause.share for cause in answer_linearly(campaign).requirement_causes(0)}
    assert {cause.name: cause.share for cause in entry.causes} == pytest.approx(expected, rel=1e-9)
    assert sum(expected.values()) == pytest.approx(1.0, abs=2e-3)  # either source is left out below 0.001
