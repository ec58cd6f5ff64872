"""Linear covariance of the navigation errors: sensitivities to constant sources, and a covariance for each process."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import local_axes
from mcnav.systems.ins.imu.gravity import DISTURBANCES
from mcnav.systems.ins.imu.instruments import PROCESSES, Imu, Noise, process_sizes
from mcnav.systems.ins.linear.response import StepResponses
from mcnav.systems.ins.truth.trajectory import Truth


@dataclass(frozen=True)
class LinearErrors:
    """The linear system at some epochs, m of them.

    Attributes
    ----------
    times : ndarray, shape (m,)
    partials : ndarray, shape (m, 9, 39)
        Of the outputs to the constant sources.
    processes : mapping of str to ndarray, shape (m, 9, 9)
        Covariance of the outputs from each process, by name; from both deflections of the vertical together.
    """

    times: Array
    partials: Array
    processes: dict[str, Array]


def _cross(vector: Array) -> Array:
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def output_map(truth: Truth, time: float) -> Array:
    """Compute the matrix from psi, v, x in inertial axes to the outputs, shape (9, 9), to first order.

    With the turn ``t = (p_e / (N + h), -p_n / (M + h), -p_e tan(phi) / (N + h))`` of the local axes by the position
    error p: velocity error ``v - Omega x x - t x v_n``, attitude error ``psi - t``, all in n.
    """
    earth = truth.earth
    position, velocity = truth.earth_fixed(np.array([time]))
    latitude, longitude, altitude = earth.to_geodetic(position)[0]
    to_earth_fixed = local_axes(np.array(latitude), np.array(longitude))
    meridian, prime = earth.curvature_radii(latitude)
    axes = (earth.turned(np.array(time - truth.times[0])) @ to_earth_fixed).T  # i to n
    turn = np.zeros((3, 3))
    turn[0, 1] = 1.0 / (prime + altitude)
    turn[1, 0] = -1.0 / (meridian + altitude)
    turn[2, 1] = -np.tan(latitude) / (prime + altitude)
    result = np.zeros((9, 9))
    result[0:3, 6:9] = axes
    result[3:6, 3:6] = axes
    spin = _cross(np.array([0.0, 0.0, earth.rotation_rate]))
    result[3:6, 6:9] = -axes @ spin + _cross(to_earth_fixed.T @ velocity[0]) @ turn @ axes
    result[6:9, 0:3] = axes
    result[6:9, 6:9] = -turn @ axes
    return result


def transitions(responses: StepResponses) -> Array:
    """Return the transition matrices of psi, v, x over the steps, shape (K, 9, 9)."""
    result = np.zeros((len(responses.attitude), 9, 9))
    result[:, :3, :3] = np.eye(3)
    result[:, 3:, :3] = responses.attitude
    result[:, 3:, 3:] = responses.motion
    return result


def constant_inputs(responses: StepResponses) -> Array:
    """Return the responses of psi, v, x to the constant errors of the instruments, shape (K, 9, 30)."""
    inputs = np.zeros((len(responses.attitude), 9, 30))
    inputs[:, :, :15] = responses.gyro.swapaxes(1, 2)
    inputs[:, 3:, 15:] = responses.accelerometer.swapaxes(1, 2)
    return inputs


def process_systems(responses: StepResponses, imu: Imu) -> dict[str, tuple[Array, Array, Array]]:
    """Return the systems of psi, v, x and one bias for each process of instruments and gravity that is not zero.

    Returns
    -------
    mapping of str to (ndarray, ndarray, ndarray)
        By name: the bias's response, shape (K, 10), with its own decay last; the covariance that a step adds, shape
        (K, 10, 10); the variance of the bias at the start, shape ().
    """
    steps = len(responses.attitude)
    durations = np.diff(responses.times)
    gyro = (imu.gyro, responses.gyro_white, responses.gyro_state, responses.gyro_driven, responses.gyro_walk,
            responses.gyro_walked)  # fmt: skip
    accelerometer = (
        imu.accelerometer, responses.accelerometer_white, responses.accelerometer_state,
        responses.accelerometer_driven, responses.accelerometer_walk, responses.accelerometer_walked,
    )  # fmt: skip
    sizes = process_sizes(imu)
    systems: dict[str, tuple[Array, Array, Array]] = {}
    names = iter(PROCESSES)
    for first, (noise, white, state, driven, walk, walked) in ((0, gyro), (3, accelerometer)):
        for axis in range(3):
            if (name := next(names)) in sizes:
                covariance = np.zeros((steps, 10, 10))
                covariance[:, first:9, first:9] = noise.random_walk[axis] ** 2 * white[:, axis]
                systems[name] = (np.zeros((steps, 10)), covariance, np.zeros(()))
        for axis in range(3):
            if (name := next(names)) in sizes:
                variance, correlation = noise.instability[axis] ** 2, noise.correlation_time[axis]
                response, covariance = np.zeros((steps, 10)), np.zeros((steps, 10, 10))
                response[:, first:9], response[:, 9] = state[:, axis], np.exp(-durations / correlation)
                covariance[:, first:, first:] = 2.0 * variance / correlation * driven[:, axis]
                systems[name] = (response, covariance, np.asarray(variance))
        for axis in range(3):
            if (name := next(names)) in sizes:
                response, covariance = np.zeros((steps, 10)), np.zeros((steps, 10, 10))
                response[:, first:9], response[:, 9] = walk[:, axis], 1.0
                covariance[:, first:, first:] = noise.rate_random_walk[axis] ** 2 * walked[:, axis]
                systems[name] = (response, covariance, np.zeros(()))
        for axis in range(3):
            if (name := next(names)) in sizes:
                systems[name] = _quantization(responses, noise, axis, first)
    return systems | _gravity_systems(responses, imu)


def _gravity_systems(responses: StepResponses, imu: Imu) -> dict[str, tuple[Array, Array, Array]]:
    """Return the systems of the gravity disturbances that are not zero."""
    systems, steps = {}, len(responses.attitude)
    for number, name in enumerate(DISTURBANCES):
        if (sigma := imu.gravity.sigma(name)) > 0.0:
            response, covariance = np.zeros((steps, 10)), np.zeros((steps, 10, 10))
            response[:, 3:9], response[:, 9] = responses.gravity.state[:, number], responses.gravity.decay[:, number]
            covariance[:, 3:, 3:] = sigma**2 * responses.gravity.driven[:, number]
            systems[name] = (response, covariance, np.asarray(sigma**2))
    return systems


def _quantization(responses: StepResponses, noise: Noise, axis: int, first: int) -> tuple[Array, Array, Array]:
    """Return the system of one instrument's quantization: the bias is the error of the present reading.

    A step takes back the error of the reading at its beginning, and adds that of the reading at its end.

    Parameters
    ----------
    first : int
        First of the deviations that the reading is part of: 0 for psi, 3 for v.
    """
    steps = len(responses.attitude)
    response, covariance = np.zeros((steps, 10)), np.zeros((steps, 10, 10))
    size, between = (
        noise.quantization[axis],
        responses.gyro_quantized if first == 0 else responses.accelerometer_quantized,
    )
    covariance[:, first:9, first:9] = size**2 * noise.quantization_interval[axis] * between[:, axis]
    reading = np.zeros((steps, 10))
    reading[:, first : first + 3], reading[:, 9] = responses.axes[1:, :, axis], 1.0
    covariance += size**2 * reading[:, :, None] * reading[:, None, :]
    over = transitions(responses)[:, :, first : first + 3]
    response[:, :9] = -np.einsum("krc,kc->kr", over, responses.axes[:-1, :, axis])
    return response, covariance, np.asarray(size**2)


def biased_processes(responses: StepResponses, imu: Imu) -> tuple[str, ...]:
    """Return the names of the processes that are biases, in order."""
    return tuple(name for name, (response, _, _) in process_systems(responses, imu).items() if response.any())
