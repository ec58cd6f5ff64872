"""Examination of linear analysis: against runs, against functions made to deceive it, and in words."""

from __future__ import annotations

import csv
import json
import secrets
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from mcnav.analysis.examination import Examination
from mcnav.analysis.model import Model
from mcnav.arrays.types import Array
from mcnav.config.read import parse_campaign, read_campaign
from mcnav.contract.failure import Failure
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.execution.progress import COMPILATION, NotCompiled
from mcnav.report.pages.lincov import statements
from mcnav.runner.draws import DrawPlan
from mcnav.sampler.distributions import Normal, Uniform
from mcnav.sampler.error_model import ErrorModel
from mcnav.studies import examine
from mcnav.studies.lincov import write_lincov
from mcnav.studies.linear_covariance import linear_covariance
from mcnav.systems.guard import call_user
from mcnav.systems.ins.aided import AidedNavigation
from mcnav.systems.ins.ensemble.aided import AidedTables
from mcnav.systems.sample_loop import simulate_each
from mcnav.systems.user import kept
from tests.commands import invoke
from tests.scaled_errors import scaled_errors
from tests.strapdown_loops import FILE, flown
from tests.strapdown_loops import tables as strapdown

ROOT = Path(__file__).parents[2]
CAMPAIGNS = ROOT / "campaigns"


@dataclass(frozen=True)
class Function:
    """Engine of a function of the errors, shape (n, sources) to (n,); it is not quick, so that there is one try."""

    function: Callable[[Array], Array]
    chunk: int = 64
    noisy: bool = False
    parallel: str = "threads"
    accuracy: str = ""
    epochs: ClassVar[None] = None
    filter: ClassVar[None] = None

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        return SimulationResult(self.function(batch.errors)[:, None])


def model_of(slopes: Array) -> tuple[Model, ErrorModel]:
    """Return the linear model of one output and its sources of one sigma each."""
    names = [f"x{number}" for number in range(len(slopes))]
    errors = ErrorModel(names, {name: Normal(1.0) for name in names})
    return Model(slopes[None], np.zeros(1), errors.mean, errors.covariance), errors


def product_of_others(rng: np.random.Generator) -> tuple[Array, Callable[[Array], Array]]:
    """One source, and a product of two that have no linear effect: true over linear sigma is 1.1."""
    slopes = np.array([1.0, 0.0, 0.0, 0.0, 0.0])
    i, j = rng.choice(np.arange(1, 5), 2, replace=False)
    return slopes, lambda x: x[:, 0] + np.sqrt(0.21) * x[:, i] * x[:, j]


def dense_curvature(rng: np.random.Generator) -> tuple[Array, Callable[[Array], Array]]:
    """Forty sources with a dense matrix of second derivatives: the ratio is 1.1."""
    slopes, full = rng.standard_normal(40), rng.standard_normal((40, 40))
    hessian = full + full.T
    slopes /= np.linalg.norm(slopes)
    hessian *= np.sqrt(0.21 / (0.5 * np.sum(hessian**2)))
    return slopes, lambda x: x @ slopes + 0.5 * np.einsum("ni,ij,nj->n", x, hessian, x)


def third_order(rng: np.random.Generator) -> tuple[Array, Callable[[Array], Array]]:
    """Twenty sources and sixty products of three of them: the ratio is 1.1."""
    slopes = rng.standard_normal(20)
    slopes /= np.linalg.norm(slopes)
    triples = np.array([rng.choice(20, 3, replace=False) for _ in range(60)])
    unique = np.unique(np.sort(triples, axis=1), axis=0)
    weight = np.sqrt(0.21 / len(unique))
    return slopes, lambda x: x @ slopes + weight * np.prod(x[:, unique], axis=2).sum(axis=1)


@pytest.mark.parametrize("deceiver", [product_of_others, dense_curvature, third_order])
def test_functions_made_to_deceive_are_seldom_called_linear(
    deceiver: Callable[[np.random.Generator], tuple[Array, Callable[[Array], Array]]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A true ratio of 1.1 is called linear, within 4 %, in at most 8 of 100 seeds: the rate that is promised."""
    wrongly = 0
    for seed in range(100):
        slopes, function = deceiver(np.random.default_rng(seed))
        monkeypatch.setattr(examine, "SEED", 5_000 + seed)
        model, errors = model_of(slopes)
        wrongly += examine.examine_model(model, errors, Function(function), 0.05).outputs[0].verdict == "holds"
    assert wrongly <= 8


def test_a_rare_jump_is_seldom_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """A jump of ten sigmas with a probability of 0.5 % makes a ratio of 1.2, and few flights meet it: the page says so.

    None of 32 check flights meets it with a probability of 0.85; of 100 seeds at least 74 then hold (1 % quantile).
    """
    model, errors = model_of(np.array([1.0, 0.1]))
    jump = Function(lambda x: x[:, 0] + 0.1 * x[:, 1] + 10.0 * (x[:, 1] > 2.576))
    held = 0
    for seed in range(100):
        monkeypatch.setattr(examine, "SEED", 5_000 + seed)
        held += examine.examine_model(model, errors, jump, 0.05).outputs[0].verdict == "holds"
    assert held >= 74


def test_sources_that_are_not_normal() -> None:
    """A square of a uniform source, whose moments are those of the uniform law: the ratio is 1.118."""
    errors = ErrorModel(["x", "y"], {"x": Uniform(1.0), "y": Normal(1.0)})
    model = Model(np.array([[0.0, 1.0]]), np.zeros(1), errors.mean, errors.covariance)
    variance = errors.covariance[0, 0]
    fourth = 9.0 / 5.0 * variance**2  # of a uniform law
    weight = np.sqrt(0.25 / (fourth - variance**2))
    square = Function(lambda x: x[:, 1] + weight * x[:, 0] ** 2, chunk=8_192)
    examined = examine.examine_model(model, errors, square, 0.05).outputs[0]
    assert examined.low < np.sqrt(1.25) < examined.high
    assert examined.verdict == "does not hold"


def test_a_size_is_judged_by_the_components_of_its_vector() -> None:
    """The size of a normal vector without a mean has no linear sigma, and a law that linear analysis knows."""
    names = ["x", "y"]
    errors = ErrorModel(names, dict.fromkeys(names, Normal(1.0)))
    partials = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]])

    @dataclass(frozen=True)
    class Vector(Function):
        def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
            x, y = self.function(batch.errors).T
            return SimulationResult(np.column_stack([x, y, np.hypot(x, y)]))

    model = Model(partials, np.zeros(3), errors.mean, errors.covariance, sizes={2: (0, 1)})
    for function, verdict in ((lambda x: x, "holds"), (lambda x: x + 0.5 * x[:, ::-1] ** 2, "does not hold")):
        examined = examine.examine_model(model, errors, Vector(function), 0.05)
        assert [output.verdict for output in examined.outputs] == [verdict] * 3


def test_a_second_command_examines_a_class_by_kept_flights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first command simulates them because it is asked to; the second has no second to spare, and reads them."""
    monkeypatch.setattr(kept, "KEPT_FROM", 0.0)
    monkeypatch.setenv("MCNAV_CACHE_DIR", str(tmp_path / "kept"))
    campaign = read_campaign(CAMPAIGNS / "14_polar.toml")
    model = linear_covariance(campaign).model
    assert str(examine.examine_campaign(campaign, model, 1e-9)).startswith("it would take about ")
    first = examine.examine_campaign(campaign, model)
    again = examine.examine_campaign(campaign, model, 1e-9)
    assert isinstance(first, Examination)
    assert isinstance(again, Examination)
    assert (again.outputs, again.joint) == (first.outputs, first.joint)


def test_noise_alone() -> None:
    """Without constant errors there is no axis, and flights with noise say whether linear analysis holds."""
    campaign = read_campaign(CAMPAIGNS / "15_flight_navigation_grade.toml")
    campaign = replace(campaign, errors=ErrorModel(campaign.errors.names, {}))
    answer = linear_covariance(campaign, examine=True)
    assert answer.examination is not None
    assert {output.verdict for output in answer.examination.outputs} == {"holds"}


def test_steps_of_an_aided_navigator_are_halved_where_something_does_not_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    """The coarsest steps suffice for what holds; anything else is what the tested steps say, and they alone."""
    probes, refined = list[int](), AidedNavigation.refined

    def recorded(aided: AidedNavigation, samples: Array) -> tuple[AidedTables, float]:
        probes.append(len(samples))
        return refined(aided, samples)

    monkeypatch.setattr(AidedNavigation, "refined", recorded)
    campaign = read_campaign(CAMPAIGNS / "21_flight_with_an_altimeter.toml")
    held = linear_covariance(campaign, examine=True).examination
    assert held is not None
    assert held.holds
    assert probes == [0]
    sizes = dict(zip(campaign.errors.names, campaign.errors.distributions, strict=True))
    unknown = replace(campaign, errors=ErrorModel(campaign.errors.names, sizes | {"heading": Normal(0.5)}))
    model = linear_covariance(unknown).model
    examined = examine.examine_campaign(unknown, model)
    assert isinstance(examined, Examination)
    assert not examined.holds
    first, tested = probes[1:]
    assert (first, tested > 0) == (0, True)
    draws = DrawPlan(unknown.errors, unknown.design, unknown.seed, unknown.samples)
    engine = unknown.scenario.engine("ensemble", draws.probes())
    assert examined.outputs == examine.examine_model(model, unknown.errors, engine, unknown.tolerance).outputs


def test_a_failed_flight_is_no_answer() -> None:
    @dataclass(frozen=True)
    class Failing(Function):
        def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
            values = batch.errors[:, :1].copy()
            values[3] = np.nan
            return SimulationResult(values, {3: Failure.of("fell")})

    model, errors = model_of(np.array([1.0, 0.0]))
    examined = examine.examine_model(model, errors, Failing(lambda x: x[:, 0]), 0.05)
    assert (examined.failed, examined.outputs[0].verdict) == (1, "cannot say")
    assert examined.joint is not None
    assert examined.joint.verdict == "cannot say"


VERDICTS = {
    "02_tn_d1772_trajectory_1": ("holds", set(), set()),
    "07_tn_d1772_trajectory_7": ("does not hold", set(), set()),
    "14_polar": ("does not hold", {"y"}, set()),
    "15_flight_navigation_grade": ("does not hold", set(), set()),
    "19_flight_with_gnss": ("holds", set(), set()),
    "26_reentry_to_a_landing_site": ("does not hold", {"true_altitude_rate"}, {"true_range_rate", "final_time"}),
}
"""Campaigns with the verdict on all outputs together, outputs whose sigma is not linear, and those open.

By runs with 20,000 samples (2,000 of 19) linear analysis differs together where it does not hold here, undecided in 26.
It differs in sigma in the y of 14 (a ratio of 2.60; x has 0.965, within the tolerance of 5 % and at its edge), and in
the true altitude rate and range rate of 26 (1.086, 1.067); its final time has 1.041.
"""


@pytest.mark.parametrize("name", VERDICTS)
def test_campaigns_are_answered_as_runs_answer(name: str) -> None:
    answer = linear_covariance(read_campaign(CAMPAIGNS / f"{name}.toml"), examine=True)
    examined = answer.examination
    assert examined is not None
    assert examined.joint is not None
    together, failing, unknown = VERDICTS[name]
    verdicts = {output.name: row.verdict for output, row in zip(answer.outputs, examined.outputs, strict=True)}
    assert {output for output, verdict in verdicts.items() if verdict == "does not hold"} == failing
    assert {output for output, verdict in verdicts.items() if verdict == "cannot say"} == unknown
    assert examined.joint.verdict == together


def test_corrected_moments_of_polar_coordinates(tmp_path: Path) -> None:
    """Sigmas to fourth order of campaign 14: 52.167 and 252.723 m, mean -34.269 m; exact 50.680, 253.129, -33.689 m.

    The error of their derivatives, by steps of a fifth of a sigma, is below 1e-4.
    """
    _, (written, *_) = write_lincov(read_campaign(CAMPAIGNS / "14_polar.toml"), tmp_path, examine=True)
    linearity = json.loads(written.read_text(encoding="utf-8"))["linearity"]
    assert linearity["sigma_second"] == pytest.approx([252.723, 52.167], rel=1e-4)
    assert min(abs(mean - -34.269) for mean in linearity["mean_second"]) < 5e-3
    assert linearity["flights"] == 45
    assert {row["verdict"] for row in linearity["outputs"]} <= {"holds", "does not hold", "cannot say"}


def test_statement_and_requirements_follow_the_examination() -> None:
    """Requirements on an output whose sigma is not linear are not judged linearly."""
    campaign = read_campaign(CAMPAIGNS / "14_polar.toml")
    answer = linear_covariance(campaign, examine=True)
    words, tone = statements(answer)[0]
    assert tone == "differs"
    assert words == (
        "Linear analysis, examined by 45 flights: holds for 1 of 2 outputs. It fails for y "
        "(2.53 times the linear sigma). Sigma to second order: y 52.2 m (linear 20.0). "
        "Do not gate or fuse with the full matrix, which is wrong. Errors rarer than one in 30 would be missed"
    )


def test_a_strapdown_loop_is_examined_as_the_same_flight_of_type_ins() -> None:
    """The same flight without aiding, with all constant errors a hundred times as large: attitudes of 50 mrad."""
    ins, loop = (
        linear_covariance(replace(campaign, errors=scaled_errors(campaign.errors, 100.0)), examine=True)
        for content in (flown(), strapdown("Free", 1.0))
        for campaign in [parse_campaign(content, str(FILE.with_name("x.toml")), "x")]
    )
    assert ins.examination is not None
    assert loop.examination is not None
    assert {row.verdict for row in (*ins.examination.outputs, *loop.examination.outputs)} == {"holds"}
    for answer in (ins, loop):
        assert answer.examination is not None
        assert answer.examination.joint is not None
        assert answer.examination.joint.verdict == "holds"
    varied = [row for row in loop.examination.outputs if not np.isnan(row.ratio)]
    assert len(varied) == 18  # errors, and the navigated states, which differ from the given truth by them
    for own, navigated in zip(varied[:9], varied[9:], strict=True):
        assert (own.low, own.high) == pytest.approx((navigated.low, navigated.high), rel=1e-6)


def test_nothing_is_compiled_for_it_unless_it_is_asked_for() -> None:
    """Code that is not stored is refused, and the next compilation works."""
    from mcnav.compiled.jit import compiled

    number = secrets.randbelow(1 << 52)  # a constant of its own, which no earlier run has stored

    def with_constant(x: float) -> float:
        return x + number

    function = compiled(with_constant)
    before = COMPILATION.functions
    with COMPILATION.refusing(), pytest.raises(NotCompiled):
        function(2.0)
    with COMPILATION.refusing(), pytest.raises(NotCompiled):  # no failure of a sample
        simulate_each(lambda row: np.full(1, call_user(function, float(row))), range(2), np.empty((2, 1)))
    assert (COMPILATION.begun, COMPILATION.functions) == (0, before)
    assert function(2.0) == 2.0 + number


def test_command_line(tmp_path: Path) -> None:
    campaign = CAMPAIGNS / "14_polar.toml"
    done = invoke("lincov", campaign, "--no-examine", "--out", tmp_path, cwd=tmp_path)
    assert "examined" not in done.stdout
    assert "linearity" not in json.loads((tmp_path / "lincov.json").read_text(encoding="utf-8"))


def test_measured_rates_are_those_of_the_file() -> None:
    """The page's table counts the rows of the experiment; none of them calls linear what a run finds different."""
    with (ROOT / "reports" / "calibration" / "examination.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    counted = Counter((row["noise"] == "True", row["examined"], row["by_samples"]) for row in rows)
    page = (ROOT / "mcnav" / "docs" / "EXAMINATION.md").read_text(encoding="utf-8")
    for noise in (False, True):
        for verdict in ("holds", "cannot say", "does not hold"):
            shown = [counted[noise, verdict, by_samples] for by_samples in ("agrees", "undecided", "differs")]
            line = f"| {'with' if noise else 'without'} | {verdict} | {' | '.join(map(str, shown))} |"
            assert line in page
        assert counted[noise, "holds", "differs"] == 0
        assert counted[noise, "does not hold", "agrees"] == 0
