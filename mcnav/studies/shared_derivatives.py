"""Derivatives of a closed loop along its nominal, computed once for campaigns that differ in sizes alone."""

from __future__ import annotations

from dataclasses import replace

from mcnav.config.read import Campaign
from mcnav.systems.closed_loop.scenario import ClosedLoopScenario


class SharedDerivatives:
    """Campaigns whose derivatives others may use again, for linear answers."""

    def __init__(self, *campaigns: Campaign) -> None:
        self._known = [campaign.scenario for campaign in campaigns if isinstance(campaign.scenario, ClosedLoopScenario)]

    def along(self, campaign: Campaign) -> Campaign:
        """Return a campaign that uses known derivatives where its scenario can; otherwise it joins the known ones."""
        scenario = campaign.scenario
        if not isinstance(scenario, ClosedLoopScenario):
            return campaign
        for earlier in self._known:
            tuned = scenario.along(earlier)
            if tuned is not scenario:
                return replace(campaign, scenario=tuned)
        self._known.append(scenario)
        return campaign
