"""The sections on a filter: its consistency, and the errors that it estimates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from markupsafe import Markup

from mcnav.analysis.filter_consistency import FilterConsistency
from mcnav.analysis.summary import Summary
from mcnav.report.columns.faults import faults_table
from mcnav.report.columns.filter_columns import foremost_neglected, groups_table, sensors_table, sigmas_of
from mcnav.report.columns.filter_tables import at_worst
from mcnav.report.document.parts import Folded, Part, Section, Sentence, folded, headed, joined
from mcnav.report.document.table import EMPHASIS, label
from mcnav.report.drawing.figure import Figure
from mcnav.report.results.model import RunAnalysis
from mcnav.report.statements import details
from mcnav.report.statements.words import TONES

EXPLANATION: Final = (
    "The mean NEES of d states is d if the filter's covariance is that of its errors. The root of NEES over d is true "
    "sigma over filter sigma, averaged over directions. In it single errors average out; so the sigma of each output "
    "is compared with the filter's as well. The filter is {optimistic} or {pessimistic} if an interval of one of these "
    "ratios lies beyond ±{tolerance:g} % of one. These intervals hold for all groups, outputs and epochs together at "
    "{confidence:g} %. It is {consistent} if the interval of every group and of every output at every "
    "single epoch lies within the tolerance. The verdict is on the navigation errors where they are a group, else on "
    "all of the filter's states, and on every output."
)


def filter_sections(content: RunAnalysis, drawn: Mapping[str, Figure]) -> list[Section]:
    """Arrange what is known of the filter; empty without one."""
    if content.filter is None:
        return []
    estimation = drawn.get("estimation")
    return [
        Section("filter", "Consistency of the filter", _consistency(content, content.filter, drawn)),
        *([] if estimation is None else [Section("estimation", "Estimated errors", [estimation])]),
    ]


def _consistency(content: RunAnalysis, result: FilterConsistency, drawn: Mapping[str, Figure]) -> list[Part]:
    summary = content.summary
    return [
        _verdict(content, result),
        *joined(drawn.get("sigma_history")),
        *_neglected(summary),
        *headed("Normalized estimation errors", drawn.get("nees_history")),
        groups_table(summary).read,
        *folded("Outputs", sigmas_of(summary, "output")),
        *folded("Other states of the filter", sigmas_of(summary, "state")),
        *_innovations(content, drawn),
        *_faults(content),
        *headed("Samples within the filter's sigmas", drawn.get("within_history")),
        Folded("How the verdict is found", [_explanation(result)], explains=True),
    ]


def _neglected(summary: Summary) -> tuple[Part, ...]:
    """Show the errors that the filter neglects, and say what tells the remedy; nothing without any."""
    table = foremost_neglected(summary)
    return headed("Neglected errors", table) if table else ()


def _verdict(content: RunAnalysis, result: FilterConsistency) -> Sentence:
    """State the verdict, where the filter is farthest off, and what makes it so."""
    verdict = result.verdict.value
    explained = " ".join(filter(None, (at_worst(result), details.explanation_of_filter(content.summary))))
    return Sentence(Markup("{} {}").format(label(verdict, TONES[verdict]), explained))


def _innovations(content: RunAnalysis, drawn: Mapping[str, Figure]) -> Sequence[Part]:
    record = content.manifest.model.filter
    confidence = f"{100.0 * content.summary.confidence:g} %"
    table = sensors_table(content.summary, bool(record and record.considered), confidence).read
    return headed("Innovations", drawn.get("nis_history"), table) if table.rows else ()


def _faults(content: RunAnalysis) -> Sequence[Part]:
    table = faults_table(content.summary).read
    return headed("Faults of the sensors", table) if table.rows else ()


def _explanation(result: FilterConsistency) -> Sentence:
    """Say how the verdict is found."""
    words = {word: EMPHASIS(word) for word in ("optimistic", "pessimistic", "consistent")}
    tolerance, confidence = 100 * result.tolerance, 100 * result.confidence
    return Sentence(Markup(EXPLANATION).format(tolerance=tolerance, confidence=confidence, **words))
