"""Final errors as a polynomial of the start errors, fitted to simulations.

With x the errors in units of their standard deviations about their means, ``y(x) = sum_k c_k x^e_k`` over monomials up
to an order. Since truth and final time do not depend on the sample, y is a smooth function of the errors alone, and a
few thousand samples determine it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain, combinations_with_replacement
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr, solve_triangular

from mcnav.arrays.types import Array, IndexArray
from mcnav.compiled.jit import compiled
from mcnav.linear.partials import Propagate, simulate_or_raise

LANES: Final = 16
"""Samples evaluated side by side."""

POINTS_PER_TERM: Final = 3
REACH: Final = 1.4
"""Standard deviation of the points, fitted and held out, in those of the sources: the points cover the tails of a large
campaign."""

HELD_OUT: Final = 512
SPARED: Final = (0.9, 0.5, 0.2)
"""Shares of the tolerance allowed for leaving out terms; the first that passes on the points held out is used."""
SEED: Final = 1963

ORDERS: Final = (2, 3, 4)
HOPELESS: Final = 1.0
"""Error, as a share of the dispersion, above which no higher order is tried."""


class PolynomialFitError(ArithmeticError):
    """Failure of all polynomial orders to meet the tolerance; the message lists their errors."""


@dataclass(frozen=True)
class PolynomialMap:
    """A fitted polynomial.

    Attributes
    ----------
    centre, scale : ndarray, shape (sources,)
        SI; a source without dispersion has scale zero and is left out.
    exponents : ndarray of int, shape (terms, sources)
        The first is that of the constant.
    coefficients : ndarray, shape (terms, outputs)
        SI units of the outputs.
    error : float
        Largest difference from samples that were not fitted, as a share of the output's dispersion.
    flights : int
        Samples that were fitted.
    reach : float
        Largest distance of a fitted point from the centre, in standard deviations: the limit of validity.
    """

    order: int
    centre: Array
    scale: Array
    exponents: IndexArray
    coefficients: Array
    error: float
    flights: int
    reach: float

    def __call__(self, errors: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Evaluate the final errors, shape (n, outputs), and whether samples are within reach, shape (n,)."""
        errors = np.ascontiguousarray(errors, dtype=float)
        inverse = np.divide(1.0, self.scale, out=np.zeros_like(self.scale), where=self.scale > 0.0)
        values, distance = np.empty((len(errors), self.coefficients.shape[1])), np.empty(len(errors))
        parents, factors = recipe(self.exponents)
        evaluate(errors, self.centre, inverse, parents, factors, np.ascontiguousarray(self.coefficients.T), values,
                 distance)  # fmt: skip
        return values, np.asarray(distance <= self.reach**2)


def monomials(sources: IndexArray, count: int, order: int) -> IndexArray:
    """List the exponents of all monomials up to an order in some of ``count`` sources, shape (terms, count)."""
    chosen = (combinations_with_replacement(sources.tolist(), degree) for degree in range(order + 1))
    rows = [np.bincount(np.array(row, dtype=int), minlength=count) for row in chain.from_iterable(chosen)]
    return np.array(rows, dtype=np.int64)


def recipe(exponents: IndexArray) -> tuple[IndexArray, IndexArray]:
    """Return each monomial's parent, an earlier monomial, and the source that multiplies it."""
    places = {tuple(row): place for place, row in enumerate(exponents.tolist())}
    parents, factors = np.zeros(len(exponents), dtype=np.int64), np.zeros(len(exponents), dtype=np.int64)
    for place, row in enumerate(exponents.tolist()[1:], start=1):
        factor = next(source for source, power in enumerate(row) if power)  # the first, so that parents are sparse too
        row[factor] -= 1
        parents[place], factors[place] = places[tuple(row)], factor
    return parents, factors


@compiled
def evaluate(
    errors: Array, centre: Array, inverse: Array, parents: IndexArray, factors: IndexArray, coefficients: Array,
    values: Array, distance: Array,
) -> None:  # fmt: skip
    """Evaluate a polynomial for many samples, a block of lanes at a time.

    Every monomial is an earlier one times one source; the outputs are one small matrix product a block, whose shape is
    always the same, so that a sample's bits do not depend on its neighbours.
    """
    terms, sources, outputs = len(parents), errors.shape[1], coefficients.shape[0]
    inputs = np.zeros(sources * LANES)
    table, sums = np.empty((terms, LANES)), np.empty((outputs, LANES))
    flat = table.ravel()
    flat[:LANES] = 1.0
    for begin in range(0, errors.shape[0], LANES):
        count = min(LANES, errors.shape[0] - begin)
        for lane in range(count):
            square = 0.0
            for source in range(sources):
                x = (errors[begin + lane, source] - centre[source]) * inverse[source]
                inputs[source * LANES + lane] = x
                square += x * x
            distance[begin + lane] = square
        for term in range(1, terms):
            own, parent, factor = term * LANES, parents[term] * LANES, factors[term] * LANES
            for lane in range(LANES):
                flat[own + lane] = flat[parent + lane] * inputs[factor + lane]
        np.dot(coefficients, table, sums)
        for output in range(outputs):
            for lane in range(count):
                values[begin + lane, output] = sums[output, lane]


@dataclass(frozen=True)
class _FitSamples:
    """Samples for fitting and checking, in standard deviations of sources and outputs."""

    points: Array
    values: Array
    spread: Array
    fitted: int

    def solved(self, exponents: IndexArray) -> tuple[Array, float]:
        """Compute coefficients by least squares, and the largest error on the points held out."""
        table = products(self.points, exponents)
        coefficients = least_squares(table[: self.fitted], self.values[: self.fitted])
        missed = np.abs(table[self.fitted :] @ coefficients - self.values[self.fitted :])
        return coefficients, float(missed.max())


def _fit_samples(propagate: Propagate, centre: Array, scale: Array, terms: int) -> _FitSamples:
    fitted = max(POINTS_PER_TERM * terms, 64)
    points = np.zeros((fitted + HELD_OUT, len(scale)))
    active = np.flatnonzero(scale > 0.0)
    generator = np.random.Generator(np.random.Philox(SEED))
    points[:, active] = REACH * generator.standard_normal((len(points), len(active)))
    values = simulate_or_raise(propagate, centre + points * scale)
    spread = values.std(axis=0) / REACH
    spread = np.where(spread > 0.0, spread, np.maximum(np.abs(values).max(axis=0), np.finfo(float).tiny))
    return _FitSamples(points, values / spread, spread, fitted)


def fit(propagate: Propagate, centre: Array, scale: Array, order: int, tolerance: float = 0.0) -> PolynomialMap:
    """Fit a polynomial of an order to simulations, and measure its error on others.

    Centre and scale are the means and standard deviations of the sources, SI. With a positive tolerance, a share of the
    dispersion, terms that are not needed for it are left out. Raises `SimulationFailed` when a sample that it needs
    fails.
    """
    whole = exponents = monomials(np.flatnonzero(scale > 0.0), len(scale), order)
    samples = _fit_samples(propagate, centre, scale, len(exponents))
    of_whole, error = samples.solved(exponents)
    coefficients = of_whole
    if 0.0 < tolerance < HOPELESS and error <= tolerance:
        for share in SPARED:
            exponents = whole[_needed(samples.points, whole, of_whole, share * tolerance)]
            coefficients, error = samples.solved(exponents)
            if error <= tolerance:
                break
    reach = float(np.sqrt((samples.points[: samples.fitted] ** 2).sum(axis=1).max()))
    return PolynomialMap(order, centre, scale, exponents, coefficients * samples.spread, error, samples.fitted, reach)


def _needed(points: Array, exponents: IndexArray, coefficients: Array, spare: float) -> IndexArray:
    """Select the largest terms, and those from which they are computed."""
    sizes = (np.abs(coefficients) * np.sqrt((products(points, exponents) ** 2).mean(axis=0))[:, None]).max(axis=1)
    rising = np.argsort(sizes)
    needed = np.asarray(exponents.sum(axis=1) <= 2)  # few
    needed[rising[np.cumsum(sizes[rising]) > spare]] = True
    parents, _ = recipe(exponents)
    for term in range(len(exponents) - 1, 0, -1):
        needed[parents[term]] |= needed[term]
    return np.flatnonzero(needed)


def least_squares(table: Array, values: Array) -> Array:
    """Solve ``table @ coefficients = values`` by QR decomposition, shape (terms, outputs)."""
    orthogonal, triangle = qr(table, mode="economic", check_finite=False)
    return np.asarray(solve_triangular(triangle, orthogonal.T @ values, check_finite=False))


def products(points: Array, exponents: IndexArray) -> Array:
    """Evaluate every monomial at every point, shape (n, terms)."""
    parents, factors = recipe(exponents)
    result = np.ones((len(points), len(exponents)))
    for term in range(1, len(exponents)):
        result[:, term] = result[:, parents[term]] * points[:, factors[term]]
    return result


def fitted_map(propagate: Propagate, centre: Array, scale: Array, tolerance: float) -> PolynomialMap:
    """Fit the polynomial of lowest order that meets a tolerance on samples that were not fitted.

    Raises `PolynomialFitError` when none of `ORDERS` does, and `SimulationFailed` when a sample that it needs fails.
    """
    tried = []
    for order in ORDERS:
        fitted = fit(propagate, centre, scale, order, tolerance)
        if fitted.error <= tolerance:
            return fitted
        tried.append(f"{fitted.error:.1e} with order {order}")
        if not fitted.error <= HOPELESS:
            break
    raise PolynomialFitError(
        f"no polynomial represents these flights within {tolerance:g} of the dispersion: the error is "
        f"{', '.join(tried)}; use the ensemble engine"
    )
