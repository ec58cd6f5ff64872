"""Corrections of mean and covariance for nonlinearity, from a few hundred to a few thousand further simulations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import comb
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine, without_noise
from mcnav.contract.scenario import Scenario
from mcnav.linear import higher_order
from mcnav.linear.corrections import (
    Corrections,
    DifferencePartials,
    PolynomialMoments,
    SecondOrderCorrections,
    SimulatedBudget,
    Uncomputed,
    UnscentedMoments,
    computed_or_reason,
)
from mcnav.linear.partials import QUICK, SimulationFailed, partials_by_differences, require_fast
from mcnav.linear.polynomial import fit
from mcnav.linear.polynomial_engine import PolynomialEngine
from mcnav.linear.polynomial_moments import moments
from mcnav.linear.unscented import unscented_covariance
from mcnav.sampler.error_model import ErrorModel

HIGHER_ORDER: Final = 3
"""Order of the polynomial whose moments are compared with the linear ones."""

MOST_TERMS: Final = 600
"""Terms of the polynomial, at most: 560 with 13 sources, whose moments take 1 s for nine outputs. With 20 sources they
take 66 s, and with 40 a fit takes gigabytes."""

ROUGHEST: Final = 0.05
"""Largest error of a polynomial that is used, on samples not fitted, as a share of the dispersion."""


def nonlinear_corrections(
    scenario: Scenario, engine: Engine, errors: ErrorModel, budget: SimulatedBudget, samples: int
) -> Corrections:
    """Compute the unscented transform, partials by differences, second-order corrections and polynomial moments.

    A slow engine simulates no corrections of second order that need more simulations than the campaign has samples.

    Parameters
    ----------
    budget : SimulatedBudget
        Error budgets, which are corrections as well.
    """
    propagate, sizes = without_noise(engine), np.array([source.nominal for source in scenario.sources])

    def second_order() -> SecondOrderCorrections:
        if engine.chunk < QUICK:
            _require_fewer(_second_order_simulations(errors), samples)
        return _derivatives(engine, errors)

    return Corrections(
        unscented=computed_or_reason(lambda: _unscented(engine, errors)),
        partials_differences=computed_or_reason(lambda: DifferencePartials(partials_by_differences(propagate, sizes))),
        second_order=computed_or_reason(second_order),
        higher_order=computed_or_reason(lambda: polynomial_moments(engine, errors)),
        budget=budget,
    )


def noise_corrections(engine: Engine, errors: ErrorModel, processes: Mapping[str, Array], samples: int) -> Corrections:
    """Compute the unscented transform and second-order corrections of a scenario with noise.

    Both are of the constant errors without noise; the linear covariance of the noise, shape (outputs, outputs) for each
    process, is added. Budgets by simulation and a polynomial's moments, of constant errors alone, are left out. So is a
    correction that needs more simulations than the campaign has samples.
    """
    left_out = Uncomputed("of constant errors alone; the samples of this scenario have noise as well")

    def unscented() -> UnscentedMoments:
        _require_fewer(2 * int(np.count_nonzero(errors.standard_deviations)) + 1, samples)
        moments = _unscented(engine, errors)
        noise = sum(processes.values(), np.zeros(moments.covariance.shape))
        return replace(moments, covariance=moments.covariance + noise)

    def second_order() -> SecondOrderCorrections:
        _require_fewer(_second_order_simulations(errors), samples)
        return _derivatives(engine, errors)

    return Corrections(
        unscented=computed_or_reason(unscented),
        second_order=computed_or_reason(second_order),
        higher_order=left_out,
        budget=SimulatedBudget(left_out, left_out),
    )


def _require_fewer(simulations: int, samples: int) -> None:
    """Raise `SimulationFailed` where a correction needs more simulations than the campaign has samples."""
    if simulations > samples:
        raise SimulationFailed(f"it needs {simulations:,} simulations, more than the campaign has samples")


def _second_order_simulations(errors: ErrorModel) -> int:
    directions = int(np.count_nonzero(errors.standard_deviations))
    return 2 * directions**2 + 2 * directions + 1


def _unscented(engine: Engine, errors: ErrorModel) -> UnscentedMoments:
    return UnscentedMoments(*unscented_covariance(without_noise(engine), errors.mean, errors.covariance))


def _derivatives(engine: Engine, errors: ErrorModel) -> SecondOrderCorrections:
    order = higher_order.second_order(without_noise(engine), errors.mean, errors.covariance)
    corrections = SecondOrderCorrections(order.mean_shift, order.quadratic, order.third_order, order.skewness)
    if not errors.normal:
        return corrections
    slopes, curvatures = order.along_axes
    return replace(corrections, centre=order.centre, slopes=slopes, curvatures=curvatures)


def polynomial_moments(engine: Engine, errors: ErrorModel) -> PolynomialMoments:
    """Compute moments of the final errors in closed form, from a polynomial fitted to simulations.

    A polynomial engine's own polynomial is used; to any other engine one of order `HIGHER_ORDER` is fitted. Raises
    `SimulationFailed` when the sources are not normal, the engine is slow, or no such polynomial fits.
    """
    if not errors.normal:
        raise SimulationFailed("the sources are not normal: their moments are not those of the closed form")
    if isinstance(engine, PolynomialEngine):
        polynomial = engine.polynomial
    else:
        require_fast(engine)
        sources = int(np.count_nonzero(errors.standard_deviations))
        terms = comb(sources + HIGHER_ORDER, HIGHER_ORDER)
        if terms > MOST_TERMS:
            raise SimulationFailed(
                f"with {sources} sources a polynomial of order {HIGHER_ORDER} has {terms:,} terms, more than "
                f"{MOST_TERMS}"
            )
        polynomial = fit(without_noise(engine), errors.mean, errors.standard_deviations, HIGHER_ORDER)
    if not polynomial.error <= ROUGHEST:
        raise SimulationFailed(
            f"a polynomial of order {polynomial.order} departs from the flights by {polynomial.error:.2g} times their "
            "dispersion"
        )
    result = moments(polynomial, errors.covariance)
    sigma = np.sqrt(np.diag(result.covariance))
    return PolynomialMoments(
        **vars(result), sigma=sigma, order=polynomial.order, error=polynomial.error, flights=polynomial.flights
    )
