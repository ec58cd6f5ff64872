"""Polynomial engine: samples are evaluated by a fitted polynomial, those beyond its reach by the exact engine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine, without_noise
from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.history import Epochs
from mcnav.contract.members import ready_engine
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.contract.scenario import Scenario
from mcnav.linear.polynomial import PolynomialMap, fitted_map

TOLERANCE: Final = 1e-4
"""Largest error of the polynomial on samples that were not fitted, as a share of each output's dispersion."""

CHUNK: Final = 65_536

MAP: Final = "map"
"""Name of the engine; every scenario has it."""


@dataclass(frozen=True)
class PolynomialEngine:
    """Engine that evaluates a polynomial fitted to an exact engine, which simulates samples beyond the fitted ones."""

    polynomial: PolynomialMap
    exact: Engine
    accuracy: str
    parallel: str = "threads"
    chunk: int = CHUNK
    epochs: Epochs | None = None
    noisy: bool = False
    filter: FilterSchema | None = None

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        """Simulate samples."""
        errors = batch.errors
        values, known = self.polynomial(errors)
        unknown = np.flatnonzero(~known)
        if len(unknown) == 0:
            return SimulationResult(values)
        simulated = without_noise(self.exact)(errors[unknown])
        values[unknown] = simulated.values
        failures = {int(unknown[row]): failure for row, failure in simulated.failures.items()}
        return SimulationResult(values, failures, len(unknown))


def fit_polynomial_engine(exact: Engine, mean: Array, standard_deviations: Array) -> PolynomialEngine:
    """Fit a polynomial engine to an exact engine, for errors of given means and standard deviations, SI.

    Raises `PolynomialFitError` when no polynomial meets `TOLERANCE`, and `SimulationFailed` when a sample that it
    needs fails.
    """
    polynomial = fitted_map(without_noise(exact), mean, standard_deviations, TOLERANCE)
    accuracy = (
        f"polynomial map of order {polynomial.order}, {len(polynomial.exponents)} terms fitted to "
        f"{polynomial.flights:,} flights; largest error on flights not fitted, drawn wider than the samples, "
        f"{polynomial.error:.1e} of an output's dispersion. Flown: {exact.accuracy}"
    )
    return PolynomialEngine(polynomial, exact, accuracy)


def exact_part(engine: Engine) -> Engine:
    """Return the engine to which a polynomial was fitted, or the engine itself."""
    return engine.exact if isinstance(engine, PolynomialEngine) else engine


def engine_names(scenario: Scenario) -> tuple[str, ...]:
    """List the names of a scenario's engines, the default first; a polynomial knows neither noise nor filters."""
    stochastic = scenario.parts.noise or scenario.parts.filter
    return scenario.engines if stochastic else (*scenario.engines, MAP)


def exact_name(scenario: Scenario, engine: str) -> str:
    """Return the name of the engine behind one of `engine_names`: a polynomial is fitted to the default."""
    return scenario.engines[0] if engine == MAP else engine


def prepare_engine(scenario: Scenario, engine: str, probes: Array, mean: Array, standard_deviations: Array) -> Engine:
    """Prepare one of `engine_names` for errors of given means and standard deviations, shape (sources,), SI.

    For the probes see `mcnav.contract.scenario.Scenario.engine`, for what is raised `fit_polynomial_engine`.
    """
    exact = ready_engine(scenario, exact_name(scenario, engine), probes)
    return fit_polynomial_engine(exact, mean, standard_deviations) if engine == MAP else exact
