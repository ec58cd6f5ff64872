"""Fixed-interval smoothers in linear analysis: held values, and a smoother of Rauch, Tung and Striebel written here."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from mcnav.arrays.types import Array
from mcnav.contract.samples import Batch
from mcnav.systems.ins.filter.tables import noise_matrices
from mcnav.systems.ins.imu.instruments import Imu, Noise
from mcnav.systems.ins.linear.aided_errors import propagate_closed_loop, smooth_closed_loop
from mcnav.systems.ins.linear.closed_loop import ClosedLoop
from mcnav.systems.ins.linear.covariance import output_map
from mcnav.systems.ins.scenario import Ins, Navigation
from tests.aided import make_filter, make_sensor, sized
from tests.flights import flight

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
    tables, over = loop.filter, []
    for k, transition in enumerate(tables.whole.transitions):
        f = np.diag(np.concatenate([np.ones(9), tables.whole.decay[k]]))
        f[:9] = transition
        over.append(f)
    return over, list(noise_matrices(tables.whole.noise))


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
    generator, timeline = np.random.default_rng(8), loop.timeline
    assert timeline.filter is not None
    assert timeline.updates is not None
    updates, place = timeline.updates, timeline.filter.place
    errors = generator.standard_normal((count, timeline.sources)) * sized(of.navigation.sensors, SIGMAS | NEGLECTED)
    constants = np.append(errors, np.ones((count, 1)), axis=1)

    def drawn(covariance: Array) -> Array:
        scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
        values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
        return generator.standard_normal((count, len(scale))) @ (vectors * np.sqrt(np.maximum(values, 0.0))).T * scale

    x = constants @ timeline.start.partials.T
    for covariance in timeline.sized(timeline.start.noise).values():
        x += drawn(covariance)
    over, noises = whole(loop)
    p, kept, innovations, u = loop.filter.initial, {}, [], 0
    for position, is_update in enumerate(timeline.is_update):
        kept[position] = x, p
        if is_update:
            n = x @ updates.responses[u].T + constants @ updates.disturbances[u].T
            for variances in updates.variances.values():
                n += np.sqrt(variances[u]) * generator.standard_normal(n.shape)
            h, r = timeline.filter.responses[u], np.diag(timeline.filter.variances[u])
            weight = h.T @ np.linalg.inv(h @ p @ h.T + r)
            left = np.eye(len(p)) - p @ weight @ h
            innovations.append((weight, n, left))
            x, p, u = x - n @ (place @ p @ weight).T, left @ p @ left.T + p @ weight @ r @ weight.T @ p, u + 1
            continue
        k = position - u
        steps = timeline.steps(k, k + 1)
        x = x @ steps.transitions[0].T + constants @ steps.inputs[0].T
        for name, noise in steps.noise.items():
            x[:, noise.rows] += drawn(timeline.sizes[name] * noise.covariances[0])
        p = over[k] @ p @ over[k].T + noises[k]
    kept[timeline.end] = x, p
    smoothed, adjoint = {}, np.zeros((count, len(p)))
    for position in range(timeline.end, -1, -1):
        if position < timeline.end:
            if timeline.is_update[position]:
                weight, n, left = innovations[timeline.updates_before[position]]
                adjoint = n @ weight.T + adjoint @ left
            else:
                adjoint = adjoint @ over[timeline.steps_before[position]]
        x, p = kept[position]
        of_state, of_constants = timeline.filter.true_errors(position)
        smoothed[position] = (x @ of_state.T + constants @ of_constants.T - adjoint @ p)[:, :9]
    positions = loop.positions(readings, np.ones(len(readings)))
    maps = [output_map(loop.truth, float(time)).T for time in loop.times[readings]]
    return np.stack([smoothed[position] @ to for position, to in zip(positions.tolist(), maps, strict=True)], axis=1)
