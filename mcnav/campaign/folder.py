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
import math
import os
import secrets
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import filelock
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from mcnav.campaign.problems import RunFolderBusy, RunFolderError
from mcnav.scenarios.protocol import History, Outcomes

Array = NDArray[np.float64]

CAMPAIGN, MANIFEST, SUMMARY, REPORT = "campaign.toml", "manifest.json", "summary.json", "report.html"
HISTORY, SAMPLES, LOCK = "history.parquet", "samples", ".lock"
OK: Final = "ok"


@dataclass(frozen=True)
class Part:
    """What the manifest says of one file of samples [begin, end)."""

    file: str
    begin: int
    end: int
    failed: int
    handed_over: int
    sha256: str


@dataclass(frozen=True)
class Samples:
    """All samples of a run.

    Attributes
    ----------
    index : ndarray of int, shape (n,)
    status : tuple of str
        ``ok``, or why the sample failed.
    errors : ndarray, shape (n, sources)
        SI.
    outputs : ndarray, shape (n, outputs)
        SI; NaN in the row of a sample that failed.
    """

    index: NDArray[np.int64]
    status: tuple[str, ...]
    errors: Array
    outputs: Array


@dataclass(frozen=True)
class Layout:
    """Columns of the sample files: ``error NAME [unit]`` and ``output NAME [unit]``."""

    errors: tuple[str, ...]
    outputs: tuple[str, ...]

    @classmethod
    def of(cls, sources: Sequence[Any], outputs: Sequence[Any]) -> Layout:
        """The layout for the sources and outputs of a scenario."""
        return cls(
            tuple(f"error {source.name} [{source.unit}]" for source in sources),
            tuple(f"output {output.name} [{output.unit}]" for output in outputs),
        )


def plain(value: Any) -> Any:
    """A value as JSON can hold it: arrays as lists, what is not finite as null."""
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    return value


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that it is either there whole, or not there."""
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(6)}.tmp")
    try:
        with temporary.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _parquet(table: pa.Table, text: Sequence[str] = ()) -> bytes:
    """A parquet file with page checksums; the same table gives the same bytes."""
    numbers = [name for name in table.column_names if name not in text]
    buffer = io.BytesIO()
    pq.write_table(
        table,
        buffer,
        compression="zstd",
        use_dictionary=list(text),
        use_byte_stream_split=[name for name in numbers if pa.types.is_floating(table.schema.field(name).type)],
        write_page_checksum=True,
    )
    return buffer.getvalue()


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
            (self.path / SAMPLES).mkdir(parents=True, exist_ok=True)
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
        for part in (self.path / SAMPLES).glob("part-*.parquet"):
            part.unlink()

    def sweep(self) -> None:
        """Delete what a killed process left half written."""
        for place in (self.path, self.path / SAMPLES):
            for temporary in place.glob(".*.tmp"):
                temporary.unlink()

    def write_part(
        self, number: int, begin: int, identity: str, layout: Layout, errors: Array, outcomes: Outcomes
    ) -> Part:
        """Store one chunk of samples; see `Part`."""
        count = len(errors)
        status = [f"failed: {outcomes.failures[row]}" if row in outcomes.failures else OK for row in range(count)]
        columns: dict[str, Any] = {"index": np.arange(begin, begin + count), "status": pa.array(status)}
        columns.update(zip(layout.errors, errors.T, strict=True))
        failed = np.isnan(outcomes.values).any(axis=1)
        for name, values in zip(layout.outputs, outcomes.values.T, strict=True):
            columns[name] = pa.array(np.ascontiguousarray(values), mask=failed)
        table = pa.table({name: pa.array(column) for name, column in columns.items()})
        place = {"mcnav.identity": identity, "mcnav.begin": str(begin), "mcnav.handed_over": str(outcomes.handed_over)}
        content = _parquet(table.replace_schema_metadata(place), ["status"])
        name = f"part-{number:05d}.parquet"
        write_whole(self.path / SAMPLES / name, content)
        digest = hashlib.sha256(content).hexdigest()
        return Part(name, begin, begin + count, int(failed.sum()), outcomes.handed_over, digest)

    def verified_part(self, number: int, begin: int, end: int, identity: str) -> Part | None:
        """The part for samples [begin, end), when a whole one of this very run is there."""
        name = f"part-{number:05d}.parquet"
        try:
            content = (self.path / SAMPLES / name).read_bytes()
            table = pq.read_table(io.BytesIO(content), page_checksum_verification=True)
        except (OSError, pa.ArrowException):
            return None
        place = {key.decode(): value.decode() for key, value in (table.schema.metadata or {}).items()}
        index = table.column("index").to_numpy() if "index" in table.column_names else np.empty(0)
        if place.get("mcnav.identity") != identity or not np.array_equal(index, np.arange(begin, end)):
            return None
        failed = sum(entry != OK for entry in table.column("status").to_pylist())
        handed_over = int(place.get("mcnav.handed_over", "0"))
        return Part(name, begin, end, failed, handed_over, hashlib.sha256(content).hexdigest())

    def table(self, parts: Sequence[Mapping[str, Any]]) -> pa.Table:
        """All samples of the parts that a manifest lists, in order, every part verified.

        Raises
        ------
        RunFolderError
            When a part is missing, or its content is not what the manifest says.
        """
        listed = {str(part["file"]) for part in parts}
        for found in sorted((self.path / SAMPLES).iterdir()):
            if found.name not in listed and not found.name.startswith("."):
                raise RunFolderError(f"{found}: is not of this run; remove it, or run the campaign again with --fresh")
        tables = []
        for part in parts:
            path = self.path / SAMPLES / str(part["file"])
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

    def samples(self, parts: Sequence[Mapping[str, Any]], layout: Layout) -> Samples:
        """The same samples as arrays; see `table`."""
        table = self.table(parts)

        def block(names: Sequence[str]) -> Array:
            columns = [table.column(name).to_numpy(zero_copy_only=False) for name in names]
            return np.column_stack(columns).astype(float)

        status = tuple(table.column("status").to_pylist())
        index = np.asarray(table.column("index").to_numpy(), dtype=np.int64)
        return Samples(index, status, block(layout.errors), block(layout.outputs))

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
        self.write(HISTORY, _parquet(table.replace_schema_metadata(events)))

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


def as_records(parts: Sequence[Part]) -> list[dict[str, Any]]:
    """Parts as the manifest lists them, in the order of their samples."""
    return [asdict(part) for part in sorted(parts, key=lambda part: part.begin)]
