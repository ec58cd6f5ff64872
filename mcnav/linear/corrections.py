"""Corrections to the linear model from further simulations; all arrays SI.

A study that cannot be made is an `Uncomputed` with its reason. The manifest has each as a table of its fields.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from mcnav.arrays.types import Array
from mcnav.linear.partials import SimulationFailed

Result = TypeVar("Result")


@dataclass(frozen=True)
class Uncomputed:
    """A study that cannot be made, and why."""

    failed: str


def computed_or_reason(compute: Callable[[], Result]) -> Result | Uncomputed:
    """Return a result, or the reason when a sample that it needs fails."""
    try:
        return compute()
    except SimulationFailed as failure:
        return Uncomputed(str(failure))


@dataclass(frozen=True)
class UnscentedMoments:
    """Mean, shape (outputs,), and covariance, shape (outputs, outputs), by the unscented transform."""

    mean: Array
    covariance: Array


@dataclass(frozen=True)
class DifferencePartials:
    """Partial derivatives by differences, shape (outputs, sources)."""

    partials: Array


@dataclass(frozen=True)
class SecondOrderCorrections:
    """Corrections of mean and covariance by second and third derivatives; see `mcnav.linear.higher_order`.

    ``centre``, ``slopes`` and ``curvatures`` are those of each output along the axes of its curvature, shapes
    (outputs,) and (outputs, r); none where sources are not normal.
    """

    mean_shift: Array
    quadratic: Array
    third_order: Array
    skewness: Array
    centre: Array | None = None
    slopes: Array | None = None
    curvatures: Array | None = None


@dataclass(frozen=True)
class PolynomialMoments:
    """Moments of the outputs by a polynomial, shape (outputs,), and covariance; the kurtosis is 3 if normal.

    ``order``, ``error`` (a share of the dispersion) and ``flights`` are those of the polynomial.
    """

    mean: Array
    covariance: Array
    skewness: Array
    kurtosis: Array
    sigma: Array
    order: int
    error: float
    flights: int


@dataclass(frozen=True)
class VarianceTable:
    """Variances of the outputs by source and their standard errors, shape (outputs, sources)."""

    variance: Array
    standard_error: Array


@dataclass(frozen=True)
class SourceBudget:
    """Variances from each source alone, and without each source; zero, and all, of one without dispersion."""

    samples: int
    degrees_of_freedom: float
    alone: VarianceTable
    without: VarianceTable


@dataclass(frozen=True)
class SobolIndices:
    """First-order and total Sobol indices and their standard errors, shape (outputs, sources)."""

    replicates: int
    points: int
    first_order: Array
    first_order_standard_error: Array
    total: Array
    total_standard_error: Array


@dataclass(frozen=True)
class SimulatedBudget:
    """Error budgets by simulation."""

    alone: SourceBudget | Uncomputed
    sobol: SobolIndices | Uncomputed


@dataclass(frozen=True)
class Corrections:
    """All corrections of a campaign; the partial derivatives of a scenario with noise have none by differences."""

    unscented: UnscentedMoments | Uncomputed
    second_order: SecondOrderCorrections | Uncomputed
    higher_order: PolynomialMoments | Uncomputed
    budget: SimulatedBudget
    partials_differences: DifferencePartials | Uncomputed | None = None
