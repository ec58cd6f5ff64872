"""The documentation is executed: every command, campaign and line of Python in it; the examples are up to date."""

from __future__ import annotations

import json
import math
import os
import re
import shlex
import shutil
import socket
import subprocess
import sys
import textwrap
import tomllib
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

import mcnav
from mcnav.config.read import parse_campaign, read_campaign
from mcnav.config.templates import new_scenario
from mcnav.physics.units import conversion
from mcnav.report.format import number
from mcnav.report.names import humanize
from mcnav.studies.linear_covariance import linear_covariance
from mcnav.workflow.analyse import report_run
from mcnav.workflow.index import write_index
from mcnav.workflow.run import run_campaign
from tests import readme, reference
from tests.commands import invoke
from tests.conftest import ROOT, campaign
from tests.printed import follow
from tests.processes import LONG, run_to_end, running
from tests.runs import simulate
from tests.unit.config.test_trajectory_file import flight, write_csv

PAGES = ROOT / "mcnav" / "docs"
EXAMPLES = ROOT / "reports" / "examples"
EXAMPLE_RUNS = [folder.parent for folder in sorted(EXAMPLES.glob("*/manifest.json"))]


def _blocks(page: str, language: str) -> list[str]:
    text = (PAGES / page).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def _run(command: list[str], place: Path) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"MPLBACKEND": "agg", "COLUMNS": "160"}
    return run_to_end(command, cwd=place, env=environment)


@pytest.fixture
def place(tmp_path: Path) -> Path:
    (tmp_path / "campaigns").symlink_to(ROOT / "campaigns")
    return tmp_path


@pytest.mark.slow
def test_every_command_of_the_guide(place: Path) -> None:
    assert follow((PAGES / "GUIDE.md").read_text(encoding="utf-8"), place).done > 10
    assert (place / "reports" / "comparison.html").read_text().count("<figure") > 1
    index = (place / "reports" / "index.html").read_text()
    assert 'href="mine/report.html"' in index
    assert 'href="comparison.html"' in index


@pytest.mark.slow
def test_every_command_of_the_page_on_scenarios(place: Path) -> None:
    assert follow((PAGES / "SCENARIOS.md").read_text(encoding="utf-8"), place).done == 4


@pytest.mark.slow
def test_every_command_of_the_page_on_clusters(place: Path) -> None:
    """A scheduler and its workers, started as the page says, fly what it says; this machine is all of the machines."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    there = {"head": "127.0.0.1", "8786": str(port), "--nworkers 16": "--nworkers 1", "/shared": str(place)}
    commands = [line for block in _blocks("SCALING.md", "sh") for line in block.splitlines() if line]
    assert len(commands) == 4
    environment = os.environ | {"DASK_TEMPORARY_DIRECTORY": str(place / "scratch")}
    with ExitStack() as stack:
        for command in commands:
            for word, here in there.items():
                command = command.replace(word, here)
            program, *arguments = shlex.split(command)
            if program == "mcnav":
                finished = _run([sys.executable, "-m", program, *arguments], place)
                assert finished.returncode == 0, f"{command}\n{finished.stderr}"
                continue
            with (place / f"{arguments[0]}.log").open("w") as log:
                started = [sys.executable, "-m", program, *arguments]
                process = stack.enter_context(running(started, cwd=place, stdout=log, stderr=log, env=environment))
            stack.callback(process.wait, LONG)
            stack.callback(process.terminate)
    assert (place / "runs" / "first" / "report.html").exists()


def test_every_trajectory_of_its_page(tmp_path: Path) -> None:
    blocks = [tomllib.loads(block) for block in _blocks("TRAJECTORIES.md", "toml")]
    assert len(blocks) == 8
    other = {name: values for name, values in flight().items() if name not in ("lat", "lon", "alt")}
    other |= {"latitude": np.radians(flight()["lat"]), "longitude": np.radians(flight()["lon"])}
    other["height"] = flight()["alt"] / 0.3048
    track = np.column_stack([flight()[name] for name in ("time", "lat", "lon", "alt")])
    lines = [f"2200 {row[0]:.3f} {row[1]:.9f} {row[2]:.9f} {row[3]:.4f} 1 9 0.02 0.02 0.02 0 0 0 0 9" for row in track]
    (tmp_path / "drive.pos").write_text("\n".join(lines), encoding="utf-8")
    for block in blocks:
        write_csv(tmp_path / "flight.csv", other if "columns" in block else flight())
        entries = {"type": "ins", "trajectory": "flight.csv"} | block
        content = {"scenario": entries, "errors": {"position_north": "10 m"}}
        parse_campaign(content, str(tmp_path / "mine.toml"), "mine")


def test_every_command_has_its_row() -> None:
    """The page says what each command of the help writes; the options are in the help alone."""
    told = (PAGES / "COMMANDS.md").read_text(encoding="utf-8")
    listed = invoke("--help", cwd=ROOT, columns=160).stdout
    commands = re.findall(r"^  ([a-z][a-z-]+) {2,}", listed.partition("Start:")[2], re.MULTILINE)
    assert len(commands) > 10
    rows = re.findall(r"^\| (.*?) \|", told, re.MULTILINE)
    for command in commands:
        assert any(f"`mcnav {command}`" in row for row in rows), command


@pytest.mark.parametrize("page", ["CAMPAIGNS.md", "GUIDE.md"])
def test_every_campaign_is_valid(page: str) -> None:
    """Whole campaigns as they are, parts of one in place of those of a campaign of the same type."""
    of_type = {"reentry": "01_tn_d1772_trajectory_4", "cruise": "11_cruise", "ins": "15_flight_navigation_grade"}
    blocks = _blocks(page, "toml")
    assert blocks
    for block in blocks:
        entries = tomllib.loads(block)
        kind = "ins" if "gravity" in entries else "reentry"
        file = of_type[entries.get("scenario", {}).get("type", kind)]
        rest = tomllib.loads((ROOT / "campaigns" / f"{file}.toml").read_text(encoding="utf-8"))
        whole = {"name", "scenario", "errors"} <= entries.keys()
        folder = "mcnav" if "scenario" in entries else "campaigns"  # paths are relative to it
        parse_campaign(entries if whole else rest | entries, str(ROOT / folder / page), "page")


def test_a_new_campaign_begins_as_the_page_on_commands_says(tmp_path: Path) -> None:
    (shown,) = _blocks("COMMANDS.md", "toml")
    assert invoke("new", "campaign", "mine", cwd=tmp_path).returncode == 0
    assert (tmp_path / "mine.toml").read_text(encoding="utf-8").startswith(shown)


@pytest.mark.parametrize("page", ["SCENARIOS.md"])
def test_every_scenario_runs(page: str, tmp_path: Path) -> None:
    """As printed, with the campaign that ``mcnav new`` writes less the settings that the class does not have."""
    shown = _blocks(page, "python")[0]
    _, campaign, _ = new_scenario("my_system", tmp_path)
    (tmp_path / "my_system.py").write_text(shown)
    settings = ("angle",) if "settings" in shown else ("speed", "angle")
    lines = campaign.read_text().splitlines(keepends=True)
    campaign.write_text("".join(line for line in lines if not line.startswith(settings)))
    assert run_campaign(read_campaign(campaign, {"samples": 500}), tmp_path / "run", None, 1).summary["failed"] == 0
    assert all(check.passed for check in mcnav.check_scenario(campaign))


def test_the_scenario_with_noise_and_a_filter_runs(tmp_path: Path) -> None:
    """As printed, and its checks: linear analysis is right about a filter that neglects a bias."""
    _, shown = _blocks("SCENARIOS.md", "python")
    (tmp_path / "attitude.py").write_text(shown)
    campaign = tmp_path / "attitude.toml"
    campaign.write_text(
        'samples = 300\n[scenario]\ntype = "attitude.py:Attitude"\n'
        '[errors]\nangle = "20 arcsec"\ngyro_bias = "0.05 deg/h"\n'
    )
    summary = simulate(read_campaign(campaign), tmp_path / "run", None, 1).summary
    assert (summary["verdict"], summary["unsettled"], summary["failed"]) == ("agrees", None, 0)
    assert summary["filter"]["verdict"] == "optimistic"
    assert summary["filter"]["neglected"][0]["name"] == "gyro_bias"
    assert all(check.passed for check in mcnav.check_scenario(campaign))


@pytest.mark.slow
def test_the_twenty_lines(place: Path) -> None:
    text, further = _blocks("NOTEBOOK.md", "python")
    assert sum(bool(line) for line in text.splitlines()) <= 20
    finished = _run([sys.executable, "-W", "error", "-c", text + further], place)
    assert finished.returncode == 0, finished.stderr
    assert "Every sigma is right. The" in finished.stdout
    assert "no change seen" in finished.stdout
    assert (place / "scatter.png").stat().st_size > 10_000
    written = {place / "scatter.pdf", place / "altitude.svg", place / "reports/first_export/matrices.mat"}
    assert all(path.exists() for path in written)


def test_a_run_in_a_notebook(place: Path) -> None:
    campaign = (ROOT / "campaigns" / "14_polar.toml").read_text().replace("name = ", 'name = "<b>polar</b>" # ')
    (place / "own.toml").write_text(campaign)
    shutil.copy(ROOT / "campaigns" / "polar.py", place)
    run = mcnav.run(place / "own.toml", place / "run", samples=500)
    assert "&lt;b&gt;polar&lt;/b&gt;" in run._repr_html_()
    shown = run._repr_html_()
    assert shown.count("<tr>") == 2 + len(run.outputs)  # headings, and all outputs together
    assert [shown.count(f'<figure id="figure-{name}-') for name in ("budget", "envelopes")] == [1, 0]
    np.testing.assert_allclose(np.sqrt(np.diag(run.covariance("linear"))), run.summary["sigma_linear"])
    for name, drawing in run.drawings.items():
        figure = run.figure(name)
        assert len(figure.axes) == len(drawing.panels)
        assert all(
            axes.get_title(loc="left") == panel.title for axes, panel in zip(figure.axes, drawing.panels, strict=True)
        )
        assert drawing._repr_svg_().count("</svg>") == 1 + len(drawing.panels)
        assert "var(--" not in drawing._repr_svg_()
    for wrong in (lambda: run.figure("none"), lambda: run.covariance("none")):
        with pytest.raises(ValueError, match="one of"):
            wrong()
    assert len(mcnav.open_run(place / "run").samples) == 500


def _numberless(page: str) -> str:
    """A page without its numbers, which differ in the last digit from one processor to another."""
    return re.sub(r"[-−+⁻]?[\d.,⁰¹²³⁴-⁹]+", "#", page)


@pytest.mark.parametrize("folder", EXAMPLE_RUNS, ids=lambda folder: folder.name)
def test_examples_are_up_to_date(folder: Path, tmp_path: Path) -> None:
    """Their reports are what the program now makes of their samples, and their results what it now finds.

    ``make examples`` brings them up to date.
    """
    shutil.copytree(folder, tmp_path / "run")
    report_run(tmp_path / "run")
    again = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    assert _numberless(again) == _numberless((folder / "report.html").read_text(encoding="utf-8"))
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    campaign = read_campaign(ROOT / "campaigns" / f"{folder.name}.toml", {"samples": summary["samples"]})
    with patch("mcnav.report.pages.run.page.render", return_value=""):
        fresh = run_campaign(campaign, tmp_path / "fresh", None, 1).summary
    assert fresh.keys() == summary.keys()
    for key in ("verdict", "verdicts", "verdict_matrix", "seed", "samples", "failed"):
        assert fresh[key] == summary[key]
    for key in ("sigma_linear", "sigma_paired", "nees_mean"):
        np.testing.assert_allclose(fresh[key], summary[key], rtol=1e-5)


def test_there_are_examples_and_an_index_of_them() -> None:
    assert len(EXAMPLE_RUNS) == 3
    index = (EXAMPLES / "index.html").read_text(encoding="utf-8")
    for folder in EXAMPLE_RUNS:
        assert f'href="{folder.name}/report.html"' in index


def test_an_index_names_what_cannot_be_read(tmp_path: Path) -> None:
    shutil.copytree(EXAMPLE_RUNS[0], tmp_path / "good & <b>")
    shutil.copytree(EXAMPLE_RUNS[0], tmp_path / "group" / "damaged")
    (tmp_path / "group" / "damaged" / "summary.json").write_text("{")
    (tmp_path / "group" / "other.html").write_text("")
    written, count, _ = write_index(tmp_path)
    page = written.read_text(encoding="utf-8")
    assert count == 2
    assert 'href="good%20%26%20%3Cb%3E/report.html"' in page
    assert "is damaged" in page
    assert str(tmp_path) not in page
    assert 'href="group/other.html"' in page
    assert written.read_bytes() == write_index(tmp_path)[0].read_bytes()


def test_requirements_in_report_index_summary_and_notebook(tmp_path: Path) -> None:
    """A run that agrees and meets none of its two requirements says so first everywhere; only linear analysis is green.

    Of the range 0.2699 % lie beyond the limit, and 0.27 % may: no number of flights decides that soon.
    """
    asked = {
        "quantile": [
            {"output": "altitude", "probability": 0.9973, "below": "1 km"},
            {"output": "range", "probability": 0.9973, "below": "58.2 km"},
        ]
    }
    done = run_campaign(campaign(1, samples=2_000, accept=asked), tmp_path / "run", "ensemble", 1)
    assert done.summary["verdict"] == "agrees"
    assert done.summary["requirements_met"] == {"met": 0, "met_as_known": 0, "not_met": 1, "undecided": 1, "of": 2}
    yes, no = (
        "Every sigma is right, and so is the full covariance matrix.",
        ("Requirements: 0 of 2 met, 1 not met, 1 undecided."),
    )
    report = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    index = write_index(tmp_path)[0].read_text(encoding="utf-8")
    for page, marks in (
        (report, (f'<div class="verdict differs"><p class="headline">{no}</p>',
                  '<div class="tile agrees" role="group" aria-label="Linear analysis: holds">')),
        (index, (f'<span class="tag differs" title="{no}">0 of 2 met</span>',
                 f'<span class="tag agrees" title="{yes}">linear agrees</span>')),
    ):  # fmt: skip
        first, second = map(page.index, marks)
        assert first < second  # what fails comes first
    assert index.count("tag agrees") == report.count("tile agrees") == 1
    assert yes in report
    results = done.results
    least = min(entry.limits[0] / (entry.estimate or 0.0) for entry in results.requirements)
    farthest = max(results.sigma_ratio_paired, key=lambda ratio: abs(math.log(ratio or 0.0)))
    assert f'<td data-name="margin">{number(least, 4)}<br>' in index
    assert f'<td data-name="linear ratio">{number(farthest, 5)}<br>' in index
    run = mcnav.open_run(tmp_path / "run")
    assert repr(run) == f"test: {no} {yes}"
    shown = run._repr_html_()
    assert 0 < shown.index(no.removeprefix("Requirements: ").removesuffix(".")) < shown.index(yes)
    assert run_campaign(campaign(1), tmp_path / "none", "ensemble", 1).summary["requirements_met"] is None


def test_the_example_of_the_readme_is_what_linear_analysis_says() -> None:
    """Linear sigmas to the digits shown; Monte Carlo within the difference stated, and half a digit."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    linear = linear_covariance(ROOT / readme.CAMPAIGN)
    for output, sigma in zip(linear.outputs, np.sqrt(np.diag(linear.model.outcome_covariance)), strict=True):
        columns = r"\[(\S+)\] +([\d.]+) +([\d.]+) +< ([\d.]+) %  ok"
        row = re.search(rf"^ +{humanize(output.name)} +{columns}$", text, re.MULTILINE)
        assert row
        expected = float(sigma) * conversion(output.unit, row[1])
        half_a_digit = 0.5 * 10.0 ** -len(row[2].partition(".")[2])
        assert float(row[2]) == pytest.approx(expected, abs=half_a_digit)
        assert float(row[3]) == pytest.approx(expected, abs=float(row[4]) / 100.0 * expected + half_a_digit)


def test_the_python_of_the_readme_answers_what_it_says(capsys: pytest.CaptureFixture[str]) -> None:
    """Sigmas agree within 0.1 %, and the worst direction is off by 21 %."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    code = text[text.index("    import mcnav as mc") :]
    names: dict[str, Any] = {}
    exec(textwrap.dedent(code[: code.index("\nThe comparison says")]), names)
    verdict = names["mc"].compare(names["C"], names["outputs"], names["draws"], names["P"])
    assert str(verdict) in capsys.readouterr().out
    assert (verdict.frame["ratio_paired"] - 1.0).abs().max() < 1e-3
    assert f"{100.0 * (verdict.worst_ratio - 1.0):.0f} %" == "21 %"
    assert verdict.sample_covariance.to_numpy() == pytest.approx(names["outputs"].cov().to_numpy(), rel=1e-9)


def test_the_example_of_the_readme_can_be_renewed() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    again = readme.renewed(text, "another")
    assert again.partition(readme.BEGIN)[2].partition(readme.END)[0] == "\nanother\n"
    assert again.partition(readme.END)[2] == text.partition(readme.END)[2]
    with pytest.raises(ValueError, match="lacks its marks"):
        readme.renewed("nothing", "another")


@pytest.mark.parametrize("page", reference.TABLES)
def test_tables_that_restate_the_program_are_what_it_says(page: str) -> None:
    assert (PAGES / page).read_text(encoding="utf-8") == reference.written(page)
