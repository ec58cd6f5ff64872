"""A reproduction as one HTML page and one CSV file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import groupby
from typing import Any, Final

import pandas as pd

from mcnav.report.page import filled
from mcnav.reproduce.tn_d1772 import Cell, Mark

PHRASES: Final = {
    Mark.DIGITS: "agree to the printed digits",
    Mark.TOLERANCE: "lie within the tolerance",
    Mark.INCONSISTENT: "are contradicted by the report itself",
    Mark.DIFFERS: "differ",
}

CAPTIONS: Final = {
    "I": "Range and time are counted from 121.92 km. Trajectories 4 and 6 are solved for their printed range.",
    "III": "The absolute sums of Table II, altitude and range.",
    "V(a)": "Navigation from 3.58 min before reentry, in the axes of the first start.",
    "V(b)": "Navigation from 3.58 min before reentry, in axes alined there. The parts differ in runs 7 to 10 because "
    "the axes do, by 89 degrees, and not because partial derivatives were inaccurate, as the report has it.",
    "VI": "Accelerometer outputs taken as zero above 121.92 km.",
}


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


def render(title: str, cells: Sequence[Cell]) -> str:
    """The page."""
    tables = []
    for name, members in groupby(cells, key=lambda cell: cell.table):
        rows = [(row, list(group)) for row, group in groupby(members, key=lambda cell: cell.row)]
        columns = list(dict.fromkeys((cell.column, cell.unit) for cell in rows[0][1]))
        shown = [(row, [_shown(cell) for cell in group]) for row, group in rows]
        tables.append({"name": f"Table {name}", "caption": CAPTIONS.get(name, ""), "columns": columns, "rows": shown})
    counted = Counter(cell.mark for cell in cells)
    return filled(
        "reproduction.html",
        title=title,
        total=len(cells),
        counts=[(mark, f"{counted[mark]:,}") for mark in Mark if counted[mark]],
        phrases=PHRASES,
        notable=[_shown(cell) for cell in cells if cell.mark in (Mark.INCONSISTENT, Mark.DIFFERS)],
        tables=tables,
    )
