"""Fixed-interval smoothers in linear analysis: held values, and a smoother of Rauch, Tung and Striebel written here."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from mcnav._types import Array
from mcnav.contract.samples import Batch
from mcnav.systems.ins.imu.instruments import Imu, Noise
from mcnav.systems.ins.linear.closed_loop import (
    ClosedLoop,
    constant_disturbances,
    driving_processes,
    propagate_closed_loop,
    true_loop,
)
from mcnav.systems.ins.linear.covariance import output_map
from mcnav.systems.ins.linear.smoothed_loop import smooth_closed_loop
from mcnav.systems.ins.linear.smoother import SmoothedLoop, SmoothedProcesses, run_smoother
from mcnav.systems.ins.scenario import Ins, Navigation
from tests.aided import make_filter, make_sensor, sized
from tests.flights import flight

STEPS = 160
TIME, DENSITY, VARIANCE = 1.0, 0.01, 4.0
OVER = np.array([[1.0, TIME], [0.0, 1.0]])
NOISE = DENSITY * np.array([[TIME**3 / 3.0, TIME**2 / 2.0], [TIME**2 / 2.0, TIME]])


def steady(believed: float) -> tuple[Array, Array]:
    """Return the steady gain of a filter of a double integrator, and its covariance after the update."""
    p = np.eye(2)
    for _ in range(5_000):
        ahead = OVER @ p @ OVER.T + NOISE
        gain = ahead[:, :1] / (ahead[0, 0] + believed)
        p = ahead - gain @ ahead[:1]
    return gain, p


@pytest.mark.parametrize(
    ("believed", "claimed", "true"),
    [(4.0, (0.562340084, 0.125744703), (0.562340084, 0.125744703)),
     (1.0, (0.334367155, 0.105741685), (0.602794028, 0.139872798))],
)  # fmt: skip
def test_held_values_of_a_double_integrator(
    believed: float, claimed: tuple[float, float], true: tuple[float, float]
) -> None:
    """Position and velocity in the interior of a long record, matched and with a believed variance of 1 for 4.

    The nine printed digits were computed in two other ways; ends are further away than the filter remembers.
    """
    gain, p = steady(believed)
    response, variance = np.array([[1.0, 0.0]]), (OVER @ p @ OVER.T + NOISE)[0, 0] + believed
    first = np.concatenate([[0], np.arange(STEPS + 1)])
    ones = np.ones((STEPS, 1, 1))
    loop = SmoothedLoop(
        first, np.ones(STEPS, dtype=np.int64), OVER * ones, response * ones, gain * ones, np.sqrt(variance) * ones,
        OVER * ones, response * ones, gain * ones, np.zeros((STEPS, 2, 0)), np.zeros((STEPS, 1, 0)),
    )  # fmt: skip
    added = np.zeros((STEPS, 3, 3))
    added[:, :2, :2] = NOISE
    nothing = (np.zeros((STEPS, 2, 1)), np.ones((STEPS, 1)))
    seen, measured = np.zeros((STEPS, 1, 2, 1)), np.stack([np.zeros((STEPS, 1)), np.full((STEPS, 1), VARIANCE)], axis=2)
    processes = SmoothedProcesses(
        (nothing[0], nothing[0]), (nothing[1], nothing[1]), (added, np.zeros_like(added)), seen, measured
    )  # fmt: skip
    middle = np.array([STEPS // 2])
    back = run_smoother(loop, processes, middle, np.ones(1), np.array([STEPS]))
    lam, state, noise = back.own[0], back.state[0], back.noise[0].sum(axis=0)
    assert np.sqrt(np.diag(p - p @ lam @ p)) == pytest.approx(claimed, rel=1e-8)
    # the true covariance of the filter's errors, with its own gain
    c, left = np.eye(2), np.eye(2) - gain @ response
    for _ in range(5_000):
        c = left @ (OVER @ c @ OVER.T + NOISE) @ left.T + VARIANCE * gain @ gain.T
    of_error = np.eye(2) - p @ state
    assert np.sqrt(np.diag(of_error @ c @ of_error.T + p @ noise @ p)) == pytest.approx(true, rel=1e-8)


START, END = 300.0, 420.0
SIGMAS = {
    "position": 10.0,
    "velocity": 0.1,
    "tilt": 1e-3,
    "heading": 3e-3,
    "gyro_bias": 2e-6,
    "accelerometer_bias": 5e-3,
}
NEGLECTED = {"accelerometer_scale": 1e-3, "gnss_position_bias": 1.0}
UNIT = Imu(
    Noise(np.full(3, 6e-6), np.full(3, 3e-6), np.full(3, 60.0), np.full(3, 1e-8)),
    Noise(np.full(3, 2e-3), np.full(3, 1e-3), np.full(3, 40.0)),
)


def aided(noise: float = 3.0, believed: float = 3.0) -> Ins:
    """Aid by positions each 2 s, but for an outage of 40 s; the filter neglects scale factors and correlated errors."""
    times = np.arange(START + 2.0, END + 0.5, 2.0)
    times = times[(times < 340.0) | (times >= 380.0)]
    sensor = make_sensor("gnss", times, {"position": noise}, 2.0, 30.0)
    seen = make_sensor("gnss", times, {"position": believed})
    model = make_filter((seen,), UNIT, SIGMAS, ("gyro_bias", "accelerometer_bias"))
    return Ins(Navigation(flight(1.0), "strapdown", START, END, UNIT, (sensor,), model))


def whole(loop: ClosedLoop) -> tuple[list[Array], list[Array]]:
    """Return F and Q of the filter over the steps."""
    tables, transitions = loop.filter, []
    for k in range(len(loop.transition)):
        f = np.diag(np.concatenate([np.ones(9), tables.decay[k]]))
        f[:9] = np.concatenate([loop.transition[k], tables.coupling[k]], axis=1)
        transitions.append(f)
    return transitions, list(tables.noise)


def rauch_tung_striebel(loop: ClosedLoop, last: int) -> list[Array]:
    """Smooth the covariances at the loop's times up to a last one by inverses of P, after the updates there."""
    transitions, noises = whole(loop)
    rows = np.concatenate([loop.measurements.rows, loop.filter.rows], axis=2)
    p, before, after = loop.filter.initial, [], []
    for k in range(last + 1):
        if k:
            p = transitions[k - 1] @ p @ transitions[k - 1].T + noises[k - 1]
        before.append(p)
        for u in range(loop.first_updates[k], loop.first_updates[k + 1]):
            h, r = rows[u], np.diag(loop.filter.variances[u])
            gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + r)
            left = np.eye(len(p)) - gain @ h
            p = left @ p @ left.T + gain @ r @ gain.T
        after.append(p)
    smoothed = [after[-1]]
    for k in range(last - 1, -1, -1):
        scale = np.sqrt(np.diag(before[k + 1]))
        inverse = np.linalg.inv(before[k + 1] / np.outer(scale, scale)) / np.outer(scale, scale)
        back = after[k] @ transitions[k].T @ inverse
        smoothed.append(after[k] + back @ (smoothed[-1] - before[k + 1]) @ back.T)
    return smoothed[::-1]


def test_what_it_claims_through_an_outage() -> None:
    """Against inverses of covariances, whose condition of 1e8 and more costs as many of the sixteen digits."""
    loop = aided().navigation.aided.loop  # type: ignore[union-attr]
    places = np.arange(0, len(loop.times), 7)
    found = smooth_closed_loop(loop, places, np.ones(len(places)))
    expected = rauch_tung_striebel(loop, len(loop.times) - 1)
    plain = propagate_closed_loop(loop, places, np.ones(len(places)))

    for place, number in enumerate(places):
        to_outputs = output_map(loop.truth, float(loop.times[number]))
        sigma = np.sqrt(np.diag(to_outputs @ expected[number][:9, :9] @ to_outputs.T))
        np.testing.assert_allclose(np.sqrt(np.diag(found.own[place])), sigma, rtol=1e-6)
    own = np.sqrt(np.diagonal(plain.own, axis1=1, axis2=2)) / np.sqrt(np.diagonal(found.own, axis1=1, axis2=2))
    assert np.all(own > 1.0 - 1e-9)
    assert own[:, :3].max() > 3.0


def test_what_it_claims_with_a_lag() -> None:
    """Against the same inverses with the measurements up to 11 s later, in which an outage begins or ends."""
    loop = aided().navigation.aided.loop  # type: ignore[union-attr]
    places = np.searchsorted(loop.times, [305.0, 331.0, 371.0, 415.0])
    found = smooth_closed_loop(loop, places, np.ones(len(places)), 11.0)
    for place, number in enumerate(places):
        last = int(np.searchsorted(loop.times, loop.times[number] + 11.0 + 1e-6)) - 1
        smoothed = rauch_tung_striebel(loop, last)[number]
        to_outputs = output_map(loop.truth, float(loop.times[number]))
        sigma = np.sqrt(np.diag(to_outputs @ smoothed[:9, :9] @ to_outputs.T))
        np.testing.assert_allclose(np.sqrt(np.diag(found.own[place])), sigma, rtol=1e-6)


@pytest.mark.parametrize("lag", [np.inf, 11.0])
def test_samples_of_a_mismatched_smoother(lag: float) -> None:
    """Squares of 512 samples' errors behind it over what is linear lie in chi-square intervals (1e-4 in all).

    At the last epoch the errors are those of the filter; a lag beyond the end is a fixed interval.
    """
    of = aided(3.0, 1.0)
    model = replace(of.navigation.filter, lag=lag)  # type: ignore[type-var]
    scenario = Ins(replace(of.navigation, filter=model, further=(331.0, 371.0)))
    sizes = sized(scenario.navigation.sensors, SIGMAS | NEGLECTED)
    errors = np.random.default_rng(5).standard_normal((512, len(sizes))) * sizes
    engine = scenario.engine("shared-gains", errors[:8])
    found = engine.simulate(Batch(np.arange(512), errors, 7))
    assert found.smoothed_history is not None
    assert found.history is not None
    np.testing.assert_allclose(found.smoothed_history[:, -1], found.history[:, -1], rtol=0.0, atol=1e-12)
    linear = scenario.smoothed()
    true = np.diagonal(linear.covariance(np.diag(sizes**2)), axis1=1, axis2=2)
    ratio = (found.smoothed_history**2).mean(axis=0) / true
    low, high = stats.chi2.ppf([5e-5 / ratio.size, 1.0 - 5e-5 / ratio.size], 512) / 512
    assert np.all((low < ratio) & (ratio < high))
    # the claimed covariance: mean NEES of a group is its trace
    assert linear.own is not None
    assert found.smoother_values is not None
    claims = np.linalg.inv(linear.own[:, :3, :3])
    behind = found.smoothed_history[:, :, :3]
    expected = np.einsum("nmi,mij,nmj->nm", behind, claims, behind)
    np.testing.assert_allclose(found.smoother_values[:, :, 1], expected, rtol=1e-3)
    assert (np.sqrt(true) / np.sqrt(np.diagonal(linear.own, axis1=1, axis2=2))).max() > 2.0


def test_before_and_after_an_update_it_is_the_same() -> None:
    loop = aided().navigation.aided.loop  # type: ignore[union-attr]
    number = int(np.searchsorted(loop.times, 320.0))
    assert loop.first_updates[number] < loop.first_updates[number + 1]
    found = smooth_closed_loop(loop, np.array([number, number]), np.array([0.0, 1.0]))
    one, other = (total(found.partials[n], {name: each[n] for name, each in found.processes.items()}) for n in (0, 1))
    sigma = np.sqrt(np.diag(one))
    assert np.all(np.abs(one - other) <= 1e-9 * np.outer(sigma, sigma))
    assert np.all(np.abs(found.own[0] - found.own[1]) <= 1e-9 * np.outer(sigma, sigma))


def total(partials: Array, processes: dict[str, Array]) -> Array:
    sizes = sized(aided().navigation.sensors, SIGMAS | NEGLECTED)
    return np.asarray(partials @ np.diag(sizes**2) @ partials.T + sum(processes.values()))


def test_a_smoother_that_believes_the_truth_has_the_covariance_that_it_claims() -> None:
    """With the same sensor as the truth, and nothing neglected."""
    times = np.arange(START + 2.0, END + 0.5, 2.0)
    sensor = make_sensor("gnss", times[(times < 340.0) | (times >= 380.0)], {"position": 3.0}, 2.0, 30.0)
    model = make_filter((sensor,), UNIT, SIGMAS, ("gyro_bias", "accelerometer_bias", "gnss_bias"))
    of = Ins(Navigation(flight(1.0), "strapdown", START, END, UNIT, (sensor,), model))
    loop = of.navigation.aided.loop  # type: ignore[union-attr]
    places = np.arange(0, len(loop.times), 9)
    found = smooth_closed_loop(loop, places, np.ones(len(places)))
    sizes = sized((sensor,), SIGMAS)
    for place in range(len(places)):
        true = found.partials[place] @ np.diag(sizes**2) @ found.partials[place].T
        true = true + sum(each[place] for each in found.processes.values())
        sigma = np.sqrt(np.diag(found.own[place]))
        assert np.all(np.abs(true - found.own[place]) <= 1e-9 * np.outer(sigma, sigma))


def test_true_errors_of_a_mismatched_smoother_are_those_of_samples() -> None:
    """Errors of 4,000 linear samples, smoothed here with the filter's beliefs, lie in chi-square intervals (1e-4).

    The samples have constant errors that the filter neglects, of the sensor too, and correlated errors of it.
    """
    of = aided(3.0, 1.0)
    loop = of.navigation.aided.loop  # type: ignore[union-attr]
    readings = np.array([5, 40, 55, len(loop.times) - 1])
    found = smooth_closed_loop(loop, readings, np.ones(len(readings)))
    expected = np.stack(
        [
            total(partials, {name: each[n] for name, each in found.processes.items()})
            for n, partials in enumerate(found.partials)
        ]
    )
    sampled = smoothed_samples(of, loop, readings, 4_000)

    ratio = (sampled**2).mean(axis=0) / np.diagonal(expected, axis1=1, axis2=2)
    low, high = stats.chi2.ppf([5e-5 / ratio.size, 1.0 - 5e-5 / ratio.size], 4_000) / 4_000
    assert np.all((low < ratio) & (ratio < high))
    claimed = np.sqrt(np.diagonal(found.own, axis1=1, axis2=2))
    assert (np.sqrt(np.diagonal(expected, axis1=1, axis2=2)) / claimed).max() > 2.0


def smoothed_samples(of: Ins, loop: ClosedLoop, readings: Array, count: int) -> Array:
    """Run linear samples forward through the closed loop, and smooth their innovations backwards: (n, m, 9)."""

    generator = np.random.default_rng(8)
    true, processes = true_loop(loop), driving_processes(loop)
    inputs, disturbances = constant_disturbances(loop)
    errors = generator.standard_normal((count, inputs.shape[2])) * sized(of.navigation.sensors, SIGMAS | NEGLECTED)
    states = len(loop.filter.constants)
    x = np.zeros((count, 9 + states))
    x[:, :9] = errors[:, :9] @ np.linalg.inv(output_map(loop.truth, float(loop.times[0]))).T
    bias = np.stack([np.sqrt(p.variance[0, 0]) * generator.standard_normal(count) for p in processes.values()])
    true_state = np.zeros((count, states))

    def errors_of_states() -> Array:
        for place, number in enumerate(loop.filter.constants):
            true_state[:, place] = errors[:, number] if number >= 0 else 0.0
            for b, name in enumerate(processes):
                true_state[:, place] += bias[b] * (name in loop.filter.processes[place])
        return np.concatenate([x[:, :9], true_state - x[:, 9:]], axis=1)

    transitions, noises = whole(loop)
    rows = np.concatenate([loop.measurements.rows, loop.filter.rows], axis=2)
    p, kept, innovations = loop.filter.initial, [], []
    for k in range(len(loop.times)):
        for u in range(loop.first_updates[k], loop.first_updates[k + 1]):
            n = x @ true.updates.rows[u].T + errors @ disturbances[u].T
            for b, process in enumerate(processes.values()):
                n += bias[b][:, None] * process.seen[u, :, 0]
                n += np.sqrt(process.measured[u]) * generator.standard_normal(n.shape)
            x = x - n @ true.gains[u].T
            h, r = rows[u], np.diag(loop.filter.variances[u])
            s = h @ p @ h.T + r
            left = np.eye(len(p)) - p @ h.T @ np.linalg.inv(s) @ h
            innovations.append((h.T @ np.linalg.inv(s), n, left))
            p = left @ p @ left.T + p @ h.T @ np.linalg.inv(s) @ r @ np.linalg.inv(s) @ h @ p
        kept.append((errors_of_states(), p))
        if k == len(loop.transition):
            break
        driven = errors @ inputs[k].T
        following = x @ true.steps.rows[k].T + driven
        for b, process in enumerate(processes.values()):
            covariance = np.zeros((10, 10))
            covariance[:9, :9], covariance[9, 9] = process.noise.white[k], process.noise.driven[k, -1]
            covariance[:9, 9] = covariance[9, :9] = process.noise.cross[k, :, -1]
            scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
            values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
            noise = generator.standard_normal((count, 10)) @ (vectors * np.sqrt(np.maximum(values, 0.0))).T * scale
            following += bias[b][:, None] * process.response[k, :, 0] + noise[:, :9]
            bias[b] = process.decay[k] * bias[b] + noise[:, 9]
        x = np.concatenate([following, x[:, 9:] * loop.filter.decay[k]], axis=1)
        p = transitions[k] @ p @ transitions[k].T + noises[k]
    found, adjoint, u = {}, np.zeros((count, len(p))), len(innovations)
    for k in range(len(loop.times) - 1, -1, -1):
        if k < len(loop.transition):
            adjoint = adjoint @ transitions[k]
        z, p = kept[k]
        found[k] = (z - adjoint @ p)[:, :9] @ output_map(loop.truth, float(loop.times[k])).T
        for _ in range(loop.first_updates[k], loop.first_updates[k + 1]):
            u -= 1
            weight, n, left = innovations[u]
            adjoint = n @ weight.T + adjoint @ left
    return np.stack([found[int(k)] for k in readings], axis=1)
