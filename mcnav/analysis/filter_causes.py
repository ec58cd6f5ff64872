"""Errors that make a filter optimistic, by the closed-loop sensitivities of linear analysis.

Linear analysis has no sampling error. It therefore chooses epoch and output as well: where Monte Carlo ratios of
several epochs are nearly equal, the largest one is so by chance, and with it the error that is named.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from mcnav.analysis.filter_consistency import MEAN, NeglectedError

if TYPE_CHECKING:
    from mcnav.analysis.filter_evidence import LinearFilter


def kind_of(cause: str) -> str:
    """Return the kind of a cause: its name without the axis, and without what marks a mean.

    >>> kind_of("gyro_misalignment_xz"), kind_of("mean_of_gyro_bias_x"), kind_of("heading")
    ('gyro_misalignment', 'gyro_bias', 'heading')
    """
    name = cause.removeprefix(MEAN)
    stem, _, axis = name.rpartition("_")
    return stem if stem and axis in AXES else name


def shares_by_kind(causes: Iterable[tuple[str, float]]) -> dict[str, float]:
    """Add up the shares of causes of one kind, the largest first.

    >>> shares_by_kind([("gyro_bias_x", 0.3), ("heading", 0.4), ("gyro_bias_y", 0.3)])
    {'gyro_bias': 0.6, 'heading': 0.4}
    """
    sums: dict[str, float] = {}
    for name, share in causes:
        sums[kind_of(name)] = sums.get(kind_of(name), 0.0) + share
    return dict(sorted(sums.items(), key=lambda item: -item[1]))


AXES: Final = frozenset(
    {"x", "y", "z", "north", "east", "down"} | {f"{first}{second}" for first in "xyz" for second in "xyz"}
)
"""Ends of names of causes that are of one kind."""

NEARLY: Final = 0.99
"""Share of the largest ratio from which another one counts as equal: of a steady filter all are, but for rounding."""


@dataclass(frozen=True)
class Departure:
    """Epoch and output, by number, at which the true sigma exceeds the filter's the most by linear analysis."""

    epoch: int
    output: int


def largest_departure(linear: LinearFilter, outputs: Sequence[int], tolerance: float) -> Departure | None:
    """Find where the sigma of one of some outputs departs the most; none within the tolerance.

    Of epochs that are nearly equal it is the last one: what an initial error contributes has then decayed. Sigmas up to
    the floor have no ratio. A departure that linear analysis does not know has no cause that it could name.
    """
    if linear.true is None:
        return None
    picked = np.array(outputs)
    true, own = (sigmas[:, picked] for sigmas in linear.sigmas)
    ratio = np.divide(true, own, out=np.zeros_like(true), where=np.isfinite(true) & (own > 0.0))
    largest = ratio.max(axis=1)
    epoch = int(np.flatnonzero(largest >= NEARLY * largest.max())[-1])
    output = int(picked[int(np.argmax(ratio[epoch]))])
    return Departure(epoch, output) if largest[epoch] > 1.0 + tolerance else None


def neglected_errors(linear: LinearFilter, at: Departure) -> tuple[NeglectedError, ...]:
    """Split the true mean square of an output that its filter does not believe in among the causes, the largest first.

    A cause of which the filter believes the share b contributes (1 - b) times its true mean square: with the filter's
    gains the true mean square is the sum of all contributions, and the filter's own variance is that of the
    contributions as believed. Causes of which the filter believes too much have negative shares, and are left out. A
    cause is its mean where this contributes more than its dispersion.
    """
    errors, total = [], 0.0
    for name in dict.fromkeys((*linear.contributions, *linear.squared_means)):
        missing = 1.0 - linear.believed.get(name, 1.0)
        spread, mean = (
            float(values[name][at.epoch, at.output]) if name in values else 0.0
            for values in (linear.contributions, linear.squared_means)
        )
        true, lack = spread + mean, missing * (spread + mean)
        total += lack
        if lack > 0.0:
            errors.append(NeglectedError(f"{MEAN}{name}" if mean > spread else name, true, true - lack, lack))
    if not (np.isfinite(total) and total > 0.0):
        return ()
    errors = [NeglectedError(error.name, error.true, error.believed, error.share / total) for error in errors]
    return tuple(sorted(errors, key=lambda error: -error.share))
