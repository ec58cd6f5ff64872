"""What the model of a type of scenario leaves out, for its pages."""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

GRAVITY: Final = "disturbances of gravity, "

NOT_MODELLED: Final = {
    "ins": "Not modelled: disturbances of gravity, vibration and what it rectifies to, errors of time tags, "
    "temperature, bending between instruments and antennas, faults of sensors.",
}
"""By type of scenario; others are their authors' business, or those of the publication that they follow."""

NO_FIELD: Final = (
    "Gravity disturbances are processes of the distance travelled, and no field: a place that is visited twice has two "
    "values."
)


def not_modelled(kind: str, causes: Collection[str] = ()) -> str:
    """Say what the model of a type of scenario leaves out; empty where nothing is known of it.

    Parameters
    ----------
    causes : collection of str
        Names of what it has.

    Examples
    --------
    >>> not_modelled("ins")[:40], not_modelled("my_system.py:MySystem")
    ('Not modelled: disturbances of gravity, v', '')
    >>> not_modelled("ins", ["gravity_anomaly"])[-44:]
    'instruments and antennas, faults of sensors.'
    """
    words = NOT_MODELLED.get(kind, "")
    if not words or not any(name.startswith("gravity_") for name in causes):
        return words
    return f"{NO_FIELD} {words.replace(GRAVITY, '')}"
