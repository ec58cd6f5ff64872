"""A number that its own check refuses: that answer is withheld, in one line, and the rest is computed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from mcnav.analysis import gates
from mcnav.analysis.linear_answer import judge_linearly
from mcnav.analysis.requirements import Requirement
from mcnav.analysis.vector_sizes import linear_sizes
from mcnav.config.read import parse_campaign
from mcnav.errors import NumericalError
from mcnav.statistics import proportions, refusals
from mcnav.statistics.gates import GatedError
from mcnav.statistics.normal_size import NormalSize
from mcnav.studies.linear_covariance import linear_covariance


@pytest.fixture
def _planes_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the check of sizes in a plane refuse; that of a line goes on."""

    def refuse(law: NormalSize, size: float) -> None:
        if len(law.variances) > 1:
            raise NumericalError(f"two ways to compute the size {size:g} disagree")
        return quantile(law, size)

    quantile = NormalSize.quantile
    monkeypatch.setattr(NormalSize, "quantile", refuse)
    monkeypatch.setattr(refusals, "_said", [])


@pytest.mark.usefixtures("_planes_refused")
def test_one_requirement_is_withheld_and_the_other_judged(capsys: pytest.CaptureFixture[str]) -> None:
    """The command ended at the first, without a word of the second."""
    both = Requirement("r95", (0, 1), (5.03,), 0.95)
    alone = Requirement("quantile", (0,), (2.0,), 0.95)
    plane, line = judge_linearly([both, alone], np.zeros(2), np.diag([1.02, 4.07]), None)
    assert not plane.judged
    assert not plane.met
    assert line.met
    assert line.value == pytest.approx(1.959964 * math.sqrt(1.02), rel=1e-6)
    note, *others = capsys.readouterr().err.splitlines()
    assert note.startswith("note: two ways to compute the size 0.95 disagree; mcnav states no result")
    assert not others


@pytest.mark.usefixtures("_planes_refused")
def test_what_does_not_need_the_refused_number_is_stated() -> None:
    (size,) = linear_sizes({2: (0, 1)}, np.array([5.1, 0.0]), np.diag([0.03, 1.07]))
    assert math.isnan(size.median)
    assert math.isnan(size.most)
    assert size.sigma == pytest.approx(math.sqrt(1.1))
    assert 0.99 < size.three_sigma_probability < 1.0


def _once_measured() -> dict[str, Any]:
    """Describe an altitude of 5 m that is measured once with 2 m behind a gate, and its requirement."""
    return {
        "samples": 100,
        "scenario": {"type": "ins", "trajectory": {
            "rate": "1 Hz", "start": {"latitude": "47 deg", "longitude": "9 deg", "altitude": "500 m"},
            "segments": [{"hold": "10 s"}],
        }},
        "imu": {},
        "errors": {"position_down": "5 m", "position_north": "1 mm"},
        "aiding": [{"type": "altimeter", "instants": ["10 s"], "altitude": "2 m"}],
        "filter": {"estimates": ["position", "velocity", "attitude"], "gate": 0.99},
        "accept": {"quantile": [{"output": "position_down", "probability": 0.99, "below": "6 m"}]},
    }  # fmt: skip


@pytest.mark.parametrize("refused", ["check_stopped", "unnoticed_beyond"])
def test_the_answer_of_gates_is_withheld_and_the_covariance_stated(
    refused: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The whole command ended where one probability of a gate was refused."""

    def refuse(*_: Any) -> None:
        raise NumericalError("a probability of a gate is refused")

    monkeypatch.setattr(refusals, "_said", [])
    monkeypatch.setattr(gates if refused == "check_stopped" else GatedError, refused, refuse)
    answer = linear_covariance(parse_campaign(_once_measured(), "mine.toml", "mine"))
    assert answer.sigma[2] == pytest.approx(1.8570, abs=5e-5)
    assert answer.gates == ()
    (required,) = answer.requirements
    assert required.judged == (refused == "check_stopped")  # its exact law needs the other
    assert not required.met
    assert capsys.readouterr().err.count("a probability of a gate is refused") == 1


def test_bounds_that_do_not_compute_back_are_zero_and_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(proportions.special, "betaincinv", lambda *_: 0.5)
    assert proportions.probability_interval(3, 100, 0.95) == (0.0, 1.0)
