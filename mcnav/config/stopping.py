"""``samples`` as a table: fly until a stated precision is reached."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Final

from mcnav.config.schema import UntilTable
from mcnav.errors import Problem
from mcnav.units import UnitError, quantity

QUANTITIES: Final = ("sigma_ratio", "sigma_ratio_paired")
"""What may be made precise, named as in ``summary.json``: Monte Carlo over linear sigma, plain or paired."""

GROWING: Final = ("random", "antithetic")
"""Designs whose samples stay as they are when more are added."""


@dataclass(frozen=True)
class StoppingRule:
    """When to stop.

    Attributes
    ----------
    quantity : str
        One of `QUANTITIES`.
    precision : float
        Half the width that the interval of every output's ratio may have.
    confidence : float
        Of all those intervals together.
    at_most : int
        Samples.
    """

    quantity: str
    precision: float
    confidence: float
    at_most: int

    def described(self) -> dict[str, Any]:
        """As a manifest keeps it."""
        return asdict(self)


def read_stopping_rule(table: UntilTable, design: str, file: str, problems: list[Problem]) -> StoppingRule | None:
    """When to stop; mistakes are added to the list."""
    name, _, written = table.until.strip().partition(" ")
    key = "samples.until"
    if name not in QUANTITIES:
        wanted = " or ".join(f'"{each} 1 %"' for each in QUANTITIES)
        problems.append(Problem(file, key, f"got {table.until!r}; expected a quantity and its precision: {wanted}"))
        return None
    try:
        precision = quantity(written, "1")
    except UnitError as wrong:
        problems.append(Problem(file, key, str(wrong)))
        return None
    if not 0.0 < precision < 1.0:
        problems.append(Problem(file, key, f"got {table.until!r}; expected a precision above 0 and below 100 %"))
        return None
    if design not in GROWING:
        message = f"needs design {' or '.join(GROWING)}: the samples of {design} change when more are added"
        problems.append(Problem(file, key, message))
        return None
    return StoppingRule(name, precision, table.confidence, table.at_most)
