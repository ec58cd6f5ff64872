"""Compiled code checks no array: those who call it refuse sizes that do not fit, and name the argument."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.compiled.jit import allocation_free
from mcnav.compiled.vectors import LANES, load, parts_of, room, store
from mcnav.systems.ins.ensemble.adjoint import run_backwards
from mcnav.systems.ins.ensemble.filter_system import Steps, Updates
from mcnav.systems.ins.ensemble.free import simulate, simulate_given
from mcnav.systems.ins.ensemble.gains import ReadingTimes, design_gains
from mcnav.systems.ins.filter.tables import StepNoise
from mcnav.systems.reentry.ensemble.history_kernel import simulate_histories as reentry_histories
from mcnav.systems.reentry.ensemble.kernel import simulate_ensemble as reentry_ensemble
from mcnav.systems.steady.ensemble import simulate_histories as steady_histories

K, U, M, N = 3, 2, 2, 11
STEPS = Steps(np.zeros((K, 9, N)), np.ones((K, N - 9)))
NOISE = StepNoise(np.zeros((K, 9, 9)), np.zeros((K, 9, N - 9)), np.zeros((K, N - 9)), np.zeros((K, N - 9)))
UPDATES = Updates(np.array([0, 0, 1, 2, 2]), np.array([2, 1]), np.ones((U, M, N)))
READINGS = ReadingTimes(np.array([1, 3]), np.array([True, False]))
UNIT = np.eye(N)


def design(**of: object) -> object:
    given = {
        "steps": STEPS, "noise": NOISE, "updates": UPDATES, "variances": np.ones((U, M)), "corrected": np.ones(N),
        "start": UNIT, "readings": READINGS,
    }  # fmt: skip
    return design_gains(**(given | of))


def backwards(**of: object) -> object:
    given = {"steps": STEPS, "updates": UPDATES, "gains": np.zeros((U, N, M)), "last": K, "end": np.zeros((9, N))}
    return run_backwards(**(given | of))


@pytest.mark.parametrize("run", [design, backwards])
def test_tables_that_fit_are_taken(run: Callable[..., object]) -> None:
    assert run() is not None


@pytest.mark.parametrize(
    ("run", "changed", "name"),
    [
        (design, {"steps": STEPS._replace(rows=np.zeros((K, 9, N + 1)))}, "steps.rows"),
        (design, {"updates": UPDATES._replace(first=np.array([0, 0, 1, 2, 3]))}, "updates.first"),
        (design, {"updates": UPDATES._replace(sizes=np.array([2, 3]))}, "updates.sizes"),
        (design, {"noise": NOISE._replace(cross=np.zeros((K, 9, 1)))}, "noise.cross"),
        (design, {"corrected": np.ones(N - 1)}, "corrected"),
        (design, {"readings": READINGS._replace(after=np.array([True]))}, "readings.after"),
        (design, {"readings": READINGS._replace(numbers=np.array([1, K + 1]))}, "readings.numbers"),
        (design, {"variances": np.ones((U, M + 1))}, "variances"),
        (backwards, {"gains": np.zeros((U, N + 1, M))}, "gains"),
        (design, {"start": np.eye(N - 1)}, "start"),
        (backwards, {"end": np.zeros((9, 9))}, "end"),
        (backwards, {"last": K + 1}, "last"),
    ],
)
def test_tables_of_a_recursion_that_do_not_fit_are_refused(
    run: Callable[..., object], changed: dict[str, object], name: str
) -> None:
    with pytest.raises(ValueError, match=f"^{name}"):
        run(**changed)


@pytest.mark.parametrize("count", [11, 13])
def test_errors_of_other_sources_are_refused_by_each_ensemble(count: int) -> None:
    """None of them has so few or so many; nothing but the check needs tables."""
    tables = SimpleNamespace(factors=np.zeros((1, 9, 9)), sizes=np.zeros(0), durations=np.ones(1))
    errors = np.zeros((2, count))
    for run in (
        lambda: simulate(tables, errors, 1, np.arange(2)),
        lambda: simulate_given(tables, errors, np.zeros((2, 1, 9))),
        lambda: reentry_ensemble(None, errors),
        lambda: reentry_histories(None, errors),
        lambda: steady_histories(None, errors, 24, np.ones(1)),
    ):
        with pytest.raises(ValueError, match=rf"^errors: got an array of shape \(2, {count}\)"):
            run()


def test_arrays_that_are_no_lanes_are_refused() -> None:
    with pytest.raises(ValueError, match=r"^lanes: got an array of shape \(3, 8\)"):
        parts_of(np.zeros((3, 8)))
    with pytest.raises(ValueError, match=r"^shape: got \(-1, 32\)"):
        room(-1)


@allocation_free
def double(x: Array) -> None:
    """Double the first row of lanes."""
    store(x, 0, 2.0 * load(x, 0))


def test_a_vector_is_of_numbers_of_64_bits_in_order() -> None:
    """Others, whose memory would be taken for such numbers, are refused where the function is compiled."""
    for array in (np.ones((1, LANES), dtype=np.float32), np.ones((1, LANES), dtype=np.int64), np.ones((LANES, 2)).T):
        with pytest.raises(TypeError, match="has no place"):
            double(array)
