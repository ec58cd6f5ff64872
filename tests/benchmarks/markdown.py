"""Tables and numbers in Markdown."""

from __future__ import annotations

from collections.abc import Sequence


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Make a table of cells."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def number(value: float | None, otherwise: str, unit: str = "") -> str:
    """Show a number with two digits, or all before the point; or what stands for none."""
    if value is None:
        return otherwise
    return f"{value:,.0f}{unit}" if value >= 100 else f"{value:.2g}{unit}"
