"""Equations of the pages as MathML, which browsers set without a script."""

from __future__ import annotations

import re

from latex2mathml.converter import convert


def with_equations(text: str) -> str:
    """Turn the blocks of a page that are fenced as ``math`` from LaTeX to MathML."""

    def equation(found: re.Match[str]) -> str:
        return f'<div class="equation" tabindex="0">{convert(found[1], display="block")}</div>\n'

    return re.sub(r"^```math\n(.*?)^```\n", equation, text, flags=re.DOTALL | re.MULTILINE)
