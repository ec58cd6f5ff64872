"""Claims of a publication: what it says, what was found, and the verdict."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from mcnav.report.document.table import Cell, Column, Table

TONES: Final = {"holds": "agrees", "in part": "undecided", "does not hold": "differs"}
"""Tones of verdicts on claims."""


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


def finding_table(findings: Sequence[Finding], heading: str) -> Table[Finding]:
    """Tabulate what is said, what was found, and the verdict."""
    columns: list[Column[Finding]] = [
        Column(heading, lambda each: each.said, kind="words"),
        Column("Finding", lambda each: each.found, kind="words"),
        Column("Verdict", lambda each: Cell(each.verdict, tone=TONES.get(each.verdict, "")), kind="label"),
    ]
    return Table("", columns, findings, style="findings")
