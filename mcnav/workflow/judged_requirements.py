"""Requirements of a run, judged by its samples and by linear analysis."""

from __future__ import annotations

from dataclasses import dataclass

from mcnav.analysis.comparison import Comparison
from mcnav.analysis.exceedance import Event, weigh
from mcnav.analysis.linear_range import BeyondRange
from mcnav.analysis.requirements import LEVELS, METHOD, Exceedance, Requirement, RequirementResult, judge_requirement
from mcnav.analysis.requirements_over_time import ErrorHistories, judge_over_time
from mcnav.arrays.types import Array, IndexArray
from mcnav.store.summaries import STORED_ROWS
from mcnav.workflow.linear_extremes import explain
from mcnav.workflow.stored_run import StoredRun


@dataclass(frozen=True)
class Judge:
    """Numbers by which requirements are judged."""

    run: StoredRun
    comparison: Comparison
    histories: ErrorHistories | None
    smoothed_histories: ErrorHistories | None
    beyond: BeyondRange | None

    def result(self, requirement: Requirement) -> RequirementResult:
        """Judge a requirement, and add what linear analysis says of it."""
        confidence, outputs, blocks = self.run.criterion.confidence, self.run.samples.outputs, self.run.blocks
        if requirement.epochs:
            histories = self.smoothed_histories if requirement.of else self.histories
            result = judge_over_time(requirement, histories, confidence)
            if histories is not None and max(requirement.epochs) < len(histories.times):
                result = self._with_exceedance(result, requirement, histories.errors, histories.blocks)
        else:
            most = STORED_ROWS if self.run.summary is not None else None
            result = judge_requirement(
                requirement, self.run.model.end, outputs, blocks, self.comparison, confidence, most
            )
            result = self._with_exceedance(result, requirement, outputs, blocks)
        return explain(result, self.run.model, self.beyond)

    def _with_exceedance(
        self, result: RequirementResult, requirement: Requirement, outcomes: Array, blocks: IndexArray
    ) -> RequirementResult:
        """Add what flights chosen with the linear model say of a requirement, where there are some."""
        number, model = self.run.requirements.index(requirement), self.run.model.end
        for record in self.run.manifest.model.exceedance or ():
            if record.requirement == number:
                exceedance = Exceedance(
                    record.estimate, record.low, record.high, record.flights, record.refusal, record.way, record.sides,
                    record.power, LEVELS if record.by_levels else METHOD,
                )  # fmt: skip
                origin = model.origin
                if requirement.epochs:
                    origin = None if self.histories is None else self.histories.origin
                event, confidence = Event.of(requirement, model.sizes, origin), self.run.criterion.confidence
                return weigh(result, exceedance, event, outcomes, blocks, confidence)
        return result
