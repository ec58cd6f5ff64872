"""The table of quantiles of the errors' absolute values, and of the CEP of pairs of outputs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from mcnav.analysis.summary import QuantileEntry, Summary
from mcnav.report.columns.result_table import ResultColumn, ResultTable, Units, in_units
from mcnav.report.document.table import Cell, Column
from mcnav.report.format import number
from mcnav.report.names import humanize

TITLE: Final = "Quantiles of the errors' absolute values; of two outputs the CEP"


@dataclass(frozen=True)
class QuantileRow:
    """A quantile, the factor from SI to the unit of its numbers, and that unit."""

    entry: QuantileEntry
    scale: float
    unit: str

    @property
    def title(self) -> Cell:
        """Name for people."""
        first, *other = map(humanize, self.entry.outputs)
        return Cell(f"{first} and {other[0]}: CEP" if other else f"|{first}|", self.unit)

    @property
    def verdict(self) -> Cell:
        """Verdict; one that is undecided has no colour."""
        verdict = self.entry.verdict or "–"
        return Cell(verdict, tone=verdict if verdict in ("agrees", "differs") else None)

    def scaled(self, value: float | None) -> float | None:
        """Return a value in the unit of this row."""
        return None if value is None else value * self.scale

    def end(self, place: int) -> float | None:
        """Return an end of the interval that holds together with the others."""
        return None if self.entry.together is None else self.scaled(self.entry.together[place])


def _low(row: QuantileRow) -> str:
    low = row.end(0)
    return number(low) if low is not None and math.isfinite(low) and low > 0.0 else "–"


COLUMNS: Final[tuple[ResultColumn[QuantileRow], ...]] = (
    ResultColumn("output", lambda row: row.entry.outputs[0],
                 (Column("Error", lambda row: row.title, "error", kind="label"),)),
    ResultColumn("other_output", lambda row: row.entry.outputs[1] if len(row.entry.outputs) > 1 else ""),
    ResultColumn("probability", lambda row: row.entry.probability,
                 (Column("Probability", lambda row: f"{100.0 * row.entry.probability:g} %", "probability"),)),
    ResultColumn("unit", lambda row: row.unit),
    ResultColumn("estimate", lambda row: row.scaled(row.entry.estimate),
                 (Column("Monte Carlo", lambda row: row.scaled(row.entry.estimate)),)),
    ResultColumn("lower", lambda row: row.scaled(row.entry.lower)),
    ResultColumn("upper", lambda row: row.scaled(row.entry.upper)),
    ResultColumn("linear", lambda row: row.scaled(row.entry.linear),
                 (Column("Linear, Gaussian", lambda row: row.scaled(row.entry.linear)),)),
    ResultColumn("joint_from", lambda row: row.end(0), (Column("From", _low),)),
    ResultColumn("joint_to", lambda row: row.end(1), (Column("To", lambda row: row.end(1)),)),
    ResultColumn("verdict", lambda row: row.entry.verdict, (Column("Verdict", lambda row: row.verdict, kind="label"),)),
)  # fmt: skip


def percentiles_table(
    summary: Summary, units: Units = "shown", confidence: str = "", tolerance: str = ""
) -> ResultTable:
    """Tabulate the quantiles with their intervals and verdicts."""
    shown_in = {
        output.name: in_units(output.unit, shown, units)
        for output, shown in zip(summary.outputs, summary.units_shown, strict=True)
    }
    rows = [QuantileRow(entry, *shown_in[entry.outputs[0]]) for entry in summary.tails]
    caption = (
        "Quantiles of the Monte Carlo errors and of a normal distribution with the linear covariance. Intervals are "
        f"distribution-free (order statistics) and hold jointly at {confidence} (Bonferroni). A dash: too few "
        f"independent samples. Agrees: the whole interval is within ±{tolerance} of the linear value; differs: it is "
        "outside."
    )
    if summary.pairs_without_cep:
        caption += (
            f" {summary.pairs_without_cep:,} pairs of outputs in one unit are too many for a CEP of each: "
            "[[accept.cep]] asks for one."
        )
    return ResultTable.of_entries("percentiles", TITLE, 3, COLUMNS, rows, caption)


def prominence(row: QuantileRow) -> tuple[bool, float]:
    """Return whether a quantile differs, and its departure from the linear one, as a share of that."""
    entry = row.entry
    departure = abs(entry.estimate / entry.linear - 1.0) if entry.estimate is not None and entry.linear else 0.0
    return entry.verdict == "differs", departure
