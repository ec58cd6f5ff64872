"""The error-state Kalman filter of an aided navigator: what it estimates, and what it believes.

The filter's states are the deviations psi, v, x of attitude, velocity and position in inertial axes (see
`mcnav.systems.ins.linear.response`), and errors of instruments and sensors. An estimated error is subtracted in the
navigator; of a considered error (Schmidt) the filter has a covariance and no estimate.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.gates import USUAL, GateQuestion
from mcnav.systems.ins.imu.gravity import DISTURBANCES, cause_of
from mcnav.systems.ins.imu.instruments import AXES, CROSS_AXES, Imu
from mcnav.systems.ins.sensors.aiding import Sensor
from mcnav.systems.ins.sensors.delay import WITHOUT_MEMORY
from mcnav.systems.ins.sensors.flexure import FlexureState
from mcnav.systems.ins.sensors.quantity import BEAMS, LEVEL_AXES

NAVIGATION: Final = 9
"""States of attitude, velocity and position."""

EKF: Final = "ekf"
ITERATED: Final = "iterated"
LEFT: Final = "left-invariant"
RIGHT: Final = "right-invariant"
UKF: Final = "ukf"
KINDS: Final = (EKF, ITERATED, LEFT, RIGHT, UKF)
"""Kinds of filters: how their error is defined, and how they update.

`mcnav.systems.ins.reference.error_definitions` and `mcnav.systems.ins.reference.nonlinear_updates` have the equations.
"""

ITERATIONS: Final = 10
"""Most iterations of an update; three suffice where it is nearly linear."""

SETTLED: Final = 1e-3
"""Change of a correction, in sigmas, at which iteration ends."""

SINGULAR: Final = 1e-13
"""Share of a state's variance that other states leave, below which it is rounding: sigma points do without it."""


@dataclass(frozen=True)
class Beliefs:
    """Sizes of errors as the filter believes them.

    Attributes
    ----------
    sigmas : mapping of str to float
        Of constant errors, by source; those it does not believe in are zero or missing.
    covariance : ndarray, shape (9, 9)
        Of the initial navigation errors, in the order of `mcnav.systems.ins.imu.instruments.OUTPUTS`.
    imu : Imu
        Processes of the instruments.
    sensors : tuple of Sensor
        The truth's sensors in order, with believed noise, correlated errors and lever arms.
    """

    sigmas: Mapping[str, float]
    covariance: Array
    imu: Imu
    sensors: tuple[Sensor, ...]


@dataclass(frozen=True)
class FilterState:
    """A state of the filter that is an error of an instrument or a sensor, or a gravity disturbance.

    Attributes
    ----------
    name : str
        Of the constant source or process that it models.
    sigma : float
        Believed standard deviation at the start.
    correlation_time : float
        Of a Gauss-Markov error, s; infinite for a constant or a random walk.
    walk : float
        Density K of a random walk, zero for none.
    considered : bool
    correlation_length : float
        Of a Gauss-Markov error of the distance travelled, m; infinite for others.
    flexure : FlexureState, optional
        Of an angle of a flexure or its rate, each of which follows the other in the order of the states: the sigma is
        that of the natural state, and the correlation time that of the state that only decays.
    """

    name: str
    sigma: float
    correlation_time: float
    walk: float
    considered: bool
    correlation_length: float = np.inf
    flexure: FlexureState | None = None


@dataclass(frozen=True)
class FilterModel:
    """A filter.

    Attributes
    ----------
    estimates, considers : tuple of str
        Kinds of errors besides position, velocity and attitude, which are always estimated: ``gyro_bias``,
        ``accelerometer_scale_factor``, ``gnss_position_bias``, ``gravity_deflection``, …
    beliefs : Beliefs
    lag : float or None
        How long after an instant measurements still count for the smoother that follows, s: infinite with a fixed
        interval; none without a smoother.
    question : GateQuestion
        What is asked of the gates.
    kind : str
        One of `KINDS`.
    """

    estimates: tuple[str, ...]
    considers: tuple[str, ...]
    beliefs: Beliefs
    lag: float | None = None
    question: GateQuestion = USUAL
    kind: str = EKF

    def since(self, start: float) -> FilterModel:
        """Return the same that believes in the sensors' measurements after a time alone, s."""
        sensors = tuple(sensor.since(start) for sensor in self.beliefs.sensors)
        return replace(self, beliefs=replace(self.beliefs, sensors=sensors))

    @property
    def smoothed(self) -> bool:
        """True where a smoother follows."""
        return self.lag is not None

    @cached_property
    def states(self) -> tuple[FilterState, ...]:
        """States besides the nine of navigation, in order; errors in which it does not believe have none.

        A bias stands for all that it consists of: the constant and the rate random walk are one state, the bias
        instability is another. So do a sensor's bias and its correlated error. Jitter is a state where it is
        believed.
        """
        states: list[FilterState] = []
        for kinds, considered in ((self.estimates, False), (self.considers, True)):
            for kind in kinds:
                states += _states_of(kind, self.beliefs, considered)
        return (*states, *self._jitters)

    @property
    def _jitters(self) -> Iterator[FilterState]:
        """Jitter of sensors: noise that is common to the components of a measurement, and forgotten after it.

        Such a state is considered where states may be: estimated or not, it leaves the same gains and covariances of
        all others.
        """
        considered = self.kind == EKF and not self.smoothed
        for sensor in self.beliefs.sensors:
            if sensor.jitter > 0.0:
                yield FilterState(sensor.jitter_name, sensor.jitter, WITHOUT_MEMORY, 0.0, considered)


def _states_of(kind: str, beliefs: Beliefs, considered: bool) -> list[FilterState]:
    """List the states of a kind of errors."""
    states = []
    for name in _constants_of(kind, beliefs):
        sigma, walk = beliefs.sigmas.get(name, 0.0), _walk(name, beliefs.imu)
        if sigma > 0.0 or walk > 0.0:
            states.append(FilterState(name, sigma, np.inf, walk, considered))
    for name, sigma, correlation_time in _correlated_of(kind, beliefs):
        if sigma > 0.0:
            states.append(FilterState(name, sigma, correlation_time, 0.0, considered))
    for sensor in beliefs.sensors:
        if sensor.flexure is not None and kind == f"{sensor.name}_flexure":
            of_axes = (
                FlexureState(sensor.name, sensor.flexure, axis, rate)
                for axis in sensor.flexure.axes
                for rate in (False, True)
            )
            time = 1.0 / sensor.flexure.decay_rate
            states += [
                FilterState(flexure.name, flexure.sigma, time, 0.0, considered, flexure=flexure) for flexure in of_axes
            ]
    gravity = beliefs.imu.gravity
    return states + [
        FilterState(name, gravity.sigma(name), np.inf, 0.0, considered, gravity.length(name))
        for name in DISTURBANCES
        if cause_of(name) == kind and gravity.sigma(name) > 0.0
    ]


def estimated_kinds(constants: tuple[str, ...]) -> tuple[str, ...]:
    """Return the kinds of errors that a filter may estimate or consider, from the names of the constant sources."""
    kinds: dict[str, None] = {}
    for name in constants:
        kinds[_kind(name)] = None
    return tuple(kinds)


def _kind(name: str) -> str:
    """Return the kind of a source or a state: its name without the axis; of a flexure's rate that of the flexure."""
    stem, _, axis = name.replace("_flexure_rate_", "_flexure_").rpartition("_")
    axes = (*AXES, *CROSS_AXES, *LEVEL_AXES, *BEAMS)
    return stem if axis in axes else name


def _constants_of(kind: str, beliefs: Beliefs) -> list[str]:
    instruments = [*(f"{kind}_{axis}" for axis in (*AXES, "xy", "xz", "yx", "yz", "zx", "zy"))]
    named = [name for sensor in beliefs.sensors for name in sensor.constants() if _kind(name) == kind]
    return named or instruments


def _walk(name: str, imu: Imu) -> float:
    """Return the density of the rate random walk that belongs to a bias."""
    for instrument, noise in (("gyro", imu.gyro), ("accelerometer", imu.accelerometer)):
        for axis, size in zip(AXES, noise.rate_random_walk, strict=True):
            if name == f"{instrument}_bias_{axis}":
                return float(size)
    return 0.0


def _correlated_of(kind: str, beliefs: Beliefs) -> list[tuple[str, float, float]]:
    """List the Gauss-Markov errors that belong to a kind: name, sigma, correlation time."""
    for instrument, noise in (("gyro", beliefs.imu.gyro), ("accelerometer", beliefs.imu.accelerometer)):
        if kind == f"{instrument}_bias":
            names = (f"{instrument}_bias_instability_{axis}" for axis in AXES)
            sizes = (noise.instability.tolist(), noise.correlation_time.tolist())
            return list(zip(names, *sizes, strict=True))
    return [
        (component.error_name("correlated"), component.correlated, component.correlation_time)
        for sensor in beliefs.sensors
        for component in sensor.components
        if _kind(component.error_name("bias")) == kind
    ]
