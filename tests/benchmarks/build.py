"""A trajectory of Table I as a `Case`: its truth as mcnav flies it, reference errors by mcnav's reference engine."""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.linear.covariance import propagated_covariance
from mcnav.systems.reentry.ensemble.grid import shared_grid
from mcnav.systems.reentry.ensemble.kernel import simulate_ensemble
from mcnav.systems.reentry.ensemble.refinement import FINEST
from mcnav.systems.reentry.ensemble.transition import linear_response
from mcnav.systems.reentry.scenario import Flight, Reentry
from mcnav.systems.reentry.table_i import ALL_ERRORS, ERRORS, TABLE_I, among_all, start_state
from mcnav.systems.reentry.vehicle import Vehicle
from tests.benchmarks.case import LENGTH, SPEED, TIME, Case
from tests.benchmarks.equations import stretch_constants

COMPARED: Final = 200
"""Draws on which errors are measured."""


def scenario_of(number: int) -> Reentry:
    """A trajectory of Table I, navigated from its first point."""
    row = TABLE_I[number]
    return Reentry(Flight(start_state(number), Vehicle(row.lift_law), row.final_altitude))


def case_of(number: int, compared: int = COMPARED) -> Case:
    """A trajectory with its reference errors.

    The reference is scipy's DOP853 on the polar equations at a relative tolerance of 1e-12.
    """
    scenario = scenario_of(number)
    navigation = scenario.navigation
    stretches = navigation.trajectory.navigated(navigation.start)
    states = np.array([navigation.trajectory.state(begin) for begin, _, _ in stretches])
    truths = (states - [0.0, navigation.theta_axes, 0.0, 0.0]) / [LENGTH, 1.0, SPEED, 1.0 / TIME]
    covariance = propagated_covariance(scenario.linear().end.partials, np.diag(ALL_ERRORS**2))
    case = Case(
        number,
        states[0],
        np.array([begin - navigation.start for begin, _, _ in stretches]) / TIME,
        np.array([end - navigation.start for _, end, _ in stretches]) / TIME,
        truths,
        np.array([stretch_constants(phase.coefficients, phase.accelerometers_on) for _, _, phase in stretches]),
        ERRORS,
        np.sqrt(np.diag(covariance)),
        np.empty((compared, 4)),
    )
    navigation.simulate_reference(among_all(case.draws(compared)), range(compared), case.reference)
    return case


def disagreement(case: Case) -> float:
    """How far the ensemble's finest grid is from the reference, share of sigma: below it nothing can be measured."""
    navigation = scenario_of(case.number).navigation
    response = linear_response(navigation.trajectory, navigation.start, navigation.theta_axes)
    values, _ = simulate_ensemble(shared_grid(response, FINEST), among_all(case.draws(len(case.reference))))
    return case.error(values)
