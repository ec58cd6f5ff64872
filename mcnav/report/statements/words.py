"""Parts of sentences: lists of names that stay short, causes with their shares, and numbers of samples."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from mcnav.statistics.power import sensible_step

WORST: Final = ("differs", "partly", "undecided", "agrees")
"""Tones of verdicts, the worst first."""

TONES: Final = {
    "consistent": "agrees", "optimistic": "differs", "pessimistic": "partly", "undecided": "undecided",
}  # fmt: skip
"""Tones of the verdicts on a filter."""

ALL: Final = 1.005
"""Sum of shares beyond which correlations take a part of it, rather than rounding."""

LISTED: Final = 3
"""Names that a sentence lists; tables have all."""


def joined(names: Sequence[str]) -> str:
    """Join names by commas and a last *and*."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def several(names: Sequence[str], most: int = LISTED) -> str:
    """List names, of many the first and how many more there are.

    >>> several(["x", "y", "z"]), several(["a", "b", "c", "d", "e"])
    ('x, y and z', 'a, b, c and 2 more')
    """
    rest = len(names) - most
    return joined([*names[:most], *([f"{rest} more"] if rest > 0 else [])])


def listed(causes: Sequence[tuple[str, float]]) -> str:
    """List causes with their shares in one line.

    >>> listed([("gyro bias z", 0.2113), ("heading", 0.05)])
    'gyro bias z 21.1 %, heading 5 %'
    >>> listed([("position", 0.65), ("velocity", 0.45)])
    'position 65 %, velocity 45 % (above 100 %: correlated)'
    """
    words = ", ".join(f"{name} {100.0 * share:.3g} %" for name, share in causes)
    above = sum(share for _, share in causes) > ALL
    return f"{words} (above 100 %: correlated)" if above else words or "–"


def more_samples(needed: int, samples: int) -> str:
    """Round the number of samples needed for a decision to a sensible step above the present number.

    >>> more_samples(1_001, 1_000), more_samples(15_333, 1_000)
    ('about 1,300 samples', 'about 16,000 samples')
    """
    return f"about {sensible_step(needed, samples):,} samples"
