"""Files written atomically, whose bytes depend on their content only."""

from __future__ import annotations

import codecs
import errno
import json
import math
import os
import re
import secrets
import stat
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

INPUTS: Final = "inputs"
"""Folder of a run with copies of the files that its scenario reads."""


def to_json(value: Any) -> Any:
    """Convert a value to JSON: arrays to lists, numbers that are not finite to null."""
    if isinstance(value, np.ndarray):
        return to_json(value.tolist())
    if isinstance(value, (list, tuple)):
        return list(value) if _all_finite(value) else [to_json(entry) for entry in value]
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: to_json(entry) for key, entry in value.items()}
    return value


def _all_finite(values: Sequence[Any]) -> bool:
    """Return whether all values are finite floating-point numbers, of which there is at least one."""
    return set(map(type, values)) == {float} and all(map(math.isfinite, values))


_SCALARS: Final = frozenset({float, int, str, bool, type(None)})


class _Indented:
    """Formatter of JSON with an indent of one blank; lists and tables of scalars are left to compiled code."""

    def __init__(self, ensure_ascii: bool, allow_nan: bool) -> None:
        self._ensure_ascii, self._allow_nan = ensure_ascii, allow_nan
        self._encoders: list[json.JSONEncoder] = []

    def _scalars(self, value: Any, depth: int) -> str:
        while len(self._encoders) <= depth:
            separators = ",\n" + " " * len(self._encoders), ": "
            self._encoders.append(
                json.JSONEncoder(ensure_ascii=self._ensure_ascii, allow_nan=self._allow_nan, separators=separators)
            )
        return self._encoders[depth].encode(value)

    def format(self, value: Any, depth: int = 0) -> str:
        """Format a value that stands at a depth."""
        table = isinstance(value, dict)
        if not (table or isinstance(value, (list, tuple))) or not value:
            return self._scalars(value, depth)
        inner, outer = "\n" + " " * (depth + 1), "\n" + " " * depth
        if set(map(type, value.values() if table else value)) <= _SCALARS:
            whole = self._scalars(value, depth + 1)
            return f"{whole[0]}{inner}{whole[1:-1]}{outer}{whole[-1]}"
        if table:
            entries = (f"{self._scalars(key, 0)}: {self.format(entry, depth + 1)}" for key, entry in value.items())
            return f"{{{inner}{f',{inner}'.join(entries)}{outer}}}"
        return f"[{inner}{f',{inner}'.join(self.format(entry, depth + 1) for entry in value)}{outer}]"


def indented_json(value: Any, ensure_ascii: bool = True, allow_nan: bool = True) -> str:
    """Format JSON as `json.dumps` with an indent of one blank, which takes three times as long.

    Keys of tables are texts.

    >>> print(indented_json({"mean": [1.5, 2.0], "unit": "m"}))
    {
     "mean": [
      1.5,
      2.0
     ],
     "unit": "m"
    }
    """
    return _Indented(ensure_ascii, allow_nan).format(value)


_TEMPORARY: Final = re.compile(r"\..+\.[0-9a-f]{12}\.tmp")


def is_temporary(name: str) -> bool:
    """Return whether a file of this name is one that `write_whole` did not finish."""
    return _TEMPORARY.fullmatch(name) is not None


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that it is either there whole, or not there."""
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(6)}.tmp")
    try:
        with temporary.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        _replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
    if not _WINDOWS:  # where no folder can be opened
        _sync_folder(path.parent)


_WINDOWS: Final = os.name == "nt"

_TRIES: Final = (0.01, 0.03, 0.1, 0.3, 0.6)
"""Seconds between tries to replace a file: Windows refuses while another program, such as a scanner, has it open."""


def _replace(temporary: Path, path: Path) -> None:
    """Put a finished file in the place of another; `OSError` that says what to do where another program keeps it."""
    for pause in _TRIES if _WINDOWS else ():
        try:
            temporary.replace(path)
        except PermissionError:
            time.sleep(pause)
        else:
            return
    try:
        temporary.replace(path)
    except PermissionError as failure:
        if not _WINDOWS:
            raise
        message = "cannot be replaced: close the program that has it open, or allow writing to it"
        raise PermissionError(failure.errno, message, str(path)) from None


_NOT_SYNCED: Final = {errno.EINVAL, errno.ENOTSUP, errno.EACCES, errno.EPERM}
"""Errors of file systems that cannot sync a folder, and of folders that may be written to, but not read."""


def _sync_folder(folder: Path) -> None:
    """Write the entries of a folder to the disk, so that a renamed file is there after a loss of power."""
    try:
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    except OSError as failure:
        if failure.errno not in _NOT_SYNCED:
            raise


def check_regular(path: Path, most: int) -> None:
    """Raise `OSError` unless this is a file of at most so many bytes: reading a pipe might never end."""
    result = path.stat()
    if not stat.S_ISREG(result.st_mode):
        raise OSError(errno.EINVAL, "is no file")
    if result.st_size > most:
        raise OSError(errno.EFBIG, f"is longer than {most:,} bytes")


def read_whole(path: Path, most: int) -> bytes:
    """Read a regular file of at most so many bytes.

    Raises `OSError` when it cannot be read, is no file, or is longer.
    """
    check_regular(path, most)
    with path.open("rb") as file:
        return file.read(most)


class TextError(ValueError):
    """Content that is no text as this program reads it; the message says what it is, and what to do."""


def text_of(content: bytes) -> str:
    """Decode the content of a text file: UTF-8, or UTF-16 with its mark at the beginning.

    Raises
    ------
    TextError
        When it is neither: with the first line that is none, and what it would be in the encoding of Windows.
    """
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        try:
            return content.decode("utf-16")
        except UnicodeDecodeError:
            raise TextError("is not UTF-8 text, and no whole UTF-16 text either; save it as UTF-8") from None
    if b"\0" in content[1:2] or content[:1] == b"\0" != content[1:2]:
        raise TextError("is not UTF-8 text, but seems to be UTF-16; save it as UTF-8")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as failure:
        line, byte = content.count(b"\n", 0, failure.start) + 1, content[failure.start : failure.start + 1]
        meant = byte.decode("cp1252", "ignore")
        hint = f", which is '{meant}' in Windows-1252" if meant.isprintable() and meant else ""
        raise TextError(f"is not UTF-8 text: line {line} has the byte 0x{byte.hex()}{hint}; save it as UTF-8") from None


def is_number(text: str) -> bool:
    """Return whether a text of a file is a number; Python's underscores between digits are none.

    >>> is_number("-1.5e3"), is_number("1_000"), is_number("")
    (True, False, False)
    """
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text


def write_texts(folder: Path, texts: Mapping[str, str]) -> list[Path]:
    """Write texts by file name into a folder, which is created if necessary; return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        write_whole(folder / name, text.encode())
    return [folder / name for name in texts]
