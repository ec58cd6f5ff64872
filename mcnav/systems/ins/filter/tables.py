"""Tables that filters share along the truth: transitions, process noise, responses of innovations to their states."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.systems.ins.filter.model import NAVIGATION, FilterModel
from mcnav.systems.ins.imu.instruments import ACCELEROMETER, CONSTANTS, GYRO, OUTPUTS, Imu
from mcnav.systems.ins.linear.covariance import output_map, process_systems
from mcnav.systems.ins.linear.response import StepResponses, respond
from mcnav.systems.ins.sensors.aiding import aiding_constants
from mcnav.systems.ins.sensors.measurements import Measurements, rate_error
from mcnav.systems.ins.truth.trajectory import Platform, Truth


@dataclass(frozen=True)
class FilterTables:
    """A filter of 9 + q states along the truth, over K steps and U updates.

    Attributes
    ----------
    coupling : ndarray, shape (K, 9, q)
        Responses of psi, v, x to the errors that the other states are.
    decay : ndarray, shape (K, q)
        What is left of these at the end of a step.
    noise : ndarray, shape (K, 9 + q, 9 + q)
        Covariance that processes add in a step.
    initial : ndarray, shape (9 + q, 9 + q)
    rows : ndarray, shape (U, M, q)
        Responses of the innovations to the other states.
    variances : ndarray, shape (U, M)
        Of the measurements' white noise, as believed.
    corrected : ndarray, shape (9 + q,)
        1 for estimated states, 0 for considered ones.
    constants : ndarray of int, shape (q,)
        Number of the constant source that a state models, -1 for none.
    processes : tuple of tuple of str
        Processes that each state models.
    rate_errors : ndarray of int, shape (q,)
        Number of the gyros' constant error as which a state enters the rate that a lever arm needs, -1 for none.
    """

    coupling: Array
    decay: Array
    noise: Array
    initial: Array
    rows: Array
    variances: Array
    corrected: Array
    constants: IndexArray
    processes: tuple[tuple[str, ...], ...]
    rate_errors: IndexArray


def tabulate_filter(
    truth: Truth,
    platform: Platform,
    imu: Imu,
    responses: StepResponses,
    model: FilterModel,
    measurements: Measurements,
) -> FilterTables:
    """Tabulate a filter along the truth.

    Parameters
    ----------
    imu : Imu
        The true processes of the instruments.
    responses : StepResponses
        Over the steps, for these.
    """
    beliefs, states = model.beliefs, model.states
    times, count = responses.times, len(states)
    steps = len(times) - 1
    believed = responses if same_memory(imu, beliefs.imu) else respond(truth, platform, times, beliefs.imu)
    systems = process_systems(believed, beliefs.imu)
    names = aiding_constants(beliefs.sensors)
    sources = {name: number for number, name in enumerate((*CONSTANTS, *names))}
    components = [component for sensor in beliefs.sensors for component in sensor.components]
    correlated = {component.error_name("correlated"): number for number, component in enumerate(components)}
    durations = np.diff(times)
    coupling, decay = np.zeros((steps, NAVIGATION, count)), np.ones((steps, count))
    noise = np.zeros((steps, NAVIGATION + count, NAVIGATION + count))
    initial = np.zeros((NAVIGATION + count, NAVIGATION + count))
    start_map = np.linalg.inv(output_map(truth, float(times[0])))
    initial[:NAVIGATION, :NAVIGATION] = start_map @ beliefs.covariance @ start_map.T
    rows = np.zeros((*measurements.components.shape, count))
    of_state: dict[str, int] = {}
    linked: list[tuple[str, ...]] = []
    numbers = np.full(count, -1, dtype=np.int64)
    rate_errors = np.array([rate_error(state.name) for state in states], dtype=np.int64)
    for place, state in enumerate(states):
        at = NAVIGATION + place
        initial[at, at] = state.sigma**2
        decay[:, place] = np.exp(-durations / state.correlation_time)
        name = state.name
        modelled: tuple[str, ...] = (name,)
        if name in sources:
            numbers[place] = sources[name]
            coupling[:, :, place] = _constant_response(responses, name)
            if sources[name] >= len(CONSTANTS):
                rows[:, :, place] = measurements.constants[:, :, sources[name] - len(CONSTANTS)]
            name = name.replace("_bias_", "_rate_random_walk_")
            modelled = (name,) if name != state.name else ()
        if name in systems:
            of_state[name] = at
            coupling[:, :, place] = systems[name][0][:, :NAVIGATION]
        elif name in correlated:
            rows[:, :, place] = -1.0 * (measurements.components == correlated[name])
            noise[:, at, at] = state.sigma**2 * -np.expm1(-2.0 * durations / state.correlation_time)
        linked.append(modelled)
        if rate_errors[place] >= 0 and measurements.swings.size:
            rows[:, :, place] = measurements.swings[:, :, rate_errors[place]]
    for name, (response, added, _) in systems.items():
        if name not in of_state and response.any():
            continue  # a bias without a state is neglected
        noise[:, :NAVIGATION, :NAVIGATION] += added[:, :NAVIGATION, :NAVIGATION]
        if name in of_state:
            at = of_state[name]
            noise[:, at, :NAVIGATION] += added[:, NAVIGATION, :NAVIGATION]
            noise[:, :NAVIGATION, at] += added[:, :NAVIGATION, NAVIGATION]
            noise[:, at, at] += added[:, NAVIGATION, NAVIGATION]
    sigmas = np.array([component.noise for component in components])
    corrected = np.array([1.0] * NAVIGATION + [0.0 if state.considered else 1.0 for state in states])
    return FilterTables(
        coupling, decay, noise, initial, rows, sigmas[measurements.components] ** 2, corrected, numbers, tuple(linked),
        rate_errors,
    )  # fmt: skip


def same_memory(one: Imu, other: Imu) -> bool:
    """Return whether the Gauss-Markov processes of two units have the same correlation times."""
    pairs = ((one.gyro, other.gyro), (one.accelerometer, other.accelerometer))
    return all(np.array_equal(a.correlation_time, b.correlation_time) for a, b in pairs)


def _constant_response(responses: StepResponses, name: str) -> Array:
    """Return the responses of psi, v, x to a constant error over the steps, shape (K, 9)."""
    constant_response = np.zeros((len(responses.times) - 1, len(OUTPUTS)))
    if name in GYRO:
        constant_response[:] = responses.gyro[:, GYRO.index(name)]
    elif name in ACCELEROMETER:
        constant_response[:, 3:] = responses.accelerometer[:, ACCELEROMETER.index(name)]
    return constant_response
