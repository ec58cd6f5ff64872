"""Records of a loop's filter at the epochs, for all samples at once; see `FilterSchema`."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array
from mcnav.contract.filter_record import BY_SENSOR, FilterSchema
from mcnav.systems.closed_loop.filter import FilterStates
from mcnav.systems.closed_loop.maps import Maps

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
        sensors={sensor.declared.name: sensor.size for sensor in maps.sensors},
        considered=considered,
        own_outputs=() if len(own) == outputs else own,
    )


@dataclass
class Innovations:
    """Sums over a sensor's updates since the last epoch, and the whitened innovations of the last one."""

    sums: Array
    last: Array | None = None

    def add(self, rows: NDArray[np.intp], innovation: Array, covariance: Array) -> None:
        """Add an update of some samples: innovations, shape (k, n), and covariance, shape (k, k) or (n, k, k)."""
        factor = np.linalg.cholesky(covariance)
        white = np.linalg.solve(factor, innovation.T[:, :, None])[:, :, 0]
        self.sums[0, rows] += np.sum(white**2, axis=1)
        self.sums[1, rows] += 1.0
        if self.last is None:
            self.last = np.full((self.sums.shape[1], white.shape[1]), np.nan)
        along = np.sum(white * self.last[rows], axis=1) / white.shape[1]
        known = np.isfinite(along)
        self.sums[3, rows] += np.where(known, along, 0.0)
        self.sums[4, rows] += known
        self.last[rows] = white


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
        sensors = [Innovations(np.zeros((len(BY_SENSOR), count))) for _ in maps.sensors]
        records = np.zeros((count, epochs, schema.width))
        return cls(schema, maps, states, group_members(maps, states), records, sensors)

    def navigation_errors(self, x: Array) -> Array:
        """Return the errors of what the filter estimates, shape (estimated, n); of attitudes by rotations."""
        structure = self.maps.structure
        return structure.navigation_errors(x)[self.states.estimates - structure.estimate.begin]

    def record(self, epoch: int, x: Array, covariance: Array) -> None:
        """Record all samples: X, shape (size, n), and the filter's covariance, shape (k, k) or (n, k, k)."""
        schema, states, count = self.schema, self.states, x.shape[1]
        estimated, places = states.estimated, schema.places
        errors = self.navigation_errors(x).T
        own = np.broadcast_to(covariance[..., :estimated, :estimated], (count, estimated, estimated))
        row = self.records[:, epoch]
        for column, members in enumerate(self.members.values()):
            chosen = list(members)
            row[:, places["nees"].start + column] = _nees(errors[:, chosen], own[:, chosen][:, :, chosen])
        whole = np.full((count, schema.outputs, schema.outputs), np.nan)
        known = np.array(schema.known)
        whole[:, known[:, None], known] = own
        below, across = np.tril_indices(schema.outputs)
        row[:, places["covariance"]] = whole[:, below, across]
        sigma = np.sqrt(np.diagonal(own, axis1=1, axis2=2))
        row[:, places["within_1"].start + known] = np.abs(errors) <= sigma
        row[:, places["within_3"].start + known] = np.abs(errors) <= 3.0 * sigma
        for name, sensor in zip(schema.sensors, self.sensors, strict=True):
            row[:, places[f"sensor:{name}"]] = sensor.sums.T
            sensor.sums[:] = 0.0


def _nees(errors: Array, covariance: Array) -> Array:
    """Compute the NEES, shape (n,), of errors, shape (n, k); NaN where the covariance is singular."""
    size = errors.shape[1]
    variance = np.diagonal(covariance, axis1=1, axis2=2)
    scale = 1.0 / np.sqrt(np.where(variance > 0.0, variance, 1.0))
    correlation = covariance * scale[:, :, None] * scale[:, None, :]
    broken = ~np.isfinite(correlation).all(axis=(1, 2))
    correlation[broken] = np.eye(size)
    regular = (variance > 0.0).all(axis=1) & (np.linalg.eigvalsh(correlation)[:, 0] > size * np.finfo(float).eps)
    correlation[~regular] = np.eye(size)
    deviations = (errors * scale)[:, :, None]
    squares = np.sum(deviations * np.linalg.solve(correlation, deviations), axis=(1, 2))
    return np.asarray(np.where(regular & ~broken, squares, np.nan))
