"""One sample simulated again: a page, a table, lines for the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd
from rich.console import Group, RenderableType
from rich.text import Text

from mcnav._types import Array
from mcnav.contract.history import History
from mcnav.contract.quantities import Output, Source
from mcnav.report.figures.flight import flight
from mcnav.report.fitted_table import FittedTable, numbers, texts
from mcnav.report.format import number
from mcnav.report.html import filled
from mcnav.report.model import humanize, labels_of
from mcnav.units import conversion


@dataclass(frozen=True)
class Outcome:
    """Result of one simulation of the sample: its final errors, SI, NaN when it failed, and ``ok`` or why it failed."""

    label: str
    values: Array
    status: str


@dataclass(frozen=True)
class Replay:
    """One sample of a run, simulated again.

    Its ``errors``, their ``sigmas`` and the final errors by the ``linear`` model are in SI. A stored ``traceback`` is
    preferred; ``notes`` are remarks for the user, a line each.
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
    labels = labels_of(replay.sources, replay.outputs)
    rows = []
    for label, source, error, sigma in zip(labels, replay.sources, replay.errors, replay.sigmas, strict=True):
        if error != 0.0 or sigma > 0.0:
            value = number(float(error) * conversion(source.unit, source.shown_in), 6)
            rows.append((label, source.shown_in, value, number(float(error / sigma)) if sigma > 0.0 else "–"))
    return rows


def _outcome_rows(replay: Replay) -> list[tuple[str, str, list[str]]]:
    outcome_rows = [replay.linear, *(outcome.values for outcome in replay.outcomes)]
    rows = []
    for i, output in enumerate(replay.outputs):
        scale = conversion(output.unit, output.shown_in)
        rows.append(
            (humanize(output.name), output.shown_in, [number(float(each[i]) * scale, 8) for each in outcome_rows])
        )
    return rows


def table(replay: Replay) -> pd.DataFrame:
    """Tabulate the history, or without one the errors and outcomes, with units in the column names."""
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
    """Render the HTML page."""
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
    """Tabulate errors and outcomes for the terminal."""
    errors = FittedTable(
        f"{replay.campaign}: sample {replay.index:,}", [*texts("error"), *numbers("value", "in sigmas")]
    )
    for name, unit, value, sigmas in _error_rows(replay):
        errors.add(f"{name} [{unit}]", value, sigmas)
    headings = ("linear", *(outcome.label for outcome in replay.outcomes))
    outcomes = FittedTable("Outcome", [*texts("final error"), *numbers(*headings)])
    for name, unit, values in _outcome_rows(replay):
        outcomes.add(f"{name} [{unit}]", *values)
    status = [Text(f"{outcome.label}: {outcome.status}") for outcome in replay.outcomes]
    trace = [Text(f"\n{replay.traceback.rstrip()}")] if replay.traceback else []
    return Group(errors, Text(), outcomes, Text(), *status, *trace)


def files(replay: Replay) -> Mapping[str, bytes]:
    """Return the page and the table by file name."""
    name = f"replay_{replay.index}"
    return {f"{name}.html": page(replay).encode(), f"{name}.csv": table(replay).to_csv(index=False).encode()}
