"""Faults of sensors in a run, as a table: what its samples had beside what linear analysis expects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from mcnav.analysis.summary import FaultEntry, Summary
from mcnav.report.columns.result_table import ResultColumn, ResultTable, Units, in_units
from mcnav.report.document.table import Column
from mcnav.report.format import number
from mcnav.report.names import humanize


@dataclass(frozen=True)
class FaultRow:
    """A fault of a sensor in a run, in the unit shown or SI."""

    entry: FaultEntry
    scale: float
    unit: str

    @property
    def words(self) -> str:
        """Size, kind, what is wrong, and when."""
        entry = self.entry
        size = f"{number(entry.size * self.scale)} {self.unit}"
        when = f"at {entry.begin:g} s" if entry.kind == "spike" else f"{entry.begin:g} s to {entry.end:g} s"
        return f"{entry.kind} of {size} in {humanize(entry.component)}, {when}"

    @property
    def rejected(self) -> str:
        """Rejected measurements of a sample, with the interval."""
        low, high = self.entry.rejected_interval or (None, None)
        between = "" if low is None or high is None else f" ({number(low, 3)} to {number(high, 3)})"
        return f"{number(self.entry.rejected)}{between}"


FAULTS: Final[tuple[ResultColumn[FaultRow], ...]] = (
    ResultColumn("sensor", lambda row: row.entry.sensor,
                 (Column("Sensor", lambda row: humanize(row.entry.sensor), "sensor", "label"),)),
    ResultColumn("kind", lambda row: row.entry.kind, (Column("Fault", lambda row: row.words, "fault", "words"),)),
    ResultColumn("component", lambda row: row.entry.component),
    ResultColumn("unit", lambda row: row.unit),
    ResultColumn("begin", lambda row: row.entry.begin),
    ResultColumn("end", lambda row: row.entry.end),
    ResultColumn("size", lambda row: row.entry.size * row.scale),
    ResultColumn("measurements", lambda row: row.entry.measurements,
                 (Column("Measurements", lambda row: str(row.entry.measurements), "measurements"),)),
    ResultColumn("rejected", lambda row: row.entry.rejected,
                 (Column("Rejected", lambda row: row.rejected, "rejected"),), lambda row: row.entry.rejected_interval),
    ResultColumn("expected", lambda row: row.entry.expected,
                 (Column("Expected", lambda row: number(row.entry.expected), "expected"),)),
    ResultColumn("alarm", lambda row: row.entry.alarm,
                 (Column("P(any rejected)", lambda row: number(row.entry.alarm), "P(any rejected)"),)),
)  # fmt: skip

FAULT_CAPTION: Final = (
    "Measurements that a gate rejects during a fault, per sample. Expected: by linear analysis as if all before were "
    "accepted; P: its probability that any is rejected. After the first rejection the filter is another."
)


def faults_table(summary: Summary, units: Units = "shown") -> ResultTable:
    """Tabulate the faults of a run's sensors, beside what linear analysis expects."""
    rows = [FaultRow(entry, *in_units(entry.unit, entry.shown_in, units)) for entry in summary.faults]
    return ResultTable.of_entries("faults", "Faults of the sensors", 1, FAULTS, rows, FAULT_CAPTION)
