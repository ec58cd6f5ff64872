"""A filter of one's own that is wrong about single errors, from campaign file to page: its groups do not show it."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from mcnav.config.read import read_campaign
from mcnav.studies.linear_covariance import linear_covariance
from mcnav.workflow.run import run_campaign
from tests.commands import invoke

SCENARIO = '''
import numpy as np
from mcnav import Epochs, Simulated, Output, Source


class Constants:
    """Six independent constants of sigma 1 m; the filter states another sigma of some of them."""

    sources = tuple(Source(f"s{i}", "m", "m", 1.0) for i in range(6))
    outputs = tuple(Output(f"x{i}", "m", "m") for i in range(6))
    epochs = Epochs("time [min]", np.arange(4.0))
    stated = np.array(STATED)
    offset = np.zeros(6)

    def fly(self, errors):
        return Simulated(np.tile(errors + self.offset, (4, 1)), np.tile(np.diag(self.stated**2), (4, 1, 1)))

    def partials(self):
        return np.tile(np.eye(6), (4, 1, 1))
'''
"""Every epoch has the same errors: what is measured at one is measured at all."""

RIGHT = 1.0
BANNER = re.compile(r'<div class="tile (\w+)".*?<p class="headline">(.*?)</p>', re.DOTALL)
CHIP = re.compile(r'class="tag (\w+)"')


def run(folder: Path, stated: list[float], samples: int, offset: str = "np.zeros(6)") -> dict[str, Any]:
    content = SCENARIO.replace("STATED", str(stated)).replace("np.zeros(6)", offset)
    (folder / "constants.py").write_text(content)
    lines = [
        f'name = "constants"\nsamples = {samples}\nseed = 4',
        '[scenario]\ntype = "constants.py:Constants"',
        "[errors]",
    ]
    path = folder / "constants.toml"
    path.write_text("\n".join([*lines, *(f's{i} = "1 m"' for i in range(6))]))
    return dict(run_campaign(read_campaign(path), folder / "run", None, 1).summary)


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Callable[[float], tuple[dict[str, Any], Path]]:
    """From what the filter states of the last error to the summary of 10,000 samples, and the folder: run once."""

    @cache
    def made(last: float) -> tuple[dict[str, Any], Path]:
        folder = tmp_path_factory.mktemp("constants")
        return run(folder, [RIGHT] * 5 + [last], 10_000), folder

    return made


def banner(folder: Path) -> tuple[str, str, str]:
    """Return tone and headline of the filter's banner, and the section that explains it."""
    page = (folder / "run" / "report.html").read_text(encoding="utf-8")
    ((tone, headline),) = [entry for entry in BANNER.findall(page) if "filter" in entry[1]]
    section = page[page.index('<section id="filter">') :]
    return tone, headline, section[: section.index("</section>")]


def test_one_of_six_sigmas_is_too_small(ran: Callable[[float], tuple[dict[str, Any], Path]]) -> None:
    """Too small by 1.2: the mean NEES of all is 6.44 for 6, a ratio of 1.036, within the tolerance of 5 %."""
    summary, folder = ran(1.0 / 1.2)
    verdict = summary["filter"]
    assert verdict["verdict"] == "optimistic"
    assert (verdict["group"], verdict["output"], verdict["verdict_groups"]) == ("", "x5", "consistent")
    low, high = verdict["factor_interval"]
    assert low < 1.2 < high
    assert re.fullmatch(
        r"The filter is optimistic by a factor of 1\.\d+ \(1\.1\d* to 1\.2\d*\) in x5 from 0 min on\.",
        summary["filter_verdict"],
    )
    tone, headline, explanation = banner(folder)
    assert tone == "differs"
    assert headline.startswith("Do not trust this filter&#39;s covariance: x5 errors are 1.2 times what it computes.")
    assert summary["filter_verdict"] in (folder / "run" / "report.html").read_text(encoding="utf-8")
    assert "1σ of x5" in explanation
    assert "single errors average out" in explanation


def test_two_of_six_sigmas_are_wrong_in_opposite_directions(tmp_path: Path) -> None:
    """Variances of 1.44 and 0.56 of those stated cancel in the mean NEES of all six; linear analysis is right."""
    summary = run(tmp_path, [RIGHT] * 4 + [0.56**-0.5, 1.0 / 1.2], 10_000)
    verdict = summary["filter"]
    assert verdict["groups"]["all"]["ratio_linear"] == pytest.approx(1.0, abs=1e-12)
    assert verdict["verdict_groups"] == "consistent"
    assert (verdict["verdict"], verdict["output"]) == ("optimistic", "x5")
    assert [(each["verdict"], each["of"], each["name"]) for each in verdict["departures"]] == [
        ("optimistic", "output", "x5"), ("pessimistic", "output", "x4"),
    ]  # fmt: skip
    for departure, true in zip(verdict["departures"], (1.2, 0.56**0.5), strict=True):
        low, high = departure["factor_interval"]
        assert low < true < high
    assert re.fullmatch(
        r"The filter is optimistic by a factor of 1\.\d+ \(.*\) in x5 from 0 min on\. "
        r"The filter is pessimistic by a factor of 1\.3\d* \(1\.\d+ to 1\.\d+\) in x4 from 0 min on\.",
        summary["filter_verdict"],
    )


def test_too_few_samples_for_single_errors(tmp_path: Path) -> None:
    """The mean NEES of six errors is known to ±3.3 % from 600 samples, one sigma to ±5.8 %: the page is not green."""
    summary = run(tmp_path, [RIGHT] * 6, 600)
    verdict = summary["filter"]
    assert (verdict["verdict"], verdict["verdict_groups"], verdict["verdict_outputs"]) == (
        "undecided", "consistent", "undecided",
    )  # fmt: skip
    assert re.fullmatch(
        r"Undecided: the filter is consistent as a whole; single errors need about [\d,]+ samples\.",
        summary["filter_verdict"],
    )
    tone, headline, _ = banner(tmp_path)
    assert (tone, headline) == ("undecided", summary["filter_verdict"])


def test_every_sigma_is_right(ran: Callable[[float], tuple[dict[str, Any], Path]]) -> None:
    """10,000 samples know each to ±1.4 %, and below the green banner every mark of the filter is green."""
    summary, folder = ran(RIGHT)
    assert summary["filter_verdict"] == (
        "The filter is consistent: every output and every group is within ±5 % of the filter sigma at every epoch "
        "(95 % confidence)."
    )
    assert banner(folder)[0] == "agrees"
    page = (folder / "run" / "report.html").read_text(encoding="utf-8")
    section = page[page.index('<section id="filter">') :]
    assert set(CHIP.findall(section[: section.index("</section>")])) == {"agrees"}


def test_an_error_that_every_flight_has_is_a_mean_that_the_filter_neglects(tmp_path: Path) -> None:
    """A constant 0.8 m on top of a sigma of 1 m: the root mean square is sqrt(1.64), by samples and linear analysis."""
    summary = run(tmp_path, [RIGHT] * 6, 3_000, "0.8 * np.eye(6)[0]")
    verdict = summary["filter"]
    assert (verdict["verdict"], verdict["output"]) == ("optimistic", "x0")
    low, high = verdict["factor_interval"]
    assert low < 1.64**0.5 < high
    assert verdict["outputs"]["x0"]["ratio_linear"] == pytest.approx(1.64**0.5, rel=1e-12)
    assert [each["name"] for each in verdict["neglected"]] == ["mean_of_nominal_errors"]
    linear = linear_covariance(tmp_path / "constants.toml").filter
    assert linear is not None
    assert (linear.verdict.value, linear.output) == ("optimistic", "x0")
    assert linear.factor == pytest.approx(1.64**0.5, rel=1e-12)


def test_a_filter_that_states_no_variance_of_an_error_is_optimistic(tmp_path: Path) -> None:
    """Whatever the samples: no finite factor describes it."""
    summary = run(tmp_path, [RIGHT] * 5 + [0.0], 200)
    assert (summary["filter"]["verdict"], summary["filter"]["factor"]) == ("optimistic", None)
    tone, headline, _ = banner(tmp_path)
    words = "The filter is optimistic: it computes no variance of x5, whose error is not zero."
    assert (tone, headline) == ("differs", words)


@pytest.mark.parametrize("last", [RIGHT, 1.0 / 1.2])
def test_what_is_not_good_comes_first(ran: Callable[[float], tuple[dict[str, Any], Path]], last: float) -> None:
    """In the terminal and on the page: the filter's verdict before a good one on linear analysis, and only then."""
    _, folder = ran(last)
    printed = invoke("show", folder / "run", cwd=folder).stdout
    order = [
        printed.index(words[:38])
        for words in (
            "The filter's covariance" if last == RIGHT else "Do not trust this filter's covariance",
            "Linear covariance predicts every sigma",
        )
    ]
    assert order[0] < order[1]
    page = (folder / "run" / "report.html").read_text(encoding="utf-8")
    assert [tone for tone, _ in BANNER.findall(page)] == (
        ["agrees", "agrees"] if last == RIGHT else ["differs", "agrees"]
    )
