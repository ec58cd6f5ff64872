"""Files that a user-defined scenario reads: recorded when they are opened, identified by content.

Python reports every file that it opens (audit event ``open``). `record_opened_files` records files opened for reading,
except those of Python, installed packages, the operating system and caches, and those written in the same block.
Files that libraries open without Python (parquet, HDF5, sqlite) are not recorded.
"""

from __future__ import annotations

import hashlib
import os
import re
import site
import stat
import sys
import sysconfig
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

from mcnav.contract.scenario import ScenarioError

SETTLED_AFTER: Final = 2.0
"""Time for which a file's time stamps are known, s, after which a change alters them, however coarse they are."""

LONGEST_NAME: Final = 100
"""Characters."""

_UNIX: Final = (
    "/proc", "/dev", "/sys", "/etc", "/run", "/usr/lib", "/usr/lib64", "/lib", "/lib64", "/usr/share/fonts",
    "/usr/share/fontconfig", "/usr/share/locale", "/usr/share/mime", "/usr/share/terminfo", "/usr/share/zoneinfo",
)  # fmt: skip
_MACOS: Final = ("/System", "/Library", "/private/etc", "/private/var/db", "/var/db")
_WINDOWS: Final = ("SystemRoot", "ProgramFiles", "ProgramFiles(x86)", "ProgramW6432")
"""Names in the environment of the folders of Windows and of installed programs."""
_IGNORED_PART: Final = re.compile(r"__pycache__|\.cache|\.matplotlib|.*\.(?:egg|dist)-info")
_IGNORED_SUFFIX: Final = frozenset({".py", ".pyc", ".pyi", ".so", ".pyd", ".dll", ".nbi", ".nbc", ".pth"})


@dataclass(frozen=True)
class SourceFile:
    """Name and text of a user's Python file."""

    file: str
    text: str

    @property
    def digest(self) -> str:
        """SHA-256 of the text."""
        return hashlib.sha256(self.text.encode()).hexdigest()


@dataclass(frozen=True)
class InputFile:
    """A file and its content at one time.

    Attributes
    ----------
    name : str
        Unique name among the files of a run.
    path : str
        Absolute path.
    digest : str
        SHA-256 of the content.
    size : int
        Bytes.
    setting : str, optional
        Key of ``[scenario]`` that names the file, if any.
    """

    name: str
    path: str
    digest: str
    size: int
    setting: str | None = None

    @property
    def unchanged(self) -> bool:
        """Return whether the file still has this content."""
        try:
            return content_of(self.path) == (self.digest, self.size)
        except OSError:
            return False


def identify_file(path: str, name: str = "", setting: str | None = None) -> InputFile:
    """Identify a file; `OSError` when it cannot be read, or is not a regular file."""
    digest, size = content_of(path)
    return InputFile(name or safe_name(path), path, digest, size, setting)


@dataclass(frozen=True)
class _Known:
    """Digest of a file with the time stamps and size ``mark``, first seen ``since``; monotonic time, s."""

    mark: tuple[int, ...]
    digest: str
    since: float
    settled: bool


_known: dict[str, _Known] = {}
"""Digests of files by path."""


def content_of(path: str) -> tuple[str, int]:
    """Return SHA-256 and size of a regular file, which is read again only when its time stamps or size differ.

    Time stamps are compared with each other, never with a clock, which may be set and may differ from a file server's.

    Raises `OSError` when it cannot be read, or is not a regular file.
    """
    now, content = time.monotonic(), Path(path).stat()
    if not stat.S_ISREG(content.st_mode):
        raise OSError("is not a regular file")
    mark = (content.st_dev, content.st_ino, content.st_size, content.st_mtime_ns, content.st_ctime_ns)
    known = _known.get(path)
    if known is not None and known.mark != mark:
        known = None
    if known is not None and known.settled:
        return known.digest, content.st_size
    with Path(path).open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    since = now if known is None else known.since
    _known[path] = _Known(mark, digest, since, now - since > SETTLED_AFTER)
    return digest, content.st_size


def safe_name(path: str) -> str:
    """Return the last part of a path as a file name that is valid on every file system.

    >>> safe_name("/data/flight 7.csv")
    'flight 7.csv'
    """
    name = re.sub(r"[^\w .+-]", "_", Path(path).name, flags=re.ASCII).lstrip(". ") or "file"
    return name if len(name) <= LONGEST_NAME else name[-LONGEST_NAME:].lstrip(". ")


def with_unique_names(files: Iterable[InputFile], taken: Sequence[InputFile] = ()) -> tuple[InputFile, ...]:
    """Give files unique names made of the last parts of their paths.

    A file with several paths appears once; files among those taken are left out.
    """
    used, input_files = {file.name.casefold() for file in taken}, list[InputFile]()
    known = {Path(file.path).resolve() for file in taken}
    for file in sorted(files, key=lambda file: file.path):
        if Path(file.path).resolve() in known:
            continue
        known.add(Path(file.path).resolve())
        parts = Path(file.path).parts
        names = [safe_name("_".join(parts[-count:])) for count in range(1, len(parts))]
        numbered = (f"{number}_{safe_name(file.path)}" for number in range(2, 10_000))
        name = next(name for name in (*names, *numbered) if name.casefold() not in used)
        used.add(name.casefold())
        input_files.append(replace(file, name=name))
    return tuple(input_files)


@dataclass
class OpenedFiles:
    """Paths opened so far in a `record_opened_files` block."""

    read: set[str] = field(default_factory=set)
    written: set[str] = field(default_factory=set)
    thread: int = field(default_factory=threading.get_ident)
    others: frozenset[int | None] = field(
        default_factory=lambda: frozenset(thread.ident for thread in threading.enumerate())
    )

    def add(self, path: Any, flags: Any) -> None:
        """Record a file that is about to be opened."""
        if not isinstance(path, (str, bytes)) or not isinstance(flags, int):
            return
        place = str(Path(os.fsdecode(path)).absolute())
        (self.read if flags & (os.O_WRONLY | os.O_RDWR) == 0 else self.written).add(place)

    @property
    def concerned(self) -> bool:
        """Return whether the current thread runs the block, or was started since the block began."""
        present = threading.get_ident()
        return present == self.thread or present not in self.others


_active: list[OpenedFiles] = []


def _hook(event: str, arguments: tuple[Any, ...]) -> None:
    """Record opened files; an audit hook cannot be removed, so it must cost little outside the blocks."""
    if not _active or event not in ("open", "os.rename"):
        return
    try:
        for watched in tuple(_active):
            if watched.concerned:
                if event == "open":
                    watched.add(arguments[0], arguments[2])
                else:
                    watched.add(arguments[1], os.O_WRONLY)
    except Exception:  # raising here would fail the user's open()
        return


@lru_cache(maxsize=1)
def _install_hook() -> None:
    sys.addaudithook(_hook)


@contextmanager
def record_opened_files() -> Iterator[OpenedFiles]:
    """Record every file that this thread, and threads started meanwhile, open."""
    _install_hook()
    files = OpenedFiles()
    _active.append(files)
    try:
        yield files
    finally:
        _active[:] = [watched for watched in _active if watched is not files]


def system_places(platform: str = sys.platform, environment: Mapping[str, str] = os.environ) -> tuple[str, ...]:
    r"""Return the folders of an operating system, as `sys.platform` names it.

    >>> system_places("win32", {"SystemRoot": "C:\\Windows"})
    ('C:\\Windows',)
    >>> "/System" in system_places("darwin", {}), "/System" in system_places("linux", {})
    (True, False)
    """
    if platform == "win32":
        return tuple(environment[name] for name in _WINDOWS if environment.get(name))
    return (*_UNIX, *_MACOS) if platform == "darwin" else _UNIX


@lru_cache(maxsize=1)
def _system_folders() -> tuple[str, ...]:
    """Return the folders of Python, installed packages, this program, the operating system and the user's caches."""
    from platformdirs import user_cache_path  # which most commands do without

    places = {*system_places(), sys.prefix, sys.base_prefix, sys.exec_prefix, str(Path(__file__).parents[1])}
    places |= {*sysconfig.get_paths().values(), *site.getsitepackages(), site.getusersitepackages()}
    places |= {
        os.environ.get(name, "") for name in ("XDG_CACHE_HOME", "MPLCONFIGDIR", "NUMBA_CACHE_DIR", "MCNAV_CACHE_DIR")
    }
    caches = (user_cache_path(name, appauthor=False) for name in ("mcnav", "numba", "matplotlib"))
    places |= {str(Path.home() / ".config" / "matplotlib"), *map(str, caches)}
    kept = {str(form) for place in places if place for form in (Path(place).absolute(), Path(place).resolve())}
    shared = (str(Path.home()), tempfile.gettempdir(), os.sep)
    return tuple(sorted(os.path.normcase(place) + os.sep for place in kept if place not in shared))


def is_input(path: str) -> bool:
    """Return whether a file counts as an input, by its folder and name."""
    where = Path(path)
    if any(os.path.normcase(place).startswith(_system_folders()) for place in (path, str(where.resolve()))):
        return False
    return where.suffix not in _IGNORED_SUFFIX and not any(
        _IGNORED_PART.fullmatch(folder) for folder in where.parts[:-1]
    )


def find_inputs(opened_files: OpenedFiles, code: str) -> dict[str, InputFile]:
    """Identify the inputs among recorded files, by path; files that no longer exist are left out.

    Raises `ScenarioError` when one is not a regular file, such as a pipe, so that its content cannot be read again.
    """
    files = {}
    for path in sorted(opened_files.read - opened_files.written):
        if not is_input(path):
            continue
        try:
            kind = Path(path).stat().st_mode
            if stat.S_ISDIR(kind):
                continue
            if not stat.S_ISREG(kind):
                message = f"{code} reads {path}, which is not a regular file; its content cannot be stored with the run"
                raise ScenarioError("type", message)
            files[path] = identify_file(path)
        except OSError:
            continue
    return files


def own_modules() -> tuple[str, ...]:
    """Return the files of loaded modules that are neither Python's nor of installed packages or this program.

    The program that runs, ``__main__``, is none of them, nor are classes of scenarios, whose text is known.
    """
    files = set[str]()
    for name, module in tuple(sys.modules.items()):
        file = getattr(module, "__file__", None)
        if not isinstance(file, str) or name == "__main__" or not Path(file).is_absolute():
            continue
        if not file.startswith(_system_folders()) and not str(Path(file).resolve()).startswith(_system_folders()):
            files.add(file)
    return tuple(sorted(files))
