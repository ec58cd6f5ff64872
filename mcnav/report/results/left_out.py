"""Effects that the model of a type of scenario leaves out, for its pages."""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

GRAVITY: Final = "disturbances of gravity, "

NOT_MODELLED: Final = {
    "ins": "Not modelled: disturbances of gravity, vibration and what it rectifies to, errors of time tags. Nor "
    "temperature, bending between instruments and antennas, faults of sensors.",
    "reentry": "Not modelled: motion out of the plane, flattening of the earth, wind (the air turns with the earth), "
    "noise of the instruments.",
    "cruise": "Not modelled: rotation and flattening of the earth, disturbances of gravity, noise of the instruments.",
    "hover": "Not modelled: rotation and flattening of the earth, disturbances of gravity, noise of the instruments.",
}
"""By type of scenario; others are their authors' business."""

OWN: Final = "Not modelled: what the code of the scenario leaves out; mcnav cannot list it."
"""Sentence for a scenario that is a class of the user's."""

BENDING, FAULTS = "bending between instruments and antennas", "faults of sensors"
"""Effects of which a campaign may state some."""

NO_FIELD: Final = (
    "Gravity disturbances are processes of the distance travelled, and no field: a place that is visited twice has two "
    "values."
)


def not_modelled(kind: str, causes: Collection[str] = (), faulty: bool = False) -> str:
    """Say what the model of a type of scenario leaves out; empty where nothing is known of it.

    Parameters
    ----------
    causes : collection of str
        Names of what it has.
    faulty : bool
        Whether the campaign states faults of sensors.

    Examples
    --------
    >>> not_modelled("ins")[:40], not_modelled("my_system.py:MySystem")[:41]
    ('Not modelled: disturbances of gravity, v', 'Not modelled: what the code of the scenar')
    >>> not_modelled("ins", ["gravity_anomaly"])[-44:]
    'instruments and antennas, faults of sensors.'
    >>> not_modelled("ins", ["master_flexure_x"], faulty=True)[-75:]
    'bending but for the stated flexure, faults of sensors but for those stated.'
    """
    words = NOT_MODELLED.get(kind, OWN if ".py:" in kind else "")
    if any("_flexure" in name for name in causes):
        words = words.replace(BENDING, "bending but for the stated flexure")
    if faulty:
        words = words.replace(FAULTS, f"{FAULTS} but for those stated")
    if not words or not any(name.startswith("gravity_") for name in causes):
        return words
    return f"{NO_FIELD} {words.replace(GRAVITY, '')}"
