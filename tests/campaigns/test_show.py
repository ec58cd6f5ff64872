"""`mcnav show`: a finished run from its summary alone."""

from __future__ import annotations

import copy
import csv
import io
import json
import random
import shutil
from pathlib import Path
from typing import Any

import pytest

from mcnav.config.read import parse_campaign
from mcnav.workflow.export import export_run
from mcnav.workflow.run import run_campaign
from tests import scalar_filter
from tests.commands import invoke
from tests.conftest import content
from tests.faults.folders.content import VALUES, places_in, set_at

ESCAPE = "\x1b[31mred"
"""Text that would colour a terminal."""


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A reentry with requirements, correlations and a filter's run; of each only manifest and summary are left."""
    place = tmp_path_factory.mktemp("show")
    accept = {
        "sigma_ratio": "5 %",
        "quantile": [{"output": "altitude", "probability": 0.99, "below": "10 km"}],
    }
    correlations = [{"between": ["altitude", "range"], "coefficient": 0.5}]
    described = content(4, name="a reentry", samples=300, accept=accept, correlations=correlations)
    run_campaign(parse_campaign(described, "test.toml", "test"), place / "plain", None, 1, report=False)
    run_campaign(scalar_filter.campaign(2_000, name="filtered"), place / "filtered", None, 1, report=False)
    for name in ("plain", "filtered"):
        export_run(place / name, place / f"{name}_export")
        export_run(place / name, place / f"{name}_si", "SI")
        for path in (place / name).iterdir():
            if path.is_dir():
                shutil.rmtree(path)
            elif path.name not in ("manifest.json", "summary.json"):
                path.unlink()
    return place


def summary_of(runs: Path, name: str) -> dict[str, Any]:
    return dict(json.loads((runs / name / "summary.json").read_text(encoding="utf-8")))


def test_a_run(runs: Path) -> None:
    """Verdict, sigmas, shares in per cent that add up with correlations, and findings on requirements."""
    done = invoke("show", "plain", cwd=runs)
    assert done.returncode == 0, done.stderr
    summary = summary_of(runs, "plain")
    assert done.stdout.startswith("a reentry: 300 samples, ensemble engine\n")
    for sigma in summary["sigma_paired"][2:]:
        assert f"{sigma:.5g}" in done.stdout
    assert "Requirements: 1 of 2 met, 1 not met." in done.stdout
    assert "|altitude| below 10 km in 99 % of samples  not met" in done.stdout
    heading, *rows = done.stdout.partition("share of the variance, %\n")[2].partition("\n\n")[0].splitlines()
    assert heading.split() == ["error", "altitude", "range", "altitude", "rate", "range", "rate"]
    assert rows[-1].startswith("correlations")
    cells = [[float(cell.replace("<", "").replace("−", "-")) for cell in row.split()[-4:]] for row in rows]
    for column in zip(*cells, strict=True):  # each cell is rounded to 0.005, or written as less than 0.01
        assert sum(column) == pytest.approx(100.0, abs=0.01 * len(rows))
    assert "filter" not in done.stdout.lower()


def test_a_filter(runs: Path) -> None:
    done = invoke("show", "filtered", cwd=runs)
    assert done.returncode == 0, done.stderr
    found = summary_of(runs, "filtered")["filter"]
    assert "The filter is optimistic by a factor of 1.5" in done.stdout
    for title in ("true over filter sigma by groups of states", "true over filter sigma of each output"):
        table = done.stdout.partition(f"Filter: {title}\n")[2].partition("\n\n")[0]
        assert "optimistic" in table
        assert f"{found['groups']['position']['ratio']:.3f}" in table
    sensors = done.stdout.partition("Innovations over the whole flight\n")[2].partition("\n\n")[0].splitlines()
    nis = {line.split()[0]: line.split()[3] for line in sensors[1:] if line}
    assert nis == {"fix": f"{found['sensors']['fix']['nis_mean']:.3f}", "spare": "–"}


@pytest.mark.parametrize("name", ["plain", "filtered"])
def test_one_table(name: str, runs: Path) -> None:
    """As `mcnav export` writes it from the whole run, in either units; as JSON; and in the terminal."""
    tables = json.loads(invoke("show", name, "--format", "json", cwd=runs).stdout)
    assert {"verdict", "outputs", "budget", "covariance"} <= set(tables)
    assert ("requirements" in tables) == (name == "plain")
    for table, rows in tables.items():
        for folder, units in ((f"{name}_export", "shown"), (f"{name}_si", "SI")):
            done = invoke("show", name, "--table", table, "--format", "csv", "--units", units, cwd=runs)
            assert done.stdout == (runs / folder / f"{table}.csv").read_text(encoding="utf-8")
        found = json.loads(invoke("show", name, "--table", table, "--format", "json", cwd=runs).stdout)
        assert found == {table: rows}
        shown = invoke("show", name, "--table", table, cwd=runs)
        assert shown.returncode == 0
        *lines, between, following = shown.stdout.splitlines()
        assert len(lines) == len(rows) + 2
        assert (between, following) == ("", f"next: mcnav export {name}")
    done = invoke("show", name, "--format", "csv", cwd=runs)
    assert [row["output"] for row in csv.DictReader(io.StringIO(done.stdout))] == [
        row["output"] for row in tables["outputs"]
    ]


def test_failed_samples_are_counted_by_reason(runs: Path, tmp_path: Path) -> None:
    shutil.copytree(runs / "plain", tmp_path / "run")
    summary = summary_of(runs, "plain") | {"failed": 3, "failures": {"failed: fell to 3 km": 2, "failed: too slow": 1}}
    (tmp_path / "run" / "summary.json").write_text(json.dumps(summary))
    done = invoke("show", "run", "--table", "failures", "--format", "csv", cwd=tmp_path)
    assert done.stdout == "reason,samples\nfell to 3 km,2\ntoo slow,1\n"
    assert "fell to 3 km" in invoke("show", "run", cwd=tmp_path).stdout


def test_a_narrow_terminal_shows_every_number(runs: Path) -> None:
    done = invoke("show", "plain", cwd=runs, columns=40)
    assert done.returncode == 0
    assert f"{summary_of(runs, 'plain')['sigma_paired'][3]:.5g}" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["nowhere"], "error: nowhere: holds no run (there is no such folder)"),
        (["plain/manifest.json"], "error: plain/manifest.json: holds no run (it is a file)"),
        (["plain_export"], "error: plain_export: holds no finished run; run the campaign first"),
        (["plain", "--table", "outpts"], "error: --table: the run has no table 'outpts'; did you mean 'outputs'? "),
        (["plain", "--table", "nees"], "error: --table: the run has no table 'nees'; "),
    ],
)
def test_bad_input(arguments: list[str], line: str, runs: Path) -> None:
    done = invoke("show", *arguments, cwd=runs)
    assert done.returncode == 2
    (told,) = done.stderr.splitlines()
    assert told.startswith(line)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("name", ["plain", "filtered"])
def test_a_summary_of_anything(name: str, runs: Path, tmp_path: Path) -> None:
    """Shown or refused in one line, and nothing that controls the terminal."""
    chance, summary = random.Random(9), summary_of(runs, name)
    shutil.copytree(runs / name, tmp_path / "run")
    statuses = []
    for path in chance.sample(list(places_in(summary)), 20):
        changed = copy.deepcopy(summary)
        set_at(changed, path, chance.choice([*VALUES, ESCAPE]))
        (tmp_path / "run" / "summary.json").write_text(json.dumps(changed))
        for arguments in ([], ["--format", "json"], ["--table", "budget", "--units", "SI"]):
            done = invoke("show", "run", *arguments, cwd=tmp_path)
            statuses.append(done.returncode)
            assert done.returncode in (0, 2), path
            assert len(done.stderr.splitlines()) == (1 if done.returncode else 0), path
            assert ESCAPE not in done.stdout + done.stderr
    assert {0, 2} == set(statuses)


def test_a_name_that_controls_a_terminal(runs: Path, tmp_path: Path) -> None:
    shutil.copytree(runs / "plain", tmp_path / "run")
    summary = summary_of(runs, "plain")
    summary["outputs"][0]["name"] = ESCAPE
    (tmp_path / "run" / "summary.json").write_text(json.dumps(summary))
    for form in ("table", "csv", "json"):
        done = invoke("show", "run", "--format", form, cwd=tmp_path)
        assert "\x1b" not in done.stdout + done.stderr
