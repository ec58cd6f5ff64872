"""The linear model of a manifest, as the functions of `mcnav.analysis` take it: at the end, and over time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from mcnav.analysis.linear_range import limits_of
from mcnav.analysis.model import Model
from mcnav.arrays.products import transform
from mcnav.arrays.types import Array
from mcnav.contract.linear import LinearModel
from mcnav.linear.at_epochs import same_times
from mcnav.linear.block_sums import Normalization
from mcnav.store.manifest import Manifest, ModelRecord, PartialsRecord
from mcnav.store.summaries import SUMMARY


@dataclass(frozen=True)
class LinearOverTime:
    """Linear errors at n times.

    Attributes
    ----------
    record : PartialsRecord
        Partial derivatives at these times.
    mean, covariance : ndarray, shapes (n, outputs) and (n, outputs, outputs)
    """

    record: PartialsRecord
    mean: Array
    covariance: Array

    @classmethod
    def of(cls, model: ModelRecord, record: PartialsRecord) -> LinearOverTime:
        """Compute the moments for the model's start errors."""
        covariance = record.covariance
        if covariance is None:
            covariance = transform(record.partials, model.start_covariance)
        mean = record.partials @ model.start_mean
        return cls(record, mean if record.nominal is None else mean + record.nominal, covariance)

    @property
    def is_whole(self) -> bool:
        """Whether the covariance has what noise adds: that of an earlier manifest has not."""
        return not self.record.processes or self.record.covariance is not None

    def is_at(self, times: Array) -> bool:
        """Return whether it is at these times."""
        return same_times(self.record.times, times)


@dataclass(frozen=True)
class RecordedModel:
    """The linear model that a manifest records, and the same at the end as samples are compared with it."""

    record: ModelRecord
    end: Model

    @classmethod
    def of(cls, record: ModelRecord) -> RecordedModel:
        """Read the linear model of a manifest."""
        return cls(record, linear_model(record))

    @cached_property
    def limits(self) -> Array:
        """Size of each output on which its system changes, shape (outputs,); infinite without one."""
        return limits_of(output.limit for output in self.record.outputs)

    @cached_property
    def over_time(self) -> LinearOverTime | None:
        """Errors over time; none where they are not known."""
        development = self.record.development
        return None if development is None else LinearOverTime.of(self.record, development)

    @cached_property
    def smoothed(self) -> LinearOverTime | None:
        """Errors behind the smoother over time; none without one."""
        smoother = self.record.smoother
        return None if smoother is None else LinearOverTime.of(self.record, smoother.errors)


def linear_model(record: ModelRecord) -> Model:
    """Return the linear model of a manifest."""
    linear = LinearModel(record.partials, record.nominal, record.processes or {}, record.origin)
    return Model.of(linear, record.start_mean, record.start_covariance, record.outputs)


def summary_frame(manifest: Manifest, model: Model) -> Normalization | None:
    """Return how the samples of a run are reduced to sums, with its linear model; none when all are stored."""
    if manifest.store != SUMMARY:
        return None
    length = manifest.sampling_design.block_length
    return Normalization.of(
        model.partials, model.mean, model.outcome_mean, model.outcome_covariance, manifest.samples, length
    )
