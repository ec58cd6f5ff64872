"""Results that are kept from one command to the next, in a folder of the user's caches.

The folder is `VARIABLE` of the environment, or that of the platform (on Linux ``~/.cache/mcnav``). A file begins with
the digest of its content, and is there whole or not at all, whichever process writes it last. Without a folder that
can be written to nothing is kept. All of it may be deleted at any time.
"""

from __future__ import annotations

import hashlib
import os
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from mcnav.files.whole import is_temporary, read_whole, write_whole

VARIABLE: Final = "MCNAV_CACHE_DIR"

MOST_FILES: Final = 200
MOST_BYTES: Final = 1_000_000_000
"""Files of one kind that are kept, and their bytes: those used last."""

LARGEST: Final = 200_000_000
"""Bytes of one result; a larger one is not kept."""

ABANDONED: Final = 3_600.0
"""Age, s, of a file that is still being written, from which on its process has ended."""


def cache_folder() -> Path | None:
    """Return the folder of all that is kept, whether it exists or not; none for a user without a home."""
    from platformdirs import user_cache_path  # which most commands do without

    given = os.environ.get(VARIABLE)
    folder = Path(given).absolute() if given else user_cache_path("mcnav", appauthor=False)
    return folder if folder.is_absolute() else None


class DamagedError(Exception):
    """Raised for a file whose content is not what was written; the message names it."""


@dataclass(frozen=True)
class Cache:
    """Results of one kind, by name."""

    kind: str

    @property
    def folder(self) -> Path | None:
        """Folder of these results, whether it exists or not; none for a user without a home."""
        folder = cache_folder()
        return None if folder is None else folder / self.kind

    @property
    def writable(self) -> bool:
        """Return whether results can be kept, and make their folder."""
        if self.folder is None:
            return False
        with suppress(OSError):
            self.folder.mkdir(parents=True, exist_ok=True)
        return self.folder.is_dir() and os.access(self.folder, os.W_OK)

    def read(self, name: str) -> bytes | None:
        """Return the content of a result; none where it is not kept. Raises `DamagedError`."""
        if self.folder is None:
            return None
        path = self.folder / name
        try:
            stored = read_whole(path, LARGEST + 100)
        except OSError:
            return None
        digest, _, content = stored.partition(b"\n")
        if digest != _digest(content):
            raise DamagedError(f"{path} is damaged")
        with suppress(OSError):
            os.utime(path)
        return content

    def write(self, name: str, content: bytes) -> bool:
        """Keep a result if that is possible, and delete those not used for longest; return whether it is kept."""
        if self.folder is None or len(content) > LARGEST:
            return False
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            write_whole(self.folder / name, _digest(content) + b"\n" + content)
        except OSError:
            return False
        with suppress(OSError):  # another process may delete them at the same time
            _delete_oldest(self.folder)
        return True


def _digest(content: bytes) -> bytes:
    return hashlib.sha256(content).hexdigest().encode()


def _delete_oldest(folder: Path) -> None:
    """Delete files beyond `MOST_FILES` and `MOST_BYTES`, and those that were abandoned while they were written."""
    files = {file: file.stat() for file in folder.iterdir()}
    kept, size = 0, 0
    for file, state in sorted(files.items(), key=lambda file: file[1].st_mtime_ns, reverse=True):
        if is_temporary(file.name):
            if time.time() - state.st_mtime > ABANDONED:
                file.unlink(missing_ok=True)
            continue
        kept, size = kept + 1, size + state.st_size
        if kept > MOST_FILES or size > MOST_BYTES:
            file.unlink(missing_ok=True)
