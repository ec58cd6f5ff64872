"""Linear analysis and both engines against a dense covariance, which is computed here and shares only the truth.

All errors are one state X of psi, v, x, the gyros' and accelerometers' errors and the sensor's, in inertial axes. The
filter has some of them. Its gains, zero for the others, act on the whole: ``X+ = (I - K H) X``, what was estimated
being taken away.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.config.read import parse_campaign
from mcnav.systems.ins.aided import AidedReferenceEngine
from mcnav.systems.ins.earth import WGS84, local_axes
from mcnav.systems.ins.ensemble.aided import GivenNoise, simulate_aided
from mcnav.systems.ins.imu.instruments import AXES, CONSTANTS, CROSS_AXES, GYRO, Imu, Noise
from mcnav.systems.ins.imu.sample_noise import SampleNoise
from mcnav.systems.ins.linear.covariance import biased_processes, output_map
from mcnav.systems.ins.reference.aided import AidedMechanization
from mcnav.systems.ins.scenario import Ins, Navigation
from mcnav.systems.ins.truth.trajectory import Platform, Truth
from tests.aided import make_filter, make_sensor, propagated_at_once, sized

END = 24.0
ARM = (10.0, -2.0, 1.0)
SIGMAS = {
    "position": 2.0, "velocity": 0.1, "tilt": 5e-3, "heading": 0.02, "gyro_bias": 2.4e-4, "gyro_scale_factor": 3e-3,
    "gyro_misalignment": 2e-3, "gyro_g_sensitivity": 1e-5, "accelerometer_bias": 0.02,
}  # fmt: skip
UNIT = Imu(Noise(np.full(3, 8.7e-5), np.full(3, 1e-3), np.full(3, 30.0), np.full(3, 1e-4)), Noise(np.full(3, 1e-3)))
"""Its gyros' bias instability and rate random walk matter on the lever arm."""


@lru_cache
def slew() -> Truth:
    """Fly north at 20 m/s, with a heading that swings by 2 rad to either side, and nods and rolls."""
    time = np.linspace(0.0, END, 241)
    angles = np.stack([2.0 * np.sin(0.3 * time), 0.2 * np.sin(0.5 * time), 0.3 * np.sin(0.4 * time)], axis=-1)
    latitude = np.radians(47.0) + 20.0 * time / 6.37e6
    return Truth.through(WGS84, time, latitude, np.full(241, np.radians(9.0)), np.full(241, 100.0), angles)


def navigation(platform: Platform = "strapdown", times: Array | None = None) -> Navigation:
    """Return a navigation whose filter estimates biases and neglects the gyros' other errors."""
    measured = np.arange(1.0, END + 0.5) if times is None else times
    sensor = make_sensor("gnss", measured, {"position": 1.0, "velocity": 0.01}, lever_arm=ARM)
    model = make_filter((sensor,), UNIT, SIGMAS, ("gyro_bias", "accelerometer_bias"))
    return Navigation(slew(), platform, 0.0, END, UNIT, (sensor,), model)


def cross(vector: Array) -> Array:
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


@dataclass
class Dense:
    """The dense covariance: ``over`` is the response of X to its start, ``covariance`` and ``own`` are P."""

    of: Navigation
    step: float
    times: Array | None = None
    names: list[str] = field(init=False)

    def __post_init__(self) -> None:
        instability = [f"gyro_bias_instability_{axis}" for axis in AXES]
        self.names = [*CONSTANTS, *instability]
        assert self.of.filter is not None
        states = [state.name for state in self.of.filter.states]
        self.chosen = np.array([*range(9), *(self.names.index(name) for name in states)])
        self.start_map = np.eye(len(self.names))
        self.start_map[:9, :9] = np.linalg.inv(output_map(self.of.truth, 0.0))
        sigmas = np.concatenate([sized((), SIGMAS), UNIT.gyro.instability])
        self.covariance = self.start_map @ np.diag(sigmas**2) @ self.start_map.T
        self.own = self.covariance[np.ix_(self.chosen, self.chosen)]
        self.over = self.start_map.copy()
        self.time = 0.0
        for time in self.of.sensors[0].times if self.times is None else self.times:
            self.advance(time)
            self.update()
        self.advance(END)

    def gyros(self, rate: Array, force: Array) -> Array:
        """Return what all errors make of the gyros' readings, in their axes."""
        found = np.zeros((3, len(self.names)))
        for a, axis in enumerate(AXES):
            entries = {"bias": 1.0, "bias_instability": 1.0, "scale_factor": rate[a], "g_sensitivity": force[a]}
            for name, value in entries.items():
                found[a, self.names.index(f"gyro_{name}_{axis}")] = value
        for reads, along in CROSS_AXES:
            found[AXES.index(reads), self.names.index(f"gyro_misalignment_{reads}{along}")] = rate[AXES.index(along)]
        return found

    def advance(self, end: float) -> None:
        """Propagate to a time by the transition of third order in each step's middle, and Simpson's rule."""
        count, states = max(round((end - self.time) / self.step), 1), len(self.names)
        for middle in self.time + (np.arange(count) + 0.5) * (end - self.time) / count:
            here = self.of.truth.states(np.array([middle]), self.of.platform, 0.0)
            axes, force, rate = here.axes[0], here.force[0], here.rate[0]
            system, density = np.zeros((states, states)), np.zeros((states, states))
            system[:3], system[3:6, :3] = axes @ self.gyros(rate, force), -cross(axes @ force)
            system[3:6, 6:9] = self.of.truth.earth.gravity_gradient(here.position)[0]
            first = self.names.index("accelerometer_bias_x")
            system[3:6, first : first + 3], system[6:9, 3:6] = axes, np.eye(3)
            system[-3:, -3:] -= np.eye(3) / 30.0
            bias = self.names.index("gyro_bias_x") + np.arange(3)
            for places, size in ((np.arange(3), 8.7e-5), (np.arange(3, 6), 1e-3), (bias, 1e-4)):
                density[places, places] = size**2
            density[-3:, -3:] = 2.0 / 30.0 * 1e-3**2 * np.eye(3)
            x = system * (end - self.time) / count
            half, whole = np.eye(states) + x / 2 + x @ x / 8, np.eye(states) + x + x @ x / 2 + x @ x @ x / 6
            noise = (
                (density + 4.0 * half @ density @ half.T + whole @ density @ whole.T) * (end - self.time) / count / 6
            )
            self.covariance, self.over = whole @ self.covariance @ whole.T + noise, whole @ self.over
            pick = np.ix_(self.chosen, self.chosen)
            self.own = whole[pick] @ self.own @ whole[pick].T + noise[pick]
        self.time = end

    def update(self) -> None:
        """Measure position and velocity of the antenna, with the rate that the navigator has."""
        of, states, time = self.of, len(self.names), np.array([self.time])
        here, body = of.truth.states(time, of.platform, 0.0), of.truth.states(time, "strapdown", 0.0)
        latitude, longitude, _ = of.truth.geodetic(time).T
        level = (of.truth.earth.turned(time) @ local_axes(latitude, longitude))[0].T
        spin, arm = cross(np.array([0.0, 0.0, of.truth.earth.rotation_rate])), body.axes[0] @ np.array(ARM)
        response = np.zeros((6, states))
        response[:3, :3], response[:3, 6:9] = -cross(arm), np.eye(3)
        swinging = body.axes[0] @ cross(body.rate[0]) @ np.array(ARM)
        response[3:, :3], response[3:, 3:6], response[3:, 6:9] = spin @ cross(arm) - cross(swinging), np.eye(3), -spin
        response[3:] -= cross(arm) @ here.axes[0] @ self.gyros(here.rate[0], here.force[0])
        response = np.kron(np.eye(2), level) @ response
        noise, own = np.diag(np.repeat([1.0, 1e-4], 3)), response[:, self.chosen]
        gain = self.own @ own.T @ np.linalg.inv(own @ self.own @ own.T + noise)
        left = np.eye(len(self.own)) - gain @ own
        self.own = left @ self.own @ left.T + gain @ noise @ gain.T
        gains = np.zeros((states, 6))
        gains[self.chosen] = gain
        left = np.eye(states) - gains @ response
        self.covariance = left @ self.covariance @ left.T + gains @ noise @ gains.T
        self.over = left @ self.over

    def outputs(self) -> tuple[Array, Array, Array]:
        """Return sigmas of the outputs, the filter's own, and partial derivatives with respect to constant sources."""
        to_outputs = output_map(self.of.truth, END)
        true, own = (to_outputs @ each[:9, :9] @ to_outputs.T for each in (self.covariance, self.own))
        return np.sqrt(np.diag(true)), np.sqrt(np.diag(own)), (to_outputs @ self.over[:9])[:, : len(CONSTANTS)]


QUADRATURE = 1e-6
"""Error of the linear analysis' own integration, as a share: that of its responses over a step of a second."""


def assert_near(found: Array, coarse: Array, fine: Array) -> None:
    """Compare with a dense result: the error of its steps falls with their square, and is a third of their change."""
    scale = np.abs(fine).max(axis=0, initial=0.0) if fine.ndim > 1 else np.abs(fine)
    assert np.all(np.abs(found - fine) <= np.abs(coarse - fine) + QUADRATURE * scale)


def assert_is_dense(of: Navigation, times: Array | None = None) -> None:
    """Compare true sigmas, the filter's own, and partial derivatives: by cause, and of all causes at once."""
    coarse, fine = (Dense(of, step, times).outputs() for step in (0.1, 0.05))
    assert of.aided is not None
    linear, sizes = of.aided.linear, sized(of.sensors, SIGMAS)
    partials = linear.partials[-1]
    total = partials @ np.diag(sizes**2) @ partials.T + sum(each[-1] for each in linear.processes.values())
    at_once = propagated_at_once(of.aided, np.array([END]), sizes)
    assert at_once.own is not None
    for true, own in ((total, linear.own[-1]), (at_once.covariance[-1], at_once.own[-1])):
        assert_near(np.sqrt(np.diag(true)), coarse[0], fine[0])
        assert_near(np.sqrt(np.diag(own)), coarse[1], fine[1])
    modelled = np.flatnonzero(sized((), SIGMAS))
    assert_near(partials[:, modelled], coarse[2][:, modelled], fine[2][:, modelled])


@pytest.mark.parametrize("platform", ["strapdown", "inertial", "level"])
def test_linear_covariance_with_an_antenna_on_a_lever_arm(platform: Platform) -> None:
    """With errors of the gyros in the rate, which are the half of the outcome where they are on the body.

    The filter believes in all of them, and estimates the biases alone.
    """
    assert_is_dense(navigation(platform))


ROUNDING = np.repeat([4e-9, 1e-12, 1e-15], 3)
"""Of outputs of the reference engine, whose positions are earth-fixed ones of 6.4e6 m: m, m/s, rad."""

ENSEMBLE = 3e-5
"""Share of the largest response to which the ensemble's steps are settled, `mcnav.systems.ins.aided.TOLERANCE`."""


def of_kind(values: Array) -> Array:
    """Return the largest size of the three outputs of a kind for each of them."""
    return np.repeat(np.abs(values).reshape(3, 3).max(axis=1), 3)


@pytest.mark.parametrize(
    "name", ["gyro_bias_y", "gyro_scale_factor_z", "gyro_misalignment_yx", "gyro_g_sensitivity_z", "heading"]
)
def test_engines_have_the_dense_partial_derivatives(name: str) -> None:
    """To errors of the gyros that the filter estimates and neglects, and to the heading.

    Central differences of a tenth of a sigma leave the third order, (6e-4 rad)^2 of the first. The dense covariance's
    steps and the reference filter's leave errors that fall with their square, a third of the change by half of them.
    """
    of, source = navigation(), CONSTANTS.index(name)
    coarse, fine = (Dense(of, step).outputs()[2][:, source] for step in (0.1, 0.05))
    assert of.aided is not None
    assert of.filter is not None
    sigmas = sized(of.sensors, SIGMAS)
    errors = np.zeros((2, len(sigmas)))
    errors[:, source] = np.array([0.1, -0.1]) * sigmas[source]
    size = 0.2 * sigmas[source]
    allowed = of_kind(coarse - fine) + ROUNDING / size
    tables = of.aided.tables(4)
    for own in (True, False):
        values, _ = of.aided.propagate(tables, errors, own)
        found = (values[0, -1] - values[1, -1]) / size
        assert np.all(np.abs(found - fine) <= allowed + ENSEMBLE * of_kind(fine)), own
    by_step = []
    for step in (0.05, 0.025):
        engine = AidedMechanization(of.truth, "strapdown", 0.0, END, np.array([END]), of.sensors, of.filter, step, step)
        values = np.stack([engine.simulate(each)[0][-1] for each in errors])
        by_step.append((values[0] - values[1]) / size)
    assert np.all(np.abs(by_step[1] - fine) <= allowed + of_kind(by_step[0] - by_step[1]))


def test_a_rate_random_walk_on_a_lever_arm_acts_as_the_bias_that_it_is() -> None:
    """One that jumps in the first step and stays, against a constant bias whose share of that step is added.

    Of the constant, which a state models, samples carry the difference to its estimate: the rest is rounding.
    """
    aided, jump = navigation().aided, 1e-3
    assert aided is not None
    tables = aided.tables(1)
    walks = biased_processes(tables.loop.responses.between(0, 1), UNIT).index("gyro_rate_random_walk_z")
    errors = np.zeros((2, len(sized(aided.sensors, SIGMAS))))
    errors[0, CONSTANTS.index("gyro_bias_z")] = jump
    steps, width = tables.ensemble.factors.shape[:2]
    added = np.zeros((2, steps, width))
    added[1, 0, :9] = jump * tables.ensemble.inputs(np.array([GYRO.index("gyro_bias_z")]))[0, 0]
    added[1, 0, 9 + walks] = jump
    given = GivenNoise(added, np.zeros((2, *tables.white.shape)))
    found = simulate_aided(tables, errors, 0, np.arange(2), True, given)
    for values in (found.values, found.linear):
        size = np.abs(values[0]).max(axis=0)
        assert np.all(size > 0.0)
        np.testing.assert_allclose(values[1] / size, values[0] / size, rtol=0.0, atol=1e-9)


def test_drifts_of_the_reference_engine_are_those_of_the_ensemble() -> None:
    """Samples with a hundredth of all noise and no other errors, whose drift moves the antenna by 1e-4 m/s and more.

    That is 1e-2 of the sensor's sigma. The reference filter's steps of 0.2 s, in which the body turns by 0.12 rad, err
    by (0.12)^2 / 12 of what errors of a tenth of a sigma make: 1.2e-4; products of errors are less.
    """
    of, nothing = navigation(), np.zeros(len(sized(navigation().sensors, SIGMAS)))
    assert of.aided is not None
    sigma = np.sqrt(np.diagonal(of.aided.linear.own, axis1=1, axis2=2))[1:]
    engine = Ins(of).engine("reference", nothing[None])
    assert isinstance(engine, AidedReferenceEngine)
    for index in range(3):
        drawn = engine.mechanization.draw(UNIT, 5, index)
        assert drawn.drifts is not None
        assert np.abs(drawn.drifts).max() * np.linalg.norm(ARM) > 0.01
        measured = {name: 0.01 * values for name, values in drawn.measurements.items()}
        noise = SampleNoise(0.01 * drawn.gyro, 0.01 * drawn.accelerometer, measured, {}, 0.01 * drawn.drifts)
        given = engine.given(noise)
        expected = simulate_aided(of.aided.tables(1), nothing[None], 0, np.zeros(1, int), True, given).values[0]
        found, _ = engine.mechanization.simulate(nothing, noise)
        without = engine.mechanization.simulate(nothing, replace(noise, drifts=None))[0]
        assert np.abs((found - expected)[1:] / sigma).max() <= 1.2e-4
        assert np.abs((without - expected)[1:] / sigma).max() >= 1e-3


def test_begin_of_a_sensor_is_its_first_measurement(tmp_path: Path) -> None:
    """In a campaign: at 5, 8, 11 s and so on, not at multiples of the interval."""
    truth, time = slew(), np.linspace(0.0, END, 241)
    rows = np.column_stack([time, truth.geodetic(time), truth.angles(time)[:, ::-1]])
    rows[:, [1, 2, 4, 5, 6]] = np.degrees(rows[:, [1, 2, 4, 5, 6]])
    np.savetxt(tmp_path / "slew.csv", rows, "%.15g", ",", header="time,lat,lon,alt,roll,pitch,heading", comments="")
    unit = {
        "bias": "2.4e-4 rad/s", "scale_factor": "3e-3", "misalignment": "2e-3 rad",
        "g_sensitivity": "1e-5 rad/s/(m/s^2)",
        "angle_random_walk": "8.7e-5 rad/sqrt(s)", "rate_random_walk": "1e-4 rad/s/sqrt(s)",
        "bias_instability": {"sigma": "1e-3 rad/s", "correlation_time": "30 s"},
    }  # fmt: skip
    aiding = {
        "type": "gnss", "interval": "3 s", "begin": "5 s", "position": "1 m", "velocity": "0.01 m/s",
        "lever_arm": [f"{each} m" for each in ARM],
    }  # fmt: skip
    content = {
        "samples": 100,
        "scenario": {"type": "ins", "trajectory": "slew.csv"},
        "imu": {
            "gyro": unit,
            "accelerometer": {"bias": "0.02 m/s^2", "velocity_random_walk": "1e-3 m/s/sqrt(s)"},
        },
        "errors": {"position": "2 m", "velocity": "0.1 m/s", "tilt": "5e-3 rad", "heading": "0.02 rad"},
        "aiding": [aiding],
        "filter": {"estimates": ["position", "velocity", "attitude", "gyro_bias", "accelerometer_bias"]},
    }
    scenario = parse_campaign(content, str(tmp_path / "mine.toml"), "mine").scenario
    assert isinstance(scenario, Ins)
    assert_is_dense(scenario.navigation, np.arange(5.0, END, 3.0))
