"""Tables that filters share along the truth: transitions, process noise, responses of innovations to their states."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.rows import KEPT
from mcnav.arrays.types import Array, IndexArray
from mcnav.systems.ins.filter.model import NAVIGATION, Beliefs, FilterModel, FilterState
from mcnav.systems.ins.imu.gravity import DISTURBANCES
from mcnav.systems.ins.imu.instruments import ACCELEROMETER, CONSTANTS, GYRO, OUTPUTS, Imu
from mcnav.systems.ins.linear.covariance import output_map, process_systems, transitions
from mcnav.systems.ins.linear.response import StepResponses
from mcnav.systems.ins.linear.response_blocks import Responses
from mcnav.systems.ins.sensors.aiding import aiding_constants
from mcnav.systems.ins.sensors.flexure import FlexureState
from mcnav.systems.ins.sensors.measurements import (
    Measurements,
    Schedule,
    flexure_rows,
    jitter_rows,
    rate_error,
    white_sigmas,
)
from mcnav.systems.ins.truth.trajectory import Truth


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


def noise_matrices(noise: StepNoise) -> Array:
    """Return Q of steps, shape (k, 9 + q, 9 + q)."""
    white, cross, driven, paired = noise
    matrices, others = np.zeros((len(white), *np.add(driven.shape[1:] * 2, NAVIGATION))), slice(NAVIGATION, None)
    matrices[:, :NAVIGATION, :NAVIGATION] = white
    matrices[:, :NAVIGATION, others], matrices[:, others, :NAVIGATION] = cross, cross.swapaxes(1, 2)
    places = NAVIGATION + np.arange(driven.shape[1])
    matrices[:, places, places] = driven
    matrices[:, places[1:], places[:-1]] = matrices[:, places[:-1], places[1:]] = paired[:, 1:]
    return matrices


class FilterOver(NamedTuple):
    """A filter over k steps.

    Attributes
    ----------
    transitions : ndarray, shape (k, 9, 9 + q)
        Responses of psi, v, x to themselves and to the errors that the other states are.
    decay : ndarray, shape (k, q)
        What is left of these at the end of a step.
    noise : StepNoise
    exact : ndarray of bool, shape (q,)
        Whether a state models a constant error of the instruments exactly.
    """

    transitions: Array
    decay: Array
    noise: StepNoise
    exact: NDArray[np.bool_]


@dataclass(frozen=True)
class FilterTables:
    """A filter of 9 + q states along the truth, over K steps and U updates, whose tables are computed in blocks.

    Attributes
    ----------
    responses, believed : Responses
        To the processes of the instruments, true and as believed.
    beliefs : Beliefs
    states : tuple of FilterState
        The q others.
    schedule : Schedule
        Of the updates.
    initial : ndarray, shape (9 + q, 9 + q)
    corrected : ndarray, shape (9 + q,)
        1 for estimated states, 0 for considered ones.
    constants : ndarray of int, shape (q,)
        Number of the constant source that a state models, -1 for none.
    modelled : tuple of str
        Process or constant that each state models.
    """

    responses: Responses
    believed: Responses
    beliefs: Beliefs
    states: tuple[FilterState, ...]
    schedule: Schedule
    initial: Array
    corrected: Array
    constants: IndexArray
    modelled: tuple[str, ...]

    @cached_property
    def sources(self) -> dict[str, int]:
        """Number of each constant source by name."""
        return _sources(self.beliefs)

    @cached_property
    def processes(self) -> tuple[tuple[str, ...], ...]:
        """Processes that each state models."""
        return tuple(() if name in self.sources else (name,) for name in self.modelled)

    @cached_property
    def rate_errors(self) -> IndexArray:
        """Number of the gyros' error as which a state enters the rate of a lever arm, -1 for none, shape (q,)."""
        return np.array([rate_error(state.name) for state in self.states], dtype=np.int64)

    @property
    def parts(self) -> tuple[int, ...]:
        """Number of the bias of its processes that a state models: 1 for the second of a flexure, else 0."""
        return tuple(0 if state.flexure is None else int(state.flexure.rate) for state in self.states)

    @cached_property
    def partners(self) -> IndexArray:
        """Number of the other state of a flexure's pair; of a state without one its own, shape (q,)."""
        partners = np.arange(len(self.states))
        for place, _ in self._flexing:
            partners[place : place + 2] = place + 1, place
        return partners

    @property
    def _flexing(self) -> list[tuple[int, FlexureState]]:
        """Flexures with the places of their pairs of states."""
        pairs = [(place, state.flexure) for place, state in enumerate(self.states)]
        return [(place, of) for place, of in pairs if of is not None and not of.rate]

    def natural(self, numbers: IndexArray) -> Array:
        """Return what states that are shown have of themselves and of their partners, by numbers of times, (m, q, 2).

        One and zero but for flexure.
        """
        natural, times = np.tile(np.array([1.0, 0.0]), (len(numbers), len(self.states), 1)), self.responses.times
        for place, of in self._flexing:
            shown = of.flexure.natural(times - times[0])[numbers]
            natural[:, place], natural[:, place + 1] = shown[:, 0], shown[:, 1, ::-1]
        return natural

    def _compute(self) -> Iterator[tuple[slice, FilterOver]]:
        known = (self.constants >= NAVIGATION) & (self.constants < len(CONSTANTS))
        for (block, true), (_, own) in zip(self.responses.blocks(), self.believed.blocks(), strict=True):
            systems = process_systems(own, self.beliefs.imu)
            over, decay = self._over(block.start, block.stop, true, systems)
            noise, exact = self._noise(block.start, block.stop), known.copy()
            _add_noise(noise, systems, {name: place for place, name in enumerate(self.modelled) if name in systems})
            for place in np.flatnonzero(known).tolist():
                constant = _constant_response(true, self.states[place].name)
                same = np.array_equal(over[:, :, NAVIGATION + place], constant)
                exact[place] = same and np.all(decay[:, place] == 1.0)
            yield block, FilterOver(over, decay, noise, exact)

    def blocks(self) -> Iterator[tuple[slice, FilterOver]]:
        """Yield all steps in blocks, in order; of a few, all at once."""
        steps = len(self.responses.times) - 1
        if steps > KEPT:
            return self._compute()
        return iter([(slice(0, steps), self.whole)])

    @cached_property
    def whole(self) -> FilterOver:
        """All steps at once."""
        transitions, decays, noises, exact = zip(*(over for _, over in self._compute()), strict=True)
        noise = StepNoise._make(map(np.concatenate, zip(*noises, strict=True)))
        return FilterOver(np.concatenate(transitions), np.concatenate(decays), noise, np.all(exact, axis=0))

    @cached_property
    def exact(self) -> NDArray[np.bool_]:
        """Flags of the states that model a constant error of the instruments exactly, shape (q,)."""
        return np.asarray(np.all([over.exact for _, over in self.blocks()], axis=0), dtype=np.bool_)

    def between(
        self, first: int, last: int, systems: Mapping[str, tuple[Array, Array, Array]] | None = None
    ) -> tuple[Array, Array]:
        """Return transitions and decay of `FilterOver` over steps from the first to before the last.

        Parameters
        ----------
        systems : mapping, optional
            Of the believed processes over these steps, of any size, as `process_systems` has them.
        """
        if systems is None and "whole" in self.__dict__:
            return self.whole.transitions[first:last].copy(), self.whole.decay[first:last].copy()
        if systems is None:
            systems = process_systems(self.believed.between(first, last), self.beliefs.imu)
        return self._over(first, last, self.responses.between(first, last), systems)

    def _over(
        self, first: int, last: int, true: StepResponses, systems: Mapping[str, tuple[Array, Array, Array]]
    ) -> tuple[Array, Array]:
        count, durations = len(self.states), np.diff(self.responses.times[first : last + 1])
        over, decay = np.zeros((last - first, NAVIGATION, NAVIGATION + count)), np.ones((last - first, count))
        over[:, :, :NAVIGATION] = transitions(true)
        for place, (state, name) in enumerate(zip(self.states, self.modelled, strict=True)):
            decay[:, place] = np.exp(-durations / state.correlation_time)
            if self.constants[place] >= 0:
                over[:, :, NAVIGATION + place] = _constant_response(true, state.name)
            if name in systems:
                over[:, :, NAVIGATION + place] = systems[name][0][:, :NAVIGATION]
            if name in DISTURBANCES:
                decay[:, place] = systems[name][0][:, NAVIGATION]
        return over, decay

    def _noise(self, first: int, last: int) -> StepNoise:
        """Return what the sensors' processes add to their states over steps."""
        times, sensors, count = self.responses.times, self.beliefs.sensors, len(self.states)
        shapes = ((NAVIGATION, NAVIGATION), (NAVIGATION, count), (count,), (count,))
        noise = StepNoise(*(np.zeros((last - first, *shape)) for shape in shapes))
        correlated = {component.error_name("correlated") for sensor in sensors for component in sensor.components}
        jitters = {sensor.jitter_name for sensor in sensors}
        for place, (state, name) in enumerate(zip(self.states, self.modelled, strict=True)):
            if name in correlated:
                added = -np.expm1(-2.0 * np.diff(times[first : last + 1]) / state.correlation_time)
                noise.driven[:, place] = state.sigma**2 * added
            if name in jitters:
                noise.driven[:, place] = state.sigma**2
        for place, of in self._flexing:
            pair, variance = slice(place, place + 2), of.flexure.sigma[of.axis] ** 2
            added = variance * of.flexure.noise(times[first : last + 1] - times[0])
            noise.driven[:, pair], noise.paired[:, place + 1] = added[:, [0, 1], [0, 1]], added[:, 1, 0]
        return noise

    @cached_property
    def rows(self) -> Array:
        """Responses of all innovations to the other states, shape (U, M, q)."""
        return self.rows_of(self.schedule.whole)

    @cached_property
    def variances(self) -> Array:
        """Variances of all measurements' white noise, as believed, shape (U, M)."""
        return self.variances_of(self.schedule.whole)

    def variances_of(self, measured: Measurements) -> Array:
        """Return the variances of some measurements' white noise, as believed, shape (u, M)."""
        return np.asarray(white_sigmas(self.beliefs.sensors, measured) ** 2)

    def rows_of(self, measured: Measurements) -> Array:
        """Return the responses of some innovations to the other states, shape (u, M, q)."""
        sensors, start = self.beliefs.sensors, float(self.responses.times[0])
        rows = np.zeros((*measured.components.shape, len(self.states)))
        components = [component for sensor in sensors for component in sensor.components]
        correlated = {component.error_name("correlated"): number for number, component in enumerate(components)}
        jitters = {sensor.jitter_name: number for number, sensor in enumerate(sensors)}
        for place, (state, name) in enumerate(zip(self.states, self.modelled, strict=True)):
            if (source := self.sources.get(state.name, -1)) >= len(CONSTANTS):
                rows[:, :, place] = measured.constants[:, :, source - len(CONSTANTS)]
            if name in correlated:
                rows[:, :, place] = -1.0 * (measured.components == correlated[name])
            if name in jitters:
                rows[:, :, place] = jitter_rows(measured, jitters[name])
            if self.rate_errors[place] >= 0 and measured.swings.size:
                rows[:, :, place] = measured.swings[:, :, self.rate_errors[place]]
        numbers = {sensor.name: number for number, sensor in enumerate(sensors)}
        for place, of in self._flexing:
            pair = flexure_rows(measured, numbers[of.sensor], of.flexure, of.axis, start)
            rows[:, :, place : place + 2] = pair
        return rows


def tabulate_filter(
    truth: Truth, imu: Imu, responses: Responses, model: FilterModel, schedule: Schedule
) -> FilterTables:
    """Tabulate a filter along the truth, from the responses to the true processes of the instruments over the steps."""
    beliefs, states = model.beliefs, model.states
    believed = (
        responses if same_memory(imu, beliefs.imu) else replace(responses, imu=beliefs.imu, _first={}, _latest=[])
    )
    sources = _sources(beliefs)
    return FilterTables(
        responses, believed, beliefs, tuple(states), schedule,
        initial_covariance(truth, beliefs.covariance, states, float(responses.times[0]), 0.0),
        np.array([1.0] * NAVIGATION + [0.0 if state.considered else 1.0 for state in states]),
        np.array([sources.get(state.name, -1) for state in states], dtype=np.int64),
        tuple(_process_of(state.name, sources) if state.flexure is None else state.flexure.process for state in states),
    )  # fmt: skip


def _sources(beliefs: Beliefs) -> dict[str, int]:
    return {name: number for number, name in enumerate((*CONSTANTS, *aiding_constants(beliefs.sensors)))}


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
