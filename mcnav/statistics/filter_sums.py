"""Sums over the records of samples' filters: what chunks of samples add up to the means of all."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.filter_record import BY_SENSOR, FilterSchema


@dataclass(frozen=True)
class Means:
    """Means over samples, their standard errors, and how many samples there were; all of one shape.

    A mean over no samples is NaN, and a standard error over fewer than two is infinite.
    """

    value: Array
    standard_error: Array
    count: Array


@dataclass(frozen=True)
class FilterSums:
    """Counts, sums and sums of squares of every column, at m epochs and, last, of its total over a sample's epochs.

    The columns are those of `FilterSchema` and, after them, the squares of the errors of the filter's other states.
    Entries that are not finite are left out, and counted by ``counts``.

    Attributes
    ----------
    samples : int
        Samples that did not fail.
    counts, sums, squares : ndarray, shape (m + 1, columns)
    """

    samples: int
    counts: Array
    sums: Array
    squares: Array

    @classmethod
    def of(cls, schema: FilterSchema, records: Array) -> FilterSums:
        """Sum the records of samples that did not fail, shape (n, m, width).

        >>> schema = FilterSchema({"all": 1}, outputs=1)
        >>> FilterSums.of(schema, np.ones((5, 3, schema.width))).sums[:, 0]
        array([ 5.,  5.,  5., 15.])
        """
        stated = schema.stated_columns
        if len(stated) < schema.width:
            return cls._of_stated(schema, records, stated)
        return cls._of_columns(records, schema.places["state_error"])

    @classmethod
    def _of_stated(cls, schema: FilterSchema, records: Array, stated: IndexArray) -> FilterSums:
        """Sum the columns of what filters state, beside which all are NaN."""
        first = int(np.searchsorted(stated, schema.places["state_error"].start))
        errors = slice(first, first + len(schema.states))
        some = cls._of_columns(np.ascontiguousarray(records[:, :, stated]), errors)
        places = np.append(stated, schema.width + np.arange(len(schema.states)))
        whole = np.zeros((3, len(some.counts), schema.width + len(schema.states)))
        whole[:, :, places] = some.counts, some.sums, some.squares
        return cls(some.samples, *whole)

    @classmethod
    def _of_columns(cls, records: Array, errors: slice) -> FilterSums:
        known = np.isfinite(records)
        if not known.all():
            records = np.where(known, records, 0.0)
        squared = records[:, :, errors] ** 2
        blocks = [records, squared] if squared.shape[2] else [records]
        filter_sums: tuple[list[Array], list[Array], list[Array]] = [], [], []
        counted = known, known[:, :, errors]
        for block, finite in zip(blocks, counted, strict=False):
            totals, any_known = block.sum(axis=1), finite.any(axis=1)
            filter_sums[0].append(np.vstack([finite.sum(axis=0), any_known.sum(axis=0)]))
            filter_sums[1].append(np.vstack([block.sum(axis=0), totals.sum(axis=0)]))
            filter_sums[2].append(
                np.vstack([np.einsum("nmf,nmf->mf", block, block), np.einsum("nf,nf->f", totals, totals)])
            )
        counts, sums, squares = (np.concatenate(blocks, axis=1).astype(float) for blocks in filter_sums)
        return cls(len(records), counts, sums, squares)

    def __add__(self, other: FilterSums) -> FilterSums:
        counts, sums, squares = self.counts + other.counts, self.sums + other.sums, self.squares + other.squares
        return FilterSums(self.samples + other.samples, counts, sums, squares)

    @property
    def means(self) -> Means:
        """Means of all columns at all epochs, and of their totals."""
        count = self.counts
        some, several = count > 0, count > 1
        value = np.where(some, self.sums / np.where(some, count, 1.0), np.nan)
        spread = np.maximum(self.squares - self.sums * np.nan_to_num(value), 0.0)
        error = np.sqrt(spread / np.where(several, count * (count - 1.0), 1.0))
        return Means(value, np.where(several, error, np.inf), count)

    def to_numbers(self) -> Array:
        """Return all numbers in one row, the number of samples last."""
        return np.concatenate(
            [self.counts.ravel(), self.sums.ravel(), self.squares.ravel(), np.array([float(self.samples)])]
        )

    @classmethod
    def from_numbers(cls, schema: FilterSchema, numbers: Array) -> FilterSums:
        """Restore sums from their numbers; `ValueError` when there are not as many as the schema asks for."""
        columns = schema.width + len(schema.states)
        if not len(numbers) or not np.isfinite(numbers[-1]):
            raise ValueError("they have no number of samples")
        counts, sums, squares = numbers[:-1].reshape(3, -1, columns)
        return cls(int(numbers[-1]), counts, sums, squares)


@dataclass(frozen=True)
class FilterMeans:
    """Means over all samples by what they are of; the last row of each is of totals over a sample's epochs.

    Attributes
    ----------
    samples : int
    means : Means
        Of all columns.
    """

    schema: FilterSchema
    samples: int
    means: Means

    @classmethod
    def of(cls, schema: FilterSchema, sums: FilterSums) -> FilterMeans:
        """Divide the sums by the counts."""
        return cls(schema, sums.samples, sums.means)

    def _at(self, columns: slice | IndexArray) -> Means:
        means = self.means
        return Means(means.value[:, columns], means.standard_error[:, columns], means.count[:, columns])

    def at(self, name: str) -> Means:
        """Return the means of columns by the name of their place, shape (m + 1, columns)."""
        return self._at(self.schema.places[name])

    @property
    def variances(self) -> Means:
        """Mean variances of the outputs, shape (m + 1, outputs)."""
        first, outputs = self.schema.places["covariance"].start, np.arange(self.schema.outputs)
        return self._at(first + outputs * (outputs + 3) // 2)

    @property
    def covariances(self) -> Array:
        """Mean covariances of the outputs at the epochs, shape (m, outputs, outputs)."""
        return self.schema.covariance(self.means.value[:-1, : self.schema.width])

    @property
    def squared_state_errors(self) -> Means:
        """Mean squares of the errors of the other states, shape (m + 1, states)."""
        return self._at(slice(self.schema.width, None))

    def sensors(self) -> Iterator[tuple[str, int, dict[str, Means]]]:
        """Yield the name of each sensor, the size of its measurements, and the means of its columns, shape (m + 1,)."""
        for name, size in self.schema.sensors.items():
            first = self.schema.places[f"sensor:{name}"].start
            means = self.means
            yield (
                name,
                size,
                {
                    key: Means(means.value[:, column], means.standard_error[:, column], means.count[:, column])
                    for column, key in enumerate(BY_SENSOR, start=first)
                },
            )
