"""Errors at the start taken out of records: the same likelihoods as with them as states of the filter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.contract.recorded import FilteredRecord
from mcnav.judgement.likelihood import log_likelihood, whiten, whiten_many, without_corrections, without_mean
from mcnav.judgement.reduction import present, with_causes
from mcnav.judgement.simulation import Innovations, beside, simulate, simulate_alone
from mcnav.judgement.start_apart import StartApart, start_alone
from mcnav.judgement.whitened_records import FACTORS, GRID, Together, _highest
from tests.calibration.named_trials import filtered, recording_of
from tests.calibration.own_records import fly

RELATIVE = 1e-11
"""Of log-likelihoods: rounding of sums over 1,000 innovations, and of a filter of 15 errors in place of 34."""


@pytest.fixture(scope="module")
def own() -> FilteredRecord:
    record = filtered(recording_of(fly(104)))
    return without_mean(with_causes(record, present(record)))


def correlated(record: FilteredRecord, first: str, second: str) -> FilteredRecord:
    """Return the record with a correlation of 0.6 between the last error of one cause and the first of another."""
    names = [cause.name for cause in record.causes]
    here = np.flatnonzero(record.initial_causes == names.index(first))[-1]
    there = np.flatnonzero(record.initial_causes == names.index(second))[0]
    initial = record.initial.copy()
    initial[here, there] = initial[there, here] = 0.6 * np.sqrt(initial[here, here] * initial[there, there])
    return replace(record, initial=initial)


def likelihoods(apart: StartApart, factors: dict[int, float]) -> Array:
    """Return the log-likelihoods of the records of which the errors at the start are taken out."""
    count = apart.shifts.shape[1]
    total = np.zeros((1, len(apart.columns), len(apart.columns)))
    grown = 0.0
    passing = {cause: factor for cause, factor in factors.items() if cause not in apart.causes}
    for whitened, log_determinants in whiten(apart.moving, apart.columns, [passing]):
        total += np.swapaxes(whitened, 1, 2) @ whitened
        grown += log_determinants[0]
    (estimates,), (misfits,), (more,) = StartApart.closed(
        total[:, count:, count:], total[:, count:, :count], apart.shifts, apart.scales([factors])
    )
    squares = np.diag(total[0])[:count] + np.sum(estimates**2 - misfits**2, axis=0)
    return np.asarray(-0.5 * (squares + grown + more))


@pytest.mark.parametrize(("pair", "apart_causes"), [(None, 6), (("tilt", "tilt"), 6), (("velocity", "gyro_bias"), 4)])
def test_likelihoods_are_those_of_a_filter_with_all_errors(
    own: FilteredRecord, pair: tuple[str, str] | None, apart_causes: int
) -> None:
    """Sizes at the start 30 times as large and as small, and those of processes; causes that correlate stay states."""
    record = own if pair is None else correlated(own, *pair)
    measured = without_corrections(record, simulate(record, 3, np.random.default_rng(0)))
    apart = StartApart.of(record, [measured], start_alone(record))
    assert len(apart.causes) == apart_causes
    for factors in ({}, *({cause: factor} for cause in range(len(record.causes)) for factor in (1.0 / 30.0, 30.0))):
        (expected,) = log_likelihood(record, measured, [factors])
        np.testing.assert_allclose(likelihoods(apart, factors), expected, rtol=RELATIVE)


def test_stages_at_once_whiten_as_one_by_one(own: FilteredRecord) -> None:
    """All but the last are four stages each; both sets of sizes have their own covariances."""
    short = replace(own, stages=own.stages[:27])
    measured, factors = without_corrections(short, simulate(short, 5, np.random.default_rng(1))), [{}, {4: 3.0}]
    expected = np.concatenate([each for each, _ in whiten(short, measured, factors)], axis=1)
    rows: list[list[Array]] = [[], []]
    for number, whitened, _ in whiten_many(short, measured, factors):
        rows[number].append(whitened.copy())
    np.testing.assert_allclose([np.concatenate(each) for each in rows], expected, rtol=1e-9, atol=1e-10)
    by_stage = sum(each for _, each in whiten(short, measured, factors))
    by_some = [sum(each for at, _, each in whiten_many(short, measured, factors) if at == number) for number in (0, 1)]
    np.testing.assert_allclose(by_some, by_stage, rtol=1e-13)


def test_gains_are_those_of_records_with_each_size_multiplied(own: FilteredRecord) -> None:
    """A record whose own size is multiplied is a sum of two records; sizes are on the grid of the likelihood."""
    simulated = simulate(own, 3, np.random.default_rng(2))
    given, drawn = simulated.chosen(slice(0, 1)), simulated.chosen(slice(1, 3))
    together = Together.of(own, given, drawn, 2, np.random.default_rng(3))
    generator = np.random.default_rng(3)
    alone = [simulate_alone(own, 2, generator, cause) for cause in range(len(own.causes))]
    extra = np.sqrt(FACTORS[-1] ** 2 - 1.0)
    records = without_corrections(own, simulated)
    multiplied = [
        Innovations(tuple(a[:, 1:] + extra * b for a, b in zip(records.values, each.values, strict=True)), each.errors)
        for each in alone
    ]
    everything = beside([records, *multiplied])
    (at_one,) = log_likelihood(own, everything, [{}])
    gains, powers = together.gains(lambda seconds: None)
    for cause in range(len(own.causes)):
        table = log_likelihood(own, everything, [{cause: factor} for factor in GRID]) - at_one
        (expected,) = _highest(table[None])
        np.testing.assert_allclose(gains[cause], expected[:3], atol=1e-7)
        np.testing.assert_allclose(powers[cause, :, -1].ravel(), expected[3:], rtol=1e-9, atol=1e-6)
