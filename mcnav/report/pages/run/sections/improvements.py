"""The section "Which number to improve": what the filter does not model, then each number finer, the best first."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from markupsafe import Markup

from mcnav.analysis.filter_causes import shares_by_kind
from mcnav.analysis.filter_consistency import cause_words
from mcnav.analysis.filter_remarks import instant
from mcnav.analysis.improvements import Departing, Improvement, improvements
from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.analysis.what_if import WhatIf
from mcnav.contract.quantities import Output
from mcnav.report.document.parts import Folded, Part, Section, Sentence, joined
from mcnav.report.document.table import CODE, Cell, Column, Table
from mcnav.report.format import number, rounded
from mcnav.report.names import humanize
from mcnav.store.manifest import Variable

if TYPE_CHECKING:
    from mcnav.report.results.model import RunAnalysis

SHOWN: Final = 6
"""Numbers that are not folded."""

SMALLEST: Final = 5e-4
"""Change of every sigma, and of the share of a limit, below which a number is left out."""

NAMED: Final = 1e-3
"""Share below which an error source that the filter does not model is left out."""

CAPTION: Final = (
    "Each spec alone, one grade of the catalogue finer, or half as large where there is no finer grade. Linear "
    "covariance{held}. {share}{limits}{effect}"
)
HELD: Final = " with the filter's gains as they are (mcnav allocate re-tunes the filter)"
LIMITS: Final = (
    "Limit used: largest share of its limit that a requirement uses{basis}. Now {now}; below 100 % all are met. "
)
EFFECT: Final = "Largest effect: the sigma at the end that changes most."
LINEAR: Final = " for linear normal errors"
MEASURED: Final = " (bound of the samples, scaled as linear covariance changes)"
SHARE: Final = "Share: of the number in the mean square of {}. "

UNMODELLED: Final = (
    "Error sources that the filter does not model, by their share in what it misses in {output} at {when}. Estimate or "
    "consider them: add them to a list below [filter]. mcnav brief answers such filters and simulates the best."
)
UNSIZED: Final = "No number of the file sizes {causes}: {share} of the mean square of {of}."


@dataclass(frozen=True)
class Failing:
    """What is to be improved.

    Attributes
    ----------
    unmodelled : mapping of str to float
        Kinds of errors that a filter does not model, and their shares, where the filter is optimistic.
    departing : Departing, optional
        Where it is the worst.
    when : str
        Its time in words.
    foremost : bool
        Whether numbers are ranked by that, because no requirement fails.
    """

    unmodelled: Mapping[str, float] = field(default_factory=dict)
    departing: Departing | None = None
    when: str = ""
    foremost: bool = False


def failing_in_run(content: RunAnalysis) -> Failing:
    """Return what a run finds to fail: its filter, unless a requirement fails."""
    summary = content.summary
    judged = summary.filter
    if judged is None or not judged.neglected or judged.neglected_at is None:
        return Failing()
    place = summary.names.index(judged.neglected_output or judged.output)
    unmodelled = shares_by_kind((entry.name, entry.share) for entry in judged.neglected)
    fails = any(entry.finding == "not met" for entry in summary.requirements)
    when = instant(judged.neglected_at, judged.time)
    return Failing(unmodelled, Departing(place, judged.neglected_at), when, not fails)


def failing_linearly(answer: LinearAnswer) -> Failing:
    """Return what linear analysis finds to fail: the filter unless a requirement does."""
    judged = answer.filter
    if judged is None or not judged.neglected or not judged.output:
        return Failing()
    place = next(i for i, output in enumerate(answer.outputs) if output.name == judged.output)
    unmodelled = shares_by_kind((cause.name, cause.share) for cause in judged.neglected)
    return Failing(unmodelled, Departing(place, judged.worst), instant(judged.worst, judged.label), answer.met)


@dataclass(frozen=True)
class _Row:
    improvement: Improvement
    before: float | None
    outputs: Sequence[Output | Variable]

    @property
    def effect(self) -> str:
        """The output whose sigma changes most, and by how much."""
        ratios = self.improvement.sigmas
        place = max(range(len(ratios)), key=lambda i: abs(ratios[i] - 1.0))
        return f"{humanize(self.outputs[place].name)} {_change(ratios[place])}"

    @property
    def matters(self) -> bool:
        """Return whether anything changes by more than rounding."""
        used = 0.0 if self.before is None or self.improvement.used is None else self.improvement.used - self.before
        departing = abs(self.improvement.departing - 1.0) >= SMALLEST
        return bool(departing or abs(used) >= SMALLEST or (abs(self.improvement.sigmas - 1.0) >= SMALLEST).any())


def improvements_section(
    what_if: WhatIf | None, outputs: Sequence[Output | Variable], failing: Failing
) -> Section | None:
    """Return the section; none where nothing can be improved to any effect."""
    if what_if is None:
        return None
    ranked = improvements(what_if, failing.departing if failing.foremost else None)
    rows = [row for row in (_Row(each, ranked.used, outputs) for each in ranked.listed) if row.matters]
    first = _unmodelled(what_if, outputs, failing)
    if not rows and first is None:
        return None
    of = _ranked_by(outputs, failing)
    unsized = None
    if what_if.unsized and ranked.unsized >= NAMED:
        causes = ", ".join(map(humanize, what_if.unsized))
        unsized = Sentence(UNSIZED.format(share=_percent(ranked.unsized), of=of, causes=causes))
    held = what_if.covariance.own is not None or bool(what_if.campaign.beliefs)
    basis = MEASURED if what_if.scales else LINEAR
    caption = CAPTION.format(
        held=HELD if held else "",
        share=SHARE.format(of) if _shared(rows) else "",
        effect="" if failing.foremost else EFFECT,
        limits="" if ranked.used is None else LIMITS.format(basis=basis, now=_percent(ranked.used)),
    )
    more: list[Part] = []
    if len(rows) > SHOWN + 1:
        more.append(Folded(f"All {len(rows)} numbers", [_table("", rows, ranked.used, outputs, failing)]))
        rows = rows[:SHOWN]
    table = _table(caption, rows, ranked.used, outputs, failing) if rows else None
    return Section("improve", "Which number to improve", [*joined(first, unsized, table), *more])


def remedy(what_if: WhatIf | None, outputs: Sequence[Output | Variable], failing: Failing) -> str:
    """Name the number whose improvement helps most against what fails, and its effect; empty where none does."""
    if what_if is None:
        return ""
    ranked = improvements(what_if, failing.departing if failing.foremost else None)
    row = next((row for row in (_Row(each, ranked.used, outputs) for each in ranked.listed) if row.matters), None)
    if row is None:
        return ""
    if not failing.foremost and (ranked.used is None or row.improvement.used is None):
        return ""
    if failing.departing is not None and failing.foremost:
        output = humanize(outputs[failing.departing.output].name)
        effect = f"σ of {output} {_change(row.improvement.departing)}"
    else:
        effect = f"{_percent(row.improvement.used)} of the limit used, {_percent(ranked.used)} now"
    size = _size(row, row.improvement.factor)
    return Markup('<a href="#improve">{}</a> at {}: {}').format(CODE(row.improvement.slider.path), size, effect)


def _ranked_by(outputs: Sequence[Output | Variable], failing: Failing) -> str:
    """Name what numbers are ranked by."""
    if failing.departing is None or not failing.foremost:
        return "what the tightest requirement limits"
    return f"the error of {humanize(outputs[failing.departing.output].name)} at {failing.when}"


def _unmodelled(
    what_if: WhatIf, outputs: Sequence[Output | Variable], failing: Failing
) -> Table[tuple[str, float]] | None:
    """Tabulate what the filter does not model, with what could be done about it."""
    kinds = [(kind, share) for kind, share in failing.unmodelled.items() if share >= NAMED]
    if not kinds or failing.departing is None:
        return None
    sized = _paths(what_if)

    def remedy(row: tuple[str, float]) -> str:
        kind = row[0]
        ways = [f'estimate it: "{kind}" in estimates' if kind in what_if.estimable else ""]
        ways += [f"a smaller {sized[kind]}" if kind in sized else ""]
        return ", or ".join(filter(None, ways)) or "no entry of the campaign file changes it"

    columns: list[Column[tuple[str, float]]] = [
        Column("Error source", lambda row: cause_words(row[0]), kind="words"),
        Column("Share", lambda row: _percent(row[1])),
        Column("What can be done", remedy, kind="words"),
    ]
    output = humanize(outputs[failing.departing.output].name)
    return Table(UNMODELLED.format(output=output, when=failing.when), columns, kinds)


def _paths(what_if: WhatIf) -> dict[str, str]:
    """Return the key of the number that sizes a kind of errors, by the end of the key."""
    paths = [slider.path for slider in what_if.campaign.sliders]
    return {"_".join(path.split(".")[1:]): path for path in paths}


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{rounded(100.0 * share)} %"


def _change(ratio: float) -> str:
    return f"{100.0 * (ratio - 1.0):+.1f} %".replace("-", "−")


def _shared(rows: Iterable[_Row]) -> bool:
    return any(not math.isnan(row.improvement.share) for row in rows)


def _size(row: _Row, factor: float) -> str:
    shown = row.improvement.slider.sizes[row.improvement.slider.shown]
    return f"{number(abs(shown.value) * factor, 3)} {shown.unit or ''}".rstrip()


def _table(
    caption: str, rows: Sequence[_Row], before: float | None, outputs: Sequence[Output | Variable], failing: Failing
) -> Table[_Row]:
    def below(row: _Row) -> str:
        finest = "half; no finer grade" if row.improvement.slider.grades else "half"
        return row.improvement.grade or finest

    share: list[Column[_Row]] = [Column("Share", lambda row: _percent(row.improvement.share), kind="label")]
    used: list[Column[_Row]] = [Column("Limit used then", lambda row: _percent(row.improvement.used), kind="label")]
    departing: list[Column[_Row]] = []
    if failing.departing is not None and failing.foremost:
        heading = f"σ of {humanize(outputs[failing.departing.output].name)} at {failing.when}"
        departing = [Column(heading, lambda row: _change(row.improvement.departing), kind="label")]
    effect: Column[_Row] = Column("Largest effect", lambda row: row.effect, kind="label")
    columns: list[Column[_Row]] = [
        Column("Number", lambda row: Cell(CODE(row.improvement.slider.path)), kind="words"),
        *(share if _shared(rows) else []),
        Column("Now", lambda row: _size(row, 1.0), kind="label"),
        Column("Improved to", lambda row: Cell(_size(row, row.improvement.factor), below=below(row)), kind="label"),
        *departing,
        *([] if before is None else used),
        *([] if departing else [effect]),
    ]
    return Table(caption, columns, rows)
