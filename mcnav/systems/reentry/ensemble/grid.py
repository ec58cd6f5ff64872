"""The shared grid of the ensemble: nodes and weights tabulated once, for every sample of a campaign.

The kernel (`mcnav.systems.reentry.ensemble.kernel`) follows ``c``, the start deviation that would have led to the
present deviation under linear gravity. Two things change it: the error of the measured force, and what gravity has
beyond its linear part. Both are products of a shared factor, which varies fast, and of a sample's own factor, which
varies slowly; so both are integrated as products, the shared factor exactly, and the nodes need to resolve the slow
factor alone:

- the sample's factor of the **gravity remainder** is a polynomial of degree 6 between nodes, through the seven nearest;
- that of the **force error**, sine and cosine of the platform's turn, is its Taylor polynomial of degree 2 about the
  middle of each interval.

Neither the thinness of the atmosphere nor its kinks shorten the steps. Nodes stand at equal parts of ``r^(-3/2) dt``,
the angle of a circular orbit at the reference's radius.

At a node the remainder of the stretch just passed is not yet known in full: a cubic through the last four nodes stands
in for it, through coefficients of its own, until the final weights take over.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.compiled.jit import uncontracted
from mcnav.physics.constants import GRAVITATIONAL_PARAMETER
from mcnav.systems.reentry.ensemble.transition import Response, Tables

DEGREE: Final = 6
"""Degree of the polynomial between nodes."""

MEMORY: Final = 4
"""Nodes whose remainder is remembered: the cubic through them stands in for what is not yet known."""

MARGIN: Final = 0.3
"""Distance of the first and last node from start and end, in steps."""

MOMENTS: Final = 3
"""Terms of the force error's Taylor polynomial."""

_POINTS: Final = 5
"""Gauss points per part of an interval of the nodes and a step of the truth's integrator."""

FORCE_FREE: Final = 1e-10
"""An interval with no more than this share of the flight's impulse is integrated without force."""


class Grid(NamedTuple):
    """Everything the kernel needs to know of a truth: n nodes, n + 1 intervals between them, start and end.

    Attributes
    ----------
    readout : ndarray, shape (n, 2, 6)
        Deviation east and up, as shares of the reference's radius, from c and the biases.
    recent : ndarray, shape (n, 2, 4, 2)
        The same from the remainders at the last four nodes, the latest first.
    weights : ndarray, shape (n, 4, 2)
        What the remainder (east, up) at a node adds to c in the end.
    forced : ndarray of bool, shape (n + 1,)
        Whether forces act in the interval.
    middles : ndarray, shape (n + 1,)
        Middle of each interval, s from the start of navigation.
    moments : ndarray, shape (n + 1, 3, 4, 4)
        What the force error's four factors, and their first and second derivatives at the middle, add to c.
    final : ndarray, shape (4, 6)
        Final deviation and its rates, east and up, from c and the biases.
    first, last, nominal : ndarray, shape (4,)
        As in `mcnav.systems.reentry.ensemble.transition.Response`.
    """

    readout: Array
    recent: Array
    weights: Array
    forced: NDArray[np.bool_]
    middles: Array
    moments: Array
    final: Array
    first: Array
    last: Array
    nominal: Array


def shared_grid(response: Response, count: int) -> Grid:
    """Tabulate nodes and weights.

    Parameters
    ----------
    response : Response
        From the start of navigation to the end.
    count : int
        Number of nodes, at least 1.
    """
    nodes = orbit_nodes(response, count)
    quadrature = product_quadrature(response, nodes)
    readout, recent, weights = node_tables(response, nodes, quadrature)
    forced, middles, moments = force_moments(response, np.append(nodes, response.end), quadrature)
    return Grid(
        readout,
        recent,
        weights,
        forced,
        middles,
        moments,
        response.final,
        response.first,
        response.last,
        response.nominal,
    )


class Quadrature(NamedTuple):
    """Gauss points of a flight, none of whose parts spans a node, an epoch or a kink.

    Attributes
    ----------
    times, lengths : ndarray, shape (q,)
        Points and their weights, s.
    tables : Tables
        At the points.
    shared : ndarray, shape (q, 4, 2)
        What the gravity remainder (east, up) at a point adds to c: ``M^-1 [0; 1] mu / r^2`` times the weight.
    """

    times: Array
    lengths: Array
    tables: Tables
    shared: Array


def product_quadrature(response: Response, instants: Array) -> Quadrature:
    """Place Gauss points between the steps of the truth's integrator and some instants (s)."""
    times, lengths = _gauss(np.union1d(response.steps, instants))
    tables = response.at(times)
    return Quadrature(times, lengths, tables, tables.push * (_gravity(tables.radius) * lengths)[:, None, None])


def node_tables(response: Response, nodes: Array, quadrature: Quadrature) -> tuple[Array, Array, Array]:
    """Tabulate `Grid.readout`, `Grid.recent` and `Grid.weights`."""
    tables = response.at(nodes)
    readout = tables.response / tables.radius[:, None, None]
    pieces = interval_weights(nodes, quadrature)
    recent = stand_ins(response.end, nodes, nodes, quadrature, pieces)
    return (
        np.ascontiguousarray(readout),
        np.ascontiguousarray(np.einsum("nac,npcb->napb", readout[:, :, :4], recent)),
        pieces.weights.sum(axis=0),
    )


def _gravity(radius: Array) -> Array:
    """Compute the acceleration of gravity, mu / r^2, m/s^2."""
    return GRAVITATIONAL_PARAMETER / (radius * radius)


def orbit_nodes(response: Response, count: int) -> Array:
    """Place nodes at equal parts of ``r^(-3/2) dt``: their times, shape (count,), s."""
    rate = response.radii**-1.5
    angle = np.append(0.0, np.cumsum(0.5 * (rate[:-1] + rate[1:]) * np.diff(response.steps)))
    wanted = (MARGIN + np.arange(count)) / (count - 1 + 2.0 * MARGIN) * angle[-1]
    nodes: Array = np.interp(wanted, angle, response.steps)
    return nodes


def _gauss(edges: Array) -> tuple[Array, Array]:
    """Place Gauss points between successive edges; points and weights, both of shape ((len(edges) - 1) * 5,)."""
    points, weights = np.polynomial.legendre.leggauss(_POINTS)
    half = 0.5 * np.diff(edges)[:, None]
    return (edges[:-1, None] + half * (1.0 + points)).ravel(), (half * weights).ravel()


def _lagrange(times: Array, stencils: Array) -> Array:
    """Evaluate Lagrange polynomials at times, shape (n,), through nodes of their own, shape (n, k): shape (n, k)."""
    values = np.ones(stencils.shape)
    _multiply_factors(times, np.ascontiguousarray(stencils), values)
    return values


@uncontracted
def _multiply_factors(times: Array, stencils: Array, values: Array) -> None:
    """Multiply values by the factors of Lagrange polynomials."""
    for row in range(len(times)):
        for this in range(stencils.shape[1]):
            for other in range(stencils.shape[1]):
                if other != this:
                    distance = stencils[row, this] - stencils[row, other]
                    values[row, this] *= (times[row] - stencils[row, other]) / distance


class Pieces(NamedTuple):
    """The final weights by interval; interval 0 lies before node 0.

    Attributes
    ----------
    weights : ndarray, shape (n + 1, n, 4, 2)
        What each interval adds to the weights of each node.
    places : ndarray of int, shape (n + 1, k)
        The nodes through which the interval's polynomial goes.
    """

    weights: Array
    places: NDArray[np.int_]


def interval_weights(nodes: Array, quadrature: Quadrature) -> Pieces:
    """Integrate the shared factor against each interval's polynomials."""
    count = len(nodes)
    size = min(DEGREE + 1, count)
    interval = np.searchsorted(nodes, quadrature.times)
    first = np.clip(np.arange(count + 1) - 1 - (size - 2) // 2, 0, count - size)
    places = first[:, None] + np.arange(size)
    polynomials = _lagrange(quadrature.times, nodes[places[interval]])
    added = np.zeros((count + 1, count, 4, 2))
    np.add.at(added, (interval[:, None], places[interval]), polynomials[:, :, None, None] * quadrature.shared[:, None])
    return Pieces(added, places)


def stand_ins(end: float, nodes: Array, instants: Array, quadrature: Quadrature, pieces: Pieces) -> Array:
    """Tabulate the remainders that stand in until the final weights of earlier nodes are complete, (m, 4, 4, 2).

    By the last four nodes, the latest first: the integral up to the instant less what the final weights have gathered.
    """
    by_interval, places = pieces
    interval = np.searchsorted(nodes, quadrature.times)
    size = places.shape[1]
    ends = np.append(nodes, end)
    recent = np.zeros((len(instants), MEMORY, 4, 2))
    for row, instant in enumerate(instants):
        passed = int(np.searchsorted(nodes, instant))
        memory = min(MEMORY, passed)
        if memory == 0:
            continue
        known = nodes[np.arange(passed - 1, passed - 1 - memory, -1)]
        # intervals behind us whose polynomial needs no later node
        complete = int(min(np.searchsorted(places[:, -1], passed), np.searchsorted(ends, instant, "right")))
        old = slice(max(0, passed - size), passed)  # nodes which the polynomials of the others need
        premature = by_interval[complete : passed + size, old].sum(axis=0)
        to_known = _lagrange(nodes[old], np.broadcast_to(known, (passed - old.start, memory)))
        recent[row, :memory] = -np.einsum("jm,jab->mab", to_known, premature)
        tail = slice(np.searchsorted(interval, complete), np.searchsorted(quadrature.times, instant))
        to_known = _lagrange(quadrature.times[tail], np.broadcast_to(known, (max(tail.stop - tail.start, 0), memory)))
        recent[row, :memory] += np.einsum("qm,qab->mab", to_known, quadrature.shared[tail])
    return recent


def force_moments(response: Response, ends: Array, quadrature: Quadrature) -> tuple[NDArray[np.bool_], Array, Array]:
    """Tabulate `Grid.forced`, `Grid.middles` and `Grid.moments` of intervals that end at times, shape (n,), s."""
    middles = 0.5 * (np.append(response.start, ends[:-1]) + ends)
    tables, lengths = quadrature.tables, quadrature.lengths
    within = quadrature.times < ends[-1]
    interval = np.searchsorted(ends, quadrature.times[within])
    impulses = lengths * np.hypot(*tables.force.T)
    impulse = np.bincount(interval, impulses[within], len(ends))
    force_x, force_z = tables.force[:, 0, None], tables.force[:, 1, None]
    push_x, push_z = tables.push_axes[:, :, 0], tables.push_axes[:, :, 1]
    # factors: (1 + S_x) cos - 1, (1 + S_x) sin, (1 + S_z) sin, (1 + S_z) cos - 1
    shared = np.stack([push_x * force_x, push_x * force_z, -push_z * force_x, push_z * force_z], axis=2)[within]
    away = quadrature.times[within] - middles[interval]
    moments = np.zeros((len(ends), MOMENTS, 4, 4))
    for order, factorial in enumerate((1.0, 1.0, 2.0)):
        np.add.at(moments[:, order], interval, shared * (lengths[within] * away**order / factorial)[:, None, None])
    return impulse > FORCE_FREE * impulses.sum(), middles - response.start, moments
