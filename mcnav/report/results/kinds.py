"""Outputs of truth with the navigation error and the navigation dispersion of the same quantity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from mcnav.contract.quantities import NAVIGATED, TRUE, TRUE_DISPERSION, Output, kind_of
from mcnav.store.manifest import Variable

HORIZONTAL: Final = (
    ("east", "north"), ("x", "y"), ("range", "cross_range"), ("along", "across"), ("longitude", "latitude"),
)  # fmt: skip
"""Ends of the names of two directions that make a plane, the one drawn to the right first."""


@dataclass(frozen=True)
class Quantity:
    """A quantity of the truth: numbers of the outputs that are of it, none where there is no such output.

    Attributes
    ----------
    name : str
        As files have it, without ``true_``.
    true : int
        Dispersion of the truth.
    error : int, optional
        Navigation error: indicated less true.
    navigated : int, optional
        Dispersion of what is indicated.
    """

    name: str
    true: int
    error: int | None
    navigated: int | None


def quantities(outputs: Sequence[Variable | Output]) -> list[Quantity]:
    """List the quantities that have an output of truth ``true_NAME``, in the order of these outputs."""
    places = {output.name: place for place, output in enumerate(outputs)}
    listed = []
    for place, output in enumerate(outputs):
        if kind_of(output) == TRUE_DISPERSION and output.name.startswith(TRUE):
            name = output.name.removeprefix(TRUE)
            listed.append(Quantity(name, place, places.get(name), places.get(f"{NAVIGATED}{name}")))
    return listed


def planes(outputs: Sequence[Variable | Output]) -> list[tuple[Quantity, Quantity]]:
    """List the pairs of lengths that are two directions of a plane.

    >>> of = [Output(f"true_position_{axis}", "m", "m", of="truth") for axis in ("north", "east", "down")]
    >>> [(right.name, upward.name) for right, upward in planes(of)]
    [('position_east', 'position_north')]
    """
    known = {quantity.name: quantity for quantity in quantities(outputs) if outputs[quantity.true].unit == "m"}
    return [
        (each, known[f"{name.removesuffix(right)}{upward}"])
        for name, each in known.items()
        for right, upward in HORIZONTAL
        if (name == right or name.endswith(f"_{right}")) and f"{name.removesuffix(right)}{upward}" in known
    ]
