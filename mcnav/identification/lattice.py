"""Resolution of readings: the step of the lattice that they lie on, if they do."""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array

LOOKED_AT: Final = 65_536
"""Readings that are looked at, from the first on."""

SAME: Final = 1e-6
"""Distance of two values, as a share of the smallest step, within which they are one value that was rounded twice."""

DISTINCT: Final = 0.5
"""Share of distinct values among the readings from which no lattice is seen: each step would be met about once."""

OFF: Final = 0.02
"""Largest distance of a value from the lattice, in steps."""


def resolution(readings: Array) -> float | None:
    """Return the step q of the lattice of readings, shape (n,); none where values hardly repeat.

    >>> resolution(np.round(np.random.default_rng(1).standard_normal(1_000), 1))
    0.1
    """
    values, step = np.unique(readings[:LOOKED_AT]), 0.0
    if len(values) < 2 or len(values) > DISTINCT * min(len(readings), LOOKED_AT):
        return None
    gaps = np.diff(values)
    # values that differ by rounding alone: the smallest gap that is no rounding error of the largest value
    gaps = gaps[gaps > max(float(np.abs(values).max()) * 1e-13, float(np.median(gaps)) * SAME)]
    if not len(gaps):
        return None
    step = float(gaps.min())
    for _ in range(3):
        steps = np.round(gaps / step)
        step = float(gaps.sum() / steps.sum())
    if np.abs(gaps / step - np.round(gaps / step)).max() > OFF:
        return None
    return float(f"{step:.9g}")
