"""Quantiles of errors: known distributions, failures, designs without independent draws."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from mcnav.analysis.comparison import Criterion
from mcnav.analysis.model import Model
from mcnav.analysis.tails import MOST_PAIRS, PROBABILITIES, pairs_in_one_unit, tails
from mcnav.statistics.normal_size import size_quantile

MODEL = Model(np.diag([1.0, 2.0, 0.0]), np.zeros(3), np.zeros(3), np.eye(3))
UNITS = ["m", "m", "m"]


def test_normal_errors() -> None:
    """Bounds at one in a million hold the known quantiles; an output without dispersion has none."""
    errors = np.random.default_rng(1).standard_normal((20_000, 3))
    found = tails(MODEL, errors @ MODEL.partials.T, np.arange(20_000), UNITS, Criterion(confidence=1.0 - 1e-6))
    assert [entry.outputs for entry in found] == [(0,)] * 3 + [(1,)] * 3 + [(0, 1)]
    for entry, probability in zip(found, PROBABILITIES, strict=False):
        expected = stats.norm.ppf(0.5 + 0.5 * probability)
        assert entry.linear == pytest.approx(expected, rel=1e-9)
        assert entry.lower < expected < entry.upper
    circle = found[-1]
    assert circle.linear == size_quantile(np.zeros(2), np.diag([1.0, 4.0]), 0.5)
    assert circle.lower < circle.linear < circle.upper
    assert circle.lower < circle.estimate < circle.upper


def test_failures_and_few_samples() -> None:
    outcomes = np.random.default_rng(1).standard_normal((1000, 3))
    outcomes[:5] = np.nan
    whole = tails(MODEL, outcomes, np.arange(1000), UNITS, Criterion(confidence=0.9))
    assert whole[0].upper < np.inf
    assert whole[2].upper == np.inf  # five failures of a thousand leave P99.73 open above
    assert np.isfinite(whole[2].estimate)
    nets = tails(MODEL, outcomes, np.arange(1000) // 62, UNITS, Criterion(confidence=0.9))
    assert {(entry.lower, entry.upper) for entry in nets} == {(0.0, np.inf)}
    none = tails(MODEL, np.full((10, 3), np.nan), np.arange(10), ["m", "s", "m"], Criterion(confidence=0.9))
    assert len(none) == 6
    assert all(np.isnan(entry.estimate) and entry.lower == 0.0 for entry in none)


def test_more_pairs_than_anyone_reads_have_no_cep() -> None:
    """46 outputs in metres have 1,035 pairs; 45 of them and one in seconds 990, which all have one."""
    model = Model(np.eye(46), np.zeros(46), np.zeros(46), np.eye(46))
    outcomes = np.random.default_rng(3).standard_normal((200, 46))
    for units, pairs, computed in ((["m"] * 46, 1035, 0), (["m"] * 45 + ["s"], 990, 990)):
        assert len(pairs_in_one_unit(model, units)) == pairs
        found = tails(model, outcomes, np.arange(200), units, Criterion())
        assert (len(found), pairs > MOST_PAIRS) == (3 * 46 + computed, not computed)
