"""An analysed run: all that a report shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mcnav.analysis.budget import ErrorBudget
from mcnav.analysis.comparison import Comparison, Criterion
from mcnav.analysis.envelopes import Envelopes, envelopes_from
from mcnav.analysis.failed_samples import FailureBias
from mcnav.analysis.filter_consistency import FilterConsistency
from mcnav.analysis.linear_range import BeyondRange
from mcnav.analysis.model import Model
from mcnav.analysis.remedies import Remedies
from mcnav.analysis.requirement_curves import RequirementCurve, requirement_curve
from mcnav.analysis.requirements import RequirementResult
from mcnav.analysis.requirements_over_time import ErrorHistories
from mcnav.analysis.running_ratios import Convergence
from mcnav.analysis.summary import HigherOrder, Summary
from mcnav.analysis.tail_curves import Curvature, TailCurve, tail_curve
from mcnav.analysis.tails import Quantile
from mcnav.analysis.variance_breakdown import VarianceBreakdown
from mcnav.analysis.vector_sizes import SampledSize
from mcnav.analysis.what_if import WhatIf
from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.history import History
from mcnav.contract.linear import LinearSystem
from mcnav.contract.quantities import EndWords, end_words, kinds_of
from mcnav.report.names import humanize, labels_of, scale_of, unit_words
from mcnav.report.results.summary import summarise
from mcnav.store.chunk_files import Samples
from mcnav.store.manifest import Manifest
from mcnav.store.run_folder import RunFolder


@dataclass(frozen=True)
class RunAnalysis:
    """A run with its samples and all that is concluded from them; what only a report shows is read when it is used.

    Of a run that stores a summary, ``samples`` are the first ones. ``failures`` gives for each reason how many samples
    failed, and the indices of the first of them. ``filter`` is none of a scenario without a filter, ``smoother`` where
    none follows it, and ``beyond`` where linear errors leave the range in which they have a meaning, none where they do
    not. ``what_if`` and ``remedies`` are known where a page is to be written, ``histories`` of the first samples where
    a requirement holds at epochs, and ``smoothed_histories`` where one of those is on the errors behind a smoother.
    """

    folder: RunFolder
    manifest: Manifest
    samples: Samples
    model: Model
    criterion: Criterion
    comparison: Comparison
    budget: ErrorBudget
    causes: VarianceBreakdown | None
    requirements: tuple[RequirementResult, ...]
    convergence: Convergence | None
    tails: tuple[Quantile, ...]
    left_out: FailureBias | None
    failures: Mapping[str, tuple[int, Sequence[int]]]
    filter: FilterConsistency | None = None
    smoother: FilterConsistency | None = None
    beyond: BeyondRange | None = None
    sizes: tuple[SampledSize, ...] = ()
    histories: ErrorHistories | None = None
    smoothed_histories: ErrorHistories | None = None
    what_if: WhatIf | None = None
    remedies: Remedies | None = None

    @cached_property
    def summary(self) -> Summary:
        """The content of ``summary.json``."""
        return summarise(
            self.manifest,
            {reason: count for reason, (count, _) in self.failures.items()},
            self.model,
            self.criterion,
            self.comparison,
            self.causes,
            self.budget,
            self.requirements,
            self.tails,
            self.left_out,
            self.filter,
            self.beyond,
            self.sizes,
            self.smoother,
        )

    @cached_property
    def history(self) -> History:
        """The truth over time."""
        return self.folder.history()

    @cached_property
    def campaign(self) -> str:
        """The resolved campaign file."""
        return self.folder.campaign()

    @cached_property
    def envelopes(self) -> Envelopes | None:
        """Dispersions at every epoch; none where the engine computes no histories."""
        epochs = self.folder.epochs()
        return None if epochs is None else envelopes_from(*epochs, self.manifest.model.to_json()["outputs"])

    @cached_property
    def requirement_curves(self) -> tuple[RequirementCurve | None, ...]:
        """Curve of each requirement that holds at epochs, none of others; empty without histories."""
        if (self.histories is None and self.smoothed_histories is None) or self.beyond is not None:
            return ()
        return tuple(map(self._requirement_curve, self.requirements))

    def _requirement_curve(self, result: RequirementResult) -> RequirementCurve | None:
        requirement = result.requirement
        histories = self.smoothed_histories if requirement.of else self.histories
        if histories is None or not requirement.epochs or max(requirement.epochs) >= len(histories.times):
            return None
        return requirement_curve(requirement, histories, self.criterion.confidence)

    @cached_property
    def tail_curves(self) -> tuple[TailCurve | None, ...]:
        """Probability beyond the limits of each requirement that flights were chosen for; none of others."""
        curvature = Curvature.of_record(self.manifest.model.second_order)
        blocks = self.manifest.sampling_design.blocks(self.samples.index)
        return tuple(
            tail_curve(result.requirement, self.model, curvature, self.outputs, blocks, self.criterion.confidence)
            if result.exceedance is not None and not result.requirement.epochs and self.beyond is None else None
            for result in self.requirements
        )  # fmt: skip

    @property
    def development(self) -> LinearSystem | None:
        """Partial derivatives over time."""
        record = self.manifest.model.development
        return (
            None
            if record is None
            else LinearSystem(record.times, record.partials, processes=record.processes, label=record.label)
        )

    @property
    def time_unit(self) -> str:
        """Unit of the histories' times; empty without any."""
        return "" if self.development is None else self.development.label.partition(" [")[2].removesuffix("]")

    @property
    def outputs(self) -> Array:
        """Final errors, shape (n, outputs), SI; NaN in the rows of failed samples."""
        return self.samples.outputs

    @property
    def index(self) -> IndexArray:
        """Indices of the samples, shape (n,)."""
        return self.samples.index

    @property
    def higher_order(self) -> HigherOrder | None:
        """Moments in closed form, SI; none where there are none: see `mcnav.linear.nonlinear_corrections`."""
        higher_order = self.summary.higher_order
        return None if higher_order is None or higher_order.sigma is None else higher_order

    @property
    def dispersed(self) -> bool:
        """Return whether there is dispersion to show: samples, and an output with a linear sigma that has a meaning."""
        return (
            self.beyond is None
            and bool(self.comparison.outputs)
            and bool(np.any(np.diag(self.comparison.covariance_linear) > 0.0))
        )

    @cached_property
    def moving(self) -> list[int]:
        """The outputs that have any dispersion, by linear analysis or flown."""
        flown = self.flown
        spread = np.ptp(flown, axis=0) if len(flown) else np.zeros(len(self.output_names))
        linear = np.diag(self.comparison.covariance_linear)
        return [i for i in range(len(linear)) if linear[i] > 0.0 or spread[i] > 0.0]

    @property
    def kinds(self) -> list[str]:
        """Kind of each output; empty strings where all are navigation errors."""
        return kinds_of(self.manifest.model.outputs)

    @property
    def ends(self) -> EndWords:
        """Names of the outputs at the end."""
        return end_words(self.manifest.model.outputs)

    @property
    def several_kinds(self) -> bool:
        """True unless all outputs are navigation errors."""
        return any(self.kinds)

    @property
    def looped(self) -> bool:
        """True of a closed loop of the user's: a class of which an output is true dispersion."""
        kind = str(self.manifest.identity.campaign.get("scenario", {}).get("type", ""))
        return ".py:" in kind and any(output.of == "truth" for output in self.manifest.model.outputs)

    @cached_property
    def source_names(self) -> list[str]:
        """Names of the sources for people."""
        return labels_of(self.manifest.model.sources, self.manifest.model.outputs)

    @property
    def cause_names(self) -> list[str]:
        """Names of the sources and, after them, of the processes of noise for people."""
        return [*self.source_names, *(humanize(name) for name in self.model.processes)]

    @property
    def output_names(self) -> list[str]:
        """Names of the outputs for people."""
        return [humanize(output.name) for output in self.manifest.model.outputs]

    @property
    def source_units(self) -> list[str]:
        """Units in which the sources are shown."""
        return [unit_words(source.shown_in) for source in self.manifest.model.sources]

    @property
    def output_units(self) -> list[str]:
        """Units in which the outputs are shown."""
        return [unit_words(output.shown_in) for output in self.manifest.model.outputs]

    @property
    def source_scale(self) -> Array:
        """Factors from SI values of the sources to those shown."""
        return scale_of(self.manifest.model.sources)

    @property
    def output_scale(self) -> Array:
        """Factors from SI values of the outputs to those shown."""
        return scale_of(self.manifest.model.outputs)

    @cached_property
    def flown(self) -> Array:
        """Final errors of the samples that did not fail, in the units shown, shape (n, outputs)."""
        known = np.isfinite(self.outputs).all(axis=1)
        return np.asfortranarray(self.outputs if known.all() else self.outputs[known]) * self.output_scale
