"""A figure as the report and a notebook know it: plots side by side, a key to them, and the numbers behind them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import matplotlib as mpl
import numpy as np
import pandas as pd
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from numpy.typing import NDArray

from mcnav.report.svg import STYLE, new, svg, variable

HALF, THIRD, WHOLE = (4.4, 2.7), (3.1, 2.9), (9.0, 2.9)
"""Sizes of a plot, in: two, three or one side by side on a wide page, and text of one size in all."""

ROWS: Final = 200
"""Rows of the table behind a figure, at most: what is plotted more densely is thinned there."""


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
        ``line``, ``dashed``, ``dot`` or ``area``.
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


@dataclass(frozen=True)
class Plot:
    """One diagram: its title, and what draws it on axes."""

    title: str
    draw: Callable[[Axes], None]


@dataclass(frozen=True)
class Drawing:
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
        `HALF`, `THIRD` or `WHOLE`, or another of the same width.
    caption : str
    """

    key: str
    title: str
    description: str
    plots: Sequence[Plot]
    series: Sequence[Series]
    data: pd.DataFrame
    size: tuple[float, float] = HALF
    caption: str = ""

    @property
    def layout(self) -> str:
        """How many plots stand side by side: the style sheet's class."""
        return {HALF[0]: "halves", THIRD[0]: "thirds"}.get(self.size[0], "whole")

    @property
    def svgs(self) -> list[Markup]:
        """Every plot as SVG."""
        drawn = []
        for number, plot in enumerate(self.plots):
            with mpl.rc_context(STYLE):
                figure = Figure(figsize=self.size)
                axes = figure.add_axes((0.16, 0.18, 0.8, 0.72))
                figure.patch.set_visible(False)
                axes.patch.set_visible(False)
                _draw(plot, axes)
                fit(axes)
                title = f"{self.title}: {plot.title}" if plot.title else self.title
                drawn.append(Markup(svg(figure, f"{self.key}-{number}", title, self.description)))
        return drawn

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

    def figure(self) -> Figure:
        """All plots as one matplotlib figure, with a legend; its ``axes`` are the plots in order."""
        columns = {"halves": 2, "thirds": 3}.get(self.layout, 1)
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
    """Give the only axes of a figure all the room that their labels leave, in one pass."""
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


def _draw(plot: Plot, axes: Axes) -> None:
    plot.draw(axes)
    if plot.title:
        axes.set_title(plot.title)


def _handle(series: Series) -> Line2D:
    if series.kind in ("dot", "area"):
        return Line2D([], [], color=series.colour, marker="o", linestyle="", label=series.label)
    return Line2D([], [], color=series.colour, linestyle="--" if series.kind == "dashed" else "-", label=series.label)


def _plain(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.6g}" if math.isfinite(value) else ""
    return str(value)


def axis_label(column: str) -> str:
    """A column's name as an axis has it.

    >>> axis_label("altitude [km]")
    'altitude (km)'
    """
    name, _, unit = column.partition(" [")
    return f"{name} ({unit.removesuffix(']')})" if unit else name
