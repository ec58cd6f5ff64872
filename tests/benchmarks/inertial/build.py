"""The case of the peers, with its reference: the navigator and the filter in earth-fixed axes at every reading."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.config.read import read_campaign
from mcnav.systems.ins.imu.instruments import CONSTANTS
from mcnav.systems.ins.imu.sample_noise import SampleNoise
from mcnav.systems.ins.reference.aided import AidedMechanization
from mcnav.systems.ins.reference.collocation import WEIGHTS
from mcnav.systems.ins.scenario import Navigation
from tests.benchmarks.inertial.case import READING, SEED, Case, pack
from tests.benchmarks.inertial.flight import PEERS, Setup, draws, navigation_of, write_campaign

EPOCH: Final = 60.0
"""Interval at which errors are compared, s."""

BIASES: Final = tuple(CONSTANTS.index(f"{kind}_bias_{axis}") for kind in ("gyro", "accelerometer") for axis in "xyz")


@dataclass(frozen=True)
class Reference:
    """The reference engine at the instruments' rate, and samples with their noise.

    Attributes
    ----------
    campaign : Path
    errors : ndarray, shape (n, sources)
    """

    campaign: Path
    navigation: Navigation
    engine: AidedMechanization
    errors: Array
    noise: tuple[SampleNoise, ...]


def reference_of(folder: Path, samples: int, setup: Setup = PEERS, epoch: float = EPOCH) -> Reference:
    """Read the campaign and draw samples of the reference engine, with epochs at an interval."""
    file = write_campaign(folder, setup)
    campaign = read_campaign(file)
    navigation = navigation_of(campaign)
    if navigation.filter is None:
        raise ValueError("expected aided navigation")
    times = np.arange(navigation.start + epoch, navigation.end + 0.5 * epoch, epoch)
    engine = AidedMechanization(
        navigation.truth, navigation.platform, navigation.start, navigation.end, times, navigation.sensors,
        navigation.filter, READING,
    )  # fmt: skip
    noise = tuple(engine.draw(navigation.imu, SEED, index) for index in range(samples))
    return Reference(file, navigation, engine, draws(campaign, samples), noise)


def case_of(reference: Reference, sigma: Array) -> Case:
    """Simulate the reference samples and arrange the case.

    Parameters
    ----------
    sigma : ndarray, shape (m, 9)
        The filter's own along the truth, at the engine's epochs.
    """
    engine, navigation = reference.engine, reference.navigation
    steps = engine.step_times
    readings = len(steps) - 1
    if np.abs(np.diff(steps) - READING).max() > 1e-9:
        raise ValueError(f"the trajectory's rows must be multiples of {READING:g} s apart")
    increments = READING * np.einsum("p,kpi->ki", WEIGHTS, engine.navigator.readings.values[:readings])
    sensor = navigation.sensors[0]
    states = pack(engine.navigator.earth_fixed(np.concatenate([[navigation.start], sensor.times])))
    found = [engine.simulate(*each)[0] for each in zip(reference.errors, reference.noise, strict=True)]
    beliefs = engine.model.beliefs
    added = [READING * np.hstack([each.gyro, each.accelerometer]) for each in reference.noise]
    return Case(
        str(reference.campaign), navigation.start, increments, states[0], _numbers(navigation, sensor.times),
        states[1:], _numbers(navigation, engine.times), sigma, np.sqrt(np.diag(beliefs.covariance)),
        np.array([beliefs.sigmas[CONSTANTS[place]] for place in BIASES]),
        np.concatenate([navigation.imu.gyro.random_walk, navigation.imu.accelerometer.random_walk]),
        np.array([component.noise for component in sensor.components]), np.array(found),
        reference.errors[:, :9], reference.errors[:, BIASES], np.array(added),
        np.array([each.measurements[sensor.name] for each in reference.noise]),
    )  # fmt: skip


def _numbers(navigation: Navigation, times: Array) -> Array:
    return np.rint((times - navigation.start) / READING).astype(np.int64)


def own_sigma(reference: Reference) -> Array:
    """Return the filter's sigmas along the truth at the epochs, by linear covariance of mcnav."""
    aided = reference.navigation.aided
    if aided is None:
        raise ValueError("expected aided navigation")
    updates, linear = aided.read_out(reference.engine.times)
    after = np.array([update != "before" for update in updates])
    return np.asarray(np.sqrt(np.diagonal(linear.own, axis1=1, axis2=2))[after])
