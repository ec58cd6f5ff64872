"""What a peer is: a way to simulate samples of aided navigation, with a setting of its accuracy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from mcnav.arrays.types import Array
from tests.benchmarks.inertial.case import Case, Samples

Simulate = Callable[[Samples, int], Array]
"""Samples and a seed of the noise that is not given to states at the epochs, shape (n, m, 15); see `Case`.

The last epochs may be missing; a peer that has no filter returns none.
"""


@dataclass(frozen=True)
class Peer:
    """One of those compared.

    Attributes
    ----------
    prepare : callable
        Case, setting and number of cores to what simulates: all that is done once for any number of samples.
    knob : str
        What a setting is.
    settings : tuple of float
    chunk : int
        Samples that are simulated at a time.
    workers : str
        How several cores are used: ``threads`` or ``processes``, each given chunks, or the peer's ``own`` way.
    errors : bool
        Whether navigation errors are returned, shape (n, m, 9), instead of states.
    """

    prepare: Callable[[Case, float, int], Simulate]
    knob: str
    settings: tuple[float, ...]
    chunk: int
    workers: str
    errors: bool = False
