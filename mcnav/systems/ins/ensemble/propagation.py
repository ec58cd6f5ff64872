"""Propagation of the covariances of the filters of LANES aided samples over a step: ``P' = Phi P Phi^T + Q``.

Each filter's transition is that of the step's tables, turned to the attitude and the force that its sample indicates.
A step of at most `SHORT` is taken by half a step of the position, the step of the velocity, and the other half: what
gravity changes within it is 3e-6 h^2 / 6 of its effect, at most 2e-6.
"""

from __future__ import annotations

from collections.abc import Callable

from mcnav.arrays.types import Array, IndexArray
from mcnav.compiled.blocks import (
    THREE,
    Block,
    add,
    add_product,
    load_block,
    load_numbers,
    load_symmetric,
    multiply,
    scale,
    scale_rows,
    store_block,
    store_symmetric,
    transpose,
)
from mcnav.compiled.jit import allocation_free_part
from mcnav.compiled.vectors import PARTS, Vector, load_part, store_part
from mcnav.systems.ins.ensemble.filters import Covariances, FilterSteps

PSI, VELOCITY, POSITION = 0, 1, 2
"""Places of the blocks of navigation."""


@allocation_free_part
def _turn_rows(turned: Block, b: Block) -> Block:
    """Compute ``R B``, with R - I."""
    return add_product(b, turned, b)


@allocation_free_part
def _turn_both(turned: Block, b: Block) -> Block:
    """Compute ``R B R^T``, with R - I."""
    a = add_product(b, turned, b)
    return add_product(a, a, transpose(turned))


@allocation_free_part
def _part_of_rows(rows: Array, t: int) -> Block:
    """Return the part t of nine rows of lanes, shape (9, PARTS, PART)."""
    return (
        load_part(rows, (0, t)), load_part(rows, (1, t)), load_part(rows, (2, t)), load_part(rows, (3, t)),
        load_part(rows, (4, t)), load_part(rows, (5, t)), load_part(rows, (6, t)), load_part(rows, (7, t)),
        load_part(rows, (8, t)),
    )  # fmt: skip


@allocation_free_part
def _force_error(thrust: Array, k: int, half: int, response: Block) -> tuple[Vector, Vector, Vector]:
    """Compute the error of the force's integral in step k, of the velocity or the position, before it is turned."""
    # the linear response, less what psi that grows evenly to a makes of the force: a x f / 2, of the position a x f / 3
    at = THREE * half
    ax, ay, az = response[0], response[1], response[2]
    fx, fy, fz = thrust[k, at], thrust[k, at + 1], thrust[k, at + 2]
    share = 0.5 if half == 0 else 1.0 / 3.0
    return (
        response[3 + at] - share * (ay * fz - az * fy),
        response[4 + at] - share * (az * fx - ax * fz),
        response[5 + at] - share * (ax * fy - ay * fx),
    )


@allocation_free_part
def _turn(turned: Block, x: Vector, y: Vector, z: Vector) -> tuple[Vector, Vector, Vector]:
    """Compute ``R x``, with R - I."""
    return (
        x + (turned[0] * x + turned[1] * y + turned[2] * z),
        y + (turned[3] * x + turned[4] * y + turned[5] * z),
        z + (turned[6] * x + turned[7] * y + turned[8] * z),
    )


@allocation_free_part
def _indicated_force(thrust: Array, k: int, half: int, turned: Block, response: Block) -> tuple[Vector, Vector, Vector]:
    """Compute the force's integral as a sample indicates it: ``R (f + df)``."""
    x, y, z = _force_error(thrust, k, half, response)
    at = THREE * half
    return _turn(turned, x + thrust[k, at], y + thrust[k, at + 1], z + thrust[k, at + 2])


@allocation_free_part
def _turn_couplings(k: int, t: int, tables: FilterSteps, turned: Array, filters: Covariances) -> None:
    """Turn the responses to the other states to the attitude that each sample of part t indicates."""
    rotation = _part_of_rows(turned, t)
    for r in range(THREE if tables.uneven[k] else POSITION):
        for s in tables.moving if r > 0 else tables.turning:
            store_block(filters.coupled, (r, s), _turn_rows(rotation, load_numbers(tables.coupling, (k, r, s))))


@allocation_free_part
def _add_force(x: Block, force: Array, half: int, b: Block) -> Block:
    """Compute ``X + psi x f`` for columns of psi, with a force of `Covariances`."""
    fx, fy, fz = load_part(force, (half, 0)), load_part(force, (half, 1)), load_part(force, (half, 2))
    return (
        x[0] + fz * b[3] - fy * b[6], x[1] + fz * b[4] - fy * b[7], x[2] + fz * b[5] - fy * b[8],
        x[3] + fx * b[6] - fz * b[0], x[4] + fx * b[7] - fz * b[1], x[5] + fx * b[8] - fz * b[2],
        x[6] + fy * b[0] - fx * b[3], x[7] + fy * b[1] - fx * b[4], x[8] + fy * b[2] - fx * b[5],
    )  # fmt: skip


@allocation_free_part
def _add_states(x: Block, t: int, r: int, c: int, states: IndexArray, filters: Covariances) -> Block:
    """Add to column c what the other states contribute to psi, v or x."""
    for s in states:
        x = add_product(x, load_block(filters.coupled, (r, s)), load_symmetric(filters.p, t, THREE + s, c))
    return x


@allocation_free_part
def _move_position(k: int, t: int, c: int, tables: FilterSteps, filters: Covariances) -> Block:
    """Compute what the position gains in the first half of a step: column c of its covariance."""
    return scale(load_symmetric(filters.p, t, VELOCITY, c), 0.5 * tables.durations[k])


@allocation_free_part
def _change_velocity(k: int, t: int, c: int, tables: FilterSteps, filters: Covariances) -> Block:
    """Compute what the velocity gains in a step, from the position in the middle: column c of its covariance."""
    x = multiply(load_numbers(tables.motion, (k, 0, POSITION)), load_symmetric(filters.p, t, POSITION, c))
    x = _add_force(x, filters.force, 0, load_symmetric(filters.p, t, PSI, c))
    return _add_states(x, t, VELOCITY, c, tables.moving, filters)


@allocation_free_part
def _change_position(k: int, t: int, c: int, tables: FilterSteps, filters: Covariances) -> Block:
    """Compute what the position gains in the second half of a step: column c of its covariance."""
    x = _move_position(k, t, c, tables, filters)
    x = _add_force(x, filters.force, 1, load_symmetric(filters.p, t, PSI, c))
    if tables.uneven[k]:
        x = _add_states(x, t, POSITION, c, tables.moving, filters)
    return x


@allocation_free_part
def _change_psi(k: int, t: int, c: int, tables: FilterSteps, filters: Covariances) -> Block:
    """Compute what psi gains in a step: column c of its covariance."""
    x = scale(load_symmetric(filters.p, t, PSI, c), 0.0)
    return _add_states(x, t, PSI, c, tables.turning, filters)


Gain = Callable[[int, int, int, FilterSteps, Covariances], Block]


@allocation_free_part
def _shear(gain: Gain, row: int, k: int, t: int, tables: FilterSteps, filters: Covariances) -> None:
    """Add to psi, v or x a linear function of the rest: ``P' = (I + E) P (I + E)^T``.

    The row's own block has ``E P`` before and ``P' E^T`` after its other blocks.
    """
    p = filters.p
    store_symmetric(p, t, row, row, add(load_block(p, (t, row, row)), gain(k, t, row, tables, filters)))
    for c in range(p.shape[1]):
        if c != row:
            x = gain(k, t, c, tables, filters)
            store_symmetric(p, t, row, c, add(load_symmetric(p, t, row, c), x))
    x = transpose(gain(k, t, row, tables, filters))
    store_symmetric(p, t, row, row, add(load_block(p, (t, row, row)), x))


@allocation_free_part
def _propagate_short(k: int, t: int, tables: FilterSteps, turned: Array, response: Array, filters: Covariances) -> None:
    """Take the covariances of part t over a short step: four shears, of the position, v, the position and psi."""
    half = 0.5 * tables.durations[k]
    rotation, of_errors = _part_of_rows(turned, t), _part_of_rows(response, t)
    # integral of the force as indicated, and what that integral's has beyond half a step of it
    x, y, z = _indicated_force(tables.thrust, k, 0, rotation, of_errors)
    u, v, w = _indicated_force(tables.thrust, k, 1, rotation, of_errors)
    store_part(filters.force, (0, 0), x)
    store_part(filters.force, (0, 1), y)
    store_part(filters.force, (0, 2), z)
    store_part(filters.force, (1, 0), u - half * x)
    store_part(filters.force, (1, 1), v - half * y)
    store_part(filters.force, (1, 2), w - half * z)
    _shear(_move_position, POSITION, k, t, tables, filters)
    _shear(_change_velocity, VELOCITY, k, t, tables, filters)
    _shear(_change_position, POSITION, k, t, tables, filters)
    _shear(_change_psi, PSI, k, t, tables, filters)


@allocation_free_part
def _propagate_long(k: int, t: int, tables: FilterSteps, turned: Array, response: Array, filters: Covariances) -> None:
    """Take the covariances of part t over a step with all of its transition: rows of ``Phi P`` first."""
    p, transition, coupled, product = filters.p, filters.transition, filters.coupled, filters.product
    motion, turning, moving, n = tables.motion, tables.turning, tables.moving, p.shape[1]
    rotation, of_errors = _part_of_rows(turned, t), _part_of_rows(response, t)
    # transition of v, x by psi: R T R^T, less the cross product with the force's error as indicated, R df
    for half in range(2):
        b = _turn_both(rotation, load_numbers(motion, (k, half, 0)))
        x, y, z = _force_error(tables.thrust, k, half, of_errors)
        x, y, z = _turn(rotation, x, y, z)
        b = (b[0], b[1] + z, b[2] - y, b[3] - z, b[4], b[5] + x, b[6] + y, b[7] - x, b[8])
        store_block(transition, half, b)
    for j in range(n):
        # F P: rows of psi, v and x
        x = load_symmetric(p, t, 0, j)
        for s in turning:
            x = add_product(x, load_block(coupled, (0, s)), load_symmetric(p, t, THREE + s, j))
        store_block(product, (0, j), x)
        for half in range(2):
            x = multiply(load_block(transition, half), load_symmetric(p, t, 0, j))
            x = add_product(x, load_numbers(motion, (k, half, 1)), load_symmetric(p, t, 1, j))
            x = add_product(x, load_numbers(motion, (k, half, 2)), load_symmetric(p, t, 2, j))
            for s in moving:
                x = add_product(x, load_block(coupled, (1 + half, s)), load_symmetric(p, t, THREE + s, j))
            store_block(product, (1 + half, j), x)
    for r in range(THREE):
        # F P F^T: with psi, then with v and x, then with the other states
        x = load_block(product, (r, 0))
        for s in turning:
            x = add_product(x, load_block(product, (r, THREE + s)), transpose(load_block(coupled, (0, s))))
        store_symmetric(p, t, r, 0, x)
        for half in range(r):
            x = multiply(load_block(product, (r, 0)), transpose(load_block(transition, half)))
            x = add_product(x, load_block(product, (r, 1)), transpose(load_numbers(motion, (k, half, 1))))
            x = add_product(x, load_block(product, (r, 2)), transpose(load_numbers(motion, (k, half, 2))))
            for s in moving:
                to_state = transpose(load_block(coupled, (1 + half, s)))
                x = add_product(x, load_block(product, (r, THREE + s)), to_state)
            store_symmetric(p, t, r, 1 + half, x)
        for s in range(n - THREE):
            store_block(p, (t, THREE + s, r), transpose(load_block(product, (r, THREE + s))))


@allocation_free_part
def _add_noise(k: int, t: int, tables: FilterSteps, turned: Array, filters: Covariances) -> None:
    """Let the other states of part t fade over a step, and add its noise as turned."""
    p, noise, others, rotation = filters.p, tables.noise, filters.p.shape[1] - THREE, _part_of_rows(turned, t)
    for r in range(THREE):
        # Q of psi, v, x: R Q R^T
        for c in range(r + 1):
            added = _turn_both(rotation, load_numbers(noise, (k, r, c)))
            store_symmetric(p, t, r, c, add(load_block(p, (t, r, c)), added))
        # D P of the other states with these, and their common noise Q R^T
        for s in tables.fading:
            store_block(p, (t, THREE + s, r), scale_rows(load_block(p, (t, THREE + s, r)), tables.decay[k], s))
        for s in tables.shaken:
            added = transpose(_turn_rows(rotation, load_numbers(noise, (k, r, THREE + s))))
            store_block(p, (t, THREE + s, r), add(load_block(p, (t, THREE + s, r)), added))
    # D P D + Q of the other states
    for s in range(others):
        for e in range(s + 1):
            if tables.still[s, e]:
                continue
            kept = scale_rows(load_block(p, (t, THREE + s, THREE + e)), tables.decay[k], s)
            kept = transpose(scale_rows(transpose(kept), tables.decay[k], e))
            added = load_numbers(noise, (k, THREE + s, THREE + e))
            store_block(p, (t, THREE + s, THREE + e), add(kept, added))


@allocation_free_part
def propagate_covariances(k: int, tables: FilterSteps, response: Array, turned: Array, filters: Covariances) -> None:
    """Take the filters' covariances over a step: ``P' = Phi P Phi^T + Q``.

    Parameters
    ----------
    response : ndarray, shape (9, PARTS, PART)
        Of psi, v, x to the errors of the instruments that are left.
    turned : ndarray, shape (9, PARTS, PART)
        R - I.
    """
    for t in range(PARTS):
        _turn_couplings(k, t, tables, turned, filters)
        if tables.short[k]:
            _propagate_short(k, t, tables, turned, response, filters)
        else:
            _propagate_long(k, t, tables, turned, response, filters)
        _add_noise(k, t, tables, turned, filters)
