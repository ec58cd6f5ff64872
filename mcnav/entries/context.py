"""The campaign file being read: where it lies, and the mistakes found in it so far."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mcnav.entries.inputs import SourceFile
from mcnav.errors import CampaignError, Problem, suggestion
from mcnav.physics.units import UnitError, quantity


@dataclass(frozen=True)
class EarlierFile:
    """SHA-256 of a file that an earlier run has read, and the copy in its folder, if there is one."""

    sha256: str
    copy: Path | None


@dataclass(frozen=True)
class FileContext:
    """A campaign file and its mistakes.

    Attributes
    ----------
    file : str
        Name of the campaign file, for messages.
    folder : Path
        Folder that relative paths start from.
    earlier : mapping of str to EarlierFile
        Files of an earlier run by setting: a copy replaces a file that has changed since.
    content : mapping
        The whole file.
    code : mapping of str to SourceFile
        Python files by name that are given with the campaign and not read from its folder.
    confined : bool
        Whether files may be read in the folder of the campaign only, also where links lead elsewhere: that of a run.
    problems : list of Problem
        Mistakes found so far; functions that read a table add theirs and go on.
    """

    file: str
    folder: Path
    earlier: Mapping[str, EarlierFile] = field(default_factory=dict)
    content: dict[str, Any] = field(default_factory=dict)
    confined: bool = False
    code: Mapping[str, SourceFile] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)

    def problem(self, key: str, message: str) -> None:
        """Add a mistake."""
        self.problems.append(Problem(self.file, key, message))

    def leaves(self, written: str) -> bool:
        """Return whether a path leads out of a folder that the campaign must not leave."""
        return self.confined and not (self.folder / written).resolve().is_relative_to(self.folder.resolve())

    def error(self) -> CampaignError:
        """Return the exception that lists all mistakes."""
        return CampaignError(self.problems)

    def quantity(self, value: object, unit: str, key: str, shares: bool = False) -> float | None:
        """Read a quantity into an SI unit; when it is wrong, add the mistake and return None."""
        try:
            return quantity(value, unit, shares)
        except UnitError as wrong:
            self.problem(key, str(wrong))
            return None

    def check_names(self, names: Iterable[str], known: list[str], key: str, what: str) -> bool:
        """Add a mistake for each name in a list that is not known; return whether all are."""
        unknown = [name for name in names if name not in known]
        for name in unknown:
            self.problem(key, f"unknown {what} {name!r}{suggestion(name, known)}")
        return not unknown
