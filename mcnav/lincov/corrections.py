"""Corrections to the linear model from a few hundred further simulations, stored in a campaign's manifest."""

from __future__ import annotations

from collections.abc import Callable
from math import comb
from typing import Any, Final

import numpy as np

from mcnav._types import Array
from mcnav.lincov.higher_order import second_order
from mcnav.lincov.partials import SimulationFailed, partials_by_differences
from mcnav.lincov.polynomial import fit
from mcnav.lincov.polynomial_engine import PolynomialEngine
from mcnav.lincov.polynomial_moments import moments
from mcnav.lincov.simulated_budget import DRAWS, simulate_each_source_alone
from mcnav.lincov.sobol import estimate_sobol_indices
from mcnav.lincov.unscented import unscented_covariance
from mcnav.sampling.error_model import ErrorModel
from mcnav.scenarios.protocol import Engine, Scenario

PROBES: Final = 64
"""Draws from which the engine's accuracy is set."""

QUICK: Final = 1_024
"""Smallest chunk of an engine that is fast enough for tens of thousands of further simulations."""

HIGHER_ORDER: Final = 3
"""Order of the polynomial whose moments are compared with the linear ones."""

ROUGHEST: Final = 0.05
"""Largest error of a polynomial that is used, on samples not fitted, as a share of the dispersion."""


MOST_TERMS: Final = 600
"""Terms of the polynomial, at most: 560 with 13 sources, whose moments take 1 s for nine outputs. With 20 sources they
take 66 s, and with 40 a fit takes gigabytes."""


def simulated_budgets(
    prepare: Callable[[Array], Engine], errors: ErrorModel, partials: Array, design: str, seed: int, samples: int
) -> dict[str, Any]:
    """Simulate the error budgets of single sources, of all sources but one, and by Sobol indices.

    Parameters
    ----------
    prepare : callable
        Function from probes, shape (n, sources), to an engine.
    partials : ndarray, shape (outputs, sources)
    samples : int
        Samples of the campaign, an upper limit of the draws.

    Returns
    -------
    dict
        ``alone`` and ``sobol``: see `mcnav.lincov.simulated_budget.simulate_each_source_alone`,
        `mcnav.lincov.sobol.estimate_sobol_indices`; a table ``{"failed": reason}`` when a sample that it needs fails,
        or the engine is too slow.
    """
    count = min(DRAWS, samples)
    prepared = prepare(errors.draw(design, seed, count, 0, min(PROBES, count)))

    def guarded(study: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        if prepared.chunk < QUICK:
            return {"failed": "the engine is too slow for so many flights on the side"}
        try:
            return study()
        except SimulationFailed as failure:
            return {"failed": str(failure)}

    return {
        "alone": guarded(lambda: simulate_each_source_alone(prepared.propagate, partials, errors, design, seed, count)),
        "sobol": guarded(lambda: estimate_sobol_indices(prepared.propagate, errors, seed)),
    }


def nonlinear_corrections(scenario: Scenario, prepared: Engine, errors: ErrorModel) -> dict[str, Any]:
    """Compute the unscented transform, partials by differences, second-order corrections and polynomial moments, SI.

    Returns
    -------
    dict
        ``unscented``, ``partials_differences``, ``second_order`` and ``higher_order``, each a table of arrays, or
        ``{"failed": reason}`` when a sample that it needs fails.
    """
    sizes = np.array([source.nominal for source in scenario.sources])

    def sigma_points() -> dict[str, Any]:
        mean, covariance = unscented_covariance(prepared.propagate, errors.mean, errors.covariance)
        return {"mean": mean, "covariance": covariance}

    def differences() -> dict[str, Any]:
        return {"partials": partials_by_differences(prepared.propagate, sizes)}

    def derivatives() -> dict[str, Any]:
        found = second_order(prepared.propagate, errors.mean, errors.covariance)
        return {
            "mean_shift": found.mean_shift,
            "quadratic": found.quadratic,
            "third_order": found.third_order,
            "skewness": found.skewness,
        }

    found: dict[str, Any] = {}
    for key, compute in (
        ("unscented", sigma_points),
        ("partials_differences", differences),
        ("second_order", derivatives),
        ("higher_order", lambda: higher_order(prepared, errors)),
    ):
        try:
            found[key] = compute()
        except SimulationFailed as failure:
            found[key] = {"failed": str(failure)}
    return found


def higher_order(prepared: Engine, errors: ErrorModel) -> dict[str, Any]:
    """Compute moments of the final errors in closed form, from a polynomial fitted to simulations.

    Parameters
    ----------
    prepared : Engine
        A polynomial engine's own polynomial is used; to any other engine one of order `HIGHER_ORDER` is fitted.

    Returns
    -------
    dict
        ``mean``, ``covariance``, ``sigma``, ``skewness``, ``kurtosis`` (3 for a normal distribution), and ``order``,
        ``error``, ``flights`` of the polynomial.

    Raises
    ------
    SimulationFailed
        When the sources are not normal, the engine is slow, the polynomial has too many terms, or it does not fit.
    """
    if not errors.normal:
        raise SimulationFailed("the sources are not normal: their moments are not those of the closed form")
    if isinstance(prepared, PolynomialEngine):
        polynomial = prepared.polynomial
    elif prepared.chunk < QUICK:
        raise SimulationFailed("the engine is too slow for so many flights on the side")
    else:
        sources = int(np.count_nonzero(errors.standard_deviations))
        terms = comb(sources + HIGHER_ORDER, HIGHER_ORDER)
        if terms > MOST_TERMS:
            raise SimulationFailed(
                f"with {sources} sources a polynomial of order {HIGHER_ORDER} has {terms:,} terms, more than "
                f"{MOST_TERMS}"
            )
        polynomial = fit(prepared.propagate, errors.mean, errors.standard_deviations, HIGHER_ORDER)
    if not polynomial.error <= ROUGHEST:
        raise SimulationFailed(
            f"a polynomial of order {polynomial.order} is {polynomial.error:.2g} of the dispersion off the flights"
        )
    found = moments(polynomial, errors.covariance)
    return {
        "mean": found.mean,
        "covariance": found.covariance,
        "sigma": np.sqrt(np.diag(found.covariance)),
        "skewness": found.skewness,
        "kurtosis": found.kurtosis,
        "order": polynomial.order,
        "error": polynomial.error,
        "flights": polynomial.flights,
    }
