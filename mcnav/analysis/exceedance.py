"""Probability beyond a requirement's limits by flights that the linear model chose, and what follows from it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mcnav.analysis.requirements import (
    Exceedance,
    Finding,
    Requirement,
    RequirementResult,
    independent_samples,
    size_members,
    size_probability,
)
from mcnav.arrays.products import transformed_variances
from mcnav.arrays.types import Array, IndexArray
from mcnav.rare.limits import AnyEpoch, Distance, Limit, Sides
from mcnav.statistics.proportions import lower_probability, upper_probability
from mcnav.statistics.samples_to_decide import samples_to_meet, samples_to_reject

CONTRADICTS: Final = 0.999
"""Confidence, to each side, of the counted share that contradicts an interval."""

POWER: Final = 0.9
"""Probability with which the search must find a second way to fail, as likely as what is allowed, to be met."""

LIKELY: Final = 0.2
"""Share of the largest departure from which a source is named in the most likely way to fail."""


@dataclass(frozen=True)
class Event:
    """Region beyond a requirement: outputs by number, and their limits; over time at any of its epochs, by number.

    ``origin``, shape (m, outputs), is what the outputs are measured from at these epochs, or at the end, m = 1.
    """

    outputs: tuple[int, ...]
    limit: Limit
    epochs: tuple[int, ...] = ()
    origin: Array | None = None

    @classmethod
    def of(cls, requirement: Requirement, sizes: Mapping[int, tuple[int, ...]], origin: Array | None = None) -> Event:
        """Return that of a quantile, a radius or a box.

        Parameters
        ----------
        sizes : mapping of int to tuple of int
            As those of `mcnav.analysis.model.Model`.
        origin : ndarray, shape (outputs,) or, over time, (epochs, outputs), optional
            What all outputs are measured from.
        """
        outputs = requirement.outputs
        limit: Sides | Distance
        members = size_members(outputs, sizes) if requirement.kind != "box" else ()
        if requirement.kind == "box" or (len(outputs) == 1 and not members):
            limits = np.array(requirement.limits)
            limit = Sides(-limits, limits)
        else:
            outputs = members or outputs
            limit = Distance(requirement.limits[0], len(outputs))
        epochs = requirement.epochs
        if origin is not None:
            at = origin[np.array(epochs)] if epochs else origin[None]
            origin = None if requirement.about else at[:, outputs]
        return cls(outputs, AnyEpoch(limit, len(epochs)) if epochs else limit, epochs, origin)

    def picked(self, values: Array) -> Array:
        """Return what is limited of all outputs, shape (n, outputs), or over time (n, m, outputs), as (n, limited)."""
        chosen = values[:, self.epochs][:, :, self.outputs] if self.epochs else values[:, None, self.outputs]
        if self.origin is not None:
            chosen = chosen + self.origin
        return np.asarray(chosen.reshape(len(values), -1))

    def worst_epoch(self, limited: Array) -> int:
        """Return the place, among the event's epochs, of the farthest beyond the limit; ``limited`` is of `picked`."""
        assert isinstance(self.limit, AnyEpoch)
        return int(np.argmax(self.limit.margins(limited)[0]))

    def distances(self, mean: Array, covariance: Array) -> Array:
        """Return how far the mean lies from each side in sigmas, shape (m, sides).

        Parameters
        ----------
        mean, covariance : ndarray, shapes (m, outputs), (m, outputs, outputs)
            Of the event's outputs at its epochs, or at the end, m = 1.
        """
        limit = self.limit.limit if isinstance(self.limit, AnyEpoch) else self.limit
        normals = limit.normals
        sigma = np.sqrt(np.maximum(transformed_variances(normals, covariance), 0.0))
        left = limit.offsets - mean @ normals.T
        return np.asarray(np.divide(left, sigma, out=np.full_like(left, np.inf), where=sigma > 0.0))

    def margin(self, values: Array) -> Array:
        """Return how far all outputs, shaped as for `picked`, lie beyond, shape (n,)."""
        return self.limit.margin(self.picked(values))


def allowed_share(requirement: Requirement) -> float:
    """Return the probability beyond its limits that a requirement allows."""
    return 1.0 - size_probability(requirement)


def samples_deciding(share: float, allowed: float, confidence: float) -> int | None:
    """Return the independent samples by which counting would decide; none where too many were needed."""
    decide = samples_to_meet if share < allowed else samples_to_reject
    return decide([share], allowed, confidence)


def weigh(
    result: RequirementResult, exceedance: Exceedance, event: Event, outcomes: Array, blocks: IndexArray,
    confidence: float,
) -> RequirementResult:  # fmt: skip
    """Add an exceedance to the result on a requirement: compare it with the samples counted, and decide by it.

    ``outcomes`` are those of the samples, shape (n, outputs), over time (n, m, outputs). A finding by counting stands,
    without an exceedance. The interval is two-sided, so that each of its ends holds at more than ``confidence``. Over
    time the exceedance is that of any epoch, no less than that of each: it shows that a requirement is met.
    """
    if result.finding != Finding.UNDECIDED:
        return result
    independent, remark = independent_samples(blocks)
    margin = event.margin(outcomes[independent])
    count, beyond = len(margin), int(np.count_nonzero(margin > 0.0))
    if not exceedance.refusal and not remark and count:
        low, high = lower_probability(beyond, count, CONTRADICTS), upper_probability(beyond, count, CONTRADICTS)
        if low > exceedance.high or high < exceedance.low:
            reason = f"{beyond:,} of {count:,} samples lie beyond the limit, which contradicts the flights chosen"
            exceedance = replace(exceedance, estimate=math.nan, low=math.nan, high=math.nan, refusal=reason)
    if exceedance.refusal:
        return replace(result, exceedance=exceedance)
    allowed = allowed_share(result.requirement)
    if exceedance.high <= allowed or (exceedance.low > allowed and not event.epochs):
        finding, remark = Finding.NOT_MET, f"decided by {exceedance.flights:,} chosen flights"
        if exceedance.high <= allowed:
            finding, remark = _met(exceedance, remark)
        return replace(result, exceedance=exceedance, finding=finding, samples_needed=None, remark=remark)
    remark = f"{exceedance.flights:,} chosen flights do not decide it either"
    return replace(result, exceedance=exceedance, samples_needed=None, remark=remark)


def _met(exceedance: Exceedance, remark: str) -> tuple[Finding, str]:
    """Return whether a requirement is met without a doubt, and the remark; or how often the search would fail."""
    if exceedance.power >= POWER:
        return Finding.MET, remark
    if math.isnan(exceedance.power):
        return Finding.MET_AS_KNOWN, f"{remark}; how well they look for a second way to fail is not known: run it again"
    found = ("none", "one", "two", "three", "four", "five", "six", "seven", "eight")[int(10.0 * exceedance.power)]
    return Finding.MET_AS_KNOWN, f"{remark}; a second way to fail as likely would be found in {found} of ten runs"


def most_likely_way(names: Sequence[str], departures: Array) -> dict[str, float]:
    """Return the departures of the sources that matter in the most likely way to fail, in sigmas, the largest first."""
    order = np.argsort(-np.abs(departures), kind="stable")
    least = LIKELY * float(np.max(np.abs(departures)))
    return {names[k]: float(departures[k]) for k in order if abs(departures[k]) >= least > 0.0}
