"""Start times as a page and as tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import pandas as pd
from markupsafe import Markup

from mcnav.analysis.comparison import Comparison, OutputComparison
from mcnav.contract.quantities import KINDS, Output, Source, end_words, kinds_of
from mcnav.linear.start_times import StartTimeStudy
from mcnav.physics.units import conversion
from mcnav.report.document.parts import Heading, Note, Page, Part, Section, Sentence, Verdict, joined
from mcnav.report.document.table import Cell, Column, Table, five_digits, label
from mcnav.report.figures import start_times as drawn
from mcnav.report.format import interval, number
from mcnav.report.names import humanize, labels_of, scale_of
from mcnav.report.pages.screen import answered
from mcnav.report.statements.details import NOT_DISTURBED, output_words
from mcnav.report.statements.start_times import answer, minutes

CONVENTIONS: Final = {
    "start": "The reference axes are aligned at each start.",
    "trajectory": "The reference axes are aligned {}.",
}

STARTS_TO_AN_EVENT: Final = (
    "Only starts up to {} are compared, because for a start at the end of the trajectory only the start errors remain."
)

ALL_STARTS: Final = (
    "All starts are compared. Shortly before the end little but the start errors remains: the best start depends on "
    "how these change with the start time ([start_times.errors])."
)

WEIGHTED: Final = (
    "Weighted: root sum square of the {}{}, each divided by its weight. The weight is that of the campaign, or the "
    "value for a start at the first point."
)

OF_KIND: Final = " of the {}"
"""Names of those sigmas, by the kind that a clock weighs."""

MOST_BESIDE: Final = 4
"""Outputs whose checks stand beside each other; those of more stand below each other."""


def table(study: StartTimeStudy, sources: Sequence[Source], outputs: Sequence[Output]) -> pd.DataFrame:
    """Tabulate all sigmas and partial derivatives by start time, with SI units in the column names."""
    columns = {"start [s]": study.times}
    for i, output in enumerate(outputs):
        columns[f"sigma {output.name} [{output.unit}]"] = study.sigma[:, i]
    columns["weighted sigma [1]" if study.means is None else "weighted rms [1]"] = study.weighted
    if study.means is not None:
        for i, output in enumerate(outputs):
            columns[f"mean error of {output.name} [{output.unit}]"] = study.means[:, i]
    if study.noise is not None:
        for i, output in enumerate(outputs):
            columns[f"sigma {output.name} from noise [{output.unit}]"] = study.noise[:, i]
    for i, output in enumerate(outputs):
        for j, source in enumerate(sources):
            unit = f"{output.unit} per {source.unit}"
            columns[f"d {output.name} / d {source.name} [{unit}]"] = study.partials[:, i, j]
    return pd.DataFrame(columns)


def check_table(checks: Mapping[float, Comparison], outputs: Sequence[Output]) -> pd.DataFrame:
    """Tabulate the Monte Carlo checks by start time and output, SI."""
    return pd.DataFrame([row for time, check in checks.items() for row in _check_rows(time, check, outputs)])


def _check_rows(time: float, comparison: Comparison, outputs: Sequence[Output]) -> list[Mapping[str, object]]:
    rows = list[Mapping[str, object]]()
    for output, result in zip(outputs, comparison.outputs, strict=False):
        low, high = result.paired.interval or (math.nan, math.nan)
        rows.append({
            "start [s]": time, "output": output.name, "unit": output.unit, "samples": comparison.samples,
            "failed": comparison.failed, "sigma linear": result.sigma_linear, "sigma paired": result.sigma_paired,
            "paired ratio": result.paired.ratio, "interval from": low, "interval to": high,
            "verdict": _verdict(result), "sigma plain": result.sigma_sample,
        })  # fmt: skip
    return rows


def _verdict(result: OutputComparison) -> str:
    return output_words(result.sigma_linear, result.paired.verdict.value)


def page(
    campaign: str,
    study: StartTimeStudy,
    checks: Mapping[float, Comparison],
    sources: Sequence[Source],
    outputs: Sequence[Output],
) -> Page:
    """Return the page; ``checks`` are Monte Carlo comparisons by start time, s."""
    scale, effects = scale_of(outputs), grouped_effects(study, sources, outputs)
    clock, words = study.clock, end_words(outputs)
    convention = clock.meaning or CONVENTIONS[study.axes].format(clock.aligned)
    compared = clock.compared or (STARTS_TO_AN_EVENT.format(clock.event) if clock.event else ALL_STARTS)
    kind = OF_KIND.format(clock.weighs.lower()) if clock.weighs else ""
    parts: list[Part] = [
        drawn.dispersion(study, checks, scale, outputs),
        _by_output(study, outputs) if clock.weighs else _best_table(study, outputs),
        Note(f"{compared} {WEIGHTED.format(_sizes(study), kind)}"),
    ]
    if checks:
        parts += [Heading("Monte Carlo checks"), _check_table(study, checks, outputs)]
    sections = [Section("when", "Best start", parts)]
    for i, output in enumerate(outputs):
        if clock.weighs and not study.weights[i]:
            continue
        figure = drawn.effects(study, i, float(scale[i]), effects, output)
        title = f"Partials of {humanize(output.name)}"
        sections.append(Section(f"partials-{i + 1}", title, joined(figure)))
    head: list[Part] = [
        Verdict(answer(study, checks, outputs)),
        Sentence(f"{words.title} as functions of the start of navigation. {convention}"),
    ]
    whole = Page(f"{campaign}: start times", "Start of navigation", campaign, head, sections)
    return answered(whole, drawn.weighted(study, checks, outputs))


def _best_table(study: StartTimeStudy, outputs: Sequence[Output]) -> Table[tuple[str, int]]:
    """Tabulate the best starts, and the dispersion of all outputs for them."""
    scale = scale_of(outputs)
    places = {humanize(output.name): int(study.best[i]) for i, output in enumerate(outputs)}
    places |= {"all, weighted": study.best_weighted, "(start at the first point)": 0}

    def of_output(i: int) -> Column[tuple[str, int]]:
        output = outputs[i]
        return Column(humanize(output.name), lambda row: float(study.rms[row[1], i] * scale[i]), unit=output.shown_in)

    columns: list[Column[tuple[str, int]]] = [
        Column("Best for", lambda row: row[0], kind="label"),
        Column(f"Start, {study.clock.label}", lambda row: minutes(study.times[row[1]])),
        *map(of_output, range(len(outputs))),
    ]
    what, size = ("root mean square", "") if study.means_matter else ("dispersion", " (1σ)")
    caption = (
        f"Start with the smallest {what} for each output and for the weighted outputs, by linear analysis. Then the "
        f"{what}{size} of every output for that start."
    )
    return Table(caption, columns, list(places.items()))


def _by_output(study: StartTimeStudy, outputs: Sequence[Output]) -> Table[int]:
    """Tabulate for each output, a row each, its best start and its dispersion for that and others."""
    scale, kinds = scale_of(outputs), kinds_of(outputs)

    def sigma(heading: str, place: Callable[[int], int]) -> Column[int]:
        return Column(heading, lambda i: float(study.rms[place(i), i] * scale[i]), form=five_digits)

    one = "rms" if study.means_matter else "1σ"
    columns: list[Column[int]] = [
        Column("Output", lambda i: Cell(humanize(outputs[i].name), outputs[i].shown_in), kind="label"),
        Column(f"Best start, {study.clock.label}", lambda i: minutes(study.times[study.best[i]])),
        sigma(f"{one} then", lambda i: int(study.best[i])),
        sigma(f"{one} for {minutes(study.times[study.best_weighted])}, best weighted", lambda i: study.best_weighted),
        sigma(f"{one} for a start with the flight", lambda i: 0),
    ]
    what = "root mean square" if study.means_matter else "dispersion"
    caption = f"Start with the smallest {what} for each output, by linear analysis, and the {what} for others."
    rows = sorted(np.flatnonzero(study.rms.any(axis=0)).tolist(), key=lambda i: KINDS.index(kinds[i]))
    return Table(caption, columns, rows, group=lambda i: kinds[i])


def _sizes(study: StartTimeStudy) -> str:
    return "root mean squares" if study.means_matter else "sigmas"


@dataclass(frozen=True)
class _Checked:
    """Check of one output at a start, in the unit shown."""

    output: Output
    result: OutputComparison

    @property
    def sigmas(self) -> tuple[str, str]:
        """Linear sigma and paired estimate."""
        scale = conversion(self.output.unit, self.output.shown_in)
        return number(self.result.sigma_linear * scale), number(self.result.sigma_paired * scale)

    @property
    def ends(self) -> str:
        """Interval of the ratio."""
        return interval(*(self.result.paired.interval or (math.nan, math.nan)))

    @property
    def verdict(self) -> Cell:
        """Verdict as a label."""
        words = _verdict(self.result)
        return Cell(words, tone=None if words == NOT_DISTURBED else words)


Check = tuple[float, Comparison, int]
"""A start, its check, and the number of the output."""


def _check_table(study: StartTimeStudy, checks: Mapping[float, Comparison], outputs: Sequence[Output]) -> Table[Check]:
    """Tabulate the Monte Carlo checks: an output a column, or a row each where there are many."""
    samples = max((comparison.samples for comparison in checks.values()), default=0)
    caption = f"Linear σ, Monte Carlo σ (paired, {samples:,} samples at each start) and their ratio with its interval."

    def checked(row: Check, i: int) -> _Checked | None:
        results = row[1].outputs
        return _Checked(outputs[i], results[i]) if i < len(results) else None

    def start(row: Check) -> Cell:
        return Cell(minutes(row[0]), below=f"{row[1].failed} failed" if row[1].failed else "")

    def of_output(i: int) -> Column[Check]:
        def content(row: Check) -> Cell:
            checked_start = checked(row, i)
            return Cell() if checked_start is None else _all_of(checked_start)

        return Column(humanize(outputs[i].name), content, unit=outputs[i].shown_in)

    def single(heading: str, content: Callable[[_Checked], Cell | str]) -> Column[Check]:
        def cell(row: Check) -> Cell | str:
            checked_start = checked(row, row[2])
            return "" if checked_start is None else content(checked_start)

        return Column(heading, cell)

    columns = [Column(f"Start, {study.clock.label}", start, kind="label")]
    if len(outputs) <= MOST_BESIDE:
        columns += map(of_output, range(len(outputs)))
        return Table(caption, columns, [(time, check, 0) for time, check in checks.items()])
    columns += [
        single("Output", lambda row: Cell(humanize(row.output.name), row.output.shown_in)),
        single("Linear σ", lambda row: row.sigmas[0]),
        single("Paired σ", lambda row: row.sigmas[1]),
        single("Ratio", lambda row: number(row.result.paired.ratio)),
        single("Interval", lambda row: row.ends),
        single("Verdict", lambda row: row.verdict),
    ]
    rows = [(time, check, i) for time, check in checks.items() for i in range(len(check.outputs))]
    return Table(caption, columns, rows)


def _all_of(checked_start: _Checked) -> Cell:
    """Write a check in one cell: both sigmas, and below them the ratio with its interval and the verdict."""
    ratio = number(checked_start.result.paired.ratio) + (
        f" ({checked_start.ends})" if checked_start.ends != "–" else ""
    )
    verdict = checked_start.verdict
    words = verdict.text if verdict.tone is None else label(verdict.text, verdict.tone)
    return Cell(" | ".join(checked_start.sigmas), below=Markup("{}<br>{}").format(ratio, words))


def grouped_effects(study: StartTimeStudy, sources: Sequence[Source], outputs: Sequence[Output]) -> list[drawn.Effects]:
    """Return the effects of each source, or of each group of sources, as a root sum square, and of the noise."""
    if not any(source.group for source in sources):
        initial = {output.name for output in outputs}
        return [
            drawn.Effects(label, study.effects[:, :, j], source.name in initial)
            for j, (source, label) in enumerate(zip(sources, labels_of(sources, outputs), strict=True))
        ]
    members: dict[str, list[int]] = {}
    for j, source in enumerate(sources):
        members.setdefault(source.group or source.name, []).append(j)
    initial = {source.group or source.name for source in sources if source.name in {output.name for output in outputs}}
    names = list(members)
    labels = [f"initial {humanize(name)}" if name in initial else humanize(name) for name in names]
    sizes = [np.sqrt((study.effects[:, :, members[name]] ** 2).sum(axis=2)) for name in names]
    effects = [
        drawn.Effects(label, size, name in initial, combined=True)
        for name, label, size in zip(names, labels, sizes, strict=True)
    ]
    effects = [effect for effect in effects if effect.sizes.any()] or effects
    return effects if study.noise is None else [*effects, drawn.Effects("noise", study.noise, False, combined=True)]
