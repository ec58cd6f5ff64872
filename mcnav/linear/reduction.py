"""Samples reduced to what comparing them with the linear model needs, so that they need not be kept.

Every second-order estimate of a comparison is a mean over samples of products of flown errors y and linear ones z, and
its standard error is that of block means. Sums of these products over blocks of samples therefore say as much as the
samples do, whatever the mean turns out to be. Sums add up: blocks that two chunks share, and chunks to a campaign.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.physics.jit import compiled

Array = NDArray[np.float64]

BLOCKS: Final = 2_048
"""Blocks of a campaign of independent draws, at least, where it has as many samples."""


def columns_of(outputs: int) -> int:
    """Sums of a block: count, y, z, products of y and of z (upper triangles by rows), third and fourth powers of y.

    >>> columns_of(4)
    37
    """
    return 1 + 4 * outputs + outputs * (outputs + 1)


def reduced_block(samples: int, of_design: int) -> int:
    """Samples of a block: a power of two, and whole blocks of the design.

    >>> reduced_block(100_000_000, 1), reduced_block(1_000, 2), reduced_block(100_000_000, 4_194_304)
    (32768, 2, 4194304)
    """
    return max(of_design, 1 << (max(1, samples // BLOCKS).bit_length() - 1))


@dataclass(frozen=True)
class Frame:
    """How samples are normalised before they are summed.

    Attributes
    ----------
    partials : ndarray, shape (outputs, sources)
    mean : ndarray, shape (sources,)
        Of the sources.
    centre, scale : ndarray, shape (outputs,)
        Linear mean and sigma of the outputs; a scale of one without dispersion.
    whitening : ndarray, shape (outputs, rank)
        Turns normalised outputs into independent ones of unit variance, by the linear covariance.
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


@dataclass(frozen=True)
class Reduced:
    """Sums over the samples of a stretch; but for the last two, of those that did not fail.

    Attributes
    ----------
    first : int
        Number of the first block.
    blocks : ndarray, shape (blocks, columns_of(outputs))
        Of normalised outputs.
    errors : ndarray, shape (sources,)
        Sum of the sources' errors about their mean, SI.
    squares : ndarray, shape (sources, sources)
        Sum of their products.
    within : ndarray, shape (levels,)
        Samples within each radius.
    lost : ndarray, shape (sources,)
    lost_squares : ndarray, shape (sources, sources)
        As ``errors`` and ``squares``, of the samples that failed.
    """

    first: int
    blocks: Array
    errors: Array
    squares: Array
    within: Array
    lost: Array
    lost_squares: Array

    def __add__(self, other: Reduced) -> Reduced:
        """With the stretch that follows: a block that both have a part of is one."""
        shared = self.first + len(self.blocks) - other.first
        blocks = np.zeros((len(self.blocks) + len(other.blocks) - shared, self.blocks.shape[1]))
        blocks[: len(self.blocks)] = self.blocks
        blocks[len(self.blocks) - shared :] += other.blocks
        return Reduced(
            self.first,
            blocks,
            self.errors + other.errors,
            self.squares + other.squares,
            self.within + other.within,
            self.lost + other.lost,
            self.lost_squares + other.lost_squares,
        )


def reduced(frame: Frame, begin: int, errors: Array, outcomes: Array) -> Reduced:
    """Reduce a stretch of samples.

    Parameters
    ----------
    frame : Frame
    begin : int
        Index of the first sample.
    errors : ndarray, shape (n, sources)
    outcomes : ndarray, shape (n, outputs)
        NaN in the row of a sample that failed.
    """
    flown = np.isfinite(outcomes).all(axis=1)
    away = errors[flown] - frame.mean
    y = (outcomes[flown] - frame.centre) / frame.scale
    z = np.einsum("nj,ij->ni", away, frame.partials) / frame.scale
    first, last = begin // frame.block, (begin + len(errors) - 1) // frame.block
    places = (begin + np.flatnonzero(flown)) // frame.block - first
    blocks = np.zeros((last - first + 1, columns_of(len(frame.centre))))
    within = np.zeros(len(frame.radii))
    _add(np.ascontiguousarray(y), z, places, frame.whitening, frame.radii, blocks, within)
    lost = errors[~flown] - frame.mean
    return Reduced(first, blocks, away.sum(axis=0), away.T @ away, within, lost.sum(axis=0), lost.T @ lost)


@compiled
def _add(
    y: Array, z: Array, places: NDArray[np.int64], whitening: Array, radii: Array, blocks: Array, within: Array
) -> None:
    outputs = y.shape[1]
    for row in range(y.shape[0]):
        sums = blocks[places[row]]
        sums[0] += 1.0
        column = 1
        for i in range(outputs):
            sums[column + i] += y[row, i]
            sums[column + outputs + i] += z[row, i]
        column += 2 * outputs
        for i in range(outputs):
            for j in range(i, outputs):
                sums[column] += y[row, i] * y[row, j]
                column += 1
        for i in range(outputs):
            for j in range(i, outputs):
                sums[column] += z[row, i] * z[row, j]
                column += 1
        for i in range(outputs):
            square = y[row, i] * y[row, i]
            sums[column + i] += square * y[row, i]
            sums[column + outputs + i] += square * square
        distance = 0.0
        for direction in range(whitening.shape[1]):
            along = 0.0
            for i in range(outputs):
                along += y[row, i] * whitening[i, direction]
            distance += along * along
        for level in range(len(radii)):
            if distance <= radii[level]:
                within[level] += 1.0
