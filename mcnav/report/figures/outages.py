"""Outages of aiding sensors, shaded in diagrams over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from mcnav.analysis.filter_remarks import period
from mcnav.report.drawing.marks import Series, Span
from mcnav.report.drawing.palette import OUTAGE
from mcnav.report.names import humanize

if TYPE_CHECKING:
    from mcnav.report.results.model import RunAnalysis

SHADED: Final = Series("outage", "outage", OUTAGE, "area")

OPACITY: Final = 0.5
"""Opacity of the shading, so that bounds are seen through it."""


def outages(content: RunAnalysis, sensors: Sequence[str] = ()) -> list[Span]:
    """Return the outages of some sensors by name, by default of all."""
    history = content.history
    label = next(iter(history.columns), "")
    return [
        Span(SHADED, begin, end, text=f"outage of {humanize(name)}: {period(begin, end, label)}",
             opacity=OPACITY)
        for name, spans in history.outages.items()
        if not sensors or name in sensors
        for begin, end in spans
    ]  # fmt: skip


def shading_key(spans: Sequence[Span]) -> list[Series]:
    """Return the entry of a figure's key for outages; empty without any."""
    return [SHADED] if spans else []
