"""Data on a filter: records of the samples' filters, the true errors, and linear analysis of both."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.floor import filter_floor, negligible
from mcnav.arrays.types import Array
from mcnav.contract.power_sums import PowerSums
from mcnav.contract.quantities import Output
from mcnav.sampler.designs import SamplingDesign
from mcnav.statistics.filter_sums import FilterMeans


@dataclass(frozen=True)
class MeanSquares:
    """Mean squares of the true errors at m epochs about zero, SI.

    Attributes
    ----------
    samples : int
    value, standard_error : ndarray, shape (m, outputs)
    """

    samples: int
    value: Array
    standard_error: Array

    @classmethod
    def of(cls, sums: PowerSums) -> MeanSquares:
        """Take them from power sums about zero."""
        squares, fourths = sums.mean_powers
        spread = np.maximum(fourths - squares**2, 0.0)
        error = np.sqrt(spread / (sums.count - 1.0)) if sums.count > 1 else np.full_like(squares, np.inf)
        return cls(sums.count, squares, error)


SINGULAR: Final = 1e-6
"""Smallest eigenvalue of a filter's correlation matrix of which a NEES is judged.

The two covariances of a matched filter agree to 1e-9 of its sigmas, so that such a NEES has an error of some 1e-3.
"""


def singular(correlations: Array) -> NDArray[np.bool_]:
    """Return which of m correlation matrices, shape (m, k, k), are singular to `SINGULAR`, shape (m,)."""
    return np.asarray(np.linalg.eigvalsh(correlations)[:, 0] <= SINGULAR)


@dataclass(frozen=True)
class LinearFilter:
    """Linear analysis of a filter and of the truth at m epochs, SI; see `FilterPrediction`.

    Attributes
    ----------
    covariance : ndarray, shape (m, outputs, outputs)
        The filter's own.
    state_variance : ndarray, shape (m, q)
        The filter's own, of its other states.
    true : ndarray, shape (m, outputs, outputs), optional
        True mean squares and products.
    state_true : ndarray, shape (m, q)
        True mean squares of the errors of these states.
    contributions : mapping of str to ndarray, shape (m, outputs)
        Variance that each source and process contributes to the truth.
    believed : mapping of str to float
        Variance that the filter believes each of these to have, over its true mean square; one for those missing.
    squared_means : mapping of str to ndarray, shape (m, outputs)
        Part of the squared mean error that the mean of each source contributes.
    units : tuple of str
        SI units of the outputs, of which those of one unit share a covariance.
    floor : ndarray, shape (outputs,), optional
        That of the outputs for samples (`mcnav.analysis.floor`).
    scales : ndarray, shape (outputs,), optional
        `Output.limit` of each, infinite without one.
    """

    covariance: Array
    state_variance: Array
    true: Array | None
    state_true: Array
    contributions: Mapping[str, Array] = field(default_factory=dict)
    believed: Mapping[str, float] = field(default_factory=dict)
    squared_means: Mapping[str, Array] = field(default_factory=dict)
    units: tuple[str, ...] = ()
    floor: Array | None = None
    scales: Array | None = None

    @property
    def sigmas(self) -> tuple[Array, Array]:
        """True sigmas and those that the filter computes, shape (m, outputs); zero where the floor hides them."""
        true, own, floor = self._with_floor
        small = negligible(true, own, floor)
        return np.where(small, 0.0, true), np.where(small | (own <= floor), 0.0, own)

    @property
    def negligible(self) -> dict[int, float]:
        """Outputs of which neither sigma is above the floor at some epoch with an error, and their floors, SI."""
        true, own, floor = self._with_floor
        small = (negligible(true, own, floor) & (true > 0.0)).any(axis=0)
        return {int(number): float(floor[number]) for number in np.flatnonzero(small)}

    @property
    def _with_floor(self) -> tuple[Array, Array, Array]:
        """True sigmas, those that the filter computes, shape (m, outputs), and the floors, shape (outputs,)."""
        assert self.true is not None
        true, own = (
            np.sqrt(np.maximum(np.diagonal(each, axis1=1, axis2=2), 0.0)) for each in (self.true, self.covariance)
        )
        units = self.units or tuple(str(number) for number in range(true.shape[1]))
        return true, own, filter_floor(true, own, units, self.floor, self.scales)


@dataclass(frozen=True)
class FilterEvidence:
    """All that a verdict on a filter rests on.

    Attributes
    ----------
    label : str
        What the times are, as ``name [unit]``.
    times : ndarray, shape (m,)
    outputs : tuple of Output
    means : FilterMeans, optional
        Of what the samples' filters say; none when every sample failed.
    true : MeanSquares, optional
        Of the errors of the samples.
    failed : int
        Samples that failed.
    design : str
        One of `mcnav.sampler.designs.DESIGNS`.
    sampling : SamplingDesign
        What it and the sources' distributions allow.
    linear : LinearFilter, optional
    subject : str
        What is judged: the filter, or the smoother behind it.
    floor : ndarray, shape (outputs,), optional
        That of the outputs for samples (`mcnav.analysis.floor`).
    withheld : tuple of int
        Outputs that depend on a source with heavy tails: no interval is known of them.
    """

    label: str
    times: Array
    outputs: tuple[Output, ...]
    means: FilterMeans | None
    true: MeanSquares | None
    failed: int
    design: str = "random"
    sampling: SamplingDesign = field(default_factory=SamplingDesign)
    linear: LinearFilter | None = None
    subject: str = "filter"
    floor: Array | None = None
    withheld: tuple[int, ...] = ()

    @property
    def samples(self) -> int:
        """Samples that did not fail."""
        return 0 if self.means is None else self.means.samples

    @property
    def weight(self) -> float:
        """Independent samples that a sample counts for, at least; see `independent_share`."""
        if self.outputs and len(self.withheld) == len(self.outputs):
            return 0.0
        return independent_share(self.design, self.sampling)


def independent_share(design: str, sampling: SamplingDesign) -> float:
    """Return how many independent samples a sample counts for in a mean of squares, at least; zero where unknown.

    The two of an antithetic pair may have equal squares: they count as one. A hypercube of L samples gives means that
    vary by no more than L / (L - 1) times those of independent samples (Owen, Annals of Statistics 25, 1997, 1541). Of
    a net nothing of the sort is known, nor of sources with heavy tails.

    Parameters
    ----------
    design : str
        One of `mcnav.sampler.designs.DESIGNS`.
    """
    length = sampling.block_length
    if np.isinf(sampling.fewest_blocks) or design == "sobol":
        return 0.0
    if design == "latin-hypercube":
        return max(length - 1.0, 1.0) / length
    return 1.0 / length
