"""Results in the terminal, from summaries."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from mcnav._types import Array
from mcnav.analysis.comparison import Comparison
from mcnav.analysis.linearity import DispersionRange
from mcnav.analysis.verdict import combine_verdicts
from mcnav.lincov.start_times import StartTimeStudy
from mcnav.report import sentences
from mcnav.report.export import output_rows, partial_rows
from mcnav.report.fitted_table import Column, FittedTable
from mcnav.report.model import humanize
from mcnav.report.requirements import TONES, shown_units, stated
from mcnav.scenarios.protocol import Output, Source, source_labels
from mcnav.units import conversion

if TYPE_CHECKING:
    import pandas as pd


COLOURS = {"agrees": "green", "partly": "yellow", "undecided": "yellow", "differs": "red"}
"""By tone of a verdict (`mcnav.report.sentences.tone`)."""

ELSEWHERE = "report.html or --format csv"
"""Where columns are that a narrow terminal has no room for."""


def verdict(summary: Mapping[str, Any]) -> RenderableType:
    """The verdict in sentences."""
    lines = [Text(sentences.headline(summary), style=f"bold {COLOURS[sentences.standing(summary)]}")]
    remarks = (
        sentences.joint_explanation,
        sentences.certain_but_small,
        sentences.stopping,
        sentences.caveat,
        sentences.failures,
    )
    lines += [Text(sentence) for sentence in (say(summary) for say in (sentences.explanation, *remarks)) if sentence]
    return Group(*lines)


def comparison(runs: Mapping[str, Mapping[str, Any]]) -> RenderableType:
    """Linear beside Monte Carlo, an output a line; with several runs, by name, each output has a line for every run."""
    several = len(runs) > 1
    first = next(iter(runs.values()))
    about = f"{len(runs)} runs" if several else f"{first['samples']:,} samples, {first['engine']} engine"
    columns = [
        Column("final error, 1σ", text=True),
        *([Column("run", text=True)] if several else []),
        Column("linear σ"),
        Column("paired σ"),
        Column("paired ratio"),
        Column("paired interval"),
        Column("verdict", text=True),
        Column("plain σ", spare=1),
        Column("plain ratio", spare=2),
        Column("plain interval", spare=3),
    ]
    table = FittedTable(
        about if several else f"{first['campaign']}: {about}", columns, keys=2 if several else 1, elsewhere=ELSEWHERE
    )
    for row in output_rows(runs):
        label = f"{humanize(row['output'])} [{row['unit']}]"
        table.add(label, *([row["run"]] if several else []), *_output_cells(row))
    return table


def _output_cells(row: Mapping[str, Any]) -> list[Text]:
    found = row["verdict"]
    return [
        Text(_shown(row["sigma_linear"], ".5g")),
        Text(_shown(row["sigma_paired"], ".5g")),
        Text(_shown(row["ratio_paired"], ".4f")),
        Text(interval(row["ratio_paired_from"], row["ratio_paired_to"])),
        Text(found or "–", style=COLOURS.get(found, "")),
        Text(_shown(row["sigma_plain"], ".5g")),
        Text(_shown(row["ratio_plain"], ".4f")),
        Text(interval(row["ratio_plain_from"], row["ratio_plain_to"])),
    ]


def _shown(value: float | None, form: str) -> str:
    return "–" if value is None or not math.isfinite(value) else format(value, form)


def interval(low: float | None, high: float | None) -> str:
    """An interval of a ratio; a dash for one that is not known.

    >>> interval(0.99, 1.01), interval(None, None)
    ('0.9900 to 1.0100', '–')
    """
    known = low is not None and high is not None and math.isfinite(low) and math.isfinite(high)
    return f"{low:.4f} to {high:.4f}" if known else "–"


def warnings(runs: Mapping[str, Mapping[str, Any]]) -> RenderableType | None:
    """What must be known before anything is read: runs without a sound linear model; none where all have one."""
    told = [(name, sentences.unsettled(summary)) for name, summary in runs.items()]
    lines = [Text(f"{name}: {words}", style="bold red") for name, words in told if words]
    return Group(*lines) if lines else None


def inputs(found: pd.DataFrame) -> RenderableType:
    """What the runs' campaigns do not have in common, a key a line; one column a run."""
    table = FittedTable("What was changed", [Column(str(name), text=True) for name in ("key", *found.columns)])
    for key, values in found.iterrows():
        table.add(str(key), *(str(value) for value in values))
    return table if table.rows else Text("The runs have the same campaign, engine and versions.")


def changes(first: str, found: pd.DataFrame) -> RenderableType:
    """What has become of each output of the first run in the others, a line each."""
    columns = [Column(name, text=True) for name in ("final error, 1σ", "run")]
    columns += [Column(name) for name in ("paired σ before", "after", "ratio", "interval")]
    columns += [Column(name, text=True) for name in ("draws", "found")]
    table = FittedTable(f"What has become of it, against {first}", columns, keys=2)
    for row in found.itertuples(index=False):
        sigmas = (_shown(row[3], ".5g"), _shown(row[4], ".5g"), _shown(row[5], ".4f"))
        draws = "common" if row[10] else "separate"
        table.add(f"{humanize(row[0])} [{row[1]}]", row[2], *sigmas, interval(row[6], row[7]), draws, row[11])
    return table


def requirements(summary: Mapping[str, Any]) -> RenderableType:
    """Each requirement, a line, with what was found."""
    units = shown_units(summary)
    headings = ("found", "requirement", "what would decide")
    table = FittedTable("Requirements", [Column(name, text=True) for name in headings], keys=2)
    for entry in summary["requirements"]:
        needed = entry["samples_needed"]
        decides = sentences.more_samples(needed, summary["samples"]) if needed else entry["remark"]
        table.add(Text(entry["finding"], style=COLOURS[TONES[entry["finding"]]]), stated(entry, units), decides)
    return table


def partials(sources: Sequence[Source], outputs: Sequence[Output], matrix: Array) -> RenderableType:
    """P, a source a line, in the units shown."""
    columns = [Column(f"{humanize(output.name)} [{output.shown_in}]") for output in outputs]
    table = FittedTable("Partial derivatives of the final errors", [Column("per unit of", text=True), *columns])
    values = iter(partial_rows(sources, outputs, matrix))
    labels = source_labels([source.name for source in sources], [output.name for output in outputs])
    for label, source in zip(labels, sources, strict=True):
        table.add(f"{label} [{source.shown_in}]", *(f"{next(values)['partial'] + 0.0:.7g}" for _ in outputs))
    return table


def agreement(outputs: Sequence[Output], differences: Mapping[str, Array]) -> RenderableType:
    """How far other methods are from the partials shown, as shares of each row's largest contribution."""
    table = FittedTable(
        "Largest difference from them, as a share of the row's largest one-sigma contribution",
        [Column("method", text=True), *(Column(humanize(output.name)) for output in outputs)],
    )
    for method, shares in differences.items():
        table.add(method, *(_shown(float(share), ".1e") for share in shares))
    return table


def linearity(outputs: Sequence[Output], found: DispersionRange, tolerance: float) -> RenderableType:
    """Multiples of the stated errors at which dispersions leave the linear ones."""
    table = FittedTable(
        f"Multiple of the stated errors at which a sigma leaves the linear one by {100 * tolerance:g} %",
        [Column("1σ of", text=True), *(Column(name) for name in ("agrees up to", "leaves at", "differs from"))],
    )
    reached = float(found.multiples[-1])
    for k, name in enumerate([*(humanize(output.name) for output in outputs), sentences.JOINT]):
        values = (found.agrees_until[k], found.departs[k], found.differs_from[k])
        table.add(name, *(sentences.multiple_words(float(value), reached) for value in values))
    return table


def best_starts(
    study: StartTimeStudy, checked: Mapping[float, Comparison], own_sigma: Array, outputs: Sequence[Output]
) -> RenderableType:
    """The best start for each output, and for all of them weighted, a line each.

    Parameters
    ----------
    study : StartTimeStudy
    checked : mapping of float to Comparison
        Monte Carlo by start time, s.
    own_sigma : ndarray, shape (outputs,)
        Linear dispersion for the campaign's own start, SI.
    outputs : sequence of Output
    """
    table = FittedTable(
        "Best start of navigation (min from reentry, up to it) by linear analysis, and 1σ of the final errors",
        [
            Column("best for", text=True),
            *(
                Column(heading)
                for heading in ("start", "σ there", "σ, own start", *(["Monte Carlo"] if checked else []))
            ),
            *([Column("verdict", text=True)] if checked else []),
        ],
    )
    scale = np.array([conversion(output.unit, output.shown_in) for output in outputs])
    labels = [f"{humanize(output.name)} [{output.shown_in}]" for output in outputs]
    rows = [(label, int(study.best[i]), np.eye(len(outputs))[i] * scale[i]) for i, label in enumerate(labels)]
    rows.append(("all, weighted", study.best_weighted, study.weights))
    for label, place, weights in rows:

        def size(sigma: Array, weights: Array = weights) -> str:
            return f"{float(np.sqrt(((sigma * weights) ** 2).sum())):.5g}"

        time = float(study.times[place])
        cells = [f"{time / 60.0:.1f}", size(study.sigma[place]), size(own_sigma)]
        found = next((each for when, each in checked.items() if np.isclose(when, time, rtol=0.0, atol=1e-6)), None)
        if found is not None and found.outputs:
            which = [output for output, weight in zip(found.outputs, weights, strict=True) if weight > 0.0]
            verdict_there = combine_verdicts([output.paired.verdict for output in which])
            cells += [size(np.array([output.sigma_paired for output in found.outputs])), verdict_there.value]
        elif checked:
            cells += ["–", "not checked"]
        table.add(*(Text(cell, style=COLOURS.get(cell, "")) for cell in (label, *cells)))
    return table


def checks(found: Sequence[tuple[str, bool, str]]) -> RenderableType:
    """Names, whether each is kept, and what was found."""
    table = FittedTable(
        "What a scenario must keep", [Column(name, text=True) for name in ("check", "", "found")], keys=2
    )
    for name, passed, told in found:
        table.add(name, Text("kept" if passed else "not kept", style="green" if passed else "red"), told)
    return table
