"""Final results of a run as tables, from its summary: what `mcnav show` prints and `mcnav export` writes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from mcnav.contract.failure import message_of
from mcnav.report import export
from mcnav.report.model import shown_units
from mcnav.report.requirements import stated
from mcnav.report.result_table import ResultTable, Row, Units, in_units

CORRELATIONS: Final = "correlations"
"""Name of the row of a budget that correlations between sources contribute."""

SIMULATED: Final = {"alone": "variance_alone", "without": "variance_without"}
"""Columns of the simulated budget, by the key of the summary."""


@dataclass(frozen=True)
class Quantity:
    """An output or source, the factor from SI to the unit of its numbers, and that unit."""

    name: str
    scale: float
    unit: str


@dataclass(frozen=True)
class Results:
    """A summary as JSON has it, and the units of the tables made of it."""

    summary: Mapping[str, Any]
    units: Units

    def quantities(self, which: str) -> list[Quantity]:
        """Return the ``outputs`` or ``sources``."""
        entries = self.summary[which]
        shown = self.summary.get("shown_in", {}).get(which) or [entry["unit"] for entry in entries]
        return [
            Quantity(str(entry["name"]), *in_units(str(entry["unit"]), str(unit), self.units))
            for entry, unit in zip(entries, shown, strict=True)
        ]

    @property
    def causes(self) -> list[str]:
        """Names of the sources and, after them, of the processes of noise."""
        return [str(entry["name"]) for key in ("sources", "processes") for entry in self.summary.get(key) or ()]


def final_tables(summary: Mapping[str, Any], units: Units = "shown") -> dict[str, ResultTable]:
    """Return the tables of final results by name, without those that have no rows.

    Parameters
    ----------
    summary : mapping
        Content of ``summary.json``.

    Raises
    ------
    LookupError, TypeError, ValueError, AttributeError, ArithmeticError
        When the summary is damaged.
    """
    results = Results(summary, units)
    tables = [
        ResultTable.of_rows(name, title, keys, rows(results)) for name, (title, keys, rows) in FINAL_TABLES.items()
    ]
    return {table.name: table for table in tables if len(table)}


def _verdict(results: Results) -> list[Row]:
    return [
        {key: value for key, value in row.items() if key != "run"} for row in export.run_rows({"": results.summary})
    ]


def _outputs(results: Results) -> list[Row]:
    """List sigmas, ratios, verdict and bias, a row for each output."""
    summary, quantities = results.summary, results.quantities("outputs")
    unscented = (summary.get("unscented") or {}).get("covariance")
    higher = (summary.get("higher_order") or {}).get("sigma")
    rows = export.output_rows({"": summary}, results.units)
    for i, (row, output) in enumerate(zip(rows, quantities, strict=True)):
        del row["run"]
        row |= {
            "samples_needed": _at(summary["samples_needed"], i),
            "mean_linear": _scaled(_at(summary["mean_linear"], i), output.scale),
            "mean_plain": _scaled(_at(summary["mean_sample"], i), output.scale),
            "bias": _scaled(_at(summary["bias"], i), output.scale),
            "bias_standard_error": _scaled(_at(summary["bias_standard_error"], i), output.scale),
            "detectable_difference": _at(summary.get("detectable_ratio_paired"), i),
            "sigma_unscented": None if unscented is None else math.sqrt(max(unscented[i][i], 0.0)) * output.scale,
            "sigma_higher_order": _scaled(_at(higher, i), output.scale),
            **{key: _at(summary.get(key), i) for key in ("skewness", "excess_kurtosis")},
        }
        if summary.get("filter"):
            row["sigma_filter"] = _scaled(_at(summary.get("sigma_filter"), i), output.scale)
    return rows


def _budget(results: Results) -> list[Row]:
    """List the share of each cause in the linear variance of each output, and its sigma alone."""
    budget, causes, sources = results.summary["budget"], results.causes, len(results.summary["sources"])
    rows = []
    for i, output in enumerate(results.quantities("outputs")):
        for j, cause in enumerate(causes):
            rows.append({
                "output": output.name, "cause": cause, "kind": "source" if j < sources else "noise",
                "share": budget["shares"][i][j], "sigma": _scaled(budget["contributions"][i][j], output.scale),
                "unit": output.unit, "share_saved": budget["saved"][i][j],
            })  # fmt: skip
        rows.append({"output": output.name, "cause": CORRELATIONS, "kind": CORRELATIONS,
                     "share": budget["cross_terms"][i], "unit": output.unit})  # fmt: skip
    return rows


def _simulated_budget(results: Results) -> list[Row]:
    """List the variance with each source alone and without it, and Sobol indices."""
    flown, linear = results.summary["budget"].get("flown") or {}, results.summary["covariance_linear"]
    alone, sobol = flown.get("alone") or {"failed": ""}, flown.get("sobol") or {"failed": ""}
    if "failed" in alone:
        return []
    rows = []
    for i, output in enumerate(results.quantities("outputs")):
        for j, source in enumerate(results.quantities("sources")):
            row: Row = {"output": output.name, "source": source.name}
            for key, column in SIMULATED.items():
                for cell, heading in (("variance", column), ("standard_error", f"{column}_standard_error")):
                    value = alone[key][cell][i][j]
                    row[f"{heading}_ratio"] = value / linear[i][i] if value is not None and linear[i][i] else None
            for key in ("first_order", "total") if "failed" not in sobol else ():
                row |= {f"sobol_{key}": sobol[key][i][j]}
                row |= {f"sobol_{key}_standard_error": sobol[f"{key}_standard_error"][i][j]}
            rows.append(row)
    return rows


def _covariance(results: Results) -> list[Row]:
    """List covariances and correlations of each pair of outputs."""
    summary, outputs = results.summary, results.quantities("outputs")
    kinds = {"linear": "linear", "plain": "sample", "paired": "paired", "filter": "filter"}
    known = {kind: matrix for kind, key in kinds.items() if (matrix := summary.get(f"covariance_{key}"))}
    rows = []
    for i, one in enumerate(outputs):
        for j, other in enumerate(outputs[: i + 1]):
            scale = one.scale * other.scale
            row: Row = {"output": one.name, "other_output": other.name, "unit": f"({one.unit})({other.unit})"}
            row |= {f"covariance_{kind}": _scaled(matrix[i][j], scale) for kind, matrix in known.items()}
            row |= {f"correlation_{kind}": _correlation(matrix, i, j) for kind, matrix in known.items()}
            rows.append(row)
    return rows


def _correlation(matrix: Sequence[Sequence[float | None]], i: int, j: int) -> float | None:
    product, both = matrix[i][j], (matrix[i][i] or 0.0) * (matrix[j][j] or 0.0)
    return None if product is None or both <= 0.0 else product / math.sqrt(both)


def _partials(results: Results) -> list[Row]:
    matrix = results.summary["partials"]
    return [
        {"output": output.name, "source": source.name, "partial": matrix[i][j] * output.scale / source.scale,
         "unit": f"{output.unit} per {source.unit}"}
        for i, output in enumerate(results.quantities("outputs"))
        for j, source in enumerate(results.quantities("sources"))
    ]  # fmt: skip


def _sources(results: Results) -> list[Row]:
    summary = results.summary
    return [
        {"source": source.name, "unit": source.unit, "mean": _scaled(summary["start_mean"][j], source.scale),
         "sigma": math.sqrt(max(summary["start_covariance"][j][j], 0.0)) * source.scale}
        for j, source in enumerate(results.quantities("sources"))
    ]  # fmt: skip


def _requirements(results: Results) -> list[Row]:
    """List each requirement with its estimate, bounds and linear value; ratios and probabilities have no unit."""
    rows, words = [], shown_units(results.summary)
    outputs = {output.name: output for output in results.quantities("outputs")}
    for entry in results.summary["requirements"]:
        without = entry["kind"] in ("sigma_ratio", "box")
        first = outputs[entry["outputs"][0]]
        scale, unit = (1.0, "") if without else (first.scale, first.unit)
        low, high = entry["interval"]
        rows.append({
            "requirement": stated(entry, words), "finding": entry["finding"], "unit": unit,
            "estimate": _scaled(entry["estimate"], scale), "lower_bound": _scaled(low, scale),
            "upper_bound": _scaled(high, scale), "linear": _scaled(entry["linear"], scale),
            "linear_meets": entry["linear_meets"], "samples_needed": entry["samples_needed"],
            "time": entry.get("time"), "remark": entry["remark"],
        })  # fmt: skip
    return rows


def _allowed_sigmas(results: Results) -> list[Row]:
    """List the largest sigma of each source that meets each requirement, the others unchanged."""
    rows, words, covariance = [], shown_units(results.summary), results.summary["start_covariance"]
    for entry in results.summary["requirements"]:
        for j, source in enumerate(results.quantities("sources") if entry.get("largest_sigmas") else ()):
            now = math.sqrt(max(covariance[j][j], 0.0))
            if now > 0.0:
                rows.append({
                    "requirement": stated(entry, words), "source": source.name, "unit": source.unit,
                    "sigma": now * source.scale, "largest_sigma": _scaled(entry["largest_sigmas"][j], source.scale),
                })  # fmt: skip
    return rows


def _percentiles(results: Results) -> list[Row]:
    outputs, rows = {output.name: output for output in results.quantities("outputs")}, []
    for entry in results.summary["tails"]:
        first, names = outputs[entry["outputs"][0]], entry["outputs"]
        row: Row = {"output": names[0], "other_output": names[1] if len(names) > 1 else ""}
        row |= {"probability": entry["probability"], "unit": first.unit}
        row |= {key: _scaled(entry[key], first.scale) for key in ("estimate", "lower", "upper", "linear")}
        low, high = (_scaled(end, first.scale) for end in entry.get("together") or (None, None))  # none before 0.1
        rows.append(row | {"joint_from": low, "joint_to": high, "verdict": entry.get("verdict")})
    return rows


def _variance_breakdown(results: Results) -> list[Row]:
    """List the terms of the difference of plain and linear variance, over the linear one."""
    rows, linear = results.summary.get("causes"), results.summary["covariance_linear"]
    if not rows:
        return []
    terms = {**rows["terms"], **{key: rows[key] for key in ("total", "paired", "standard_error", "unscented")}}
    return [
        {"output": output.name, "term": term, "share": values[i] / linear[i][i]}
        for i, output in enumerate(results.quantities("outputs"))
        for term, values in terms.items()
        if values[i] is not None and linear[i][i]
    ]


def _tests(results: Results) -> list[Row]:
    rows = results.summary.get("tests") or {}
    return [
        {"test": name, "statistic": test["statistic"],
         "degrees_of_freedom": ", ".join(f"{each:g}" for each in test["degrees_of_freedom"]),
         "p_value": test["p_value"], "rank": test["rank"]}
        for name, test in rows.items()
        if test
    ]  # fmt: skip


def _ellipsoids(results: Results) -> list[Row]:
    return [
        {"level": entry["level"], "share": entry["share"], "from": entry["interval"][0], "to": entry["interval"][1]}
        for entry in results.summary.get("contained") or ()
    ]


def _directions(results: Results) -> list[Row]:
    """List the principal directions: weights of the outputs in units of their linear sigmas."""
    names = [output.name for output in results.quantities("outputs")]
    rows = zip(results.summary["principal_ratios"], results.summary["principal_directions"], strict=True)
    return [{"direction": k, "sigma_ratio": ratio, **dict(zip(names, weights, strict=True))}
            for k, (ratio, weights) in enumerate(rows)]  # fmt: skip


def _failures(results: Results) -> list[Row]:
    failures = results.summary["failures"]
    return [{"reason": message_of(reason), "samples": count} for reason, count in failures.items()]


def _ends(name: str, interval: Sequence[float | None] | None) -> Row:
    low, high = interval or (None, None)
    return {f"{name}_from": low, f"{name}_to": high}


def _finding(entry: Mapping[str, Any]) -> Row:
    """Return the cells of a verdict on a ratio over time."""
    return {
        "verdict": entry["verdict"], "worst_ratio": entry["factor"], **_ends("worst_ratio", entry["factor_interval"]),
        **{f"time_{key}": entry[key] for key in ("worst", "begin", "end")},
        "samples_needed": entry["samples_needed"], "remark": entry["remark"],
    }  # fmt: skip


def _filter_groups(results: Results) -> list[Row]:
    rows = results.summary.get("filter") or {"groups": {}}
    return [
        {"group": name, "states": entry["size"], "nees": entry["nees_mean"], **_ends("nees", entry["nees_interval"]),
         **_ends("nees_bounds", entry["nees_bounds"]), "ratio": entry["ratio"],
         **_ends("ratio", entry["ratio_interval"]), "ratio_linear": entry["ratio_linear"], **_finding(entry)}
        for name, entry in rows["groups"].items()
    ]  # fmt: skip


def _filter_sigmas(results: Results) -> list[Row]:
    """List true and filter sigma at the end, of every output and every other state of the filter."""
    filter_sigmas, rows = results.summary.get("filter") or {"outputs": {}, "states": {}}, []
    shown = {output.name: output for output in results.quantities("outputs")}
    for kind in ("outputs", "states"):
        for name, entry in filter_sigmas[kind].items():
            quantity = shown.get(name) if kind == "outputs" else None
            scale, unit = (1.0, entry["unit"]) if quantity is None else (quantity.scale, quantity.unit)
            row: Row = {"state": name, "kind": kind.removesuffix("s"), "unit": unit}
            row |= {key: _scaled(entry[key], scale) for key in ("sigma_true", "sigma_filter")}
            row |= {"ratio": entry["ratio"], **_ends("ratio", entry["ratio_interval"])}
            row["ratio_linear"] = entry["ratio_linear"]
            rows.append(row | {key: entry.get(key) for key in ("within_1", "within_3")} | _finding(entry))
    return rows


def _filter_sensors(results: Results) -> list[Row]:
    rows = results.summary.get("filter") or {"sensors": {}}
    return [
        {"sensor": name, "components": entry["size"], "accepted": entry["accepted"], "rejected": entry["rejected"],
         "nis": entry["nis_mean"], **_ends("nis", entry["nis_interval"]), **_ends("nis_bounds", entry["nis_bounds"]),
         "nis_beyond": entry["nis_beyond"], "correlation": entry["correlation"],
         "correlation_bound": entry["correlation_bound"], "correlation_beyond": entry["correlation_beyond"],
         "verdict": entry["verdict"]}
        for name, entry in rows["sensors"].items()
    ]  # fmt: skip


def _neglected(results: Results) -> list[Row]:
    """List the errors that make a filter optimistic: their variances over the sum of all differences."""
    neglected = results.summary.get("filter") or {"neglected": ()}
    rows, outputs = [], {output.name: output for output in results.quantities("outputs")}
    for entry in neglected["neglected"]:
        output = outputs[neglected.get("neglected_output") or neglected["output"]]
        sigmas = {f"sigma_{key}": math.sqrt(max(entry[key], 0.0)) * output.scale for key in ("true", "believed")}
        row: Row = {"cause": entry["name"], "output": output.name, "unit": output.unit, **sigmas}
        rows.append(row | {"share": entry["share"]})
    return rows


def _at(values: Sequence[Any] | None, i: int) -> Any:
    """Return an entry of a list that is empty where nothing was compared."""
    return None if values is None or i >= len(values) else values[i]


def _scaled(value: float | None, scale: float) -> float | None:
    return None if value is None else value * scale


FINAL_TABLES: Final[Mapping[str, tuple[str, int, Callable[[Results], list[Row]]]]] = {
    "verdict": ("Verdict", 1, _verdict),
    "outputs": ("Linear and Monte Carlo sigmas of the final errors", 1, _outputs),
    "budget": ("Linear error budget", 2, _budget),
    "simulated_budget": ("Variance with each source alone and without it, over the linear variance", 2,
                         _simulated_budget),
    "requirements": ("Requirements", 1, _requirements),
    "allowed_sigmas": ("Largest source sigmas that meet each requirement, by linear analysis", 2, _allowed_sigmas),
    "covariance": ("Covariances and correlations of the final errors", 2, _covariance),
    "percentiles": ("Quantiles of the errors' absolute values; of two outputs the CEP", 3, _percentiles),
    "tests": ("Tests of all outputs together", 1, _tests),
    "ellipsoids": ("Share of samples within the linear ellipsoids", 1, _ellipsoids),
    "principal_directions": ("Principal directions of the difference", 1, _directions),
    "variance_breakdown": ("Terms of plain minus linear variance, over the linear variance", 2, _variance_breakdown),
    "partials": ("Partial derivatives P", 2, _partials),
    "sources": ("Error sources", 1, _sources),
    "filter_groups": ("True over filter sigma by groups of states", 1, _filter_groups),
    "filter_sigmas": ("True and filter sigma at the end", 1, _filter_sigmas),
    "filter_sensors": ("Innovations over the whole flight", 1, _filter_sensors),
    "neglected": ("Errors that the filter neglects", 1, _neglected),
    "failures": ("Failed samples by reason", 1, _failures),
}  # fmt: skip
"""Title, number of columns that identify a row, and rows of each table, by name."""
