"""Navigators of the textbook cases: earths, vehicles, aiding, and what linear analysis and samples say of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.samples import Batch
from mcnav.physics.constants import STANDARD_GRAVITY
from mcnav.statistics.mean_square import mean_square_intervals
from mcnav.systems.ins.earth import WGS84, Earth
from mcnav.systems.ins.filter.model import Beliefs, FilterModel
from mcnav.systems.ins.imu.instruments import CONSTANTS, OUTPUTS, Imu, Noise
from mcnav.systems.ins.scenario import SOURCES, Ins, Navigation
from mcnav.systems.ins.sensors.aiding import Component, Sensor, aiding_constants
from mcnav.systems.ins.truth.trajectory import Truth
from mcnav.validation.reproduce.textbook.numbers import CONFIDENCE

SEED: Final = 1949
PROBES: Final = 16
ROWS: Final = 9
"""Rows of a truth: a vehicle at rest, or one with a constant acceleration, is exact with any number."""

SPHERE: Final = Earth(WGS84.radius, 0.0, STANDARD_GRAVITY * WGS84.radius**2, 0.0)
"""The sphere of the textbooks: it does not turn, and has standard gravity on the ground."""

TURNING: Final = replace(SPHERE, rotation_rate=WGS84.rotation_rate)
"""The same sphere, turning."""

FLAT_RADIUS: Final = 1e6 * WGS84.radius
FLAT: Final = Earth(FLAT_RADIUS, 0.0, STANDARD_GRAVITY * FLAT_RADIUS**2, 0.0)
"""The flat earth: a sphere so large that its curvature changes an error by 5e-8 in ten minutes."""

EMPTY_SPACE: Final = Earth(WGS84.radius, 0.0, 1.0, 0.0)
"""A sphere that does not turn and hardly attracts: every axis is a channel of its own."""

HELD_BY: Final = 1.0
"""Random walk of the vertical accelerometer that an altimeter's filter believes in, m/s/sqrt(s).

It is so large that the altimeter alone determines altitude and vertical velocity.
"""


def at_rest(earth: Earth, latitude: float, duration: float, acceleration: float = 0.0) -> Truth:
    """Stay on the ground, level, heading north, from a latitude, deg; or accelerate northwards, m/s^2."""
    times = np.linspace(0.0, duration, ROWS)
    same = np.ones(ROWS)
    north = 0.5 * acceleration * times**2 / earth.radius
    return Truth.through(
        earth, times, np.radians(latitude) + north, 0.0 * same, 0.0 * same, np.zeros((ROWS, 3))
    )  # fmt: skip


def white(instrument: str, density: float) -> Imu:
    """Return instruments of one kind with a random walk on each axis, and nothing else."""
    return on_each_axis(instrument, random_walk=density)


def on_each_axis(instrument: str, **sizes: float) -> Imu:
    """Return instruments of one kind, ``gyro`` or ``accelerometer``, with processes on each axis."""
    noise = Noise(**{name: np.full(3, size) for name, size in sizes.items()})
    return Imu(gyro=noise) if instrument == "gyro" else Imu(accelerometer=noise)


def sensor(name: str, interval: float, end: float, noise: Mapping[str, float]) -> Sensor:
    """Return a sensor that measures all axes of some quantities with white noise, every interval up to the end."""
    times = interval * np.arange(1.0, np.floor(end / interval + 1e-9) + 1.0)
    components = tuple(
        Component(quantity, axis, sigma, 0.0, 1.0, name if len(noise) == 1 else f"{name}_{quantity}")
        for quantity, sigma in noise.items()
        for axis in range(1 if quantity == "altitude" else 3)
    )
    return Sensor(name, name, times, components)


def filter_of(
    sensors: tuple[Sensor, ...],
    imu: Imu,
    sigmas: Mapping[str, float],
    estimates: tuple[str, ...] = (),
    considers: tuple[str, ...] = (),
) -> FilterModel:
    """Return a filter that believes in processes, and in sigmas of constant errors by name or kind."""
    names = (*CONSTANTS, *aiding_constants(sensors))
    sizes = all_sizes(names, sigmas)
    beliefs = Beliefs(dict(zip(names, sizes.tolist(), strict=True)), np.diag(sizes[: len(OUTPUTS)] ** 2), imu, sensors)
    return FilterModel(estimates, considers, beliefs)


def all_sizes(names: Sequence[str], sigmas: Mapping[str, float]) -> Array:
    """Return the sigma of every constant error from those by name or kind; zero for the others."""
    return np.array([next((size for kind, size in sigmas.items() if name.startswith(kind)), 0.0) for name in names])


def held_altitude(duration: float) -> tuple[tuple[Sensor, ...], FilterModel]:
    """Return an altimeter and a filter that hold altitude and vertical velocity, and leave the rest alone."""
    sensors = (sensor("altimeter", 10.0, duration, {"altitude": 1e-3}),)
    believed = Imu(accelerometer=Noise(random_walk=np.array([0.0, 0.0, HELD_BY])))
    vertical, others = {"position_down": 1e-3, "velocity_down": 1e-3}, {"position": 1e-3, "velocity": 1e-5}
    sigmas = {**vertical, **others, "tilt": 1e-8, "heading": 1e-8}
    return sensors, filter_of(sensors, believed, sigmas)


@dataclass(frozen=True)
class Sigma:
    """Standard deviation of errors: linear, the filter's own by linear analysis, and of samples with its interval.

    ``paired`` is that of the samples by their differences from linear outcomes of the same errors and the same noise.
    """

    linear: float
    own: float
    paired: float
    simulated: float
    interval: tuple[float, float]


@dataclass(frozen=True)
class MeanSquare:
    """Mean of normalized squares of a filter over samples, and its interval."""

    simulated: float
    interval: tuple[float, float]


class Case:
    """A navigation whose constant errors are normal, with its samples.

    Parameters
    ----------
    sigmas : mapping of str to float
        Of constant errors, by name or kind.
    """

    def __init__(
        self,
        truth: Truth,
        sigmas: Mapping[str, float],
        samples: int,
        imu: Imu | None = None,
        aiding: tuple[tuple[Sensor, ...], FilterModel] | None = None,
    ) -> None:
        sensors, model = aiding or ((), None)
        self.scenario = Ins(
            Navigation(truth, "strapdown", 0.0, float(truth.times[-1]), imu or Imu(), sensors, model, {})
        )
        self.sizes = all_sizes([source.name for source in self.scenario.sources], sigmas)
        self.samples = samples

    @cached_property
    def linear(self) -> Array:
        """Linear covariance of the final errors, shape (9, 9)."""
        model = self.scenario.linear().end
        constant = (model.partials * self.sizes**2) @ model.partials.T
        return np.asarray(sum(model.processes.values(), constant))

    @cached_property
    def own(self) -> Array:
        """Sigmas of the filter at the end by linear analysis, shape (9,); NaN without a filter."""
        prediction = self.scenario.filter_prediction()
        return np.full(len(OUTPUTS), np.nan) if prediction is None else np.sqrt(np.diag(prediction.covariance[-1]))

    @cached_property
    def own_states(self) -> Array:
        """Sigmas of the other states of the filter at the end by linear analysis, shape (q,)."""
        prediction = self.scenario.filter_prediction()
        return np.empty(0) if prediction is None else np.asarray(np.sqrt(prediction.state_variance[-1]))

    def variances_after_updates(self, output: str) -> list[float]:
        """Return the filter's variance of an output after each instant of its updates, by linear analysis."""
        navigation = self.scenario.navigation
        instants = np.unique(np.concatenate([sensor.times for sensor in navigation.sensors]))
        linear = self.scenario.linear(instants)
        if linear.own is None:
            raise ValueError("a navigation without aiding has no filter")
        place = OUTPUTS.index(output)
        after = [number for number, update in enumerate(linear.updates) if update == "after"]
        return [float(linear.own[number, place, place]) for number in after]

    @property
    def epochs(self) -> Array:
        """Instants of the navigation's epochs, shape (m,), s."""
        return self.scenario.navigation.times

    def horizontal_variance(self) -> Array:
        """Return the linear variance of the horizontal position error at the epochs, shape (m,), m²."""
        known = self.scenario.navigation.linear
        constant = ((known.partials[:, :2] * self.sizes) ** 2).sum(axis=(1, 2))
        noise = [process[:, 0, 0] + process[:, 1, 1] for process in known.processes.values()]
        return np.asarray(sum(noise, constant))

    def horizontal_squares(self) -> Array:
        """Return the squares of the samples' horizontal position errors at the epochs, shape (n, m), m²."""
        return self._simulated[1]

    def partial(self, output: str, source: str) -> float:
        """Return one partial derivative of the final errors, SI."""
        return float(self.scenario.linear().end.partials[OUTPUTS.index(output), CONSTANTS.index(source)])

    @cached_property
    def _simulated(self) -> tuple[Array, Array, Array | None]:
        """Final errors of the samples and linear ones, shape (2, n, 9), horizontal squares, and filters' records."""
        generator = np.random.Generator(np.random.Philox(key=SEED))
        errors = generator.standard_normal((self.samples, len(self.sizes))) * self.sizes
        probes = errors[:PROBES]
        if self.scenario.navigation.filter is None:  # of every kind: one channel excites the others in second order
            usual = np.array([source.nominal for source in SOURCES[: len(OUTPUTS)]])
            probes = probes.copy()
            probes[:, : len(OUTPUTS)] += generator.standard_normal((len(probes), len(OUTPUTS))) * usual
        engine = self.scenario.engine(self.scenario.engines[0], probes)
        values, level, records = [], [], []
        for begin in range(0, self.samples, engine.chunk):
            index = np.arange(begin, min(begin + engine.chunk, self.samples))
            simulated = engine.simulate(Batch(index, errors[index], SEED))
            if simulated.failures or simulated.linear_values is None or simulated.history is None:
                raise RuntimeError(f"samples fail: {next(iter(simulated.failures.values()), '')}")
            values.append(np.stack([simulated.values, simulated.linear_values]))
            level.append((simulated.history[..., :2] ** 2).sum(axis=2))
            records.append(simulated.filter_values)
        known = [record for record in records if record is not None]
        of_filters = np.concatenate(known) if known else None
        return np.concatenate(values, axis=1), np.concatenate(level), of_filters

    def sigma(self, *outputs: str) -> Sigma:
        """Return the sigma of outputs that are independent and alike; their samples are pooled."""
        places = [OUTPUTS.index(output) for output in outputs]
        squares, linear_squares = self._simulated[0][:, :, places].reshape(2, -1) ** 2
        variance = float(self.linear[places[0], places[0]])
        mean, (low, high) = _mean(squares, 1)
        return Sigma(
            float(np.sqrt(variance)),
            float(self.own[places[0]]),
            float(np.sqrt(variance + np.mean(squares - linear_squares))),
            float(np.sqrt(mean)),
            (float(np.sqrt(low)), float(np.sqrt(high))),
        )

    def mean_square(self, group: str) -> MeanSquare:
        """Return the mean NEES of a group of states, or the mean NIS of a sensor at its last updates, by component."""
        schema, records = self.scenario.filter_schema, self._simulated[2]
        if schema is None or records is None:
            raise ValueError("a navigation without aiding has no filter")
        if group in schema.sensors:
            last = records[:, -1, schema.places[f"sensor:{group}"]]
            values, size = last[:, 0] / last[:, 1], schema.sensors[group]
        else:
            values = records[:, -1, schema.places["nees"]][:, list(schema.groups).index(group)]
            size = schema.groups[group]
        return MeanSquare(*_mean(values / size, size))


def _mean(values: Array, freedom: int) -> tuple[float, tuple[float, float]]:
    """Compute the mean of squares, each of some degrees of freedom, and its interval."""
    count = len(values)
    mean, error = values.mean(), values.std(ddof=1) / np.sqrt(count)
    low, high = mean_square_intervals(mean, error, np.array(count), np.array(count * freedom), CONFIDENCE)
    return float(mean), (float(low), float(high))
