"""Equations as MathML, which browsers and screen readers know."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from markupsafe import Markup

from mcnav.report.document.parts import Formula

OPERATORS: Final = "=+−()"


def _tag(name: str, *parts: str) -> str:
    return f"<{name}>{''.join(parts)}</{name}>"


def _terms(text: str) -> Iterator[str]:
    """Typeset what spaces separate: MathML as it is, operators, numbers, names.

    >>> "".join(_terms("P + 1"))
    '<mi>P</mi><mo>+</mo><mn>1</mn>'
    """
    for piece in text.split(" "):
        tag = "mo" if piece in OPERATORS else "mn" if piece.isdigit() else "mi"
        yield piece if piece.startswith("<") else _tag(tag, piece)


def _row(*parts: str) -> str:
    return _tag("mrow", *(term for part in parts for term in ([part] if part.startswith("<") else _terms(part))))


def _hat(name: str) -> str:
    return _tag("mover", _tag("mi", name), _tag("mo", "^"))


def _under(part: str, words: str) -> str:
    return _tag("munder", part, _tag("mtext", words))


def _formula(*parts: str) -> Formula:
    return Formula(Markup('<math display="block">{}</math>').format(Markup(_row(*parts))))


def _transposed(part: str) -> str:
    return _tag("msup", part, '<mi mathvariant="normal">T</mi>')


PT: Final = _transposed(_tag("mi", "P"))
PSPT: Final = f"{_tag('mi', 'P')}{_tag('mi', 'S')}{PT}"
ERROR: Final = _row("( y − m )")
HALF: Final = _tag("mfrac", _tag("mn", "1"), _tag("mn", "2"))

PAIRED: Final = _formula(_hat("C"), "= cov ( y ) − cov ( P s ) +", PSPT)
"""The paired estimate, Ĉ = cov(y) − cov(P s) + P S Pᵀ."""

NEES: Final = _formula("ε =", _transposed(ERROR), _tag("msup", _row("(", PSPT, ")"), _row("− 1")), ERROR)
"""Normalized estimation error squared, ε = (y − m)ᵀ (P S Pᵀ)⁻¹ (y − m)."""

SAMPLING: Final = _formula(
    "cov ( y ) −", PSPT, "=", _under(_row("P (", _hat("S"), "− S )", PT), "sampling"), "+",
    _under(_row(HALF, "tr ( H S H S )"), "second order"), "+", _tag("mtext", "third order"), "+",
    _tag("mtext", "remainder"),
)  # fmt: skip
"""Terms of the difference, cov(y) − P S Pᵀ = P (Ŝ − S) Pᵀ + ½ tr(H S H S) + third order + remainder."""

SHARE: Final = _formula(
    _tag("msub", _tag("mi", "share"), _row("i j")), "=",
    _tag(
        "mfrac",
        _row(_tag("msubsup", _tag("mi", "P"), _row("i j"), _tag("mn", "2")),
             _tag("msub", _tag("mi", "S"), _row("j j"))),
        _tag("msub", _row("(", PSPT, ")"), _row("i i")),
    ),
)  # fmt: skip
"""Share of source j in the linear variance of output i, P_ij² S_jj / (P S Pᵀ)_ii."""
