"""The section on where a run comes from: failed samples, accuracy, versions, campaign and files."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from markupsafe import Markup

from mcnav.errors import shortened
from mcnav.execution.shell import quote_word
from mcnav.report.document.parts import Facts, Folded, Lines, Note, Part, Section, folded, headed
from mcnav.report.document.table import CODE, Column, Table, counted
from mcnav.report.format import number
from mcnav.report.results.failures import FailureRow, failure_rows
from mcnav.report.results.model import RunAnalysis
from mcnav.store.chunk_files import ChunkFile
from mcnav.store.manifest import Manifest

POWERS: Final = re.compile(r"\b\d(\.\d+)?e[+-]\d+")
"""Numbers as Python writes them with powers of ten."""

CHUNKS: Final = 200
"""Files of samples whose checksums are listed."""


def provenance_section(content: RunAnalysis) -> Section:
    """Arrange what the run consists of."""
    inputs, failed = input_files(content.manifest), failure_rows(content)
    return Section("provenance", "Provenance", [
        *headed("Failed samples", _failed_table(failed) if failed else None),
        _facts(content),
        Folded("The campaign file", [Lines(content.campaign, "The campaign file")]),
        *folded("Input files", _input_table(inputs) if inputs else None),
        Folded("Checksums of the stored samples", _checksums(content.manifest)),
    ])  # fmt: skip


def _failed_table(rows: list[FailureRow]) -> Table[FailureRow]:
    columns: list[Column[FailureRow]] = [
        Column("Reason", lambda row: row.reason, kind="words"),
        Column("Samples", lambda row: row.count, form=counted),
        Column("Index", lambda row: row.first),
    ]
    replay = CODE("mcnav replay RUN INDEX")
    return Table(Markup("Reasons for failures. {} simulates a sample again.").format(replay), columns, rows)


def simulated_per_second(content: RunAnalysis) -> str:
    """Return how many samples a second were simulated; empty where that is not known of all."""
    execution = content.manifest.execution
    samples, seconds = (execution.samples, execution.seconds) if execution else (0, 0.0)
    return f"{samples / max(seconds, 1e-3):,.0f}" if samples == content.summary.samples else ""


def _facts(content: RunAnalysis) -> Facts:
    manifest, speed = content.manifest, simulated_per_second(content)
    versions = ", ".join(f"{name} {version}" for name, version in manifest.identity.versions.items())
    entries = [("Numerical accuracy", POWERS.sub(lambda match: number(float(match[0]), 2), manifest.accuracy))]
    if speed and manifest.execution:
        jobs = manifest.execution.jobs
        entries.append(("Speed", f"{speed} samples per second with {jobs} {'job' if jobs == 1 else 'jobs'}"))
    entries += [("Started", manifest.started), ("Versions", versions)]
    if manifest.commit:
        entries.append(("Commit of mcnav", CODE(shortened(manifest.commit))))
    identity = Markup(
        "{} (SHA-256 of campaign, engine and versions; this page shows the first digits, manifest.json all)"
    ).format(CODE(shortened(manifest.identity.digest)))
    again = CODE(f"mcnav run campaign.toml --engine {quote_word(content.summary.engine)}")
    rerun = Markup("{} in the run folder, which has the campaign file below.").format(again)
    return Facts([*entries, ("Identity of the run", identity), ("Rerun", rerun)], below=True)


@dataclass(frozen=True)
class InputFile:
    """A file of a run besides its campaign: a user's code, or what that reads."""

    name: str
    use: str
    bytes: int | None
    sha256: str
    copied: bool = True


def input_files(manifest: Manifest) -> list[InputFile]:
    """List the files of a run besides its campaign."""
    code = manifest.identity.code
    own = [] if code is None else [InputFile(code.file, "the scenario", None, code.sha256)]
    return own + [
        InputFile(file.name, file.setting or "opened by the scenario", file.bytes, file.sha256, file.copied)
        for file in manifest.files
    ]


def _input_table(rows: list[InputFile]) -> Table[InputFile]:
    columns: list[Column[InputFile]] = [
        Column("File", lambda row: row.name, kind="label"),
        Column("Use", lambda row: row.use + ("" if row.copied else " (no copy)"), kind="words"),
        Column("Bytes", lambda row: row.bytes, form=counted),
        Column("SHA-256", lambda row: CODE(shortened(row.sha256))),
    ]
    caption = "Files that the scenario consists of or reads. A copy is in the run folder unless noted."
    return Table(caption, columns, rows)


def _checksums(manifest: Manifest) -> list[Part]:
    columns: list[Column[ChunkFile]] = [
        Column("File", lambda row: row.file, kind="label"),
        Column("SHA-256", lambda row: CODE(shortened(row.sha256))),
    ]
    count = len(manifest.chunks)
    more = [Note(f"The first {CHUNKS} of {count}; manifest.json lists all.")] if count > CHUNKS else []
    return [Table("SHA-256 of every file in samples/", columns, manifest.chunks[:CHUNKS]), *more]
