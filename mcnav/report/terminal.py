"""Results in the terminal, from summaries."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from mcnav.analysis.linearity import DispersionRange
from mcnav.report import wording
from mcnav.report.content import spoken
from mcnav.report.requirements import TONES, shown_units, stated
from mcnav.scenarios.protocol import Output, Source
from mcnav.units import conversion

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

COLOURS = {"agrees": "green", "partly": "yellow", "undecided": "yellow", "differs": "red"}
"""By tone of a verdict (`mcnav.report.wording.tone`)."""


def _table(title: str) -> Table:
    return Table(
        title=Text(title), title_justify="left", title_style="bold", header_style="bold", box=None, pad_edge=False
    )


def verdict(summary: Mapping[str, Any]) -> RenderableType:
    """The verdict in sentences."""
    lines = [Text(wording.headline(summary), style=f"bold {COLOURS[wording.tone(summary)]}")]
    remarks = (wording.joint_explanation, wording.certain_but_small, wording.stopping, wording.caveat, wording.failures)
    lines += [Text(sentence) for sentence in (say(summary) for say in (wording.explanation, *remarks)) if sentence]
    return Group(*lines)


def comparison(runs: Mapping[str, Mapping[str, Any]]) -> RenderableType:
    """Linear beside Monte Carlo, an output a line; with several runs, by name, each output has a line for every run."""
    several = len(runs) > 1
    first = next(iter(runs.values()))
    about = f"{len(runs)} runs" if several else f"{first['samples']:,} samples, {first['engine']} engine"
    table = _table(about if several else f"{first['campaign']}: {about}")
    table.add_column("final error, 1σ", no_wrap=True)
    if several:
        table.add_column("run", overflow="fold")
    for heading in ("linear", "Monte Carlo", "paired ratio", "interval"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    units = {
        (entry["name"], entry["unit"]): shown_units(run)[entry["name"]][1]
        for run in [*runs.values()][::-1]
        for entry in run["outputs"]
    }
    names = dict.fromkeys((entry["name"], entry["unit"]) for run in runs.values() for entry in run["outputs"])
    for name, unit in names:
        shown = units[name, unit]
        label = f"{spoken(name)} [{shown}]"
        for title, run in runs.items():
            at = [(entry["name"], entry["unit"]) for entry in run["outputs"]]
            if (name, unit) in at:
                cells = _output_cells(run, at.index((name, unit)), conversion(unit, shown))
                table.add_row(Text(label), *([Text(title)] if several else []), *cells)
                label = ""
    return table


def _output_cells(summary: Mapping[str, Any], i: int, scale: float) -> list[Text]:
    linear = f"{summary['sigma_linear'][i] * scale:.5g}"
    if not summary["verdicts"]:
        return [Text(linear), *(Text("–") for _ in range(4))]
    ratio, interval = summary["sigma_ratio_paired"][i], summary["sigma_ratio_paired_interval"][i]
    found = summary["verdicts"][i]
    known = interval is not None and None not in interval
    return [
        Text(linear),
        Text(f"{summary['sigma_sample'][i] * scale:.5g}"),
        Text("–" if ratio is None else f"{ratio:.4f}"),
        Text(f"{interval[0]:.4f}…{interval[1]:.4f}" if known else "–"),
        Text(found, style=COLOURS[found]),
    ]


def warnings(runs: Mapping[str, Mapping[str, Any]]) -> RenderableType | None:
    """What must be known before anything is read: runs without a sound linear model; none where all have one."""
    told = [(name, wording.unsettled(summary)) for name, summary in runs.items()]
    lines = [Text(f"{name}: {words}", style="bold red") for name, words in told if words]
    return Group(*lines) if lines else None


def inputs(found: pd.DataFrame) -> RenderableType:
    """What the runs' campaigns do not have in common, a key a line; one column a run."""
    table = _table("What was changed")
    table.add_column("key", overflow="fold")
    for title in found.columns:
        table.add_column(Text(title), overflow="fold")
    for key, values in found.iterrows():
        table.add_row(Text(str(key)), *(Text(str(value)) for value in values))
    return table if table.row_count else Text("The runs have the same campaign, engine and versions.")


def changes(first: str, found: pd.DataFrame) -> RenderableType:
    """What has become of each output of the first run in the others, a line each."""
    table = _table(f"What has become of it, against {first}")
    for heading in ("final error, 1σ", "run"):
        table.add_column(heading, overflow="fold")
    for heading in ("before", "after", "ratio", "interval"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("draws")
    table.add_column("found")
    for row in found.itertuples(index=False):
        cells = (f"{row[3]:.5g}", f"{row[4]:.5g}", f"{row[5]:.4f}", f"{row[6]:.4f}…{row[7]:.4f}")
        draws = "common" if row[10] else "separate"
        table.add_row(
            Text(f"{spoken(row[0])} [{row[1]}]"), Text(row[2]), *(Text(cell) for cell in cells), draws, Text(row[11])
        )
    return table


def requirements(summary: Mapping[str, Any]) -> RenderableType:
    """Each requirement, a line, with what was found."""
    units = shown_units(summary)
    table = _table("Requirements")
    for heading in ("found", "requirement", "what would decide"):
        table.add_column(heading, overflow="fold")
    for entry in summary["requirements"]:
        needed = f"about {entry['samples_needed']:,} samples" if entry["samples_needed"] else entry["remark"]
        table.add_row(
            Text(entry["finding"], style=COLOURS[TONES[entry["finding"]]]), Text(stated(entry, units)), Text(needed)
        )
    return table


def partials(sources: Sequence[Source], outputs: Sequence[Output], matrix: Array) -> RenderableType:
    """P, a source a line, in the units shown."""
    table = _table("Partial derivatives of the final errors")
    table.add_column("per unit of")
    for output in outputs:
        table.add_column(Text(f"{spoken(output.name)} [{output.shown_in}]"), justify="right")
    for j, source in enumerate(sources):
        per = conversion(source.shown_in, source.unit)
        values = [
            f"{matrix[i, j] * per * conversion(output.unit, output.shown_in):.7g}" for i, output in enumerate(outputs)
        ]
        table.add_row(Text(f"{spoken(source.name)} [{source.shown_in}]"), *values)
    return table


def agreement(outputs: Sequence[Output], differences: Mapping[str, Array]) -> RenderableType:
    """How far other methods are from the partials shown, as shares of each row's largest contribution."""
    table = _table("Largest difference from them, as a share of the row's largest one-sigma contribution")
    table.add_column("method")
    for output in outputs:
        table.add_column(spoken(output.name), justify="right")
    for method, shares in differences.items():
        table.add_row(method, *(f"{share:.1e}" for share in shares))
    return table


def linearity(outputs: Sequence[Output], found: DispersionRange, tolerance: float) -> RenderableType:
    """Multiples of the stated errors at which dispersions leave the linear ones."""
    table = _table(f"Multiple of the stated errors at which a sigma leaves the linear one by {100 * tolerance:g} %")
    table.add_column("1σ of")
    for heading in ("agrees up to", "leaves at", "differs from"):
        table.add_column(heading, justify="right")
    reached = float(found.multiples[-1])
    for k, name in enumerate([*(spoken(output.name) for output in outputs), wording.JOINT]):
        values = (found.agrees_until[k], found.departs[k], found.differs_from[k])
        table.add_row(Text(name), *(wording.multiple_words(float(value), reached) for value in values))
    return table


def checks(found: Sequence[tuple[str, bool, str]]) -> RenderableType:
    """Names, whether each is kept, and what was found."""
    table = _table("What a scenario must keep")
    for heading in ("check", "", "found"):
        table.add_column(heading, overflow="fold")
    for name, passed, told in found:
        table.add_row(
            Text(name), Text("kept" if passed else "not kept", style="green" if passed else "red"), Text(told)
        )
    return table
