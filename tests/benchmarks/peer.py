"""What a peer is: a way to fly draws, with a knob for its accuracy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tests.benchmarks.case import Case

Fly = Callable[[np.ndarray], np.ndarray]
"""Draws, shape (n, 10), to final navigation errors, shape (n, 4), SI."""


@dataclass(frozen=True)
class Peer:
    """One of those compared.

    Attributes
    ----------
    prepare : callable
        Case, setting and number of cores to what flies: all that is done once however many draws are flown.
    knob : str
        What a setting is.
    settings : tuple of float
        From rough to fine.
    chunk : int
        Draws that are flown at a time.
    workers : str
        How several cores are used: ``threads`` or ``processes``, each given chunks, or the peer's ``own`` way.
    fewest : int
        Draws below which a flight takes as long as with so many.
    """

    prepare: Callable[[Case, float, int], Fly]
    knob: str
    settings: tuple[float, ...]
    chunk: int
    workers: str
    fewest: int = 16
