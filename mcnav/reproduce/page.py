"""The reproduction of NASA TN D-1772 as one HTML page and its CSV files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any, Final

import pandas as pd
from markupsafe import Markup

from mcnav.campaign.files import write_whole
from mcnav.report.page import filled
from mcnav.reproduce import tn_drawings as drawn
from mcnav.reproduce import tn_figures as computed
from mcnav.reproduce.tn_d1772 import Cell, Mark, all_cells
from mcnav.reproduce.tn_findings import Finding, claims, settled

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
    "V(b)": "Navigation from 3.58 min before reentry, in axes alined there. The parts differ in runs 7 to 10 because "
    "the axes do, by 89 degrees, and not because partial derivatives were inaccurate, as the report has it.",
    "VI": "Accelerometer outputs taken as zero above 121.92 km.",
}


@dataclass(frozen=True)
class Drawn:
    """A figure of the report.

    Attributes
    ----------
    name, title : str
    caption : str
    data : DataFrame
        Its CSV file.
    svg : str
    """

    name: str
    title: str
    caption: str
    data: pd.DataFrame
    svg: str


def _partials_of(output: int) -> tuple[Callable[[], pd.DataFrame], Callable[[pd.DataFrame], str]]:
    return (lambda: computed.figures_6_to_9(output), lambda frame: drawn.draw_6_to_9(frame, output))


FIGURES: Final[Mapping[str, tuple[str, str, Callable[[], pd.DataFrame], Callable[[pd.DataFrame], str]]]] = {
    "1": ("Altitude against range", "The seven trajectories.", computed.figure_1, drawn.draw_1),
    "2": ("Trajectory 4 over time", "Position, rates, speed, angle, force.", computed.figure_2, drawn.draw_2),
    "3": (
        "Error histories of trajectory 4",
        "Navigation errors with all of the report's errors at once; the last points are run 11 of Table II(d).",
        computed.figure_3,
        drawn.draw_3,
    ),
    "4": (
        "Sums of absolute final errors against final range",
        "Squares are printed (Table III), dots computed; the lines are flights between and beyond, to 28 km altitude.",
        computed.figure_4,
        drawn.draw_4,
    ),
    "5": (
        "Range of linearity",
        "Final altitude error of trajectory 4 up to a hundred times the report's initial errors.",
        computed.figure_5,
        drawn.draw_5,
    ),
    **{
        str(6 + output): (
            f"Partial derivatives of final {name} against start time",
            "Trajectory 4; the curves are partial derivatives times the report's errors, the CSV file has both.",
            *_partials_of(output),
        )
        for output, name in enumerate(("altitude", "range", "altitude rate", "range rate"))
    },
    "10": (
        "Partial derivatives of the perigee radius in r, r' and θ'",
        "Closed forms of the appendix on the printed ellipse, a flight without atmosphere, trajectory 4's altitude.",
        computed.figure_10,
        drawn.draw_10,
    ),
    "11": (
        "Partial derivatives of the perigee radius in r, V and γ",
        "Closed forms of the appendix on the printed ellipse.",
        computed.figure_11,
        drawn.draw_11,
    ),
    "12": (
        "Final altitude and range errors against start time",
        "Trajectory 4, the report's errors at whatever time navigation starts. Triangles mark the least up to reentry.",
        computed.figure_12,
        drawn.draw_12,
    ),
    "13": (
        "Switching altitude of the accelerometers",
        "Not in the report: trajectory 4 with the outputs taken as zero above an altitude, which it tried at one only.",
        computed.switching,
        drawn.draw_switching,
    ),
}
"""Title, caption, data and drawing of each figure."""


def table(cells: Sequence[Cell]) -> pd.DataFrame:
    """One row a printed number."""
    return pd.DataFrame(
        [
            {
                "table": cell.table,
                "row": cell.row,
                "column": cell.column,
                "unit": cell.unit,
                "printed": cell.printed,
                "computed": cell.computed,
                "ensemble engine": cell.second,
                "difference": cell.difference,
                "tolerance": cell.tolerance,
                "mark": cell.mark.value,
                "reason": cell.reason,
            }
            for cell in cells
        ]
    )


def _shown(cell: Cell) -> dict[str, Any]:
    """A cell for the template: one digit more than printed."""
    decimals = len(cell.printed.partition(".")[2]) + 1
    return {
        "table": cell.table,
        "row": cell.row,
        "column": cell.column,
        "unit": cell.unit,
        "printed": cell.printed.replace("-", "−"),
        "shown": f"{cell.computed:.{decimals}f}".replace("-", "−"),
        "allowed": f"{cell.tolerance:.3g}",
        "mark": cell.mark.value,
        "kind": cell.mark.name.lower(),
        "reason": cell.reason,
    }


def _between_engines(cells: Sequence[Cell]) -> str:
    """How far the two engines are apart in a table, as a share of the tolerance; empty where only one computes it."""
    shares = [abs(cell.second - cell.computed) / cell.tolerance for cell in cells if cell.second == cell.second]
    return f"The two engines differ by at most {max(shares):.0e} of the tolerance." if shares else ""


def render(
    title: str, cells: Sequence[Cell], figures: Sequence[Drawn], said: Sequence[Finding], decided: Sequence[Finding]
) -> str:
    """The page."""
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
        figures=[(figure, Markup(figure.svg)) for figure in figures],
        claims=said,
        settled=decided,
    )


def write_reproduction(path: Path) -> tuple[list[Cell], list[Path]]:
    """Recompute the whole report and write it down.

    Returns
    -------
    cells : list of Cell
        Every number of Tables I to VI.
    written : list of Path
        The page, ``tables.csv``, ``findings.csv`` and ``figure_01.csv`` to ``figure_13.csv``.
    """
    cells = all_cells()
    figures = []
    for name, (title, caption, data, draw) in FIGURES.items():
        frame = data()
        figures.append(Drawn(name, title, caption, frame, draw(frame)))
    said, decided = claims({figure.name: figure.data for figure in figures}), settled()
    found = [("claim", finding) for finding in said] + [("decision", finding) for finding in decided]
    findings = pd.DataFrame([{"kind": kind} | vars(finding) for kind, finding in found])
    files = {
        PAGE: render(TITLE, cells, figures, said, decided),
        "tables.csv": table(cells).to_csv(index=False),
        "findings.csv": findings.to_csv(index=False),
        **{f"figure_{int(figure.name):02}.csv": figure.data.to_csv(index=False) for figure in figures},
    }
    path.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        write_whole(path / name, text.encode())
    return cells, [path / name for name in files]
