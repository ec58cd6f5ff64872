"""The navigator itself, one sample at a time: the reference path.

The indicated state in earth-fixed axes is integrated from what the instruments measure (Groves 2013, *Principles of
GNSS, Inertial, and Multisensor Integrated Navigation Systems*, section 5.3; Titterton and Weston 2004, section 3.5)::

    q' = q o w / 2 - W o q / 2
    v' = C(q) f + g(r) - 2 W x v - W x (W x r)
    r' = v

with the quaternion q from instruments' to earth-fixed axes, the velocity v over the earth, the position r, the measured
inertial rate w and specific force f in the instruments' axes, the earth's rate W and the gravitation g of
`mcnav.systems.ins.reference.normal_field`. On a stabilised platform, q is the platform's indicated attitude.

The method is the collocation at three Gauss points (Hairer, Norsett and Wanner 1993, section II.7), of order six. Steps
do not cross the truth's rows, between which it is smooth. Sums are compensated (Kahan): the vertical channel, which
doubles an error every 400 s, makes 1e-7 m in an hour of each unit in the last place of gravity.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.numerics.elements import stack_elements
from mcnav.systems.ins.imu.instruments import ACCELEROMETER, CONSTANTS, GYRO, OUTPUTS, Imu
from mcnav.systems.ins.imu.readings import response_matrix
from mcnav.systems.ins.reference.collocation import NODES, REASONS, STATE, WENT_ON, navigate
from mcnav.systems.ins.reference.navigation_errors import EarthFixedStates, indicated_state, navigation_errors
from mcnav.systems.ins.reference.normal_field import field_constants, normal_gravitation_at
from mcnav.systems.ins.truth.trajectory import Platform, Truth

LONGEST_STEP: Final = 0.1
"""Longest step, s: noise is constant over it. The method's own error is below rounding with steps of 4 s on an
airliner's hour with climbs and turns, which are divided further."""

LARGEST_TURN_ERROR: Final = 1e-17
"""Largest error of the method in a step, rad: a tenth of rounding. At a constant rate it is that of 0.039 rad."""

LOWEST_SHARE: Final = 0.15
"""Smallest distance from the earth's centre, as a share of the equatorial radius: outside the focal disc of WGS-84."""

NEAREST_POLE: Final = 1e-3
"""Smallest distance of an epoch's indicated position from the earth's axis, as a share of the equatorial radius."""

SAME_INSTANT: Final = 1e-7
"""Instants that are no further apart are one, s."""

BLOCK: Final = 20_000
"""Instants at which the truth is evaluated at once."""


class Diverged(ArithmeticError):
    """A sample that cannot be integrated to its end; the message says why and when."""


@dataclass(frozen=True)
class Readings:
    """Readings of perfect instruments at the Gauss points of all steps, S of them, and of the steps to the epochs.

    Attributes
    ----------
    step_times : ndarray, shape (S + 1,)
    values : ndarray, shape (S + m, 3, 6)
        Inertial rate and specific force at the points of each step and, after these, of each epoch's own step.
    epoch_steps : ndarray of int, shape (m,)
        Step at whose beginning an epoch's own step begins.
    epoch_durations : ndarray, shape (m,)
        Durations of these, s: zero where an epoch is the beginning of a step.
    """

    step_times: Array
    values: Array
    epoch_steps: IndexArray
    epoch_durations: Array


@dataclass(frozen=True)
class Mechanization:
    """A navigator along a truth, from the start to the end of navigation.

    Attributes
    ----------
    start, end : float
        In the trajectory's time, s.
    times : ndarray, shape (m,)
        Epochs in order, from start to end; at least one.
    longest_step : float
        s; noise is constant over a step.
    stops : ndarray, shape (s,)
        Rising instants after the start, up to the end, at which steps end besides the truth's rows, s.
    """

    truth: Truth
    platform: Platform
    start: float
    end: float
    times: Array
    longest_step: float = LONGEST_STEP
    stops: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def step_times(self) -> Array:
        """Boundaries of the steps, s; they do not depend on the epochs."""
        return self.readings.step_times

    @cached_property
    def readings(self) -> Readings:
        """Readings of perfect instruments."""
        times = np.asarray(self.times, dtype=float)
        within = np.all(np.diff(times, prepend=self.start, append=self.end) >= 0.0)
        if not (self.start < self.end and len(times) and within):
            raise ValueError(
                f"epochs must be in order from start to end, at least one; "
                f"got {times} s in a navigation from {self.start:g} to {self.end:g} s"
            )
        steps = self._step_times()
        number = np.clip(np.searchsorted(steps, times, side="right") - 1, 0, len(steps) - 2)
        durations = times - steps[number]
        widths = np.concatenate([np.diff(steps), durations])
        begins = np.concatenate([steps[:-1], steps[number]])
        at = (begins[:, None] + widths[:, None] * NODES).ravel()
        blocks = [self._measured(at[begin : begin + BLOCK]) for begin in range(0, len(at), BLOCK)]
        return Readings(steps, np.concatenate(blocks).reshape(-1, 3, 6), number.astype(np.int64), durations)

    @cached_property
    def true_states(self) -> EarthFixedStates:
        """The truth at the start and, after it, at the epochs."""
        return self.earth_fixed(np.concatenate([[self.start], self.times]))

    @cached_property
    def gravitation(self) -> Array:
        """Constants of the gravitation."""
        return field_constants(self.truth.earth)

    def simulate(
        self, errors: Array, gyro_noise: Array | None = None, accelerometer_noise: Array | None = None
    ) -> Array:
        """Simulate one sample: its navigation errors at the epochs.

        Parameters
        ----------
        errors : ndarray, shape (39,)
            In the order of `mcnav.systems.ins.imu.instruments.CONSTANTS`.
        gyro_noise, accelerometer_noise : ndarray, shape (S, 3), optional
            Means over each step, between the step times, of what the processes add to the instruments' readings:
            rad/s and m/s^2.

        Returns
        -------
        ndarray, shape (m, 9)
            In the order of `mcnav.systems.ins.imu.instruments.OUTPUTS`.

        Raises
        ------
        Diverged
            When the indicated position comes near the earth's centre or, at an epoch, a pole, or breaks down.
        """
        errors = np.asarray(errors, dtype=float)
        steps = len(self.step_times) - 1
        if errors.shape != (len(CONSTANTS),):
            raise ValueError(f"errors must have shape ({len(CONSTANTS)},), one for each constant; got {errors.shape}")
        if not np.all(np.isfinite(errors)):
            raise Diverged("the sample has errors that are not finite")
        noises = [np.zeros((steps, 3)) if noise is None else noise for noise in (gyro_noise, accelerometer_noise)]
        for noise in noises:
            if noise.shape != (steps, 3):
                raise ValueError(f"noise must have shape ({steps}, 3), one row for each step; got {noise.shape}")
        start = self.indicated_start(errors[: len(OUTPUTS)])
        instruments = errors[len(OUTPUTS) :]
        gyro, accelerometer = instruments[: len(GYRO)], instruments[-len(ACCELEROMETER) :]
        states = np.empty((len(self.times), STATE))
        lowest = LOWEST_SHARE * self.truth.earth.radius
        readings = self.readings
        outcome, step = navigate(
            self.gravitation, self.truth.earth.rotation_rate, lowest, readings.step_times, readings.values,
            readings.epoch_steps, readings.epoch_durations, response_matrix(gyro), response_matrix(accelerometer),
            np.ascontiguousarray(noises[0]), np.ascontiguousarray(noises[1]), start, states,
        )  # fmt: skip
        if outcome != WENT_ON:
            raise Diverged(f"{REASONS[outcome]} at {readings.step_times[step]:.1f} s")
        away = np.hypot(states[:, 7], states[:, 8]) < NEAREST_POLE * self.truth.earth.radius
        if np.any(away):
            raise Diverged(f"the indicated position came near a pole at {self.times[np.argmax(away)]:.1f} s")
        true = self.true_states
        fixed_states = EarthFixedStates(states[:, 7:], states[:, 4:7], matrices(states[:, :4]))
        at_epochs = EarthFixedStates(true.position[1:], true.velocity[1:], true.axes[1:])
        return navigation_errors(self.truth.earth, at_epochs, fixed_states)

    def indicated_start(self, errors: Array) -> Array:
        """Compute the state, shape (10,), that has the initial errors."""
        from scipy.spatial.transform import Rotation

        true = self.true_states
        first = EarthFixedStates(true.position[:1], true.velocity[:1], true.axes[:1])
        latitude, _, altitude = self.truth.earth.to_geodetic(first.position)[0]
        meridian, _ = self.truth.earth.curvature_radii(latitude)
        if not abs(latitude + errors[0] / (meridian + altitude)) < 0.5 * np.pi:
            raise Diverged("the indicated position is beyond a pole at the start")
        indicated = indicated_state(self.truth.earth, first, errors[None])
        turn = Rotation.from_matrix(indicated.axes[0]).as_quat()
        return np.concatenate([turn[3:], turn[:3], indicated.velocity[0], indicated.position[0]])

    def _step_times(self) -> Array:
        """Divide the time between start, rows of the truth and end into steps."""
        rows = self.truth.times
        inner = rows[(rows > self.start) & (rows < self.end)]
        knots = np.concatenate([[self.start], inner, [self.end]])
        if len(self.stops):
            knots = with_stops(knots, self.stops)
        knots = divide(knots, np.diff(knots) / (self.longest_step * (1.0 + 1e-9)))
        widths = np.diff(knots)
        at = (knots[:-1, None] + widths[:, None] * NODES).ravel()
        blocks = [at[begin : begin + BLOCK] for begin in range(0, len(at), BLOCK)]
        rates = [self.truth.states(block, self.platform, self.start).rate for block in blocks]
        errors = _turn_error(np.concatenate(rates).reshape(-1, 3, 3), widths)
        # of n parts each errs by 1 / n^7 of it
        return divide(knots, (errors / LARGEST_TURN_ERROR) ** (1.0 / 7.0))

    def earth_fixed(self, times: Array) -> EarthFixedStates:
        """Evaluate the truth in earth-fixed axes."""
        position, velocity = self.truth.earth_fixed(times)
        to_inertial = self.truth.earth.turned(times - self.truth.times[0])
        axes = self.truth.states(times, self.platform, self.start).axes
        return EarthFixedStates(position, velocity, np.swapaxes(to_inertial, -1, -2) @ axes)

    def _measured(self, times: Array) -> Array:
        """Compute inertial rates and specific forces in the instruments' axes, shape (n, 6)."""
        state = self.earth_fixed(times)
        spin = np.array([0.0, 0.0, self.truth.earth.rotation_rate])
        carried = 2.0 * state.velocity + np.cross(spin, state.position)
        acceleration = self.truth.position(times, 2) + np.cross(spin, carried)
        felt = acceleration - normal_gravitation_at(self.gravitation, state.position)
        rate = self.truth.states(times, self.platform, self.start).rate
        return np.concatenate([rate, np.einsum("nji,nj->ni", state.axes, felt)], axis=-1)


def longest_step(imu: Imu) -> float:
    """Return the longest step for an inertial measurement unit, s: an interval between readings with quantization."""
    return min(LONGEST_STEP, imu.shortest_reading)


def _turn_error(rates: Array, widths: Array) -> Array:
    """Estimate the error of the attitude after a step, rad: h^7 / 100800 times its seventh derivative.

    The quaternion exp(x), with half the angle x turned by so far, has Bell's polynomial of the derivatives of x as its
    derivative; that of the rates' norms bounds it.

    Parameters
    ----------
    rates : ndarray, shape (S, 3, 3)
        At the Gauss points of steps.
    """
    spacing = NODES[2] - NODES[1]
    first, middle, last = (rates[:, point] for point in range(3))
    turn = 0.5 * np.max(np.linalg.norm(rates, axis=-1), axis=-1) * widths
    change = 0.25 * np.linalg.norm(last - first, axis=-1) * widths / spacing
    bend = 0.5 * np.linalg.norm(last - 2.0 * middle + first, axis=-1) * widths / spacing**2
    even = turn**7 + 21.0 * turn**5 * change + 105.0 * turn**3 * change**2 + 105.0 * turn * change**3
    odd = 35.0 * turn**4 * bend + 210.0 * turn**2 * change * bend + 105.0 * change**2 * bend + 70.0 * turn * bend**2
    return np.asarray((even + odd) / 100_800.0)


def with_stops(knots: Array, stops: Array) -> Array:
    """Merge stops into knots; a stop replaces a knot next to it."""
    at = np.searchsorted(stops, knots)
    before, after = stops[np.maximum(at - 1, 0)], stops[np.minimum(at, len(stops) - 1)]
    distance = np.minimum(np.abs(knots - before), np.abs(knots - after))
    return np.unique(np.concatenate([knots[distance > SAME_INSTANT], stops]))


def divide(knots: Array, shares: Array) -> Array:
    """Divide each interval between knots into equal parts, at least as many as its share."""
    parts: IndexArray = np.maximum(np.ceil(shares), 1.0).astype(np.int64)
    number = np.repeat(np.arange(len(parts)), parts)
    within = np.arange(len(number)) - np.repeat(np.cumsum(parts) - parts, parts)
    inner = knots[number] + np.diff(knots)[number] * (within / parts[number])
    return np.concatenate([inner, knots[-1:]])


def matrices(quaternion: Array) -> Array:
    """Compute the matrices of quaternions, shape (n, 4), scalar first."""
    w, x, y, z = (quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True)).T
    return stack_elements([
        [w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ])  # fmt: skip
