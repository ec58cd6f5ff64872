"""F, Q and H of a filter's own states in tables without what is always zero, for compiled code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.systems.ins.filter.tables import StepNoise
from mcnav.systems.ins.linear.closed_loop import ClosedLoop


class Steps(NamedTuple):
    """F over K steps, of psi, v, x and q other states, which decay and respond to nothing.

    Attributes
    ----------
    rows : ndarray, shape (K, 9, 9 + q)
        Of psi, v, x.
    decay : ndarray, shape (K, q)
        What is left of the other states.
    """

    rows: Array
    decay: Array


class Updates(NamedTuple):
    """H of U updates with at most M components.

    Attributes
    ----------
    first : ndarray of int, shape (K + 2,)
        Number of the first update at each time.
    sizes : ndarray of int, shape (U,)
        Components of each.
    rows : ndarray, shape (U, M, 9 + q)
    """

    first: IndexArray
    sizes: IndexArray
    rows: Array


def filter_system(loop: ClosedLoop) -> tuple[tuple[Steps, StepNoise], Updates]:
    """Return F and Q, and H, of the filter's own states."""
    tables, measured = loop.filter, loop.measurements
    rows = np.concatenate([measured.rows, tables.rows], axis=2)
    over = tables.whole
    return (Steps(over.transitions, over.decay), over.noise), Updates(loop.first_updates, measured.sizes, rows)
