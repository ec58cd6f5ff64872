"""The ensemble kernel: the navigator by variation of constants, thousands of samples along one shared truth.

The truth does not depend on the navigation errors. In cartesian inertial axes the navigator of NASA TN D-1772,
eqs. (5)-(9), is ``r_i'' = -mu r_i / |r_i|^3 + m``, where the measured force ``m`` of a sample depends on time and on
its equipment errors alone. The deviation ``delta`` from the flight of a perfect navigator therefore obeys

    delta'' = G delta + [g(r + delta) - g(r) - G delta] + (m - f),

Encke's form with its linear part split off. That part is the same for all samples: with the transition matrix M and the
bias response N of `mcnav.systems.reentry.ensemble.transition`, ``delta = M c + N U`` and

    c' = M^-1 [0; gravity remainder + force error].

``c`` is the start deviation that would have led here under linear gravity: constant but for the force error, which is
known beforehand but for two slow factors, and the gravity remainder, which is of second order and smooth. So the steps
are long (some 50 for a flight of 80 minutes), their weights (`mcnav.systems.reentry.ensemble.grid`) are shared, and
each node costs one evaluation of the remainder. No errors give exactly zero.

Samples go through the kernel in blocks of `LANES`, held in one flat array ``row * LANES + lane``, so that each
statement of the inner loops is one vector operation and nothing is allocated.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.compiled.jit import compiled
from mcnav.compiled.lanes import SMALLEST_COMPONENT, angle_of_half, gravity_remainder, half_turn
from mcnav.compiled.shapes import check_shape
from mcnav.physics.constants import EARTH_RADIUS
from mcnav.systems.reentry.ensemble.grid import MEMORY, Grid
from mcnav.systems.reentry.instruments import Error

LANES: Final = 128
"""Samples that go through the kernel side by side."""

ROWS: Final = len(Error) + 1 + 2 * MEMORY
"""Rows of a block: the errors in the order of `Error`, with c in place of the initial conditions and the biases times
1 + S; the smallest component of the indicated position so far; the remainders east and up at the last four nodes, the
latest first."""

MISALIGNMENT: Final = LANES * Error.MISALIGNMENT
GYRO_DRIFT: Final = LANES * Error.GYRO_DRIFT
BIAS_X: Final = LANES * Error.BIAS_X
BIAS_Z: Final = LANES * Error.BIAS_Z
SCALE_FACTOR_X: Final = LANES * Error.SCALE_FACTOR_X
SCALE_FACTOR_Z: Final = LANES * Error.SCALE_FACTOR_Z
CROSS_AXIS_X: Final = LANES * Error.CROSS_AXIS_X
CROSS_AXIS_Z: Final = LANES * Error.CROSS_AXIS_Z
COMPONENT: Final = LANES * len(Error)
EAST_1, UP_1, EAST_2, UP_2, EAST_3, UP_3, EAST_4, UP_4 = (COMPONENT + LANES * row for row in range(1, 1 + 2 * MEMORY))
"""First lane of these rows."""

REPORT_ROWS: Final = 5
"""Rows of a report: see `convert`."""


@compiled
def load(block: Array, errors: Array, first: Array) -> None:
    """Fill a block from errors (n <= LANES, sources) at the first state; lanes beyond n fly without errors."""
    radius, angle, radius_rate, angle_rate = first
    speed, inverse = radius * angle_rate, 1.0 / radius
    east_x, east_y = np.cos(angle), -np.sin(angle)  # up is (-east_y, east_x)
    block[:] = 0.0
    for source in range(errors.shape[1]):
        for lane in range(errors.shape[0]):
            block[source * LANES + lane] = errors[lane, source]
    for i in range(LANES):
        altitude, shift = block[i], block[LANES + i] * inverse
        altitude_rate, shift_rate = block[2 * LANES + i], block[3 * LANES + i] * inverse
        # errors in the indicated position's axes (TN D-1772, eq. 10), of which the versine is 1 - cos
        sine_half, cosine_half = half_turn(shift)
        sine, versine = 2.0 * sine_half * cosine_half, 2.0 * sine_half * sine_half
        faster = radius * shift_rate + altitude * (angle_rate + shift_rate)
        # along the axes at the actual position: the indicated ones are turned by the shift
        east = altitude * sine + radius * sine
        up = altitude - altitude * versine - radius * versine
        faster_east = altitude_rate * sine + radius_rate * sine + faster - faster * versine - speed * versine
        faster_up = altitude_rate - altitude_rate * versine - radius_rate * versine - faster * sine - speed * sine
        # along X and Y, and the biases U (1 + S)
        block[i] = east * east_x - up * east_y
        block[LANES + i] = east * east_y + up * east_x
        block[2 * LANES + i] = faster_east * east_x - faster_up * east_y
        block[3 * LANES + i] = faster_east * east_y + faster_up * east_x
        block[BIAS_X + i] *= 1.0 + block[SCALE_FACTOR_X + i]
        block[BIAS_Z + i] *= 1.0 + block[SCALE_FACTOR_Z + i]
        # a start farther round than a right angle would come out wrapped
        block[COMPONENT + i] = (1.0 + altitude * inverse) * (1.0 - versine) if np.abs(shift) < 0.5 * np.pi else -1.0


@compiled
def push_by_force(block: Array, middle: float, moments: Array) -> None:
    """Add the force error of one interval to c: NASA TN D-1772, eqs. (6)-(8), less the biases.

    Along the reference axes X and Z the error is ``f_X A_x + f_Z B_x`` and ``f_Z A_z - f_X B_z`` with the turn ``a`` of
    the platform in ``A = (1 + S) cos(a) - 1 -+ K sin(a)`` and ``B = (1 + S) sin(a) +- K cos(a)``, upper signs for x.
    Biases, ``U (1 + S)``, are read out.
    """
    value, slope, curvature = moments
    (p00, p01, p02, p03), (p10, p11, p12, p13), (p20, p21, p22, p23), (p30, p31, p32, p33) = value
    (q00, q01, q02, q03), (q10, q11, q12, q13), (q20, q21, q22, q23), (q30, q31, q32, q33) = slope
    (r00, r01, r02, r03), (r10, r11, r12, r13), (r20, r21, r22, r23), (r30, r31, r32, r33) = curvature
    for i in range(LANES):
        drift, scale_x, scale_z = block[GYRO_DRIFT + i], block[SCALE_FACTOR_X + i], block[SCALE_FACTOR_Z + i]
        # turn of the platform in the interval's middle: a = m + d t; A_x - 1, B_x, A_z - 1, B_z
        sine_half, cosine_half = half_turn(block[MISALIGNMENT + i] + drift * middle)
        sine, versine = 2.0 * sine_half * cosine_half, 2.0 * sine_half * sine_half
        cosine, cross_x, cross_z = 1.0 - versine, block[CROSS_AXIS_X + i], block[CROSS_AXIS_Z + i]
        a = scale_x - versine - scale_x * versine - cross_x * sine
        b = sine + scale_x * sine + cross_x * cosine
        d = scale_z - versine - scale_z * versine + cross_z * sine
        c = sine + scale_z * sine - cross_z * cosine
        # their first and second derivatives with respect to time
        a1, b1, c1, d1 = -drift * b, drift + drift * a, drift + drift * d, -drift * c
        a2, b2, c2, d2 = -drift * b1, drift * a1, drift * d1, -drift * c1
        # c' = integral of M^-1 [0; force error]: moments of the force, times value, slope and curvature
        block[i] += (
            p00 * a + p01 * b + p02 * c + p03 * d + q00 * a1 + q01 * b1 + q02 * c1 + q03 * d1
            + r00 * a2 + r01 * b2 + r02 * c2 + r03 * d2
        )  # fmt: skip
        block[LANES + i] += (
            p10 * a + p11 * b + p12 * c + p13 * d + q10 * a1 + q11 * b1 + q12 * c1 + q13 * d1
            + r10 * a2 + r11 * b2 + r12 * c2 + r13 * d2
        )  # fmt: skip
        block[2 * LANES + i] += (
            p20 * a + p21 * b + p22 * c + p23 * d + q20 * a1 + q21 * b1 + q22 * c1 + q23 * d1
            + r20 * a2 + r21 * b2 + r22 * c2 + r23 * d2
        )  # fmt: skip
        block[3 * LANES + i] += (
            p30 * a + p31 * b + p32 * c + p33 * d + q30 * a1 + q31 * b1 + q32 * c1 + q33 * d1
            + r30 * a2 + r31 * b2 + r32 * c2 + r33 * d2
        )  # fmt: skip


@compiled
def push_by_gravity(block: Array, readout: Array, recent: Array, weights: Array) -> None:
    """Add the gravity remainder at one node to c and remember it.

    The constants are taken out of their tables first, and the remembered rows move on by one node: with rows known
    beforehand the compiler sees that lanes do not touch each other.
    """
    (m00, m01, m02, m03, n00, n01), (m10, m11, m12, m13, n10, n11) = readout
    (ee1, eu1), (ee2, eu2), (ee3, eu3), (ee4, eu4) = recent[0]
    (ue1, uu1), (ue2, uu2), (ue3, uu3), (ue4, uu4) = recent[1]
    (we0, wu0), (we1, wu1), (we2, wu2), (we3, wu3) = weights
    for i in range(LANES):
        # deviation at the node as a share of the radius: M c + N U, with what recent remainders add
        c0, c1, c2, c3 = block[i], block[LANES + i], block[2 * LANES + i], block[3 * LANES + i]
        u, w = block[BIAS_X + i], block[BIAS_Z + i]
        e1, v1, e2, v2 = block[EAST_1 + i], block[UP_1 + i], block[EAST_2 + i], block[UP_2 + i]
        e3, v3, e4, v4 = block[EAST_3 + i], block[UP_3 + i], block[EAST_4 + i], block[UP_4 + i]
        east = (
            m00 * c0 + m01 * c1 + m02 * c2 + m03 * c3 + n00 * u + n01 * w
            + ee1 * e1 + eu1 * v1 + ee2 * e2 + eu2 * v2 + ee3 * e3 + eu3 * v3 + ee4 * e4 + eu4 * v4
        )  # fmt: skip
        up = (
            m10 * c0 + m11 * c1 + m12 * c2 + m13 * c3 + n10 * u + n11 * w
            + ue1 * e1 + uu1 * v1 + ue2 * e2 + uu2 * v2 + ue3 * e3 + uu3 * v3 + ue4 * e4 + uu4 * v4
        )  # fmt: skip
        # c += weights times the remainder of gravity there
        e0, v0 = gravity_remainder(east, up)
        block[i] = c0 + we0 * e0 + wu0 * v0
        block[LANES + i] = c1 + we1 * e0 + wu1 * v0
        block[2 * LANES + i] = c2 + we2 * e0 + wu2 * v0
        block[3 * LANES + i] = c3 + we3 * e0 + wu3 * v0
        block[COMPONENT + i] = min(block[COMPONENT + i], 1.0 + up)
        # the four latest remainders move on
        block[EAST_1 + i], block[UP_1 + i], block[EAST_2 + i], block[UP_2 + i] = e0, v0, e1, v1
        block[EAST_3 + i], block[UP_3 + i], block[EAST_4 + i], block[UP_4 + i] = e2, v2, e3, v3


@compiled
def _arrive(block: Array, final: Array, report: Array) -> None:
    """Write the deviation at the end, for `convert`, into a report."""
    for row in range(4):
        # delta = M c + N U at the end
        m0, m1, m2, m3, n0, n1 = final[row]
        for i in range(LANES):
            report[row * LANES + i] = (
                m0 * block[i] + m1 * block[LANES + i] + m2 * block[2 * LANES + i] + m3 * block[3 * LANES + i]
                + n0 * block[BIAS_X + i] + n1 * block[BIAS_Z + i]
            )  # fmt: skip
    for i in range(LANES):
        report[4 * LANES + i] = block[COMPONENT + i]


@compiled
def convert(report: Array, reference: Array, nominal: Array) -> None:
    """Turn deviations from a polar state into navigation errors (NASA TN D-1772, eq. 10), without cancellation.

    Rows 0-3 of the report: deviation east and up and its rates, which become altitude, range, altitude rate and range
    rate; row 4: smallest component of the indicated position so far.
    """
    radius, _, radius_rate, angle_rate = reference
    missed_radius, missed_angle, missed_radius_rate, missed_angle_rate = nominal
    speed, inverse = radius * angle_rate, 1.0 / radius
    for i in range(LANES):
        # altitude: r (sqrt(1 + q) - 1), with 1 + q the square of the indicated radius over r
        east, up = report[i] * inverse, report[LANES + i] * inverse
        faster_east, faster_up = report[2 * LANES + i], report[3 * LANES + i]
        q = up * (2.0 + up) + east * east
        root = np.sqrt(np.abs(1.0 + q))
        further = 1.0 + root
        along = further + up
        product = 1.0 / (root * further * along)  # one division for three
        inverse_root = product * further * along
        altitude = radius * q * (product * root * along)
        # range: the angle between indicated and reference position
        tangent = east * (product * root * further)  # of half the angle between indicated and reference position
        sine, cosine = east * inverse_root, (1.0 + up) * inverse_root
        versine = sine * tangent
        # rates along and across the indicated vertical
        across = faster_east * cosine - faster_up * sine - speed * versine - radius_rate * sine
        radius_rate_error = faster_up * cosine + faster_east * sine + speed * sine - radius_rate * versine
        slip = across - altitude * angle_rate
        report[i] = altitude + missed_radius
        report[LANES + i] = EARTH_RADIUS * (angle_of_half(tangent) + missed_angle)
        report[2 * LANES + i] = radius_rate_error + missed_radius_rate
        report[3 * LANES + i] = EARTH_RADIUS * (slip * inverse * inverse_root + missed_angle_rate)
        report[4 * LANES + i] = min(report[4 * LANES + i], 1.0 + up)


@compiled
def _store(report: Array, outcome: Array, component: Array) -> None:
    """Write the outcomes of the lanes that carry samples."""
    for lane in range(outcome.shape[0]):
        for output in range(4):
            outcome[lane, output] = report[output * LANES + lane]
        component[lane] = report[4 * LANES + lane]


@compiled
def _simulate(errors: Array, grid: Grid, outcome: Array, component: Array) -> None:
    block, report = np.empty(ROWS * LANES), np.empty(REPORT_ROWS * LANES)
    nodes = grid.readout.shape[0]
    for begin in range(0, errors.shape[0], LANES):
        end = min(begin + LANES, errors.shape[0])
        load(block, errors[begin:end], grid.first)
        for node in range(nodes):
            if grid.forced[node]:
                push_by_force(block, float(grid.middles[node]), grid.moments[node])
            push_by_gravity(block, grid.readout[node], grid.recent[node], grid.weights[node])
        if grid.forced[nodes]:
            push_by_force(block, float(grid.middles[nodes]), grid.moments[nodes])
        _arrive(block, grid.final, report)
        convert(report, grid.last, grid.nominal)
        _store(report, outcome[begin:end], component[begin:end])


def simulate_ensemble(grid: Grid, errors: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Simulate many samples: their final navigation errors.

    Parameters
    ----------
    grid : Grid
        The shared truth.
    errors : ndarray, shape (n, sources)
        In the order of `mcnav.systems.reentry.instruments.Error`: m, m/s, rad, rad/s, m/s^2, dimensionless.

    Returns
    -------
    outcome : ndarray, shape (n, 4)
        Altitude, range, altitude rate, range rate: m, m/s.
    valid : ndarray of bool, shape (n,)
        False for a sample that came within `SMALLEST_COMPONENT` or is not finite: fly it on the reference path.
    """
    errors = np.ascontiguousarray(errors, dtype=float)
    check_shape("errors", errors, (None, len(Error)))
    outcome, component = np.empty((len(errors), 4)), np.empty(len(errors))
    _simulate(errors, grid, outcome, component)
    return outcome, (component >= SMALLEST_COMPONENT) & np.isfinite(outcome).all(axis=1)
