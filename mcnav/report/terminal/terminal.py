"""Results as tables and sentences for the terminal."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from mcnav.analysis.checked_starts import simulated_rms
from mcnav.analysis.summary import Summary
from mcnav.analysis.verdict import combine_verdicts
from mcnav.arrays.types import Array
from mcnav.contract.quantities import Output, Source, end_words
from mcnav.report.columns.output_columns import outputs_of_runs
from mcnav.report.columns.requirements import requirements_table
from mcnav.report.document.fitted_table import FittedTable, numbers, texts
from mcnav.report.document.terminal_parts import COLOURS, fitted
from mcnav.report.exports.export import partial_rows
from mcnav.report.names import humanize, labels_of, scale_of
from mcnav.report.statements import fields, start_times, verdicts

if TYPE_CHECKING:
    from mcnav.analysis.comparison import Comparison
    from mcnav.linear.start_times import StartTimeStudy


ELSEWHERE = "report.html or --format csv"
"""Note on a narrow terminal's missing columns."""


def verdict(summary: Summary) -> RenderableType:
    """State the verdicts on linear analysis, requirements and filter in sentences, the worst first."""
    lines = []
    for statement in verdicts.statements(summary):
        words = " ".join(filter(None, (statement.sentence, statement.next_step)))
        lines.append(Text(words, style=f"bold {COLOURS[statement.tone]}"))
        lines += [Text(sentence) for sentence in (*statement.details, *statement.warnings)]
    return Group(*lines)


def comparison(runs: Mapping[str, Summary]) -> RenderableType:
    """Tabulate linear and Monte Carlo sigmas of runs by name, one line per output and run."""
    several, first = len(runs) > 1, next(iter(runs.values()))
    title = f"{first.campaign}: {first.samples:,} samples, {first.engine} engine"
    return fitted(outputs_of_runs(runs, f"{len(runs)} runs" if several else title, ELSEWHERE))


def _shown(value: float | None, form: str) -> str:
    return "–" if value is None or not math.isfinite(value) else format(value, form)


def warnings(runs: Mapping[str, Summary]) -> RenderableType | None:
    """Warn of runs without a valid linear model; none where all have one."""
    result = [(name, summary.unsettled) for name, summary in runs.items()]
    lines = [Text(f"{name}: {fields.unsettled(reason)}", style="bold red") for name, reason in result if reason]
    return Group(*lines) if lines else None


def requirements(summary: Summary) -> RenderableType:
    """Tabulate the requirements and their findings."""
    return fitted(requirements_table(summary).read)


def partials(sources: Sequence[Source], outputs: Sequence[Output], matrix: Array) -> RenderableType:
    """Tabulate P in the units shown, one line per source."""
    columns = [*texts("per unit of"), *numbers(*map(_label, outputs))]
    table = FittedTable(f"Partial derivatives of the {end_words(outputs).many}", columns)
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


def best_starts(
    study: StartTimeStudy, checked: Mapping[float, Comparison], own_rms: Array, outputs: Sequence[Output]
) -> RenderableType:
    """State the best start, and tabulate it for each output and for all outputs weighted.

    ``checked`` are Monte Carlo results by start time, s; ``own_rms`` are the linear root mean squares for the
    campaign's own start, SI, shape (outputs,).
    """
    what = "rms" if study.means_matter else "σ"
    columns = [*texts("best for"), *numbers("start", f"best {what}", f"campaign's {what}")]
    columns += [*numbers("Monte Carlo"), *texts("verdict")] if checked else []
    sizes = "root mean squares" if study.means_matter else "1σ"
    title = (
        f"Best start of navigation by linear analysis ({study.clock.label}), and {sizes} of the "
        f"{end_words(outputs).many}"
    )
    table = FittedTable(title, columns)
    scale = scale_of(outputs)
    rows = [(_label(output), int(study.best[i]), np.eye(len(outputs))[i] * scale) for i, output in enumerate(outputs)]
    for label, place, weights in [*rows, ("all, weighted", study.best_weighted, study.weights)]:

        def size(sigma: Array, weights: Array = weights) -> str:
            return f"{float(np.sqrt(((sigma * weights) ** 2).sum())):.5g}"

        time = float(study.times[place])
        cells = [f"{time / 60.0:.1f}", size(study.rms[place]), size(own_rms)]
        result = next((check for when, check in checked.items() if np.isclose(when, time, rtol=0.0, atol=1e-6)), None)
        if result is not None and result.outputs:
            verdicts = [
                output.paired.verdict for output, weight in zip(result.outputs, weights, strict=True) if weight > 0
            ]
            cells += [size(simulated_rms(study, time, result)), combine_verdicts(verdicts).value]
        elif checked:
            cells += ["–", "not checked"]
        table.add(*(Text(cell, style=COLOURS.get(cell, "")) for cell in (label, *cells)))
    return Group(Text(start_times.answer(study, checked, outputs), style="bold"), "", table)


def checks(title: str, result: Sequence[tuple[str, bool, str]]) -> RenderableType:
    """Tabulate checks: name, whether it passed, and the finding."""
    table = FittedTable(title, texts("check", "result", "finding"), keys=2)
    for name, passed, finding in result:
        table.add(name, Text("passed" if passed else "failed", style="green" if passed else "red"), finding)
    return table
