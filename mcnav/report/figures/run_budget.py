"""The error budget of a run: linear shares, shares by Monte Carlo, and sigmas by contributor over time."""

from __future__ import annotations

import numpy as np

from mcnav.report.drawing.figure import Figure
from mcnav.report.figures.budgets import ALL, development_figure, shares_figure
from mcnav.report.figures.outages import outages
from mcnav.report.figures.sources import contributors, flown_shares, origins, variance_over_time
from mcnav.report.results.model import RunAnalysis
from mcnav.report.results.worst_components import foremost_outputs


def budget(content: RunAnalysis) -> Figure:
    """Draw shares of each contributor in each output's linear variance: linear, and by Monte Carlo if known."""
    picked = foremost_outputs(content)
    linear = np.nan_to_num(content.budget.attributed)[picked]
    flown = None if content.budget.crossed else flown_shares(content)  # each source alone: they would not add up
    flown = None if flown is None else flown[picked]
    routes = {", linear": ("Linear", linear)}
    if flown is not None:
        routes[", Monte Carlo"] = ("Monte Carlo, each source alone", flown)
    return shares_figure(
        "Error budget",
        "Share of each cause in the variance of each output, in per cent of the linear variance.",
        ("cause", content.cause_names),
        [content.output_names[i] for i in picked],
        routes,
        [contributor for contributor in contributors(content) if (linear[:, contributor.members] != 0.0).any()],
        content.budget.crossed,
    )


def partials_history(content: RunAnalysis) -> Figure | None:
    """Draw the linear sigma of each output over time, in total and by contributor."""
    known = content.development
    if known is None:
        return None
    moving, scale = content.moving, content.output_scale
    curves = {ALL: np.sqrt(variance_over_time(content)) * scale}
    for each in contributors(content) if content.filter is None else origins(content, content.filter):
        part = np.sqrt(variance_over_time(content, each.members)) * scale
        if part[:, moving].max(initial=0.0) > 0.0:
            curves[each.series] = part
    what = "sigma" if content.several_kinds else "one-sigma error"
    return development_figure(
        f"Linear {what} of each output over the flight, for all errors and for each contributor.",
        (known.label, known.times),
        {i: (content.output_names[i], content.output_units[i]) for i in moving},
        curves,
        outages(content),
        "Linear model." if content.filter is None else "Closed-loop linear analysis, by origin of the errors.",
    )
