"""Final results of a run as tables, from its summary: what `mcnav show` prints and `mcnav export` writes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from mcnav.analysis.summary import Summary
from mcnav.arrays.types import Array
from mcnav.contract.failure import message_of
from mcnav.contract.quantities import KINDS, end_words, kinds_of
from mcnav.report.columns.faults import faults_table
from mcnav.report.columns.filter_columns import groups_table, neglected_table, sensors_table, sigmas_table
from mcnav.report.columns.joint_columns import directions_table, ellipsoids_table, tests_table
from mcnav.report.columns.output_columns import outputs_table
from mcnav.report.columns.percentiles import percentiles_table
from mcnav.report.columns.requirements import allowed_table, requirements_table
from mcnav.report.columns.result_table import ResultTable, Row, Units, in_units
from mcnav.report.columns.vector_sizes import sizes_table
from mcnav.report.exports import export

CORRELATIONS: Final = "correlations"
"""Name of the row of a budget that correlations between sources contribute."""

SOBOL: Final = ("first_order", "first_order_standard_error", "total", "total_standard_error")
"""Sobol indices of a simulated budget."""


@dataclass(frozen=True)
class Quantity:
    """An output or source, the factor from SI to the unit of its numbers, and that unit."""

    name: str
    scale: float
    unit: str


@dataclass(frozen=True)
class Results:
    """A summary as JSON has it, and the units of the tables made of it."""

    summary: Summary
    units: Units

    def quantities(self, which: Literal["outputs", "sources"]) -> list[Quantity]:
        """Return the ``outputs`` or ``sources``."""
        entries = self.summary.outputs if which == "outputs" else self.summary.sources
        known = self.summary.shown_in.outputs if which == "outputs" else self.summary.shown_in.sources
        shown = known or [entry.unit for entry in entries]
        return [
            Quantity(entry.name, *in_units(entry.unit, unit, self.units))
            for entry, unit in zip(entries, shown, strict=True)
        ]


Build = Callable[[Results], ResultTable]


def final_tables(summary: Summary, units: Units = "shown") -> dict[str, ResultTable]:
    """Return the tables of final results by name, without those that have no rows.

    Raises
    ------
    LookupError, TypeError, ValueError, AttributeError, ArithmeticError
        When the summary is damaged.
    """
    results = Results(summary, units)
    tables = [build(results) for build in FINAL_TABLES]
    return {table.name: table for table in tables if len(table)}


def _of_rows(
    name: str, title: str, keys: int, rows: Callable[[Results], list[Row]]
) -> Callable[[Results], ResultTable]:
    """Return the builder of a table that people read as it is in data."""
    return lambda results: ResultTable.of_rows(name, title, keys, rows(results))


def _verdict(results: Results) -> list[Row]:
    return [
        {key: value for key, value in row.items() if key != "run"} for row in export.run_rows({"": results.summary})
    ]


def _budget(results: Results) -> list[Row]:
    """List the share of each cause in the linear variance of each output, and its sigma alone."""
    budget, causes, sources = results.summary.budget, results.summary.causes_of_errors, len(results.summary.sources)
    rows, outputs, kinds = [], results.quantities("outputs"), kinds_of(results.summary.outputs)
    for i in sorted(range(len(outputs)), key=lambda i: KINDS.index(kinds[i]) if kinds[i] else 0):
        output, of_kind = outputs[i], {"output_kind": kinds[i].lower()} if kinds[i] else {}
        for j, cause in enumerate(causes):
            rows.append({
                "output": output.name, "cause": cause, "kind": "source" if j < sources else "noise",
                "share": float(budget.shares[i, j]), "sigma": float(budget.contributions[i, j]) * output.scale,
                "unit": output.unit, "share_saved": float(budget.saved[i, j]), **of_kind,
            })  # fmt: skip
        rows.append({"output": output.name, "cause": CORRELATIONS, "kind": CORRELATIONS,
                     "share": float(budget.cross_terms[i]), "unit": output.unit, **of_kind})  # fmt: skip
    return rows


def budget_table(results: Results) -> ResultTable:
    """Tabulate the linear error budget."""
    return ResultTable.of_rows("budget", "Linear error budget", 2, _budget(results))


def _simulated_budget(results: Results) -> list[Row]:
    """List the variance with each source alone and without it, and Sobol indices."""
    flown, linear = results.summary.budget.flown, results.summary.covariance_linear
    alone, sobol = (None, None) if flown is None else (flown.alone, flown.sobol)
    if alone is None or alone.alone is None or alone.without is None:
        return []
    rows = []
    for i, output in enumerate(results.quantities("outputs")):
        for j, source in enumerate(results.quantities("sources")):
            row: Row = {"output": output.name, "source": source.name}
            for column, known in (("variance_alone", alone.alone), ("variance_without", alone.without)):
                for heading, numbers in ((column, known.variance), (f"{column}_standard_error", known.standard_error)):
                    value = numbers[i][j]
                    divided = value is not None and linear[i, i]
                    row[f"{heading}_ratio"] = value / float(linear[i, i]) if divided and value is not None else None
            for key in SOBOL if sobol is not None and sobol.first_order is not None else ():
                row[f"sobol_{key}"] = getattr(sobol, key)[i][j]
            rows.append(row)
    return rows


def _covariance(results: Results) -> list[Row]:
    """List covariances and correlations of each pair of outputs."""
    summary, outputs = results.summary, results.quantities("outputs")
    known = {"linear": summary.covariance_linear, "plain": summary.covariance_sample}
    known |= {"paired": summary.covariance_paired}
    known |= {} if summary.covariance_filter is None else {"filter": summary.covariance_filter}
    known = {kind: matrix for kind, matrix in known.items() if matrix.size}
    rows = []
    for i, one in enumerate(outputs):
        for j, other in enumerate(outputs[: i + 1]):
            scale = one.scale * other.scale
            row: Row = {"output": one.name, "other_output": other.name, "unit": f"({one.unit})({other.unit})"}
            row |= {f"covariance_{kind}": float(matrix[i, j]) * scale for kind, matrix in known.items()}
            row |= {f"correlation_{kind}": _correlation(matrix, i, j) for kind, matrix in known.items()}
            rows.append(row)
    return rows


def _correlation(matrix: Array, i: int, j: int) -> float | None:
    both = float(matrix[i, i] * matrix[j, j])
    return float(matrix[i, j]) / math.sqrt(both) if both > 0.0 else None


def _partials(results: Results) -> list[Row]:
    matrix = results.summary.partials
    return [
        {"output": output.name, "source": source.name, "partial": float(matrix[i, j]) * output.scale / source.scale,
         "unit": f"{output.unit} per {source.unit}"}
        for i, output in enumerate(results.quantities("outputs"))
        for j, source in enumerate(results.quantities("sources"))
    ]  # fmt: skip


def _sources(results: Results) -> list[Row]:
    summary = results.summary
    return [
        {"source": source.name, "unit": source.unit, "mean": float(summary.start_mean[j]) * source.scale,
         "sigma": math.sqrt(max(summary.start_covariance[j, j], 0.0)) * source.scale}
        for j, source in enumerate(results.quantities("sources"))
    ]  # fmt: skip


def _variance_breakdown(results: Results) -> list[Row]:
    """List the terms of the difference of plain and linear variance, over the linear one."""
    causes, linear = results.summary.causes, results.summary.covariance_linear
    if causes is None:
        return []
    terms = {**causes.terms, "total": causes.total, "paired": causes.paired}
    terms |= {"standard_error": causes.standard_error, "unscented": causes.unscented}
    return [
        {"output": output.name, "term": term, "share": float(values[i] / linear[i, i])}
        for i, output in enumerate(results.quantities("outputs"))
        for term, values in terms.items()
        if np.isfinite(values[i]) and linear[i, i]
    ]


def _failures(results: Results) -> list[Row]:
    failures = results.summary.failures
    return [{"reason": message_of(reason), "samples": count} for reason, count in failures.items()]


FINAL_TABLES: Final[tuple[Build, ...]] = (
    _of_rows("verdict", "Verdict", 1, _verdict),
    lambda results: outputs_table(results.summary, results.units),
    budget_table,
    _of_rows("simulated_budget", "Variance with each source alone and without it, over the linear variance", 2,
             _simulated_budget),
    lambda results: requirements_table(results.summary, results.units),
    lambda results: allowed_table(results.summary, results.units),
    lambda results: _of_rows(
        "covariance", f"Covariances and correlations of the {end_words(results.summary.outputs).many}", 2, _covariance
    )(results),
    lambda results: percentiles_table(results.summary, results.units),
    lambda results: sizes_table(results.summary, results.units),
    lambda results: tests_table(results.summary),
    lambda results: ellipsoids_table(results.summary),
    lambda results: directions_table(results.summary),
    _of_rows("variance_breakdown", "Terms of plain minus linear variance, over the linear variance", 2,
             _variance_breakdown),
    _of_rows("partials", "Partial derivatives P", 2, _partials),
    _of_rows("sources", "Error sources", 1, _sources),
    lambda results: groups_table(results.summary),
    lambda results: sigmas_table(results.summary, results.units),
    lambda results: sensors_table(results.summary),
    lambda results: neglected_table(results.summary, results.units),
    lambda results: faults_table(results.summary, results.units),
    _of_rows("failures", "Failed samples by reason", 1, _failures),
)  # fmt: skip
"""The tables in the order in which they are listed."""
