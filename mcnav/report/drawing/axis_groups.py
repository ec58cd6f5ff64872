"""Quantities that share a diagram: those with the same unit, or whose names differ only in their axis."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Final

from mcnav.analysis.filter_consistency import SigmaConsistency
from mcnav.report.drawing.marks import Series
from mcnav.report.drawing.palette import SOURCE_COLOURS
from mcnav.report.names import humanize

AXES: Final = frozenset([
    "x", "y", "z", "xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz", "north", "east", "down", "up", "roll", "pitch",
    "yaw", "heading", "azimuth", "elevation", "vertical", "horizontal", "downrange", "crossrange", "1", "2", "3",
])  # fmt: skip
"""Last words of names that tell the axis."""

HUES: Final = (0, 4, 2, 6, 8, 5, 1, 11, 3, 7, 9, 10)
"""Colours of sources in the order in which the curves of one diagram take them: the first ones are far apart."""

Group = tuple[str, tuple[SigmaConsistency, ...]]
"""Title of a diagram, and the quantities in it."""


def stem(label: str) -> str:
    """Return a name for people without its axis.

    >>> stem("gyro bias x"), stem("heading"), stem("altimeter bias")
    ('gyro bias', 'heading', 'altimeter bias')
    """
    words = label.split()
    return " ".join(words[:-1]) if len(words) > 1 and words[-1] in AXES else label


def same_unit(quantities: Sequence[SigmaConsistency]) -> list[Group]:
    """Group quantities by their units; more than have a colour are several groups."""
    return _grouped(quantities, lambda row: (row.unit, row.shown_in))


def _grouped(quantities: Sequence[SigmaConsistency], key: Callable[[SigmaConsistency], Hashable]) -> list[Group]:
    consistencies: dict[Hashable, list[SigmaConsistency]] = {}
    for quantity in quantities:
        consistencies.setdefault(key(quantity), []).append(quantity)
    parts = [
        tuple(members[begin : begin + len(HUES)])
        for members in consistencies.values()
        for begin in range(0, len(members), len(HUES))
    ]
    return [(_title(members), members) for members in parts]


def _title(members: Sequence[SigmaConsistency]) -> str:
    names = [humanize(member.name) for member in members]
    stems = names if len(names) == 1 else list(dict.fromkeys(map(stem, names)))
    return stems[0] if len(stems) == 1 else f"{', '.join(stems[:-1])} and {stems[-1]}"


def curves(panel: int, members: Sequence[SigmaConsistency]) -> list[Series]:
    """Return the series of the quantities of a diagram, with names of their own in the figure.

    Where the title says the rest, labels are the axes.
    """
    names = [humanize(member.name) for member in members]
    common = len(names) > 1 and len(set(map(stem, names))) == 1
    labels = [name.split()[-1] for name in names] if common else names
    return [
        Series(f"curve-{panel}-{place}", label, SOURCE_COLOURS[HUES[place % len(HUES)]])
        for place, label in enumerate(labels)
    ]
