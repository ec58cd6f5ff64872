"""Transfer alignment by a master on a structure that bends: geometry, covariances, samples and both engines."""

from __future__ import annotations

import re
import tomllib
from copy import deepcopy
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from scipy import stats
from scipy.linalg import expm

from mcnav.arrays.types import Array
from mcnav.config.read import parse_campaign
from mcnav.errors import CampaignError
from mcnav.systems.ins.aided import AidedNavigation
from mcnav.systems.ins.ensemble.aided import GivenNoise, simulate_aided
from mcnav.systems.ins.ensemble.conditional import Measured, NoiseSystem
from mcnav.systems.ins.imu.instruments import Imu, Noise
from mcnav.systems.ins.reference.aided import AidedMechanization
from mcnav.systems.ins.scenario import Navigation
from mcnav.systems.ins.sensors.aiding import Sensor
from mcnav.systems.ins.sensors.flexure import Flexure
from mcnav.systems.ins.sensors.measurements import measure
from tests.aided import make_filter, make_sensor, propagated_at_once, sized
from tests.conftest import ROOT
from tests.flights import flight

BEGIN, END = 600.0, 616.0
ARM = (-3.0, -2.0, 0.5)
BENT = Flexure((1e-3, 2e-3, 5e-4), 3.0, 0.2)
UNIT = Imu(Noise(np.full(3, 1e-5)), Noise(np.full(3, 1e-3)))
SIGMAS = {
    "position": 10.0, "velocity": 0.5, "tilt": 5e-3, "heading": 1e-2, "gyro_bias": 5e-6, "accelerometer_bias": 5e-3,
    "master_attitude_bias": 2e-3,
}  # fmt: skip


def master(times: Array, flexure: Flexure = BENT) -> Sensor:
    sensor = make_sensor("master", times, {"velocity": 0.02, "attitude": 1e-4}, 0.01, 5.0, ARM)
    return replace(sensor, flexure=flexure)


@lru_cache
def navigation(believed: Flexure = BENT, considered: bool = False) -> AidedNavigation:
    """Align in a turn that begins in a climb."""
    sensor = master(np.arange(BEGIN + 1.0, END + 0.5, 1.0))
    kinds = ("gyro_bias", "accelerometer_bias", "master_attitude_bias", "master_velocity_bias")
    flexure = ("master_flexure",)
    model = make_filter((sensor,), UNIT, SIGMAS, kinds + (() if considered else flexure), flexure * considered)
    beliefs = replace(model.beliefs, sensors=(replace(sensor, flexure=believed),))
    found = Navigation(flight(), "strapdown", BEGIN, END, UNIT, (sensor,), replace(model, beliefs=beliefs)).aided
    assert found is not None
    return found


@pytest.mark.parametrize("damping", [0.05, 0.7, 1.0])
def test_a_flexure_is_the_second_order_process_in_both_of_its_states(damping: float) -> None:
    """Against the exponential of its matrix, which has 1e-14, and the closed form of its correlation."""
    flexure, times = Flexure((1.0, 0.0, 0.0), 3.0, damping), np.array([0.0, 0.03, 0.5, 4.0])
    system = np.array([[0.0, 1.0], [-9.0, -6.0 * damping]])
    over = np.stack([expm(system * step) for step in np.diff(times)])
    np.testing.assert_allclose(flexure.transitions(np.diff(times)), over, atol=1e-12)
    stationary, natural = np.diag([1.0, 9.0]), flexure.natural(times)
    added = stationary - over @ stationary @ over.swapaxes(1, 2)
    np.testing.assert_allclose(natural[1:] @ flexure.noise(times) @ natural[1:].swapaxes(1, 2), added, atol=1e-11)
    steps = flexure.decay(np.diff(times))[:, None, None] * natural[1:] @ np.linalg.inv(natural[:-1])
    np.testing.assert_allclose(steps, over, atol=1e-12)
    a, b = 3.0 * damping, 3.0 * np.sqrt(1.0 - damping**2)
    expected = np.exp(-a * times) * (np.cos(b * times) + a * times * np.sinc(b * times / np.pi))
    np.testing.assert_allclose((flexure.transitions(times) @ stationary)[:, 0, 0], expected, atol=1e-12)
    variates = np.random.default_rng(3).standard_normal((4, 20_000, 3, 2))
    drawn = flexure.draw(times, variates)[:, :, 0]
    bound = stats.norm.isf(5e-6) / np.sqrt(20_000)  # of four correlations, each with a sigma of 1 / sqrt(n) at most
    assert np.abs((drawn[:, :, 0] * drawn[0, :, 0]).mean(axis=1) - expected).max() < np.sqrt(2.0) * bound
    assert np.abs((drawn[:, :, 1] ** 2).mean(axis=1) / 9.0 - 1.0).max() < np.sqrt(2.0) * bound


def test_what_bends_is_where_the_master_is() -> None:
    """Its velocity is the derivative of its place: central differences of 1 ms leave 1e-7 of the arm's velocity."""
    truth, time, step = flight(), 630.0, 1e-3
    angle, rate = np.array([1.0, -2.0, 0.5]) * 1e-3, np.array([4.0, 1.0, -3.0]) * 1e-3
    found = measure(truth, "strapdown", BEGIN, (master(np.array([time])),))

    def moved(t: float) -> Array:
        """Return what the bent arm adds to the place of its end."""
        return np.asarray(truth.attitude(t).apply(np.cross(angle + rate * (t - time), ARM)))

    of_earth = (moved(time + step) - moved(time - step)) / (2.0 * step)
    level = found.directions[0, :3] @ truth.earth.turned(np.array([time - truth.times[0]]))[0]
    responses = found.flexure[0] @ np.concatenate([angle, rate])
    np.testing.assert_allclose(responses[:3], level @ of_earth, atol=1e-7 * np.abs(of_earth).max())
    np.testing.assert_allclose(responses[3:], angle, atol=1e-15)


@pytest.mark.parametrize("considered", [False, True])
def test_a_matched_filter_knows_its_errors(considered: bool) -> None:
    """True errors by cause, of all causes at once, and the filter's own are three recursions: equal to 1e-9."""
    of = navigation(considered=considered)
    linear, sources = of.linear, np.diag(sized(of.sensors, SIGMAS) ** 2)
    true = linear.partials @ sources @ linear.partials.swapaxes(1, 2) + sum(linear.processes.values())
    own = np.diagonal(linear.own, axis1=1, axis2=2)
    np.testing.assert_allclose(np.diagonal(true, axis1=1, axis2=2), own, rtol=1e-9)
    together = propagated_at_once(of, of.times[1:], np.sqrt(np.diagonal(sources))).covariance
    np.testing.assert_allclose(np.diagonal(together, axis1=1, axis2=2), own[1:], rtol=1e-9)
    of_states = np.einsum("mqs,st,mqt->mq", linear.state_partials, sources, linear.state_partials)
    np.testing.assert_allclose(of_states + sum(linear.state_variances.values()), linear.own_variances, rtol=1e-9)
    if not considered:  # else no smoother is defined
        smoothed = of.smoothed_at_epochs
        true = smoothed.partials @ sources @ smoothed.partials.swapaxes(1, 2) + sum(smoothed.processes.values())
        scale = np.diagonal(linear.own, axis1=1, axis2=2)
        apart = np.diagonal(true - smoothed.own, axis1=1, axis2=2)
        assert np.abs(apart / scale).max() < 1e-9


@pytest.mark.parametrize("believed", [BENT, Flexure((5e-4, 5e-4, 5e-4), 5.0, 1.0)], ids=["matched", "mismatched"])
def test_samples_have_the_covariance_of_linear_analysis(believed: Flexure) -> None:
    """Also those of the flexure's states, with wrong beliefs as well: 33 variances, one of 1e4 times outside."""
    of, count = navigation(believed), 2_000
    sigmas = sized(of.sensors, SIGMAS)
    errors = np.random.default_rng(4).standard_normal((count, len(sigmas))) * sigmas
    aided = simulate_aided(of.tables(1), errors, 5, np.arange(count), False)
    linear, sources = of.linear, np.diag(sigmas**2)
    true = linear.partials[-1] @ sources @ linear.partials[-1].T + sum(each[-1] for each in linear.processes.values())
    left, states = linear.state_partials[-1], len(of.filter.states)
    of_states = np.diag(left @ sources @ left.T) + sum(each[-1] for each in linear.state_variances.values())
    first = aided.records.shape[2] - 5 - 2 * states
    found = np.concatenate([aided.values[:, -1], aided.records[:, -1, first : first + states]], axis=1)
    ratio = np.mean(found**2, axis=0) / np.concatenate([np.diag(true), of_states])
    low, high = stats.chi2.ppf([5e-5 / ratio.size, 1.0 - 5e-5 / ratio.size], count) / count
    assert np.all((low < ratio) & (ratio < high)), ratio
    np.testing.assert_allclose(
        aided.records[0, -1, first + states : first + 2 * states], linear.own_variances[-1], rtol=1e-9
    )


def test_noise_that_is_given_has_the_covariance_of_linear_analysis() -> None:
    """Its responses to normals by a recursion backwards: their square is the processes' covariance, to 1e-9.

    And the linear errors of samples with given normals are what these responses make of them.
    """
    of = navigation()
    tables = of.tables(1)
    system = NoiseSystem(tables.ensemble, tables.adjoint, Measured.of(tables))
    rows = system.rows(tuple(range(9)))
    expected = np.diag(sum(each[-1] for each in of.linear.processes.values()))
    np.testing.assert_allclose(np.sum(rows**2, axis=1), expected, rtol=1e-9)
    normals = system.draw(3, np.arange(2))
    none = np.zeros((2, len(sized(of.sensors, SIGMAS))))
    found = simulate_aided(tables, none, 0, np.arange(2), False, system.given(system.parted(normals))).linear
    np.testing.assert_allclose(found, normals @ rows.T, atol=1e-9 * np.sqrt(expected).max(), rtol=1e-9)


def test_both_engines_agree_on_a_sample_that_bends() -> None:
    """With a tenth of a flexure alone: products of its errors, and the reference's filter steps, leave 2e-5."""
    of, variates = navigation(), np.random.default_rng(6).standard_normal((16, 3, 2))
    flexure = 0.1 * BENT.draw(of.sensors[0].times, variates).swapaxes(1, 2).reshape(-1, 6)
    tables = of.tables(1)
    added = np.einsum("ucr,ur->uc", of.loop.measurements.flexure, flexure)
    given = GivenNoise(np.zeros((1, *tables.ensemble.factors.shape[:2])), added[None])
    none = np.zeros((1, len(sized(of.sensors, SIGMAS))))
    ensemble = simulate_aided(tables, none, 0, np.zeros(1, dtype=np.int64), True, given)
    reference = AidedMechanization(of.truth, "strapdown", BEGIN, END, of.times, of.sensors, of.filter)
    noise = replace(reference.quiet(), flexures={"master": flexure})
    errors, records = reference.simulate(none[0], noise)
    sigma = np.sqrt(np.diagonal(of.linear.own, axis1=1, axis2=2))
    assert np.abs(ensemble.values[0] / sigma).max() > 0.02
    assert np.abs((errors - ensemble.values[0]) / sigma).max() < 2e-5
    states = len(of.filter.states)
    first = records.shape[1] - 5 - states
    own = records[-1, first : first + states]
    np.testing.assert_allclose(own, of.linear.own_variances[-1], rtol=1e-3)


CAMPAIGN = tomllib.loads((ROOT / "campaigns" / "33_alignment_on_a_swaying_base.toml").read_text("utf-8"))


@pytest.mark.parametrize(
    ("flexure", "believed", "message"),
    [
        ("1 mrad", {}, "aiding #1.flexure: got '1 mrad'; expected"),
        ({"sigma": "1 mrad"}, {}, "aiding #1.flexure: frequency is missing; expected { sigma = "),
        ({"sigma": "1 m", "frequency": "1 Hz"}, {}, "aiding #1.flexure.sigma: got '1 m', which is a length"),
        ({"sigma": "1 mrad", "frequency": "1 Hz", "damping": 2.0}, {}, "flexure.damping: got 2.0; expected a number"),
        ({"sigma": "1 mrad", "frequency": "1 Hz", "correlation_time": "1 s"}, {}, "flexure: got a frequency or a dam"),
        ({"sigma": "1 mrad", "frequency": "9 Hz"}, {}, "is damped too near to 1 for 600 s at this frequency"),
        (None, {"sigma": "1 mrad", "frequency": "9 Hz", "damping": 0.1}, "the sensor has none; give it one in"),
        (None, None, "filter.estimates: unknown error 'master_flexure'"),
    ],
)
def test_a_flexure_that_cannot_be(flexure: object, believed: object, message: str) -> None:
    content = deepcopy(CAMPAIGN)
    (sensor,) = content["aiding"]
    if flexure is None:
        del sensor["flexure"]
        if believed is not None:
            content["filter"]["estimates"].remove("master_flexure")
            content["filter"]["believes"] = {"aiding": {"master": {"flexure": believed}}}
    else:
        sensor["flexure"] = flexure
    with pytest.raises(CampaignError, match=re.escape(message)):
        parse_campaign(content, "mine.toml", "mine")


@pytest.mark.parametrize("late", [{"delay": "20 ms"}, {"jitter": "5 ms"}, {"distribution": "fixed", "value": "50 ms"}])
def test_a_structure_that_bends_holds_no_late_sensor(late: dict[str, str]) -> None:
    """By its own keys, or by an error of the campaign; samples had the flexure of the time stamp."""
    content = deepcopy(CAMPAIGN)
    if "value" in late:
        content["errors"]["master_delay"] = late
    else:
        content["aiding"][0] |= late
    with pytest.raises(CampaignError, match=r"aiding #1\.flexure: master is late as well, and how the structure bent"):
        parse_campaign(content, "mine.toml", "mine")
