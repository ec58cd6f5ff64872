"""Navigation errors against time, for many samples: the ensemble kernel with stops at given epochs.

Between nodes the deviation is read out as at a node: c, with the remainders of the last four nodes in place of what the
final weights have not gathered yet, times the response at the epoch. Forces are integrated up to each epoch. Epochs do
not change the nodes, so the final errors are those of `simulate_ensemble` but for the intervals over which forces are
summed. The approximation costs up to 1e-3 of an epoch's sigma with the nodes that a campaign's final errors need (in
the first intervals, and where the flight ends fast), and under 1e-4 with half as many again; at nine epochs in ten it
costs less than 1e-5.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.compiled.jit import compiled, reduced_math
from mcnav.compiled.lanes import SMALLEST_COMPONENT
from mcnav.compiled.shapes import check_shape
from mcnav.contract.power_sums import PowerSums, sums_of
from mcnav.systems.reentry.ensemble.grid import (
    force_moments,
    interval_weights,
    node_tables,
    orbit_nodes,
    product_quadrature,
    stand_ins,
)
from mcnav.systems.reentry.ensemble.kernel import (
    BIAS_X,
    BIAS_Z,
    COMPONENT,
    EAST_1,
    EAST_2,
    EAST_3,
    EAST_4,
    LANES,
    REPORT_ROWS,
    ROWS,
    UP_1,
    UP_2,
    UP_3,
    UP_4,
    convert,
    load,
    push_by_force,
    push_by_gravity,
)
from mcnav.systems.reentry.ensemble.transition import Response
from mcnav.systems.reentry.instruments import Error
from mcnav.systems.reentry.outputs import SCALE

SUMS: Final = sums_of(4)
"""Power sums of an epoch: 4 first, 10 second (by rows of the upper triangle), 4 third and 4 fourth."""


class HistoryGrid(NamedTuple):
    """A shared grid with epochs: n nodes and m epochs make n + m stops in order of time.

    Attributes
    ----------
    readout, recent, weights : ndarray
        Of the nodes, as in `mcnav.systems.reentry.ensemble.grid.Grid`.
    epoch : ndarray of int, shape (n + m,)
        Which epoch a stop is, or -1 for a node.
    forced, middles, moments : ndarray
        Of the interval before each stop, as in `mcnav.systems.reentry.ensemble.grid.Grid`.
    response : ndarray, shape (m, 4, 6)
        Deviation and its rates, east and up, from c and the biases.
    remembered : ndarray, shape (m, 4, 4, 2)
        The same from the remainders at the last four nodes, the latest first.
    first : ndarray, shape (4,)
        Reference at the start, as in `mcnav.systems.reentry.ensemble.transition.Response`.
    reference, nominal : ndarray, shape (m, 4)
        Polar states of the reference, and the same less those of the truth.
    """

    readout: Array
    recent: Array
    weights: Array
    epoch: NDArray[np.int_]
    forced: NDArray[np.bool_]
    middles: Array
    moments: Array
    response: Array
    remembered: Array
    first: Array
    reference: Array
    nominal: Array


def history_grid(response: Response, count: int, epochs: Array) -> HistoryGrid:
    """Tabulate nodes, epochs and weights.

    Parameters
    ----------
    response : Response
        From the start of navigation to the end.
    count : int
        Number of nodes, at least those that final errors need:
        `mcnav.systems.reentry.ensemble.refinement.Refinement.nodes`.
    epochs : ndarray, shape (m,)
        Rising times from the start of navigation to the end, s from the first point of the truth.

    Raises
    ------
    ValueError
        When an epoch lies outside the flight or before its predecessor.
    """
    if np.any(np.diff(epochs) < 0.0) or epochs[0] < response.start or epochs[-1] > response.end:
        raise ValueError(
            f"epochs must rise from {response.start:g} s to {response.end:g} s; got {epochs[0]:g} s to {epochs[-1]:g} s"
        )
    nodes = orbit_nodes(response, count)
    stops = np.concatenate([epochs, nodes])
    order = np.argsort(stops, kind="stable")  # an epoch comes before a node of the same time
    quadrature = product_quadrature(response, stops)
    at_epochs, reference, nominal = response.deviations(epochs)
    stand_in = stand_ins(response.end, nodes, epochs, quadrature, interval_weights(nodes, quadrature))
    return HistoryGrid(
        *node_tables(response, nodes, quadrature),
        np.where(order < len(epochs), order, -1),
        *force_moments(response, stops[order], quadrature),
        np.ascontiguousarray(at_epochs),
        np.ascontiguousarray(np.einsum("nac,npcb->napb", at_epochs[:, :, :4], stand_in)),
        response.first,
        np.ascontiguousarray(reference),
        np.ascontiguousarray(nominal),
    )


@compiled
def _read_out(block: Array, response: Array, remembered: Array, report: Array) -> None:
    """Write the deviation at an epoch and its rates, east and up, into the first four rows of a report."""
    for row in range(4):
        # delta = M c + N U, and what the last four remainders add that no weight has gathered yet
        m0, m1, m2, m3, n0, n1 = response[row]
        (e1, u1), (e2, u2), (e3, u3), (e4, u4) = remembered[row]
        for i in range(LANES):
            report[row * LANES + i] = (
                m0 * block[i] + m1 * block[LANES + i] + m2 * block[2 * LANES + i] + m3 * block[3 * LANES + i]
                + n0 * block[BIAS_X + i] + n1 * block[BIAS_Z + i]
                + e1 * block[EAST_1 + i] + u1 * block[UP_1 + i] + e2 * block[EAST_2 + i] + u2 * block[UP_2 + i]
                + e3 * block[EAST_3 + i] + u3 * block[UP_3 + i] + e4 * block[EAST_4 + i] + u4 * block[UP_4 + i]
            )  # fmt: skip
    for i in range(LANES):
        report[4 * LANES + i] = block[COMPONENT + i]


@compiled
def _store(report: Array, outcome: Array) -> None:
    for lane in range(outcome.shape[0]):
        for output in range(4):
            outcome[lane, output] = report[output * LANES + lane]


@reduced_math
def _add_powers(report: Array, count: int, pivot: Array, sums: Array) -> None:
    """Add powers and products of the first lanes' errors, less a pivot, to the sums of one epoch."""
    p0, p1, p2, p3 = pivot
    s0 = s1 = s2 = s3 = 0.0
    s00 = s01 = s02 = s03 = s11 = s12 = s13 = s22 = s23 = s33 = 0.0
    c0 = c1 = c2 = c3 = f0 = f1 = f2 = f3 = 0.0
    for i in range(count):
        a, b = report[i] - p0, report[LANES + i] - p1
        c, d = report[2 * LANES + i] - p2, report[3 * LANES + i] - p3
        # sums, products of two, third and fourth powers
        aa, bb, cc, dd = a * a, b * b, c * c, d * d
        s0, s1, s2, s3 = s0 + a, s1 + b, s2 + c, s3 + d
        s00, s01, s02, s03 = s00 + aa, s01 + a * b, s02 + a * c, s03 + a * d
        s11, s12, s13, s22, s23, s33 = s11 + bb, s12 + b * c, s13 + b * d, s22 + cc, s23 + c * d, s33 + dd
        c0, c1, c2, c3 = c0 + aa * a, c1 + bb * b, c2 + cc * c, c3 + dd * d
        f0, f1, f2, f3 = f0 + aa * aa, f1 + bb * bb, f2 + cc * cc, f3 + dd * dd
    for place, value in enumerate(
        (s0, s1, s2, s3, s00, s01, s02, s03, s11, s12, s13, s22, s23, s33, c0, c1, c2, c3, f0, f1, f2, f3)
    ):
        sums[place] += value


@compiled
def _simulate(errors: Array, grid: HistoryGrid, pivot: Array, stored: Array, sums: Array, component: Array) -> None:
    """Simulate samples; store each epoch's errors where there is room, add their powers where there is none."""
    block, report = np.empty(ROWS * LANES), np.empty(REPORT_ROWS * LANES)
    for begin in range(0, errors.shape[0], LANES):
        end = min(begin + LANES, errors.shape[0])
        load(block, errors[begin:end], grid.first)
        node = 0
        for stop in range(len(grid.epoch)):
            if grid.forced[stop]:
                push_by_force(block, float(grid.middles[stop]), grid.moments[stop])
            epoch = grid.epoch[stop]
            if epoch < 0:
                push_by_gravity(block, grid.readout[node], grid.recent[node], grid.weights[node])
                node += 1
                continue
            _read_out(block, grid.response[epoch], grid.remembered[epoch], report)
            convert(report, grid.reference[epoch], grid.nominal[epoch])
            if len(stored) > 0:
                _store(report, stored[begin:end, epoch])
            else:
                _add_powers(report, end - begin, pivot[epoch], sums[epoch])
            for i in range(LANES):
                block[COMPONENT + i] = report[4 * LANES + i]
        for lane in range(begin, end):
            component[lane] = block[COMPONENT + lane - begin]


def nominal_errors(grid: HistoryGrid) -> Array:
    """Compute the navigation errors of a perfect system at the epochs, shape (m, 4), m and m/s."""
    return np.asarray(grid.nominal * SCALE)


def simulate_histories(grid: HistoryGrid, errors: Array) -> tuple[Array, Array]:
    """Simulate samples: their navigation errors at every epoch.

    Parameters
    ----------
    errors : ndarray, shape (n, sources)
        As for `mcnav.systems.reentry.ensemble.kernel.simulate_ensemble`.

    Returns
    -------
    histories : ndarray, shape (n, m, 4)
        Altitude, range, altitude rate, range rate: m, m/s (NASA TN D-1772, eq. 10).
    component : ndarray, shape (n,)
        Smallest component of the indicated position along the reference until the last stop: a sample below
        `mcnav.compiled.lanes.SMALLEST_COMPONENT` has left the kernel's validity.
    """
    errors = np.ascontiguousarray(errors, dtype=float)
    check_shape("errors", errors, (None, len(Error)))
    stored, component = np.empty((len(errors), len(grid.reference), 4)), np.empty(len(errors))
    _simulate(errors, grid, nominal_errors(grid), stored, np.empty((0, SUMS)), component)
    return stored, component


def history_sums(grid: HistoryGrid, errors: Array) -> PowerSums:
    """Add up power sums of samples' errors at every epoch; no sample is stored.

    Parameters
    ----------
    errors : ndarray, shape (n, sources)
        A sample that leaves the kernel's validity (`followed`) is left out at every epoch.
    """
    errors = np.ascontiguousarray(errors, dtype=float)
    check_shape("errors", errors, (None, len(Error)))
    pivot, none = nominal_errors(grid), np.empty((0, 0, 4))
    while True:
        sums, component = np.zeros((len(grid.reference), SUMS)), np.empty(len(errors))
        _simulate(errors, grid, pivot, none, sums, component)
        valid = followed_samples(component)
        if valid.all():
            return PowerSums(len(errors), pivot, sums)
        errors = errors[valid]


def followed_samples(component: Array) -> NDArray[np.bool_]:
    """Select the samples that stayed within the kernel's validity, by the component of `simulate_histories`."""
    return np.asarray(component >= SMALLEST_COMPONENT)  # false for NaN
