"""Tables that filters share along the truth: transitions, process noise, responses of innovations to their states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array, IndexArray
from mcnav.systems.ins.filter.model import NAVIGATION, FilterModel, FilterState
from mcnav.systems.ins.imu.gravity import DISTURBANCES
from mcnav.systems.ins.imu.instruments import ACCELEROMETER, CONSTANTS, GYRO, OUTPUTS, Imu
from mcnav.systems.ins.linear.covariance import output_map, process_systems, transitions
from mcnav.systems.ins.linear.response import StepResponses
from mcnav.systems.ins.linear.response_blocks import Responses
from mcnav.systems.ins.sensors.aiding import Sensor, aiding_constants
from mcnav.systems.ins.sensors.measurements import Measurements, flexure_rows, jitter_rows, rate_error, white_sigmas
from mcnav.systems.ins.truth.trajectory import Platform, Truth


class StepNoise(NamedTuple):
    """Covariances Q that processes add in K steps; of the other states, only neighbours in pairs are correlated.

    Attributes
    ----------
    white : ndarray, shape (K, 9, 9)
        Of psi, v, x.
    cross : ndarray, shape (K, 9, q)
        Of these with the other states.
    driven : ndarray, shape (K, q)
        Variances of the other states.
    paired : ndarray, shape (K, q)
        Covariance of each with the one before it.
    """

    white: Array
    cross: Array
    driven: Array
    paired: Array


def noise_matrices(noise: StepNoise, steps: slice = slice(None)) -> Array:
    """Return Q of some steps, shape (k, 9 + q, 9 + q)."""
    white, cross, driven, paired = (table[steps] for table in noise)
    matrices, others = np.zeros((len(white), *np.add(driven.shape[1:] * 2, NAVIGATION))), slice(NAVIGATION, None)
    matrices[:, :NAVIGATION, :NAVIGATION] = white
    matrices[:, :NAVIGATION, others], matrices[:, others, :NAVIGATION] = cross, cross.swapaxes(1, 2)
    places = NAVIGATION + np.arange(driven.shape[1])
    matrices[:, places, places] = driven
    matrices[:, places[1:], places[:-1]] = matrices[:, places[:-1], places[1:]] = paired[:, 1:]
    return matrices


@dataclass(frozen=True)
class FilterTables:
    """A filter of 9 + q states along the truth, over K steps and U updates.

    Attributes
    ----------
    transitions : ndarray, shape (K, 9, 9 + q)
        Responses of psi, v, x to themselves and to the errors that the other states are.
    decay : ndarray, shape (K, q)
        What is left of these at the end of a step.
    noise : StepNoise
    initial : ndarray, shape (9 + q, 9 + q)
    rows : ndarray, shape (U, M, q)
        Responses of the innovations to the other states.
    variances : ndarray, shape (U, M)
        Of the measurements' white noise, as believed.
    corrected : ndarray, shape (9 + q,)
        1 for estimated states, 0 for considered ones.
    constants : ndarray of int, shape (q,)
        Number of the constant source that a state models, -1 for none.
    exact : ndarray of bool, shape (q,)
        Whether a state models a constant error of the instruments exactly.
    processes : tuple of tuple of str
        Processes that each state models.
    parts : tuple of int
        Number of the bias of these processes that a state models: 1 for the second of a flexure, else 0.
    natural : ndarray, shape (K + 1, q, 2)
        What a state that is shown has of the state itself and of the other one of its pair, at the times of the grid:
        one and zero but for flexure.
    partners : ndarray of int, shape (q,)
        Number of that other one; of a state without one its own.
    believed : Responses
        To the processes of the instruments as believed.
    rate_errors : ndarray of int, shape (q,)
        Number of the gyros' constant error as which a state enters the rate that a lever arm needs, -1 for none.
    """

    transitions: Array
    decay: Array
    noise: StepNoise
    initial: Array
    rows: Array
    variances: Array
    corrected: Array
    constants: IndexArray
    exact: NDArray[np.bool_]
    processes: tuple[tuple[str, ...], ...]
    rate_errors: IndexArray
    parts: tuple[int, ...]
    natural: Array
    partners: IndexArray
    believed: Responses

    @property
    def coupling(self) -> Array:
        """Responses of psi, v, x to the errors that the other states are, shape (K, 9, q)."""
        return self.transitions[:, :, NAVIGATION:]


def tabulate_filter(
    truth: Truth, platform: Platform, imu: Imu, responses: Responses, model: FilterModel, measurements: Measurements
) -> FilterTables:
    """Tabulate a filter along the truth, from the responses to the true processes of the instruments over the steps."""
    beliefs, states = model.beliefs, model.states
    count, steps = len(states), len(responses.times) - 1
    believed = (
        responses if same_memory(imu, beliefs.imu) else replace(responses, imu=beliefs.imu, _first={}, _latest=[])
    )
    sources = {name: number for number, name in enumerate((*CONSTANTS, *aiding_constants(beliefs.sensors)))}
    components = [component for sensor in beliefs.sensors for component in sensor.components]
    sigmas = white_sigmas(beliefs.sensors, measurements)
    modelled = tuple(
        _process_of(state.name, sources) if state.flexure is None else state.flexure.process for state in states
    )
    tables = FilterTables(
        np.zeros((steps, NAVIGATION, NAVIGATION + count)), np.ones((steps, count)),
        StepNoise(
            np.zeros((steps, NAVIGATION, NAVIGATION)), np.zeros((steps, NAVIGATION, count)), np.zeros((steps, count)),
            np.zeros((steps, count)),
        ),
        initial_covariance(truth, beliefs.covariance, states, float(responses.times[0]), 0.0),
        np.zeros((*measurements.components.shape, count)), sigmas**2,
        np.array([1.0] * NAVIGATION + [0.0 if state.considered else 1.0 for state in states]),
        np.array([sources.get(state.name, -1) for state in states], dtype=np.int64),
        np.array([NAVIGATION <= sources.get(state.name, -1) < len(CONSTANTS) for state in states], dtype=np.bool_),
        tuple(() if name in sources else (name,) for name in modelled),
        np.array([rate_error(state.name) for state in states], dtype=np.int64),
        tuple(0 if state.flexure is None else int(state.flexure.rate) for state in states),
        np.tile(np.array([1.0, 0.0]), (steps + 1, count, 1)), np.arange(count), believed,
    )  # fmt: skip
    for place, (state, name) in enumerate(zip(states, modelled, strict=True)):
        tables.decay[:, place] = np.exp(-np.diff(responses.times) / state.correlation_time)
        if sources.get(state.name, -1) >= len(CONSTANTS):
            tables.rows[:, :, place] = measurements.constants[:, :, sources[state.name] - len(CONSTANTS)]
        for number, component in enumerate(components):
            if name == component.error_name("correlated"):
                tables.rows[:, :, place] = -1.0 * (measurements.components == number)
                added = -np.expm1(-2.0 * np.diff(responses.times) / state.correlation_time)
                tables.noise.driven[:, place] = state.sigma**2 * added
        for number, sensor in enumerate(beliefs.sensors):
            if name == sensor.jitter_name:
                tables.rows[:, :, place] = jitter_rows(measurements, number)
                tables.noise.driven[:, place] = state.sigma**2
        if tables.rate_errors[place] >= 0 and measurements.swings.size:
            tables.rows[:, :, place] = measurements.swings[:, :, tables.rate_errors[place]]
    _fill_flexures(tables, states, responses.times, beliefs.sensors, measurements)
    _fill_steps(tables, responses, beliefs.imu, states, modelled)
    return tables


def _fill_steps(
    tables: FilterTables, responses: Responses, imu: Imu, states: Sequence[FilterState], modelled: Sequence[str]
) -> None:
    """Fill in the transitions, and what the believed processes of the instruments and of gravity do.

    Parameters
    ----------
    modelled : sequence of str
        Processes, by state.
    """
    for (steps, true), (_, own) in zip(responses.blocks(), tables.believed.blocks(), strict=True):
        systems = process_systems(own, imu)
        tables.transitions[steps, :, :NAVIGATION] = transitions(true)
        for place, (state, name) in enumerate(zip(states, modelled, strict=True)):
            if tables.constants[place] >= 0:
                tables.coupling[steps, :, place] = _constant_response(true, state.name)
            if name in systems:
                tables.coupling[steps, :, place] = systems[name][0][:, :NAVIGATION]
            if name in DISTURBANCES:
                tables.decay[steps, place] = systems[name][0][:, NAVIGATION]
            if tables.exact[place]:
                same = np.array_equal(tables.coupling[steps, :, place], _constant_response(true, state.name))
                tables.exact[place] = same and np.all(tables.decay[steps, place] == 1.0)
        of_state = {name: place for place, name in enumerate(modelled) if name in systems}
        _add_noise(StepNoise(*(table[steps] for table in tables.noise)), systems, of_state)


def _fill_flexures(
    tables: FilterTables, states: Sequence[FilterState], times: Array, sensors: Sequence[Sensor],
    measurements: Measurements,
) -> None:  # fmt: skip
    """Fill in what pairs of states that are flexures have besides their decay."""
    numbers = {sensor.name: number for number, sensor in enumerate(sensors)}
    since = times - times[0]
    for place, state in enumerate(states):
        of = state.flexure
        if of is None or of.rate:
            continue
        pair, variance = slice(place, place + 2), of.flexure.sigma[of.axis] ** 2
        tables.rows[:, :, pair] = flexure_rows(measurements, numbers[of.sensor], of.flexure, of.axis, float(times[0]))
        added = variance * of.flexure.noise(since)
        tables.noise.driven[:, pair], tables.noise.paired[:, place + 1] = added[:, [0, 1], [0, 1]], added[:, 1, 0]
        natural = of.flexure.natural(since)
        tables.natural[:, place], tables.natural[:, place + 1] = natural[:, 0], natural[:, 1, ::-1]
        tables.partners[pair] = place + 1, place


def _process_of(name: str, sources: Mapping[str, int]) -> str:
    """Return the name of the process that a state models: with a constant bias, its rate random walk."""
    return name.replace("_bias_", "_rate_random_walk_") if name in sources else name


def initial_covariance(
    truth: Truth, navigation: Array, states: Sequence[FilterState], start: float, since: float
) -> Array:
    """Return the covariance of psi, v, x and of the other states, which are independent, where navigation starts.

    Parameters
    ----------
    navigation : ndarray, shape (9, 9)
        Covariance of the outputs.
    start : float
        Time, s.
    since : float
        Duration since the time from which the states of flexures are counted, s.
    """
    start_map = np.linalg.inv(output_map(truth, start))
    initial = np.diag([0.0] * NAVIGATION + [state.sigma**2 for state in states])
    for place, state in enumerate(states, NAVIGATION):
        if (of := state.flexure) is not None and not of.rate:
            variance, pair = of.flexure.sigma[of.axis] ** 2, slice(place, place + 2)
            initial[pair, pair] = variance * of.flexure.covariance(np.array([since]))[0]
    initial[:NAVIGATION, :NAVIGATION] = start_map @ navigation @ start_map.T
    return initial


def _add_noise(
    noise: StepNoise, systems: Mapping[str, tuple[Array, Array, Array]], of_state: Mapping[str, int]
) -> None:
    """Add what processes add in a step to the covariance of psi, v, x and of the states that model them."""
    navigation = np.zeros_like(noise.white)
    for name, (response, added, _) in systems.items():
        if name not in of_state and response.any():
            continue  # a bias without a state is neglected
        navigation += added[:, :NAVIGATION, :NAVIGATION]
        if name in of_state:
            noise.cross[:, :, of_state[name]] += added[:, :NAVIGATION, NAVIGATION]
            noise.driven[:, of_state[name]] += added[:, NAVIGATION, NAVIGATION]
    noise.white[:] += navigation


def same_memory(one: Imu, other: Imu) -> bool:
    """Return whether the Gauss-Markov processes of two units, and of gravity, have the same correlation."""
    if not np.array_equal(one.gravity.lengths, other.gravity.lengths):
        return False
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
