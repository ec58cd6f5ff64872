"""Results as rows of numbers in full precision, and as CSV and JSON.

Sources and outputs have the names that they have in campaign files. The column ``unit`` holds the unit of every
dimensional number of its row, which is the one that tables show.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mcnav._types import Array
from mcnav.report import sentences
from mcnav.report.requirements import shown_units, stated
from mcnav.scenarios.protocol import Output, Source
from mcnav.units import conversion

if TYPE_CHECKING:
    from mcnav.report.comparison import Row as Between

Row = dict[str, Any]


def output_rows(runs: Mapping[str, Mapping[str, Any]]) -> list[Row]:
    """List linear beside Monte Carlo, an output of a run a row; outputs in order, and for each the runs that have it.

    Parameters
    ----------
    runs : mapping of str to mapping
        Summaries by the name of the run.
    """
    units = {
        (entry["name"], entry["unit"]): shown_units(run)[entry["name"]][1]
        for run in [*runs.values()][::-1]
        for entry in run["outputs"]
    }
    names = dict.fromkeys((entry["name"], entry["unit"]) for run in runs.values() for entry in run["outputs"])
    rows = []
    for name, unit in names:
        for title, run in runs.items():
            at = [(entry["name"], entry["unit"]) for entry in run["outputs"]]
            if (name, unit) in at:
                shown = units[name, unit]
                about = {"run": title, "output": name, "unit": shown}
                rows.append(about | _compared(run, at.index((name, unit)), conversion(unit, shown)))
    return rows


def _compared(summary: Mapping[str, Any], i: int, scale: float) -> Row:
    """Numbers of one output; none where there is nothing to compare."""

    def at(key: str) -> float | None:
        values = summary.get(key) or []
        return values[i] if i < len(values) else None

    def scaled(key: str) -> float | None:
        value = at(key)
        return None if value is None else value * scale

    found: Row = {"sigma_linear": scaled("sigma_linear")}
    for kind, sigma, ratio in (
        ("paired", "sigma_paired", "sigma_ratio_paired"),
        ("plain", "sigma_sample", "sigma_ratio"),
    ):
        bounds = (summary.get(f"{ratio}_interval") or [None] * (i + 1))[i] or (None, None)
        low, high = bounds if None not in bounds else (None, None)
        found |= {f"sigma_{kind}": scaled(sigma), f"ratio_{kind}": at(ratio)}
        found |= {f"ratio_{kind}_from": low, f"ratio_{kind}_to": high}
    verdicts = sentences.verdict_words(summary)
    return found | {"verdict": verdicts[i] if verdicts else None, "samples": summary["samples"]}


def run_rows(runs: Mapping[str, Mapping[str, Any]]) -> list[Row]:
    """List the verdicts, a run a row."""
    same = ("campaign", "samples", "failed", "engine", "seed", "design", "verdict", "verdict_matrix")
    return [
        {"run": title} | {key: run.get(key) for key in same} | {"headline": sentences.headline(run)}
        for title, run in runs.items()
    ]


def requirement_rows(summary: Mapping[str, Any]) -> list[Row]:
    """List the requirements in words with what was found, a requirement a row."""
    units = shown_units(summary)
    return [
        {
            "requirement": stated(entry, units),
            "finding": entry["finding"],
            "samples_needed": entry["samples_needed"],
            "remark": entry["remark"],
        }
        for entry in summary["requirements"]
    ]


def with_changes(rows: Sequence[Row], runs: Sequence[str], found: Sequence[Between]) -> list[Row]:
    """Add to rows of outputs what has become of each since the first run; empty for the first run itself.

    Parameters
    ----------
    rows : sequence of dict
        Of `output_rows`.
    runs : sequence of str
        Names of the runs, in order.
    found : sequence of mcnav.report.comparison.Row
    """
    changed: dict[tuple[str, str], Row] = {}
    for row in found:
        told: Row = {"change": row.words}
        if row.change is not None:
            scale = conversion(row.unit, row.shown_in)
            told |= {
                "change_ratio": row.change.ratio,
                "change_ratio_from": row.change.interval[0],
                "change_ratio_to": row.change.interval[1],
                "change_mean": row.change.mean.value * scale,
                "change_mean_standard_error": row.change.mean.standard_error * scale,
                "common_draws": row.change.common,
            }
        changed[runs[row.run], row.output] = told
    return [{**row, **changed.get((row["run"], row["output"]), {})} for row in rows]


def partial_rows(sources: Sequence[Source], outputs: Sequence[Output], matrix: Array) -> list[Row]:
    """List partial derivatives, shape (outputs, sources), SI, one a row, in the unit of its row."""
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
    r"""Write rows as CSV in full precision; what is not known is empty.

    >>> as_csv([{"output": "x", "sigma": 0.1}, {"output": "y", "sigma": None}])
    'output,sigma\nx,0.1\ny,\n'
    """
    written = io.StringIO()
    keys = list(dict.fromkeys(key for row in rows for key in row))
    writer = csv.DictWriter(written, keys, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows({key: _finite(value) for key, value in row.items()} for row in rows)
    return written.getvalue()


def as_json(tables: Mapping[str, Any]) -> str:
    """Write tables by name as JSON in full precision; what is not known is null.

    >>> as_json({"outputs": [{"sigma": float("nan")}]}).split()
    ['{', '"outputs":', '[', '{', '"sigma":', 'null', '}', ']', '}']
    """
    return json.dumps(_finite(tables), indent=2, ensure_ascii=False) + "\n"


def _finite(value: Any) -> Any:
    """A value with numpy's numbers as Python's, and none in place of what is not finite."""
    if isinstance(value, Mapping):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(entry) for entry in value]
    value = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(value, float) and not math.isfinite(value) else value
