"""What would help: each remedy is computed and loads, and samples confirm it where linear analysis fails."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from mcnav.analysis.remedies import Remedies, Remedy
from mcnav.config.read import Campaign, parse_campaign, read_campaign
from mcnav.report.pages.run.page import figures
from mcnav.report.pages.run.tiles import tiles, worst_departure
from mcnav.report.pages.run.worst_case import worst_case
from mcnav.report.results.model import RunAnalysis
from mcnav.report.statements.verdicts import statements
from mcnav.store.run_folder import RunFolder
from mcnav.studies.linear_answers import answer_linearly
from mcnav.studies.run_remedies import advise_run, all_remedies
from mcnav.workflow.analyse import analyse
from mcnav.workflow.run import run_campaign
from mcnav.workflow.stored_remedies import stored_remedies
from tests.campaigns.test_advice import BENT, CAMPAIGN, exact_quantile
from tests.closed_loops import campaign as loop
from tests.commands import invoke
from tests.conftest import ROOT

NEGLECTED = ROOT / "campaigns" / "20_flight_with_neglected_errors.toml"
HOVER = """
samples = 300
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


def loaded(remedy: Remedy, beside: Path) -> Campaign:
    """Read the copied file beside the campaign's own."""
    return parse_campaign(tomllib.loads(remedy.campaign), str(beside), "pasted")


@pytest.fixture(scope="module")
def neglected(tmp_path_factory: pytest.TempPathFactory) -> RunAnalysis:
    """Return a run of a filter that is optimistic in tilt because it does not model misalignments."""
    folder = tmp_path_factory.mktemp("neglected") / "run"
    run_campaign(read_campaign(NEGLECTED, {"samples": 40}), folder, None, 1, advise=advise_run)
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


def known(content: RunAnalysis) -> Remedies:
    remedies = stored_remedies(content.folder)
    assert remedies is not None
    return remedies


def test_a_run_says_the_best_filter_first(neglected: RunAnalysis) -> None:
    """One that estimates all unmodelled errors is consistent; the copied file loads and has its verdict and sigma."""
    remedies = known(neglected)
    best = remedies.listed[0]
    assert (best.words, best.then.verdict) == ("estimate all 4 unmodelled errors", "consistent")
    campaign = loaded(best, NEGLECTED)
    added = set(campaign.resolved["filter"]["estimates"]) - set(
        neglected.manifest.identity.campaign["filter"]["estimates"]
    )
    assert added == {
        f"{unit}_{kind}" for unit in ("gyro", "accelerometer") for kind in ("scale_factor", "misalignment")
    }
    answer = answer_linearly(campaign)
    assert answer.history is not None
    minutes = float(remedies.at.removesuffix(" min"))
    reading = int(np.argmin(np.abs(answer.history.readings.times - 60.0 * minutes)))
    place = [output.name for output in answer.outputs].index(remedies.output)
    assert best.then.sigma == pytest.approx(answer.history.sigma[reading, place], rel=1e-12)  # processes together
    assert best.then.sigma < 0.5 * remedies.now.sigma  # 0.061 of 0.139 mrad
    assert remedies.left > 0
    page = (neglected.folder.path / "report.html").read_text(encoding="utf-8")
    assert page.index('data-toml="') < page.index('id="fold-filter"')


def test_unmodelled_numbers_need_no_tuning(neglected: RunAnalysis) -> None:
    """The filter does not know of misalignments, so that its gains are the same: lincov of the copied file agrees."""
    remedies = known(neglected)
    finer = next(remedy for remedy in remedies.listed if remedy.words.startswith("imu.gyro.misalignment"))
    assert finer.held
    answer = answer_linearly(loaded(finer, NEGLECTED))
    assert answer.history is not None
    minutes = float(remedies.at.removesuffix(" min"))
    reading = int(np.argmin(np.abs(answer.history.readings.times - 60.0 * minutes)))
    place = [output.name for output in answer.outputs].index(remedies.output)
    assert finer.then.sigma == pytest.approx(answer.history.sigma[reading, place], rel=1e-9)


@pytest.fixture(scope="module")
def hover(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("hover")
    (folder / "hover.toml").write_text(HOVER, encoding="utf-8")
    (folder / "met.toml").write_text(HOVER.replace("8 km", "80 km"), encoding="utf-8")
    for name in ("hover", "met"):
        run_campaign(read_campaign(folder / f"{name}.toml"), folder / name, None, 1, advise=advise_run)
    return folder


def test_half_of_a_drift_leaves_the_root_of_what_is_left(hover: Path) -> None:
    """Errors of two sources add in squares: the share of the limit follows from the partial derivatives of the run."""
    content = analyse(RunFolder(hover / "hover"))
    remedies = known(content)
    squares = np.diag(content.model.covariance) * content.model.partials[content.summary.names.index("range")] ** 2
    for remedy in remedies.listed:
        place = [source.name for source in content.manifest.model.sources].index(remedy.words.split()[0][7:])
        left = squares.sum() - 0.75 * squares[place]
        assert remedy.then.used / remedies.now.used == pytest.approx(np.sqrt(left / squares.sum()), rel=1e-9)
        assert loaded(remedy, hover / "hover.toml").requirements
    (entry,) = content.summary.requirements
    assert remedies.now.used == pytest.approx(entry.interval[1] / 8e3, rel=1e-9)  # what the samples bound


def test_where_nothing_fails_nothing_is_said(hover: Path) -> None:
    assert stored_remedies(RunFolder(hover / "met")) is None
    page = (hover / "met" / "report.html").read_text(encoding="utf-8")
    assert 'id="remedies"' not in page
    assert 'data-toml="' not in page
    assert all_remedies(analyse(RunFolder(hover / "met")), None) is None


def test_remedies_on_demand(hover: Path) -> None:
    """The command computes all and simulates the best with the draws of the run, which it says."""
    done = invoke("report", "hover", "--remedies", "--jobs", 1, cwd=hover)
    assert done.returncode == 0, done.stderr
    best = known(analyse(RunFolder(hover / "hover"))).listed[0]
    assert best.samples == 500
    assert best.simulated in ("met", "not met", "undecided")
    assert "500 samples" in (hover / "hover" / "report.html").read_text(encoding="utf-8")
    (hover / "hover" / "remedies.json").write_text("{}")
    done = invoke("report", "hover", cwd=hover)
    assert done.returncode != 0
    assert done.stderr.count("\n") == 1
    assert "remedies.json: is damaged" in done.stderr
    assert invoke("report", "hover", "--remedies", "--jobs", 1, cwd=hover).returncode == 0


def test_where_linear_analysis_fails_samples_confirm_or_nothing_is_said(tmp_path: Path) -> None:
    """By ten million draws the limit holds with what is proposed; a run, which simulates none, withholds all."""
    (tmp_path / "bent.py").write_text(BENT, encoding="utf-8")
    (tmp_path / "bent.toml").write_text(CAMPAIGN.format(limit="3 m"), encoding="utf-8")
    campaign = read_campaign(tmp_path / "bent.toml")
    run_campaign(campaign, tmp_path / "run", None, 1, advise=advise_run)
    content = analyse(RunFolder(tmp_path / "run"))
    withheld = known(content)
    assert not withheld.listed
    assert "mcnav report --remedies" in withheld.reason
    assert set(withheld.withheld) == {"errors.x at 0.5 m (now 1 m)", "errors.v at 0.5 m (now 1 m)"}
    kept = all_remedies(content, tmp_path / "bent.toml", 1)
    assert kept is not None
    assert [remedy.words for remedy in kept.listed] == ["errors.x at 0.5 m (now 1 m)"]
    assert kept.listed[0].simulated == "met"
    assert exact_quantile(0.5, 1.0) < 3.0 < exact_quantile(1.0, 0.5)
    unexecuted = all_remedies(content, None, 1)
    assert unexecuted is not None
    assert "--campaign" in unexecuted.reason


LIMIT = {"output": "position", "probability": 0.95, "below": "1 mm"}


def test_a_loop_whose_numbers_are_in_its_class(tmp_path: Path) -> None:
    """Its filter is code; numbers of the file are halved with its gains held."""
    campaign = loop("DoubleIntegrator", samples=200, accept={"quantile": [LIMIT]})
    run_campaign(campaign, tmp_path / "run", None, 1, advise=advise_run)
    remedies = known(analyse(RunFolder(tmp_path / "run")))
    assert remedies.listed
    assert not remedies.left


def test_processes_together_have_the_sigmas_of_each_by_itself() -> None:
    """To 1e-12: sums of some thirty variances in another order differ by rounding."""
    file = ROOT / "campaigns" / "20_flight_with_neglected_errors.toml"
    alone, together = answer_linearly(read_campaign(file)), answer_linearly(read_campaign(file), by_cause=False)
    assert alone.history is not None
    assert together.history is not None
    assert alone.filter is not None
    assert together.filter is not None
    assert np.allclose(together.history.sigma, alone.history.sigma, rtol=1e-12, atol=0.0)
    assert together.filter.verdict == alone.filter.verdict
    assert together.filter.factor == pytest.approx(alone.filter.factor, rel=1e-12)
