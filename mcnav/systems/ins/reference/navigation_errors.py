"""Navigation errors of indicated states, and the indicated states that have given errors: exact, not to first order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import Earth, local_axes


@dataclass(frozen=True)
class EarthFixedStates:
    """States at m instants, in earth-fixed axes.

    Attributes
    ----------
    position, velocity : ndarray, shape (m, 3)
        m, and m/s over the earth.
    axes : ndarray, shape (m, 3, 3)
        From the instruments' axes to earth-fixed ones.
    """

    position: Array
    velocity: Array
    axes: Array


def navigation_errors(earth: Earth, true: EarthFixedStates, indicated: EarthFixedStates) -> Array:
    """Compute the errors of indicated states.

    Returns
    -------
    ndarray, shape (m, 9)
        In the order of `mcnav.systems.ins.imu.instruments.OUTPUTS`: differences of latitude, longitude and altitude
        times the radii at the true position, differences of velocities in local axes of their own, and the rotation
        vector from true to indicated attitude, each relative to local axes of its own.
    """
    from scipy.spatial.transform import Rotation

    latitude, longitude, altitude = earth.to_geodetic(true.position).T
    there = earth.to_geodetic(indicated.position).T
    meridian, prime = earth.curvature_radii(latitude)
    eastward = there[1] - longitude
    eastward -= 2.0 * np.pi * np.round(eastward / (2.0 * np.pi))
    position = [
        (there[0] - latitude) * (meridian + altitude),
        eastward * (prime + altitude) * np.cos(latitude),
        altitude - there[2],
    ]
    level, level_there = local_axes(latitude, longitude), local_axes(there[0], there[1])
    velocity = _transposed_times(level_there, indicated.velocity) - _transposed_times(level, true.velocity)
    attitude = np.swapaxes(level, -1, -2) @ true.axes
    attitude_there = np.swapaxes(level_there, -1, -2) @ indicated.axes
    turn = Rotation.from_matrix(attitude_there @ np.swapaxes(attitude, -1, -2)).as_rotvec()
    return np.concatenate([np.stack(position, axis=-1), velocity, turn], axis=-1)


def indicated_state(earth: Earth, true: EarthFixedStates, errors: Array) -> EarthFixedStates:
    """Compute the indicated states that have given errors: the inverse of `navigation_errors`.

    Parameters
    ----------
    errors : ndarray, shape (m, 9)
    """
    from scipy.spatial.transform import Rotation

    latitude, longitude, altitude = earth.to_geodetic(true.position).T
    meridian, prime = earth.curvature_radii(latitude)
    north, east, down = errors[:, :3].T
    latitude_there = latitude + north / (meridian + altitude)
    longitude_there = longitude + east / ((prime + altitude) * np.cos(latitude))
    level, level_there = local_axes(latitude, longitude), local_axes(latitude_there, longitude_there)
    velocity = _transposed_times(level, true.velocity) + errors[:, 3:6]
    attitude = Rotation.from_rotvec(errors[:, 6:]).as_matrix() @ np.swapaxes(level, -1, -2) @ true.axes
    there = earth.from_geodetic(latitude_there, longitude_there, altitude - down)
    return EarthFixedStates(
        # without errors the true position to the last digit
        true.position + (there - earth.from_geodetic(latitude, longitude, altitude)),
        np.einsum("nij,nj->ni", level_there, velocity),
        level_there @ attitude,
    )


def _transposed_times(axes: Array, vectors: Array) -> Array:
    return np.asarray(np.einsum("nji,nj->ni", axes, vectors))
