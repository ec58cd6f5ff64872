"""Comparison of a quantity in the reference engine: navigator and truth at one measurement, in earth-fixed axes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import WGS84, Earth
from mcnav.systems.ins.reference.local_frame import LocalFrame

Reference: TypeAlias = Literal["earth", "local", "stars"]
"""Axes against which a quantity is measured: earth-fixed ones, north, east, down of its own place, inertial ones."""


@dataclass(frozen=True)
class TrueState:
    """The truth that is measured.

    Attributes
    ----------
    position, velocity : ndarray, shape (3,)
        Velocity over the earth.
    axes : ndarray, shape (3, 3)
        From the instruments' to earth-fixed axes.
    mounting : ndarray, shape (3, 3)
        From the body's to the instruments' axes.
    turning : ndarray, shape (3,)
        Rate of the body over the earth, in the body's axes, rad/s.
    swirling : ndarray, shape (3,)
        How that rate changes, rad/s^2.
    gimbals : ndarray, shape (3,)
        Rate of the body about the instruments' platform, in the instruments' axes, rad/s; zero where there is none.
    level : ndarray, shape (3, 3)
        From local to earth-fixed axes.
    altitude : float
        m.
    lever_arm : ndarray, shape (3,)
        m.
    turns : mapping of str to ndarray, shape (3, 3)
        Of a measurement of another time than its time stamp: from a reference's axes at that time to those at the
        stamp, in earth-fixed axes.
    """

    position: Array
    velocity: Array
    axes: Array
    mounting: Array
    turning: Array
    gimbals: Array
    level: Array
    altitude: float
    lever_arm: Array
    swirling: Array = field(default_factory=lambda: np.zeros(3))
    turns: Mapping[Reference, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class Indicated:
    """The indicated state of a navigator at one instant.

    Attributes
    ----------
    position, velocity : ndarray, shape (3,)
        Earth-fixed; over the earth.
    axes : ndarray, shape (3, 3)
        From the instruments' axes to earth-fixed ones.
    frame : LocalFrame
        At the position.
    reading : ndarray, shape (6,)
        Inertial rate and specific force as measured and compensated, in the instruments' axes.
    """

    position: Array
    velocity: Array
    axes: Array
    frame: LocalFrame
    reading: Array


@dataclass(frozen=True)
class Comparison:
    """A navigator and the truth at one measurement.

    Attributes
    ----------
    mounting, gimbals : ndarray
        As `TrueState` has them, at the measurement's time stamp: they are known to the navigator.
    arm : ndarray, shape (3,)
        Lever arm that the navigator uses, m.
    arm_states, gyro_states : ndarray, shape (3, q)
        Responses of that arm, and of the rate that the gyros measure, to the filter's states besides those of
        navigation.
    rotation_rate : float
        Of the earth, rad/s.
    flexes : bool
        Whether the structure between the unit and the sensor bends.
    globe : Earth
    arrangement : ndarray
        As `mcnav.systems.ins.sensors.quantity.SensorType.arrange` has it.
    offsets, offset_states : mapping of str to ndarray, shapes (3,), (3, q)
        What the navigator takes less what is true, and its responses to the filter's states, by the names of
        `mcnav.systems.ins.sensors.quantity.OFFSETS`.
    turned : ndarray, shape (3, 3)
        What the axes against which the quantity is measured have turned between measurement and time stamp.
    """

    true: TrueState
    indicated: Indicated
    mounting: Array
    gimbals: Array
    arm: Array
    arm_states: Array
    gyro_states: Array
    rotation_rate: float
    flexes: bool = False
    globe: Earth = WGS84
    arrangement: Array = field(default_factory=lambda: np.zeros((0, 3)))
    offsets: Mapping[str, Array] = field(default_factory=dict)
    offset_states: Mapping[str, Array] = field(default_factory=dict)
    turned: Array = field(default_factory=lambda: np.eye(3))


@dataclass(frozen=True)
class Difference:
    """Predicted less true value of a quantity with a axes.

    Attributes
    ----------
    value : ndarray, shape (a,)
    navigation : ndarray, shape (a, 9)
        Its responses to psi, dv, dr (`mcnav.systems.ins.reference.axes` has their places).
    others : ndarray, shape (a, q), optional
        Its responses to the filter's other states, besides those that are errors of the measurement itself.
    true : ndarray, shape (a,), optional
        The true value, of a quantity that may have a scale factor.
    flexure, true_flexure : ndarray, shape (a, 6), optional
        Responses of the measured value to the angles of a flexure about the body's axes and to their rates: as the
        navigator knows them, and the true ones. Of a sensor that flexes alone.
    """

    value: Array
    navigation: Array
    others: Array | None = None
    true: Array | None = None
    flexure: Array | None = None
    true_flexure: Array | None = None


def responses(axes: int) -> Array:
    """Return no responses of a quantity with some axes to psi, dv, dr."""
    return np.zeros((axes, 9))
