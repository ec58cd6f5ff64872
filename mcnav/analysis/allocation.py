"""Changes of a data sheet's numbers with which requirements are just met, and the multiples at which that is."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from mcnav.analysis.linear_answer import LinearAnswer, LinearRequirement
from mcnav.analysis.requirements import Finding
from mcnav.analysis.simulated_requirements import Basis
from mcnav.analysis.summary import RequirementEntry
from mcnav.errors import NumericalError
from mcnav.statistics.bisection import Place, root_between, smallest_reaching

MOST: Final = 1_000.0
"""Largest multiple of a number that is looked at."""

STRIDE: Final = 10.0
"""Ratio of successive multiples in the search for one at which a goal is not met."""

POWERS: Final = (0.05, 4.0)
"""Powers of a multiple with which errors may grow: 2 where they add up, less where a filter's gains change."""

LADDER: Final = (*(4.0**power for power in range(-4, 5)), MOST)
"""Multiples, besides the least, that are looked at where none below one is known to meet a goal."""

NARROW: Final = 0.02
"""Width, as a logarithm, to which the multiple of the largest margin is found."""

LEAST: Final = 1e-3
"""Multiple that stands for none where a number cannot be zero."""

PRECISION: Final = 1e-4
"""Relative width to which a multiple is found; proposed numbers have three digits."""

MOST_TRIALS: Final = 60
"""Multiples tried before the search for one ends."""

OTHERS: Final = "other changes are by linear analysis alone"
"""Reason why flights have examined only the campaign as it is and the change that the answer states first."""


@dataclass(frozen=True)
class NumberChange:
    """Change of one number, or of several by the same factor, with which a goal is just met.

    Attributes
    ----------
    label : str
        Such as ``imu.gyro.bias``, or ``all numbers``.
    paths : tuple of str
        Keys that change.
    now, needed : str
        The number; empty for several, and where no change is found.
    factor : float
        Needed over present size: above one where the number has to grow. Infinite where the goal is met at any size up
        to `MOST` times the present one, NaN where it is not met by this change alone, smaller or larger.
    closest : float
        Where the goal is not met: multiple of the largest margin among those looked at, which ``result`` is of.
    result : LinearRequirement
        Requirement with the least margin, by a linear answer computed with the needed number; with a `Basis` its value
        is the linear one times the scale of the basis.
    simulated : RequirementEntry or None
        The requirement of the goal with the least margin as samples of the changed campaign show it; none where the
        change was not simulated.
    linearity : str
        Whether linear analysis holds then: ``holds``, ``does not hold``, ``cannot say``; empty where no flight has
        examined it.
    swept : str
        Values of a sweep of its key, from the present one to that needed. Empty where no sweep makes the same change:
        of several numbers, of axes, and of a distribution with more than its size to change.
    """

    label: str
    paths: tuple[str, ...]
    now: str
    needed: str
    factor: float
    closest: float
    result: LinearRequirement
    simulated: RequirementEntry | None = None
    linearity: str = ""
    swept: str = ""

    @property
    def reached(self) -> bool:
        """Return whether the goal is met by this change alone."""
        return not math.isnan(self.factor)


@dataclass(frozen=True)
class Goal:
    """Requirements to be met together.

    Attributes
    ----------
    requirements : tuple of int
        Their numbers in the campaign, from zero.
    met : bool
        Whether they are met now, so that numbers may be loosened.
    changes : tuple of NumberChange
        The smallest change first.
    unconfirmed : tuple of str
        Labels of changes that are not among them, because simulation did not confirm them.
    """

    requirements: tuple[int, ...]
    met: bool
    changes: tuple[NumberChange, ...]
    unconfirmed: tuple[str, ...] = ()

    def stated(self, changes: Sequence[NumberChange]) -> NumberChange | None:
        """Return the one of some of its changes that an answer states first; none where none has a finite multiple.

        Where the goal is met that is the one of most numbers together, else the smallest.
        """
        finite = [change for change in changes if change.reached and 0.0 < change.factor < math.inf]
        if self.met:
            return max(finite, key=lambda change: len(change.paths), default=None)
        return min(finite, key=lambda change: abs(math.log(change.factor)), default=None)


@dataclass(frozen=True)
class GradeMove:
    """A number at the value of another grade: key, grade, present and new value."""

    path: str
    grade: str
    now: str
    needed: str


@dataclass(frozen=True)
class GradeChange:
    """Numbers moved by one grade of the catalogue, and the requirements then.

    Attributes
    ----------
    worst : LinearRequirement
        Requirement with the least margin.
    simulated : RequirementEntry or None
        The requirement with the least margin as samples show it; none where the change was not simulated.
    linearity : str
        As that of `NumberChange`.
    """

    moves: tuple[GradeMove, ...]
    worst: LinearRequirement
    simulated: RequirementEntry | None = None
    linearity: str = ""

    @property
    def met(self) -> bool:
        """Return whether all requirements are met, by simulation where there is one."""
        return self.worst.met if self.simulated is None else self.simulated.finding == Finding.MET


@dataclass(frozen=True)
class GradeSearch:
    """Changes by one grade.

    Attributes
    ----------
    finer : bool
        Whether numbers move to finer grades to meet the requirements, or to coarser ones that still meet them.
    changes : tuple of GradeChange
        The fewest finer changes that meet all requirements, or each coarser one alone; the largest margin first.
    whole : GradeChange or None
        All numbers moved; none where no grade states another value.
    exhaustive : bool
        Whether no fewer changes do.
    """

    finer: bool
    changes: tuple[GradeChange, ...]
    whole: GradeChange | None
    exhaustive: bool


@dataclass(frozen=True)
class Allocation:
    """Numbers that would meet a campaign's requirements.

    Attributes
    ----------
    answer : LinearAnswer
        Of the campaign as it is.
    numbers : int
        Numbers of its data sheet.
    goals : tuple of Goal
        Each requirement that is not met, and all of them together; where all are met, that they stay so.
    grades : GradeSearch or None
        None of a campaign without inertial measurement unit.
    computed : int
        Linear answers that were computed.
    basis : Basis or None
        Simulation of the campaign as it is, which scales linear answers; none where they stand alone.
    linearity : str
        Whether linear analysis holds of the campaign as it is; as that of `NumberChange`.
    unexamined : str
        Why flights have not examined all changes, a clause; empty where they have, or nobody asked.
    """

    answer: LinearAnswer
    numbers: int
    goals: tuple[Goal, ...]
    grades: GradeSearch | None
    computed: int
    basis: Basis | None = None
    linearity: str = ""
    unexamined: str = ""


def worst_of(requirements: Sequence[LinearRequirement], goal: Sequence[int]) -> LinearRequirement:
    """Return the requirement of a goal with the least margin; one that linear analysis cannot judge comes first."""
    return min((requirements[number] for number in goal), key=lambda each: (not math.isnan(each.margin), each.margin))


def critical_multiple(
    margin: Callable[[float], float], least: float = 0.0, rounded: Callable[[float], float] | None = None
) -> float:
    """Find the multiple of an error at which a margin becomes one.

    The square of a size over its limit, ``1 / margin^2``, is linear in the square of the multiple where errors add up;
    regula falsi (Illinois) in these is then exact at once. Where a filter's gains change it grows as another power,
    which three multiples give.

    Parameters
    ----------
    margin : callable
        Margin of a goal at a multiple; at least one where it is met. NaN beyond multiples that can be computed.
    least : float
        Smallest multiple to be looked at.
    rounded : callable, optional
        Rounds a multiple down to one that can be proposed: the search ends with the last one below the root.

    Returns
    -------
    float
        The largest multiple found at which the goal is met, within `PRECISION`, or `NARROW` where larger ones have no
        margin; infinite where it is met up to `MOST`, NaN where it is not met at ``least``.

    Examples
    --------
    >>> round(critical_multiple(lambda multiple: 2.0 / multiple), 3)
    2.0
    >>> 98.0 < critical_multiple(lambda multiple: 9e9 if multiple < 100.0 else math.nan) < 100.0
    True
    """

    def excess(multiple: float) -> float:
        result = margin(multiple)
        return math.nan if math.isnan(result) else 1.0 / result**2 - 1.0

    at_one = excess(1.0)
    if at_one <= 0.0:
        met, beyond = _first_beyond(excess, at_one)
        if beyond is not None:
            return _root(excess, met, beyond, rounded)
        return math.inf if met[0] == MOST else met[0]
    at_least = excess(least)
    return _root(excess, (least, at_least), (1.0, at_one)) if at_least <= 0.0 else math.nan


def nearest_multiple(margin: Callable[[float], float], least: float = 0.0) -> tuple[float, float]:
    """Find a multiple with which a goal that is not met now is just met: a smaller one, or else a larger one.

    Errors that add up are smallest at the least multiple. With a filter the margin may have its maximum elsewhere:
    gains follow from the numbers, and larger ones may suit the errors that the filter neglects. Where the least
    multiple does not meet the goal, the `LADDER` is looked at, and the surroundings of its best rung by golden section.

    Parameters
    ----------
    margin, least
        As for `critical_multiple`; the margin at one is below one.

    Returns
    -------
    multiple : float
        Just met with it; NaN where no multiple looked at meets the goal.
    closest : float
        Of the largest margin looked at where none meets it, otherwise the same as ``multiple``.

    Examples
    --------
    >>> round(nearest_multiple(lambda multiple: 1.0 / (0.5 + multiple))[0], 3)
    0.5
    >>> round(nearest_multiple(lambda multiple: (0.1 + multiple) / 3.1)[0], 3)
    3.0
    >>> nearest_multiple(lambda multiple: 0.9 / (1.0 + multiple))
    (nan, 0.0)
    """
    multiple = critical_multiple(margin, least)
    if not math.isnan(multiple):
        return multiple, multiple
    known = {each: _number(margin(each)) for each in (least, *LADDER)}
    met = [each for each, value in known.items() if value >= 1.0]
    if not met:
        met = _climb(margin, known)
    if not met:
        highest = max(known.values())
        return math.nan, next(each for each, value in known.items() if value >= highest * (1.0 - 1e-9))
    nearest = min(met, key=lambda each: abs(math.log(each)))
    if nearest < 1.0:
        multiple = critical_multiple(margin, nearest)
    else:
        unmet = max(each for each in known if 1.0 <= each < nearest)
        low, high = ((math.log(each), _shortfall(known[each])) for each in (unmet, nearest))
        _, end = root_between(lambda place: _shortfall(margin(math.exp(place))), low, high, PRECISION)
        multiple = min(math.exp(end), nearest)
    return multiple, multiple


def _shortfall(margin: float) -> float:
    """Return a margin on a logarithmic scale, above zero where the goal is not met."""
    return -math.log(margin) if margin > 0.0 else math.inf


def _number(value: float) -> float:
    return -math.inf if math.isnan(value) else value


def _climb(margin: Callable[[float], float], known: dict[float, float]) -> list[float]:
    """Look for the largest margin around the best rung until one meets the goal; return that, and extend ``known``."""
    rungs = sorted(known)
    place = max(range(len(rungs)), key=lambda each: known[rungs[each]])
    if place in (0, len(rungs) - 1) or rungs[place - 1] == 0.0:
        return []
    low, high = math.log(rungs[place - 1]), math.log(rungs[place + 1])
    golden = 0.5 * (math.sqrt(5.0) - 1.0)
    inner = [high - golden * (high - low), low + golden * (high - low)]
    values = [_number(margin(math.exp(each))) for each in inner]
    while True:
        for each, value in zip(inner, values, strict=True):
            known[math.exp(each)] = value
            if value >= 1.0:
                return [math.exp(each)]
        if high - low <= NARROW:
            return []
        if values[0] >= values[1]:
            high, inner[1], values[1] = inner[1], inner[0], values[0]
            inner[0] = high - golden * (high - low)
            values[0] = _number(margin(math.exp(inner[0])))
        else:
            low, inner[0], values[0] = inner[0], inner[1], values[1]
            inner[1] = low + golden * (high - low)
            values[1] = _number(margin(math.exp(inner[1])))


def _first_beyond(
    excess: Callable[[float], float], at_one: float
) -> tuple[tuple[float, float], tuple[float, float] | None]:
    """Find two multiples from one on between which a goal ceases to be met, with their excess.

    The second one is none where the goal is met up to `MOST`, or up to where linear answers end, within `NARROW`.
    """
    met, multiple, ends = (1.0, at_one), 1.0, math.inf
    while met[0] < MOST and ends > met[0] * (1.0 + NARROW):
        multiple = min(STRIDE * met[0], MOST) if math.isinf(ends) else math.sqrt(met[0] * ends)
        beyond = excess(multiple)
        if math.isnan(beyond):
            ends = multiple
        elif beyond > 0.0:
            return met, (multiple, beyond)
        else:
            met = multiple, beyond
    return met, None


def _root(
    excess: Callable[[float], float], met: Place, unmet: Place, rounded: Callable[[float], float] | None = None
) -> float:
    """Close in on a root between a multiple at which a goal is met and a larger one at which it is not."""
    (low, at_low), (high, at_high) = met, unmet
    weight_low, weight_high, side, known = at_low, at_high, 0, [met, unmet]
    proposed = math.nan
    for _ in range(MOST_TRIALS):
        if high - low <= PRECISION * high or -PRECISION <= at_low <= 0.0:
            break
        square = high**2 - weight_high * (high**2 - low**2) / (weight_high - weight_low)
        multiple = math.sqrt(max(square, 0.0))
        if len(known) > 2 and low < (crossing := _crossing_of_a_power(met, *known[-2:])) < high:
            multiple = crossing
            if rounded is not None:
                proposed = rounded(crossing)
                if proposed == low:
                    break
                multiple = proposed if low < proposed else crossing
        edge = 0.1 * PRECISION * (multiple or high)
        if rounded is None or multiple != proposed:
            multiple = min(max(multiple - edge, low + edge), high - edge)  # a hair on the side where the goal is met
        root = excess(multiple)
        known.append((multiple, root))
        if root <= 0.0:
            low, at_low, weight_low = multiple, root, root
            weight_high = 0.5 * weight_high if side < 0 else at_high
            side = -1
        else:
            high, at_high, weight_high = multiple, root, root
            weight_low = 0.5 * weight_low if side > 0 else at_low
            side = 1
    return low


def _crossing_of_a_power(first: Place, *others: Place) -> float:
    """Find where ``y = a + b x^p`` through three points is zero; NaN where there is no such power within `POWERS`.

    >>> _crossing_of_a_power((1.0, -1.5), (3.0, 3.0**1.5 - 2.5), (2.0, 2.0**1.5 - 2.5)) - 2.5 ** (2 / 3) < 1e-12
    True
    """
    (x, at), (near, at_near), (far, at_far) = first, *sorted(others)
    if not x < near < far or not at < at_near < at_far:
        return math.nan

    def ratio(power: float) -> float:
        quotient: float = (far**power - x**power) / (near**power - x**power)
        return quotient

    try:
        power = smallest_reaching(ratio, (at_far - at) / (at_near - at), *POWERS)
    except NumericalError:
        return math.nan
    growth = (at_near - at) / (near**power - x**power)
    crossing: float = max(x**power - at / growth, 0.0) ** (1.0 / power)
    return crossing
