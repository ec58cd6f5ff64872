"""Outputs of a guided reentry: navigation errors, dispersion of the truth, time and largest deceleration."""

from __future__ import annotations

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.quantities import Output
from mcnav.physics.constants import EARTH_RADIUS
from mcnav.systems.reentry.guided.description import TRUE_ALTITUDE, TRUTH_OUTPUTS, GuidedNavigation
from mcnav.systems.reentry.guided.ensemble.kernel import Flights
from mcnav.systems.reentry.guided.linear import LinearFlight, Reading
from mcnav.systems.reentry.navigator import navigation_error
from mcnav.systems.reentry.outputs import DEVIATIONS, SCALE, append_errors


def outputs_of(navigation: GuidedNavigation) -> tuple[Output, ...]:
    """Return the outputs: navigation errors and further ones, then those of the truth."""
    altitude = (TRUE_ALTITUDE,) if navigation.guidance.final == "indicated" else ()
    return (*DEVIATIONS, *(further_output.output for further_output in navigation.further), *altitude, *TRUTH_OUTPUTS)


def _from_reentry(navigation: GuidedNavigation, times: Array) -> Array:
    """Convert times from the start of navigation to times from the nominal reentry, s."""
    return np.asarray(times + (navigation.start - navigation.trajectory.reentry_time))


def read_flights(navigation: GuidedNavigation, flights: Flights, nominal: Array) -> Array:
    """Return the outputs of flights, shape (n, m, outputs), SI.

    Parameters
    ----------
    nominal : ndarray, shape (m, 4)
        Nominal polar states at the instants, the last at the nominal end.
    """
    errors = append_errors(navigation.further, navigation_error(flights.actual, flights.indicated), flights.actual)
    dispersion = navigation_error(nominal, flights.actual)
    kept = dispersion if navigation.guidance.final == "indicated" else dispersion[..., 1:]
    times, peaks = _from_reentry(navigation, flights.times)[..., None], flights.peaks[..., None]
    return np.concatenate([errors, kept, times, peaks], axis=-1)


def origin_of(navigation: GuidedNavigation, nominal: Array) -> Array:
    """Return what the outputs are measured from, shape (m, outputs), SI: altitude and rates of the nominal flight.

    The range is that from the place which the nominal flight reaches.

    Parameters
    ----------
    nominal : ndarray, shape (m, 4)
        Nominal polar states at the instants.
    """
    outputs, states = outputs_of(navigation), nominal * SCALE
    origin = np.zeros((len(nominal), len(outputs)))
    values = {
        "true_altitude": states[:, 0] - EARTH_RADIUS, "true_altitude_rate": states[:, 2],
        "true_range_rate": states[:, 3],
    }  # fmt: skip
    for place, output in enumerate(outputs):
        origin[:, place] = values.get(output.name, 0.0)
    return origin


def rows_of_outputs(navigation: GuidedNavigation, actual: Array, indicated: Array) -> Array:
    """Return the partial derivatives of the outputs to what a step writes, shape (outputs, 10).

    As in `mcnav.systems.reentry.guided.timeline`.

    Parameters
    ----------
    actual, indicated : ndarray, shape (4,)
        Polar states without errors.
    """
    first = 0 if navigation.guidance.final == "indicated" else 1
    eye, none = np.eye(4), np.zeros((4, 4))
    further = [
        np.concatenate([each.gradient(indicated) - each.gradient(actual), each.gradient(indicated)]) / np.tile(SCALE, 2)
        for each in navigation.further
    ]
    of_states = np.array([*np.hstack([none, eye]), *further, *np.hstack([eye, none])[first:]])
    rows = np.pad(of_states, ((0, 2), (0, 2)))
    rows[-2, -2] = rows[-1, -1] = 1.0  # time and largest deceleration
    return rows


def read_nominal(flight: LinearFlight, reading: Reading, nominal: Array) -> Array:
    """Return the outputs without errors, shape (outputs,), SI.

    Parameters
    ----------
    nominal : ndarray, shape (4,)
        Nominal polar state at the instant.
    """
    flown = Flights(
        reading.actual[None, None], reading.indicated[None, None], np.array([[reading.time]]),
        np.array([[reading.peak]]), np.zeros(1, dtype=np.int64),
    )  # fmt: skip
    values = np.asarray(read_flights(flight.navigation, flown, nominal[None])[0, 0])
    if flight.senses_all:
        values[: len(DEVIATIONS) + len(flight.navigation.further)] = 0.0  # but for rounding
    return values
