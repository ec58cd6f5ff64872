"""Numbers that their own check refuses: that answer is withheld, and whatever else a command computes goes on."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final, TypeVar

from mcnav.errors import NumericalError
from mcnav.execution.progress import note

MOST_SAID: Final = 3
"""Refusals of one process that are noted: a curve may have one at each of its points."""

Answer = TypeVar("Answer")

_said: Final[list[str]] = []


def or_withheld(compute: Callable[..., Answer], *values: Any, instead: Any = math.nan) -> Answer:
    """Return a function's answer or, where a check refuses it, NaN or what stands ``instead``; a note says why.

    >>> or_withheld(math.hypot, 3.0, 4.0)
    5.0
    """
    try:
        return compute(*values)
    except NumericalError as refusal:
        note_refusal(refusal)
        return instead  # type: ignore[no-any-return]


def note_refusal(refusal: NumericalError) -> None:
    """Say once why a number is withheld, for the first `MOST_SAID` reasons."""
    words = str(refusal)
    if words not in _said and len(_said) < MOST_SAID:
        _said.append(words)
        note(words)
