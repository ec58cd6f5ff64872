"""The linear model of a manifest, as the functions of `mcnav.analysis` take it."""

from __future__ import annotations

from mcnav.analysis.comparison import Model
from mcnav.arrays.products import transform
from mcnav.arrays.types import Array
from mcnav.contract.linear import LinearModel
from mcnav.linear.block_sums import Normalization
from mcnav.store.manifest import Manifest, ModelRecord, PartialsRecord
from mcnav.store.summaries import SUMMARY


def linear_model(record: ModelRecord) -> Model:
    """Return the linear model of a manifest."""
    linear = LinearModel(record.partials, record.nominal, record.processes or {}, record.origin)
    return Model.of(linear, record.start_mean, record.start_covariance, record.outputs)


def linear_moments(model: ModelRecord, development: PartialsRecord) -> tuple[Array, Array]:
    """Return linear mean and covariance over time, shapes (n, outputs) and (n, outputs, outputs)."""
    partials, covariance = development.partials, development.covariance
    if covariance is None:
        covariance = transform(partials, model.start_covariance)
    mean = partials @ model.start_mean
    return mean if development.nominal is None else mean + development.nominal, covariance


def summary_frame(manifest: Manifest, model: Model) -> Normalization | None:
    """Return how the samples of a run are reduced to sums, with its linear model; none when all are stored."""
    if manifest.store != SUMMARY:
        return None
    length = manifest.sampling_design.block_length
    return Normalization.of(
        model.partials, model.mean, model.outcome_mean, model.outcome_covariance, manifest.samples, length
    )
