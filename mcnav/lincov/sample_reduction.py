"""Reduction of samples to block sums (`mcnav.lincov.block_sums`)."""

from __future__ import annotations

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.compiled.jit import compiled
from mcnav.lincov.block_sums import BlockSums, Normalization, column_count


def reduce_samples(
    frame: Normalization, begin: int, errors: Array, outcomes: Array, linear: Array | None = None
) -> BlockSums:
    """Reduce a stretch of samples, from their errors, shape (n, sources), and their outcomes, shape (n, outputs).

    The outcomes of a sample that failed are NaN. ``linear`` are those of the linear system, where they depend on noise
    besides the errors.
    """
    successful = np.isfinite(outcomes).all(axis=1)
    deviations = errors[successful] - frame.mean
    y = (outcomes[successful] - frame.centre) / frame.scale
    if linear is None:
        z = np.einsum("nj,ij->ni", deviations, frame.partials) / frame.scale
    else:
        z = (linear[successful] - frame.centre) / frame.scale
    first, last = begin // frame.block, (begin + len(errors) - 1) // frame.block
    positions = (begin + np.flatnonzero(successful)) // frame.block - first
    blocks = np.zeros((last - first + 1, column_count(len(frame.centre))))
    within = np.zeros(len(frame.radii))
    _add(np.ascontiguousarray(y), z, positions, frame.whitening, frame.radii, blocks, within)
    lost = errors[~successful] - frame.mean
    return BlockSums(
        first, blocks, deviations.sum(axis=0), deviations.T @ deviations, within, lost.sum(axis=0), lost.T @ lost
    )


@compiled
def _add(
    y: Array, z: Array, positions: IndexArray, whitening: Array, radii: Array, blocks: Array, within: Array
) -> None:
    outputs = y.shape[1]
    for row in range(y.shape[0]):
        sums = blocks[positions[row]]
        sums[0] += 1.0
        column = 1
        for i in range(outputs):
            sums[column + i] += y[row, i]
            sums[column + outputs + i] += z[row, i]
        column += 2 * outputs
        for values in (y, z):
            for i in range(outputs):
                for j in range(i, outputs):
                    sums[column] += values[row, i] * values[row, j]
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
