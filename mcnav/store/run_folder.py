"""The run folder: what a run leaves behind, and all that a report needs.

``campaign.toml`` (resolved), ``manifest.json``, ``samples/part-*.parquet``, ``history.parquet``, where partial
derivatives are known over time ``development.parquet``, where the engine knows errors throughout the flight
``epochs.parquet`` and ``histories.parquet``, with a filter ``filter.parquet``, behind a smoother
``smoothed_histories.parquet``, ``summary.json``, ``report.html``, and
the Python file of a scenario of the user's own, which only ``mcnav run`` on the campaign beside it ever executes, with
the small files that it reads in ``inputs/``. A file is written under a temporary name and renamed when it is complete,
so that a file that is there is whole. The file of a chunk has the identity of its run and its place in it; it is
verified by its content, not because the manifest lists it.
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

from mcnav.arrays.types import Array
from mcnav.contract.history import NOMINAL_FLIGHT, History, Panel
from mcnav.entries.inputs import InputFile
from mcnav.errors import RunFolderBusy, RunFolderError
from mcnav.files.parquet import arrow_table, columns_in, parquet_bytes
from mcnav.files.parquet_reading import LARGEST_TABLE, MOST_EXPANSION, read_table, table_from
from mcnav.files.whole import INPUTS, is_temporary, read_whole, to_json, write_whole
from mcnav.store.chunk_files import (
    STATUS,
    ChunkFile,
    Samples,
    put,
    room_for,
)
from mcnav.store.development import development_in, development_table
from mcnav.store.histories import first_histories
from mcnav.store.inputs import LARGEST_COPY
from mcnav.store.manifest import FileRecord, Manifest, ModelRecord, PartialsRecord
from mcnav.store.run_files import (
    CAMPAIGN,
    DEVELOPMENT,
    EPOCHS,
    FILES,
    HISTORIES,
    HISTORY,
    LARGEST_JSON,
    LOCK,
    MANIFEST,
    SAMPLES,
    TABLES,
    as_text,
    check_exists,
    folders_of,
    json_digest,
    read_manifest,
    read_summary,
    refuse_links,
    remember_whole,
)
from mcnav.systems.histories import check_history

READERS: Final = 2
"""Threads that read and verify sample files."""

_REPLAY: Final = re.compile(r"replay_\d+\.(?:html|csv)")


def _rows_of(chunk: ChunkFile, stored_rows: int | None) -> int:
    """Count the rows of a chunk, of samples below ``stored_rows`` where only these have rows."""
    return chunk.end - chunk.begin if stored_rows is None else max(min(chunk.end, stored_rows) - chunk.begin, 0)


@contextmanager
def _reading(path: Path, fault: str) -> Iterator[None]:
    """Convert errors of a file that is missing or damaged into `RunFolderError`."""
    try:
        yield
    except (OSError, pa.ArrowException, LookupError, TypeError, ValueError, AttributeError, RecursionError) as failure:
        raise RunFolderError(f"{path}: {fault}; run the campaign again") from failure


class RunFolder:
    """One run folder."""

    def __init__(self, path: Path) -> None:
        self.path = path

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Hold the folder's lock; it is freed by the end of the process, however it ends.

        Raises `RunFolderBusy` when another process holds it; `RunFolderError` when the folder cannot be made or written
        to.
        """
        lock = filelock.FileLock(self.path / LOCK)
        refuse_links([self.path / LOCK, *folders_of(self.path)])
        try:
            self.chunk_folder.mkdir(parents=True, exist_ok=True)
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

        Raises `RunFolderError` when the manifest is damaged, or of a format that this version does not read, or when
        there are links in the folder.
        """
        return read_manifest(self.path, Manifest)

    def check_exists(self) -> None:
        """Raise `RunFolderError` where there is no folder."""
        check_exists(self.path)

    def existing_manifest(self) -> Manifest:
        """Read the manifest of a run, finished or not; `RunFolderError` when there is none."""
        self.check_exists()
        manifest = self.manifest()
        if manifest is None:
            lists = (
                f"; mcnav report --index {self.path} lists the runs in it"
                if any(self.path.glob(f"*/{MANIFEST}"))
                else ""
            )
            raise RunFolderError(f"{self.path}: holds no run ({MANIFEST} is missing){lists}")
        return manifest

    def finished_manifest(self) -> Manifest:
        """Read the manifest of a finished run with its partial derivatives over time.

        Raises `RunFolderError` when there is none, or one of the two files is damaged.
        """
        manifest = self.existing_manifest()
        if not manifest.complete:
            raise RunFolderError(
                f"{self.path}: the run is not finished; run the campaign again, it goes on where it stopped"
            )
        model = manifest.model
        if model.development_sha256 is None:
            return manifest
        known = self._development(model, model.development_sha256)
        return manifest.model_copy(update={"model": model.model_copy(update={"development": known})})

    def _development(self, model: ModelRecord, digest: str) -> PartialsRecord:
        """Read the partial derivatives over time; `RunFolderError` when they are not those of the manifest."""
        path = self.path / DEVELOPMENT
        with _reading(path, "is missing or damaged"):
            content = read_whole(path, LARGEST_JSON)
            if hashlib.sha256(content).hexdigest() != digest:
                raise ValueError("its checksum differs")
            return development_in(content, model)

    def summary(self) -> dict[str, Any]:
        """Read the analysed results; `RunFolderError` when there are none, or they are not those of the run."""
        self.manifest()  # all of it is checked, also what the summary does not repeat
        return read_summary(self.path)

    def write_json(self, name: str, content: Mapping[str, Any]) -> None:
        """Write a JSON file of this folder."""
        self.write(name, as_text(to_json(content)))

    def write(self, name: str, content: bytes) -> None:
        """Write a file of this folder, whole; `RunFolderError` when the disk refuses it."""
        try:
            (self.path / name).parent.mkdir(exist_ok=True)
            write_whole(self.path / name, content)
        except OSError as failure:
            raise RunFolderError(f"{self.path / name}: cannot be written: {failure.strerror or failure}") from None

    def begin(
        self, manifest: Manifest, history: History, files: Mapping[str, bytes], inputs: Sequence[InputFile]
    ) -> None:
        """Write what is known before samples are simulated.

        Parameters
        ----------
        files : mapping of str to bytes
            The campaign, its tables and the user's code, by their path in the folder.
        inputs : sequence of InputFile
            Files that the scenario reads; all but large ones are copied.

        Raises
        ------
        RunFolderError
            When an input has changed meanwhile, or the disk refuses a file.
        """
        # the manifest first: a folder with the user's code but no manifest would not be a run's
        for name, content in {**_manifest_files(manifest), HISTORY: history_table(history), **files}.items():
            self.write(name, content)
        for file in inputs:
            if file.size <= LARGEST_COPY:
                self.write(f"{INPUTS}/{file.name}", _content_of(file))

    def finish(self, manifest: Manifest, files: Mapping[str, bytes]) -> None:
        """Write files by name, then the manifest of the complete run."""
        for name, content in {**files, **_manifest_files(manifest)}.items():
            self.write(name, content)

    def copy_of(self, record: FileRecord) -> Path | None:
        """Return the copy of a file that a manifest lists; none when there is none with that content."""
        path = self.path / INPUTS / record.name
        try:
            content = read_whole(path, LARGEST_COPY)
        except OSError:
            return None
        return path if hashlib.sha256(content).hexdigest() == record.sha256 else None

    def foreign(self) -> list[str]:
        """Names in the folder that no run writes."""
        own = {*FILES, SAMPLES, TABLES, INPUTS, LOCK}
        if not self.path.is_dir():
            return []
        names = (entry.name for entry in self.path.iterdir())
        return sorted(name for name in names if name not in own and not (is_temporary(name) or _REPLAY.fullmatch(name)))

    def clear(self, needed: Sequence[Path] = ()) -> None:
        """Delete what a run wrote here, and nothing else; copies of inputs stay where the next run reads them."""
        self._clear_copies({path.resolve() for path in needed})
        for name in FILES:
            (self.path / name).unlink(missing_ok=True)
        replays = (path for path in self.path.glob("replay_*") if _REPLAY.fullmatch(path.name))
        for path in (*self.chunk_folder.glob("part-*.parquet"), *(self.path / TABLES).glob("*.csv"), *replays):
            path.unlink()

    def _clear_copies(self, needed: Set[Path]) -> None:
        """Delete the copies of the user's code and of inputs, if they are still what the run wrote."""
        try:
            manifest = self.manifest()
        except RunFolderError:
            return
        if manifest is None:
            return
        code = manifest.identity.code
        if code is not None:
            path = self.path / Path(code.file).name
            with suppress(OSError, ValueError):
                if path.suffix == ".py" and hashlib.sha256(path.read_bytes()).hexdigest() == code.sha256:
                    path.unlink()
        for record in manifest.files:
            copy = self.copy_of(record)
            if copy is not None and copy.resolve() not in needed:
                copy.unlink()
        with suppress(OSError):
            (self.path / INPUTS).rmdir()  # unless there is something else in it

    def remove_partial_files(self) -> None:
        """Delete what killed processes and workers left half written."""
        for place in (self.path, *folders_of(self.path)):
            for entry in place.glob(".*.tmp"):
                if is_temporary(entry.name):
                    entry.unlink(missing_ok=True)

    @property
    def chunk_folder(self) -> Path:
        """Folder of the files of samples."""
        return self.path / SAMPLES

    def samples(self, manifest: Manifest) -> Samples:
        """Read all samples in order, every file verified, also of a run that goes on.

        A file is in memory only while it is copied.

        Raises `RunFolderError` when a file is missing, or its content is not what the manifest says.
        """
        chunks, stored_rows, folder = manifest.chunks, manifest.stored_rows, self.chunk_folder
        present = sorted(folder.iterdir())
        if manifest.complete:
            _refuse_strangers(present, {chunk.file for chunk in chunks})
        layout = manifest.sample_schema
        begins = list(accumulate((_rows_of(chunk, stored_rows) for chunk in chunks), initial=0))
        columns = sum(map(len, (layout.errors, layout.outputs, layout.linear, layout.filter))) + 2
        room = LARGEST_TABLE + sum(min(MOST_EXPANSION * result.stat().st_size, LARGEST_TABLE) for result in present)
        if 8 * begins[-1] * columns > room and len(present) >= len(chunks):
            raise ValueError("it claims to have more samples than there is room for")
        samples = room_for(begins[-1], layout)

        def read(chunk: ChunkFile, begin: int) -> bool:
            table = _verified(folder / chunk.file, chunk, stored_rows)
            try:
                return put(table, layout, samples, begin)
            except (pa.ArrowException, KeyError, TypeError, ValueError):
                raise RunFolderError(f"{folder / chunk.file}: does not have this run's columns") from None

        with ThreadPoolExecutor(READERS) as readers:
            if not all(readers.map(read, chunks, begins)):
                raise RunFolderError(f"{folder}: does not hold each sample once, in order, with its status")
        return samples

    def campaign(self) -> str:
        """Read the resolved campaign file; `RunFolderError` when it cannot be read."""
        with _reading(self.path / CAMPAIGN, "cannot be read"):
            return read_whole(self.path / CAMPAIGN, LARGEST_JSON).decode("utf-8")

    def history(self) -> History:
        """Read the history of the truth; `RunFolderError` when it cannot be read."""
        with _reading(self.path / HISTORY, "is missing or damaged"):
            table = read_table(self.path / HISTORY, LARGEST_JSON)
            marks = table.schema.metadata or {}
            events, described = json.loads(marks[b"mcnav.events"]), json.loads(marks[b"mcnav.panels"])
            panels = tuple(
                Panel(**entry | {key: tuple(entry[key]) for key in ("y", "legend", "marks")}) for entry in described
            )
            outages = json.loads(marks.get(b"mcnav.outages", b"{}"))
            title = marks.get(b"mcnav.title", NOMINAL_FLIGHT.encode()).decode()
            return check_history(History(columns_in(table), events, panels, outages, title))

    def epochs(self) -> tuple[dict[str, Array], dict[str, Any]] | None:
        """Read the columns of ``epochs.parquet`` and its description; none where the run has none.

        Raises `RunFolderError` when it cannot be read.
        """
        path = self.path / EPOCHS
        if not path.exists():
            return None
        with _reading(path, "is damaged"):
            table = read_table(path, LARGEST_JSON)
            return columns_in(table), json.loads((table.schema.metadata or {})[b"mcnav.epochs"])

    def histories(
        self, samples: int, expected: Sequence[str] | None = None, name: str = HISTORIES
    ) -> tuple[str, Array, dict[str, Array]] | None:
        """Read the errors of the first samples at every epoch; none where the run has no histories.

        Parameters
        ----------
        expected : sequence of str, optional
            Outputs that the file must have, as ``name [unit]``; others are not read.
        name : str
            Of the file: those behind a smoother have one of their own.

        Returns
        -------
        label : str
            What the times are, as ``name [unit]``.
        times : ndarray, shape (m,)
        errors : dict of str to ndarray, shape (n, m)
            Of each output, keyed ``name [unit]``, SI; NaN where unknown.

        Raises
        ------
        RunFolderError
            When they cannot be read.
        """
        path = self.path / name
        if not path.exists():
            return None
        with _reading(path, "is damaged"):
            return first_histories(path, samples, expected)


def _manifest_files(manifest: Manifest) -> dict[str, bytes]:
    """Return the manifest, with a checksum of itself, after the file of partial derivatives over time."""
    content, known = manifest.to_json(), manifest.model.development
    files = {} if known is None else {DEVELOPMENT: development_table(manifest.model, known)}
    for table in files.values():
        content["model"]["development_sha256"] = hashlib.sha256(table).hexdigest()
    text = as_text(content | {"checksum": json_digest(content)})
    remember_whole(text)
    return {**files, MANIFEST: text}


def history_table(history: History) -> bytes:
    """Tabulate a history of the truth; events, panels and outages are metadata."""
    marks = {
        "mcnav.events": json.dumps(dict(history.events)),
        "mcnav.panels": json.dumps([asdict(panel) for panel in history.panels]),
    }
    if history.title != NOMINAL_FLIGHT:
        marks["mcnav.title"] = history.title
    if history.outages:
        marks["mcnav.outages"] = json.dumps(dict(history.outages))
    return parquet_bytes(arrow_table(history.columns).replace_schema_metadata(marks))


def _content_of(file: InputFile) -> bytes:
    """Read a file again; `RunFolderError` when it has changed."""
    try:
        content = read_whole(Path(file.path), LARGEST_COPY)
    except OSError as failure:
        raise RunFolderError(f"{file.path}: cannot be read: {failure.strerror or failure}") from None
    if hashlib.sha256(content).hexdigest() != file.digest:
        raise RunFolderError(f"{file.path}: changed while the run began; run the campaign again")
    return content


def _refuse_strangers(present: Sequence[Path], listed: Set[str]) -> None:
    """Raise `RunFolderError` when there are files that the manifest does not list."""
    for result in present:
        if result.name not in listed and not result.name.startswith("."):
            raise RunFolderError(f"{result}: is not of this run; remove it, or run the campaign again with --fresh")


def _verified(path: Path, chunk: ChunkFile, stored_rows: int | None) -> pa.Table:
    """Read the samples of one chunk."""
    try:
        content = read_whole(path, LARGEST_TABLE)
    except OSError as failure:
        raise RunFolderError(f"{path}: cannot be read: {failure.strerror or failure}; run the campaign again") from None
    if hashlib.sha256(content).hexdigest() != chunk.sha256:
        raise RunFolderError(f"{path}: is damaged (its checksum differs); run the campaign again to mend it")
    try:
        return table_from(content, _rows_of(chunk, stored_rows), STATUS)
    except (pa.ArrowException, ValueError, OSError) as failure:
        raise RunFolderError(f"{path}: is no chunk of this program ({failure})") from None
