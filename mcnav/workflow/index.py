"""All runs of a folder on one page: verdict, sigmas, date, and what went in."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

from mcnav.analysis.summary import Summary
from mcnav.errors import RunFolderError, reading_file
from mcnav.files import write_whole
from mcnav.report import filter_verdict, sentences
from mcnav.report.format import number
from mcnav.report.html import filled
from mcnav.report.model import humanize, shown_units
from mcnav.store.run_folder import MANIFEST, REPORT, SUMMARY, RunFolder

DEEPEST: Final = 3
"""Folders below the one that is looked through."""

INDEX: Final = "index.html"
HASH: Final = 10
"""Digits shown of what identifies a run."""


def write_index(folder: Path) -> tuple[Path, int]:
    """Write ``index.html`` of all runs in a folder and below it.

    Returns
    -------
    written : Path
    runs : int
        Number of runs on the page.
    """
    runs, others = [], []
    for place in _below(folder, DEEPEST):
        if (place / MANIFEST).exists():
            runs.append(_entry(folder, place))
        else:
            others += [_link(folder, page) for page in sorted(place.glob("*.html")) if page.name != INDEX]
    written = folder / INDEX
    filters = any(run.get("filter") for run in runs)
    write_whole(written, filled("index.html", runs=runs, others=others, filters=filters).encode())
    return written, len(runs)


def _below(folder: Path, depth: int) -> list[Path]:
    """Walk a folder and those in it in order of their names, but neither into run folders nor along links."""
    result = [folder]
    if depth and not (folder / MANIFEST).exists():
        entries = (entry for entry in folder.iterdir() if entry.is_dir() and not entry.is_symlink())
        inside = sorted(entry for entry in entries if not entry.name.startswith("."))
        result += [place for entry in inside for place in _below(entry, depth - 1)]
    return result


def _link(folder: Path, page: Path) -> dict[str, str]:
    path = Path(os.path.relpath(page, folder)).as_posix()
    return {"href": quote(path), "path": path}


def _entry(folder: Path, place: Path) -> dict[str, Any]:
    """Build a run's row; a run that cannot be read has the reason."""
    entry: dict[str, Any] = _link(folder, place / REPORT) | {"folder": place.name, "report": (place / REPORT).exists()}
    try:
        with reading_file(place / SUMMARY):
            run = RunFolder(place)
            summary, manifest = Summary.of(run.summary()), run.existing_manifest()
            units = shown_units(summary)
            counts = summary.counts
            sigmas = summary.sigma_paired or summary.sigma_linear.tolist()
            return entry | {
                "name": summary.campaign,
                "tone": sentences.tone(summary),
                "standing": sentences.standing(summary),
                "headline": sentences.headline(summary),
                "warning": "" if summary.unsettled is None else sentences.unsettled(summary.unsettled),
                "filter": filter_verdict.verdict(summary),
                "filter_tone": filter_verdict.TONES.get(filter_verdict.verdict(summary), ""),
                "filter_headline": filter_verdict.headline(summary),
                "samples": f"{summary.samples:,}",
                "failed": f"{summary.failed:,}",
                "sigmas": [
                    (humanize(name), number(sigma * units[name][0], 4), units[name][1])
                    for name, sigma in zip(summary.names, sigmas, strict=True)
                ],
                "date": manifest.started[:10],
                "hash": manifest.identity.digest[:HASH],
                "requirements": counts and f"{counts.met} of {counts.of} met",
                "requirements_tone": counts and sentences.tone_of(counts),
            }  # fmt: skip
    except RunFolderError as failure:
        return entry | {"name": place.name, "tone": "", "failure": str(failure).replace(str(place), place.name)}
