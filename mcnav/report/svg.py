"""How every figure looks, and how it becomes an SVG that can share a page with others.

Colours are drawn as the hexadecimal values below, which matplotlib knows, and written as the style sheet's variables,
so that figures follow the page into dark mode and onto paper.
"""

from __future__ import annotations

import io
import re
from typing import Any, Final

import matplotlib as mpl
from markupsafe import escape
from matplotlib.figure import Figure as MplFigure
from numpy.typing import NDArray

INK, MUTED, GRID, PAPER = "#1d2733", "#5d6b7a", "#dfe5ec", "#ffffff"
LINEAR, FLOWN = "#0b5fa5", "#c24e00"
BAND, AREA, POINT = "#e4eef7", "#f3c9a8", "#8794a3"
SOURCE_COLOURS: Final = (
    "#0072b2", "#56b4e9", "#009e73", "#8fd0b8", "#d55e00", "#e69f00", "#7b3294", "#c2a5cf", "#6b6b6b", "#b8b8b8",
)  # fmt: skip
"""Okabe and Ito's palette, extended in pairs: told apart in colour blindness and, mostly, in grey."""

VARIABLES: Final = {
    INK: "ink", MUTED: "muted", GRID: "line", PAPER: "paper", LINEAR: "linear", FLOWN: "flown", BAND: "band",
    AREA: "area", POINT: "point", **{colour: f"source-{number}" for number, colour in enumerate(SOURCE_COLOURS)},
}  # fmt: skip
"""The style sheet's name of each colour."""

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

HASHED: Final = r'(?<=["#])[a-z]+[0-9a-f]{10}(?=[")])'
"""The ids of markers and clipping paths in matplotlib's SVG, where they are defined and where they are used."""


def variable(colour: str) -> str:
    """Return a colour as a variable of the style sheet; other colours stay as they are.

    >>> variable("#0b5fa5"), variable("#123456")
    ('var(--linear)', '#123456')
    """
    return f"var(--{VARIABLES[colour]})" if colour in VARIABLES else colour


def svg(figure: MplFigure, key: str, title: str, description: str) -> str:
    """Render a figure as SVG for one place of a page: no date, no prologue, ids of its own, a title and a description.

    The group of an artist whose gid is ``series-NAME`` gets that as its class; with a gid ``tip-TEXT`` it gets the text
    as its title, which browsers show when a pointer rests on it.
    """
    buffer = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": key}):
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None, "Creator": None}, dpi=160)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>\s*", "", text, flags=re.DOTALL)
    text = _counted(text)
    text = re.sub(r' id="series-([\w-]+)"', r' class="series-\1"', text)
    text = re.sub(r' id="tip-([^"]*)">', r"><title>\1</title>", text)
    text = re.sub(r'\bid="', f'id="{key}-', text)
    text = re.sub(r"url\(#", f"url(#{key}-", text)
    text = re.sub(r'xlink:href="#', f'xlink:href="#{key}-', text)
    text = re.sub(r'(?: d| x| y|transform)="[^"]*"', lambda found: _rounded(found[0]), text)
    text = re.sub(r"#[0-9a-f]{6}(?=[;\"])", lambda found: variable(found[0]), text)
    text = text.replace("'DejaVu Sans'", "var(--sans)").replace(", sans-serif", "")
    text = re.sub(r"<defs>\s*<style.*?</style>\s*</defs>", "", text, flags=re.DOTALL)
    text = re.sub(r"M ([\d.]+ [\d.]+) L \1(?= M| ?\")", r"M\1h0", text)
    text = re.sub(r"\n\s+", "\n", text)
    labels = f'role="img" aria-labelledby="{key}-t {key}-d" '
    inside = f'<title id="{key}-t">{escape(title)}</title><desc id="{key}-d">{escape(description)}</desc>'
    text = re.sub(r'<svg ([^>]*?)width="[^"]*"([^>]*?)height="[^"]*"', r"<svg \1\2", text, count=1)
    return re.sub(r"<svg ([^>]*)>", lambda found: f"<svg {labels}{found[1]}>{inside}", text, count=1)


def _counted(text: str) -> str:
    """Ids that matplotlib makes from the last digits of coordinates, numbered as they come."""
    numbers = {name: f"n{k}" for k, name in enumerate(dict.fromkeys(re.findall(HASHED, text)))}
    return re.sub(HASHED, lambda found: numbers[found[0]], text)


def _rounded(attribute: str) -> str:
    """Coordinates to a hundredth of a point, which no eye and no printer tells apart."""
    return re.sub(r"(\.\d\d)\d+", r"\1", attribute).replace("\n", "")


def new(
    width: float, height: float, rows: int = 1, columns: int = 1, **keywords: Any
) -> tuple[MplFigure, NDArray[Any]]:
    """Create a figure of a size in inches with an array of axes, shape (rows, columns)."""
    figure = MplFigure(figsize=(width, height), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **keywords)
    return figure, axes
