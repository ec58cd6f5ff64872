"""Closed loops from a file to a report, whatever the number of workers."""

from __future__ import annotations

import json
import shutil
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from scipy import stats

from mcnav.config.read import read_campaign
from mcnav.contract.samples import Batch
from mcnav.errors import CampaignError
from mcnav.report.statements.lincov import mean_words
from mcnav.studies.linear_covariance import linear_covariance
from mcnav.studies.linearity import linearity_study
from mcnav.systems.closed_loop.sizes import LoopSizes
from mcnav.systems.user.conformance import check_conformance
from mcnav.workflow.analyse import samples_of
from mcnav.workflow.run import run_campaign
from tests.closed_loops import CAMPAIGNS, FILE, SHIPPED, campaign, tables
from tests.commands import in_process
from tests.runs import simulate


def written(folder: Path, name: str, **changes: Any) -> Path:
    folder.mkdir(exist_ok=True)
    shutil.copy(FILE, folder)
    path, content = folder / f"{name}.toml", {} if name in SHIPPED else tables(name, **changes)
    if name in SHIPPED:
        content = tomllib.loads((CAMPAIGNS / f"{SHIPPED[name]}.toml").read_text(encoding="utf-8")) | changes
        shutil.copy(CAMPAIGNS / content["scenario"]["type"].partition(":")[0], folder)
    path.write_text(tomli_w.dumps(content), encoding="utf-8")
    return path


@pytest.mark.slow
def test_samples_do_not_depend_on_workers(tmp_path: Path) -> None:
    path = written(tmp_path / "case", "Pendulum", samples=2_100)
    described = read_campaign(path)
    engine: Any = described.scenario.engine("vectorised", np.zeros((1, len(described.scenario.sources))))
    assert engine.chunk < 2_100
    samples = []
    for jobs in (1, 2):
        folder = tmp_path / f"run_{jobs}"
        simulate(described, folder, "vectorised", jobs)
        samples.append(samples_of(folder))
    assert samples[0].equals(samples[1])


def test_a_run_of_a_version_with_shorter_chunks_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Chunks are simulated again to the same bits, and none of the shorter ones is left."""
    described, folder = read_campaign(written(tmp_path / "case", "Pendulum", samples=150)), tmp_path / "run"
    samples = []
    for most in (40, 100):
        monkeypatch.setattr("mcnav.systems.closed_loop.scenario.MOST_SAMPLES", most)
        run_campaign(described, folder, "vectorised", jobs=1)
        samples.append(samples_of(folder))
    assert samples[0].equals(samples[1])
    assert len(list((folder / "samples").glob("part-*.parquet"))) == 2


def test_a_run_judges_all_four_kinds(tmp_path: Path) -> None:
    """True dispersion, navigation dispersion, navigation error and the filter's own, with requirements on any."""
    limit = {"output": "true_position", "probability": 0.9, "below": "4 m", "after": "100 s"}
    path = written(
        tmp_path / "case", "DoubleIntegrator", samples=200, accept={"quantile": [limit]},
        filter={"believes": {"measurements": {"ranging": "1 m"}}},
    )  # fmt: skip
    in_process("run", path, "--out", tmp_path / "run", "--jobs", "1")
    summary = json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))
    assert summary["filter"]["verdict"] == "optimistic"
    assert (tmp_path / "run" / "report.html").exists()
    answer = linear_covariance(path)
    assert answer.met
    assert answer.filter is not None
    assert answer.filter.verdict.value == "optimistic"
    assert {cause.name for cause in answer.filter.neglected} <= {"ranging"}


def test_a_new_closed_loop_runs(tmp_path: Path) -> None:
    in_process("new", "scenario", "mine", "--closed-loop", "--in", tmp_path)
    described = read_campaign(tmp_path / "mine.toml")
    scenario: Any = described.scenario
    assert scenario.remarks == ()
    assert linear_covariance(described).sigma[0] == pytest.approx(1.0414, abs=1e-4)


def test_a_plain_scenario_has_no_sizes_of_processes(tmp_path: Path) -> None:
    in_process("new", "scenario", "plain", "--in", tmp_path)
    path = tmp_path / "plain.toml"
    path.write_text(path.read_text(encoding="utf-8") + '\n[processes]\ngusts = "1 m"\n', encoding="utf-8")
    with pytest.raises(Exception, match="no ClosedLoop"):
        read_campaign(path)


BIAS = {"sigma": "1 mrad", "correlation_time": "10 s"}
"""A Gauss-Markov process."""


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"processes": {"gust": "1 rad/s^2/sqrt(Hz)"}}, "processes.gust: unknown process; did you mean 'gusts'?"),
        ({"processes": {"gusts": "1 m"}}, "processes.gusts: got '1 m', which is a length; expected"),
        ({"processes": 3}, "processes: got 3; expected a table"),
        ({"processes": {"bias": "1 mrad"}}, "processes.bias: got '1 mrad'; expected a table such as { sigma"),
        ({"processes": {"bias": {"sigma": "1 mrad"}}}, "processes.bias.correlation_time: is missing; a Gauss-Markov"),
        ({"processes": {"bias": {**BIAS, "sigm": 3}}}, "processes.bias.sigm: unknown key of a Gauss-Markov process"),
        ({"processes": {"bias": {**BIAS, "sigma": "1 s"}}}, "processes.bias.sigma: got '1 s', which is a time; "),
        ({"processes": {"bias": {**BIAS, "correlation_time": "0 s"}}}, "processes.bias.correlation_time: got '0 s'"),
        ({"measurements": {"sonar": "1 m"}}, "measurements.sonar: unknown measurement; expected encoder"),
        ({"filter": {"believe": {}}}, "filter.believe: unknown key of a closed loop's filter; did you"),
        ({"filter": {"believes": {"noise": {}}}}, "filter.believes.noise: unknown key of what a filter believes; exp"),
        ({"filter": {"believes": {"errors": {"x": "1 m"}}}}, "filter.believes.errors.x: unknown error source; "),
        ({"filter": {"believes": {"errors": 3}}}, "filter.believes.errors: got 3; expected a table"),
        ({"filter": 3}, "filter: got 3; expected a table"),
    ],
)  # fmt: skip
def test_one_mistake_in_a_size_is_one_line(changes: dict[str, Any], line: str, tmp_path: Path) -> None:
    path = written(tmp_path / "case", "Pendulum", **changes)
    with pytest.raises(CampaignError) as wrong:
        read_campaign(path)
    (told,) = str(wrong.value).splitlines()
    assert told.startswith(f"{path}: {line}")


def test_a_filter_believes_a_process_with_another_sigma(tmp_path: Path) -> None:
    """Its correlation time is the true one unless given."""
    for believed in ("2 mrad", {"sigma": "2 mrad"}):
        filter_table = {"believes": {"processes": {"bias": believed}}}
        path = written(tmp_path / "case", "Pendulum", processes={"bias": BIAS}, filter=filter_table)
        sizes = read_campaign(path).scenario.sizes  # type: ignore[attr-defined]
        assert (sizes.true.markov[0], sizes.believed.markov[0]) == pytest.approx((1e-3, 2e-3))
        assert sizes.believed.decay == pytest.approx(0.1)


def test_the_size_of_a_correction_follows_its_exact_law(tmp_path: Path) -> None:
    """nasa/condor's burn: median and quantile of 99.73 % as computed elsewhere.

    So many samples are below each as are of that probability, whatever the seed, and their mean is the law's; each
    within bounds that are missed once in a million times.
    """
    count, false_alarm = 1_400, 1e-6
    path = written(tmp_path / "case", "Rendezvous", samples=count, seed=5)
    told = in_process("run", path, "--out", tmp_path / "run", "--jobs", "1")
    summary = json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))
    (size,) = summary["sizes"]
    assert size["output"] == "burn_size"
    assert size["median"] == pytest.approx(1.486095, abs=6e-7)
    assert size["most"] == pytest.approx(1.603197, abs=6e-7)
    assert size["three_sigma"] == pytest.approx(1.801769, abs=6e-7)
    assert size["wrong"]
    flown = samples_of(tmp_path / "run")["output burn_size [m/s]"].to_numpy()
    for name, probability in (("median", 0.5), ("most", 0.9973)):
        law = stats.binom(count, probability)
        assert law.ppf(0.5 * false_alarm) <= np.sum(flown <= size[name]) <= law.isf(0.5 * false_alarm)
    away = (flown.mean() - size["mean"]) / (flown.std(ddof=1) / np.sqrt(count))
    assert abs(away) < stats.t(count - 1).isf(0.5 * false_alarm)
    for name in ("median", "mean", "most"):
        low, high = size[f"{name}_interval"]
        assert low < size[f"{name}_sample"] < high
    sentence = "99.73 % below 1.6032 m/s (exact law; nominal plus 3 σ, 1.8018, is wrong)"
    assert sentence in " ".join(told.output.split())
    assert "Size of corrections" in (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    answer = linear_covariance(written(tmp_path / "case", "Rendezvous", accept={
        "quantile": [{"output": "burn_size", "probability": 0.9973, "below": "1.7 m/s"}],
    }))  # fmt: skip
    assert answer.requirements[0].value == pytest.approx(1.603197, abs=6e-7)
    assert answer.met


def test_a_correction_without_a_nominal_has_a_law_and_no_linear_sigma(tmp_path: Path) -> None:
    path = written(tmp_path / "case", "Trim", samples=400)
    in_process("run", path, "--out", tmp_path / "run", "--jobs", "1")
    (size,) = json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))["sizes"]
    assert size["nominal"] == 0.0
    assert size["median"] == pytest.approx(0.085474, abs=6e-7)  # the covariance of condor's burn
    assert size["mean"] == pytest.approx(0.094168, abs=6e-7)
    assert size["most"] == pytest.approx(0.278972, abs=6e-7)
    assert size["three_sigma"] == pytest.approx(0.318249, abs=6e-7)
    flown = samples_of(tmp_path / "run")["output burn_size [m/s]"].to_numpy()
    law = stats.binom(400, 0.5)
    assert law.ppf(5e-7) <= np.sum(flown <= size["median"]) <= law.isf(5e-7)  # missed once in a million times
    summary = json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))
    place = [output["name"] for output in summary["outputs"]].index("burn_size")
    squares = 0.0336119023630829**2 + 0.043291158546284986**2 + 0.09082802475163287**2
    assert summary["sigma_linear"][place] == pytest.approx((squares - size["mean"] ** 2) ** 0.5, rel=1e-9)
    assert summary["verdicts"][place] != "differs"  # judged by its exact law
    assert summary["verdict"] != "differs"


def test_a_nominal_command_is_no_mean_error(tmp_path: Path) -> None:
    """A correction and its time have values in the nominal; a parameter with a mean is a mean error."""
    path = written(tmp_path / "case", "Kicked")
    assert list(mean_words(linear_covariance(path))) == []
    bias = {"true_vx": {"distribution": "fixed", "value": "1 m/s"}}
    ((sentence, _),) = mean_words(linear_covariance(written(tmp_path / "case", "Kicked", errors=bias)))
    assert "that of true x at 30 s is +30.0 m, and its sigma is zero" in sentence


@pytest.mark.parametrize("name", ["Corrected", "Pendulum"])
def test_noise_multiplied_is_a_loop_of_such_sizes(name: str) -> None:
    """A plan of three times the errors, made anew, has the gains of the stated ones; differences are good to 1e-6."""
    scenario: Any = campaign(name).scenario
    sizes = LoopSizes(scenario.sizes.true.scaled(3.0), scenario.sizes.believed.scaled(3.0))
    batch = Batch(np.arange(4), 3.0 * np.random.default_rng(7).standard_normal((4, len(scenario.sources))) * 1e-3, 5)
    stated, multiplied = (each.engine("vectorised", batch.errors) for each in (scenario, scenario.with_sizes(sizes)))
    result, expected = stated.with_noise(3.0).simulate(batch), multiplied.simulate(batch)
    scale = np.abs(expected.values).max(axis=0) + 1e-12
    np.testing.assert_allclose(result.values / scale, expected.values / scale, atol=1e-6)
    np.testing.assert_allclose(result.linear_values / scale, expected.linear_values / scale, atol=1e-6)
    assert np.abs(result.values - stated.simulate(batch).values).max() > 0.0


def test_a_linear_loop_with_noise_is_linear_at_any_multiple() -> None:
    study = linearity_study(campaign("DoubleIntegrator"), samples=200, largest=4.0)
    assert study.noise == "scaled"
    assert np.isinf(study.together.agrees_until).all()
    np.testing.assert_allclose(study.together.ratios, 1.0, atol=1e-6)


def test_sizes_of_zero_nominal_have_no_range_of_linearity(tmp_path: Path) -> None:
    path = written(tmp_path / "case", "Trim")
    shown = in_process("sweep", path, "--scale", "-n", "200", "--largest", "1", "--out", tmp_path / "range").output
    assert "All errors may grow" in shown
    assert "zero in the nominal, and they have no range: burn size" in " ".join(shown.split())


def test_a_scenario_is_not_blamed_for_sizes_of_zero_nominal() -> None:
    described = campaign("Trim")
    checks = check_conformance(described.scenario, described.errors.standard_deviations)
    assert [check.told for check in checks if not check.passed] == []


BY_AXIS = {"velocity": ["1 cm/s", "2 cm/s", "3 cm/s"]}
"""Errors of a group of sources."""


@pytest.mark.parametrize("entry", [BY_AXIS["velocity"], dict(zip("xyz", BY_AXIS["velocity"], strict=True))])
def test_errors_of_a_group_are_given_by_axis(entry: object) -> None:
    described = campaign("Trim", errors={"true_velocity": entry})
    sigmas = dict(zip(described.errors.names, described.errors.standard_deviations, strict=True))
    assert [sigmas[f"true_velocity_{axis}"] for axis in "xyz"] == pytest.approx([0.01, 0.02, 0.03])


@pytest.mark.parametrize(
    ("entry", "line"),
    [
        ("1 kg", "errors.true_velocity: got '1 kg'"),
        (["1 m/s", "2 m/s"], "errors.true_velocity: got a list of 2; expected 3, for x, y, z"),
        (["1 m/s", "2 kg", "1 m/s"], "errors.true_velocity #2: got '2 kg'"),
        ({"x": "1 m/s", "w": "1 m/s"}, "errors.true_velocity.w: unknown axis; expected x, y, z"),
        ({"sigma": "1 kg"}, "errors.true_velocity.sigma: got '1 kg'"),
    ],
)
def test_one_mistake_in_the_errors_of_a_group_is_one_line(entry: object, line: str) -> None:
    with pytest.raises(CampaignError) as wrong:
        campaign("Trim", errors={"true_velocity": entry})
    assert len(str(wrong.value).splitlines()) == 1
    assert line in str(wrong.value)
