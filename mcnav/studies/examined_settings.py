"""Examination of linear analysis at some settings of a campaign: what sweeps, allocations, remedies and live pages ask.

One function lies below all of them, `Examiner.examine`. Settings are examined one after another, the first that matter
most, as long as all of them together take less than the answers that they examine, and only where the simulator is
compiled; ``--examine`` examines them in any case.
"""

from __future__ import annotations

import math
from time import perf_counter
from typing import Final

import numpy as np

from mcnav.analysis.examination import Examination
from mcnav.analysis.linear_range import find_beyond, limits_of
from mcnav.analysis.model import Model
from mcnav.config.read import Campaign
from mcnav.errors import CampaignError
from mcnav.execution.threads import one_thread
from mcnav.linear.refusals import scenario_errors
from mcnav.studies.examine import examine_campaign
from mcnav.studies.linear_answers import end_model

COSTLY: Final = "it would take longer than the answers"


class Examiner:
    """Examines settings within a limit of time.

    Parameters
    ----------
    examine : bool or None
        Whether settings are examined; with none, where that takes less than their answers.
    seconds : float
        What they may take, by default of callers what their answers have taken.
    expected : float
        What the first is expected to take, s; of others that is what the one before took.

    Attributes
    ----------
    reason : str
        Why a setting was not examined, a clause; empty where all were, or nobody asked, or errors are beyond the range
        of linear analysis, which answers say themselves.
    """

    def __init__(self, examine: bool | None, seconds: float, expected: float = 0.0) -> None:
        self._asked = examine is not False
        self._left = math.inf if examine else seconds
        self._last = 0.0 if examine else expected
        self.reason = ""

    @property
    def open(self) -> bool:
        """Return whether a further setting is examined, as far as time tells; where it is not, `reason` says so."""
        if self._asked and self._left <= self._last:
            self.reason = COSTLY
        return self._asked and self._left > self._last

    def examine(self, campaign: Campaign, model: Model | None = None) -> Examination | None:
        """Examine a setting, whose linear model may be known; none where it is not examined, `reason` says why."""
        if not self.open:
            return None
        began = perf_counter()
        answer = self._examine(campaign, model)
        self._last = perf_counter() - began
        self._left -= self._last
        if isinstance(answer, str):
            self.reason = answer
            return None
        return answer

    def _examine(self, campaign: Campaign, model: Model | None) -> Examination | str | None:
        try:
            with one_thread(), scenario_errors(campaign.file):
                model = end_model(campaign, campaign.scenario.linear().end) if model is None else model
                sigma = np.sqrt(np.maximum(np.diag(model.outcome_covariance), 0.0))
                limits = limits_of(output.limit for output in campaign.scenario.outputs)
                if find_beyond(limits, model.outcome_mean, sigma, None) is not None:
                    return None
                return examine_campaign(campaign, model, self._left)
        except CampaignError as wrong:
            return str(wrong.problems[0])
