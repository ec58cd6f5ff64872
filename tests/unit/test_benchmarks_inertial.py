"""The benchmarks' chapter on inertial navigation: its peers fly what mcnav flies, and it says what was found."""

from __future__ import annotations

import json
import math
import platform
import time
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

import tests.stored_pyins  # noqa: F401
from mcnav.arrays.types import Array
from mcnav.systems.ins.scenario import Ins
from tests.benchmarks import machine, readme
from tests.benchmarks.inertial import bounds, compare, engines, growth
from tests.benchmarks.inertial.build import case_of, own_sigma, reference_of
from tests.benchmarks.inertial.case import READING, Case, load
from tests.benchmarks.inertial.compare import Child, Effort
from tests.benchmarks.inertial.flight import FREE, PEERS, Setup, draws, read
from tests.benchmarks.inertial.peers import LOOP, OWN, PYINS, SHARED
from tests.benchmarks.inertial.peers import PEERS as EVERY
from tests.benchmarks.inertial.pool import shared
from tests.benchmarks.inertial.tables import chapter, sentence, targets_table
from tests.benchmarks.inertial.targets import Target, fastest_accurate, targets
from tests.benchmarks.tables import markdown
from tests.conftest import ROOT
from tests.unit.test_benchmarks import record as record_of_reentries

SHORT = replace(PEERS, end=PEERS.start + 30.0)
EPOCH = 10.0
SAMPLES = 2
FOLDER = TemporaryDirectory()
"""Of the campaign, which mcnav's own peers read; removed at exit."""


@lru_cache
def case() -> Case:
    """Half a minute of the flight that is measured, with few reference samples."""
    reference = reference_of(Path(FOLDER.name), SAMPLES, SHORT, EPOCH)
    return case_of(reference, own_sigma(reference))


def apart(name: str, samples: int = SAMPLES) -> float:
    """Measure a peer's largest error as the benchmark does."""
    entry = EVERY[name]
    peer = entry.load()
    with shared(peer, peer.prepare(case(), entry.setting, 1), 1) as simulate:
        quiet, found = (simulate(each, 0) for each in (case().quiet, case().compared[:samples]))
    errors = found - quiet if peer.errors else case().errors(found, quiet[0])
    assert errors.shape[1] >= 2
    return case().apart(errors)[0]


@pytest.mark.parametrize(
    ("name", "tolerance"), [(OWN, 1e-4), (f"{LOOP}, 0.1 s", 1e-4), (LOOP, 1e-3), ("filterpy + joblib", 1e-3)]
)
def test_peers_fly_what_the_reference_flies(name: str, tolerance: float) -> None:
    """The same noise in all: what is left is of the filters' steps.

    Gains differ by the step over the time in which a filter settles, squared: over tens of seconds a step of 1 s leaves
    1e-3 of sigma and one of 0.1 s a hundredth of it. The ensemble agrees with the reference to 1e-4
    (`tests.cross.test_ins_aided_reference`).
    """
    assert apart(name) < tolerance


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:The copy keyword is deprecated")  # pyins' use of pandas
def test_pyins_flies_what_the_reference_flies() -> None:
    """Its attitudes err by 1e-4 of what they multiply, and its covariance has steps of 1 s."""
    assert apart(PYINS, 1) < 1e-2


def test_a_spoiled_peer_is_found_out() -> None:
    spoiled = case().reference.copy()
    spoiled[1, 2, 4] += 0.5 * case().sigma[2, 4]
    assert case().apart(spoiled)[0] == pytest.approx(0.5)
    assert case().apart(np.full_like(spoiled, np.nan)) == (np.inf, np.inf)


def test_what_is_drawn_by_peers_has_the_filters_sigma() -> None:
    """Errors at the end over the filter's sigma are normal: the mean square of n has a deviation of sqrt(2 / n)."""
    peer, count = EVERY[LOOP].load(), 64
    simulate = peer.prepare(case(), 1.0, 1)
    states = simulate(case().drawn(count), 7)
    errors = case().errors(states, simulate(case().quiet, 0)[0])[:, -1] / case().sigma[-1]
    assert not np.array_equal(states, simulate(case().drawn(count), 8))
    # outputs are correlated: each of the nine by itself, with five of its deviations
    assert np.abs(np.mean(errors**2, axis=0) - 1.0).max() < 5.0 * np.sqrt(2.0 / count)


def test_a_case_survives_its_file_and_is_shortened(tmp_path: Path) -> None:
    case().save(tmp_path / "case.npz")
    again = load(tmp_path / "case.npz")
    assert (again.campaign, again.start, again.seconds) == (case().campaign, SHORT.start, 30.0)
    assert np.array_equal(again.reference, case().reference)
    short = again.shortened(10.0)
    assert (short.seconds, len(short.updates), len(short.epochs)) == (10.0, 10, 1)
    assert np.array_equal(short.reference, case().reference[:, :1])
    assert np.all(short.updates * READING == np.arange(1.0, 11.0))


@pytest.mark.parametrize(
    "setup", [FREE, Setup(), *(replace(SHORT, states=states, interval=0.5, grade="tactical") for states in (9, 15, 21))]
)
def test_campaigns_are_what_they_say(setup: Setup, tmp_path: Path) -> None:
    campaign = read(tmp_path, setup)
    scenario = campaign.scenario
    assert isinstance(scenario, Ins)
    navigation = scenario.navigation
    assert (navigation.start, navigation.end) == (setup.start, setup.end)
    varied = draws(campaign, 3).any(axis=0).sum()
    if navigation.filter is None:
        # initial errors; biases, scale factors and six misalignments of gyros and accelerometers
        assert (setup.states, varied) == (0, 9 + 2 * (3 + 3 + 6))
    else:
        assert 9 + len(navigation.filter.states) == setup.states == varied
        assert np.allclose(np.diff(navigation.sensors[0].times), setup.interval)


def test_operations_are_those_of_the_structure() -> None:
    """Multiplications and additions of the entries that are neither zero nor those of an identity."""
    pattern = np.ones((9, 15), dtype=bool)
    pattern[:3] = False
    pattern[:3, 9:12] = True
    multiplied = int(pattern.sum()) * 15 + 9 * 10 // 2 * 15
    assert bounds.filter_operations(15, 6) == {"step": 2 * multiplied, "update": 2 * 6 * (15 * 16 // 2 + 2 * 15)}
    assert bounds.filter_operations(9, 1)["step"] < bounds.filter_operations(15, 1)["step"]


class Pretended:
    """What children would answer: one missing, one that fails when it is timed, one that flies a part."""

    def __init__(self, folder: Path, name: str, path: Path, cores: int) -> None:
        self.name, self.cores, self.rounds = name, cores, 0

    def answer(self) -> dict[str, Any]:
        if self.name == "gnss-ins-sim":
            return {"missing": "ModuleNotFoundError: No module named 'gnss_ins_sim'"}
        return {"start_up": 1.5}

    def ask(self, do: str, **request: Any) -> dict[str, Any]:
        if do == "accuracy":
            return {"compared": 2, "error": 2e-5, "root_mean_square": 4e-6}
        if do == "count":
            return {"samples": 2, "share": 0.2 if self.name.endswith("default") else 1.0}
        if self.name == "JAX vmap":
            return {"failed": "ended with status -11: no message"}
        self.rounds += 1
        seconds = 6.0 if self.name.startswith(PYINS) else 1e-3
        return {"wall": seconds * self.rounds, "processor": seconds * self.rounds}

    def megabytes(self) -> float:
        return 100.0

    def close(self) -> None:
        pass


@lru_cache
def peer_rows() -> tuple[dict[str, Any], ...]:
    """Rows of children that did not run."""
    notes = {"gnss-ins-sim": "the registry does not have it"}
    effort = Effort(0.1, 4)
    return tuple(compare.measure(list(EVERY), Path(), Path(), effort, notes, lambda line: None, Pretended))


def test_times_are_those_of_the_whole_flight_and_of_one_sample() -> None:
    rows = {row["peer"]: row for row in peer_rows()}
    assert rows[OWN]["processor_milliseconds"] == {"least": 0.5, "median": 1.25, "largest": 2.0}
    assert rows[PYINS]["runs"] == 3  # slow ones fewer
    assert rows[PYINS]["processor_milliseconds"]["least"] == pytest.approx(3e3)
    assert rows[f"{PYINS}, default"]["processor_milliseconds"]["least"] == pytest.approx(15e3)
    assert "two_cores" in rows[PYINS]
    assert "two_cores" not in rows[f"{PYINS}, default"]
    assert rows["gnss-ins-sim"]["missing"] == "the registry does not have it"
    assert rows["JAX vmap"]["failed"].endswith("no message")


def engine_rows() -> list[dict[str, Any]]:
    """Engines, of the free ones one that is too rough."""
    works = [
        ("free, without noise", 60, 1e-3, 300_000.0), ("free, without noise", 240, 1e-6, 250_000.0),
        ("free, with noise", 240, 1e-6, 40_000.0), ("aided, own gains", 3600, 1e-5, 1_500.0),
        ("aided, shared gains", 3600, 1e-3, 9_000.0),
    ]  # fmt: skip
    same = {"accuracy": "", "root_mean_square": 1e-7, "compared": 4, "samples": 64}
    return [
        {
            "name": name, "steps": steps, "error": error, **same,
            "processor_microseconds": compare.spread([2e6 / speed]), "two_threads_per_second": compare.spread([speed]),
            "speed_up": compare.spread([1.9]),
        }
        for name, steps, error, speed in works
    ]  # fmt: skip


def record() -> dict[str, Any]:
    """A record of measurements that were not made."""
    run = {"seconds": compare.spread([4.0]), "processor_seconds": compare.spread([6.0]), "megabytes": 300.0, "runs": 1}
    bound = {
        "name": "aided, own gains", "microseconds": 1_000.0, "steps": 3600, "normals": 54_000, "normals_share": 0.5,
        "operations": 22_000_000, "operations_share": 0.25, "bytes": 1e6, "memory_share": 0.1,
        "normal_nanoseconds": 10.0, "peak_operations_per_second": 1e11, "peak_bytes_per_second": 1e10,
    }  # fmt: skip
    return {
        "format": 1,
        "machine": machine.described(["numpy", "jax"]),
        "case": {"seconds": 600.0, "updates": 600, "epochs": 10},
        "peers": list(peer_rows()),
        "engines": engine_rows(),
        "hour": 3600.0,
        "bounds": [bound],
        "growth": [
            {"varied": "states", "seconds": 600.0, "interval": 1.0, "states": 9, "engine": name, "microseconds": 300.0}
            for name in ("aided, own gains", "aided, shared gains")
        ],
        "commands": [
            {"command": "run", "samples": 1_000, "jobs": 2, "engine": "ensemble", **run},
            {"command": "lincov", "samples": None, "jobs": 1, "engine": None, **run},
        ],
        "truth": {"rows": 360_001.0, "read": 0.3, "tables": 0.4, "engine": 2.0, "aided_tables": 1.5},
    }


def test_targets_hold_where_the_measurement_says_so() -> None:
    found = {each.name: each for each in targets(record())}
    free = next(each for name, each in found.items() if name.startswith("an hour, free, without noise at"))
    assert (free.measured, free.holds) == (250_000.0, True)  # the faster one is too rough
    assert fastest_accurate(engine_rows()[:1], "free, without noise") is None
    assert found["mcnav run of 1,000 aided samples of an hour"].holds
    assert not found["mcnav lincov of the same campaign"].holds
    assert found["tables of an hour at 100 rows a second, free"].holds
    assert not found["tables of an hour at 100 rows a second, aided"].holds
    assert found[f"ten minutes, own gains, against {PYINS}"].measured == pytest.approx(6_000.0)
    assert not found[f"ten minutes, own gains, against {LOOP}"].holds
    assert not Target("nothing", 1.0, math.nan, "s").holds
    assert not Target("nothing", 1.0, math.nan, "s", at_least=False).holds
    table = targets_table([Target("this", 2.0, 1.0, "s", at_least=False), Target("that", 2.0, math.nan, "×")])
    assert table.splitlines()[2:] == ["| this | ≤ 2 s | 1 s | yes |", "| that | ≥ 2 × | not measured | no |"]


def test_the_chapter_shows_all_that_was_measured() -> None:
    page = "\n\n".join(chapter(record()))
    rows = {line.split("|")[1].strip(): line for line in page.splitlines() if line.startswith("|")}
    assert set(EVERY) < set(rows)
    assert "not installed: the registry does not have it" in rows["gnss-ins-sim"]
    assert "failed: ended with status -11" in rows["JAX vmap"]
    assert "(× 5)" in rows[f"{PYINS}, default"]
    assert "2e-05 (2 samples)" in rows[SHARED]
    assert "50%" in rows["aided, own gains"]
    assert "360,001 rows" in page
    whole = markdown(record_of_reentries(), record())
    assert page in whole
    assert "jax" in whole.splitlines()[-1]
    assert "jax" not in markdown(record_of_reentries()).splitlines()[-1]


def test_the_chapter_is_shown_without_whole_runs() -> None:
    page = "\n\n".join(chapter(record() | {"growth": [], "commands": [], "truth": {}}))
    assert "Whole runs" not in page
    assert "| mcnav lincov of the same campaign | ≤ 2 s | not measured | no |" in page


def test_the_record_is_json_and_names_no_machine() -> None:
    text = json.dumps(record(), allow_nan=False)
    assert f'"{platform.node()}"' not in text
    assert str(ROOT) not in text
    assert str(Path.home()) not in text


def test_the_readme_has_a_sentence_of_the_chapter() -> None:
    told = readme.excerpt(record_of_reentries(), record()).replace("\n", " ")
    assert "10 minutes with GNSS once a second" in told
    assert "0.5 ms a sample (a compiled loop 0.5 ms, python-ins 3 s)" in told
    assert sentence(record()) in told
    assert sentence(record() | {"peers": []}) == ""


def test_engines_are_timed_on_one_thread_and_on_two() -> None:
    def simulate(number: int, rows: Array) -> None:
        time.sleep(1e-3 * len(rows))

    work = engines.Work("sleeping", simulate, 4, np.zeros((16, 1)), "", 60, 1e-6, 1e-7, 2)
    (row,) = engines.measure([work], 1e-3, 3)
    assert row["samples"] >= 8
    # sleeping takes no processor, and on two threads half the time; other processes may only lengthen it
    assert row["wall_microseconds"]["least"] >= 1e3
    assert row["two_threads_per_second"]["largest"] <= 2e3
    assert row["processor_microseconds"]["least"] < 0.5 * row["wall_microseconds"]["least"]


def test_growth_varies_one_thing_at_a_time() -> None:
    every = growth.setups(Setup())
    assert [setup.end - setup.start for varied, setup in every if varied == "duration"] == [600.0, 1800.0, 3600.0]
    assert {setup.states for varied, setup in every if varied == "states"} == {9, 21}
    assert all(setup.interval == 1.0 for varied, setup in every if varied != "interval")


@pytest.mark.slow
def test_a_child_answers_and_is_ended(tmp_path: Path) -> None:
    case().save(tmp_path / "case.npz")
    child = Child(tmp_path, LOOP, tmp_path / "case.npz", 1)
    try:
        assert child.answer()["start_up"] > 0.0
        assert child.ask(do="accuracy")["error"] < 1e-3
        count = child.ask(do="count", seconds=0.01)
        assert count["share"] == 1.0
        assert child.ask(do="time", samples=count["samples"], round_number=0)["processor"] > 0.0
        assert child.megabytes() > 10.0
    finally:
        child.close()
    assert child.process.returncode == 0
    assert child.megabytes() == 0.0
