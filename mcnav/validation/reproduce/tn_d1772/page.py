"""The reproduction of NASA TN D-1772 as one HTML page and its CSV files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from mcnav.files import write_texts
from mcnav.report.figures.figure import Figure
from mcnav.report.format import number
from mcnav.report.html import filled
from mcnav.validation.reproduce.tn_d1772 import curves as computed
from mcnav.validation.reproduce.tn_d1772 import figures as drawn
from mcnav.validation.reproduce.tn_d1772.claims import Finding, claims, settled
from mcnav.validation.reproduce.tn_d1772.globe import RESULTS
from mcnav.validation.reproduce.tn_d1772.in_three_dimensions import Comparison, comparisons, figure_14
from mcnav.validation.reproduce.tn_d1772.spatial_claims import spatial_claims
from mcnav.validation.reproduce.tn_d1772.tables import Cell, Mark, all_cells

TITLE: Final = "NASA TN D-1772, recomputed"
PAGE: Final = "tn_d1772.html"

PHRASES: Final = {
    Mark.DIGITS: "agree to the printed digits",
    Mark.TOLERANCE: "lie within the tolerance",
    Mark.INCONSISTENT: "are contradicted by the report itself",
    Mark.DIFFERS: "differ",
}

CAPTIONS: Final = {
    "I": "Range and time are counted from 121.92 km. Trajectories 4 and 6 are solved for their printed range.",
    "III": "The absolute sums of Table II, altitude and range.",
    "IV(c)": "A hundred times the errors: far from linear, and still the same by both engines.",
    "V(a)": "Navigation from 3.58 min before reentry, in the axes of the first start.",
    "V(b)": "Navigation from 3.58 min before reentry, in axes aligned there. The parts differ in runs 7 to 10 because "
    "the axes do, by 89 degrees, and not because partial derivatives were inaccurate, as the report has it.",
    "VI": "Accelerometer outputs taken as zero above 121.92 km.",
}


FIGURES: Final[Mapping[str, tuple[Callable[[], pd.DataFrame], Callable[[pd.DataFrame], Figure]]]] = {
    "1": (computed.figure_1, drawn.figure_1),
    "2": (computed.figure_2, drawn.figure_2),
    "3": (computed.figure_3, drawn.figure_3),
    "4": (computed.figure_4, drawn.figure_4),
    "5": (computed.figure_5, drawn.figure_5),
    **{
        str(6 + output): (partial(computed.figures_6_to_9, output=output), partial(drawn.figures_6_to_9, output=output))
        for output in range(4)
    },
    "10": (computed.figure_10, drawn.figure_10),
    "11": (computed.figure_11, drawn.figure_11),
    "12": (computed.figure_12, drawn.figure_12),
    "13": (computed.switching, drawn.figure_13),
    "14": (figure_14, drawn.figure_14),
}
"""Data and drawing of each figure."""


def table(cells: Sequence[Cell]) -> pd.DataFrame:
    """Tabulate the cells, a row for each printed number."""
    frame = pd.DataFrame(cells)
    frame["difference"] = [cell.difference for cell in cells]
    frame["mark"] = [cell.mark.value for cell in cells]
    shown = ["table", "row", "column", "unit", "printed", "computed", "second", "difference", "tolerance", "mark",
             "reason"]  # fmt: skip
    return frame[shown].rename(columns={"second": "ensemble engine"})


def _shown(cell: Cell) -> dict[str, Any]:
    """Format a cell for the template: one digit more than printed."""
    decimals = len(cell.printed.partition(".")[2]) + 1
    return vars(cell) | {
        "printed": cell.printed.replace("-", "−"),
        "shown": f"{round(cell.computed, decimals) + 0.0:.{decimals}f}".replace("-", "−"),  # and no negative zero
        "allowed": f"{cell.tolerance:.3g}",
        "mark": cell.mark.value,
        "kind": cell.mark.name.lower(),
    }


def _between_engines(cells: Sequence[Cell]) -> str:
    """Say how far the engines differ in a table, as a share of the tolerance; empty where only one computes it."""
    shares = [abs(cell.second - cell.computed) / cell.tolerance for cell in cells if cell.second == cell.second]
    return f"The two engines differ by at most {number(max(shares), 1)} of the tolerance." if shares else ""


def render(
    title: str, cells: Sequence[Cell], figures: Mapping[str, Figure], said: Sequence[Finding],
    decided: Sequence[Finding], spatial: Sequence[Finding], compared: Sequence[Comparison],
) -> str:  # fmt: skip
    """Render the page; figures by number, findings and numbers of the navigator in three dimensions last."""
    tables = []
    for name, members in groupby(cells, key=lambda cell: cell.table):
        own = list(members)
        rows = [(row, list(group)) for row, group in groupby(own, key=lambda cell: cell.row)]
        columns = list(dict.fromkeys((cell.column, cell.unit) for cell in rows[0][1]))
        shown = [(row, [_shown(cell) for cell in group]) for row, group in rows]
        caption = f"{CAPTIONS.get(name, '')} {_between_engines(own)}".strip()
        tables.append({"name": f"Table {name}", "caption": caption, "columns": columns, "rows": shown})
    counted = Counter(cell.mark for cell in cells)
    return filled(
        "reproduction.html",
        title=title,
        total=len(cells),
        counts=[(mark, f"{counted[mark]:,}") for mark in Mark if counted[mark]],
        phrases=PHRASES,
        notable=[_shown(cell) for cell in cells if cell.mark in (Mark.INCONSISTENT, Mark.DIFFERS)],
        tables=tables,
        marks=[(mark.name.lower(), phrase) for mark, phrase in PHRASES.items()],
        figures=figures,
        claims=said,
        settled=decided,
        spatial=spatial,
        compared=[_compared(each) for each in compared],
    )


def _compared(each: Comparison) -> dict[str, Any]:
    """Format a comparison for the template."""
    numbers = {name: number(getattr(each, name)) for name in ("planar", "planar_simulated", "linear", "own")}
    interval = "" if np.isnan(each.low) else f" ({number(each.low, 3)} to {number(each.high, 3)})"
    return {
        "case": each.case.replace("-", "−"),
        "result": each.result,
        **numbers,
        "simulated": f"{number(each.simulated)}{interval}",
        "departure": number(100.0 * each.departure, 2),
    }


def chapter(compared: Sequence[Comparison]) -> str:
    """Write the table of the chapter on three dimensions in ``TN_D1772.md``.

    Each cell has the planar navigator's number, where it has one, and that of the navigator in three dimensions; those
    of samples are in brackets.
    """
    lines = [f"| case | {' | '.join(RESULTS)} |", f"| --- |{' --- |' * len(RESULTS)}"]
    for case, members in groupby(compared, key=lambda each: each.case):
        cells = {each.result: _cell(each) for each in members}
        lines.append(f"| {case.replace('-', '−')} | {' | '.join(cells.get(name, '–') for name in RESULTS)} |")
    return "\n".join(lines) + "\n"


def _cell(each: Comparison) -> str:
    """Write the numbers of a comparison."""

    def pair(linear: float, sampled: float) -> str:
        return number(linear, 3) if np.isnan(sampled) else f"{number(linear, 3)} ({number(sampled, 3)})"

    spatial = pair(each.linear, each.simulated)
    return spatial if np.isnan(each.planar) else f"{pair(each.planar, each.planar_simulated)}; {spatial}"


def write_reproduction(path: Path) -> tuple[list[Cell], list[Path]]:
    """Recompute the whole report; return every number of Tables I to VI, and the files written.

    They are the page, ``tables.csv``, ``findings.csv``, ``three_dimensions.csv``, the table ``three_dimensions.md`` of
    the chapter on three dimensions, and ``figure_01.csv`` to ``figure_14.csv``.
    """
    cells = all_cells()
    data = {name: tabulate() for name, (tabulate, _) in FIGURES.items()}
    figures = {name: draw(data[name]) for name, (_, draw) in FIGURES.items()}
    said, decided, compared = claims(data), settled(), comparisons()
    spatial = spatial_claims(compared, data["14"])
    kinds = (("claim", said), ("decision", decided), ("three dimensions", spatial))
    reproduction = [(kind, finding) for kind, findings in kinds for finding in findings]
    findings = pd.DataFrame([{"kind": kind} | vars(finding) for kind, finding in reproduction])
    files = {
        PAGE: render(TITLE, cells, figures, said, decided, spatial, compared),
        "three_dimensions.csv": pd.DataFrame(compared).to_csv(index=False),
        "three_dimensions.md": chapter(compared),
        "tables.csv": table(cells).to_csv(index=False),
        "findings.csv": findings.to_csv(index=False),
        **{figure.file: data[name].to_csv(index=False) for name, figure in figures.items()},
    }
    return cells, write_texts(path, files)
