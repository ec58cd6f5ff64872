"""Records of filters at the epochs of a campaign: names and places of the numbers of a record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray

BY_SENSOR: Final = ("nis", "accepted", "rejected", "lag", "lags")
"""Numbers of each sensor, counted since the epoch before.

Sum of the normalized innovations squared over all updates; updates accepted and rejected; sum over consecutive updates
of the products of whitened innovations, by their size; and how many products.
"""


@dataclass(frozen=True)
class FilterSchema:
    """Columns of a record: one row of numbers for each sample and epoch, after the last update at or before it.

    Attributes
    ----------
    groups : mapping of str to int
        Groups of states whose normalized estimation error squared (NEES) is recorded, and their sizes: all,
        navigation, position, velocity, attitude and, if there are other estimated states, sensors.
    outputs : int
        Outputs of the scenario.
    states : tuple of str
        Other states of the filter, by the name of the error that each models; considered ones, too.
    units : tuple of (str, str)
        SI unit of each of these, and the unit in which it is shown.
    sensors : mapping of str to int
        Sensors, and the size of the measurements of each.
    considered : tuple of str
        Kinds of errors that the filter considers without estimating them: they correlate its innovations.
    own_outputs : tuple of int
        Numbers of the outputs of which the filter states a covariance, where these are not all; the others' is NaN.
    """

    groups: Mapping[str, int]
    outputs: int
    states: tuple[str, ...] = ()
    units: tuple[tuple[str, str], ...] = ()
    sensors: Mapping[str, int] = field(default_factory=dict)
    considered: tuple[str, ...] = ()
    own_outputs: tuple[int, ...] = ()

    @cached_property
    def places(self) -> Mapping[str, slice]:
        """Places of the columns by what they hold; a sensor's columns have its name after a colon."""
        sizes = {
            "nees": len(self.groups),
            "covariance": self.outputs * (self.outputs + 1) // 2,
            "within_1": self.outputs,
            "within_3": self.outputs,
            "state_error": len(self.states),
            "state_variance": len(self.states),
            **{f"sensor:{name}": len(BY_SENSOR) for name in self.sensors},
        }
        ends = np.cumsum(list(sizes.values())).tolist()
        return {name: slice(end - size, end) for (name, size), end in zip(sizes.items(), ends, strict=True)}

    @property
    def known(self) -> tuple[int, ...]:
        """Numbers of the outputs of which the filter states a covariance."""
        return self.own_outputs or tuple(range(self.outputs))

    @cached_property
    def stated_columns(self) -> IndexArray:
        """Columns that are not always NaN: all but covariances of outputs of which the filter states none."""
        stated = np.ones(self.width, dtype=bool)
        rows, columns = np.tril_indices(self.outputs)
        stated[self.places["covariance"]] = np.isin(rows, self.known) & np.isin(columns, self.known)
        return np.flatnonzero(stated)

    @property
    def width(self) -> int:
        """Numbers of a record."""
        return int(max(place.stop for place in self.places.values()))

    @property
    def main_group(self) -> str:
        """The group whose NEES is that of a sample: navigation, or the first."""
        return "navigation" if "navigation" in self.groups else next(iter(self.groups))

    def final(self, records: Array) -> Array:
        """Return sigmas of the outputs and the NEES of the main group at the end, shape (n, outputs + 1)."""
        last = records[:, -1]
        variances = np.diagonal(self.covariance(last), axis1=1, axis2=2)
        nees = last[:, self.places["nees"]][:, [list(self.groups).index(self.main_group)]]
        return np.concatenate([np.sqrt(np.maximum(variances, 0.0)), nees], axis=1)

    def covariance(self, records: Array) -> Array:
        """Return the covariances of the outputs, shape (..., outputs, outputs), of records, shape (..., width)."""
        rows, columns = np.tril_indices(self.outputs)
        covariance = np.empty((*records.shape[:-1], self.outputs, self.outputs))
        covariance[..., rows, columns] = covariance[..., columns, rows] = records[..., self.places["covariance"]]
        return covariance


@dataclass(frozen=True)
class FilterPrediction:
    """Linear analysis of a filter at m epochs: its own covariance, and the truth about its other states.

    Attributes
    ----------
    label : str
        What the times are, as ``name [unit]``.
    times : ndarray, shape (m,)
    covariance : ndarray, shape (m, outputs, outputs)
        The filter's own.
    state_variance : ndarray, shape (m, q)
        The filter's own, of its other states.
    state_partials : ndarray, shape (m, q, sources)
        Of the true errors of these states' estimates.
    state_processes : mapping of str to ndarray, shape (m, q)
        Variance that each process adds to them.
    believed : mapping of str to float
        Variance that the filter believes a source or process to have over its true mean square: one where the filter
        models it rightly, zero where it neglects it. Those missing are modelled rightly.
    """

    label: str
    times: Array
    covariance: Array
    state_variance: Array
    state_partials: Array
    state_processes: Mapping[str, Array] = field(default_factory=dict)
    believed: Mapping[str, float] = field(default_factory=dict)
