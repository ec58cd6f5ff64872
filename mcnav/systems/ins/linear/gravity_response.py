"""Response of the navigation errors to gravity disturbances over the steps of a grid.

In inertial axes, with deviations v and x of velocity and position, the gravity gradient G, and processes b of unit
sigma (`mcnav.systems.ins.imu.gravity`) that act along the columns of A (`mcnav.systems.ins.truth.gravity`)::

    v' = A b + G x        x' = v        b' = -(u / L) b + sqrt(2 u / L) w

with the speed u over the earth, a correlation length L and white noise w of unit density: the processes are those of
the distance, whose rates change with the speed. The method is that of `mcnav.systems.ins.linear.response`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.compiled.jit import allocation_free_part, compiled
from mcnav.systems.ins.imu.gravity import GravityDisturbance
from mcnav.systems.ins.linear.quadrature import (
    AHEAD,
    LATER,
    LONGEST_INTERVAL,
    NODE,
    SHARE_OF_CORRELATION,
    advance_motion,
    intervals_of,
)
from mcnav.systems.ins.truth.gravity import disturbed_acceleration, speed
from mcnav.systems.ins.truth.trajectory import Truth


class GravityResponses(NamedTuple):
    """Responses over K steps to p processes of unit sigma, in the order of `DISTURBANCES`; none, p = 0, without any.

    Attributes
    ----------
    state : ndarray, shape (K, p, 6)
        Of v and x at the end of a step, to the process at its beginning.
    decay : ndarray, shape (K, p)
        What is left of the process.
    driven : ndarray, shape (K, p, 7, 7)
        Covariance of v, x and the process that the step adds.
    """

    state: Array
    decay: Array
    driven: Array


class _Path(NamedTuple):
    """The truth at the nodes of J intervals, of which K steps consist.

    Attributes
    ----------
    begins : ndarray of int, shape (K + 1,)
        First interval of each step.
    lengths : ndarray, shape (J,)
        Durations, s.
    pulls : ndarray, shape (J, 2, 3, p)
        A.
    rates : ndarray, shape (J, 2, p)
        u / L, 1/s.
    gradients : ndarray, shape (J, 3, 3)
        G, in the middle.
    """

    begins: IndexArray
    lengths: Array
    pulls: Array
    rates: Array
    gradients: Array


class _Work(NamedTuple):
    """Responses at the end of a step to v and x at the end of an interval, and to v and x at a node, shape (6, 3).

    Attributes
    ----------
    to_processes : ndarray, shape (2, p, 6)
        To the processes at the nodes, per second.
    node : ndarray, shape (7,)
        Response at a node, with that of the process.
    """

    of_v: Array
    of_x: Array
    along: Array
    apart: Array
    to_processes: Array
    node: Array


def respond_to_gravity(truth: Truth, times: Array, gravity: GravityDisturbance) -> GravityResponses:
    """Compute the responses over the steps between rising times, shape (K + 1,) s."""
    steps, lengths = len(times) - 1, gravity.lengths
    count = len(lengths)
    responses = GravityResponses(
        np.zeros((steps, count, 6)), np.zeros((steps, count)), np.zeros((steps, count, 7, 7))
    )  # fmt: skip
    if not count:
        return responses
    fastest = max(truth.fastest, 1e-3)
    bounds = intervals_of(truth, times, min(LONGEST_INTERVAL, SHARE_OF_CORRELATION * float(lengths.min()) / fastest))
    durations = np.diff(bounds)
    nodes = np.stack([bounds[:-1] + NODE * durations, bounds[1:] - NODE * durations], axis=1).ravel()
    middles = 0.5 * (bounds[:-1] + bounds[1:])
    to_inertial = truth.earth.turned(middles - truth.times[0])
    position = np.einsum("nij,nj->ni", to_inertial, truth.earth_fixed(middles)[0])
    path = _Path(
        np.searchsorted(bounds, times), durations, disturbed_acceleration(truth, nodes).reshape(-1, 2, 3, count),
        (speed(truth, nodes)[:, None] / lengths).reshape(-1, 2, count), truth.earth.gravity_gradient(position),
    )  # fmt: skip
    of_v, of_x, along, apart = np.zeros((4, 6, 3))
    work = _Work(of_v, of_x, along, apart, np.zeros((2, count, 6)), np.zeros(7))
    _respond(path, work, responses)
    return responses


@compiled
def _respond(path: _Path, work: _Work, out: GravityResponses) -> None:
    """Go through the intervals of each step from the last to the first."""
    count = path.rates.shape[2]
    for k in range(len(path.begins) - 1):
        # at the step's end: v and x to themselves, and nothing of the processes is lost
        for r in range(6):
            for m in range(3):
                work.of_v[r, m] = 1.0 if r == m else 0.0
                work.of_x[r, m] = 1.0 if r == 3 + m else 0.0
        for p in range(count):
            out.decay[k, p] = 1.0
        for j in range(path.begins[k + 1] - 1, path.begins[k] - 1, -1):
            h = path.lengths[j]
            # v' = A b: responses to the processes at the nodes
            for i in range(2):
                advance_motion(work.of_v, work.of_x, path.gradients[j], LATER[i] * h, work.along, work.apart)
                for p in range(count):
                    for r in range(6):
                        total = 0.0
                        for m in range(3):
                            total += work.along[r, m] * path.pulls[j, i, m, p]
                        work.to_processes[i, p, r] = total
            for p in range(count):
                _drive(h, path.rates[j, :, p], p, work, out.state[k, p], out.driven[k, p], out.decay[k])
            # back to the interval's beginning
            for r in range(6):
                for m in range(3):
                    work.along[r, m], work.apart[r, m] = work.of_v[r, m], work.of_x[r, m]
            advance_motion(work.along, work.apart, path.gradients[j], h, work.of_v, work.of_x)
        for p in range(count):
            for r in range(7):
                for c in range(r):
                    out.driven[k, p, c, r] = out.driven[k, p, r, c]


@allocation_free_part
def _drive(h: float, rates: Array, p: int, work: _Work, state: Array, driven: Array, decay: Array) -> None:
    """Take the response to a process back by one interval, with its noise.

    Parameters
    ----------
    rates : ndarray, shape (2,)
        At the nodes; they change evenly in between.
    state, driven : ndarray, shapes (6,), (7, 7)
        Of the process; of the covariance the lower triangle.
    decay : ndarray, shape (p,)
        From the end of the interval to that of the step.
    """
    weight, node, to_process = 0.5 * h, work.node, work.to_processes
    # distances in correlation lengths: over the interval, and from the nodes to its end
    whole = weight * (rates[0] + rates[1])
    first = h * (AHEAD[0][0] * rates[0] + AHEAD[0][1] * rates[1])
    second = h * (AHEAD[1][0] * rates[0] + AHEAD[1][1] * rates[1])
    for i in range(2):
        to_end = np.exp(-first) if i == 0 else np.exp(-second)
        early = 1.0 if i == 0 else np.exp(first - second)
        late = np.exp(second - first) if i == 0 else 1.0
        # through the accelerations from the node to the end, and through the process that is left there
        for r in range(6):
            pushed = AHEAD[i][0] * early * to_process[0, p, r] + AHEAD[i][1] * late * to_process[1, p, r]
            node[r] = to_end * state[r] + h * pushed
        node[6] = decay[p] * to_end
        # white noise of density 2 u / L
        density = 2.0 * rates[i] * weight
        for r in range(7):
            for c in range(r + 1):
                driven[r, c] += density * node[r] * node[c]
    # to the process at the beginning of the interval
    for r in range(6):
        pushed = np.exp(first - whole) * to_process[0, p, r] + np.exp(second - whole) * to_process[1, p, r]
        state[r] = np.exp(-whole) * state[r] + weight * pushed
    decay[p] *= np.exp(-whole)
