"""The panel of a run's figures that shows its worst case: what the foremost tile is about."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from mcnav.analysis.summary import FilterSummary
from mcnav.report.document.parts import Tile
from mcnav.report.drawing.figure import Figure
from mcnav.report.drawing.marks import of_requirement
from mcnav.report.figures.requirements import with_limit
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
    for name, about in _wanted(content, subject):
        figure = drawn.get(name)
        panels = [] if figure is None else [panel for panel in figure.panels if set(about) <= set(panel.about)]
        if figure is not None and panels:
            shows = figure.shows if len(figure.panels) == 1 else f"{tile.value} {tile.of}.".lstrip()
            shown = replace(figure, panels=panels[:1], shown=0, shows=shows)
            return _with_limit(shown, content) if subject == "Requirements" and about else shown
    return None


def _with_limit(figure: Figure, content: RunAnalysis) -> Figure:
    """Draw the limit of the worst requirement in the outputs that it limits, where that is what a figure shows."""
    row = worst_requirement(content.summary, content.time_unit)
    return with_limit(figure, row) if row is not None and figure.name in ("histograms", "scatter") else figure


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
