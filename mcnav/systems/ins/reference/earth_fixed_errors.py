"""Error model of the reference engine's filter, in earth-fixed axes, along the navigator's own indicated trajectory.

With the attitude error psi (rotation vector from true to indicated axes), the errors dv of velocity and dr of position,
C from the instruments' axes to earth-fixed ones, the force f = C f~, the earth's rate W and gravitation g (Groves 2013,
*Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*, section 14.2.3, with the whole gradient
of gravitation)::

    psi' = -W x psi + C dw
    dv'  = psi x f - 2 W x dv + (dg/dr) dr - W x (W x dr) + C df
    dr'  = dv

The errors dw and df of the compensated readings are linear in the filter's other states, which are constants, random
walks or Gauss-Markov processes. Gravity disturbances enter dv' along the local axes, and decay with the distance
travelled at the indicated speed (`mcnav.systems.ins.reference.indicated_gravity`).

Over a step of the filter the matrix F of this system is its mean; the transition is its exponential to third order,
with the exact decay of the other states, and process noise is integrated by Simpson's rule. What the mean neglects is
of second order in the step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.compiled.jit import compiled
from mcnav.systems.ins.filter.model import NAVIGATION, FilterModel, FilterState
from mcnav.systems.ins.imu.gravity import DISTURBANCES
from mcnav.systems.ins.imu.instruments import ACCELEROMETER, AXES, CROSS_AXES, GYRO, Imu
from mcnav.systems.ins.reference.axes import ATTITUDE, POSITION, VELOCITY, cross_matrix
from mcnav.systems.ins.reference.normal_field import normal_gravitation
from mcnav.systems.ins.sensors.flexure import FlexureState

GRADIENT_STEP: Final = 100.0
"""Step of the central differences of gravitation, m: their error is 2e-10 of the gradient."""

SMALL: Final = 0.1
"""Duration, in correlation times, up to which the integrals of the decay are series: 1e-11 of them is lost at most."""

_TERMS: Final = 7

_INPUTS: Final = ("one", *(f"rate_{axis}" for axis in AXES), *(f"force_{axis}" for axis in AXES))
_INPUTS_ALL: Final = (*_INPUTS, *(f"force_squared_{axis}" for axis in AXES))


@dataclass(frozen=True)
class InstrumentState:
    """A state of the filter that is an error of an instrument.

    Attributes
    ----------
    place : int
        Among the filter's states besides those of navigation.
    gyro : bool
        Whether it is one of the gyros, or of the accelerometers.
    constant : int
        Constant error of the instrument as which it acts: its number in `GYRO` or `ACCELEROMETER`.
    axis : int
        Axis that reads it.
    input : int
        What it multiplies: one, a rate, a force or the square of a force.
    """

    place: int
    gyro: bool
    constant: int
    axis: int
    input: int


def instrument_states(states: Sequence[FilterState]) -> tuple[InstrumentState, ...]:
    """Find those states of a filter that are errors of instruments."""
    result = []
    for place, state in enumerate(states):
        name = state.name.replace("_bias_instability_", "_bias_")
        for names in (GYRO, ACCELEROMETER):
            if name in names:
                number, gyro = names.index(name), names is GYRO
                result.append(InstrumentState(place, gyro, number, *_reading(number, gyro)))
    return tuple(result)


def _reading(number: int, gyro: bool) -> tuple[int, int]:
    """Return the axis that reads a constant error of an instrument, and what the error multiplies."""
    kind, axis = divmod(number, 3)
    own = "rate" if gyro else "force"
    if kind == 0:
        return axis, 0
    if kind == 1:
        return axis, _INPUTS_ALL.index(f"{own}_{AXES[axis]}")
    if number < len(GYRO) - 3:
        reads, along = CROSS_AXES[number - 6]
        return AXES.index(reads), _INPUTS_ALL.index(f"{own}_{along}")
    return axis, _INPUTS_ALL.index(f"{'force' if gyro else 'force_squared'}_{AXES[axis]}")


@dataclass(frozen=True)
class Driving:
    """White noise that drives an error model.

    Attributes
    ----------
    gyro, accelerometer : ndarray, shape (3,)
        N of the readings: rad/sqrt(s), m/s/sqrt(s).
    states : ndarray, shape (q,)
        Share of the own density of each of the other states, 0 or 1.
    """

    gyro: Array
    accelerometer: Array
    states: Array


@dataclass(frozen=True)
class GravityStates:
    """States of a filter that are gravity disturbances, g of them.

    Attributes
    ----------
    places : ndarray of int, shape (g,)
        Among the filter's states besides those of navigation.
    disturbances : ndarray of int, shape (g,)
        Their numbers in `mcnav.systems.ins.imu.gravity.DISTURBANCES`.
    lengths : ndarray, shape (g,)
        Correlation lengths, m.
    """

    places: IndexArray
    disturbances: IndexArray
    lengths: Array

    @classmethod
    def of(cls, states: Sequence[FilterState]) -> GravityStates:
        """Find them among the states of a filter."""
        found = [place for place, state in enumerate(states) if state.name in DISTURBANCES]
        return cls(
            np.array(found, dtype=np.int64),
            np.array([DISTURBANCES.index(states[place].name) for place in found], dtype=np.int64),
            np.array([states[place].correlation_length for place in found]),
        )


@dataclass(frozen=True)
class ErrorModel:
    """System of the filter's states: psi, dv, dr and q others."""

    model: FilterModel

    @cached_property
    def states(self) -> tuple[FilterState, ...]:
        """States besides those of navigation."""
        return self.model.states

    @cached_property
    def size(self) -> int:
        """Number of all states."""
        return NAVIGATION + len(self.states)

    @cached_property
    def instruments(self) -> tuple[InstrumentState, ...]:
        """States that are errors of instruments."""
        return instrument_states(self.states)

    @cached_property
    def gravity(self) -> GravityStates:
        """States that are gravity disturbances."""
        return GravityStates.of(self.states)

    @cached_property
    def decay_rates(self) -> Array:
        """Inverse correlation times of the other states, shape (q,), 1/s; zero of gravity disturbances and flexures."""
        return np.array([1.0 / state.correlation_time if state.flexure is None else 0.0 for state in self.states])

    @cached_property
    def _flexures(self) -> tuple[tuple[int, FlexureState], ...]:
        """Places of the angles of flexures among all states; each is followed by its rate."""
        return tuple(
            (NAVIGATION + place, state.flexure)
            for place, state in enumerate(self.states)
            if state.flexure is not None and not state.flexure.rate
        )

    @cached_property
    def considered(self) -> IndexArray:
        """Places of the states that are not estimated, among all."""
        return NAVIGATION + np.flatnonzero([state.considered for state in self.states])

    def flexed(self, estimates: Array, duration: float) -> Array:
        """Return the estimates, shape (q,), of which those of flexures are taken over a duration, s."""
        for place, state in self._flexures:
            pair = slice(place - NAVIGATION, place - NAVIGATION + 2)
            estimates[pair] = state.flexure.transitions(np.array([duration]))[0] @ estimates[pair]
        return estimates

    def rates_at(self, speeds: Array) -> Array:
        """Return what the other states decay by, 1/s, at speeds over the earth, shape (n,) m/s: shape (n, q)."""
        rates = np.tile(self.decay_rates, (len(speeds), 1))
        rates[:, self.gravity.places] = speeds[:, None] / self.gravity.lengths
        return rates

    def _driven(self, rates: Array) -> Array:
        """Return the densities of the white noise that drives the other states, at their rates of decay."""
        sigma, walk = (np.array([getattr(state, name) for state in self.states]) for name in ("sigma", "walk"))
        return np.asarray(2.0 * sigma**2 * rates * (rates > 0.0) + walk**2)

    @cached_property
    def _alone(self) -> tuple[IndexArray, Array]:
        """Places of the correlated errors of sensors among the other states, and their variances."""
        result = np.setdiff1d(np.flatnonzero(self.decay_rates), [instrument.place for instrument in self.instruments])
        return result, np.array([self.states[place].sigma for place in result]) ** 2

    def initial_covariance(self, to_outputs: Array) -> Array:
        """Compute the covariance at the start, from the map of psi, dv, dr to the outputs, shape (9, 9)."""
        initial_covariance = np.diag(np.concatenate([np.zeros(NAVIGATION), [state.sigma**2 for state in self.states]]))
        inverse = np.linalg.inv(to_outputs)
        initial_covariance[:NAVIGATION, :NAVIGATION] = inverse @ self.model.beliefs.covariance @ inverse.T
        return initial_covariance

    def transitions(
        self, spin: float, steps: FilterSteps, axes: Array, rates: Array, forces: Array, gradients: Array,
        pulls: Array | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Compute the transitions over K steps of the filter and the noise that processes add.

        Parameters
        ----------
        steps : FilterSteps
        axes : ndarray, shape (n, 3, 3)
            C at the middles of the navigator's steps.
        rates, forces : ndarray, shape (n, 3)
            Compensated readings, as means over the navigator's steps.
        gradients : ndarray, shape (K, 3, 3)
            Of gravitation, 1/s^2.
        pulls : ndarray, shape (n, 3, g), optional
            Responses of dv' to gravity disturbances, if the filter has such states.

        Returns
        -------
        tuple of ndarray, shape (K, 9 + q, 9 + q)
        """
        imu: Imu = self.model.beliefs.imu
        everything = Driving(imu.gyro.random_walk, imu.accelerometer.random_walk, np.ones(len(self.states)))
        passed = (axes, rates, forces, gradients)
        whole, (noise,) = self.transitions_by_cause(spin, steps, *passed, (everything,), pulls)
        return whole, noise

    def transitions_by_cause(
        self, spin: float, steps: FilterSteps, axes: Array, rates: Array, forces: Array, gradients: Array,
        causes: Sequence[Driving], pulls: Array | None = None,
    ) -> tuple[Array, list[Array]]:  # fmt: skip
        """Compute the transitions as `transitions` does, and the noise that each of several causes adds."""
        system, coupling = self._system(spin, steps, axes, rates, forces, gradients)
        if pulls is not None:
            coupling[:, VELOCITY, self.gravity.places] = steps.mean(pulls)
        square = system @ system
        cube, first, second = square @ system, system @ coupling, square @ coupling
        half, whole = (
            self._transition(integral, (system, square, cube), (coupling, first, second))
            for integral in steps.integrals
        )
        for place, state in self._flexures:
            pair = slice(place, place + 2)
            half[:, pair, pair] = state.flexure.transitions(0.5 * steps.durations)
            whole[:, pair, pair] = state.flexure.transitions(steps.durations)
        return whole, [self._accumulated(steps, axes, half, whole, cause) for cause in causes]

    def _accumulated(self, steps: FilterSteps, axes: Array, half: Array, whole: Array, cause: Driving) -> Array:
        """Integrate the noise of a cause over the steps of the filter by Simpson's rule, shape (K, 9 + q, 9 + q)."""
        size = self.size
        white = np.zeros((len(steps.durations), size, size))
        for place, random_walk in ((ATTITUDE, cause.gyro), (VELOCITY, cause.accelerometer)):
            if np.any(random_walk):
                density = axes * random_walk**2 @ np.swapaxes(axes, -1, -2)
                white[:, place, place] = steps.mean(density)
        others = np.arange(NAVIGATION, size)
        white[:, others, others] = self._driven(steps.rates) * cause.states
        # a cause drives navigation and its own states alone
        driven = np.concatenate([np.arange(NAVIGATION), others[cause.states != 0.0]])
        block = np.s_[:, driven[:, None], driven]
        noise = np.zeros_like(white)
        own, middle, end = white[block], half[block], whole[block]
        own = own + 4.0 * (middle @ own @ np.swapaxes(middle, -1, -2)) + end @ own @ np.swapaxes(end, -1, -2)
        noise[block] = own * (steps.durations / 6.0)[:, None, None]
        # correlated errors of sensors drive no other state, and may be shorter than a step
        alone, variances = self._alone
        remaining = np.exp(-2.0 * np.outer(steps.durations, self.decay_rates[alone]))
        noise[:, NAVIGATION + alone, NAVIGATION + alone] = variances * cause.states[alone] * (1.0 - remaining)
        for first, state in self._flexures:
            variance, pair = cause.states[first - NAVIGATION] * state.sigma**2, slice(first, first + 2)
            noise[:, pair, pair] = variance * state.flexure.added(steps.durations)
        return np.asarray(noise)

    def _system(
        self, spin: float, steps: FilterSteps, axes: Array, rates: Array, forces: Array, gradients: Array
    ) -> tuple[Array, Array]:
        """Compute the matrices of the system of psi, dv, dr and of its coupling to the other states."""
        count = len(steps.durations)
        turning = cross_matrix(np.array([0.0, 0.0, spin]))
        system = np.zeros((count, NAVIGATION, NAVIGATION))
        system[:, ATTITUDE, ATTITUDE] = -turning
        system[:, VELOCITY, ATTITUDE] = -cross_matrix(steps.mean(np.einsum("nij,nj->ni", axes, forces)))
        system[:, VELOCITY, VELOCITY] = -2.0 * turning
        system[:, VELOCITY, POSITION] = gradients - turning @ turning
        system[:, POSITION, VELOCITY] = np.eye(3)
        coupling = np.zeros((count, NAVIGATION, len(self.states)))
        if self.instruments:
            inputs = np.concatenate([np.ones((len(rates), 1)), rates, forces, forces**2], axis=1)
            columns = axes[:, :, [instrument.axis for instrument in self.instruments]]
            columns = steps.mean(columns * inputs[:, None, [instrument.input for instrument in self.instruments]])
            for number, instrument in enumerate(self.instruments):
                coupling[:, ATTITUDE if instrument.gyro else VELOCITY, instrument.place] = columns[:, :, number]
        return system, coupling

    def _transition(self, integrals: Array, system: Sequence[Array], coupling: Sequence[Array]) -> Array:
        """Assemble transitions, shape (K, 9 + q, 9 + q), from the integrals of the decays."""
        transition = np.zeros((len(integrals), self.size, self.size))
        transition[:, :NAVIGATION, :NAVIGATION] = np.eye(NAVIGATION)
        others = np.arange(NAVIGATION, self.size)
        transition[:, others, others] = integrals[:, 0, :-1]
        for order in range(3):
            # the last column is that of a state that does not decay
            transition[:, :NAVIGATION, :NAVIGATION] += integrals[:, order + 1, -1, None, None] * system[order]
            transition[:, :NAVIGATION, NAVIGATION:] += integrals[:, order + 1, None, :-1] * coupling[order]
        return transition


@dataclass(frozen=True)
class FilterSteps:
    """Steps of the filter between two stops, K of them, each of one or more steps of the navigator.

    Attributes
    ----------
    begins : ndarray of int, shape (K,)
        First of the navigator's steps.
    weights : ndarray, shape (n,)
        Share of each of the navigator's steps in the filter's.
    durations : ndarray, shape (K,)
        s.
    rates : ndarray, shape (q,) or (K, q)
        Of decay of the other states, 1/s.
    """

    begins: IndexArray
    weights: Array
    durations: Array
    rates: Array

    @classmethod
    def group(cls, durations: Array, longest: float, decay_rates: Array) -> FilterSteps:
        """Group the navigator's steps, shape (n,) s, into as equal parts as they allow."""
        ends = np.cumsum(durations)
        parts = max(int(np.ceil(ends[-1] / longest - 1e-6)), 1)
        middles = ends - 0.5 * durations
        number = np.minimum((middles / ends[-1] * parts).astype(np.int64), parts - 1)
        begins = np.flatnonzero(np.diff(number, prepend=-1))
        totals = np.add.reduceat(durations, begins)
        counts = np.diff(begins, append=len(durations))
        return cls(begins, durations / np.repeat(totals, counts), totals, decay_rates)

    @cached_property
    def integrals(self) -> tuple[Array, Array]:
        """Decay of the other states and its integrals, up to half a step and up to the whole: shape (K, 4, q + 1)."""
        rates = np.concatenate([self.rates, np.zeros((*self.rates.shape[:-1], 1))], axis=-1)
        return _decay_integrals(0.5 * self.durations, rates), _decay_integrals(self.durations, rates)

    @property
    def middles(self) -> IndexArray:
        """Steps of the navigator at whose ends the filter's steps are half over."""
        ends = np.append(self.begins[1:], len(self.weights))
        return np.asarray((self.begins + ends - 1) // 2)

    def mean(self, values: Array) -> Array:
        """Average over each step of the filter what was given for the navigator's, shape (n, ...)."""
        weights = self.weights.reshape(-1, *np.ones(values.ndim - 1, dtype=int))
        return np.asarray(np.add.reduceat(weights * values, self.begins, axis=0))


def _decay_integrals(durations: Array, rates: Array) -> Array:
    """Compute exp(-a s) and its first three repeated integrals over durations s, shape (K, 4, q).

    The rates a are of shape (q,), or (K, q).

    The k-th is ``s^k sum_j (-a s)^j / (k + j)!``, and by recursion ``(s^(k-1) / (k-1)! - previous) / a``.
    """
    x = durations[:, None] * rates
    decay_integrals = np.empty((len(durations), 4, rates.shape[-1]))
    decay_integrals[:, 0] = np.exp(-x)
    factorials = np.cumprod(np.append(1.0, np.arange(1.0, _TERMS + 4)))
    for k in (1, 2, 3):
        power = durations[:, None] ** k
        series = np.polynomial.polynomial.polyval(-np.minimum(x, SMALL), 1.0 / factorials[k : k + _TERMS])
        safe = np.where(rates > 0.0, rates, 1.0)
        recursion = (durations[:, None] ** (k - 1) / factorials[k - 1] - decay_integrals[:, k - 1]) / safe
        decay_integrals[:, k] = np.where(x <= SMALL, power * series, recursion)
    return decay_integrals


@compiled
def gravitation_gradients(constants: Array, positions: Array) -> Array:
    """Compute the gradients of gravitation at positions, shape (n, 3), by central differences: shape (n, 3, 3).

    They are those of the closed form, and not of the zonal harmonics of `Earth.gravity_gradient`: the engines stay
    independent.
    """
    gradients = np.empty((len(positions), 3, 3))
    there = np.empty(3)
    for row in range(len(positions)):
        for axis in range(3):
            for i in range(3):
                there[i] = positions[row, i]
            there[axis] += GRADIENT_STEP
            ax, ay, az = normal_gravitation(constants, there[0], there[1], there[2])
            there[axis] -= 2.0 * GRADIENT_STEP
            bx, by, bz = normal_gravitation(constants, there[0], there[1], there[2])
            gradients[row, 0, axis] = (ax - bx) / (2.0 * GRADIENT_STEP)
            gradients[row, 1, axis] = (ay - by) / (2.0 * GRADIENT_STEP)
            gradients[row, 2, axis] = (az - bz) / (2.0 * GRADIENT_STEP)
    return gradients
