"""The panel of a run's figures that shows its worst case: what the foremost tile is about."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from mcnav.analysis.summary import FilterSummary
from mcnav.report.document.parts import Tile
from mcnav.report.drawing.figure import Figure
from mcnav.report.drawing.marks import of_requirement
from mcnav.report.figures.requirements import landing, with_limit
from mcnav.report.figures.sigma_ratios import sigma_ratios_over_time
from mcnav.report.results.model import RunAnalysis
from mcnav.report.statements.fields import worst_departure
from mcnav.report.statements.means import large_means_of
from mcnav.report.statements.requirements import worst_requirement

Wanted = tuple[str, Sequence[str]]
"""Name of a figure, and what its panel has to be about; anything where that is empty."""


def worst_case(content: RunAnalysis, drawn: Mapping[str, Figure], tile: Tile) -> Figure | None:
    """Return the figure of a tile's subject with the one panel that shows the worst; none where no panel does.

    Parameters
    ----------
    drawn : mapping of str to Figure
        Figures of the report by name.
    tile : Tile
        Its number stands below a figure of several panels, whose own words are on all of them.
    """
    subject = tile.subject
    if subject == "Smoother":
        of_smoother = sigma_ratios_over_time(replace(content, filter=content.smoother))
        drawn = {} if of_smoother is None else {
            "sigma_history": replace(of_smoother, title="True sigma over the smoother's sigma")}  # fmt: skip
    row = worst_requirement(content.summary, content.time_unit) if subject == "Requirements" else None
    if row is not None and (limited := landing(content, row)) is not None:
        drawn = {**drawn, "scatter": limited}
    for name, about in _wanted(content, subject):
        figure = drawn.get(name)
        panels = [] if figure is None else [panel for panel in figure.panels if set(about) <= set(panel.about)]
        if figure is not None and panels:
            shows = figure.shows if len(figure.panels) == 1 else f"{tile.value} {tile.of}.".lstrip()
            shown = replace(figure, panels=panels[:1], shown=0, shows=shows)
            at_end = row is not None and about and name in ("histograms", "scatter")
            return with_limit(shown, row) if row is not None and at_end else shown
    return None


def _wanted(content: RunAnalysis, subject: str) -> Iterator[Wanted]:
    """Yield what would show the worst case, the best first."""
    summary = content.summary
    match subject:
        case "Mean errors":
            largest = [summary.names[large.output] for large in large_means_of(summary)[:1]]
            yield "envelopes", largest
            yield "histograms", largest
        case "Requirements":
            row = worst_requirement(summary, content.time_unit)
            if row is not None and row.entry.outputs and row.entry.kind != "sigma_ratio":
                yield "requirements_over_time", [of_requirement(row.number)]
                yield "tails", [of_requirement(row.number)]
                if len(row.entry.outputs) > 1:
                    yield "scatter", row.entry.outputs
                yield "histograms", row.entry.outputs[:1]
            else:
                yield "ratios", ()
        case "Filter" | "Smoother":
            result = summary.filter if subject == "Filter" else summary.smoother
            about = [] if result is None else [_worst_of(result)]
            yield "sigma_history", about
            yield "nees_history", about
            yield "estimation", about
        case _:
            yield "ratios" if "differs" in summary.verdicts else "combination", ()
            yield "ratios", ()


def _worst_of(result: FilterSummary) -> str:
    """Return the output or group that the tile of a filter names."""
    worst = worst_departure(result)
    return worst.name if worst is not None else result.output or result.group
