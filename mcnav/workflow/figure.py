"""Draw one figure of a run's report for a paper."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from mcnav.errors import RunFolderError, reading_file, suggestion
from mcnav.execution.threads import one_thread
from mcnav.report.pages.run.page import figures
from mcnav.store.run_folder import RunFolder
from mcnav.workflow.analyse import analyse

ENDINGS: Final = (".pdf", ".svg", ".png")

CROWDED: Final = "labels overlap at this size; choose a larger one, a smaller --font-scale, --panel or --columns"


def draw_figure(
    folder: Path,
    name: str,
    into: Path,
    width: float | None,
    height: float | None,
    font_scale: float,
    panels: Sequence[str] = (),
    columns: int | None = None,
) -> list[str]:
    """Draw a figure by name into a file, and return notes; see `mcnav.report.drawing.figure.Figure.figure`.

    Parameters
    ----------
    panels : sequence of str
        Titles of its panels, by default the first ones.

    Raises
    ------
    RunFolderError
        When there is no finished run, no such figure or panel, or it cannot be drawn so small.
    """
    if into.suffix.lower() not in ENDINGS:
        raise RunFolderError(f"{into}: must end in .pdf, .svg or .png")
    with one_thread(), reading_file(folder):
        figure = figures(analyse(RunFolder(folder)))
    if name not in figure:
        raise RunFolderError(f"--figure: the report has no figure {name!r:.60}{suggestion(name, list(figure))}")
    from mcnav.report.drawing.on_axes import crowded, save

    try:
        chosen = figure[name].of_panels(*panels) if panels else figure[name]
        drawn = chosen.figure(width, font_scale, height, columns)
        save(drawn, into)
    except ValueError as wrong:
        raise RunFolderError(f"{name}: {wrong}") from None
    return [CROWDED] if crowded(drawn) else []
