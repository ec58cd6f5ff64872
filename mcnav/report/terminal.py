"""Results in the terminal, from summaries."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from mcnav.report import wording
from mcnav.report.content import spoken
from mcnav.scenarios.protocol import Output, Source
from mcnav.units import conversion

Array = NDArray[np.float64]

COLOURS = {"agrees": "green", "partly": "yellow", "undecided": "yellow", "differs": "red"}
"""By tone of a verdict (`mcnav.report.wording.tone`)."""

SHOWN_IN = {"m": "km"}
"""Units for the terminal where the SI unit is not the customary one."""


def _table(title: str) -> Table:
    return Table(
        title=Text(title), title_justify="left", title_style="bold", header_style="bold", box=None, pad_edge=False
    )


def verdict(summary: Mapping[str, Any]) -> RenderableType:
    """The verdict in sentences."""
    lines = [Text(wording.headline(summary), style=f"bold {COLOURS[wording.tone(summary)]}")]
    remarks = (wording.joint_explanation, wording.certain_but_small, wording.caveat, wording.failures)
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
    names = dict.fromkeys((entry["name"], entry["unit"]) for run in runs.values() for entry in run["outputs"])
    for name, unit in names:
        shown = SHOWN_IN.get(unit, unit)
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
