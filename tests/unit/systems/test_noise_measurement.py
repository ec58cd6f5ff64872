"""Covariance of a class's noise: how well probes measure it, and for which class a kept measurement is read on."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import platformdirs
import pytest

from mcnav.entries.inputs import SourceFile
from mcnav.systems.user import code, kept
from mcnav.systems.user.code import UserScenarioSpec
from mcnav.systems.user.measured_noise import INDEPENDENT, probe_count
from mcnav.systems.user.noise_measurement import Probes
from mcnav.systems.user.stochastic_scenario import StochasticUserScenario, user_scenario

WALK = """
import os
import numpy as np
from mcnav import Output, Source

class Mine:
    sources = (Source("a", "m", "m", 1.0),)
    outputs = (Output("b", "m", "m"), Output("c", "m", "m"))
    settings = {"size": "m"}

    def __init__(self, size=0.5):
        self.size, self.flown = size, 0
        OPENED

    def fly(self, errors, noise):
        self.flown += 1
        steps = self.size * noise.standard_normal(8) * float(os.environ.get("OF_THE_TEST", "1"))
        return errors[0] + np.array([steps.sum(), steps @ np.arange(8.0)])
"""
"""A walk of eight steps of 0.5 m, and its first moment."""

COVARIANCE = 0.25 * np.array([[8.0, 28.0], [28.0, 140.0]])

READ = 3
"""Simulations when a measurement is read on: without noise, and the first probe up and down."""


@pytest.fixture(autouse=True)
def _kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MCNAV_CACHE_DIR", str(tmp_path / "kept"))
    monkeypatch.setattr(kept, "KEPT_FROM", 0.0)


def _opened(opened: str = "", size: float = 0.5) -> StochasticUserScenario:
    """Return the scenario as a new process has it."""
    code._classes.clear()
    code._objects.clear()
    sys.modules.pop("beside_it", None)
    text = WALK.replace("OPENED", opened)
    scenario = user_scenario(UserScenarioSpec(SourceFile("mine.py", text), "Mine", (("size", size),)))
    assert isinstance(scenario, StochasticUserScenario)
    return scenario


def _measured(scenario: StochasticUserScenario) -> tuple[bytes, int]:
    """Return the bits of the covariance, and how many simulations it took."""
    covariance = scenario.measured_noise.covariance
    return covariance.tobytes(), scenario._instance.flown


def test_probes_measure_as_well_as_more_samples_of_noise() -> None:
    """Errors of 200 variances with a random share of each variate, and of single variates, against the bound."""
    scenario = _opened()
    for variates in (1, 8, 500):
        probes = Probes(scenario._engine, 1, variates, np.zeros((1, 2)))
        every = np.array([probes.deviations(number) for number in range(variates)])
        np.testing.assert_allclose(every @ every.T, variates * np.eye(variates), atol=1e-9 * variates)
    variates, count = 1_200, probe_count(1_200)
    probes = Probes(scenario._engine, 1, variates, np.zeros((1, 2)))
    some = np.array([probes.deviations(number) for number in range(count)])
    bound = np.sqrt(2.0 * (variates - count) / (count * (variates - 1)))
    assert bound <= np.sqrt(2.0 / INDEPENDENT)
    shares = np.random.default_rng(5).standard_normal((200, variates))
    errors = np.mean((some @ shares.T) ** 2, axis=0) / np.sum(shares**2, axis=1) - 1.0
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(bound, rel=5.0 / np.sqrt(400.0))
    assert np.sqrt(np.mean((np.mean(some**2, axis=0) - 1.0) ** 2)) < bound  # each variate alone


def test_a_measurement_is_read_on_with_the_same_bits() -> None:
    first = _opened()
    np.testing.assert_allclose(first.measured_noise.covariance[0], COVARIANCE, rtol=1e-12)
    bits, simulations = _measured(first)
    assert simulations == 1 + 2 * 8
    assert first.with_sigmas(np.array([3.0])).measured_noise is first.measured_noise  # another campaign of the process
    assert _measured(_opened()) == (bits, READ)


def _another_file(folder: Path) -> None:
    (folder / "read.txt").write_text("b")


def _another_module(folder: Path) -> None:
    (folder / "beside_it.py").write_text("SIZE = 2")


CHANGES: dict[str, Callable[[Path], object]] = {
    "a file that it opens": _another_file,
    "a module beside it": _another_module,
    "the environment": lambda folder: os.environ.update({"OF_THE_TEST": "2"}),
}


@pytest.mark.parametrize("change", CHANGES)
def test_what_has_changed_is_measured_anew(
    change: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Text and settings are part of the name; what cannot be seen changes the first probe."""
    _another_module(tmp_path)
    _another_file(tmp_path)
    (tmp_path / "read.txt").write_text("a")
    (tmp_path / "beside_it.py").write_text("SIZE = 1")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("OF_THE_TEST", "1")
    opened = f"open({str(tmp_path / 'read.txt')!r}).close(); import beside_it"
    _measured(_opened(opened))
    assert _measured(_opened(opened))[1] == READ
    assert _measured(_opened(opened, 0.6))[1] > READ
    assert _measured(_opened(f"{opened}; pass"))[1] > READ
    CHANGES[change](tmp_path)
    assert _measured(_opened(opened))[1] > READ
    told = capsys.readouterr().err
    assert ("no longer simulates what it did when the covariance" in told) == (change == "the environment")
    assert _measured(_opened(opened))[1] == READ


def test_a_damaged_file_is_measured_anew_and_told(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    bits, _ = _measured(_opened())
    (file,) = (tmp_path / "kept" / "noise").iterdir()
    stored = file.read_bytes()
    for damaged in (stored[:-1], stored[:200] + b"x" + stored[201:], b""):
        file.write_bytes(damaged)
        assert _measured(_opened()) == (bits, 1 + 2 * 8)
        (line,) = capsys.readouterr().err.splitlines()
        assert line == f"note: {file} is damaged; the covariance of the noise is measured anew"
        assert file.read_bytes() == stored


def test_without_a_folder_it_is_measured_and_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A long measurement is told beforehand, with where it is kept, or why it is not."""
    monkeypatch.setattr(kept, "TOLD_FROM", 0.0)
    bits, _ = _measured(_opened())
    told = "note: measuring the covariance of the noise: about 0 s on this machine, "
    assert capsys.readouterr().err == f"{told}kept for the next commands\n"
    (tmp_path / "file").touch()
    monkeypatch.setenv("MCNAV_CACHE_DIR", str(tmp_path / "file" / "kept"))
    assert _measured(_opened()) == (bits, 1 + 2 * 8)
    where = tmp_path / "file" / "kept" / "noise"
    assert (
        capsys.readouterr().err == f"{told}not kept: {where} is not writable; set MCNAV_CACHE_DIR to a folder that is\n"
    )
    monkeypatch.delenv("MCNAV_CACHE_DIR")
    monkeypatch.setattr(
        platformdirs, "user_cache_path", lambda *_, **__: Path("~/.cache/mcnav")
    )  # of a user without a home
    assert _measured(_opened()) == (bits, 1 + 2 * 8)
    assert "not kept: there is no home folder; set MCNAV_CACHE_DIR" in capsys.readouterr().err
