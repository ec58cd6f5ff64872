"""The tables on a filter: ratios of groups of states, of outputs and states, innovations, neglected errors."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

from mcnav.analysis.filter_consistency import cause_words
from mcnav.analysis.filter_decision import deciding_names
from mcnav.analysis.filter_remarks import instant, period
from mcnav.analysis.summary import Ends, FilterRatio, FilterSummary, NeglectedEntry, SensorEntry, Summary
from mcnav.report.columns.result_table import ResultColumn, ResultTable, Units, in_units
from mcnav.report.document.table import Cell, Column, Table
from mcnav.report.drawing.strip import Strip
from mcnav.report.format import interval, number, percent, rounded
from mcnav.report.names import humanize, labels_in
from mcnav.report.statements.fields import LEAST
from mcnav.report.statements.words import TONES, more_samples

GROUP_TITLES: Final = {
    "all": "all estimated states", "navigation": "navigation errors", "sensors": "errors of instruments and sensors",
}  # fmt: skip
"""Groups of states for people, where their names do not say it."""


@dataclass(frozen=True)
class RatioRow:
    """A ratio of true to filter sigma: of a group of states, an output or another state of the filter."""

    filter: FilterSummary
    entry: FilterRatio
    name: str
    kind: str
    scale: float = 1.0
    unit: str = ""
    decides: bool = False

    @property
    def title(self) -> Cell:
        """Name for people."""
        name = GROUP_TITLES.get(self.name, humanize(self.name)) if self.kind == "group" else humanize(self.name)
        return Cell(name, self.unit)

    @property
    def worst(self) -> str:
        """Time at which the ratio is farthest from one."""
        return "–" if self.entry.worst is None else instant(self.entry.worst, self.filter.time)

    @property
    def certain(self) -> str:
        """First and last epoch at which the ratio is certain to be beyond the tolerance."""
        begin, end = self.entry.begin, self.entry.end
        if begin is None or end is None:
            return "–"
        return instant(end, self.filter.time) if begin == end else period(begin, end, self.filter.time)

    @property
    def verdict(self) -> Cell:
        """Verdict; on a page only what decides has a colour, as the verdict on the filter has."""
        needed = self.entry.samples_needed
        remark = more_samples(needed, self.filter.samples) if needed else self.entry.remark
        aside = "does not decide" if self.kind == "group" and not self.decides else ""
        tone = TONES[self.entry.verdict] if self.decides else None
        return Cell(self.entry.verdict, tone=tone, below="; ".join(filter(None, (remark, aside))))

    def marked(self, ratio: float | None, ends: Ends | None) -> Cell:
        """Return a ratio with its mark."""
        return Cell(rounded(ratio), strip=Strip.of(ratio, ends, self.filter.tolerance))

    def scaled(self, value: float | None) -> float | None:
        """Return a sigma in the unit of this row."""
        return None if value is None else value * self.scale


_SIGMAS: Final[tuple[ResultColumn[RatioRow], ...]] = (
    ResultColumn("sigma_true", lambda row: row.scaled(row.entry.sigma_true),
                 (Column("True σ", lambda row: row.scaled(row.entry.sigma_true), "true σ"),)),
    ResultColumn("sigma_filter", lambda row: row.scaled(row.entry.sigma_filter),
                 (Column("Filter σ", lambda row: row.scaled(row.entry.sigma_filter), "filter σ"),)),
)  # fmt: skip

_RATIO: Final[tuple[ResultColumn[RatioRow], ...]] = (
    ResultColumn("ratio", lambda row: row.entry.ratio, (
        Column("Ratio at the end", lambda row: row.marked(row.entry.ratio, row.entry.ratio_interval), place="page"),
        Column("", lambda row: row.entry.ratio, "ratio at the end", place="terminal"),
        Column("", lambda row: interval(*row.entry.ratio_interval), "interval", place="terminal"),
    ), lambda row: row.entry.ratio_interval),
    ResultColumn("ratio_linear", lambda row: row.entry.ratio_linear),
)  # fmt: skip

_WITHIN: Final[tuple[ResultColumn[RatioRow], ...]] = (
    ResultColumn("within_1", lambda row: row.entry.within_1),
    ResultColumn("within_3", lambda row: row.entry.within_3),
)

_FINDING: Final[tuple[ResultColumn[RatioRow], ...]] = (
    ResultColumn("verdict", lambda row: row.entry.verdict,
                 (Column("Verdict", lambda row: row.verdict, "verdict", kind="text"),)),
    ResultColumn("worst_ratio", lambda row: row.entry.factor,
                 (Column("Worst ratio", lambda row: row.marked(row.entry.factor, row.entry.factor_interval),
                         place="page"),
                  Column("", lambda row: row.entry.factor, "worst ratio", place="terminal")),
                 lambda row: row.entry.factor_interval),
    ResultColumn("time_worst", lambda row: row.entry.worst, (Column("At", lambda row: row.worst, "at"),)),
    ResultColumn("time_begin", lambda row: row.entry.begin,
                 (Column("Certain", lambda row: row.certain, place="page"),)),
    ResultColumn("time_end", lambda row: row.entry.end),
    ResultColumn("samples_needed", lambda row: row.entry.samples_needed),
    ResultColumn("remark", lambda row: row.entry.remark),
)  # fmt: skip

GROUPS: Final[tuple[ResultColumn[RatioRow], ...]] = (
    ResultColumn("group", lambda row: row.name,
                 (Column("Errors", lambda row: row.title, "group", kind="label"),)),
    ResultColumn("states", lambda row: row.entry.size, (Column("States", lambda row: str(row.entry.size), "states"),)),
    ResultColumn("nees", lambda row: row.entry.nees_mean, ends=lambda row: row.entry.nees_interval),
    ResultColumn("nees_bounds_from", lambda row: (row.entry.nees_bounds or (None, None))[0]),
    ResultColumn("nees_bounds_to", lambda row: (row.entry.nees_bounds or (None, None))[1]),
    *_RATIO, *_FINDING,
)  # fmt: skip

SIGMAS: Final[tuple[ResultColumn[RatioRow], ...]] = (
    ResultColumn("state", lambda row: row.name, (Column("Errors", lambda row: row.title, "output", kind="label"),)),
    ResultColumn("kind", lambda row: row.kind),
    ResultColumn("unit", lambda row: row.unit),
    *_SIGMAS, *_RATIO, *_WITHIN, *_FINDING,
)  # fmt: skip

GROUP_CAPTION: Final = (
    "True over filter sigma by groups of states: root of the mean NEES over the number of states. Certain: first and "
    "last epoch at which the interval that holds together with those of all deciding groups, outputs and epochs is "
    "beyond the tolerance. Marks: intervals at the end are of that epoch, those of the worst ratio hold together."
)
SIGMA_CAPTIONS: Final = {
    "output": "True over filter sigma of each output. Each of them decides.",
    "state": "True over filter sigma of each other state of the filter. They do not decide; their intervals hold "
    "together with one another.",
}


def group_rows(summary: Summary) -> list[RatioRow]:
    """List the groups of states."""
    if (result := summary.filter) is None:
        return []
    deciding = deciding_names(result.groups)
    return [RatioRow(result, entry, name, "group", decides=name in deciding) for name, entry in result.groups.items()]


def sigma_rows(summary: Summary, units: Units = "shown") -> list[RatioRow]:
    """List every output and every other state of the filter."""
    if (result := summary.filter) is None:
        return []
    shown_in = {
        output.name: in_units(output.unit, shown, units)
        for output, shown in zip(summary.outputs, summary.units_shown, strict=True)
    }
    outputs = [
        RatioRow(result, entry, name, "output", *shown_in.get(name, (1.0, entry.unit)), decides=True)
        for name, entry in result.outputs.items()
    ]
    return outputs + [RatioRow(result, entry, name, "state", unit=entry.unit) for name, entry in result.states.items()]


def groups_table(summary: Summary) -> ResultTable:
    """Tabulate the ratios of groups of states."""
    title = "True over filter sigma by groups of states"
    return ResultTable.of_entries("filter_groups", title, 1, GROUPS, group_rows(summary), GROUP_CAPTION)


def sigmas_table(summary: Summary, units: Units = "shown") -> ResultTable:
    """Tabulate true and filter sigma at the end."""
    title = "True and filter sigma at the end"
    return ResultTable.of_entries("filter_sigmas", title, 1, SIGMAS, sigma_rows(summary, units))


def sigmas_of(summary: Summary, kind: str, units: Units = "shown") -> Table[RatioRow] | None:
    """Return the table of the outputs, or of the other states; none without any."""
    table, rows = sigmas_table(summary, units).read, [row for row in sigma_rows(summary, units) if row.kind == kind]
    title = "Filter: true over filter sigma of each output"
    return replace(table, rows=rows, caption=SIGMA_CAPTIONS[kind], title=title) if rows else None


@dataclass(frozen=True)
class SensorRow:
    """The innovations of a sensor; ``considered``: correlated innovations are those of a matched filter as well."""

    name: str
    entry: SensorEntry
    considered: bool

    @property
    def rejected(self) -> Cell:
        """Rejected updates, and their share."""
        rejected, whole = self.entry.rejected, self.entry.accepted + self.entry.rejected
        return Cell(number(rejected, 3), below=f"{100.0 * rejected / whole:.2g} %" if rejected else "")

    @property
    def bounds(self) -> Cell:
        """Bounds of the mean NIS, and what is expected."""
        low, high = self.entry.nis_bounds or (None, None)
        known = self.entry.nis_mean is not None
        return Cell(f"{number(low)} to {number(high)}", below=f"expected {self.entry.size}") if known else Cell("–")

    @property
    def nis(self) -> Cell:
        """True where the mean NIS is within its bounds."""
        if self.entry.nis_mean is None:
            return Cell("no updates")
        return Cell("beyond bounds", tone="differs") if self.entry.nis_beyond else Cell("within bounds", tone="agrees")

    @property
    def innovations(self) -> Cell:
        """True where the innovations are white."""
        if self.entry.correlation is None:
            return Cell("–")
        if not self.entry.correlation_beyond:
            return Cell("white", tone="agrees")
        return Cell("correlated", tone="partly" if self.considered else "differs")

    @property
    def bound(self) -> str:
        """Bound of the correlation."""
        return "–" if self.entry.correlation is None else f"±{number(self.entry.correlation_bound, 2)}"


SENSORS: Final[tuple[ResultColumn[SensorRow], ...]] = (
    ResultColumn("sensor", lambda row: row.name,
                 (Column("Sensor", lambda row: humanize(row.name), "sensor", kind="label"),)),
    ResultColumn("components", lambda row: row.entry.size),
    ResultColumn("accepted", lambda row: row.entry.accepted,
                 (Column("Accepted updates", lambda row: row.entry.accepted, "accepted"),)),
    ResultColumn("rejected", lambda row: row.entry.rejected,
                 (Column("Rejected", lambda row: row.rejected, "rejected"),)),
    ResultColumn("nis", lambda row: row.entry.nis_mean, (
        Column("Mean NIS", lambda row: row.entry.nis_mean, "mean NIS"),
        Column("", lambda row: str(row.entry.size), "expected", place="terminal"),
    ), lambda row: row.entry.nis_interval),
    ResultColumn("nis_bounds_from", lambda row: (row.entry.nis_bounds or (None, None))[0],
                 (Column("Bounds", lambda row: row.bounds, place="page"),)),
    ResultColumn("nis_bounds_to", lambda row: (row.entry.nis_bounds or (None, None))[1]),
    ResultColumn("nis_beyond", lambda row: row.entry.nis_beyond, (Column("NIS", lambda row: row.nis, kind="text"),)),
    ResultColumn("correlation", lambda row: row.entry.correlation,
                 (Column("Correlation", lambda row: row.entry.correlation, "correlation"),)),
    ResultColumn("correlation_bound", lambda row: row.entry.correlation_bound,
                 (Column("Bound", lambda row: row.bound, "bound"),)),
    ResultColumn("correlation_beyond", lambda row: row.entry.correlation_beyond,
                 (Column("Innovations", lambda row: row.innovations, "innovations", kind="text"),)),
    ResultColumn("verdict", lambda row: row.entry.verdict),
)  # fmt: skip


def sensors_table(summary: Summary, considered: bool = False, confidence: str = "") -> ResultTable:
    """Tabulate updates, NIS and whiteness of each sensor."""
    sensors = {} if summary.filter is None else summary.filter.sensors
    rows = [SensorRow(name, entry, considered) for name, entry in sensors.items()]
    caption = (
        "Updates in a sample's flight on average. NIS: mean normalized innovation squared over the whole flight, "
        "beside that of a consistent filter. Correlation of consecutive innovations: zero for white ones. "
        f"Bounds hold at {confidence} each."
    )
    return ResultTable.of_entries("filter_sensors", "Innovations over the whole flight", 1, SENSORS, rows, caption)


@dataclass(frozen=True)
class NeglectedRow:
    """An error that makes the filter optimistic: what it adds to an output, and what the filter believes of it."""

    entry: NeglectedEntry
    output: str
    label: str
    scale: float
    unit: str

    @property
    def true(self) -> float:
        """Root mean square that the error adds."""
        return math.sqrt(max(self.entry.true, 0.0)) * self.scale

    @property
    def believed(self) -> float:
        """Root mean square that the filter believes that it adds."""
        return math.sqrt(max(self.entry.believed, 0.0)) * self.scale


NEGLECTED: Final[tuple[ResultColumn[NeglectedRow], ...]] = (
    ResultColumn("cause", lambda row: row.entry.name, (Column("Error", lambda row: row.label, kind="label"),)),
    ResultColumn("output", lambda row: row.output),
    ResultColumn("unit", lambda row: row.unit),
    ResultColumn("sigma_true", lambda row: row.true,
                 (Column("True", lambda row: f"{number(row.true)} {row.unit}"),)),
    ResultColumn("sigma_believed", lambda row: row.believed,
                 (Column("Filter", lambda row: f"{number(row.believed)} {row.unit}"),)),
    ResultColumn("share", lambda row: row.entry.share,
                 (Column("Share", lambda row: percent(row.entry.share).removeprefix("+")),)),
)  # fmt: skip


def neglected_rows(summary: Summary, units: Units = "shown") -> list[NeglectedRow]:
    """List the errors that the filter neglects."""
    result = summary.filter
    if result is None or not result.neglected:
        return []
    name = result.neglected_output or result.output
    place = summary.names.index(name)
    scale, unit = in_units(summary.outputs[place].unit, summary.units_shown[place], units)
    labels = dict(zip((source.name for source in summary.sources), labels_in(summary), strict=True))
    return [
        NeglectedRow(entry, name, labels.get(entry.name, cause_words(entry.name)), scale, unit)
        for entry in result.neglected
    ]


def neglected_table(summary: Summary, units: Units = "shown") -> ResultTable:
    """Tabulate the errors that the filter neglects."""
    rows = neglected_rows(summary, units)
    return ResultTable.of_entries("neglected", "Errors that the filter neglects", 1, NEGLECTED, rows)


def foremost_neglected(summary: Summary) -> Table[NeglectedRow] | None:
    """Return the neglected errors for a page, where those with small shares are one row; none without any."""
    table, rows, result = neglected_table(summary).read, neglected_rows(summary), summary.filter
    if not rows or result is None or result.neglected_at is None:
        return None
    rest = [row for row in rows if row.entry.share < LEAST]
    if len(rest) > 1:
        sums = {key: sum(getattr(row.entry, key) for row in rest) for key in ("true", "believed", "share")}
        together = replace(rows[0], entry=NeglectedEntry(name="", **sums), label=f"{len(rest)} others")
        rows = [*(row for row in rows if row.entry.share >= LEAST), together]
    caption = (
        f"What makes the filter optimistic at {instant(result.neglected_at, result.time)}, where by linear analysis "
        f"the sigma of {humanize(result.neglected_output)} departs most. Root mean square that each error adds, what "
        "the filter computes of it, and share in the difference of the squares."
    )
    return replace(table, rows=rows, caption=caption)
