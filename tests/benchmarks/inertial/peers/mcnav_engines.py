"""mcnav's own engines of aided navigation: gains of each sample's own, gains along the truth, and the reference.

They are read from the campaign's file and prepared as a run would do it. The noise that is given to the ensemble is
that of the readings, as what it adds to the deviations over a step between updates.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.config.read import read_campaign
from mcnav.contract.samples import Batch
from mcnav.systems.ins.aided import AidedEngine, AidedReferenceEngine
from mcnav.systems.ins.ensemble.aided import GivenNoise, simulate_aided
from mcnav.systems.ins.imu.linear_noise import respond_from_rest
from mcnav.systems.ins.imu.sample_noise import SampleNoise
from tests.benchmarks.inertial.build import BIASES
from tests.benchmarks.inertial.case import READING, Case, Samples
from tests.benchmarks.inertial.flight import draws
from tests.benchmarks.inertial.peer import Peer, Simulate

PROBES = 64
"""Samples on which a run settles the steps."""


def constants(samples: Samples, sources: int) -> Array:
    """Return the constant errors as mcnav has them, shape (n, sources)."""
    errors = np.zeros((len(samples), sources))
    errors[:, :9], errors[:, BIASES] = samples.initial, samples.biases
    return errors


def noise_of(samples: Samples, row: int, sensor: str, numbers: IndexArray) -> SampleNoise:
    """Return the given noise of one sample, as means over steps between readings of some numbers."""
    total = np.concatenate([np.zeros((1, 6)), np.cumsum(samples.increments[row], axis=0)])[numbers]
    mean = np.diff(total, axis=0) / (READING * np.diff(numbers))[:, None]
    return SampleNoise(mean[:, :3], mean[:, 3:], {sensor: samples.measurements[row]})


def _engine(case: Case, name: str) -> tuple[AidedEngine | AidedReferenceEngine, int]:
    """Prepare an engine; return it with the number of sources."""
    campaign = read_campaign(Path(case.campaign))
    probes = draws(campaign, PROBES)
    engine = campaign.scenario.engine(name, probes)
    if not isinstance(engine, (AidedEngine, AidedReferenceEngine)):
        raise TypeError(f"expected an engine of aided navigation; got {type(engine).__name__}")
    return engine, probes.shape[1]


def _places(engine: AidedEngine | AidedReferenceEngine, case: Case) -> IndexArray:
    """Return the numbers of the engine's epochs that are those of the case."""
    return np.searchsorted(engine.navigation.times, case.start + READING * case.epochs - 0.5 * READING)


def _ensemble(name: Literal["ensemble", "shared-gains"]):  # type: ignore[no-untyped-def]
    def prepare(case: Case, setting: float, cores: int) -> Simulate:
        engine, sources = _engine(case, name)
        if not isinstance(engine, AidedEngine):
            raise TypeError(f"expected an ensemble; got {type(engine).__name__}")
        navigation, tables = engine.navigation, engine.tables
        places, steps = _places(engine, case), case.start + READING * np.arange(len(case.increments) + 1.0)

        def given(samples: Samples) -> GivenNoise:
            width = tables.ensemble.factors.shape[1]
            added = np.zeros((len(samples), len(tables.loop.times) - 1, width))
            for row, increments in enumerate(samples.increments):
                gyro, accelerometer = np.split(increments / READING, 2, axis=1)
                added[row, :, :9] = respond_from_rest(
                    navigation.truth, navigation.platform, steps, tables.loop.times, gyro, accelerometer
                )
            return GivenNoise(added, samples.measurements)

        def simulate(samples: Samples, seed: int) -> Array:
            errors, index = constants(samples, sources), np.arange(len(samples))
            if samples.given:
                return simulate_aided(tables, errors, seed, index, engine.own, given(samples)).values[:, places]
            history = engine.simulate(Batch(index, errors, seed)).history
            if history is None:
                raise TypeError("expected histories")
            return history[:, places]

        return simulate

    return prepare


def _reference(case: Case, setting: float, cores: int) -> Simulate:
    """Prepare the reference engine with its own steps, over which noise that is given is averaged."""
    engine, sources = _engine(case, "reference")
    if not isinstance(engine, AidedReferenceEngine):
        raise TypeError(f"expected the reference; got {type(engine).__name__}")
    mechanization, places = engine.mechanization, _places(engine, case)
    numbers = np.rint((mechanization.step_times - case.start) / READING).astype(np.int64)
    sensor = engine.navigation.sensors[0].name

    def simulate(samples: Samples, seed: int) -> Array:
        errors = constants(samples, sources)
        if samples.given:
            noise = [noise_of(samples, row, sensor, numbers) for row in range(len(samples))]
            return np.array([mechanization.simulate(*each)[0] for each in zip(errors, noise, strict=True)])[:, places]
        history = engine.simulate(Batch(np.arange(len(samples)), errors, seed)).history
        if history is None:
            raise TypeError("expected histories")
        return history[:, places]

    return simulate


AUTOMATIC = (0.0,)
"""The steps are settled by the engine."""

OWN = Peer(_ensemble("ensemble"), "automatic", AUTOMATIC, 64, "threads", errors=True)
SHARED = Peer(_ensemble("shared-gains"), "automatic", AUTOMATIC, 256, "threads", errors=True)
REFERENCE = Peer(_reference, "automatic", AUTOMATIC, 1, "threads", errors=True)
