"""Parts of a figure: series, axes, ten kinds of marks, and panels that hold them. Nothing is drawn here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from mcnav.arrays.types import Array
from mcnav.report.drawing.palette import INK, MUTED, SOURCE_COLOURS, variable
from mcnav.report.drawing.ticks import limits

DASHES: Final[dict[str, tuple[float, ...]]] = {
    "line": (), "dashed": (8.0, 3.5), "dashdot": (10.0, 3.0, 2.0, 3.0), "dotted": (2.0, 2.6), "long": (16.0, 4.0),
}  # fmt: skip
"""Kinds of lines, which tell many curves apart where colours cannot: dashes and gaps, px. The style sheet has them."""

SHAPES: Final = ("dot", "ring", "square", "box", "triangle", "onward")
"""Kinds of points; the style sheet has them. Besides, a series may be an ``area``."""


@dataclass(frozen=True)
class Series:
    """An entry of a figure's key: the class of its marks is ``series-NAME``, its kind a line, a shape or ``area``."""

    name: str
    label: str
    colour: str
    kind: str = "line"

    @property
    def variable(self) -> str:
        """The colour as the style sheet names it."""
        return variable(self.colour)

    def of_kind(self, kind: str) -> Series:
        """Return the same series with other marks in the key."""
        return replace(self, kind=kind)


def numbered(number: int, label: str) -> Series:
    """Return one of many series: the first sixty differ in colour or in the kind of line.

    >>> numbered(1, "range"), numbered(13, "bias x").kind
    (Series(name='source-1', label='range', colour='#56b4e9', kind='dashed'), 'dotted')
    """
    around, colour = divmod(number, len(SOURCE_COLOURS))
    lines = tuple(DASHES)
    return Series(f"source-{number}", label, SOURCE_COLOURS[colour], lines[(colour + 2 * around) % len(lines)])


@dataclass(frozen=True)
class Axis:
    """An axis.

    Limits are by default those of the marks, with a margin, a share of the span. Rows from the top and columns from the
    left have ``names`` in place of numbers, at 0, 1, 2 ... A ``bare`` axis has no ticks. Axes with the same ``link``
    zoom together, on the whole page.
    """

    label: str = ""
    unit: str = ""
    log: bool = False
    low: float | None = None
    high: float | None = None
    names: Sequence[str] = ()
    margin: float = 0.04
    bare: bool = False
    link: str = ""

    @property
    def title(self) -> str:
        """Label and unit."""
        return f"{self.label} ({self.unit})" if self.unit and self.label else self.label or self.unit

    def limits(self, reach: Array) -> tuple[float, float]:
        """Return the limits for marks that reach so far; rows and columns have half of one to spare."""
        if self.names:
            return -0.5, len(self.names) - 0.5
        given = [each for each in (self.low, self.high) if each is not None]
        low, high = limits(np.append(reach, given) if given else reach, self.log, self.margin)
        low, high = low if self.low is None else self.low, high if self.high is None else self.high
        return (low, high) if high > low else (low, low + (abs(low) or 1.0))


def axis(column: str, *, low: float | None = None, log: bool = False, margin: float = 0.04, link: bool = False) -> Axis:
    """Return the axis of a column ``name [unit]``; where linked, all axes of that column zoom together.

    >>> axis("altitude [km]").title
    'altitude (km)'
    """
    name, _, unit = column.replace("^2", "²").partition(" [")
    return Axis(name, unit.removesuffix("]"), log, low, margin=margin, link=column if link else "")


@dataclass(frozen=True, eq=False)
class Line:
    """A curve; gaps where it is not finite. The pointer does not read the values of a ``silent`` one."""

    series: Series
    x: ArrayLike
    y: ArrayLike
    width: float = 1.9
    kind: str = ""
    silent: bool = False


@dataclass(frozen=True, eq=False)
class Points:
    """Points, of the shape that their series is; ``texts`` say what each is, ``names`` stand beside them."""

    series: Series
    x: ArrayLike
    y: ArrayLike
    size: float = 6.0
    opacity: float = 1.0
    texts: Sequence[str] = ()
    names: Sequence[str] = ()


@dataclass(frozen=True, eq=False)
class Band:
    """The area between two curves."""

    series: Series
    x: ArrayLike
    low: ArrayLike
    high: ArrayLike
    opacity: float = 1.0


@dataclass(frozen=True, eq=False)
class Bars:
    """Horizontal bars of one series, each with a text that says what it is and one that stands in it."""

    series: Series
    rows: ArrayLike
    low: ArrayLike
    high: ArrayLike
    texts: Sequence[str]
    names: Sequence[str] = ()
    thickness: float = 0.66


@dataclass(frozen=True)
class Interval:
    """A horizontal interval in a row, with a text that says what it is."""

    series: Series
    row: float
    low: float
    high: float
    text: str = ""
    width: float = 2.6


@dataclass(frozen=True)
class Rule:
    """A line across the panel: upright at a place of the x axis, or level; its name stands beside it."""

    at: float
    level: bool = False
    colour: str = MUTED
    kind: str = "line"
    width: float = 1.3
    name: str = ""
    series: Series | None = None


@dataclass(frozen=True)
class Span:
    """An area across the panel between two places of the x axis, or of the y axis where it is level.

    ``text`` says what it is.
    """

    series: Series
    low: float
    high: float
    level: bool = False
    text: str = ""
    opacity: float = 1.0


@dataclass(frozen=True, eq=False)
class Steps:
    """A histogram: the height of each bin between ``edges``, filled."""

    series: Series
    edges: ArrayLike
    heights: ArrayLike


@dataclass(frozen=True, eq=False)
class Cells:
    """A matrix of squares: shares from -1 to 1 as opacity, in one colour for each sign, and what stands on them."""

    positive: Series
    negative: Series
    shares: Array
    texts: Sequence[Sequence[str]]
    deepest: float = 0.5


@dataclass(frozen=True)
class Text:
    """A word at a point, or with ``corner`` in the upper right corner of the panel."""

    text: str
    x: float = 0.0
    y: float = 0.0
    corner: bool = False
    colour: str = INK


Mark = Line | Points | Band | Bars | Interval | Rule | Span | Steps | Cells | Text


def extent(mark: Mark) -> tuple[Array, Array]:
    """Return all that a mark reaches along x and along y."""
    nothing = np.empty(0)
    match mark:
        case Line() | Points():
            array_likes: tuple[ArrayLike, ...] = (mark.x, mark.y)
        case Band():
            array_likes = (
                mark.x,
                np.concatenate([np.asarray(mark.low, dtype=float), np.asarray(mark.high, dtype=float)]),
            )
        case Bars():
            array_likes = (
                np.concatenate([np.asarray(mark.low, dtype=float), np.asarray(mark.high, dtype=float)]),
                mark.rows,
            )
        case Interval():
            array_likes = ([mark.low, mark.high], [mark.row])
        case Steps():
            array_likes = (mark.edges, np.append(np.asarray(mark.heights, dtype=float), 0.0))
        case Text(corner=False):
            array_likes = ([mark.x], [mark.y])
        case Rule(name=""):
            array_likes = (nothing, [mark.at]) if mark.level else ([mark.at], nothing)
        case _:
            array_likes = (nothing, nothing)
    x, y = (np.asarray(array_like, dtype=float) for array_like in array_likes)
    return x, y


def of_requirement(number: int) -> str:
    """Name a requirement by its number, from one, in `Panel.about`."""
    return f"requirement {number}"


@dataclass(frozen=True)
class Panel:
    """One diagram, with a key of its own where it has series that the figure's key lacks.

    Both axes of an ``even`` one have the same scale, which zooming keeps. ``about`` has the names of the outputs or the
    group of states that it shows, or its requirement, as `of_requirement` names it.
    """

    title: str
    x: Axis
    y: Axis
    marks: Sequence[Mark]
    key: Sequence[Series] = field(default=())
    even: bool = False
    about: Sequence[str] = field(default=())

    def reaches(self) -> tuple[Array, Array]:
        """Return all that the marks reach along x and along y."""
        extents = [extent(mark) for mark in self.marks]
        return np.concatenate([np.empty(0), *(x for x, _ in extents)]), np.concatenate(
            [np.empty(0), *(y for _, y in extents)]
        )
