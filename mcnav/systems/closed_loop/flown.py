"""Maps that the nominal flight has flown, and their derivatives: those of a kind many at once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.scenario import ScenarioError
from mcnav.systems.closed_loop.differences import COLUMNS, Derivatives, TimedMap, columns_of, differentiate_maps
from mcnav.systems.closed_loop.event import Saltation
from mcnav.systems.closed_loop.maps import Event
from mcnav.systems.closed_loop.rotations import Space
from mcnav.systems.closed_loop.schedule import Instant
from mcnav.systems.closed_loop.transitions import (
    Composed,
    FlownGroup,
    Group,
    Innovation,
    LinearInstant,
    Moment,
    Transition,
)


class Apart(Exception):
    """Maps must be differentiated one after the other."""


@dataclass(eq=False)
class FlownMap:
    """A map of the flight about one state, and its derivatives once they are known.

    Attributes
    ----------
    group : tuple
        Maps of a group are one function.
    at : tuple of float
        Time, s, and what else tells it from others of its group.
    where : str
        Its name, for people.
    to_x : bool
        Whether its values are X.
    value : ndarray, shape (m,)
        About the nominal, by itself.
    believed : FlownMap, optional
        The map as the navigator believes it; none where it is the same.
    """

    group: Group
    function: TimedMap
    x: Array
    at: tuple[float, ...]
    inputs: Array
    where: str
    to_x: bool = True
    value: Array = field(default_factory=lambda: np.zeros(0))
    derivatives: Derivatives | None = None
    believed: FlownMap | None = None

    @property
    def known(self) -> Derivatives:
        """The derivatives."""
        assert self.derivatives is not None
        return self.derivatives

    @property
    def step(self) -> Transition:
        """The transition of a step, or of a part of it."""
        believed = None if self.believed is None else (self.believed.known.state, self.believed.known.inputs)
        return Transition(self.known.state, self.known.inputs, "step", fixed=believed)


@dataclass
class FlownEvent:
    """An event within a step: its time and fraction, X before and after it."""

    event: Event
    time: float
    fraction: float
    saltation: Saltation
    before: Array


@dataclass
class FlownStep:
    """A step of the flight: its parts, and events between them."""

    parts: list[FlownMap | FlownEvent] = field(default_factory=list)

    def linear(self) -> Transition:
        """Return its transition."""
        first, *others = self.parts
        assert isinstance(first, FlownMap)
        composed = Composed.of(first.step)
        moments: list[Moment] = []
        for other in others:
            if isinstance(other, FlownMap):
                composed.add(other.step)
                continue
            event, saltation = other.event, other.saltation
            moments.append(Moment(other.time, other.fraction, "before", other.before, composed.transition))
            composed.jump(saltation, event.number if event.kind == "correction" else None)
            moments.append(Moment(other.time, other.fraction, "after", saltation.value, composed.transition))
        whole = composed.transition
        straight = None if others else first.known.straight
        return Transition(
            whole.state, whole.inputs, "step", straight=straight, corrections=whole.corrections, fixed=whole.fixed,
            moments=tuple(moments),
        )  # fmt: skip


@dataclass
class FlownUpdate:
    """A map at an instant."""

    map: FlownMap
    kind: str
    number: int = 0

    def linear(self) -> Transition | Innovation:
        """Return its transition, or innovation."""
        known = self.map.known
        if not self.map.to_x:
            return Innovation(self.number, known.state, known.value, known.straight)
        straight = known.straight if self.kind == "correct" else None
        return Transition(known.state, known.inputs, self.kind, self.number, straight=straight)


@dataclass
class FlownInstant:
    """What is flown until an instant, and at it; ``ended`` is the effect of an end within the last step."""

    instant: Instant
    before: list[Array]
    steps: list[FlownStep] = field(default_factory=list)
    updates: list[FlownUpdate] = field(default_factory=list)
    nominal: Array = field(default_factory=lambda: np.zeros(0))
    ended: Transition | None = None

    def linear(self) -> LinearInstant:
        """Return its linear maps."""
        updates = (self.ended,) if self.ended is not None else tuple(update.linear() for update in self.updates)
        steps = tuple(step.linear() for step in self.steps)
        return LinearInstant(self.instant, steps, updates, self.nominal, np.array(self.before))


def groups_of(flown: Sequence[FlownMap]) -> tuple[FlownGroup, ...]:
    """Return the groups of maps."""
    return tuple(
        FlownGroup(group, np.array([each.x for each in members]), np.array([each.at for each in members]),
                   members[0].inputs)
        for group, members in _members_of(flown).items()
    )  # fmt: skip


def _members_of(flown: Iterable[FlownMap]) -> dict[Group, list[FlownMap]]:
    groups: dict[Group, list[FlownMap]] = {}
    for map_ in flown:
        groups.setdefault(map_.group, []).append(map_)
    return groups


def differentiate_flown(flown: Iterable[FlownMap], steps: Array, space: Space, apart: bool) -> set[str]:
    """Differentiate maps, those of a group together, and return the names of those with kinks.

    Parameters
    ----------
    steps : ndarray, shape (size,)
        Sizes of X.
    apart : bool
        Whether a map may have another value than by itself.

    Raises
    ------
    Apart
        Where maps that are evaluated together have other values.
    ScenarioError
        Where derivatives are not finite.
    """
    for members in _members_of(flown).values():
        most = max(COLUMNS // columns_of(len(steps) + len(members[0].inputs)), 1)
        for begin in range(0, len(members), most):
            some = members[begin : begin + most]
            values = _evaluate(some, steps, space, apart)
            if begin == 0 and len(some) > 1:
                _check_apart(some, values, steps, space, apart)
    kinks = set()
    for map_ in flown:
        known = map_.known
        check_finite(map_.where, known.value, known.state)
        if known.kinked.any():
            kinks.add(map_.where.split(" at ")[0])
    return kinks


def _evaluate(maps: Sequence[FlownMap], steps: Array, space: Space, apart: bool) -> Array:
    """Differentiate maps of a group together, and return their values, shape (m, maps, columns)."""
    first = maps[0]
    derivatives, values = differentiate_maps(
        first.function, np.array([map_.x for map_ in maps]), np.array([map_.at for map_ in maps]), steps,
        first.inputs, space, space if first.to_x else None,
    )  # fmt: skip
    for map_, known in zip(maps, derivatives, strict=True):
        if not apart and not np.array_equal(known.value, map_.value, equal_nan=True):
            raise Apart
        map_.derivatives = known
    return values


def _check_apart(together: Sequence[FlownMap], values: Array, steps: Array, space: Space, apart: bool) -> None:
    """Raise `Apart` where the first or the last of some maps has other values by itself."""
    for place in (0, -1):
        kept = together[place].derivatives
        alone = _evaluate([together[place]], steps, space, apart)[:, 0]
        together[place].derivatives = kept
        if not np.array_equal(alone, values[:, place], equal_nan=True):
            raise Apart


def check_finite(where: str, *arrays: Array) -> None:
    """Raise `ScenarioError` where the flight is not finite."""
    if not all(np.isfinite(array).all() for array in arrays):
        raise ScenarioError("type", f"its flight without any error is not finite: {where}")
