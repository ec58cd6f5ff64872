"""Filters that know more than the one of a campaign: what they estimate, consider or believe, the best remedy first."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from mcnav.analysis.brief import FilterRemedy
from mcnav.analysis.filter_causes import kind_of, shares_by_kind
from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.analysis.linear_filter import LinearVerdict
from mcnav.config.documents import Document
from mcnav.config.overrides import parse_document
from mcnav.errors import CampaignError
from mcnav.studies.confirmed_changes import ConfirmationPlan
from mcnav.studies.lincov import answer_linearly

MOST: Final = 4
"""Neglected kinds of errors that are given to the filter one by one, the largest first."""

Entries = Mapping[str, Sequence[str]]


def find_remedies(document: Document, answer: LinearAnswer) -> list[FilterRemedy]:
    """Answer campaigns whose filter knows more; the best remedy first, as `FilterRemedy.rank` has it.

    Parameters
    ----------
    document : Document
        The campaign.
    answer : LinearAnswer
        Of the campaign as it is, whose filter departs from the truth.
    """
    remedies = []
    for words, entries in _changes(document, answer):
        try:
            then = answer_linearly(parse_document(changed(document, entries), {}))
        except CampaignError:
            continue  # an error may have no state
        if then.filter is not None and answer.filter is not None:
            remedies.append(FilterRemedy(words, then.filter, sigma_at(then, answer.filter), entries))
    return sorted(remedies, key=lambda remedy: remedy.rank)


def confirmed(remedy: FilterRemedy, document: Document, plan: ConfirmationPlan) -> FilterRemedy:
    """Simulate a remedy, and return it with the verdict of the samples on its filter."""
    summary = plan.simulate(parse_document(changed(document, remedy.entries), {}))
    return replace(remedy, simulated=summary.filter, samples=summary.samples)


def changed(document: Document, entries: Entries) -> Document:
    """Return a campaign with other entries of ``[filter]``; one that is empty is taken out."""
    table = {**document.content["filter"], **{name: list(value) for name, value in entries.items()}}
    kept = {name: value for name, value in table.items() if value != []}
    return replace(document, content={**document.content, "filter": kept})


def _changes(document: Document, answer: LinearAnswer) -> Iterator[tuple[str, Entries]]:
    """Yield entries of filters that know more, with the change in words."""
    table = document.content["filter"]
    estimates, considers = [*table["estimates"]], [*table.get("considers", ())]
    if "believes" in table:
        yield "believes the true sizes", {"believes": []}
    kinds = [kind for kind in _kinds(answer) if kind not in (*estimates, *considers)]
    kinds = [kind for kind in kinds if _is_accepted(changed(document, {"estimates": [*estimates, kind]}))]
    for kind in kinds[:MOST]:
        yield f"estimates {kind} too", {"estimates": [*estimates, kind]}
        yield f"considers {kind}", {"considers": [*considers, kind]}
    if len(kinds) > 1:
        yield f"estimates all {len(kinds)} kinds of unmodelled errors", {"estimates": [*estimates, *kinds]}


def _is_accepted(document: Document) -> bool:
    try:
        parse_document(document, {})
    except CampaignError:
        return False
    return True


def _kinds(answer: LinearAnswer) -> list[str]:
    """List the kinds of errors that there are, those first that the filter neglects most."""
    shares = shares_by_kind((cause.name, cause.share) for cause in (answer.filter.neglected if answer.filter else ()))
    sized = (np.diag(answer.model.covariance) > 0.0) | (answer.model.mean != 0.0)
    others = [kind_of(source.name) for source, known in zip(answer.sources, sized, strict=True) if known]
    return list(dict.fromkeys([*shares, *others]))


def sigma_at(answer: LinearAnswer, at: LinearVerdict) -> float:
    """Return the true sigma of the output that departs most, or of the first of its group, at its worst reading."""
    history = answer.history
    if history is None or not at.output:
        return float("nan")
    place = next(number for number, output in enumerate(answer.outputs) if output.name == at.output)
    reading = int(np.argmin(np.abs(history.readings.times - at.worst)))
    return float(history.sigma[reading, place])
