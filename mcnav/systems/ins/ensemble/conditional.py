"""Samples whose noise is given what it adds to the linear errors of some outputs, and is random otherwise.

The noise of a sample is a vector z of independent standard normals, and adds ``N z`` to the linear errors of outputs
at an epoch; conditions are those of `mcnav.systems.conditions`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.systems.conditions import Conditions
from mcnav.systems.ins.ensemble.adjoint import Adjoint
from mcnav.systems.ins.ensemble.aided import AidedTables, GivenNoise
from mcnav.systems.ins.ensemble.flexures import SensorFlexure
from mcnav.systems.ins.ensemble.free import EnsembleTables
from mcnav.systems.sample_loop import join_results

STREAM: Final = 1 << 20
"""Highest word of the counter, apart from those of `mcnav.systems.ins.imu.sample_noise`."""

LARGEST: Final = 4_000_000
"""Numbers in the variates of samples that are simulated together, which take 32 MB."""


class Variates(NamedTuple):
    """Standard normals of the noise, or numbers for each of them, by what they drive; shapes begin with the same axis.

    Attributes
    ----------
    start : ndarray, shape (..., b)
        Biases of processes at the start.
    steps : ndarray, shape (..., K, 9 + b)
        What processes add in the steps, by the columns of `EnsembleTables.factors`.
    white, correlated : ndarray, shape (..., U, M)
        White noise and correlated errors of the measurements.
    flexure : ndarray, shape (..., I, 3, 2)
        Angles and rates of the flexures of sensors, one after the other, at all of their instants.
    jitter : ndarray, shape (..., J)
        Jitter of the J measurements of sensors that have it.
    """

    start: Array
    steps: Array
    white: Array
    correlated: Array
    flexure: Array
    jitter: Array


@dataclass(frozen=True)
class Measured:
    """Parts of the noise of measurements, as `AidedTables` has it, and their place among the steps.

    Attributes
    ----------
    first : ndarray of int, shape (K + 2,)
        Number of the first update at each time.
    components : ndarray of int, shape (U, M)
    white, correlated, memory : ndarray, shape (U, M)
    swings : ndarray, shape (U, M, b)
        What each bias of a process adds to the measurements, where these need the rate of the body.
    flexures : tuple of SensorFlexure
    bent : ndarray, shape (U, M, 6)
        As `mcnav.systems.ins.sensors.measurements.Measurements` has the responses to them.
    jitters : ndarray, shape (U,)
        Sigma of the jitter of each measurement, s.
    changes : ndarray, shape (U, M)
        As `mcnav.systems.ins.sensors.measurements.Measurements` has them.
    """

    first: IndexArray
    components: IndexArray
    white: Array
    correlated: Array
    memory: Array
    swings: Array
    flexures: tuple[SensorFlexure, ...] = ()
    bent: Array = field(default_factory=lambda: np.zeros((0, 0, 6)))
    jitters: Array = field(default_factory=lambda: np.zeros(0))
    changes: Array = field(default_factory=lambda: np.zeros((0, 0)))

    @classmethod
    def nothing(cls, steps: int, biases: int) -> Measured:
        """Return that of a navigator without aiding."""
        none = np.zeros((0, 0))
        first = np.zeros(steps + 2, dtype=np.int64)
        return cls(first, none.astype(np.int64), none, none, none, np.zeros((0, 0, biases)))

    @classmethod
    def of(cls, tables: AidedTables) -> Measured:
        """Return that of samples with filters."""
        measured, rate_errors = tables.loop.measurements, tables.rate_errors
        swings = np.zeros((*tables.white.shape, len(rate_errors)))
        if measured.swings.shape[2]:
            known = rate_errors >= 0
            # a rate that is too large makes the measured velocity of the antenna too small
            swings[:, :, known] = -measured.swings[:, :, rate_errors[known]]
        return cls(
            tables.loop.first_updates, measured.components, tables.white, tables.correlated, tables.memory, swings,
            tables.flexures, measured.flexure,
            np.array([sensor.jitter for sensor in tables.loop.sensors])[measured.sensors], measured.changes,
        )  # fmt: skip

    def moved(self, flexure: SensorFlexure) -> Array:
        """Return what angles and rates about the three axes add to a sensor's measurements, shape (u, M, 3, 2)."""
        bent = self.bent[flexure.updates]
        return np.asarray(bent.reshape(*bent.shape[:2], 2, 3).swapaxes(2, 3))

    @cached_property
    def driven(self) -> Array:
        """Sigma of what drives the correlated errors since the update before, shape (U, M)."""
        return np.asarray(self.correlated * np.sqrt(1.0 - self.memory**2))


@dataclass(frozen=True)
class NoiseSystem:
    """The noise of samples as a linear system of standard normals."""

    shared: EnsembleTables
    adjoint: Adjoint
    measured: Measured

    @cached_property
    def partials(self) -> Variates:
        """N: responses of the nine linear errors at the last epoch, by a recursion backwards; `Variates`, (9, ...)."""
        shared, adjoint, measured = self.shared, self.adjoint, self.measured
        steps, biases = len(shared.durations), len(shared.sizes)
        later = np.empty((steps + 1, 9, biases))
        response = np.zeros((9, biases))
        for k in range(steps, -1, -1):
            if k < steps:
                response = np.einsum("oi,qi->oq", adjoint.steps[k], shared.biases[k]) + response * shared.decays[k]
            for u in range(measured.first[k], measured.first[k + 1]):
                response = response + np.einsum("oc,cq->oq", adjoint.updates[u], measured.swings[u])
            later[k] = response
        driving = np.concatenate([adjoint.steps, later[1:]], axis=2)
        return Variates(
            later[0] * shared.sizes,
            np.einsum("koi,kij->okj", driving, shared.factors),
            np.einsum("uoc,uc->ouc", adjoint.updates, measured.white),
            self._correlated_partials(),
            np.concatenate([np.zeros((9, 0, 3, 2)), *map(self._flexure_partials, self.measured.flexures)], axis=1),
            -np.einsum("uoc,uc,u->ou", adjoint.updates, measured.changes, measured.jitters)[:, measured.jitters > 0.0],
        )

    def _flexure_partials(self, flexure: SensorFlexure) -> Array:
        """Return the responses to what drives the flexure of a sensor, shape (9, i, 3, 2)."""
        over, roots = flexure.flexure.drawn_steps(flexure.instants)
        seen = np.einsum("uoc,ucar->uoar", self.adjoint.updates[flexure.updates], self.measured.moved(flexure))
        partials, later = np.zeros((9, len(flexure.instants), 3, 2)), np.zeros((9, 3, 2))
        for i in range(len(flexure.instants) - 1, -1, -1):
            later = later + seen[flexure.measured == i].sum(axis=0) * flexure.flexure.sizes
            partials[:, i] = later @ roots[i - 1] if i else later
            later = later @ over[i - 1]
        return partials

    def _correlated_partials(self) -> Array:
        """Return the responses to what drives the correlated errors, shape (9, U, M)."""
        measured = self.measured
        partials = np.zeros((9, *measured.white.shape))
        if not measured.correlated.any():
            return partials
        later = np.zeros((int(measured.components.max()) + 1, 9))
        for u in range(len(measured.white) - 1, -1, -1):
            for c in np.flatnonzero(measured.correlated[u]):
                component = measured.components[u, c]
                response = self.adjoint.updates[u, :, c] + later[component]
                partials[:, u, c] = measured.driven[u, c] * response
                later[component] = measured.memory[u, c] * response
        return partials

    def rows(self, outputs: tuple[int, ...]) -> Array:
        """Return rows of N of some outputs, flat, shape (m, Z)."""
        chosen = list(outputs)
        return np.concatenate([each[chosen].reshape(len(chosen), each[0].size) for each in self.partials], axis=1)

    def draw(self, seed: int, indices: IndexArray) -> Array:
        """Draw z for samples, each from the counter-based generator keyed by seed and index, shape (n, Z)."""
        counter = np.array([0, 0, 0, STREAM], dtype=np.uint64)
        drawn = np.empty((len(indices), sum(self._sizes)))
        for row, index in enumerate(indices):
            key = np.array((seed, index), dtype=np.uint64)
            np.random.Generator(np.random.Philox(counter=counter, key=key)).standard_normal(out=drawn[row])
        return drawn

    def parted(self, normals: Array) -> Variates:
        """Return z, shape (n, Z), by what it drives."""
        parts = np.split(normals, np.cumsum(self._sizes)[:-1], axis=1)
        shapes = [each.shape[1:] for each in self.partials]
        return Variates(*(part.reshape(len(normals), *shape) for part, shape in zip(parts, shapes, strict=True)))

    @property
    def _sizes(self) -> list[int]:
        return [each[0].size for each in self.partials]

    def given(self, variates: Variates) -> GivenNoise:
        """Return what z adds to steps and measurements."""
        shared, measured = self.shared, self.measured
        added = np.einsum("kij,nkj->nki", shared.factors, variates.steps)
        start = shared.sizes * variates.start
        errors = measured.white * variates.white
        if len(shared.durations):
            # biases of given noise start at zero: that of the start acts in the first step, and at its updates
            added[:, 0, :9] += np.einsum("nq,qi->ni", start, shared.biases[0])
            added[:, 0, 9:] += start * shared.decays[0]
            at_start = slice(measured.first[0], measured.first[1])
            errors[:, at_start] += np.einsum("nq,ucq->nuc", start, measured.swings[at_start])
        if measured.correlated.any():
            drifts = np.zeros((len(start), int(measured.components.max()) + 1))
            for u in range(len(measured.white)):
                chosen = np.flatnonzero(measured.correlated[u])
                at = measured.components[u, chosen]
                drifts[:, at] = measured.memory[u, chosen] * drifts[:, at] + (
                    measured.driven[u, chosen] * variates.correlated[:, u, chosen]
                )
                errors[:, u, chosen] += drifts[:, at]
        jitters = np.zeros((len(start), len(measured.jitters)))
        jitters[:, measured.jitters > 0.0] = measured.jitters[measured.jitters > 0.0] * variates.jitter
        first = 0
        for each in measured.flexures:
            last = first + len(each.instants)
            drawn = each.flexure.draw(each.instants, variates.flexure[:, first:last].swapaxes(0, 1))
            errors[:, each.updates] += np.einsum("ucar,unar->nuc", measured.moved(each), drawn[each.measured])
            first = last
        return GivenNoise(added, errors, jitters if jitters.any() else None)

    @property
    def together(self) -> int:
        """Samples whose variates are in memory together."""
        return max(1, LARGEST // max(1, sum(self._sizes)))


@dataclass(frozen=True)
class ConditionalSamples:
    """Samples with conditions on what noise adds to the linear errors of some outputs, at the end or at epochs.

    ``engine`` simulates samples with given noise, no more than ``most`` at a time.
    """

    noise: NoiseSystem
    conditions: Conditions
    most: int
    engine: Callable[[Batch, GivenNoise], SimulationResult]

    @classmethod
    def of(
        cls, noise: NoiseSystem, outputs: tuple[int, ...], epochs: tuple[int, ...] | None,
        adjoint_at: Callable[[int], Adjoint], most: int, engine: Callable[[Batch, GivenNoise], SimulationResult],
    ) -> ConditionalSamples:  # fmt: skip
        """Find the conditions; ``adjoint_at`` runs the linear system backwards from an epoch."""
        rows = [] if epochs else [noise.rows(outputs)]
        for epoch in dict.fromkeys(epochs or ()):
            there = tuple(output for output, at in zip(outputs, epochs or (), strict=True) if at == epoch)
            rows.append(replace(noise, adjoint=adjoint_at(epoch)).rows(there))
        return cls(noise, Conditions.on(np.concatenate(rows)), most, engine)

    @property
    def factor(self) -> Array:
        """Additions of the normals to the outcomes; those of an epoch follow each other."""
        return self.conditions.factor

    def simulate(self, batch: Batch, normals: Array) -> SimulationResult:
        """Simulate samples with these normals of their noise, shape (n, r)."""
        results, step = list[SimulationResult](), min(self.most, self.noise.together)
        for begin in range(0, len(normals), step):
            piece, wanted = batch[begin : begin + step], normals[begin : begin + step]
            met = self.conditions.met(self.noise.draw(batch.seed, piece.index), wanted)
            results.append(self.engine(piece, self.noise.given(self.noise.parted(met))))
        return join_results(results)
