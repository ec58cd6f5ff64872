"""Kinds of filters compared, as a page, a table of the terminal, a data frame and ``filters.json``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import pandas as pd

from mcnav.analysis.filter_kinds import HEADING, HORIZONTAL, KindComparison, KindResult
from mcnav.report.document.parts import Facts, Findings, Note, Page, Part, Section, Sentence, Verdict, Verdicts
from mcnav.report.document.table import Cell, Column, Table
from mcnav.report.drawing.figure import HALF, Figure, side_by_side
from mcnav.report.drawing.marks import Axis, Band, Interval, Line, Mark, Panel, Points, Rule, Series, Span
from mcnav.report.drawing.palette import FLOWN, INK
from mcnav.report.figures.agreement import TOLERANCE
from mcnav.report.format import number
from mcnav.report.names import humanize
from mcnav.report.pages.screen import answered
from mcnav.report.statements.means import mean_sentence
from mcnav.report.statements.sweep import shown
from mcnav.report.statements.words import TONES, WORST, joined

GROUPS: Final = ("navigation", "position", "velocity", "attitude")
"""Groups of errors in the data."""

NOTES: Final = (
    "Every kind has the same initial errors, sensor errors and noise. The ratio is true sigma ÷ filter sigma where the "
    "verdict is decided, over the whole flight.",
    "Its interval is that of all epochs together. NEES and sigmas are those at the end. Horizontal position is DRMS, "
    "the root of the sum of two variances.",
    "To first order all kinds are one filter: linear analysis has one answer. What a sample takes is its computing "
    "time on one thread.",
)


def terminal(comparison: KindComparison) -> list[Part]:
    """List what the terminal shows."""
    return [*_mean_errors(comparison), _verdict(comparison), kind_table(comparison)]


def page(comparison: KindComparison) -> Page:
    """Return the page."""
    facts = Facts([("kinds", ", ".join(comparison.kinds)), *(
        [] if comparison.variable is None else
        [(comparison.variable.path, ", ".join(shown(comparison.variable, at) for at in comparison.variable.values))]
    ), ("samples", ", ".join(sorted({f"{result.summary.samples:,}" for result in comparison.results})))])  # fmt: skip
    varied = comparison.variable is not None and not comparison.variable.words
    figure = over_values(comparison) if varied else kind_ratios(comparison)
    sections = [Section("kinds", "Kinds of filters", [figure, kind_table(comparison), facts, *map(Note, NOTES)])]
    head: list[Part] = [*_mean_errors(comparison), Verdicts([_verdict(comparison)]), *_accuracy_and_cost(comparison)]
    return answered(
        Page(f"{comparison.campaign}: filters", "Kinds of filters", comparison.campaign, head, sections), rest="Filter"
    )


def _accuracy_and_cost(comparison: KindComparison) -> list[Part]:
    """List what each kind gives and takes, the worst verdict first; nothing where a key is varied."""
    if comparison.variable is not None:
        return []
    rows = []
    for result in sorted(comparison.results, key=_standing):
        drms, cost = number(result.sigmas(HORIZONTAL)[0], 3), number(result.milliseconds, 2)
        tone = TONES.get(result.verdict, "undecided")
        rows.append((result.verdict, tone, f"{result.kind}: {drms} m DRMS, {cost} ms a sample"))
    return [Findings(rows, name="Kinds")]


def _mean_errors(comparison: KindComparison) -> list[Part]:
    """Say first in which runs mean errors exceed one sigma."""
    said = [(result, mean_sentence(result.summary)) for result in comparison.results]
    return [Sentence(f"{compared.kind} ({compared.folder}): {words}", "partly") for compared, words in said if words]


def _verdict(comparison: KindComparison) -> Verdict:
    """Say which kinds are consistent, or from which value on each is optimistic."""
    if comparison.variable is None:
        groups: dict[str, list[str]] = {}
        for result in sorted(comparison.results, key=_standing):
            groups.setdefault(result.verdict, []).append(result.kind)
        words = [f"{joined(kinds)} {'is' if len(kinds) == 1 else 'are'} {verdict}" for verdict, kinds in groups.items()]
        tones = {TONES.get(result.verdict, "undecided") for result in comparison.results}
        said = [*_worst_ratio(comparison), *_more(comparison)]
        return Verdict(f"{'; '.join(words)}.", max(tones, key=WORST.index), said)
    words = []
    for kind, begin in comparison.optimistic_from.items():
        at = None if begin is None else shown(comparison.variable, begin)
        words.append(f"{kind}: {'nowhere certainly optimistic' if at is None else f'optimistic from {at} on'}")
    said = [*_worst_ratio(comparison), *_more(comparison)]
    return Verdict(f"Over {comparison.variable.path}: {'; '.join(words)}.", "", said)


def _standing(result: KindResult) -> int:
    """Return the place of a verdict among all, the worst first."""
    return WORST.index(TONES.get(result.verdict, "undecided"))


def _worst_ratio(comparison: KindComparison) -> list[str]:
    """Say how far off the covariance of the most optimistic kind is; nothing where none is optimistic."""
    known = [(result.factor[0], result) for result in comparison.results if result.factor is not None]
    wrong = [(ratio, result) for ratio, result in known if TONES.get(result.verdict) == "differs"]
    if not wrong:
        return []
    ratio, worst = max(wrong, key=lambda pair: pair[0])
    of, (low, high) = humanize(worst.decided_by), (worst.factor or (ratio,) * 3)[1:]
    ends = f" ({number(low, 2)} to {number(high, 2)})" if math.isfinite(low) and math.isfinite(high) else ""
    samples = f"{worst.summary.samples:,} samples"
    return [f"Worst: {of} errors of {worst.kind} are {number(ratio, 2)} times what it computes{ends}, by {samples}."]


def _more(comparison: KindComparison) -> list[str]:
    """Say that more samples may decide, where a kind is undecided."""
    few = [result.summary.samples for result in comparison.results if result.verdict == "undecided"]
    return [f"{min(few):,} samples do not decide: run more with --samples."] if few else []


def kind_table(comparison: KindComparison) -> Table[KindResult]:
    """Tabulate the kinds: verdict, sigma, NEES, cost."""
    variable = comparison.variable
    columns: list[Column[KindResult]] = [
        Column("Kind", lambda row: row.kind, kind="label"),
        Column("Verdict", lambda row: Cell(row.verdict, tone=TONES.get(row.verdict)), kind="text"),
        Column("True σ / filter σ", _factor, "true / filter"),
        Column("Decided by", lambda row: humanize(row.decided_by), kind="words", spare=3),
        Column("NEES / 9 at the end", _nees, "NEES / 9"),
        Column("Horizontal position, true DRMS (filter's)", lambda row: _sigmas(row, HORIZONTAL, 1.0),
               "horizontal DRMS", unit="m"),
        Column("Heading, true σ (filter's)", lambda row: _sigmas(row, (HEADING,), math.degrees(1.0)), "heading σ",
               unit="deg", spare=1),
        Column("Failed", lambda row: f"{row.summary.failed:,}", spare=4),
        Column("A sample takes", lambda row: number(row.milliseconds, 2),
               "cost", unit="ms", spare=2),
    ]  # fmt: skip
    if variable is not None:
        columns.insert(0, Column(variable.path, lambda row: shown(variable, float(row.value or 0.0)), kind="label"))
    return Table("Kinds of filters by Monte Carlo.", columns, comparison.results)


def _factor(kind_result: KindResult) -> str:
    known = kind_result.factor
    if known is None:
        return "–"
    return f"{number(known[0], 3)} ({number(known[1], 3)} to {number(known[2], 3)})"


def _nees(kind_result: KindResult) -> str:
    group = kind_result.group("navigation")
    if group is None or group.nees_mean is None:
        return "–"
    ends = ["–" if end is None else number(end / group.size, 3) for end in group.nees_interval or (None, None)]
    return f"{number(group.nees_mean / group.size, 3)} ({' to '.join(ends)})"


def _sigmas(kind_result: KindResult, names: tuple[str, ...], scale: float) -> str:
    true, own = kind_result.sigmas(names)
    return f"{number(true * scale, 3)} ({number(own * scale, 3)})"


RATIO: Final = Series("flown", "Monte Carlo, with its interval", FLOWN, "dot")


def kind_ratios(comparison: KindComparison) -> Figure:
    """Draw the ratio of true to filter sigma with its interval, a row for each kind, against the tolerance."""
    results = comparison.results
    names = [
        result.kind if comparison.variable is None or result.value is None
        else f"{result.kind}, {shown(comparison.variable, result.value)}"
        for result in results
    ]  # fmt: skip
    factors = np.array([result.factor or (math.nan,) * 3 for result in results], dtype=float).reshape(-1, 3)
    marks: list[Mark] = [*_consistent(comparison, level=False)]
    for place in np.flatnonzero(np.isfinite(factors[:, 0])).tolist():
        ratio, low, high = factors[place].tolist()
        ends = (ratio if math.isnan(low) else low, ratio if math.isnan(high) else high)
        text = f"{names[place]}: {number(ratio, 3)} ({number(low, 3)} to {number(high, 3)})"
        marks += [Interval(RATIO, place, *ends, text), Points(RATIO, [ratio], [place], 7.5, texts=[text])]
    return Figure(
        name="filters",
        title="True over filter sigma",
        description="Ratio of true to filter sigma where the verdict is decided, with its interval, by kind.",
        panels=[Panel("", Axis("true σ / filter σ", log=True), Axis(names=names), marks)],
        key=[RATIO, TOLERANCE],
        columns={"kind": names, "ratio": factors[:, 0], "from": factors[:, 1], "to": factors[:, 2]},
        size=(HALF[0], 82.0 + 30.0 * len(names)),
        file="filters.csv",
    )


def _consistent(comparison: KindComparison, level: bool) -> list[Mark]:
    """Return the line of a consistent filter, and the band of the tolerance where it is known."""
    known = {result.summary.filter.tolerance for result in comparison.results if result.summary.filter is not None}
    tolerance = next((one for one in known if one), None)
    band = [] if tolerance is None else [Span(TOLERANCE, 1.0 - tolerance, 1.0 + tolerance, level=level)]
    return [*band, Rule(1.0, level=level, colour=INK)]


def over_values(comparison: KindComparison) -> Figure:
    """Draw the ratio of true to filter sigma by value, a panel for each kind."""
    variable = comparison.variable
    assert variable is not None
    axis = Axis(variable.path, variable.unit, log=variable.log, link=variable.path)
    panels, columns = [], {variable.label: variable.values}
    for kind in comparison.kinds:
        factors = np.array([result.factor or (math.nan,) * 3 for result in comparison.of(kind)], dtype=float)
        ratio, low, high = factors.reshape(-1, 3).T
        marks: list[Mark] = [
            *_consistent(comparison, level=True), Band(RATIO, variable.values, low, high, 0.25),
            Line(RATIO, variable.values, ratio), Points(RATIO, variable.values, ratio),
        ]  # fmt: skip
        panels.append(Panel(kind, axis, Axis("true σ / filter σ", log=True), marks))
        columns |= {kind: ratio, f"{kind}, from": low, f"{kind}, to": high}
    return Figure(
        name="filters",
        title="True over filter sigma",
        description=f"Ratio of true to filter sigma where the verdict is decided, by {variable.path} and kind.",
        panels=panels,
        key=[RATIO, TOLERANCE],
        columns=columns,
        size=side_by_side(len(panels)),
        file="filters.csv",
    )


def row(comparison: KindComparison, compared: KindResult) -> Mapping[str, Any]:
    """Return a result in data: angles in rad, lengths in m, times in s or minutes as their names say."""
    factor = compared.factor or (None, None, None)
    horizontal, heading = compared.sigmas(HORIZONTAL), compared.sigmas((HEADING,))
    data: dict[str, Any] = {} if comparison.variable is None else {comparison.variable.label: compared.value}
    data |= {
        "kind": compared.kind, "verdict": compared.verdict, "ratio": factor[0], "ratio_low": factor[1],
        "ratio_high": factor[2],
        "decided_by": compared.decided_by, "samples": compared.summary.samples, "failed": compared.summary.failed,
    }  # fmt: skip
    for name in GROUPS:
        group = compared.group(name)
        low, high = (None, None) if group is None or group.nees_interval is None else group.nees_interval
        data |= {
            f"nees_{name}": None if group is None else group.nees_mean, f"nees_{name}_low": low,
            f"nees_{name}_high": high, f"nees_{name}_expected": None if group is None else group.size,
        }  # fmt: skip
    data |= {
        "sigma_position_horizontal": horizontal[0], "own_sigma_position_horizontal": horizontal[1],
        "sigma_heading": heading[0], "own_sigma_heading": heading[1], "milliseconds": compared.milliseconds,
        "folder": compared.folder,
    }  # fmt: skip
    return data


def frame(comparison: KindComparison) -> pd.DataFrame:
    """Tabulate the results, a row each."""
    return pd.DataFrame([row(comparison, result) for result in comparison.results])


def table(comparison: KindComparison) -> Mapping[str, Any]:
    """Return the content of ``filters.json``."""
    return {
        "campaign": comparison.campaign,
        "kinds": list(comparison.kinds),
        "varied": None if comparison.variable is None else comparison.variable.path,
        "unit": None if comparison.variable is None else comparison.variable.unit,
        "optimistic_from": None if comparison.variable is None else dict(comparison.optimistic_from),
        "filters": [
            {name: None if isinstance(value, float) and not math.isfinite(value) else value
             for name, value in row(comparison, result).items()}
            for result in comparison.results
        ],
    }  # fmt: skip
