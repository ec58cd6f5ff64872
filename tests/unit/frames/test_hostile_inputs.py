"""Plausible mistakes in Python: each is one line that names what came, and what would do."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import pytest
import scipy.stats

import mcnav as mc
from tests.closed_loops import DoubleIntegrator, Remembering

ERRORS = mc.Errors({"a": 1.0, "b": 0.3})
DRAWS = ERRORS.draw(100, seed=1)
P = pd.DataFrame([[1.0, 1.0]], index=["y1"], columns=["a", "b"])
REENTRY = {"type": "reentry", "trajectory": 4}


def total(errors: Any) -> Any:
    """One output."""
    return errors[:, :1] + errors[:, 1:]


MISTAKES: dict[str, tuple[Callable[[], Any], str]] = {
    "negative": (lambda: mc.Errors({"a": "-5 km"}), "a: a sigma must not be negative; got -5000"),
    "list": (lambda: mc.Errors(["a"]), "Errors needs a mapping of one or more error sources"),  # type: ignore[arg-type]
    "none drawn": (lambda: ERRORS.draw(0), "samples must be a whole number of at least 2; got 0"),
    "text": (lambda: mc.Errors({"a": 1, "b": 1}, {("a", "b"): "0.3"}), "expected -1 to 1; got '0.3'"),  # type: ignore[dict-item]
    "matrix": (lambda: mc.Errors({"a": 1, "b": 1}, np.eye(2)), "expected a mapping such as"),  # type: ignore[arg-type]
    "pair twice": (lambda: mc.Errors({"a": 1, "b": 1}, {("a", "b"): 0.3, ("b", "a"): 0.5}), "given twice"),
    "not positive": (
        lambda: mc.Errors(dict.fromkeys("abc", 1.0), {("a", "b"): 0.9, ("b", "c"): 0.9, ("a", "c"): -0.9}),
        "its smallest eigenvalue is -0.8",
    ),
    "discrete": (lambda: mc.Errors({"a": scipy.stats.poisson(3)}), "got scipy.stats.poisson; expected a continuous"),
    "no file": (lambda: mc.table("nowhere.csv", "a"), "nowhere.csv: cannot be read as a table: No such file"),
    "draws of Errors": (lambda: mc.simulate(total, ERRORS), r"such as errors.draw\(20_000\); got Errors"),  # type: ignore[arg-type]
    "nan": (lambda: mc.simulate(total, DRAWS.where(DRAWS > -1e9, 0.0) / [1.0, 0.0]), "b is not finite in row 0"),
    "words": (lambda: mc.simulate(total, DRAWS.assign(b="x")), "b must be numbers; got dtype"),
    "twice": (lambda: mc.simulate(total, pd.concat([DRAWS, DRAWS], axis=1)), "a column a source; got a, b, a, b"),
    "transposed": (lambda: mc.simulate(lambda e: e.T, DRAWS), r"must return shape \(100, 100\)|got shape \(2, 100\)"),
    "more names": (lambda: mc.simulate(total, DRAWS, outputs=["x", "y"]), r"shape \(100, 2\).*got shape \(100, 1\)"),
    "complex": (lambda: mc.simulate(lambda e: 1j * e, DRAWS), "must return real numbers; got dtype complex128"),
    "nothing": (lambda: mc.simulate(lambda e: None, DRAWS), "must return real numbers; got dtype object"),
    "one sample": (lambda: mc.simulate(lambda e: e["a"], DRAWS), r"given errors of shape \(n, 2\), a row a sample"),
    "same names": (lambda: mc.simulate(lambda e: e, DRAWS, outputs=["x", "x"]), "different names; got x, x"),
    "unit": (
        lambda: mc.simulate(REENTRY, mc.Errors({"altitude": "5 s"}).draw(4)),
        "altitude is drawn in s; the system has it in m",
    ),
    "pure number": (lambda: mc.partials(REENTRY, {"altitude": "5"}), "altitude is drawn as a pure number; .* in m"),
    "no covariance": (lambda: mc.propagate_covariance(P, -np.eye(2)), "positive semidefinite; .* eigenvalue -1"),
    "asymmetric": (lambda: mc.propagate_covariance(P, np.triu(np.ones((2, 2)))), "must be symmetric"),
    "swapped": (lambda: mc.propagate_covariance(ERRORS, P), "partials must be a frame or a matrix .* got Errors"),  # type: ignore[arg-type]
    "outputs first": (lambda: mc.compare(DRAWS[["a"]], P), "covariance must be square, outputs by outputs; got shape"),
    "a covariance": (lambda: mc.compare(P @ P.T, DRAWS.cov()), "outputs must be samples, .*; got a covariance"),
    "other draws": (
        lambda: mc.compare(mc.propagate_covariance(P, ERRORS), total(ERRORS.draw(100, seed=2).to_numpy()), DRAWS, P),
        "not correlated with P times the draws: give the draws that were simulated",
    ),
    "a type alone": (lambda: mc.simulate("hover", DRAWS), "scenario.duration: is missing"),
    "one folder": (lambda: mc.compare_runs("run"), "takes a list of run folders, at least one; got 'run'"),
    "no jobs": (lambda: mc.run({"scenario": REENTRY}, "nowhere", jobs=0), "jobs must be a whole number of at least 1"),
    "a key": (lambda: mc.sweep({"scenario": REENTRY}, "errors.a"), "varied must be a mapping"),  # type: ignore[arg-type]
    "interval": (lambda: mc.identify(np.arange(2000.0), "0.1 s"), "interval must be a positive number, s; got '0.1 s'"),
    "function": (lambda: mc.lincov(total), r"got function; .* mcnav.Campaign\({'type': function"),  # type: ignore[arg-type]
    "object": (lambda: mc.Campaign(DoubleIntegrator(), {}), "got an object of DoubleIntegrator; give the class"),  # type: ignore[arg-type]
    "no log": (lambda: mc.read_imu_log("nowhere.csv"), "nowhere.csv: no such file"),
    "misspelt": (lambda: mc.simulat, "did you mean 'simulate'"),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_one_line(mistake: str) -> None:
    call, message = MISTAKES[mistake]
    with pytest.raises((ValueError, TypeError, mc.CampaignError, AttributeError), match=message) as refused:
        call()
    assert len(str(refused.value).splitlines()) == 1


def test_a_kink_and_noise_are_told() -> None:
    """Central differences of ``|a|`` are zero, exactly: only the short steps both ways show the kink."""
    random = np.random.default_rng(1)
    for function in (lambda e: np.abs(e[:, :1]), lambda e: random.normal(size=(len(e), 1))):
        with pytest.warns(UserWarning, match="P is doubtful: its steps differ by .* kink or a jump about no errors"):
            assert mc.partials(function, {"a": 1.0}).attrs["error"] > 0.01


class TestClosedLoops:
    """Given as a class or a table; what a filter believes where no campaign says it."""

    LOOP = {"scenario": DoubleIntegrator, "measurements": {"ranging": "1 m"}}  # noqa: RUF012

    def test_a_filter_believes_the_errors_of_the_draws(self) -> None:
        """As with the campaign that has them; and it does not believe that there are none."""
        errors = mc.Errors({"position": 3.0, "velocity": 0.5}, {("position", "velocity"): 0.4})
        draws = errors.draw(20, seed=1)
        campaign = mc.Campaign(**self.LOOP, errors=errors, samples=20)
        expected = mc.simulate(campaign, draws)
        pd.testing.assert_frame_equal(mc.simulate(self.LOOP, draws), expected, rtol=1e-9, atol=1e-9)
        pd.testing.assert_frame_equal(mc.partials(self.LOOP, errors), mc.partials(campaign, errors), atol=1e-9)
        with pytest.raises(ValueError, match="the filter needs the sigmas of the errors: draw them"):
            mc.simulate(self.LOOP, pd.DataFrame(draws.to_numpy(), columns=draws.columns))

    def test_sizes_that_are_missing_are_named_with_what_would_do(self) -> None:
        draws = mc.Errors({"position": 3.0}).draw(5)
        remedy = r"ranging needs a size .*mcnav.Campaign\(DoubleIntegrator, measurements={'ranging': '1 m'}\)"
        for loop in (DoubleIntegrator, DoubleIntegrator()):
            with (
                pytest.warns(UserWarning, match="is simulated without disturbance, whose sizes only a campaign has"),
                pytest.raises(ValueError, match=remedy),
            ):
                mc.simulate(loop, draws)

    def test_an_object_with_settings_of_its_own_is_not_taken_for_its_class(self) -> None:
        draws = mc.Errors({"position": 3.0}).draw(5)
        with pytest.raises(ValueError, match="got an object of Remembering with settings of its own; give the class"):
            mc.simulate(Remembering(0.3, 0.3), draws)
