"""Linear answer for a box of campaigns: the worst and the best over all settings of its ranges.

The filter of every setting is that of the nominal campaign. A variance is then linear in the square of a size, so that
the corners are extreme in the sizes of independent errors without a mean: their answers are those of the nominal
campaign with its covariances multiplied (`mcnav.analysis.resized_answers`), which two answers by the engine examine.
All other ranges are searched (`mcnav.analysis.box_search`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter
from typing import Final

import numpy as np

from mcnav.analysis.box import Box, BoxFilter, Extreme, Narrowed, Spread
from mcnav.analysis.box_search import Maxima, Point, grid
from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.analysis.linear_covariance import LinearCovariance
from mcnav.analysis.linear_filter import LinearVerdict
from mcnav.analysis.resized_answers import judged, requirement_value, resize
from mcnav.arrays.types import Array
from mcnav.config.data_sheet import DataSheetNumber, owners_of
from mcnav.config.overrides import ALL_AXES, SIZES
from mcnav.config.ranges import SpecRange
from mcnav.config.read import Campaign
from mcnav.execution.progress import duration, note
from mcnav.studies.boxed_campaign import BoxedCampaign, Values
from mcnav.studies.boxed_gates import with_gates
from mcnav.studies.linear_answers import answer_linearly, judge_filter_of
from mcnav.studies.shared_derivatives import SharedDerivatives

MOST: Final = 200
"""Points of a search by resized answers, after which it refines no more."""

MANY: Final = 50
SLOW: Final = 5.0
"""Linear systems, and seconds, from which on they are said beforehand."""

REFINED: Final = 7, 0.2
NARROWED: Final = 6
OVERRUN: Final = 1.5
"""Linear systems that refinement is expected to need, at least and as a share of those of the grid; those of each range
to find what it matters; and how many times as many as are expected are computed at most."""

SAME: Final = 1e-6
"""Relative difference of sigmas up to which resized answers are those of the engine."""

HALF: Final = 0.5
"""Place in the ranges at which resized answers are examined, besides all lower ends."""

INNER: Final = 3
"""Values of half a range that are looked at where it is not monotone."""

SIZED: Final = tuple(name for name in SIZES if name != "value")
"""Keys whose value is proportional to a sigma."""


def answer_box(
    campaign: Campaign, nominal: LinearAnswer, boxed: BoxedCampaign | None = None, filter_alone: bool = False
) -> Box:
    """Answer for all settings of a campaign with ranges.

    Parameters
    ----------
    nominal : LinearAnswer
        That of the campaign itself, in which each range is at its upper end.
    boxed : BoxedCampaign, optional
        Its settings, where they are known already.
    filter_alone : bool
        Whether the search is refined for the ratio of the filter alone.
    """
    boxed = boxed or BoxedCampaign(campaign)
    return with_gates(_Study(boxed, nominal, filter_alone).box(), boxed, nominal)


@dataclass(frozen=True)
class _Sized:
    """Sources and processes whose sigmas are proportional to a range."""

    sources: tuple[int, ...]
    processes: tuple[str, ...]
    monotone: bool


class _Answers:
    """Linear answers at settings; each linear system is computed once."""

    def __init__(self, boxed: BoxedCampaign, nominal: LinearAnswer) -> None:
        self._boxed, self._nominal = boxed, nominal
        self._derivatives = SharedDerivatives(boxed.nominal)
        self.sized = [
            _sized(spec, number, boxed, nominal) for spec, number in zip(boxed.ranges, boxed.numbers, strict=True)
        ]
        self._systems: dict[Values, LinearAnswer] = {boxed.upper: nominal}
        self._known: dict[Values, LinearAnswer] = {}
        self.examined = 0
        if any(self.sized) and not self._examine():
            self.sized = [None] * len(self.sized)

    @property
    def systems(self) -> int:
        """Linear systems that were computed, that of the nominal campaign among them."""
        return len(self._systems) + self.examined

    @property
    def settings(self) -> int:
        """Settings that were answered."""
        return len({*self._known, *self._systems})

    def at(self, values: Values) -> LinearAnswer:
        """Return the answer at a setting."""
        if values not in self._known:
            self._known[values] = self._resized(values)
        return self._known[values]

    def _resized(self, values: Values) -> LinearAnswer:
        upper = self._boxed.upper
        anchor = tuple(high if sized else value for value, high, sized in zip(values, upper, self.sized, strict=True))
        if anchor not in self._systems:
            self._systems[anchor] = self._computed(anchor)
        answer = self._systems[anchor]
        if anchor == values:
            return answer
        scales, squares = np.ones(len(answer.sources)), dict[str, float]()
        for value, high, sized in zip(values, upper, self.sized, strict=True):
            if sized is not None:
                scales[list(sized.sources)] *= value / high
                squares |= dict.fromkeys(sized.processes, (value / high) ** 2)
        covariance = answer.model.covariance * np.outer(scales, scales)
        return resize(answer, answer.model.mean, covariance, squares)

    def _computed(self, values: Values) -> LinearAnswer:
        """Compute the linear system of a setting."""
        return answer_linearly(self._derivatives.along(self._boxed.at(self._boxed.setting(values))))

    def _examine(self) -> bool:
        """Return whether resized answers are those of the engine, at the lower ends of sizes and half-way."""
        boxed = self._boxed
        for share in (0.0, HALF):
            values = tuple(
                spec.span.at(share) if sized else spec.span.high
                for spec, sized in zip(boxed.ranges, self.sized, strict=True)
            )
            self.examined += 1
            if not _same(self.at(values), self._computed(values)):
                self._known.clear()
                return False
        return True


def _same(resized: LinearAnswer, computed: LinearAnswer) -> bool:
    """Return whether two answers have the same sigmas, true and by the filter, at the end and over time."""

    def close(one: Array | None, other: Array | None) -> bool:
        if one is None or other is None:
            return one is other
        least = np.maximum(SAME * np.nanmax(np.abs(other), axis=0, initial=0.0), computed.model.floor)
        return one.shape == other.shape and bool(np.all(np.nan_to_num(np.abs(one - other)) <= least))

    def over_time(one: LinearCovariance | None, other: LinearCovariance | None) -> bool:
        if one is None or other is None:
            return one is other
        return close(one.sigma, other.sigma) and close(one.sigma_filter, other.sigma_filter)

    return (
        close(resized.sigma[None], computed.sigma[None])
        and over_time(resized.history, computed.history)
        and over_time(resized.smoothed, computed.smoothed)
    )


def _sized(
    spec: SpecRange, number: DataSheetNumber | None, boxed: BoxedCampaign, answer: LinearAnswer
) -> _Sized | None:
    """Return what a range sizes; none where it is no size, or one that a mean grows with."""
    if number is None or not spec.span.high > 0.0 or spec.span.low < 0.0:
        return None
    rest = spec.path.removeprefix(number.path).strip(".").split(".") if spec.path != number.path else []
    component = int(rest.pop()) - 1 if rest and isinstance(spec.place[-1], int) else None
    axes = [name for name in rest if any(name in known for known in ALL_AXES)]
    if any(name not in SIZED and name not in axes for name in rest):
        return None

    def places_of(causes: Sequence[str]) -> list[int]:
        owners = owners_of(causes, boxed.sheet)
        return [
            place
            for place, (cause, owner) in enumerate(zip(causes, owners, strict=True))
            if owner is number and (not axes or cause.rpartition("_")[2] == axes[-1])
        ]

    model, names = answer.model, list(answer.model.processes)
    sources = places_of([source.name for source in answer.sources])
    processes = [names[place] for place in places_of(names)]
    if component is not None:  # of a list by axis
        if any(causes and len(causes) <= component for causes in (sources, processes)):
            return None
        sources, processes = sources[component:][:1], processes[component:][:1]
    if not (sources or processes) or np.any(model.mean[sources]):
        return None
    shared = model.covariance - np.diag(np.diag(model.covariance))
    return _Sized(tuple(sources), tuple(processes), not np.any(shared[sources]))


class _Study:
    """A box in the making."""

    def __init__(self, boxed: BoxedCampaign, nominal: LinearAnswer, filter_alone: bool) -> None:
        self._boxed, self._nominal, self._filter_alone = boxed, nominal, filter_alone
        self.answers = _Answers(boxed, nominal)
        sized = self.answers.sized
        self._searched = [place for place, size in enumerate(sized) if size is None or not size.monotone]
        self._verdicts: dict[Values, tuple[LinearVerdict | None, float, float]] = {}

    def box(self) -> Box:
        """Find the extremes of all measures, and which range matters most."""
        asked, outputs = len(self._nominal.requirements), len(self._nominal.outputs)
        spreads = [self._spread(measure) for measure in range(asked + 1 + outputs)]
        requirements, sigmas = spreads[:asked], spreads[asked + 1 :]
        about, output = self._foremost(requirements, sigmas)
        narrowed = () if self._filter_alone else self._narrowed(output + asked + 1 if about is None else about)
        return Box(
            {spec.path: spec.text for spec in self._boxed.nominal.ranges}, tuple(sigmas), tuple(requirements),
            self._of_filter(spreads[asked]), self._exact, self.answers.settings, self.answers.systems,
            self._boxed.held, narrowed, about, output,
        )  # fmt: skip

    @property
    def _exact(self) -> bool:
        """Return whether all is monotone: of several outputs about a mean a quantile need not be."""
        answer = self._nominal
        together = any(row.judged and len(row.requirement.outputs) > 1 for row in answer.requirements)
        means = answer.mean if answer.history is None else answer.history.mean
        return not self._searched and not (together and np.any(means))

    @cached_property
    def _maxima(self) -> Maxima:
        """The search of all ranges that are not monotone."""
        points = grid(len(self._searched))
        unsized = [number for number, place in enumerate(self._searched) if self.answers.sized[place] is None]
        distinct = {tuple(point[number] for number in unsized): point for point in points}
        least = len(distinct)
        narrowed = 0 if self._filter_alone else NARROWED * len(unsized)
        expected = least + max(REFINED[0], round(REFINED[1] * least)) + narrowed
        most = int(OVERRUN * expected) - least - narrowed if unsized else MOST
        maxima = Maxima(len(self._searched), self._badness, len(points) + most)
        if unsized:
            maxima.at(points[1])  # it may compute what all others share
            began = perf_counter()
            self._badness(list(distinct.values())[least // 2])  # kept among the answers: points stay in their order
            seconds = (expected - 2) * (perf_counter() - began)
            if expected > MANY or seconds > SLOW:
                note(f"ranges to be searched: {len(unsized)}, with some {expected} linear answers, {duration(seconds)}")
        asked, count = len(self._nominal.requirements), len(self._nominal.requirements) + 1 + len(self._nominal.outputs)
        maxima.search([asked] if self._filter_alone else range(2 * count))
        return maxima

    def _values(self, point: Point, share: float) -> Values:
        """Return a setting: ranges that are searched at a point, all others at a share of their way."""
        shares = dict(zip(self._searched, point, strict=True))
        return tuple(spec.span.at(shares.get(place, share)) for place, spec in enumerate(self._boxed.ranges))

    def _badness(self, point: Point) -> Array:
        """Compute at a point what is to be as large as possible: each measure at its worst, and its best negated."""
        worst, best = self._measures(self._values(point, 1.0), 1), self._measures(self._values(point, 0.0), 2)
        return np.concatenate([np.nan_to_num(worst, nan=np.inf), -np.nan_to_num(best, nan=np.inf)])

    def _measures(self, values: Values, ratio: int) -> Array:
        """Compute measures of a setting, larger ones being worse: requirements, a ratio of the filter, sigmas."""
        answer = self.answers.at(values)
        requirements = [self._requirement(answer, number) for number in range(len(answer.requirements))]
        return np.array([*requirements, self._filter(values)[ratio], *answer.sigma])

    def _requirement(self, answer: LinearAnswer, number: int) -> float:
        """Return the value of a requirement, of a probability the other way round; NaN where it cannot be judged."""
        row = self._nominal.requirements[number]
        if not row.judged:
            return math.nan
        value = requirement_value(answer, number)
        return -value if row.requirement.kind == "box" else value

    def _filter(self, values: Values) -> tuple[LinearVerdict | None, float, float]:
        """Judge the filter at a setting; the largest ratio of true to computed sigma, and the smallest."""
        if values not in self._verdicts:
            answer, campaign, verdict = self.answers.at(values), self._boxed.nominal, None
            if answer.history is not None and self._nominal.filter is not None:
                verdict = judge_filter_of(answer, [answer.history], campaign.scenario, campaign.tolerance)
            ratios = np.zeros(0) if verdict is None else np.column_stack([verdict.ratios, *verdict.groups.values()])
            ratios = ratios[~np.isnan(ratios)]
            high, low = (float(ratios.max()), float(ratios.min())) if ratios.size else (math.nan, math.nan)
            self._verdicts[values] = verdict, high, low
        return self._verdicts[values]

    def _spread(self, measure: int) -> Spread:
        """Return the extremes of a measure."""
        count = len(self._nominal.requirements) + 1 + len(self._nominal.outputs)
        return Spread(self._extreme(measure, measure), self._extreme(count + measure, measure))

    def _extreme(self, function: int, measure: int) -> Extreme:
        is_best = function != measure
        point, _ = self._maxima.largest(function)
        values = self._values(point, 0.0 if is_best else 1.0)
        value = float(self._measures(values, 2 if is_best else 1)[measure])
        requirements = self._nominal.requirements
        if measure < len(requirements) and requirements[measure].requirement.kind == "box":
            value = -value
        return Extreme(value, self._boxed.setting(values))

    def _of_filter(self, ratio: Spread) -> BoxFilter | None:
        """Return the verdicts on the filter where its ratio is largest and smallest."""
        verdicts = [
            self._filter(tuple(spec.span.value_of(extreme.setting[spec.path]) for spec in self._boxed.ranges))[0]
            for extreme in (ratio.worst, ratio.best)
        ]
        if verdicts[0] is None or verdicts[1] is None:
            return None
        return BoxFilter(ratio, verdicts[0], verdicts[1])

    def _foremost(self, requirements: Sequence[Spread], sigmas: Sequence[Spread]) -> tuple[int | None, int]:
        """Return the number of the tightest requirement, and of the output that depends the most on the ranges."""
        floor = self._nominal.model.floor
        spans = [
            spread.worst.value / max(spread.best.value, least) if spread.worst.value > least > 0.0 else 0.0
            for spread, least in zip(sigmas, floor, strict=True)
        ]
        output = int(np.argmax(spans))
        margins = {}
        for number, (spread, row) in enumerate(zip(requirements, self._nominal.requirements, strict=True)):
            if row.judged and not math.isnan(spread.worst.value):
                values = tuple(spec.span.value_of(spread.worst.setting[spec.path]) for spec in self._boxed.ranges)
                margins[number] = judged(self.answers.at(values))[number].margin
        return (min(margins, key=lambda number: margins[number]) if margins else None), output

    def _narrowed(self, measure: int) -> tuple[Narrowed, ...]:
        """Find what it would gain to know each range to a factor of two, the others being as in the worst setting."""
        point, worst = self._maxima.largest(measure)
        at = self._values(point, 1.0)
        rows = [row for place in range(len(at)) if (row := self._narrow(measure, worst, at, place)) is not None]
        return tuple(sorted(rows, key=lambda row: -row.gain))

    def _narrow(self, measure: int, worst: float, at: Values, place: int) -> Narrowed | None:
        """Find the half of a range with the least worst value."""
        spec = self._boxed.ranges[place]
        low, high = spec.span.low, spec.span.high
        middle = 0.5 * (low + high)
        halves = [(low, min(2.0 * low, middle) if low > 0.0 else middle)]
        if place in self._searched:
            halves.append((max(0.5 * high, middle) if high > 0.0 else middle, high))
        rows = []
        for begin, end in halves:
            looked = np.linspace(begin, end, INNER) if place in self._searched else [end]
            found = max(
                float(self._measures((*at[:place], float(f"{value:.12g}"), *at[place + 1 :]), 1)[measure])
                for value in looked
            )
            if math.isfinite(found) and math.isfinite(worst) and worst:
                rows.append((found, begin, end))
        if not rows:
            return None
        least, begin, end = min(rows)
        written = spec.span.written
        shown = -least if measure < len(self._nominal.requirements) and worst < 0.0 else least
        return Narrowed(spec.path, written(begin), written(end), shown, (worst - least) / abs(worst))
