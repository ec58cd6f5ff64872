"""Flights for requirements that the samples of a campaign cannot decide by counting (`mcnav.rare`)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from scipy import special

from mcnav._types import Array, IndexArray
from mcnav.analysis.comparison import Model
from mcnav.analysis.exceedance import Event, allowed_share, most_likely_way, samples_deciding
from mcnav.analysis.requirements import Requirement, is_rare, size_probability
from mcnav.contract.engine import (
    ConditionalEngine,
    ConditionalNoise,
    Engine,
    conditions_noise,
    has_histories,
    without_noise,
)
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.contract.scenario import Scenario, is_linear_over_time
from mcnav.execution.soundness import isolated
from mcnav.rare.estimate import estimate_probability
from mcnav.rare.facets import linear_facets
from mcnav.sampling.copula import semidefinite_factor
from mcnav.sampling.designs import SamplingDesign
from mcnav.sampling.error_model import ErrorModel
from mcnav.statistics.bisection import root_between
from mcnav.store.manifest import ExceedanceRecord
from mcnav.systems.timeouts import check_stopped
from mcnav.workflow.prepare import LinearHistory, PreparedSystem, exact_part, linear_history, same_times

RAREST: Final = 12.0
"""Distance of the linear limit in sigmas beyond which a probability, of 1e-33, is not estimated."""

MOST_SHARE: Final = 0.01
"""Linear probability above which samples are counted."""

FLIGHTS, NOISY_FLIGHTS = 1_000, 2_000
"""Flights for one requirement, about, without noise and with it; and the samples that a campaign must have for them."""

SHARE: Final = 5
MOST_FLIGHTS: Final = 4_000
"""Flights of a campaign with noise, which scatters entries: one flight for so many samples, and at most so many."""

UNFELT: Final = 1e-6
"""Share of an output's linear sigma below which what noise adds to it is rounding."""

MOVED: Final = 0.2
"""Share of its distance by which the most likely way to fail is moved to the limit, at most."""

STREAM: Final = 1_000_003
"""Seeds of the flights: the campaign's times this, plus the number of the requirement."""


@dataclass(frozen=True)
class _Noise:
    """Noise that adds ``factor @ w`` of normals w to the linear outcomes of the requirement's outputs.

    ``processes`` are the covariances that each process adds to them, shape (m, m). ``felt`` are the outputs, by their
    place among these, to which noise adds more than rounding; the noise of ``samples`` is given for them.
    """

    samples: ConditionalNoise
    processes: Mapping[str, Array]
    factor: Array
    felt: IndexArray

    @classmethod
    def of(cls, engine: ConditionalEngine, model: Model, outputs: tuple[int, ...]) -> _Noise:
        """Factor the covariance; a part without variance has no normals."""
        processes = {name: covariance[np.ix_(outputs, outputs)] for name, covariance in model.processes.items()}
        covariance = sum(processes.values(), np.zeros((len(outputs), len(outputs))))
        whole = np.sqrt(np.diag(model.outcome_covariance)[list(outputs)])
        sigma = np.sqrt(np.diag(covariance))
        sigma = np.where(sigma > UNFELT * whole, sigma, 0.0)
        felt = np.flatnonzero(sigma)
        inverse = np.divide(1.0, sigma, out=np.zeros_like(sigma), where=sigma > 0.0)
        factor = sigma[:, None] * semidefinite_factor(inverse[:, None] * covariance * inverse)
        samples = engine.conditional_noise(tuple(outputs[place] for place in felt))
        return cls(samples, processes, factor[:, factor.any(axis=0)], felt)

    def added(self, normals: Array) -> Array:
        """Return what noise adds to the linear outcomes, shape (n, m)."""
        return np.asarray(np.einsum("nr,mr->nm", normals, self.factor))


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
    throughout: LinearHistory | None = None

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
        if self.event.epochs:
            return self.event.picked(_histories(self.engine, self.errors_of(points)))
        flown = self.simulate(points, numbers)
        values = self.event.picked(flown.values).copy()
        values[list(flown.failures)] = math.nan
        return values

    def simulate(self, points: Array, numbers: IndexArray) -> SimulationResult:
        """Simulate, with noise by number; all outputs."""
        errors = self.errors_of(points)
        if self.noise is None:
            return without_noise(self.engine)(errors)
        batch = Batch(numbers, errors, self._noise_seed)
        added = self.noise.added(points[:, self.constants :])
        return self.noise.samples.simulate(batch, added[:, self.noise.felt])

    @cached_property
    def _noise_seed(self) -> int:
        return int(np.random.SeedSequence(self.seed, spawn_key=(1,)).generate_state(1, np.uint64)[0])

    def linear(self, points: Array) -> Array:
        """Return the outputs by the linear model."""
        errors, throughout = self.errors_of(points), self.throughout
        if throughout is not None:
            return self.event.picked(throughout.nominal + np.einsum("mos,ns->nmo", throughout.partials, errors))
        outcomes = self.event.picked(self.model.nominal + errors @ self.model.partials.T)
        return np.asarray(outcomes if self.noise is None else outcomes + self.noise.added(points[:, self.constants :]))

    def departures(self, point: Array) -> tuple[list[str], Array]:
        """Return the departures of sources and processes in a point, in sigmas.

        That of a process is the size of its normals in the most likely noise that adds y,
        ``|z_p|^2 = y^T S^+ S_p S^+ y`` with its covariance S_p of a total S.
        """
        spread = self.errors.standard_deviations
        departures = (self.errors_of(point[None])[0] - self.errors.mean) / np.where(spread > 0.0, spread, 1.0)
        names = list(self.errors.names)
        if self.noise is None:
            return names, departures
        # with S = L L^T and y = L w, S^+ y solves L^T x = w
        pulled = np.linalg.lstsq(self.noise.factor.T, point[self.constants :], rcond=None)[0]
        sizes = [math.sqrt(max(0.0, float(pulled @ part @ pulled))) for part in self.noise.processes.values()]
        return names + list(self.noise.processes), np.append(departures, sizes)


def estimate_exceedances(
    system: PreparedSystem, model: Model, requirements: Sequence[Requirement], confidence: float
) -> tuple[ExceedanceRecord, ...]:
    """Estimate the probability beyond the limits of each requirement that counting cannot decide, but those on sigmas.

    Over time it is that of any epoch.
    """
    records = []
    engine = isolated(system.scenario, exact_part(system.engine), system.timeout)
    over_time = any(requirement.epochs for requirement in requirements)
    throughout = linear_at_epochs(system.scenario, exact_part(system.engine)) if over_time else None
    for number, requirement in enumerate(requirements):
        if requirement.kind == "sigma_ratio":
            continue
        if requirement.epochs and (reason := _refusal_over_time(engine, throughout)):
            if is_rare(size_probability(requirement)):
                records.append(_refused(number, reason))
            continue
        draws = system.draws
        normals, event = _normals(engine, draws.errors, draws.seed, model, requirement, number, throughout)
        if not _is_beyond_counting(normals, event, requirement, system, confidence):
            continue
        reason = _refusal(system, bool(requirement.epochs))
        refused = _refused(number, reason)
        records.append(refused if reason else _estimate(number, normals, event, system.draws.samples, confidence))
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


def linear_at_epochs(scenario: Scenario, engine: Engine) -> LinearHistory | None:
    """Return the linear model at the epochs of an engine; none where it is not known there, or has noise."""
    known = linear_history(scenario, engine)
    if known is not None or engine.epochs is None or not is_linear_over_time(scenario):
        return known
    system = scenario.linear_over_time(len(engine.epochs.times))
    if not same_times(system.times, engine.epochs.times) or any(each.any() for each in system.processes.values()):
        return None
    nominal = np.zeros(system.partials.shape[:2]) if system.nominal is None else system.nominal
    return LinearHistory(engine.epochs, system.partials, nominal)


def _refusal_over_time(engine: Engine, throughout: LinearHistory | None) -> str:
    """Say why no flights are chosen for requirements over time; nothing where they are."""
    known = throughout is not None and engine.filter is None
    return "" if known else "over time flights are chosen without noise and filters alone"


def _refused(number: int, reason: str) -> ExceedanceRecord:
    nothing = math.nan
    return ExceedanceRecord(requirement=number, estimate=nothing, low=nothing, high=nothing, flights=0, refusal=reason)


def _refusal(system: PreparedSystem, over_time: bool) -> str:
    """Say why no flights are chosen; nothing where they are. ``over_time`` there is no noise."""
    engine, draws = system.engine, system.draws
    if not over_time and (engine.noisy or engine.filter is not None) and not conditions_noise(exact_part(engine)):
        return (
            "flights are chosen with the noise of type ins, of engines ensemble and shared-gains, and of closed loops"
        )
    if system.unsettled is not None:
        return "there is no linear model to choose flights with"
    flights = NOISY_FLIGHTS if engine.noisy and not over_time else FLIGHTS
    if draws.samples < flights:
        return f"it takes about {flights:,} flights, more than the campaign has samples ({draws.samples:,})"
    return ""


def _is_beyond_counting(
    normals: _Normals, event: Event, requirement: Requirement, system: PreparedSystem, confidence: float
) -> bool:
    """Return whether counting samples cannot decide a requirement, if the linear model is right."""
    if not normals.dimensions or normals.dimensions > 200:
        return False
    facets = linear_facets(normals.linear, event.limit, normals.dimensions)
    distances = facets.distances[: facets.foreseen]
    if not len(distances) or not 0.0 < float(np.min(distances)) < RAREST:
        return False
    expected, draws = float(np.sum(special.ndtr(-distances))), system.draws
    if expected > MOST_SHARE:
        return False
    length = SamplingDesign.of(draws.design, draws.samples).block_length
    independent = draws.samples // length if length <= 2 else 0
    needed = samples_deciding(expected, allowed_share(requirement), confidence)
    return needed is None or needed > independent


def _estimate(number: int, normals: _Normals, event: Event, samples: int, confidence: float) -> ExceedanceRecord:
    """Estimate the probability beyond the limits of one requirement, with flights in proportion to the samples."""
    most = FLIGHTS if normals.noise is None else int(np.clip(samples // SHARE, NOISY_FLIGHTS, MOST_FLIGHTS))
    rare = estimate_probability(
        normals.fly, normals.linear, event.limit, normals.dimensions, normals.seed, confidence=confidence,
        most=most, noisy=normals.noise is not None,
    )  # fmt: skip
    record = ExceedanceRecord(
        requirement=number, estimate=rare.estimate, low=rare.low, high=rare.high, flights=rare.flights,
    )  # fmt: skip
    if rare.refusal:
        return record.completed({"refusal": rare.refusal})
    way = most_likely_way(*normals.departures(rare.point))
    return record.completed({"way": way, "sides": rare.sides, "point": rare.point})


@dataclass(frozen=True)
class FailingFlight:
    """Flight of the most likely way to fail, just beyond the limit.

    Attributes
    ----------
    errors : ndarray, shape (sources,)
    added : ndarray, shape (m,)
        What noise adds to the linear outcomes of the requirement's ``outputs``; empty without noise.
    result : SimulationResult
    reached : float
        Multiple of the limit.
    """

    errors: Array
    outputs: tuple[int, ...]
    added: Array
    result: SimulationResult
    reached: float


def fly_way_to_fail(
    engine: Engine, errors: ErrorModel, seed: int, model: Model, requirement: Requirement, record: ExceedanceRecord,
    throughout: LinearHistory | None,
) -> FailingFlight:  # fmt: skip
    """Fly the most likely way to fail of a requirement, moved along its direction to just beyond the limit.

    It is moved by at most a fifth of its distance: where the limit is not crossed there, it is flown as it is. Noise
    that the condition leaves random is that of flight 0.
    """
    normals, event = _normals(engine, errors, seed, model, requirement, record.requirement, throughout)
    point = np.array(record.point)

    def margin(multiple: float) -> float:
        value = float(event.limit.margin(normals.fly(multiple * point[None], np.zeros(1, dtype=np.int64)))[0])
        return value if math.isfinite(value) else 1.0

    (low, below), (high, beyond) = ((each, margin(each)) for each in (1.0 - MOVED, 1.0 + MOVED))
    crossed = below <= 0.0 < beyond
    multiple = root_between(margin, (low, below), (high, beyond), 1e-6)[1] if crossed else 1.0
    found = multiple * point[None]
    chosen = normals.errors_of(found)[0]
    added = np.zeros(0) if normals.noise is None else normals.noise.added(found[:, normals.constants :])[0]
    number = np.zeros(1, dtype=np.int64)
    reached = float(event.limit.reached(normals.fly(found, number))[0])
    return FailingFlight(chosen, event.outputs, added, normals.simulate(found, number), reached)


def _normals(
    engine: Engine, errors: ErrorModel, seed: int, model: Model, requirement: Requirement, number: int,
    throughout: LinearHistory | None,
) -> tuple[_Normals, Event]:  # fmt: skip
    """Return flights as functions of standard normals for a requirement by number, and what failing is."""
    event = Event.of(requirement, model.sizes)
    noise = None
    if conditions_noise(engine) and not event.epochs:
        noise = _Noise.of(engine, model, event.outputs)
    over_time = throughout if event.epochs else None
    return _Normals(engine, errors, model, event, seed * STREAM + number, noise, over_time), event
