"""F, Q and H of a filter's own states in tables without what is always zero, for compiled code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.systems.ins.filter.model import NAVIGATION
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


class StepNoise(NamedTuple):
    """Q over K steps; different ones of the other states are independent, but for pairs of neighbours.

    Attributes
    ----------
    white : ndarray, shape (K, 9, 9)
        Of psi, v, x.
    cross : ndarray, shape (K, 9, q)
        Of these with the other states.
    driven : ndarray, shape (K, q)
        Variances of the other states.
    paired : ndarray, shape (K, q)
        Covariance of each with the one before it.
    """

    white: Array
    cross: Array
    driven: Array
    paired: Array


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
    white, cross = tables.noise[:, :NAVIGATION, :NAVIGATION], tables.noise[:, :NAVIGATION, NAVIGATION:]
    driven = np.diagonal(tables.noise, axis1=1, axis2=2)[:, NAVIGATION:]
    paired = np.zeros_like(driven)
    paired[:, 1:] = np.diagonal(tables.noise[:, NAVIGATION:, NAVIGATION:], -1, axis1=1, axis2=2)
    return (
        (
            Steps(tables.transitions, tables.decay),
            StepNoise(*(np.ascontiguousarray(table) for table in (white, cross, driven, paired))),
        ),
        Updates(loop.first_updates, measured.sizes, np.concatenate([measured.rows, tables.rows], axis=2)),
    )
