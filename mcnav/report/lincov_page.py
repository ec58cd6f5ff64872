"""Linear covariance of a campaign as an HTML page."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.report.figures import lincov as drawn
from mcnav.report.html import filled
from mcnav.report.left_out import not_modelled
from mcnav.report.lincov import answer_rows, largest_rows, requirement_rows, statements
from mcnav.report.model import humanize, scale_of
from mcnav.report.requirements import TONES
from mcnav.report.sentences import BEYOND

EXPLANATION: Final = (
    "Linear analysis for normal errors; nothing is simulated. mcnav run tests it by Monte Carlo simulation."
)


def render(found: LinearAnswer, outages: drawn.Outages) -> str:
    """Render the page; outages are those of the aiding sensors."""
    (words, tone), *others = statements(found)
    rows, meaningful = answer_rows(found), found.beyond is None
    requirements = [row | {"tone": TONES.get(row["finding"], "undecided")} for row in requirement_rows(found)]
    return filled(
        "lincov.html",
        campaign=found.campaign,
        headline=words,
        tone=tone,
        explanation=EXPLANATION,
        not_modelled=not_modelled(found.kind),
        requirements=requirements,
        boxes=any(each.requirement.kind == "box" for each in found.requirements),
        others=[sentence for sentence, _ in others],
        outputs=[row | {"name": humanize(row["output"])} for row in rows],
        biased=any(row["mean"] for row in rows),
        largest=[row | {"name": humanize(row["output"])} for row in largest_rows(found)],
        beyond=BEYOND,
        meaningful=meaningful,
        history=found.history,
        label="" if found.history is None else found.history.readings.label,
        figures={
            "sigmas": drawn.sigmas(found, outages),
            "requirements": drawn.requirements(found, outages),
            "budget": drawn.budget(found) if meaningful else None,
            "development": drawn.development(found, outages),
            "correlations": drawn.correlations(found) if meaningful and found.sigma.any() else None,
        },
        names=[(humanize(output.name), output.shown_in) for output in found.outputs],
        grouped=_grouped(found),
        causes=_causes(found),
        cross_terms=found.budget.cross_terms,
        correlated=bool(np.nanmax(np.abs(found.budget.cross_terms), initial=0.0) > 1e-12),
    )


def _grouped(found: LinearAnswer) -> list[dict[str, Any]]:
    """List the contributors with their share of each variance and the sigma that they cause."""
    budget, scale = found.budget, scale_of(found.outputs)
    rows = []
    for each in drawn.contributors(found):
        members = list(each.members)
        sigma = np.sqrt((budget.contributions[:, members] ** 2).sum(axis=1)) * scale
        rows.append({
            "name": each.label,
            "cells": list(zip(budget.shares[:, members].sum(axis=1), sigma, strict=True)),
        })  # fmt: skip
    return rows


def _causes(found: LinearAnswer) -> list[dict[str, Any]]:
    """List all causes with the sigma of each source, the largest mean share first."""
    budget, scale, labels = found.budget, scale_of(found.outputs), drawn.cause_labels(found)
    own = np.sqrt(np.diag(found.model.covariance)) * scale_of(found.sources)
    count = len(found.sources)
    order = np.argsort(-np.nan_to_num(budget.shares).mean(axis=0), kind="stable")
    return [
        {
            "name": labels[j],
            "sigma": own[j] if j < count else None,
            "unit": found.sources[j].shown_in if j < count else "",
            "cells": list(zip(budget.shares[:, j], np.abs(budget.contributions[:, j]) * scale, strict=True)),
        }
        for j in order.tolist()
        if budget.contributions[:, j].any()
    ]
