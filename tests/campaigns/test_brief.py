"""The brief: what it says is what the run, linear analysis and allocation say, and each mistake is one line."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from mcnav.analysis.filter_consistency import Honesty
from mcnav.config.read import read_campaign
from mcnav.report.columns.requirements import requirement_rows
from mcnav.report.document.html import page_html
from mcnav.report.document.table import Table
from mcnav.report.figures.brief import limit_to_causes
from mcnav.report.pages.brief import Links, page
from mcnav.report.pages.run.page import figures
from mcnav.report.pages.run.sections.improvements import failing_in_run, improvements_section
from mcnav.report.pages.run.tiles import tiles, worst_departure
from mcnav.report.pages.run.worst_case import worst_case
from mcnav.report.results.model import RunAnalysis
from mcnav.report.statements.verdicts import statements
from mcnav.store.run_folder import RunFolder
from mcnav.studies.brief import advise
from mcnav.studies.lincov import answer_linearly
from mcnav.workflow.analyse import analyse
from mcnav.workflow.what_if import what_if_of_run
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
    share = 100.0 * (row.entry.limits[0] / (row.entry.interval[1] or np.nan)) ** 2  # not the linear value
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


@pytest.fixture(scope="module")
def neglected(tmp_path_factory: pytest.TempPathFactory) -> RunAnalysis:
    """Return a run of a filter that is optimistic in tilt because it does not model misalignments."""
    folder = tmp_path_factory.mktemp("neglected") / "run"
    simulate(read_campaign(NEGLECTED, {"samples": 40}), folder, None, 1)
    return analyse(RunFolder(folder))


def test_the_worst_case_is_drawn_of_what_the_first_tile_names(neglected: RunAnalysis) -> None:
    """Not the first panel of the figure, position, but that of the tilt; and its words are on the tilt as well."""
    summary = neglected.summary
    first = tiles(summary, statements(summary), (), neglected.time_unit)[0]
    assert (first.subject, first.status) == ("Filter", "optimistic")
    drawn = figures(neglected)
    shown = worst_case(neglected, drawn, first)
    assert shown is not None
    (panel,) = shown.panels
    worst = worst_departure(summary.filter)  # type: ignore[arg-type]
    assert worst is not None
    assert worst.name in panel.about
    assert panel.title != drawn["sigma_history"].panels[0].title
    assert worst.name.replace("_", " ") in shown.shows


def test_the_best_remedy_stands_first(neglected: RunAnalysis) -> None:
    """A consistent filter before all others, with the entry of the campaign file that makes it."""
    advice = advise(NEGLECTED)
    best = advice.remedies[0]
    assert best.verdict.verdict == Honesty.CONSISTENT
    assert {"gyro_misalignment", "accelerometer_misalignment"} < set(best.entries["estimates"])
    assert not {"gyro_g_sensitivity", "gnss_lever_arm"} & set(best.entries["estimates"])  # of which there are none
    written = page(neglected, advice, Links("run", ""))
    text = page_html(written).partition("What would help")[2]
    assert text.index("gyro_misalignment&#34;") < text.index("considers gyro_misalignment")


def test_the_cause_of_a_failing_filter_comes_before_numbers(neglected: RunAnalysis) -> None:
    """Misalignments of the gyros make up most of what the filter misses; GNSS noise makes up nothing of it."""
    what_if = what_if_of_run(neglected)
    section = improvements_section(what_if, neglected.manifest.model.outputs, failing_in_run(neglected))
    assert section is not None
    causes, numbers = (part for part in section.parts if isinstance(part, Table))
    kind, share = causes.rows[0]
    neglect = [cause for cause in neglected.summary.filter.neglected if cause.name.startswith(kind)]  # type: ignore[union-attr]
    assert kind == "gyro_misalignment"
    assert share == pytest.approx(sum(cause.share for cause in neglect))
    assert share > 0.5
    assert "gyro_misalignment" in str(causes.columns[2].content(causes.rows[0]))
    assert numbers.rows[0].improvement.slider.path == "imu.gyro.misalignment"
    assert numbers.rows[0].improvement.factor == 0.5  # the catalogue has no finer grade
