"""Samples whose noise is given what it adds to the linear errors of some outputs, and is random otherwise.

The noise of a sample is a vector z of independent standard normals, and adds ``N z`` to the linear errors of outputs
at the last epoch. With random z,

    z' = z + N^T (N N^T)^+ (y - N z)

has the distribution of z under the condition ``N z = y`` (Journel and Huijbregts, *Mining Geostatistics*, 1978, of
conditional simulation).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.contract.failure import Failure
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.systems.ins.ensemble.aided import AidedTables, GivenNoise
from mcnav.systems.ins.ensemble.free import EnsembleTables
from mcnav.systems.ins.linear.adjoint import Adjoint

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
    """

    start: Array
    steps: Array
    white: Array
    correlated: Array


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
    """

    first: IndexArray
    components: IndexArray
    white: Array
    correlated: Array
    memory: Array
    swings: Array

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
            tables.loop.first_updates, measured.components, tables.white, tables.correlated, tables.memory, swings
        )

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
        )

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

    def covariance(self, outputs: tuple[int, ...]) -> Array:
        """Return ``N N^T`` of some outputs, shape (m, m)."""
        rows = self._rows(outputs)
        return np.asarray(sum(np.einsum("is,js->ij", each, each) for each in rows))

    def _rows(self, outputs: tuple[int, ...]) -> list[Array]:
        """Return rows of N, flat."""
        return [each[list(outputs)].reshape(len(outputs), each[0].size) for each in self.partials]

    def draw(self, seed: int, indices: IndexArray) -> Variates:
        """Draw z for samples, each from the counter-based generator keyed by seed and index; `Variates`, (n, ...)."""
        shapes = [each.shape[1:] for each in self.partials]
        sizes = [int(np.prod(shape)) for shape in shapes]
        places = np.cumsum(sizes)[:-1]
        counter = np.array([0, 0, 0, STREAM], dtype=np.uint64)
        drawn = np.empty((len(indices), sum(sizes)))
        for row, index in enumerate(indices):
            key = np.array((seed, index), dtype=np.uint64)
            np.random.Generator(np.random.Philox(counter=counter, key=key)).standard_normal(out=drawn[row])
        parts = np.split(drawn, places, axis=1)
        return Variates(*(part.reshape(len(indices), *shape) for part, shape in zip(parts, shapes, strict=True)))

    def conditioned(self, variates: Variates, outputs: tuple[int, ...], wanted: Array) -> Variates:
        """Return z' of z, with the linear errors of some outputs that are wanted, shape (n, m)."""
        rows = self._rows(outputs)
        flat = [z.reshape(len(wanted), n.shape[1]) for z, n in zip(variates, rows, strict=True)]
        missing = wanted - sum(np.einsum("ns,is->ni", z, n) for z, n in zip(flat, rows, strict=True))
        covariance = self.covariance(outputs)
        scale = np.sqrt(np.diag(covariance))
        inverse = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0.0)
        weights = inverse[:, None] * np.linalg.pinv(inverse[:, None] * covariance * inverse, rcond=1e-12) * inverse
        moved = np.einsum("ni,ij->nj", missing, weights)
        changed = (z + np.einsum("ni,is->ns", moved, n) for z, n in zip(flat, rows, strict=True))
        return Variates(*(z.reshape(each.shape) for z, each in zip(changed, variates, strict=True)))

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
        return GivenNoise(added, errors)

    @property
    def together(self) -> int:
        """Samples whose variates are in memory together."""
        return max(1, LARGEST // max(1, int(sum(each[0].size for each in self.partials))))


@dataclass(frozen=True)
class ConditionalSamples:
    """Samples with conditions on what noise adds to the linear errors of some outputs at the last epoch.

    ``engine`` simulates samples with given noise, no more than ``most`` at a time.
    """

    noise: NoiseSystem
    outputs: tuple[int, ...]
    most: int
    engine: Callable[[Batch, GivenNoise], SimulationResult]

    def simulate(self, batch: Batch, added: Array) -> SimulationResult:
        """Simulate samples whose noise adds so much to these outputs, shape (n, m), SI; final errors alone."""
        values, linear = np.full((2, len(added), 9), np.nan)
        failures: dict[int, Failure] = {}
        step = min(self.most, self.noise.together)
        for begin in range(0, len(added), step):
            piece, wanted = batch[begin : begin + step], added[begin : begin + step]
            variates = self.noise.draw(batch.seed, piece.index)
            result = self.engine(piece, self.noise.given(self.noise.conditioned(variates, self.outputs, wanted)))
            values[begin : begin + step] = result.values
            linear[begin : begin + step] = result.linear_values
            failures |= {begin + row: failure for row, failure in result.failures.items()}
        return SimulationResult(values, failures, linear_values=linear)
