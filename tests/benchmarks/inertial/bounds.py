"""What bounds the kernels of an hour's navigation: random numbers, memory, and the operations of a filter.

Random numbers are counted from the tables and timed by themselves, memory is what is read of the shared tables by a
block of lanes and written of its results, and operations are those that the structure of the equations leaves: products
with the tables of a step, and the covariance of the filter. The rest of a step is not counted, so that the share of
operations is a lower bound.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from mcnav.compiled.vectors import LANES, room
from mcnav.contract.engine import without_noise
from mcnav.contract.samples import Batch
from mcnav.sampler.normals import draw_normals
from mcnav.systems.ins.aided import AidedEngine
from mcnav.systems.ins.ensemble.free import EnsembleTables
from mcnav.systems.ins.imu.instruments import IMU_STREAM, process_sizes
from mcnav.systems.ins.scenario import EnsembleEngine
from tests.benchmarks.inertial.engines import PROBES, SEED
from tests.benchmarks.inertial.flight import FREE, Setup, draws, read
from tests.benchmarks.operations import rates
from tests.benchmarks.timing import fastest

NAVIGATION: Final = 9
NORMALS: Final = 1_000
"""Variates of each lane: some steps, which stay in the cache."""


def filter_operations(states: int, components: int) -> dict[str, int]:
    """Count the operations of a filter's step and update, with the structure of the equations used.

    In a step attitude depends on itself and on gyros alone, velocity and position on all states, and biases on
    themselves; the covariance is symmetric. An update takes its components one after the other. A multiplication and an
    addition are two operations.

    >>> filter_operations(15, 6)
    {'step': 4320, 'update': 1800}
    """
    attitude, others = 3 * 3 * states, 6 * states * states
    back = NAVIGATION * (NAVIGATION + 1) // 2 * states
    one = states * (states + 1) // 2 + 2 * states
    return {"step": 2 * (attitude + others + back), "update": 2 * components * one}


def step_operations(tables: EnsembleTables, sources: int, noisy: bool) -> int:
    """Count the operations of a step's products with the shared tables: linear response, sources, processes."""
    width, biases = tables.factors.shape[1], len(tables.sizes)
    linear = 6 * 9 + 6 * 9 // 2  # what is linear, and the products of force with the turn of the sample
    noise = width * (width + 1) // 2 + 9 * biases if noisy else 0
    return 2 * (linear + 9 * sources + noise)


def arrays(holder: Any) -> Iterator[np.ndarray]:
    """Yield all arrays that a dataclass holds, in it and below."""
    for field in fields(holder):
        value = getattr(holder, field.name)
        if isinstance(value, np.ndarray):
            yield value
        elif is_dataclass(value):
            yield from arrays(value)


def normal_nanoseconds(seconds: float = 0.2) -> float:
    """Time one normal variate of the kernels' generator."""
    samples, out = np.arange(LANES, dtype=np.uint64)[None], room(NORMALS)

    def run() -> None:
        draw_normals(np.uint64(SEED), samples, IMU_STREAM, 0, NORMALS, out)

    run()
    return 1e9 * fastest(run, seconds).processor / (NORMALS * LANES)


def copy_bytes_per_second(seconds: float = 0.2) -> float:
    """Measure what a copy of a large array moves in a second, both ways."""
    source = np.ones(1 << 24)
    other = np.empty_like(source)
    return 2 * source.nbytes / fastest(lambda: np.copyto(other, source), seconds).processor


def measure(folder: Path, setup: Setup, free: Setup = FREE, seconds: float = 0.5) -> list[dict[str, Any]]:
    """Return a row for each kernel: without and with noise, own and shared gains."""
    normal, peak, copied = normal_nanoseconds(), rates(0.2)["simple"], copy_bytes_per_second()
    rows = [*_free(folder, free, seconds), *_aided(folder, setup, seconds)]
    for row in rows:
        spent = 1e-6 * row["microseconds"]
        row |= {
            "normal_nanoseconds": normal, "normals_share": 1e-9 * normal * row["normals"] / spent,
            "peak_operations_per_second": peak, "operations_share": row["operations"] / peak / spent,
            "peak_bytes_per_second": copied, "memory_share": row["bytes"] / copied / spent,
        }  # fmt: skip
    return rows


def _free(folder: Path, setup: Setup, seconds: float) -> Iterator[dict[str, Any]]:
    campaign = read(folder, setup)
    engine = campaign.scenario.engine("ensemble", draws(campaign, PROBES))
    if not isinstance(engine, EnsembleEngine):
        raise TypeError("expected the ensemble of free navigation")
    errors, tables = draws(campaign, engine.chunk), engine.tables
    sources = int(errors[:, NAVIGATION:].any(axis=0).sum())
    batch, steps = Batch(np.arange(len(errors)), errors, SEED), len(tables.durations)
    quiet = tables.without_noise().at_the_end()
    for name, noisy, own, run in (
        ("free, without noise", False, quiet, lambda: without_noise(engine)(errors)),
        ("free, with noise", True, tables, lambda: engine.simulate(batch)),
    ):
        run()
        normals = len(own.sizes) + steps * own.factors.shape[1] if noisy else 0
        yield {
            "name": name, "steps": steps, "microseconds": 1e6 * fastest(run, seconds).processor / len(errors),
            "normals": normals, "operations": steps * step_operations(own, sources, noisy),
            "bytes": _bytes(own, len(own.epochs) * 2 * NAVIGATION * 8),
        }  # fmt: skip


def _aided(folder: Path, setup: Setup, seconds: float) -> Iterator[dict[str, Any]]:
    campaign = read(folder, setup)
    for name in ("ensemble", "shared-gains"):
        engine = campaign.scenario.engine(name, draws(campaign, PROBES))
        if not isinstance(engine, AidedEngine):
            raise TypeError("expected an ensemble of aided navigation")
        errors = draws(campaign, engine.chunk)
        batch, tables = Batch(np.arange(len(errors)), errors, SEED), engine.tables
        result = engine.simulate(batch)
        run = partial(engine.simulate, batch)
        (sensor,) = engine.navigation.sensors
        steps, updates, components = len(tables.ensemble.durations), len(sensor.times), len(sensor.components)
        noisy = bool(process_sizes(engine.navigation.imu))
        sources = int(errors[:, NAVIGATION:].any(axis=0).sum())
        filtered = filter_operations(NAVIGATION + len(engine.filter.states), components)
        own = steps * filtered["step"] + updates * filtered["update"] if engine.own else 0
        # a sample and its linear twin go along together
        both = 2 * steps * step_operations(tables.ensemble, sources, noisy)
        written = sum(each.nbytes for each in (result.history, result.filter_values) if each is not None) / len(errors)
        yield {
            "name": "aided, own gains" if engine.own else "aided, shared gains", "steps": steps,
            "microseconds": 1e6 * fastest(run, seconds).processor / len(errors),
            "normals": steps * tables.ensemble.factors.shape[1] + updates * components,
            "operations": own + both, "bytes": _bytes(tables, written),
        }  # fmt: skip


def _bytes(tables: Any, written: float) -> float:
    """Return what a sample moves: its share of a pass over the tables, and its results."""
    return sum(each.nbytes for each in arrays(tables)) / LANES + written
