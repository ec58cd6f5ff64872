"""Flights, and the linear model, as functions of standard normals, for what a requirement limits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from mcnav.analysis.exceedance import Event
from mcnav.analysis.model import Model
from mcnav.analysis.requirements import Requirement
from mcnav.arrays.products import transform
from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.engine import (
    ConditionalEngine,
    ConditionalNoise,
    Engine,
    conditions_noise,
    has_histories,
    without_noise,
)
from mcnav.contract.linear import LinearSystem
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.contract.scenario import Scenario
from mcnav.execution.stopping import check_stopped
from mcnav.rare.facets import BEHIND
from mcnav.sampler.error_model import ErrorModel

UNFELT: Final = 1e-6
"""Share of an output's linear sigma below which what noise adds to it is rounding."""

STREAM: Final = 1_000_003
"""Seeds of the flights: the campaign's times this, plus the number of the requirement."""


@dataclass(frozen=True)
class EventLaw:
    """Linear law of an event's outputs at its epochs, or at the end, m = 1.

    ``mean`` has shape (m, outputs); ``processes`` are the covariances that each process of noise adds, shape
    (m, outputs, outputs), and ``covariance`` is that of all causes.
    """

    mean: Array
    covariance: Array
    processes: Mapping[str, Array]

    @classmethod
    def of(cls, event: Event, model: Model, errors: ErrorModel, throughout: LinearSystem | None) -> EventLaw:
        """Return it by the model at the end or, of an event over time, throughout the flight."""
        chosen = list(event.outputs)
        if event.epochs and throughout is not None:
            epochs = np.array(event.epochs)
            partials, nominal = throughout.partials[epochs][:, chosen], throughout.nominal_errors[epochs][:, chosen]
            processes = {
                name: process[epochs][:, chosen][:, :, chosen] for name, process in throughout.processes.items()
            }
        else:
            partials, nominal = model.partials[None, chosen], model.nominal[None, chosen]
            processes = {name: process[None][:, chosen][:, :, chosen] for name, process in model.processes.items()}
        covariance = transform(partials, errors.covariance)
        mean = nominal + partials @ errors.mean
        return cls(
            mean if event.origin is None else mean + event.origin, sum(processes.values(), covariance), processes
        )

    @property
    def of_noise(self) -> Array:
        """Covariance of all noise."""
        return np.asarray(sum(self.processes.values(), np.zeros_like(self.covariance)))


@dataclass(frozen=True)
class EventNoise:
    """Noise that adds ``factor @ w`` of normals w to what the linear model says of an event's outcomes.

    ``factor`` has shape (limited, r). ``processes`` are those of `EventLaw`.
    """

    samples: ConditionalNoise
    factor: Array
    processes: Mapping[str, Array]

    @classmethod
    def of(cls, engine: ConditionalEngine, event: Event, law: EventLaw) -> EventNoise:
        """Ask for conditions on what is felt of the noise, and near enough to its limits to matter."""
        whole, noise = (
            np.sqrt(np.diagonal(covariances, axis1=1, axis2=2)) for covariances in (law.covariance, law.of_noise)
        )
        nearest = np.min(event.distances(law.mean, law.covariance), axis=1)
        felt = (noise > UNFELT * whole) & (nearest < np.min(nearest) + BEHIND)[:, None]
        places = np.flatnonzero(felt)
        epochs, outputs = np.divmod(places, len(event.outputs))
        at = tuple(event.epochs[epoch] for epoch in epochs) if event.epochs else None
        samples = engine.conditional_noise(tuple(event.outputs[output] for output in outputs), at)
        factor = np.zeros((felt.size, samples.factor.shape[1]))
        factor[places] = samples.factor
        return cls(samples, factor, law.processes)

    def added(self, normals: Array) -> Array:
        """Return what noise adds to the linear outcomes, shape (n, limited)."""
        return np.asarray(np.einsum("nr,mr->nm", normals, self.factor))

    def sizes(self, added: Array, place: int) -> list[float]:
        """Return the size of each process's normals in the most likely noise that adds so much, shape (outputs,).

        ``place`` is that of the epoch among the event's.

        With its covariance S_p of a total S, ``|z_p|^2 = y^T S^+ S_p S^+ y``.
        """
        parts = [process[place] for process in self.processes.values()]
        covariance = sum(parts, np.zeros((len(added), len(added))))
        sigma = np.sqrt(np.diag(covariance))
        inverse = np.divide(1.0, sigma, out=np.zeros_like(sigma), where=sigma > 0.0)
        pulled = inverse * (np.linalg.pinv(inverse[:, None] * covariance * inverse, rcond=1e-10) @ (inverse * added))
        return [math.sqrt(max(0.0, float(pulled @ covariance @ pulled))) for covariance in parts]


@dataclass(frozen=True)
class EventNormals:
    """Simulation and linear model as functions of standard normals, for what an event limits.

    The first normals are those on which constant errors depend; the others are those of `EventNoise`. The linear model
    ``throughout`` the flight is that of an event over time.
    """

    engine: Engine
    errors: ErrorModel
    model: Model
    event: Event
    seed: int
    noise: EventNoise | None = None
    throughout: LinearSystem | None = None

    @property
    def constants(self) -> int:
        """Standard normals on which constant errors depend."""
        return len(self.errors.dispersing)

    @property
    def dimensions(self) -> int:
        """All standard normals."""
        return self.constants + (0 if self.noise is None else self.noise.factor.shape[1])

    def errors_of(self, points: Array) -> Array:
        """Return constant errors, shape (n, sources), of standard normals, shape (n, dimensions)."""
        variates = np.zeros((len(points), self.errors.variates))
        variates[:, self.errors.dispersing] = points[:, : self.constants]
        return self.errors.errors_of(variates)

    def fly(self, points: Array, numbers: IndexArray) -> Array:
        """Simulate, with noise by number; NaN for a flight that fails."""
        check_stopped()
        if not len(points):
            return np.zeros((0, len(self.linear(np.zeros((1, self.dimensions)))[0])))
        if self.event.epochs and self.noise is None:
            return self.event.picked(_histories(self.engine, self.errors_of(points)))
        flown = self.simulate(points, numbers)
        outcomes = flown.history if self.event.epochs else flown.values
        assert outcomes is not None
        values = self.event.picked(outcomes).copy()
        values[list(flown.failures)] = math.nan
        return values

    def simulate(self, points: Array, numbers: IndexArray) -> SimulationResult:
        """Simulate, with noise by number; all outputs."""
        errors = self.errors_of(points)
        if self.noise is None:
            return without_noise(self.engine)(errors)
        batch = Batch(numbers, errors, self._noise_seed)
        return self.noise.samples.simulate(batch, points[:, self.constants :])

    @cached_property
    def _noise_seed(self) -> int:
        return int(np.random.SeedSequence(self.seed, spawn_key=(1,)).generate_state(1, np.uint64)[0])

    def linear(self, points: Array) -> Array:
        """Return the outputs by the linear model."""
        errors, throughout = self.errors_of(points), self.throughout
        if throughout is not None:
            outcomes = self.event.picked(
                throughout.nominal_errors + np.einsum("mos,ns->nmo", throughout.partials, errors)
            )
        else:
            outcomes = self.event.picked(self.model.nominal + errors @ self.model.partials.T)
        return np.asarray(outcomes if self.noise is None else outcomes + self.noise.added(points[:, self.constants :]))

    def departures(self, point: Array) -> tuple[list[str], Array]:
        """Return the departures of sources and processes in a point, in sigmas; of processes those where it fails."""
        spread = self.errors.standard_deviations
        departures = (self.errors_of(point[None])[0] - self.errors.mean) / np.where(spread > 0.0, spread, 1.0)
        names = list(self.errors.names)
        if self.noise is None:
            return names, departures
        added = self.noise.added(point[None, self.constants :]).reshape(-1, len(self.event.outputs))
        place = self.event.worst_epoch(self.linear(point[None])) if self.event.epochs else 0
        return names + list(self.noise.processes), np.append(departures, self.noise.sizes(added[place], place))


def _histories(engine: Engine, errors: Array) -> Array:
    """Simulate errors without noise: outputs at every epoch, shape (n, m, outputs); NaN for a sample that fails."""
    if has_histories(engine):
        return engine.histories(errors)
    result = engine.simulate(Batch(np.arange(len(errors)), errors, 0))
    assert result.history is not None
    histories = result.history.copy()
    histories[list(result.failures)] = math.nan
    return histories


def event_of(requirement: Requirement, model: Model, throughout: LinearSystem | None) -> Event:
    """Return what is beyond a requirement, by the model at the end or throughout the flight."""
    over_time = throughout if requirement.epochs else None
    return Event.of(requirement, model.sizes, model.origin if over_time is None else over_time.origin)


def normals_of(
    engine: Engine, noisy: bool, errors: ErrorModel, seed: int, model: Model, requirement: Requirement, number: int,
    throughout: LinearSystem | None,
) -> tuple[EventNormals, Event]:  # fmt: skip
    """Return flights as functions of standard normals for a requirement by number, and what failing is."""
    event, noise = event_of(requirement, model, throughout), None
    if noisy and conditions_noise(engine):
        noise = EventNoise.of(engine, event, EventLaw.of(event, model, errors, throughout))
    over_time = throughout if event.epochs else None
    return EventNormals(engine, errors, model, event, seed * STREAM + number, noise, over_time), event


def has_noise(scenario: Scenario, engine: Engine) -> bool:
    """Return whether the samples of an engine have noise at present."""
    return engine.noisy and scenario.noisy
