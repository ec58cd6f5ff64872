"""What the model of a type of scenario leaves out, for its pages."""

from __future__ import annotations

from typing import Final

NOT_MODELLED: Final = {
    "ins": "Not modelled: disturbances of gravity but for those of [gravity], vibration and what it rectifies to, errors "
    "of time tags, temperature, bending between instruments and antennas, faults of sensors.",
}
"""By type of scenario; others are their authors' business, or those of the publication that they follow."""


def not_modelled(kind: str) -> str:
    """Say what the model of a type of scenario leaves out; empty where nothing is known of it.

    >>> not_modelled("ins")[:37], not_modelled("my_system.py:MySystem")
    ('Not modelled: disturbances of gravity', '')
    """
    return NOT_MODELLED.get(kind, "")
