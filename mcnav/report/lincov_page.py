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


def render(answer: LinearAnswer, outages: drawn.Outages) -> str:
    """Render the page; outages are those of the aiding sensors."""
    (words, tone), *others = statements(answer)
    rows, meaningful = answer_rows(answer), answer.beyond is None
    requirements = [row | {"tone": TONES.get(row["finding"], "undecided")} for row in requirement_rows(answer)]
    return filled(
        "lincov.html",
        campaign=answer.campaign,
        headline=words,
        tone=tone,
        explanation=EXPLANATION,
        not_modelled=not_modelled(answer.kind),
        requirements=requirements,
        boxes=any(each.requirement.kind == "box" for each in answer.requirements),
        others=[sentence for sentence, _ in others],
        outputs=[row | {"name": humanize(row["output"])} for row in rows],
        biased=any(row["mean"] for row in rows),
        largest=[row | {"name": humanize(row["output"])} for row in largest_rows(answer)],
        beyond=BEYOND,
        meaningful=meaningful,
        history=answer.history,
        label="" if answer.history is None else answer.history.readings.label,
        figures={
            "sigmas": drawn.sigmas(answer, outages),
            "requirements": drawn.requirements(answer, outages),
            "budget": drawn.budget(answer) if meaningful else None,
            "development": drawn.development(answer, outages),
            "correlations": drawn.correlations(answer) if meaningful and answer.sigma.any() else None,
        },
        names=[(humanize(output.name), output.shown_in) for output in answer.outputs],
        grouped=_grouped(answer),
        causes=_causes(answer),
        cross_terms=answer.budget.cross_terms,
        correlated=bool(np.nanmax(np.abs(answer.budget.cross_terms), initial=0.0) > 1e-12),
    )


def _grouped(answer: LinearAnswer) -> list[dict[str, Any]]:
    """List the contributors with their share of each variance and the sigma that they cause."""
    budget, scale = answer.budget, scale_of(answer.outputs)
    rows = []
    for each in drawn.contributors(answer):
        members = list(each.members)
        sigma = np.sqrt((budget.contributions[:, members] ** 2).sum(axis=1)) * scale
        rows.append({
            "name": each.label,
            "cells": list(zip(budget.shares[:, members].sum(axis=1), sigma, strict=True)),
        })  # fmt: skip
    return rows


def _causes(answer: LinearAnswer) -> list[dict[str, Any]]:
    """List all causes with the sigma of each source, the largest mean share first."""
    budget, scale, labels = answer.budget, scale_of(answer.outputs), drawn.cause_labels(answer)
    own = np.sqrt(np.diag(answer.model.covariance)) * scale_of(answer.sources)
    count = len(answer.sources)
    order = np.argsort(-np.nan_to_num(budget.shares).mean(axis=0), kind="stable")
    return [
        {
            "name": labels[j],
            "sigma": own[j] if j < count else None,
            "unit": answer.sources[j].shown_in if j < count else "",
            "cells": list(zip(budget.shares[:, j], np.abs(budget.contributions[:, j]) * scale, strict=True)),
        }
        for j in order.tolist()
        if budget.contributions[:, j].any()
    ]
