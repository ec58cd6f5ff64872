"""The table of outputs: sigmas, ratios, verdict and bias, a row for each output of each run."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

from mcnav.analysis.summary import Ends, Summary
from mcnav.arrays.types import Array
from mcnav.contract.quantities import AT_END, FINAL_ERRORS, KINDS, end_words, kinds_of
from mcnav.report.columns.result_table import ResultColumn, ResultTable, Row, Units, in_units, row_of
from mcnav.report.document.table import Cell, Column, Table, five_digits
from mcnav.report.format import interval, number, with_error
from mcnav.report.names import humanize
from mcnav.report.statements import details
from mcnav.report.statements.means import large_means_of
from mcnav.report.statements.words import more_samples

if TYPE_CHECKING:
    import pandas as pd

VERDICTS: Final = ("agrees", "undecided", "differs")


@dataclass(frozen=True)
class OutputEntry:
    """An output of a run, the factor from SI to the unit of its numbers, that unit, and the kind of the output.

    Where all are navigation errors, the kind is empty.
    """

    run: str
    summary: Summary
    place: int
    name: str
    scale: float
    unit: str
    kind: str = ""

    def at(self, values: Sequence[float | None] | Array | None, scale: float = 1.0) -> float | None:
        """Return the entry of this output in a list that is empty where nothing was compared."""
        value = None if values is None or self.place >= len(values) else values[self.place]
        return None if value is None else float(value) * scale

    def scaled(self, values: Sequence[float | None] | Array | None) -> float | None:
        """Return that entry in the unit of this output."""
        return self.at(values, self.scale)

    def compared(self, values: Sequence[float | None] | Array, scale: float = 1.0) -> float | None:
        """Return that entry; none where linear analysis has no meaning."""
        return None if self.summary.beyond_range else self.at(values, scale)

    def ends(self, intervals: Sequence[Ends | None]) -> Ends:
        """Return the interval of this output; none of what is unbounded."""
        known = None if self.summary.beyond_range or self.place >= len(intervals) else intervals[self.place]
        return (None, None) if known is None or None in known else known

    @property
    def verdict(self) -> str | None:
        """Verdict as shown; none where nothing was compared."""
        if self.summary.beyond_range:
            return details.BEYOND
        return details.verdict_words(self.summary)[self.place] if self.summary.verdicts else None

    @property
    def samples_needed(self) -> int | None:
        """Samples that would decide; none where they are not known."""
        needed = self.summary.samples_needed
        return needed[self.place] if self.place < len(needed) else None

    @property
    def nominal(self) -> float | None:
        """Value on the nominal flight; none of a navigation error."""
        return _known(self.scaled(self.summary.nominal))

    @property
    def mean_error(self) -> float | None:
        """Mean error, of a state of the truth off the nominal; none of a command or a time."""
        return _known(self.scaled(self.summary.mean_error or self.summary.mean_linear))

    @property
    def sigma_linear(self) -> float | None:
        """Linear sigma."""
        return self.compared(self.summary.sigma_linear, self.scale)

    @property
    def sigma_paired(self) -> float | None:
        """Paired estimate of the sigma."""
        return self.compared(self.summary.sigma_paired, self.scale)

    @property
    def ratio_paired(self) -> float | None:
        """Paired estimate of the sigma over the linear one."""
        return self.compared(self.summary.sigma_ratio_paired)

    @property
    def ratio_paired_ends(self) -> Ends:
        """Its interval."""
        return self.ends(self.summary.sigma_ratio_paired_interval)

    @property
    def sigma_higher_order(self) -> float | None:
        """Sigma of the fitted polynomial; none where it is not known."""
        return self.scaled(self.summary.higher_order.sigma if self.summary.higher_order else None)

    @property
    def sigma_unscented(self) -> float | None:
        """Sigma by the unscented transform; none where it is not known."""
        covariance = self.summary.unscented and self.summary.unscented.covariance
        variance = None if not covariance else covariance[self.place][self.place]
        return None if variance is None else math.sqrt(max(variance, 0.0)) * self.scale


def _known(value: float | None) -> float | None:
    return None if value is None or math.isnan(value) else value


Value = Callable[[OutputEntry], float | None]


def _sigma(name: str, kind: str, value: Value, spare: int = 0) -> ResultColumn[OutputEntry]:
    """Return a column of sigmas, to five digits."""
    page = Column(f"{kind.capitalize()} σ", value, form=five_digits, place="page", size="sigma")
    return ResultColumn(name, value, (page, Column("", value, f"{kind} σ", form=_five, place="terminal", spare=spare)))


def _value(name: str, heading: str, value: Value) -> ResultColumn[OutputEntry]:
    """Return a column of values in the unit of the output, to five digits."""
    page = Column(heading, value, form=five_digits, place="page", size="value")
    return ResultColumn(name, value, (page, Column("", value, heading.lower(), form=_five, place="terminal")))


def _ratio(
    name: str, kind: str, value: Value, ends: Callable[[OutputEntry], Ends], spare: int = 0
) -> ResultColumn[OutputEntry]:
    """Return a column of sigma ratios with their intervals, which a page has below them."""

    def both(entry: OutputEntry) -> Cell:
        return Cell(number(value(entry), 5), below=interval(*ends(entry)))

    shown: tuple[Column[OutputEntry], ...] = (
        Column(f"{kind.capitalize()} ratio", both, place="page"),
        Column("", value, f"{kind} ratio", form=_decimals, place="terminal", spare=spare and spare + 1),
        Column("", lambda row: interval(*ends(row)), f"{kind} interval", place="terminal",
               spare=spare and spare + 2),
    )  # fmt: skip
    return ResultColumn(name, value, shown, ends)


def _five(value: float | None) -> str:
    return "–" if value is None or not math.isfinite(value) else f"{value:.5g}"


def _decimals(value: float | None) -> str:
    return "–" if value is None or not math.isfinite(value) else f"{value:.4f}"


def _verdict(entry: OutputEntry) -> Cell:
    needed = entry.samples_needed
    below = f"needs {more_samples(needed, entry.summary.samples)}" if needed else ""
    return Cell(entry.verdict or "–", tone=entry.verdict if entry.verdict in VERDICTS else None, below=below)


def _bias(entry: OutputEntry) -> Cell:
    """Give the bias in per cent of the linear sigma, with its standard error."""
    sigma = entry.at(entry.summary.sigma_linear)
    bias, error = entry.at(entry.summary.bias), entry.at(entry.summary.bias_standard_error)
    if not sigma or bias is None or error is None:
        return Cell("–")
    value, *rest = with_error(100.0 * bias / sigma, 100.0 * error / sigma).split(" ")
    return Cell(value, below=" ".join(rest))


RUN: Final = ResultColumn[OutputEntry](
    "run", lambda row: row.run, (Column("Run", lambda row: row.run, "run", kind="text"),)
)
OUTPUT: Final = ResultColumn[OutputEntry](
    "output", lambda row: row.name,
    (Column("Output", lambda row: Cell(humanize(row.name), row.unit), FINAL_ERRORS.heading, kind="text"),),
)  # fmt: skip

NUMBERS: Final[tuple[ResultColumn[OutputEntry], ...]] = (
    ResultColumn("unit", lambda row: row.unit),
    _sigma("sigma_linear", "linear", lambda row: row.sigma_linear),
    _sigma("sigma_paired", "paired", lambda row: row.sigma_paired),
    _ratio("ratio_paired", "paired", lambda row: row.ratio_paired, lambda row: row.ratio_paired_ends),
    ResultColumn("verdict", lambda row: row.verdict, (Column("Verdict", _verdict, "verdict", kind="text"),)),
    _sigma("sigma_plain", "plain", lambda row: row.scaled(row.summary.sigma_sample), spare=1),
    _ratio("ratio_plain", "plain", lambda row: row.compared(row.summary.sigma_ratio),
           lambda row: row.ends(row.summary.sigma_ratio_interval), spare=1),
    ResultColumn("samples", lambda row: row.summary.samples),
    ResultColumn("samples_needed", lambda row: row.samples_needed),
    ResultColumn("mean_linear", lambda row: row.scaled(row.summary.mean_linear)),
    ResultColumn("mean_plain", lambda row: row.scaled(row.summary.mean_sample)),
    ResultColumn("bias", lambda row: row.scaled(row.summary.bias), (Column("Bias, % of σ", _bias, place="page"),)),
    ResultColumn("bias_standard_error", lambda row: row.scaled(row.summary.bias_standard_error)),
    ResultColumn("detectable_difference", lambda row: row.at(row.summary.detectable_ratio_paired), (
        Column("Smallest detectable difference (90 % power), %",
               lambda row: number(row.at(row.summary.detectable_ratio_paired, 100.0), 2), place="page"),)),
    ResultColumn("sigma_unscented", lambda row: row.sigma_unscented),
    ResultColumn("sigma_higher_order", lambda row: row.sigma_higher_order),
    ResultColumn("skewness", lambda row: row.at(row.summary.skewness)),
    ResultColumn("excess_kurtosis", lambda row: row.at(row.summary.excess_kurtosis)),
)  # fmt: skip

NOMINAL: Final = _value("nominal", "Nominal", lambda row: row.nominal)
"""Values on the nominal flight, of runs with outputs other than navigation errors."""

MEAN_ERROR: Final = _value("mean_error", "Mean error", lambda row: row.mean_error)
"""Mean errors, where some exceed one sigma."""

FILTERED: Final = ResultColumn[OutputEntry]("sigma_filter", lambda row: row.scaled(row.summary.sigma_filter))


def outputs_table(summary: Summary, units: Units = "shown", caption: str = "") -> ResultTable:
    """Tabulate the outputs of a run."""
    columns = (*_leading([summary]), *NUMBERS, *((FILTERED,) if summary.filter else ()))
    return ResultTable.of_entries("outputs", _title(summary), 1, columns, entries_of({"": summary}, units), caption)


def _leading(summaries: Sequence[Summary]) -> tuple[ResultColumn[OutputEntry], ...]:
    """Return the columns of the output, of its nominal value, and of its mean error, where runs have them."""
    nominal = (NOMINAL,) if any(summary.nominal for summary in summaries) else ()
    return OUTPUT, *nominal, *((MEAN_ERROR,) if any(map(large_means_of, summaries)) else ())


def _title(summary: Summary) -> str:
    return f"Linear and Monte Carlo sigmas of the {end_words(summary.outputs).many}"


def outputs_frame(summary: Summary) -> pd.DataFrame:
    """Return the columns that people read, with the unit, for pandas; the index are the outputs."""
    columns = [column for column in NUMBERS if column.shown or column.name == "unit"]
    rows = entries_of({"": summary}, "shown")
    leading = _leading([summary])
    return ResultTable.of_entries("outputs", _title(summary), 1, (*leading, *columns), rows).frame(indexed=True)


def outputs_of_runs(runs: Mapping[str, Summary], title: str, elsewhere: str) -> Table[OutputEntry]:
    """Tabulate the outputs of runs by name for people, with a column of the names where there are several."""
    output, *others = _leading([*runs.values()])
    run = (RUN,) if len(runs) > 1 else ()
    columns = [each for column in (output, *run, *others, *NUMBERS) for each in column.shown]
    entries = grouped(entries_of(runs, "shown"))
    if any(entry.kind for entry in entries):
        columns[0] = replace(columns[0], brief=AT_END.heading)
    keys = 2 if len(runs) > 1 else 1
    return Table("", columns, entries, title, keys, elsewhere=elsewhere, group=lambda entry: entry.kind)


def grouped(entries: Sequence[OutputEntry]) -> list[OutputEntry]:
    """Return the outputs of each kind one after another."""
    return sorted(entries, key=lambda entry: KINDS.index(entry.kind) if entry.kind else 0)


def output_rows(runs: Mapping[str, Summary]) -> list[Row]:
    """List the outputs of runs by name, a row for each output of each run, in data."""
    columns = (RUN, *_leading([*runs.values()]), *NUMBERS)
    return [row_of(columns, entry) for entry in entries_of(runs, "shown")]


def entries_of(runs: Mapping[str, Summary], units: Units) -> list[OutputEntry]:
    """List the outputs of all runs, each in the unit in which the first run that has it shows it."""
    shown_in = {
        (output.name, output.unit): shown
        for run in [*runs.values()][::-1]
        for output, shown in zip(run.outputs, run.units_shown, strict=True)
    }
    entries, every = [], {(output.name, output.unit): output for run in runs.values() for output in run.outputs}
    for (name, unit), kind in zip(every, kinds_of([*every.values()]), strict=True):
        scale, shown = in_units(unit, shown_in[name, unit], units)
        for title, run in runs.items():
            known = [(output.name, output.unit) for output in run.outputs]
            if (name, unit) in known:
                entries.append(OutputEntry(title, run, known.index((name, unit)), name, scale, shown, kind))
    return entries
