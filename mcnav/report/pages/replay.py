"""One sample simulated again: a page, a table, lines for the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from mcnav.arrays.types import Array
from mcnav.contract.history import History
from mcnav.contract.quantities import FINAL_ERRORS, Output, Source, end_words
from mcnav.physics.units import conversion
from mcnav.report.document.html import page_html
from mcnav.report.document.parts import Facts, Lines, Note, Page, Part, Section, joined
from mcnav.report.document.table import Cell, Column, Table
from mcnav.report.figures.flight import flight
from mcnav.report.format import number
from mcnav.report.names import humanize, labels_of


@dataclass(frozen=True)
class Outcome:
    """One simulation of the sample: its outputs at the end, SI, NaN when it failed, and ``ok`` or why it failed."""

    label: str
    values: Array
    status: str


@dataclass(frozen=True)
class Replay:
    """One sample of a run, simulated again; or, with the number of a requirement, the most likely way to fail it.

    ``limited`` says what a requirement limits and what the flight reaches. Its ``errors``, their ``sigmas`` and the
    final errors by the ``linear`` model are in SI. A stored ``traceback`` is preferred; ``notes`` are remarks for the
    user, a line each.
    """

    campaign: str
    index: int | None
    sources: Sequence[Source]
    outputs: Sequence[Output]
    errors: Array
    sigmas: Array
    linear: Array
    outcomes: tuple[Outcome, ...]
    traceback: str
    history: History
    notes: tuple[str, ...] = ()
    requirement: int = 0
    limited: str = ""

    @property
    def name(self) -> str:
        """Name of its files."""
        return f"replay_fail_{self.requirement}" if self.index is None else f"replay_{self.index}"

    @property
    def words(self) -> str:
        """Name of the flight."""
        if self.index is None:
            return f"most likely way to fail requirement {self.requirement}"
        return f"sample {self.index:,}"


@dataclass(frozen=True)
class _Error:
    """Error of a source in the unit shown, and in sigmas."""

    name: str
    unit: str
    value: float
    sigmas: float | None


def error_table(replay: Replay) -> Table[_Error]:
    """Tabulate the errors of the sample."""
    labels, rows = labels_of(replay.sources, replay.outputs), []
    for label, source, error, sigma in zip(labels, replay.sources, replay.errors, replay.sigmas, strict=True):
        if error != 0.0 or sigma > 0.0:
            value = float(error) * conversion(source.unit, source.shown_in)
            rows.append(_Error(label, source.shown_in, value, float(error / sigma) if sigma > 0.0 else None))
    columns: list[Column[_Error]] = [
        Column("Source", lambda row: Cell(row.name, row.unit), "error", "label"),
        Column("value", lambda row: row.value, form=lambda value: number(value, 6)),
        Column("in sigmas", lambda row: row.sigmas),
    ]
    return Table("Errors of this flight.", columns, rows, f"{replay.campaign}: {replay.words}")


def outcome_table(replay: Replay) -> Table[int]:
    """Tabulate the outputs at the end, a row each: of the linear model, stored, and simulated again."""

    def outcome(heading: str, values: Array) -> Column[int]:
        def content(i: int) -> str:
            output = replay.outputs[i]
            return number(float(values[i]) * conversion(output.unit, output.shown_in), 8)

        return Column(heading, content)

    words = end_words(replay.outputs)
    columns = [
        Column("Output", lambda i: Cell(humanize(replay.outputs[i].name), replay.outputs[i].shown_in), words.one,
               "label"),
        outcome("linear", replay.linear),
        *(outcome(quantity.label, quantity.values) for quantity in replay.outcomes),
    ]  # fmt: skip
    what = "Final navigation errors" if words == FINAL_ERRORS else words.title
    caption = f"{what}: linear model, stored result, and new simulations."
    return Table(caption, columns, range(len(replay.outputs)), "Outcome")


def table(replay: Replay) -> pd.DataFrame:
    """Tabulate the history, or without one the errors and outcomes, with units in the column names."""
    if replay.history.columns:
        return pd.DataFrame(dict(replay.history.columns))
    row: dict[str, object] = {"index": replay.words if replay.index is None else replay.index}
    row |= {f"error {s.name} [{s.unit}]": e for s, e in zip(replay.sources, replay.errors, strict=True)}
    rows = []
    for outcome in replay.outcomes:
        values = {f"output {o.name} [{o.unit}]": v for o, v in zip(replay.outputs, outcome.values, strict=True)}
        rows.append({"flown": outcome.label, "status": outcome.status} | row | values)
    return pd.DataFrame(rows)


def page(replay: Replay) -> Page:
    """Return the page."""
    heading, figure = f"{replay.campaign}: {replay.words}", flight(replay.history)
    traceback = Lines(replay.traceback, "Traceback") if replay.traceback else None
    sections = [Section("outcome", "Outcome", joined(_limit(replay), outcome_table(replay), traceback))]
    if figure is not None:
        until = Note("Simulated by the reference engine, up to the end or the failure.")
        sections.append(Section("flight", "Time history", [figure, until]))
    sections.append(Section("errors", "Errors", [error_table(replay)]))
    facts = Facts([(outcome.label, outcome.status) for outcome in replay.outcomes])
    kind = "Most likely way to fail" if replay.index is None else "One sample simulated again"
    return Page(heading, kind, heading, [facts], sections)


def _limit(replay: Replay) -> Note | None:
    """Say what the flight reaches of a limit; nothing of a sample."""
    return Note(replay.limited) if replay.limited else None


def terminal(replay: Replay) -> list[Part]:
    """List what the terminal shows: errors, outcomes, and why a simulation failed."""
    status = [Note(f"{outcome.label}: {outcome.status}") for outcome in replay.outcomes]
    trace = [Lines(replay.traceback, "Traceback")] if replay.traceback else []
    return [error_table(replay), *joined(_limit(replay)), outcome_table(replay), Note(""), *status, *trace]


def files(replay: Replay) -> Mapping[str, bytes]:
    """Return the page and the table by file name."""
    name = replay.name
    return {f"{name}.html": page_html(page(replay)).encode(), f"{name}.csv": table(replay).to_csv(index=False).encode()}
