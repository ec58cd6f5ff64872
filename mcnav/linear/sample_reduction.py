"""Reduction of samples to block sums (`mcnav.linear.block_sums`)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.compiled.jit import compiled
from mcnav.linear.block_sums import BlockSums, Normalization, column_count


class BlockReduction:
    """Block sums of a stretch of samples that comes in pieces, whose bits do not depend on the pieces.

    The sum of a block is that of its two halves, and so on down to single samples, of which those that failed and those
    outside of the stretch are zero. So the sums of blocks twice as long are sums of two of these, to the last bit.

    Parameters
    ----------
    begin : int
        Index of the first sample.
    """

    def __init__(self, frame: Normalization, begin: int) -> None:
        self.frame, self.index = frame, begin
        # the sum of the left half at each size, until the right one is complete
        self._halves = np.zeros((frame.block.bit_length(), column_count(len(frame.centre))))

    def add(self, errors: Array, outcomes: Array, linear: Array | None = None) -> BlockSums:
        """Reduce the next samples, from their errors, shape (n, sources), and their outcomes, shape (n, outputs).

        The outcomes of a sample that failed are NaN. ``linear`` are those of the linear system, where they depend on
        noise besides the errors. The blocks returned are those that are complete, counted from the first that is not.
        """
        frame, begin, outputs = self.frame, self.index, len(self.frame.centre)
        successful = np.asarray(np.isfinite(outcomes).all(axis=1))
        deviations = errors[successful] - frame.mean
        y = (outcomes[successful] - frame.centre) / frame.scale
        if linear is None:
            z = np.einsum("nj,ij->ni", deviations, frame.partials) / frame.scale
        else:
            z = (linear[successful] - frame.centre) / frame.scale
        self.index += len(errors)
        first = begin // frame.block
        blocks = np.zeros((self.index // frame.block - first, column_count(outputs)))
        within = np.zeros(len(frame.radii))
        _add(
            np.ascontiguousarray(y), z, successful, begin % frame.block, self._halves, frame.whitening, frame.radii,
            blocks, within,
        )  # fmt: skip
        lost = errors[~successful] - frame.mean
        return BlockSums(
            first, blocks, deviations.sum(axis=0), deviations.T @ deviations, within, lost.sum(axis=0), lost.T @ lost
        )

    def rest(self) -> Array:
        """Return the sums of the last block, shape (1, columns), where it is not complete, else shape (0, columns)."""
        position, total = self.index % self.frame.block, np.zeros(self._halves.shape[1])
        for level, half in enumerate(self._halves):
            if position >> level & 1:
                total = half + total
        return total[None][: 1 if position else 0]


@compiled
def _add(
    y: Array,
    z: Array,
    successful: NDArray[np.bool_],
    position: int,
    halves: Array,
    whitening: Array,
    radii: Array,
    blocks: Array,
    within: Array,
) -> None:
    outputs, top, row, block = y.shape[1], halves.shape[0] - 1, 0, 0
    sums = np.empty(halves.shape[1])
    for sample in range(successful.shape[0]):
        for column in range(sums.shape[0]):
            sums[column] = 0.0
        if successful[sample]:
            sums[0] = 1.0
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
            row += 1
        # a binary counter: bit l of the position tells whether the left half of 2^l samples waits for its right one
        level, waiting = 0, position
        while level < top and waiting & 1:
            for column in range(sums.shape[0]):
                sums[column] += halves[level, column]
            level += 1
            waiting >>= 1
        if level == top:
            for column in range(sums.shape[0]):
                blocks[block, column] = sums[column]
            block += 1
            position = 0
        else:
            for column in range(sums.shape[0]):
                halves[level, column] = sums[column]
            position += 1
