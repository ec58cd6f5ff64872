"""Lines of text files as an editor counts them."""

from __future__ import annotations

import re
from itertools import dropwhile, islice
from pathlib import Path
from typing import Final

from mcnav.files.whole import is_number

BEGINNING: Final = 4_096
"""Bytes by which a text is told from other formats."""

NO_TABLE: Final = re.compile(rb"\x00|\APAR1|\A(\xef\xbb\xbf)?\s*[<\\$!]")
"""Binary formats; markup and sentences of receivers, whose rows are not lines."""

COMMENT: Final = re.compile(r"\s*(#|%|//|!)")
"""Beginning of a comment, which may stand before the first row."""


def place_of_row(path: Path, row: int) -> str:
    r"""Return the place of a row of a file, counted from zero: its line where the file is a text.

    Comments, empty lines and the line of names count as lines, as in an editor.

    >>> written = Path("two.csv").write_text("# a flight\ntime,rate\n\n0,1\n1,2\n")
    >>> place_of_row(Path("two.csv"), 1), place_of_row(Path("absent.parquet"), 1)
    ('line 5', 'row 2')
    """
    try:
        with path.open("rb") as file:
            if NO_TABLE.search(file.read(BEGINNING)):
                return f"row {row + 1:,}"
        commented = path.suffix.lower() == ".pos"  # which may have comments between its rows
        with path.open(encoding="utf-8-sig", errors="replace") as text:
            lines = ((number, line) for number, line in enumerate(text, start=1) if line.strip())
            lines = (each for each in lines if not (commented and each[1].startswith("%")))
            rows = dropwhile(lambda each: COMMENT.match(each[1]), lines)
            number, line = next(rows)
            ahead = row if _holds_numbers(line) else row + 1
            if ahead:
                number, _ = next(islice(rows, ahead - 1, None))
    except (OSError, StopIteration):
        return f"row {row + 1:,}"
    return f"line {number:,}"


def _holds_numbers(line: str) -> bool:
    """Return whether most cells of a line are numbers: a row may hold a date."""
    cells = re.split(r"[,;\t]" if re.search(r"[,;\t]", line) else r"\s+", line.strip())
    return 2 * sum(is_number(cell.strip().strip('"')) for cell in cells) > len(cells)
