"""This program's own engines: the ensemble's kernel on a grid of given nodes, and the polynomial map.

Truth, linear response and grid are part of the preparation, as they are of a campaign. The knob is the number of nodes,
which a campaign would choose by itself (see `tests.benchmarks.kernel`); the map's is its order.
"""

from __future__ import annotations

import numpy as np

from mcnav.contract.engine import without_noise
from mcnav.linear.polynomial import fit
from mcnav.linear.polynomial_engine import PolynomialEngine
from mcnav.systems.reentry.engines import ENSEMBLE_CHUNK, EnsembleEngine, Navigation
from mcnav.systems.reentry.ensemble.grid import shared_grid
from mcnav.systems.reentry.ensemble.transition import linear_response
from mcnav.systems.reentry.scenario import Flight, Reentry
from mcnav.systems.reentry.table_i import ALL_ERRORS, TABLE_I, among_all
from mcnav.systems.reentry.vehicle import Vehicle
from tests.benchmarks.case import Case
from tests.benchmarks.peer import Fly, Peer

MAP_NODES = 136
MAP_CHUNK = 65_536


def navigation(case: Case) -> Navigation:
    """The truth of a case, flown by mcnav."""
    row = TABLE_I[case.number]
    return Reentry(Flight(tuple(case.first_point), Vehicle(row.lift_law), row.final_altitude)).navigation


def _engine(case: Case, nodes: int) -> EnsembleEngine:
    flown = navigation(case)
    grid = shared_grid(linear_response(flown.trajectory, flown.start, flown.theta_axes), nodes)
    return EnsembleEngine(flown, grid, "")


def prepare_ensemble(case: Case, nodes: float, cores: int) -> Fly:
    """Samples flown by the kernel; one beyond its validity by the reference path."""
    engine = _engine(case, int(nodes))
    return lambda draws: without_noise(engine)(among_all(draws)).values


def prepare_map(case: Case, order: float, cores: int) -> Fly:
    """Samples evaluated by a polynomial; those beyond the fitted ones are flown."""
    exact = _engine(case, MAP_NODES)
    polynomial = fit(
        lambda draws: without_noise(exact)(draws), np.zeros(len(ALL_ERRORS)), among_all(case.one_sigma), int(order)
    )
    engine = PolynomialEngine(polynomial, exact, "")
    return lambda draws: without_noise(engine)(among_all(draws)).values


ENSEMBLE = Peer(prepare_ensemble, "nodes", (24, 34, 48, 68, 96, 136, 192), ENSEMBLE_CHUNK, "threads")
MAP = Peer(prepare_map, "order", (2, 3, 4), MAP_CHUNK, "threads")
