"""What is wrong with a file, said in lines that name the file, the key, what came and what would do."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from mcnav.units import printable

LONGEST: Final = 400
"""Characters of a file name, key or message that are shown."""


@dataclass(frozen=True)
class Problem:
    """One mistake."""

    file: str
    key: str
    message: str

    def __str__(self) -> str:
        return ": ".join(printable(part, LONGEST) for part in (self.file, self.key, self.message) if part)


class CampaignError(Exception):
    """A campaign that cannot be run as it stands; all its mistakes together, one a line."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        super().__init__("\n".join(str(problem) for problem in problems))
        self.problems = tuple(problems)


class RunFolderError(Exception):
    """A run folder that cannot be used; the message names it and says what would do."""


class RunFolderBusy(RunFolderError):
    """Another process is writing to the run folder."""


def suggestion(name: str, known: list[str]) -> str:
    """What an unknown name may have meant, or what is known, as the end of a message."""
    close = difflib.get_close_matches(name, known, n=1)
    if close:
        return f"; did you mean {close[0]!r}?"
    return f"; expected one of {', '.join(known)}" if known else ""
