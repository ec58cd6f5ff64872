"""One step of LANES samples: the response to the errors of their instruments, and the deviation from the truth.

A sample is the rotation from true to indicated axes, and deviations of velocity and position
(`mcnav.systems.ins.ensemble.free` has the equations). Vectors of lanes are handled in threes, as those of space are.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.blocks import Block
from mcnav.compiled.jit import allocation_free_part, allocation_free_subroutine, inlined, uncontracted_subroutine
from mcnav.compiled.lanes import gravity_shares
from mcnav.compiled.vectors import PARTS, Rooms, Vector, load, load_part, parts_of, room, store, store_part, where
from mcnav.systems.ins.earth import gravitation

LARGEST_TURN: Final = 0.5
"""Largest rotation by the gyros' errors within a step, rad: beyond it a sample leaves the engine's validity."""

SHORT: Final = 2.0
"""Longest step for `advance_short`, s: what gravity's gradient, 3e-6 1/s^2, makes of a step's growth is 1e-6 of it."""

SMALLEST_RADIUS: Final = 0.5
"""Smallest distance from the earth's centre, as a share of the earth's radius."""


class StepTables(NamedTuple):
    """Tables that samples share over K steps, as `mcnav.systems.ins.ensemble.free.EnsembleTables` has it.

    Attributes
    ----------
    inputs : ndarray, shape (K, p, 9)
        Of the constant errors that are not zero, those of the gyros first.
    gyros : int
        Number of these.
    factors : ndarray, shape (K, 9 + b, 9 + b) or (K, 9 + b, 6 + b)
    adjoint : ndarray, shape (K, 9, 9)
        As `mcnav.systems.ins.ensemble.adjoint.Adjoint` has it.
    """

    constants: Array
    durations: Array
    motion: Array
    force: Array
    thrust: Array
    inputs: Array
    gyros: int
    biases: Array
    decays: Array
    factors: Array
    places: Array
    fields: Array
    gradients: Array
    curvatures: Array
    adjoint: Array


class Deviations(NamedTuple):
    """Samples at the beginning of a step, and what it takes to its end; rows of lanes.

    Attributes
    ----------
    turn : ndarray, shape (4, LANES)
        Quaternion from true to indicated axes.
    moved : ndarray, shape (6, LANES)
        Deviations of velocity and position.
    linear : ndarray, shape (9, LANES)
        Linear errors of the outputs at the last epoch, from all that the sample has had so far.
    here, pull : ndarray, shape (3, LANES)
        Deviation of the position, and the change of gravitation by it beyond the linear one.
    errors, bias : ndarray, shapes (p, LANES), (b, LANES)
        Constant errors of the instruments, and biases of processes.
    response : ndarray, shape (9, LANES)
        Linear response of attitude, velocity and position to the errors of the instruments in the step.
    turned : ndarray, shape (9, LANES)
        R - I at the beginning of the step.
    sound : ndarray, shape (1, LANES)
        1 as long as a sample stays where the scheme holds, then 0.
    checked : ndarray, shape (2, LANES)
        Squares of a step's turn and of the distance from the earth's centre.
    following : ndarray, shape (6, LANES)
        Velocity and position at the end of a step without the remainder of gravity.
    there, middle, last : ndarray, shape (3, LANES)
        Position at the end of a step, and remainders of gravity in its middle and at its end.
    """

    turn: Array
    moved: Array
    linear: Array
    here: Array
    pull: Array
    errors: Array
    bias: Array
    response: Array
    turned: Array
    sound: Array
    checked: Array
    following: Array
    there: Array
    middle: Array
    last: Array


def deviations_of(errors: int, biases: int, keep: Rooms = room, started: Rooms = room) -> Deviations:
    """Return room for samples with a number of constant errors and of biases of processes.

    Parameters
    ----------
    keep : callable
        Makes the rooms that outlast a step.
    started : callable
        Makes those that `start` fills: the same, unless each block of steps begins with it.
    """
    return Deviations(
        keep(4), keep(6), keep(9), started(3), started(3), keep(errors), keep(biases), keep(9), room(9), keep(1),
        room(2), room(6), room(3), room(3), room(3),
    )  # fmt: skip


class DeviationParts(NamedTuple):
    """Arrays of `Deviations` that a short step uses, by parts: shapes (..., PARTS, PART)."""

    turn: Array
    moved: Array
    response: Array
    turned: Array
    checked: Array


def parts_of_deviations(samples: Deviations) -> DeviationParts:
    """Return the memory of samples by parts."""
    return DeviationParts(*(parts_of(getattr(samples, name)) for name in DeviationParts._fields))


@uncontracted_subroutine
def change_gravitation(constants: Array, place: Array, field: Array, x: Array, out: Array) -> None:
    """Compute the change of gravitation by deviations, shape (3, LANES).

    Without deviations it is exactly zero: not contracted, as the field of the truth.
    """
    gx, gy, gz = gravitation(constants, place[0] + load(x, 0), place[1] + load(x, 1), place[2] + load(x, 2))
    store(out, 0, gx - field[0])
    store(out, 1, gy - field[1])
    store(out, 2, gz - field[2])


@allocation_free_part
def _leave_remainder(gradient: Array, x: Array, change: Array) -> None:
    """Subtract from the change of gravitation by deviations what is linear in them."""
    a, b, c = load(x, 0), load(x, 1), load(x, 2)
    for r in range(3):
        store(change, r, load(change, r) - (gradient[r, 0] * a + gradient[r, 1] * b + gradient[r, 2] * c))


@allocation_free_subroutine
def place(i: int, errors: Array, linear: Array, state: Array, samples: Deviations) -> None:
    """Put a sample at its start into lane i.

    Parameters
    ----------
    errors : ndarray, shape (p,)
    linear, state : ndarray, shapes (9,), (10,)
        Linear errors of the outputs; quaternion, and deviations of velocity and position.
    """
    samples.sound[0, i] = 1.0
    for q in range(len(errors)):
        samples.errors[q, i] = errors[q]
    for r in range(4):
        samples.turn[r, i] = state[r]
    for r in range(9):
        samples.linear[r, i] = linear[r]
        samples.response[r, i] = 0.0
    for r in range(6):
        samples.moved[r, i] = state[4 + r]


@allocation_free_part
def start(k: int, tables: StepTables, samples: Deviations) -> None:
    """Compute the deviations of the position, and the remainder of gravitation, at the beginning of step k."""
    for r in range(3):
        store(samples.here, r, load(samples.moved, 3 + r))
    change_gravitation(tables.constants, tables.places[2 * k], tables.fields[2 * k], samples.here, samples.pull)
    _leave_remainder(tables.gradients[2 * k], samples.here, samples.pull)


@allocation_free_part
def respond(k: int, tables: StepTables, drawn: bool, normals: Array, first: int, samples: Deviations) -> None:
    """Compute the linear response in step k to constant errors, biases of processes and noise; take the biases on.

    Parameters
    ----------
    drawn : bool
        Whether there is noise: factors times normal variates.
    normals : ndarray, shape (rows, LANES)
    first : int
        Row of the step's first variate.
    """
    errors, bias, inputs, biases, factors = samples.errors, samples.bias, tables.inputs, tables.biases, tables.factors
    independent = factors.shape[2] - len(bias)  # nine, or six if the position has no noise of its own
    for r in range(0, 9, 3):
        # an accelerometer turns nothing
        # B e: constant errors
        count = tables.gyros if r == 0 else len(errors)
        x = y = z = 0.0
        for q in range(count):
            error = load(errors, q)
            x += inputs[k, q, r] * error
            y += inputs[k, q, r + 1] * error
            z += inputs[k, q, r + 2] * error
        # B b: biases of processes at the step's beginning
        for q in range(len(bias)):
            error = load(bias, q)
            x += biases[k, q, r] * error
            y += biases[k, q, r + 1] * error
            z += biases[k, q, r + 2] * error
        # L n: rows of the Cholesky factor of Q times normal variates
        if drawn:
            for c in range(min(r + 3, independent)):
                normal = load(normals, first + c)
                x += factors[k, r, c] * normal
                y += factors[k, r + 1, c] * normal
                z += factors[k, r + 2, c] * normal
        store(samples.response, r, x)
        store(samples.response, r + 1, y)
        store(samples.response, r + 2, z)
    for q in range(len(bias)):
        # b' = d b + L n
        x = tables.decays[k, q] * load(bias, q)
        if drawn:
            for c in range(independent + 1 + q):
                x += factors[k, 9 + q, c] * load(normals, first + c)
        store(bias, q, x)


@allocation_free_subroutine
def add_given(added: Array, i: int, samples: Deviations) -> None:
    """Add what processes add in a step to the response and the biases of lane i: shape (9 + b,)."""
    for r in range(9):
        samples.response[r, i] += added[r]
    for q in range(len(samples.bias)):
        samples.bias[q, i] += added[9 + q]


@inlined
def rotation_less_one(a: Vector, b: Vector, c: Vector, e: Vector) -> Block:
    """Compute R - I of a quaternion."""
    return (
        -2.0 * (c * c + e * e), 2.0 * (b * c - a * e), 2.0 * (b * e + a * c),
        2.0 * (b * c + a * e), -2.0 * (b * b + e * e), 2.0 * (c * e - a * b),
        2.0 * (b * e - a * c), 2.0 * (c * e + a * b), -2.0 * (b * b + c * c),
    )  # fmt: skip


@inlined
def rotate(m: Block, x: Vector, y: Vector, z: Vector) -> tuple[Vector, Vector, Vector]:
    """Multiply a vector by a matrix."""
    return m[0] * x + m[1] * y + m[2] * z, m[3] * x + m[4] * y + m[5] * z, m[6] * x + m[7] * y + m[8] * z


@inlined
def multiply_turns(
    a: Vector, b: Vector, c: Vector, e: Vector, w: Vector, x: Vector, y: Vector, z: Vector
) -> tuple[Vector, Vector, Vector, Vector]:
    """Multiply rotations (a, b, c, e) by further ones from the right."""
    return (
        a * w - (b * x + c * y + e * z), b * w + (a * x + c * z - e * y), c * w + (a * y + e * x - b * z),
        e * w + (a * z + b * y - c * x),
    )  # fmt: skip


@allocation_free_part
def turn_less_one(turn: Array, out: Array) -> None:
    """Compute R - I of rotations, shape (9, LANES)."""
    less_one = rotation_less_one(load(turn, 0), load(turn, 1), load(turn, 2), load(turn, 3))
    store(out, 0, less_one[0])
    store(out, 1, less_one[1])
    store(out, 2, less_one[2])
    store(out, 3, less_one[3])
    store(out, 4, less_one[4])
    store(out, 5, less_one[5])
    store(out, 6, less_one[6])
    store(out, 7, less_one[7])
    store(out, 8, less_one[8])


@inlined
def products_within(
    turned: Block, thrust: Array, half: int, k: int, ax: Vector, ay: Vector, az: Vector, lx: Vector, ly: Vector,
    lz: Vector,
) -> tuple[Vector, Vector, Vector]:  # fmt: skip
    """Compute the products of errors within a step, of which the rotation (ax, ay, az) grows evenly.

    Parameters
    ----------
    turned : block
        R - I.
    half : int
        0 for the velocity, 1 for the position.
    lx, ly, lz : vectors
        The linear response.
    """
    # (a x (a x f)) / 6 + (a x u) / 2 for the velocity, / 12 and / 3 for the position, where u is what the linear
    # response has besides the force turned by a half or a third of a
    of_force, of_input = (-1.0 / 12.0, 0.5) if half == 0 else (-1.0 / 36.0, 1.0 / 3.0)
    fx, fy, fz = thrust[k, 3 * half], thrust[k, 3 * half + 1], thrust[k, 3 * half + 2]
    wx = of_force * (ay * fz - az * fy) + of_input * lx
    wy = of_force * (az * fx - ax * fz) + of_input * ly
    wz = of_force * (ax * fy - ay * fx) + of_input * lz
    px, py, pz = ay * wz - az * wy, az * wx - ax * wz, ax * wy - ay * wx
    qx, qy, qz = rotate(turned, px + lx, py + ly, pz + lz)
    return px + qx, py + qy, pz + qz


@inlined
def _turn_within(ax: Vector, ay: Vector, az: Vector) -> tuple[Vector, Vector, Vector, Vector, Vector]:
    """Compute the quaternion of what gyros' errors amount to in a step, up to `LARGEST_TURN`, and its square."""
    square = ax * ax + ay * ay + az * az
    t = 0.25 * square
    cosine = 1.0 - t * (1 / 2 - t * (1 / 24 - t * (1 / 720 - t * (1 / 40320 - t * (1 / 3628800)))))
    sine = 0.5 * (1.0 - t * (1 / 6 - t * (1 / 120 - t * (1 / 5040 - t * (1 / 362880 - t * (1 / 39916800))))))
    return cosine, sine * ax, sine * ay, sine * az, square


@inlined
def _check(constants: Array, samples: Deviations) -> None:
    """Note which samples are not sound: turned too far in a step, or too near to the earth's centre."""
    floor = (SMALLEST_RADIUS * constants[0]) ** 2
    sound = where(load(samples.checked, 0) < LARGEST_TURN * LARGEST_TURN, load(samples.sound, 0), 0.0)
    store(samples.sound, 0, where(load(samples.checked, 1) > floor, sound, 0.0))


@inlined
def _parted(turned: Block) -> tuple[Vector, Vector, Vector, Vector, Vector, Vector]:
    """Part R - I: its skew part is that of a vector, which the linear response turns by; of the rest, what is mixed."""
    return (
        0.5 * (turned[7] - turned[5]), 0.5 * (turned[2] - turned[6]), 0.5 * (turned[3] - turned[1]),
        0.5 * (turned[1] + turned[3]), 0.5 * (turned[2] + turned[6]), 0.5 * (turned[5] + turned[7]),
    )  # fmt: skip


@inlined
def _add_motion(k: int, motion: Array, a: Vector, b: Vector, c: Vector, samples: Deviations) -> None:
    """Add to velocity and position of a step's end the linear response to those of its beginning, and to turns."""
    moved, following = samples.moved, samples.following
    vx, vy, vz, x, y, z = (
        load(moved, 0), load(moved, 1), load(moved, 2), load(moved, 3), load(moved, 4), load(moved, 5),
    )  # fmt: skip
    for r in range(6):
        along = load(following, r) + (motion[k, r, 0] * a + motion[k, r, 1] * b + motion[k, r, 2] * c)
        along += motion[k, r, 3] * vx + motion[k, r, 4] * vy + motion[k, r, 5] * vz
        along += motion[k, r, 6] * x + motion[k, r, 7] * y + motion[k, r, 8] * z
        store(following, r, along)


@inlined
def _rows(rows: Array) -> Block:
    """Return nine rows of lanes as a block."""
    return (
        load(rows, 0), load(rows, 1), load(rows, 2), load(rows, 3), load(rows, 4), load(rows, 5), load(rows, 6),
        load(rows, 7), load(rows, 8),
    )  # fmt: skip


@allocation_free_part
def advance(k: int, tables: StepTables, samples: Deviations) -> None:
    """Take samples over step k, with their response to the errors of the instruments in it."""
    constants, force, h = tables.constants, tables.force, tables.durations[k]
    response, here, moved, following = samples.response, samples.here, samples.moved, samples.following
    there, middle, last = samples.there, samples.middle, samples.last
    # R - I at the step's beginning
    turn_less_one(samples.turn, samples.turned)
    turned = _rows(samples.turned)
    a, b, c, b01, b02, b12 = _parted(turned)
    b00, b11, b22 = turned[0], turned[4], turned[8]
    ax, ay, az = load(response, 0), load(response, 1), load(response, 2)
    # the linear response to errors and the products of errors within the step, for v, then for x
    for half in range(2):
        lx, ly, lz = load(response, 3 + 3 * half), load(response, 4 + 3 * half), load(response, 5 + 3 * half)
        px, py, pz = products_within(turned, tables.thrust, half, k, ax, ay, az, lx, ly, lz)
        store(following, 3 * half, px + lx)
        store(following, 3 * half + 1, py + ly)
        store(following, 3 * half + 2, pz + lz)
    # (R - I) F beyond its skew part: a matrix N, symmetric; the response to N F is a table
    for r in range(6):
        extra = load(following, r) + (force[k, r, 0] * b00 + force[k, r, 4] * b11 + force[k, r, 8] * b22)
        extra += (force[k, r, 1] + force[k, r, 3]) * b01 + (force[k, r, 2] + force[k, r, 6]) * b02
        extra += (force[k, r, 5] + force[k, r, 7]) * b12
        store(following, r, extra)
    # M (psi, v, x), where psi is the skew part of R - I
    _add_motion(k, tables.motion, a, b, c, samples)
    # positions in the middle and at the end, and the remainders of gravitation there: g(r + x) - g(r) - G x
    first = samples.pull
    for r in range(3):
        f = load(first, r)
        end = load(following, 3 + r) + (0.5 * h * h) * f
        change = load(moved, r) - (load(following, r) + h * f)
        store(there, r, end)
        store(here, r, 0.5 * (load(here, r) + end) + 0.125 * h * change)
    change_gravitation(constants, tables.places[2 * k + 1], tables.fields[2 * k + 1], here, middle)
    _leave_remainder(tables.gradients[2 * k + 1], here, middle)
    change_gravitation(constants, tables.places[2 * k + 2], tables.fields[2 * k + 2], there, last)
    _leave_remainder(tables.gradients[2 * k + 2], there, last)
    # Simpson's rule for the remainder, and for what its velocity and position change in gravity
    for r in range(3):
        pushed = pulled = 0.0
        for c in range(3):
            gradient = tables.gradients[2 * k + 1, r, c]
            pushed += gradient * (load(first, c) + load(middle, c))
            pulled += gradient * (2.0 * load(first, c) + load(middle, c))
        f, m = load(first, r), load(middle, r)
        velocity = load(following, r) + h * ((1.0 / 6.0) * (f + 4.0 * m + load(last, r)) + (h * h / 12.0) * pushed)
        position = load(following, 3 + r) + h * h * ((1.0 / 6.0) * (f + 2.0 * m) + (h * h / 72.0) * pulled)
        store(moved, r, velocity)
        store(moved, 3 + r, position)
        store(here, r, position)
    for r in range(3):
        store(first, r, load(last, r))
    # R' = R times the rotation by the gyros' errors
    turn, (w, x, y, z, square) = samples.turn, _turn_within(ax, ay, az)
    store(samples.checked, 0, square)
    w, x, y, z = multiply_turns(load(turn, 0), load(turn, 1), load(turn, 2), load(turn, 3), w, x, y, z)
    store(turn, 0, w)
    store(turn, 1, x)
    store(turn, 2, y)
    store(turn, 3, z)
    x, y = tables.places[2 * k + 2, 0] + load(here, 0), tables.places[2 * k + 2, 1] + load(here, 1)
    z = tables.places[2 * k + 2, 2] + load(here, 2)
    store(samples.checked, 1, x * x + y * y + z * z)
    _check(constants, samples)


@inlined
def _force_alone(k: int, tables: StepTables) -> tuple[float, float, float, float, float, float]:
    """Compute the specific force's integral without what gravity makes of it, and the second one less half a step."""
    thrust, gradient, h = tables.thrust, tables.gradients[2 * k + 1], tables.durations[k]
    fx, fy, fz = thrust[k, 0], thrust[k, 1], thrust[k, 2]
    x = (h * h / 6.0) * (gradient[0, 0] * fx + gradient[0, 1] * fy + gradient[0, 2] * fz)
    y = (h * h / 6.0) * (gradient[1, 0] * fx + gradient[1, 1] * fy + gradient[1, 2] * fz)
    z = (h * h / 6.0) * (gradient[2, 0] * fx + gradient[2, 1] * fy + gradient[2, 2] * fz)
    # of the second integral gravity makes h / 4 times as much
    sx, sy, sz = thrust[k, 3] - 0.25 * h * x, thrust[k, 4] - 0.25 * h * y, thrust[k, 5] - 0.25 * h * z
    fx, fy, fz = fx - x, fy - y, fz - z
    return fx, fy, fz, sx - 0.5 * h * fx, sy - 0.5 * h * fy, sz - 0.5 * h * fz


@inlined
def _change_gravity(
    k: int, tables: StepTables, radius: float, x: Vector, y: Vector, z: Vector
) -> tuple[Vector, Vector, Vector]:
    """Compute the change of gravitation by deviations in the middle of step k.

    That of a point mass, and of the zonal harmonics to second order.
    """
    at, gradients, curvatures = 2 * k + 1, tables.gradients, tables.curvatures
    share, pull = 1.0 / radius, tables.constants[2] / (radius * radius)
    # of a point mass beyond the linear: mu / r^2 times `gravity_remainder` of x / r
    nx, ny, nz = share * tables.places[at, 0], share * tables.places[at, 1], share * tables.places[at, 2]
    ux, uy, uz = share * x, share * y, share * z
    radial, along = gravity_shares(nx * ux + ny * uy + nz * uz, ux * ux + uy * uy + uz * uz)
    radial, along = pull * radial, pull * along
    # G x of the whole field, and the zonal harmonics to second order
    xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
    gx = nx * radial + ux * along + (gradients[at, 0, 0] * x + gradients[at, 0, 1] * y + gradients[at, 0, 2] * z)
    gy = ny * radial + uy * along + (gradients[at, 1, 0] * x + gradients[at, 1, 1] * y + gradients[at, 1, 2] * z)
    gz = nz * radial + uz * along + (gradients[at, 2, 0] * x + gradients[at, 2, 1] * y + gradients[at, 2, 2] * z)
    gx += curvatures[k, 0, 0] * xx + curvatures[k, 0, 1] * yy + curvatures[k, 0, 2] * zz
    gy += curvatures[k, 1, 0] * xx + curvatures[k, 1, 1] * yy + curvatures[k, 1, 2] * zz
    gz += curvatures[k, 2, 0] * xx + curvatures[k, 2, 1] * yy + curvatures[k, 2, 2] * zz
    gx += curvatures[k, 0, 3] * xy + curvatures[k, 0, 4] * xz + curvatures[k, 0, 5] * yz
    gy += curvatures[k, 1, 3] * xy + curvatures[k, 1, 4] * xz + curvatures[k, 1, 5] * yz
    gz += curvatures[k, 2, 3] * xy + curvatures[k, 2, 4] * xz + curvatures[k, 2, 5] * yz
    return gx, gy, gz


@allocation_free_part
def advance_short(k: int, tables: StepTables, samples: Deviations, parts: DeviationParts, filtered: bool) -> None:
    """Take samples over a step of at most `SHORT`, with their response to the errors of the instruments in it.

    Gravity changes by the mean position of the step, to which the velocity at its beginning and an even turned force
    lead; the linear response has what gravity makes of it.

    Parameters
    ----------
    parts : DeviationParts
        The samples' memory by parts, so that what a part needs stays in registers.
    filtered : bool
        Whether R - I is kept for covariances of the samples' own.
    """
    thrust, h, places, response, moved, turn = (
        tables.thrust, tables.durations[k], tables.places, parts.response, parts.moved, parts.turn,
    )  # fmt: skip
    # integrals of the force alone: of v, and of x beyond half a step of it
    fx, fy, fz, sx, sy, sz = _force_alone(k, tables)
    half, sixth, px, py, pz = 0.5 * h, h / 6.0, places[2 * k + 1, 0], places[2 * k + 1, 1], places[2 * k + 1, 2]
    radius = np.sqrt(px * px + py * py + pz * pz)
    for t in range(PARTS):
        # R - I at the step's beginning
        a, b, c, e = load_part(turn, (0, t)), load_part(turn, (1, t)), load_part(turn, (2, t)), load_part(turn, (3, t))
        turned = rotation_less_one(a, b, c, e)
        if filtered:
            store_part(parts.turned, (0, t), turned[0])
            store_part(parts.turned, (1, t), turned[1])
            store_part(parts.turned, (2, t), turned[2])
            store_part(parts.turned, (3, t), turned[3])
            store_part(parts.turned, (4, t), turned[4])
            store_part(parts.turned, (5, t), turned[5])
            store_part(parts.turned, (6, t), turned[6])
            store_part(parts.turned, (7, t), turned[7])
            store_part(parts.turned, (8, t), turned[8])
        # R' = R times the rotation by the gyros' errors
        ax, ay, az = load_part(response, (0, t)), load_part(response, (1, t)), load_part(response, (2, t))
        w, x, y, z, square = _turn_within(ax, ay, az)
        w, x, y, z = multiply_turns(a, b, c, e, w, x, y, z)
        store_part(turn, (0, t), w)
        store_part(turn, (1, t), x)
        store_part(turn, (2, t), y)
        store_part(turn, (3, t), z)
        store_part(parts.checked, (0, t), square)
        # what v gains: products of errors within the step, and (R - I) F
        lx, ly, lz = load_part(response, (3, t)), load_part(response, (4, t)), load_part(response, (5, t))
        dx, dy, dz = products_within(turned, thrust, 0, k, ax, ay, az, lx, ly, lz)
        ux, uy, uz = rotate(turned, fx, fy, fz)
        dx, dy, dz = dx + ux, dy + uy, dz + uz
        # half a step of x, then the mean position of the step, at which gravity changes by g
        vx, vy, vz = load_part(moved, (0, t)), load_part(moved, (1, t)), load_part(moved, (2, t))
        x, y, z = load_part(moved, (3, t)), load_part(moved, (4, t)), load_part(moved, (5, t))
        x, y, z = x + half * vx, y + half * vy, z + half * vz
        mx, my, mz = x + sixth * dx, y + sixth * dy, z + sixth * dz
        gx, gy, gz = _change_gravity(k, tables, radius, mx, my, mz)
        mx, my, mz = px + mx, py + my, pz + mz
        store_part(parts.checked, (1, t), mx * mx + my * my + mz * mz)
        # v' = v + all of it, with the linear response
        vx, vy, vz = vx + (dx + lx + h * gx), vy + (dy + ly + h * gy), vz + (dz + lz + h * gz)
        store_part(moved, (0, t), vx)
        store_part(moved, (1, t), vy)
        store_part(moved, (2, t), vz)
        # of the position, what the errors and the force add besides half a step of the velocity's part
        lx = load_part(response, (6, t)) - half * lx
        ly = load_part(response, (7, t)) - half * ly
        lz = load_part(response, (8, t)) - half * lz
        ux, uy, uz = rotate(turned, lx + sx, ly + sy, lz + sz)
        store_part(moved, (3, t), x + half * vx + (lx + ux))
        store_part(moved, (4, t), y + half * vy + (ly + uy))
        store_part(moved, (5, t), z + half * vz + (lz + uz))
    _check(tables.constants, samples)
