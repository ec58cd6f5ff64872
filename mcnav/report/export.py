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

from mcnav._types import Array
from mcnav.contract.quantities import Output, Source
from mcnav.report import filter_verdict, sentences
from mcnav.report.model import shown_units
from mcnav.report.result_table import Row, Units
from mcnav.units import conversion

if TYPE_CHECKING:
    from mcnav.report.comparison import Row as RowOfChange

EXPORTED: Final = {
    "change": "change", "change_ratio": "ratio", "change_ratio_from": "from", "change_ratio_to": "to",
    "change_mean": "mean after less before", "change_mean_standard_error": "standard error",
    "common_draws": "common draws",
}  # fmt: skip
"""Names of a change's cells in CSV and JSON."""

FORMULA: Final = ("=", "+", "-", "@", "\t", "\r", "\n")
"""Beginnings of a text that spreadsheets take for a formula."""


def output_rows(runs: Mapping[str, Mapping[str, Any]], units: Units = "shown") -> list[Row]:
    """List linear and Monte Carlo sigmas, one row per output and run; ``runs`` are summaries by run name."""
    shown_in = {
        (entry["name"], entry["unit"]): shown_units(run)[entry["name"]][1]
        for run in [*runs.values()][::-1]
        for entry in run["outputs"]
    }
    rows = []
    for name, unit in dict.fromkeys(
        (entry["name"], entry["unit"]) for run in runs.values() for entry in run["outputs"]
    ):
        for title, run in runs.items():
            at = [(entry["name"], entry["unit"]) for entry in run["outputs"]]
            if (name, unit) in at:
                shown = shown_in[name, unit] if units == "shown" else unit
                scale = conversion(unit, shown)
                rows.append({"run": title, "output": name, "unit": shown} | _sigmas(run, at.index((name, unit)), scale))
    return rows


def _sigmas(summary: Mapping[str, Any], i: int, scale: float) -> Row:
    """Return sigmas, ratios and verdict of one output; none where nothing was compared."""

    def at(key: str, factor: float = 1.0) -> Any:
        values = summary.get(key)
        value = None if values is None or i >= len(values) else values[i]
        return value if value is None or factor == 1.0 else value * factor

    row: Row = {"sigma_linear": at("sigma_linear", scale)}
    for kind, sigma, ratio in (
        ("paired", "sigma_paired", "sigma_ratio_paired"), ("plain", "sigma_sample", "sigma_ratio"),
    ):  # fmt: skip
        bounds = at(f"{ratio}_interval") or (None, None)
        low, high = bounds if None not in bounds else (None, None)
        row |= {f"sigma_{kind}": at(sigma, scale), f"ratio_{kind}": at(ratio)}
        row |= {f"ratio_{kind}_from": low, f"ratio_{kind}_to": high}
    if summary.get("beyond_range"):
        row = dict.fromkeys(row) | {"sigma_plain": row["sigma_plain"]}
        return row | {"verdict": sentences.BEYOND, "samples": summary["samples"]}
    verdicts = sentences.verdict_words(summary)
    return row | {"verdict": verdicts[i] if verdicts else None, "samples": summary["samples"]}


def run_rows(runs: Mapping[str, Mapping[str, Any]]) -> list[Row]:
    """List the verdicts, one row per run."""
    same = ("campaign", "samples", "failed", "engine", "seed", "design", "verdict", "verdict_matrix")
    return [
        {"run": title}
        | {key: run.get(key) for key in same}
        | {"headline": sentences.headline(run)}
        | ({"filter": filter_verdict.verdict(run)} if run.get("filter") else {})
        for title, run in runs.items()
    ]


def with_changes(rows: Sequence[Row], runs: Sequence[str], changes: Sequence[RowOfChange]) -> list[Row]:
    """Add to `output_rows` the change of each output from the first run; rows of the first run have none."""
    changed: dict[tuple[str, str], Row] = {}
    for row in changes:
        cells = row.cells
        kept = EXPORTED if row.change is not None else {"change": EXPORTED["change"]}
        changed[runs[row.run], row.output] = {name: cells[key] for name, key in kept.items()}
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
