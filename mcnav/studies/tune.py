"""Tuning: what a filter is to believe so that it is consistent or pessimistic at every setting of a box.

Beliefs start at the upper ends. A Gauss-Markov process whose correlation time is a range is believed with several
correlation times, and with the sigma at which no setting is optimistic; beside them stands the bounding model

    sigma^2 tau_max / tau_min      initial 2 sigma^2 / (1 + tau_min / tau_max)      correlation time tau_max

of Langel, Garcia Crespillo and Joerger (NAVIGATION 68(2), 2021). Where that is not enough, or nothing is such a
process, sensor sigmas, process noise, initial sigmas or all of them are inflated. Candidates are tried at a few
settings; the whole box is searched for the cheapest, and a setting that it does not bound joins the few.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from time import perf_counter
from typing import Any, Final, Literal

import numpy as np

from mcnav.analysis.box import Box, Setting
from mcnav.analysis.examination import Linearity, combine
from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.analysis.tuning import ROUNDING, Candidate, TunedBelief, Tuning, bounding_model
from mcnav.config.data_sheet import DataSheetNumber, round_up
from mcnav.config.documents import Description, document_of
from mcnav.config.overrides import Value, override, parse_document
from mcnav.config.ranges import SpecRange
from mcnav.config.read import Campaign, campaign_from
from mcnav.errors import CampaignError, Problem
from mcnav.execution.progress import SILENT, Phase, Progress
from mcnav.execution.threads import one_thread
from mcnav.files.whole import indented_json, to_json, write_texts
from mcnav.physics.units import UnitError, multiplied, parted
from mcnav.report.document.html import page_html
from mcnav.report.pages import tune as tables
from mcnav.runner.executors import JOBS
from mcnav.studies.box import answer_box
from mcnav.studies.boxed_campaign import BoxedCampaign
from mcnav.studies.examined_settings import Examiner
from mcnav.studies.linear_answers import answer_linearly
from mcnav.studies.shared_derivatives import SharedDerivatives
from mcnav.studies.simulated_campaigns import samples_of, simulated

FILE: Final = "tune.json"
PAGE: Final = "tune.html"

Measure = Literal["requirement", "sigma"]

BELIEFS: Final = "filter.believes"

SHARES: Final = (1.0, 0.75, 0.5)
"""Places of believed correlation times in their ranges."""

MOST_INFLATION: Final = 100.0
GROWTH: Final = 1.3
STEPS: Final = 12
"""Largest inflation, by how much faster each next one grows, and how many are tried for a candidate."""

CLOSE: Final = 1.003
"""Ratio of two inflations between which none is tried any more."""

SEARCHES: Final = 3
"""Times that the whole box is searched."""

GROUPS: Final[Mapping[str, tuple[str, ...]]] = {
    "sensor sigmas": ("aiding.", "measurements."),
    "process noise": ("imu.", "processes.", "gravity."),
    "initial sigmas": ("errors.",),
    "all sigmas": ("aiding.", "measurements.", "imu.", "processes.", "gravity.", "errors."),
}
"""Numbers of a data sheet that are inflated together, by the beginnings of their paths."""


def tune(
    campaign: Description, measure: Measure | None = None, confirm: bool = True, samples: int | None = None,
    jobs: int = JOBS, progress: Progress = SILENT, examine: bool | None = None,
) -> Tuning:  # fmt: skip
    """Find what a filter is to believe so that it is consistent or pessimistic at every setting of a box.

    Parameters
    ----------
    campaign : str, Path, Campaign or mapping
        With ranges.
    measure : str, optional
        What is to cost little: the worst value of the tightest requirement over its limit, or the mean filter sigma at
        the end; by default the requirement, where there is one.
    confirm : bool
        Whether samples are simulated at the setting at which the filter is closest to being optimistic.
    samples : int, optional
        By default those of the campaign.
    jobs : int
        Processes that simulate them.
    progress : Progress
        Where it is told how far the study is; silent by default.
    examine : bool, optional
        Whether flights examine linear analysis with what is chosen; by default where that is quick.

    Raises
    ------
    CampaignError
        When the campaign has no ranges, or no filter whose beliefs it states.

    Examples
    --------
    >>> import mcnav as mc
    >>> mc.tune("campaigns/40_range_with_a_drift.toml", confirm=False).believes  # doctest: +SKIP
    {'processes': {'drift': {'sigma': '2.02 m', 'correlation_time': '200.0 s'}}}
    >>> mc.tune({"scenario": {"type": "reentry", "trajectory": 1}, "errors": {"altitude": "1..5 km"}})
    Traceback (most recent call last):
    ...
    mcnav.errors.CampaignError: campaign: filter: this campaign has no filter to tune
    """
    progress.phase(Phase.PREPARING, note="linear answers of filters")
    began = perf_counter()
    with one_thread():
        study = _Study(campaign_from(campaign), measure)
        tuning = study.tuned()
    if tuning.chosen is None:
        return tuning
    boxed = study.boxed(tuning.chosen.beliefs)
    tuning = _examined(tuning, boxed, Examiner(examine, perf_counter() - began))
    if not confirm:
        return tuning
    count = samples or samples_of(study.nominal)
    summary = simulated(boxed.at(tuning.worst), count, jobs, progress)
    verdict = "" if summary.filter is None else str(summary.filter.verdict)
    return replace(tuning, confirmed=verdict, samples=count)


def _examined(tuning: Tuning, boxed: BoxedCampaign, examiner: Examiner) -> Tuning:
    """Examine linear analysis where the chosen filter is closest to optimistic, and at the upper ends."""
    verdicts, upper = list[Linearity](), boxed.setting(boxed.upper)
    for setting in (tuning.worst, upper) if tuning.worst != upper else (upper,):
        examined = examiner.examine(boxed.at(setting))
        if examined is not None:
            verdicts.append(examined.verdict_on(range(len(examined.outputs))))
    return replace(tuning, linearity=combine(verdicts).value if verdicts else "", unexamined=examiner.reason)


@dataclass(frozen=True)
class _Markov:
    """A Gauss-Markov process whose correlation time is a range."""

    number: DataSheetNumber
    time: SpecRange

    def believed(self, share: float, factor: float) -> TunedBelief:
        """Believe it with a correlation time at a share of its range, and a sigma times a factor."""
        written = str(self.time.span.written(self.time.span.at(share)))
        entry = {"sigma": multiplied(_size(self.number), factor), "correlation_time": written}
        return TunedBelief(self.number.path, entry, factor, f"its correlation time is {self.time.span}")

    @property
    def bounding(self) -> TunedBelief:
        """The bounding model."""
        span = self.time.span
        model = bounding_model(1.0, span.low, span.high)
        entry = {
            "sigma": multiplied(_size(self.number), model.sigma),
            "correlation_time": str(span.written(span.high)),
        }
        if self.number.path.startswith("processes."):  # other tables have no sigma at the start
            entry["initial"] = multiplied(_size(self.number), model.initial)
        return TunedBelief(self.number.path, entry, model.sigma, f"it bounds correlation times of {span}")


class _Study:
    """A tuning in the making."""

    def __init__(self, campaign: Campaign, measure: Measure | None) -> None:
        self.nominal, self._document = campaign, document_of(campaign)
        self._plain = BoxedCampaign(campaign)
        if not self._plain.ranges:
            message = 'has no ranges to tune for; give one such as bias = "0.5..2 deg/h" (mcnav docs howto-ranges)'
            raise CampaignError([Problem(campaign.file, "", message)])
        self._answer = answer_linearly(campaign)
        if self._answer.filter is None:
            raise CampaignError([Problem(campaign.file, "filter", "this campaign has no filter to tune")])
        judged = [row for row in self._answer.requirements if row.judged]
        if measure == "requirement" and not judged:
            raise CampaignError([Problem(campaign.file, "accept", "no requirement can be judged; use --cost sigma")])
        self._measure: Measure = measure or ("requirement" if judged else "sigma")
        self._active = self._first_settings()
        self._known: dict[str, tuple[float, float]] = {}
        self._derivatives = SharedDerivatives()

    def tuned(self) -> Tuning:
        """Try candidates, and search the box with the cheapest."""
        before = self._tried("as it is", ()).ratio
        candidates = self._candidates()
        box: Box | None = None
        for _ in range(SEARCHES):
            bounding = [candidate for candidate in candidates if candidate.ratio <= 1.0 + ROUNDING]
            if not bounding:
                break
            chosen = min(bounding, key=lambda candidate: candidate.cost)
            box = self._box(chosen.beliefs)
            assert box.filter is not None
            worst = box.filter.ratio.worst
            if worst.value <= 1.0 + ROUNDING:
                return self._result(before, replace(chosen, ratio=worst.value), candidates, box, worst.setting)
            self._active.append(worst.setting)
            candidates = self._candidates()
        return self._result(before, None, candidates, None, self._active[-1])

    def boxed(self, beliefs: Sequence[TunedBelief]) -> BoxedCampaign:
        """Return the box with beliefs stated."""
        values: dict[str, Value] = {f"{BELIEFS}.{belief.path}": _value(belief.entry) for belief in beliefs}
        document = replace(self._document, content=override(self._document.content, values, self._document.file))
        nominal = replace(parse_document(document, {}), ranges=document.ranges)
        return BoxedCampaign(nominal, document)

    def _box(self, beliefs: Sequence[TunedBelief]) -> Box:
        boxed = self.boxed(beliefs)
        return answer_box(boxed.nominal, answer_linearly(boxed.nominal), boxed, filter_alone=True)

    def _first_settings(self) -> list[Setting]:
        """Return settings that are looked at first: all ranges but correlation times at their upper ends."""
        plain = self._plain
        shares = sorted({1.0, *((0.0, 0.5) if self._markov else ())}, reverse=True)
        times = {process.time.path for process in self._markov}
        return [
            plain.setting([spec.span.at(share if spec.path in times else 1.0) for spec in plain.ranges])
            for share in shares
        ]

    @cached_property
    def _markov(self) -> list[_Markov]:
        """Gauss-Markov processes that the filter believes, of a correlation time that is a range."""
        return [
            _Markov(number, spec)
            for spec, number in zip(self._plain.ranges, self._plain.numbers, strict=True)
            if number is not None and spec.path in self._plain.held and spec.path.endswith(".correlation_time")
        ]

    def _candidates(self) -> list[Candidate]:
        """Try all candidates at the settings that are looked at."""
        tried = [self._inflated("as it is", lambda _: (), False)]
        if self._markov:
            for share in SHARES:
                times = ", ".join(
                    f"{process.time.span.at(share):.3g} {process.time.span.unit}" for process in self._markov
                )
                tried.append(self._inflated(f"correlation time {times}", self._with_memory(share), True))
            tried.append(self._tried("bounding model", [process.bounding for process in self._markov]))
        if not any(candidate.ratio <= 1.0 + ROUNDING for candidate in tried):
            tried += [self._inflated(name, self._group(begins), True) for name, begins in GROUPS.items()
                      if self._group(begins)(2.0)]  # fmt: skip
        return tried

    def _with_memory(self, share: float) -> Any:
        return lambda factor: tuple(process.believed(share, factor) for process in self._markov)

    def _group(self, begins: tuple[str, ...]) -> Any:
        """Return beliefs of a group of numbers as a function of the factor that they are inflated by."""
        numbers = [number for number in self._plain.sheet if number.path.startswith(begins) and _is_sized(number)]
        why = "errors that the filter does not model make it optimistic"
        return lambda factor: tuple(
            TunedBelief(number.path, _inflated_entry(number, factor), factor, why) for number in numbers
        )

    def _inflated(self, name: str, beliefs_at: Any, inflate: bool) -> Candidate:
        """Find the least inflation with which no setting that is looked at is optimistic."""
        best = self._tried(name, beliefs_at(1.0))
        if best.ratio <= 1.0 + ROUNDING or not inflate:
            return best
        low, high, factor = 1.0, math.inf, best.ratio
        for step in range(STEPS):
            factor = min(round_up(factor), MOST_INFLATION)
            candidate = self._tried(name, beliefs_at(factor))
            if candidate.ratio <= 1.0 + ROUNDING:
                best, high = candidate, factor
            else:
                low = factor
                best = candidate if math.isinf(high) else best
            if high <= low * CLOSE or low >= MOST_INFLATION:
                break
            factor = math.sqrt(low * high) if math.isfinite(high) else factor * max(candidate.ratio, GROWTH**step)
        return best

    def _tried(self, name: str, beliefs: Sequence[TunedBelief]) -> Candidate:
        """Compute the largest ratio, and the cost, at the settings that are looked at."""
        boxed, ratios, costs = self.boxed(beliefs), list[float](), list[float]()
        for setting in self._active:
            key = f"{beliefs}{setting}"
            if key not in self._known:
                answer = answer_linearly(self._derivatives.along(boxed.at(setting)))
                assert answer.filter is not None
                self._known[key] = answer.filter.largest[0], self._cost(answer)
            ratios.append(self._known[key][0])
            costs.append(self._known[key][1])
        return Candidate(name, tuple(beliefs), max(ratios), max(costs))

    def _cost(self, answer: LinearAnswer) -> float:
        if self._measure == "requirement":
            return max(1.0 / row.margin for row in answer.requirements if row.judged and row.margin > 0.0)
        return _mean_ratio(_stated(answer), _stated(self._answer))

    def _result(
        self, before: float, chosen: Candidate | None, candidates: Sequence[Candidate], box: Box | None, worst: Setting
    ) -> Tuning:
        known = math.nan
        if chosen is not None:
            true = answer_linearly(self.boxed(chosen.beliefs).at(worst))
            known = _mean_ratio(true.sigma, answer_linearly(self._plain.at(worst, held=False)).sigma)
        words = {
            "requirement": "worst value of the tightest requirement over its limit",
            "sigma": "mean filter sigma at the end, over that of a filter that believes the upper ends",
        }[self._measure]
        return Tuning(self.nominal.name, words, before, chosen, tuple(candidates), box, known, worst)


def write_tuning(tuning: Tuning, path: Path) -> list[Path]:
    """Write a tuning as ``tune.json`` and a page."""
    files = {FILE: indented_json(to_json(tables.table(tuning))) + "\n", PAGE: page_html(tables.page(tuning))}
    return write_texts(path, files)


def _stated(answer: LinearAnswer) -> Any:
    assert answer.history is not None
    assert answer.history.sigma_filter is not None
    return answer.history.sigma_filter[-1]


def _mean_ratio(one: Any, other: Any) -> float:
    """Return the mean of ratios that are known."""
    known = np.isfinite(one) & np.isfinite(other) & (np.nan_to_num(other) > 0.0)
    return float(np.mean(one[known] / other[known]))


def _is_sized(number: DataSheetNumber) -> bool:
    try:
        _size(number)
    except (UnitError, KeyError, TypeError):
        return False
    return True


def _size(number: DataSheetNumber) -> str:
    """Return the sigma of a number that has one for all axes, as text."""
    entry: Any = number.entry
    text = entry if isinstance(entry, str) else entry["sigma"]
    parted(text)
    return str(text)


def _inflated_entry(number: DataSheetNumber, factor: float) -> str | Mapping[str, str]:
    """Return what is believed of a number with its sigma times a factor."""
    sigma = multiplied(_size(number), factor)
    if isinstance(number.entry, dict) and not number.path.startswith("errors."):
        return {**{key: str(value) for key, value in number.entry.items()}, "sigma": sigma}
    return sigma


def _value(entry: str | Mapping[str, str]) -> Value:
    return entry if isinstance(entry, str) else dict(entry)
