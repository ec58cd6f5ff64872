"""Derivatives of a closed loop along its nominal, computed once for campaigns that differ in sizes alone."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from mcnav.config.read import Campaign
from mcnav.contract.scenario import Scenario, runs_user_code

if TYPE_CHECKING:
    from mcnav.systems.closed_loop.scenario import ClosedLoopScenario


class SharedDerivatives:
    """Campaigns whose derivatives others may use again, for linear answers.

    Parameters
    ----------
    near : bool
        Whether only campaigns do whose differences have steps of the same order.
    """

    def __init__(self, *campaigns: Campaign, near: bool = True) -> None:
        self._near = near
        loops = (loop_of(campaign.scenario) for campaign in campaigns)
        self._known = [loop for loop in loops if loop is not None]

    def along(self, campaign: Campaign) -> Campaign:
        """Return a campaign that uses known derivatives where its scenario can; otherwise it joins the known ones."""
        scenario = loop_of(campaign.scenario)
        if scenario is None:
            return campaign
        for earlier in self._known:
            tuned = scenario.along(earlier, self._near)
            if tuned is not scenario:
                return replace(campaign, scenario=tuned)
        self._known.append(scenario)
        return campaign


def loop_of(scenario: Scenario) -> ClosedLoopScenario | None:
    """Return a scenario that is a closed loop; none where it is another."""
    if not runs_user_code(scenario):
        return None
    from mcnav.systems.closed_loop.scenario import ClosedLoopScenario  # which campaigns without code do not need

    return scenario if isinstance(scenario, ClosedLoopScenario) else None
