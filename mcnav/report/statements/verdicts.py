"""What is said of a run: one table of conditions, sentences, consequences and next steps, subject by subject.

The first row of a subject whose condition holds is said. ``{names}`` in its texts are the fields of
`mcnav.report.statements.fields`; a text with an empty field is left out.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from string import Formatter
from typing import TYPE_CHECKING, Final, Literal

from mcnav.report.statements import details, fields
from mcnav.report.statements.means import large_means_of
from mcnav.report.statements.words import TONES, WORST

if TYPE_CHECKING:
    from mcnav.analysis.summary import Summary, Tally
    from mcnav.arrays.types import Array

Subject = Literal["means", "requirements", "filter", "smoother", "linear"]
"""Subjects of verdicts, in the order of those of one tone."""

SUBJECTS: Final[tuple[Subject, ...]] = ("means", "requirements", "filter", "smoother", "linear")

WORDS: Final = {"agrees": "YES", "partly": "PARTLY", "differs": "NO", "undecided": "UNDECIDED"}
"""The verdict in one word, by tone."""

OF_REQUIREMENTS: Final = {"agrees": "MET", "differs": "NOT MET", "undecided": "UNDECIDED"}


@dataclass(frozen=True)
class Row:
    """A row of the table: when it holds, what is said, what follows from it, and what to do next."""

    holds: Callable[[Summary], bool]
    sentence: str
    consequence: str = ""
    next_step: str = ""


@dataclass(frozen=True)
class Statement:
    """A verdict: subject, tone, word, sentence, consequences, next step, cause; what explains it and warns of it."""

    subject: Subject
    tone: str
    word: str
    sentence: str
    consequences: tuple[str, ...] = ()
    next_step: str = ""
    cause: str = ""
    details: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


def _partly(summary: Summary) -> bool:
    return tone(summary) == "partly"


def _is(wanted: str) -> Callable[[Summary], bool]:
    return lambda summary: tone(summary) == wanted


def _filter_is(*verdicts: str) -> Callable[[Summary], bool]:
    """Return a condition: the verdict on the filter, which names what is worst unless it is consistent."""
    return lambda summary: (
        summary.filter is not None
        and summary.filter.verdict in verdicts
        and (summary.filter.verdict == "consistent" or bool(fields.factor(summary)))
    )


TABLE: Final[Mapping[Subject, Sequence[Row]]] = {
    "means": (Row(lambda summary: bool(large_means_of(summary)), "{means}"),),
    "requirements": (
        Row(lambda summary: summary.counts is not None, "Requirements: {counts}.", "Least margin: {least_margin}."),
    ),
    "filter": (
        Row(_filter_is("consistent"), "The filter's covariance is that of its errors{within}.",
            next_step="Its sigmas can be used as the filter computes them."),
        Row(_filter_is("optimistic"),
            "Do not trust this filter's covariance: {whose} errors are {factor} times what it computes.",
            "{worst_output}"),
        Row(_filter_is("pessimistic"),
            "This filter's covariance is larger than its errors: {whose} errors are {factor} times what it computes."),
        Row(lambda summary: summary.filter is not None, "{filter_verdict}"),
    ),
    "smoother": (Row(lambda summary: summary.smoother is not None, "{smoother_verdict}"),),
    "linear": (
        Row(lambda summary: summary.unsettled is not None, "{unsettled}"),
        Row(lambda summary: bool(summary.beyond_range), "{beyond_range}"),
        Row(lambda summary: not any(summary.sigma_linear) and summary.verdict != "differs",
            "Nothing to compare: {no_dispersion}."),
        Row(lambda summary: _partly(summary) and summary.verdict_matrix != "differs",
            "Every sigma is right. The samples do not decide on the full covariance matrix.",
            next_step="Run {samples_for_matrix} to decide."),
        Row(lambda summary: _partly(summary) and fields.mean_alone_differs(summary),
            "Every sigma is right. The mean is not.",
            next_step="Use the sigmas, with the mean errors of Monte Carlo."),
        Row(_partly, "Every sigma is right. The full covariance matrix is not.",
            next_step="Use the sigmas; do not gate or fuse with the full matrix."),
        Row(_is("differs"), "The linear {sigma_is} wrong for {wrong}.", next_step="Use the Monte Carlo sigmas."),
        Row(lambda summary: tone(summary) == "undecided" and summary.verdict_matrix == "differs",
            "The full covariance matrix is wrong. {succeeded} samples do not decide on the sigmas.",
            next_step="Run {samples_for_sigmas} to decide on the sigmas; do not gate or fuse with the full matrix."),
        Row(_is("undecided"), "{succeeded} samples do not decide whether every linear sigma is right.",
            next_step="Run {samples_for_sigmas} to decide."),
        Row(lambda summary: summary.filter is not None, "Linear covariance predicts every sigma within {bound}."),
        Row(lambda summary: summary.verdict_matrix == "agrees",
            "Every sigma is right, and so is the full covariance matrix.",
            next_step="Linear covariance is enough here, without a simulation."),
        Row(lambda summary: True, "Every sigma is right.",
            next_step="Linear covariance is enough here, without a simulation."),
    ),
}  # fmt: skip
"""All that is said of a run first. Subjects of which no row holds are left out."""


def statements(summary: Summary, epochs: Mapping[str, Array] | None = None) -> list[Statement]:
    """State the verdicts on a run, the worst first; mean errors that exceed one sigma follow only what fails.

    Parameters
    ----------
    epochs : mapping, optional
        Columns over time as `mcnav.store.run_folder.RunFolder.epochs` returns them, where they are stored.
    """
    return [_statement(subject, row, summary, epochs or {}) for subject, row in _rows(summary)]


def _rows(summary: Summary) -> list[tuple[Subject, Row]]:
    """Return the rows of the table that hold, the worst first."""
    rows = [
        (subject, row)
        for subject in SUBJECTS
        if (row := next((row for row in TABLE[subject] if row.holds(summary)), None)) is not None
    ]
    return sorted(rows, key=lambda said: WORST.index(tone_on(said[0], summary)))


def _statement(subject: Subject, row: Row, summary: Summary, epochs: Mapping[str, Array]) -> Statement:
    known = tone_on(subject, summary)
    consequences = [fill(row.consequence, summary, epochs)]
    if subject == "filter" and known == "differs":
        consequences.append(fields.silent_sensor(summary))
    if subject == "requirements":
        consequences.append(fields.margin(summary))
    sentence, next_step = fill(row.sentence, summary, epochs), fill(row.next_step, summary, epochs)
    unrepeated = [_unrepeated(words, next_step) for words in details.details_on(summary, subject, _partly(summary))]
    return Statement(
        subject=subject,
        tone=known,
        word=(OF_REQUIREMENTS if subject == "requirements" else WORDS)[known],
        sentence=sentence,
        consequences=tuple(filter(None, consequences)),
        next_step=next_step,
        cause=fields.cause(summary, subject) if known != "agrees" or subject == "requirements" else "",
        details=tuple(words for words in unrepeated if words not in ("", sentence)),
        warnings=details.warnings_on(summary) if subject == "linear" else (),
    )


DECIDES: Final = " would decide."
"""End of a sentence on the samples that an undecided verdict needs."""


def _unrepeated(words: str, next_step: str) -> str:
    """Leave out of details how many samples would decide, where the next step says it.

    >>> _unrepeated("It is undecided. About 2,000 samples would decide.", "Run about 2,000 samples to decide.")
    'It is undecided.'
    """
    asked = next_step.lower()

    def repeated(sentence: str) -> bool:
        return sentence.endswith(DECIDES) and sentence.removesuffix(DECIDES).lower() in asked

    kept = [sentence for sentence in re.split(r"(?<=\.)\s+", words) if not repeated(sentence)]
    return " ".join(kept)


def fill(text: str, summary: Summary, epochs: Mapping[str, Array]) -> str:
    """Put the fields of a text in their places; empty where one of them is."""
    names = [name for _, name, _, _ in Formatter().parse(text) if name]
    values = {name: fields.FIELDS[name](summary, epochs) for name in names}
    return text.format(**values) if all(values[name] or name in fields.MAY_BE_EMPTY for name in names) else ""


def headline(summary: Summary, subjects: Sequence[Subject] = SUBJECTS) -> str:
    """State the verdicts on a run in one line, the worst first."""
    return " ".join(fill(row.sentence, summary, {}) for subject, row in _rows(summary) if subject in subjects)


def tone_on(subject: Subject, summary: Summary) -> str:
    """Return the tone of the verdict on a subject."""
    if subject == "requirements" and summary.counts is not None:
        return tone_of(summary.counts)
    if subject == "filter" and summary.filter is not None:
        return TONES[summary.filter.verdict]
    if subject == "smoother" and summary.smoother is not None:
        return TONES[summary.smoother.verdict]
    return "partly" if subject == "means" else tone(summary)


def tone(summary: Summary) -> str:
    """Combine the verdicts on outputs and covariance matrix: ``agrees``, ``partly``, ``differs`` or ``undecided``.

    Beyond its range linear analysis differs, whatever the samples show.
    """
    if summary.unsettled:
        return "undecided"
    if summary.beyond_range:
        return "differs"
    if summary.verdict == "agrees" and summary.verdict_matrix not in ("agrees", None):
        return "partly"
    return summary.verdict


def tone_of(counts: Tally) -> str:
    """Return ``agrees`` when all requirements are met, ``differs`` when one is not met, else ``undecided``."""
    return "differs" if counts.not_met else "agrees" if counts.met == counts.of else "undecided"


def standing(summary: Summary) -> str:
    """Combine the tone with the requirements: an agreeing run is ``partly`` unless all requirements are met.

    It is so, too, where a mean error exceeds one sigma.
    """
    counts, result = summary.counts, tone(summary)
    is_open = (counts is not None and counts.met < counts.of) or bool(large_means_of(summary))
    return "partly" if result == "agrees" and is_open else result
