"""One sample flown again: a page, a table, lines for the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd
from rich.console import Group, RenderableType
from rich.text import Text

from mcnav._types import Array
from mcnav.report.figures.flight import flight
from mcnav.report.fitted_table import Column, FittedTable
from mcnav.report.format import number
from mcnav.report.model import humanize
from mcnav.report.page import filled
from mcnav.scenarios.protocol import History, Output, Source, source_labels
from mcnav.units import conversion


@dataclass(frozen=True)
class Outcome:
    """What became of the sample, one time.

    Attributes
    ----------
    label : str
        When and how: ``stored``, ``again, ensemble``.
    values : ndarray, shape (outputs,)
        SI; NaN when it failed.
    status : str
        ``ok``, or why it failed.
    """

    label: str
    values: Array
    status: str


@dataclass(frozen=True)
class Replay:
    """One sample of a run, flown again.

    Attributes
    ----------
    campaign : str
    index : int
    sources, outputs
        Of the scenario.
    errors, sigmas : ndarray, shape (sources,)
        Of the sample, and one sigma of each, SI.
    linear : ndarray, shape (outputs,)
        Final errors by the linear model, SI.
    outcomes : tuple of Outcome
    traceback : str
        Of the failure, as stored, or else as raised again; empty when there is none.
    history : History
        Of the flight; empty when the scenario shows none.
    notes : tuple of str
        What the user should know of how it was flown again, a line each.
    """

    campaign: str
    index: int
    sources: Sequence[Source]
    outputs: Sequence[Output]
    errors: Array
    sigmas: Array
    linear: Array
    outcomes: tuple[Outcome, ...]
    traceback: str
    history: History
    notes: tuple[str, ...] = ()


def _error_rows(replay: Replay) -> list[tuple[str, str, str, str]]:
    labels = source_labels([source.name for source in replay.sources], [output.name for output in replay.outputs])
    rows = zip(labels, replay.sources, replay.errors, replay.sigmas, strict=True)
    return [
        (
            label,
            source.shown_in,
            number(float(error) * conversion(source.unit, source.shown_in), 6),
            number(float(error / sigma), 4) if sigma > 0.0 else "–",
        )
        for label, source, error, sigma in rows
        if error != 0.0 or sigma > 0.0
    ]


def _outcome_rows(replay: Replay) -> list[tuple[str, str, list[str]]]:
    found = [replay.linear, *(outcome.values for outcome in replay.outcomes)]
    return [
        (
            humanize(output.name),
            output.shown_in,
            [number(float(values[i]) * conversion(output.unit, output.shown_in), 8) for values in found],
        )
        for i, output in enumerate(replay.outputs)
    ]


def table(replay: Replay) -> pd.DataFrame:
    """The history, or where there is none the errors and outcomes, units in the column names."""
    if replay.history.columns:
        return pd.DataFrame(dict(replay.history.columns))
    row: dict[str, Any] = {"index": replay.index}
    row |= {f"error {s.name} [{s.unit}]": e for s, e in zip(replay.sources, replay.errors, strict=True)}
    rows = []
    for outcome in replay.outcomes:
        values = {f"output {o.name} [{o.unit}]": v for o, v in zip(replay.outputs, outcome.values, strict=True)}
        rows.append({"flown": outcome.label, "status": outcome.status} | row | values)
    return pd.DataFrame(rows)


def page(replay: Replay) -> str:
    """The page."""
    return filled(
        "replay.html",
        campaign=replay.campaign,
        index=f"{replay.index:,}",
        outcomes=replay.outcomes,
        errors=_error_rows(replay),
        rows=_outcome_rows(replay),
        traceback=replay.traceback,
        flight=flight(replay.history),
    )


def lines(replay: Replay) -> RenderableType:
    """Errors and outcomes for the terminal."""
    errors = _table(f"{replay.campaign}: sample {replay.index:,}", ["error", "value", "in sigmas"])
    for name, unit, value, sigmas in _error_rows(replay):
        errors.add(f"{name} [{unit}]", value, sigmas)
    outcomes = _table("Outcome", ["final error", "linear", *(outcome.label for outcome in replay.outcomes)])
    for name, unit, values in _outcome_rows(replay):
        outcomes.add(f"{name} [{unit}]", *values)
    told = [Text(f"{outcome.label}: {outcome.status}") for outcome in replay.outcomes]
    trace = [Text(f"\n{replay.traceback.rstrip()}")] if replay.traceback else []
    return Group(errors, Text(), outcomes, Text(), *told, *trace)


def _table(title: str, headings: Sequence[str]) -> FittedTable:
    return FittedTable(title, [Column(heading, text=not place) for place, heading in enumerate(headings)])


def files(replay: Replay) -> Mapping[str, bytes]:
    """The page and the table, by file name."""
    name = f"replay_{replay.index}"
    return {f"{name}.html": page(replay).encode(), f"{name}.csv": table(replay).to_csv(index=False).encode()}
