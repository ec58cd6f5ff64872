"""Colours of the figures, by the names that the style sheet has for them."""

from __future__ import annotations

from typing import Final

INK, MUTED, GRID, PAPER = "#1d2733", "#566372", "#dfe5ec", "#ffffff"
LINEAR, FLOWN, FILTER = "#0b5fa5", "#c24e00", "#0a7a55"
BAND, AREA, POINT, OTHER, OUTAGE = "#e4eef7", "#f3c9a8", "#8794a3", "#9aa5b1", "#d9d0e6"
SOURCE_COLOURS: Final = (
    "#0072b2", "#56b4e9", "#009e73", "#8fd0b8", "#d55e00", "#e69f00", "#7b3294", "#c2a5cf", "#6b6b6b", "#b8b8b8",
    "#f0e442", "#8c510a",
)  # fmt: skip
"""Okabe and Ito's palette, extended in pairs: distinguishable in colour blindness and, mostly, in grey."""

VARIABLES: Final = {
    INK: "ink", MUTED: "muted", GRID: "line", PAPER: "paper", LINEAR: "linear", FLOWN: "flown", FILTER: "filter",
    BAND: "band", AREA: "area", POINT: "point", OTHER: "other", OUTAGE: "outage",
    **{colour: f"source-{number}" for number, colour in enumerate(SOURCE_COLOURS)},
}  # fmt: skip
"""The style sheet's name of each colour."""


def variable(colour: str) -> str:
    """Return a colour as the style sheet names it; other colours stay as they are.

    >>> variable("#0b5fa5"), variable("#123456")
    ('var(--linear)', '#123456')
    """
    return f"var(--{VARIABLES[colour]})" if colour in VARIABLES else colour


def readable_on(colour: str) -> str:
    """Return nearly black or nearly white, whichever reads better on a colour (relative luminance, WCAG 2).

    Neither is a variable of the style sheet: the bars keep their brightness in dark mode, and so must their text.

    >>> readable_on("#8fd0b8"), readable_on("#7b3294")
    ('#101418', '#fdfdfd')
    """
    channels = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.03928 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return "#101418" if 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2] > 0.2 else "#fdfdfd"
