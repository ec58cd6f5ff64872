"""Causes of errors of a campaign, and the error model with all of them as states, in earth-fixed axes.

The errors s of a record are the nine of navigation and every constant error, bias instability, rate random walk and
correlated error that the campaign has. Constant errors that it does not have, and that a record can show, are states of
no size; processes that it does not have are states of a size from which they are looked for.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.quantities import Output, Source
from mcnav.contract.recorded import Cause, Offset
from mcnav.systems.ins.filter.model import NAVIGATION, Beliefs, FilterModel, FilterState, estimated_kinds
from mcnav.systems.ins.imu.instruments import ACCELEROMETER, GYRO, OUTPUTS, Imu, Noise
from mcnav.systems.ins.reference.earth_fixed_errors import Driving, ErrorModel
from mcnav.systems.ins.sensors.aiding import Sensor, aiding_constants
from mcnav.systems.ins.sensors.registry import SENSOR_TYPES

ABSENT: Final = 1e-9
"""Share of its usual size that an error has which a campaign does not have: a state, and nothing besides."""

START: Final = {"position": (0, 1, 2), "velocity": (3, 4, 5), "tilt": (6, 7), "heading": (8,)}
"""Kinds of initial navigation errors, and their places in `OUTPUTS`."""

TOGETHER: Final = "navigation errors at the start"

OF_INSTRUMENTS: Final = ("gyro_bias", "accelerometer_bias", "gyro_scale_factor", "accelerometer_scale_factor")
"""Kinds of the instruments' errors that a record can show although the campaign does not have them."""

MISSING_TIME: Final = 30.0
"""Correlation time of the processes that a campaign does not have, s."""

JITTER: Final = 0.01
"""Sigma from which jitter is looked for, s."""

LEAST: Final = {"gyro": 5e-6, "accelerometer": 1e-3}
"""Sigma from which a process of instruments without white noise is looked for, rad/s and m/s^2."""

WALKS: Final = {"gyro": "angle_random_walk", "accelerometer": "velocity_random_walk"}


@dataclass(frozen=True)
class Campaign:
    """True errors of a campaign.

    Attributes
    ----------
    names : tuple of str
        Constant sources.
    mean, covariance : ndarray, shape (n,), (n, n)
        Of the sources.
    units : mapping of str to (str, str, float)
        Of sources and processes: SI unit, unit shown, usual size.
    missing : tuple of str
        Kinds of Gauss-Markov processes that the campaign does not have, and this one has.
    """

    names: tuple[str, ...]
    mean: Array
    covariance: Array
    units: Mapping[str, tuple[str, str, float]]
    imu: Imu
    sensors: tuple[Sensor, ...]
    missing: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, sources: tuple[Source, ...], processes: tuple[Output, ...], mean: Array, covariance: Array, imu: Imu,
        sensors: tuple[Sensor, ...],
    ) -> Campaign:  # fmt: skip
        """Collect the units of sources and processes."""
        units = {each.name: (each.unit, each.shown_in, each.nominal) for each in sources}
        units |= {each.name: (each.unit, each.shown_in, 1.0) for each in processes}
        components = [component for sensor in sensors for component in sensor.components]
        units |= {each.error_name("correlated"): units[each.error_name("noise")] for each in components}
        units |= {sensor.jitter_name: units[sensor.delay_name] for sensor in sensors if sensor.has_delay}
        return cls(tuple(each.name for each in sources), mean, covariance, units, imu, sensors)

    def with_missing(self) -> Campaign:
        """Return the same with the Gauss-Markov processes that it does not have."""
        gyro, accelerometer = (
            noise if noise.instability.any() else _with_instability(noise, LEAST[name])
            for name, noise in (("gyro", self.imu.gyro), ("accelerometer", self.imu.accelerometer))
        )
        missing = [
            f"{name}_bias_instability"
            for name, noise, with_it in (
                ("gyro", self.imu.gyro, gyro), ("accelerometer", self.imu.accelerometer, accelerometer)
            )
            if with_it is not noise
        ]  # fmt: skip
        known = {each.label for sensor in self.sensors for each in sensor.components if each.correlated > 0.0}
        labels = {
            each.label for sensor in self.sensors if SENSOR_TYPES[sensor.kind].errors for each in sensor.components
        } - known
        sensors = tuple(
            replace(sensor, components=tuple(
                replace(each, correlated=each.noise, correlation_time=MISSING_TIME) if each.label in labels else each
                for each in sensor.components
            ), jitter=sensor.jitter or JITTER * sensor.has_delay)
            for sensor in self.sensors
        )  # fmt: skip
        missing += [f"{label}_correlated" for label in sorted(labels)]
        missing += [sensor.jitter_name for sensor in self.sensors if sensor.has_delay and not sensor.jitter]
        return replace(self, imu=replace(self.imu, gyro=gyro, accelerometer=accelerometer), sensors=sensors,
                       missing=tuple(missing))  # fmt: skip

    @cached_property
    def sigmas(self) -> dict[str, float]:
        """Standard deviations of the sources, by name."""
        return dict(zip(self.names, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    @cached_property
    def means(self) -> dict[str, float]:
        """Means of the sources, by name."""
        return dict(zip(self.names, self.mean.tolist(), strict=True))

    @cached_property
    def kinds(self) -> tuple[tuple[str, tuple[str, ...]], ...]:
        """Kinds of constant errors of instruments and of these sensors, and their sources."""
        members: dict[str, list[str]] = {}
        for name in (*GYRO, *ACCELEROMETER, *aiding_constants(self.sensors)):
            members.setdefault(estimated_kinds((name,))[0], []).append(name)
        return tuple((kind, tuple(names)) for kind, names in members.items())

    def is_absent(self, members: tuple[str, ...]) -> bool:
        """Return whether the campaign gives no size to any of some sources."""
        return all(self.sigmas[name] == 0.0 and self.means[name] == 0.0 for name in members)

    @property
    def _shown_by_sensors(self) -> tuple[str, ...]:
        """Kinds of sensors' errors that a record can show although the campaign does not have them."""
        biases = [
            component.label + "_bias"
            for sensor in self.sensors if SENSOR_TYPES[sensor.kind].errors
            for component in sensor.components
        ]  # fmt: skip
        arms = (f"{sensor.name}_lever_arm" for sensor in self.sensors if sensor.has_lever_arm)
        times = (
            name for sensor in self.sensors if sensor.has_delay for name in (sensor.delay_name, sensor.jitter_name)
        )
        return (*times, *biases, *arms)

    @cached_property
    def model(self) -> ErrorModel:
        """The error model with all errors as states."""
        kinds, sigmas = [], dict(self.sigmas)
        for kind, members in self.kinds:
            if not self.is_absent(members) or kind in (*OF_INSTRUMENTS, *self._shown_by_sensors):
                kinds.append(kind)
                sigmas |= {
                    name: ABSENT * self.units[name][2]
                    for name in members
                    if self.sigmas[name] == 0.0 and (self.is_absent(members) or self.means[name] != 0.0)
                }
        initial = self.covariance[:NAVIGATION, :NAVIGATION]
        return ErrorModel(FilterModel(tuple(kinds), (), Beliefs(sigmas, initial, self.imu, self.sensors)))


@dataclass(frozen=True)
class CauseTable:
    """Causes of a campaign, and where each enters its error model.

    Attributes
    ----------
    causes : tuple of Cause
    driving : tuple of (int, Driving)
        Processes: number of the cause, and the white noise that it is.
    start : ndarray of int, shape (e,)
        Number of the cause of each error at the start; -1 for none.
    noise : mapping of str to int
        Cause of the white noise of components, by their labels.
    """

    causes: tuple[Cause, ...]
    driving: tuple[tuple[int, Driving], ...]
    start: IndexArray
    noise: Mapping[str, int]


def tabulate_causes(campaign: Campaign) -> CauseTable:
    """List the causes of a campaign."""
    states = campaign.model.states
    causes: list[Cause] = []
    start = np.full(NAVIGATION + len(states), -1)
    start[:NAVIGATION] = _causes_of_start(campaign, causes)
    driving = _driving_of_readings(campaign, causes)
    numbers: dict[str, int] = {}
    for place, state in enumerate(states):
        kind = estimated_kinds((state.name,))[0]
        if state.sigma > 0.0 and (campaign.sigmas.get(state.name, 1.0) > 0.0):
            if kind not in numbers:
                numbers[kind] = len(causes)
                causes.append(_cause(campaign, kind, [each.sigma for each in _members(states, kind)], state.name))
            start[NAVIGATION + place] = numbers[kind]
    for kind in dict.fromkeys(estimated_kinds((state.name,))[0] for state in states):
        members = _members(states, kind)
        mask = np.array([float(state in members) for state in states])
        if any(np.isfinite(state.correlation_time) for state in members):
            driving.append((numbers[kind], Driving(np.zeros(3), np.zeros(3), mask)))
        elif walks := [state.walk for state in members if state.walk > 0.0]:
            name = kind.replace("_bias", "_rate_random_walk")
            driving.append((len(causes), Driving(np.zeros(3), np.zeros(3), mask)))
            causes.append(_cause(campaign, name, walks, f"{name}_x"))
    noise: dict[str, int] = {}
    for sensor in campaign.sensors:
        for component in sensor.components:
            if component.label not in noise:
                noise[component.label] = len(causes)
                sizes = [each.noise for each in sensor.components if each.label == component.label]
                cause = _cause(campaign, f"{component.label}_noise", sizes, component.error_name("noise"))
                if sensor.log is not None and component.noise_at is not None:
                    key = f"[[aiding]] {sensor.name}: log_factor"
                    cause = replace(cause, key=key, log_factor=sensor.log.factor)
                causes.append(cause)
    return CauseTable(tuple(causes), tuple(driving), start.astype(np.int64), noise)


def _members(states: tuple[FilterState, ...], kind: str) -> list[FilterState]:
    """Return the states of a kind."""
    return [state for state in states if estimated_kinds((state.name,))[0] == kind]


def _with_instability(noise: Noise, least: float) -> Noise:
    """Return noise with a process that adds as much within its correlation time as the white noise does."""
    size = max(float(noise.random_walk.max()) / np.sqrt(2.0 * MISSING_TIME), least)
    return replace(noise, instability=np.full(3, size), correlation_time=np.full(3, MISSING_TIME))


def _cause(campaign: Campaign, kind: str, sizes: list[float], name: str) -> Cause:
    unit, shown_in, _ = campaign.units[name]
    absent = kind in campaign.missing
    return Cause(
        kind, float(max(sizes)), unit, shown_in, key_of(kind, campaign.sensors), absent=absent,
        correlation_time=MISSING_TIME if absent and not kind.endswith("_jitter") else 0.0,
    )  # fmt: skip


def _causes_of_start(campaign: Campaign, causes: list[Cause]) -> Array:
    """List the causes of the initial navigation errors; correlated ones are one cause."""
    covariance = campaign.covariance[:NAVIGATION, :NAVIGATION]
    blocks = np.zeros_like(covariance, dtype=bool)
    for places in START.values():
        blocks[np.ix_(places, places)] = True
    result = np.full(NAVIGATION, -1)
    if np.any(covariance[~blocks] != 0.0):
        result[np.diag(covariance) > 0.0] = len(causes)
        causes.append(Cause(TOGETHER, 1.0, "1", "1", "[errors] position, velocity, tilt, heading"))
        return result
    for kind, places in START.items():
        sizes = np.sqrt(np.diag(covariance)[list(places)])
        if np.any(sizes > 0.0):
            result[list(places)] = len(causes)
            causes.append(_cause(campaign, kind, sizes.tolist(), OUTPUTS[places[0]]))
    return result


def _driving_of_readings(campaign: Campaign, causes: list[Cause]) -> list[tuple[int, Driving]]:
    """List the white noise of the readings."""
    driving, nothing = [], np.zeros(len(campaign.model.states))
    for instrument, walk in WALKS.items():
        size = getattr(campaign.imu, instrument).random_walk
        if np.any(size > 0.0):
            densities = {each: size if each == instrument else np.zeros(3) for each in WALKS}
            driving.append((len(causes), Driving(densities["gyro"], densities["accelerometer"], nothing)))
            name = f"{instrument}_{walk}"
            causes.append(_cause(campaign, name, size.tolist(), f"{name}_x"))
    return driving


def list_offsets(campaign: Campaign) -> tuple[Offset, ...]:
    """List the constant errors that the campaign does not have, and that its error model has as states."""
    names = [state.name for state in campaign.model.states]
    result = []
    for kind, members in campaign.kinds:
        if campaign.is_absent(members) and all(name in names for name in members):
            places = np.array([NAVIGATION + names.index(name) for name in members], dtype=np.int64)
            axes = tuple(name.removeprefix(kind).strip("_") for name in members)
            unit, shown_in, _ = campaign.units[members[0]]
            used = next((each.lever_arm for each in campaign.sensors if kind == f"{each.name}_lever_arm"), None)
            result.append(Offset(kind, axes, places, unit, shown_in, key_of(kind, campaign.sensors), used))
    return tuple(result)


def key_of(kind: str, sensors: tuple[Sensor, ...]) -> str:
    """Return where a campaign has the size of a kind of errors.

    >>> key_of("gyro_angle_random_walk", ())
    '[imu.gyro] angle_random_walk'
    >>> key_of("heading", ())
    '[errors] heading'
    """
    if kind in START:
        return f"[errors] {kind}"
    for instrument in WALKS:
        if kind.startswith(f"{instrument}_"):
            return f"[imu.{instrument}] {kind.removeprefix(f'{instrument}_')}"
    for sensor in sensors:
        if kind == f"{sensor.name}_lever_arm":
            return f"[[aiding]] {sensor.name}: lever_arm"
        if kind in (sensor.delay_name, sensor.jitter_name):
            return f"[[aiding]] {sensor.name}: {kind.removeprefix(f'{sensor.name}_')}"
        if kind in (f"{sensor.name}_{offset}" for offset in sensor.offsets):
            return f"[[aiding]] {sensor.name}: {kind.removeprefix(f'{sensor.name}_')}_error"
        sort = SENSOR_TYPES[sensor.kind]
        for measured in sort.quantities:
            label = sort.label(sensor.name, measured)
            if kind.startswith(f"{label}_"):
                error = kind.removeprefix(f"{label}_")
                return f"[[aiding]] {sensor.name}: {measured if error == 'noise' else sort.key(measured, error)}"
    raise ValueError(f"{kind} is not a kind of errors of {', '.join(sensor.name for sensor in sensors)}")
