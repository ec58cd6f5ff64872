"""Page and terminal output of a unit identified from logs at rest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from mcnav.identification.choice import BESIDE, CLOSE, PENALTY, TIMED
from mcnav.identification.goodness import SINGLE, Finding, Goodness
from mcnav.physics.units import conversion
from mcnav.report.document.parts import (
    Facts,
    Heading,
    Lines,
    Listing,
    Note,
    Page,
    Part,
    Section,
    Sentence,
    Verdict,
    joined,
)
from mcnav.report.document.table import Cell, Column, Table
from mcnav.report.figures import identify as drawn
from mcnav.report.format import number, probability
from mcnav.report.names import humanize
from mcnav.report.pages.screen import RESULTS, answered
from mcnav.report.results.identified import (
    AxisReport,
    CampaignSigmas,
    GradeRow,
    IdentificationReport,
    LogFacts,
    ParameterRow,
    SigmaRow,
)
from mcnav.report.statements.words import several

RATES: Final = {"gyro": "deg/h", "accelerometer": "ug"}
"""Shown units of readings."""

CAMPAIGN_NOTES: Final = (
    "The interval follows from those of the identified values alone. What the logs do not show is the campaign's: "
    "constant biases, scale factors, misalignments, initial errors and sensors.",
    "Not included: differences between this unit at rest and any other one, in motion, or at other temperatures. "
    "Nor are departures from linear analysis: mcnav run tests them.",
)

TEST_NOTE: Final = (
    "The test of fit looks for spectral lines, a trend, unsteadiness and another shape of the spectrum at once. It "
    "rejects about five of a hundred records whose model is right. A model that is not rejected may still be wrong "
    "where the record is too short to tell."
)

KINDS: Final = 2
"""Kinds of processes that a sentence names."""

NOTICED: Final = 2
"""Remarks that the terminal shows in brief."""

FAINT: Final = 0.1
"""Share of the white noise's variance from which rounding to the resolution is said to matter."""

COARSE: Final = 0.5
"""Standard deviation of the readings, in steps of their lattice, below which rounding is not white noise."""


def hours_words(hours: float | None) -> str:
    """Say how long a log would have to be.

    >>> hours_words(12.345), hours_words(np.inf), hours_words(None)
    ('record at least 12.3 h', 'no log of ten years would show it', '')
    """
    if hours is None:
        return ""
    return (
        f"record at least {duration_words(3600.0 * hours)}"
        if np.isfinite(hours)
        else ("no log of ten years would show it")
    )


def duration_words(seconds: float) -> str:
    """Write a duration with three digits in s, min or h.

    >>> duration_words(31.2336), duration_words(2164.0), duration_words(3600.0 * 25)
    ('31.2 s', '36.1 min', '25 h')
    """
    if seconds < 120.0:
        return f"{seconds:.3g} s"
    return f"{seconds / 60.0:.3g} min" if seconds < 7200.0 else f"{seconds / 3600.0:.3g} h"


def statement_words(row: ParameterRow) -> str:
    """Say what is known of a parameter, in plain letters for a comment."""
    low, high = row.low * row.factor, row.high * row.factor
    if row.value is not None:
        return f"{low:.4g} to {high:.4g} {row.shown_in}"
    below = f"below {high:.4g} {row.shown_in}" if np.isfinite(row.high) else ""
    above = f"above {low:.4g} {row.shown_in}" if row.low > 0.0 else ""
    return "; ".join(filter(None, ("not identifiable from this record", above, below, hours_words(row.hours_wanted))))


def page(report: IdentificationReport) -> Page:
    """Return the page."""
    sections = [Section("values", "Values", [parameter_table(report), *_grade_parts(report)])]
    if report.sigmas is not None:
        sections.append(Section("campaign", "Navigation errors that follow", _campaign_parts(report.sigmas)))
    noticed = list(remarks(report))
    parts: list[Part] = [model_table(report), Note(TEST_NOTE)]
    if noticed:
        parts += [Heading("What was noticed"), Listing(noticed)]
    sections.append(Section("models", "Models and tests of fit", parts))
    for instrument in report.instruments:
        axes = [axis for axis in report.axes if axis.instrument == instrument]
        figures = [drawn.allan(instrument, axes), drawn.spectrum(instrument, axes)]
        sections.append(Section(instrument, f"Noise of the {instrument}", figures))
    sections.append(Section("imu", "To paste into a campaign", [Lines(report.imu, "Table [imu]")]))
    names = ", ".join(log.name.rpartition("/")[2] for log in report.logs)
    return answered(
        Page(
            f"{names}: noise",
            "Identification from logs at rest",
            names,
            [*_head(report), *joined(_grades_in_brief(report), _fitted_part(report))],
            sections,
        ),
        rest=RESULTS,
    )


def terminal(report: IdentificationReport, full: bool = True) -> list[Part]:
    """List what the terminal shows: everything, or what fits a screen."""
    if not full:
        return _in_brief(report)
    parts: list[Part] = [*_head(report), parameter_table(report), model_table(report)]
    parts += [Sentence(""), *(Sentence(remark, "undecided") for remark in remarks(report))]
    parts += _grade_parts(report)
    if report.sigmas is not None:
        parts += _campaign_parts(report.sigmas)
    return [*parts, Lines(report.imu, "Table [imu]")]


def _in_brief(report: IdentificationReport) -> list[Part]:
    """List the estimates, a row for each value with its axes beside each other, models, errors that follow, remarks."""
    rows: dict[tuple[str, str, str], dict[str, ParameterRow]] = {}
    for row in sorted((row for row in report.parameters if row.stated), key=lambda row: _place(report, row)):
        rows.setdefault((row.instrument, row.key, row.shown_in), {})[row.axis] = row
    axes = list(dict.fromkeys(row.axis for row in report.parameters))

    def of_axis(axis: str) -> Column[tuple[str, str, str]]:
        return Column(axis, lambda key: _estimate(rows[key][axis]) if axis in rows[key] else "–")

    columns: list[Column[tuple[str, str, str]]] = [
        Column("Value", lambda key: key[1], "value", "label"), *map(of_axis, axes),
        Column("Unit", lambda key: key[2], "unit", "label"),
    ]  # fmt: skip
    models: dict[str, list[str]] = {}
    for axis in report.axes:
        models.setdefault(str(axis.fitted.chosen.model), []).append(axis.name)
    said = [f"Model of {_axes_words(names)}: {words}." for words, names in models.items()]
    noticed = list(remarks(report))
    left = len(noticed) - NOTICED
    more = f"{left} more remark{'s' * (left > 1)}, i" if left > 0 else "I"
    return [
        *_head(report), Table("", columns, list(rows), "Noise; < is an upper bound", group=lambda key: key[0]),
        *map(Sentence, said), *(Sentence(remark, "undecided") for remark in noticed[:NOTICED]),
        *([_sigma_table(report.sigmas)] if report.sigmas is not None else []),
        Note(f"{more}ntervals, tests, table [imu]: --full. Files: --out FOLDER."),
    ]  # fmt: skip


def _estimate(row: ParameterRow) -> str:
    if row.value is not None:
        return number(row.value * row.factor, 3)
    return f"< {number(row.high * row.factor, 3)}" if np.isfinite(row.high) else "–"


def _axes_words(names: Sequence[str]) -> str:
    """Name axes of instruments, each instrument once.

    >>> _axes_words(["gyro x", "gyro y", "accelerometer z"])
    'gyro x, y, accelerometer z'
    """
    words, last = list[str](), ""
    for name in names:
        instrument, _, axis = name.rpartition(" ")
        words.append(axis if instrument == last else name)
        last = instrument
    return ", ".join(words)


def _head(report: IdentificationReport) -> list[Part]:
    """Say whether the models fit, and of what logs."""
    rejected = [axis.name for axis in report.axes if any(test.rejected for test in axis.goodness)]
    names = _names(report)
    logs = [f"{names[log.name]}: {_length(log)}." for log in report.logs]
    if rejected:
        said = ["Treat the values of these axes as rough.", *logs]
        return [Verdict(f"The model does not fit the readings of {_axes_words(rejected)}.", "differs", said)]
    return [Verdict("The models fit the readings of all axes.", "agrees", logs)]


def _fitted_part(report: IdentificationReport) -> Facts | None:
    """Say why the curve of the first axis, which is drawn beside, may leave the points; none where nothing is known."""
    axis = report.axes[0]
    return Facts([(axis.name, "; ".join(axis.limits))], below=True) if axis.limits else None


def _grades_in_brief(report: IdentificationReport) -> Facts | None:
    """Name the values that have a grade of the catalogue, with the nearest; none without any."""
    rows = [
        (f"{row.instrument} {humanize(row.key)}", f"{number(row.value, 3)} {row.unit}, nearest grade: {row.nearest}")
        for row in report.grades
    ]
    return Facts(rows, below=True) if rows else None


def _names(report: IdentificationReport) -> dict[str, str]:
    """Return the names of the logs without their folders, unless two would be the same."""
    short = {log.name: log.name.rpartition("/")[2] for log in report.logs}
    return short if len(set(short.values())) == len(short) else {name: name for name in short}


def _length(log: LogFacts) -> str:
    return f"{duration_words(log.duration)}, {log.readings:,} readings, one every {log.interval:.3g} s"


def parameter_table(report: IdentificationReport) -> Table[ParameterRow]:
    """Tabulate the parameters of all axes."""
    columns: list[Column[ParameterRow]] = [
        Column("Value", lambda row: row.key, "value", "label"),
        Column("Axis", lambda row: row.axis, "axis", "label"),
        Column("Estimate", lambda row: None if row.value is None else row.value * row.factor, "estimate"),
        Column("95 % interval", _interval, "95 % interval", "label"),
        Column("Unit", lambda row: row.shown_in, "unit", "label"),
        Column("Otherwise", _otherwise, "not identifiable from this record", "words"),
    ]
    rows = sorted((row for row in report.parameters if row.stated), key=lambda row: _place(report, row))
    caption = (
        "By maximum likelihood; 95 % intervals by its profile. Upper bounds of values that are not identifiable hold "
        "with 97.5 %. A log of the length shown would give a value at this bound to 20 %."
    )
    return Table(caption, columns, rows, "Noise", keys=2, group=lambda row: row.instrument)


def _place(report: IdentificationReport, row: ParameterRow) -> tuple[int, int]:
    keys = list(
        dict.fromkeys(parameter.key for parameter in report.parameters if parameter.instrument == row.instrument)
    )
    return list(report.instruments).index(row.instrument), keys.index(row.key)


def _interval(row: ParameterRow) -> str:
    low, high = number(row.low * row.factor), number(row.high * row.factor)
    if row.value is not None:
        return f"{low} to {high}"
    if np.isfinite(row.high):
        return f"{low} to {high}" if row.low > 0.0 else f"below {high}"
    return f"above {low}" if row.low > 0.0 else "–"


def _otherwise(row: ParameterRow) -> str:
    return "" if row.value is not None else hours_words(row.hours_wanted)


def model_table(report: IdentificationReport) -> Table[AxisReport]:
    """Tabulate the models that were chosen, and the tests of fit."""
    several = len(report.logs) > 1
    columns: list[Column[AxisReport]] = [
        Column("Axis", lambda axis: axis.name, "axis", "label"),
        Column("Model", lambda axis: str(axis.fitted.chosen.model), "model", "words"),
        Column("Next model", lambda axis: str(axis.fitted.candidates[1].model), "next model", "words", spare=2),
        Column("Margin", lambda axis: axis.fitted.margin, "margin", form=lambda value: number(value, 3)),
        Column("Test of fit", _fit, "fit", "label"),
        Column("p", lambda axis: probability(min(test.p for test in axis.goodness)), "p"),
    ]
    if several:
        columns.append(Column("Logs agree, p", lambda axis: probability(axis.agreement or 0.0), "logs agree, p"))
        columns.append(Column("Mean from log to log", _repeated, "mean from log to log, 1σ", "label"))
    else:
        columns.append(Column("Mean", _mean, "mean", "label"))
    caption = (
        "Margin: by how much −2 log L with the price of the processes is larger for the next model. Quantization and a "
        f"first slow process cost {PENALTY:g}, a second one {BESIDE:g}, a correlation time {TIMED:g}. Below {CLOSE:g} "
        "a margin tells little."
    )
    return Table(caption, columns, report.axes, "Models")


def _fit(axis: AxisReport) -> Cell:
    worst = min(axis.goodness, key=lambda test: test.p)
    return Cell(worst.worst.name, tone="differs") if worst.rejected else Cell("fits", tone="agrees")


def _mean(axis: AxisReport) -> str:
    unit = RATES[axis.instrument]
    return f"{number(float(axis.means[0]) * conversion(axis.unit, unit), 5)} {unit}"


def _repeated(axis: AxisReport) -> str:
    spread, unit = axis.repeatability, RATES[axis.instrument]
    if spread is None:
        return "–"
    value, low, high = (
        number(bound * conversion(axis.unit, unit)) for bound in (spread.value, spread.low, spread.high)
    )
    return f"{value} ({low} to {high}) {unit}"


def remarks(report: IdentificationReport) -> Iterator[str]:
    """List what was noticed of logs, readings and models."""
    notes, short = dict[str, list[str]](), _names(report)
    for log in report.logs:
        for note in log.notes:
            notes.setdefault(note, []).append(short[log.name])
    alone = len(report.logs) == 1
    yield from (note if alone else f"{', '.join(names)}: {note}" for note, names in notes.items())
    yield from report.notes
    yield from _all_departures(report)
    for axis in report.axes:
        yield from (f"{axis.name}: {sentence}" for sentence in _of_resolution(axis))
        if axis.fitted.rivals:
            yield f"{axis.name}: the logs cannot tell {' or '.join(axis.fitted.ambiguities)}"
        if axis.agreement is not None and axis.agreement < 0.05:
            yield (
                f"{axis.name}: the logs do not agree (p = {probability(axis.agreement)}): the noise in common and its "
                "interval are of none of them"
            )


def _all_departures(report: IdentificationReport) -> Iterator[str]:
    """Describe how the records of all axes depart from their models."""
    for axis in report.axes:
        for place, goodness in enumerate(axis.goodness):
            where = axis.name if len(axis.goodness) == 1 else f"{axis.name} in {report.logs[place].name}"
            yield from (f"{where}: {departure}" for departure in _departures(axis, goodness))


def _departures(axis: AxisReport, goodness: Goodness) -> Iterator[str]:
    """Describe how a record departs from its model, where the test of fit rejects it."""
    if not goodness.rejected:
        return
    for finding in goodness.findings:
        if finding.p < SINGLE:
            yield f"{_finding(axis, finding)} (p = {probability(finding.p)})"


def _finding(axis: AxisReport, finding: Finding) -> str:
    if finding.name == "line":
        return f"a spectral line at {finding.at:.4g} Hz"
    if finding.name == "trend":
        unit = RATES[axis.instrument]
        slope = finding.at * conversion(axis.unit, unit) * 3600.0
        return f"the readings drift by {number(slope, 3)} {unit} in an hour, as with temperature"
    if finding.name == "shape":
        return f"the spectrum has another shape than the model, most about {finding.at:.3g} Hz"
    return (
        f"the noise is not the same all the time, most about {finding.at:.4g} s: motion, or readings that stand still"
    )


def _of_resolution(axis: AxisReport) -> Iterator[str]:
    """Say on what lattice readings lie, and what rounding to it does."""
    step = axis.resolution
    if step is None:
        return
    shown = f"{number(step * conversion(axis.unit, RATES[axis.instrument]), 3)} {RATES[axis.instrument]}"
    own = {estimate.name: estimate.value for estimate in axis.fitted.estimates}
    counted = own.get("quantization", 0.0) * np.sqrt(12.0) / axis.interval
    if abs(counted / step - 1.0) < 0.2:
        yield f"resolution {shown}: an accumulated value that is counted in steps of {step * axis.interval:.4g} (SI)"
        return
    sigma = own["random_walk"] / np.sqrt(axis.interval)
    share = step**2 / 12.0 / sigma**2
    if sigma < COARSE * step:
        yield f"resolution {shown}, coarser than the noise: what the model says of fast noise is that of rounding"
        return
    unit = RATES[axis.instrument]
    added = number(step / np.sqrt(12.0) * conversion(axis.unit, unit), 3)
    words = ", which is part of what is stated" if share > FAINT else ""
    yield (
        f"resolution {shown}: rounding adds {added} {unit} to a reading, {100.0 * share:.2g} % of the variance of the "
        f"white noise{words}"
    )


def _grade_parts(report: IdentificationReport) -> list[Part]:
    """Place the values between the grades of the catalogue."""
    if not report.grades:
        return []
    columns: list[Column[GradeRow]] = [
        Column("Value", lambda row: f"{row.instrument} {row.key}", "value", "label"),
        Column("Mean of the axes", lambda row: Cell(number(row.value), row.unit), "mean of the axes"),
        Column("Between", _between, "between", "words"),
        Column("Nearest", lambda row: row.nearest, "nearest", "label"),
    ]
    return [
        Table("Grades of the catalogue (mcnav docs imu) around the identified values.", columns, report.grades, "Grade")
    ]


def _between(row: GradeRow) -> str:
    if row.finer and row.coarser:
        return f"{row.finer} and {row.coarser}"
    return f"coarser than {row.finer}" if row.finer else f"finer than {row.coarser}"


def _sigma_table(sigmas: CampaignSigmas) -> Table[SigmaRow]:
    """Tabulate the navigation errors that follow."""
    columns: list[Column[SigmaRow]] = [
        Column("Output", lambda row: Cell(humanize(row.output), row.unit), "output", "label"),
        Column("By the campaign", lambda row: row.own, "the campaign's σ"),
        Column("By the logs", lambda row: row.sigma, "by the logs"),
        Column("95 % interval", lambda row: f"{number(row.low)} to {number(row.high)}", "95 % interval", "label"),
        *([Column[SigmaRow]("At the bounds", lambda row: row.bounded, "at the bounds")] if sigmas.bounded else []),
    ]
    return Table(f"Final errors of {sigmas.campaign}, one sigma, by linear analysis.", columns, sigmas.rows,
                 f"Final errors of {sigmas.campaign}, 1σ")  # fmt: skip


def _campaign_parts(sigmas: CampaignSigmas) -> list[Part]:
    """Tabulate the navigation errors that follow, and say what they rest on."""
    words = [f"{len(sigmas.replaced)} values of [imu] are replaced by those of the logs"
             + (", also in what the filter believes of the instruments unless the campaign says otherwise"
                if sigmas.filtered else "") + "."]  # fmt: skip
    if sigmas.kept:
        words.append(f"Kept from the campaign, not identified by the logs: {_named(sigmas.kept)}.")
    if sigmas.bounded:
        words.append(f"At the bounds: with {_named(sigmas.bounded)} as large as the logs allow.")
    return [_sigma_table(sigmas), *map(Sentence, words), *map(Note, CAMPAIGN_NOTES)]


def _named(names: Sequence[str]) -> str:
    """Name processes, with the axes of each together.

    >>> _named(["gyro_rate_random_walk_x", "gyro_rate_random_walk_y"])
    'gyro rate random walk x, y'
    """
    axes = dict[str, list[str]]()
    for name in names:
        kind, _, axis = name.rpartition("_")
        axes.setdefault(kind, []).append(axis)
    return several([f"{humanize(kind)} {', '.join(axis)}" for kind, axis in axes.items()], KINDS)
