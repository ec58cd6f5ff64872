"""Files of a run folder by name, its JSON files, and the summary of a finished run.

What only shows a summary reads it here, without the libraries that samples need.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Literal, TypeVar

from pydantic import ValidationError

from mcnav.caches.recent import Recent
from mcnav.errors import RunFolderError
from mcnav.files.records import Record
from mcnav.files.whole import INPUTS, indented_json, read_whole

CAMPAIGN, MANIFEST, SUMMARY, REPORT = "campaign.toml", "manifest.json", "summary.json", "report.html"
HISTORY, DEVELOPMENT, SAMPLES, LOCK = "history.parquet", "development.parquet", "samples", ".lock"
EPOCHS, HISTORIES, FILTER = "epochs.parquet", "histories.parquet", "filter.parquet"
SMOOTHED, REMEDIES = "smoothed_histories.parquet", "remedies.json"
FILES: Final = (
    MANIFEST,
    SUMMARY,
    REPORT,
    REMEDIES,
    HISTORY,
    DEVELOPMENT,
    EPOCHS,
    HISTORIES,
    SMOOTHED,
    FILTER,
    CAMPAIGN,
)
TABLES: Final = "tables"
"""Folder of a run with the tables of its campaign."""

LARGEST_JSON: Final = 64_000_000
"""Bytes of a manifest or summary; a quarter of a million chunks."""

MOST_ENTRIES: Final = 3_000_000
"""Entries of a manifest or summary; those of a quarter of a million chunks are half of it."""

FORMAT: Final = 1
"""Counts the changes after which an earlier program cannot read a manifest."""

_SURROGATE: Final = re.compile(rb"\\u[dD][89a-fA-F]")
"""Half of a surrogate pair as JSON escapes it; this program escapes none."""

Read = TypeVar("Read", bound=Record)


class ManifestError(ValueError):
    """Content that is no manifest of this program."""


class RunHead(Record):
    """Entries of a manifest that the summary repeats."""

    format: Literal[FORMAT] = FORMAT  # type: ignore[valid-type]
    campaign: str
    samples: int
    seed: int
    design: str
    complete: bool = False


def json_digest(content: Mapping[str, Any]) -> str:
    """SHA-256 of a JSON table."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def as_text(content: Mapping[str, Any]) -> bytes:
    """Format a JSON file."""
    return (indented_json(content, ensure_ascii=False, allow_nan=False) + "\n").encode()


_WHOLE: Final = Recent[bool](most=8)
"""Digests of the last manifests that are as this program writes them: finding out takes longer than reading."""


def _is_whole(text: bytes, manifest: Mapping[str, Any]) -> bool:
    """Return whether a text is that of its manifest, and the manifest has its checksum."""
    try:
        content = {key: value for key, value in manifest.items() if key != "checksum"}
        return as_text(manifest) == text and manifest.get("checksum") == json_digest(content)
    except (ValueError, RecursionError):
        return False


def remember_whole(text: bytes) -> None:
    """Remember that a manifest is whole, because this program has just written it."""
    _WHOLE.get(hashlib.sha256(text).digest(), lambda: True)


def validate(kind: type[Read], content: Mapping[str, Any], text: bytes | None = None) -> Read:
    """Read a manifest's content as a record; its text need not be formatted again where it is known.

    Raises `ManifestError` naming the first entry that is not as this program writes it.
    """
    if content.get("format", FORMAT) != FORMAT:
        raise ManifestError(f"format: got {str(content['format'])[:20]!r}; this version reads format {FORMAT}")
    try:
        return kind.model_validate_json(json.dumps(content) if text is None else text)
    except ValidationError as invalid:
        first = invalid.errors(include_url=False, include_input=False, include_context=False)[0]
        message = str(first["msg"]).removeprefix("Value error, ")
        place = ".".join(map(str, first["loc"]))
        raise ManifestError(": ".join(filter(None, (place, message[:1].lower() + message[1:])))) from None


def folders_of(path: Path) -> tuple[Path, ...]:
    """Return the folders of a run: that of its samples, and two that some runs have."""
    return path / SAMPLES, path / TABLES, path / INPUTS


def _links_in(folder: Path) -> list[Path]:
    with os.scandir(folder) as entries:
        return [folder / entry.name for entry in entries if entry.is_symlink()]


def refuse_links(places: Sequence[Path]) -> None:
    """Raise `RunFolderError` naming the first of some places that is a link."""
    for place in places:
        if place.is_symlink():
            raise RunFolderError(f"{place}: is a link to somewhere else, which no run makes; remove it")


def check_links(path: Path) -> None:
    """Raise `RunFolderError` where a link is in place of a file of a run: it may lead anywhere."""
    refuse_links([*(path / name for name in (*FILES, LOCK)), *folders_of(path)])
    refuse_links([path for folder in folders_of(path) if folder.is_dir() for path in _links_in(folder)])


def check_exists(path: Path) -> None:
    """Raise `RunFolderError` where there is no folder."""
    if not path.is_dir():
        missing = "it is a file" if path.exists() else "there is no such folder"
        campaign = str(path) if path.exists() and path.suffix == ".toml" and " " not in str(path) else "CAMPAIGN"
        raise RunFolderError(f"{path}: holds no run ({missing}); mcnav run {campaign} makes one")


def _read(path: Path, name: str, remedy: str) -> bytes | None:
    """Read a file of a folder; none when it is not there."""
    try:
        return read_whole(path / name, LARGEST_JSON)
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as failure:
        told = failure.strerror or failure
        raise RunFolderError(f"{path / name}: cannot be read: {told}; {remedy}") from None


def read_json(path: Path, name: str, remedy: str) -> tuple[dict[str, Any], bytes] | None:
    """Read a JSON file of a folder and its text; none when it is not there."""
    result = _read(path, name, remedy)
    if result is None:
        return None
    if sum(result.count(mark) for mark in (b",", b"[", b"{")) > MOST_ENTRIES:
        raise RunFolderError(f"{path / name}: has more than {MOST_ENTRIES:,} entries; {remedy}")
    try:
        content = json.loads(result.decode("utf-8"))
        if _SURROGATE.search(result):
            json.dumps(content, ensure_ascii=False).encode()  # half a pair alone cannot be encoded, nor printed
    except (ValueError, RecursionError):
        content = None
    if not isinstance(content, dict):
        raise RunFolderError(f"{path / name}: is damaged; {remedy}")
    return content, result


def read_manifest(path: Path, kind: type[Read]) -> Read | None:
    """Read the manifest of a run folder as a record; none when nothing has been run there.

    Raises `RunFolderError` when the manifest is damaged, or of a format that this version does not read, or when there
    are links in the folder.
    """
    remedy = "run the campaign again to mend it"
    check_links(path)
    read = read_json(path, MANIFEST, remedy)
    if read is None:
        return None
    content, text = read
    if not _WHOLE.get(hashlib.sha256(text).digest(), lambda: _is_whole(text, content), fits=bool):
        raise RunFolderError(f"{path / MANIFEST}: is damaged or was edited; {remedy}")
    try:
        return validate(kind, content, text)
    except ManifestError as fault:
        raise RunFolderError(f"{path / MANIFEST}: is not as this program writes it ({fault}); {remedy}") from None


def read_summary(path: Path) -> dict[str, Any]:
    """Read the analysed results of a run folder.

    Raises `RunFolderError` when there are none, or they are not those of the run.
    """
    remedy = "run mcnav report on the folder"
    head, read = read_manifest(path, RunHead), read_json(path, SUMMARY, remedy)
    if read is None or head is None:
        raise RunFolderError(f"{path}: holds no finished run; run the campaign first")
    summary, _ = read
    same = all(summary.get(key) == getattr(head, key) for key in ("campaign", "samples", "seed", "design"))
    if not (head.complete and same):
        raise RunFolderError(f"{path / SUMMARY}: is not that of the run in this folder; {remedy}")
    return summary
