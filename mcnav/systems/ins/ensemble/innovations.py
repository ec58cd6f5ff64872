"""Innovations of sensors in kernels: each is compiled by itself, where a campaign has it, and called by its address.

So kernels contain no innovation: after a change of one, it alone is compiled again. Where numba has no addresses,
kernels contain all innovations and choose one by its kind.
"""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np
from numba import typeof, types

from mcnav.arrays.types import IndexArray
from mcnav.compiled.jit import allocation_free_by_address
from mcnav.compiled.numba_private import ADDRESSES, address_of, call_by_address, has
from mcnav.compiled.vectors import lanes
from mcnav.systems.ins.sensors.innovation import Innovation, MeasurementTables, NavigatorErrors, choose_by_kind
from mcnav.systems.ins.sensors.measurements import Measurements
from mcnav.systems.ins.sensors.registry import QUANTITIES

_NUMBERS, _ROOMS, _ROWS = (typeof(np.zeros((0,) * axes)) for axes in (1, 2, 3))

ARGUMENTS: Final = (
    lanes, types.int64, types.int64,
    types.NamedTuple(
        (_ROWS, _ROWS, _ROOMS, _ROOMS, typeof(np.zeros(0, dtype=np.bool_)), _NUMBERS), MeasurementTables
    ),
    types.NamedTuple((*(lanes,) * 6, *(_ROOMS,) * 7), NavigatorErrors), _ROWS, types.boolean,
)  # fmt: skip
"""Types of the arguments of an innovation."""

INNOVATIONS: Final = tuple(quantity.innovation for quantity in QUANTITIES.values())

INNOVATION: Innovation = call_by_address(ARGUMENTS) if has(ADDRESSES) else choose_by_kind(INNOVATIONS)
"""The innovation that one of `places_of` stands for, called with that number and its own arguments."""


def places_of(measured: Measurements) -> IndexArray:
    """Return what tells `INNOVATION`, in this process, the innovation of each component, shape (U, M).

    Of those beyond an update's components it is zero.
    """
    used = np.arange(measured.kinds.shape[1]) < measured.sizes[:, None]
    if not has(ADDRESSES):
        return np.where(used, measured.kinds, 0)
    kinds, numbers = np.unique(measured.kinds[used], return_inverse=True)
    places = np.zeros(measured.kinds.shape, dtype=np.int64)
    places[used] = np.array([_address_of(kind) for kind in kinds.tolist()], dtype=np.int64)[numbers]
    return places


@cache
def _address_of(kind: int) -> int:
    return address_of(_compiled(kind), ARGUMENTS)


@cache
def _compiled(kind: int) -> Innovation:
    """Return the compiled innovation, which must last as long as its address is used."""
    function: Innovation = INNOVATIONS[kind].py_func  # type: ignore[attr-defined]
    return allocation_free_by_address(function)
