"""A filter that knows some of the outputs of a class, and requirements at epochs of a class."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from mcnav.config.read import read_campaign
from mcnav.errors import CampaignError
from mcnav.studies.linear_covariance import linear_covariance
from tests.commands import invoke
from tests.runs import simulate

CODE = """
import numpy as np
from mcnav import Epochs, Simulated, Output, Source


class Part:
    sources = tuple(Source(f"s{i}", "m", "m", 1.0) for i in range(3))
    outputs = (Output("x", "m", "m"), Output("true_x", "m", "m", of="truth"), Output("y", "m", "m"))
    epochs = Epochs("time [min]", np.arange(4.0))

    def fly(self, errors):
        return Simulated(np.tile(errors * [1.0, 5.0, 1.0], (4, 1)), np.tile(np.diag([1.0, 1.0 / 1.2**2]), (4, 1, 1)))

    def partials(self):
        return np.tile(np.diag([1.0, 5.0, 1.0]), (4, 1, 1))
"""

CAMPAIGN = """
name = "part"
samples = 2_000
[scenario]
type = "part.py:Part"
[errors]
s0 = "1 m"
s1 = "1 m"
s2 = "1 m"
[[accept.quantile]]
output = "true_x"
probability = 0.95
below = "12 m"
WHEN
"""


def written(folder: Path, when: str = 'after = "60 s"') -> Path:
    (folder / "part.py").write_text(CODE)
    (folder / "part.toml").write_text(CAMPAIGN.replace("WHEN", when))
    return folder / "part.toml"


def test_a_filter_states_the_covariance_of_navigation_errors_alone(tmp_path: Path) -> None:
    """The dispersion of the truth, five times as large, is none of its business; y is, by a factor of 1.2."""
    summary = simulate(read_campaign(written(tmp_path)), tmp_path / "run", None, 1).summary["filter"]
    assert list(summary["outputs"]) == ["x", "y"]
    assert (summary["verdict"], summary["output"]) == ("optimistic", "y")
    low, high = summary["outputs"]["y"]["factor_interval"]
    assert low < 1.2 < high
    done = invoke("lincov", "part.toml", "--out", "lin", cwd=tmp_path)
    assert "It is worst in y, at " in done.stdout
    judged = json.loads((tmp_path / "lin" / "lincov.json").read_text())["filter"]
    assert (judged["verdict"], judged["output"]) == ("optimistic", "y")


def test_a_sigma_that_the_filter_does_not_state_is_a_dash(tmp_path: Path) -> None:
    """In the terminal and on the page; a file has nothing there."""
    campaign = read_campaign(written(tmp_path))
    printed = invoke("lincov", "part.toml", "--out", "lin", cwd=tmp_path).stdout
    (end, *_) = [line.split() for line in printed.splitlines() if line.startswith("true x [m]")]
    assert end[3:6] == ["0", "5.0000", "–"]  # nominal, sigma, and that of the filter
    assert "nan" not in printed
    assert ">nan<" not in (tmp_path / "lin" / "lincov.html").read_text()
    rows = json.loads((tmp_path / "lin" / "lincov.json").read_text())["rows"]
    assert [row["sigma_filter"][1] for row in rows] == [None] * 4
    table = invoke("lincov", "part.toml", "--format", "csv", cwd=tmp_path).stdout
    assert "0.0,,true_x,m,5.0,,0.0,False" in table
    history = linear_covariance(campaign).history
    assert history is not None
    assert history.readings.own_outputs == (0, 2)


def test_requirements_at_epochs_of_a_class(tmp_path: Path) -> None:
    """From 60 s on, the second of four epochs, a minute apart; 1.96 times 5 m by linear analysis."""
    campaign = read_campaign(written(tmp_path))
    assert campaign.requirements[0].epochs == (1, 2, 3)
    done = invoke("lincov", "part.toml", "--out", "lin", cwd=tmp_path)
    assert "9.800 m" in done.stdout
    with pytest.raises(CampaignError, match="got 90 s, which lies between two epochs; expected 60 s or 120 s"):
        read_campaign(written(tmp_path, 'at = "90 s"'))
    with pytest.raises(CampaignError, match="navigation is from 0 s to 180 s"):
        read_campaign(written(tmp_path, 'after = "4 min"'))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ('filter_outputs = ("z",)', "filter_outputs must list outputs, each once"),
        ('filter_outputs = "x"', "filter_outputs must list outputs, each once"),
        ('outputs = (Output("x", "m", "m", of="nothing"),)', "x is of 'nothing'; expected navigation, truth, control"),
    ],
)
def test_what_is_not_declared_rightly_is_refused(tmp_path: Path, wrong: str, message: str) -> None:
    path = written(tmp_path)
    (tmp_path / "part.py").write_text(CODE + f"    {wrong}\n")
    with pytest.raises(CampaignError, match=message):
        simulate(read_campaign(path), tmp_path / "run", None, 1)
