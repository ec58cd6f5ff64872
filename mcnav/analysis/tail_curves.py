"""Probability beyond multiples of a requirement's limits: by counting, by the linear model, and with its curvature."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from mcnav.analysis.model import Model
from mcnav.analysis.requirements import (
    Requirement,
    counted,
    counted_model,
    error_sizes,
    independent_samples,
    size_members,
)
from mcnav.arrays.types import Array, IndexArray
from mcnav.statistics.normal_box import probability_beyond_box
from mcnav.statistics.normal_size import NormalSize
from mcnav.statistics.proportions import probability_interval
from mcnav.statistics.quadratic_tail import QuadraticForm
from mcnav.statistics.refusals import or_withheld

POINTS: Final = 61
"""Multiples of the limits at which probabilities are known, up to `FARTHEST`."""

FARTHEST: Final = 1.15
COMMON: Final = 0.5
"""Linear probability at which curves begin, about."""


@dataclass(frozen=True)
class Curvature:
    """Outputs as quadratic functions of normal sources: see `mcnav.linear.higher_order.SecondOrder.along_axes`.

    ``centre`` has shape (outputs,), ``slopes`` and ``curvatures`` (outputs, r).
    """

    centre: Array
    slopes: Array
    curvatures: Array

    @classmethod
    def of_record(cls, second_order: Mapping[str, Any] | None) -> Curvature | None:
        """Return that of a manifest; none where it has none."""
        entries = [(second_order or {}).get(key) for key in ("centre", "slopes", "curvatures")]
        if any(entry is None for entry in entries):
            return None
        return cls(*(np.array(entry, dtype=float) for entry in entries))

    def beyond(self, requirement: Requirement, model: Model, multiple: float = 1.0) -> float:
        """Compute the probability beyond multiples of the limits of a quantile or a box; NaN of a radius or a size.

        Noise adds its linear variance. The probabilities of several outputs of a box are added up, so that theirs is no
        larger than this.
        """
        if requirement.kind not in ("quantile", "box") or size_members(requirement.outputs, model.sizes):
            return math.nan
        if requirement.kind == "quantile" and len(requirement.outputs) > 1:
            return math.nan
        centre = counted(requirement, self.centre, model.origin)
        noise = sum((np.diag(process) for process in model.processes.values()), np.zeros(len(self.centre)))
        return sum(
            QuadraticForm(
                float(centre[i]), self.slopes[i], self.curvatures[i], float(np.sqrt(max(noise[i], 0.0)))
            ).beyond(multiple * limit)
            for i, limit in zip(requirement.outputs, requirement.limits, strict=True)
        )  # fmt: skip


def linear_beyond(requirement: Requirement, model: Model, multiple: float = 1.0) -> float:
    """Compute the probability beyond multiples of the limits for linear normal errors; NaN where it is not known."""
    model = counted_model(requirement, model)
    members = size_members(requirement.outputs, model.sizes)
    chosen = np.array(members or requirement.outputs)
    mean, covariance = model.outcome_mean[chosen], model.outcome_covariance[np.ix_(chosen, chosen)]
    limits = multiple * np.array(requirement.limits)
    if requirement.kind == "box" or len(chosen) == 1:
        return or_withheld(probability_beyond_box, mean, covariance, limits)
    return or_withheld(NormalSize.of(mean, covariance).beyond, float(limits[0]))


@dataclass(frozen=True)
class TailCurve:
    """Probability beyond multiples of the limits, shape (m,), by several methods; NaN where one does not know it.

    Attributes
    ----------
    multiples : ndarray, shape (m,)
    counted, low, high : ndarray, shape (m,)
        Share of the samples at or beyond them, and the ends of its two-sided interval.
    linear, curved : ndarray, shape (m,)
        For linear normal errors, and with the curvature of the outputs.
    samples : int
        Independent samples that were counted.
    at_limit : tuple of float
        Linear and curved probability at the limits themselves.
    beyond : int
        Samples at or beyond the limits themselves.
    """

    multiples: Array
    counted: Array
    low: Array
    high: Array
    linear: Array
    curved: Array
    samples: int
    at_limit: tuple[float, float]
    beyond: int


def tail_curve(
    requirement: Requirement, model: Model, curvature: Curvature | None, outcomes: Array, blocks: IndexArray,
    confidence: float,
) -> TailCurve:  # fmt: skip
    """Compute the curve of a requirement on the final outcomes of samples, shape (n, outputs)."""

    def curved(multiple: float) -> float:
        return math.nan if curvature is None else curvature.beyond(requirement, model, multiple)

    coarse = np.linspace(0.02, 1.0, 50)
    common = np.array([linear_beyond(requirement, model, each) for each in coarse])
    begin = float(coarse[int(np.argmax(common < COMMON))]) if np.isfinite(common).all() else 0.1
    multiples = np.linspace(min(begin, 0.9), FARTHEST, POINTS)
    independent, remark = independent_samples(blocks)
    reached = np.sort(limits_reached(requirement, model, outcomes[independent]))
    reached = reached[np.isfinite(reached)]
    counts, samples = len(reached) - np.searchsorted(reached, multiples, side="left"), len(reached)
    ends = [
        (math.nan, math.nan) if remark or not samples else probability_interval(int(count), samples, confidence)
        for count in counts
    ]
    low, high = np.array(ends).T
    return TailCurve(
        multiples, np.where(counts > 0, counts / max(samples, 1), np.nan), low, high,
        np.array([linear_beyond(requirement, model, multiple) for multiple in multiples]),
        np.array([curved(multiple) for multiple in multiples]),
        samples, (linear_beyond(requirement, model), curved(1.0)), int(np.count_nonzero(reached >= 1.0)),
    )  # fmt: skip


def limits_reached(requirement: Requirement, model: Model, outcomes: Array) -> Array:
    """Return the multiple of the limits that each outcome reaches, shape (n,); NaN of a sample that failed."""
    outcomes = counted(requirement, outcomes, model.origin)
    if requirement.kind == "box":
        return np.asarray(np.max(np.abs(outcomes[:, requirement.outputs]) / np.array(requirement.limits), axis=1))
    members = size_members(requirement.outputs, model.sizes)
    sizes = np.linalg.norm(outcomes[:, members], axis=1) if members else error_sizes(outcomes, requirement.outputs)
    return np.asarray(sizes / requirement.limits[0])
