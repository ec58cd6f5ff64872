"""Measurements as recordings have them: by quantity, and as the true state that would be measured so without errors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import Earth, local_axes
from mcnav.systems.ins.reference.axes import cross_matrix
from mcnav.systems.ins.sensors.aiding import Sensor
from mcnav.systems.ins.sensors.comparison import Indicated, TrueState

QUANTITIES: Final = ("position", "velocity", "altitude", "attitude", "body_velocity", "heading")
"""Quantities that can be recorded."""


def quantities_of(sensor: Sensor) -> tuple[str, ...]:
    """Return the quantities that a sensor measures, in order."""
    return tuple(dict.fromkeys(component.quantity for component in sensor.components))


def stated_sigmas(sensor: Sensor) -> dict[str, Array]:
    """Return the sigmas that the log of a sensor states, shape (u, 3), of quantities with all three axes."""
    result = {}
    for quantity in ("position", "velocity"):
        sigmas = [each.noise_at for each in sensor.components if each.quantity == quantity]
        if sensor.log is not None and len(sigmas) == 3 and None not in sigmas:
            result[quantity] = np.array(sigmas, dtype=float).T / sensor.log.factor
    return result


def true_state(earth: Earth, values: Mapping[str, Array], row: int, indicated: Indicated) -> TrueState:
    """Return the state that has the recorded values at a row, with no lever arm; the rest of it is as indicated.

    Parameters
    ----------
    values : mapping of str to ndarray, shape (u, a)
        As in `mcnav.contract.recorded.RecordedMeasurements`.
    """
    from scipy.spatial.transform import Rotation

    frame = indicated.frame
    position, level = indicated.position, frame.axes
    if "position" in values:
        latitude, longitude, altitude = values["position"][row]
        position = earth.from_geodetic(latitude, longitude, altitude)
        level = local_axes(np.asarray(latitude), np.asarray(longitude))
    velocity, axes = indicated.velocity, indicated.axes
    if "velocity" in values:
        velocity = level @ values["velocity"][row]
    if "attitude" in values:
        axes = level @ Rotation.from_euler("ZYX", values["attitude"][row][::-1]).as_matrix()
    if "heading" in values:
        axes = level @ Rotation.from_euler("Z", float(values["heading"][row, 0])).as_matrix()
    if "body_velocity" in values:
        velocity, axes = values["body_velocity"][row], np.eye(3)
    altitude = float(values["altitude"][row, 0]) if "altitude" in values else frame.altitude
    nothing = np.zeros(3)
    return TrueState(position, velocity, axes, np.eye(3), nothing, nothing, level, altitude, nothing)


def recorded_values(
    earth: Earth, sensor: Sensor, true: TrueState, offset: Array, factors: Array, arm: Array
) -> dict[str, Array]:
    """Return what a sensor records of a true state with its errors, by quantity: the inverse of `true_state`.

    Parameters
    ----------
    offset, factors : ndarray, shape (c,)
        Errors of the components, as `SensorModel.measurement_errors` has them.
    arm : ndarray, shape (3,)
        Used lever arm less the true one.
    """
    result = {}
    for quantity in quantities_of(sensor):
        value = _without_errors(earth, quantity, true, sensor.lever_arm - arm)
        error = np.zeros(len(value))
        for place, component in enumerate(sensor.components):
            if component.quantity == quantity:
                error[component.axis] = offset[place] + factors[place] * value[component.axis]
        result[quantity] = _with_error(earth, quantity, value, true, error)
    return result


def _without_errors(earth: Earth, quantity: str, true: TrueState, lever: Array) -> Array:
    """Return a quantity of the true state; of a position the earth-fixed one."""
    body = true.axes @ true.mounting
    match quantity:
        case "position":
            return np.asarray(true.position + body @ lever)
        case "velocity":
            return np.asarray(true.level.T @ (true.velocity + body @ (cross_matrix(true.turning) @ lever)))
        case "altitude":
            return np.array([true.altitude])
        case "body_velocity":
            return np.asarray(body.T @ true.velocity)
        case "attitude":
            return np.zeros(3)
        case "heading":
            forward = true.level.T @ body[:, 0]
            return np.array([np.arctan2(forward[1], forward[0])])
    raise ValueError(f"{quantity} cannot be recorded; known are {', '.join(QUANTITIES)}")


def _with_error(earth: Earth, quantity: str, value: Array, true: TrueState, error: Array) -> Array:
    """Add an error to a quantity, and give it as it is recorded."""
    from scipy.spatial.transform import Rotation

    if quantity == "position":
        return np.asarray(earth.to_geodetic((value + true.level @ error)[None])[0])
    if quantity == "attitude":
        measured = true.level.T @ true.axes @ Rotation.from_rotvec(error).as_matrix()
        return np.asarray(Rotation.from_matrix(measured).as_euler("ZYX")[::-1])
    return value + error
