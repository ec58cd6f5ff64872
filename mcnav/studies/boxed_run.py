"""The setting of a box at which a campaign with ranges is simulated, varied or changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

from mcnav.analysis.box import Box, Setting
from mcnav.config.documents import Description, Document, document_of
from mcnav.config.overrides import parse_document
from mcnav.config.read import Campaign
from mcnav.errors import CampaignError, Problem
from mcnav.execution.progress import note
from mcnav.execution.threads import one_thread
from mcnav.report.statements.box import setting_words, simulated_at
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
        setting, chosen, place = boxed.setting(boxed.upper), replace(campaign, ranges=()), "at the upper ends"
    else:
        setting = _box(boxed).tightest
        chosen, place = boxed.at(setting, overrides), "at the worst setting by linear analysis"
    return replace(chosen, remarks=(simulated_at(place, setting),))


def at_worst(campaign: Description, varied: Sequence[str] = ()) -> tuple[Document, tuple[str, ...]]:
    """Return a campaign at the worst setting of its ranges, without ranges, and what is to be said of that.

    The filter believes the upper ends unless the campaign states something else. Without ranges it is the same.

    Parameters
    ----------
    varied : sequence of str
        Keys that a study varies itself: their ranges are at the upper ends where the setting is sought.

    Raises
    ------
    CampaignError
        When the campaign has no linear model.
    """
    document = document_of(campaign)
    kept = tuple(spec for spec in document.ranges if not any(_within(spec.path, key) for key in varied))
    if not kept:
        return replace(document, ranges=()), ()
    document = replace(document, ranges=kept)
    boxed = BoxedCampaign(replace(parse_document(document, {}), ranges=kept), document)
    if not boxed.ranges:
        return replace(document, ranges=()), ()
    box = _box(boxed)
    return boxed.document_at(box.tightest), (_worst_words(boxed, box),)


def noted_at_worst(campaign: Description, varied: Sequence[str] = ()) -> Document:
    """Return what `at_worst` does, and note what is to be said of it."""
    document, remarks = at_worst(campaign, varied)
    for remark in remarks:
        note(remark)
    return document


def campaign_at_worst(campaign: Description) -> Campaign:
    """Read a campaign at the worst setting of its ranges, and note what is to be said of it."""
    return parse_document(noted_at_worst(campaign), {})


def _within(path: str, key: str) -> bool:
    return f"{path}.".startswith(f"{key}.") or f"{key}.".startswith(f"{path}.")


def _box(boxed: BoxedCampaign) -> Box:
    with one_thread():
        return answer_box(boxed.nominal, answer_linearly(boxed.nominal), boxed)


def _worst_words(boxed: BoxedCampaign, box: Box) -> str:
    """Say at which setting ranges are, and whether it is the worst for everything."""
    setting: Setting = box.tightest
    where = ", the upper ends" if setting == boxed.setting(boxed.upper) else f": {setting_words(setting)}"
    spreads = [*box.requirements, *box.outputs]
    elsewhere = sum(spread.worst.setting != setting for spread in spreads if spread.worst.value != spread.best.value)
    of = "of the tightest requirement" if box.about is not None else "of the output that depends the most on them"
    other = f"; another is worse for {elsewhere} of {len(spreads)} requirements and outputs, see mcnav lincov"
    return f"ranges are at the worst setting {of} by linear analysis{where}{other if elsewhere else ''}"
