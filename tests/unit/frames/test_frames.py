"""The four functions: the same bits for any number of jobs, P and P S P' by hand, verdicts against closed forms."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
import pandas as pd
import pytest

import mcnav as mc
from mcnav.frames import simulation

REENTRY = {"type": "reentry", "trajectory": 4}
ERRORS = mc.Errors({"a": 1.0, "b": 0.3, "c": 0.2}, correlations={("a", "b"): 0.4})


def linear(errors: Any) -> Any:
    """Two outputs, linear in three sources."""
    return np.column_stack([errors[:, 0] + 2.0 * errors[:, 1], 3.0 * errors[:, 2]])


P = np.array([[1.0, 2.0, 0.0], [0.0, 0.0, 3.0]])


class TestSimulate:
    def test_any_number_of_jobs(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Processes are started for a function, threads for a reentry; the bits are those of one worker."""
        monkeypatch.setattr(simulation, "COST", {"loky": 0.0, "threading": 0.0})
        draws = ERRORS.draw(20_000, seed=1)
        one, two = (mc.simulate(linear, draws, jobs=jobs, outputs=["x", "y"]) for jobs in (1, 2))
        pd.testing.assert_frame_equal(one, two, check_exact=True)
        np.testing.assert_array_equal(one, linear(draws.to_numpy()))
        flown = mc.Errors({"altitude": "5 km"}).draw(20_000, seed=1)
        pd.testing.assert_frame_equal(*(mc.simulate(REENTRY, flown, jobs=jobs) for jobs in (1, 2)), check_exact=True)

    def test_what_happens_once_starts_no_workers(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """A first call that takes ten times what workers cost, as compilation does, is not the cost of a chunk."""
        monkeypatch.setattr(simulation, "COST", {"loky": 0.05})
        monkeypatch.setattr(simulation, "_by_workers", None)  # which a call would find out
        compiled: list[bool] = []

        def slow_at_first(errors: Any) -> Any:
            if not compiled:
                time.sleep(0.5)
                compiled.append(True)
            return errors[:, :1]

        draws = mc.Errors({"a": 1.0}).draw(100_000, seed=1)
        assert len(mc.simulate(slow_at_first, draws, jobs=2, outputs=["x"])) == 100_000

    def test_a_failed_sample_is_a_row_with_its_reason(self) -> None:
        def fails(errors: Any) -> Any:
            if (errors[:, 0] > 1.0).any():
                raise ArithmeticError("no fuel")
            return np.where(errors[:, :1] < -1.0, np.nan, errors[:, :1])

        draws = ERRORS.draw(100, seed=1)
        with pytest.warns(UserWarning, match=r"a call with many samples failed \(ArithmeticError: no fuel\)"):
            out = mc.simulate(fails, draws, outputs=["x"])
        high, low = draws["a"] > 1.0, draws["a"] < -1.0
        assert set(out.loc[high, "reason"]) == {"ArithmeticError: no fuel"}
        assert set(out.loc[low, "reason"]) == {"an output is not finite"}
        assert set(out.loc[~high & ~low, "reason"]) == {""}
        assert out["x"].isna().equals(high | low)
        assert out.attrs["failed"] == int((high | low).sum()) > 0

    def test_names_of_outputs(self) -> None:
        draws = ERRORS.draw(5, seed=1)
        assert list(mc.simulate(linear, draws)) == ["y1", "y2"]
        assert list(mc.simulate(lambda errors: pd.DataFrame({"u": errors[:, 0]}), draws)) == ["u"]
        assert list(mc.simulate(lambda errors: errors[:, 0], draws, outputs=["x"])) == ["x"]

    def test_objects_with_propagate_and_fly_are_given_their_own_order(self) -> None:
        class Mine:
            sources = (mc.Source("b", "m", "m", 1.0), mc.Source("z", "m", "m", 1.0), mc.Source("a", "m", "m", 1.0))
            outputs = (mc.Output("x", "m", "m"),)

            def propagate(self, errors: Any) -> Any:
                return errors @ np.array([[1.0], [10.0], [100.0]])

        class Single(Mine):
            propagate = None

            def fly(self, errors: Any) -> Any:
                return errors @ np.array([[1.0], [10.0], [100.0]])

        del Single.propagate
        draws = mc.Errors({"a": 1.0, "b": 1.0}).draw(10, seed=1)
        expected = 100.0 * draws["a"] + draws["b"]
        out = mc.simulate(Mine(), draws)
        np.testing.assert_allclose(out["x"], expected, rtol=1e-14)
        assert out.attrs["units"] == {"x": "m"}
        with pytest.raises(ValueError, match="no error source 'c'"):
            mc.simulate(Mine(), mc.Errors({"c": 1.0}).draw(10))

    @pytest.mark.parametrize(
        ("system", "error", "message"),
        [
            (5, TypeError, "got int; expected a function, an object with propagate or fly, or a campaign"),
            (REENTRY, ValueError, "no error source 'a'"),
            (lambda errors: 1.0 / 0.0, ValueError, "failed for each of the first 5 samples: ZeroDivisionError"),
        ],
    )
    def test_what_is_no_system(self, system: Any, error: type[Exception], message: str) -> None:
        with pytest.raises(error, match=message):
            mc.simulate(system, ERRORS.draw(5))


class TestPartials:
    def test_differences_of_a_function(self) -> None:
        partials = mc.partials(linear, ERRORS, outputs=["x", "y"])
        np.testing.assert_allclose(partials, P, atol=1e-11)
        assert partials.attrs["error"] < 1e-9
        assert list(partials.index) == ["x", "y"]
        assert list(partials.columns) == ["a", "b", "c"]

    def test_a_scenario_has_equations_whose_error_is_against_differences(self) -> None:
        errors = mc.Errors({"gyro_drift": "0.2 deg/h", "altitude": "5 km"})
        partials = mc.partials(REENTRY, errors)
        answer = mc.lincov({"scenario": REENTRY, "errors": errors})
        # of the end alone, and among epochs: equal but for rounding
        pd.testing.assert_frame_equal(partials, answer.partials[list(partials)], rtol=1e-12, atol=0.0)
        assert 0.0 < partials.attrs["error"] < 1e-8
        covariance = mc.propagate_covariance(partials, errors)
        np.testing.assert_allclose(covariance, answer.covariance, rtol=1e-12)

    def test_a_function_that_fails_at_the_nominal(self) -> None:
        with pytest.raises(ValueError, match="its flight without any error failed"):
            mc.partials(lambda errors: np.where(errors[:, :1] == 0.0, np.nan, errors[:, :1]), {"a": 1.0})


class TestPropagation:
    def test_by_hand(self) -> None:
        frame = pd.DataFrame(P, index=["x", "y"], columns=["a", "b", "c"])
        expected = P @ ERRORS.covariance.to_numpy() @ P.T
        shuffled = ERRORS.covariance.loc[["c", "a", "b"], ["c", "a", "b"]]
        for covariance in (ERRORS, ERRORS.covariance, shuffled):
            np.testing.assert_allclose(mc.propagate_covariance(frame, covariance), expected, rtol=1e-14)
        np.testing.assert_allclose(mc.propagate_covariance(P, ERRORS.covariance.to_numpy()), expected, rtol=1e-14)

    def test_other_sources_are_refused(self) -> None:
        frame = pd.DataFrame(P, index=["x", "y"], columns=["a", "b", "d"])
        with pytest.raises(ValueError, match="must list the same sources; got a, b, d and a, b, c"):
            mc.propagate_covariance(frame, ERRORS)
        with pytest.raises(ValueError, match="must be finite"):
            mc.propagate_covariance(np.full((1, 1), np.nan), np.eye(1))


class TestComparison:
    def test_a_linear_system_agrees_exactly_when_paired(self) -> None:
        draws = ERRORS.draw(2_000, seed=4)
        partials = mc.partials(linear, ERRORS)
        covariance = mc.propagate_covariance(partials, ERRORS)
        paired = mc.compare(covariance, mc.simulate(linear, draws), draws, partials)
        assert (paired.verdict, paired.joint) == ("agrees", "agrees")
        # P by differences is right to 1e-11
        np.testing.assert_allclose(paired.frame["ratio_paired"], 1.0, atol=1e-9)
        assert paired.nees == pytest.approx(2.0, abs=1e-8)

    def test_a_quadratic_one_has_the_sigma_of_theory(self) -> None:
        """Y = a + k (a^2 - 1): sigma sqrt(1 + 2 k^2), while linear analysis has one."""
        k = 0.5
        errors = mc.Errors({"a": 1.0})
        draws = errors.draw(50_000, seed=5)

        def bent(values: Any) -> Any:
            return values + k * (values**2 - 1.0)

        partials = mc.partials(bent, errors)
        out, covariance = mc.simulate(bent, draws), mc.propagate_covariance(partials, errors)
        plain, paired = mc.compare(covariance, out), mc.compare(covariance, out, draws, partials)
        truth = math.sqrt(1.0 + 2.0 * k**2)
        for verdict in (plain, paired):
            row = verdict.frame.loc["y1"].rename(lambda name: name.replace("_paired", "").replace("_plain", ""))
            assert verdict.verdict == "differs"
            assert row["ratio_from"] < truth < row["ratio_to"]  # at 97.5 %, one fixed seed
            assert "Do not use this covariance for y1" in str(verdict)
        width = {
            v.paired: np.ptp(v.frame.filter(regex="_(from|to)$").loc["y1"].to_numpy(float)) for v in (plain, paired)
        }
        assert width[True] < width[False] * 1.2

    def test_a_thin_direction_is_partly(self) -> None:
        """Each sigma agrees, and the difference of two outputs does not."""
        errors = mc.Errors({"a": 1.0, "b": 0.01})
        draws = errors.draw(20_000, seed=6)

        def thin(values: Any) -> Any:
            a, b = values.T
            return np.column_stack([a, a + b + 0.02 * a**2])

        partials = mc.partials(thin, errors)
        covariance = mc.propagate_covariance(partials, errors)
        verdict = mc.compare(covariance, mc.simulate(thin, draws), draws, partials)
        assert (verdict.verdict, verdict.joint) == ("partly", "differs")
        # In the thin direction b + 0.02 (a^2 - 1) has sigma sqrt(1e-4 + 2 * 4e-4) where linear analysis has 0.01.
        assert verdict.worst_ratio == pytest.approx(3.0, rel=0.05)
        assert "Do not gate or fuse with it" in verdict.sentence
        np.testing.assert_allclose(np.abs(verdict.worst_direction), math.sqrt(0.5), rtol=0.01)

    def test_too_few_samples_name_the_number_that_decides(self) -> None:
        verdict = mc.compare(np.eye(1), np.random.default_rng(1).normal(size=(60, 1)))
        assert verdict.verdict == "undecided"
        assert "simulate at least 100" in verdict.sentence

    def test_failed_samples_are_counted(self) -> None:
        samples = np.random.default_rng(1).normal(size=(20_000, 1))
        samples[::100] = np.nan
        verdict = mc.compare(np.eye(1), samples)
        assert (verdict.samples, verdict.failed, verdict.verdict) == (19_800, 200, "undecided")
        assert "200 of 20,000 samples failed" in verdict.sentence

    def test_the_share_of_false_alarms(self) -> None:
        """Intervals of a right covariance hold together in 95 % of 400 trials or more.

        The standard error of that share is 1.1 %: below 91 % lie fewer than one in a thousand such tests.
        """
        generator, held = np.random.default_rng(2), 0
        for _ in range(400):
            frame = mc.compare(np.eye(2), generator.normal(size=(500, 2))).frame
            held += bool(((frame["ratio_plain_from"] <= 1.0) & (frame["ratio_plain_to"] >= 1.0)).all())
        assert held >= 0.91 * 400

    def test_what_does_not_fit_together(self) -> None:
        draws = ERRORS.draw(500, seed=1)
        out, partials = mc.simulate(linear, draws), mc.partials(linear, ERRORS)
        covariance = mc.propagate_covariance(partials, ERRORS)
        with pytest.raises(ValueError, match="needs both draws and partials"):
            mc.compare(covariance, out, draws)
        with pytest.raises(ValueError, match="must list the same outputs"):
            mc.compare(covariance.rename(index={"y1": "z"}, columns={"y1": "z"}), out)
        with pytest.raises(ValueError, match="is not P S P' of these partials and draws for y1, y2"):
            mc.compare(4.0 * covariance, out, draws, partials)
        with pytest.raises(ValueError, match="tolerance must be between 0 and 1"):
            mc.compare(covariance, out, tolerance=0.0)
        with pytest.raises(ValueError, match="finite and positive semidefinite"):
            mc.compare(-np.eye(2), out)

    def test_noise_that_p_s_p_leaves_out_is_said(self) -> None:
        partials = mc.partials(linear, ERRORS)
        partials.attrs["noise"] = {"gusts": {"y1": 1.0, "y2": 0.0}}
        verdict = mc.compare(mc.propagate_covariance(partials, ERRORS), mc.simulate(linear, ERRORS.draw(500)))
        assert "leaves out the noise of gusts" in verdict.sentence
