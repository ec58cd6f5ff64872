"""Outputs of a loop: what is read out of X."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.contract.quantities import Of, Output
from mcnav.systems.closed_loop.structure import Structure

ROUNDING: Final = 1e-12
"""Share of a quantity's largest nominal value below which its deviations are rounding, of some thousand steps."""


@dataclass(frozen=True)
class Readout:
    """Navigation errors, dispersions of truth and of navigation, commands, corrections with their size, final time."""

    structure: Structure
    guided: bool

    @cached_property
    def outputs(self) -> tuple[Output, ...]:
        """Names and units, in the order of the rows."""
        structure = self.structure
        outputs: list[Output] = []

        def add(name: str, unit: str, of: Of, size_of: tuple[str, ...] = ()) -> None:
            outputs.append(Output(name, unit, unit, of=of, size_of=size_of))

        for prefix, of, block in (("", "navigation", structure.estimate), ("true_", "truth", structure.truth),
                                  ("navigated_", "truth", structure.estimate)):  # fmt: skip
            for quantity in block.quantities:
                if prefix != "navigated_" or quantity.name in structure.truth.names:
                    for name in quantity.names:
                        add(f"{prefix}{name}", quantity.unit, of)  # type: ignore[arg-type]
        if self.guided:
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

    @property
    def navigation(self) -> int:
        """Number of navigation errors: the first outputs."""
        return self.structure.estimate.size

    def read(self, x: Array, nominal: Array) -> Array:
        """Read the outputs, shape (outputs, n), of X, shape (size, n), about the nominal X, shape (size,)."""
        structure = self.structure
        places, counterparts = structure.pairs
        indicated = nominal[:, None].copy()
        indicated[places] = nominal[counterparts, None]
        dispersed = structure.space.minus(x, indicated)
        of_truth = counterparts < structure.truth.whole.stop
        rows = [structure.navigation_errors(x), dispersed[structure.truth.whole], dispersed[places[of_truth]]]
        return self._rows(x, rows)

    def _rows(self, x: Array, rows: list[Array]) -> Array:
        """Add commands, corrections and final time to the rows of errors and dispersions."""
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
        """Rows of deviations of X, shape (outputs, size), but of sizes, which have none."""
        structure = self.structure
        places, counterparts = structure.pairs
        everything, of_truth = np.eye(structure.size), counterparts < structure.truth.whole.stop
        errors = everything[places] - everything[counterparts]
        return self._rows(everything, [errors, everything[structure.truth.whole], everything[places[of_truth]]])

    def floor(self, largest: Array) -> Array:
        """Return the deviations of outputs below which they are rounding, shape (outputs,).

        Parameters
        ----------
        largest : ndarray, shape (size,)
            Largest value of X along the nominal.
        """
        matrix = np.abs(self._linear)
        return np.asarray(ROUNDING * (matrix * largest).max(axis=1, initial=0.0))

    def partials(self, nominal: Array) -> Array:
        """Return the derivatives of the outputs by X, shape (outputs, size); that of a size at zero is zero."""
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
        return matrix
