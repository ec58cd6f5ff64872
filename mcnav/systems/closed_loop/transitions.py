"""The linear system of a loop along its nominal flight: the derivative of each of its maps, whatever the gains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.linear import Update
from mcnav.systems.closed_loop.differences import Straight
from mcnav.systems.closed_loop.event import Saltation
from mcnav.systems.closed_loop.schedule import Instant
from mcnav.systems.closed_loop.structure import Structure

Group: TypeAlias = tuple[Any, ...]
"""Identity of a map: its kind, and its numbers."""


@dataclass(frozen=True)
class Transition:
    """``X+ = A X + G w`` about the nominal.

    Attributes
    ----------
    state : ndarray, shape (size, size)
    inputs : ndarray, shape (size, k)
        For inputs in their SI units; those of a step are its two Legendre modes, one after the other.
    kind : str
        ``step``, ``measure``, ``correct``, ``guide`` or ``event``, the end.
    number : int
        Of the measurement or correction.
    gain : ndarray, shape (estimated states, k), optional
    factor : ndarray, shape (k, k, 1), optional
        Cholesky's factor of the covariance that the filter expects of the innovation.
    straight : Straight, optional
        The map of X, or of the innovation, where it is linear.
    corrections : mapping of int to ndarray, shape (size, axes)
        For the execution errors of corrections by trigger within a step, by number.
    fixed : tuple of (ndarray, ndarray), optional
        A and G of a step as a filter sees them: events happen at their nominal instants, and processes have the
        correlation times that it believes. None where both agree.
    moments : tuple of Moment
        Before and after events within a step.
    """

    state: Array
    inputs: Array
    kind: str
    number: int = 0
    gain: Array | None = None
    factor: Array | None = None
    straight: Straight | None = None
    corrections: Mapping[int, Array] = field(default_factory=dict)
    fixed: tuple[Array, Array] | None = None
    moments: tuple[Moment, ...] = ()

    @property
    def of_filter(self) -> tuple[Array, Array]:
        """A and G as a filter sees them."""
        return (self.state, self.inputs) if self.fixed is None else self.fixed


@dataclass(frozen=True)
class Moment:
    """The linear system before or after an event within a step, or at another time of it.

    Attributes
    ----------
    fraction : float
        Of the step.
    x : ndarray, shape (size,)
        Of the nominal.
    transition : Transition
        From the begin of the step; it shares the noise of the whole step.
    """

    time: float
    fraction: float
    label: Update
    x: Array
    transition: Transition


@dataclass(frozen=True)
class Innovation:
    """``y = value + Y X + v`` about the nominal: what a sensor measures less what the navigator expects.

    Attributes
    ----------
    number : int
        Of the sensor.
    response : ndarray, shape (k, size)
        Y.
    value : ndarray, shape (k,)
    straight : Straight, optional
        The map, where it is linear.
    """

    number: int
    response: Array
    value: Array
    straight: Straight | None = None
    kind: str = "measure"


@dataclass(frozen=True)
class LinearInstant:
    """Linear maps from one instant to the next, about the nominal.

    Attributes
    ----------
    instant : Instant
    steps : tuple of Transition
        Those that lead to it.
    updates : tuple of Transition or Innovation
        Those at it.
    nominal : ndarray, shape (size,)
        X after them.
    before : ndarray, shape (steps + 1, size)
        X before each step, and before the updates.
    """

    instant: Instant
    steps: tuple[Transition, ...]
    updates: tuple[Transition | Innovation, ...]
    nominal: Array
    before: Array

    @property
    def changed(self) -> bool:
        """True where a measurement or a correction changes X at it."""
        return any(update.kind in ("measure", "correct") for update in self.updates)


@dataclass(frozen=True, eq=False)
class FlownGroup:
    """Maps of the flight that are one function: where they were flown.

    Attributes
    ----------
    group : tuple
    x : ndarray, shape (n, size)
    at : ndarray, shape (n, k)
        Times, s, and the like.
    inputs : ndarray, shape (j,)
        Sizes of what enters.
    """

    group: Group
    x: Array
    at: Array
    inputs: Array


@dataclass(frozen=True)
class Linearization:
    """The linear system of a loop at all instants, without gains.

    Attributes
    ----------
    instants : sequence of LinearInstant
    end : int
        Number of the instant of the nominal end.
    end_time : float
    event_times : mapping of str to float
        Of corrections, phases and ends by trigger, by name.
    signs : ndarray, shape (events,)
        Of the triggers' functions before they are met.
    steps : ndarray, shape (size,)
        Sizes of X, from which steps of differences follow.
    kinks : frozenset of str
        Maps that have a kink at the nominal.
    innovations : mapping of int to ndarray
        Largest nominal innovation of each sensor by component, SI.
    beside : str
        Digest of the values that the maps have beside the nominal, with all errors and all noise.
    flown : tuple of FlownGroup
        Maps of the flight that may be evaluated together; none where they must be one after the other.
    """

    instants: Sequence[LinearInstant]
    end: int
    end_time: float
    event_times: Mapping[str, float]
    signs: Array
    steps: Array
    kinks: frozenset[str]
    innovations: Mapping[int, Array]
    beside: str = ""
    flown: tuple[FlownGroup, ...] = ()

    @property
    def settled(self) -> bool:
        """True where no innovation moves the nominal, so that it does not depend on gains."""
        return not any(innovation.any() for innovation in self.innovations.values())

    def largest_values(self, structure: Structure) -> Array:
        """Return the largest value of X's quantities along the nominal, or ten of their sizes, shape (size,)."""
        largest = np.max([np.abs(planned.before).max(axis=0) for planned in self.instants], axis=0)
        largest = np.maximum(largest, 10.0 * self.steps)
        for block in structure.blocks:
            for _, place in block.places():
                largest[place] = largest[place].max()
        return np.asarray(largest)


@dataclass
class Composed:
    """Maps one after the other, all with the same noise.

    Attributes
    ----------
    state, inputs : ndarray, shapes (size, size) and (size, k)
        With events at every sample's own instant.
    fixed, inputs_fixed : ndarray, the same shapes
        With events at the nominal instants, and the correlation times that a filter believes.
    corrections : dict of int to ndarray
        As those of a `Transition`.
    """

    state: Array
    inputs: Array
    fixed: Array
    inputs_fixed: Array
    corrections: dict[int, Array]

    @classmethod
    def of(cls, transition: Transition) -> Composed:
        """Return that of a transition."""
        return cls(transition.state, transition.inputs, *transition.of_filter, dict(transition.corrections))

    def add(self, step: Transition) -> None:
        """Add a part of a step."""
        fixed, inputs_fixed = step.of_filter
        self._change(step.state, fixed)
        self.inputs, self.inputs_fixed = self.inputs + step.inputs, self.inputs_fixed + inputs_fixed

    def jump(self, saltation: Saltation, correction: int | None) -> None:
        """Add an event, with the number of the correction that it is."""
        self._change(saltation.state, saltation.fixed)
        if correction is not None:
            self.corrections[correction] = saltation.inputs

    @property
    def transition(self) -> Transition:
        """The transition of all of them."""
        fixed = None if self.fixed is self.state else (self.fixed, self.inputs_fixed)
        return Transition(self.state, self.inputs, "step", corrections=dict(self.corrections), fixed=fixed)

    def _change(self, state: Array, fixed: Array) -> None:
        same = fixed is state and self.fixed is self.state
        self.state, self.inputs = state @ self.state, state @ self.inputs
        self.fixed, self.inputs_fixed = (
            (self.state, self.inputs) if same else (fixed @ self.fixed, fixed @ self.inputs_fixed)
        )
        self.corrections = {number: state @ inputs for number, inputs in self.corrections.items()}
