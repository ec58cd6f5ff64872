"""A precision reached by looking repeatedly: the interval at which was stopped covers as often as it says."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from mcnav.statistics.interim_sizes import confidence_of_each, interim_sizes

TRIALS, FALSE_ALARM = 4_000, 1e-3


def _missed(each: float, precision: float, sizes: tuple[int, ...]) -> int:
    """Campaigns that stop at an interval of a mean which does not hold the true one, zero."""
    generator = np.random.default_rng(6)
    critical = stats.norm.ppf(0.5 + 0.5 * each)
    missed = 0
    for _ in range(TRIALS):
        values = generator.standard_normal(sizes[-1])
        for size in sizes:
            mean, half = values[:size].mean(), critical * values[:size].std(ddof=1) / np.sqrt(size)
            # stopping by the outcome, the worst that a rule may do: as soon as zero is outside, or at the end
            if abs(mean) > half or half < precision or size == sizes[-1]:
                missed += abs(mean) > half
                break
    return missed


def test_looking_does_not_spoil_the_confidence() -> None:
    """Even by a rule that stops whenever zero is excluded; without the correction it is spoiled for certain."""
    sizes = interim_sizes(256, 4096)
    assert sizes == (256, 512, 1024, 2048, 4096)
    honest = _missed(confidence_of_each(0.95, len(sizes)), 0.0, sizes)
    assert stats.binom.sf(honest - 1, TRIALS, 0.05) > FALSE_ALARM
    naive = _missed(0.95, 0.0, sizes)
    assert stats.binom.sf(naive - 1, TRIALS, 0.05) < 1e-9


@pytest.mark.parametrize(("chunk", "at_most"), [(1, 2), (32, 100_000), (8192, 8192), (8192, 10**6), (300, 301)])
def test_looks_rise_to_the_most_allowed(chunk: int, at_most: int) -> None:
    sizes = interim_sizes(chunk, at_most)
    assert sizes[-1] == at_most
    assert np.all(np.diff(sizes) > 0)
    assert all(size % chunk == 0 for size in sizes[:-1])
