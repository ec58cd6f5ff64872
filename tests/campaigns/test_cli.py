"""The commands: what they print, and their exit status.

A run, a comparison, bad input, wrong use and a requirement that is not met are processes; the other commands run in the
process of the tests, as `test_a_process_prints_what_its_command_does` allows.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from mcnav.entries.examples import examples
from mcnav.execution.streams import HANDLER, tolerate
from mcnav.studies import precompile
from mcnav.systems.reentry.scenario import SOURCES
from tests.commands import in_process, invoke
from tests.conftest import ROOT
from tests.processes import run_to_end

DEMO = ROOT / "campaigns" / "01_tn_d1772_trajectory_4.toml"


TOLERANT = "from mcnav.execution.streams import tolerate; tolerate()\n"
"""What a program does first, whose output may be in an encoding that lacks some characters."""


def mcnav(*arguments: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run the program in a folder."""
    command = [sys.executable, "-m", "mcnav", *map(str, arguments)]
    environment = os.environ | {"COLUMNS": "300", "PYTHONWARNINGS": "error"}
    return run_to_end(command, cwd=cwd, env=environment)


@pytest.fixture(scope="module")
def workplace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the demo has been run."""
    place = tmp_path_factory.mktemp("workplace")
    finished = mcnav("run", DEMO, "--samples", 2000, cwd=place)
    assert finished.returncode == 0, finished.stderr
    assert finished.stderr == ""
    assert "Every sigma is right. The" in finished.stdout
    assert "report: reports/01_tn_d1772_trajectory_4/report.html" in finished.stdout
    return place


def test_help(tmp_path: Path) -> None:
    finished = invoke("--help", cwd=tmp_path)
    assert finished.returncode == 0
    commands = (
        "run",
        "report",
        "compare",
        "sweep",
        "reproduce",
        "new",
        "lincov",
        "allocate",
        "check",
    )
    for command in commands:
        assert command in finished.stdout


def test_run_again_uses_what_is_stored(workplace: Path) -> None:
    part = next((workplace / "reports" / DEMO.stem / "samples").iterdir())
    before = part.stat().st_mtime_ns
    assert invoke("run", DEMO, "--samples", 2000, cwd=workplace).returncode == 0
    assert part.stat().st_mtime_ns == before


@pytest.mark.parametrize("command", ["--help", "docs"])
def test_what_computes_nothing_imports_no_numerical_library(command: str) -> None:
    program = f"""{TOLERANT}
import sys
from mcnav import cli
sys.argv = ["mcnav", {command!r}]
try:
    cli.main()
except SystemExit as ended:
    assert not ended.code
print("\\nloaded:", *sorted({{name.partition(".")[0] for name in sys.modules}}))
"""
    finished = run_to_end([sys.executable, "-c", program], cwd=ROOT)
    assert finished.returncode == 0, finished.stderr
    loaded = set(finished.stdout.rpartition("loaded:")[2].split())
    assert {"mcnav", "typer"} <= loaded
    assert not loaded & {"numpy", "scipy", "numba", "pandas", "pyarrow", "matplotlib", "pint", "jinja2", "joblib"}


def test_a_command_uses_one_thread_unless_told_otherwise() -> None:
    program = "import os, sys; from mcnav import cli; cli._prepare_process(); print(os.environ['OPENBLAS_NUM_THREADS'])"
    environment = {key: value for key, value in os.environ.items() if key != "OPENBLAS_NUM_THREADS"}
    for told, expected in (({}, "1"), ({"OPENBLAS_NUM_THREADS": "3"}, "3")):
        assert run_to_end([sys.executable, "-c", program], env=environment | told).stdout.strip() == expected


AIDED = ROOT / "campaigns" / "19_flight_with_gnss.toml"
SLOW_IMPORTS = {"pandas", "pint", "matplotlib", "dask", "distributed", "scipy.stats", "filterpy"}
UNNEEDED = {*SLOW_IMPORTS, "mcnav.systems.closed_loop.scenario", "mcnav.systems.ins.reference.aided"}
RUN = ("run", "--samples", 100)
STORED = ROOT / "reports" / "examples" / "01_tn_d1772_trajectory_4"


@pytest.mark.parametrize(
    "calls",
    [
        [
            (("lincov", campaign, "--out", campaign.stem), {*UNNEEDED, "joblib", "mcnav.analysis.summary"})
            for campaign in (DEMO, AIDED)
        ],
        [
            ((*RUN, DEMO, "--out", "first", "--no-report"), {*UNNEEDED, "mcnav.report.pages.run.page"}),
            (("report", "first"), SLOW_IMPORTS), ((*RUN, AIDED, "--out", "aided"), SLOW_IMPORTS),
        ],
        [(("show", STORED), {*SLOW_IMPORTS, "scipy.special", "scipy.linalg", "pyarrow", "numba", "joblib"})],
    ],
    ids=["lincov", "run", "show"],
)  # fmt: skip
def test_what_is_slow_to_import_and_not_needed_is_not_imported(
    calls: list[tuple[tuple[object, ...], set[str]]], tmp_path: Path
) -> None:
    """By commands in one process, one after the other: what one imports, the next ones have."""
    program = f"{TOLERANT}import sys; from mcnav import cli\n"
    for command, slow in calls:
        program += (
            f"sys.argv = {['mcnav', *map(str, command)]}\ntry: cli.main()\n"
            f"except SystemExit as ended: assert not ended.code\nprint('loaded:', *{slow} & sys.modules.keys())\n"
        )
    finished = run_to_end([sys.executable, "-c", program], cwd=tmp_path)
    assert finished.returncode == 0, finished.stderr
    assert [line for line in finished.stdout.splitlines() if line.startswith("loaded:")] == ["loaded:"] * len(calls)


def test_without_report(workplace: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with_report = workplace / "reports" / DEMO.stem
    finished = invoke("run", DEMO, "--samples", 2000, "--out", "run", "--no-report", cwd=tmp_path)
    assert finished.returncode == 0, finished.stderr
    assert finished.stdout.endswith("summary: run/summary.json\n\nnext: mcnav report run --open\n")
    folder = tmp_path / "run"
    assert (folder / "summary.json").read_bytes() == (with_report / "summary.json").read_bytes()
    assert not (folder / "report.html").exists()

    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda address: opened.append(address) or len(opened) == 1)
    shown = in_process("report", folder, "--open")
    assert shown.exit_code == 0
    assert "no browser" not in shown.output
    assert opened == [(folder / "report.html").as_uri()]
    assert "<svg" in (folder / "report.html").read_text()
    assert "no browser" in in_process("report", folder, "--open").output

    again = invoke("run", DEMO, "--samples", 2000, "--out", "run", "--no-report", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert not (folder / "report.html").exists()  # it might be of fewer samples


def test_report_and_compare(workplace: Path) -> None:
    folder = workplace / "reports" / DEMO.stem
    before = (folder / "report.html").read_bytes()
    assert invoke("report", folder, cwd=workplace).returncode == 0
    assert (folder / "report.html").read_bytes() == before
    other = workplace / "other"
    assert (
        invoke("run", DEMO, "--samples", 500, "--seed", 3, "--jobs", 1, "--out", other, cwd=workplace).returncode == 0
    )
    compared = invoke("compare", folder, other, cwd=workplace)
    assert compared.returncode == 0
    assert "2 runs" in compared.stdout
    assert compared.stdout.count(str(folder)) >= 5
    for summary in (json.loads((each / "summary.json").read_text()) for each in (folder, other)):
        for value in summary["sigma_sample"][:2]:
            assert f"{value * 1e-3:.5g}" in compared.stdout


def test_partials(workplace: Path) -> None:
    finished = invoke("lincov", DEMO, "--partials", cwd=workplace)
    assert finished.returncode == 0
    for word in ("gyro drift [deg/h]", "initial altitude [km]", "initial range rate [m/s]", "differences", "runs"):
        assert word in finished.stdout
    single = invoke("lincov", DEMO, "--partials", "--method", "runs", cwd=workplace)
    assert single.returncode == 0


def test_partials_for_every_start_time(workplace: Path) -> None:
    """The table holds what a campaign that starts at the first point has as its partials, in both axes."""
    for axes in ("start", "trajectory"):
        folder = workplace / axes
        finished = invoke(
            "sweep",
            DEMO,
            "--vary",
            "start",
            "--confirm",
            0,
            "--points",
            9,
            "--axes",
            axes,
            "--out",
            folder,
            cwd=workplace,
        )
        assert finished.returncode == 0, finished.stderr
        table = pd.read_csv(folder / "start_times.csv")
        assert len(table) == 9
        summary = json.loads((workplace / "reports" / DEMO.stem / "summary.json").read_text())
        found = table.filter(regex=r"^d ").iloc[0].to_numpy().reshape(4, -1)
        contributions = np.sqrt(np.diag(summary["start_covariance"]))
        difference = np.abs(found - summary["partials"]) * contributions
        assert (difference.max(axis=1) < 1e-5 * np.array(summary["sigma_linear"])).all()
        sigma = table.filter(regex=r"^sigma")
        assert sigma.iloc[0].tolist() == pytest.approx(summary["sigma_linear"], rel=1e-5)
        assert (folder / "start_times.html").read_text().count("<figure") == 6  # the first screen repeats one


def test_start_times(workplace: Path) -> None:
    folder = workplace / "starts"
    finished = invoke("sweep", DEMO, "--vary", "start", "--count", 31, "--out", folder, cwd=workplace)
    assert finished.returncode == 0, finished.stderr
    checks = pd.read_csv(folder / "start_times_checks.csv")
    assert (checks["verdict"] == "agrees").all()
    table = pd.read_csv(folder / "start_times.csv")
    before = table[table["start [s]"] <= 0.0]
    best = before.loc[before["sigma altitude [m]"].idxmin()]
    flown = checks[(checks["output"] == "altitude") & np.isclose(checks["start [s]"], best["start [s]"])].iloc[0]
    told = next(line for line in finished.stdout.splitlines() if line.startswith("altitude [km]")).split()
    sizes = [best["sigma altitude [m]"], table["sigma altitude [m]"][0], flown["sigma paired"]]
    # the campaign's own start is the first point: two methods, 1e-5 apart, of which five digits are shown
    assert float(told[2]) == pytest.approx(best["start [s]"] / 60.0, abs=0.051)
    assert [float(word) for word in told[3:6]] == pytest.approx([1e-3 * size for size in sizes], rel=1e-4)
    assert told[6] == "agrees"
    assert any(line.startswith("all, weighted") for line in finished.stdout.splitlines())
    assert finished.stdout.startswith("Start at ")
    assert "Monte Carlo agrees with linear analysis there." in finished.stdout
    assert (folder / "start_times.html").read_text().count('class="tag agrees"') == len(checks)


def test_linearity(workplace: Path) -> None:
    folder = workplace / "linearity"
    finished = invoke("sweep", DEMO, "--scale", "--samples", 500, "--largest", 12, "--out", folder, cwd=workplace)
    assert finished.returncode == 0, finished.stderr
    assert "joint distribution" in finished.stdout
    (answer,) = (line for line in finished.stdout.splitlines() if line.startswith("All errors may grow by"))
    assert answer[:60] in (folder / "linearity.html").read_text()
    assert len(pd.read_csv(folder / "linearity.csv")) == 4 * (len(SOURCES) + 1)
    assert (folder / "linearity.html").read_text().count("<figure") == 3  # the first screen repeats one


JAGGED = """
import numpy as np
from mcnav import Output, Source


class Jagged:
    sources = (Source("height", "m", "m", 1.0),)
    outputs = tuple(Output(name, "m", "m") for name in ("height", "b", "c", "d", "e", "f"))

    def propagate(self, errors):
        return errors * np.arange(1.0, 7.0) + 100.0 * np.sin(1e3 * errors)
"""


def test_linearity_of_what_is_nowhere_linear(workplace: Path) -> None:
    """Only the least multiple is simulated, so that each figure shows one: stderr is empty, without warnings.

    A source with the name of an output is an initial one, also in a scenario of one's own.
    """
    (workplace / "jagged.py").write_text(JAGGED)
    described = '[scenario]\ntype = "jagged.py:Jagged"\n[errors]\nheight = "1 m"\n'
    (workplace / "jagged.toml").write_text(described)
    finished = invoke("sweep", "jagged.toml", "--scale", "--out", "jagged", cwd=workplace)
    assert finished.returncode == 0, finished.stderr
    assert finished.stderr == ""
    table = pd.read_csv(workplace / "jagged" / "linearity_dispersion.csv")
    assert set(table["multiple"]) == {0.1}
    assert ">initial height</th>" in (workplace / "jagged" / "linearity.html").read_text()
    assert set(pd.read_csv(workplace / "jagged" / "linearity.csv")["source"]) == {"height", "all at once"}


def test_reproduce_the_story(workplace: Path) -> None:
    finished = invoke("reproduce", "story-of-84-minutes", "--out", workplace / "story", cwd=workplace)
    assert finished.returncode == 0, finished.stderr
    assert finished.stdout.splitlines()[0] == f"written: {workplace / 'story' / 'story.html'}"
    *files, between, following = finished.stdout.splitlines()
    assert (between, following) == ("", "next: mcnav docs story")
    for line in files:
        assert Path(line.removeprefix("written: ")).exists()


def test_a_run_folders_own_campaign_goes_on_there(workplace: Path) -> None:
    folder = workplace / "reports" / DEMO.stem
    finished = invoke("run", folder / "campaign.toml", cwd=workplace)
    assert finished.returncode == 0, finished.stderr
    assert not (workplace / "reports" / "campaign").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "nowhere.toml"], "error: nowhere.toml: no such file"),
        (["run", "wrong.toml"], "error: wrong.toml: errors.gyro_drift: got '5 km', which is a length"),
        (
            ["run", DEMO, "--samples", 1000],
            "holds a run of 2,000 samples, and 1,000 are fewer; ask for as many or more",
        ),
        (["run", DEMO, "--seed", 3], "seed was 1772, is 3); --fresh replaces them"),
        (["run", DEMO, "--out", "file/inside"], "error: file/inside: cannot be written to"),
        (["run", DEMO, "--out", "x" * 300], "File name too long"),
        (["run", DEMO, "--check"], "accept: is missing; --check needs requirements"),
        (["run", DEMO, "--known-ways"], "--known-ways: belongs to --check; add --check"),
        (["report", "nowhere"], "error: nowhere: holds no run"),
        (
            ["report", "reports"],
            "reports: holds no run (manifest.json is missing); mcnav report --index reports lists the",
        ),
        (["report", "nowhere", "--foo"], "--foo: no such option; mcnav report --help"),
        (["tune", DEMO], 'has no ranges to tune for; give one such as bias = "0.5..2 deg/h" (mcnav docs howto-ranges)'),
        (["judge", DEMO, "--imu", "nolog.csv"], "expected"),
        (["compare", "nowhere"], "error: nowhere: holds no run (there is no such folder)"),
        (["lincov", "nowhere.toml", "--partials"], "error: nowhere.toml: no such file"),
    ],
    ids=str,
)
def test_bad_input(arguments: list[object], message: str, workplace: Path) -> None:
    """One line, exit status 2, no traceback, and earlier results as they were."""
    (workplace / "file").touch()
    wrong = 'samples = 3\n[scenario]\ntype = "reentry"\ntrajectory = 4\n[errors]\ngyro_drift = "5 km"\n'
    (workplace / "wrong.toml").write_text(wrong)
    summary = workplace / "reports" / DEMO.stem / "summary.json"
    before = summary.read_bytes()
    finished = invoke(*arguments, cwd=workplace)
    assert finished.returncode == 2
    assert message in finished.stderr
    assert len(finished.stderr.splitlines()) == 1
    assert summary.read_bytes() == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "19"], "; did you mean 'campaigns/19_flight_with_gnss.toml'?"),
        (["run", "campaigns/14_polar"], "; did you mean 'campaigns/14_polar.toml'?"),
        (["lincov", "14_polr.toml"], "; did you mean 'campaigns/14_polar.toml'?"),
        (["check", "fligth.csv", "--trajectory"], "; did you mean 'campaigns/flight.csv'?"),
        (["run", "quaternion.toml"], "quaternion.toml: no such file; expected a campaign file in TOML"),
        (["demo", "99"], "no example '99'; they are numbered from 1 to 40, and --list shows them"),
        (["demo", "gnss"], "no example 'gnss'; did you mean '19_flight_with_gnss'?"),
        (["docs", "filter"], "'filter' is unknown; did you mean 'howto-filter'?"),
        (["docs", "aided"], "'aided' is unknown; did you mean 'tutorial-aided'?"),
        (["reproduce", "tnd1772"], "'tnd1772' is unknown; did you mean 'tn-d1772'?"),
        (["show", "run", "--format", "cvs"], "'cvs' is unknown; did you mean 'csv'? It is one of table, csv, json"),
        (
            ["run", DEMO, "--engine", "referense"],
            "this scenario has ensemble, reference, map; did you mean 'reference'?",
        ),
    ],
    ids=str,
)
def test_near_names_are_suggested(arguments: list[object], message: str) -> None:
    finished = invoke(*arguments, cwd=ROOT)
    assert finished.returncode == 2
    assert message in finished.stderr.splitlines()[-1]


def test_an_example_is_suggested_where_there_are_none(tmp_path: Path) -> None:
    line = "19: no such file; expected a campaign file in TOML; mcnav demo 19 runs the example 19_flight_with_gnss"
    assert line in invoke("run", "19", cwd=tmp_path).stderr


@pytest.mark.parametrize(
    "arguments",
    [["run", DEMO, "--jobs", 0], ["run", DEMO, "--samples", 1], ["run", DEMO, "--engine", "magic"], ["fly"], ["run"]],
)
def test_wrong_use(arguments: list[object], workplace: Path) -> None:
    finished = invoke(*arguments, cwd=workplace)
    assert finished.returncode == 2
    assert "Traceback" not in finished.stderr
    assert finished.stderr


@pytest.mark.parametrize(
    ("arguments", "status"),
    [(["show", "RUN"], 0), (["run", "nowhere.toml"], 2), (["run", DEMO, "--samples", 1], 2), (["fly"], 2)],
    ids=str,
)
def test_a_process_prints_what_its_command_does(arguments: list[object], status: int, workplace: Path) -> None:
    """Status, output and errors are the same, to the letter, as those of the command in this process."""
    arguments = [f"reports/{DEMO.stem}" if word == "RUN" else word for word in arguments]
    process, here = (program(*arguments, cwd=workplace) for program in (mcnav, invoke))
    tolerate()
    encoding = os.environ.get("PYTHONIOENCODING") or "utf-8"
    here.stdout, here.stderr = (text.encode(encoding, HANDLER).decode(encoding) for text in (here.stdout, here.stderr))
    assert process.returncode == here.returncode == status
    assert (process.stdout, process.stderr) == (here.stdout, here.stderr)
    assert process.stdout or process.stderr


@pytest.mark.parametrize(
    ("below", "status", "found"), [("200 km", 0, "met"), ("97.6 km", 1, "undecided"), ("60 km", 1, "not met")]
)
def test_check(below: str, status: int, found: str, workplace: Path) -> None:
    """Exit status 1 unless every requirement is met; without --check the requirements are shown, and that is all."""
    described = DEMO.read_text() + "[[accept.quantile]]\noutput = 'altitude'\nprobability = 0.9973\n"
    campaign = workplace / f"accept_{status}_{found[:3]}.toml"
    campaign.write_text(f"{described}below = '{below}'\n")
    program = mcnav if found == "not met" else invoke
    finished = program("run", campaign, "--samples", 2000, "--check", cwd=workplace)
    assert finished.returncode == status, finished.stderr
    assert f"{found}" in finished.stdout
    assert f"|altitude| below {below} in 99.73 % of samples" in finished.stdout
    assert "Every sigma is right. The" in finished.stdout
    told = {"met": "1 of 1 met", "not met": "0 of 1 met, 1 not met", "undecided": "0 of 1 met, 1 undecided"}[found]
    assert f"Requirements: {told}." in finished.stdout
    if found == "not met":
        assert invoke("run", campaign, "--samples", 2000, cwd=workplace).returncode == 0
    summary = json.loads((workplace / "reports" / campaign.stem / "summary.json").read_text())
    assert [entry["finding"] for entry in summary["requirements"]] == [found]
    assert "Allowed source sigmas" in (workplace / "reports" / campaign.stem / "report.html").read_text()


def test_failed_samples_give_status_3(workplace: Path) -> None:
    described = '[scenario]\ntype = "reentry"\ntrajectory = 4\n[errors]\n'
    described += 'altitude = { distribution = "uniform", half_width = "40000 km" }\n'
    (workplace / "failing.toml").write_text(described)
    finished = invoke("run", "failing.toml", "--samples", 40, "--jobs", 1, cwd=workplace)
    assert finished.returncode == 3
    assert "samples failed and are excluded from all results" in finished.stdout.replace("\n", " ")


def test_every_example_is_compiled_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """By every engine if it is of a kind of its own, or named; the lines are those of what is done."""
    asked: list[tuple[str, bool]] = []

    def compile_for(name: str, every: bool) -> precompile.Compiled:
        asked.append((name, every))
        return precompile.Compiled(name, 2, 0.25)

    monkeypatch.setattr(precompile, "compile_for", compile_for)
    told: list[str] = []
    names = [name for name in examples() if name not in precompile.LEFT_OUT]
    assert precompile.compile_kernels((), 1, told.append) == 2 * len(names)
    assert sorted(asked) == [(name, name in precompile.DISTINCT) for name in names]
    assert told[0] == f"1 of {len(names)}: {precompile.DISTINCT[0]}: 2 functions, 0.2 s"
    asked.clear()
    assert precompile.compile_kernels([names[1]], 1, told.append) == 2
    assert asked == [(names[1], True)]


def test_compiling_beforehand_leaves_nothing_to_compile(tmp_path: Path) -> None:
    """In two processes, and again in one. A level belongs to objects, which are not asked for."""
    for jobs in (2, 1):
        done = invoke("dev", "compile", "--only", "11", "--jobs", jobs, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    assert done.stdout == "0 functions compiled, all others were stored\n\nnext: mcnav demo\n"
    told = [line.rpartition(",")[0] for line in done.stderr.splitlines()]
    assert told == ["1 of 1: 11_cruise: 0 functions"]
    refused = invoke("dev", "compile", "--level", "x86-64-v3", cwd=tmp_path)
    assert (refused.returncode, refused.stderr) == (2, "error: --level: belongs to --out; add --out FOLDER\n")


def test_a_check_flies_the_errors_of_a_campaign(tmp_path: Path) -> None:
    """A fault moves the flight without errors, about which it is linear; that kernels repeat themselves tests show."""
    done = invoke("check", ROOT / "campaigns" / "31_flight_with_a_faulty_receiver.toml", cwd=tmp_path)
    checks = {line.split("  ")[0] for line in done.stdout.splitlines()}
    assert {"shapes", "linear near zero", "nominal outputs", "history"} < checks
    assert not {"determinism", "travels to workers", "partials against differences"} & checks


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nothing.csv"], "nothing.csv: no such file; expected a trajectory as CSV or parquet"),
        (["nothing.py"], "nothing.py: nothing.py does not exist"),
        (["empty.py"], "empty.py: has no class with a method propagate, fly or rates; mcnav new scenario NAME writes"),
        (["broken.py"], "broken.py: broken.py cannot be executed: SyntaxError"),
        (["empty.py", "--column", "lat=x"], "--column: empty.py is no trajectory file; leave it out"),
    ],
)
def test_usual_mistakes_of_a_check(arguments: list[str], message: str, tmp_path: Path) -> None:
    (tmp_path / "empty.py").write_text("A = 1\n")
    (tmp_path / "broken.py").write_text("class A(\n")
    done = invoke("check", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"error: {message}")


def test_a_trajectory_is_checked(tmp_path: Path) -> None:
    """A heading that was not recorded, which reads as zeros, is a failed check."""
    flight = ROOT / "campaigns" / "flight.csv"
    done = invoke("check", flight, cwd=tmp_path)
    assert (done.returncode, done.stdout.count(" passed ")) == (0, 4)
    assert f"next: mcnav new ins flight --out {flight.parent} --trajectory {flight}" in done.stdout
    table = pd.read_csv(flight)
    table[[name for name in table if "heading" in name]] = 0.0
    table.to_csv(tmp_path / "unturned.csv", index=False)
    done = invoke("check", "unturned.csv", cwd=tmp_path)
    assert (done.returncode, done.stdout.count(" failed ")) == (1, 1)
    assert done.stdout.endswith("next: mcnav docs trajectories\n")


def test_a_report_that_is_not_written_cannot_be_opened(tmp_path: Path) -> None:
    done = invoke("run", DEMO, "--open", "--no-report", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (2, "error: --open: shows the report; leave out --no-report\n")


def test_the_report_is_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where there is no browser, a note says so."""
    opened = list[str]()
    monkeypatch.setattr("webbrowser.open", lambda address: bool(opened.append(address)))
    done = invoke("run", DEMO, "--samples", 50, "--open", cwd=tmp_path)
    assert opened == [(tmp_path / "reports" / DEMO.stem / "report.html").as_uri()]
    assert "note: no browser is found; open the file yourself" in done.stderr
    assert done.stdout.endswith(f"next: mcnav show reports/{DEMO.stem} --table budget\n")
