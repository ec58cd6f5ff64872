"""Flights for requirements that the samples of a campaign cannot decide by counting (`mcnav.rare`)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from scipy import special

from mcnav.analysis.exceedance import Event, allowed_share, most_likely_way, samples_deciding
from mcnav.analysis.model import Model
from mcnav.analysis.requirements import Requirement, is_rare, size_probability
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
from mcnav.contract.scenario import Scenario, ScenarioError
from mcnav.execution.stopping import check_stopped
from mcnav.linear.at_epochs import stated_at_epochs
from mcnav.linear.polynomial_engine import exact_part
from mcnav.rare.estimate import estimate_probability
from mcnav.rare.facets import BEHIND
from mcnav.rare.jumps import known_facets
from mcnav.runner.soundness import isolated
from mcnav.sampler.designs import SamplingDesign
from mcnav.sampler.error_model import ErrorModel
from mcnav.statistics.bisection import root_between
from mcnav.store.manifest import ExceedanceRecord
from mcnav.workflow.prepare import PreparedSystem

RAREST: Final = 12.0
"""Distance of the linear limit in sigmas beyond which a probability, of 1e-33, is not estimated."""

MOST_SHARE: Final = 0.01
"""Linear probability above which samples are counted."""

FLIGHTS, NOISY_FLIGHTS = 1_000, 2_000
"""Flights for one requirement, about, without noise and with it; and the samples that a campaign must have for them."""

SHARE: Final = 5
MOST_FLIGHTS: Final = 4_000
"""Flights of a campaign with noise, which scatters entries: one flight for so many samples, and at most so many."""

CHEAP: Final = 2_048
"""Samples of a chunk from which an engine simulates many together, so that tens of thousands of flights are cheap.

It is part of the engine: the time that flights take would differ from one run to the next, and so would results.
"""

MOST_NORMALS: Final = 400
"""Standard normals of errors and noise on which a requirement depends, at most."""

UNFELT: Final = 1e-6
"""Share of an output's linear sigma below which what noise adds to it is rounding."""

MOVED: Final = 0.2
"""Share of its distance by which the most likely way to fail is moved to the limit, at most."""

STREAM: Final = 1_000_003
"""Seeds of the flights: the campaign's times this, plus the number of the requirement."""


@dataclass(frozen=True)
class _Law:
    """Linear law of an event's outputs at its epochs, or at the end, m = 1.

    ``mean`` has shape (m, outputs); ``processes`` are the covariances that each process of noise adds, shape
    (m, outputs, outputs), and ``covariance`` is that of all causes.
    """

    mean: Array
    covariance: Array
    processes: Mapping[str, Array]

    @classmethod
    def of(cls, event: Event, model: Model, errors: ErrorModel, throughout: LinearSystem | None) -> _Law:
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
class _Noise:
    """Noise that adds ``factor @ w`` of normals w to what the linear model says of an event's outcomes.

    ``factor`` has shape (limited, r). ``processes`` are those of `_Law`.
    """

    samples: ConditionalNoise
    factor: Array
    processes: Mapping[str, Array]

    @classmethod
    def of(cls, engine: ConditionalEngine, event: Event, law: _Law) -> _Noise:
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
class _Normals:
    """Simulation and linear model as functions of standard normals, for what an event limits.

    The first normals are those on which constant errors depend; the others are those of `_Noise`. The linear model
    ``throughout`` the flight is that of an event over time.
    """

    engine: Engine
    errors: ErrorModel
    model: Model
    event: Event
    seed: int
    noise: _Noise | None = None
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


def estimate_exceedances(
    system: PreparedSystem, requirements: Sequence[Requirement], confidence: float
) -> tuple[ExceedanceRecord, ...]:
    """Estimate the probability beyond the limits of each requirement that counting cannot decide, but those on sigmas.

    Over time it is that of any epoch.
    """
    records, model, throughout = [], system.linear, system.differenced
    engine = isolated(system.scenario, exact_part(system.engine), system.timeout)
    if throughout is None and any(requirement.epochs and not requirement.of for requirement in requirements):
        throughout = stated_at_epochs(system.scenario, exact_part(system.engine))
    noisy = has_noise(system.scenario, system.engine)
    for number, requirement in enumerate(requirements):
        if requirement.kind == "sigma_ratio":
            continue
        over_time, rare = bool(requirement.epochs), is_rare(size_probability(requirement))
        if requirement.of and over_time:
            records += [_refused(number, "errors behind a smoother are counted alone")] if rare else []
            continue
        reason = _refusal(system, over_time, throughout)
        if reason and (over_time or noisy):
            records += [_refused(number, reason)] if rare else []
            continue
        draws = system.draws
        event = _event(requirement, model, throughout)
        if noisy:
            law = _Law.of(event, model, draws.errors, throughout)
            distances = event.distances(law.mean, law.covariance)
            share = float(np.max(np.sum(special.ndtr(-distances), axis=1)))
            near = 0.0 < float(np.min(distances)) < RAREST
            if not near or _is_counted(share, requirement, system, confidence):
                continue
        try:
            normals, event = _normals(engine, noisy, draws.errors, draws.seed, model, requirement, number, throughout)
        except ScenarioError as wrong:
            records += [_refused(number, str(wrong))] if rare else []
            continue
        if normals.dimensions > MOST_NORMALS:
            reason = f"errors and noise have {normals.dimensions} normals there; at most {MOST_NORMALS} can be chosen"
            records += [_refused(number, reason)] if rare else []
            continue
        if not (noisy and over_time) and not _is_beyond_counting(normals, event, requirement, system, confidence):
            continue
        if reason:
            records.append(_refused(number, reason))
            continue
        allowed = allowed_share(requirement)
        records.append(_estimate(number, normals, event, draws.samples, confidence, allowed))
    return tuple(records)


def _histories(engine: Engine, errors: Array) -> Array:
    """Simulate errors without noise: outputs at every epoch, shape (n, m, outputs); NaN for a sample that fails."""
    if has_histories(engine):
        return engine.histories(errors)
    result = engine.simulate(Batch(np.arange(len(errors)), errors, 0))
    assert result.history is not None
    histories = result.history.copy()
    histories[list(result.failures)] = math.nan
    return histories


def has_noise(scenario: Scenario, engine: Engine) -> bool:
    """Return whether the samples of an engine have noise at present."""
    return engine.noisy and scenario.noisy


def _refused(number: int, reason: str) -> ExceedanceRecord:
    nothing = math.nan
    return ExceedanceRecord(requirement=number, estimate=nothing, low=nothing, high=nothing, flights=0, refusal=reason)


def _refusal(system: PreparedSystem, over_time: bool, throughout: LinearSystem | None) -> str:
    """Say why no flights are chosen; nothing where they are."""
    engine, draws, noisy = system.engine, system.draws, has_noise(system.scenario, system.engine)
    if over_time and throughout is None:
        return "over time flights are chosen where the linear model is known at all epochs"
    if noisy and not conditions_noise(exact_part(engine)):
        return "flights are chosen with the noise of other engines than reference: ensemble, shared-gains, single"
    if system.unsettled is not None:
        return "there is no linear model to choose flights with"
    flights = NOISY_FLIGHTS if noisy else FLIGHTS
    if draws.samples < flights:
        return f"it takes about {flights:,} flights, more than the campaign has samples ({draws.samples:,})"
    return ""


def _is_beyond_counting(
    normals: _Normals, event: Event, requirement: Requirement, system: PreparedSystem, confidence: float
) -> bool:
    """Return whether counting samples cannot decide a requirement, if the linear model is right."""
    if not normals.dimensions:
        return False
    facets = known_facets(normals.linear, event.limit, normals.dimensions)
    distances = facets.distances[: facets.foreseen]
    if not len(distances) or not 0.0 < float(np.min(distances)) < RAREST:
        return False
    return not _is_counted(float(np.sum(special.ndtr(-distances))), requirement, system, confidence)


def _is_counted(expected: float, requirement: Requirement, system: PreparedSystem, confidence: float) -> bool:
    """Return whether counting samples decides a requirement, if so many are expected beyond its limit."""
    if expected > MOST_SHARE:
        return True
    draws = system.draws
    length = SamplingDesign.of(draws.design, draws.samples).block_length
    independent = draws.samples // length if length <= 2 else 0
    needed = samples_deciding(expected, allowed_share(requirement), confidence)
    return needed is not None and needed <= independent


def _estimate(
    number: int, normals: _Normals, event: Event, samples: int, confidence: float, allowed: float
) -> ExceedanceRecord:
    """Estimate the probability beyond the limits of one requirement, with flights in proportion to the samples."""
    most = FLIGHTS if normals.noise is None else int(np.clip(samples // SHARE, NOISY_FLIGHTS, MOST_FLIGHTS))
    rare = estimate_probability(
        normals.fly, normals.linear, event.limit, normals.dimensions, normals.seed, confidence=confidence,
        most=most, noisy=normals.noise is not None, cheap=normals.engine.chunk >= CHEAP, allowed=allowed,
    )  # fmt: skip
    record = ExceedanceRecord(
        requirement=number, estimate=rare.estimate, low=rare.low, high=rare.high, flights=rare.flights,
    )  # fmt: skip
    if rare.refusal:
        return record.completed({"refusal": rare.refusal})
    way = most_likely_way(*normals.departures(rare.point))
    known = {"way": way, "sides": rare.sides, "point": rare.point, "power": rare.power, "by_levels": rare.by_levels}
    return record.completed(known)


@dataclass(frozen=True)
class FailingFlight:
    """Flight of the most likely way to fail, just beyond the limit.

    Attributes
    ----------
    errors : ndarray, shape (sources,)
    added : ndarray, shape (m,)
        What noise adds to the linear outcomes of the requirement's ``outputs``, over time at the epoch that is farthest
        beyond the limit; empty without noise.
    epoch : int or None
        Number of that epoch; none of a requirement at the end.
    result : SimulationResult
    reached : float
        Multiple of the limit.
    """

    errors: Array
    outputs: tuple[int, ...]
    added: Array
    epoch: int | None
    result: SimulationResult
    reached: float


def fly_way_to_fail(
    engine: Engine, noisy: bool, errors: ErrorModel, seed: int, model: Model, requirement: Requirement,
    record: ExceedanceRecord, throughout: LinearSystem | None,
) -> FailingFlight:  # fmt: skip
    """Fly the most likely way to fail of a requirement, moved along its direction to just beyond the limit.

    It is moved by at most a fifth of its distance: where the limit is not crossed there, it is flown as it is. Noise
    that the condition leaves random is that of flight 0.
    """
    normals, event = _normals(engine, noisy, errors, seed, model, requirement, record.requirement, throughout)
    point = np.array(record.point)

    def margin(multiple: float) -> float:
        value = float(event.limit.margin(normals.fly(multiple * point[None], np.zeros(1, dtype=np.int64)))[0])
        return value if math.isfinite(value) else 1.0

    (low, below), (high, beyond) = ((multiple, margin(multiple)) for multiple in (1.0 - MOVED, 1.0 + MOVED))
    crossed = below <= 0.0 < beyond
    multiple = root_between(margin, (low, below), (high, beyond), 1e-6)[1] if crossed else 1.0
    found = multiple * point[None]
    chosen = normals.errors_of(found)[0]
    number = np.zeros(1, dtype=np.int64)
    flown = normals.fly(found, number)
    place = event.worst_epoch(flown) if event.epochs else 0
    added = np.zeros(0)
    if normals.noise is not None:
        added = normals.noise.added(found[:, normals.constants :]).reshape(-1, len(event.outputs))[place]
    epoch = event.epochs[place] if event.epochs else None
    reached = float(event.limit.reached(flown)[0])
    return FailingFlight(chosen, event.outputs, added, epoch, normals.simulate(found, number), reached)


def _event(requirement: Requirement, model: Model, throughout: LinearSystem | None) -> Event:
    """Return what is beyond a requirement, by the model at the end or throughout the flight."""
    over_time = throughout if requirement.epochs else None
    return Event.of(requirement, model.sizes, model.origin if over_time is None else over_time.origin)


def _normals(
    engine: Engine, noisy: bool, errors: ErrorModel, seed: int, model: Model, requirement: Requirement, number: int,
    throughout: LinearSystem | None,
) -> tuple[_Normals, Event]:  # fmt: skip
    """Return flights as functions of standard normals for a requirement by number, and what failing is."""
    event, noise = _event(requirement, model, throughout), None
    if noisy and conditions_noise(engine):
        noise = _Noise.of(engine, event, _Law.of(event, model, errors, throughout))
    over_time = throughout if event.epochs else None
    return _Normals(engine, errors, model, event, seed * STREAM + number, noise, over_time), event
