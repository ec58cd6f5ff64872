"""The page of a judged record."""

from __future__ import annotations

from mcnav.contract.recorded import FilteredRecord
from mcnav.judgement.verdict import Judgement
from mcnav.report.document.parts import Lines, Listing, Note, Page, Section, joined
from mcnav.report.figures.judge import innovations, reference_errors, whiteness
from mcnav.report.pages.judged import basis, cause_table, nees_table, offset_table, sensor_table, to_paste, verdict
from mcnav.report.pages.screen import RESULTS, answered

METHOD = (
    "The verdict is on the largest of all statistics, each over its 95 % point in simulated records. They are mean NIS "
    "and autocorrelation of each sensor, and NEES against a reference. Others are what the likelihood of the "
    "innovations gains by another size of each number, or by a constant error. An alarm is a statistic that fewer than "
    "5 % of simulated records have. Simulated records are linear and have the gains that the filter used on this one."
)


def page(title: str, record: FilteredRecord, judgement: Judgement) -> Page:
    """Return the page."""
    pasted = to_paste(judgement)
    sections = [Section("change", "What to change", [Lines(pasted, "Tables to paste")])] if pasted else []
    sections += [
        Section("innovations", "Innovations", [innovations(record), whiteness(record), sensor_table(judgement)])
    ]
    compared = joined(reference_errors(record, judgement), nees_table(judgement))
    if compared:
        sections.append(Section("reference", "Errors against the reference", compared))
    sections.append(
        Section(
            "numbers", "What the record says of each number", joined(cause_table(judgement), offset_table(judgement))
        )
    )
    notes = Listing(judgement.notes) if judgement.notes else None
    return answered(Page(
        title, "A recorded flight judged", title, joined(verdict(judgement), basis(judgement), notes), sections,
        [Note(METHOD)],
    ), rest=RESULTS)  # fmt: skip
