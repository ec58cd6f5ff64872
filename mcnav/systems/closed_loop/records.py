"""Records of a loop's filter at the epochs, for all samples at once; see `FilterSchema`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.contract.filter_record import BY_SENSOR, FilterSchema
from mcnav.systems.closed_loop.algebra import factorize, whiten
from mcnav.systems.closed_loop.filter import FilterStates
from mcnav.systems.closed_loop.maps import Maps

DOUBTFUL: Final = 1e-8
"""Pivot of a correlation matrix from which on it is regular without a look at its eigenvalues."""

ALL = "all"
"""Group of all navigation errors that the filter estimates."""


def group_members(maps: Maps, states: FilterStates) -> dict[str, tuple[int, ...]]:
    """Return the groups whose NEES is recorded, with their states by number: all, and vectors with several axes."""
    estimate = maps.structure.estimate
    members = {ALL: tuple(range(states.estimated))}
    places = states.estimates.tolist()
    for quantity, place in estimate.places():
        inside = tuple(number for number, at in enumerate(places) if place.start <= at < place.stop)
        alone = not any(other != quantity.name and other.startswith(quantity.name) for other in estimate.names)
        if quantity.axes and len(inside) == quantity.size > 1 and alone and len(inside) < states.estimated:
            members[quantity.name] = inside
    return members


def schema_of(maps: Maps, states: FilterStates, outputs: int) -> FilterSchema:
    """Return the columns of the records."""
    own = tuple((states.estimates - maps.structure.estimate.begin).tolist())
    structure = maps.structure
    considered = tuple(
        quantity.name
        for block in (structure.parameters, structure.markov)
        for quantity, place in block.places()
        if place.start in states.considered
    )
    return FilterSchema(
        groups={name: len(members) for name, members in group_members(maps, states).items()},
        outputs=outputs,
        sensors={} if maps.covariance is not None else {sensor.declared.name: sensor.size for sensor in maps.sensors},
        considered=considered,
        own_outputs=() if len(own) == outputs else own,
    )


@dataclass
class Innovations:
    """Sums over a sensor's updates since the last epoch, and the whitened innovations of the last one."""

    sums: Array
    last: Array | None = None

    def add(self, rows: NDArray[np.intp], white: Array, rejected: NDArray[np.bool_]) -> None:
        """Add an update of some samples: innovations, whitened by what the filter expects of them, shape (k, n)."""
        if self.last is None:
            self.last = np.full((len(white), self.sums.shape[1]), np.nan)
        along = sum_rows(white * self.last[:, rows]) / len(white)
        known = np.isfinite(along)
        added = np.zeros((len(self.sums), len(rows)))
        added[0], added[1], added[2] = sum_rows(white**2), ~rejected, rejected
        added[3], added[4] = np.where(known, along, 0.0), known
        self.sums[:, rows] += added
        self.last[:, rows] = white


@dataclass
class Recorder:
    """Records of n samples at m epochs, shape (n, m, width)."""

    schema: FilterSchema
    maps: Maps
    states: FilterStates
    members: dict[str, tuple[int, ...]]
    records: Array
    sensors: list[Innovations] = field(default_factory=list)

    @classmethod
    def of(cls, schema: FilterSchema, maps: Maps, states: FilterStates, count: int, epochs: int) -> Recorder:
        """Return one without records."""
        sensors = [Innovations(np.zeros((len(BY_SENSOR), count))) for _ in schema.sensors]
        records = np.zeros((epochs, count, schema.width)).transpose(1, 0, 2)  # an epoch is written at once
        records[:, :, schema.places["covariance"]] = np.nan
        return cls(schema, maps, states, group_members(maps, states), records, sensors)

    def navigation_errors(self, x: Array) -> Array:
        """Return the errors of what the filter estimates, shape (estimated, n); of attitudes by rotations."""
        structure = self.maps.structure
        return structure.navigation_errors(x)[self.states.estimates - structure.estimate.begin]

    def record(self, epoch: int, x: Array, covariance: Array) -> None:
        """Record all samples: X, shape (size, n), and the filter's covariance, shape (k, k, n) or (k, k, 1)."""
        schema, states = self.schema, self.states
        estimated, places = states.estimated, schema.places
        errors = self.navigation_errors(x)
        own = covariance[:estimated, :estimated]
        row = self.records[:, epoch]
        for column, members in enumerate(self.members.values()):
            chosen = np.array(members)
            row[:, places["nees"].start + column] = normalized_squares(errors[chosen], own[chosen[:, None], chosen])
        known = np.array(schema.known)
        below, across = np.tril_indices(estimated)
        high, low = np.maximum(known[below], known[across]), np.minimum(known[below], known[across])
        row[:, places["covariance"].start + high * (high + 1) // 2 + low] = own[below, across].T
        sigma = np.sqrt(own[np.arange(estimated), np.arange(estimated)])
        row[:, places["within_1"].start + known] = (np.abs(errors) <= sigma).T
        row[:, places["within_3"].start + known] = (np.abs(errors) <= 3.0 * sigma).T
        for name, sensor in zip(schema.sensors, self.sensors, strict=True):
            row[:, places[f"sensor:{name}"]] = sensor.sums.T
            sensor.sums[:] = 0.0


def normalized_squares(errors: Array, covariance: Array) -> Array:
    """Compute the NEES, shape (n,), of errors, shape (k, n); NaN where the covariance is singular.

    Parameters
    ----------
    covariance : ndarray, shape (k, k, n) or (k, k, 1)
    """
    size = len(errors)
    variance = covariance[np.arange(size), np.arange(size)]
    scale = 1.0 / np.sqrt(np.where(variance > 0.0, variance, 1.0))
    correlation = covariance * scale[:, None] * scale
    factors = factorize(correlation)
    smallest = np.min(factors[np.arange(size), np.arange(size)] ** 2, axis=0)  # NaN where a pivot is not positive
    doubtful = ~(smallest > DOUBTFUL)
    singular = doubtful & ~(variance > 0.0).all(axis=0)
    checked = np.flatnonzero(doubtful & ~singular)
    whole = np.isfinite(correlation[:, :, checked]).all(axis=(0, 1))
    singular[checked[~whole]] = True
    checked = checked[whole]
    lowest = np.linalg.eigvalsh(correlation[:, :, checked].transpose(2, 0, 1))[:, 0]
    singular[checked] = ~(lowest > size * np.finfo(float).eps)
    squares = sum_rows(whiten(factors, errors * scale) ** 2)
    return np.asarray(np.where(singular, np.nan, squares))


def sum_rows(values: Array) -> Array:
    """Sum over rows, one after the other, shape (n,): a library's sum may depend on how many samples there are."""
    total: Array = values[0].copy()
    for row in values[1:]:
        total += row
    return total
