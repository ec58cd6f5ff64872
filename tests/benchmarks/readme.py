"""The last benchmark into its page and, in three lines, into the README: ``python -m tests.benchmarks.readme``."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from tests.benchmarks.inertial.tables import sentence
from tests.benchmarks.tables import FINE, OURS, markdown

ROOT: Final = Path(__file__).parent.parent.parent
BEGIN: Final = "<!-- benchmarks: written by python -m tests.benchmarks.readme -->\n"
END: Final = "<!-- end of benchmarks -->\n"
PAGE: Final = "reports/benchmarks/benchmarks.md"


def excerpt(record: Mapping[str, Any], inertial: Mapping[str, Any] | None = None) -> str:
    """Make the sentences of the README: a trajectory with the fastest peer, the longest run, aided ones."""
    sentences = []
    for case in record["cases"][-1:]:
        rows = [
            row
            for row in record["peers"]
            if row["trajectory"] == case["trajectory"] and (row.get("at") or {}).get(FINE)
        ]
        times = {row["peer"]: row["at"][FINE]["microseconds"] for row in rows}
        others = {name: time for name, time in times.items() if not name.startswith(OURS)}
        if OURS in times and others:
            best = min(others, key=lambda name: others[name])
            sentences.append(
                f"On trajectory {case['trajectory']} a sample takes {times[OURS]:.2g} µs of one core with an "
                f"integration error below {FINE} sigma. The fastest other package ({best}) takes {others[best]:.2g} µs."
            )
    if record["growth"]:
        run = max(record["growth"]["samples"], key=lambda row: row["samples"])
        sentences.append(
            f"A run of {run['samples']:,} samples takes {run['seconds']:.0f} s from the command to the report, "
            f"with {run['jobs']} jobs and {run['megabytes']:.0f} MB of memory."
        )
    if inertial:
        sentences.append(sentence(inertial))
    sentences.append(f"All measurements, and how they are made: [Benchmarks]({PAGE}).")
    return textwrap.fill(" ".join(filter(None, sentences)), 120, break_on_hyphens=False)


def renewed(text: str, record: Mapping[str, Any], inertial: Mapping[str, Any] | None = None) -> str:
    """Make the README with new figures of the chapters.

    Raises
    ------
    ValueError
        When its marks are not there.
    """
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise ValueError(f"the README lacks its marks {BEGIN.strip()} and {END.strip()}")
    return f"{before}{BEGIN}\n{excerpt(record, inertial)}\n\n{END}{after}"


def records(folder: Path) -> tuple[dict[str, Any], *tuple[dict[str, Any] | None, ...]]:
    """Read the records of the chapters, in the order of `markdown`; none of one that has not been measured."""
    first, *further = (folder / f"{name}.json" for name in ("benchmarks", "inertial", "whole_runs", "waits"))
    known = [dict(json.loads(path.read_text(encoding="utf-8"))) if path.exists() else None for path in further]
    return (dict(json.loads(first.read_text(encoding="utf-8"))), *known)


if __name__ == "__main__":
    readme, known = ROOT / "README.md", records((ROOT / PAGE).parent)
    readme.write_text(renewed(readme.read_text(encoding="utf-8"), *known[:2]), encoding="utf-8")
    (ROOT / PAGE).write_text(markdown(*known), encoding="utf-8")
