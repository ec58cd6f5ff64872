"""Gains that are computed again in blocks, and tables of updates whose rows are computed where they are asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mcnav.arrays import rows as tables
from mcnav.arrays.rows import Rows, Table, rows_at
from mcnav.arrays.types import Array
from mcnav.contract.timeline import Timeline
from mcnav.linear.engine import design as designs
from mcnav.linear.engine.adjoint import adjoint
from mcnav.linear.engine.innovations import innovation_laws
from mcnav.linear.engine.propagate import propagate
from mcnav.linear.engine.smoother import smooth
from tests.timelines import arbitrary

HELD = arbitrary(7, 700, knows_truth=True)
POSITIONS = np.array([0, 255, 256, 300, 700])
UPDATES = np.array([201, 3])


def in_rows(timeline: Timeline) -> Timeline:
    """Return the timeline with tables of its updates that compute rows."""
    updates, filtered = timeline.updates, timeline.filter
    assert updates is not None
    assert filtered is not None
    own = {"responses": computed(filtered.responses), "variances": computed(filtered.variances)}
    true = {"responses": computed(updates.responses), "disturbances": computed(updates.disturbances)}
    variances = {name: computed(table) for name, table in updates.variances.items()}
    return replace(timeline, updates=replace(updates, variances=variances, **true), filter=replace(filtered, **own))


def computed(table: Table) -> Rows:
    """Return a table that computes the rows of another."""
    return Rows(table.shape, lambda first, last: table[first:last])


def answers(timeline: Timeline) -> list[Array]:
    """Return answers of the engine that take gains and tables of updates."""
    designed = designs.design(timeline, POSITIONS)
    read = propagate(timeline, designed.gains, POSITIONS)
    together = propagate(timeline, designed.gains, POSITIONS, by_cause=False)
    (law,) = innovation_laws(timeline, designed.gains, np.array([150]))
    smoothed = smooth(timeline, designed, POSITIONS, lag=40.0)
    return [
        designed.gains[:], designed.roots[:], designed.covariances, designed.gains[90:211],
        rows_at(designed.roots, UPDATES), read.partials, read.covariances, together.covariances,
        law.partials, law.noise, law.responses, adjoint(timeline, designed.gains, 600, np.eye(6)),
        smoothed.claimed, smoothed.partials, smoothed.covariances,
        designs.design(timeline, POSITIONS, gains=0.5 * designed.gains[:]).covariances,
    ]  # fmt: skip


@pytest.mark.parametrize("knows_truth", [True, False])
def test_blocks_have_the_bits_of_the_whole(monkeypatch: pytest.MonkeyPatch, knows_truth: bool) -> None:
    held = arbitrary(7, 700, knows_truth)
    whole = answers(held)
    monkeypatch.setattr(tables, "KEPT", 0)
    monkeypatch.setattr(designs, "KEPT", 0)
    rows = in_rows(held)
    assert isinstance(designs.design(rows).gains, Rows)
    for one, other in zip(whole, answers(rows), strict=True):
        assert np.isfinite(one).all()
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("begin", [0, 100, 300])
def test_gains_of_a_later_start_are_zero_before_it(monkeypatch: pytest.MonkeyPatch, begin: int) -> None:
    whole = designs.design(HELD, begin=begin)
    monkeypatch.setattr(designs, "KEPT", 0)
    blocks = designs.design(HELD, begin=begin)
    for one, other in ((whole.gains, blocks.gains), (whole.roots, blocks.roots)):
        np.testing.assert_array_equal(one[:], other[:])
        assert not one[: int(HELD.updates_before[begin])].any()


def test_a_table_that_is_short_is_computed_once() -> None:
    asked: list[tuple[int, int]] = []

    def make(first: int, last: int) -> Array:
        asked.append((first, last))
        return np.arange(first, last, dtype=float)

    table, long = Rows((10,), make), Rows((tables.KEPT + 1,), make)
    assert (table[2:4].tolist(), table[8:].tolist()) == ([2.0, 3.0], [8.0, 9.0])
    assert (long[2:4].tolist(), long[5:3].tolist(), float(long[7])) == ([2.0, 3.0], [], 7.0)
    assert asked == [(0, 10), (2, 4), (5, 5), (7, 8)]
