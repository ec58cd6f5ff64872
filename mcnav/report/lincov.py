"""Linear covariance of a campaign as tables for the terminal, and as rows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from mcnav._types import Array
from mcnav.analysis.linear_answer import LinearAnswer, LinearRequirement, causes_at
from mcnav.analysis.linear_covariance import LinearCovariance
from mcnav.contract.quantities import Output
from mcnav.report.figures.axis_groups import stem
from mcnav.report.figures.lincov import cause_labels
from mcnav.report.fitted_table import FittedTable, numbers, texts
from mcnav.report.format import number
from mcnav.report.lincov_words import (
    cause_words,
    filter_words,
    final_means,
    mean_words,
    range_words,
    worst_first,
)
from mcnav.report.model import humanize, scale_of
from mcnav.report.requirements import TONES, listed, stated
from mcnav.report.sentences import BEYOND
from mcnav.units import conversion

CAUSES: Final = "largest causes, share of the variance"
"""Heading of the column that lists them."""

COARSEST_SHARE: Final = 0.001
"""Smallest share of a variance that is listed."""

MONTE_CARLO: Final = "needs Monte Carlo"
"""Finding on a requirement that linear analysis cannot judge."""

COLOURS: Final = {"met": "green", "not met": "red"}

INITIAL: Final = "initial"
"""Beginning of the names of initial errors; alone it is no kind of causes."""

TERMINAL: Final = {"agrees": "green", "differs": "red", "partly": "yellow", "undecided": "yellow", "": ""}
"""Colours of the headline's tones."""


def units_shown(outputs: Sequence[Output]) -> dict[str, tuple[float, str]]:
    """Return for each output, by name, the factor from SI and the unit shown."""
    return {each.name: (conversion(each.unit, each.shown_in), each.shown_in) for each in outputs}


def finding(row: LinearRequirement) -> str:
    """Return the finding on a requirement in words."""
    return ("met" if row.met else "not met") if row.judged else MONTE_CARLO


def headline(answer: LinearAnswer) -> tuple[str, str]:
    """State how many requirements are met, or else the largest causes; return the words and their tone."""
    judged = [each.met for each in answer.requirements if each.judged]
    if judged:
        failed, count = judged.count(False), len(judged)
        partly = " that linear analysis can judge" if count < len(answer.requirements) else ""
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
    names = largest_causes(answer)
    if not names:
        return "No final error has any dispersion", "undecided"
    return f"Largest {'cause' if len(names) == 1 else 'causes'} at the end: {' and '.join(names)}", ""


def statements(answer: LinearAnswer) -> list[tuple[str, str]]:
    """List what linear analysis says, in sentences with their tones, the worst first."""
    said = [*range_words(answer), *filter_words(answer)]
    if answer.beyond is None or any(each.judged for each in answer.requirements):
        said.append(headline(answer))
    return worst_first([*said, *mean_words(answer)])


def printed(answer: LinearAnswer) -> RenderableType:
    """Arrange the terminal's lines: sentences, requirements, sigmas at times that were asked for, outputs."""
    lines: list[RenderableType] = [
        Text(words, style=f"bold {TERMINAL[tone]}" if number == 0 else TERMINAL[tone])
        for number, (words, tone) in enumerate(statements(answer))
    ]
    if answer.requirements:
        lines += ["", requirement_table(answer)]
    if answer.asked is not None:
        lines += ["", sigma_table(answer, answer.asked)]
    lines += ["", answer_table(answer)]
    if answer.meaningful is not None:
        lines += ["", largest_table(answer)]
    return Group(*lines)


def largest_causes(answer: LinearAnswer) -> list[str]:
    """Name the kinds of causes that are the largest of most outputs, at most two."""
    labels, shares = cause_labels(answer), np.nan_to_num(answer.budget.shares)
    kind_of = [label if stem(label) == INITIAL else stem(label) for label in labels]
    kinds = list(dict.fromkeys(kind_of))
    of_kind = np.array([[each == kind for each in kind_of] for kind in kinds], dtype=float)
    summed = shares @ of_kind.T
    leading = [int(np.argmax(row)) for row in summed if row.any()]
    counted = sorted(set(leading), key=lambda k: (-leading.count(k), -summed[:, k].sum(), k))
    return [kinds[k] for k in counted[:2]]


def requirement_rows(answer: LinearAnswer) -> list[dict[str, Any]]:
    """List the requirements with their linear values, in SI and in words."""
    names, units = [output.name for output in answer.outputs], units_shown(answer.outputs)
    label = "" if answer.history is None else answer.history.readings.label
    rows = []
    for place, each in enumerate(answer.requirements):
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
            "causes": cause_words(answer, answer.requirement_causes(place)) if each.judged else [],
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


def requirement_table(answer: LinearAnswer) -> FittedTable:
    """Tabulate the requirements and their linear values."""
    columns = [*texts("finding", "requirement"), *numbers("linear"), *texts("largest at"), *numbers("errors may be ×")]
    columns += texts("largest causes then, share of the mean square")
    table = FittedTable("Requirements, for linear normal errors", columns, keys=2)
    for row in requirement_rows(answer):
        words = Text(row["finding"], style=COLOURS.get(row["finding"], ""))
        table.add(words, row["requirement"], row["shown"], row["at"] or "–", number(row["margin"]),
                  listed(row["causes"]))  # fmt: skip
    return table


def answer_rows(answer: LinearAnswer) -> list[dict[str, Any]]:
    """List the outputs at the end in the units shown: mean, sigma, that of the filter, and the causes of the variance.

    Where errors are beyond the range of linear analysis, numbers and causes are none.
    """
    scale, own = scale_of(answer.outputs), None if answer.history is None else answer.history.sigma_filter
    means, meaningful = final_means(answer), answer.beyond is None
    return [
        {
            "output": output.name,
            "unit": output.shown_in,
            "mean": float(means[i] * scale[i]) if meaningful else None,
            "sigma": float(answer.sigma[i] * scale[i]) if meaningful else None,
            "sigma_filter": float(own[-1, i] * scale[i]) if meaningful and own is not None else None,
            "causes": cause_words(answer, answer.final_causes(i)) if meaningful else [],
        }
        for i, output in enumerate(answer.outputs)
    ]


def largest_rows(answer: LinearAnswer) -> list[dict[str, Any]]:
    """List the largest sigma of each output over time in the units shown, with the filter's and the causes then."""
    scale, history = scale_of(answer.outputs), answer.meaningful
    if history is None:
        return []
    rows, own = [], history.sigma_filter
    for i, output in enumerate(answer.outputs):
        worst = int(np.argmax(history.sigma[:, i]))
        rows.append({
            "output": output.name,
            "unit": output.shown_in,
            "sigma": float(history.sigma[worst, i] * scale[i]),
            "time": float(history.readings.times[worst]),
            "sigma_filter": None if own is None else float(own[worst, i] * scale[i]),
            "causes": cause_words(answer, causes_at(history, worst, i)),
        })  # fmt: skip
    return rows


def answer_table(answer: LinearAnswer) -> FittedTable:
    """Tabulate the final means and sigmas with the causes of the variances."""
    rows = answer_rows(answer)
    filtered = answer.history is not None and answer.history.sigma_filter is not None
    biased = any(row["mean"] for row in rows)
    columns = [*texts("output"), *numbers(*(["mean"] if biased else []), "σ", *(["filter's σ"] if filtered else []))]
    table = FittedTable("Linear covariance at the end, 1σ", [*columns, *texts(CAUSES)])
    for row in rows:
        cells = [_shown(row["mean"])] if biased else []
        cells += [_shown(row["sigma"])]
        cells += [_shown(row["sigma_filter"])] if filtered else []
        table.add(f"{humanize(row['output'])} [{row['unit']}]", *cells, listed(row["causes"]))
    return table


def largest_table(answer: LinearAnswer) -> FittedTable:
    """Tabulate the largest sigmas over time with the causes of the variances at these times."""
    history = answer.meaningful
    assert history is not None
    filtered = history.sigma_filter is not None
    columns = [
        *texts("output"),
        *numbers("largest σ", *(["filter's σ"] if filtered else []), f"at {history.readings.label}"),
    ]
    within = " within the range of linear analysis" if answer.beyond is not None else ""
    table = FittedTable(f"Largest over time{within}, 1σ", [*columns, *texts(CAUSES)])
    for row in largest_rows(answer):
        own = [_shown(row["sigma_filter"])] if filtered else []
        time = f"{row['time']:.5g}"
        table.add(f"{humanize(row['output'])} [{row['unit']}]", _shown(row["sigma"]), *own, time, listed(row["causes"]))
    return table


def _shown(value: float | None) -> str:
    return BEYOND if value is None else f"{value:.5g}"


def sigma_rows(answer: LinearAnswer) -> list[dict[str, Any]]:
    """List means and sigmas at all readings, a row for each reading and output, in the units shown; else at the end.

    Where ``beyond_range`` holds they have no meaning.
    """
    scale, history = scale_of(answer.outputs), answer.asked or answer.history
    if history is None:
        return [
            {"time": None, "update": "", "output": output.name, "unit": output.shown_in,
             "sigma": float(answer.sigma[i] * scale[i]), "sigma_filter": None, "mean": float(answer.mean[i] * scale[i]),
             "beyond_range": answer.beyond is not None}
            for i, output in enumerate(answer.outputs)
        ]  # fmt: skip
    beyond = answer.readings_beyond(history)
    return [
        {
            "time": float(time),
            "update": history.readings.updates[at] or "",
            "output": output.name,
            "unit": output.shown_in,
            "sigma": float(history.sigma[at, i] * scale[i]),
            "sigma_filter": None if history.sigma_filter is None else float(history.sigma_filter[at, i] * scale[i]),
            "mean": float(history.mean[at, i] * scale[i]),
            "beyond_range": bool(beyond[at]),
        }
        for at, time in enumerate(history.readings.times)
        for i, output in enumerate(answer.outputs)
    ]


def sigma_table(answer: LinearAnswer, covariance: LinearCovariance) -> FittedTable:
    """Tabulate the sigmas at all readings: true ones and, below them, those that the filter states, and the means."""
    outputs, readings, own = answer.outputs, covariance.readings, covariance.sigma_filter
    scale, beyond, biased = scale_of(outputs), answer.readings_beyond(covariance), bool(covariance.means)
    several = own is not None or biased
    columns = [*numbers(readings.label), *texts("update", *(["σ"] if several else []))]
    columns += numbers(*(f"{humanize(output.name)} [{output.shown_in}]" for output in outputs))
    table = FittedTable("Linear covariance, 1σ", columns, keys=3 if several else 2)

    def cells(values: Array, at: int) -> list[str]:
        return [BEYOND if beyond[at] else f"{value:.4g}" for value in values * scale]

    for at, time in enumerate(readings.times):
        when = (f"{time:g}", readings.updates[at] or "–")
        table.add(*when, *(["true"] if several else []), *cells(covariance.sigma[at], at))
        if own is not None:
            table.add("", "", "filter's", *cells(own[at], at))
        if biased:
            table.add("", "", "mean", *cells(covariance.mean[at], at))
    return table


def contributor_rows(answer: LinearAnswer) -> list[dict[str, Any]]:
    """List the contributions of all causes to the final sigmas, the largest first; none beyond the linear range."""
    if answer.beyond is not None:
        return []
    scale, budget, names = scale_of(answer.outputs), answer.budget, answer.causes
    rows = []
    for i, output in enumerate(answer.outputs):
        shares = np.nan_to_num(budget.shares[i])
        for j in np.argsort(-shares, kind="stable"):
            if shares[j] >= COARSEST_SHARE:
                sigma = float(abs(budget.contributions[i, j]) * scale[i])
                row = {"output": output.name, "cause": names[j], "share": float(shares[j]), "sigma": sigma}
                rows.append(row | {"unit": output.shown_in})
    return rows


def exported(answer: LinearAnswer) -> Mapping[str, Any]:
    """Return the tables that ``--format json`` prints."""
    return {
        "sigmas": sigma_rows(answer),
        "contributors": contributor_rows(answer),
        "requirements": requirement_rows(answer),
    }
