"""Conditions on noise: some combinations of its standard normals are given, the others stay random.

The noise of a sample is a vector z of independent standard normals, and adds ``N z`` to linear outcomes. With an
orthonormal basis Q of the rows of N, ``w = Q z`` are standard normals themselves, and with random z

    z' = z + Q^T (w - Q z)

has the distribution of z under the condition ``Q z = w`` (Journel and Huijbregts, *Mining Geostatistics*, 1978, of
conditional simulation). The outcomes get ``N Q^T w`` by the condition, and at random what is left of N.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array

LEFT: Final = 1e-4
"""Share of the variance that noise adds to an outcome which may be left without a condition of its own."""

DIGITS: Final = 9
"""Digits of such shares that are compared: the order of equal ones does not depend on rounding."""


@dataclass(frozen=True)
class Conditions:
    """Orthonormal rows Q, shape (r, Z), and what they add to the outcomes, ``factor = N Q^T``, shape (m, r)."""

    directions: Array
    factor: Array

    @classmethod
    def on(cls, partials: Array) -> Conditions:
        """Find Q for N, shape (m, Z), by Gram and Schmidt's method: the row of which most is left comes next.

        Rows of which no more than `LEFT` is left need none, such as those of epochs that follow each other closely.
        """
        sizes = np.sqrt(np.einsum("mz,mz->m", partials, partials))
        remainders = np.divide(partials, sizes[:, None], out=np.zeros_like(partials), where=sizes[:, None] > 0.0)
        squares, rows = (sizes > 0.0).astype(float), list[Array]()
        while (squares > LEFT).any():
            row = remainders[int(np.argmax(np.round(squares, DIGITS)))]
            for direction in rows:  # again: what rounding has left of them
                row = row - (row @ direction) * direction
            row = row / np.sqrt(row @ row)
            rows.append(row)
            remainders = remainders - np.einsum("mz,z->m", remainders, row)[:, None] * row
            squares = np.einsum("mz,mz->m", remainders, remainders)
        directions = np.array(rows).reshape(len(rows), partials.shape[1])
        return cls(directions, np.einsum("mz,rz->mr", partials, directions))

    def met(self, normals: Array, wanted: Array) -> Array:
        """Return z' of z, shape (n, Z), for w, shape (n, r)."""
        missing = wanted - np.einsum("nz,rz->nr", normals, self.directions)
        return np.asarray(normals + np.einsum("nr,rz->nz", missing, self.directions))
