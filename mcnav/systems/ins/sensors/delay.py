"""Measurements that are late: how fast what a sensor measures changes, and what it measures at another time.

A sensor that is late by d measures at t - d what is stamped t (d > 0). With h, what it measures without errors, the
error of the measurement is ::

    h(t - d) - h(t) = -h' d + ...

A quantity states h' nowhere: its responses to psi, v and x are the derivatives of h with respect to the state over the
earth, and h' is their product with how that state changes. Where the axes against which a quantity is measured turn
over the earth at the rate p, the state turns at -p over them. With the body's rate w over the earth, the earth's rate
W, the velocity u over the earth and its change a, and what the gyros of a lever arm read of the body, ``w + W``::

    psi' = w - p        u' = a - p x u        x' = u        (w + W)' = w' - psi' x W

The delay of a sensor is one constant error, which all that it measures has; its jitter is a delay of its own at each
time, also the same for all that it measures.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.systems.ins.reference.axes import ATTITUDE, POSITION, VELOCITY
from mcnav.systems.ins.sensors.comparison import Comparison, Reference
from mcnav.systems.ins.sensors.quantity import Geometry, QuantityDefinition
from mcnav.systems.ins.sensors.registry import QUANTITIES, SENSOR_TYPES
from mcnav.systems.ins.sensors.surroundings import Surroundings

WITHOUT_MEMORY: Final = 1e-12
"""Correlation time of jitter, s: nothing of it is left after any step."""


def reference_of(kind: str, quantity: str) -> Reference:
    """Return the axes against which a type of sensor measures a quantity.

    >>> reference_of("star-tracker", "attitude"), reference_of("master", "attitude")
    ('stars', 'local')
    """
    own = QUANTITIES[quantity].reference
    return SENSOR_TYPES[kind].references.get(quantity, own) if kind in SENSOR_TYPES else own


def motion_along_truth(along: Surroundings, quantity: QuantityDefinition, reference: Reference) -> Array:
    """Return how psi, v and x of the truth change as a quantity is measured, shape (u, 9)."""
    spin, velocity = np.array([0.0, 0.0, along.spin]), along.velocity
    turn = np.einsum("nij,nj->ni", along.body, along.turning)
    if quantity.of_instruments:
        turn = np.einsum("nij,nj->ni", along.instruments, along.rate) - spin
    felt = np.einsum("nij,nj->ni", along.instruments, along.force) + along.globe.gravitation(along.position)
    change = felt - np.cross(spin, 2.0 * velocity + np.cross(spin, along.position))
    axes_turn = _axes_turn_along_truth(along, reference, spin)
    turn, change = turn - axes_turn, change - np.cross(axes_turn, velocity)
    return np.concatenate([turn, change + np.cross(spin, velocity), velocity], axis=1)


def change_along_truth(
    along: Surroundings, geometry: Geometry, quantity: QuantityDefinition, reference: Reference
) -> Array:
    """Return h' of a component along the truth, shape (u,), in its unit per second."""
    motion = motion_along_truth(along, quantity, reference)
    result = np.einsum("ni,ni->n", geometry.row, motion)
    if quantity.swings and along.lever_arm.any():
        spin = np.array([0.0, 0.0, along.spin])
        swirl = np.einsum("nij,nj->ni", along.body, along.swirling) - np.cross(motion[:, :3], spin)
        result += np.einsum("ni,ni->n", np.cross(along.lever, geometry.direction), swirl)
    return np.asarray(result)


def _axes_turn_along_truth(along: Surroundings, reference: Reference, spin: Array) -> Array:
    """Return the rate over the earth of the axes against which a quantity is measured, in inertial axes, rad/s."""
    if reference == "stars":
        return np.asarray(np.broadcast_to(-spin, along.velocity.shape))
    if reference == "earth":
        return np.zeros_like(along.velocity)
    north, east, _ = np.einsum("nji,nj->in", along.level, along.velocity)
    meridian, prime = along.radii
    in_level = np.stack([east / prime, -north / meridian, -east / prime * np.tan(along.latitude)], axis=1)
    return np.asarray(np.einsum("nij,nj->ni", along.level, in_level))


def change_as_indicated(at: Comparison, quantity: QuantityDefinition, reference: Reference) -> Array:
    """Return h' of all axes of a quantity as a navigator knows it, shape (a,), in its unit per second.

    How the body's rate over the earth changes is taken as known: it is the derivative of the readings.
    """
    indicated, spin = at.indicated, np.array([0.0, 0.0, at.rotation_rate])
    velocity, reading = indicated.velocity, indicated.reading
    rate = reading[:3] if quantity.of_instruments else reading[:3] + at.gimbals
    turn = indicated.axes @ rate - spin - _axes_turn(at, reference, spin)
    felt = indicated.axes @ reading[3:] + at.globe.gravitation(indicated.position[None])[0]
    change = felt - np.cross(spin, 2.0 * velocity + np.cross(spin, indicated.position))
    motion = np.empty(9)
    motion[ATTITUDE], motion[POSITION] = turn, velocity
    motion[VELOCITY] = change - np.cross(_axes_turn(at, reference, spin), velocity)
    swirl = at.mounting @ at.true.swirling - indicated.axes.T @ np.cross(turn, spin)
    nothing = np.zeros((3, 1))
    alone = replace(
        at, arm_states=nothing, gyro_states=swirl[:, None], offset_states=dict.fromkeys(at.offset_states, nothing)
    )
    difference = quantity.compare(alone)
    of_gyros = 0.0 if difference.others is None else difference.others[:, 0]
    return np.asarray(difference.navigation @ motion + of_gyros)


def _axes_turn(at: Comparison, reference: Reference, spin: Array) -> Array:
    """Return the rate over the earth of the axes against which a quantity is measured, in earth-fixed axes, rad/s."""
    if reference == "stars":
        return np.asarray(-spin)
    if reference == "earth":
        return np.zeros(3)
    frame = at.indicated.frame
    return np.asarray(frame.axes @ (frame.turn @ (frame.axes.T @ at.indicated.velocity)))
