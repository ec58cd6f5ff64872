"""The setting of a box at which a campaign with ranges is simulated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal

from mcnav.config.read import Campaign
from mcnav.errors import CampaignError, Problem
from mcnav.execution.threads import one_thread
from mcnav.report.statements.box import setting_words
from mcnav.studies.box import answer_box
from mcnav.studies.boxed_campaign import BoxedCampaign
from mcnav.studies.linear_answers import answer_linearly

At = Literal["worst", "nominal"]
"""Settings that can be simulated: the worst of the tightest requirement, and all upper ends."""


def campaign_to_run(campaign: Campaign, at: At | None, overrides: Mapping[str, Any]) -> Campaign:
    """Return the campaign of the setting that is simulated; one without ranges is itself.

    Parameters
    ----------
    at : str, optional
        By default the worst setting by linear analysis: of the tightest requirement, or without one of the output that
        depends the most on the ranges.
    overrides : mapping
        Top-level entries that replace those of the file.

    Raises
    ------
    CampaignError
        When a setting is asked for and the campaign has no ranges, or has no linear model.
    """
    if not campaign.ranges:
        if at is not None:
            raise CampaignError([Problem(campaign.file, "--at", "the campaign has no ranges; leave it out")])
        return campaign
    boxed = BoxedCampaign(campaign)
    if at == "nominal" or not boxed.ranges:
        setting, chosen, words = boxed.setting(boxed.upper), replace(campaign, ranges=()), "at the upper ends"
    else:
        with one_thread():
            box = answer_box(campaign, answer_linearly(campaign))
        setting = box.tightest
        chosen, words = boxed.at(setting, overrides), "at the worst setting by linear analysis"
    return replace(chosen, remarks=(f"the campaign has ranges; it is simulated {words}: {setting_words(setting)}",))
