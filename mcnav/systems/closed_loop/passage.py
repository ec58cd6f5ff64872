"""Events within a step: corrections and ends by trigger, at each sample's own instant on its own noise path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.contract.scenario import ScenarioError
from mcnav.systems.closed_loop.event import find_crossings
from mcnav.systems.closed_loop.maps import Maps


@dataclass(frozen=True)
class Step:
    """A step of the whole loop: its begin, s, and its length."""

    begin: float
    length: float

    def times(self, fraction: Array | float, count: int) -> Array:
        """Return the times at a fraction of it, shape (count,)."""
        return np.full(count, self.begin) + fraction * self.length


def pass_through(
    maps: Maps, step: Step, x: Array, white: Array, events: Sequence[int], fractions: Array, noises: Sequence[Array]
) -> Array:
    """Propagate by a step in which events happen at known fractions of it, the same for all samples.

    Parameters
    ----------
    x : ndarray, shape (size, n)
    white : ndarray, shape (2, inputs, n)
    events : sequence of int
        Their numbers, in the order in which they happen.
    fractions : ndarray, shape (len(events), n)
    noises : sequence of ndarray
        Execution errors of those that are corrections, shape (axes, n).
    """
    count, begin = x.shape[1], np.asarray(0.0)
    start = np.full(count, step.begin)
    for number, fraction, noise in zip(events, fractions, noises, strict=True):
        x = maps.step(x, start, step.length, white, fraction, begin)
        x = maps.happen(number, x, step.times(fraction, count), noise)
        begin = fraction
    if not events or maps.events[events[-1]].kind != "end":
        x = maps.step(x, start, step.length, white, 1.0, begin)
    return x


def set_signs(maps: Maps, signs: Array, x: Array, time: float, began: int | None) -> None:
    """Set the signs of the triggers' functions that samples look for from a time of the nominal on.

    Raises `ScenarioError` where one is zero.

    Parameters
    ----------
    signs : ndarray, shape (events,)
        Changed in place.
    x : ndarray, shape (size,)
    began : int or None
        Phase that begins, whose successor is looked for; none at the start of the flight.
    """
    for number, event in enumerate(maps.events):
        if (event.kind == "phase" and event.number == (began or 0) + 1) or (event.kind != "phase" and began is None):
            signs[number] = np.sign(maps.triggered(event.trigger, x[:, None], np.array([time]))[0])
            if signs[number] == 0.0:
                told = f"the trigger's function is zero at {'the start' if began is None else f'{time:g} s'}"
                raise ScenarioError("type", f"{event.name}: {told}; it must be to one side of it")


def meet(maps: Maps, x: Array, time: Array, signs: Array, pending: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell which pending events samples have met, shape (events, n).

    Parameters
    ----------
    signs : ndarray, shape (events,)
        Of the triggers' functions before they are met.
    """
    met = np.zeros_like(pending)
    for number, event in enumerate(maps.events):
        waits = pending[number]
        if event.kind == "phase":  # the one before it has begun
            waits = waits & (maps.phase_numbers(x) == event.number - 1)
        if waits.any():
            value = maps.triggered(event.trigger, x, time)
            met[number] = waits & (np.sign(value) != signs[number]) & np.isfinite(value)
    return met


@dataclass(frozen=True)
class Passages:
    """Events that samples meet within a step.

    Attributes
    ----------
    events : ndarray of int, shape (rounds, n)
        One after the other; -1 where there is no more.
    fractions : ndarray, shape (rounds, n)
    """

    events: NDArray[np.intp]
    fractions: Array

    def groups(self) -> list[tuple[tuple[int, ...], NDArray[np.intp]]]:
        """Return the sequences of events with the samples, by number, that meet them so."""
        sequences, which = np.unique(self.events, axis=1, return_inverse=True)
        which = which.reshape(-1)
        return [
            (tuple(event for event in sequence.tolist() if event >= 0), np.flatnonzero(which == number))
            for number, sequence in enumerate(sequences.T)
        ]


def find_passages(
    maps: Maps, step: Step, x: Array, white: Array, signs: Array, pending: NDArray[np.bool_], noises: Sequence[Array]
) -> Passages:
    """Find the events that samples meet within a step, the earliest first; arguments as those of `pass_through`."""
    count = x.shape[1]
    start, begin, moving = np.full(count, step.begin), np.zeros(count), np.ones(count, dtype=bool)
    pending, sequence, at = pending.copy(), [], []
    while moving.any():
        columns = np.flatnonzero(moving)
        of_x, of_white, since = x[:, columns], white[:, :, columns], begin[columns]
        after = maps.step(of_x, start[columns], step.length, of_white, 1.0, since)
        met = meet(maps, after, step.times(1.0, len(columns)), signs, pending[:, columns])
        first, which = np.full(len(columns), np.inf), np.full(len(columns), -1)
        for number in np.flatnonzero(met.any(axis=1)).tolist():
            chosen, trigger = met[number], maps.events[number].trigger
            some, noise, low = of_x[:, chosen], of_white[:, :, chosen], since[chosen]
            times = np.full(some.shape[1], step.begin)
            before = maps.triggered(trigger, some, times + low * step.length)
            value = maps.triggered(trigger, after[:, chosen], times + step.length)
            there = find_crossings(maps, trigger, (some, times), step.length, noise, (low, before, value))
            there = np.where(np.sign(before) == signs[number], there, low)  # beyond it already
            earlier = there < first[chosen]
            places = np.flatnonzero(chosen)[earlier]
            first[places], which[places] = there[earlier], number
        happens = which >= 0
        moving[columns[~happens]] = False
        if not happens.any():
            break
        events, fractions = np.full(count, -1), np.zeros(count)
        events[columns], fractions[columns] = which, np.where(happens, first, 0.0)
        x = x.copy()
        for number in np.unique(which[happens]).tolist():
            chosen = np.flatnonzero(events == number)
            fraction = fractions[chosen]
            reached = maps.step(x[:, chosen], start[chosen], step.length, white[:, :, chosen], fraction, begin[chosen])
            times = step.times(fraction, len(chosen))
            x[:, chosen] = maps.happen(number, reached, times, noises[number][:, chosen])
            begin[chosen], pending[number, chosen] = fraction, False
            if maps.events[number].kind == "end":
                moving[chosen] = False
        sequence.append(events)
        at.append(fractions)
    shape = (len(sequence), count)
    return Passages(np.array(sequence, dtype=np.intp).reshape(shape), np.array(at).reshape(shape))
