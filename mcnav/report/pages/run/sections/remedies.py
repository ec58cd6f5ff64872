"""The section "What would help": remedies with what each does, the best first, and the best on the first screen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from markupsafe import Markup, escape

from mcnav.analysis.remedies import CONFIRMING, REFUTING, Remedies, Remedy
from mcnav.contract.quantities import Output
from mcnav.physics.units import conversion
from mcnav.report.document.parts import Folded, Note, Part, Section, Sentence, joined
from mcnav.report.document.table import CODE, Cell, Column, Table
from mcnav.report.format import rounded
from mcnav.report.names import humanize
from mcnav.report.statements.words import several
from mcnav.store.manifest import Variable

TITLE: Final = "What would help"
ALL_REMEDIES: Final = "mcnav report RUN --remedies"

COPY: Final = Markup('<button type="button" class="copy" data-toml="{}" hidden>Copy TOML</button>').format
LINK: Final = Markup('<a href="#remedies">{}</a>').format

COMPUTED: Final = (
    "Linear covariance of each changed campaign, its filter re-tuned. Copy TOML gives the whole campaign file with the "
    "change: save it {}."
)
HELD: Final = "“Gains held”: the filter keeps its gains, and a run of the changed file re-tunes it."
DRAWS: Final = "Samples of a changed campaign have the draws of this run."
LEFT: Final = "A run does not wait for {} more: {} computes them."
WITHHELD: Final = "Withheld, because linear analysis does not hold of it or samples did not confirm it: {}."
UNEXAMINED: Final = "Flights did not examine linear analysis of all changes: {}. {} does it."
DOUBT: Final = "linear analysis {} of it: simulate it first"
CODE_FILTER: Final = "What the filter models is in the code of the scenario. Let it estimate or consider {}."
TONES: Final = dict.fromkeys(CONFIRMING, "agrees") | dict.fromkeys(REFUTING, "differs")
UNKNOWN: Final = "None known: see why"
LONGEST: Final = 14
"""Most words of a reason that the first screen gives; the section has it in full."""

NAMED: Final = 3
"""Remedies that are named where they are withheld."""

FIRST: Final = 3
"""Remedies that are not folded."""

Outputs = Sequence[Output | Variable]


def remedies_section(remedies: Remedies | None, outputs: Outputs, command: str) -> Section | None:
    """Return the section; none where nothing fails. ``command`` computes all remedies."""
    return None if remedies is None else Section("remedies", TITLE, remedy_parts(remedies, outputs, command))


def remedy_parts(remedies: Remedies, outputs: Outputs, command: str) -> list[Part]:
    """Tabulate the remedies, or say why there is none."""
    notes = [
        Note(CODE_FILTER.format(several([humanize(kind) for kind in remedies.missed]))) if remedies.missed else None,
        Note(WITHHELD.format(several(remedies.withheld, NAMED))) if remedies.withheld else None,
        Note(Markup(UNEXAMINED).format(remedies.unexamined, CODE(command))) if remedies.unexamined else None,
        Note(Markup(LEFT).format(remedies.left, CODE(command))) if remedies.left else None,
    ]
    if not remedies.listed:
        return [Sentence(f"{remedies.reason[:1].upper()}{remedies.reason[1:]}."), *joined(*notes)]
    how = " ".join([
        COMPUTED.format(remedies.beside),
        *([HELD] if any(remedy.held for remedy in remedies.listed) else []),
        *([DRAWS] if any(remedy.samples for remedy in remedies.listed) else []),
    ])  # fmt: skip
    table = remedy_table(remedies, outputs)
    rest = len(table.rows) - FIRST
    if rest < 2:
        return [table, *joined(*notes), Note(how)]
    others = Folded(f"{rest} that help less", [replace(table, rows=table.rows[FIRST:], caption="")])
    return [replace(table, rows=table.rows[:FIRST]), others, *joined(*notes), Note(how)]


def remedy_table(remedies: Remedies, outputs: Outputs) -> Table[Remedy]:
    """Tabulate the remedies, below what stands now."""

    def simulated(row: Remedy) -> Cell:
        if not row.simulated:
            return Cell("–")
        return Cell(row.simulated, below=f"{row.samples:,} samples", tone=TONES.get(row.simulated, "undecided"))

    def verdict(row: Remedy) -> Cell:
        return Cell(row.then.verdict, tone=TONES.get(row.then.verdict, "undecided"))

    columns: list[Column[Remedy]] = [
        Column("Change", lambda row: Cell(_first_up(row.words), below="gains held" if row.held else ""), kind="words")
    ]
    if remedies.failing == "filter":
        ratio = Column[Remedy]("True over filter σ at worst", lambda row: rounded(row.then.ratio))
        columns += [Column("Filter then", verdict, kind="label"), ratio]
        if remedies.output and not math.isnan(remedies.now.sigma):
            heading = f"True σ of {humanize(remedies.output)} at {remedies.at}"
            columns.append(Column(heading, lambda row: sigma_words(row.then.sigma, remedies, outputs)))
    else:
        columns.append(Column("Limit used then", lambda row: percent(row.then.used)))
    if any(row.doubted for row in remedies.listed):
        columns.append(Column("Linear analysis then", lambda row: row.linearity or "not examined", kind="label"))
    if any(row.simulated for row in remedies.listed):
        columns.append(Column("Simulated", simulated, kind="label"))
    columns.append(Column("", lambda row: Cell(COPY(row.campaign)), kind="label", place="page"))
    return Table(_caption(remedies, outputs), columns, remedies.listed)


def _caption(remedies: Remedies, outputs: Outputs) -> str:
    """State what holds now."""
    now = remedies.now
    if remedies.failing == "requirement":
        return f"Largest share of a limit that a requirement uses. Now: {percent(now.used)}; below 100 % all are met."
    words = f"Now: true σ is {rounded(now.ratio)} times the filter's."
    if remedies.output and not math.isnan(now.sigma):
        words += f" True σ of {humanize(remedies.output)}: {sigma_words(now.sigma, remedies, outputs)}."
    return words


def fix_name(remedies: Remedies | None, subject: str = "") -> str:
    """Name what the first screen says of the best remedy: a fix only where nothing fails any more.

    ``subject`` is what the verdict is about, where it may be something else than what fails.
    """
    if remedies is None:
        return ""
    whole = remedies.best is None or remedies.best.mends
    other = remedies.failing == "filter" and subject not in ("", "filter")
    if other:
        return "Fix of the filter" if whole else "Helps the filter"
    return "Fix" if whole else "Helps most"


def fix(remedies: Remedies | None, outputs: Outputs) -> Markup | str:
    """Return the best remedy and its effect for the first screen, or why there is none; empty where nothing fails."""
    if remedies is None:
        return ""
    if remedies.best is None:
        reason = f"{remedies.reason[:1].upper()}{remedies.reason[1:]}."
        return LINK(reason if len(reason.split()) <= LONGEST else UNKNOWN)
    best = remedies.best
    done = effect(remedies, outputs)
    if best.doubted:
        done = f"{done}; {DOUBT.format(best.linearity)}"
    return Markup("{}: {}. {}").format(LINK(_first_up(best.words)), done, COPY(best.campaign))


def effect(remedies: Remedies, outputs: Outputs) -> str:
    """Say in a few words what the best remedy does."""
    best = remedies.best
    if best is None:
        return ""
    by = f" in {best.samples:,} samples" if best.confirmed else ""
    if remedies.failing == "requirement":
        finding = f", {best.simulated}{by}" if best.confirmed else ""
        return f"{percent(best.then.used)} of the limit ({percent(remedies.now.used)} now){finding}"
    if best.mends:
        sigma = remedies.output and not math.isnan(best.then.sigma)
        of = f", {humanize(remedies.output)} {sigma_words(best.then.sigma, remedies, outputs)}" if sigma else ""
        return f"consistent{by}{of}"
    return f"ratio {rounded(best.then.ratio, 2)} ({rounded(remedies.now.ratio, 2)} now)"


def sigma_words(sigma: float, remedies: Remedies, outputs: Outputs) -> str:
    """Write a sigma of the output that departs in the unit that it is shown in."""
    output = next(output for output in outputs if output.name == remedies.output)
    return f"{rounded(sigma * conversion(output.unit, output.shown_in), 2)} {output.shown_in}".strip()


def percent(share: float) -> str:
    """Write a share of a limit; with three digits near one, so that 99.6 % is not 100 %."""
    return "–" if math.isnan(share) else f"{100.0 * share:.3g} %"


def _first_up(words: str) -> Markup:
    """Begin with a capital letter; a key of the campaign file stays as it is, in code."""
    key, mark, size = words.partition(" at ")
    if mark and "." in key:
        return CODE(key) + Markup(" at {}").format(size)
    return escape(f"{words[:1].upper()}{words[1:]}")
