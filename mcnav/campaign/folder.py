"""The run folder: what a run leaves behind, and all that a report needs.

``campaign.toml`` (resolved), ``manifest.json``, ``samples/part-*.parquet``, ``history.parquet``, ``summary.json``,
``report.html``. Every file is written under a temporary name and renamed when it is complete, so that a file that is
there is whole. A part carries the identity of its run and its place in it; it is believed by its content, not because
the manifest mentions it.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import filelock
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from mcnav.campaign.files import parquet_bytes, plain, write_whole
from mcnav.campaign.problems import RunFolderBusy, RunFolderError
from mcnav.scenarios.protocol import History

Array = NDArray[np.float64]

CAMPAIGN, MANIFEST, SUMMARY, REPORT = "campaign.toml", "manifest.json", "summary.json", "report.html"
HISTORY, SAMPLES, LOCK = "history.parquet", "samples", ".lock"


def _checksum(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


class RunFolder:
    """One run folder.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @contextmanager
    def held(self) -> Iterator[None]:
        """Hold the folder's lock; it is freed by the end of the process, however it ends.

        Raises
        ------
        RunFolderBusy
            When another process holds it.
        RunFolderError
            When the folder cannot be made or written to.
        """
        lock = filelock.FileLock(self.path / LOCK)
        try:
            (self.parts).mkdir(parents=True, exist_ok=True)
            lock.acquire(timeout=0)
        except filelock.Timeout:
            raise RunFolderBusy(f"{self.path}: another mcnav is writing here; wait for it, or choose --out") from None
        except (FileExistsError, NotADirectoryError):
            raise RunFolderError(f"{self.path}: cannot be written to: a file is where a folder should be") from None
        except OSError as failure:
            raise RunFolderError(f"{self.path}: cannot be written to: {failure.strerror or failure}") from None
        try:
            yield
        finally:
            lock.release()

    def manifest(self) -> dict[str, Any] | None:
        """What the run says of itself; none when nothing has been run here.

        Raises
        ------
        RunFolderError
            When the manifest is there but is not as this program wrote it.
        """
        content = self._json(MANIFEST, "run the campaign again with --fresh")
        if content is not None and content.pop("checksum", None) != _checksum(content):
            raise RunFolderError(
                f"{self.path / MANIFEST}: is damaged or was edited; run the campaign again with --fresh"
            )
        return content

    def write_manifest(self, content: Mapping[str, Any]) -> None:
        """Write the manifest with a checksum of itself."""
        known = plain(content)
        self.write_json(MANIFEST, known | {"checksum": _checksum(known)})

    def summary(self) -> dict[str, Any]:
        """The analysed results.

        Raises
        ------
        RunFolderError
            When there are none, or they are not those of the run.
        """
        remedy = "run mcnav report on the folder"
        summary, manifest = self._json(SUMMARY, remedy), self.manifest()
        if summary is None or manifest is None:
            raise RunFolderError(f"{self.path}: holds no finished run; run the campaign first")
        told = ("campaign", "samples", "seed", "design")
        if not manifest.get("complete") or any(summary.get(key) != manifest.get(key) for key in told):
            raise RunFolderError(f"{self.path / SUMMARY}: is not that of the run in this folder; {remedy}")
        return summary

    def _json(self, name: str, remedy: str) -> dict[str, Any] | None:
        path = self.path / name
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as failure:
            raise RunFolderError(f"{path}: cannot be read: {failure.strerror or failure}") from None
        except (ValueError, RecursionError):
            raise RunFolderError(f"{path}: is damaged; {remedy}") from None
        if not isinstance(content, dict):
            raise RunFolderError(f"{path}: is damaged; {remedy}")
        return content

    def write_json(self, name: str, content: Mapping[str, Any]) -> None:
        """Write a JSON file of this folder."""
        text = json.dumps(plain(content), indent=1, ensure_ascii=False, allow_nan=False)
        self.write(name, (text + "\n").encode())

    def write(self, name: str, content: bytes) -> None:
        """Write a file of this folder, whole.

        Raises
        ------
        RunFolderError
            When the disk refuses it.
        """
        try:
            write_whole(self.path / name, content)
        except OSError as failure:
            raise RunFolderError(f"{self.path / name}: cannot be written: {failure.strerror or failure}") from None

    def foreign(self) -> list[str]:
        """Names in the folder that no run writes."""
        own = {CAMPAIGN, MANIFEST, SUMMARY, REPORT, HISTORY, SAMPLES, LOCK}
        if not self.path.is_dir():
            return []
        return sorted(entry.name for entry in self.path.iterdir() if entry.name not in own)

    def clear(self) -> None:
        """Delete what a run wrote here, and nothing else."""
        for name in (MANIFEST, SUMMARY, REPORT, HISTORY, CAMPAIGN):
            (self.path / name).unlink(missing_ok=True)
        for part in (self.parts).glob("part-*.parquet"):
            part.unlink()

    def sweep(self) -> None:
        """Delete what a killed process left half written."""
        for place in (self.path, self.parts):
            for temporary in place.glob(".*.tmp"):
                temporary.unlink()

    @property
    def parts(self) -> Path:
        """Where the sample files are."""
        return self.path / SAMPLES

    def table(self, parts: Sequence[Mapping[str, Any]]) -> pa.Table:
        """All samples of the parts that a manifest lists, in order, every part verified.

        Raises
        ------
        RunFolderError
            When a part is missing, or its content is not what the manifest says.
        """
        listed = {str(part["file"]) for part in parts}
        for found in sorted((self.parts).iterdir()):
            if found.name not in listed and not found.name.startswith("."):
                raise RunFolderError(f"{found}: is not of this run; remove it, or run the campaign again with --fresh")
        tables = []
        for part in parts:
            path = self.parts / str(part["file"])
            try:
                content = path.read_bytes()
            except OSError as failure:
                raise RunFolderError(
                    f"{path}: cannot be read: {failure.strerror or failure}; run the campaign again"
                ) from None
            if hashlib.sha256(content).hexdigest() != part["sha256"]:
                raise RunFolderError(f"{path}: is damaged (its checksum differs); run the campaign again to mend it")
            tables.append(pq.read_table(io.BytesIO(content)))
        return pa.concat_tables(tables).combine_chunks()

    def campaign(self) -> str:
        """The resolved campaign file.

        Raises
        ------
        RunFolderError
            When it cannot be read.
        """
        try:
            return (self.path / CAMPAIGN).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as failure:
            raise RunFolderError(f"{self.path / CAMPAIGN}: cannot be read; run the campaign again") from failure

    def write_history(self, history: History) -> None:
        """Store what was flown."""
        table = pa.table(dict(history.columns))
        events = {"mcnav.events": json.dumps(dict(history.events))}
        self.write(HISTORY, parquet_bytes(table.replace_schema_metadata(events)))

    def history(self) -> History:
        """What was flown.

        Raises
        ------
        RunFolderError
            When it cannot be read.
        """
        try:
            table = pq.read_table(self.path / HISTORY, page_checksum_verification=True)
            events = json.loads((table.schema.metadata or {})[b"mcnav.events"])
        except (OSError, pa.ArrowException, KeyError, ValueError) as failure:
            raise RunFolderError(f"{self.path / HISTORY}: is missing or damaged; run the campaign again") from failure
        return History({name: table.column(name).to_numpy() for name in table.column_names}, events)
