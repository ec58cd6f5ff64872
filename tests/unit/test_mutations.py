"""The mutation trial's changes: each parses, differs from the source, and stays where it belongs."""

from __future__ import annotations

import ast
import random

import pytest

from tests.mutation import ROOT
from tests.mutation.mutants import candidates, choose
from tests.mutation.references import read_references
from tests.mutation.sites import find_sites, mutate


@pytest.mark.parametrize(
    ("source", "choices"),
    [
        ("x = a + b", ["a - b"]),
        ("x = a < b", ["a <= b", "a >= b"]),
        ("x = a and b", ["a or b"]),
        ("x = -a", ["a"]),
        ("x = not a", ["a"]),
        ("x = a[0]", ["1", "-1"]),
        ("x = 0.25", ["0.5", "0.125", "-0.25"]),
        ("x = True", ["False"]),
        ("x += a", ["pass", "x -= a"]),
        ("x = a.T", ["a"]),
        ("x = np.sin(a)", ["np.cos(a)"]),
        ("x = np.sqrt(a)", ["a"]),
        ("x = f(a, b)", ["f(b, a)"]),
        ("x = load(a, b)", []),
        ("x = np.empty((n + 1, 3))", []),
        ('x = f"{a + b}"', []),
        ("raise ValueError(a + b)", []),
        ("x: Literal[1]", []),
        ("zip(a, strict=True)", []),
        ('"""One, or 1 + 1."""', []),
        ("@lru_cache(2)\ndef f() -> Literal[1]:\n    return a", []),
    ],
)
def test_changes_of_each_kind(source: str, choices: list[str]) -> None:
    assert [choice for site in find_sites(source) for choice in site.choices] == choices


def test_a_place_in_a_constant_belongs_to_its_name() -> None:
    """By which the compiled code that contains it is found, where several are defined together, too."""
    found = find_sites("A = 0\nB, C = 1, 2 * D")
    assert [(site.was, site.owner) for site in found] == [("0", "A"), ("1", "B"), ("2 * D", "C"), ("2", "C")]


def test_every_change_parses_and_differs() -> None:
    """Lines are kept, and the text around the place; non-ASCII symbols and expressions of several lines included."""
    chance = random.Random(3)
    for path, site in chance.sample(candidates(ROOT, "statistics/"), 30):
        source = (ROOT / path).read_text(encoding="utf-8")
        for choice in site.choices:
            mutant = mutate(source, site, choice)
            assert ast.dump(ast.parse(mutant)) != ast.dump(ast.parse(source))
            assert mutant.count("\n") == source.count("\n")
    source = "x = 'θ'; y = f(\n    a +\n    b,\n    c)\n"
    outer = find_sites(source)[0]
    assert mutate(source, outer, outer.choices[0]) == "x = 'θ'; y = (f(c, a + b)\n\n\n)\n"


def test_a_seed_chooses_the_same_mutants() -> None:
    first, again, other = (list(map(str, choose(ROOT, 20, seed, "linear/p"))) for seed in (1, 1, 2))
    assert first == again != other


def test_compiled_code_that_holds_a_definition_is_found_through_its_callers() -> None:
    """Gravitation is part of the steps of both ensembles; a check of rows is part of nothing compiled."""
    references = read_references(ROOT, ("mcnav/systems/ins",))
    after = references.compiled_after(("mcnav/systems/ins/earth.py", "gravitation"))
    assert ("mcnav/systems/ins/ensemble/free.py", "_run") in after
    assert ("mcnav/systems/ins/ensemble/aided.py", "_run") in after
    assert ("mcnav/systems/ins/ensemble/filters.py", "factor_innovations") not in after
    assert references.compiled_after(("mcnav/systems/ins/truth/rows.py", "LARGEST_GAP")) == set()
