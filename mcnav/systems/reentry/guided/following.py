"""A lift law that follows the nominal flight to its landing site.

The independent variable is the range angle theta: at the landing site's, the altitude should be the final one. With the
deviations z = (r, r', r_E theta') less those of the nominal flight at the same range angle,

    L/D = L/D_ref(theta) + k(theta) . z,

which is a `FollowingLaw`. Where the gains are not given, they are those of a linear quadratic regulator: along the
nominal flight ``dz/dtheta = A z + B u`` with u = L/D - L/D_ref, and k = -(1/R) B^T S makes

    (miss / m)^2 + 1/(theta_f - theta_0) int (u / c)^2 dtheta

least: m is the size of a miss, in range, that weighs as much as a change c of L/D throughout. S obeys the Riccati
equation ``dS/dtheta = -A^T S - S A + S B B^T S / R`` backwards from the end, where the miss is ``-r_E theta' / r'``
times the deviation of r.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from mcnav.arrays.types import Array
from mcnav.physics.constants import EARTH_RADIUS
from mcnav.systems.reentry.guided.description import FollowingLaw
from mcnav.systems.reentry.truth import Phase, Trajectory, truth_rates

INTERVALS: Final = 48
"""Intervals between knots, at least: kinks of the nominal flight are knots, too."""

P_POWERS: Final = 8
GAIN_POWERS: Final = 4
STEPS: Final = np.array([1.0, 1e-3, 1e-3])
"""Steps of the differences that linearize the flight: m, m/s, m/s."""


@dataclass(frozen=True)
class Gains:
    """Gains by altitude (1/m), altitude rate (s/m) and range rate (s/m), the same throughout."""

    altitude: float
    altitude_rate: float
    range_rate: float


@dataclass(frozen=True)
class Weights:
    """Weights of the regulator: a miss (m) that weighs as much as a change of L/D throughout."""

    miss: float = 1e3
    change: float = 0.1


@dataclass(frozen=True)
class Following:
    """A law that follows the nominal flight: largest L/D, and gains, or the weights of which they follow."""

    limit: float
    gains: Gains | Weights = Weights()


class NoMargin(ValueError):
    """The limit leaves the nominal flight no margin to be steered with; the message says so."""


def _time_at(trajectory: Trajectory, angle: float) -> float:
    """Find when the nominal flight passes a range angle, s."""
    end = trajectory.final_time
    if angle >= trajectory.state(end)[1]:
        return end
    return float(brentq(lambda time: float(trajectory.state(time)[1]) - angle, 0.0, end, xtol=1e-11))


def _reduced(state: Array) -> Array:
    """Return r, r' and r_E theta'."""
    return np.array([state[0], state[2], EARTH_RADIUS * state[3]])


def _by_angle(phase: Phase, z: Array, lift: float) -> Array:
    """Compute the rates of r, r' and r_E theta' by the range angle."""
    coefficients = phase.coefficients.copy()
    coefficients[5], coefficients[6] = lift, 0.0
    rates = truth_rates(0.0, np.array([z[0], 0.0, z[1], z[2] / EARTH_RADIUS]), coefficients)
    return np.asarray(_reduced(rates) * (EARTH_RADIUS / z[2]))


def _lift(phase: Phase, radius_rate: float) -> float:
    return float(phase.coefficients[5] + phase.coefficients[6] * radius_rate)


def _linearized(trajectory: Trajectory, time: float) -> tuple[Array, Array]:
    """Compute A, shape (3, 3), and B, shape (3,), at a time of the nominal flight."""
    phase, z = trajectory.phase_at(time), _reduced(trajectory.state(time))
    lift = _lift(phase, z[1])
    columns = [
        (_by_angle(phase, z + step, lift) - _by_angle(phase, z - step, lift)) / (2.0 * step.sum())
        for step in np.diag(STEPS)
    ]
    by_lift = 0.5 * (_by_angle(phase, z, lift + 1.0) - _by_angle(phase, z, lift - 1.0))
    return np.stack(columns, axis=1), by_lift


def _regulate(trajectory: Trajectory, weights: Weights, angles: Array) -> Array:
    """Solve the Riccati equation: the gains k at rising range angles, the last at the end, shape (n, 3)."""
    begin, end = float(angles[0]), float(angles[-1])
    final = trajectory.state(trajectory.final_time)
    miss = np.array([-EARTH_RADIUS * final[3] / final[2], 0.0, 0.0]) / weights.miss
    effort = 1.0 / (weights.change**2 * (end - begin))

    def rates(angle: float, packed: Array) -> Array:
        cost = packed.reshape(3, 3)
        drift, by_lift = _linearized(trajectory, _time_at(trajectory, angle))
        pushed = cost @ by_lift
        return np.asarray((-drift.T @ cost - cost @ drift + np.outer(pushed, pushed) / effort).ravel())

    start = np.outer(miss, miss).ravel()
    solution = solve_ivp(rates, (end, begin), start, "LSODA", angles[::-1], rtol=1e-6, atol=1e-12)
    if solution.status != 0:
        raise ArithmeticError(f"the Riccati equation broke down: {solution.message}")
    costs = solution.y.T[::-1].reshape(-1, 3, 3)
    by_lift = [_linearized(trajectory, _time_at(trajectory, float(angle)))[1] for angle in angles]
    return np.asarray([-(cost @ push) / effort for cost, push in zip(costs, by_lift, strict=True)])


def _knots(trajectory: Trajectory) -> Array:
    """Return range angles from reentry to the end: kinks of the nominal flight, and evenly spaced between them."""
    begin = trajectory.reentry_time
    kinks = [begin, *(phase.end for phase in trajectory.phases if phase.end > begin + 1e-6)]
    angles = [float(trajectory.state(time)[1]) for time in kinks]
    longest = (angles[-1] - angles[0]) / INTERVALS
    parts = [np.linspace(a, b, 1 + max(1, int(np.ceil((b - a) / longest))))[:-1] for a, b in pairwise(angles) if b > a]
    return np.append(np.concatenate(parts), angles[-1])


def _hermite(values: Array, slopes: Array, lengths: Array) -> Array:
    """Return cubic polynomials with given values and slopes at their ends, shape (n, 3, 4), by rising powers."""
    length, rise = lengths[:, None], np.diff(values, axis=0)
    begin, end = slopes[:-1], slopes[1:]
    square = (3.0 * rise - (2.0 * begin + end) * length) / length**2
    cube = (-2.0 * rise + (begin + end) * length) / length**3
    return np.stack([values[:-1], begin, square, cube], axis=2)


def follow(trajectory: Trajectory, following: Following) -> FollowingLaw:
    """Make the law that follows a nominal flight from its reentry on.

    Raises `NoMargin` when the limit is not above the nominal flight's largest L/D.
    """
    knots = _knots(trajectory)
    lengths = np.diff(knots)
    if isinstance(following.gains, Weights):
        gains = _regulate(trajectory, following.gains, knots)
    else:
        given = following.gains
        gains = np.tile([given.altitude, given.altitude_rate, given.range_rate], (len(knots), 1))
    cubics = _hermite(gains, np.gradient(gains, knots, axis=0), lengths)
    offsets, largest = _offsets(trajectory, knots, cubics)
    if following.limit <= largest * (1.0 + 1e-9):
        raise NoMargin(
            f"got {following.limit:g}; the nominal flight itself has a lift-to-drag ratio of up to {largest:.4g}, "
            "and a law that follows it needs more"
        )
    polynomials = np.zeros((len(lengths), 4, P_POWERS))
    polynomials[:, 0], polynomials[:, 1:, :GAIN_POWERS] = offsets, cubics
    lift = _lift(trajectory.phase_at(trajectory.reentry_time), trajectory.state(trajectory.reentry_time)[2])
    return FollowingLaw(knots, polynomials, following.limit, lift)


def _offsets(trajectory: Trajectory, knots: Array, cubics: Array) -> tuple[Array, float]:
    """Fit L/D_ref less the gains times the nominal states, shape (n, P_POWERS); return the largest L/D_ref, too."""
    lengths, largest = np.diff(knots), 0.0
    offsets = np.zeros((len(lengths), P_POWERS))
    points = 0.5 - 0.5 * np.cos(np.pi * np.arange(2 * P_POWERS) / (2 * P_POWERS - 1))
    for number, (begin, length) in enumerate(zip(knots[:-1].tolist(), lengths.tolist(), strict=True)):
        middle = trajectory.phase_at(_time_at(trajectory, begin + 0.5 * length))
        times = [_time_at(trajectory, begin + share * length) for share in points]
        states = np.array([_reduced(middle.solution(time)) for time in times])
        lift = np.array([_lift(middle, rate) for rate in states[:, 1]])
        largest = max(largest, float(np.abs(lift).max()))
        powers = (points[:, None] * length) ** np.arange(GAIN_POWERS)
        offset = lift - np.einsum("cm,pm,pc->p", cubics[number], powers, states)
        fitted = np.polynomial.Polynomial.fit(points * length, offset, P_POWERS - 1, domain=[0.0, length])
        coefficients = fitted.convert().coef
        offsets[number, : len(coefficients)] = coefficients
    return offsets, largest
