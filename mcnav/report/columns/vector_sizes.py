"""Sizes of vectors, such as velocity corrections, as a table and in sentences."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from mcnav.report.columns.result_table import ResultColumn, ResultTable, Units, in_units
from mcnav.report.document.table import Cell, Column
from mcnav.report.format import number
from mcnav.report.names import humanize

if TYPE_CHECKING:
    from mcnav.analysis.summary import SizeEntry, Summary

TITLE: Final = "Sizes of vectors"

DIGITS: Final = 5


@dataclass(frozen=True)
class SizeRow:
    """A size, the factor from SI to the unit of its numbers, and that unit."""

    entry: SizeEntry
    scale: float
    unit: str

    @property
    def title(self) -> Cell:
        """Name for people."""
        return Cell(humanize(self.entry.output), self.unit)

    def scaled(self, value: float | None) -> float | None:
        """Return a value in the unit of this row."""
        return None if value is None else value * self.scale

    def cell(self, value: float | None, ends: Sequence[float | None] | None = None) -> Cell:
        """Return a value, above its interval."""
        low, high = (None, None) if ends is None else map(self.scaled, ends)
        known = ends is not None
        unbounded = high is None or not math.isfinite(high)
        below = f"{number(low, DIGITS)} to {'–' if unbounded else number(high, DIGITS)}" if known else ""
        return Cell(number(self.scaled(value), DIGITS), below=below)


def _columns() -> tuple[ResultColumn[SizeRow], ...]:
    columns: list[ResultColumn[SizeRow]] = [
        ResultColumn("output", lambda row: row.entry.output,
                     (Column("Size", lambda row: row.title, "size", kind="label"),)),
        ResultColumn("unit", lambda row: row.unit),
    ]  # fmt: skip

    def add(name: str, value: Callable[[SizeEntry], float | None], heading: str) -> None:
        columns.append(
            ResultColumn(name, lambda row: row.scaled(value(row.entry)),
                         (Column(heading, lambda row: row.cell(value(row.entry))),))
        )  # fmt: skip

    def add_sampled(name: str, value: Callable[[SizeEntry], tuple[float | None, object]], heading: str) -> None:
        columns.append(
            ResultColumn(name, lambda row: row.scaled(value(row.entry)[0]),
                         (Column(heading, lambda row: row.cell(*value(row.entry))),),  # type: ignore[arg-type]
                         lambda row: _ends(row, value(row.entry)[1]))
        )  # fmt: skip

    add("nominal", lambda entry: entry.nominal, "Nominal")
    add("median", lambda entry: entry.median, "Median")
    add_sampled("median_sample", lambda entry: (entry.median_sample, entry.median_interval), "Monte Carlo")
    add("mean", lambda entry: entry.mean, "Mean")
    add_sampled("mean_sample", lambda entry: (entry.mean_sample, entry.mean_interval), "Monte Carlo")
    add("most", lambda entry: entry.most, "99.73 %")
    add_sampled("most_sample", lambda entry: (entry.most_sample, entry.most_interval), "Monte Carlo")
    add("three_sigma", lambda entry: entry.three_sigma, "Nominal + 3 σ")
    return tuple(columns)


def _ends(row: SizeRow, ends: object) -> tuple[float | None, float | None] | None:
    return None if not isinstance(ends, (list, tuple)) else (row.scaled(ends[0]), row.scaled(ends[1]))


COLUMNS: Final = _columns()


def sizes_table(summary: Summary, units: Units = "shown", confidence: str = "") -> ResultTable:
    """Tabulate sizes by their exact law, and by samples with intervals."""
    shown_in = {
        output.name: in_units(output.unit, shown, units)
        for output, shown in zip(summary.outputs, summary.units_shown, strict=True)
    }
    rows = [SizeRow(entry, *shown_in[entry.output]) for entry in summary.sizes]
    caption = (
        "Size of a vector whose components are normal with the linear mean and covariance, by its exact law: a "
        "generalized chi-square, which is not normal. 99.73 %: not exceeded with that probability. Monte Carlo: with "
        f"intervals of {confidence} each, distribution-free but for the mean. Nominal + 3 σ, with σ the root sum of "
        "squares of the components', is no such bound."
    )
    return ResultTable.of_entries("sizes", TITLE, 1, COLUMNS, rows, caption)


def size_sentence(
    name: str, law: Sequence[float | None], three_sigma: float, wrong: bool, scale: float, unit: str
) -> str:  # fmt: skip
    """Say what a size is by its exact law: median, mean and the quantile of 99.73 %.

    >>> size_sentence("burn_size", (1.486095, 1.486776, 1.603197), 1.801769, True, 1.0, "m")
    'Size of burn: median 1.4861, mean 1.4868, 99.73 % below 1.6032 m (exact law; nominal plus 3 σ, 1.8018, is wrong).'
    """
    median, mean, most = ("–" if value is None else number(value * scale, DIGITS) for value in law)
    rough = f"; nominal plus 3 σ, {number(three_sigma * scale, DIGITS)}, is wrong" if wrong else ""
    spoken = humanize(name.removesuffix("_size"))
    return f"Size of {spoken}: median {median}, mean {mean}, 99.73 % below {most} {unit} (exact law{rough})."


def size_sentences(summary: Summary) -> list[str]:
    """Say what each size of a run is."""
    table = sizes_table(summary)
    rows: Sequence[SizeRow] = table.read.rows
    return [
        size_sentence(row.entry.output, (row.entry.median, row.entry.mean, row.entry.most),
                      row.entry.three_sigma, row.entry.wrong, row.scale, row.unit)
        for row in rows
    ]  # fmt: skip
