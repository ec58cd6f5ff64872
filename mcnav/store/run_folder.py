"""The run folder: what a run leaves behind, and all that a report needs.

``campaign.toml`` (resolved), ``manifest.json``, ``samples/part-*.parquet``, ``history.parquet``, where the engine knows
errors throughout the flight ``epochs.parquet`` and ``histories.parquet``, ``summary.json``, ``report.html``, and the
Python file of a scenario of the user's own, which only ``mcnav run`` on the campaign beside it ever executes, with the
small files that it reads in ``inputs/``. A file is written under a temporary name and renamed when it is complete, so
that a file that is there is whole. A part carries the identity of its run and its place in it; it is believed by its
content, not because the manifest mentions it.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence, Set
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import asdict
from itertools import accumulate
from pathlib import Path
from typing import Any, Final

import filelock
import pyarrow as pa

from mcnav._types import Array
from mcnav.errors import RunFolderBusy, RunFolderError
from mcnav.files import arrow_table, is_temporary, numbers_in, parquet_bytes, read_whole, to_json, write_whole
from mcnav.scenarios.histories import check_history
from mcnav.scenarios.inputs import InputFile
from mcnav.scenarios.protocol import History, Panel
from mcnav.store.inputs import INPUTS, LARGEST_KEPT
from mcnav.store.manifest import FileRecord, Manifest, ManifestError, json_digest
from mcnav.store.parts import LARGEST_PART, MOST_ROWS, Part, Samples, in_order, put, room_for, table_from

CAMPAIGN, MANIFEST, SUMMARY, REPORT = "campaign.toml", "manifest.json", "summary.json", "report.html"
HISTORY, SAMPLES, LOCK = "history.parquet", "samples", ".lock"
EPOCHS, HISTORIES = "epochs.parquet", "histories.parquet"
TABLES: Final = "tables"
"""Folder of a run in which the tables of its campaign are kept."""

LARGEST_JSON: Final = 64_000_000
"""Bytes of a manifest or summary; a quarter of a million chunks."""

NOT_EACH_ONCE: Final = "does not hold each sample once, in order, with its status"

READERS: Final = 2
"""Threads that read and verify sample files."""

_REPLAY: Final = re.compile(r"replay_\d+\.(?:html|csv)")


def _as_text(content: Mapping[str, Any]) -> bytes:
    """Format a JSON file."""
    return (json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()


def _rows_of(part: Part, kept: int | None) -> int:
    """Count the rows of a part, of samples below ``kept`` where only these have rows."""
    return part.end - part.begin if kept is None else max(min(part.end, kept) - part.begin, 0)


class RunFolder:
    """One run folder.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Hold the folder's lock; it is freed by the end of the process, however it ends.

        Raises
        ------
        RunFolderBusy
            When another process holds it.
        RunFolderError
            When the folder cannot be made or written to.
        """
        lock = filelock.FileLock(self.path / LOCK)
        linked = [place for place in (self.path / LOCK, self.parts, *self._folders) if place.is_symlink()]
        if linked:
            raise RunFolderError(f"{linked[0]}: is a link to somewhere else, which no run makes; remove it")
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

    def manifest(self) -> Manifest | None:
        """Read the manifest; none when nothing has been run here.

        Raises
        ------
        RunFolderError
            When the manifest is damaged, or of a format that this version does not read.
        """
        remedy = "run the campaign again to mend it"
        content = self._json(MANIFEST, remedy)
        if content is None:
            return None
        try:
            whole = _as_text(content) == self._read(MANIFEST, remedy)
        except ValueError:
            whole = False
        if not whole or content.pop("checksum", None) != json_digest(content):
            raise RunFolderError(f"{self.path / MANIFEST}: is damaged or was edited; {remedy}")
        try:
            return Manifest.from_json(content)
        except ManifestError as fault:
            raise RunFolderError(
                f"{self.path / MANIFEST}: is not as this program writes it ({fault}); {remedy}"
            ) from None

    def check_exists(self) -> None:
        """Raise `RunFolderError` where there is no folder."""
        if not self.path.is_dir():
            missing = "it is a file" if self.path.exists() else "there is no such folder"
            raise RunFolderError(f"{self.path}: holds no run ({missing})")

    def existing_manifest(self) -> Manifest:
        """Read the manifest of a run, finished or not; `RunFolderError` when there is none."""
        self.check_exists()
        manifest = self.manifest()
        if manifest is None:
            raise RunFolderError(f"{self.path}: holds no run ({MANIFEST} is missing)")
        return manifest

    def finished_manifest(self) -> Manifest:
        """Read the manifest of a finished run; `RunFolderError` when there is none."""
        manifest = self.existing_manifest()
        if not manifest.complete:
            raise RunFolderError(
                f"{self.path}: the run is not finished; run the campaign again, it goes on where it stopped"
            )
        return manifest

    def write_manifest(self, manifest: Manifest) -> None:
        """Write the manifest with a checksum of itself."""
        content = manifest.to_json()
        self.write_json(MANIFEST, content | {"checksum": json_digest(content)})

    def summary(self) -> dict[str, Any]:
        """Read the analysed results.

        Raises
        ------
        RunFolderError
            When there are none, or they are not those of the run.
        """
        remedy = "run mcnav report on the folder"
        summary, manifest = self._json(SUMMARY, remedy), self.manifest()
        if summary is None or manifest is None:
            raise RunFolderError(f"{self.path}: holds no finished run; run the campaign first")
        same = all(summary.get(key) == getattr(manifest, key) for key in ("campaign", "samples", "seed", "design"))
        if not (manifest.complete and same):
            raise RunFolderError(f"{self.path / SUMMARY}: is not that of the run in this folder; {remedy}")
        return summary

    def _read(self, name: str, remedy: str) -> bytes | None:
        """Read a file of this folder; none when it is not there."""
        try:
            return read_whole(self.path / name, LARGEST_JSON)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as failure:
            told = failure.strerror or failure
            raise RunFolderError(f"{self.path / name}: cannot be read: {told}; {remedy}") from None

    def _json(self, name: str, remedy: str) -> dict[str, Any] | None:
        found = self._read(name, remedy)
        if found is None:
            return None
        try:
            content = json.loads(found.decode("utf-8"))
        except (ValueError, RecursionError):
            content = None
        if not isinstance(content, dict):
            raise RunFolderError(f"{self.path / name}: is damaged; {remedy}")
        return content

    def write_json(self, name: str, content: Mapping[str, Any]) -> None:
        """Write a JSON file of this folder."""
        self.write(name, _as_text(to_json(content)))

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

    def write_tables(self, tables: Mapping[str, bytes]) -> None:
        """Store the tables that the campaign file reads."""
        if tables:
            (self.path / TABLES).mkdir(exist_ok=True)
        for name, content in tables.items():
            self.write(name, content)

    def write_inputs(self, files: Sequence[InputFile]) -> None:
        """Keep copies of the files that the scenario reads, but for large ones.

        Raises
        ------
        RunFolderError
            When one has changed meanwhile, or the disk refuses it.
        """
        for file in files:
            if file.size > LARGEST_KEPT:
                continue
            try:
                content = read_whole(Path(file.path), LARGEST_KEPT)
            except OSError as failure:
                raise RunFolderError(f"{file.path}: cannot be read: {failure.strerror or failure}") from None
            if hashlib.sha256(content).hexdigest() != file.digest:
                raise RunFolderError(f"{file.path}: changed while the run began; run the campaign again")
            try:
                (self.path / INPUTS).mkdir(exist_ok=True)
            except OSError as failure:
                raise RunFolderError(f"{self.path / INPUTS}: cannot be made: {failure.strerror or failure}") from None
            self.write(f"{INPUTS}/{file.name}", content)

    def kept_input(self, record: FileRecord) -> Path | None:
        """Return the copy of a file that a manifest lists; none when there is none with that content."""
        path = self.path / INPUTS / record.name
        try:
            content = read_whole(path, LARGEST_KEPT)
        except OSError:
            return None
        return path if hashlib.sha256(content).hexdigest() == record.sha256 else None

    @property
    def _folders(self) -> tuple[Path, ...]:
        """Folders that some runs have beside that of their samples."""
        return self.path / TABLES, self.path / INPUTS

    def foreign(self) -> list[str]:
        """Names in the folder that no run writes."""
        own = {CAMPAIGN, MANIFEST, SUMMARY, REPORT, HISTORY, EPOCHS, HISTORIES, SAMPLES, TABLES, INPUTS, LOCK}
        if not self.path.is_dir():
            return []
        names = (entry.name for entry in self.path.iterdir())
        return sorted(name for name in names if name not in own and not (is_temporary(name) or _REPLAY.fullmatch(name)))

    def clear(self, needed: Sequence[Path] = ()) -> None:
        """Delete what a run wrote here, and nothing else; copies of inputs stay where the next run reads them."""
        self._clear_code()
        self._clear_inputs({path.resolve() for path in needed})
        for name in (MANIFEST, SUMMARY, REPORT, HISTORY, EPOCHS, HISTORIES, CAMPAIGN):
            (self.path / name).unlink(missing_ok=True)
        for part in (self.parts).glob("part-*.parquet"):
            part.unlink()
        for written in self.path.glob("replay_*"):
            if _REPLAY.fullmatch(written.name):
                written.unlink()
        for table in (self.path / TABLES).glob("*.csv"):
            table.unlink()

    def _clear_code(self) -> None:
        """Delete the copy of the user's own file, if it is still what the run wrote."""
        try:
            manifest = self.manifest()
            code = None if manifest is None else manifest.identity.code
            if code is None:
                return
            path = self.path / Path(code.file).name
            if path.suffix == ".py" and hashlib.sha256(path.read_bytes()).hexdigest() == code.sha256:
                path.unlink()
        except (RunFolderError, OSError, ValueError):
            return

    def _clear_inputs(self, needed: Set[Path]) -> None:
        """Delete the copies of files that the scenario read, if they are still what the run wrote."""
        try:
            manifest = self.manifest()
        except RunFolderError:
            return
        for record in () if manifest is None else manifest.files:
            path = self.kept_input(record)
            if path is not None and path.resolve() not in needed:
                path.unlink()
        with suppress(OSError):
            (self.path / INPUTS).rmdir()  # unless there is something else in it

    def remove_partial_files(self) -> None:
        """Delete what a killed process left half written."""
        for place in (self.path, self.parts, *self._folders):
            for entry in place.glob(".*.tmp"):
                if is_temporary(entry.name):
                    entry.unlink()

    @property
    def parts(self) -> Path:
        """Where the sample files are."""
        return self.path / SAMPLES

    def table(self, manifest: Manifest) -> pa.Table:
        """Read all samples of a finished run in order, every part verified.

        Raises
        ------
        RunFolderError
            When a part is missing, or its content is not what the manifest says.
        """
        self._refuse_strangers(manifest)
        with ThreadPoolExecutor(READERS) as readers:
            tables = list(readers.map(lambda part: self._verified(part, manifest.kept), manifest.parts))
        try:
            whole = pa.concat_tables(tables)
            ordered = in_order(whole)
        except (pa.ArrowException, KeyError):
            raise RunFolderError(f"{self.parts}: the chunks do not have the same columns") from None
        if not ordered:
            raise RunFolderError(f"{self.parts}: {NOT_EACH_ONCE}")
        return whole

    def samples(self, manifest: Manifest) -> Samples:
        """As `table`, as arrays, also of a run that goes on; each part is in memory only while it is copied."""
        if manifest.complete:
            self._refuse_strangers(manifest)
        parts, kept = manifest.parts, manifest.kept
        layout = manifest.sample_schema
        rows = [_rows_of(part, kept) for part in parts]
        begins = list(accumulate(rows, initial=0))
        sizes = [found.stat().st_size for found in self.parts.iterdir()]
        if begins[-1] > MOST_ROWS * sum(sizes) and len(sizes) >= len(parts):
            raise ValueError("it claims to have more samples than there is room for")
        samples = room_for(begins[-1], layout)

        def read(part: Part, begin: int) -> bool:
            table = self._verified(part, kept)
            try:
                put(table, layout, samples, begin)
                return in_order(table, begin)
            except (pa.ArrowException, KeyError, TypeError, ValueError):
                raise RunFolderError(f"{self.parts / part.file}: does not have this run's columns") from None

        with ThreadPoolExecutor(READERS) as readers:
            if not all(readers.map(read, parts, begins)):
                raise RunFolderError(f"{self.parts}: {NOT_EACH_ONCE}")
        return samples

    def _refuse_strangers(self, manifest: Manifest) -> None:
        """Raise `RunFolderError` when there are parts that the manifest does not list."""
        listed = {part.file for part in manifest.parts}
        for found in sorted(self.parts.iterdir()):
            if found.name not in listed and not found.name.startswith("."):
                raise RunFolderError(f"{found}: is not of this run; remove it, or run the campaign again with --fresh")

    def _verified(self, part: Part, kept: int | None) -> pa.Table:
        """Read the samples of one part."""
        path = self.parts / part.file
        try:
            content = read_whole(path, LARGEST_PART)
        except OSError as failure:
            raise RunFolderError(
                f"{path}: cannot be read: {failure.strerror or failure}; run the campaign again"
            ) from None
        if hashlib.sha256(content).hexdigest() != part.sha256:
            raise RunFolderError(f"{path}: is damaged (its checksum differs); run the campaign again to mend it")
        try:
            return table_from(content, _rows_of(part, kept))
        except (pa.ArrowException, ValueError, OSError) as failure:
            raise RunFolderError(f"{path}: is no chunk of this program ({failure})") from None

    def campaign(self) -> str:
        """Read the resolved campaign file.

        Raises
        ------
        RunFolderError
            When it cannot be read.
        """
        try:
            return read_whole(self.path / CAMPAIGN, LARGEST_JSON).decode("utf-8")
        except (OSError, UnicodeDecodeError) as failure:
            raise RunFolderError(f"{self.path / CAMPAIGN}: cannot be read; run the campaign again") from failure

    def write_history(self, history: History) -> None:
        """Store what was flown."""
        table = arrow_table(history.columns)
        panels = [asdict(panel) for panel in history.panels]
        marks = {"mcnav.events": json.dumps(dict(history.events)), "mcnav.panels": json.dumps(panels)}
        self.write(HISTORY, parquet_bytes(table.replace_schema_metadata(marks)))

    def history(self) -> History:
        """Read the history of the truth.

        Raises
        ------
        RunFolderError
            When it cannot be read.
        """
        try:
            table = table_from(read_whole(self.path / HISTORY, LARGEST_JSON))
            marks = table.schema.metadata or {}
            events, described = json.loads(marks[b"mcnav.events"]), json.loads(marks[b"mcnav.panels"])
            panels = tuple(
                Panel(**entry | {key: tuple(entry[key]) for key in ("y", "legend", "marks")}) for entry in described
            )
            columns = {name: numbers_in(table.column(name)) for name in table.column_names}
            return check_history(History(columns, events, panels))
        except (OSError, pa.ArrowException, KeyError, TypeError, ValueError, AttributeError, RecursionError) as failure:
            raise RunFolderError(f"{self.path / HISTORY}: is missing or damaged; run the campaign again") from failure

    def epochs(self) -> tuple[dict[str, Array], dict[str, Any]] | None:
        """Columns of ``epochs.parquet`` and what it says of itself; none where the run has none.

        Raises
        ------
        RunFolderError
            When it cannot be read.
        """
        path = self.path / EPOCHS
        if not path.exists():
            return None
        try:
            table = table_from(read_whole(path, LARGEST_JSON))
            described = json.loads((table.schema.metadata or {})[b"mcnav.epochs"])
        except (OSError, pa.ArrowException, KeyError, TypeError, ValueError, RecursionError) as failure:
            raise RunFolderError(f"{path}: is damaged; run the campaign again") from failure
        return {name: numbers_in(table.column(name)) for name in table.column_names}, described
