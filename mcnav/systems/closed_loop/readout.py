"""Outputs of a loop: what is read out of X."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.quantities import Of, Output
from mcnav.systems.closed_loop.differences import Derivatives, differentiate_map
from mcnav.systems.closed_loop.maps import Maps
from mcnav.systems.closed_loop.structure import Structure
from mcnav.systems.closed_loop.transitions import Linearization

ROUNDING: Final = 1e-12
"""Share of a quantity's largest nominal value below which its deviations are rounding, of some thousand steps."""


def standard_outputs(structure: Structure, guided: bool) -> tuple[Output, ...]:
    """Name the outputs that every loop has, in the order of their rows."""
    outputs: list[Output] = []

    def add(name: str, unit: str, of: Of, size_of: tuple[str, ...] = ()) -> None:
        outputs.append(Output(name, unit, unit, of=of, size_of=size_of, departs=of == "truth"))

    for prefix, of, block in (("", "navigation", structure.estimate), ("true_", "truth", structure.truth),
                              ("navigated_", "truth", structure.estimate)):  # fmt: skip
        for quantity in block.quantities:
            if prefix != "navigated_" or quantity.name in structure.truth.names:
                for name in quantity.names:
                    add(f"{prefix}{name}", quantity.unit, of)  # type: ignore[arg-type]
    if guided:
        (command,) = structure.command.quantities
        for name in command.names:
            add(name, command.unit, "control")
    for quantity in structure.corrections.quantities:
        for name in quantity.names:
            add(name, quantity.unit, "control")
        if quantity.axes:
            add(f"{quantity.name}_size", quantity.unit, "control", quantity.names)
    for quantity in structure.clock.quantities:
        add(quantity.name, quantity.unit, "time")
    return tuple(outputs)


@dataclass(frozen=True)
class Readout:
    """Navigation errors, dispersions of truth and of navigation, commands, corrections with their size, times, others.

    The last are outputs of the user's own.
    """

    maps: Maps

    @property
    def structure(self) -> Structure:
        """Structure of X."""
        return self.maps.structure

    @property
    def guided(self) -> bool:
        """True where there are commands."""
        return self.maps.guide is not None

    @cached_property
    def outputs(self) -> tuple[Output, ...]:
        """Names and units, in the order of the rows."""
        own = self.maps.own_outputs
        if own is None:
            return standard_outputs(self.structure, self.guided)
        added = [
            Output(name, quantity.unit, quantity.unit, of=of)
            for quantity, of in zip(own.quantities, own.of, strict=True)
            for name in quantity.names
        ]
        return (*standard_outputs(self.structure, self.guided), *added)

    def read(self, x: Array, nominal: Array, time: Array) -> Array:
        """Read the outputs, shape (outputs, n), of X, shape (size, n), about the nominal X, shape (size,).

        Parameters
        ----------
        time : ndarray, shape (n,)
        """
        structure = self.structure
        places, counterparts = structure.pairs
        indicated = nominal[:, None].copy()
        indicated[places] = nominal[counterparts, None]
        dispersed = structure.space.minus(x, indicated)
        of_truth = counterparts < structure.truth.whole.stop
        rows = [structure.navigation_errors(x), dispersed[structure.truth.whole], dispersed[places[of_truth]]]
        standard = self._rows(x, rows)
        if self.maps.own_outputs is None:
            return standard
        return np.concatenate([standard, self.maps.own_values(x, time)])

    def read_nominal(self, nominal: Array, time: float) -> Array:
        """Read the outputs of the nominal, shape (outputs,)."""
        return self.read(nominal[:, None], nominal, np.array([time]))[:, 0]

    def origin(self, nominal: Array, floor: Array) -> Array:
        """Return what the outputs are measured from, shape (outputs,): states of the nominal X, shape (size,).

        It is zero of errors, of what is read out as it is, of attitudes, whose departures are rotations, and of states
        that are zero but for rounding.

        Parameters
        ----------
        floor : ndarray, shape (outputs,)
            Rounding of the outputs.
        """
        structure = self.structure
        places, counterparts = structure.pairs
        of_truth = counterparts < structure.truth.whole.stop
        states = nominal.copy()
        for place, _ in structure.truth.attitudes:
            states[place] = 0.0
        rows = [np.zeros(len(places)), states[structure.truth.whole], states[counterparts[of_truth]]]
        values = np.zeros(len(self.outputs))
        known = np.concatenate(rows)
        values[: len(known)] = known
        return np.where(np.abs(values) > floor, values, 0.0)

    def _rows(self, x: Array, rows: list[Array]) -> Array:
        """Add commands, corrections and times to the rows of errors and dispersions."""
        structure = self.structure
        if self.guided:
            rows.append(x[structure.command.whole])
        for quantity, place in structure.corrections.places():
            rows.append(x[place])
            if quantity.axes:
                rows.append(np.sqrt(np.sum(x[place] ** 2, axis=0, keepdims=True)))
        rows.append(x[structure.clock.whole])
        return np.concatenate(rows)

    @property
    def _linear(self) -> Array:
        """Rows of deviations of X, shape (standard outputs, size), but of sizes, which have none."""
        structure = self.structure
        places, counterparts = structure.pairs
        everything, of_truth = np.eye(structure.size), counterparts < structure.truth.whole.stop
        errors = everything[places] - everything[counterparts]
        return self._rows(everything, [errors, everything[structure.truth.whole], everything[places[of_truth]]])

    def own_derivatives(self, nominal: Array, steps: Array, time: float) -> Derivatives:
        """Differentiate the outputs of the user's own about the nominal."""

        def function(x: Array, entering: Array) -> Array:
            return self.maps.own_values(x, np.full(x.shape[1], time))

        return differentiate_map(function, nominal, steps, np.zeros(0), self.structure.space)

    def floor(self, linear: Linearization) -> Array:
        """Return the deviations of outputs below which they are rounding, shape (outputs,)."""
        matrix, largest = np.abs(self._linear), linear.largest_values(self.structure)
        floors = (matrix * largest).max(axis=1, initial=0.0)
        if self.maps.own_outputs is not None:
            derivatives = self.own_derivatives(linear.instants[linear.end].nominal, linear.steps, linear.end_time)
            own = np.maximum((np.abs(derivatives.state) * largest).max(axis=1), np.abs(derivatives.value))
            floors = np.concatenate([floors, own])
        return np.asarray(ROUNDING * floors)

    def partials(self, nominal: Array, steps: Array, time: float) -> Array:
        """Return the derivatives of the outputs by X, shape (outputs, size); that of a size at zero is zero.

        Parameters
        ----------
        steps : ndarray, shape (size,)
            Sizes of X, from which steps of differences follow.
        """
        size = self.structure.size
        matrix = self._linear
        names = [output.name for output in self.outputs]
        for quantity, place in self.structure.corrections.places():
            if quantity.axes:
                impulse = nominal[place]
                length = float(np.linalg.norm(impulse))
                row = np.zeros(size)
                row[place] = impulse / length if length > 0.0 else 0.0
                matrix[names.index(f"{quantity.name}_size")] = row
        if self.maps.own_outputs is None:
            return matrix
        return np.concatenate([matrix, self.own_derivatives(nominal, steps, time).state])
