"""Simulation of samples from their start to their end, instant by instant."""

from __future__ import annotations

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.failure import Failure, Reason
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.systems.closed_loop.flight import Flight
from mcnav.systems.closed_loop.noise import CORRECTIONS, PROCESSES, Noise, NoNoise
from mcnav.systems.closed_loop.records import Recorder
from mcnav.systems.closed_loop.setup import Setup
from mcnav.systems.closed_loop.waiting import begin, wait


def simulate(
    setup: Setup, batch: Batch, noise: bool, over_time: bool = True, shares: Array | None = None,
    draws: Noise | None = None,
) -> SimulationResult:  # fmt: skip
    """Simulate samples; without ``over_time`` their final outputs alone.

    Parameters
    ----------
    shares : ndarray, shape (n,), optional
        Multiple of each sample's noise.
    draws : Noise, optional
        Of these samples, in place of that of the batch's numbers.
    """
    if draws is None and noise:
        draws = Noise(batch.seed, batch.index, shares)
    flight = _begin(setup, batch, draws or NoNoise(len(batch.errors)), over_time)
    plan, last = setup.plan, len(setup.schedule) - 1
    with np.errstate(all="ignore"):
        if plan.begin is not None:
            wait(flight)
        for number, instant in enumerate(setup.schedule):
            flight.number = number
            for place, time in enumerate(instant.step_times().tolist()):
                flight.step(instant, place, time)
            if plan.begin is not None and number == plan.begin.number:
                begin(flight, setup, batch.errors)
            if number <= plan.end:
                flight.reach(plan.instants[number].covariance)
            flight.update(instant)
            if number < last:
                flight.expire(instant.time)
            if over_time and number in setup.epochs and number != plan.end:
                flight.read(setup.epochs[number], instant.time)
            if number >= plan.end and not len(flight.rows):
                break
        flight.expire(setup.schedule[last].time, over=True)
        flight.number = plan.end
        end = setup.epochs[plan.end]
        flight.read(end, plan.end_time)
        matrix = setup.readout.partials(plan.instants[plan.end].nominal, plan.steps, plan.end_time)
        nominal = plan.instants[plan.end].nominal
        deviation = matrix @ flight.deviation
        deviation[np.abs(deviation) <= setup.floor[:, None]] = 0.0
        linear = (setup.readout.read_nominal(nominal, plan.end_time)[:, None] + deviation).T
    values = flight.history[:, end].copy()
    values[list(flight.failures)] = np.nan
    for row in np.flatnonzero(~np.isfinite(values).all(axis=1)).tolist():
        flight.failures.setdefault(row, Failure.of(Reason.NOT_FINITE))
    return SimulationResult(
        values,
        dict(sorted(flight.failures.items())),
        linear_values=None if draws is None else linear,
        history=flight.history if over_time else None,
        filter_values=None if flight.recorder is None else flight.recorder.records,
    )


def _begin(setup: Setup, batch: Batch, draws: Noise | NoNoise, over_time: bool) -> Flight:
    """Start samples with their errors, and with their processes' values where there is noise."""
    maps, structure, count = setup.maps, setup.maps.structure, len(batch.errors)
    deviation = np.zeros((structure.size, count))
    for column, source in enumerate(structure.sources):
        deviation[list(source.moves)] += batch.errors[:, column]
    if structure.markov.size:
        deviation[structure.markov.whole] = draws.draw(PROCESSES, structure.markov.size) * setup.true.markov[:, None]
    x = structure.started(setup.start, batch.errors, deviation)
    covariance, own = np.zeros((0, 0, 1)), False
    if setup.states is not None:
        own = setup.states.own_gains
        covariance = setup.states.start_covariance(structure, setup.believed)[:, :, None]
        covariance = np.repeat(covariance, count if own else 1, axis=2)
    recorder = None
    if setup.schema is not None and setup.judged is not None and over_time:
        recorder = Recorder.of(setup.schema, maps, setup.judged, count, len(setup.epochs))
    events = [event.number for event in maps.events if event.kind == "correction"]
    impulses = {}
    for number in events:
        sizes = setup.true.corrections[number]
        impulses[number] = draws.draw(CORRECTIONS + number, len(sizes)) * sizes[:, None]
    history = np.full((count, len(setup.epochs), len(setup.readout.outputs)), np.nan)
    return Flight(
        setup, draws, np.arange(count), x, covariance, deviation, np.full_like(x, np.nan),
        np.full_like(covariance, np.nan), setup.plan.signs,
        np.ones((len(maps.events), count), dtype=bool), impulses, recorder, history, own,
    )  # fmt: skip
