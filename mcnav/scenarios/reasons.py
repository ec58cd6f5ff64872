"""Why samples failed, when there are many reasons."""

from __future__ import annotations

import re
from typing import Final

_NUMBER: Final = re.compile(r"-?\d+(?:[.,]\d+)*(?:e[+-]?\d+)?")


def without_numbers(reason: str) -> str:
    """A reason as those are told that differ in their numbers alone.

    >>> without_numbers("fell to 3.5 km")
    'fell to … km'
    """
    return _NUMBER.sub("…", reason)
