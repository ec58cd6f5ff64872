"""The polynomial map as an engine: samples are evaluated, not flown; those it does not know are flown after all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.linear.polynomial import PolynomialMap, fitted_map
from mcnav.scenarios.protocol import Outcomes, Prepared, Scenario

Array = NDArray[np.float64]

TOLERANCE: Final = 1e-4
"""Largest error of the map on flights that were not fitted, as a share of each output's dispersion."""

CHUNK: Final = 65_536

MAP: Final = "map"
"""Name of the engine; every scenario has it."""


@dataclass(frozen=True)
class MapEngine:
    """A map in place of flights.

    Attributes
    ----------
    polynomial : PolynomialMap
    exact : Prepared
        The engine to which it was fitted, which flies the samples that lie beyond the fitted ones.
    accuracy : str
    """

    polynomial: PolynomialMap
    exact: Prepared
    accuracy: str
    parallel: str = "threads"
    chunk: int = CHUNK

    def propagate(self, errors: Array) -> Outcomes:
        """Final errors of samples, shape (n, sources)."""
        values, known = self.polynomial(errors)
        unknown = np.flatnonzero(~known)
        if len(unknown) == 0:
            return Outcomes(values)
        flown = self.exact.propagate(errors[unknown])
        values[unknown] = flown.values
        failures, tracebacks = (
            {int(unknown[row]): told for row, told in found.items()} for found in (flown.failures, flown.tracebacks)
        )
        return Outcomes(values, failures, len(unknown), tracebacks)


def mapped(exact: Prepared, mean: Array, standard_deviations: Array, tolerance: float = TOLERANCE) -> MapEngine:
    """Fit a map to an engine's flights.

    Parameters
    ----------
    exact : Prepared
    mean, standard_deviations : ndarray, shape (sources,)
        Of the errors that are to be flown, SI.
    tolerance : float

    Raises
    ------
    MapRefused
        When no map meets the tolerance.
    FlightFailed
        When a flight that the fit needs fails.
    """
    polynomial = fitted_map(exact.propagate, mean, standard_deviations, tolerance)
    accuracy = (
        f"polynomial map of order {polynomial.order}, {len(polynomial.exponents)} terms fitted to "
        f"{polynomial.flights:,} flights; largest error on flights not fitted, drawn wider than the samples, "
        f"{polynomial.error:.1e} of an output's dispersion. Flown: {exact.accuracy}"
    )
    return MapEngine(polynomial, exact, accuracy)


def engines_of(scenario: Scenario) -> tuple[str, ...]:
    """Every engine that a scenario can be flown by, the default first."""
    return (*scenario.engines, MAP)


def prepared_by(scenario: Scenario, engine: str, probes: Array, mean: Array, standard_deviations: Array) -> Prepared:
    """One of `engines_of` a scenario, ready to fly errors of given mean and standard deviations, shape (sources,), SI.

    Parameters
    ----------
    scenario : Scenario
    engine : str
    probes : ndarray, shape (n, sources)
        See `mcnav.scenarios.protocol.Scenario.prepared`.
    mean, standard_deviations : ndarray, shape (sources,)

    Raises
    ------
    MapRefused
        When no map represents the flights.
    FlightFailed
        When a flight to which a map is to be fitted fails.
    """
    if engine != MAP:
        return scenario.prepared(engine, probes)
    return mapped(scenario.prepared(scenario.engines[0], probes), mean, standard_deviations)
