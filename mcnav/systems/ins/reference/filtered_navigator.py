"""An inertial navigator with its error-state filter, in earth-fixed axes: it takes readings and measurements.

The indicated state is integrated from compensated readings (`mcnav.systems.ins.reference.collocation`,
`mcnav.systems.ins.reference.compensation`); the filter is filterpy's `KalmanFilter` with an error model along the
indicated trajectory (`mcnav.systems.ins.reference.earth_fixed_errors`). Where readings and measurements come from is
the matter of others: of a sample along a truth (`mcnav.systems.ins.reference.aided`), or of a recording
(`mcnav.systems.ins.recorded`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.systems.ins.earth import Earth
from mcnav.systems.ins.filter.model import NAVIGATION
from mcnav.systems.ins.reference.axes import ATTITUDE, POSITION, VELOCITY, cross_matrix
from mcnav.systems.ins.reference.collocation import AT_END, NODES, REASONS, STATE, WEIGHTS, WENT_ON, advance
from mcnav.systems.ins.reference.compensation import Compensation
from mcnav.systems.ins.reference.earth_fixed_errors import ErrorModel, FilterSteps, gravitation_gradients
from mcnav.systems.ins.reference.error_definitions import carried_over, retracted
from mcnav.systems.ins.reference.indicated_gravity import IndicatedGravity
from mcnav.systems.ins.reference.local_frame import LocalFrame
from mcnav.systems.ins.reference.mechanization import LOWEST_SHARE, Diverged, matrices
from mcnav.systems.ins.sensors.comparison import Indicated


class Passage(NamedTuple):
    """Steps that were navigated, n of them: the arguments of an error model, and the filter's transitions over K steps.

    Attributes
    ----------
    axes : ndarray, shape (n, 3, 3)
    rates, forces : ndarray, shape (n, 3)
    gradients : ndarray, shape (K, 3, 3)
    transitions : ndarray, shape (K, 9 + q, 9 + q)
    """

    axes: Array
    rates: Array
    forces: Array
    gradients: Array
    transitions: Array


@dataclass(frozen=True)
class Update:
    """Update of a filter by a measurement.

    Attributes
    ----------
    whitened : ndarray, shape (c,)
        The innovation divided by the Cholesky factor of its covariance.
    covariance : ndarray, shape (c, c)
        Of the innovation, as the filter believes.
    gain : ndarray, shape (9 + q, c)
        Zero where it was rejected.
    accepted : bool
    """

    whitened: Array
    covariance: Array
    gain: Array
    accepted: bool


class FilteredNavigator:
    """A navigator and its filter on their way.

    Parameters
    ----------
    gravitation : ndarray
        Constants of the gravitation.
    state : ndarray, shape (10,)
        Indicated quaternion, velocity and position at the start.
    start : float
        s.
    aligned : float, optional
        Instant at which earth-fixed axes are the inertial ones, s; the start unless given.
    """

    def __init__(
        self, earth: Earth, gravitation: Array, model: ErrorModel, state: Array, start: float,
        aligned: float | None = None,
    ) -> None:  # fmt: skip
        from filterpy.kalman import KalmanFilter

        self.earth, self.gravitation, self.model = earth, gravitation, model
        self.kind = model.model.kind
        self.compensation = Compensation(model)
        self.estimates, self.estimated_at = np.zeros(len(model.states)), start
        self._aligned = start if aligned is None else aligned
        self.state = state
        self.filter: Any = KalmanFilter(dim_x=model.size, dim_z=1)
        self.filter.P = model.initial_covariance(self.frame().to_outputs(state[4:7]))

    def frame(self) -> LocalFrame:
        """Return the local axes at the indicated position."""
        return LocalFrame.at(self.earth, self.state[7:])

    def from_inertial(self) -> Array:
        """Return the map of errors from inertial axes, shape (9 + q, 9 + q): ``v = C^T v_i - W x C^T x_i``."""
        turn = self.earth.turned(np.array(self.estimated_at - self._aligned)).T
        result = np.eye(self.model.size)
        for place in (ATTITUDE, VELOCITY, POSITION):
            result[place, place] = turn
        result[VELOCITY, POSITION] = -cross_matrix(np.array([0.0, 0.0, self.earth.rotation_rate])) @ turn
        return result

    def advance(self, measured: Array, begins: Array, durations: Array, steps: FilterSteps, until: float) -> Passage:
        """Integrate the indicated state and the filter's covariance over n steps, to an instant.

        Parameters
        ----------
        measured : ndarray, shape (n, 3, 6)
            Readings at the Gauss points of the steps.
        begins, durations : ndarray, shape (n,)
            Of the steps, s.

        Raises
        ------
        Diverged
            When the indicated state breaks down.
        """
        elapsed = (begins - self.estimated_at)[:, None] + durations[:, None] * NODES
        readings = self.compensation.compensate(measured, self.estimates, elapsed)
        states = self.integrate(self.state, readings, begins, durations)
        pulls, rates = None, self.model.decay_rates
        if len(self.model.gravity.places):
            along = IndicatedGravity.along(self.earth, self.gravitation, self.model.gravity, states, durations)
            pulls, rates, steps = along.pulls, self.model.rates_at(along.speed), along.taken_by(steps, self.model)
            rates = np.average(rates, axis=0, weights=durations)
            if np.any(push := along.push(self.estimates)):
                # the attitude does not depend on it: as before, it is taken from the readings in their axes
                axes = matrices(states[1:, :4] + states[:-1, :4])
                readings = readings.copy()
                readings[..., 3:] -= np.einsum("nji,nj->ni", axes, push)[:, None]
                states = self.integrate(self.state, readings, begins, durations)
        middles = matrices(states[1:, :4] + states[:-1, :4])
        means = np.einsum("p,npi->ni", WEIGHTS, readings)
        gradients = gravitation_gradients(self.gravitation, states[steps.middles + 1, 7:])
        passed = (middles, means[:, :3], means[:, 3:], gradients)
        transitions, noises = self.model.transitions(self.earth.rotation_rate, steps, *passed, pulls)
        for transition, noise in zip(transitions, noises, strict=True):
            self.filter.predict(F=transition, Q=noise)
        self.state = states[-1]
        self.estimates = self.model.flexed(
            self.estimates * np.exp(-rates * (until - self.estimated_at)), until - self.estimated_at
        )
        self.estimated_at = until
        return Passage(*passed, transitions)

    def integrate(self, state: Array, readings: Array, begins: Array, durations: Array) -> Array:
        """Integrate a state over n steps: at their ends, the first at the beginning, shape (n + 1, 10)."""
        states = np.empty((len(durations) + 1, STATE))
        states[0] = state
        outcome, step = advance(
            self.gravitation, self.earth.rotation_rate, LOWEST_SHARE * self.earth.radius, durations, readings,
            state, states[1:],
        )  # fmt: skip
        if outcome != WENT_ON:
            raise Diverged(f"{REASONS[outcome]} at {begins[step]:.1f} s")
        return states

    def indicated(self, reading: Array, state: Array | None = None) -> Indicated:
        """Return the indicated state, or another, with a compensated reading, shape (6,), at the same instant."""
        state = self.state if state is None else state
        axes = matrices(state[None, :4])[0]
        return Indicated(state[7:], state[4:7], axes, LocalFrame.at(self.earth, state[7:]), reading)

    def extrapolated(self, measured: Array, estimates: Array | None = None) -> Array:
        """Compensate the readings of one step, shape (1, 3, 6), and extrapolate them to its end: shape (6,)."""
        estimates = self.estimates if estimates is None else estimates
        return np.asarray(AT_END @ self.compensation.compensate(measured, estimates, np.zeros((1, 3)))[0])

    def update(self, innovation: Array, response: Array, variances: Array, threshold: float) -> Update:
        """Update the filter by an innovation, if its normalized square is within a threshold; correct the navigator."""
        noise = np.diag(variances)
        covariance = response @ self.filter.P @ response.T + noise
        whitened = np.asarray(np.linalg.solve(np.linalg.cholesky(covariance), innovation))
        if not whitened @ whitened <= threshold:
            return Update(whitened, covariance, np.zeros((self.model.size, len(innovation))), False)
        gain = _correct(self.filter, innovation, response, noise, covariance, self.model.considered)
        change = self.filter.x[:, 0]
        self.filter.x = np.zeros_like(self.filter.x)
        self.correct(change)
        return Update(whitened, covariance, gain, True)

    def correct(self, change: Array) -> None:
        """Correct the navigator by an error of the filter's states, shape (9 + q,), and carry the covariance over."""
        change = retracted(self.kind, change)
        self.state, self.estimates = self.corrected(change)
        self.filter.P = carried_over(self.kind, self.filter.P, change)

    def corrected(self, change: Array) -> tuple[Array, Array]:
        """Return the indicated state and the estimates less an error of the filter's states, shape (9 + q,)."""
        state = self.state.copy()
        state[:4] = _turned_back(state[:4], change[ATTITUDE])
        state[4:7] -= change[VELOCITY]
        state[7:] -= change[POSITION]
        return state, self.estimates + change[NAVIGATION:]


def _correct(
    kalman: Any, innovation: Array, response: Array, variances: Array, covariance: Array, considered: IndexArray
) -> Array:
    """Update filterpy's filter and return the gain; it has no method for considered states, whose gains are zero."""
    if not len(considered):
        kalman.update(innovation[:, None], R=variances, H=response)
        gain = np.asarray(kalman.K)
    else:
        gain = np.linalg.solve(covariance, response @ kalman.P).T
        gain[considered] = 0.0
        left = np.eye(len(gain)) - gain @ response
        kalman.x = kalman.x + gain @ innovation[:, None]
        kalman.P = left @ kalman.P @ left.T + gain @ variances @ gain.T
    kalman.P = 0.5 * (kalman.P + kalman.P.T)
    return np.asarray(gain)


def _turned_back(quaternion: Array, vector: Array) -> Array:
    """Rotate a quaternion, scalar first, back by a rotation vector of its outer axes."""
    size = float(np.linalg.norm(vector))
    scalar, part = np.cos(0.5 * size), -0.5 * np.sinc(size / (2.0 * np.pi)) * vector
    w, u = quaternion[0], quaternion[1:]
    a, b, c = part
    x, y, z = u
    across = np.array([b * z - c * y, c * x - a * z, a * y - b * x])  # np.cross takes ten times as long
    back = np.concatenate([[scalar * w - part @ u], scalar * u + w * part + across])
    return np.asarray(back / np.linalg.norm(back))
