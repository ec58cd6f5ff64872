"""A judged record: how sure its verdict is, and what is farthest off."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.judgement.findings import CauseVerdict
from mcnav.judgement.profile import Factor
from mcnav.judgement.verdict import Judgement
from mcnav.report.pages.judged import verdict


def cause(name: str, value: float, low: float, high: float) -> CauseVerdict:
    return CauseVerdict(name, "", 1.0, "m", "m", Factor(value, low, high), 1.0, None, (), ())


def judged(unusual: int, simulated: int, *causes: CauseVerdict) -> list[str]:
    """Return the sentences below the verdict on a record with so many simulated ones as unusual."""
    share = (unusual + 1.0) / (simulated + 1.0)
    said = verdict(Judgement(60.0, 100, simulated, share, (), (), (), causes, (), (), np.zeros((0, 9))))
    return [str(sentence) for sentence in said.sentences]


@pytest.mark.parametrize(("unusual", "simulated"), [(8, 200), (14, 200)])
def test_few_records_that_do_not_decide_ask_for_more(unusual: int, simulated: int) -> None:
    """By Clopper and Pearson 8 of 200 are 1.7 to 7.7 %, which says nothing of a level of 5 %; nor do 14."""
    told = judged(unusual, simulated)[1]
    assert told.endswith("at 95 % confidence: judge again with --records 2000.")
    assert ("1.7 to 7.7 %" in told) == (unusual == 8)


@pytest.mark.parametrize(("unusual", "simulated"), [(0, 200), (1, 1000), (200, 1000)])
def test_records_that_decide_ask_for_nothing(unusual: int, simulated: int) -> None:
    assert not any("--records" in sentence for sentence in judged(unusual, simulated))


def test_the_size_whose_interval_is_farthest_off_is_named() -> None:
    walk, noise = cause("gyro_angle_random_walk", 3.8, 1.25, 7.51), cause("gnss_position_noise", 1.02, 0.99, 1.05)
    said = judged(0, 200, noise, walk)
    assert "Farthest off is gyro angle random walk, 3.80 times (1.25 to 7.51)." in said
    assert not any(sentence.startswith("Farthest") for sentence in judged(0, 200, noise))
