"""Comparison of several runs, as tables and as a page."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from mcnav.analysis.envelopes import Envelopes
from mcnav.analysis.run_comparison import Change
from mcnav.analysis.summary import Summary
from mcnav.contract.quantities import EndWords, end_words
from mcnav.errors import shortened
from mcnav.physics.units import conversion
from mcnav.report.document.parts import Facts, Folded, Note, Page, Part, Section, Sentence, Verdict, joined
from mcnav.report.document.table import CODE, Cell, Column, Table, counted, five_digits
from mcnav.report.drawing.figure import HALF, Figure
from mcnav.report.drawing.marks import Axis, Interval, Mark, Panel, Points, Rule, Series
from mcnav.report.drawing.palette import FLOWN, INK
from mcnav.report.figures import comparisons
from mcnav.report.format import interval, number, rounded, with_error
from mcnav.report.names import humanize, labels_in
from mcnav.report.pages.screen import RESULTS, answered
from mcnav.report.statements import details, fields, verdicts
from mcnav.report.statements.words import TONES
from mcnav.statistics.estimates import Estimate
from mcnav.store.manifest import Manifest

if TYPE_CHECKING:
    import pandas as pd

ABSENT: Final = "–"
NAN: Final = float("nan")
NOTHING: Final = Change(NAN, NAN, NAN, (NAN, NAN), Estimate(NAN, NAN, 0.0), False)
MARKS: Final = ("dot", "square", "triangle", "ring", "box")
"""Marker shapes of runs; their colour is that of Monte Carlo."""

CHANGED: Final = {"larger": "undecided", "smaller": "undecided", "no change seen": "agrees"}
"""Tones of findings; others have none."""

SAME: Final = "the same campaign, engine and versions"
"""Words for runs between which no input differs."""

COMMON: Final = (
    "Common random numbers: sample k of both runs uses the same ones, so that sampling noise cancels in the difference."
)

FIRST: Final = 18
"""Lines of outputs and runs that the figure of the first screen has room for."""

NAMED: Final = 3
"""Inputs that differ, and runs, that the first screen names."""

OF_SAMPLING: Final = ("samples", "seed")
"""Inputs that it names after those that change the errors."""

LONGEST: Final = 40
"""Characters of a value of them."""

MOST_INPUTS: Final = 1_000
"""Inputs that differ that are listed: a stranger's manifest may have a million."""


@dataclass(frozen=True)
class Row:
    """One output of a later run, counted from 1, compared with the first run; no change with too few samples.

    ``nominal`` are its values on the nominal flights, none of a navigation error.
    """

    run: int
    output: str
    unit: str
    shown_in: str
    change: Change | None
    nominal: tuple[float | None, float | None] = (None, None)

    @property
    def words(self) -> str:
        """Finding in words."""
        if self.change is None or not np.isfinite(self.change.ratio):
            still = self.change is not None and self.change.before == self.change.after == 0.0
            return details.NOT_DISTURBED if still else "nothing to compare"
        if not np.isfinite(self.change.interval[1]):
            return "no interval"
        if not self.change.certain:
            return "no change seen"
        return "larger" if self.change.ratio > 1.0 else "smaller"

    @property
    def title(self) -> str:
        """The output for people, and that root mean squares are compared, where they are."""
        return f"{humanize(self.output)}{', root mean square' if self.known.about_zero else ''}"

    @property
    def nominals(self) -> tuple[float | None, float | None]:
        """The nominal values in the unit shown."""
        before, after = (None if value is None else value * self.scale for value in self.nominal)
        return before, after

    @property
    def nominal_cells(self) -> dict[str, float | None]:
        """The nominal values by name."""
        return dict(zip(("nominal_before", "nominal_after"), self.nominals, strict=True))

    @property
    def known(self) -> Change:
        """The change; not a number where there is none."""
        return self.change or NOTHING

    @property
    def scale(self) -> float:
        """Factor from SI to the unit shown."""
        return conversion(self.unit, self.shown_in)

    @property
    def cells(self) -> dict[str, float | str | bool]:
        """The change by the names of data files, in the units shown."""
        known, scale = self.known, self.scale
        return {
            "sigma_before": known.before * scale, "sigma_after": known.after * scale, "change": self.words,
            "change_ratio": known.ratio, "change_ratio_from": known.interval[0], "change_ratio_to": known.interval[1],
            "change_mean": known.mean.value * scale,
            "change_mean_standard_error": known.mean.standard_error * scale, "common_draws": known.common,
            **({"compared": "root mean square"} if known.about_zero else {}),
            **{name: value for name, value in self.nominal_cells.items() if value is not None},
        }  # fmt: skip


def inputs(manifests: Sequence[Manifest]) -> pd.DataFrame:
    """Tabulate the inputs that differ between runs: one row per key of the campaign, one column per run.

    A last row says how many there are beyond `MOST_INPUTS`.
    """
    import pandas as pd  # slow to import: a fifth of a second

    flat = [
        dict(_flat(inputs.campaign))
        | {"engine": inputs.engine}
        | ({} if inputs.revision is None else {"revision": str(inputs.revision)})
        | {f"version of {name}": text for name, text in inputs.versions.items()}
        | {f"files.{name}": f"SHA-256 {text}" for name, text in inputs.files.items()}
        for inputs in (manifest.identity for manifest in manifests)
    ]
    rows = {
        key: [inputs.get(key, ABSENT) for inputs in flat]
        for key in dict.fromkeys(key for inputs in flat for key in inputs)
    }
    changed = {key: values for key, values in rows.items() if key != "name" and len(set(values)) > 1}
    if (more := len(changed) - MOST_INPUTS) > 0:
        changed = dict(islice(changed.items(), MOST_INPUTS)) | {f"and {more:,} more": [""] * len(manifests)}
    return pd.DataFrame.from_dict(changed, orient="index", columns=range(len(manifests)))


def _flat(value: Any, prefix: str = "") -> Iterator[tuple[str, str]]:
    """Flatten nested tables; keys are joined by dots.

    >>> dict(_flat({"errors": {"altitude": "5 km"}, "samples": 20}))
    {'errors.altitude': '5 km', 'samples': '20'}
    """
    if isinstance(value, Mapping):
        entries: Iterable[tuple[Any, Any]] = value.items()
    elif isinstance(value, list) and any(isinstance(entry, Mapping) for entry in value):
        entries = enumerate(value, 1)
    else:
        yield prefix.removesuffix("."), str(value)
        return
    for key, entry in entries:
        yield from _flat(entry, f"{prefix}{key}.")


def outputs(rows: Sequence[Row], titles: Sequence[str]) -> pd.DataFrame:
    """Tabulate the change of each output in the units shown: one row per output of a later run."""
    import pandas as pd

    cells = [{"run": titles[row.run], "output": row.output, "unit": row.shown_in, **row.cells} for row in rows]
    return pd.DataFrame(cells, columns=None if cells else ["run", "output"]).set_index(["run", "output"])


def ratios(rows: Sequence[Row], titles: Sequence[str]) -> Figure | None:
    """Draw the sigma ratios of later runs to the first."""
    known = [(row, row.change) for row in rows if row.change is not None and np.isfinite(row.change.interval).all()]
    if not known:
        return None
    later = sorted({row.run for row, _ in known})
    series = {
        run: Series(f"run-{run}", f"{titles[run]}, Monte Carlo", FLOWN, MARKS[k % len(MARKS)])
        for k, run in enumerate(later)
    }
    names = list(dict.fromkeys(row.output for row, _ in known))

    marks: list[Mark] = [Rule(1.0, colour=INK)]
    for row, change in known:
        step = later.index(row.run) - 0.5 * (len(later) - 1)
        place = names.index(row.output) + 0.7 * step / max(len(later), 2)
        low, high = change.interval
        text = f"{humanize(row.output)}, {titles[row.run]}: {rounded(change.ratio)} ({rounded(low)} to {rounded(high)})"
        marks += [
            Interval(series[row.run], place, low, high, text),
            Points(series[row.run], [change.ratio], [place], 7.5, texts=[text]),
        ]
    shown = {row.output: f"{humanize(row.output)}{' (rms)' if row.known.about_zero else ''}" for row, _ in known}
    rows_axis = Axis(names=[shown[name] for name in names])
    measure = "σ" if not any(row.known.about_zero for row, _ in known) else "σ or rms"
    return Figure(
        name="changes",
        title="Sigma of each output relative to the first run",
        description="Monte Carlo sigma of each output and run over that of the first run, with its interval.",
        panels=[Panel("", Axis(f"{measure} / {measure} of the first run", log=True), rows_axis, marks)],
        key=tuple(series.values()),
        columns=dict(outputs([row for row, _ in known], titles).reset_index().items()),
        size=(HALF[0], 82.0 + 24.0 * len(names) * (1 + len(later))),
    )


def page(
    titles: Sequence[str],
    summaries: Sequence[Summary],
    manifests: Sequence[Manifest],
    rows: Sequence[Row],
    confidence: float,
    over_time: Sequence[Envelopes | None],
) -> Page:
    """Return the comparison as a page; ``over_time`` are the sigmas of each run over time, where they are known."""
    changed, words = input_table(titles, manifests), end_words(manifests[0].model.outputs)
    nothing = Sentence(f"None: the runs have {SAME}.")
    sections = [
        Section("runs", "Verdicts", [_verdict_table(titles, summaries)]),
        Section("inputs", "Changed inputs", [changed if changed.rows else nothing]),
        Section("outputs", "Change from baseline", _changes(titles, rows, confidence, words)),
    ]
    if (drawn := comparisons.curves(titles, summaries, over_time)) is not None:
        sections.append(Section("curves", "Over time", [drawn]))
    budgets = [*_waterfalls(titles, summaries), *_budgets(titles, manifests, summaries)]
    sections.append(Section("budget", "Error budget", budgets))
    heading = ", ".join(titles)
    verdict, most = _changed(titles, rows), ratios(_changed_most(rows), titles)
    verdict = replace(verdict, sentences=[*changed_verdicts(titles, summaries), *verdict.sentences])
    head = joined(verdict, _inputs_in_brief(manifests))
    return answered(Page(heading, "Comparison of runs", heading, head, sections=sections), most, RESULTS)


def _inputs_in_brief(manifests: Sequence[Manifest]) -> Facts | None:
    """Name the first keys of the campaign that differ, with their values in two runs; none where none differs."""
    rows = [(str(key), [shortened(value) for value in values]) for key, values in inputs(manifests).iterrows()]
    if not rows:
        return None
    rows.sort(key=lambda row: row[0] in OF_SAMPLING)
    entries = [
        (key, " → ".join(values).replace(ABSENT, "absent") if max(map(len, values)) <= LONGEST else "changed")
        for key, values in rows[:NAMED]
    ]
    if (more := len(rows) - NAMED) > 0:
        entries.append(("and", f"{more} more changed input{'s' * (more > 1)}"))
    return Facts(entries, below=True)


def _changed_most(rows: Sequence[Row]) -> list[Row]:
    """Return the rows of the outputs that change the most, in the order of all, as many as the first screen shows."""
    sizes: dict[str, float] = {}
    for row in rows:
        ratio = row.known.ratio
        size = abs(math.log(ratio)) if ratio > 0.0 and math.isfinite(ratio) else 0.0
        sizes[row.output] = max(size, sizes.get(row.output, 0.0))
    most = max(1, FIRST // (1 + max((row.run for row in rows), default=0)))
    shown = sorted(sizes, key=lambda name: -sizes[name])[:most]
    return [row for row in rows if row.output in shown]


def _changed(titles: Sequence[str], rows: Sequence[Row]) -> Verdict:
    """Say how many outputs changed, and which of them the most."""
    known = [row for row in rows if row.words in ("larger", "smaller") and row.known.ratio]
    if not known:
        return Verdict(f"No output is seen to differ from {titles[0]}.", "agrees")
    most = max(known, key=lambda row: abs(math.log(row.known.ratio)))
    counts = [(word, sum(row.words == word for row in known)) for word in ("larger", "smaller")]
    said = " and ".join(f"{count} {word}" for word, count in counts if count)
    all_alike = len(rows) > 1 and len(rows) in (count for _, count in counts)
    subject = (
        f"All {len(rows)} sigmas at the end are {known[0].words}"
        if all_alike
        else f"Of {len(rows)} sigmas at the end {said}"
    )
    others = f" in {titles[1]}" if len(titles) == 2 else ""
    return Verdict(
        f"{subject}{others} than in {titles[0]}.", "undecided",
        [f"Largest change: {most.title} in {titles[most.run]}, {rounded(most.known.ratio)} times."],
    )  # fmt: skip


def changed_verdicts(titles: Sequence[str], summaries: Sequence[Summary]) -> list[str]:
    """Say which verdicts differ between the runs: on the filter, on requirements, on linear analysis.

    A verdict in which a run has no part is not compared.
    """
    subjects = {
        "Filter": [summary.filter.verdict if summary.filter else "" for summary in summaries],
        "Requirements": [fields.counts(summary) for summary in summaries],
        "Linear analysis": [verdicts.tone(summary) for summary in summaries],
    }
    return [
        f"{subject}: {', '.join(f'{words} in {title}' for words, title in zip(said, titles, strict=True))}."
        for subject, said in subjects.items()
        if len(set(said)) > 1 and all(said) and len(said) <= NAMED
    ]


def terminal(
    titles: Sequence[str], manifests: Sequence[Manifest], rows: Sequence[Row], confidence: float
) -> list[Part]:
    """List what the terminal shows: the inputs that differ, and the change of each output."""
    changed, words = input_table(titles, manifests), end_words(manifests[0].model.outputs)
    return [
        *([_changed(titles, rows)] if rows else []),
        changed if changed.rows else Sentence(f"The runs have {SAME}."),
        change_table(titles, rows, confidence, words),
    ]


def _verdict_table(titles: Sequence[str], summaries: Sequence[Summary]) -> Table[tuple[str, Summary]]:
    """Tabulate the verdicts on linear analysis and, where there is one, on the filter of each run."""
    filters = any(summary.filter for summary in summaries)

    def on_linear(summary: Summary) -> str:
        return verdicts.headline(summary, ("means", "linear", "requirements"))

    def of_filter(row: tuple[str, Summary]) -> Cell:
        words = row[1].filter.verdict if row[1].filter else ""
        if not words:
            return Cell("–")
        return Cell(words, tone=TONES.get(words, ""), behind=row[1].filter_verdict)

    verdict: Column[tuple[str, Summary]] = Column(
        "Verdict",
        lambda row: Cell(
            verdicts.tone(row[1]),
            tone=verdicts.standing(row[1]),
            behind=on_linear(row[1]),
        ),
        kind="words",
    )
    columns: list[Column[tuple[str, Summary]]] = [
        Column("Run", lambda row: row[0], kind="label", of_user=True),
        Column("Campaign", lambda row: row[1].campaign, kind="words", of_user=True),
        Column("Samples", lambda row: row[1].samples, form=counted),
        Column("Failed", lambda row: row[1].failed, form=counted),
        verdict,
        *([Column("Filter", of_filter, kind="words")] if filters else []),
    ]
    on_filter = " and on the filter" if filters else ""
    caption = f"Verdict on linear covariance analysis{on_filter} for each run."
    return Table(caption, columns, list(zip(titles, summaries, strict=True)))


Values = tuple[str, Sequence[str]]
"""A name with a value for each run."""


def _of_runs(titles: Sequence[str]) -> list[Column[Values]]:
    """Return a column for each run."""

    def of_run(place: int) -> Column[Values]:
        return Column(titles[place], lambda row: row[1][place], kind="label", of_user=True)

    return [of_run(place) for place in range(len(titles))]


def input_table(titles: Sequence[str], manifests: Sequence[Manifest]) -> Table[Values]:
    """Tabulate the inputs that differ between runs."""
    rows = [(str(key), [shortened(value) for value in values]) for key, values in inputs(manifests).iterrows()]
    caption = (
        "Keys of the campaign, engine and versions that differ between the runs. A dash: the run does not have the key."
    )
    key: Column[Values] = Column("Key", lambda row: CODE(row[0]), "key", "label")
    return Table(caption, [key, *_of_runs(titles)], rows, "Changed inputs")


def _changes(titles: Sequence[str], rows: Sequence[Row], confidence: float, words: EndWords) -> list[Part]:
    """Draw and tabulate the change of each output from the first run."""
    if not rows:
        return [Sentence("The first run shares no output with another run.")]
    common = Note(COMMON) if any(row.change is not None and row.change.common for row in rows) else None
    return [*joined(ratios(rows, titles), change_table(titles, rows, confidence, words), common)]


def change_table(titles: Sequence[str], rows: Sequence[Row], confidence: float, words: EndWords) -> Table[Row]:
    """Tabulate sigmas before and after, their ratio and the change of the mean."""

    def ratio(row: Row) -> Cell:
        known = row.known
        return Cell(five_digits(known.ratio), below=interval(*known.interval))

    def mean(row: Row) -> str:
        known = row.known.mean
        return with_error(known.value * row.scale, known.standard_error * row.scale)

    def nominal(when: str, place: int) -> Column[Row]:
        return Column(f"Nominal {when}", lambda row: row.nominals[place], f"nominal {when}", form=five_digits)

    squared = any(row.known.about_zero for row in rows)
    measure = "Paired σ or rms" if squared else "Paired σ"
    columns: list[Column[Row]] = [
        Column("Output", lambda row: Cell(row.title, row.shown_in), words.heading, "label"),
        Column("Run", lambda row: titles[row.run], "run", "label"),
        *([nominal("before", 0), nominal("after", 1)] if any(row.nominal != (None, None) for row in rows) else []),
        Column(
            f"{measure} before", lambda row: row.known.before * row.scale, f"{measure.lower()} before", form=five_digits
        ),
        Column(f"{measure} after", lambda row: row.known.after * row.scale, "after", form=five_digits),
        Column("Paired ratio", ratio, "ratio"),
        Column("interval", lambda row: interval(*row.known.interval), place="terminal"),
        Column("Change of the mean", mean, place="page"),
        Column("Random numbers", lambda row: "common" if row.known.common else "separate", "random numbers", "label"),
        Column("Change", lambda row: Cell(row.words, tone=CHANGED.get(row.words, "")), "change", "label"),
    ]
    caption = (
        f"{words.title} of each run compared with {titles[0]}. Monte Carlo sigmas (paired estimates), their ratio, and "
        f"the change of the mean ± one standard error. All intervals hold jointly at {100.0 * confidence:g} %."
    )
    if squared:
        caption += " Where a mean error exceeds one sigma in a run, root mean squares are compared in place of sigmas."
    return Table(caption, columns, rows, f"Change from {titles[0]}", keys=2)


def _waterfalls(titles: Sequence[str], summaries: Sequence[Summary]) -> tuple[Figure, ...]:
    """Draw the difference of each later run's error budget from that of the first run."""
    pairs = [((titles[0], title), later) for title, later in zip(titles[1:], summaries[1:], strict=True)]
    figures = (
        comparisons.waterfall(names, summaries[0], later, f"waterfall-{run}")
        for run, (names, later) in enumerate(pairs, start=1)
    )
    return tuple(figure for figure in figures if figure is not None)


def _budgets(titles: Sequence[str], manifests: Sequence[Manifest], summaries: Sequence[Summary]) -> list[Part]:
    """Tabulate for each output of the first run the effect of one sigma of each source and process, run by run."""
    parts = list[Part]()
    for output in manifests[0].model.outputs:
        scale = conversion(output.unit, output.shown_in)
        rows: dict[str, list[str]] = {}
        for at, (manifest, summary) in enumerate(zip(manifests, summaries, strict=True)):
            names = [output.name for output in manifest.model.outputs]
            if output.name not in names:
                continue
            contributions = summary.budget.contributions[names.index(output.name)]
            labels = [*labels_in(summary), *(humanize(process.name) for process in summary.processes)]
            for label, value in zip(labels, contributions, strict=True):
                rows.setdefault(label, [ABSENT] * len(manifests))[at] = number(value * scale, 4)
        shown: list[Values] = [(label, cells) for label, cells in rows.items() if set(cells) - {"0", ABSENT}]
        name, words = humanize(output.name), end_words([output])
        caption = (
            f"{name}, {output.shown_in}: {words.one} for one sigma of each cause alone, by the linear model of each "
            "run."
        )
        cause: Column[Values] = Column("Cause", lambda row: row[0], kind="label")
        parts.append(Folded(name, [Table(caption, [cause, *_of_runs(titles)], shown)]))
    return parts
