"""Sums over independent blocks of samples: all that a comparison needs, apart from rank statistics.

Let y be the simulated and z the linear final errors of the same draws, SI. Every second-order estimate is a mean of
products of y and z, and its standard error follows from the sums over independent blocks. The sums come from stored
samples (`SampleMoments`) or from a summary (`SummaryMoments`); the analysis does not distinguish the two.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

import numpy as np

from mcnav.arrays.products import transform
from mcnav.arrays.types import Array, IndexArray
from mcnav.linear.block_sums import BlockSums, Normalization
from mcnav.statistics.chunked import scatter, squared_distances, stretches_of_blocks
from mcnav.statistics.shape import power_sums
from mcnav.statistics.whitening import Whitening


@dataclass(frozen=True)
class SampleMoments:
    """Block sums of stored samples that were successful, formed on demand.

    The samples have shape (n, outputs), contiguous by columns; ``begins`` is the first one of each block, shape (b,).
    ``centre`` is the linear mean, shape (outputs,), and ``given`` the whitening by the linear covariance.
    """

    y: Array
    z: Array
    begins: IndexArray
    centre: Array
    given: Whitening

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.y)

    @property
    def unbiased(self) -> float:
        """Factor n / (n - 1) from mean squares about the mean to the unbiased variance."""
        return self.samples / (self.samples - 1.0)

    @cached_property
    def counts(self) -> Array:
        """Samples in each block, shape (b,)."""
        return np.diff(self.begins, append=self.samples).astype(float)

    @cached_property
    def mean(self) -> Array:
        """Mean of y, shape (outputs,)."""
        return np.asarray(self.y.mean(axis=0))

    @cached_property
    def linear_mean(self) -> Array:
        """Mean of z."""
        return np.asarray(self.z.mean(axis=0))

    @cached_property
    def covariances(self) -> tuple[Array, Array]:
        """Unbiased sample covariances of y and of z, each of shape (outputs, outputs)."""
        return scatter(self.y) / (self.samples - 1), scatter(self.z) / (self.samples - 1)

    @cached_property
    def distances(self) -> Array:
        """NEES of each sample of y, shape (n,)."""
        return squared_distances(self.y, self.centre, self.given)

    @cached_property
    def _departures(self) -> tuple[Array, Array]:
        """Samples of y and of z about their means, shape (outputs, n) each."""
        return (self.y - self.mean).T, (self.z - self.linear_mean).T

    def _sums(self, values: Array) -> Array:
        single = len(self.begins) == len(values)
        return values if single else np.asarray(np.add.reduceat(values, self.begins))

    def differences(self, i: int) -> Array:
        """Add up ``y_i - z_i``, shape (b,)."""
        return self._sums(self.y[:, i] - self.z[:, i])

    def products(self, i: int, j: int) -> tuple[Array, Array]:
        """Add up ``y_i y_j``, and ``y_i y_j - z_i z_j``, about the means of all samples, each of shape (b,)."""
        simulated, linear = (
            (values[:, i] - mean[i]) * (values[:, j] - mean[j])
            for values, mean in ((self.y, self.mean), (self.z, self.linear_mean))
        )
        return self._sums(simulated), self._sums(simulated - linear)

    def paired_products(self, i: int, others: IndexArray) -> Array:
        """Add up ``y_i y_j - z_i z_j`` about the means of all samples for several j, shape (others, b)."""
        y, z = self._departures
        products = y[others]
        products *= y[i]
        products -= z[others] * z[i]
        single = len(self.begins) == self.samples
        return products if single else np.asarray(np.add.reduceat(products, self.begins, axis=1))

    def combined(self, weights: Array) -> tuple[Array, Array]:
        """Add up ``u^2``, and ``u^2 - v^2``, of the combinations ``u = w y`` and ``v = w z`` about their means."""
        u, v = ((values - mean) @ weights for values, mean in ((self.y, self.mean), (self.z, self.linear_mean)))
        return self._sums(u * u), self._sums(u * u - v * v)

    @property
    def rounding(self) -> float:
        """Share of its terms' sigmas below which the sigma of a combination is rounding of the sums."""
        return 0.0

    def powers(self, i: int) -> Array:
        """Add up the first four powers of y_i in some origin and unit, shape (4, b)."""
        return power_sums(self.y[:, i], self.begins)

    def nees(self) -> tuple[Array, Array]:
        """Add up the NEES of y, and that less the NEES of z, each of shape (b,)."""
        differences = self.distances - squared_distances(self.z, self.centre, self.given)
        return self._sums(self.distances), self._sums(differences)

    def nees_about_means(self) -> Array:
        """Add up the NEES of y less that of z, each about its mean, shape (b,)."""
        y, z = squared_distances(self.y, self.mean, self.given), squared_distances(self.z, self.linear_mean, self.given)
        return self._sums(y - z)

    def whitened(self, products: bool = True) -> Iterator[tuple[Array, Array]]:
        """Add up in whitened coordinates of dimension r, some blocks at a time.

        The rows are y about the linear mean, ``y - z``, and with ``products`` the distinct elements of ``y y^T - z
        z^T`` about the means of all samples, shape (2 r + r (r + 1) / 2, blocks). With them comes the sum of the
        squares of each row's terms.
        """
        matrix = self.given.matrix.T
        elements = list(zip(*np.triu_indices(self.given.rank), strict=True)) if products else []
        centre, *means = ((matrix @ vector)[:, None] for vector in (self.centre, self.mean, self.linear_mean))
        columns = 2 * self.given.rank + len(elements)
        for rows, own in stretches_of_blocks(self.begins, self.samples, columns):
            u, v = matrix @ self.y[rows].T, matrix @ self.z[rows].T
            y, z = u - means[0], v - means[1]
            sums = np.empty((2 * len(u) + len(elements), own.stop - own.start))
            squares = np.zeros(len(sums))
            starts = self.begins[own] - rows.start
            for k, values in enumerate(chain(u - centre, u - v, (y[a] * y[b] - z[a] * z[b] for a, b in elements))):
                squares[k] = values @ values
                sums[k] = values if len(starts) == len(values) else np.add.reduceat(values, starts)
            yield sums, squares

    def within(self) -> Array:
        """Count the samples inside the linear ellipsoids of probabilities `LEVELS`, shape (levels,)."""
        return np.array([np.count_nonzero(self.distances <= radius) for radius in self.given.radii])


@dataclass(frozen=True)
class SummaryMoments:
    """Block sums of a campaign that stores a summary, in the terms of `SampleMoments`.

    Attributes
    ----------
    y, z : ndarray, shape (b, outputs)
        About the linear mean.
    yy, zz : ndarray, shape (b, outputs, outputs)
        Products.
    thirds, fourths : ndarray, shape (b, outputs)
        Powers of y in units of ``scale``, shape (outputs,).
    hits : ndarray, shape (levels,)
        Samples inside the linear ellipsoids.
    """

    counts: Array
    y: Array
    z: Array
    yy: Array
    zz: Array
    thirds: Array
    fourths: Array
    scale: Array
    hits: Array
    centre: Array
    given: Whitening

    @classmethod
    def of(cls, frame: Normalization, sums: BlockSums, given: Whitening) -> SummaryMoments:
        """Restore units, and the full matrices of products."""
        filled, outputs = sums.blocks[sums.blocks[:, 0] > 0.0], len(frame.scale)
        elements = outputs * (outputs + 1) // 2
        cuts = np.cumsum([1, outputs, outputs, elements, elements, outputs])
        counts, y, z, yy, zz, thirds, fourths = np.split(filled, cuts, axis=1)
        rows, columns = np.triu_indices(outputs)

        def matrix(flat: Array) -> Array:
            full = np.empty((len(flat), outputs, outputs))
            full[:, rows, columns] = full[:, columns, rows] = flat
            return full * np.outer(frame.scale, frame.scale)

        y, z = y * frame.scale, z * frame.scale
        yy, zz = matrix(yy), matrix(zz)
        return cls(counts[:, 0], y, z, yy, zz, thirds, fourths, frame.scale, sums.within, frame.centre, given)

    @property
    def samples(self) -> int:
        return int(self.counts.sum())

    @property
    def unbiased(self) -> float:
        return self.samples / (self.samples - 1.0)

    @cached_property
    def mean(self) -> Array:
        return np.asarray(self.centre + self.y.sum(axis=0) / self.samples)

    @cached_property
    def centred(self) -> tuple[Array, Array]:
        """Sums of the products of y and of z about their means, each of shape (b, outputs, outputs)."""
        centred = []
        for first, second in ((self.y, self.yy), (self.z, self.zz)):
            mean = first.sum(axis=0) / self.samples
            crossed = first[:, :, None] * mean
            centred.append(
                second - crossed - crossed.swapaxes(1, 2) + self.counts[:, None, None] * np.outer(mean, mean)
            )
        return centred[0], centred[1]

    @cached_property
    def covariances(self) -> tuple[Array, Array]:
        unbiased = self.samples / (self.samples - 1.0)
        yy, zz = ((unbiased * products).sum(axis=0) / self.samples for products in self.centred)
        return yy, zz

    def differences(self, i: int) -> Array:
        return np.asarray(self.y[:, i] - self.z[:, i])

    def products(self, i: int, j: int) -> tuple[Array, Array]:
        yy, zz = (each[:, i, j] for each in self.centred)
        return yy, yy - zz

    def paired_products(self, i: int, others: IndexArray) -> Array:
        yy, zz = self.centred
        return np.ascontiguousarray((yy[:, i, others] - zz[:, i, others]).T)

    def combined(self, weights: Array) -> tuple[Array, Array]:
        yy, zz = (np.einsum("bij,i,j->b", each, weights, weights) for each in self.centred)
        return yy, yy - zz

    @property
    def rounding(self) -> float:
        """Root of the largest relative error of a block's sums of n products, n eps."""
        return float(np.sqrt(np.finfo(float).eps * self.counts.max(initial=1.0)))

    def powers(self, i: int) -> Array:
        scale = self.scale[i]
        return np.stack([self.y[:, i] / scale, self.yy[:, i, i] / scale**2, self.thirds[:, i], self.fourths[:, i]])

    def nees(self) -> tuple[Array, Array]:
        weights = self.given.matrix @ self.given.matrix.T
        simulated, linear = (np.einsum("bij,ij->b", products, weights) for products in (self.yy, self.zz))
        return simulated, simulated - linear

    def nees_about_means(self) -> Array:
        weights = self.given.matrix @ self.given.matrix.T
        simulated, linear = (np.einsum("bij,ij->b", products, weights) for products in self.centred)
        return np.asarray(simulated - linear)

    def whitened(self, products: bool = True) -> Iterator[tuple[Array, Array]]:
        matrix = self.given.matrix
        first, second = np.triu_indices(self.given.rank if products else 0)
        yy, zz = self.centred
        elements = transform(matrix.T, yy - zz)[:, first, second]
        sums = np.concatenate([self.y @ matrix, (self.y - self.z) @ matrix, elements], axis=1).T
        yield sums, np.sum(sums**2, axis=1)

    def within(self) -> Array:
        return self.hits


BlockMoments = SampleMoments | SummaryMoments


@dataclass(frozen=True)
class ErrorSums:
    """Sums of start errors about an origin, shape (sources,), and of their products, shape (sources, sources), SI."""

    samples: int
    total: Array
    products: Array

    @classmethod
    def of(cls, errors: Array) -> ErrorSums:
        """Add up errors of shape (n, sources) about their mean."""
        sources = errors.shape[1]
        products = scatter(errors) if len(errors) else np.zeros((sources, sources))
        return cls(len(errors), np.zeros(sources), products)

    @property
    def covariance(self) -> Array:
        """Unbiased sample covariance, shape (sources, sources); NaN from fewer than two samples."""
        if self.samples < 2:
            return np.full_like(self.products, np.nan)
        about = self.products - np.outer(self.total, self.total) / self.samples
        return np.asarray(about / (self.samples - 1))


@dataclass(frozen=True)
class ReducedSamples:
    """Samples of a campaign, reduced to what its analysis needs.

    ``moments`` are block sums of the successful samples, ``stored`` those of the stored ones: the same unless the run
    stores a summary. ``drawn`` and ``successful`` are sums of the start errors of all and of the successful samples.
    """

    moments: BlockMoments
    stored: SampleMoments
    drawn: ErrorSums
    successful: ErrorSums

    @property
    def failed(self) -> int:
        """Samples that failed."""
        return self.drawn.samples - self.successful.samples
