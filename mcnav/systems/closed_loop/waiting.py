"""A flight whose navigator waits: the truth flies by what is commanded without errors.

Estimates, memory and commands are those of the nominal. The derivatives of what waits are taken from nominal flights
beside the samples, at each stage of a step.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.systems.closed_loop.flight import Flight
from mcnav.systems.closed_loop.maps import Maps
from mcnav.systems.closed_loop.methods import Method
from mcnav.systems.closed_loop.quantities import Values
from mcnav.systems.closed_loop.setup import Setup
from mcnav.systems.closed_loop.structure import Part, Structure
from mcnav.systems.closed_loop.transitions import Linearization


@dataclass(frozen=True)
class _Beside(Maps):
    """Maps of samples and, as many columns after them, of the nominal flights beside them."""

    def derivative(
        self, x: Array, time: Array, white: Array, part: Part = "both", parameters: Values | None = None
    ) -> Array:
        """Compute dX/dt of both parts, that of what waits from the flight beside."""
        rates = super().derivative(x, time, white, part, parameters)
        count, held = x.shape[1] // 2, self.structure.navigator
        rates[held, :count] = rates[held, count:]
        return rates


@dataclass(frozen=True)
class WaitingMaps(Maps):
    """Maps of a loop whose navigator waits.

    Attributes
    ----------
    nominal : mapping of float to ndarray, shape (size,)
        X without errors by the time at the begin of a step, s.
    """

    nominal: Mapping[float, Array] = field(default_factory=dict)

    @classmethod
    def along(cls, maps: Maps, linear: Linearization) -> WaitingMaps:
        """Return those along the nominal; nothing is measured."""
        nominal = {
            time: x
            for planned in linear.instants
            for time, x in zip(planned.instant.step_times().tolist(), planned.before, strict=False)
        }
        given = {attribute.name: getattr(maps, attribute.name) for attribute in fields(Maps)}
        return cls(**(given | {"update": None, "covariance": None}), nominal=nominal)

    @property
    def apart(self) -> bool:
        """False: what waits is propagated beside the truth."""
        return False

    def triggers_by_truth(self, trigger: Method) -> bool:
        """Return false, for the same reason."""
        return False

    def step(
        self, x: Array, time: Array, length: Array | float, white: Array, fraction: Array | float = 1.0,
        since: Array | float = 0.0, part: Part = "both",
    ) -> Array:  # fmt: skip
        """Propagate both parts by a step, or from one fraction of it to another; see `Maps.step`."""
        count = x.shape[1]
        times, of_time = np.unique(time, return_inverse=True)
        beside = np.array([self.nominal[time] for time in times.tolist()])[of_time].T
        quiet = np.zeros_like(white)
        if np.any(since):
            beside = super().step(beside, time, length, quiet, since)
        of_both = {attribute.name: getattr(self, attribute.name) for attribute in fields(Maps)}
        reached = _Beside(**of_both).step(
            np.concatenate([x, beside], axis=1), np.tile(time, 2), _twice(length),
            np.concatenate([white, quiet], axis=2), _twice(fraction), _twice(since),
        )  # fmt: skip
        return reached[:, :count]

    def corrected(self, number: int, x: Array, time: Array, noise: Array) -> Array:
        """Return X after a correction: what waits does not know of its execution error."""
        result = super().corrected(number, x, time, noise)
        held = self.structure.navigator
        result[held] = super().corrected(number, x, time, np.zeros_like(noise))[held]
        return result


def _twice(share: Array | float) -> Array | float:
    return np.tile(share, 2) if np.ndim(share) else share


def follow_truth(structure: Structure) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the places in X of estimates that start at their sample's own truth, and those of this truth."""
    places, counterparts = structure.pairs
    follows = (counterparts < structure.truth.whole.stop) & (structure.navigator_start == "truth")
    return places[follows], counterparts[follows]


def wait(flight: Flight) -> None:
    """Let the navigators of samples at their start wait: without errors, measurements and filters."""
    setup = flight.setup
    held = setup.maps.structure.navigator
    flight.x[held], flight.deviation[held] = setup.start[held, None], 0.0
    flight.setup = replace(setup, maps=WaitingMaps.along(setup.maps, setup.plan), states=None)


def begin(flight: Flight, setup: Setup, errors: Array) -> None:
    """Let navigators start: where the nominal has them, as far off as their own truth, and with their errors.

    Parameters
    ----------
    setup : Setup
        Of what comes.
    errors : ndarray, shape (n, sources)
    """
    plan, structure = setup.plan, setup.maps.structure
    assert plan.begin is not None
    nominal, space = plan.instants[plan.begin.number].before[-1], structure.space
    places, counterparts = follow_truth(structure)
    apart, told = space.minus(flight.x, nominal[:, None]), np.zeros_like(flight.x)
    told[places] = apart[counterparts]
    started = flight.x.copy()
    started[structure.navigator] = nominal[structure.navigator, None]
    flight.x = space.plus(space.plus(started, told), plan.begin.errors @ errors[flight.rows].T)
    flight.deviation = plan.begin.state @ flight.deviation + plan.begin.errors @ errors.T
    flight.setup = setup
    if flight.own:
        flight.covariance = np.repeat(plan.begin.covariance[:, :, None], len(flight.rows), axis=2)
