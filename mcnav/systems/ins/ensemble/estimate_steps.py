"""Steps of LANES aided samples: what their filters have estimated of the errors of the instruments."""

from __future__ import annotations

from typing import NamedTuple

from mcnav.arrays.types import Array, IndexArray
from mcnav.compiled.jit import allocation_free_part
from mcnav.compiled.vectors import load, store


class EstimateSteps(NamedTuple):
    """Tables for the filters' estimates of errors over K steps, of `mcnav.systems.ins.filter.tables.FilterTables`.

    Attributes
    ----------
    turning, moving, fading : ndarray of int
        Other states that psi responds to, that v and x respond to, and that are not constants.
    """

    coupling: Array
    decay: Array
    corrected: Array
    turning: IndexArray
    moving: IndexArray
    fading: IndexArray


@allocation_free_part
def subtract_estimates(k: int, tables: EstimateSteps, response: Array, estimate: Array) -> None:
    """Subtract from the response of step k what is estimated of the errors of the instruments; let estimates fade.

    Parameters
    ----------
    response, estimate : ndarray, shapes (9, LANES), (q, LANES)
    """
    coupling = tables.coupling
    for r in range(0, 9, 3):
        x, y, z = load(response, r), load(response, r + 1), load(response, r + 2)
        for s in tables.turning if r == 0 else tables.moving:
            estimated = load(estimate, s)
            x -= coupling[k, r, s] * estimated
            y -= coupling[k, r + 1, s] * estimated
            z -= coupling[k, r + 2, s] * estimated
        store(response, r, x)
        store(response, r + 1, y)
        store(response, r + 2, z)
    for s in tables.fading:
        store(estimate, s, tables.decay[k, s] * load(estimate, s))
