"""Headless Chromium, and every kind of page, made when it is first asked for."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
import pytest

import mcnav
from mcnav.config.read import read_campaign
from mcnav.files.whole import write_texts
from mcnav.report.document.html import page_html
from mcnav.report.pages.trajectory import page as trajectory_page
from mcnav.studies.allocate import write_allocation
from mcnav.studies.lincov import write_lincov
from mcnav.studies.linearity import write_linearity
from mcnav.studies.start_times import write_start_times
from mcnav.studies.sweep import SweepPlan, write_sweep
from mcnav.systems.ins.earth import WGS84
from mcnav.systems.ins.truth.segments import Climb, Hold, SpeedChange, Start, Turn, fly_segments
from mcnav.validation.reproduce.findings import Finding
from mcnav.validation.reproduce.story_of_84_minutes import page as story_page
from mcnav.validation.reproduce.textbook import page as textbook_page
from mcnav.validation.reproduce.textbook.filters import tutorial_numbers
from mcnav.validation.reproduce.tn_d1772 import page as tn_page
from mcnav.validation.reproduce.tn_d1772.in_the_closed_loop import LoopComparison
from mcnav.validation.reproduce.tn_d1772.in_three_dimensions import Comparison
from mcnav.validation.reproduce.tn_d1772.starting import advice
from mcnav.validation.reproduce.tn_d1772.tables import Cell
from mcnav.validation.reproduce.ukfm import page as ukfm_page
from mcnav.validation.reproduce.ukfm.simulation import run as simulate_ukfm
from mcnav.workflow import compare, index
from mcnav.workflow.replay import replay, write_replay
from mcnav.workflow.run import run_campaign
from mcnav.workflow.trajectory import describe
from tests.calibration import page as calibration_page
from tests.campaigns.test_brief import HOVER
from tests.campaigns.test_live import FILTERED
from tests.commands import in_process
from tests.conftest import ROOT, campaign
from tests.processes import LONG
from tests.reproduction import Reproduction

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
NAME = "Trajectory 4 </script> $\\frac{$ 🚀 تجربة"
FOLDER = "run $frac{$ 🚀 تجربة"
"""Names that would break a page where they are not written as they are; the second one is a folder's."""
REPRODUCED = "reproduction"
"""Kind of a folder that is no page."""


UNFOLD = "document.querySelectorAll('details.fold').forEach((fold) => { fold.open = true; })"
"""Opens the folds of a run's report."""

AXES = ("north", "east", "down")
SOURCES = [
    f"{kind}_{axis}"
    for kind in (*(f"{unit}_{kind}" for unit in ("gyro", "accelerometer") for kind in
                   ("bias", "scale_factor", "misalignment", "noise", "g_sensitivity")),
                 "initial_position", "initial_velocity", "initial_attitude", "gravity", "lever_arm")
    for axis in AXES
]  # fmt: skip
OUTPUTS = {f"{kind}_{axis}": unit for kind, unit in (("position", "m"), ("velocity", "m/s"), ("attitude", "rad"))
           for axis in AXES}  # fmt: skip
MANY = f"""
import numpy as np
from mcnav import Output, Source


class Many:
    sources = tuple(Source(name, "m", "m", 1.0) for name in {SOURCES})
    outputs = tuple(Output(name, unit, unit) for name, unit in {OUTPUTS}.items())
    matrix = np.sin(np.arange(1, 406) ** 1.5).reshape(9, 45) * 0.9 ** np.arange(45)

    def propagate(self, errors):
        outputs = errors @ self.matrix.T
        outputs[:, 6] += 0.5 * (errors[:, 2] ** 2 - 1.0)
        return outputs
"""


AIDED = """
name = "NAME"
samples = 120
seed = 7

[scenario]
type = "ins"
trajectory = "flight.csv"
platform = "strapdown"
start = "300 s"
end = "900 s"

[imu]
grade = "tactical"
[imu.gyro]
scale_factor = "3000 ppm"

[errors]
position = "10 m"
velocity = "0.1 m/s"
tilt = "0.5 mrad"
heading = "3 mrad"

[[aiding]]
type = "gnss"
interval = "5 s"
position = "3 m"
velocity = "0.1 m/s"
outages = [["500 s", "600 s"]]

[[aiding]]
type = "altimeter"
interval = "30 s"
altitude = "5 m"
bias = "10 m"
gate = 0.9

[filter]
estimates = ["position", "velocity", "attitude", "gyro_bias", "accelerometer_bias", "altimeter_bias"]

[[accept.quantile]]
output = "heading"
probability = 0.95
below = "3 mrad"
"""
"""An aided navigation, with everything that a report has of one."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Everything here needs a browser, and is left out where there is none unless it is said to be required."""
    missing = CHROMIUM is None and os.environ.get("MCNAV_BROWSER") != "required"
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.skipif(missing, reason="no Chromium on this machine"))


class Browser:
    """A browser that opens all pages in the same window, or in one without scripts: a new one costs more than a page.

    What is waited for may take as long as it does on a busy machine.
    """

    def __init__(self, chromium: Any) -> None:
        self.chromium = chromium
        self.windows: dict[bool, Any] = {}

    def _window(self, scripts: bool) -> Any:
        if scripts not in self.windows:
            self.windows[scripts] = self.chromium.new_page(java_script_enabled=scripts)
            self.windows[scripts].set_default_timeout(1e3 * LONG)
        return self.windows[scripts]

    @contextmanager
    def opened(
        self,
        path: Path,
        width: int = 1280,
        height: int = 900,
        scripts: bool = True,
        silent: bool = True,
        folder: Path | None = None,
        folded: bool = False,
    ) -> Iterator[Any]:
        """Open a page; at the end, it has said nothing if it is to be silent, and asked for nothing but itself.

        Parameters
        ----------
        folder : Path, optional
            Folder of files that the page may ask for as well.
        folded : bool
            Whether the folds of a run's report stay closed, as readers find them.
        """
        own = (path.as_uri(), "data:") if folder is None else (folder.as_uri(), "data:")
        with self.visited(path.as_uri(), width, height, scripts, silent, own, folded) as window:
            yield window

    @contextmanager
    def visited(
        self, address: str, width: int = 1280, height: int = 900, scripts: bool = True, silent: bool = True,
        own: tuple[str, ...] | None = None, folded: bool = False,
    ) -> Iterator[Any]:  # fmt: skip
        """Open an address in the same way; ``own`` begins all addresses that it may ask for, by default itself."""
        window, said, asked = self._window(scripts), list[str](), list[str]()
        heard: dict[str, Callable[[Any], None]] = {
            "console": lambda message: said.append(message.text),
            "pageerror": lambda error: said.append(str(error)),
            "request": lambda request: asked.append(request.url),
        }
        window.mouse.move(0, 0)
        window.set_viewport_size({"width": width, "height": height})
        window.emulate_media(media="screen", color_scheme="light")
        for event, hear in heard.items():
            window.on(event, hear)
        try:
            window.goto(address)
            if not folded:
                window.evaluate(UNFOLD)
            yield window
        finally:
            for event, hear in heard.items():
                window.remove_listener(event, hear)
            window.goto("about:blank")
        assert not (silent and said), said
        assert [url for url in asked if not url.startswith(own or (address, "data:"))] == []


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    from playwright.sync_api import sync_playwright

    quiet = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update"]
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=quiet, timeout=1e3 * LONG)
        yield Browser(chromium)
        chromium.close()


@pytest.fixture(scope="session")
def page_of(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Callable[[str], Path]:
    """From the kind of a page to where it has been written."""

    @cache
    def made(kind: str) -> Path:
        if kind == REPRODUCED:
            reproduction: Reproduction = request.getfixturevalue("reproduction")
            return reproduction.folder
        return (KINDS | FURTHER)[kind](tmp_path_factory.mktemp("pages"), made)

    return made


def _report(folder: Path, _: Callable[[str], Path]) -> Path:
    asked = {"quantile": [{"output": "altitude", "probability": 0.9973, "below": "120 km"}]}
    run_campaign(campaign(4, name=NAME, samples=5_000, accept=asked), folder / FOLDER, "ensemble", 2)
    return folder / FOLDER / "report.html"


def _many(folder: Path, _: Callable[[str], Path]) -> Path:
    """Nine outputs, 45 sources in groups, and requirements: the largest report."""
    (folder / "many.py").write_text(MANY)
    accept = "".join(
        f'[[accept.quantile]]\noutput = "{name}"\nprobability = 0.95\nbelow = "9 {unit}"\n'
        for name, unit in OUTPUTS.items()
    )
    errors = "".join(f'{name} = "1 m"\n' for name in SOURCES)
    (folder / "many.toml").write_text(
        f"name = '{NAME}'\nsamples = 1000\nseed = 4\n[scenario]\ntype = 'many.py:Many'\n[errors]\n{errors}{accept}"
    )
    mcnav.run(folder / "many.toml", folder / "run")
    return folder / "run" / "report.html"


def _start_times(folder: Path, _: Callable[[str], Path]) -> Path:
    plan = {"count": 41, "samples": 200, "check": ["-60 min", "-30 min"]}
    return write_start_times(campaign(4, name=NAME, start_times=plan), folder)[1][-1]


def _ins_start_times(folder: Path, _: Callable[[str], Path]) -> Path:
    table = {"count": 41, "samples": 200, "check": ["60 s"]}
    described = mcnav.read_campaign(
        ROOT / "campaigns" / "16_flight_tactical_grade.toml", {"name": NAME, "start_times": table}
    )
    return write_start_times(described, folder)[1][-1]


def _linearity(folder: Path, _: Callable[[str], Path]) -> Path:
    return write_linearity(campaign(4, name=NAME), folder, samples=200, largest=12.0)[1][-1]


def _aided(folder: Path, _: Callable[[str], Path]) -> Path:
    """Ten minutes with a turn and an outage, and a filter that neglects scale factors."""
    shutil.copy(ROOT / "campaigns" / "flight.csv", folder)
    (folder / "aided.toml").write_text(AIDED.replace("NAME", NAME.replace("\\", "\\\\")), encoding="utf-8")
    mcnav.run(folder / "aided.toml", folder / "run")
    return folder / "run" / "report.html"


def _story(folder: Path, _: Callable[[str], Path]) -> Path:
    return story_page.write(folder)[0]


def _textbook(folder: Path, _: Callable[[str], Path]) -> Path:
    """Numbers that agree and that differ, with intervals and without."""
    written = folder / textbook_page.PAGE
    written.write_text(textbook_page.render(tutorial_numbers()), encoding="utf-8")
    return written


def _ukfm(folder: Path, _: Callable[[str], Path]) -> Path:
    written = folder / ukfm_page.PAGE
    written.write_text(ukfm_page.render(simulate_ukfm(10)), encoding="utf-8")
    return written


def _tn(folder: Path, made: Callable[[str], Path]) -> Path:
    """All figures, of the data that the command writes, and of its numbers one of each mark."""
    written = made(REPRODUCED)
    printed = {"1510": 1510.2, "1511": 1513.0, "1512": 1600.0, "1513": 1600.0, "3": 4.0}
    cells = [
        Cell("I", f"trajectory {row}", "final range", "km", text, computed, 5.0, NAME, contradicted=row == 3)
        for row, (text, computed) in enumerate(printed.items(), start=1)
    ]
    figures = {
        name: draw(pd.read_csv(written / f"figure_{int(name):02}.csv")) for name, (_, draw) in tn_page.FIGURES.items()
    }
    rows = {
        name: [
            {str(key): value for key, value in row.items()} for row in pd.read_csv(written / name).to_dict("records")
        ]
        for name in ("three_dimensions.csv", "closed_loop.csv")
    }
    compared = [Comparison(**row) for row in rows["three_dimensions.csv"]]
    loops = [LoopComparison(**row) for row in rows["closed_loop.csv"]]
    found = [Finding(NAME, "It is said in many words what is found of it. " * 5, "holds")]
    started = advice(pd.read_csv(written / "figure_16.csv"))
    page = folder / tn_page.PAGE
    page.write_text(
        tn_page.render(NAME, cells, figures, found, found, found, compared, found, loops, started), encoding="utf-8"
    )
    return page


def _calibration(folder: Path, _: Callable[[str], Path]) -> Path:
    table = pd.read_csv(ROOT / "reports" / "calibration" / "calibration.csv")
    table["finding"] = table["finding"].fillna("")
    written = folder / "calibration.html"
    written.write_text(calibration_page.render(table), encoding="utf-8")
    return written


def _replay(folder: Path, made: Callable[[str], Path]) -> Path:
    return write_replay(replay(made("report").parent, 12), folder)[0]


def _comparison(folder: Path, made: Callable[[str], Path]) -> Path:
    larger = campaign(4, 2.0, name=NAME, samples=2_000)
    run_campaign(larger, folder / f"larger {FOLDER}", "ensemble", 2)
    written = folder / "comparison.html"
    runs = compare.compare_runs([made("report").parent, folder / f"larger {FOLDER}"])
    written.write_text(runs.page, encoding="utf-8")
    return written


def _trajectory(folder: Path, _: Callable[[str], Path]) -> Path:
    start = Start(latitude=0.8, longitude=0.1, course=1.0)
    rows = fly_segments(start, [Hold(20.0), SpeedChange(80.0), Climb(500.0), Turn(3.0), Climb(-300.0)], 5.0, WGS84)
    truth = rows.truth(WGS84)
    found = describe(NAME, truth, rows, {"start of navigation": 20.0})
    (written,) = write_texts(folder, {"trajectory.html": page_html(trajectory_page(found))})
    return written


def _lincov(folder: Path, _: Callable[[str], Path]) -> Path:
    described = read_campaign(ROOT / "campaigns" / "23_lunar_return_updated_once.toml", {"name": NAME})
    return write_lincov(described, folder)[1][-1]


def _bent(folder: Path, _: Callable[[str], Path]) -> Path:
    """Linear analysis that does not hold, examined."""
    return write_lincov(read_campaign(ROOT / "campaigns" / "14_polar.toml"), folder, examine=True)[1][-1]


def _allocate(folder: Path, _: Callable[[str], Path]) -> Path:
    """Of the changes one is simulated."""
    described = read_campaign(ROOT / "campaigns" / "23_lunar_return_updated_once.toml")
    return write_allocation({**described.resolved, "name": NAME}, folder, confirm=1)[1][-1]


def _sweep(folder: Path, _: Callable[[str], Path]) -> Path:
    """Curves with a limit, and Monte Carlo at three points."""
    described = campaign(4, name=NAME, samples=2_000)
    plan = SweepPlan({"errors.altitude": "1..100 km"}, ("altitude < 40 km", "range", "cep(altitude, range)"), 7)
    return write_sweep(dict(described.resolved), plan, folder, 3)[1][-1]


def _contours(folder: Path, _: Callable[[str], Path]) -> Path:
    """Contours of an aided navigation whose filter believes less than is true."""
    shutil.copy(ROOT / "campaigns" / "flight.csv", folder)
    (folder / "aided.toml").write_text(AIDED.replace("NAME", NAME.replace("\\", "\\\\")), encoding="utf-8")
    varied = {"imu.gyro.scale_factor": "100..10000 ppm", "aiding.gnss.position": "1..9 m"}
    return write_sweep(folder / "aided.toml", SweepPlan(varied, ("position_horizontal",), 6), folder)[1][-1]


def _index(_: Path, made: Callable[[str], Path]) -> Path:
    return index.write_index(made("report").parent.parent)[0]


def _commanded(folder: Path, page: str, *words: object) -> Path:
    """Return the page that a command writes into a folder."""
    done = in_process(*words, "--out", folder / "page")
    assert done.exit_code == 0, done.output
    return folder / "page" / page


def _loop(folder: Path, _: Callable[[str], Path]) -> Path:
    return _commanded(folder, "report.html", "run", ROOT / "campaigns" / "24_rendezvous.toml", "--samples", 200)


def _faulty(folder: Path, _: Callable[[str], Path]) -> Path:
    """A filter that fails, and mean errors above one sigma."""
    campaign = ROOT / "campaigns" / "31_flight_with_a_faulty_receiver.toml"
    return _commanded(folder, "report.html", "run", campaign, "--samples", 100)


def _brief(folder: Path, _: Callable[[str], Path]) -> Path:
    (folder / "hover.toml").write_text(HOVER, encoding="utf-8")
    run_campaign(read_campaign(folder / "hover.toml"), folder / "run", None, 1)
    return _commanded(folder, "brief.html", "brief", folder / "run")


OF_SECONDS: Final = FILTERED.replace('"10 s"', '"2 s"')


def _filtered(folder: Path) -> Path:
    """Write a campaign of 100 s."""
    shutil.copy(ROOT / "campaigns" / "flight.csv", folder)
    (folder / "filtered.toml").write_text(OF_SECONDS, encoding="utf-8")
    return folder / "filtered.toml"


def _filters(folder: Path, _: Callable[[str], Path]) -> Path:
    kinds = ("--kind", "ekf", "--kind", "iterated", "--samples", 4)
    return _commanded(folder, "filters.html", "filters", _filtered(folder), *kinds)


def _judged(folder: Path, _: Callable[[str], Path]) -> Path:
    """A sample of the campaign, whose times a wrong GNSS sigma is at odds with."""
    campaign, record = _filtered(folder), folder / "record"
    assert in_process("judge", campaign, "--record", "--rate", 20, "--out", record).exit_code == 0
    campaign.write_text(OF_SECONDS.replace('"3 m"', '"1 m"'), encoding="utf-8")
    files = ("--imu", record / "imu.csv", "--reference", record / "reference.csv", "--start", record / "start.csv")
    measured = ("--measurements", f"gnss={record / 'gnss.csv'}")
    return _commanded(folder, "judge.html", "judge", campaign, *files, *measured, "--records", 200)


def _identified(folder: Path, _: Callable[[str], Path]) -> Path:
    """Readings that drift, so that the model does not fit."""
    white = np.random.default_rng(1).standard_normal((6, 2_000))
    names = [f"{name}_{axis}" for name in ("gyro", "accelerometer") for axis in "xyz"]
    drift = {"gyro_x": np.linspace(0.0, 20.0, 2_000), "accelerometer_z": np.full(2_000, -1e6)}
    table = {name: values + drift.get(name, 0.0) for name, values in zip(names, white, strict=True)}
    pd.DataFrame({"time": 0.1 * np.arange(2_000)} | table).to_csv(folder / "static.csv", index=False)
    units = ("--unit", "gyro=deg/h", "--unit", "accelerometer=ug")
    return _commanded(folder, "identify.html", "identify", folder / "static.csv", *units)


FURTHER: Final[dict[str, Callable[[Path, Callable[[str], Path]], Path]]] = {
    "loop": _loop, "faulty": _faulty, "brief": _brief, "filters": _filters, "judge": _judged, "identify": _identified,
}  # fmt: skip
"""Kinds whose first screen and sentences are tested, and nothing else."""

KINDS: dict[str, Callable[[Path, Callable[[str], Path]], Path]] = {
    "report": _report, "many": _many, "aided": _aided, "replay": _replay, "comparison": _comparison, "index": _index,
    "start times": _start_times, "ins start times": _ins_start_times, "linearity": _linearity,
    "calibration": _calibration, "story": _story, "textbook": _textbook, "tn": _tn, "ukfm": _ukfm,
    "trajectory": _trajectory, "lincov": _lincov, "bent": _bent, "allocate": _allocate, "sweep": _sweep,
    "contours": _contours,
}  # fmt: skip
"""What makes each kind of page, in a folder of its own."""
