"""Requirements of a run, judged by its samples and by linear analysis."""

from __future__ import annotations

from dataclasses import dataclass

from mcnav.analysis.comparison import Comparison, Criterion, Model
from mcnav.analysis.exceedance import Event, weigh
from mcnav.analysis.linear_range import BeyondRange
from mcnav.analysis.requirements import LEVELS, METHOD, Exceedance, Requirement, RequirementResult, judge_requirement
from mcnav.analysis.requirements_over_time import ErrorHistories, judge_over_time
from mcnav.arrays.types import Array, IndexArray
from mcnav.store.manifest import Manifest
from mcnav.store.summaries import STORED_ROWS, SUMMARY
from mcnav.workflow.linear_extremes import explain


@dataclass(frozen=True)
class Judge:
    """Numbers by which requirements are judged."""

    manifest: Manifest
    requirements: tuple[Requirement, ...]
    model: Model
    criterion: Criterion
    comparison: Comparison
    outputs: Array
    blocks: IndexArray
    histories: ErrorHistories | None
    smoothed_histories: ErrorHistories | None
    beyond: BeyondRange | None

    def result(self, requirement: Requirement) -> RequirementResult:
        """Judge a requirement, and add what linear analysis says of it."""
        confidence = self.criterion.confidence
        if requirement.epochs:
            histories = self.smoothed_histories if requirement.of else self.histories
            result = judge_over_time(requirement, histories, confidence)
            if histories is not None and max(requirement.epochs) < len(histories.times):
                result = self._with_exceedance(result, requirement, histories.errors, histories.blocks)
        else:
            most = STORED_ROWS if self.manifest.store == SUMMARY else None
            result = judge_requirement(
                requirement, self.model, self.outputs, self.blocks, self.comparison, confidence, most
            )
            result = self._with_exceedance(result, requirement, self.outputs, self.blocks)
        return explain(result, self.manifest.model, self.model, self.beyond)

    def _with_exceedance(
        self, result: RequirementResult, requirement: Requirement, outcomes: Array, blocks: IndexArray
    ) -> RequirementResult:
        """Add what flights chosen with the linear model say of a requirement, where there are some."""
        number = self.requirements.index(requirement)
        for record in self.manifest.model.exceedance or ():
            if record.requirement == number:
                exceedance = Exceedance(
                    record.estimate, record.low, record.high, record.flights, record.refusal, record.way, record.sides,
                    record.power, LEVELS if record.by_levels else METHOD,
                )  # fmt: skip
                origin = self.model.origin
                if requirement.epochs:
                    origin = None if self.histories is None else self.histories.origin
                event, confidence = Event.of(requirement, self.model.sizes, origin), self.criterion.confidence
                return weigh(result, exceedance, event, outcomes, blocks, confidence)
        return result
