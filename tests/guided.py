"""Guided reentries along the trajectories of Table I, and what differences of their reference engine say."""

from __future__ import annotations

from typing import Any

import numpy as np

from mcnav.systems.reentry.guided.description import TRUTH_SOURCES, Guidance, GuidedNavigation
from mcnav.systems.reentry.guided.reference import simulate_guided
from mcnav.systems.reentry.scenario import SOURCES
from mcnav.systems.reentry.table_i import TABLE_I
from mcnav.systems.reentry.vehicle import Vehicle
from tests.conftest import reentry

ALL_SOURCES = (*SOURCES, *TRUTH_SOURCES)
NAMES = [source.name for source in ALL_SOURCES]
ALL_SIZES = np.array([source.nominal for source in ALL_SOURCES])
"""A usual size of every error of a guided reentry."""


def guided(number: int, guidance: Guidance | None = None, **options: Any) -> GuidedNavigation:
    """Return a guided reentry along a trajectory of Table I; options are those of its `Flight`."""
    row, unguided = TABLE_I[number], reentry(number, **options).navigation
    return GuidedNavigation(
        unguided.trajectory,
        Vehicle(row.lift_law),
        row.final_altitude,
        options.get("accelerometers_off_above"),
        unguided.start,
        unguided.theta_axes,
        Guidance() if guidance is None else guidance,
    )


def errors_of(**sizes: float) -> np.ndarray:
    """Return errors, shape (sources,), of which all but the named ones are zero."""
    return np.array([sizes.get(name, 0.0) for name in NAMES])


def reference_partials(navigation: GuidedNavigation, fraction: float, names: list[str]) -> np.ndarray:
    """Compute partial derivatives by some errors from flights of the reference engine, shape (outputs, len(names)).

    Central differences over a fraction of each usual size and over half of it, whose error of second order cancels
    (Richardson): ``(4 D(h/2) - D(h)) / 3``.
    """

    def difference(name: str, step: float) -> np.ndarray:
        there, back = (simulate_guided(navigation, errors_of(**{name: sign * step})) for sign in (1.0, -1.0))
        return np.asarray((there - back) / (2.0 * step))

    steps = {name: fraction * ALL_SIZES[NAMES.index(name)] for name in names}
    columns = [(4.0 * difference(name, step / 2.0) - difference(name, step)) / 3.0 for name, step in steps.items()]
    return np.stack(columns, axis=1)
