"""LANES aided samples before they are moved on trial: what a trial changes of them is kept and taken back."""

from __future__ import annotations

from typing import NamedTuple

from mcnav.arrays.types import Array
from mcnav.compiled.jit import allocation_free_part
from mcnav.compiled.vectors import load, room, store
from mcnav.systems.ins.ensemble.steps import Deviations
from mcnav.systems.ins.ensemble.updates import Estimates


class KeptSamples(NamedTuple):
    """Copy of the state and the estimates of samples, rows of lanes."""

    turn: Array
    moved: Array
    estimate: Array
    sound: Array


def kept_samples(states: int, wanted: bool) -> KeptSamples:
    """Return room for samples with a number of states besides those of navigation; none unless it is wanted."""
    return KeptSamples(room(4 * wanted), room(6 * wanted), room(states * wanted), room(int(wanted)))


@allocation_free_part
def keep_samples(samples: Deviations, own: Estimates, kept: KeptSamples) -> None:
    """Copy samples."""
    for r in range(4):
        store(kept.turn, r, load(samples.turn, r))
    for r in range(6):
        store(kept.moved, r, load(samples.moved, r))
    for s in range(len(own.estimate)):
        store(kept.estimate, s, load(own.estimate, s))
    store(kept.sound, 0, load(samples.sound, 0))


@allocation_free_part
def take_back_samples(samples: Deviations, own: Estimates, kept: KeptSamples) -> None:
    """Restore samples from their copy."""
    for r in range(4):
        store(samples.turn, r, load(kept.turn, r))
    for r in range(6):
        store(samples.moved, r, load(kept.moved, r))
    for s in range(len(own.estimate)):
        store(own.estimate, s, load(kept.estimate, s))
    store(samples.sound, 0, load(kept.sound, 0))
