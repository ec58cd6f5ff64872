"""A campaign in which its filter or a requirement fails, by a run or by linear analysis, as remedies are sought for."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np

from mcnav.analysis.answer_times import as_read
from mcnav.analysis.filter_causes import kind_of, shares_by_kind
from mcnav.analysis.filter_remarks import instant
from mcnav.analysis.improvements import Departing, reading_at, shares_used
from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.analysis.model import Model
from mcnav.analysis.remedies import DEPARTING, Failing, Remedy, Standing, something_fails
from mcnav.analysis.requirements import Finding
from mcnav.analysis.simulated_requirements import Basis
from mcnav.analysis.what_if import WhatIf
from mcnav.config.documents import Document
from mcnav.config.read import Campaign, parse_campaign
from mcnav.contract.quantities import Source
from mcnav.studies.changeable_content import changeable_content
from mcnav.studies.remedy_changes import Change, written
from mcnav.systems.registry import is_code
from mcnav.workflow.what_if import what_if_of_answer, what_if_of_run

if TYPE_CHECKING:
    from mcnav.report.results.model import RunAnalysis

NAMED: Final = 0.02
"""Share of what a filter misses from which on a kind of errors is named."""


@dataclass(frozen=True)
class Case:
    """A campaign in which something fails.

    Attributes
    ----------
    document : Document
    beside : str
        Where a changed file is to be saved, as the end of a sentence.
    sources : tuple of Source
    outputs : tuple of str
    what_if : WhatIf or None
    failing : str
    departing : Departing or None
        Where a filter departs the most.
    label : str
        What its time is, as ``name [unit]``.
    at : str
        When, in words.
    ratio : float
        True over filter sigma there.
    verdict : str
        On the filter; empty without one.
    unmodelled : tuple of str
        Kinds of errors that the filter does not model and could, the largest first.
    missed : tuple of str
        Kinds of errors that a filter in code misses most.
    scales : tuple of float
        By requirement, what a run multiplies linear errors by; empty without a run.
    """

    document: Document
    beside: str
    sources: tuple[Source, ...]
    outputs: tuple[str, ...]
    what_if: WhatIf | None
    failing: Failing
    departing: Departing | None
    label: str
    at: str
    ratio: float
    verdict: str
    unmodelled: tuple[str, ...]
    missed: tuple[str, ...] = ()
    scales: tuple[float, ...] = ()

    @cached_property
    def now(self) -> Standing:
        """What fails now; sigmas and shares of limits by linear covariance."""
        if self.what_if is None:
            return Standing(verdict=self.verdict, ratio=self.ratio)
        covariance, ones = self.what_if.covariance, [1.0] * len(self.what_if.campaign.sliders)
        used, sigma = shares_used(self.what_if, [ones]), math.nan
        if self.departing is not None:
            reading = reading_at(covariance, self.departing.time)
            sigma = float(covariance.sigma(ones)[reading, self.departing.output])
        return Standing(verdict=self.verdict, ratio=self.ratio, sigma=sigma, used=math.nan if used is None else used[0])

    @property
    def tuned(self) -> bool:
        """Return whether a run with another number has other gains of an aided navigation's filter."""
        return "filter" in self.document.content and not is_code(_kind(self.document))

    @property
    def has_code(self) -> bool:
        """Return whether the scenario is a class of the user's."""
        return is_code(_kind(self.document))

    def remedy(self, change: Change, then: Standing, held: bool = False) -> Remedy:
        """Return a change with its effect."""
        text = written(change.content)
        return Remedy(words=change.words, lines=change.lines, campaign=text, then=then, held=held)

    def read(self, remedy: Remedy) -> Campaign:
        """Read the campaign with a remedy."""
        content = tomllib.loads(remedy.campaign)
        return parse_campaign(content, self.document.file, self.document.stem, code=self.document.code)


def _kind(document: Document) -> str:
    return str(document.content.get("scenario", {}).get("type", ""))


def case_of_run(content: RunAnalysis, document: Document, beside: str) -> Case | None:
    """Return what a run finds to fail; none where nothing does."""
    summary, judged = content.summary, content.summary.filter
    if not something_fails(summary):
        return None
    unmet = any(entry.finding == Finding.NOT_MET for entry in summary.requirements)
    departs = judged is not None and judged.verdict in DEPARTING
    what_if = content.what_if or what_if_of_run(content)
    departing, label, at, ratio, shares = None, "", "", math.nan, dict[str, float]()
    if judged is not None and departs:
        ratio = judged.factor if judged.factor is not None else math.nan
        name, time = judged.neglected_output or judged.output, judged.neglected_at or judged.worst
        if name and time is not None:
            departing, label = Departing(summary.names.index(name), time), judged.time
            at = instant(time, label)
        shares = shares_by_kind((entry.name, entry.share) for entry in judged.neglected)
    sources = tuple(
        Source(source.name, source.unit, source.shown_in, 0.0, group=source.group or "")
        for source in content.manifest.model.sources
    )
    return Case(
        document, beside, sources, tuple(summary.names), what_if, "requirement" if unmet else "filter", departing,
        label, at, ratio, judged.verdict if judged is not None else "",
        _unmodelled(what_if, sources, content.model, shares), _missed(document, shares),
        Basis.of(summary).scales,
    )  # fmt: skip


def case_of_answer(campaign: Campaign, answer: LinearAnswer) -> Case | None:
    """Return what linear analysis finds to fail; none where nothing does."""
    judged = answer.filter
    unmet = any(row.judged and not row.met for row in answer.requirements)
    departs = judged is not None and judged.verdict in DEPARTING
    if not answer.fails:
        return None
    document, beside = document_and_place(campaign)
    what_if = what_if_of_answer(as_read(answer), document.content, beside)
    answer = as_read(answer)
    judged = answer.filter
    names, departing, label, at = [output.name for output in answer.outputs], None, "", ""
    shares = dict[str, float]()
    if judged is not None and departs and judged.output:
        departing, label = Departing(names.index(judged.output), judged.worst), judged.label
        at = instant(judged.worst, label)
        shares = shares_by_kind((cause.name, cause.share) for cause in judged.neglected)
    return Case(
        document, beside, answer.sources, tuple(names), what_if, "requirement" if unmet else "filter", departing, label,
        at, judged.factor if judged is not None else math.nan, judged.verdict.value if judged is not None else "",
        _unmodelled(what_if, answer.sources, answer.model, shares), _missed(document, shares),
    )  # fmt: skip


def _unmodelled(
    what_if: WhatIf | None, sources: Sequence[Source], model: Model, shares: Mapping[str, float]
) -> tuple[str, ...]:
    """List the kinds of errors that a filter could model and does not, those first that it misses most."""
    if what_if is None:
        return ()
    sized = (np.diag(model.covariance) > 0.0) | (model.mean != 0.0)
    kinds = [kind_of(source.name) for source, known in zip(sources, sized, strict=True) if known]
    return tuple(kind for kind in dict.fromkeys([*shares, *kinds]) if kind in what_if.estimable)


def _missed(document: Document, shares: Mapping[str, float]) -> tuple[str, ...]:
    """List the kinds of errors that a filter in code misses, without those that make up little."""
    return tuple(kind for kind, share in shares.items() if share >= NAMED) if is_code(_kind(document)) else ()


def document_and_place(campaign: Campaign) -> tuple[Document, str]:
    """Return a campaign as its file has it, and where a changed file is to be saved."""
    content, beside = changeable_content(campaign)
    code = {} if campaign.code is None else {campaign.code.file: campaign.code}
    return Document(content, campaign.file, campaign.name, code), beside
