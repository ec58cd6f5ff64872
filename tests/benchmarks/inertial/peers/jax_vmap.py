"""The same navigator and filter in JAX, on the processor with doubles: one sample's scan over readings under `vmap`.

Updates are the outer scan and readings the inner one. All that is not a product of matrices is written for scalars,
which XLA makes one loop over the samples of; noise is drawn for one update at a time, by the library's own generator.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from mcnav.arrays.types import Array
from tests.benchmarks.inertial.case import READING, Case, Samples
from tests.benchmarks.inertial.equations import EARTH_RATE, MU, reading_step
from tests.benchmarks.inertial.peer import Peer, Simulate
from tests.benchmarks.inertial.peers.arrange import initial_covariance, level_axes, quaternions, returned

jax.config.update("jax_enable_x64", True)

CHUNK = 256
"""Samples of one call: another number is compiled again. With 64 to 1,024 a sample takes as long."""

INTERVAL = 100
"""Readings between updates."""

read = reading_step(jnp)


def cross(x: Any) -> Any:
    """Return the matrix of a cross product."""
    zero = jnp.zeros(())
    return jnp.array([[zero, -x[2], x[1]], [x[2], zero, -x[0]], [-x[1], x[0], zero]])


def matrix(a: Any, b: Any, c: Any, d: Any) -> Any:
    """Return the matrix of a quaternion."""
    return jnp.array([
        [1.0 - 2.0 * (c * c + d * d), 2.0 * (b * c - a * d), 2.0 * (b * d + a * c)],
        [2.0 * (b * c + a * d), 1.0 - 2.0 * (b * b + d * d), 2.0 * (c * d - a * b)],
        [2.0 * (b * d - a * c), 2.0 * (c * d + a * b), 1.0 - 2.0 * (b * b + c * c)],
    ])  # fmt: skip


def model(state: Any, sums: Any, axes: Any, duration: float, densities: Any) -> tuple[Any, Any]:
    """Return transition matrix and noise of a step, as `transition` and `noise_of_step` of the compiled filter."""
    t, eye, zero = duration, jnp.eye(3), jnp.zeros((3, 3))
    spin = EARTH_RATE * jnp.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    place = jnp.stack(state[7:])
    radius = jnp.sqrt(place @ place)
    unit = place / radius
    gradient = MU / radius**3 * (3.0 * jnp.outer(unit, unit) - eye) - spin @ spin
    first, second = cross(jnp.stack(sums[:3])), cross(jnp.stack(sums[3:]))
    phi = jnp.block([
        [eye - spin * t, zero, zero, axes * t, zero],
        [-first, eye - 2.0 * t * spin + 0.5 * t * t * gradient, t * gradient, -0.5 * t * first @ axes, axes * t],
        [-second, eye * t - t * t * spin, eye + 0.5 * t * t * gradient, -t / 3.0 * second @ axes, 0.5 * t * t * axes],
        [zero, zero, zero, eye, zero],
        [zero, zero, zero, zero, eye],
    ])  # fmt: skip
    force, (gyro, accelerometer) = first / t, densities
    turned = -force @ force * gyro
    q = jnp.block([
        [gyro * t * eye, gyro * t**2 / 2.0 * force, gyro * t**3 / 6.0 * force],
        [-gyro * t**2 / 2.0 * force, accelerometer * t * eye + turned * t**3 / 3.0,
         accelerometer * t**2 / 2.0 * eye + turned * t**4 / 8.0],
        [-gyro * t**3 / 6.0 * force, accelerometer * t**2 / 2.0 * eye + turned * t**4 / 8.0,
         accelerometer * t**3 / 3.0 * eye + turned * t**5 / 20.0],
    ])  # fmt: skip
    return phi, jnp.pad(q, ((0, 6), (0, 6)))


def flight(case: Case, given: bool) -> Any:
    """Make the compiled function of samples: start, biases, key or noise to states, shape (n, U, 10)."""
    readings = jnp.array(case.increments.reshape(-1, INTERVAL, 6).swapaxes(1, 2))
    truth, level = jnp.array(case.measured[:, :6]), jnp.array(level_axes(case))
    covariance, variances = jnp.array(initial_covariance(case)), case.measurement**2
    sizes, densities = jnp.array(case.noise[:, None] * np.sqrt(READING)), (case.noise[0] ** 2, case.noise[3] ** 2)
    numbers = jnp.arange(len(readings))

    def one(start: Any, biases: Any, key: Any, added: Any, disturbances: Any) -> Any:
        def take(carry: Any, reading: Any) -> Any:
            (state, sums, before, middle), number = carry
            state, sums = read(state, sums, reading, before, READING)
            halfway = 2 * (number + 1) == INTERVAL
            middle = tuple(jnp.where(halfway, new, old) for new, old in zip(state[:4], middle, strict=True))
            return ((state, sums, reading, middle), number + 1), None

        def pass_update(carry: Any, now: Any) -> Any:
            state, left, before, p = carry
            increments, true, axes_of_level, number, noise, disturbance = now
            if not given:
                first, second = jax.random.split(jax.random.fold_in(key, number))
                noise = sizes * jax.random.normal(first, (6, INTERVAL))
                errors = jnp.sqrt(variances) * jax.random.normal(second, (6,))
            else:
                errors = (disturbance.reshape(2, 3) @ axes_of_level.T).ravel()
            nothing = (jnp.zeros(()),) * 6
            measured = tuple(increments + left[:, None] + noise)  # six rows, in each of which samples are neighbours
            # several readings in one turn of the loop (unroll) are slower
            begin = ((state, nothing, before, state[:4]), 0)
            ((state, sums, before, middle), _), _ = jax.lax.scan(take, begin, measured)
            phi, q = model(state, sums, matrix(*middle), INTERVAL * READING, densities)
            p = phi @ p @ phi.T + q
            indicated = jnp.stack([*state[7:], *state[4:7]])
            innovation, correction = indicated - true - errors, jnp.zeros(15)
            for m, j in enumerate((6, 7, 8, 3, 4, 5)):
                gain = p[j] / (p[j, j] + variances[m])
                correction = correction + gain * (innovation[m] - correction[j])
                p = p - jnp.outer(gain, p[j])
            b, c, d = -0.5 * correction[0], -0.5 * correction[1], -0.5 * correction[2]
            e, f, g, h = state[:4]
            a = 1.0 - 0.5 * (b * b + c * c + d * d)
            turned = jnp.stack([
                a * e - b * f - c * g - d * h, a * f + b * e + c * h - d * g,
                a * g - b * h + c * e + d * f, a * h + b * g - c * f + d * e,
            ])  # fmt: skip
            turned = turned / jnp.sqrt(turned @ turned)
            state = tuple(jnp.concatenate([turned, jnp.stack(state[4:]) - correction[3:9]]))
            return (state, left - READING * correction[9:], before, p), jnp.stack(state)

        carry = (tuple(start), biases, (jnp.zeros(()),) * 6, covariance)
        return jax.lax.scan(pass_update, carry, (readings, truth, level, numbers, added, disturbances))[1]

    return jax.jit(jax.vmap(one, in_axes=(0, 0, 0, 0 if given else None, 0 if given else None)))


def prepare(case: Case, setting: float, cores: int) -> Simulate:
    """Samples in chunks of one size; XLA shares them among cores itself."""
    if setting != INTERVAL * READING or np.any(np.diff(case.updates, prepend=0) != INTERVAL):
        raise ValueError("written for one step of the covariance between updates that are a second apart")
    drawing, following = flight(case, False), flight(case, True)
    nothing = jnp.zeros((len(case.updates), 1)), jnp.zeros((len(case.updates), 1))

    def simulate(samples: Samples, seed: int) -> Array:
        start, left = quaternions(case.started(samples)), samples.biases * READING
        count = len(samples)
        if samples.given:
            keys = jax.random.split(jax.random.key(seed), count)
            noise = samples.increments.reshape(count, -1, INTERVAL, 6).swapaxes(2, 3)
            found = following(start, left, keys, noise, samples.measurements)
        else:
            keys = jax.random.split(jax.random.key(seed), CHUNK)
            found = drawing(np.resize(start, (CHUNK, 10)), np.resize(left, (CHUNK, 6)), keys, *nothing)
        places = np.searchsorted(case.updates, case.epochs)
        return returned(np.asarray(found)[:count, places])

    return simulate


PEER = Peer(prepare, "covariance step [s]", (INTERVAL * READING,), CHUNK, "own")
