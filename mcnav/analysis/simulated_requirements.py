"""Requirements as samples show them: the scale that carries a linear answer to the simulated one.

Advice that starts from linear analysis alone misses a limit wherever the errors are not linear and normal. A run bounds
each requirement by its samples: a linear answer counts only after it is multiplied by bound over linear value.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from scipy import special

from mcnav.analysis.requirements import Finding

if TYPE_CHECKING:
    from mcnav.analysis.summary import RequirementEntry, Summary


@dataclass(frozen=True)
class Basis:
    """A simulation of a campaign as it is.

    Attributes
    ----------
    samples : int
    confidence : float
        Of each one-sided bound.
    entries : tuple of RequirementEntry
        In the order of the campaign.
    """

    samples: int
    confidence: float
    entries: tuple[RequirementEntry, ...]

    @classmethod
    def of(cls, summary: Summary) -> Basis:
        """Take the requirements of a run."""
        return cls(summary.samples, summary.confidence, tuple(summary.requirements))

    @property
    def scales(self) -> tuple[float, ...]:
        """Scale of each requirement, as `measured_scale` has it."""
        return tuple(map(measured_scale, self.entries))


def measured_scale(entry: RequirementEntry) -> float:
    """Compute by what linear errors are to be multiplied for linear analysis to state the bound of the samples.

    Of a quantile or a radius it is the upper bound over the linear value. Of a box with linear probability p and lower
    bound b it is ``z(p)/z(b)``, where ``z(p)`` is the size within which a standard normal error lies with probability
    p: exact for a single output, and a first value for several. Where flights were chosen to bound the probability e
    beyond a limit L, of which linear analysis has the quantile q at probability p, it is ``(L/z(1 - e))/(q/z(p))``.

    Returns
    -------
    float
        NaN where the samples bound nothing, or linear analysis has no value.

    Examples
    --------
    >>> from mcnav.analysis.summary import RequirementEntry
    >>> measured_scale(RequirementEntry(kind="quantile", outputs=["y"], limits=[10.0], probability=0.9, finding="met",
    ...     estimate=9.0, interval=(8.8, 9.2), linear=8.0, linear_meets=True, samples_needed=None, largest_sigmas=None))
    1.15
    """
    linear, (low, high) = entry.linear, entry.interval
    if entry.kind == "sigma_ratio" or linear is None or not (math.isfinite(linear) and linear > 0.0):
        return math.nan
    if entry.kind == "box":
        return _ratio(_size_within(linear), _size_within(low or 0.0))
    rare = entry.exceedance
    if rare is not None and not rare.refusal and rare.high:
        probability = 0.5 if entry.probability is None else entry.probability
        return _ratio(entry.limits[0] * _size_within(probability), linear * _size_within(1.0 - rare.high))
    return _ratio(high or math.inf, linear)


def _size_within(probability: float) -> float:
    """Return the size within which a standard normal error lies with a probability."""
    return float(special.ndtri(0.5 + 0.5 * min(max(probability, 0.0), 1.0)))


def _ratio(numerator: float, denominator: float) -> float:
    known = 0.0 < denominator < math.inf and 0.0 < numerator < math.inf
    return numerator / denominator if known else math.nan


def least_margin(entries: Sequence[RequirementEntry]) -> RequirementEntry:
    """Return the requirement with the worst finding; of several the one whose bound uses most of its limit."""
    order = (Finding.NOT_MET, Finding.UNDECIDED, Finding.MET)
    return min(entries, key=lambda entry: (order.index(Finding(entry.finding)), -_used(entry)))


def _used(entry: RequirementEntry) -> float:
    low, high = entry.interval
    if entry.kind == "box":
        return (1.0 - (low or 0.0)) / max(1.0 - (entry.probability or 0.5), 1e-300)
    return math.inf if high is None else high / entry.limits[0] if entry.limits[0] else math.inf
