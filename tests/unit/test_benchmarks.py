"""The benchmarks' own parts: what they compare is the same flight, and what they say is what was found."""

from __future__ import annotations

import json
import platform
import re
from collections import Counter
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcnav.systems.reentry.ensemble.grid import shared_grid
from mcnav.systems.reentry.instruments import Error
from mcnav.systems.reentry.navigator import joint_rates as rates_of_mcnav
from tests.benchmarks import growth, install, machine, readme, stages, waits
from tests.benchmarks.build import case_of, disagreement, scenario_of
from tests.benchmarks.case import ERROR_UNITS, LENGTH, SPEED, TIME, Case, load
from tests.benchmarks.compare import cheapest, measure, reason
from tests.benchmarks.equations import joint_rates
from tests.benchmarks.figure import work_precision
from tests.benchmarks.inertial.peers import PEERS as INERTIAL_PEERS
from tests.benchmarks.operations import Counted, of_sample
from tests.benchmarks.peers import PEERS
from tests.benchmarks.pool import shared
from tests.benchmarks.spawn import run
from tests.benchmarks.tables import markdown
from tests.benchmarks.timing import enough, fastest
from tests.conftest import ROOT, response

DRAWS = 3
TRAJECTORY = 4
UNITS = np.array([LENGTH, 1.0, SPEED, 1.0 / TIME])


@lru_cache
def case() -> Case:
    """One of the trajectories that are measured, with few draws."""
    return case_of(TRAJECTORY, DRAWS)


def test_rates_are_those_of_the_reference() -> None:
    scenario = scenario_of(TRAJECTORY)
    draw = case().draws(DRAWS)[2]
    for stretch, phase in enumerate(scenario.trajectory.phases):
        actual, indicated = case().truths[stretch], case().truths[stretch] + [1e-3, 2e-3, -1e-3, 3e-3]
        time = case().begins[stretch]
        errors = draw / ERROR_UNITS
        ours = joint_rates(np)(time, actual, indicated, case().phases[stretch], errors[4:])
        state = np.concatenate([actual * UNITS, indicated * UNITS])
        every = np.zeros((1, len(Error)))  # the benchmarks have the ten sources of the report
        every[0, : len(draw)] = draw
        theirs = rates_of_mcnav(time * TIME, state, phase.coefficients, 1.0, every, 0.0, 0.0)
        np.testing.assert_allclose(np.concatenate(ours) * np.tile(UNITS, 2) / TIME, theirs, rtol=1e-11)


@pytest.mark.parametrize(
    ("name", "setting", "tolerance"),
    [("mcnav", 96, 2e-7), ("scipy + joblib", 1e-10, 1e-7), ("numpy DOP853", 1e-9, 1e-6), ("numpy RK4", 16, 1e-5)],
)
def test_peers_fly_what_mcnav_flies(name: str, setting: float, tolerance: float) -> None:
    peer = PEERS[name].load()
    with shared(peer, peer.prepare(case(), setting, 1), 1) as fly:
        assert case().error(fly(case().draws(DRAWS))) < tolerance


def test_a_case_survives_its_file(tmp_path: Path) -> None:
    case().save(tmp_path / "case.npz")
    again = load(tmp_path / "case.npz")
    assert again.number == TRAJECTORY
    assert np.array_equal(again.reference, case().reference)
    assert np.array_equal(again.draws(DRAWS + 2)[:DRAWS], case().draws(DRAWS))


def test_what_is_not_finite_is_infinitely_wrong() -> None:
    assert case().error(np.full((DRAWS, 4), np.nan)) == np.inf
    assert disagreement(case()) < 1e-6


def test_a_spoiled_peer_is_found_out() -> None:
    spoiled = case().reference.copy()
    spoiled[1, 2] += 0.5 * case().sigma[2]
    assert case().error(spoiled) == pytest.approx(0.5)


def test_cheapest_is_cheapest_of_the_accurate_ones() -> None:
    settings = [
        {"setting": 1, "error": 1e-3, "microseconds": 1.0},
        {"setting": 2, "error": 1e-6, "microseconds": 3.0},
        {"setting": 3, "error": 1e-8, "microseconds": 2.0},
        {"setting": 4, "failed": "of something"},
        {"setting": 5, "error": None, "microseconds": 0.1},
    ]
    assert cheapest(settings, 1e-5) == settings[2]
    assert cheapest(settings, 1e-9) is None


def child(folder: Path, name: str, path: Path, cores: int, seconds: float, settings: Any = ()) -> dict[str, Any]:
    """What children would answer: one peer missing, one broken, one that is never accurate."""
    if name == "numbalsoda":
        return {"missing": "ModuleNotFoundError: No module named 'numbalsoda'", "megabytes": 1.0}
    if name == "heyoka batch":
        return {"failed": "ended with status -11: no message"}
    error = 1e-4 if name == "numpy RK4" else 1e-7
    found = {"setting": 2.0, "error": error, "compared": 200, "samples": 9, "runs": 3, "microseconds": 4.0}
    return {"knob": "steps", "start_up": 0.5, "megabytes": 100.0, "settings": [found]}


def record() -> dict[str, Any]:
    """A record of children that did not run."""
    notes = {"numbalsoda>=0.3.4": "No Fortran compiler"}
    rows = [measure(name, Path(), Path(), 0.0, notes, child) | {"trajectory": TRAJECTORY} for name in PEERS]
    described = {"trajectory": TRAJECTORY, "minutes": 87.0, "stretches": 15, "compared": 200, "reference": "reference"}
    return {
        "machine": machine.described(["numpy", "numbalsoda"]),
        "cases": [described | {"disagreement": 1e-8}],
        "peers": rows,
        "kernel": [],
        "growth": {},
        "stages": [],
    }


def test_the_missing_are_named_with_their_reason() -> None:
    page = markdown(record())
    rows = {line.split("|")[1].strip(): line for line in page.splitlines() if line.startswith("|")}
    assert set(PEERS) < set(rows)
    assert "not installed: No Fortran compiler" in rows["numbalsoda"]
    assert "failed: ended with status -11" in rows["heyoka batch"]
    assert "not reached (best 1e-04)" in rows["numpy RK4"]
    assert "250,000" not in rows["numpy RK4"]
    assert "0.25 million" in rows["mcnav"]


def test_the_record_is_json_and_names_no_machine() -> None:
    text = json.dumps(record(), allow_nan=False)
    assert f'"{platform.node()}"' not in text
    assert str(ROOT) not in text
    assert str(Path.home()) not in text


def test_the_readme_is_renewed_between_its_marks() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    once = readme.renewed(text, record())
    told = once.replace("\n", " ")
    assert "a sample takes 4 µs of one core with an integration error below 1e-06 sigma." in told
    assert "The fastest other package (" in told
    assert f"]({readme.PAGE})" in once
    assert readme.renewed(once, record()) == once
    assert once.startswith(text[: text.index(readme.BEGIN)])
    assert once.endswith(text[text.index(readme.END) :])
    with pytest.raises(ValueError, match="lacks its marks"):
        readme.renewed("nothing", record())


def test_whole_runs_are_shown_beside_their_engines() -> None:
    row = {
        "campaign": "11_cruise",
        "samples": [20_000, 500_000],
        "load": 7.6,
        "microseconds": 9.0,
        "engine_microseconds": 4.0,
    }
    spent = {"seconds": {"least": 8.0}, "processor_seconds": {"least": 11.0}}
    longest = {"campaign": "11_cruise", "samples": 1_000_000, "jobs": 2, "load": 8.0, **spent}
    known = {"machine": machine.described(["numba"]) | {"date": "2026-11-26"}, "slopes": [row], "longest": longest}
    page = markdown(record(), None, known)
    assert "| 11_cruise | 20,000 to 500,000 | 9 | 4 | 2.25 × | 7.6 |" in page
    assert page.count("Measured on ") == 2  # each chapter says on what and when


def test_what_users_wait_for_is_in_imports(monkeypatch: pytest.MonkeyPatch) -> None:
    """A command whose files another makes is measured for its status, and shown beside what is wanted.

    In imports of a package that takes less time than those of the benchmark.
    """
    monkeypatch.setattr(waits, "IMPORTS", "import json")
    (wait,) = waits.measure(lambda _: None, [waits.Wait("`show`", 1.5, ("docs", "imu"), (("docs",),))])["waits"]
    assert wait["processor_seconds"] > 0.0
    with pytest.raises(RuntimeError, match=r"mcnav check nothing\.toml ended with status 2"):
        waits.measure(lambda _: None, [waits.Wait("", 1.0, ("check", "nothing.toml"))])
    known = {"machine": machine.described(["numba"]) | {"date": "2026-11-28"}, "waits": [wait]}
    shown = f"| {wait['processor_seconds'] / wait['imports_seconds']:.1f} | 1.5 |"
    assert shown in markdown(record(), None, None, known)


def test_the_figure_shows_every_peer() -> None:
    drawn = work_precision(record())
    assert drawn == work_precision(record())
    assert all(name in drawn for name in PEERS)
    assert "numbalsoda (missing)" in drawn


def test_reasons_are_those_of_the_installation() -> None:
    assert reason(PEERS["numbalsoda"], "ModuleNotFoundError", {}) == "ModuleNotFoundError"
    said = (
        "WARNING: Error\nCollecting\n  CMake Error at CMakeLists.txt:3 (project):\n    No compiler in /opt/bin.\n  more"
    )
    assert install.reason(said) == "CMake Error at CMakeLists.txt:3 (project): No compiler in …"
    assert install.reason("") == "pip gave no reason"
    every = {*PEERS.values(), *INERTIAL_PEERS.values()}
    assert {entry.package for entry in every} - {"mcnav", "numpy", "scipy", "numba", "filterpy"} == {
        re.split("[>=]", requirement)[0] for requirement in install.requirements()
    }


def test_operations_are_counted_where_they_are_done() -> None:
    counts: Counter[str] = Counter()
    x = Counted(2.0, counts)
    assert float(np.float64(1.0) + 3.0 * x * x - x / 4.0) == 12.5
    assert counts == {"simple": 4, "division": 1}
    scenario = scenario_of(TRAJECTORY)
    few, many = (of_sample(shared_grid(response(scenario), nodes)) for nodes in (24, 48))
    gravity = many["root"] - few["root"]
    assert gravity == 24  # a root for each node
    assert many["division"] - few["division"] == 24
    assert many["simple"] > 1.8 * few["simple"]


def test_times_are_the_fastest_and_long_enough() -> None:
    calls: list[int] = []
    assert fastest(lambda: calls.append(1), 0.0).runs == len(calls) == 3
    assert enough(lambda count: None, 10, 35, 1.0) == 35


def test_a_child_that_hangs_is_ended() -> None:
    status, megabytes, _, said = run(["sleep", "60"], longest=0.2)
    assert (status, said) == (-9, "")
    assert megabytes > 0.0


def test_stages_are_where_they_are_watched() -> None:
    assert growth.CAMPAIGN.exists()
    for places in stages.STAGES.values():
        for place in places:
            assert callable(getattr(*stages.holder_of(place)))
