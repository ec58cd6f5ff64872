"""Files that a scenario reads, as part of a run: in its identity, in its folder, and unchanged until its end."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from mcnav.entries.inputs import InputFile
from mcnav.errors import RunFolderError
from mcnav.store.manifest import FileRecord

LARGEST_COPY: Final = 1_000_000
"""Bytes of a file that is copied; of a larger one only the digest is stored."""


def file_records(files: Sequence[InputFile]) -> tuple[FileRecord, ...]:
    """List files as the manifest does."""
    return tuple(
        FileRecord(
            name=file.name, bytes=file.size, sha256=file.digest, copied=file.size <= LARGEST_COPY, setting=file.setting
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
