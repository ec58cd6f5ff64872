"""Measurements as the reference engine has them, in earth-fixed axes: what is measured, predicted, and how they differ.

Of a navigator with the errors psi, dv, dr (see `mcnav.systems.ins.reference.earth_fixed_errors`), with C from the
body's axes to earth-fixed ones, the lever arm l, the body's inertial rate w, the earth's rate W, and N, E, D the local
directions, an innovation, predicted less measured, is to first order ::

    position        n . (dr + psi x C l)                  n a local direction
    velocity        n . (dv + psi x C (w x l) - W x (psi x C l) + C (g x l))
    altitude        -D . dr
    attitude        p . psi                               p an axis of the instruments
    body velocity   b . (dv + v x psi)                    b an axis of the body
    heading         (f_n df_e - f_e df_n) / (f_n^2 + f_e^2)

less the errors of the measurement; df is the change of the forward axis f and of the local directions. The navigator
predicts the antenna's velocity ``v + (C w - W) x C l`` with the rate that its gyros measured in the step before, as
compensated, and g is what is left of their errors (`mcnav.systems.ins.reference.aided`). These are the functions
``compare`` of the files in `mcnav.systems.ins.sensors`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.systems.ins.earth import Earth, local_axes
from mcnav.systems.ins.filter.model import NAVIGATION, FilterState
from mcnav.systems.ins.imu.instruments import AXES
from mcnav.systems.ins.reference.earth_fixed_errors import InstrumentState, instrument_states
from mcnav.systems.ins.reference.navigation_errors import EarthFixedStates
from mcnav.systems.ins.sensors.aiding import Sensor
from mcnav.systems.ins.sensors.comparison import Comparison, Indicated, Reference, TrueState
from mcnav.systems.ins.sensors.delay import change_as_indicated, reference_of
from mcnav.systems.ins.sensors.quantity import OFFSETS
from mcnav.systems.ins.sensors.registry import QUANTITIES
from mcnav.systems.ins.truth.trajectory import Truth


@dataclass(frozen=True)
class SensorTruth:
    """The truth at u instants of a sensor.

    Attributes
    ----------
    states : EarthFixedStates
        Positions and velocities over the earth, and the instruments' axes.
    mounting : ndarray, shape (u, 3, 3)
        From the body's to the instruments' axes.
    turning : ndarray, shape (u, 3)
        Rate of the body over the earth, in the body's axes, rad/s.
    gimbals : ndarray, shape (u, 3)
        Rate of the body about the instruments' platform, in the instruments' axes, rad/s; zero where there is none.
    level : ndarray, shape (u, 3, 3)
        From local to earth-fixed axes.
    altitude : ndarray, shape (u,)
    swirling : ndarray, shape (u, 3)
        How the rate of the body over the earth changes, rad/s^2; zero for a sensor without a lever arm.
    turns : mapping of str to ndarray, shape (u, 3, 3)
        As `TrueState` has them; empty for measurements of their time stamps.
    """

    states: EarthFixedStates
    mounting: Array
    turning: Array
    gimbals: Array
    level: Array
    altitude: Array
    swirling: Array
    turns: Mapping[Reference, Array] = field(default_factory=dict)

    @classmethod
    def at(
        cls, truth: Truth, states: EarthFixedStates, times: Array, rate: Array | None = None, on_arm: bool = False
    ) -> SensorTruth:
        """Compute them from the true states at the instants, s.

        Parameters
        ----------
        rate : ndarray, shape (u, 3), optional
            Inertial rate of the instruments' platform in its axes; none if they are on the body.
        on_arm : bool
            Whether the sensor has a lever arm.
        """
        latitude, longitude, altitude = truth.earth.to_geodetic(states.position).T
        mounting = np.swapaxes(states.axes, -1, -2) @ truth.attitude(times).as_matrix()
        turning = np.asarray(truth.attitude(times, 1))
        gimbals = np.zeros_like(turning)
        if rate is not None:
            of_earth = states.axes[:, 2] * truth.earth.rotation_rate
            gimbals = np.einsum("nij,nj->ni", mounting, turning) + of_earth - rate
        swirling = np.asarray(truth.attitude(times, 2)) if on_arm else np.zeros_like(turning)
        return cls(states, mounting, turning, gimbals, local_axes(latitude, longitude), altitude, swirling)

    def late(self, stamped: SensorTruth, delays: Array, spin: float) -> SensorTruth:
        """Return the same as the truth of measurements that are stamped later, by delays, shape (u,), s.

        Parameters
        ----------
        stamped : SensorTruth
            At the time stamps.
        spin : float
            Rate of the earth, rad/s.
        """
        from scipy.spatial.transform import Rotation

        against_stars = Rotation.from_rotvec(-spin * delays[:, None] * np.array([0.0, 0.0, 1.0])).as_matrix()
        against_local = stamped.level @ np.swapaxes(self.level, -1, -2)
        return replace(self, turns={"stars": against_stars, "local": against_local})

    def at_row(self, row: int, lever_arm: Array) -> TrueState:
        """Return the truth at one of them."""
        states = self.states
        return TrueState(
            states.position[row], states.velocity[row], states.axes[row], self.mounting[row], self.turning[row],
            self.gimbals[row], self.level[row], float(self.altitude[row]), lever_arm, self.swirling[row],
            {reference: turns[row] for reference, turns in self.turns.items()},
        )  # fmt: skip


@dataclass(frozen=True)
class SensorModel:
    """A sensor as the truth has it, and as the filter believes it to be.

    Attributes
    ----------
    sensor, believed : Sensor
    truth : SensorTruth or None
        At its instants; none for a sensor whose measurements are recorded.
    states : sequence of FilterState
        Of the filter, besides those of navigation.
    globe : Earth
    """

    sensor: Sensor
    believed: Sensor
    truth: SensorTruth | None
    states: Sequence[FilterState]
    globe: Earth

    @property
    def size(self) -> int:
        """Measured components."""
        return len(self.sensor.components)

    @cached_property
    def variances(self) -> Array:
        """Believed variances of the white noise, shape (u, c)."""
        count = len(self.believed.times)
        return np.stack([component.white_variances(count) for component in self.believed.components], axis=1)

    @cached_property
    def threshold(self) -> float:
        """Largest normalized innovation squared of an accepted measurement."""
        from scipy.special import gammaincinv

        gate = self.sensor.gate
        return np.inf if gate is None else 2.0 * float(gammaincinv(0.5 * self.size, gate))

    @cached_property
    def _quantities(self) -> dict[str, tuple[IndexArray, IndexArray]]:
        """Measured quantities: the components that measure each, and their axes."""
        quantities = {}
        for quantity in QUANTITIES:
            places = [n for n, component in enumerate(self.sensor.components) if component.quantity == quantity]
            axes = [self.sensor.components[place].axis for place in places]
            if places:
                quantities[quantity] = (np.array(places), np.array(axes))
        return quantities

    @cached_property
    def _added(self) -> Array:
        """Responses of the readings to those of the filter's states that are added to them, shape (c, q)."""
        added = np.zeros((self.size, len(self.states)))
        for row, component in enumerate(self.sensor.components):
            names = (component.error_name("bias"), component.error_name("correlated"))
            for column, state in enumerate(self.states):
                added[row, column] = state.name in names
        return added

    @cached_property
    def _scaled(self) -> Array:
        """Responses of the readings to the filter's states that are scale factors, per true value, shape (c, q)."""
        result = np.zeros((self.size, len(self.states)))
        for row, component in enumerate(self.sensor.components):
            for column, state in enumerate(self.states):
                scaled = QUANTITIES[component.quantity].scaled and state.name == component.error_name("scale_factor")
                result[row, column] = scaled
        return result

    @cached_property
    def _arms(self) -> Array:
        """The filter's states that are errors of the lever arm, shape (3, q)."""
        names = [f"{self.sensor.name}_lever_arm_{axis}" for axis in AXES]
        arms = [[float(self.sensor.has_lever_arm and state.name == name) for state in self.states] for name in names]
        return np.array(arms).reshape(3, len(self.states))

    @cached_property
    def _delays(self) -> Array:
        """The filter's states that are delays of the sensor: a constant one, and jitter; shape (q,)."""
        names = (self.sensor.delay_name, self.sensor.jitter_name)
        return np.array([float(state.name in names) for state in self.states])

    @cached_property
    def _gyro_states(self) -> tuple[InstrumentState, ...]:
        """The filter's states that are errors of the gyros."""
        return tuple(state for state in instrument_states(self.states) if state.gyro)

    def true_at(self, row: int) -> TrueState:
        """Return the truth at a measurement by its number."""
        if self.truth is None:
            raise ValueError(f"measurements of {self.sensor.name} are recorded, and have no truth")
        return self.truth.at_row(row, self.sensor.lever_arm)

    def measurement_errors(self, constants: Array, noise: Array) -> tuple[Array, Array, Array]:
        """Split a sample's constant errors, in the order of `Sensor.constants`, and add the noise.

        Returns
        -------
        offsets : ndarray, shape (u, c)
            Bias, correlated error and noise.
        factors : ndarray, shape (c,)
            Scale factors.
        arm : ndarray, shape (3,)
            Used lever arm less the true one, m.
        """
        values = dict(zip(self.sensor.constants(), constants, strict=True))
        bias = [values[component.error_name("bias")] for component in self.sensor.components]
        factors = [values.get(component.error_name("scale_factor"), 0.0) for component in self.sensor.components]
        arm = [values.get(f"{self.sensor.name}_lever_arm_{axis}", 0.0) for axis in AXES]
        return bias + noise, np.array(factors), np.array(arm)

    def innovation(
        self, true: TrueState, indicated: Indicated, estimates: Array, offset: Array, factors: Array, arm: Array,
        flexure: Array | None = None, offsets: Mapping[str, Array] | None = None, stamped: TrueState | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Compute an innovation and its response to the filter's states.

        Parameters
        ----------
        true : TrueState
            At the measurement.
        stamped : TrueState, optional
            At its time stamp; the same unless it is late.
        estimates : ndarray, shape (q,)
            Of the filter's other states; zero for considered ones.
        offset, factors, arm : ndarray
            The sample's errors of this measurement, as `measurement_errors` has them.
        flexure : ndarray, shape (6,), optional
            The sample's angles of a flexure, and their rates.
        offsets : mapping of str to ndarray, shape (3,), optional
            The sample's errors as `offsets_of` has them; none for zero.

        Returns
        -------
        tuple of ndarray, shape (c,), (c, 9 + q)
            The response to the other states is that to their true values less the estimates.
        """
        innovation, response = np.empty(self.size), np.zeros((self.size, NAVIGATION + len(self.states)))
        used = self.believed.lever_arm + arm - self._arms @ estimates
        gyros, flexes = self._gyros(indicated.reading), self.sensor.flexure is not None
        known = {
            name: (0.0 if offsets is None else offsets[name]) - states @ estimates
            for name, states in self._offsets.items()
        }
        stamped = true if stamped is None else stamped
        at = Comparison(
            true, indicated, stamped.mounting, stamped.gimbals, used, self._arms, gyros, self.globe.rotation_rate,
            flexes, self.globe, self.sensor.arrangement, known, self._offsets,
        )  # fmt: skip
        added, scaled = self._added @ estimates, self._scaled @ estimates
        response[:, NAVIGATION:] = -self._added
        for quantity, (places, axes) in self._quantities.items():
            reference = reference_of(self.sensor.kind, quantity)
            turned = true.turns.get(reference)
            difference = QUANTITIES[quantity].compare(at if turned is None else replace(at, turned=turned))
            innovation[places] = difference.value[axes] + added[places] - offset[places]
            scales = 1.0 + scaled[places, None]  # what is predicted is multiplied by them
            response[places, :NAVIGATION] = scales * difference.navigation[axes]
            if difference.others is not None:
                response[places, NAVIGATION:] += scales * difference.others[axes]
            if difference.flexure is not None and difference.true_flexure is not None:
                of_states = difference.flexure[axes] @ self._bends
                innovation[places] += of_states @ estimates
                response[places, NAVIGATION:] -= of_states
                if flexure is not None:
                    innovation[places] -= difference.true_flexure[axes] @ flexure
            if QUANTITIES[quantity].scaled:
                if difference.true is None:
                    raise ValueError(f"compare of {quantity} lacks the true value, which a scale factor needs")
                true_value = difference.true[axes]
                predicted = true_value + difference.value[axes]
                innovation[places] += scaled[places] * predicted - factors[places] * true_value
                response[places, NAVIGATION:] -= self._scaled[places] * predicted[:, None]
            if self._delays.any():
                changes = change_as_indicated(replace(at, true=stamped), QUANTITIES[quantity], reference)[axes]
                innovation[places] -= changes * (self._delays @ estimates)
                response[places, NAVIGATION:] += np.outer(changes, self._delays)
        return innovation, response

    @cached_property
    def _offsets(self) -> dict[str, Array]:
        """The filter's states that are errors of `OFFSETS`, by name, shapes (3, q)."""
        offsets = {}
        for offset in self.sensor.offsets:
            names = [f"{self.sensor.name}_{offset}_{axis}" for axis in OFFSETS[offset][0]]
            found = [[float(state.name == name) for state in self.states] for name in names]
            offsets[offset] = np.array(found).reshape(3, len(self.states))
        return offsets

    def offsets_of(self, constants: Array) -> dict[str, Array]:
        """Return a sample's errors of `OFFSETS` from its constant ones, in the order of `Sensor.constants`."""
        values = dict(zip(self.sensor.constants(), constants, strict=True))
        return {
            offset: np.array([values[f"{self.sensor.name}_{offset}_{axis}"] for axis in OFFSETS[offset][0]])
            for offset in self.sensor.offsets
        }

    @cached_property
    def _bends(self) -> Array:
        """Angles of the sensor's flexure, and their rates, as the filter's states have them, shape (6, q)."""
        bends = np.zeros((6, len(self.states)))
        for column, state in enumerate(self.states):
            if state.flexure is not None and state.flexure.sensor == self.sensor.name:
                bends[3 * state.flexure.rate + state.flexure.axis, column] = 1.0
        return bends

    def _gyros(self, reading: Array) -> Array:
        """Return the responses of a rate to the filter's states that are errors of the gyros, shape (3, q)."""
        gyros = np.zeros((3, len(self.states)))
        inputs = np.concatenate([[1.0], reading])
        for gyro_state in self._gyro_states:
            gyros[gyro_state.axis, gyro_state.place] = inputs[gyro_state.input]
        return gyros
