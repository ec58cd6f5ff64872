"""Block sums of samples, which replace the samples in comparisons with the linear model.

Every second-order estimate of a comparison is a mean over samples of products of simulated errors y and linear ones z,
and its standard error is that of block means. Sums of these products over blocks of samples are therefore sufficient,
whatever the mean. Sums are additive: over chunks that share a block, and over the chunks of a campaign.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.statistics.whitening import whitening

BLOCKS: Final = 2_048
"""Smallest number of blocks of a campaign of independent draws, where it has as many samples."""


def column_count(outputs: int) -> int:
    """Count a block's sums: count, y, z, products of y and z (upper triangles by rows), third and fourth powers of y.

    >>> column_count(4)
    37
    """
    return 1 + 4 * outputs + outputs * (outputs + 1)


def block_size(samples: int, of_design: int) -> int:
    """Return the samples of a block: a power of two, and whole blocks of the design.

    >>> block_size(100_000_000, 1), block_size(1_000, 2), block_size(100_000_000, 4_194_304)
    (32768, 2, 4194304)
    """
    return max(of_design, 1 << (max(1, samples // BLOCKS).bit_length() - 1))


@dataclass(frozen=True)
class Normalization:
    """Normalization of samples before they are summed, by the linear model.

    Attributes
    ----------
    mean : ndarray, shape (sources,)
        Mean of the sources.
    centre, scale : ndarray, shape (outputs,)
        Linear mean and sigma of the outputs; a scale of one without dispersion.
    whitening : ndarray, shape (outputs, rank)
        Transformation of normalised outputs to independent ones of unit variance, by the linear covariance.
    radii : ndarray, shape (levels,)
        Squared distances, rising, within which samples are counted.
    block : int
        Samples of a block.
    """

    partials: Array
    mean: Array
    centre: Array
    scale: Array
    whitening: Array
    radii: Array
    block: int

    @classmethod
    def of(
        cls, partials: Array, mean: Array, centre: Array, covariance: Array, samples: int, block_length: int
    ) -> Normalization:
        """Normalize the samples of a campaign by its linear model.

        Parameters
        ----------
        covariance : ndarray, shape (outputs, outputs)
            Linear covariance of the outputs.
        samples : int
            Samples of the campaign.
        block_length : int
            Samples in an independent block of the design.

        Examples
        --------
        Two outputs, of which the second has no dispersion:

        >>> Normalization.of(np.eye(2), np.zeros(2), np.zeros(2), np.diag([4.0, 0.0]), 1_000, 1).scale
        array([2., 1.])
        """
        sigma = np.sqrt(np.diag(covariance))
        scale = np.where(sigma > 0.0, sigma, 1.0)
        given = whitening(covariance)
        whitened = np.ascontiguousarray(scale[:, None] * given.matrix)
        return cls(partials, mean, centre, scale, whitened, given.radii, block_size(samples, block_length))


@dataclass(frozen=True)
class BlockSums:
    """Sums over the samples of a stretch: the last two over the failed samples, the others over the successful ones.

    Attributes
    ----------
    first : int
        Number of the first block.
    blocks : ndarray, shape (blocks, column_count(outputs))
        Sums of normalised outputs.
    errors, squares : ndarray, shapes (sources,) and (sources, sources)
        Sum of the sources' errors about their mean, SI, and of their products.
    within : ndarray, shape (levels,)
        Samples within each radius.
    lost, lost_squares : ndarray
        As ``errors`` and ``squares``, for the samples that failed.
    """

    first: int
    blocks: Array
    errors: Array
    squares: Array
    within: Array
    lost: Array
    lost_squares: Array

    def __add__(self, other: BlockSums) -> BlockSums:
        """Add the stretch that follows, which may share a block."""
        shared = self.first + len(self.blocks) - other.first
        blocks = np.zeros((len(self.blocks) + len(other.blocks) - shared, self.blocks.shape[1]))
        blocks[: len(self.blocks)] = self.blocks
        blocks[len(self.blocks) - shared :] += other.blocks
        totals = (getattr(self, attribute.name) + getattr(other, attribute.name) for attribute in fields(self)[2:])
        return BlockSums(self.first, blocks, *totals)

    def followed_by(self, blocks: Array) -> BlockSums:
        """Append blocks, shape (n, columns), whose samples the totals have already."""
        return replace(self, blocks=np.concatenate([self.blocks, blocks]))

    def doubled(self) -> BlockSums:
        """Return the sums over blocks twice as long, of which the first and the last may have one half each."""
        edges = (self.first % 2, (self.first + len(self.blocks)) % 2)
        halves = np.pad(self.blocks, (edges, (0, 0)))
        return replace(self, first=self.first // 2, blocks=halves[::2] + halves[1::2])
