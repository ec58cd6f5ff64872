"""Requirements and their results as rows of tables."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from mcnav.analysis.filter_consistency import MEAN, cause_words
from mcnav.analysis.filter_remarks import instant
from mcnav.report.columns.result_table import ResultColumn, ResultTable, Units, in_units
from mcnav.report.document.table import Cell, Column, Table
from mcnav.report.format import number
from mcnav.report.names import humanize, labels_in, shown_units, unit_words
from mcnav.report.statements.words import listed, more_samples
from mcnav.statistics.demonstration import runs_to_show

if TYPE_CHECKING:
    from mcnav.analysis.summary import RequirementEntry, Summary
    from mcnav.arrays.types import Array

RADII: Final = {
    "cep": "circular error probable",
    "r95": "radius of 95 % of the errors",
    "sep": "spherical error probable",
}
"""Radii about zero that requirements limit, by kind."""

NAMED: Final = 3
"""Causes that are named beside a number."""

TONES: Final = {"met": "agrees", "not met": "differs", "undecided": "undecided", "met for the known ways": "undecided"}


@dataclass(frozen=True)
class NamedRequirement:
    """See `mcnav.analysis.requirements.Requirement`; outputs by name."""

    kind: str
    outputs: Sequence[str]
    limits: Sequence[float]
    probability: float | None
    when: str = ""
    about: str = ""


def stated(entry: NamedRequirement | RequirementEntry, shown_in: Mapping[str, tuple[float, str]]) -> str:
    """Put a requirement in words; ``shown_in`` is that of `shown_units`."""
    names, limits = entry.outputs, entry.limits
    if entry.kind == "sigma_ratio":
        return f"every sigma within ±{100.0 * limits[0]:g} % of the linear one"
    when = (", about the nominal" if entry.about else "") + (f", {entry.when}" if entry.when else "")
    if entry.kind in RADII:
        scale, unit = shown_in[names[0]]
        radius = f"{limits[0] * scale:g} {unit}".rstrip()
        together = f"{', '.join(map(humanize, names[:-1]))} and {humanize(names[-1])}"
        return f"{RADII[entry.kind]} of {together} below {radius}{when}"
    sides = []
    for name, limit in zip(names, limits, strict=True):
        scale, unit = shown_in[name]
        sides.append(f"|{humanize(name)}| below {limit * scale:g} {unit}".rstrip())
    return f"{' and '.join(sides)} in {100.0 * (entry.probability or 0.0):g} % of samples{when}"


def nominal_of(summary: Summary, names: Sequence[str]) -> Array:
    """Return the nominal of outputs by name, SI; zero of errors."""
    nominal = dict(zip(summary.names, summary.nominal, strict=False))
    return np.array([nominal.get(name) or 0.0 for name in names])


def requirement_causes(summary: Summary, entry: RequirementEntry) -> list[tuple[str, float]]:
    """List the largest causes of the errors that a requirement of a summary limits, for people, with their shares."""
    return [(cause_label(summary, cause.name), cause.share) for cause in entry.causes[:NAMED]]


def cause_label(summary: Summary, cause: str) -> str:
    """Name a cause of a summary for people."""
    labels = dict(zip((source.name for source in summary.sources), labels_in(summary), strict=True))
    name = cause.removeprefix(MEAN)
    return f"{'mean of ' if name != cause else ''}{labels[name]}" if name in labels else cause_words(cause)


def way_to_fail(summary: Summary, way: Mapping[str, float]) -> str:
    """Put the most likely way to fail in words, the departures of at most `NAMED` sources in sigmas."""
    labels = dict(zip((source.name for source in summary.sources), labels_in(summary), strict=True))
    parts = [f"{labels.get(name, humanize(name))} at {sigmas:+.1f}σ" for name, sigmas in list(way.items())[:NAMED]]
    return "most likely by " + " with ".join(filter(None, (parts[0], ", ".join(parts[1:]))))


@dataclass(frozen=True)
class RequirementRow:
    """A requirement of a run, the factor from SI to the unit of its numbers, and that unit."""

    summary: Summary
    entry: RequirementEntry
    scale: float
    unit: str
    time_unit: str = ""
    number: int = 1

    @property
    def words(self) -> str:
        """The requirement in words."""
        return stated(self.entry, shown_units(self.summary))

    @property
    def tone(self) -> str:
        """Tone of the finding."""
        return TONES[self.entry.finding]

    @property
    def causes(self) -> list[tuple[str, float]]:
        """Largest causes of the errors that it limits, with their shares."""
        return requirement_causes(self.summary, self.entry)

    def scaled(self, value: float | None) -> float | None:
        """Return a value in the unit of this row."""
        return None if value is None else value * self.scale

    def with_unit(self, value: str) -> str:
        """Put the unit behind a number; a pure number has none."""
        return f"{value} {unit_words(self.unit)}".rstrip()

    def shown(self, value: float | None, missing: str = "∞") -> str:
        """Format a value: a ratio, a probability, or an error with its unit."""
        kind, scaled = self.entry.kind, self.scaled(value)
        if kind == "sigma_ratio":
            return number(scaled, 5)
        if scaled is None or not math.isfinite(scaled):
            return "–" if kind == "box" else missing
        return f"{100.0 * scaled:.3f} %" if kind == "box" else self.with_unit(number(scaled, 4))

    @property
    def estimate(self) -> Cell:
        """The estimate; over time the largest one, and when that is."""
        entry = self.entry
        words = ""
        if entry.time is not None and entry.samples is not None:
            words = f"largest at {instant(entry.time, f'time [{self.time_unit}]')}, of {entry.samples:,} samples"
        elif self.time_unit and not entry.epochs and entry.kind != "sigma_ratio":
            words = "at the end"
        return Cell(self.shown(entry.estimate, "–"), below=words)

    @property
    def linear(self) -> Cell:
        """The value by linear analysis, and whether it meets the requirement."""
        known = self.entry.kind != "sigma_ratio" and self.entry.linear is not None
        met = "met" if self.entry.linear_meets else "not met"
        return Cell(self.shown(self.entry.linear, "–"), below=met if known else "–")

    @property
    def runs_to_show(self) -> list[int | None]:
        """Samples that show it by counting if none, one or two lie beyond the limit; empty of a sigma ratio."""
        kind, probability = self.entry.kind, self.entry.probability
        if kind == "sigma_ratio" or self.entry.epochs:
            return []
        level = 0.5 if probability is None else probability
        return [runs_to_show(level, self.summary.confidence, failures) for failures in range(3)]

    @property
    def by_counting(self) -> str:
        """Samples that show it by counting, in words."""
        runs = self.runs_to_show
        if not runs or None in runs:
            return ""
        none, one, two = (f"{run:,}" for run in runs)
        return f"shown by {none} samples with none beyond, {one} with one, {two} with two"

    @property
    def exceedance(self) -> str:
        """Probability beyond the limits by flights that the linear model chose, or why there is none."""
        known = self.entry.exceedance
        if known is None:
            return "–"
        if known.refusal or known.estimate is None or known.low is None or known.high is None:
            return f"not estimated: {known.refusal}"
        when = " at any epoch" if self.entry.epochs else ""
        return f"{known.estimate:.2e} ({known.low:.2e} to {known.high:.2e}){when}, {known.flights:,} flights"

    @property
    def way(self) -> str:
        """The most likely way to fail."""
        known = self.entry.exceedance
        if known is None or not known.way:
            return ""
        return f"{way_to_fail(self.summary, known.way)}; flown by mcnav replay RUN --fail {self.number}"

    @property
    def to_decide(self) -> str:
        """Number of samples that would decide, and why nothing was decided."""
        needed = self.entry.samples_needed
        decides = more_samples(needed, self.summary.samples) if needed else ""
        return "; ".join(filter(None, (decides, self.entry.remark)))


COLUMNS: Final[tuple[ResultColumn[RequirementRow], ...]] = (
    ResultColumn("requirement", lambda row: row.words,
                 (Column("Requirement", lambda row: Cell(row.words, below=row.by_counting), place="page", kind="words"),
                  Column("Requirement", lambda row: row.words, "requirement", kind="words", place="terminal"))),
    ResultColumn("finding", lambda row: row.entry.finding, (
        Column("Finding", lambda row: Cell(row.entry.finding, tone=row.tone), "finding",
               kind="text"),)),
    ResultColumn("unit", lambda row: row.unit),
    ResultColumn("estimate", lambda row: row.scaled(row.entry.estimate),
                 (Column("Monte Carlo", lambda row: row.estimate, place="page"),)),
    ResultColumn("lower_bound", lambda row: row.scaled(row.entry.interval[0]),
                 (Column("Lower bound", lambda row: row.shown(row.entry.interval[0]), place="page"),)),
    ResultColumn("upper_bound", lambda row: row.scaled(row.entry.interval[1]),
                 (Column("Upper bound", lambda row: row.shown(row.entry.interval[1]), place="page"),)),
    ResultColumn("linear", lambda row: row.scaled(row.entry.linear),
                 (Column("Linear, Gaussian", lambda row: row.linear, place="page"),)),
    ResultColumn("linear_meets", lambda row: row.entry.linear_meets),
    ResultColumn("samples_needed", lambda row: row.entry.samples_needed,
                 (Column("To decide", lambda row: row.to_decide, "to decide", kind="words"),)),
    ResultColumn("time", lambda row: row.entry.time),
    ResultColumn("remark", lambda row: row.entry.remark),
)  # fmt: skip

EXCEEDANCE: Final[tuple[ResultColumn[RequirementRow], ...]] = (
    ResultColumn("exceedance", lambda row: row.entry.exceedance.estimate if row.entry.exceedance else None, (
        Column("Exceedance", lambda row: Cell(row.exceedance, below=row.way), place="page", kind="words"),
        Column("Exceedance", lambda row: "; ".join(filter(None, (row.exceedance, row.way))), "exceedance",
               kind="words", place="terminal"),)),
    ResultColumn("exceedance_from", lambda row: row.entry.exceedance.low if row.entry.exceedance else None),
    ResultColumn("exceedance_to", lambda row: row.entry.exceedance.high if row.entry.exceedance else None),
    ResultColumn("exceedance_flights", lambda row: row.entry.exceedance.flights if row.entry.exceedance else None),
    ResultColumn("exceedance_power", lambda row: row.entry.exceedance.power if row.entry.exceedance else None),
    ResultColumn("exceedance_refusal", lambda row: row.entry.exceedance.refusal if row.entry.exceedance else ""),
)  # fmt: skip
"""Columns of runs in which counting could not be expected to decide a requirement."""

CAUSES: Final = ResultColumn[RequirementRow]("largest_causes", lambda row: listed(row.causes) if row.causes else "", (
    Column("Largest causes", lambda row: listed(row.causes), "largest linear causes of these errors",
           kind="words"),))  # fmt: skip


def requirement_rows(summary: Summary, units: Units = "shown", time_unit: str = "") -> list[RequirementRow]:
    """List the requirements; ratios and probabilities have no unit."""
    shown_in = {
        output.name: in_units(output.unit, shown, units)
        for output, shown in zip(summary.outputs, summary.units_shown, strict=True)
    }
    rows = []
    for place, entry in enumerate(summary.requirements, 1):
        scale, unit = (1.0, "") if entry.kind in ("sigma_ratio", "box") else shown_in[entry.outputs[0]]
        rows.append(RequirementRow(summary, entry, scale, unit, time_unit, place))
    return rows


def requirements_table(
    summary: Summary, units: Units = "shown", time_unit: str = "", confidence: str = ""
) -> ResultTable:
    """Tabulate the requirements with their findings, estimates, bounds and linear values.

    ``time_unit`` is that of the run's histories, ``confidence`` that of bounds.
    """
    rows = requirement_rows(summary, units, time_unit)
    explained = any(entry.causes for entry in summary.requirements)
    beyond = any(entry.exceedance is not None for entry in summary.requirements)
    columns = (*COLUMNS, *(EXCEEDANCE if beyond else ()), *((CAUSES,) if explained else ()))
    caption = _caption(summary, explained, confidence)
    return ResultTable.of_entries("requirements", "Requirements", 1, columns, rows, caption)


def _caption(summary: Summary, explained: bool, confidence: str) -> str:
    over_time = any(entry.time is not None for entry in summary.requirements)
    parts = [
        f"Requirements of the campaign's [accept] table. Bounds are one-sided at {confidence} each and "
        "distribution-free (order statistics, exact binomial). Of sigmas they are the ends of the interval of the "
        "paired ratio farthest from one."
    ]
    if over_time:
        parts.append(
            "Over time all values are the largest of the epochs. The lower bound holds for all epochs together. Only "
            "the campaign's first samples have errors over time."
        )
    if any(entry.exceedance is not None for entry in summary.requirements):
        parts.append(
            "Exceedance: probability beyond the limits, with its two-sided interval, by flights along lines that the "
            "linear model chose and by a search in other places; sigmas are those of the sources. Met for the known "
            "ways: the search would miss a second way to fail, as likely as what is allowed, in more than one of ten "
            "runs."
        )
    if explained:
        when = ", over time at the epoch with the largest estimate" if over_time else ""
        parts.append(f"Causes: share of the linear mean square of the errors that the requirement limits{when}.")
    return " ".join(parts)


@dataclass(frozen=True)
class AllowedSigma:
    """The largest sigma of a source that meets a requirement; NaN: not without the source, infinite: any meets it."""

    requirement: str
    source: str
    label: str
    unit: str
    sigma: float
    largest: float

    @property
    def largest_words(self) -> str:
        """The largest sigma with its unit."""
        if math.isfinite(self.largest):
            return f"{number(self.largest)} {self.unit}"
        return "any" if math.isinf(self.largest) else "none"


ALLOWED: Final[tuple[ResultColumn[AllowedSigma], ...]] = (
    ResultColumn("requirement", lambda row: row.requirement),
    ResultColumn("source", lambda row: row.source, (Column("Source", lambda row: row.label),)),
    ResultColumn("unit", lambda row: row.unit),
    ResultColumn("sigma", lambda row: row.sigma, (Column("σ now", lambda row: f"{number(row.sigma)} {row.unit}"),)),
    ResultColumn("largest_sigma", lambda row: row.largest, (Column("Largest σ", lambda row: row.largest_words),)),
)

ALLOWED_CAPTION: Final = (
    "Largest sigma of each source that meets the requirement, with the other sources unchanged. Linear analysis, times "
    "the upper bound of the samples over the linear value. Not simulated: mcnav allocate simulates such "
    "changes. “None”: the others exceed the limit without it."
)


def allowed_sigmas(summary: Summary, units: Units = "shown") -> list[AllowedSigma]:
    """List the largest sigma of each source that meets each requirement by linear analysis, the others unchanged."""
    words, labels = shown_units(summary), labels_in(summary)
    sigmas = np.sqrt(np.maximum(summary.start_covariance.diagonal(), 0.0))
    shown_in = summary.shown_in.sources or [source.unit for source in summary.sources]
    scales = [in_units(source.unit, shown, units) for source, shown in zip(summary.sources, shown_in, strict=True)]
    return [
        AllowedSigma(stated(entry, words), source.name, label, unit, sigma * scale, largest * scale)
        for entry in summary.requirements
        if entry.largest_sigmas is not None
        for source, label, (scale, unit), sigma, largest in zip(
            summary.sources, labels, scales, sigmas.tolist(), entry.largest_sigmas.tolist(), strict=True
        )
        if sigma > 0.0
    ]


def allowed_table(summary: Summary, units: Units = "shown") -> ResultTable:
    """Tabulate the largest source sigmas that meet the requirements."""
    title = "Largest source sigmas that meet each requirement, by linear analysis scaled by the samples"
    return ResultTable.of_entries("allowed_sigmas", title, 2, ALLOWED, allowed_sigmas(summary, units), ALLOWED_CAPTION)


def allowed_by_requirement(summary: Summary) -> dict[str, Table[AllowedSigma]]:
    """Return a table of the largest source sigmas for each requirement that has them."""
    table, rows = allowed_table(summary).read, dict[str, list[AllowedSigma]]()
    for row in allowed_sigmas(summary):
        rows.setdefault(row.requirement, []).append(row)
    return {words: replace(table, rows=some) for words, some in rows.items()}
