"""Linear covariance of a campaign as tables for the terminal, and as rows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from mcnav.analysis.linear_answer import LinearAnswer, LinearRequirement
from mcnav.analysis.linear_covariance import LinearCovariance
from mcnav.report.figures.axis_groups import stem
from mcnav.report.figures.lincov import cause_labels
from mcnav.report.fitted_table import FittedTable, numbers, texts
from mcnav.report.format import number
from mcnav.report.model import humanize, scale_of
from mcnav.report.requirements import TONES, stated
from mcnav.scenarios.protocol import Output
from mcnav.units import conversion

LARGEST: Final = 3
"""Causes listed for each output."""

COARSEST_SHARE: Final = 0.001
"""Smallest share of a variance that is listed."""

MONTE_CARLO: Final = "needs Monte Carlo"
"""Finding on a requirement that linear analysis cannot judge."""

COLOURS: Final = {"met": "green", "not met": "red"}

INITIAL: Final = "initial"
"""Beginning of the names of initial errors; alone it is no kind of causes."""

TERMINAL: Final = {"agrees": "green", "differs": "red", "undecided": "yellow", "": ""}
"""Colours of the headline's tones."""


def units_shown(outputs: Sequence[Output]) -> dict[str, tuple[float, str]]:
    """Return for each output, by name, the factor from SI and the unit shown."""
    return {each.name: (conversion(each.unit, each.shown_in), each.shown_in) for each in outputs}


def finding(row: LinearRequirement) -> str:
    """Return the finding on a requirement in words."""
    return ("met" if row.met else "not met") if row.judged else MONTE_CARLO


def headline(found: LinearAnswer) -> tuple[str, str]:
    """State how many requirements are met, or else the largest causes; return the words and their tone."""
    judged = [each.met for each in found.requirements if each.judged]
    if judged:
        failed, count = judged.count(False), len(judged)
        partly = " that linear analysis can judge" if count < len(found.requirements) else ""
        if count == 1:
            words = f"The requirement{partly} is {'not ' * failed}met"
        elif not failed:
            words = f"{'Both' if count == 2 else f'All {count}'} requirements{partly} are met"
        elif failed == count:
            words = (
                f"{'Neither' if count == 2 else f'None of the {count}'} requirement{'s' * (count > 2)}{partly} is met"
            )
        else:
            words = f"{failed} of {count} requirements{partly} {'is' if failed == 1 else 'are'} not met"
        return words, TONES["not met" if failed else "met"]
    names = largest_causes(found)
    if not names:
        return "No final error has any dispersion", "undecided"
    return f"Largest {'cause' if len(names) == 1 else 'causes'}: {' and '.join(names)}", ""


def printed(found: LinearAnswer) -> RenderableType:
    """Arrange the terminal's lines: headline, requirements, sigmas at times that were asked for, outputs."""
    words, tone = headline(found)
    lines: list[RenderableType] = [Text(words, style=f"bold {TERMINAL[tone]}")]
    if found.requirements:
        lines += ["", requirement_table(found)]
    if found.asked is not None:
        lines += ["", sigma_table(found.asked, found.outputs)]
    return Group(*lines, "", answer_table(found))


def largest_causes(found: LinearAnswer) -> list[str]:
    """Name the kinds of causes that are the largest of most outputs, at most two."""
    labels, shares = cause_labels(found), np.nan_to_num(found.budget.shares)
    kind_of = [label if stem(label) == INITIAL else stem(label) for label in labels]
    kinds = list(dict.fromkeys(kind_of))
    of_kind = np.array([[each == kind for each in kind_of] for kind in kinds], dtype=float)
    summed = shares @ of_kind.T
    leading = [int(np.argmax(row)) for row in summed if row.any()]
    counted = sorted(set(leading), key=lambda k: (-leading.count(k), -summed[:, k].sum(), k))
    return [kinds[k] for k in counted[:2]]


def requirement_rows(found: LinearAnswer) -> list[dict[str, Any]]:
    """List the requirements with their linear values, in SI and in words."""
    names, units = [output.name for output in found.outputs], units_shown(found.outputs)
    label = "" if found.history is None else found.history.readings.label
    rows = []
    for each in found.requirements:
        limited = [names[i] for i in each.requirement.outputs]
        entry = {
            "kind": each.requirement.kind,
            "outputs": limited,
            "limits": each.requirement.limits,
            "probability": each.requirement.probability,
            "when": each.requirement.when,
        }
        rows.append({
            "requirement": stated(entry, units),
            "finding": finding(each),
            "value": each.value if each.judged else None,
            "shown": shown_value(each, *units[limited[0]]),
            "margin": each.margin if math.isfinite(each.margin) else None,
            "at": "" if each.time is None else f"{each.time:.6g} {label.partition('[')[2].removesuffix(']')}".strip(),
        })  # fmt: skip
    return rows


def shown_value(row: LinearRequirement, scale: float, unit: str) -> str:
    """Format the linear value of a requirement: a probability, or an error in the unit shown."""
    if not row.judged:
        return "–"
    return f"{100.0 * row.value:.3f} %" if row.requirement.kind == "box" else f"{number(row.value * scale)} {unit}"


def shown_limit(row: LinearRequirement, scale: float, unit: str) -> str:
    """Format the limit that a linear value is compared with."""
    required = row.requirement
    if required.kind == "box":
        return f"{100.0 * (required.probability or 0.5):g} %"
    return f"{number(required.limits[0] * scale)} {unit}"


def requirement_table(found: LinearAnswer) -> FittedTable:
    """Tabulate the requirements and their linear values."""
    columns = [*texts("finding", "requirement"), *numbers("linear"), *texts("largest at"), *numbers("errors may be ×")]
    table = FittedTable("Requirements, for linear normal errors", columns, keys=2)
    for row in requirement_rows(found):
        words = Text(row["finding"], style=COLOURS.get(row["finding"], ""))
        table.add(words, row["requirement"], row["shown"], row["at"] or "–", number(row["margin"]))
    return table


def answer_rows(found: LinearAnswer) -> list[dict[str, Any]]:
    """List the outputs with their sigmas in the units shown: at the end, the filter's, and the largest over time."""
    scale, history, labels = scale_of(found.outputs), found.history, cause_labels(found)
    rows = []
    for i, output in enumerate(found.outputs):
        row: dict[str, Any] = {
            "output": output.name,
            "unit": output.shown_in,
            "sigma": float(found.sigma[i] * scale[i]),
            "sigma_filter": None,
            "largest": None,
            "time": None,
        }
        if history is not None:
            own, worst = history.sigma_filter, int(np.argmax(history.sigma[:, i]))
            row["sigma_filter"] = None if own is None else float(own[-1, i] * scale[i])
            row["largest"] = float(history.sigma[worst, i] * scale[i])
            row["time"] = float(history.readings.times[worst])
        shares = np.nan_to_num(found.budget.shares[i])
        order = np.argsort(-shares, kind="stable")[:LARGEST]
        row["causes"] = [(labels[j], float(shares[j])) for j in order if shares[j] >= COARSEST_SHARE]
        rows.append(row)
    return rows


def answer_table(found: LinearAnswer) -> FittedTable:
    """Tabulate the final sigmas, their largest values over time, and the largest causes."""
    history = found.history
    filtered = history is not None and history.sigma_filter is not None
    columns = [*texts("output"), *numbers("σ at the end", *(["filter's σ"] if filtered else []))]
    if history is not None:
        columns += numbers("largest σ", f"at {history.readings.label}")
    columns += texts("largest causes, share of the variance")
    table = FittedTable("Linear covariance, 1σ", columns)
    for row in answer_rows(found):
        cells = [f"{row['sigma']:.5g}"]
        cells += [f"{row['sigma_filter']:.5g}"] if filtered else []
        cells += [f"{row['largest']:.5g}", f"{row['time']:.5g}"] if history is not None else []
        causes = ", ".join(f"{name} {100.0 * share:.3g} %" for name, share in row["causes"])
        table.add(f"{humanize(row['output'])} [{row['unit']}]", *cells, causes or "–")
    return table


def sigma_rows(found: LinearAnswer) -> list[dict[str, Any]]:
    """List the sigmas at all readings, a row for each reading and output, in the units shown; else those at the end."""
    scale, history = scale_of(found.outputs), found.asked or found.history
    if history is None:
        return [
            {"time": None, "update": "", "output": output.name, "unit": output.shown_in,
             "sigma": float(found.sigma[i] * scale[i]), "sigma_filter": None}
            for i, output in enumerate(found.outputs)
        ]  # fmt: skip
    return [
        {
            "time": float(time),
            "update": history.readings.updates[at] or "",
            "output": output.name,
            "unit": output.shown_in,
            "sigma": float(history.sigma[at, i] * scale[i]),
            "sigma_filter": None if history.sigma_filter is None else float(history.sigma_filter[at, i] * scale[i]),
        }
        for at, time in enumerate(history.readings.times)
        for i, output in enumerate(found.outputs)
    ]


def sigma_table(found: LinearCovariance, outputs: Sequence[Output]) -> FittedTable:
    """Tabulate the sigmas at all readings: true ones and, below them, those that the filter states."""
    readings, scale, own = found.readings, scale_of(outputs), found.sigma_filter
    columns = [*numbers(readings.label), *texts("update", *(["σ"] if own is not None else []))]
    columns += numbers(*(f"{humanize(output.name)} [{output.shown_in}]" for output in outputs))
    table = FittedTable("Linear covariance, 1σ", columns, keys=2 if own is None else 3)
    for at, time in enumerate(readings.times):
        when = (f"{time:g}", readings.updates[at] or "–")
        true = [f"{value:.4g}" for value in found.sigma[at] * scale]
        table.add(*when, *(["true"] if own is not None else []), *true)
        if own is not None:
            table.add("", "", "filter's", *(f"{value:.4g}" for value in own[at] * scale))
    return table


def contributor_rows(found: LinearAnswer) -> list[dict[str, Any]]:
    """List the contributions of all causes to the final sigmas, the largest first."""
    scale, budget, names = scale_of(found.outputs), found.budget, found.causes
    rows = []
    for i, output in enumerate(found.outputs):
        shares = np.nan_to_num(budget.shares[i])
        for j in np.argsort(-shares, kind="stable"):
            if shares[j] >= COARSEST_SHARE:
                sigma = float(abs(budget.contributions[i, j]) * scale[i])
                row = {"output": output.name, "cause": names[j], "share": float(shares[j]), "sigma": sigma}
                rows.append(row | {"unit": output.shown_in})
    return rows


def exported(found: LinearAnswer) -> Mapping[str, Any]:
    """Return the tables that ``--format json`` prints."""
    return {
        "sigmas": sigma_rows(found),
        "contributors": contributor_rows(found),
        "requirements": requirement_rows(found),
    }
