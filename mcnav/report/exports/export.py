"""Results as rows of numbers in full precision, and as CSV and JSON.

Sources and outputs are named as in campaign files. The column ``unit`` is the unit of every dimensional number in its
row, which is the unit shown in tables.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from mcnav.analysis.summary import Summary
from mcnav.arrays.types import Array
from mcnav.contract.quantities import Output, Source
from mcnav.physics.units import conversion
from mcnav.report.columns.result_table import Row
from mcnav.report.statements import verdicts

if TYPE_CHECKING:
    from mcnav.report.pages.comparison import Row as RowOfChange

EXPORTED: Final = (
    "change", "change_ratio", "change_ratio_from", "change_ratio_to", "change_mean", "change_mean_standard_error",
    "common_draws",
)  # fmt: skip
"""Cells of a change in CSV and JSON."""

FORMULA: Final = ("=", "+", "-", "@", "\t", "\r", "\n")
"""Beginnings of a text that spreadsheets take for a formula."""


def run_rows(runs: Mapping[str, Summary]) -> list[Row]:
    """List the verdicts, one row per run."""
    same = ("campaign", "samples", "failed", "engine", "seed", "design", "verdict", "verdict_matrix")
    return [
        {"run": title}
        | {key: getattr(run, key) for key in same}
        | {"headline": verdicts.headline(run)}
        | ({"filter": run.filter.verdict} if run.filter else {})
        for title, run in runs.items()
    ]


def with_changes(rows: Sequence[Row], runs: Sequence[str], changes: Sequence[RowOfChange]) -> list[Row]:
    """Add to the rows of outputs the change of each from the first run; rows of the first run have none."""
    changed: dict[tuple[str, str], Row] = {}
    for row in changes:
        cells = row.cells
        kept = EXPORTED if row.change is not None else EXPORTED[:1]
        changed[runs[row.run], row.output] = {name: cells[name] for name in kept}
    return [{**row, **changed.get((row["run"], row["output"]), {})} for row in rows]


def partial_rows(sources: Sequence[Source], outputs: Sequence[Output], matrix: Array) -> list[Row]:
    """List partial derivatives, given with shape (outputs, sources) in SI, one per row in the units shown."""
    return [
        {
            "output": output.name,
            "source": source.name,
            "partial": float(matrix[i, j])
            * conversion(source.shown_in, source.unit)
            * conversion(output.unit, output.shown_in),
            "unit": f"{output.shown_in} per {source.shown_in}",
        }
        for j, source in enumerate(sources)
        for i, output in enumerate(outputs)
    ]


def as_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    r"""Write rows as CSV in full precision; unknown values are empty.

    Texts and headings that a spreadsheet would read as formulas have an apostrophe before them.

    >>> as_csv([{"output": "x", "sigma": 0.1}, {"output": "=y()", "sigma": None}])
    "output,sigma\nx,0.1\n'=y(),\n"
    """
    written = io.StringIO()
    keys = dict.fromkeys(key for row in rows for key in row)
    writer = csv.writer(written, lineterminator="\n")
    writer.writerow(map(_harmless, keys))
    writer.writerows([_harmless(_finite(row.get(key))) for key in keys] for row in rows)
    return written.getvalue()


def _harmless(cell: Any) -> Any:
    """Put an apostrophe before a text that a spreadsheet would execute (OWASP, CSV injection)."""
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(FORMULA) else cell


def as_json(tables: Mapping[str, Any]) -> str:
    r"""Write tables by name as JSON in full precision; unknown values are null.

    What is not printable is escaped: JSON itself leaves characters that a terminal obeys.

    >>> as_json({"outputs": [{"sigma": float("nan")}]}).split()
    ['{', '"outputs":', '[', '{', '"sigma":', 'null', '}', ']', '}']
    >>> as_json({"\u202e": "\x9b31m"}).split()
    ['{', '"\\u202e":', '"\\u009b31m"', '}']
    """
    lines = json.dumps(_finite(tables), indent=2, ensure_ascii=False).split("\n")
    shown = (line if line.isprintable() else "".join(map(_escaped, line)) for line in lines)
    return "\n".join(shown) + "\n"


def _escaped(character: str) -> str:
    """Escape a character of JSON that is not printable."""
    if character.isprintable():
        return character
    units = character.encode("utf-16-be", "surrogatepass").hex()
    return "".join(f"\\u{units[at : at + 4]}" for at in range(0, len(units), 4))


def _finite(value: Any) -> Any:
    """Convert numpy numbers to Python's, and those that are not finite to none."""
    if isinstance(value, Mapping):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(entry) for entry in value]
    value = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(value, float) and not math.isfinite(value) else value
