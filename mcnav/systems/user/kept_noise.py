"""Measured covariances of noise that are kept (`mcnav.systems.user.kept`)."""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.caches.stored import Cache
from mcnav.systems.guard import LINEARIZING
from mcnav.systems.user import noise_measurement
from mcnav.systems.user.code import Loaded, UserScenarioSpec
from mcnav.systems.user.kept import KeptNumbers, Kind, keep
from mcnav.systems.user.measured_noise import EVERY, INDEPENDENT, MeasuredNoise
from mcnav.systems.user.noise_measurement import Probes, measure, respond
from mcnav.systems.user.stochastic_engine import SCALE, StochasticUserEngine

KIND: Final = Kind(
    Cache("noise"),
    (noise_measurement.SEED, INDEPENDENT, EVERY, SCALE),
    "measuring the covariance of the noise",
    "the covariance was kept",
    "the covariance of the noise is measured anew",
)


def noise_of(loaded: Loaded, spec: UserScenarioSpec, engine: StochasticUserEngine, sources: int) -> MeasuredNoise:
    """Return the covariance of the noise of a user's class: measured now, in this process before, or by an earlier one.

    Raises
    ------
    ScenarioError
        When a simulation fails, or a file changes that the class reads.
    """
    if loaded.noise is None:
        with loaded.recording(spec.code.file, LINEARIZING):
            probes = Probes.of(engine, sources)

        def simulate() -> KeptNumbers:
            measured = measure(probes, KIND.tell)
            return KeptNumbers((measured.covariance, measured.first), measured.variates)

        kept = keep(loaded, spec, KIND, lambda known: _same(probes, known), simulate)
        covariance, first = kept.arrays
        loaded.noise = MeasuredNoise(covariance, first, kept.variates)
    return loaded.noise


def _same(probes: Probes, kept: KeptNumbers) -> bool:
    """Simulate the first probe again, and compare bits; also compare the number of variates."""
    _, first = kept.arrays
    if kept.variates is None:
        probes = noise_measurement.independent(probes)
    if kept.variates != probes.variates or first.shape != probes.nominal.shape:
        return False
    if not probes.count:
        return True
    try:
        response = respond(probes, 0)
    except noise_measurement.OtherVariates:
        return False
    return isinstance(response, np.ndarray) and response.tobytes() == first.tobytes()
