"""Files that a scenario reads, as part of a run: in its identity, in its folder, and unchanged until its end."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from mcnav.errors import RunFolderError, shortened
from mcnav.scenarios.inputs import InputFile
from mcnav.store.manifest import FileRecord

INPUTS: Final = "inputs"
"""Folder of a run in which the files that its scenario reads are kept."""

LARGEST_KEPT: Final = 1_000_000
"""Bytes of a file that is kept; of a larger one only its digest is."""


def file_records(files: Sequence[InputFile]) -> tuple[FileRecord, ...]:
    """List files as the manifest does."""
    return tuple(
        FileRecord(
            name=file.name, bytes=file.size, sha256=file.digest, kept=file.size <= LARGEST_KEPT, setting=file.setting
        )
        for file in files
    )


def check_unchanged(files: Sequence[InputFile], folder: Path) -> None:
    """Raise `RunFolderError` when a file has another content than the run began with.

    What a run has stored by then comes from the earlier content: each chunk looks before it begins and before it is
    stored.
    """
    _refuse(files, f"samples stored in {folder} come from the file as it was: restore it, or replace them with --fresh")


def check_as_read(files: Sequence[InputFile]) -> None:
    """Raise `RunFolderError` when a file has changed since the campaign was read."""
    _refuse(files, "the campaign was read before that; read it again")


def _refuse(files: Sequence[InputFile], remedy: str) -> None:
    for file in files:
        if not file.unchanged:
            gone = not Path(file.path).exists()
            what = f"is gone, or not to be seen from {platform.node()}" if gone else "has changed"
            raise RunFolderError(f"{file.path}: {what}; {remedy}")


def changed_since(before: Mapping[str, str], now: Mapping[str, str]) -> str | None:
    """Name the first file that differs between two runs, and how; none when none does."""
    for name in sorted(before.keys() | now.keys()):
        if before.get(name) != now.get(name):
            return shortened(f"{name} was {before.get(name, 'absent')}, is {now.get(name, 'absent')}")
    return None
