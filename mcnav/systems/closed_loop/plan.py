"""The plan of a loop's samples: its linear system with gains, and the filter's covariance, by the compiled algebra.

What samples use has the same bits on any processor; the linear answers are those of `mcnav.linear.engine`.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.scenario import ScenarioError
from mcnav.systems.closed_loop.algebra import propagate, update
from mcnav.systems.closed_loop.filter import FilterStates
from mcnav.systems.closed_loop.maps import Maps
from mcnav.systems.closed_loop.sizes import Sizes
from mcnav.systems.closed_loop.transitions import Innovation, LinearInstant, Linearization, Transition


@dataclass
class GainFilter:
    """The filter of a loop along its nominal.

    Attributes
    ----------
    covariance : ndarray, shape (k, k)
    """

    maps: Maps
    states: FilterStates
    believed: Sizes
    covariance: Array

    @classmethod
    def at_start(cls, maps: Maps, states: FilterStates, believed: Sizes) -> GainFilter:
        """Return it at the start of the flight."""
        return cls(maps, states, believed, states.start_covariance(maps.structure, believed))

    def propagate(self, transition: Transition) -> None:
        """Propagate its covariance by a step or a correction: ``F = T A S``, ``G = T G``."""
        state, inputs = transition.of_filter
        correct = transition.kind == "correct"
        self._propagate(state, inputs, self.believed.corrections[transition.number] if correct else self.believed.modes)
        for number, entering in transition.corrections.items():
            self._propagate(np.eye(len(state)), entering, self.believed.corrections[number])

    def _propagate(self, state: Array, inputs: Array, believed: Array) -> None:
        f, entering = self.states.of_errors(state, inputs * believed)
        self.covariance = propagate(self.covariance[:, :, None], f, entering)[:, :, 0]

    def close(self, innovation: Innovation) -> Transition:
        """Update its covariance, and return what the update does to X."""
        states, sigma = self.states, sized(self.maps, self.believed, innovation.number)
        h = -innovation.response @ states.moving
        gains, factor, after = update(self.covariance[:, :, None], h[:, :, None], sigma, states.estimated)
        gain = gains[: states.estimated, :, 0]
        size = innovation.response.shape[1]
        state, inputs = np.eye(size), np.zeros((size, len(sigma)))
        state[states.estimates] += gain @ innovation.response
        inputs[states.estimates] = gain
        self.covariance = after[:, :, 0]
        return Transition(state, inputs, "measure", innovation.number, gain, factor, innovation.straight)

    def correction(self, innovation: Innovation) -> Array:
        """Update its covariance, and return what the update adds to X, shape (size,)."""
        change, gain = np.zeros(innovation.response.shape[1]), self.close(innovation).gain
        assert gain is not None
        change[self.states.estimates] = gain @ innovation.value
        return change


def sized(maps: Maps, believed: Sizes, number: int) -> Array:
    """Return the believed sigmas of a sensor; `ScenarioError` when one is zero."""
    sigma = believed.measurements[number]
    if not sigma.all():
        name = maps.sensors[number].declared.name
        raise ScenarioError("type", f"measurement {name} needs a size in [measurements], or a believed one")
    return sigma


@dataclass(frozen=True)
class PlannedInstant(LinearInstant):
    """Linear maps from one instant to the next, with gains.

    Attributes
    ----------
    covariance : ndarray, shape (k, k)
        The filter's, after them.
    """

    updates: tuple[Transition, ...]
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def scaled(self, multiple: float) -> PlannedInstant:
        """Return what a filter that believes a multiple of all errors does: with the same gains."""

        def scaled(transition: Transition) -> Transition:
            return transition if transition.factor is None else replace(transition, factor=multiple * transition.factor)

        return replace(self, updates=tuple(map(scaled, self.updates)), covariance=multiple**2 * self.covariance)


@dataclass(frozen=True)
class Begin:
    """Start of a navigator that has waited: ``X+ = A X + U e`` before the updates of an instant.

    Attributes
    ----------
    number : int
        Of the instant.
    state : ndarray, shape (size, size)
    errors : ndarray, shape (size, sources)
        U, how the sources move X there.
    covariance : ndarray, shape (k, k)
        What the filter begins with.
    """

    number: int
    state: Array
    errors: Array
    covariance: Array


@dataclass(frozen=True)
class Plan(Linearization):
    """The linear system at all instants, with gains.

    Attributes
    ----------
    begin : Begin, optional
        Where the navigator starts, if not with the flight.
    """

    instants: Sequence[PlannedInstant]
    begin: Begin | None = None

    def scaled(self, multiple: float) -> Plan:
        """Return the plan of a filter that believes a multiple of all errors."""
        begin = self.begin
        begun = None if begin is None else replace(begin, covariance=multiple**2 * begin.covariance)
        return replace(self, instants=[planned.scaled(multiple) for planned in self.instants], begin=begun)

    @cached_property
    def _written(self) -> bytes:
        return pickle.dumps(given(self), protocol=5)

    def __reduce__(self) -> tuple[Callable[[bytes], Plan], tuple[bytes]]:
        """Return the plan as a text of bytes, which is written once, and read once in a worker: chunks share it."""
        return _read_plan, (self._written,)


@lru_cache(maxsize=1)
def _read_plan(written: bytes) -> Plan:
    return Plan(**pickle.loads(written))


def given(structure: Any) -> dict[str, Any]:
    """Return the fields of a dataclass by name."""
    return {attribute.name: getattr(structure, attribute.name) for attribute in fields(structure)}


def make_plan(
    linear: Linearization, maps: Maps, states: FilterStates | None, believed: Sizes, begin: Begin | None = None
) -> Plan:
    """Compute gains along a linearization; before the start of a navigator that waits nothing is measured."""
    gains = None if states is None else GainFilter.at_start(maps, states, believed)
    instants = []
    for number, planned in enumerate(linear.instants):
        if begin is None or number > begin.number:
            for step in planned.steps:
                _propagate(step, gains)
        elif gains is not None and number == begin.number:
            gains.covariance = begin.covariance
        waits = begin is not None and number < begin.number
        updates = tuple(_close(update, None if waits else gains) for update in planned.updates)
        covariance = np.zeros((0, 0)) if gains is None else gains.covariance
        instants.append(PlannedInstant(**(given(planned) | {"updates": updates}), covariance=covariance))
    return Plan(**(given(linear) | {"instants": instants}), begin=begin)


def _propagate(transition: Transition, gains: GainFilter | None) -> None:
    if gains is not None:
        gains.propagate(transition)


def _close(update: Transition | Innovation, gains: GainFilter | None) -> Transition:
    """Return what an update does to X, with its gain; the filter's covariance is updated."""
    if isinstance(update, Innovation):
        assert gains is not None
        return gains.close(update)
    if update.kind == "correct":
        _propagate(update, gains)
    return update
