"""The figures of the last benchmark into the README, between its marks: ``python -m tests.benchmarks.readme``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from tests.benchmarks.kernel import sentence
from tests.benchmarks.tables import growth_tables, peers_table

ROOT: Final = Path(__file__).parent.parent.parent
BEGIN: Final = "<!-- benchmarks: written by python -m tests.benchmarks.readme -->\n"
END: Final = "<!-- end of benchmarks -->\n"


def excerpt(record: Mapping[str, Any]) -> str:
    """What the README shows of a record."""
    machine = record["machine"]
    parts = [f"{machine['processor']}, {machine['cores']} cores, Python {machine['python']}, {machine['date']}."]
    for case in record["cases"]:
        rows = [row for row in record["peers"] if row["trajectory"] == case["trajectory"]]
        parts += [f"Trajectory {case['trajectory']} ({case['minutes']:.0f} minutes):", peers_table(rows)]
    if record["growth"]:
        parts += ["Whole runs of trajectory 4, from the start of the process to the finished report:"]
        parts += growth_tables(record["growth"], record["stages"])
    parts += [
        f"What bounds the kernel on trajectory {found['trajectory']}: {sentence(found['bound'])}."
        for found in record["kernel"]
    ]
    return "\n\n".join(parts)


def renewed(text: str, record: Mapping[str, Any]) -> str:
    """The README with new figures.

    Raises
    ------
    ValueError
        When its marks are not there.
    """
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise ValueError(f"the README lacks its marks {BEGIN.strip()} and {END.strip()}")
    return f"{before}{BEGIN}\n{excerpt(record)}\n\n{END}{after}"


if __name__ == "__main__":
    path = ROOT / "README.md"
    known = json.loads((ROOT / "reports" / "benchmarks" / "benchmarks.json").read_text())
    path.write_text(renewed(path.read_text(encoding="utf-8"), known), encoding="utf-8")
