"""The linear system of a loop, kept from one command to the next (`mcnav.systems.user.kept`).

It is read again where code, settings, sizes, start and schedule are the same, and where all maps of the flight still
have the same values: along the nominal, and beside it with all errors and all noise. Together these are evaluated in a
tenth of the time that flight and derivatives take.
"""

from __future__ import annotations

import hashlib
import pickle
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.caches.stored import Cache
from mcnav.contract.scenario import ScenarioError
from mcnav.systems.closed_loop.differences import COLUMNS, MIXED, mixed, values_about
from mcnav.systems.closed_loop.kept import arrays_of_sizes, environment, program
from mcnav.systems.closed_loop.maps import Maps
from mcnav.systems.closed_loop.nominal_flight import map_of
from mcnav.systems.closed_loop.schedule import Instant
from mcnav.systems.closed_loop.sizes import LoopSizes
from mcnav.systems.closed_loop.transitions import FlownGroup, Linearization
from mcnav.systems.guard import CodeMisbehaved
from mcnav.systems.user.code import Loaded, UserScenarioSpec
from mcnav.systems.user.kept import NUMBERS, KeptNumbers, Kind, keep

DERIVATIVES: Final = Kind(
    Cache("derivatives"), (), "differentiating the maps of the loop", "its derivatives were kept",
    "they are computed again",
)  # fmt: skip


class _OneByOne(Exception):
    """Raised with a linear system whose maps cannot be evaluated together: it is not kept."""

    def __init__(self, linear: Linearization) -> None:
        self.linear = linear


@dataclass(frozen=True)
class KeptLinearization:
    """Where the linear system of a loop is kept.

    Attributes
    ----------
    ask : callable
        Calls a function with code of the user's; what fails is a `ScenarioError`.
    """

    loaded: Loaded
    spec: UserScenarioSpec
    maps: Maps
    sizes: LoopSizes
    ask: Callable[[Callable[[], str]], str]

    def keep(
        self, start: Array, schedule: tuple[Instant, ...], linearize: Callable[[], Linearization]
    ) -> Linearization:
        """Return the linear system that an earlier command has kept, or linearize.

        Parameters
        ----------
        start : ndarray, shape (size,)
        """
        last: list[Linearization] = []

        def repeats(known: KeptNumbers) -> bool:
            linear, values = _read(known)
            last.append(linear)
            return self._values(linear) == values

        def compute() -> KeptNumbers:
            linear = linearize()
            values = self._values(linear)
            if not values:
                raise _OneByOne(linear)
            last.append(linear)
            return _written(linear, values)

        digest = hashlib.sha256(f"{program()} {schedule!r} {environment(self.spec.code.text)}".encode())
        for array in (start, *arrays_of_sizes(self.sizes)):
            digest.update(f"{array.shape}".encode() + np.ascontiguousarray(array).tobytes())
        try:
            keep(self.loaded, self.spec, replace(DERIVATIVES, computed=(digest.hexdigest(),)), repeats, compute)
        except _OneByOne as alone:
            return alone.linear
        return last[-1]

    def _values(self, linear: Linearization) -> str:
        """Digest the values of all maps along the nominal and beside it; empty where they are not had together."""
        if not linear.flown:
            return ""
        try:
            return self.ask(lambda: digest_of_values(self.maps, linear))
        except CodeMisbehaved:
            raise
        except ScenarioError:  # linearizing raises it again, where the flight without errors fails
            return ""


def digest_of_values(maps: Maps, linear: Linearization) -> str:
    """Digest the values of all maps along the nominal, and with all of X and of what enters moved together."""
    digest = hashlib.sha256()
    for group in linear.flown:
        for values in _beside(maps, group, linear.steps):
            digest.update(f"{group.group} {values.shape}".encode() + np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()


def _beside(maps: Maps, group: FlownGroup, steps: Array) -> list[Array]:
    sizes, together = np.concatenate([steps, group.inputs]), COLUMNS // (1 + MIXED)
    moved = np.column_stack([np.zeros(len(sizes)), sizes[:, None] * mixed(len(sizes))])
    function, space = map_of(maps, group.group), maps.structure.space
    return [
        values_about(function, group.x[begin : begin + together], group.at[begin : begin + together], moved, space)
        for begin in range(0, len(group.x), together)
    ]


def _written(linear: Linearization, values: str) -> KeptNumbers:
    content = zlib.compress(pickle.dumps((linear, values), protocol=5), 1)
    return KeptNumbers((np.frombuffer(content + bytes(-len(content) % NUMBERS.itemsize), NUMBERS),))


def _read(known: KeptNumbers) -> tuple[Linearization, str]:
    """Read what `_written` has written, of the same program: the bytes of the numbers."""
    content = zlib.decompressobj().decompress(known.arrays[0].astype(NUMBERS).tobytes())
    linear, values = pickle.loads(content)
    return linear, values
