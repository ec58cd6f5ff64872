"""Results as tables and sentences for the terminal."""

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
from mcnav.contract.quantities import Output, Source
from mcnav.errors import shortened
from mcnav.lincov.start_times import StartTimeStudy
from mcnav.report import filter_verdict, linearity_words, sentences, start_time_words
from mcnav.report.export import output_rows, partial_rows
from mcnav.report.fitted_table import FittedTable, numbers, texts
from mcnav.report.format import interval
from mcnav.report.model import humanize, labels_of, scale_of
from mcnav.report.requirements import TONES, listed, requirement_rows

if TYPE_CHECKING:
    import pandas as pd


COLOURS = {"agrees": "green", "partly": "yellow", "undecided": "yellow", "differs": "red"}
"""By verdict (`mcnav.report.sentences.tone`)."""

ELSEWHERE = "report.html or --format csv"
"""Where a narrow terminal's missing columns are."""


def verdict(summary: Mapping[str, Any]) -> RenderableType:
    """State the verdict in sentences, that on a filter as well; what is not good comes first."""
    lines = [Text(sentences.headline(summary), style=f"bold {COLOURS[sentences.standing(summary)]}")]
    remarks = (sentences.certain_but_small, sentences.stopping, sentences.caveat, sentences.failures)
    result = [*sentences.findings(summary), *(remark(summary) for remark in remarks)]
    lines += [Text(sentence) for sentence in result if sentence]
    of_filter = filter_lines(summary)
    if filter_verdict.comes_first(summary, sentences.standing(summary)):
        return Group(*of_filter, *lines)
    return Group(*lines, *of_filter)


def filter_lines(summary: Mapping[str, Any]) -> list[Text]:
    """List the sentences on a filter; none without a filter."""
    lines = filter_verdict.verdict(summary)
    if not lines:
        return []
    stated = Text(filter_verdict.headline(summary), style=f"bold {COLOURS[filter_verdict.TONES[lines]]}")
    return [stated, *(Text(sentence) for sentence in [filter_verdict.explanation(summary)] if sentence)]


def comparison(runs: Mapping[str, Mapping[str, Any]]) -> RenderableType:
    """Tabulate linear and Monte Carlo sigmas of runs by name, one line per output and run."""
    several, first = len(runs) > 1, next(iter(runs.values()))
    title = f"{first['campaign']}: {first['samples']:,} samples, {first['engine']} engine"
    columns = [
        *texts("final error, 1σ", *(["run"] if several else [])),
        *numbers("linear σ", "paired σ", "paired ratio", "paired interval"),
        *texts("verdict"),
        *numbers("plain σ", "plain ratio", "plain interval", spare=True),
    ]
    title, keys = (f"{len(runs)} runs", 2) if several else (title, 1)
    table = FittedTable(title, columns, keys, ELSEWHERE)
    for row in output_rows(runs):
        sigmas = []
        for kind in ("paired", "plain"):
            ends = interval(row[f"ratio_{kind}_from"], row[f"ratio_{kind}_to"])
            sigmas.append((_shown(row[f"sigma_{kind}"], ".5g"), _shown(row[f"ratio_{kind}"], ".4f"), ends))
        label = f"{humanize(row['output'])} [{row['unit']}]"
        text = Text(row["verdict"] or "–", style=COLOURS.get(row["verdict"], ""))
        run = [row["run"]] if several else []
        table.add(label, *run, _shown(row["sigma_linear"], ".5g"), *sigmas[0], text, *sigmas[1])
    return table


def _shown(value: float | None, form: str) -> str:
    return "–" if value is None or not math.isfinite(value) else format(value, form)


def warnings(runs: Mapping[str, Mapping[str, Any]]) -> RenderableType | None:
    """Warn of runs without a valid linear model; none where all have one."""
    result = [(name, sentences.unsettled(summary)) for name, summary in runs.items()]
    lines = [Text(f"{name}: {words}", style="bold red") for name, words in result if words]
    return Group(*lines) if lines else None


def inputs(result: pd.DataFrame) -> RenderableType:
    """Tabulate the inputs that differ between runs, one line per key."""
    table = FittedTable("Changed inputs", texts("key", *result.columns))
    for key, values in result.iterrows():
        table.add(str(key), *(shortened(value) for value in values))
    return table if table.rows else Text("The runs have the same campaign, engine and versions.")


def changes(first: str, result: pd.DataFrame) -> RenderableType:
    """Tabulate the change of each output from the first run; see `mcnav.report.comparison.outputs`."""
    columns = [
        *texts("final error, 1σ", "run"), *numbers("paired σ before", "after", "ratio", "interval"),
        *texts("random numbers", "change"),
    ]  # fmt: skip
    table = FittedTable(f"Change from {first}", columns, keys=2)
    for row in result.to_dict("records"):
        table.add(
            f"{humanize(row['output'])} [{row['unit']}]", row["run"], _shown(row["sigma before"], ".5g"),
            _shown(row["sigma after"], ".5g"), _shown(row["ratio"], ".4f"), interval(row["from"], row["to"]),
            "common" if row["common draws"] else "separate", row["change"],
        )  # fmt: skip
    return table


def requirements(summary: Mapping[str, Any]) -> RenderableType:
    """Tabulate the requirements and their findings."""
    rows = requirement_rows(summary)
    explained = any(row["causes"] for row in rows)
    columns = texts(
        "finding", "requirement", "to decide", *(["largest linear causes of these errors"] if explained else [])
    )
    table = FittedTable("Requirements", columns, keys=2)
    for row in rows:
        needed, colour = row["samples_needed"], COLOURS[TONES[row["finding"]]]
        decides = [sentences.more_samples(needed, summary["samples"])] if needed else []
        words = "; ".join([*decides, *([row["remark"]] if row["remark"] else [])])
        causes = [listed(row["causes"])] if explained else []
        table.add(Text(row["finding"], style=colour), row["requirement"], words, *causes)
    return table


def partials(sources: Sequence[Source], outputs: Sequence[Output], matrix: Array) -> RenderableType:
    """Tabulate P in the units shown, one line per source."""
    columns = [*texts("per unit of"), *numbers(*map(_label, outputs))]
    table = FittedTable("Partial derivatives of the final errors", columns)
    values = iter(partial_rows(sources, outputs, matrix))
    labels = labels_of(sources, outputs)
    for label, source in zip(labels, sources, strict=True):
        table.add(f"{label} [{source.shown_in}]", *(f"{next(values)['partial'] + 0.0:.7g}" for _ in outputs))
    return table


def _label(output: Output) -> str:
    return f"{humanize(output.name)} [{output.shown_in}]"


def agreement(outputs: Sequence[Output], differences: Mapping[str, Array]) -> RenderableType:
    """Tabulate the differences of other methods from the partials, relative to each row's largest contribution."""
    title = "Largest difference, as a share of the output's largest one-sigma contribution"
    table = FittedTable(title, [*texts("method"), *numbers(*(humanize(output.name) for output in outputs))])
    for method, shares in differences.items():
        table.add(method, *(_shown(float(share), ".1e") for share in shares))
    return table


def linearity(outputs: Sequence[Output], dispersion_range: DispersionRange, tolerance: float) -> RenderableType:
    """State by what factor errors may grow, and tabulate the multiples at which sigmas leave the tolerance."""
    title = f"Multiple of the stated errors at which a sigma differs from the linear one by {100 * tolerance:g} %"
    headings = ("agrees up to", "exceeds tolerance at", "differs from")
    table = FittedTable(title, [*texts("1σ of"), *numbers(*headings)])
    names = [humanize(output.name) for output in outputs]
    for name, words in linearity_words.linearity_rows(names, dispersion_range):
        table.add(name, *words)
    return Group(Text(linearity_words.answer(names, dispersion_range, tolerance), style="bold"), "", table)


def best_starts(
    study: StartTimeStudy, checked: Mapping[float, Comparison], own_sigma: Array, outputs: Sequence[Output]
) -> RenderableType:
    """State the best start, and tabulate it for each output and for all outputs weighted.

    ``checked`` are Monte Carlo results by start time, s; ``own_sigma`` is the linear dispersion for the campaign's own
    start, SI, shape (outputs,).
    """
    columns = [*texts("best for"), *numbers("start", "best σ", "campaign's σ")]
    columns += [*numbers("Monte Carlo"), *texts("verdict")] if checked else []
    title = f"Best start of navigation by linear analysis ({study.clock.label}), and 1σ of the final errors"
    table = FittedTable(title, columns)
    scale = scale_of(outputs)
    rows = [(_label(output), int(study.best[i]), np.eye(len(outputs))[i] * scale) for i, output in enumerate(outputs)]
    for label, place, weights in [*rows, ("all, weighted", study.best_weighted, study.weights)]:

        def size(sigma: Array, weights: Array = weights) -> str:
            return f"{float(np.sqrt(((sigma * weights) ** 2).sum())):.5g}"

        time = float(study.times[place])
        cells = [f"{time / 60.0:.1f}", size(study.sigma[place]), size(own_sigma)]
        result = next((each for when, each in checked.items() if np.isclose(when, time, rtol=0.0, atol=1e-6)), None)
        if result is not None and result.outputs:
            verdicts = [each.paired.verdict for each, weight in zip(result.outputs, weights, strict=True) if weight > 0]
            cells += [size(np.array([each.sigma_paired for each in result.outputs])), combine_verdicts(verdicts).value]
        elif checked:
            cells += ["–", "not checked"]
        table.add(*(Text(cell, style=COLOURS.get(cell, "")) for cell in (label, *cells)))
    return Group(Text(start_time_words.answer(study, checked, outputs), style="bold"), "", table)


def checks(result: Sequence[tuple[str, bool, str]]) -> RenderableType:
    """Tabulate the checks of a scenario: name, whether it passed, and the finding."""
    table = FittedTable("Checks of the scenario", texts("check", "result", "finding"), keys=2)
    for name, passed, finding in result:
        table.add(name, Text("passed" if passed else "failed", style="green" if passed else "red"), finding)
    return table
