"""One step of LANES samples: the response to the errors of their instruments, and the deviation from the truth.

A sample is the rotation from true to indicated axes, and deviations of velocity and position
(`mcnav.physics.ins.ensemble` has the equations). Vectors of lanes are handled in threes, as those of space are.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from mcnav._types import Array
from mcnav.physics.ins.earth import gravitation
from mcnav.physics.jit import allocation_free, allocation_free_part, allocation_free_uncontracted, inlined
from mcnav.physics.vectors import Rooms, Vector, load, room, store, where

LARGEST_TURN: Final = 0.5
"""Largest rotation by the gyros' errors within a step, rad: beyond it a sample leaves the engine's validity."""

SHORT: Final = 2.0
"""Longest step for `advance_short`, s: what gravity's gradient, 3e-6 1/s^2, makes of a step's growth is 1e-6 of it."""

SMALLEST_RADIUS: Final = 0.5
"""Smallest distance from the earth's centre, as a share of the earth's radius."""


class StepTables(NamedTuple):
    """Tables that samples share over K steps, as `mcnav.physics.ins.ensemble.EnsembleTables` has it.

    Attributes
    ----------
    inputs : ndarray, shape (K, p, 9)
        Of the constant errors that are not zero, those of the gyros first.
    gyros : int
        Number of these.
    factors : ndarray, shape (K, 9 + b, 9 + b) or (K, 9 + b, 6 + b)
    adjoint : ndarray, shape (K, 9, 9)
        As `mcnav.physics.ins.adjoint.Adjoint` has it.
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
    following: Array
    there: Array
    middle: Array
    last: Array


def deviations_of(errors: int, biases: int, keep: Rooms = room) -> Deviations:
    """Return room for samples with a number of constant errors and of biases of processes.

    Parameters
    ----------
    keep : callable
        Makes the rooms that outlast a step.
    """
    return Deviations(
        keep(4), keep(6), keep(9), keep(3), keep(3), keep(errors), keep(biases), room(9), room(9), keep(1), room(6),
        room(3), room(3), room(3),
    )  # fmt: skip


@allocation_free_uncontracted
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


@allocation_free
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
        count = tables.gyros if r == 0 else len(errors)
        x = y = z = 0.0
        for q in range(count):
            error = load(errors, q)
            x += inputs[k, q, r] * error
            y += inputs[k, q, r + 1] * error
            z += inputs[k, q, r + 2] * error
        for q in range(len(bias)):
            error = load(bias, q)
            x += biases[k, q, r] * error
            y += biases[k, q, r + 1] * error
            z += biases[k, q, r + 2] * error
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
        x = tables.decays[k, q] * load(bias, q)
        if drawn:
            for c in range(independent + 1 + q):
                x += factors[k, 9 + q, c] * load(normals, first + c)
        store(bias, q, x)


@allocation_free
def add_given(added: Array, i: int, samples: Deviations) -> None:
    """Add what processes add in a step to the response and the biases of lane i: shape (9 + b,)."""
    for r in range(9):
        samples.response[r, i] += added[r]
    for q in range(len(samples.bias)):
        samples.bias[q, i] += added[9 + q]


@allocation_free_part
def turn_less_one(turn: Array, out: Array) -> None:
    """Compute R - I of rotations, shape (9, LANES)."""
    a, b, c, e = load(turn, 0), load(turn, 1), load(turn, 2), load(turn, 3)
    store(out, 0, -2.0 * (c * c + e * e))
    store(out, 1, 2.0 * (b * c - a * e))
    store(out, 2, 2.0 * (b * e + a * c))
    store(out, 3, 2.0 * (b * c + a * e))
    store(out, 4, -2.0 * (b * b + e * e))
    store(out, 5, 2.0 * (c * e - a * b))
    store(out, 6, 2.0 * (b * e - a * c))
    store(out, 7, 2.0 * (c * e + a * b))
    store(out, 8, -2.0 * (b * b + c * c))


@inlined
def multiply_turns(turn: Array, w: Vector, x: Vector, y: Vector, z: Vector) -> None:
    """Multiply rotations by further ones from the right."""
    a, b, c, e = load(turn, 0), load(turn, 1), load(turn, 2), load(turn, 3)
    store(turn, 0, a * w - (b * x + c * y + e * z))
    store(turn, 1, b * w + (a * x + c * z - e * y))
    store(turn, 2, c * w + (a * y + e * x - b * z))
    store(turn, 3, e * w + (a * z + b * y - c * x))


@inlined
def products_within(
    turned: Array,
    thrust: Array,
    half: int,
    k: int,
    ax: Vector,
    ay: Vector,
    az: Vector,
    lx: Vector,
    ly: Vector,
    lz: Vector,
) -> tuple[Vector, Vector, Vector]:
    """Compute the products of errors within a step, of which the rotation (ax, ay, az) grows evenly.

    Parameters
    ----------
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
    qx, qy, qz = px + lx, py + ly, pz + lz
    return (
        px + (load(turned, 0) * qx + load(turned, 1) * qy + load(turned, 2) * qz),
        py + (load(turned, 3) * qx + load(turned, 4) * qy + load(turned, 5) * qz),
        pz + (load(turned, 6) * qx + load(turned, 7) * qy + load(turned, 8) * qz),
    )


@inlined
def _turn(ax: Vector, ay: Vector, az: Vector, samples: Deviations) -> None:
    """Turn samples by what their gyros' errors amount to in a step; beyond `LARGEST_TURN` they are not sound."""
    square = ax * ax + ay * ay + az * az
    t = 0.25 * square
    cosine = 1.0 - t * (1 / 2 - t * (1 / 24 - t * (1 / 720 - t * (1 / 40320 - t * (1 / 3628800)))))
    sine = 0.5 * (1.0 - t * (1 / 6 - t * (1 / 120 - t * (1 / 5040 - t * (1 / 362880 - t * (1 / 39916800))))))
    multiply_turns(samples.turn, cosine, sine * ax, sine * ay, sine * az)
    store(samples.sound, 0, where(square < LARGEST_TURN * LARGEST_TURN, load(samples.sound, 0), 0.0))


@inlined
def _check_distance(constants: Array, x: Vector, y: Vector, z: Vector, samples: Deviations) -> None:
    """Note which samples are so near to the earth's centre that they are not sound."""
    floor = (SMALLEST_RADIUS * constants[0]) ** 2
    store(samples.sound, 0, where(x * x + y * y + z * z > floor, load(samples.sound, 0), 0.0))


@inlined
def _parted(turned: Array) -> tuple[Vector, Vector, Vector, Vector, Vector, Vector]:
    """Part R - I: its skew part is that of a vector, which the linear response turns by; of the rest, what is mixed."""
    return (
        0.5 * (load(turned, 7) - load(turned, 5)), 0.5 * (load(turned, 2) - load(turned, 6)),
        0.5 * (load(turned, 3) - load(turned, 1)), 0.5 * (load(turned, 1) + load(turned, 3)),
        0.5 * (load(turned, 2) + load(turned, 6)), 0.5 * (load(turned, 5) + load(turned, 7)),
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


@allocation_free_part
def advance(k: int, tables: StepTables, samples: Deviations) -> None:
    """Take samples over step k, with their response to the errors of the instruments in it."""
    constants, force, turned, h = tables.constants, tables.force, samples.turned, tables.durations[k]
    response, here, moved, following = samples.response, samples.here, samples.moved, samples.following
    there, middle, last = samples.there, samples.middle, samples.last
    turn_less_one(samples.turn, turned)
    a, b, c, b01, b02, b12 = _parted(turned)
    b00, b11, b22 = load(turned, 0), load(turned, 4), load(turned, 8)
    ax, ay, az = load(response, 0), load(response, 1), load(response, 2)
    for half in range(2):
        lx, ly, lz = load(response, 3 + 3 * half), load(response, 4 + 3 * half), load(response, 5 + 3 * half)
        px, py, pz = products_within(turned, tables.thrust, half, k, ax, ay, az, lx, ly, lz)
        store(following, 3 * half, px + lx)
        store(following, 3 * half + 1, py + ly)
        store(following, 3 * half + 2, pz + lz)
    for r in range(6):
        extra = load(following, r) + (force[k, r, 0] * b00 + force[k, r, 4] * b11 + force[k, r, 8] * b22)
        extra += (force[k, r, 1] + force[k, r, 3]) * b01 + (force[k, r, 2] + force[k, r, 6]) * b02
        extra += (force[k, r, 5] + force[k, r, 7]) * b12
        store(following, r, extra)
    _add_motion(k, tables.motion, a, b, c, samples)
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
    _turn(ax, ay, az, samples)
    x, y = tables.places[2 * k + 2, 0] + load(here, 0), tables.places[2 * k + 2, 1] + load(here, 1)
    z = tables.places[2 * k + 2, 2] + load(here, 2)
    _check_distance(constants, x, y, z, samples)


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


@allocation_free_part
def advance_short(k: int, tables: StepTables, samples: Deviations) -> None:
    """Take samples over a step of at most `SHORT`, with their response to the errors of the instruments in it.

    Gravity changes by the mean position of the step, to which the velocity at its beginning and an even turned force
    lead; the linear response has what gravity makes of it.
    """
    thrust, turned, h, response, moved = (
        tables.thrust, samples.turned, tables.durations[k], samples.response, samples.moved,
    )  # fmt: skip
    here, pull, half = samples.here, samples.middle, 0.5 * h
    fx, fy, fz, sx, sy, sz = _force_alone(k, tables)
    turn_less_one(samples.turn, turned)
    ax, ay, az = load(response, 0), load(response, 1), load(response, 2)
    lx, ly, lz = load(response, 3), load(response, 4), load(response, 5)
    px, py, pz = products_within(turned, thrust, 0, k, ax, ay, az, lx, ly, lz)
    px += load(turned, 0) * fx + load(turned, 1) * fy + load(turned, 2) * fz
    py += load(turned, 3) * fx + load(turned, 4) * fy + load(turned, 5) * fz
    pz += load(turned, 6) * fx + load(turned, 7) * fy + load(turned, 8) * fz
    vx, vy, vz = load(moved, 0), load(moved, 1), load(moved, 2)
    x, y, z = load(moved, 3) + half * vx, load(moved, 4) + half * vy, load(moved, 5) + half * vz
    store(here, 0, x + (h / 6.0) * px)
    store(here, 1, y + (h / 6.0) * py)
    store(here, 2, z + (h / 6.0) * pz)
    change_gravitation(tables.constants, tables.places[2 * k + 1], tables.fields[2 * k + 1], here, pull)
    vx += (px + lx) + h * load(pull, 0)
    vy += (py + ly) + h * load(pull, 1)
    vz += (pz + lz) + h * load(pull, 2)
    store(moved, 0, vx)
    store(moved, 1, vy)
    store(moved, 2, vz)
    # of the position, what the errors and the force add besides half a step of the velocity's part
    lx, ly, lz = load(response, 6) - half * lx, load(response, 7) - half * ly, load(response, 8) - half * lz
    fx, fy, fz = lx + sx, ly + sy, lz + sz
    lx += load(turned, 0) * fx + load(turned, 1) * fy + load(turned, 2) * fz
    ly += load(turned, 3) * fx + load(turned, 4) * fy + load(turned, 5) * fz
    lz += load(turned, 6) * fx + load(turned, 7) * fy + load(turned, 8) * fz
    store(moved, 3, x + (half * vx + lx))
    store(moved, 4, y + (half * vy + ly))
    store(moved, 5, z + (half * vz + lz))
    _turn(ax, ay, az, samples)
    x, y = tables.places[2 * k + 1, 0] + load(here, 0), tables.places[2 * k + 1, 1] + load(here, 1)
    z = tables.places[2 * k + 1, 2] + load(here, 2)
    _check_distance(tables.constants, x, y, z, samples)
