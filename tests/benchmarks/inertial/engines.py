"""mcnav's engines on an hour of flight: samples a second on one core and on two, and errors against the reference.

Free navigation has all constant errors and processes of a navigation-grade unit; aided navigation has GNSS once a
second and a filter of 15 states. Every accuracy is that of samples which the reference engine simulates with the same
constant errors and, where there is noise, the same noise: as a share of the linear sigma, or of the filter's own.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.engine import without_noise
from mcnav.contract.samples import Batch
from mcnav.runner.memory import keep_freed_memory
from mcnav.systems.ins.aided import AidedEngine, AidedReferenceEngine
from mcnav.systems.ins.ensemble.aided import simulate_aided
from mcnav.systems.ins.ensemble.free import simulate_given
from mcnav.systems.ins.imu.fine_noise import draw_noise
from mcnav.systems.ins.imu.linear_noise import respond_from_rest
from mcnav.systems.ins.scenario import EPOCHS, EnsembleEngine, ReferenceEngine
from tests.benchmarks.inertial.compare import spread
from tests.benchmarks.inertial.flight import FREE, Setup, draws, read
from tests.benchmarks.timing import enough

PROBES: Final = 64
SEED: Final = 1901
COMPARED: Final = 4
ROUNDS: Final = 5
THREADS: Final = 2
STEPS: Final = (1, 2, 4)
"""Between epochs, besides those that the engine chooses."""


@dataclass(frozen=True)
class Work:
    """An engine at work.

    Attributes
    ----------
    simulate : callable
        Simulates the samples of a number and of constant errors.
    accuracy : str
        What the engine itself states, if it has chosen the steps.
    steps : int
    error, root_mean_square : float
        Against the reference, shares of sigma.
    """

    name: str
    simulate: Callable[[int, Array], object]
    chunk: int
    errors: Array
    accuracy: str
    steps: int
    error: float
    root_mean_square: float
    compared: int


def _apart(found: Array, reference: Array, sigma: Array) -> tuple[float, float]:
    """Return the largest and the root mean square difference at all epochs after the start."""
    shares = (found - reference)[:, 1:] / sigma[1:]
    return float(np.abs(shares).max()), float(np.sqrt(np.mean(shares**2)))


def free(folder: Path, setup: Setup = FREE, compared: int = COMPARED, most: int = 1 << 16) -> list[Work]:
    """Prepare free navigation without noise and with it: with rising numbers of steps, the engine's own the last."""
    campaign = read(folder, setup)
    errors = draws(campaign, most)
    engine, reference = (campaign.scenario.engine(name, errors[:PROBES]) for name in ("ensemble", "reference"))
    if not (isinstance(engine, EnsembleEngine) and isinstance(reference, ReferenceEngine)):
        raise TypeError("expected engines of free navigation")
    linear = engine.navigation.linear
    constant = np.einsum("mij,j->mi", linear.partials**2, campaign.errors.standard_deviations**2)
    noise = sum(np.diagonal(each, axis1=1, axis2=2) for each in linear.processes.values())
    few, mechanization = errors[:compared], reference.mechanization
    drawn = [draw_noise(engine.navigation.imu, mechanization.step_times, SEED, index) for index in range(compared)]
    quiet = np.array([mechanization.simulate(each) for each in few])
    noisy = np.array([mechanization.simulate(each, *its) for each, its in zip(few, drawn, strict=True)])
    works = []
    for each in _by_steps(engine):
        navigation, tables = each.navigation, each.tables
        added = np.zeros((compared, *tables.factors.shape[:2]))
        found = simulate_given(tables, few, added)
        works.append(
            Work("free, without noise", _propagate(each), each.chunk, errors, each.accuracy, len(tables.durations),
                 *_apart(found.values, quiet, np.sqrt(constant)), compared)
        )  # fmt: skip
        for row, its in enumerate(drawn):
            # all that the processes add to a step, so that the biases of processes stay zero
            added[row, :, :9] = respond_from_rest(
                navigation.truth, navigation.platform, mechanization.step_times, _grid(each), *its
            )
        found = simulate_given(tables, few, added)
        works.append(
            Work("free, with noise", _simulate(each), each.chunk, errors, each.accuracy, len(tables.durations),
                 *_apart(found.values, noisy, np.sqrt(constant + noise)), compared)
        )  # fmt: skip
    return works


def _by_steps(engine: EnsembleEngine) -> list[EnsembleEngine]:
    """Return the engine with fewer steps, and as it is."""
    own = len(engine.tables.durations) // EPOCHS
    coarser = [steps for steps in STEPS if steps < own]
    return [*(replace(engine, tables=engine.navigation.tables(steps), accuracy="") for steps in coarser), engine]


def _propagate(engine: EnsembleEngine) -> Callable[[int, Array], object]:
    return lambda number, rows: without_noise(engine)(rows)


def _simulate(engine: EnsembleEngine | AidedEngine) -> Callable[[int, Array], object]:
    return lambda number, rows: engine.simulate(Batch(np.arange(number, number + len(rows)), rows, SEED))


def _grid(engine: EnsembleEngine) -> Array:
    """Return the times of an engine's steps."""
    durations = engine.tables.durations
    return np.asarray(engine.navigation.start + np.concatenate([[0.0], np.cumsum(durations)]))


def aided(
    folder: Path, setup: Setup, compared: int = COMPARED, most: int = 1 << 12,
    names: Sequence[str] = ("ensemble", "shared-gains"),
) -> list[Work]:  # fmt: skip
    """Prepare aided navigation with gains of each sample's own, and with those along the truth."""
    campaign = read(folder, setup)
    errors = draws(campaign, most)
    reference = campaign.scenario.engine("reference", errors[:PROBES])
    if not isinstance(reference, AidedReferenceEngine):
        raise TypeError("expected the reference of aided navigation")
    navigation, mechanization = reference.navigation, reference.mechanization
    sigma = np.sqrt(np.diagonal(navigation.linear.own, axis1=1, axis2=2))
    noise = [mechanization.draw(navigation.imu, SEED, index) for index in range(compared)]
    expected = [mechanization.simulate(errors[row], noise[row])[0] for row in range(compared)]
    works = []
    for name in names:
        engine = campaign.scenario.engine(name, errors[:PROBES])
        if not isinstance(engine, AidedEngine):
            raise TypeError("expected an ensemble of aided navigation")
        found = [_given(engine, errors[row : row + 1], reference, noise[row]) for row in range(compared)]
        difference = _apart(np.array(found), np.array(expected), sigma) if compared else (np.nan, np.nan)
        gains = "own gains" if engine.own else "shared gains"
        works.append(
            Work(f"aided, {gains}", _simulate(engine), engine.chunk, errors, engine.accuracy,
                 len(engine.tables.loop.times) - 1, *difference, compared)
        )  # fmt: skip
    return works


def _given(engine: AidedEngine, errors: Array, reference: AidedReferenceEngine, noise: Any) -> Array:
    """Simulate one sample with the reference's noise: errors at the epochs, shape (m, 9)."""
    navigation, tables = engine.navigation, engine.tables
    given = reference.given(noise)
    added = np.zeros((1, *tables.ensemble.factors.shape[:2]))
    added[0, :, :9] = respond_from_rest(
        navigation.truth, navigation.platform, reference.mechanization.step_times, tables.loop.times, noise.gyro,
        noise.accelerometer,
    )  # fmt: skip
    found = simulate_aided(
        tables, errors, 0, np.zeros(1, dtype=np.int64), engine.own, type(given)(added, given.measured)
    )
    return np.asarray(found.values[0])


def measure(works: Sequence[Work], seconds: float = 1.0, rounds: int = ROUNDS) -> list[dict[str, Any]]:
    """Time all in turns, on one thread and on two; some seconds each."""
    keep_freed_memory()  # as the program does
    counts = [_count(work, seconds) for work in works]
    alone: list[list[tuple[float, float]]] = [[] for _ in works]
    both: list[list[float]] = [[] for _ in works]
    with ThreadPoolExecutor(THREADS) as pool:
        for _ in range(rounds):
            for place, (work, count) in enumerate(zip(works, counts, strict=True)):
                processor, begin = time.process_time(), time.perf_counter()
                for piece in _pieces(work, count):
                    work.simulate(*piece)
                middle = time.perf_counter()
                alone[place].append((time.process_time() - processor, middle - begin))
                list(pool.map(lambda piece, work=work: work.simulate(*piece), _pieces(work, count)))
                both[place].append(time.perf_counter() - middle)
    rows = []
    for work, count, one, two in zip(works, counts, alone, both, strict=True):
        rows.append({
            "name": work.name, "samples": count, "accuracy": work.accuracy, "steps": work.steps, "error": work.error,
            "root_mean_square": work.root_mean_square, "compared": work.compared,
            "processor_microseconds": spread([1e6 * each[0] / count for each in one]),
            "wall_microseconds": spread([1e6 * each[1] / count for each in one]),
            "two_threads_per_second": spread([count / each for each in two]),
            "speed_up": spread([each[1] / its for each, its in zip(one, two, strict=True)]),
        })  # fmt: skip
    return rows


def _count(work: Work, seconds: float) -> int:
    """Find how many samples take some seconds: chunks in equal numbers for all threads, where there are several."""

    def simulate(count: int) -> None:
        for piece in _pieces(work, count):
            work.simulate(*piece)

    return enough(simulate, min(THREADS * work.chunk, len(work.errors)), len(work.errors), seconds)


def _pieces(work: Work, count: int) -> list[tuple[int, Array]]:
    size = min(work.chunk, -(-count // THREADS))
    return [(begin, work.errors[begin : min(begin + size, count)]) for begin in range(0, count, size)]
