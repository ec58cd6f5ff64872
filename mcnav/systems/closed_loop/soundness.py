"""Faults that must be noticed of a loop before its samples are compared with its linear system."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.contract.scenario import ScenarioError
from mcnav.systems.closed_loop.differences import COLUMNS
from mcnav.systems.closed_loop.maps import Event
from mcnav.systems.closed_loop.nominal_flight import innovation_shares
from mcnav.systems.closed_loop.schedule import Instant
from mcnav.systems.closed_loop.setup import Setup
from mcnav.systems.closed_loop.simulation import simulate
from mcnav.systems.closed_loop.sizes import LoopSizes
from mcnav.systems.closed_loop.structure import Structure

SAMPLES: Final = 6
"""Samples that are followed beside the nominal: one of six lies beyond 1.4 sigma, on average, in any direction."""

SMALL_SHARE: Final = 0.01
"""Share of all errors and noise with which samples must follow their twins."""

SEED: Final = 1966

SAME: Final = 1e-9
"""Share of an output's size by which a sample may depend on others: the order of a library's sums."""

LARGEST_INNOVATION: Final = 1e-3
"""Nominal innovation, as a share of its believed sigma, from which on gains that differ between samples matter."""

LARGEST_STEP_ERROR: Final = 1e-3
"""Change of X by halved steps, as a share of the quantity's size, over the whole flight."""

NEARLY: Final = 1e-6
"""Share of a quantity's size by which steps that are taken together may differ from those of the plan."""

GRAZING: Final = 0.1
"""Sigma of the final time as a share of the flight from which on a trigger grazes."""


@dataclass(frozen=True)
class Tried:
    """What a few samples beside the nominal, and halved steps of it, have shown.

    Attributes
    ----------
    values, linear : ndarray, shape (2 SAMPLES, outputs)
        Final values of samples, and of their twins: with all errors and noise, and after them with `SMALL_SHARE`.
    shares, at : ndarray, shape (size,)
        Change of X by halved steps, in sizes, and the time of the step that changes it most, s.
    """

    values: Array
    linear: Array
    shares: Array
    at: Array

    @property
    def arrays(self) -> tuple[Array, ...]:
        """The numbers."""
        return self.values, self.linear, self.shares, self.at

    def step_error(self, structure: Structure) -> list[str]:
        """Say whether steps are too long."""
        worst = int(np.argmax(self.shares))
        if not self.shares[worst] > LARGEST_STEP_ERROR:
            return []
        of = ((quantity.name, place) for block in structure.blocks for quantity, place in block.places())
        name = next(name for name, place in of if place.start <= worst < place.stop)
        return [
            f"halved steps change {name} by {self.shares[worst]:.2g} of its size, most at {self.at[worst]:.4g} s: "
            "shorten step, or let the instants of measurements, commands or corrections be those at which rates jump"
        ]


def try_samples(setup: Setup) -> Tried:
    """Try a few samples, and halved steps; `ScenarioError` when samples are not repeatable."""
    result = _check_repeatable(setup)
    assert result.linear_values is not None
    return Tried(result.values, result.linear_values, *_halve_steps(setup))


def _check_repeatable(setup: Setup) -> SimulationResult:
    """Simulate a few samples, call each method once, and simulate one of them again, alone.

    Return the samples; after them the same with `SMALL_SHARE` of all errors and noise.

    Raises
    ------
    ScenarioError
        When identical calls have other outcomes, or a sample depends on others.
    """
    errors = np.random.default_rng(SEED).standard_normal((SAMPLES, len(setup.maps.structure.sources)))
    errors = np.tile(errors * np.sqrt(np.maximum(np.diag(setup.true.start), 0.0)), (2, 1))
    shares = np.repeat([1.0, SMALL_SHARE], SAMPLES)
    batch = Batch(np.tile(np.arange(SAMPLES), 2), errors * shares[:, None], SEED)
    result = simulate(setup, batch, noise=True, over_time=False, shares=shares)
    _call_once(setup)
    first = result.values
    try:
        alone = simulate(setup, batch[1:2], noise=True, over_time=False).values
    except Exception:
        _repeat(setup, batch, shares, first)
        raise
    scale = np.nan_to_num(np.abs(first)).max(axis=0) + np.abs(setup.floor) / SAME
    gaps = np.abs(first[1] - alone[0])
    if np.isnan(first[1]).any() != np.isnan(alone[0]).any() or np.any(gaps > SAME * scale):
        _repeat(setup, batch, shares, first)
        output = setup.readout.outputs[int(np.nanargmax(gaps / np.where(scale > 0.0, scale, 1.0)))].name
        raise ScenarioError(
            "type",
            f"{output} of a sample changes with the samples beside it: is a mean or a sum taken over samples? "
            "A method must treat each by itself",
        )
    return result


def _repeat(setup: Setup, batch: Batch, shares: Array, first: Array) -> None:
    """Raise `ScenarioError` when samples have other outcomes than before, shape (n, outputs)."""
    again = simulate(setup, batch, noise=True, over_time=False, shares=shares).values
    if not np.array_equal(first, again, equal_nan=True):
        raise ScenarioError(
            "type",
            "answers identical calls differently: is something random, or kept in self from one call to the next?",
        )


def _call_once(setup: Setup) -> None:
    """Call each method once: one that counts its calls answers the next flight differently."""
    maps, x, time = setup.maps, setup.start[:, None], np.zeros(1)
    white = np.zeros((maps.structure.white.size + maps.structure.markov.size, 1))
    frame = maps.truth_frame(x, time, white)
    for method in (maps.rates, maps.sense, *(sensor.truth for sensor in maps.sensors)):
        if method is not None:
            method(frame)
    maps.after_guidance(x, time)


def remarks_on(setup: Setup, sigmas: Mapping[str, float]) -> list[str]:
    """Return what is to be said of a loop, a clause each.

    Parameters
    ----------
    sigmas : mapping of str to float
        Linear sigmas of the times of events by trigger, s, by name.
    """
    plan, remarks = setup.plan, []
    sizes = LoopSizes(setup.true, setup.believed)
    for name, share in innovation_shares(plan, setup.maps, setup.states is not None, sizes).items():
        if share > LARGEST_INNOVATION:
            remarks.append(
                f"the innovation of {name} is {share:.2g} of its sigma without any error: the model differs from "
                "what is measured, and gains that differ between samples are not linear"
            )
    kinks = set(plan.kinks)
    if setup.maps.own_outputs is not None:
        derivatives = setup.readout.own_derivatives(plan.instants[plan.end].nominal, plan.steps, plan.end_time)
        kinks |= {"outputs"} if derivatives.kinked.any() else set()
    if kinks:
        remarks.append(f"{' and '.join(sorted(kinks))} has a kink at the nominal, where there is no derivative")
    for quantity, place in setup.maps.structure.corrections.places():
        if quantity.axes and not plan.instants[plan.end].nominal[place].any():
            remarks.append(
                f"the nominal {quantity.name} is zero: its size has no derivative there, and mean plus three sigma "
                "is no bound of it"
            )
    remarks += _unmeasured(setup)
    for event in setup.maps.events:
        remarks += _near_updates(setup, event, sigmas[event.name])
        time, sigma = plan.event_times[event.name], sigmas[event.name]
        if sigma > GRAZING * time:
            remarks.append(
                f"{_trigger_of(event)} grazes: one sigma of "
                f"{'the final' if event.kind == 'end' else 'its'} time is {sigma:.3g} s of {time:.4g} s, for which "
                "linear analysis is rough"
            )
    return remarks


def _unmeasured(setup: Setup) -> list[str]:
    """Name sensors that never measure, a filter without any, and samples that outlast the planned gains."""
    maps, states = setup.maps, setup.states
    if states is None:
        return []
    instants = [instant.instant for instant in setup.plan.instants]
    done = {number for instant in instants for number in instant.measurements}
    if not done:
        return ["the filter has no measurement within the flight: it propagates its covariance, and corrects nothing"]
    remarks = [
        f"{sensor.declared.name} never measures within the flight without errors"
        for number, sensor in enumerate(maps.sensors)
        if number not in done
    ]
    if not states.own_gains and any(event.kind == "end" for event in maps.events):
        remarks.append("samples that end later than the flight without errors use the last planned gains")
    return remarks


def _trigger_of(event: Event) -> str:
    return "the trigger" if event.kind == "end" else f"the trigger of {event.name}"


def _near_updates(setup: Setup, event: Event, sigma: float) -> list[str]:
    """Find measurements, corrections and commands within one sigma of an event of the nominal."""
    time = setup.plan.event_times[event.name]
    near = max(sigma, SAME * setup.plan.end_time)
    after = next(number for number, instant in enumerate(setup.schedule) if instant.time >= time - near)
    instants = setup.schedule[max(after - 1, 0) : after + 2]
    told = "Samples end before or after it" if event.kind == "end" else "It comes before or after it"
    changes = [(instant, _change_at(setup, instant)) for instant in instants if abs(instant.time - time) <= near]
    at: dict[tuple[str, str], list[str]] = {}
    for instant, change in changes:
        if change is not None:
            at.setdefault(change, []).append(f"{instant.time:.6g}")
    return [
        f"{_trigger_of(event)} is met at {time:.6g} s, within one sigma of the {what}{'s' * (len(times) > 1)} at "
        f"{' and '.join(times)} s. {told}, and {meaning}"
        for (what, meaning), times in at.items()
    ]


def _change_at(setup: Setup, instant: Instant) -> tuple[str, str] | None:
    """Name what changes X at an instant, and what that means for a trigger near it; none where nothing does."""
    maps = setup.maps
    if instant.measurements:
        return "measurement", "an update may jump over the trigger"
    if instant.corrections:
        return "correction", "the correction is made or not"
    if instant.guide and maps.guide is not None and not maps.continuous:
        return "command", "the last command is of one cycle or of the next"
    return None


def _halve_steps(setup: Setup) -> tuple[Array, Array]:
    """Compare each step with two halves of it, at the nominal and one size to its sides; see `Tried`.

    The difference of a step goes on as the linear system has it, so that what decays does not add up.
    """
    structure, sizes = setup.maps.structure, _sizes(setup)
    sides = _sides(structure, sizes)
    error, whole_error = np.zeros_like(sides), np.zeros(structure.size)
    largest, at = np.zeros(structure.size), np.zeros(structure.size)
    halved = _halved(setup, sides)
    for planned in setup.plan.instants:
        times = planned.instant.step_times()
        for time, step in zip(times, planned.steps, strict=False):
            added = next(halved)
            error = step.state @ error + added
            at = np.where(_largest(added) > largest, time, at)
            largest = np.maximum(_largest(added), largest)
            whole_error = np.maximum(whole_error, _largest(error))
        for update in planned.updates:
            error = update.state @ error
    return whole_error / sizes, at


def _sizes(setup: Setup) -> Array:
    """Return the sizes of X: of an estimate without errors of its own that of the truth, which it comes to follow."""
    sizes, (places, counterparts) = setup.steps.copy(), setup.maps.structure.pairs
    sizes[places] = np.maximum(sizes[places], sizes[counterparts])
    return sizes


def _sides(structure: Structure, sizes: Array) -> Array:
    """Return the deviations at which steps are compared: none, and one size of what rates may depend on, both ways."""
    moving = np.arange(structure.corrections.begin)
    change = np.diag(sizes)[:, moving]
    return np.concatenate([np.zeros((structure.size, 1)), change, -change], axis=1)


@dataclass(frozen=True)
class _Step:
    """A step of the nominal: begin and length, s, and X there and after it, shape (size,); none after an event."""

    time: float
    length: float
    before: Array
    after: Array | None


def _steps(setup: Setup) -> list[_Step]:
    steps = []
    for planned in setup.plan.instants:
        times = planned.instant.step_times().tolist()
        for place, (time, done) in enumerate(zip(times, planned.steps, strict=False)):
            smooth = not done.moments and place + 1 < len(planned.before)
            after = planned.before[place + 1] if smooth else None
            steps.append(_Step(time, planned.instant.length, planned.before[place], after))
    return steps


def _halved(setup: Setup, sides: Array) -> Iterator[Array]:
    """Return what two halves of each step add to X more than the whole step, at the sides, shape (size, sides).

    Many steps of a length are taken at once; each by itself where that changes the nominal, as a method does that
    takes all its times for the same.
    """
    space, steps, begin = setup.maps.structure.space, _steps(setup), 0
    together = max(COLUMNS // sides.shape[1], 1)
    while begin < len(steps):
        length = steps[begin].length
        possible = steps[begin : begin + together]
        some = list(takewhile(lambda step: abs(step.length - length) <= SAME * length, possible))  # noqa: B023
        added, reached = _compare(setup, some, sides)
        gaps = [
            np.abs(space.minus(one[:, None], step.after[:, None])[:, 0])
            for one, step in zip(reached, some, strict=True)
            if step.after is not None
        ]
        if len(some) > 1 and np.any(np.array(gaps) > NEARLY * setup.steps):
            added = [_compare(setup, [step], sides)[0][0] for step in some]
        yield from added
        begin += len(some)


def _compare(setup: Setup, steps: Sequence[_Step], sides: Array) -> tuple[list[Array], list[Array]]:
    """Take steps of a length whole and in halves; return the differences at the sides, and X after whole ones."""
    maps, count, length = setup.maps, len(steps), steps[0].length
    space, inputs = maps.structure.space, maps.structure.white.size + maps.structure.markov.size
    before = np.repeat(np.column_stack([step.before for step in steps]), sides.shape[1], axis=1)
    x, begin = space.plus(before, np.tile(sides, count)), np.repeat([step.time for step in steps], sides.shape[1])
    white = np.zeros((2, inputs, x.shape[1]))
    whole, half = maps.step(x, begin, length, white), maps.step(x, begin, 0.5 * length, white)
    added = space.minus(maps.step(half, begin + 0.5 * length, 0.5 * length, white), whole)
    return np.split(added, count, axis=1), list(whole[:, :: sides.shape[1]].T)


def _largest(change: Array) -> Array:
    return np.asarray(np.nan_to_num(np.abs(change), nan=np.inf).max(axis=1))
