"""Campaigns at the edge of what can be said: a right result or a clear statement; no warning, no NaN, no crash."""

from __future__ import annotations

import html
import json
import re
from pathlib import Path

import pytest

from tests.commands import in_process

TOYS = '''
import numpy as np

from mcnav import Output, Source


class Toy:
    """x = a + b, y is constant, z = c + d e / 10; fails where an error is above a limit."""

    sources = tuple(Source(name, "m", "m", 1.0) for name in "abcde")
    outputs = tuple(Output(name, "m", "m") for name in "xyz")
    settings = {"limit": "1"}

    def __init__(self, limit=1e9):
        self.limit = limit

    def propagate(self, errors):
        a, b, c, d, e = errors.T
        found = np.column_stack([a + b, 7.0 + 0.0 * a, c + 0.1 * d * e])
        found[np.abs(errors).max(axis=1) > self.limit] = np.nan
        return found


class Single:
    """One output of two errors, bent; or nothing but bent."""

    sources = tuple(Source(name, "m", "m", 1.0) for name in "ab")
    outputs = (Output("x", "m", "m"),)
    settings = {"slope": "1"}

    def __init__(self, slope=1.0):
        self.slope = slope

    def propagate(self, errors):
        return self.slope * errors[:, :1] + 0.1 * errors[:, 1:] ** 2


class Wide:
    """Six outputs of two errors."""

    sources = tuple(Source(name, "m", "m", 1.0) for name in "ab")
    outputs = tuple(Output(name, "m", "m") for name in "uvwxyz")

    def propagate(self, errors):
        a, b = errors.T
        return np.column_stack([a, b, a + b, a - b, a * b, a**2])
'''
SIGMAS = "\n".join(f'{name} = "1 m"' for name in "abcde")
TWO = 'a = "1 m"\nb = "1 m"'
REENTRY = 'altitude = "5 km"\nrange = "2 km"\naltitude_rate = "1 m/s"'
ACCEPT = """
[accept]
sigma_ratio = "5 %"
[[accept.quantile]]
output = "x"
probability = 0.99
below = "10 m"
[[accept.cep]]
outputs = ["x", "y"]
below = "10 m"
[[accept.box]]
within = { x = "10 m", z = "10 m" }
probability = 0.9
"""


def _correlated(one: str, other: str, coefficient: float) -> str:
    return f'[[correlations]]\nbetween = ["{one}", "{other}"]\ncoefficient = {coefficient}\n'


CASES = {
    "a source of zero sigma": (
        "Toy", 2000, SIGMAS.replace('b = "1 m"', 'b = "0 m"'), ACCEPT, 0, "Every sigma is right",
    ),
    "perfectly correlated": (
        "Toy", 2000, SIGMAS, _correlated("a", "b", 1) + _correlated("c", "d", -1), 0, "Every sigma is right",
    ),
    "errors that cancel": ("Toy", 2000, SIGMAS, _correlated("a", "b", -1), 0, "Every sigma is right"),
    "no errors": ("Toy", 100, "", ACCEPT, 0, "no error source varies"),
    "nothing depends": ("Single slope=0", 100, 'a = "1 m"', "", 0, "no output depends on an error source"),
    "curvature alone": ("Single slope=0", 100, TWO, "", 0, "predicts no dispersion of x"),
    "a single output": ("Single", 2000, TWO, "", 0, "Every sigma is right"),
    "fewer samples than outputs": ("Wide", 3, TWO, "", 0, "too few independent samples"),
    "a single pair": ("Wide", 2, TWO, 'design="antithetic"', 0, "too few independent samples"),
    "a net of three": ("Wide", 3, TWO, 'design="sobol"', 0, "too few independent samples"),
    "all failed": ("Toy limit=0.001", 50, SIGMAS, ACCEPT, 3, "0 of 50 samples succeeded"),
    "one left": ("Toy limit=0.6225", 50, SIGMAS, ACCEPT, 3, "1 of 50 samples succeeded"),
    "shared tails": (
        "Toy", 300, SIGMAS, '[[joint]]\nsources = ["a", "c"]\ndistribution = "student-t"\ndegrees_of_freedom = 4\n',
        0, "because of heavy tails (a and c)",
    ),
    "a reentry of one matrix rank": (
        "reentry", 100, REENTRY,
        _correlated("altitude", "range", 1) + _correlated("altitude", "altitude_rate", -1)
        + _correlated("range", "altitude_rate", -1), 0, "",
    ),
    "a reentry far beyond linear": (
        "reentry", 100, 'altitude = "6000 km"\naltitude_rate = "9 km/s"', "", 0, "The linear sigmas are wrong for",
    ),
    "a reentry of two samples": ("reentry", 2, REENTRY, "", 0, "too few independent samples"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_a_clear_statement(case: str, tmp_path: Path) -> None:
    """Terminal, summary and report; warnings are errors in every test."""
    kind, samples, errors, more, status, said = CASES[case]
    name, *settings = kind.split()
    scenario = 'type = "reentry"\ntrajectory = 4' if name == "reentry" else f'type = "toys.py:{name}"'
    top = more if more.startswith("design") else ""
    lines = [f"samples = {samples}\nseed = 3", top, f"[scenario]\n{scenario}", *settings, f"[errors]\n{errors}"]
    (tmp_path / "toys.py").write_text(TOYS)
    (tmp_path / "case.toml").write_text("\n".join([*lines, "" if top else more]))
    told = in_process("run", tmp_path / "case.toml", "--out", tmp_path / "run", "--jobs", "1")
    assert told.exit_code == status, told.output
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["samples"] == samples
    report = (tmp_path / "run" / "report.html").read_text()
    words = html.unescape(re.sub(r"<(style|script).*?</\1>|<[^>]+>", " ", report, flags=re.DOTALL))
    for text in (told.output, words):
        assert not re.search(r"\b(nan|NaN|inf|Traceback|Warning)\b", text)
    assert said in " ".join(words.split())
