"""Several runs beside each other, as a page and as tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pandas as pd

from mcnav.analysis.run_comparison import Change
from mcnav.report import sentences
from mcnav.report.figures.figure import HALF, Figure
from mcnav.report.figures.marks import Axis, Interval, Mark, Panel, Points, Rule, Series
from mcnav.report.figures.palette import LINEAR, SOURCE_COLOURS
from mcnav.report.format import number, with_error
from mcnav.report.model import humanize, labels_of
from mcnav.report.page import filled
from mcnav.statistics.estimates import Estimate
from mcnav.units import conversion

ABSENT: Final = "–"
NAN: Final = float("nan")
NOTHING: Final = Change(NAN, NAN, NAN, (NAN, NAN), Estimate(NAN, NAN, 0.0), False)
MARKS: Final = ("dot", "square", "triangle", "ring", "box")
"""Runs are told apart by their marks' shape and colour."""
TONES: Final = {"larger": "undecided", "smaller": "undecided", "no change seen": "agrees"}


@dataclass(frozen=True)
class Row:
    """One output of one later run beside the first run.

    Attributes
    ----------
    run : int
        Which run, from 1.
    output, unit, shown_in : str
    change : Change or None
        None where too few flights came through.
    """

    run: int
    output: str
    unit: str
    shown_in: str
    change: Change | None

    @property
    def words(self) -> str:
        """What came of the comparison."""
        if self.change is None or not np.isfinite(self.change.ratio):
            still = self.change is not None and self.change.before == self.change.after == 0.0
            return sentences.NOT_DISTURBED if still else "nothing to compare"
        if not np.isfinite(self.change.interval[1]):
            return "no interval"
        if not self.change.certain:
            return "no change seen"
        return "larger" if self.change.ratio > 1.0 else "smaller"


def inputs(manifests: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """What goes into the runs and is not the same in all: one row a key of the campaign, one column a run."""
    described = [
        _flat(each["identity"]["campaign"])
        | {"engine": str(each["identity"]["engine"])}
        | {f"version of {name}": text for name, text in each["identity"]["versions"].items()}
        | {f"files.{name}": f"SHA-256 {text}" for name, text in each["identity"].get("files", {}).items()}
        for each in manifests
    ]
    keys = [key for key in dict.fromkeys(key for each in described for key in each) if key != "name"]
    rows = {key: [each.get(key, ABSENT) for each in described] for key in keys}
    return pd.DataFrame.from_dict(
        {key: values for key, values in rows.items() if len(set(values)) > 1}, orient="index",
        columns=range(len(manifests)),
    )  # fmt: skip


def _flat(value: Any, prefix: str = "") -> dict[str, str]:
    """Nested tables as one: ``errors.altitude``.

    >>> _flat({"errors": {"altitude": "5 km"}, "samples": 20})
    {'errors.altitude': '5 km', 'samples': '20'}
    """
    if isinstance(value, Mapping):
        return {key: leaf for name, entry in value.items() for key, leaf in _flat(entry, f"{prefix}{name}.").items()}
    if isinstance(value, list) and any(isinstance(entry, Mapping) for entry in value):
        return {key: leaf for at, entry in enumerate(value) for key, leaf in _flat(entry, f"{prefix}{at + 1}.").items()}
    return {prefix.removesuffix("."): str(value)}


def outputs(rows: Sequence[Row], titles: Sequence[str]) -> pd.DataFrame:
    """What has become of each output, in the units shown: one row an output of a later run."""
    table = []
    for row in rows:
        scale, found = conversion(row.unit, row.shown_in), row.change
        known = found if found is not None else NOTHING
        table.append(
            {
                "output": row.output,
                "unit": row.shown_in,
                "run": titles[row.run],
                "sigma before": known.before * scale,
                "sigma after": known.after * scale,
                "ratio": known.ratio,
                "from": known.interval[0],
                "to": known.interval[1],
                "mean after less before": known.mean.value * scale,
                "standard error": known.mean.standard_error * scale,
                "common draws": known.common,
                "change": row.words,
            }
        )
    return pd.DataFrame(table)


def ratios(rows: Sequence[Row], titles: Sequence[str]) -> Figure | None:
    """Forest plot of the sigma ratios of later runs to the first."""
    known = [row for row in rows if row.change is not None and np.isfinite(row.change.interval).all()]
    if not known:
        return None
    later = sorted({row.run for row in known})
    series = {
        run: Series(f"run-{run}", titles[run], SOURCE_COLOURS[k % len(SOURCE_COLOURS)], MARKS[k % len(MARKS)])
        for k, run in enumerate(later)
    }
    names = list(dict.fromkeys(row.output for row in known))

    marks: list[Mark] = [Rule(0.0, colour=LINEAR, width=1.6)]
    for row in known:
        if row.change is None:
            continue
        step = later.index(row.run) - 0.5 * (len(later) - 1)
        place = names.index(row.output) + 0.7 * step / max(len(later), 2)
        each, (low, high) = series[row.run], (100.0 * (end - 1.0) for end in row.change.interval)
        ratio = 100.0 * (row.change.ratio - 1.0)
        text = f"{humanize(row.output)}, {each.label}: {ratio:+.3g} %, {low:+.3g} to {high:+.3g} %".replace("-", "−")
        marks += [Interval(each, place, low, high, text), Points(each, [ratio], [place], 7.0)]
    rows_axis = Axis(names=[humanize(name) for name in names])

    return Figure(
        name="changes",
        title="Sigma of each output against the first run",
        description="For each output and run the difference of the Monte Carlo sigma from that of the first run, with "
        "its interval.",
        panels=[Panel("", Axis("σ against the first run", "%"), rows_axis, marks)],
        key=tuple(series.values()),
        columns=dict(outputs(known, titles).items()),
        size=(HALF[0], 82.0 + 24.0 * len(names) * (1 + len(later))),
    )


def render(
    titles: Sequence[str],
    summaries: Sequence[Mapping[str, Any]],
    manifests: Sequence[Mapping[str, Any]],
    rows: Sequence[Row],
    confidence: float,
) -> str:
    """The page."""
    return filled(
        "between.html",
        titles=titles,
        runs=[
            {"title": title, "name": summary["campaign"], "samples": f"{summary['samples']:,}",
             "failed": f"{summary['failed']:,}", "headline": sentences.headline(summary),
            "tone": sentences.tone(summary),
             "standing": sentences.standing(summary)}
            for title, summary in zip(titles, summaries, strict=True)
        ],
        inputs=[(str(key), list(values)) for key, values in inputs(manifests).iterrows()],
        rows=[_cells(row, titles) for row in rows],
        common=any(row.change is not None and row.change.common for row in rows),
        figure=ratios(rows, titles),
        budgets=_budgets(manifests, summaries),
        confidence=f"{100.0 * confidence:g} %",
    )  # fmt: skip


def _cells(row: Row, titles: Sequence[str]) -> dict[str, Any]:
    scale, found = conversion(row.unit, row.shown_in), row.change
    told = {
        "output": humanize(row.output), "unit": row.shown_in, "run": titles[row.run], "words": row.words,
        "tone": TONES.get(row.words, ""),
    }  # fmt: skip
    if found is None:
        return told | dict.fromkeys(("before", "after", "ratio", "interval", "mean", "common"), ABSENT)
    sure = np.isfinite(found.interval).all()
    return told | {
        "before": number(found.before * scale, 5),
        "after": number(found.after * scale, 5),
        "ratio": number(found.ratio, 5),
        "interval": f"{number(found.interval[0], 5)} to {number(found.interval[1], 5)}" if sure else ABSENT,
        "mean": with_error(found.mean.value * scale, found.mean.standard_error * scale),
        "common": "common" if found.common else "separate",
    }


def _budgets(manifests: Sequence[Mapping[str, Any]], summaries: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """For each output of the first run what one sigma of each source does to it, run by run."""
    tables = []
    for entry in manifests[0]["model"]["outputs"]:
        scale = conversion(entry["unit"], entry["shown_in"])
        rows: dict[str, list[str]] = {}
        for at, (manifest, summary) in enumerate(zip(manifests, summaries, strict=True)):
            names = [each["name"] for each in manifest["model"]["outputs"]]
            if entry["name"] not in names:
                continue
            contributions = summary["budget"]["contributions"][names.index(entry["name"])]
            for label, value in zip(labels_of(manifest["model"]), contributions, strict=True):
                rows.setdefault(label, [ABSENT] * len(manifests))[at] = number(value * scale, 4)
        shown = [(label, cells) for label, cells in rows.items() if set(cells) - {"0", ABSENT}]
        tables.append({"name": humanize(entry["name"]), "unit": entry["shown_in"], "rows": shown})
    return tables
