"""Records without the errors at the start alone, which are solved for after a record has been whitened.

Such errors move no more after the start: x = W u + v, with independent unit sources u. A filter of the other errors is
smaller; it whitens the records x and the responses W. Sizes d of the sources need no pass of their own. With whitened x
and W, and M = W^T W ::

    x^T S^-1 x = |x|^2 - |h|^2      L L^T = I + d M d      h = L^-1 d W^T x      log det S grows by 2 log det L

|x|^2 may be much larger than the difference. Each record is therefore shifted by the u0 that it shows with the
campaign's sizes. Nothing cancels then, and h is zero with these sizes ::

    y = x - W u0      x^T S^-1 x = |y|^2 + |u0 / d|^2 - |h|^2      h = L^-1 (d W^T y - u0 / d)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.recorded import FilteredRecord
from mcnav.judgement.likelihood import respond_freely, whiten_many
from mcnav.judgement.reduction import without_idle
from mcnav.judgement.simulation import Innovations, beside, semidefinite_root


@dataclass(frozen=True)
class StartApart:
    """Records without the errors at the start alone.

    Attributes
    ----------
    record : FilteredRecord
        Of mean zero.
    moving : FilteredRecord
        Without these errors, and without those that stay zero.
    columns : Innovations
        Of R records, without what they show of these errors; behind them the responses W to the m sources.
    shifts : ndarray, shape (m, R)
        What they show: u0.
    sources : ndarray of int, shape (m,)
        Places of the sources.
    """

    record: FilteredRecord
    moving: FilteredRecord
    columns: Innovations
    shifts: Array
    sources: IndexArray

    @classmethod
    def of(cls, record: FilteredRecord, measured: Sequence[Innovations], sources: IndexArray) -> StartApart:
        """Take these errors out of R records, which have no corrections and no mean.

        Parameters
        ----------
        sources : ndarray of int
            `start_alone`.
        """
        moving = without_start(record, sources)
        responses = respond_freely(record, record.to_states[:, sources] @ _root(record, sources))
        columns, count, size = beside([*measured, responses]), sum(len(each) for each in measured), len(sources)
        sums = np.zeros((size, count + size))
        for _, whitened, _ in whiten_many(moving, columns, [{}]):
            sums += whitened[:, count:].T @ whitened
        shifts = np.asarray(np.linalg.solve(np.eye(size) + sums[:, count:], sums[:, :count]), dtype=np.float64)
        for value in columns.values:
            value[:, :count] -= value[:, count:] @ shifts
        return cls(record, moving, columns, shifts, sources)

    @property
    def causes(self) -> frozenset[int]:
        """Causes whose sizes need no pass."""
        return frozenset(self.record.initial_causes[self.sources].tolist())

    def scales(self, factors: Sequence[Mapping[int, float]]) -> Array:
        """Return the sizes of the sources with each of f sets of sizes, shape (f, m)."""
        causes = self.record.initial_causes[self.sources].tolist()
        return np.array([[sizes.get(cause, 1.0) for cause in causes] for sizes in factors]).reshape(len(factors), -1)

    @staticmethod
    def closed(information: Array, products: Array, shifts: Array, scales: Array) -> tuple[Array, Array, Array]:
        """Return u0 / d and h, shapes (f, m, R), and what log det S grows by, (f,).

        Parameters
        ----------
        information, products : ndarray, shapes (..., m, m), (..., m, R)
            M and W^T y.
        shifts : ndarray, shape (m, R)
        scales : ndarray, shape (f, m)
            d.
        """
        inner = np.eye(len(shifts)) + information * scales[:, :, None] * scales[:, None, :]
        root = np.linalg.cholesky(inner)
        estimates = shifts / scales[:, :, None]
        grown = 2.0 * np.sum(np.log(np.diagonal(root, axis1=1, axis2=2)), axis=1)
        return estimates, np.linalg.inv(root) @ (products * scales[:, :, None] - estimates), grown


def without_start(record: FilteredRecord, sources: IndexArray) -> FilteredRecord:
    """Return a record without some sources at the start, and without the errors that then stay zero."""
    initial = record.initial.copy()
    initial[sources] = initial[:, sources] = 0.0
    return without_idle(replace(record, initial=initial))


def start_alone(record: FilteredRecord) -> IndexArray:
    """Return the sources that are errors at the start alone: of causes without process, noise and correlations."""
    causes = record.initial_causes
    acting = {part.cause for stage in record.stages for part in (*stage.processes, *stage.noise)}
    here, there = np.nonzero((record.initial != 0.0) & (causes[:, None] != causes))
    apart = {-1, *acting, *causes[here].tolist(), *causes[there].tolist()}
    chosen = [cause not in apart for cause in causes.tolist()]
    return np.flatnonzero((np.diag(record.initial) > 0.0) & chosen)


def _root(record: FilteredRecord, sources: IndexArray) -> Array:
    """Return a root of the covariance of sources, of each cause by itself, shape (m, m)."""
    causes, result = record.initial_causes[sources], np.zeros((len(sources), len(sources)))
    for cause in np.unique(causes):
        places = np.flatnonzero(causes == cause)
        here = sources[places]
        result[np.ix_(places, places)] = semidefinite_root(record.initial[np.ix_(here, here)])
    return result
