"""Sentences on a box of campaigns, whose specs are ranges."""

from __future__ import annotations

import math
import re
from typing import Final

from mcnav.analysis.box import Box, Narrowed, Setting, Spread
from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.analysis.requirements import Requirement, size_probability
from mcnav.physics.units import UnitError, parted
from mcnav.report.format import rounded
from mcnav.report.names import humanize, scale_of

NAMED: Final = 3
"""Values of a setting that a sentence names."""

MATTERS: Final = 0.005
"""Smallest gain that is named."""

RANGED: Final = "the campaign has ranges; it is simulated "


def shown_entry(entry: str | int | float) -> str:
    """Shorten a value of a campaign file to three digits.

    >>> shown_entry("0.0123456789 deg/h"), shown_entry(84.0)
    ('0.0123 deg/h', '84.0')
    """
    try:
        number, unit = parted(str(entry))
    except UnitError:
        return str(entry)
    return f"{rounded(number)} {unit}".rstrip()


def setting_words(setting: Setting, most: int | None = None) -> str:
    """Name the values of a setting, the first of them alone where there are more than some.

    >>> setting_words({"imu.gyro.bias": "2.0 deg/h", "errors.heading": "1.0 mrad"}, 1)
    'imu.gyro.bias = 2.00 deg/h and 1 more'
    """
    named = [f"{path} = {shown_entry(value)}" for path, value in setting.items()]
    if most is None or len(named) <= most:
        return ", ".join(named)
    return f"{', '.join(named[:most])} and {len(named) - most} more"


def simulated_at(place: str, setting: Setting) -> str:
    """Say at which setting of its ranges a campaign is simulated, as a remark on its run.

    >>> simulated_at("at the upper ends", {"errors.heading": "1.0 mrad"})
    'the campaign has ranges; it is simulated at the upper ends: errors.heading = 1.00 mrad'
    """
    return f"{RANGED}{place}: {setting_words(setting)}"


def simulated_in_brief(warning: str) -> str:
    """Shorten the warning of such a remark to its first value; empty for other warnings.

    >>> remark = simulated_at("at the upper ends", {"imu.gyro.bias": "2.0 deg/h", "errors.heading": "1.0 mrad"})
    >>> simulated_in_brief(f"Warning: {remark}."), simulated_in_brief("Warning: a kink.")
    ('Simulated at the upper ends: imu.gyro.bias = 2.00 deg/h and 1 more.', '')
    """
    _, remark, place = warning.rstrip(".").partition(RANGED)
    values = re.split(r", (?=[\w.]+ = )", place)
    more = f" and {len(values) - 1} more" if len(values) > 1 else ""
    return f"Simulated {values[0]}{more}." if remark else ""


def is_met(requirement: Requirement, value: float) -> bool:
    """Return whether a value of a requirement meets it."""
    if requirement.kind == "box":
        return value >= size_probability(requirement)
    return value < requirement.limits[0]


def box_words(answer: LinearAnswer) -> list[tuple[str, str]]:
    """List what is to be said of the ranges of a campaign, in sentences with their tones; nothing without any."""
    box = answer.box
    if box is None or not box.varies:
        return []
    words = [(_extremes(answer, box), _tone(answer, box))]
    if box.gated is not None:
        words.insert(0, (_gated(box.gated), "undecided"))
    if box.filter is not None:
        high, low = box.filter.ratio.worst.value, box.filter.ratio.best.value
        tone = "differs" if high > 1.0 + box.filter.optimistic.tolerance else ""
        words.append((f"Over the ranges, true ÷ filter sigma lies between {rounded(low)} and {rounded(high)}", tone))
    if answer.smoother is not None:
        words.append(("The smoother's sigma was compared with its errors at the upper ends alone", ""))
    return [*words, *((sentence, "") for sentence in (_gain(answer, box), _searched(box), _held(box)) if sentence)]


def _gated(setting: Setting) -> str:
    """Say why no requirement is judged over the ranges."""
    where = setting_words(setting, NAMED)
    return (
        "Over the ranges, requirements need Monte Carlo (mcnav run) and sigmas leave rejections out: gates reject good "
        f"measurements with {where}, and linear analysis is not shown to hold there"
    )


def _extremes(answer: LinearAnswer, box: Box) -> str:
    """Name the best and the worst value of the tightest requirement, or of the output that depends the most."""
    spread, scale, unit = _foremost(answer, box)
    name = f"1σ of {humanize(answer.outputs[box.output].name)}"
    if box.about is not None:
        required = answer.requirements[box.about].requirement
        named = ", ".join(humanize(answer.outputs[place].name) for place in required.outputs)
        name = f"{required.kind.upper() if len(required.kind) == 3 else humanize(required.kind)} of {named}"
    best, worst = _told_apart(spread.best.value * scale, spread.worst.value * scale)
    if best == worst:
        return f"{name[0].upper()}{name[1:]} is {worst} {unit} with any values of the ranges"
    where = setting_words(spread.worst.setting, NAMED)
    return f"Over the ranges, {name} is {best} to {worst} {unit}; worst with {where}"


def _told_apart(one: float, other: float) -> tuple[str, str]:
    """Shorten two numbers to three digits, or to as many more as tell them apart.

    >>> _told_apart(12.13, 19.8), _told_apart(10290.1, 10346.2)
    (('12.1', '19.8'), ('10,290', '10,350'))
    """
    shown = [(rounded(one, digits), rounded(other, digits)) for digits in range(3, 7)]
    return next((pair for pair in shown if pair[0] != pair[1]), shown[0])


def _foremost(answer: LinearAnswer, box: Box) -> tuple[Spread, float, str]:
    """Return what `Box.narrowed` is about, with the factor to the unit shown, and this unit."""
    if box.about is None:
        output = answer.outputs[box.output]
        return box.outputs[box.output], float(scale_of([output])[0]), output.shown_in
    required = answer.requirements[box.about].requirement
    output = answer.outputs[required.outputs[0]]
    in_percent = required.kind == "box"
    scale, unit = (100.0, "%") if in_percent else (float(scale_of([output])[0]), output.shown_in)
    return box.requirements[box.about], scale, unit


def _tone(answer: LinearAnswer, box: Box) -> str:
    rows = zip(answer.requirements, box.requirements, strict=True)
    known = [(row.requirement, spread) for row, spread in rows if not math.isnan(spread.worst.value)]
    return "differs" if any(not is_met(requirement, spread.worst.value) for requirement, spread in known) else ""


def _gain(answer: LinearAnswer, box: Box) -> str:
    """Say which range matters most."""
    first: Narrowed | None = next(iter(box.narrowed), None)
    if first is None or first.gain < MATTERS:
        return "No range alone matters: to know one to a factor of two would gain less than 0.5 %"
    between, (spread, scale, unit) = f"{shown_entry(first.low)} to {shown_entry(first.high)}", _foremost(answer, box)
    gained = f"{rounded(abs(spread.worst.value - first.worst) * scale)} {unit}"
    return f"{first.path} matters most: to know that it is {between} would gain {gained}"


def _searched(box: Box) -> str:
    """Say how sure the extremes are."""
    if box.exact:
        return "Exact: every value grows with every range, so that the ends are the extremes"
    return f"The worst of {box.settings:,} settings, searched and refined about the worst; it is no proof"


def _held(box: Box) -> str:
    if not box.held:
        return ""
    named = ", ".join(box.held[:NAMED]) + (f" and {len(box.held) - NAMED} more" if len(box.held) > NAMED else "")
    return f"The filter believes the upper end of {named}: [filter.believes] states nothing else"
