"""How every figure looks, and how it becomes an SVG that can share a page with others."""

from __future__ import annotations

import io
import re
from typing import Any, Final

import matplotlib as mpl
from matplotlib.figure import Figure
from numpy.typing import NDArray

INK, MUTED, GRID = "#1d2733", "#5d6b7a", "#dfe5ec"
LINEAR, FLOWN = "#0b5fa5", "#d55e00"
SOURCE_COLOURS: Final = (
    "#0072b2", "#56b4e9", "#009e73", "#8fd0b8", "#d55e00", "#e69f00", "#7b3294", "#c2a5cf", "#6b6b6b", "#b8b8b8",
)  # fmt: skip
"""Okabe and Ito's palette, extended in pairs: told apart in colour blindness and, mostly, in grey."""

STYLE: Final[Any] = {
    "font.family": ["sans-serif"],
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9.0,
    "text.parse_math": False,
    "text.color": INK,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.titlesize": 10.0,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "legend.frameon": False,
    "svg.fonttype": "none",
    "axes.unicode_minus": True,
}


def svg(figure: Figure, key: str, title: str, description: str) -> str:
    """A figure as SVG for one place of a page: no date, no prologue, ids of its own, a title and a description."""
    buffer = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": key}):
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None, "Creator": None}, dpi=160)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>\s*", "", text, flags=re.DOTALL)
    text = re.sub(r'\bid="', f'id="{key}-', text)
    text = re.sub(r"url\(#", f"url(#{key}-", text)
    text = re.sub(r'xlink:href="#', f'xlink:href="#{key}-', text)
    labels = f'role="img" aria-labelledby="{key}-t {key}-d" '
    inside = f'<title id="{key}-t">{title}</title><desc id="{key}-d">{description}</desc>'
    text = re.sub(r'<svg ([^>]*?)width="[^"]*"([^>]*?)height="[^"]*"', r"<svg \1\2", text, count=1)
    return re.sub(r"<svg ([^>]*)>", rf"<svg {labels}\1>{inside}", text, count=1)


def new(width: float, height: float, rows: int = 1, columns: int = 1, **keywords: Any) -> tuple[Figure, NDArray[Any]]:
    """A figure of a size in inches with an array of axes, shape (rows, columns)."""
    figure = Figure(figsize=(width, height), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **keywords)
    return figure, axes
