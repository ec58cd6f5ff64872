"""Good measurements that are rejected, of filters that numpy runs: exact laws, the check values, and simulations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from mcnav.analysis.rejections import OnLinear, judge_rejections
from mcnav.analysis.withheld import probability_beyond
from mcnav.arrays.types import Array
from mcnav.contract.gates import RejectedErrors, RejectionLaws, RejectionReading
from mcnav.contract.quantities import Output

OUTPUTS = (Output("position", "m", "m"),)
FALSE_ALARM = 1e-4


def run(f: Array, q: Array, start: Array, noise: float, skipped: range, count: int) -> tuple[Array, Array, list[Array]]:
    """Run a filter that measures the first state after each step, but for a range of measurements.

    Returns the covariance at the end, its response to the whitened innovation of the first one that is skipped, and of
    each later measurement the variance that the filter believes in and its response.
    """
    covariance, response, innovations = start.copy(), np.zeros(len(start)), []
    for k in range(count):
        covariance, response = f @ covariance @ f.T + q, f @ response
        variance = covariance[0, 0] + noise
        innovations.append(np.array([variance, response[0]]))
        gain = covariance[:, 0] / variance
        if k in skipped:
            if k == skipped.start:
                response = gain * np.sqrt(variance)
            continue
        covariance, response = covariance - variance * np.outer(gain, gain), response - gain * response[0]
    return covariance, response, innovations


def laws(f: Array, q: Array, start: Array, noise: float, count: int, gate: float, size: int = 1) -> RejectionLaws:
    """Return the laws at the end, each first rejection by a filter of its own; M independent axes alike."""
    rows = []
    for k in range(count):
        once, innovation, later = run(f, q, start, noise, range(k, k + 1), count)
        never, never_response, _ = run(f, q, start, noise, range(k, count), count)
        correlation = later[k + 1][1] / np.sqrt(later[k + 1][0]) if k + 1 < count else np.nan
        rows.append([once[0, 0], innovation[0], never[0, 0], never_response[0], correlation])
    table, own = np.array(rows), run(f, q, start, noise, range(0), count)[0][0, 0]
    nothing = np.zeros((count, 1, size - 1))
    once, never = (
        RejectedErrors(variances[:, None] - own, np.concatenate([responses[:, None, None], nothing], axis=2))
        for variances, responses in (table[:, 0:2].T, table[:, 2:4].T)
    )
    return RejectionLaws(
        "", ("gnss",) * count, np.arange(1.0, count + 1.0), np.full(count, 1.0 - gate),
        np.full(count, stats.chi2.ppf(gate, size)), np.full(count, size), np.repeat(table[:, 4:], size, axis=1),
        (RejectionReading(float(count), np.array([own]), once, never),),
    )  # fmt: skip


def axis_at_rest() -> tuple[Array, Array, Array]:
    """Return a second of position, velocity and tilt: 0.1 deg/sqrt(h), 50 ug/sqrt(Hz); 5 m, 0.1 m/s, 0.3 mrad."""
    g, steps = 9.81, 200
    q, dt = np.zeros((3, 3)), 1.0 / steps
    fine = np.array([[1.0, dt, 0.5 * g * dt**2], [0.0, 1.0, g * dt], [0.0, 0.0, 1.0]])
    for _ in range(steps):
        q = fine @ q @ fine.T + dt * np.diag([0.0, (50e-6 * g) ** 2, (0.1 * np.pi / 180.0 / 60.0) ** 2])
    return np.linalg.matrix_power(fine, steps), q, np.diag([25.0, 0.01, 0.3e-3**2])


def test_the_check_values_of_a_lockout() -> None:
    """Eight minutes of positions in two axes, a gate of 0.9: digits that were computed elsewhere."""
    f, q, start = axis_at_rest()
    answer = judge_rejections(laws(f, q, start, 1.0, 480, 0.9, size=2), OUTPUTS, 0.05)
    assert answer.verdict == OnLinear.REFUSED
    assert answer.rms_once == pytest.approx([0.3514], abs=5e-5)
    assert answer.rms_never == pytest.approx([462.0], abs=0.5)
    again = [answer.first[k].next for k in (0, 1, 2, 400)]
    assert again == pytest.approx([0.764, 0.232, 0.163, 0.109], abs=5e-4)
    assert answer.largest_next == again[0]
    assert answer.expected_least == pytest.approx(48.0)
    assert answer.accepted_by_all == pytest.approx(0.9**480)
    assert [each.probability for each in answer.first[:3]] == pytest.approx([0.1, 0.09, 0.081])


def test_one_measurement_is_exact() -> None:
    """A constant of 5 m, measured with 2 m behind a gate of 99 %: check values of a mixture of two laws."""
    one = laws(np.eye(1), np.zeros((1, 1)), np.array([[25.0]]), 4.0, 1, 0.99)
    answer = judge_rejections(one, OUTPUTS, 0.05)
    assert answer.verdict == OnLinear.FAILS
    assert answer.exact
    limit = stats.chi2.ppf(0.99, 1)
    beyond = stats.chi2.sf(limit, 3) / 0.01  # of the rejected innovation's square
    square = 0.99 * 100.0 / 29.0 + 0.01 * (25.0 + (beyond - 1.0) * 25.0**2 / 29.0)
    assert answer.rms_once == pytest.approx([np.sqrt(square)], rel=1e-12)
    # 2.2956 and 1.2362 in a flight of ten seconds, in which gravity makes 5.0008 m of the 5 m
    assert answer.ratio == pytest.approx(1.2362, abs=1e-4)
    assert probability_beyond(one, 0, 6.0) == pytest.approx(0.0112, abs=5e-5)
    assert answer.first[0].next is None
    # sqrt(1 + 0.01 (c - 1) 25 / 29) of the sigma that the filter states: within 5 %
    assert answer.consistent


@pytest.mark.parametrize("gate", [0.9, 0.99])
def test_flights_of_which_the_first_rejection_is_the_only_one(gate: float) -> None:
    """Random walks with a slope, 8 measurements: flights by numpy, which reject once and then never again, or always.

    Moments at a false alarm of 1e-4 each, by their own standard errors.
    """
    f, q = np.array([[1.0, 1.0], [0.0, 1.0]]), np.diag([0.1, 0.01])
    start, noise, count = np.diag([9.0, 1.0]), 1.0, 200_000
    walk = laws(f, q, start, noise, 8, gate)
    answer = judge_rejections(walk, OUTPUTS, 0.05)
    assert answer.rms_once is not None
    assert answer.rms_never is not None
    generator, quantile = np.random.default_rng(53), stats.norm.isf(0.5 * FALSE_ALARM)
    for ever, rms in ((False, answer.rms_once[0]), (True, answer.rms_never[0])):
        errors = generator.standard_normal((count, 2)) @ np.linalg.cholesky(start).T
        covariances = np.tile(start, (count, 1, 1))
        first, again = np.full(count, -1), np.zeros(count, dtype=bool)
        for k in range(8):
            errors = errors @ f.T + generator.standard_normal((count, 2)) @ np.linalg.cholesky(q).T
            covariances = f @ covariances @ f.T + q
            variances = covariances[:, 0, 0] + noise
            innovations = errors[:, 0] + np.sqrt(noise) * generator.standard_normal(count)
            beyond = innovations**2 > walk.limits[0] * variances
            again |= beyond & (first == k - 1) & (first >= 0)
            rejected = (first >= 0) & ever | beyond & (first < 0)
            first[beyond & (first < 0)] = k
            gains = np.where(rejected[:, None], 0.0, covariances[:, :, 0] / variances[:, None])
            errors = errors - gains * innovations[:, None]
            covariances = covariances - variances[:, None, None] * gains[:, :, None] * gains[:, None, :]
        squares = errors[:, 0] ** 2
        assert abs(squares.mean() - rms**2) < quantile * squares.std() / np.sqrt(count)
        for k, each in enumerate(answer.first):
            low, high = stats.binom.ppf([0.5 * FALSE_ALARM, 1.0 - 0.5 * FALSE_ALARM], count, each.probability)
            assert low <= np.sum(first == k) <= high
            if each.next is not None:
                low, high = stats.binom.ppf([0.5 * FALSE_ALARM, 1.0 - 0.5 * FALSE_ALARM], np.sum(first == k), each.next)
                assert low <= np.sum(again[first == k]) <= high


def test_a_gate_that_rejects_next_to_nothing_holds() -> None:
    f, q, start = axis_at_rest()
    answer = judge_rejections(laws(f, q, start, 1.0, 30, 1.0 - 1e-7), OUTPUTS, 0.05)
    assert answer.verdict == OnLinear.HOLDS
    assert answer.consistent
    assert 1.0 < answer.ratio < 1.05


def test_nothing_is_said_of_innovations_that_have_another_law() -> None:
    nothing = np.zeros(0)
    answer = judge_rejections(
        RejectionLaws("inconsistent", (), nothing, nothing, nothing, nothing.astype(int), np.zeros((0, 0)), ()),
        OUTPUTS,
        0.05,
    )
    assert answer.verdict == OnLinear.REFUSED
    assert answer.expected_least is None
    assert not answer.consistent
