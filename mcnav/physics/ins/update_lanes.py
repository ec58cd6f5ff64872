"""Updates of aided samples, LANES at a time: measurements' errors, innovations, gates, and corrections."""

from __future__ import annotations

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.physics.ins.ensemble import LANES
from mcnav.physics.ins.measurements import (
    ALTITUDE,
    BODY_VELOCITY,
    HEADING,
    POSITION,
    VELOCITY,
    altitude_change,
    fill_row,
    heading_change,
    innovate,
)
from mcnav.physics.jit import compiled, uncontracted


@uncontracted
def rotation_vector(turn: Array, i: int, out: Array) -> None:
    """Compute the rotation vector of a quaternion."""
    b, c, e = turn[1, i], turn[2, i], turn[3, i]
    sine = np.sqrt(b * b + c * c + e * e)
    factor = 2.0
    if sine > 0.0:
        factor = 2.0 * np.arctan2(sine, turn[0, i]) / sine
    out[0], out[1], out[2] = factor * b, factor * c, factor * e


@compiled
def disturb(
    n: int, i: int, u: int, m: int, components: IndexArray, constant_rows: Array, aiding: Array, correlated: Array,
    memory: Array, white: Array, white_normals: Array, drift_normals: Array, drifts: Array, given: Array,
    disturbance: Array,
) -> None:  # fmt: skip
    """Compute the errors of an update's measurements: drawn, or given, and those of constant errors."""
    most = components.shape[1]
    for c in range(m):
        if given.shape[1] > 0:
            value = given[n, u * most + c]
        else:
            value = white[u, c] * white_normals[i, u * most + c]
            if correlated[u, c] > 0.0:
                at, kept = components[u, c], memory[u, c]
                driven = correlated[u, c] * np.sqrt(1.0 - kept * kept)
                drifts[at, i] = kept * drifts[at, i] + driven * drift_normals[i, u * most + c]
                value += drifts[at, i]
        for a in range(aiding.shape[1]):
            value -= constant_rows[u, c, a] * aiding[n, a]
        disturbance[c, i] = value


@compiled
def correct_twins(
    m: int, rows: Array, state_rows: Array, gains: Array, bounds: IndexArray, disturbance: Array, innovation: Array,
    twin: Array, estimate: Array,
) -> None:  # fmt: skip
    """Update the linear samples with the gains along the truth."""
    states = len(estimate)
    for c in range(m):
        for i in range(LANES):
            innovation[c, i] = -disturbance[c, i]
        for j in range(bounds[c, 0], bounds[c, 1]):
            weight = rows[c, j]
            for i in range(LANES):
                innovation[c, i] += weight * twin[j, i]
        for s in range(states):
            weight = state_rows[c, s]
            if weight != 0.0:
                for i in range(LANES):
                    innovation[c, i] -= weight * estimate[s, i]
    for c in range(m):
        for j in range(9):
            weight = gains[j, c]
            for i in range(LANES):
                twin[j, i] -= weight * innovation[c, i]
        for s in range(states):
            weight = gains[9 + s, c]
            for i in range(LANES):
                estimate[s, i] += weight * innovation[c, i]


@compiled
def _innovate_of_antenna(
    direction: Array, arm: Array, spin: float, of_velocity: bool, over: Array, z: Array, innovation: Array, full: Array
) -> None:
    """Compute what `innovate` and `fill_row` do for a position or a velocity, of all lanes at once.

    Parameters
    ----------
    innovation : ndarray, shape (LANES,)
    full : ndarray, shape (9, LANES)
    """
    dx, dy, dz = direction[0], direction[1], direction[2]
    first = 3 if of_velocity else 6
    for i in range(LANES):
        innovation[i] = dx * z[first, i] + dy * z[first + 1, i] + dz * z[first + 2, i]
        full[first, i], full[first + 1, i], full[first + 2, i] = dx, dy, dz
    if of_velocity:
        for i in range(LANES):
            innovation[i] += spin * (dx * z[7, i] - dy * z[6, i])
            full[6, i], full[7, i], full[8, i] = -spin * dy, spin * dx, 0.0
    ax, ay, az = arm[0], arm[1], arm[2]
    if ax == 0.0 and ay == 0.0 and az == 0.0:
        return
    if not of_velocity:
        for r in range(3, 6):
            for i in range(LANES):
                full[r, i] = 0.0
    for i in range(LANES):
        lx = over[0, i] * ax + over[1, i] * ay + over[2, i] * az
        ly = over[3, i] * ax + over[4, i] * ay + over[5, i] * az
        lz = over[6, i] * ax + over[7, i] * ay + over[8, i] * az
        innovation[i] += dx * lx + dy * ly + dz * lz
        full[0, i] = (ay + ly) * dz - (az + lz) * dy
        full[1, i] = (az + lz) * dx - (ax + lx) * dz
        full[2, i] = (ax + lx) * dy - (ay + ly) * dx


@compiled
def _innovate_lane(
    i: int, kind: int, constants: Array, direction: Array, arm: Array, forward: Array, place: Array, turn: Array,
    turns: Array, z: Array, innovation: Array, full: Array,
) -> None:  # fmt: skip
    """Compute the innovation of another component, and its response to errors, of one lane."""
    psi, velocity, away, there, row = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(9)
    over, turned = np.zeros((3, 3)), np.zeros((3, 3))
    spin = constants[3]
    rotation_vector(turn, i, psi)
    for r in range(3):
        for c in range(3):
            over[r, c] = turns[3 * r + c, i]
            turned[r, c] = over[r, c] + (1.0 if r == c else 0.0)
        velocity[r], away[r], there[r] = z[3 + r, i], z[6 + r, i], arm[r]
    if kind == BODY_VELOCITY:  # the navigator's own velocity over the earth
        there[0] += velocity[0] + spin * away[1]
        there[1] += velocity[1] - spin * away[0]
        there[2] += velocity[2]
    fill_row(kind, direction, there, spin, turned, row)
    for j in range(9):
        full[j, i] = row[j]
    if kind == ALTITUDE:
        innovation[i] = altitude_change(constants, place, away)
    elif kind == HEADING:
        innovation[i] = heading_change(forward, over, arm, away)
    else:
        innovation[i] = innovate(kind, direction, arm, spin, over, psi, velocity, away)


@compiled
def innovate_lanes(
    u: int, m: int, constants: Array, kinds: IndexArray, directions: Array, arms: Array, forward: Array, spots: Array,
    state_rows: Array, turn: Array, z: Array, estimate: Array, disturbance: Array, over: Array, innovation: Array,
    full: Array,
) -> None:  # fmt: skip
    """Compute the innovations of the samples and their responses to errors, about each sample's own attitude."""
    for i in range(LANES):
        a, b, c, e = turn[0, i], turn[1, i], turn[2, i], turn[3, i]
        over[0, i], over[4, i], over[8, i] = -2.0 * (c * c + e * e), -2.0 * (b * b + e * e), -2.0 * (b * b + c * c)
        over[1, i], over[2, i] = 2.0 * (b * c - a * e), 2.0 * (b * e + a * c)
        over[3, i], over[5, i] = 2.0 * (b * c + a * e), 2.0 * (c * e - a * b)
        over[6, i], over[7, i] = 2.0 * (b * e - a * c), 2.0 * (c * e + a * b)
    for q in range(m):
        kind = kinds[u, q]
        if kind in (POSITION, VELOCITY):
            _innovate_of_antenna(
                directions[u, q], arms[u, q], constants[3], kind == VELOCITY, over, z, innovation[q], full[q]
            )
        else:
            for i in range(LANES):
                _innovate_lane(
                    i, kind, constants, directions[u, q], arms[u, q], forward[u], spots[u], turn, over, z,
                    innovation[q], full[q],
                )  # fmt: skip
        for s in range(len(estimate)):
            weight = state_rows[u, q, s]
            if weight != 0.0:
                for i in range(LANES):
                    innovation[q, i] -= weight * estimate[s, i]
        for i in range(LANES):
            innovation[q, i] -= disturbance[q, i]


@compiled
def judge(
    m: int, limit: float, root: Array, innovation: Array, whitened: Array, before: Array, has_before: bool,
    tally: Array, accepted: Array,
) -> None:  # fmt: skip
    """Normalize the innovations of a sensor, count them, and accept or reject the measurement."""
    normalized = np.zeros(LANES)
    for c in range(m):
        for i in range(LANES):
            value = innovation[c, i]
            for e in range(c):
                value -= root[c, e, i] * whitened[e, i]
            whitened[c, i] = value / root[c, c, i]
            normalized[i] += whitened[c, i] * whitened[c, i]
    for i in range(LANES):
        accepted[i] = 1.0 if normalized[i] <= limit else 0.0
        tally[0, i] += normalized[i]
        tally[1, i] += accepted[i]
        tally[2, i] += 1.0 - accepted[i]
        if has_before:
            value = 0.0
            for c in range(m):
                value += whitened[c, i] * before[c, i]
            tally[3, i] += value / m
            tally[4, i] += 1.0
        for c in range(m):
            before[c, i] = whitened[c, i]


@compiled
def feed_back(m: int, gain: Array, innovation: Array, turn: Array, z: Array, estimate: Array) -> None:
    """Correct the navigators, and the estimates of the other states."""
    psi, velocity, away = np.zeros(3), np.zeros(3), np.zeros(3)
    for i in range(LANES):
        for r in range(3):
            psi[r] = velocity[r] = away[r] = 0.0
            for c in range(m):
                psi[r] += gain[r, c, i] * innovation[c, i]
                velocity[r] += gain[3 + r, c, i] * innovation[c, i]
                away[r] += gain[6 + r, c, i] * innovation[c, i]
        for r in range(3):
            z[3 + r, i] -= velocity[r]
            z[6 + r, i] -= away[r]
        angle = np.sqrt(psi[0] * psi[0] + psi[1] * psi[1] + psi[2] * psi[2])
        sine = -0.5
        if angle > 0.0:
            sine = -np.sin(0.5 * angle) / angle
        a, b, c, e = turn[0, i], turn[1, i], turn[2, i], turn[3, i]
        w, x, y, v = np.cos(0.5 * angle), sine * psi[0], sine * psi[1], sine * psi[2]
        turn[0, i] = w * a - (x * b + y * c + v * e)
        turn[1, i] = w * b + (x * a + y * e - v * c)
        turn[2, i] = w * c + (y * a + v * b - x * e)
        turn[3, i] = w * e + (v * a + x * c - y * b)
    for s in range(len(estimate)):
        for c in range(m):
            for i in range(LANES):
                estimate[s, i] += gain[9 + s, c, i] * innovation[c, i]
