"""What good measurements that gates reject do to linear analysis, of a scenario and its errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.analysis.rejections import OnLinear, RejectionAnswer, judge_by_flights, judge_rejections
from mcnav.arrays.types import IndexArray
from mcnav.config.campaign import Campaign
from mcnav.contract.gates import RejectionLaws
from mcnav.contract.scenario import Scenario, has_gates
from mcnav.report.columns.gates import rejection_line
from mcnav.report.format import number
from mcnav.sampler.error_model import ErrorModel

READINGS: Final = 5
"""Epochs at which rejections of good measurements are looked at, and as many of those of requirements."""

FEWEST_SEEN: Final = 30
"""Samples with a rejection from which these show what follows one: an error rarer than that is not seen."""

FLIGHTS: Final = 4_000
"""Flights that begin with a rejection where they are asked for."""

FEW_FLIGHTS: Final = 1_000
"""Where they are not, and a flight has a rejection at most on average: samples seldom see what follows one."""


@dataclass(frozen=True)
class DoubtAboutGates:
    """Remarks of a run on rejections of good measurements.

    Attributes
    ----------
    doubt : str or None
        As `doubt_about_gates` returns it.
    unseen : tuple of str
        What rejections do that too few of its samples have for them to show it.
    """

    doubt: str | None
    unseen: tuple[str, ...]

    @classmethod
    def of(cls, campaign: Campaign) -> DoubtAboutGates:
        """Judge the gates of a campaign, with flights where rejections are rare."""
        scenario = campaign.scenario
        _, rejections = rejections_of(scenario, campaign.errors, campaign.tolerance, fly=None)
        doubt = doubt_about_gates(rejections, scenario)
        if not doubt or rejections is None or rejections.accepted_by_all is None:
            return cls(doubt, ())
        seen = campaign.samples * (1.0 - rejections.accepted_by_all)
        if seen >= FEWEST_SEEN:
            return cls(doubt, ())
        words = f"about {number(seen, 2)} of {campaign.samples:,} have a rejection"
        return cls(doubt, (f"{doubt}. These samples cannot show it: {words}",))


def rejections_of(
    scenario: Scenario, errors: ErrorModel, tolerance: float, epochs: Sequence[int] = (), fly: bool | None = False
) -> tuple[RejectionLaws | None, RejectionAnswer | None]:
    """Judge what good measurements that gates reject do, at the end and at epochs; none without a gate.

    Parameters
    ----------
    tolerance : float
        Of the ratio of an rms to that of linear analysis.
    epochs : sequence of int
        Of requirements, rising.
    fly : bool, optional
        Whether flights that begin with a rejection answer what laws leave open; with none, where rejections are rare.
    """
    if not has_gates(scenario):
        return None, None
    times = scenario.reading_times
    chosen = np.unique(np.concatenate([_some(range(len(times))), _some(epochs)]))
    laws = scenario.rejection_laws(errors.mean, errors.covariance, times[chosen])
    if laws is None:
        return None, None
    answer = judge_rejections(laws, scenario.outputs, tolerance)
    rare = answer.expected_least is not None and answer.expected_least <= 1.0
    count = FLIGHTS if fly else FEW_FLIGHTS if fly is None and rare else 0
    return laws, judge_by_flights(answer, laws, scenario.outputs, tolerance, count) if count else answer


def doubt_about_gates(rejections: RejectionAnswer | None, scenario: Scenario) -> str | None:
    """Say what rejections of good measurements do where linear analysis does not hold for them.

    Empty where it holds, none without a gate.
    """
    if rejections is None:
        return None
    if rejections.verdict == OnLinear.HOLDS:
        return ""
    return rejection_line(rejections, [output.name for output in scenario.outputs])


def _some(numbers: Sequence[int]) -> IndexArray:
    """Return at most `READINGS` of rising numbers, the first and the last among them."""
    places = np.linspace(0, len(numbers) - 1, min(READINGS, len(numbers))).round().astype(int)
    return np.array([numbers[place] for place in places], dtype=np.int64)
