"""A number that its own check refuses: that answer is withheld, in one line, and the rest is computed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mcnav.analysis.linear_answer import judge_linearly
from mcnav.analysis.requirements import Requirement
from mcnav.analysis.vector_sizes import linear_sizes
from mcnav.errors import NumericalError
from mcnav.statistics import refusals
from mcnav.statistics.normal_size import NormalSize


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
