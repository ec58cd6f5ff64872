"""Partial derivatives of a guided reentry for many start times, from one flight of its linear system.

An error X at a later start moves the end as the errors at the first start that lead to it would. With the sensitivities
of the state to the errors at the first start, S_x, and to those that act during the flight, S_u, and with the partial
derivatives P_x, P_u of the end,

    P_x(t) = P_x S_x(t)^-1 U,     P_u(t) = P_u - P_x S_x(t)^-1 S_u(t)

where U adds errors at the start to truth and navigator. This holds until reentry. Behind it drag makes the flight
forget where it began, S_x becomes singular, and the largest deceleration may have passed: later starts have a flight
each.

Without errors the navigator is taken to be where the truth is: where the accelerometers are switched off, the drag that
it misses before its start is neglected.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.systems.reentry.guided.description import GuidedError
from mcnav.systems.reentry.guided.linear import EQUIPMENT, LinearFlight
from mcnav.systems.reentry.instruments import Error

TRUE: Final = np.arange(GuidedError.TRUE_ALTITUDE, GuidedError.DENSITY)
STATES: Final = np.concatenate([TRUE, np.arange(Error.MISALIGNMENT)])
"""Sources at the start: of the truth, then of the navigator."""

TURNED: Final = ((Error.SCALE_FACTOR_X, Error.CROSS_AXIS_X), (Error.CROSS_AXIS_Z, Error.SCALE_FACTOR_Z))
"""Sources whose force along the first axis is proportional to that along the second."""


def start_errors(radius: float, navigator_start: str) -> Array:
    """Return the matrix U from the errors of `STATES` to polar states of truth and navigator, shape (8, 8)."""
    arcs = np.diag([1.0, 1.0 / radius, 1.0, 1.0 / radius])
    told = arcs if navigator_start == "truth" else np.zeros((4, 4))
    return np.block([[arcs, np.zeros((4, 4))], [told, arcs]])


def partials_before_reentry(flight: LinearFlight, partials: Array, times: Array, axes: str) -> Array:
    """Compute the partial derivatives for starts at times before reentry, shape (n, outputs, sources).

    Parameters
    ----------
    flight : LinearFlight
        From an earlier start.
    partials : ndarray, shape (outputs, sources)
        Those of that start.
    times : ndarray, shape (n,)
        s from that start.
    axes : str
        As in `mcnav.systems.reentry.scenario.Flight`.
    """
    navigation, result = flight.navigation, np.empty((len(times), *partials.shape))
    for row, time in enumerate(times):
        reading = flight.at(float(time))
        carried = np.linalg.solve(reading.by_source[:, STATES].T, partials[:, STATES].T).T
        radius, angle = reading.actual[0], reading.actual[1]
        result[row][:, STATES] = carried @ start_errors(radius, navigation.guidance.navigator_start)
        result[row][:, EQUIPMENT] = partials[:, EQUIPMENT] - carried @ reading.by_source[:, EQUIPMENT]
        result[row][:, Error.GYRO_DRIFT] -= time * result[row][:, Error.MISALIGNMENT]
        if axes == "start":
            _turn(result[row], float(angle - navigation.theta_axes))
    return result


def _turn(partials: Array, angle: float) -> None:
    """Turn the axes of the accelerometers by a range angle, rad: columns of ``partials``, shape (outputs, sources).

    ``x = X cos + Z sin``, ``z = -X sin + Z cos``; biases are vectors, the others are products of two axes.
    """
    to_new = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    biases = [Error.BIAS_X, Error.BIAS_Z]
    partials[:, biases] = partials[:, biases] @ to_new.T
    products = partials[:, np.array(TURNED)]
    turned = np.einsum("rij,ai,bj->rab", products, to_new, to_new)
    partials[:, np.array(TURNED)] = turned
