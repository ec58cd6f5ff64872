"""Mean errors: which part of a mean is an error, what of it is rounding, and where it exceeds one sigma.

Of a navigation error the whole mean is an error, also that of a flight without errors. A state of the truth is in error
by the mean of its departure from the nominal. Commands and times are no errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.quantities import Of

ROUNDING: Final = 1e-9
"""Share of an output's sigma and of what errors of usual size cause, below which its mean is rounding."""

UNDISTURBED: Final = 1e-6
"""Share of the largest error of its unit below which the mean of an output without sigma is rounding."""

LEAST_SPREAD: Final = 1e-6
"""Share of a mean below which its sigma may be rounding, so that no ratio of them is told."""


class Quantity(Protocol):
    """A source or an output."""

    @property
    def unit(self) -> str:
        """SI unit."""

    @property
    def of(self) -> Of:
        """Kind of quantity."""


class Cause(Quantity, Protocol):
    """A source."""

    @property
    def nominal(self) -> float:
        """A usual size."""


def mean_errors(outputs: Sequence[Quantity], mean: Array, nominal: Array | None) -> Array:
    """Return the part of the means, shape (..., outputs), that is an error; NaN of commands and times.

    Parameters
    ----------
    nominal : ndarray, shape (..., outputs), or None
        Part of the means that a flight without errors has.
    """
    are_errors = [output.of in ("navigation", "truth") for output in outputs]
    return np.where(are_errors, departures(outputs, mean, nominal), np.nan)


def departures(outputs: Sequence[Quantity], mean: Array, nominal: Array | None) -> Array:
    """Return the means, shape (..., outputs), of errors, and of other outputs off the nominal flight.

    Parameters
    ----------
    nominal : ndarray, shape (..., outputs), or None
        Part of the means that a flight without errors has.
    """
    if nominal is None:
        return mean
    return np.asarray(mean - np.where([output.of == "navigation" for output in outputs], 0.0, nominal))


def nominal_values(outputs: Sequence[Quantity], nominal: Array | None, origin: Array | None, sigma: Array) -> Array:
    """Return what the outputs are on the nominal flight, shape (..., outputs); NaN of navigation errors.

    Parameters
    ----------
    nominal, origin : ndarray, shape (..., outputs), or None
        As those of `mcnav.contract.linear.LinearSystem`.
    sigma : ndarray, shape (..., outputs)
        Of the outputs: much smaller values are rounding.
    """
    values = np.zeros(len(outputs)) + (0.0 if nominal is None else nominal) + (0.0 if origin is None else origin)
    values = np.where(np.abs(values) > ROUNDING * sigma, values, 0.0)
    return np.where([output.of == "navigation" for output in outputs], np.nan, values)


def rounding_of_means(
    outputs: Sequence[Quantity], sources: Sequence[Cause], partials: Array, mean: Array, sigma: Array
) -> Array:
    """Return below which size a mean is rounding, shape (outputs,), SI.

    Where no error source acts on an output, the largest errors of its unit tell what rounding is.

    Parameters
    ----------
    partials : ndarray, shape (outputs, sources)
    mean, sigma : ndarray, shape (outputs,)
        Of the outputs; over time the largest sigma.
    """
    usual = np.abs(partials) @ np.array([abs(source.nominal) for source in sources])
    floor, sizes = ROUNDING * (usual + sigma), np.abs(mean) + sigma + usual
    for place, output in enumerate(outputs):
        if usual[place] == sigma[place] == 0.0:
            alike = [size for size, other in zip(sizes, outputs, strict=True) if other.unit == output.unit]
            scale = [abs(source.nominal) for source in sources if source.unit == output.unit]
            floor[place] = max(UNDISTURBED * max(alike), ROUNDING * max(scale, default=0.0))
    return np.asarray(floor)


@dataclass(frozen=True)
class LargeMean:
    """A mean error that exceeds one sigma: number of the output, mean error and sigma, SI."""

    output: int
    mean: float
    sigma: float

    @property
    def ratio(self) -> float:
        """Mean error over sigma; infinite where it is more than a million."""
        return float(in_sigmas(abs(self.mean), self.sigma))


def in_sigmas(sizes: Array | float, sigmas: Array | float) -> Array:
    """Divide sizes of means by sigmas: infinite beyond a million; zero over zero is zero."""
    sizes, sigmas = np.broadcast_arrays(np.asarray(sizes, dtype=float), np.asarray(sigmas, dtype=float))
    scattered = sigmas > LEAST_SPREAD * sizes
    ratios = np.divide(sizes, sigmas, out=np.full(sizes.shape, np.inf), where=scattered)
    return np.where(sizes > 0.0, ratios, 0.0)


def large_means(mean: Array, sigma: Array, floor: Array, least: Array | None = None) -> tuple[LargeMean, ...]:
    """List the mean errors that exceed one sigma, shape (outputs,), the largest in sigmas first; NaN is none.

    Parameters
    ----------
    floor : ndarray
        Below which a mean is rounding.
    least : ndarray, optional
        Size that an estimated mean error has at least, by its interval; that of the mean error unless given.
    """
    size = np.abs(mean) if least is None else least
    known = np.isfinite(mean) & np.isfinite(sigma) & (size > sigma) & (size > floor)
    large = [LargeMean(place, float(mean[place]), float(sigma[place])) for place in np.flatnonzero(known).tolist()]
    return tuple(sorted(large, key=lambda entry: -entry.ratio))
