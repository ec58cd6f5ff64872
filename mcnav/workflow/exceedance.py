"""Flights for requirements that the samples of a campaign cannot decide by counting (`mcnav.rare`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy import special

from mcnav.analysis.exceedance import Event, allowed_share, most_likely_way, samples_deciding
from mcnav.analysis.requirements import Requirement, is_rare, size_probability
from mcnav.contract.engine import (
    conditions_noise,
)
from mcnav.contract.linear import LinearSystem
from mcnav.contract.scenario import ScenarioError
from mcnav.linear.polynomial_engine import exact_part
from mcnav.rare.estimate import estimate_probability
from mcnav.rare.jumps import known_facets
from mcnav.sampler.designs import SamplingDesign
from mcnav.store.manifest import ExceedanceRecord
from mcnav.workflow.event_normals import EventLaw, EventNormals, event_of, has_noise, normals_of
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


def estimate_exceedances(
    system: PreparedSystem, requirements: Sequence[Requirement], confidence: float
) -> tuple[ExceedanceRecord, ...]:
    """Estimate the probability beyond the limits of each requirement that counting cannot decide, but those on sigmas.

    Over time it is that of any epoch.
    """
    records, model, engine = [], system.linear, system.exact
    follows = any(requirement.epochs and not requirement.of for requirement in requirements)
    throughout = system.at_epochs if follows else None
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
        event = event_of(requirement, model, throughout)
        if noisy:
            law = EventLaw.of(event, model, draws.errors, throughout)
            distances = event.distances(law.mean, law.covariance)
            share = float(np.max(np.sum(special.ndtr(-distances), axis=1)))
            near = 0.0 < float(np.min(distances)) < RAREST
            if not near or _is_counted(share, requirement, system, confidence):
                continue
        try:
            normals, event = normals_of(engine, noisy, draws.errors, draws.seed, model, requirement, number, throughout)
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
    normals: EventNormals, event: Event, requirement: Requirement, system: PreparedSystem, confidence: float
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
    number: int, normals: EventNormals, event: Event, samples: int, confidence: float, allowed: float
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
