"""The floor: rounding is not dispersion, and a real difference one order above it is found."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.analysis.comparison import Comparison, Criterion, compare
from mcnav.analysis.filter_consistency import Honesty
from mcnav.analysis.floor import INTEGRATED, OWN_SIZE, REQUIRED, STORED, agreement_floor, filter_floor
from mcnav.analysis.linear_covariance import LinearCovariance
from mcnav.analysis.linear_filter import judge_filter
from mcnav.analysis.model import Model
from mcnav.analysis.verdict import Verdict
from mcnav.contract.linear import LinearSystem

SAMPLES = 4_000


def _compared(model: Model, ratio: float, sigma: float) -> Comparison:
    """Compare samples of sigma times a ratio with a linear model of one output and one error of that sigma."""
    errors = sigma * np.random.default_rng(7).standard_normal((SAMPLES, 1))
    fixed = np.broadcast_to(model.mean[1:], (SAMPLES, len(model.mean) - 1))
    return compare(model, np.hstack([errors, fixed]), model.outcome_mean + ratio * errors, Criterion())


MODELS = {
    "scale": (lambda s: Model(np.ones((1, 1)), np.zeros(1), np.zeros(1), np.diag([s**2]), scales=np.array([6.4e6])),
              INTEGRATED * 6.4e6),
    "limit": (lambda s: Model(np.ones((1, 1)), np.zeros(1), np.zeros(1), np.diag([s**2]), limits=np.array([10.0])),
              REQUIRED * 10.0),
    "fixed": (lambda s: Model(np.ones((1, 2)), np.zeros(1), np.array([0.0, 94.0]), np.diag([s**2, 0.0])),
              OWN_SIZE * 94.0),
}  # fmt: skip


@pytest.mark.parametrize("kind", MODELS)
def test_differences_within_the_floor_agree_and_ten_times_it_are_found(kind: str) -> None:
    """A paired ratio of 1.1 is known to some 0.002 here: 0.1 times the root of 2 / 4,000 and less."""
    build, floor = MODELS[kind]
    assert build(0.5 * floor).floor == pytest.approx(floor)
    within = _compared(build(0.5 * floor), 1.3, 0.5 * floor)
    assert (within.verdict, within.outputs[0].paired.negligible) == (Verdict.AGREES, True)
    assert within.ellipsoid is None
    for ratio in (1.1, 0.9):
        real = _compared(build(10.0 * floor), ratio, 10.0 * floor)
        assert (real.verdict, real.outputs[0].paired.negligible) == (Verdict.DIFFERS, False)


def test_a_nominal_value_hides_nothing() -> None:
    """A position of 7,000 km that is known to 1 m: its own size is no error, and 10 % are found."""
    model = Model(np.ones((1, 1)), np.array([7e6]), np.zeros(1), np.eye(1))
    assert model.floor[0] == pytest.approx(7e-4)
    assert _compared(model, 1.1, 1.0).verdict == Verdict.DIFFERS


def test_the_floor_is_the_largest_of_its_parts() -> None:
    terms, none = np.array([[3.0]]), np.zeros(1)
    assert agreement_floor(terms, none, none)[0] == pytest.approx(3e-10)
    assert agreement_floor(terms, none, np.array([2.0]), limits=np.array([5e3]))[0] == pytest.approx(5e-3)
    assert filter_floor(np.array([[5.0, 1e-9]]), np.zeros((1, 2)), ("m", "m"))[1] == pytest.approx(STORED * 5.0)


def test_an_attitude_error_hides_no_position_and_a_position_error_hides_tilts() -> None:
    """Half a radian over a radian of scale would be 0.6 m over the earth's radius: a filter knows 0.5 m."""
    scales, units = np.array([6.4e6, 1.0]), ("m", "rad")
    floors = filter_floor(np.array([[0.5, 0.5]]), np.zeros((1, 2)), units, scales=scales)
    assert floors == pytest.approx(STORED * np.array([0.5, 0.5]))
    floors = filter_floor(np.array([[80.0, 1e-9]]), np.zeros((1, 2)), units, scales=scales)
    assert floors == pytest.approx(STORED * np.array([80.0, 80.0 / 6.4e6]))


def test_what_is_judged_together_leaves_out_what_is_hardly_dispersed() -> None:
    """The second output has a fixed error of 1 and a sigma of 1e-4: a nonlinear mean there is no surprise."""
    model = Model(np.array([[1.0, 0.0], [1e-4, 1.0]]), np.zeros(2), np.array([0.0, 1.0]), np.diag([1.0, 0.0]))
    assert model.judged.tolist() == [True, False]
    errors = np.random.default_rng(8).standard_normal((SAMPLES, 1))
    outcomes = np.hstack([errors, 1.0 + 1e-4 * errors + 0.002])
    found = compare(model, np.hstack([errors, np.ones((SAMPLES, 1))]), outcomes, Criterion())
    assert found.apart == (1,)
    assert found.ellipsoid is not None
    assert found.ellipsoid.verdict == Verdict.AGREES


@pytest.mark.parametrize(
    ("true", "verdict"),
    [(9.5e-8, Honesty.CONSISTENT), (9.9e-7, Honesty.CONSISTENT), (1.1e-5, Honesty.OPTIMISTIC)],
)
def test_a_filter_of_five_metres_knows_other_positions_to_a_micrometre(true: float, verdict: Honesty) -> None:
    """STORED times 5 m: below it the filter may state anything, ten times above 10 % are found."""
    own = 0.0 if true < 1e-6 else 1e-5
    system = LinearSystem(np.zeros(1), np.diag([5.0, true])[None], np.zeros((1, 2)), own=np.diag([25.0, own**2])[None])
    covariance = np.diag([25.0, true**2])[None]
    sigma = np.array([[5.0, true]])
    answer = LinearCovariance(
        readings=system, mean=np.zeros((1, 2)), covariance=covariance, sigma=sigma, sigma_filter=np.array([[5.0, own]]),
        variances={}, correlations=np.eye(2)[None], means={},
    )  # fmt: skip
    names = ["position_down", "position_east"]
    found = judge_filter([answer], names, {"all": 2}, ("a", "b"), np.eye(2), 0.05, ("m", "m"))
    assert found is not None
    assert found.verdict == verdict
    assert list(found.floors) == (["position_east"] if verdict == Honesty.CONSISTENT else [])
