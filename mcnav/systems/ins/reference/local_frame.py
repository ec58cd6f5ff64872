"""Local axes of the reference engine, and errors in them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import Earth, local_axes
from mcnav.systems.ins.imu.instruments import OUTPUTS
from mcnav.systems.ins.reference.axes import ATTITUDE, POSITION, VELOCITY, cross_matrix


@dataclass(frozen=True)
class LocalFrame:
    """North, east and down at a position, and how they turn with it.

    Attributes
    ----------
    latitude, longitude : float
        rad.
    altitude : float
        m.
    axes : ndarray, shape (3, 3)
        From n to e.
    turn : ndarray, shape (3, 3)
        Rotation vector in n of the axes by a displacement in n, 1/m.
    """

    latitude: float
    longitude: float
    altitude: float
    axes: Array
    turn: Array

    @classmethod
    def at(cls, earth: Earth, position: Array) -> LocalFrame:
        """Compute the frame at an earth-fixed position, shape (3,)."""
        latitude, longitude, altitude = (float(coordinate) for coordinate in earth.to_geodetic(position[None])[0])
        meridian, prime = (float(radius) for radius in earth.curvature_radii(np.asarray(latitude)))
        east = 1.0 / (prime + altitude)
        turn = np.array(
            [[0.0, east, 0.0], [-1.0 / (meridian + altitude), 0.0, 0.0], [0.0, -np.tan(latitude) * east, 0.0]]
        )
        return cls(latitude, longitude, altitude, local_axes(np.asarray(latitude), np.asarray(longitude)), turn)

    def to_outputs(self, velocity: Array) -> Array:
        """Compute the map of psi, dv, dr to the outputs, shape (9, 9), at an earth-fixed velocity, to first order.

        With the turn t of the local axes: the velocity's error in n less ``t x v``, the attitude's less t.
        """
        to_level = self.axes.T
        turn = self.turn @ to_level
        outputs = np.zeros((len(OUTPUTS), len(OUTPUTS)))
        outputs[0:3, POSITION] = to_level
        outputs[3:6, VELOCITY] = to_level
        outputs[3:6, POSITION] = cross_matrix(to_level @ velocity) @ turn
        outputs[6:9, ATTITUDE] = to_level
        outputs[6:9, POSITION] = -turn
        return outputs
