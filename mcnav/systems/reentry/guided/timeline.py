"""The timeline of a guided reentry, from its linear system along the flight without errors.

X holds the deviation of the truth's polar state from the nominal one and the navigator's error, both scaled as outputs
are. Behind reentry drag makes the flight forget where it began, and S becomes singular: X stays as it is at reentry,
and what is read, before and after, is written by each step: truth and navigator at the instant, by how much the end is
later, and the change of the largest specific force so far. The last step takes them to the sample's own end.

Later starts are starts of the same nominal flight, up to reentry; behind it the largest deceleration may have passed,
and starts need a flight each. Without errors the navigator is taken to be where the truth is: where the accelerometers
are switched off, the drag that it misses before its start is neglected.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.timeline import Start, Timeline
from mcnav.linear.engine.starts import start_times
from mcnav.systems.reentry.guided.description import GuidedError
from mcnav.systems.reentry.guided.ensemble.kernel import SOURCES
from mcnav.systems.reentry.guided.linear import EQUIPMENT, LinearFlight, Reading
from mcnav.systems.reentry.guided.outputs import rows_of_outputs
from mcnav.systems.reentry.instruments import Error
from mcnav.systems.reentry.linearized import constants_of_start, start_arcs
from mcnav.systems.reentry.outputs import SCALE
from mcnav.systems.variations import Variations

TRUE: Final = slice(0, 4)
ERRORS: Final = slice(4, 8)
STATES: Final = 8
WRITTEN: Final = 10
"""States of the truth and of the navigator, up to reentry, and those that each step writes."""

OF_STATES: Final = np.concatenate(
    [np.arange(GuidedError.TRUE_ALTITUDE, GuidedError.DENSITY), np.arange(Error.MISALIGNMENT)]
)
"""Sources at the start: of the truth, then of the navigator."""


def fly_timeline(flight: LinearFlight, times: Array, axes: str = "trajectory") -> Timeline:
    """Return the timeline with some times among its instants, besides the start and the end.

    Parameters
    ----------
    times : ndarray, shape (n,)
        s from the start of navigation; from the end of the flight without errors on they are the sample's own end.
    axes : str
        As in `mcnav.systems.reentry.linearized.LinearNavigator.timeline`.
    """
    navigation, final = flight.navigation, flight.final_time
    reentry = max(navigation.trajectory.reentry_time - navigation.start, 0.0)
    instants = np.union1d([0.0, final], times[times < final])
    readings = [*(flight.at(float(time)) for time in instants[:-1]), flight.end]
    held = [flight.at(reentry) if time > reentry else reading for time, reading in zip(instants, readings, strict=True)]
    by_source = np.array(
        [
            np.concatenate([_by_source(one)[:STATES], _by_source(other)])
            for one, other in zip(held, readings, strict=True)
        ]
    )

    def begin(position: int) -> Start:
        actual = readings[position].actual
        partials = np.zeros((STATES + WRITTEN, SOURCES + 1))
        partials[:STATES, OF_STATES] = _start_errors(actual, navigation.guidance.navigator_start)
        if position == 0:
            partials[STATES:, :-1] = by_source[0, STATES:]
        turn = float(actual[1] - navigation.theta_axes) if axes == "start" else 0.0
        constants = np.eye(SOURCES + 1)
        of_navigator = constants_of_start(turn, float(instants[position]))[:-1, :-1]
        constants[: len(of_navigator), : len(of_navigator)] = of_navigator
        return Start(partials, constants=constants)

    by_constant = np.zeros((len(instants), STATES + WRITTEN, SOURCES + 1))
    by_constant[:, :, EQUIPMENT] = by_source[:, :, EQUIPMENT]
    first = _start_errors(readings[0].actual, navigation.guidance.navigator_start)
    by_state = by_source[:, :, OF_STATES] @ np.linalg.inv(first)
    if flight.senses_all:
        for first_row in (0, STATES):  # but for rounding: the navigator senses where the truth goes
            by_state[:, first_row + 4 : first_row + 8, TRUE] = 0.0
    return Variations(instants, by_state, by_constant).timeline(
        begin(0),
        lambda position, time: np.pad(
            rows_of_outputs(navigation, readings[position].actual, readings[position].indicated), ((0, 0), (STATES, 0))
        ),
        begin,
        lambda more: fly_timeline(flight, np.union1d(times, more), axes),
    )


def _by_source(reading: Reading) -> Array:
    """Return the partial derivatives of what is written at an instant, shape (10, sources)."""
    true, indicated = reading.by_source[TRUE], reading.by_source[ERRORS]
    scale = SCALE[:, None]
    return np.concatenate(
        [scale * true, scale * (indicated - true), reading.time_by_source[None], reading.peak_by_source[None]]
    )


def _start_errors(actual: Array, navigator_start: str) -> Array:
    """Return the partial derivatives of truth and navigator at a start to the errors of `OF_STATES`, shape (8, 8)."""
    arcs = np.diag(start_arcs(actual))
    untold = np.zeros((4, 4)) if navigator_start == "truth" else -arcs
    return np.block([[arcs, np.zeros((4, 4))], [untold, arcs]])


def partials_before_reentry(flight: LinearFlight, times: Array, axes: str) -> Array:
    """Compute the partial derivatives of the end for starts at times before reentry, shape (n, outputs, sources)."""
    timeline = fly_timeline(flight, times, axes)
    readout = timeline.readout(timeline.end, flight.final_time)
    return start_times(timeline, timeline.end, readout, timeline.positions(times)).partials[:, :, :-1]
