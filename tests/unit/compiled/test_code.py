"""Digests of code: comments, docstrings and lines are not part of them, all else is."""

from __future__ import annotations

from pathlib import Path
from types import FunctionType

import numpy as np
import pytest

from mcnav.compiled.code import digest_of_files, digest_of_function

TEXT = '''"""Equations."""

FACTOR = 2.0
"""Of the product."""

NAMES = frozenset({"one", "other", "third"})


class Tables:
    """Tables of the product."""

    width: int = 3


def product(x):
    """Return a product."""
    # twice
    return [FACTOR * y for y in ("text", x)], "a product"
'''


def digest(text: str, folder: Path) -> str:
    file = folder / "kernel.py"
    file.write_text(text)
    return digest_of_files([file])


@pytest.fixture(autouse=True)
def _without_byte_code(monkeypatch: pytest.MonkeyPatch) -> None:
    """Python takes a file of the same length and second for the one before."""
    monkeypatch.setattr("sys.dont_write_bytecode", True)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"""Equations."""', '"""Equations of motion.\n\nOf a product.\n"""'),
        ('"""Of the product."""', '"""Of products."""'),
        ('"""Tables of the product."""', '"""Tables."""'),
        ('    """Return a product."""', '    """Return the product."""'),
        ("# twice", "# by a factor\n\n"),
    ],
)
def test_words_change_nothing(old: str, new: str, tmp_path: Path) -> None:
    assert old in TEXT
    assert digest(TEXT.replace(old, new), tmp_path) == digest(TEXT, tmp_path)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("2.0", "2.5"), ('"third"', '"fourth"'), ("int = 3", "int = 4"), ("FACTOR * y", "FACTOR + y"),
        ('"text"', '"word"'), (', "a product"', ', "the product"'), ("def product(x)", "def product(x, z=1)"),
        ("2.0", "2"),
    ],
)  # fmt: skip
def test_all_else_does(old: str, new: str, tmp_path: Path) -> None:
    assert old in TEXT
    assert digest(TEXT.replace(old, new), tmp_path) != digest(TEXT, tmp_path)


def make(value: object) -> FunctionType:
    def function() -> object:
        """Return what it is made with."""
        return value

    return function


def test_a_function_is_what_it_takes_from_around_it() -> None:
    """Values that `repr` shortens included."""
    many, other = np.zeros(5000), np.zeros(5000)
    other[2500] = 1.0
    values = 1.0, 1, make(1.0), make(2.0), many, other
    assert len({digest_of_function(make(value)) for value in values}) == len(values)
    assert digest_of_function(make(make(many))) == digest_of_function(make(make(many.copy())))
