"""A range of linearity in words: multiples, and what a study without noise leaves out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from mcnav.analysis.linearity import DispersionRange
from mcnav.report.sentences import JOINT

WITHOUT_NOISE: Final = (
    "The scenario has noise, which is left out here: the range is that of the constant errors. "
    "A run compares linear covariance and samples with noise."
)
"""Note on the range of linearity of a scenario with noise."""


def multiple_words(value: float, largest: float) -> str:
    """Format a multiple: a dash where there is no effect, a lower bound where it was not reached.

    >>> multiple_words(8.2345, 100.0), multiple_words(float("inf"), 100.0)
    ('8.23', '> 100')
    """
    if math.isnan(value):
        return "–"
    return f"> {largest:g}" if math.isinf(value) else f"{value:.3g}"


def linearity_rows(names: Sequence[str], found: DispersionRange) -> list[tuple[str, list[str]]]:
    """List the multiples up to which each output and the joint distribution agrees, departs, and differs."""
    columns = zip([*names, JOINT], found.agrees_until, found.departs, found.differs_from, strict=True)
    largest = float(found.multiples[-1])
    return [(name, [multiple_words(float(value), largest) for value in values]) for name, *values in columns]
