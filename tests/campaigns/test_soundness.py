"""Scenarios with no linear model to compare with: refused before anything is simulated, or marked when forced."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

import mcnav
from mcnav.config.read import read_campaign
from mcnav.contract.samples import SimulationResult
from mcnav.errors import CampaignError
from mcnav.systems.finite_differences import differentiate
from mcnav.systems.user.soundness import LARGEST
from mcnav.workflow.analyse import report_run
from tests.commands import in_process
from tests.conftest import ROOT
from tests.runs import simulate

CODE = """
import itertools
import numpy as np
from mcnav import Output, Source

COUNT = itertools.count()


def rng(value):
    return np.random.default_rng(abs(int(value)))


class Mine:
    sources = (Source("a", "m", "m", 1.0), Source("noise_seed", "1", "1", 1.0))
    outputs = (Output("x", "m", "m"), Output("y", "m", "m"))
    PARTIALS

    def METHOD(self, errors):
        a, seed = errors.T
        BODY
"""
PLAIN = "return np.array([a, 2.0 * a]).T"
ALL = 'a = "1 m"\nnoise_seed = "1"'


def _written(folder: Path, body: str, method: str = "propagate", partials: str = "", errors: str = ALL) -> Path:
    given = f"def partials(self): return np.array({partials})" if partials else ""
    code = CODE.replace("BODY", body.replace("\n", "\n        ")).replace("METHOD", method).replace("PARTIALS", given)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "mine.py").write_text(code)
    path = folder / "mine.toml"
    path.write_text(f'samples = 300\nseed = 1\n[scenario]\ntype = "mine.py:Mine"\n[errors]\n{errors}\n')
    return path


SEEDED = "n = np.array([rng(s * 1e6).standard_normal() for s in seed])\nreturn np.array([a + n, 2.0 * a]).T"
SIGNED = SEEDED.replace("s * 1e6", "s * 1e6 + 1e9")
HASHED = (
    "n = np.array([rng(hash((float(p), float(s)))).standard_normal() for p, s in errors])\n"
    "return np.array([a + n, 2.0 * a]).T"
)
UNSETTLED = {
    "a seed that is a source": (SEEDED, "propagate", "", "x", "noise_seed"),
    "a seed of both signs": (SIGNED, "propagate", "", "x", "noise_seed"),
    "seeded by the errors": (HASHED, "propagate", "", "x", None),
    "a tenth of the dispersion": (SEEDED.replace("a + n", "a + 0.1 * n"), "propagate", "", "x", "noise_seed"),
    "with partials of its own": (SEEDED, "propagate", "[[1.0, 0.0], [2.0, 0.0]]", "x", "noise_seed"),
    "one by one": (
        "return np.array([a + rng(seed * 1e6).standard_normal(), 2.0 * a])", "fly", "", "x", "noise_seed",
    ),
    "one by one, partials of its own": (
        "return np.array([a + rng(seed * 1e6).standard_normal(), 2.0 * a])",
        "fly", "[[1.0, 0.0], [2.0, 0.0]]", "x", "noise_seed",
    ),
    "a jump at zero": ("return np.array([a + (a > 0.0), 2.0 * a]).T", "propagate", "", "x", "a"),
}  # fmt: skip


@pytest.mark.parametrize("case", UNSETTLED)
def test_unsettled_derivatives_are_refused_before_anything_is_simulated(case: str, tmp_path: Path) -> None:
    """One line: file, key, source, output, by how much, what to do."""
    body, method, partials, output, source = UNSETTLED[case]
    path = _written(tmp_path, body, method, partials)
    with pytest.raises(CampaignError) as refused:
        simulate(read_campaign(path), tmp_path / "run", None, 1)
    (line,) = str(refused.value).splitlines()
    assert line.startswith(f"{path}: scenario: the partial derivative of output {output!r} to source ")
    assert source is None or f"to source {source!r}" in line
    assert "% of the output's largest one-sigma contribution (limit 1 %)" in line
    assert line.endswith("or use --force")
    assert not list((tmp_path / "run").rglob("*.parquet"))
    assert not (tmp_path / "run" / "manifest.json").exists()


RANDOM = {
    "a generator without a seed": "return np.array([a + np.random.default_rng().normal(size=len(a)), a]).T",
    "numpy's global generator": "return np.array([a + np.random.standard_normal(len(a)), a]).T",
    "a count of calls": "return np.array([a * next(COUNT), a]).T",
    "tiny": "return np.array([a + 1e-12 * np.random.standard_normal(len(a)), a]).T",
}


@pytest.mark.parametrize("case", RANDOM)
@pytest.mark.parametrize("method", ["propagate", "fly"])
@pytest.mark.parametrize("force", [False, True])
def test_a_scenario_that_answers_identical_calls_differently_is_refused(
    case: str, method: str, force: bool, tmp_path: Path
) -> None:
    """Forced or not: nothing that is flown could be flown again."""
    body = RANDOM[case]
    if method == "fly":
        body = body.replace("size=len(a)", "").replace("len(a)", "").replace(".T", "")
    path = _written(tmp_path, body, method)
    with pytest.raises(CampaignError) as refused:
        simulate(read_campaign(path), tmp_path / "run", None, 1, force=force)
    (line,) = str(refused.value).splitlines()
    assert line.startswith(f"{path}: scenario.type: answers identical calls differently")
    assert not list((tmp_path / "run").rglob("*.parquet"))


def test_noise_drawn_for_a_whole_chunk_is_refused(tmp_path: Path) -> None:
    """The same bits in every call, but a sample depends on its place."""
    body = "return np.array([a + np.random.default_rng(0).standard_normal(len(a)), a]).T"
    with pytest.raises(CampaignError, match="with its place among others"):
        simulate(read_campaign(_written(tmp_path, body)), tmp_path / "run", None, 1)


PASSING = {
    "linear": (PLAIN, ""),
    "without any slope": ("return np.array([0.1 * a**2, 7.0 + 0.0 * a]).T", ""),
    "a slope of rounding": ("return np.array([1e6 * np.cos(a / 3.0), np.hypot(3.0 + a, 4.0) - 0.6 * a]).T", ""),
    "a quadratic with an integrator's noise": ("return np.array([a**2 + 1e-7 * np.sin(1e9 * a), a]).T", ""),
    "a kink": ("return np.array([np.abs(a), a]).T", ""),
    "a jump elsewhere": ("return np.array([a + (a > 0.5), a]).T", ""),
    "strongly bent": ("return np.array([a + a**2 + a**3, np.exp(a)]).T", ""),
    "partials of its own": ("return np.array([a + a**2 + a**3, np.exp(a)]).T", "[[1.0, 0.0], [1.0, 0.0]]"),
    "an integrator's noise": ("return np.array([a + 1e-6 * np.sin(1e9 * a), 2.0 * a]).T", ""),
    "the same with partials": (
        "return np.array([a + 1e-4 * np.sin(1e9 * a), 2.0 * a]).T", "[[1.0, 0.0], [2.0, 0.0]]",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", PASSING)
def test_what_is_not_linear_but_no_noise_is_flown(case: str, tmp_path: Path) -> None:
    body, partials = PASSING[case]
    summary = simulate(read_campaign(_written(tmp_path, body, "propagate", partials)), tmp_path / "run", None, 1)
    assert summary.summary["unsettled"] is None


def test_a_source_that_the_campaign_does_not_disturb_is_not_judged(tmp_path: Path) -> None:
    path = _written(tmp_path, SEEDED, errors='a = "1 m"')
    assert simulate(read_campaign(path), tmp_path / "run", None, 1).summary["unsettled"] is None


@pytest.mark.parametrize("number", ["13_boost", "14_polar"])
def test_our_own_campaigns_are_settled_by_far(number: str) -> None:
    campaign = read_campaign(ROOT / "campaigns" / f"{number}.toml")
    every = np.ones(len(campaign.scenario.sources), dtype=bool)
    assert campaign.scenario.differences.disagreement(every).max() < 1e-3 * LARGEST  # type: ignore[attr-defined]


@pytest.mark.parametrize(("tolerance", "refused"), [("5 %", False), ("0.5 %", True)])
def test_a_tight_tolerance_asks_for_settled_derivatives(tolerance: str, refused: bool, tmp_path: Path) -> None:
    """Noise of 0.3 % of the dispersion, the same to both sides: too little for a tolerance of 5 %, not for 0.5 %."""
    path = _written(tmp_path, SEEDED.replace("a + n", "a + 3e-3 * n"))
    path.write_text(f'tolerance = "{tolerance}"\n' + path.read_text())
    run = read_campaign(path)
    if refused:
        with pytest.raises(CampaignError, match=r"limit 0\.1 %"):
            simulate(run, tmp_path / "run", None, 1)
    else:
        assert simulate(run, tmp_path / "run", None, 1).summary["unsettled"] is None


def test_partials_of_its_own_that_are_not_those_of_the_flights(tmp_path: Path) -> None:
    path = _written(tmp_path, PLAIN, "propagate", "[[1.1, 0.0], [2.0, 0.0]]")
    with pytest.raises(CampaignError) as refused:
        simulate(read_campaign(path), tmp_path / "run", None, 1)
    assert "the class's own partial derivative of output 'x' to source 'a' is 10 % of" in str(refused.value)
    summary = simulate(read_campaign(path), tmp_path / "run", None, 1, force=True).summary
    assert summary["unsettled"]["own"]
    assert "own partial derivatives disagree with finite differences (x by a: 10 %)" in repr(
        mcnav.open_run(tmp_path / "run")
    )


def test_forced_it_is_said_on_top_of_everything(tmp_path: Path) -> None:
    """Terminal, summary, report, index, compare, notebook; after a new analysis as well."""
    path, folder = _written(tmp_path, SEEDED), tmp_path / "runs" / "run"
    words = "Partial derivatives do not converge (x by noise seed: "
    end = "the comparison below has no valid linear model."
    command = ["run", str(path), "--out", str(folder), "--jobs", "1"]
    refused = in_process(*command)
    assert (refused.exit_code, refused.output.count("\n")) == (2, 1)
    told = in_process(*command, "--force")
    assert told.exit_code == 0, told.output
    said = " ".join(told.output.split())
    assert said.startswith(f"mine: {words}")
    assert end in said
    assert "No:" not in said
    for _ in range(2):
        summary = mcnav.summary_of(folder)
        assert summary["verdict"] == "undecided"
        assert summary["unsettled"]["source"] == "noise_seed"
        assert summary["unsettled"]["output"] == "x"
        assert summary["unsettled"]["disagreement"] > 0.1
        page = (folder / "report.html").read_text()
        assert page.index(words) < page.index("<section")
        assert "No: the linear" not in page
        report_run(folder)
    assert in_process("report", "--index", tmp_path / "runs").exit_code == 0
    assert words in (tmp_path / "runs" / "index.html").read_text()
    compared = " ".join(in_process("compare", folder).output.split())
    assert compared.startswith(f"{folder}: {words}".replace("\n", " "))
    run = mcnav.open_run(folder)
    assert run.verdict == "undecided"
    assert words in repr(run)
    assert words in run._repr_html_()


def test_force_changes_no_sample(tmp_path: Path) -> None:
    """The identity, and with it every chunk, is that of the same campaign without it."""
    path = _written(tmp_path, PLAIN)
    digests = []
    for force in (False, True):
        folder = tmp_path / str(force)
        simulate(read_campaign(path), folder, None, 1, force=force)
        manifest = json.loads((folder / "manifest.json").read_text())
        parts = sorted((folder / "samples").glob("*.parquet"))
        digests.append((manifest["identity"], [hashlib.sha256(part.read_bytes()).hexdigest() for part in parts]))
    assert digests[0] == digests[1]


def test_a_refused_campaign_deletes_nothing(tmp_path: Path) -> None:
    """Not with --fresh either."""
    path = _written(tmp_path, PLAIN)
    simulate(read_campaign(path), tmp_path / "run", None, 1)
    before = {file: file.read_bytes() for file in (tmp_path / "run").rglob("*") if file.is_file()}
    _written(tmp_path, SEEDED)
    with pytest.raises(CampaignError):
        simulate(read_campaign(path), tmp_path / "run", None, 1, fresh=True)
    assert {file: file.read_bytes() for file in before} == before


@pytest.mark.parametrize("share", [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1])
def test_noise_that_passes_is_harmless(share: float) -> None:
    """Fifty functions each: of those that pass, no linear sigma is off by more than the limit; from 5 % none passes.

    Noise of a share e of the dispersion adds e²/2 to Monte Carlo's sigma, 0.5 % at 10 %: what must be refused because
    of it is far above what is.
    """
    partials = np.array([[1.0, 1.0], [1.0, -0.5]])
    sigmas = np.sqrt((partials**2).sum(axis=1))
    passed = 0
    for trial in range(50):

        def fly(errors: np.ndarray, trial: int = trial) -> SimulationResult:
            seeds = ([abs(hash((float(row[0]), float(row[1])))), trial] for row in errors)
            noise = np.array([np.random.default_rng(seed).standard_normal(2) for seed in seeds])
            return SimulationResult(errors @ partials.T + share * sigmas * noise)

        found = differentiate(fly, np.ones(2))
        if found.disagreement(np.ones(2, dtype=bool)).max() <= LARGEST:
            passed += 1
            off = np.sqrt((found.model.partials**2).sum(axis=1)) / sigmas - 1.0
            assert np.abs(off).max() <= LARGEST * np.sqrt(2.0)
    assert passed == 50 if share <= 1e-5 else passed == 0 if share >= 1e-2 else True
