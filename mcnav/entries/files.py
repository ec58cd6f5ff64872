"""Files that a key of ``[scenario]`` names, and their copies in the folder of the run that read them."""

from __future__ import annotations

import re
from pathlib import PurePosixPath
from typing import Final

from mcnav.entries.context import EarlierFile, FileContext
from mcnav.entries.inputs import InputFile, identify_file, safe_name
from mcnav.entries.values import SettingError, display

FILE: Final = re.compile(r"[^\x00-\x1f\x7f]{1,200}")
"""Path of a file in a setting."""

OUTSIDE: Final = "the file must lie beside the campaign file, or in a folder beside it"


def is_inside(written: str) -> bool:
    """Return whether a path stays in the folder of the campaign file."""
    parts = PurePosixPath(written)
    return not (parts.is_absolute() or ".." in parts.parts or "\\" in written)


def read_file(value: object, key: str, context: FileContext) -> InputFile:
    """Identify the file of a setting; when a run is repeated and the file has changed, its copy in the run folder."""
    if not isinstance(value, str):
        raise SettingError(f"got {display(value)}; expected the path of a file in quotes")
    if not FILE.fullmatch(value) or not is_inside(value) or context.leaves(value):
        raise SettingError(f"got {display(value)}; {OUTSIDE}")
    path, name, earlier = context.folder / value, safe_name(value), context.earlier.get(key)
    try:
        file = identify_file(str(path.absolute()), name, key)
    except OSError as failure:
        if earlier is None:
            raise SettingError(f"{path} {why_unreadable(failure)}") from None
        return _identify_copy(earlier, name, key, f"{path} {why_unreadable(failure)}")
    if earlier is None or file.digest == earlier.sha256:
        return file
    change = f"{path} has changed since the run (its SHA-256 was {earlier.sha256[:12]})"
    return _identify_copy(earlier, name, key, change)


def _identify_copy(earlier: EarlierFile, name: str, key: str, change: str) -> InputFile:
    """Identify the copy of a file in the folder of the run that read it."""
    if earlier.copy is None:
        raise SettingError(f"{change}, and the run folder has no copy of it; restore it")
    try:
        return identify_file(str(earlier.copy.absolute()), name, key)
    except OSError as failure:
        raise SettingError(f"{change}, and its copy {earlier.copy} {why_unreadable(failure)}") from None


def why_unreadable(failure: OSError) -> str:
    """Say why a file cannot be read."""
    if isinstance(failure, FileNotFoundError):
        return "does not exist; paths are relative to the campaign file"
    return f"cannot be read: {failure.strerror or failure}"
