"""Comparison of several runs, as tables and as a page."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from mcnav.analysis.run_comparison import Change
from mcnav.analysis.summary import Summary
from mcnav.errors import shortened
from mcnav.report import filter_verdict, sentences
from mcnav.report.figures.agreement import forest
from mcnav.report.figures.figure import HALF, Figure
from mcnav.report.figures.marks import Axis, Mark, Panel, Rule, Series
from mcnav.report.figures.palette import LINEAR, SOURCE_COLOURS
from mcnav.report.format import number
from mcnav.report.html import filled
from mcnav.report.model import humanize, labels_in
from mcnav.statistics.estimates import Estimate
from mcnav.store.manifest import Manifest
from mcnav.units import conversion

if TYPE_CHECKING:
    import pandas as pd

ABSENT: Final = "–"
NAN: Final = float("nan")
NOTHING: Final = Change(NAN, NAN, NAN, (NAN, NAN), Estimate(NAN, NAN, 0.0), False)
MARKS: Final = ("dot", "square", "triangle", "ring", "box")
"""Marker shapes of runs, besides their colours."""

MOST_INPUTS: Final = 1_000
"""Inputs that differ that are listed: a stranger's manifest may have a million."""


@dataclass(frozen=True)
class Row:
    """One output of a later run, counted from 1, compared with the first run; no change with too few samples."""

    run: int
    output: str
    unit: str
    shown_in: str
    change: Change | None

    @property
    def words(self) -> str:
        """Finding in words."""
        if self.change is None or not np.isfinite(self.change.ratio):
            still = self.change is not None and self.change.before == self.change.after == 0.0
            return sentences.NOT_DISTURBED if still else "nothing to compare"
        if not np.isfinite(self.change.interval[1]):
            return "no interval"
        if not self.change.certain:
            return "no change seen"
        return "larger" if self.change.ratio > 1.0 else "smaller"

    @property
    def cells(self) -> dict[str, Any]:
        """The change by heading, in the units shown."""
        known, scale = self.change or NOTHING, conversion(self.unit, self.shown_in)
        return {
            "sigma before": known.before * scale, "sigma after": known.after * scale, "ratio": known.ratio,
            "from": known.interval[0], "to": known.interval[1], "mean after less before": known.mean.value * scale,
            "standard error": known.mean.standard_error * scale, "common draws": known.common, "change": self.words,
        }  # fmt: skip


def inputs(manifests: Sequence[Manifest]) -> pd.DataFrame:
    """Tabulate the inputs that differ between runs: one row per key of the campaign, one column per run.

    A last row says how many there are beyond `MOST_INPUTS`.
    """
    import pandas as pd  # slow to import: a fifth of a second

    flat = [
        dict(_flat(each.campaign))
        | {"engine": each.engine}
        | ({} if each.revision is None else {"revision": str(each.revision)})
        | {f"version of {name}": text for name, text in each.versions.items()}
        | {f"files.{name}": f"SHA-256 {text}" for name, text in each.files.items()}
        for each in (manifest.identity for manifest in manifests)
    ]
    rows = {
        key: [each.get(key, ABSENT) for each in flat] for key in dict.fromkeys(key for each in flat for key in each)
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

    return pd.DataFrame(
        [{"output": row.output, "unit": row.shown_in, "run": titles[row.run]} | row.cells for row in rows]
    )


def ratios(rows: Sequence[Row], titles: Sequence[str]) -> Figure | None:
    """Draw the sigma ratios of later runs to the first."""
    known = [(row, row.change) for row in rows if row.change is not None and np.isfinite(row.change.interval).all()]
    if not known:
        return None
    later = sorted({row.run for row, _ in known})
    series = {
        run: Series(f"run-{run}", titles[run], SOURCE_COLOURS[k % len(SOURCE_COLOURS)], MARKS[k % len(MARKS)])
        for k, run in enumerate(later)
    }
    names = list(dict.fromkeys(row.output for row, _ in known))

    marks: list[Mark] = [Rule(0.0, colour=LINEAR, width=1.6)]
    for row, change in known:
        step = later.index(row.run) - 0.5 * (len(later) - 1)
        place = names.index(row.output) + 0.7 * step / max(len(later), 2)
        marks += forest(series[row.run], [place], [(change.ratio, *change.interval)], [humanize(row.output)])
    rows_axis = Axis(names=[humanize(name) for name in names])
    return Figure(
        name="changes",
        title="Sigma of each output relative to the first run",
        description="Difference of the Monte Carlo sigma of each output and run from that of the first run, with its "
        "interval.",
        panels=[Panel("", Axis("difference of σ from the first run", "%"), rows_axis, marks)],
        key=tuple(series.values()),
        columns=dict(outputs([row for row, _ in known], titles).items()),
        size=(HALF[0], 82.0 + 24.0 * len(names) * (1 + len(later))),
    )


def render(
    titles: Sequence[str],
    summaries: Sequence[Summary],
    manifests: Sequence[Manifest],
    rows: Sequence[Row],
    confidence: float,
) -> str:
    """Render the comparison as an HTML page."""
    runs = [
        {"headline": sentences.headline(each, ("linear", "requirements")), "tone": sentences.tone(each),
         "standing": sentences.standing(each),
         "filter": filter_verdict.verdict(each), "filter_headline": filter_verdict.headline(each),
         "filter_tone": filter_verdict.TONES.get(filter_verdict.verdict(each), "")}
        for each in summaries
    ]  # fmt: skip
    return filled(
        "between.html",
        titles=titles,
        runs=list(zip(titles, summaries, runs, strict=True)),
        filters=any(run["filter"] for run in runs),
        inputs=[(str(key), [shortened(value) for value in values]) for key, values in inputs(manifests).iterrows()],
        rows=[{**cells, "name": humanize(cells["output"])} for cells in outputs(rows, titles).to_dict("records")],
        common=any(row.change is not None and row.change.common for row in rows),
        figure=ratios(rows, titles),
        budgets=_budgets(manifests, summaries),
        confidence=f"{100.0 * confidence:g} %",
    )


def _budgets(manifests: Sequence[Manifest], summaries: Sequence[Summary]) -> list[dict[str, Any]]:
    """List for each output of the first run the linear effect of one sigma of each source and process, run by run."""
    tables = []
    for output in manifests[0].model.outputs:
        scale = conversion(output.unit, output.shown_in)
        rows: dict[str, list[str]] = {}
        for at, (manifest, summary) in enumerate(zip(manifests, summaries, strict=True)):
            names = [each.name for each in manifest.model.outputs]
            if output.name not in names:
                continue
            contributions = summary.budget.contributions[names.index(output.name)]
            labels = [*labels_in(summary), *(humanize(each.name) for each in summary.processes)]
            for label, value in zip(labels, contributions, strict=True):
                rows.setdefault(label, [ABSENT] * len(manifests))[at] = number(value * scale, 4)
        shown = [(label, cells) for label, cells in rows.items() if set(cells) - {"0", ABSENT}]
        tables.append({"name": humanize(output.name), "unit": output.shown_in, "rows": shown})
    return tables
