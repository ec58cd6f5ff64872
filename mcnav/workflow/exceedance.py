"""Flights for requirements that the samples of a campaign cannot decide by counting (`mcnav.rare`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import special

from mcnav._types import Array
from mcnav.analysis.comparison import Model
from mcnav.analysis.exceedance import Event, allowed_share, most_likely_way, samples_deciding
from mcnav.analysis.requirements import Requirement
from mcnav.contract.engine import Engine, without_noise
from mcnav.execution.soundness import isolated
from mcnav.rare.estimate import estimate_probability
from mcnav.rare.facets import linear_facets
from mcnav.sampling.designs import SamplingDesign
from mcnav.sampling.error_model import ErrorModel
from mcnav.store.manifest import ExceedanceRecord
from mcnav.systems.timeouts import check_stopped
from mcnav.workflow.prepare import PreparedSystem, exact_part

RAREST: Final = 12.0
"""Distance of the linear limit in sigmas beyond which a probability, of 1e-33, is not estimated."""

MOST_SHARE: Final = 0.01
"""Linear probability above which samples are counted."""

FLIGHTS: Final = 1_000
"""Flights for one requirement, about; and the samples that a campaign must have for them."""

STREAM: Final = 1_000_003
"""Seeds of the flights: the campaign's times this, plus the number of the requirement."""


@dataclass(frozen=True)
class _Normals:
    """Simulation and linear model as functions of the standard normals on which errors depend, for some outputs."""

    engine: Engine
    errors: ErrorModel
    model: Model
    outputs: tuple[int, ...]

    @property
    def dimensions(self) -> int:
        """Standard normals on which errors depend."""
        return len(self.errors.dispersing)

    def errors_of(self, points: Array) -> Array:
        """Return errors, shape (n, sources), of standard normals, shape (n, dimensions)."""
        variates = np.zeros((len(points), self.errors.variates))
        variates[:, self.errors.dispersing] = points
        return self.errors.errors_of(variates)

    def fly(self, points: Array) -> Array:
        """Simulate; NaN for a flight that fails."""
        check_stopped()
        if not len(points):
            return np.zeros((0, len(self.outputs)))
        flown = without_noise(self.engine)(self.errors_of(points))
        values = flown.values[:, self.outputs].copy()
        values[list(flown.failures)] = math.nan
        return values

    def linear(self, points: Array) -> Array:
        """Return the outputs by the linear model."""
        outcomes = self.model.nominal + self.errors_of(points) @ self.model.partials.T
        return np.asarray(outcomes[:, self.outputs])


def estimate_exceedances(
    system: PreparedSystem, model: Model, requirements: Sequence[Requirement], confidence: float
) -> tuple[ExceedanceRecord, ...]:
    """Estimate the probability beyond the limits of each requirement that counting cannot decide.

    Those over time, and those on sigmas, are left out.
    """
    records = []
    engine = isolated(system.scenario, exact_part(system.engine), system.timeout)
    for number, requirement in enumerate(requirements):
        if requirement.kind == "sigma_ratio" or requirement.epochs:
            continue
        event = Event.of(requirement, model.sizes)
        normals = _Normals(engine, system.draws.errors, model, event.outputs)
        if not _is_beyond_counting(normals, event, requirement, system, confidence):
            continue
        reason = _refusal(system)
        records.append(_refused(number, reason) if reason else _estimate(number, normals, event, system, confidence))
    return tuple(records)


def _refused(number: int, reason: str) -> ExceedanceRecord:
    nothing = math.nan
    return ExceedanceRecord(requirement=number, estimate=nothing, low=nothing, high=nothing, flights=0, refusal=reason)


def _refusal(system: PreparedSystem) -> str:
    """Say why no flights are chosen; nothing where they are."""
    engine, draws = system.engine, system.draws
    if engine.noisy or engine.filter is not None:
        return "flights are chosen among constant errors alone, and this campaign has noise or a filter"
    if system.unsettled is not None:
        return "there is no linear model to choose flights with"
    if draws.samples < FLIGHTS:
        return f"it takes about {FLIGHTS:,} flights, more than the campaign has samples ({draws.samples:,})"
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


def _estimate(
    number: int, normals: _Normals, event: Event, system: PreparedSystem, confidence: float
) -> ExceedanceRecord:
    """Estimate the probability beyond the limits of one requirement."""
    errors, seed = system.draws.errors, system.draws.seed * STREAM + number
    rare = estimate_probability(
        normals.fly, normals.linear, event.limit, normals.dimensions, seed, confidence=confidence, most=FLIGHTS
    )
    record = ExceedanceRecord(
        requirement=number, estimate=rare.estimate, low=rare.low, high=rare.high, flights=rare.flights,
    )  # fmt: skip
    if rare.refusal:
        return record.completed({"refusal": rare.refusal})
    spread = errors.standard_deviations
    departures = (normals.errors_of(rare.point[None])[0] - errors.mean) / np.where(spread > 0.0, spread, 1.0)
    return record.completed({"way": most_likely_way(errors.names, departures), "sides": rare.sides})
