"""The section "Which number to improve": each number of the data sheet one grade finer, the best first."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from mcnav._dataclasses import dataclass
from mcnav.analysis.improvements import Improvement, improvements
from mcnav.analysis.what_if import WhatIf
from mcnav.contract.quantities import Output
from mcnav.report.document import CODE, Cell, Column, Folded, Part, Section, Table
from mcnav.report.format import number, rounded
from mcnav.report.names import humanize
from mcnav.store.manifest import Variable

SHOWN: Final = 6
"""Numbers that are not folded."""

SMALLEST: Final = 5e-4
"""Change of every sigma, and of the share of a limit, below which a number is left out."""

CAPTION: Final = (
    "Each number alone by one grade of the catalogue finer, or half as large where the catalogue has no grades, by "
    "linear covariance{held}. {limits}Largest effect: the sigma at the end that changes most.{finest}"
)
HELD: Final = " with the filter's gains as they are (mcnav allocate tunes the filter anew)"
LIMITS: Final = (
    "Limit used: largest share of its limit that a requirement uses for linear normal errors, {} now; below 100 % all "
    "are met. "
)


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
        return f"{humanize(self.outputs[place].name)} {100.0 * (ratios[place] - 1.0):+.1f} %".replace("-", "−")

    @property
    def matters(self) -> bool:
        """Return whether anything changes by more than rounding."""
        used = 0.0 if self.before is None or self.improvement.used is None else self.improvement.used - self.before
        return bool(abs(used) >= SMALLEST or (abs(self.improvement.sigmas - 1.0) >= SMALLEST).any())


def improvements_section(what_if: WhatIf | None, outputs: Sequence[Output | Variable]) -> Section | None:
    """Return the section; none where no number can be improved to any effect."""
    if what_if is None:
        return None
    before, listed = improvements(what_if)
    rows = [row for row in (_Row(each, before, outputs) for each in listed) if row.matters]
    if not rows:
        return None
    finest = len(what_if.campaign.sliders) > len(listed)
    held = what_if.covariance.own is not None or bool(what_if.campaign.beliefs)
    caption = CAPTION.format(
        held=HELD if held else "", limits="" if before is None else LIMITS.format(_percent(before)),
        finest=" Numbers of the finest grade are left out." if finest else "",
    )  # fmt: skip
    more: list[Part] = []
    if len(rows) > SHOWN + 1:
        more.append(Folded(f"All {len(rows)} numbers", [_table("", rows, before)]))
        rows = rows[:SHOWN]
    return Section("improve", "Which number to improve", [_table(caption, rows, before), *more])


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{rounded(100.0 * share)} %"


def _table(caption: str, rows: Sequence[_Row], before: float | None) -> Table[_Row]:
    def size(row: _Row, factor: float) -> str:
        shown = row.improvement.slider.sizes[row.improvement.slider.shown]
        return f"{number(abs(shown.value) * factor, 3)} {shown.unit or ''}".rstrip()

    used: list[Column[_Row]] = [Column("Limit used then", lambda row: _percent(row.improvement.used), kind="label")]
    columns: list[Column[_Row]] = [
        Column("Number", lambda row: Cell(CODE(row.improvement.slider.path)), kind="words"),
        Column("Now", lambda row: size(row, 1.0), kind="label"),
        Column("Improved to", lambda row: Cell(size(row, row.improvement.factor),
                                               below=row.improvement.grade or "half"), kind="label"),
        *([] if before is None else used),
        Column("Largest effect", lambda row: row.effect, kind="label"),
    ]  # fmt: skip
    return Table(caption, columns, rows)
