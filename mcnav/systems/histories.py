"""Histories: what makes one that can be drawn, and the errors of one flight added to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.history import History, Panel
from mcnav.contract.quantities import Output
from mcnav.errors import CampaignError, Problem
from mcnav.physics.units import conversion

BEFORE_END: Final = 1.0
"""Time before the end of an outage, or of a span, at which errors are read out, s; less in a short one."""


def first_and_last(begin: float, end: float) -> tuple[float, float]:
    """Return the begin of a span of time, and an instant just before its end, s."""
    return begin, end - min(BEFORE_END, 0.01 * (end - begin))


def check_history(history: History) -> History:
    """Check that a history's columns are numbers of one length, and that its panels show existing columns.

    Raises `TypeError`, `ValueError` when it is none; the message says why.
    """
    columns = {str(name): np.asarray(column, dtype=float) for name, column in history.columns.items()}
    lengths = {column.shape for column in columns.values()}
    if len(lengths) > 1 or any(len(shape) != 1 for shape in lengths):
        raise ValueError("the columns of a history must all be of one length")
    needed = {name for panel in history.panels for name in (panel.x, *panel.y)}
    if not needed <= columns.keys():
        raise ValueError(f"its panels show {sorted(needed - columns.keys())}, which are no columns")
    if any(not panel.y or (panel.legend and len(panel.legend) != len(panel.y)) for panel in history.panels):
        raise ValueError("a panel needs at least one column, and a legend as long as its columns")
    events = {str(name): float(value) for name, value in history.events.items()}
    if any(mark not in events for panel in history.panels for mark in panel.marks):
        raise ValueError("a panel marks an event that the history does not have")
    outages = {
        str(name): tuple((float(begin), float(end)) for begin, end in outage)
        for name, outage in history.outages.items()
    }
    if any(not begin <= end for outage in outages.values() for begin, end in outage):
        raise ValueError("an outage must not end before it begins")
    return History(columns, events, history.panels, outages, str(history.title))


def drawable_history(history: History, file: str) -> History:
    """Check the history of the truth before samples are simulated: the run's report reads and draws it afterwards.

    Raises `CampaignError` of the campaign's file.
    """
    try:
        return check_history(history)
    except (TypeError, ValueError) as wrong:
        raise CampaignError([Problem(file, "scenario", f"has no history that can be drawn: {wrong}")]) from None


def with_errors(history: History, errors: Array, outputs: Sequence[Output]) -> History:
    """Add the navigation errors of a flight, shape (m, outputs), SI, to a history as columns and diagrams."""
    time = next(iter(history.columns))
    columns, panels = dict(history.columns), list(history.panels)
    for column, output in zip(errors.T, outputs, strict=True):
        spoken = output.name.replace("_", " ")
        name = f"{spoken} error [{output.shown_in}]"
        columns[name] = column * conversion(output.unit, output.shown_in)
        panels.append(Panel(f"Error of {spoken}", time, (name,)))
    return replace(history, columns=columns, panels=tuple(panels))
