"""Figures of a linear covariance: sigmas and requirements over time, error budget, correlations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Final

import numpy as np

from mcnav.analysis.linear_answer import LinearAnswer, LinearRequirement, sizes_over_time
from mcnav.analysis.linear_covariance import LinearCovariance
from mcnav.arrays.products import transformed_variances
from mcnav.arrays.types import Array
from mcnav.contract.quantities import end_words
from mcnav.report.drawing.figure import HALF, Figure, side_by_side
from mcnav.report.drawing.marks import Axis, Cells, Line, Mark, Panel, Points, Rule, Series, Span, axis
from mcnav.report.drawing.palette import FILTER, INK, LINEAR
from mcnav.report.figures.budgets import ALL, development_figure, shares_figure
from mcnav.report.figures.matrices import DEEPEST, NEGATIVE, NIL, POSITIVE, signs_of
from mcnav.report.figures.outages import OPACITY, SHADED, shading_key
from mcnav.report.figures.sources import Contributor, groups, ranked
from mcnav.report.figures.truth import SigmasOverTime, over_time
from mcnav.report.format import fixed
from mcnav.report.names import humanize, labels_of, scale_of

Outages = Mapping[str, Sequence[tuple[float, float]]]
"""Begin and end of the outages of each sensor, in the unit of the history's times."""

TRUE: Final = Series("linear", "linear, 1σ", LINEAR)
ABOUT_ZERO: Final = Series("linear", "linear, root mean square", LINEAR)
STATED: Final = Series("filter", "filter, 1σ", FILTER)
LIMIT: Final = Series("limit", "limit", INK)
SIZE: Final = Series("size", "linear", LINEAR)
COUNTED: Final = Series("counted", "epochs that count", INK, "dot")


def cause_labels(answer: LinearAnswer) -> list[str]:
    """Return the names of the sources and processes for people."""
    return [*labels_of(answer.sources, answer.outputs), *map(humanize, answer.model.processes)]


def _shading(outages: Outages, label: str) -> list[Span]:
    unit = label.partition("[")[2].removesuffix("]")
    return [
        Span(SHADED, begin, end, text=f"outage of {humanize(name)}: {begin:g} to {end:g} {unit}", opacity=OPACITY)
        for name, spans in outages.items()
        for begin, end in spans
    ]


def short_name(requirement: LinearRequirement, answer: LinearAnswer) -> str:
    """Name a requirement in a few words: its kind and outputs."""
    required = requirement.requirement
    names = ", ".join(humanize(answer.outputs[i].name) for i in required.outputs)
    kind = required.kind if required.kind == "box" else required.kind.upper()
    named = f"{100.0 * (required.probability or 0.5):g} % of |{names}|" if kind == "QUANTILE" else f"{kind}, {names}"
    return f"{named}, {required.when}" if required.when else named


def _moving(history: LinearCovariance) -> list[int]:
    return [int(i) for i in np.flatnonzero(history.sigma.max(axis=0) > 0.0)]


def sigmas(answer: LinearAnswer, outages: Outages) -> Figure | None:
    """Draw sigma of every output over time, with that of the filter; none without a history.

    Where a mean navigation error exceeds its sigma, true sizes are root mean squares about zero.
    """
    history = answer.meaningful
    if history is None or not _moving(history):
        return None
    label, times, scale = history.readings.label, history.readings.times, scale_of(answer.outputs)
    shaded = _shading(outages, label)
    means = np.where([output.of == "navigation" for output in answer.outputs], np.nan_to_num(history.mean), 0.0)
    large = bool(np.any((np.abs(means) > history.sigma) & (history.sigma > 0.0)))
    sizes, series, measure = (np.hypot(history.sigma, means), ABOUT_ZERO, "rms") if large else (
        history.sigma, TRUE, "1σ"
    )  # fmt: skip
    columns: dict[str, Array] = {label: times}
    panels = []
    for i in _moving(history):
        name, unit = humanize(answer.outputs[i].name), answer.outputs[i].shown_in
        marks: list[Mark] = [*shaded, Line(series, times, sizes[:, i] * scale[i], 3.2)]
        columns[f"{name}, {measure} [{unit}]"] = sizes[:, i] * scale[i]
        if history.sigma_filter is not None:
            marks.append(Line(STATED, times, history.sigma_filter[:, i] * scale[i], 1.4))
            columns[f"{name}, filter's 1σ [{unit}]"] = history.sigma_filter[:, i] * scale[i]
        panels.append(Panel(name, axis(label, margin=0.0, link=True), Axis(measure, unit, low=0.0), marks))
    filtered = history.sigma_filter is not None
    return Figure(
        name="sigmas",
        title="Linear root mean square over time" if large else "Linear sigma over time",
        description=("Root mean square" if large else "Standard deviation")
        + " of each output over time by linear analysis"
        + (", and that which the filter states." if filtered else "."),
        panels=panels,
        key=(series, *([STATED] if filtered else []), *shading_key(shaded)),
        columns=columns,
        size=side_by_side(len(panels)),
        caption="Two values at a time are those before and after its updates." if filtered else "",
        file="lincov.json",
    )


def truth(answer: LinearAnswer) -> Figure | None:
    """Draw sigmas of truth and navigation over time; none without outputs of truth or a history."""
    history = answer.meaningful
    if history is None:
        return None
    own = {} if history.sigma_filter is None else {"linear": history.sigma_filter}
    known = SigmasOverTime(history.readings.label, history.readings.times, {}, {"linear": history.sigma}, own)
    return over_time(answer.outputs, known)


def requirements(answer: LinearAnswer, outages: Outages) -> Figure | None:
    """Draw the quantile or radius of each requirement over time with its limit; none without one over time."""
    history = answer.meaningful
    wanted = [
        requirement for requirement in answer.requirements if requirement.requirement.epochs and requirement.judged
    ]
    if history is None or not wanted:
        return None
    label, scale = history.readings.label, scale_of(answer.outputs)
    times, shaded = history.readings.times[history.settled], _shading(outages, label)
    columns: dict[str, Array] = {label: times}
    panels = []
    for number, asked in enumerate(wanted, start=1):
        first = asked.requirement.outputs[0]
        values = sizes_over_time(asked.requirement, history.moments, answer.model.sizes) * scale[first]
        unit = answer.outputs[first].shown_in
        limit, at = asked.requirement.limits[0] * scale[first], list(asked.requirement.epochs)
        title = f"{number}: {short_name(asked, answer)}"
        columns[f"{title} [{unit}]"] = values
        marks: list[Mark] = [
            *shaded,
            Line(SIZE, times, values, 2.1),
            Points(COUNTED, times[at], values[at], 4.0),
            Rule(limit, level=True, colour=INK, series=LIMIT),
        ]
        reach = max(2.0 * limit, 1.1 * float(values[at].max()))
        high = reach if values.max() > reach else max(1.1 * limit, 1.1 * float(values.max()))
        panels.append(Panel(title, axis(label, margin=0.0, link=True), Axis("error", unit, low=0.0, high=high), marks))
    return Figure(
        name="requirements",
        title="Requirements over time",
        description="Quantile or radius of each requirement over time by linear analysis, with its limit.",
        panels=panels,
        key=(SIZE, COUNTED, LIMIT, *shading_key(shaded)),
        columns=columns,
        size=side_by_side(len(panels)),
    )


def contributors(answer: LinearAnswer) -> list[Contributor]:
    """Return the causes with a colour each, those that differ only in their axis together where there are many."""
    labels, shares = cause_labels(answer), np.nan_to_num(answer.budget.shares)
    active = [j for j in range(len(labels)) if answer.budget.contributions[:, j].any()]
    grouped = groups(labels, active)
    parts = np.array([shares[:, list(members)].sum(axis=1) for _, members in grouped]).reshape(len(grouped), -1)
    return ranked(grouped, parts.mean(axis=1).tolist(), parts.max(axis=1, initial=0.0), len(labels) <= len(active))


def departures(answer: LinearAnswer) -> dict[str, float]:
    """Return by how much each output departs: the largest logarithm of true over filter sigma, zero without a filter.

    Outputs that do not move are left out.
    """
    history = answer.meaningful
    if history is None:
        return {}
    names = [humanize(output.name) for output in answer.outputs]
    away = dict.fromkeys((names[i] for i in _moving(history)), 0.0)
    own = history.sigma_filter
    for i in [] if own is None else _moving(history):
        known = (own[:, i] > 0.0) & (history.sigma[:, i] > 0.0)  # type: ignore[index]
        if known.any():
            away[names[i]] = float(np.abs(np.log(history.sigma[known, i] / own[known, i])).max())  # type: ignore[index]
    return away


def budget(answer: LinearAnswer, foremost: Sequence[str] = ()) -> Figure | None:
    """Draw the share of each contributor in each output's final variance; none without dispersion.

    ``foremost``: the outputs that are drawn, by default all.
    """
    parts = contributors(answer)
    names = [humanize(output.name) for output in answer.outputs]
    picked = [i for i, name in enumerate(names) if not foremost or name in foremost]
    return None if not parts else shares_figure(
        "Error budget at the end",
        "Share of each cause in the final variance of each output, in per cent.",
        ("cause", cause_labels(answer)),
        [names[i] for i in picked],
        {"": ("At the end", np.nan_to_num(answer.budget.attributed)[picked])},
        parts,
        answer.budget.crossed,
    )  # fmt: skip


def development(answer: LinearAnswer, outages: Outages) -> Figure | None:
    """Draw sigma of each output over time by contributor; none without a history."""
    history = answer.meaningful
    if history is None or not _moving(history):
        return None
    label, times, scale = history.readings.label, history.readings.times, scale_of(answer.outputs)
    curves = {ALL: history.sigma * scale}
    for contributor in contributors(answer):
        curves[contributor.series] = np.sqrt(np.maximum(_variances(answer, history, contributor.members), 0.0)) * scale
    return development_figure(
        "Standard deviation of each output over time, for all errors and for each cause.",
        (label, times),
        {i: (humanize(answer.outputs[i].name), answer.outputs[i].shown_in) for i in _moving(history)},
        curves,
        _shading(outages, label),
    )


def _variances(answer: LinearAnswer, history: LinearCovariance, members: Sequence[int]) -> Array:
    """Compute the variance over time due to some causes, shape (times, outputs), SI."""
    count = len(answer.sources)
    sources = [j for j in members if j < count]
    partials, covariance = history.readings.partials[:, :, sources], answer.model.covariance[np.ix_(sources, sources)]
    total = transformed_variances(partials, covariance)
    for j in (j for j in members if j >= count):
        total = total + history.variances[answer.causes[j]]
    return total


def correlations(answer: LinearAnswer) -> Figure:
    """Draw the correlation matrix of the final errors; the table has the covariances."""
    names, scale = [humanize(output.name) for output in answer.outputs], scale_of(answer.outputs)
    units = [output.shown_in for output in answer.outputs]
    values = np.nan_to_num(answer.correlation)
    texts = [["0" if abs(value) < NIL else fixed(value, 2) for value in row] for row in values]
    rows, across = np.transpose(list(product(range(len(names)), repeat=2)))
    square = Axis(names=names)
    panels = [Panel("Correlation", square, square, [Cells(POSITIVE, NEGATIVE, values, texts, DEEPEST)])]
    return Figure(
        name="correlations",
        title=f"Correlations of the {end_words(answer.outputs).many}",
        description="Correlation matrix of the outputs by linear analysis, as numbers on coloured squares.",
        panels=panels,
        key=signs_of(panels),
        columns={
            "row": [names[i] for i in rows],
            "column": [names[j] for j in across],
            "unit": [f"{units[i]}·{units[j]}" for i, j in zip(rows, across, strict=True)],
            "covariance": (answer.covariance * np.outer(scale, scale))[rows, across],
            "correlation": answer.correlation[rows, across],
        },
        size=(HALF[0], 60.0 + 36.0 * len(names)),
    )
