"""Groups of LANES samples that take steps in turns: the tables of a block of steps stay in the cache for all groups."""

from __future__ import annotations

from typing import Final, NamedTuple

from mcnav.arrays.types import Array
from mcnav.compiled.jit import inlined
from mcnav.compiled.vectors import LANES, Store, load, room, store

STEPS_OF_BLOCK: Final = 16
"""Steps that a group takes before the others take them; its variates are drawn for all of them at once."""


class SampleGroups(NamedTuple):
    """Rooms that outlast a step: of the group at work, and of all groups.

    Attributes
    ----------
    kept : ndarray, shape (rows, LANES)
    others : ndarray, shape (groups, rows, LANES)
    """

    kept: Array
    others: Array


def sample_groups(count: int, keep: Store) -> SampleGroups:
    """Return room for the groups of a number of samples, of which all rooms made by a store outlast a step."""
    return SampleGroups(keep.rows, room(-(-count // LANES), len(keep.rows)))


@inlined
def put_aside(group: int, groups: SampleGroups) -> None:
    """Copy what outlasts a step to the room of a group."""
    for r in range(len(groups.kept)):
        store(groups.others, (group, r), load(groups.kept, r))


@inlined
def take_back(group: int, groups: SampleGroups) -> None:
    """Copy back what was put aside of a group."""
    for r in range(len(groups.kept)):
        store(groups.kept, r, load(groups.others, (group, r)))
