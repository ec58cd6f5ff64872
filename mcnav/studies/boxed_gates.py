"""Gates in a box of campaigns: requirements are withheld where rejections of good measurements leave them open."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from mcnav.analysis.box import Box, BoxFilter, Extreme, Setting, Spread
from mcnav.analysis.filter_consistency import Honesty
from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.analysis.linear_filter import LinearVerdict
from mcnav.analysis.rejections import OnLinear
from mcnav.studies.boxed_campaign import BoxedCampaign
from mcnav.studies.linear_answers import answer_linearly


def with_gates(box: Box, boxed: BoxedCampaign, nominal: LinearAnswer) -> Box:
    """Return a box as gates let it be judged: at the upper ends, and where requirements and the filter are worst.

    Sizes of errors over the ranges leave rejections out. They are those of flights where linear analysis holds with
    gates at all these settings; elsewhere the box names the first setting at which it does not.
    """
    if nominal.rejections is None:
        return box
    upper, answered = boxed.setting(boxed.upper), 0
    for setting in _extreme(box, upper):
        answer = nominal if setting == upper else answer_linearly(boxed.at(setting))
        answered += setting != upper
        if answer.rejections is None or answer.rejections.verdict != OnLinear.HOLDS:
            return replace(_withheld(box), gated=setting, systems=box.systems + answered)
    return replace(box, systems=box.systems + answered)


def _extreme(box: Box, upper: Setting) -> Iterator[Setting]:
    """Yield the settings at which rejections matter the most, each once."""
    settings = [upper, *(spread.worst.setting for spread in box.requirements), box.tightest]
    if box.filter is not None:
        settings.append(box.filter.ratio.worst.setting)
    for place, setting in enumerate(settings):
        if setting not in settings[:place]:
            yield setting


def _withheld(box: Box) -> Box:
    """Return a box without values of requirements, and with no filter that is consistent."""

    def unknown(extreme: Extreme) -> Extreme:
        return replace(extreme, value=math.nan)

    def undecided(verdict: LinearVerdict) -> LinearVerdict:
        return replace(verdict, verdict=Honesty.UNDECIDED) if verdict.verdict == Honesty.CONSISTENT else verdict

    filtered = box.filter
    return replace(
        box, about=None, narrowed=box.narrowed if box.about is None else (),
        requirements=tuple(Spread(unknown(spread.worst), unknown(spread.best)) for spread in box.requirements),
        filter=None if filtered is None else BoxFilter(
            filtered.ratio, undecided(filtered.optimistic), undecided(filtered.pessimistic)
        ),
    )  # fmt: skip
