"""Claims of a publication: what it says, what was found, and the verdict."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from markupsafe import Markup

from mcnav.report.document.table import Cell, Column, Table, counts_in_words

TONES: Final = {"holds": "agrees", "in part": "undecided", "does not hold": "differs"}
"""Tones of verdicts on claims."""

WORDS: Final = {
    "holds": ("holds", "hold"),
    "in part": ("holds in part", "hold in part"),
    "does not hold": ("does not hold", "do not hold"),
    "not tested": ("cannot be tested", "cannot be tested"),
}
"""Verdicts of one claim and of several."""


@dataclass(frozen=True)
class Finding:
    """A statement of a publication, what was found, and the verdict.

    It is ``holds``, ``in part``, ``does not hold``, ``not tested`` or ``settled`` (for what had to be decided to
    reproduce anything).
    """

    said: str
    found: str
    verdict: str

    def __post_init__(self) -> None:
        """Give numbers below zero a minus sign in place of a hyphen."""
        object.__setattr__(self, "found", re.sub(r"(?<![\w−-])-(?=\d)", "−", self.found))


def verdicts_in_words(findings: Sequence[Finding]) -> Markup:
    """Count the claims by verdict.

    >>> str(verdicts_in_words([Finding("a", "b", "holds"), Finding("a", "b", "not tested")]))
    '2 claims: <strong>1</strong> holds, <strong>1</strong> cannot be tested.'
    """
    counted = Counter(finding.verdict for finding in findings)
    words = [(WORDS[verdict][counted[verdict] > 1], counted[verdict]) for verdict in WORDS if counted[verdict]]
    return Markup("{} claims: {}").format(len(findings), counts_in_words(words))


def finding_table(findings: Sequence[Finding], heading: str) -> Table[Finding]:
    """Tabulate what is said, what was found, and the verdict."""
    columns: list[Column[Finding]] = [
        Column(heading, lambda row: row.said, kind="words"),
        Column("Finding", lambda row: row.found, kind="words"),
        Column("Verdict", lambda row: Cell(row.verdict, tone=TONES.get(row.verdict, "")), kind="label"),
    ]
    return Table("", columns, findings, style="findings")
