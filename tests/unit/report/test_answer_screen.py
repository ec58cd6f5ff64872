"""A run on one screen of a terminal: verdict, consequence, and the table that shows them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from rich.text import Text

from mcnav.analysis.summary import Summary
from mcnav.arrays.types import Array
from mcnav.report.document.fitted_table import OpenConsole
from mcnav.report.statements.verdicts import statements
from mcnav.report.terminal.answer_screen import screen
from mcnav.workflow.stored_summary import stored_summary
from tests.conftest import ROOT

EXAMPLES = ROOT / "reports" / "examples"
NONE: Mapping[str, Array] = {}


@pytest.fixture(scope="module")
def reentry() -> Summary:
    """Trajectory 4 with 1,000 samples, which leave the full matrix undecided; with 20,000 it differs."""
    return stored_summary(EXAMPLES / "01_tn_d1772_trajectory_4").model_copy(update={"verdict_matrix": "differs"})


def _printed(summary: Summary, seconds: float | None = 1.3) -> str:
    console = OpenConsole(width=80, soft_wrap=True)
    with console.capture() as captured:
        console.print(screen(summary, NONE, seconds, ["Report:   there"]))
    return captured.get()


def _joint(summary: Summary, **keys: Any) -> Summary:
    assert summary.joint is not None
    return summary.model_copy(update={"joint": summary.joint.model_copy(update=keys)})


def _filter(**keys: Any) -> dict[str, Any]:
    ratio = {"sigma_true": 2.0, "sigma_filter": 1.0, "ratio": 2.0, "ratio_interval": [1.8, 2.2],
             "verdict": "optimistic", "factor": 2.5, "factor_interval": [2.1, 3.0], "begin": 1.0, "end": 5.0,
             "worst": 3.0, "samples_needed": None}  # fmt: skip
    names = ("altitude", "range", "altitude_rate", "range_rate")
    departure = {"verdict": "optimistic", "of": "output", "name": "range", "factor": 2.5, "factor_interval": [2.1, 3.0],
                 "begin": 1.0, "end": 5.0, "worst": 3.0}  # fmt: skip
    sensor = {"size": 2, "accepted": 9.0, "rejected": 0.0, "nis_mean": 2.04, "nis_interval": None, "nis_bounds": None,
              "nis_beyond": False, "correlation": None, "correlation_interval": None, "correlation_bound": None,
              "correlation_beyond": False, "verdict": "consistent", "factor": 1.0, "factor_interval": None,
              "samples_needed": None}  # fmt: skip
    return {
        "verdict": "optimistic", "output": "range", "factor": 2.5, "factor_interval": [2.1, 3.0], "time": "time [min]",
        "worst": 3.0, "tolerance": 0.1, "confidence": 0.95, "departures": [departure],
        "neglected": [{"name": "gyro_drift", "true": 1.0, "believed": 0.0, "share": 0.8}],
        "outputs": dict.fromkeys(names, ratio), "sensors": {"gnss": sensor},
    } | keys  # fmt: skip


def test_trajectory_4(reentry: Summary) -> None:
    """The table of five rows, the sentence, and what follows from it; no line is wider than 80."""
    lines = _printed(reentry).splitlines()
    assert lines[0] == "NASA TN D-1772, trajectory 4" + "1,000 samples, 1.3 s".rjust(52)
    assert lines[1] == "PARTLY  Every sigma is right. The full covariance matrix is not."
    assert [line.split()[0] for line in lines[4:9]] == ["altitude", "range", "altitude", "range", "thinnest"]
    assert [line.split()[-1] for line in lines[4:9]] == ["ok"] * 4 + ["DIFFERS"]
    assert "Use the sigmas; do not gate or fuse with the full matrix." in lines
    assert max(map(len, lines)) <= 80
    assert "1,000 samples, stored" in _printed(reentry, None)


def test_the_thinnest_direction_is_called_so_only_where_it_is(reentry: Summary) -> None:
    """A combination along another axis of the ellipsoid has another name: here that of altitude alone."""
    assert reentry.joint is not None
    assert reentry.joint.differing is not None
    alone = reentry.joint.differing.model_copy(update={"shares": [1.0, 0.0, 0.0, 0.0]})
    shown = _printed(_joint(reentry, differing=alone))
    assert "\n  combination " in shown
    assert "thinnest" not in shown


@pytest.mark.parametrize(
    ("keys", "word", "sentence"),
    [
        ({"verdict_matrix": "agrees"}, "YES", "Every sigma is right, and so is the full covariance matrix."),
        ({"verdict_matrix": None}, "YES", "Every sigma is right."),
        ({"verdict_matrix": "undecided"}, "PARTLY",
         "Every sigma is right. The samples do not decide on the full covariance matrix."),
        ({"verdict": "differs", "verdicts": ["agrees", "differs", "agrees", "differs"]}, "NO",
         "The linear sigmas are wrong for range and range rate."),
        ({"verdict": "undecided", "samples_needed": [None, 5_000, None, None]}, "UNDECIDED",
         "The full covariance matrix is wrong. 1,000 samples do not decide on the sigmas."),
        ({"verdict": "undecided", "verdict_matrix": None}, "UNDECIDED",
         "1,000 samples do not decide whether every linear sigma is right."),
    ],
)  # fmt: skip
def test_each_verdict(reentry: Summary, keys: dict[str, Any], word: str, sentence: str) -> None:
    (answer,) = statements(reentry.model_copy(update=keys), NONE)
    assert (answer.word, answer.sentence) == (word, sentence)
    assert _printed(reentry.model_copy(update=keys))


def test_what_is_needed_is_said(reentry: Summary) -> None:
    few = reentry.model_copy(
        update={"verdict": "undecided", "verdict_matrix": None, "samples_needed": [None, 5_000, None, None]}
    )
    assert statements(few, NONE)[0].next_step == "Run about 5,000 samples to decide."


def test_an_optimistic_filter_comes_first(reentry: Summary) -> None:
    """Its worst output with both sigmas, NIS and cause, before the verdict on linear analysis; and its own table."""
    wrong = Summary.of(reentry.to_json() | {"filter": _filter(), "verdict_matrix": "agrees"})
    epochs = {
        "time [min]": np.array([1.0, 3.0]),
        "mean range [m]": np.array([0.0, 1_500.0]),
        "sigma range [m]": np.array([1.0, 2_000.0]),  # 2,500 m about zero
        "filter sigma range [m]": np.array([1.0, 1_000.0]),
    }
    first, second = statements(wrong, epochs)
    assert first.word == "NO"
    assert first.sentence == "Do not trust this filter's covariance: range errors are 2.5 times what it computes."
    assert first.consequences == (
        "Worst: range at 3 min, true 2.5 km, filter 1.0: 2.5 times (95 %: 2.1 to 3.0).",
        "NIS hardly shows it: 2.0 where 2 is expected.",
    )
    assert first.cause == "gyro drift 80 %"
    assert "Cause: gyro drift 80 %." in _printed(wrong)
    assert second.word == "YES"
    assert second.sentence.startswith("Linear covariance predicts every sigma within 0.")
    shown = _printed(wrong)
    assert shown.count("OPTIMISTIC") == 4
    assert "P S P'" not in shown


def test_a_consistent_filter(reentry: Summary) -> None:
    right = Summary.of(reentry.to_json() | {"filter": _filter(verdict="consistent", departures=[])})
    said = [answer.sentence for answer in statements(right, NONE)]
    assert "The filter's covariance is that of its errors, within 10 %." in said
    assert "P S P'" in _printed(right)


def test_words_are_coloured(reentry: Summary) -> None:
    rendered = screen(reentry, NONE, 1.0, []).renderables  # type: ignore[attr-defined]
    assert str(next(each for each in rendered if isinstance(each, Text) and "PARTLY" in each.plain).style)
