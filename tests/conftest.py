"""Shared scenarios and campaigns; each is built once."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from filelock import FileLock
from hypothesis import settings

from mcnav.config.read import Campaign, parse_campaign
from mcnav.execution.progress import Phase
from mcnav.execution.threads import one_thread
from mcnav.systems.reentry.ensemble.transition import Response, linear_response
from mcnav.systems.reentry.scenario import SOURCES, Flight, Reentry
from mcnav.systems.reentry.table_i import COLUMNS, ERROR_SIZES, ERRORS, TABLE_I, among_all, start_state
from mcnav.systems.reentry.vehicle import Vehicle
from tests import examples, worker_server
from tests.compile_once import share_compilation
from tests.processes import run_to_end
from tests.reproduction import Reproduction, reproduce, reproduced

FOLDER = Path(__file__).parent
PACKAGE = FOLDER.parent / "mcnav"
BROWSER = FOLDER / "browser"
"""Folder whose files stay together, for the sake of one browser and of its pages."""

LONG_FIRST = ("faults", "browser", "campaigns", "published", "statistical", "cross", "properties")
"""Folders whose tests come first, those with the longest before the others."""

NOT_INERTIAL = (
    "cross/test_compiled.py", "campaigns/test_own_noise.py", "faults/test_storage.py", "campaigns/test_run.py",
    "cross/test_engines.py", "faults/test_failures.py", "faults/test_hostile.py", "statistical/test_intervals.py",
    "cross/test_partials.py",
)  # fmt: skip
"""Files whose tests load hardly anything of inertial navigation; they take longer than its compilation by another
worker.

The first one compiles the kernels of reentry, which the others load, but for the second one, which loads nothing.
"""

INERTIAL = (
    "cross/test_ins_aided.py", "faults/test_kill.py", "faults/test_navigation_inputs.py",
    "faults/test_navigation_storage.py", "faults/test_navigation_interrupted.py", "faults/test_bad_input.py",
    "campaigns/test_own.py",
)  # fmt: skip
"""Long tests of inertial navigation; the first file compiles its kernels, which the same worker then loads."""


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark every test with the folder it is in, and order them; `pyproject.toml` lists what each folder costs.

    On Windows tests that need POSIX are skipped.

    Workers begin with equal parts of the tests, and take from each other's last ones when they have done their own. The
    first begins by compiling what is inertial, the second what is not, and both and the others go on with tests that
    need nothing else; a file's tests stay together, and short ones come last, so that no worker compiles what another
    does, or waits for it at the end.
    """
    files = dict[Path, list[pytest.Item]]()
    for item in items:
        if FOLDER in item.path.parent.parents:  # examples of modules beside this file have no folder
            item.add_marker(item.path.relative_to(FOLDER).parts[0])
        if os.name == "nt" and item.get_closest_marker("posix"):
            item.add_marker(pytest.mark.skip(reason="needs POSIX"))
        files.setdefault(BROWSER if BROWSER in item.path.parents else item.path, []).append(item)
    inertial, others = (
        [files.pop(FOLDER / name) for name in names if FOLDER / name in files] for names in (INERTIAL, NOT_INERTIAL)
    )
    rest = [files[path] for path in sorted(files, key=_rank)]
    parts: list[list[pytest.Item]] = [[] for _ in range(getattr(config, "workerinput", {}).get("workercount", 1))]
    compiler, idle = parts[:1], parts[1:] or parts
    for groups, takers in ((inertial, compiler), (others, idle), (rest, parts)):
        for number, group in enumerate(groups):
            takers[number % len(takers)].extend(group)
    items[:] = _level(parts)


class _ExamplesAlone:
    """Leaves modules without examples and tests out of the search for them, which imports a module and its objects.

    One of them takes the signals of POSIX from the process that imports it. A hook of this file itself would not be
    asked about files outside this folder.
    """

    def pytest_ignore_collect(self, collection_path: Path) -> bool | None:
        """Ignore such a module; what tests call imports it all the same."""
        if collection_path.suffix != ".py" or collection_path.name.startswith(("test_", "conftest")):
            return None
        return True if ">>>" not in collection_path.read_text(encoding="utf-8") else None


def pytest_configure(config: pytest.Config) -> None:
    """Search modules of the package for examples only if they have any."""
    config.pluginmanager.register(_ExamplesAlone())
    config.pluginmanager.register(examples)


def pytest_collection(session: pytest.Session) -> None:
    """Import a share of all test files first, so that each is compiled by one worker and loaded by the others.

    pytest rewrites assertions, which takes as long as the rest of the collection. A file that cannot be imported is
    reported when it is collected.
    """
    config = session.config
    given = getattr(config, "workerinput", None)
    if given and config.args == config.getini("testpaths"):
        number, count = int(given["workerid"].removeprefix("gw")), given["workercount"]
        for path in sorted(FOLDER.rglob("test_*.py"))[number::count]:
            with suppress(Exception):
                import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))


def pytest_collection_finish() -> None:
    """Leave what all tests need, a million objects, out of every later collection of garbage."""
    gc.collect()
    gc.freeze()


def _rank(path: Path) -> int:
    """Return the place of a file's folder, or of a folder, among all."""
    folder = path.relative_to(FOLDER).parts[0] if FOLDER in path.parents else ""
    return LONG_FIRST.index(folder) if folder in LONG_FIRST else len(LONG_FIRST)


def _level(parts: list[list[pytest.Item]]) -> list[pytest.Item]:
    """Join parts whose last tests have been moved so that all have the sizes into which xdist divides them."""
    left, sizes = sum(map(len, parts)), list[int]()
    for number in range(len(parts)):
        sizes.append(left // (len(parts) - number))
        left -= sizes[-1]
    surplus = [item for part, size in zip(parts, sizes, strict=True) for item in part[size:]]
    levelled: list[pytest.Item] = []
    for part, size in zip(parts, sizes, strict=True):
        lacking = size - len(part[:size])
        levelled += part[:size] + surplus[:lacking]
        del surplus[:lacking]
    return levelled


settings.register_profile("suite", derandomize=True, deadline=None)
settings.load_profile("suite")

ROOT = Path(__file__).parent.parent
TRAJECTORIES = tuple(TABLE_I)
SIZES = np.array([source.nominal for source in SOURCES])
"""A usual size of every error of a reentry."""


class RecordedProgress:
    """Progress that records phases, ready samples, and those of them that were stored already."""

    def __init__(self) -> None:
        self.phases: list[tuple[Phase, int | None, str]] = []
        self.samples = self.stored = 0

    def phase(self, phase: Phase, samples: int | None = None, note: str = "") -> None:
        self.phases.append((phase, samples, note))

    def advance(self, samples: int, stored: bool = False) -> None:
        self.samples += samples
        self.stored += samples if stored else 0


@lru_cache
def reentry(trajectory: int, **options: Any) -> Reentry:
    """Return the scenario of a trajectory of Table I."""
    row = TABLE_I[trajectory]
    return Reentry(Flight(start_state(trajectory), Vehicle(row.lift_law), row.final_altitude, **options))


@lru_cache
def response(scenario: Reentry) -> Response:
    """Compute the linear response from the start of navigation."""
    navigation = scenario.navigation
    return linear_response(navigation.trajectory, navigation.start, navigation.theta_axes)


def tn_errors(multiple: float = 1.0) -> dict[str, Any]:
    """Return ``[errors]`` at a multiple of those of NASA TN D-1772."""
    return {
        SOURCES[
            error
        ].name: f"{float(size * multiple)!r} {unit if (unit := SOURCES[error].unit) != '1' else ''}".strip()
        for error, size in ERROR_SIZES.items()
    }


TWO_ERRORS = {"altitude_rate": "2 m/s", "gyro_drift": "0.05 deg/h"}
"""Errors for campaigns of the reference engine whose subject is the run: those of the TN take 270 flights, 4 s, more.

The flights of the corrections to the linear model grow with the square of the number of errors.
"""


def content(trajectory: int = 4, multiple: float = 1.0, **entries: Any) -> dict[str, Any]:
    """Return the content of a campaign file."""
    return {
        "samples": 500,
        "seed": 1772,
        "scenario": {"type": "reentry", "trajectory": trajectory},
        "errors": tn_errors(multiple),
    } | entries


def campaign(trajectory: int = 4, multiple: float = 1.0, **entries: Any) -> Campaign:
    """Return a campaign at a multiple of the errors of NASA TN D-1772."""
    return parse_campaign(content(trajectory, multiple, **entries), "test.toml", "test")


@pytest.fixture(scope="session", autouse=True)
def one_thread_each() -> Iterator[None]:
    """Leave linear algebra one thread: its matrices are small here, and there are other workers than this one."""
    with one_thread():
        yield


@pytest.fixture(scope="session", autouse=True)
def kept_apart(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Keep results of these tests apart from those of whoever runs them; all workers share what they have kept."""
    os.environ["MCNAV_CACHE_DIR"] = str(_shared(tmp_path_factory) / "cache")


@pytest.fixture(scope="session", autouse=True)
def compiled_once(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Let one worker compile what several need at the same time."""
    share_compilation(_shared(tmp_path_factory) / "compiling")


@pytest.fixture(scope="session", autouse=True)
def no_wait_for_disks() -> Iterator[None]:
    """Leave what this process writes to the system, which puts it on the disk later: a run waits for ten of its files.

    No test takes the power away. Those that need a disk that fills, or a process that ends then, have their own.
    """
    with patch("os.fsync", lambda _: None):
        yield


@pytest.fixture(scope="session", autouse=True)
def forked_workers() -> None:
    """Fork the workers of runs in this process."""
    if hasattr(os, "fork"):
        worker_server.use_server()


def _shared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder that all workers have."""
    folder = tmp_path_factory.getbasetemp()
    return folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder


def _once(tmp_path_factory: pytest.TempPathFactory, name: str, make: Callable[[Path], None]) -> Path:
    """Return a folder that the first of all workers makes, and the others wait for."""
    shared = _shared(tmp_path_factory)
    with FileLock(shared / f"{name}.lock"):
        if not (shared / name).exists():
            make(shared / f"{name}.part")
            (shared / f"{name}.part").rename(shared / name)
    return shared / name


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the documentation as a site, once for all workers; any warning of Sphinx fails it."""

    def build(folder: Path) -> None:
        finished = run_to_end([sys.executable, ROOT / ".github" / "site" / "build.py", folder], cwd=ROOT)
        assert finished.returncode == 0, finished.stderr

    return _once(tmp_path_factory, "site", build)


@pytest.fixture(scope="session")
def reproduction(tmp_path_factory: pytest.TempPathFactory) -> Reproduction:
    """Reproduce NASA TN D-1772, once for all workers."""
    return reproduced(_once(tmp_path_factory, "reproduction", reproduce))


@pytest.fixture(params=TRAJECTORIES, ids=lambda number: f"trajectory {number}")
def scenario(request: pytest.FixtureRequest) -> Reentry:
    """Return each trajectory of Table I in turn."""
    return reentry(request.param)


@pytest.fixture
def draws() -> Callable[[int, float], np.ndarray]:
    """Return a function that draws normal errors at a multiple of the TN's ten sigmas, shape (count, sources)."""

    def draw(count: int, multiple: float = 1.0) -> np.ndarray:
        return among_all(np.random.default_rng(1963).standard_normal((count, len(ERRORS))) * ERRORS * multiple)

    return draw


@pytest.fixture
def all_draws(draws: Callable[[int, float], np.ndarray]) -> Callable[[int, float], np.ndarray]:
    """The same with normal draws of every other source."""

    def draw(count: int, multiple: float = 1.0) -> np.ndarray:
        others = np.random.default_rng(1966).standard_normal((count, len(SIZES))) * SIZES * multiple
        others[:, COLUMNS] = 0.0
        return np.asarray(draws(count, multiple) + others)

    return draw
