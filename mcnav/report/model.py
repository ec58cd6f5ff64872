"""All that a report shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.analysis.budget import ErrorBudget
from mcnav.analysis.comparison import Comparison, Criterion, Model
from mcnav.analysis.convergence import Convergence
from mcnav.analysis.envelopes import Envelopes
from mcnav.analysis.requirements import RequirementResult
from mcnav.analysis.tails import Quantile
from mcnav.analysis.variance_breakdown import VarianceBreakdown
from mcnav.scenarios.protocol import History, PartialsHistory, source_labels
from mcnav.units import conversion


@dataclass(frozen=True)
class Content:
    """A judged run with its samples; see `mcnav.workflow.analyse.Analysis` and the manifest for the fields.

    ``outputs`` has shape (n, outputs), SI, with NaN in the rows of failed samples.
    """

    summary: Mapping[str, Any]
    manifest: Mapping[str, Any]
    model: Model
    criterion: Criterion
    comparison: Comparison
    budget: ErrorBudget
    causes: VarianceBreakdown | None
    requirements: tuple[RequirementResult, ...]
    convergence: Convergence | None
    tails: tuple[Quantile, ...]
    outputs: Array
    index: IndexArray
    failures: Mapping[str, tuple[int, Sequence[int]]]
    history: History
    campaign: str
    development: PartialsHistory | None = None
    envelopes: Envelopes | None = None

    @property
    def higher_order(self) -> Mapping[str, Any] | None:
        """Moments in closed form, SI; none where there are none: see `mcnav.lincov.corrections.higher_order`."""
        found: Mapping[str, Any] = self.summary.get("higher_order") or {}
        return found if "sigma" in found else None

    @property
    def dispersed(self) -> bool:
        """Whether there is any dispersion to show: some output has one by linear analysis, and samples were flown."""
        return bool(self.comparison.outputs) and bool(np.any(np.diag(self.comparison.covariance_linear) > 0.0))

    @cached_property
    def moving(self) -> list[int]:
        """The outputs that have any dispersion, by linear analysis or flown."""
        flown = self.flown
        spread = np.ptp(flown, axis=0) if len(flown) else np.zeros(len(self.output_names))
        linear = np.diag(self.comparison.covariance_linear)
        return [i for i in range(len(linear)) if linear[i] > 0.0 or spread[i] > 0.0]

    @property
    def source_names(self) -> list[str]:
        """Names of the sources for people."""
        return labels_of(self.manifest["model"])

    @property
    def output_names(self) -> list[str]:
        """Names of the outputs for people."""
        return [humanize(entry["name"]) for entry in self.manifest["model"]["outputs"]]

    @property
    def source_units(self) -> list[str]:
        """Units in which the sources are shown."""
        return [str(entry["shown_in"]) for entry in self.manifest["model"]["sources"]]

    @property
    def output_units(self) -> list[str]:
        """Units in which the outputs are shown."""
        return [str(entry["shown_in"]) for entry in self.manifest["model"]["outputs"]]

    @property
    def source_scale(self) -> Array:
        """What SI values of the sources are multiplied by to be shown."""
        return _scale(self.manifest["model"]["sources"])

    @property
    def output_scale(self) -> Array:
        """What SI values of the outputs are multiplied by to be shown."""
        return _scale(self.manifest["model"]["outputs"])

    @cached_property
    def flown(self) -> Array:
        """Final errors of the samples that did not fail, in the units shown, shape (n, outputs)."""
        known = np.isfinite(self.outputs).all(axis=1)
        return np.asfortranarray(self.outputs if known.all() else self.outputs[known]) * self.output_scale


def _scale(entries: list[dict[str, str]]) -> Array:
    return np.array([conversion(entry["unit"], entry["shown_in"]) for entry in entries])


def labels_of(model: Mapping[str, Any]) -> list[str]:
    """Names for people of the sources in a table with ``sources`` and ``outputs``: a manifest's model, or a summary."""
    return source_labels(*([entry["name"] for entry in model[key]] for key in ("sources", "outputs")))


def humanize(name: str) -> str:
    """A name from a file as people write it.

    >>> humanize("gyro_drift")
    'gyro drift'
    """
    return name.replace("_", " ")
