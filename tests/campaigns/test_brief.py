"""The brief: what it says is what the run, linear analysis and allocation say, and each mistake is one line."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from mcnav.analysis.filter_consistency import Honesty
from mcnav.config.read import read_campaign
from mcnav.report.figures.brief import limit_to_causes
from mcnav.report.requirements import requirement_rows
from mcnav.store.run_folder import RunFolder
from mcnav.studies.brief import advise
from mcnav.studies.lincov import answer_linearly
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


def test_a_page_and_a_pdf_with_the_same_words_and_bytes(place: Path) -> None:
    done = invoke("brief", "run", cwd=place)
    assert done.returncode == 0, done.stderr
    text = re.sub(r"\s+", " ", re.sub("<[^>]+>", " ", (place / "run_brief" / "brief.html").read_text("utf-8")))
    first = (place / "run_brief" / "brief.pdf").read_bytes()
    assert first.startswith(b"%PDF-")
    summary = RunFolder(place / "run").summary()
    (requirement,) = summary["requirements"]
    assert f"Requirements {requirement['finding']}" in text
    assert "gyro_drift" in text
    assert "mcnav replay run" in text
    invoke("brief", "run", "--out", "again", cwd=place)
    assert (place / "again" / "brief.pdf").read_bytes() == first


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
    share = 100.0 * (row.entry.limits[0] / (row.entry.linear or np.nan)) ** 2
    assert f"the limit allows {share:.3g} %" in figure.shows


def test_remedies_are_linear_answers_of_changed_filters() -> None:
    """A filter that knows of the gyros' misalignments is less optimistic; one that knows all kinds is consistent."""
    advice = advise(NEGLECTED)
    assert advice.now is not None
    now, then = advice.now, {each.words: each for each in advice.remedies}
    assert now.verdict.factor == answer_linearly(read_campaign(NEGLECTED)).filter.factor  # type: ignore[union-attr]
    better = then["estimates gyro_misalignment too"]
    assert better.verdict.factor < now.verdict.factor
    assert better.sigma < now.sigma
    whole = next(each for words, each in then.items() if words.startswith("estimates all"))
    assert whole.verdict.verdict == Honesty.CONSISTENT
    assert whole.verdict.factor == pytest.approx(1.0, abs=1e-6)


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
