"""A figure drawn by matplotlib, for papers and notebooks. Nothing else in the program imports matplotlib."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as MplFigure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from mcnav.report.drawing import marks as m
from mcnav.report.drawing.palette import GRID, INK, MUTED, PAPER, readable_on
from mcnav.report.drawing.paper import CENTIMETRES
from mcnav.report.drawing.ticks import labelled, linear_ticks, log_label, log_ticks, text_width

PX: Final = 1.0 / 96.0
"""A pixel of a page, in."""

POINT: Final = 0.75
"""A pixel of a page in points of 1/72 in."""

STYLE: Final[Any] = {
    "font.family": ["sans-serif"], "font.sans-serif": ["DejaVu Sans"], "text.parse_math": False, "text.color": INK,
    "axes.edgecolor": MUTED, "axes.labelcolor": INK, "axes.titlecolor": INK, "axes.titlelocation": "left",
    "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True, "axes.axisbelow": True,
    "grid.color": GRID, "grid.linewidth": 0.7, "xtick.color": MUTED, "ytick.color": MUTED, "xtick.labelcolor": INK,
    "ytick.labelcolor": INK, "legend.frameon": False, "svg.fonttype": "none", "pdf.fonttype": 42,
    "axes.unicode_minus": True,
}  # fmt: skip

LEGEND_HANDLE, LEGEND_GAP = 2.8, 2.0
"""Width of a handle with its distance from the text, and distance of columns: matplotlib's, in sizes of the text."""

TOUCHING: Final = 1.0
"""Pixels by which labels may touch."""

SHAPES: Final = {"dot": "o", "ring": "o", "square": "s", "box": "s", "triangle": "v", "onward": ">"}


def drawn(
    panels: Sequence[m.Panel], key: Sequence[m.Series], size: tuple[float, float], columns: int, width: float | None,
    font_scale: float, height: float | None = None,
) -> MplFigure:  # fmt: skip
    """Draw panels of a size, px, in columns, with a key; see `mcnav.report.drawing.figure.Figure.figure`."""
    columns = min(columns, len(panels))
    rows = -(-len(panels) // columns)
    across, down = size[0] * PX * columns, size[1] * PX * rows + 0.4
    shrunk = 1.0 if width is None else width / CENTIMETRES["in"] / across
    inches = across * shrunk, down * shrunk if height is None else height / CENTIMETRES["in"]
    with mpl.rc_context(STYLE | {"font.size": 9.0 * font_scale, "axes.titlesize": 10.0 * font_scale}):
        made = MplFigure(figsize=inches, layout="constrained")
        grid = made.subplots(rows, columns, squeeze=False)
        room = shrunk / font_scale, inches[1] / down / font_scale
        for panel, axes in zip(panels, grid.flat, strict=False):
            draw(panel, axes, font_scale, room)
        for axes in grid.flat[len(panels) :]:
            axes.remove()
        if key:
            side_by_side = _legend_columns(key, inches[0] / PX, 9.0 / POINT * font_scale)
            made.legend(handles=[_handle(entry) for entry in key], loc="outside upper left", ncols=side_by_side)
    return made


def _legend_columns(key: Sequence[m.Series], width: float, size: float) -> int:
    """Return how many columns of a legend, four at most, fit into a width, px, with text of a size, px."""
    for columns in range(min(4, len(key)), 1, -1):
        rows_of_key = -(-len(key) // columns)
        widest = [
            max(text_width(series.label, size) for series in key[k : k + rows_of_key])
            for k in range(0, len(key), rows_of_key)
        ]
        if sum(widest) + (LEGEND_HANDLE * len(widest) + LEGEND_GAP * (len(widest) - 1)) * size <= width:
            return columns
    return 1


def save(figure: MplFigure, path: Path) -> None:
    """Write a figure to a file without the date.

    Raises `ValueError` when panels and text have no room in it.
    """
    undated = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}.get(path.suffix.lower(), {})
    with mpl.rc_context(STYLE | {"svg.hashsalt": "mcnav"}), warnings.catch_warnings():
        warnings.filterwarnings("error", message="constrained_layout not applied")
        try:
            figure.savefig(path, metadata=undated, dpi=200)
        except UserWarning:
            raise ValueError("panels and text do not fit; choose a larger size, smaller text or fewer panels") from None


def crowded(figure: MplFigure) -> bool:
    """Return whether titles or labels of panels of a figure overlap, or do not fit into it."""
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message="constrained_layout not applied")
        try:
            figure.draw_without_rendering()
        except UserWarning:
            return True
    boxes = [
        text.get_window_extent()
        for axes in figure.axes
        for text in (axes.title, axes._left_title, axes.xaxis.label, axes.yaxis.label)  # type: ignore[attr-defined]
        if text.get_text()
    ]
    whole = figure.bbox.padded(TOUCHING)
    if any(not (whole.contains(box.x0, box.y0) and whole.contains(box.x1, box.y1)) for box in boxes):
        return True
    inner = [box.padded(-TOUCHING) for box in boxes]
    return any(one.overlaps(other) for k, one in enumerate(inner) for other in inner[:k])


def draw(panel: m.Panel, axes: Axes, font_scale: float = 1.0, room: tuple[float, float] = (1.0, 1.0)) -> None:
    """Draw a panel on axes; ``room`` is its width and height over the page's, in sizes of its text."""
    for order, mark in enumerate(panel.marks):
        _mark(axes, mark, 2.0 + 0.01 * order, font_scale)
    if panel.title:
        axes.set_title(panel.title)
    axes.set_xlabel(panel.x.title)
    axes.set_ylabel(panel.y.title)
    ticks = [max(2, min(most, round(most * size))) for most, size in zip((5, 6), room, strict=True)]
    for side, axis, reach, most in zip("xy", (panel.x, panel.y), panel.reaches(), ticks, strict=True):
        _scale(axes, side, axis, reach, most)
    if panel.even:
        axes.set_aspect("equal", adjustable="box")
    if panel.key:
        handles = [_handle(series) for series in panel.key]
        axes.legend(handles=handles, fontsize=8.0 * font_scale, frameon=True, framealpha=0.85, edgecolor="none")


def _scale(axes: Axes, side: str, axis: m.Axis, reach: Any, most: int) -> None:
    own, to, grid = (axes.xaxis, axes.set_xlim, "x") if side == "x" else (axes.yaxis, axes.set_ylim, "y")
    low, high = axis.limits(reach)
    if axis.names:
        turned: Any = {"rotation": 30, "ha": "right", "rotation_mode": "anchor"} if side == "x" else {}
        own.set_ticks(range(len(axis.names)), list(axis.names), **turned)
        to(*((low, high) if side == "x" else (high, low)))
        axes.grid(visible=False, axis=grid)  # type: ignore[arg-type]
        return
    if axis.log:
        (axes.set_xscale if side == "x" else axes.set_yscale)("log")
        ticks = log_ticks(low, high, most if most < 5 else 6)
        own.set_ticks(ticks, [log_label(tick) for tick in ticks])
        own.set_minor_formatter(lambda value, _: "")
    elif axis.bare:
        own.set_ticks([])
    else:
        ticks, step = linear_ticks(low, high, most)
        own.set_ticks(ticks, labelled(ticks, step))
    to(low, high)


def _handle(series: m.Series) -> Line2D | Patch:
    if series.kind == "area":
        return Patch(color=series.colour, label=series.label)
    return Line2D([], [], label=series.label, **_looks(series, series.kind))


def _looks(series: m.Series, kind: str, size: float = 6.0) -> dict[str, Any]:
    if kind in SHAPES:
        hollow = {"fillstyle": "none"} if kind in ("ring", "box") else {"markeredgewidth": 0.0}
        marker = {"marker": SHAPES[kind], "markersize": size * POINT}
        return {"color": series.colour, "linestyle": "none", **marker, **hollow}
    dashes = m.DASHES.get(kind, ())
    return {"color": series.colour, "linestyle": (0, tuple(dash * 0.5 for dash in dashes)) if dashes else "-"}


def _mark(axes: Axes, mark: m.Mark, order: float, font_scale: float) -> None:
    small = 8.0 * font_scale
    match mark:
        case m.Line():
            looks = _looks(mark.series, mark.kind or mark.series.kind)
            axes.plot(mark.x, mark.y, linewidth=mark.width * POINT, zorder=order, **looks)
        case m.Points():
            x, y = np.broadcast_arrays(np.atleast_1d(mark.x), np.atleast_1d(mark.y))
            looks = _looks(mark.series, mark.series.kind, mark.size)
            axes.plot(x, y, alpha=mark.opacity, zorder=order, **looks)
            for a, b, name in zip(x, y, mark.names, strict=False):
                axes.annotate(
                    name, (float(a), float(b)), (3, 2), textcoords="offset points", fontsize=small, zorder=order
                )
        case m.Band():
            axes.fill_between(mark.x, mark.low, mark.high, color=mark.series.colour, alpha=mark.opacity, linewidth=0.0,
                              zorder=order)  # fmt: skip
        case m.Bars():
            low, rows = np.asarray(mark.low, dtype=float), np.asarray(mark.rows, dtype=float)
            width = np.asarray(mark.high, dtype=float) - low
            axes.barh(rows, width, left=low, color=mark.series.colour, height=mark.thickness, edgecolor=PAPER,
                      linewidth=0.6, zorder=order)  # fmt: skip
            for row, begin, extent, name in zip(rows, low, width, mark.names, strict=False):
                axes.text(begin + 0.5 * extent, row, name, ha="center", va="center", fontsize=small, zorder=order,
                          color=readable_on(mark.series.colour))  # fmt: skip
        case m.Interval():
            axes.plot([mark.low, mark.high], [mark.row] * 2, color=mark.series.colour, linewidth=mark.width * POINT,
                      zorder=order)  # fmt: skip
        case m.Rule():
            across = axes.axhline if mark.level else axes.axvline
            looks = _looks(m.Series("", "", mark.series.colour if mark.series else mark.colour), mark.kind)
            across(mark.at, linewidth=mark.width * POINT, zorder=order, **looks)
            if mark.name:
                axes.annotate(mark.name, (mark.at, 0.0), (3, 3), xycoords=("data", "axes fraction"),
                              textcoords="offset points", fontsize=small, annotation_clip=True)  # fmt: skip
        case m.Span():
            (axes.axhspan if mark.level else axes.axvspan)(
                mark.low, mark.high, color=mark.series.colour, alpha=mark.opacity, zorder=order, lw=0.0
            )
        case m.Steps():
            axes.stairs(mark.heights, mark.edges, fill=True, color=mark.series.colour, zorder=order)
        case m.Cells():
            for (row, column), share in np.ndenumerate(mark.shares):
                if not np.isfinite(share):
                    continue
                colour = (mark.positive if share >= 0.0 else mark.negative).colour
                alpha, corner = mark.deepest * min(abs(float(share)), 1.0), (column - 0.5, row - 0.5)
                axes.add_artist(Rectangle(corner, 1.0, 1.0, facecolor=colour, zorder=order, alpha=alpha))
                axes.text(column, row, mark.texts[row][column], ha="center", va="center", zorder=order + 0.001,
                          fontsize=font_scale * min(8.0, 40.0 / len(mark.texts)))  # fmt: skip
        case m.Text():
            where: Any = {"xycoords": "axes fraction", "ha": "right", "va": "top"} if mark.corner else {}
            place = (0.99, 0.97) if mark.corner else (mark.x, mark.y)
            axes.annotate(mark.text, place, (0, 0) if mark.corner else (3, 2), textcoords="offset points",
                          fontsize=small, color=mark.colour, zorder=order, **where)  # fmt: skip
