"""Tables of Markdown: the same but for the last digit shown."""

from __future__ import annotations

import re

NUMBER = r"\d[\d,]*(?:\.\d+)?"


def cells(text: str) -> list[list[str]]:
    """Return the cells of every row of the tables in a text."""
    rows = [line.strip("|").split("|") for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in row] for row in rows]


def assert_same_tables(one: str, other: str) -> None:
    """Compare tables; numbers may differ by one unit of the last digit, which processors may round differently."""
    found, expected = cells(one), cells(other)
    assert len(found) == len(expected) > 0
    for row, same in zip(found, expected, strict=True):
        assert [re.sub(NUMBER, "", cell) for cell in row] == [re.sub(NUMBER, "", cell) for cell in same]
        for a, b in zip(re.findall(NUMBER, "|".join(row)), re.findall(NUMBER, "|".join(same)), strict=True):
            unit = 10.0 ** -len(a.partition(".")[2])
            assert abs(float(a.replace(",", "")) - float(b.replace(",", ""))) < 1.001 * unit, (row, same)
