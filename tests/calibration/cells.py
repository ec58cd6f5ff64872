"""Statements of campaigns, counted: how often each was made, and how often it was right."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final, TypeVar

from joblib import Parallel, delayed

from mcnav.execution.child_processes import end_with_parent, interrupts_blocked
from mcnav.execution.threads import one_thread

LEVEL: Final = 0.95
"""Confidence of each single statement."""

Kind = TypeVar("Kind")


@dataclass(frozen=True, order=True)
class Cell:
    """One statement about one sort of campaign; its kind is ``coverage``, ``false alarm`` or ``power``."""

    kind: str
    system: str
    statement: str
    sources: str
    design: str
    samples: int


@dataclass
class Tally:
    """Numbers of statements that were right (an interval covered, a test rejected), and of those made."""

    hits: Counter[Cell] = field(default_factory=Counter)
    made: Counter[Cell] = field(default_factory=Counter)

    def add(self, cell: Cell, hit: bool) -> None:
        """Count one statement."""
        self.made[cell] += 1
        self.hits[cell] += hit

    def __iadd__(self, other: Tally) -> Tally:
        self.hits.update(other.hits)
        self.made.update(other.made)
        return self


def tally(trials: int, jobs: int, kinds: Sequence[Kind], count: Callable[[Kind, Sequence[int], Tally], None]) -> Tally:
    """Count the statements of so many campaigns of each kind, with seeds 0, 1, ..., in parallel processes."""
    stretch = max(1, trials // (4 * jobs))
    pieces = [
        (kind, range(begin, min(begin + stretch, trials))) for kind in kinds for begin in range(0, trials, stretch)
    ]
    total = Tally()
    with interrupts_blocked():
        parts = Parallel(
            n_jobs=jobs, return_as="generator", backend="loky", initializer=end_with_parent, initargs=(os.getpid(),)
        )(delayed(_piece)(count, *piece) for piece in pieces)
    for part in parts:
        total += part
    return total


def _piece(count: Callable[[Kind, Sequence[int], Tally], None], kind: Kind, seeds: Sequence[int]) -> Tally:
    piece = Tally()
    with one_thread():
        count(kind, seeds, piece)
    return piece
