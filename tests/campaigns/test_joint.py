"""The verdict on all outputs together, as a reader meets it: what fails comes first, explained, with a figure."""

from __future__ import annotations

import html
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.commands import invoke

SCENARIOS = '''
import numpy as np

from mcnav import Output, Source

SOURCES = tuple(Source(name, "m", "m", 1.0) for name in "abcd")


def outputs(*names):
    return tuple(Output(name, "m", "cm") for name in names)


class Twins:
    """The second is three times the first, but for a square: 3 first - second has no linear sigma."""

    sources, outputs = SOURCES, outputs("first", "second")

    def propagate(self, errors):
        a = errors[:, 0]
        return np.column_stack([a, 3.0 * a + 0.02 * a**2])


class Flat:
    """A square, a kink and a dead zone without partial derivatives, beside a linear output."""

    sources, outputs = SOURCES, outputs("square", "kink", "dead", "straight")

    def propagate(self, errors):
        a, b, c, d = errors.T
        dead = np.sign(c) * np.maximum(np.abs(c) - 0.5, 0.0)
        return np.column_stack([a**2, np.abs(b), dead, d])


class Shifted:
    """A mean error of 2 m that no partial derivative sees, and hardly any dispersion."""

    sources, outputs = SOURCES, outputs("reading", "other")

    def propagate(self, errors):
        a, b, c, _ = errors.T
        return np.column_stack([a + 2.0 * (1.0 - np.exp(-2000.0 * b**2)), c])


class Narrow:
    """Two outputs whose difference is narrow, and bent."""

    sources, outputs = SOURCES, outputs("left", "right")

    def propagate(self, errors):
        a, b, _, _ = errors.T
        return np.column_stack([a, a + 0.01 * b + 0.03 * a**2])
'''


@dataclass(frozen=True)
class Shown:
    """Results of a run, and what it prints."""

    summary: dict[str, Any]
    printed: list[str]
    shown: list[str]
    page: str

    @property
    def banner(self) -> list[str]:
        """The paragraphs of the page's first tile."""
        banner = re.search(r'<div class="tile .*?</div>', self.page, re.DOTALL)
        assert banner is not None
        return [html.unescape(each) for each in re.findall(r"<p[^>]*>(.*?)</p>", banner[0])]


def run(name: str, folder: Path, *options: str, samples: int = 4_000) -> Shown:
    """Run a scenario of `SCENARIOS`."""
    (folder / "scenarios.py").write_text(SCENARIOS)
    errors = "\n".join(f'{source} = "1 m"' for source in "abcd")
    text = f'samples = {samples}\nseed = 2\n[scenario]\ntype = "scenarios.py:{name}"\n[errors]\n{errors}\n'
    (folder / "campaign.toml").write_text(text)
    done = invoke("run", "campaign.toml", "--out", "run", *options, cwd=folder)
    shown = invoke("show", "run", cwd=folder)
    assert (done.returncode, shown.returncode) == (0, 0), done.stderr
    summary = json.loads((folder / "run" / "summary.json").read_text())
    page = (folder / "run" / "report.html").read_text(encoding="utf-8")
    return Shown(summary, done.stdout.splitlines(), shown.stdout.splitlines(), page)


NO = "Every sigma is right. The full covariance matrix is not."


@pytest.mark.parametrize("options", [(), ("--store", "summary")], ids=["samples", "summary"])
def test_the_failing_part_comes_first(options: tuple[str, ...], tmp_path: Path) -> None:
    """In the terminal, in `mcnav show` and on the page.

    The sigma of a square, 0.02 sqrt(2) m here, is known to 4 sqrt(3.5 / 4,000) = 12 %.
    """
    found = run("Twins", tmp_path, *options)
    for lines in (found.printed, found.shown, found.banner):
        (at,) = (place for place, line in enumerate(lines) if line.startswith(NO))
        first, then = lines[at + 1 : at + 3]
        words = re.match(
            r"The full covariance matrix differs: linear analysis treats a combination as exact that varies\. "
            r"second − 3 first: linear sigma 0 cm, simulated (\S+) cm \(0\.9\d+ % of the 300 cm of second\)\.", first
        )  # fmt: skip
        assert words is not None
        assert float(words[1]) == pytest.approx(2.0 * 2.0**0.5, rel=0.12)
        assert then.startswith("Every sigma from 4,000 samples is within")
    assert found.summary["verdict_matrix"] == "differs"
    assert found.page.index('id="figure-combination"') < found.page.index('<details class="fold"')
    page = html.unescape(found.page)
    assert "Samples along the thinnest direction" in page
    along = re.search(
        r"Sigma along the thinnest direction: (\S+) cm simulated, 0 cm linear \(second alone: 300 cm\)\.", page
    )
    assert along is not None
    assert float(along[1]) == pytest.approx(2.0 * 2.0**0.5, rel=0.12)


def test_outputs_without_partial_derivatives_say_why(tmp_path: Path) -> None:
    found = run("Flat", tmp_path)
    (told,) = (line for line in found.printed if line.startswith("Linear analysis predicts no dispersion"))
    assert told.startswith(
        "Linear analysis predicts no dispersion of square, kink and dead. The partial derivatives at the nominal are "
        "zero. The simulated sigmas of 4,000 samples are "
    )
    assert "Second-order terms explain the sigma of square: quadratic at the nominal." in told
    assert "kink and dead have a kink, a flat place or terms of higher order there." in told
    assert "Take the simulated sigma" in told
    (joint,) = (line for line in found.printed if line.startswith("The full covariance matrix"))
    assert joint.startswith(
        "The full covariance matrix differs with it. In all other directions the mean squared distance"
    )
    assert not any("agrees as well" in line for line in found.printed)


def test_a_mean_error_is_called_one(tmp_path: Path) -> None:
    """The mean is off by 2 m, two sigmas; nothing is said of an ellipsoid, and the figure shows the shift."""
    found = run("Shifted", tmp_path, "--force")
    joint = found.summary["joint"]
    assert joint["cause"] == "mean"
    assert joint["mean_error"] == pytest.approx(2.0, rel=0.1)
    told = next(line for line in found.printed if line.startswith(("The mean is off", "The full covariance matrix")))
    assert re.search(r"mean is off by \S+ sigma in reading \(by \S+ cm\)\. The dispersion", told)
    assert re.search(
        r"The mean squared distance in sigmas is \S+ about the linear mean. It is \S+ about the sample mean", told
    )
    assert "ellipsoid" not in told


def test_a_narrow_direction_is_explained(tmp_path: Path) -> None:
    """right - left: linear 0.01 m, simulated sqrt(1 + 18) times as large, beside outputs of 1 m; known to 12 %."""
    found = run("Narrow", tmp_path)
    told = next(line for line in found.printed if line.startswith("The full covariance matrix"))
    words = re.search(
        r"differs most in the thinnest direction of (\w+) and (\w+)\. There the simulated sigma is (\S+) cm, the "
        r"linear one (\S+) cm \((\S+) times as large\)",
        told,
    )
    assert words is not None
    assert {words[1], words[2]} == {"left", "right"}
    assert float(words[4]) == pytest.approx(1.0, rel=1e-2)
    assert float(words[5]) == pytest.approx(19.0**0.5, rel=0.12)
    assert "these errors nearly cancel" in told
    assert "The sigmas of single outputs hold." in told
