"""``samples`` as a table: simulate until a stated precision is reached."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from mcnav.config.schema import UntilTable
from mcnav.entries.context import FileContext

GROWING: Final = ("random", "antithetic")
"""Designs whose samples do not change when more are added."""


@dataclass(frozen=True)
class StoppingRule:
    """Precision at which a run stops.

    Attributes
    ----------
    quantity : str
        One of `QUANTITIES`.
    precision : float
        Largest half-width of the interval of every output's ratio.
    confidence : float
        Joint confidence of all those intervals.
    at_most : int
        Largest number of samples.
    """

    quantity: str
    precision: float
    confidence: float
    at_most: int


def read_stopping_rule(table: UntilTable, design: str, context: FileContext) -> StoppingRule | None:
    """Read the stopping rule; when it is wrong, add the mistake to the context and return None."""
    name, _, written = table.until.strip().partition(" ")
    key = "samples.until"
    precision = context.quantity(written, "1", key)
    if precision is None:
        return None
    if not 0.0 < precision < 1.0:
        context.problem(key, f"got {table.until!r}; expected a precision above 0 and below 100 %")
        return None
    if design not in GROWING:
        needed = " or ".join(GROWING)
        context.problem(key, f"needs design {needed}: the samples of {design} change when more are added")
        return None
    return StoppingRule(name, precision, table.confidence, table.at_most)
