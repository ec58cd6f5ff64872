"""Tuning of a filter for a box: verdict, beliefs to paste, and what was tried."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Final

import tomli_w

from mcnav.analysis.remedies import DOUBTED
from mcnav.analysis.tuning import ROUNDING, Candidate, TunedBelief, Tuning
from mcnav.report.document.parts import Page, Part, Sentence, Verdict
from mcnav.report.document.table import Column, Table
from mcnav.report.format import rounded
from mcnav.report.statements.box import setting_words

DOUBT: Final = {
    "does not hold": "Linear analysis does not hold with these beliefs",
    "cannot say": "Flights cannot say whether linear analysis holds with these beliefs",
}
SHORT: Final = {"does not hold": "does not hold", "cannot say": "is not shown to hold"}
"""What flights say of linear analysis, as a sentence and as a clause."""

LEAST_SHOWN: Final = 1e-4
"""Smallest excess of a ratio over one that five digits show."""


def verdict(tuning: Tuning) -> Verdict:
    """State whether a filter was found, and what it costs."""
    ratio = _ratio(tuning.before)
    before = f"As it is, the largest true ÷ filter sigma is {ratio} over the settings that were looked at."
    if tuning.chosen is None:
        words = "No filter that was tried bounds the errors at every setting"
        return Verdict(words, "differs", [before, "Let the filter model more of the errors: [filter] estimates."])
    largest = f"With the beliefs below it is {_ratio(tuning.chosen.ratio)}," if tuning.believes else "The filter is"
    sentences = [
        before,
        f"{largest} closest to optimistic at {tuning.closest} with {setting_words(tuning.worst)}.",
        f"Errors are there {rounded(tuning.known)} times those of a filter that knows this setting.",
    ]
    if tuning.box is not None and not tuning.box.exact:
        sentences.append(f"The worst of {tuning.box.settings:,} settings; it is no proof.")
    if tuning.confirmed == "undecided":
        sentences.append(f"{tuning.samples:,} samples there do not decide whether it is consistent.")
    elif tuning.confirmed:
        sentences.append(f"By {tuning.samples:,} samples there it is {tuning.confirmed}.")
    if tuning.linearity in DOUBTED:
        sentences.append(f"{DOUBT[tuning.linearity]}: simulate this filter before you use it.")
    if tuning.unexamined:
        sentences.append(f"Linear analysis was not examined at all settings: {tuning.unexamined}. --examine does it.")
    if tuning.confirmed == "optimistic":
        return Verdict("Linear analysis finds no setting optimistic, but samples do", "differs", sentences)
    if tuning.doubted:
        words = f"The filter is optimistic nowhere by linear analysis, which {SHORT[tuning.linearity]} here"
        return Verdict(words, "undecided", sentences)
    filtered = "With these beliefs" if tuning.believes else "As it is,"
    return Verdict(f"{filtered} the filter is optimistic at no setting that was looked at", "agrees", sentences)


def _ratio(value: float) -> str:
    """Shorten a ratio to five digits, or to the two decimals by which it is above one.

    >>> _ratio(0.992059731), _ratio(1.0000174), _ratio(1.0 + 1e-12)
    ('0.99206', '1.000017', '1.0000')
    """
    above = value - 1.0
    digits = 2 - math.floor(math.log10(above)) if ROUNDING < above < LEAST_SHOWN else 5
    return rounded(value, digits)


def pasted(tuning: Tuning) -> str:
    """Write the table to be pasted into the campaign file."""
    return tomli_w.dumps({"filter": {"believes": dict(tuning.believes)}}).strip()


def _beliefs(tuning: Tuning) -> Table[TunedBelief]:
    columns: list[Column[TunedBelief]] = [
        Column("Belief", lambda row: row.path, "belief", "label"),
        Column("Sigma times", lambda row: rounded(row.factor), "sigma ×"),
        Column("Because", lambda row: row.why, "because", "words"),
    ]
    rows = [] if tuning.chosen is None else tuning.chosen.beliefs
    return Table(
        "Beliefs, and by how much each sigma lies above the upper end of what is true.", columns, rows, "Beliefs"
    )


def _candidates(tuning: Tuning) -> Table[Candidate]:
    columns: list[Column[Candidate]] = [
        Column("Filter", lambda row: row.name, "filter", "label"),
        Column("Largest true ÷ filter sigma", lambda row: _ratio(row.ratio), "largest true ÷ filter σ"),
        Column("Cost", lambda row: rounded(row.cost, 4), "cost"),
    ]
    caption = f"Filters that were tried. Cost: {tuning.measure}."
    return Table(caption, columns, tuning.candidates, "Filters that were tried")


def terminal(tuning: Tuning) -> list[Part]:
    """List what the terminal shows besides the table to paste."""
    answer = verdict(tuning)
    parts: list[Part] = [Verdict(answer.headline, answer.tone), *(Sentence(words) for words in answer.sentences)]
    return [*parts, *([_beliefs(tuning)] if tuning.believes else []), _candidates(tuning)]


def page(tuning: Tuning) -> Page:
    """Return the page."""
    head: list[Part] = [verdict(tuning), *([_beliefs(tuning)] if tuning.believes else []), _candidates(tuning)]
    return Page(f"{tuning.campaign}: tuning", "Tuning", tuning.campaign, head, [])


def table(tuning: Tuning) -> Mapping[str, object]:
    """Arrange a tuning as ``tune.json`` has it."""
    return {
        "campaign": tuning.campaign,
        "measure": tuning.measure,
        "before": tuning.before,
        "ratio": None if tuning.chosen is None else tuning.chosen.ratio,
        "cost": None if tuning.chosen is None else tuning.chosen.cost,
        "known": tuning.known,
        "worst": dict(tuning.worst),
        "believes": tuning.believes,
        "candidates": [asdict(candidate) for candidate in tuning.candidates],
        "confirmed": tuning.confirmed,
        "samples": tuning.samples,
        "linearity": {"chosen": tuning.linearity or None, "unexamined": tuning.unexamined or None},
    }
