"""Errors that make a filter optimistic, by the closed-loop sensitivities of linear analysis."""

from __future__ import annotations

import numpy as np

from mcnav.analysis.filter_consistency import NeglectedError
from mcnav.analysis.filter_evidence import LinearFilter


def neglected_errors(linear: LinearFilter, epoch: int, output: int) -> tuple[NeglectedError, ...]:
    """Split the true variance of an output that its filter does not believe in among the causes, the largest first.

    A cause of which the filter believes the share b contributes (1 - b) times its true variance: with the filter's
    gains the true variance is the sum of all contributions, and the filter's own is that of the contributions as
    believed. Causes of which the filter believes too much have negative shares, and are left out.
    """
    true = {name: float(variances[epoch, output]) for name, variances in linear.contributions.items()}
    missing = {name: (1.0 - linear.believed.get(name, 1.0)) * variance for name, variance in true.items()}
    total = sum(missing.values())
    if not (np.isfinite(total) and total > 0.0):
        return ()
    found = [
        NeglectedError(name, true[name], true[name] - lack, lack / total)
        for name, lack in missing.items()
        if lack > 0.0
    ]
    return tuple(sorted(found, key=lambda each: -each.share))
