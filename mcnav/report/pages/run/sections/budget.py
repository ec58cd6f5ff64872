"""The section on the error budget: linear shares, their development, and shares by Monte Carlo."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mcnav.report.columns.share_table import each_cause, share_tables, together
from mcnav.report.document import formulas
from mcnav.report.document.parts import Folded, Part, Section, Sentence, headed, joined
from mcnav.report.document.table import row_limit
from mcnav.report.drawing.figure import Figure
from mcnav.report.figures.sources import contributors
from mcnav.report.pages.run.sections.simulated_budget import simulated_budget
from mcnav.report.results.model import RunAnalysis


def budget_section(content: RunAnalysis, drawn: Mapping[str, Figure]) -> Section:
    """Tabulate the contributors, and all sources; draw how the shares develop."""
    return Section("budget", "Error budget", [
        *joined(drawn.get("budget")), *_tables(content), _definition(),
        *headed("Over the flight", drawn.get("development")), *simulated_budget(content),
    ])  # fmt: skip


def _tables(content: RunAnalysis) -> list[Part]:
    budget, model = content.budget, content.model
    outputs, cross_terms = content.manifest.model.outputs, budget.cross_terms
    caused = budget.contributions * content.output_scale[:, None]
    sigmas = np.sqrt(np.diag(model.covariance))
    shown = sigmas * content.source_scale, model.mean * content.source_scale
    sources = list(zip(*shown, content.source_units, strict=True))
    listed = [*((sigmas > 0.0) | (model.mean != 0.0)).tolist(), *(True for _ in model.processes)]
    every, parts = each_cause(budget, caused, content.cause_names, sources, listed), contributors(content)
    grouped = "; of several causes the root sum square" if any(len(part.members) > 1 for part in parts) else ""
    effect = "effect at the end" if content.several_kinds else content.ends.one
    at_the_end = " at the end" if content.time_unit else ""
    foremost = share_tables(
        f"Share of the linear variance{at_the_end}, %, and {effect} for one sigma{grouped}.",
        "Cause", outputs, together(budget, caused, parts), cross_terms,
    )  # fmt: skip
    limit = row_limit(len(outputs))
    left_out = f" The {len(every) - limit:,} with the smallest mean share are in summary.json." * (len(every) > limit)
    whole = share_tables(
        f"Linear error budget: share of the variance{at_the_end}, %, and {effect} for one sigma of each cause alone."
        f"{left_out}",
        "Cause", outputs, every[:limit], cross_terms, sigmas=True, means=bool(np.any(model.mean)),
    )  # fmt: skip
    if content.looped:
        foremost = [Folded(f"Shares of all {len(outputs)} outputs", foremost)]
    return [*foremost, Folded(f"{limit} of {len(every)} causes" if left_out else f"All {len(every)} causes", whole)]


def _definition() -> Folded:
    words = (
        "Share of cause j in the linear variance of output i. Correlations between sources contribute the rest, which "
        "may be negative:"
    )
    return Folded("How shares are computed", [Sentence(words), formulas.SHARE], explains=True)
