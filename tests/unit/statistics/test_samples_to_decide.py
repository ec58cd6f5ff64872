"""Samples that decide: the stated number decides as often as it says, and no fewer than it says."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from mcnav.statistics.samples_to_decide import (
    MOST,
    samples_for_ratio,
    samples_to_meet,
    samples_to_reject,
)

CONFIDENCE = 0.95
LEAST = 0.89
"""Least probability of a decision that the stated sizes promise: 90 %, to within 1 %."""


def decided(share: float, allowed: float, count: int) -> float:
    """Compute the probability that exact bounds from so many samples decide, by adding up the binomial distribution."""
    hits = np.arange(count + 1)
    chances = stats.binom(count, share).pmf(hits)
    met = stats.binom(count, allowed).cdf(hits) <= 1.0 - CONFIDENCE
    rejected = stats.binom(count, allowed).cdf(hits - 1) >= CONFIDENCE
    return float(chances[met if share < allowed else rejected].sum())


@pytest.mark.parametrize(("share", "allowed"), [(0.0, 0.05), (0.02, 0.05), (0.4, 0.5), (0.001, 0.0027), (0.89, 0.9)])
def test_shares_below_the_allowed_one(share: float, allowed: float) -> None:
    """From the stated number on as many are decided, and with 15 % fewer not all along."""
    needed = samples_to_meet([share], allowed, CONFIDENCE)
    assert needed is not None
    assert min(decided(share, allowed, count) for count in range(needed, needed + 60)) >= LEAST
    if share:
        assert min(decided(share, allowed, int(count)) for count in np.linspace(0.7, 0.85, 30) * needed) < 0.9


@pytest.mark.parametrize(("share", "allowed"), [(0.1, 0.05), (0.6, 0.5), (0.006, 0.0027), (0.95, 0.9)])
def test_shares_above_the_allowed_one(share: float, allowed: float) -> None:
    needed = samples_to_reject([share], allowed, CONFIDENCE)
    assert needed is not None
    assert min(decided(share, allowed, count) for count in range(needed, needed + 60)) >= LEAST
    assert min(decided(share, allowed, int(count)) for count in np.linspace(0.7, 0.85, 30) * needed) < 0.9


def test_several_shares_need_more() -> None:
    one, three = (samples_to_meet([0.02] * number, 0.05, CONFIDENCE) for number in (1, 3))
    assert one is not None
    assert three is not None
    assert one < three < 2 * one
    assert samples_to_meet([0.02, 0.06], 0.05, CONFIDENCE) is None
    assert samples_to_reject([0.02, 0.1], 0.05, CONFIDENCE) == samples_to_reject([0.1], 0.05, CONFIDENCE)


def test_too_close_has_no_number() -> None:
    """A distance of d needs about 8.6 a (1 - a) / d^2 samples, a thousand million here at d = 4.7e-6."""
    assert samples_to_meet([0.0027 - 4e-6], 0.0027, CONFIDENCE) is None
    needed = samples_to_meet([0.0027 - 6e-6], 0.0027, CONFIDENCE)
    assert needed is not None
    assert needed < MOST
    assert samples_to_reject([0.05], 0.05, CONFIDENCE) is None
    assert samples_for_ratio(1.05, (1.0, 1.1), 0.05, 1_000, CONFIDENCE) is None
    assert samples_for_ratio(1.0, (0.0, np.inf), 0.05, 1_000, CONFIDENCE) is None


@pytest.mark.parametrize("ratio", [1.0, 1.03, 0.96, 1.06, 1.2, 0.9])
def test_ratios_are_decided_as_often_as_stated(ratio: float) -> None:
    """Normal estimates of the ratio, a million with a fixed seed: four binomial errors are 0.0012."""
    error, count, tolerance, trials = 0.08, 1_000, 0.05, 1_000_000
    half = stats.norm.ppf(0.975) * error
    needed = samples_for_ratio(ratio, (ratio - half, ratio + half), tolerance, count, CONFIDENCE)
    assert needed is not None
    shrunk = np.sqrt(count / needed)
    estimates = ratio + error * shrunk * np.random.default_rng(11).standard_normal(trials)
    low, high = estimates - half * shrunk, estimates + half * shrunk
    agrees = (low >= 1.0 - tolerance) & (high <= 1.0 + tolerance)
    differs = (low > 1.0 + tolerance) | (high < 1.0 - tolerance)
    assert np.mean(agrees | differs) == pytest.approx(0.9, abs=4.0 * np.sqrt(0.9 * 0.1 / trials) + 1e-4)
