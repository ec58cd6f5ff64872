"""A figure as the report and a notebook know it: plots side by side, a key to them, and the numbers behind them."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import matplotlib as mpl
import numpy as np
import pandas as pd
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure as MplFigure
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.ticker import ScalarFormatter
from numpy.typing import ArrayLike, NDArray

from mcnav.report.format import SUPERSCRIPTS
from mcnav.report.svg import INK, MUTED, PAPER, SOURCE_COLOURS, STYLE, new, svg, variable

HALF, THIRD = (4.4, 2.7), (3.1, 2.9)
"""Sizes of a plot, in: two or three side by side on a wide page, and text of one size in both."""

ROWS: Final = 200
"""Rows of the table behind a figure, at most: what is plotted more densely is thinned there."""


LOOKS: Final[Mapping[str, Mapping[str, Any]]] = {
    "line": {"linestyle": "-"},
    "dashed": {"linestyle": (0, (4.0, 1.6))},
    "dashdot": {"linestyle": (0, (6.0, 1.6, 1.2, 1.6))},
    "dotted": {"linestyle": (0, (1.2, 1.4))},
    "long": {"linestyle": (0, (9.0, 2.4))},
    "dot": {"linestyle": "none", "marker": "o", "markersize": 4.5},
    "ring": {"linestyle": "none", "marker": "o", "markersize": 5.5, "fillstyle": "none"},
    "square": {"linestyle": "none", "marker": "s", "markersize": 5.5},
    "box": {"linestyle": "none", "marker": "s", "markersize": 7.5, "fillstyle": "none"},
    "triangle": {"linestyle": "none", "marker": "v", "markersize": 7.0},
    "onward": {"linestyle": "none", "marker": ">", "markersize": 6.0},
    "area": {"linestyle": "none", "marker": "s", "markersize": 7.0},
}
"""How a series of each kind is plotted; of an area only its entry in a legend. The style sheet has the same kinds."""

LINES: Final = ("line", "dashed", "dashdot", "dotted", "long")
"""Kinds that tell many curves apart where colours cannot; two sources that share one differ in brightness."""


@dataclass(frozen=True)
class Series:
    """An entry of a figure's key.

    Attributes
    ----------
    name : str
        The gid of its artists is ``series-NAME``.
    label : str
    colour : str
    kind : str
        One of `LOOKS`.
    """

    name: str
    label: str
    colour: str
    kind: str = "line"

    @property
    def gid(self) -> str:
        """The gid of this series' artists."""
        return f"series-{self.name}"

    @property
    def variable(self) -> str:
        """The colour as the style sheet names it."""
        return variable(self.colour)

    def on(self, axes: Axes, x: ArrayLike, y: ArrayLike, **looks: Any) -> None:
        """Plot points or a curve of this series as it looks, but for what ``looks`` says."""
        axes.plot(x, y, color=self.colour, gid=self.gid, **{"linewidth": 1.4, **LOOKS[self.kind], **looks})

    def band(self, axes: Axes, x: ArrayLike, low: ArrayLike, high: ArrayLike, opacity: float = 1.0) -> None:
        """Fill between two curves in this series' colour."""
        axes.fill_between(x, low, high, color=self.colour, alpha=opacity, linewidth=0.0, zorder=0, gid=self.gid)


def numbered(number: int, label: str, kind: str = "") -> Series:
    """One of many series, by its number: a source has one colour, and one style of curve, in all figures.

    >>> numbered(1, "range"), numbered(11, "bias x", "area").colour
    (Series(name='source-1', label='range', colour='#56b4e9', kind='dashed'), '#56b4e9')
    """
    colour = SOURCE_COLOURS[number % len(SOURCE_COLOURS)]
    return Series(f"source-{number}", label, colour, kind or LINES[number % len(LINES)])


@dataclass(frozen=True)
class Plot:
    """One diagram: its title, and what draws it on axes."""

    title: str
    draw: Callable[[Axes], None]


@dataclass(frozen=True)
class Figure:
    """A figure.

    Attributes
    ----------
    key : str
        Names the figure on its page.
    title, description : str
        For those who do not see it.
    plots : sequence of Plot
    series : sequence of Series
        Its key; empty where the plots speak for themselves.
    data : DataFrame
        The numbers behind it.
    size : tuple of float
        `HALF` or `THIRD`, or another of the same width.
    caption : str
    file : str
        Of the same data in full beside the page; empty when there is none.
    """

    key: str
    title: str
    description: str
    plots: Sequence[Plot]
    series: Sequence[Series]
    data: pd.DataFrame
    size: tuple[float, float] = HALF
    caption: str = ""
    file: str = ""

    @property
    def layout(self) -> str:
        """How many plots stand side by side: the style sheet's class."""
        return "thirds" if self.size[0] == THIRD[0] else "halves"

    @cached_property
    def svgs(self) -> list[Markup]:
        """Every plot as SVG."""
        return [self.svg(number) for number in range(len(self.plots))]

    def svg(self, number: int) -> Markup:
        """One plot as SVG."""
        plot = self.plots[number]
        with mpl.rc_context(STYLE):
            figure = MplFigure(figsize=self.size)
            axes = figure.add_axes((0.16, 0.18, 0.8, 0.72))
            figure.patch.set_visible(False)
            axes.patch.set_visible(False)
            _draw(plot, axes)
            fit(axes)
            title = f"{self.title}: {plot.title}" if plot.title else self.title
            return Markup(svg(figure, f"{self.key}-{number}", title, self.description))

    @property
    def table(self) -> tuple[list[str], list[list[str]]]:
        """Headings and rows of the table behind it, plain enough for any program to read."""
        shown = self.data.iloc[:: -(-len(self.data) // ROWS) or 1]
        rows = [[_plain(value) for value in row] for row in shown.itertuples(index=False, name=None)]
        return [str(name) for name in self.data.columns], rows

    @property
    def thinned(self) -> bool:
        """Whether that table leaves rows out."""
        return len(self.data) > ROWS

    def figure(self) -> MplFigure:
        """All plots as one matplotlib figure, with a legend; its ``axes`` are the plots in order."""
        columns = 3 if self.layout == "thirds" else 2
        rows = -(-len(self.plots) // columns)
        columns = min(columns, len(self.plots))
        with mpl.rc_context(STYLE):
            figure, axes = new(self.size[0] * columns, self.size[1] * rows + 0.4, rows, columns)
            for plot, each in zip(self.plots, axes.flat, strict=False):
                _draw(plot, each)
            for each in axes.flat[len(self.plots) :]:
                each.remove()
            handles = [_handle(series) for series in self.series]
            if handles:
                figure.legend(handles=handles, loc="outside upper left", ncols=4)
        return figure

    def _repr_svg_(self) -> str:
        """Shown by Jupyter."""
        import io

        buffer = io.StringIO()
        with mpl.rc_context(STYLE):
            self.figure().savefig(buffer, format="svg", metadata={"Date": None})
        return buffer.getvalue()


def fit(axes: Axes) -> None:
    """Give the only axes of a figure all the room that their labels leave.

    In one pass, and another where the axes' new size has brought other labels.
    """
    before = _ticks(axes)
    _fit_once(axes)
    if _ticks(axes) != before:
        _fit_once(axes)


def _ticks(axes: Axes) -> list[list[float]]:
    return [list(axis.get_majorticklocs()) for axis in (axes.xaxis, axes.yaxis)]


def _fit_once(axes: Axes) -> None:
    width, height = axes.figure.bbox.size
    whole, own = axes.get_tightbbox(), axes.get_window_extent()
    if whole is None:
        return
    pad = 0.06 * axes.figure.dpi
    left, bottom = own.x0 - whole.x0 + pad, own.y0 - whole.y0 + pad
    right, top = max(whole.x1 - own.x1, 0.0) + pad, max(whole.y1 - own.y1, 0.0) + pad
    if left + right < 0.8 * width and bottom + top < 0.8 * height:
        axes.set_position((left / width, bottom / height, 1 - (left + right) / width, 1 - (bottom + top) / height))


def dots(axes: Axes, points: NDArray[np.float64], colour: str, size: float, gid: str, opacity: float = 1.0) -> None:
    """Points, shape (n, 2), as one path of round dots: a tenth of the bytes of as many markers."""
    codes = np.tile([Path.MOVETO, Path.LINETO], len(points)).astype(Path.code_type)
    path = Path(np.repeat(points, 2, axis=0), codes)
    path.should_simplify = False
    patch = PathPatch(path, fill=False, edgecolor=colour, alpha=opacity, linewidth=size, capstyle="round", gid=gid)
    axes.add_artist(patch)
    axes.update_datalim(points)
    axes.autoscale_view()


def mark(axes: Axes, place: float, label: str) -> None:
    """Draw a vertical line at an event, with its name in the corner where it hides least of the curves.

    To be called when everything else is drawn.
    """
    low, high = sorted(axes.get_xlim())
    if not low <= place <= high:
        return
    to_fractions = axes.transData + axes.transAxes.inverted()
    curves = [line.get_xydata() for line in axes.lines if line.get_transform() == axes.transData]
    points = to_fractions.transform(np.concatenate([np.empty((0, 2)), *curves]))
    across = float(to_fractions.transform((place, axes.get_ylim()[0]))[0])
    width = 0.02 * len(label) + 0.02

    def hidden(corner: tuple[int, int]) -> int:
        x, y = (points[:, 0] - across) * corner[0], points[:, 1] if corner[1] == 0 else 1.0 - points[:, 1]
        outside = across + corner[0] * width
        return int(((x > 0.0) & (x < width) & (y < 0.13)).sum()) + (10**9 if not 0.0 <= outside <= 1.0 else 0)

    side, top = min(((1, 0), (1, 1), (-1, 0), (-1, 1)), key=hidden)
    axes.axvline(place, color=MUTED, linewidth=1.0, linestyle=":")
    axes.annotate(
        label, (place, float(top)), xytext=(3 * side, 3 - 6 * top), xycoords=("data", "axes fraction"),
        textcoords="offset points", ha="left" if side > 0 else "right", va="top" if top else "bottom", color=INK,
        fontsize=8, bbox={"facecolor": PAPER, "edgecolor": "none", "pad": 0.8, "alpha": 0.8},
    )  # fmt: skip


def plainly(axis: Axis) -> None:
    """Label a logarithmic axis with numbers, and powers of ten where they are very small or large.

    The default writes mathematics, which these pages' text is not parsed for.
    """

    def shown(value: float, _: object = None) -> str:
        if 1e-3 <= value < 1e7:
            return f"{value:,.10g}"
        return f"10{f'{np.log10(value):.0f}'.translate(SUPERSCRIPTS)}" if value > 0.0 else ""

    axis.set_major_formatter(shown)
    axis.set_minor_formatter(lambda value, _: "")


class _Grouped(ScalarFormatter):
    """Numbers as matplotlib has them, but with commas between thousands, as everywhere else on a page."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        whole, point, rest = super().__call__(x, pos).partition(".")
        return re.sub(r"(?<=\d)(?=(\d{3})+$)", ",", whole) + point + rest


def _draw(plot: Plot, axes: Axes) -> None:
    plot.draw(axes)
    if plot.title:
        axes.set_title(plot.title)
    for axis in (axes.xaxis, axes.yaxis):
        if type(axis.get_major_formatter()) is ScalarFormatter:
            axis.set_major_formatter(_Grouped())


def _handle(series: Series) -> Line2D:
    return Line2D([], [], color=series.colour, label=series.label, **LOOKS[series.kind])


def _plain(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.6g}" if math.isfinite(value) else ""
    return str(value)


def axis_label(column: str) -> str:
    """Turn a column's name into an axis label.

    >>> axis_label("altitude [km]")
    'altitude (km)'
    """
    name, _, unit = column.replace("^2", "²").partition(" [")
    return f"{name} ({unit.removesuffix(']')})" if unit else name
