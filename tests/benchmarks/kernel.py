"""The ensemble's kernel by itself: work against precision, two threads, epochs, and what bounds it.

    python -m tests.benchmarks.kernel [TRAJECTORY ...]

prints, for each trajectory, the ensemble on rising numbers of nodes; as a campaign would refine it, on one thread and
two; with errors read out at epochs; and its operations counted, beside what one core does of them in such loops. The
ensemble's own finest grid is the measure of its convergence, the reference engine that of its truth.
"""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, Final

import numpy as np

from mcnav.systems.reentry.engines import HISTORY_NODES
from mcnav.systems.reentry.ensemble.grid import Grid, shared_grid
from mcnav.systems.reentry.ensemble.history_kernel import history_grid, history_sums
from mcnav.systems.reentry.ensemble.kernel import simulate_ensemble
from mcnav.systems.reentry.ensemble.refinement import FINEST, refined_grid
from mcnav.systems.reentry.ensemble.transition import Response, linear_response
from mcnav.systems.reentry.outputs import DEVIATIONS
from mcnav.systems.reentry.scenario import SOURCES
from mcnav.systems.reentry.table_i import TABLE_I, among_all
from tests.benchmarks.build import case_of, scenario_of
from tests.benchmarks.case import Case
from tests.benchmarks.operations import KINDS, of_sample, rates, shortest
from tests.benchmarks.timing import fastest

NODES: Final = (24, 34, 48, 68, 96, 136, 192)
TOLERANCES: Final = (1e-5, 1e-6)
"""Of the refinement; a campaign's is the latter."""

PROBES: Final = 64
EPOCHS: Final = (60, 200)
FLOWN: Final = 65_536
CHUNK: Final = 8_192
BYTES: Final = 8 * (len(SOURCES) + len(DEVIATIONS))
"""Read and written of a sample: everything else stays in the cache."""


def measure(case: Case, seconds: float = 0.3) -> dict[str, Any]:
    """Everything about one trajectory."""
    navigation = scenario_of(case.number).navigation
    response = linear_response(navigation.trajectory, navigation.start, navigation.theta_axes)
    samples = among_all(case.draws(FLOWN))
    refined = [
        refined_grid(navigation.trajectory, navigation.start, navigation.theta_axes, samples[:PROBES], tolerance)
        for tolerance in TOLERANCES
    ]
    return {
        "trajectory": case.number,
        "nodes": _by_nodes(case, response, samples, seconds),
        "refined": [
            {"tolerance": tolerance, "nodes": found.nodes, **_threads(case, found.grid, samples, seconds)}
            for tolerance, found in zip(TOLERANCES, refined, strict=True)
        ],
        "epochs": _by_epochs(response, refined[-1].nodes, samples[:CHUNK], seconds),
        "bound": _bound(refined[-1].grid, samples[:CHUNK], seconds),
    }


def _by_nodes(case: Case, response: Response, samples: np.ndarray, seconds: float) -> list[dict[str, Any]]:
    compared = samples[: len(case.reference)]
    finest, _ = simulate_ensemble(shared_grid(response, FINEST), compared)
    found = []
    for nodes in NODES:
        grid = shared_grid(response, nodes)
        values, _ = simulate_ensemble(grid, compared)
        spent = fastest(lambda grid=grid: simulate_ensemble(grid, samples[:CHUNK]), seconds).processor / CHUNK
        against_finest = float((np.abs(values - finest) / case.sigma).max())
        found.append(
            {
                "nodes": nodes,
                "microseconds": spent * 1e6,
                "against_finest": against_finest,
                "against_reference": case.error(values),
            }
        )
    return found


def _threads(case: Case, grid: Grid, samples: np.ndarray, seconds: float) -> dict[str, float]:
    """One thread and two over the same samples."""
    fly, chunks = partial(simulate_ensemble, grid), np.split(samples, len(samples) // CHUNK)
    alone = fastest(lambda: [fly(chunk) for chunk in chunks], seconds).wall
    with ThreadPoolExecutor(2) as pool:
        both = fastest(lambda: list(pool.map(fly, chunks)), seconds).wall
    values, _ = simulate_ensemble(grid, samples[: len(case.reference)])
    return {
        "microseconds": alone / len(samples) * 1e6,
        "error": case.error(values),
        "two_threads_samples_per_second": len(samples) / both,
        "two_threads_efficiency": alone / (2.0 * both),
    }


def _by_epochs(response: Response, nodes: int, samples: np.ndarray, seconds: float) -> list[dict[str, float]]:
    """Final errors alone, and the second pass in which power sums of all errors are taken at epochs."""
    final = shared_grid(response, nodes)
    alone = fastest(lambda: simulate_ensemble(final, samples), seconds).processor
    found = [{"epochs": 0, "microseconds": alone / len(samples) * 1e6}]
    for count in EPOCHS:
        times = np.linspace(response.start, response.end, count)
        grid = history_grid(response, int(np.ceil(HISTORY_NODES * nodes)), times)
        spent = alone + fastest(lambda grid=grid: history_sums(grid, samples), seconds).processor
        found.append({"epochs": count, "microseconds": spent / len(samples) * 1e6})
    return found


def _bound(grid: Grid, samples: np.ndarray, seconds: float) -> dict[str, float]:
    """Operations of a sample, how fast they were done, and how fast one core can do them and move memory."""
    operations, per_second = of_sample(grid), rates(seconds)
    spent = fastest(lambda: simulate_ensemble(grid, samples), seconds).processor / len(samples)
    room = np.ones(1 << 24)
    other = np.empty_like(room)
    copied = 2 * room.nbytes / fastest(lambda: np.copyto(other, room), seconds).wall
    total = sum(operations[kind] for kind in KINDS)
    return {
        "nodes": len(grid.readout),
        "forced_intervals": int(grid.forced.sum()),
        "operations": total,
        **{f"operations_{kind}": operations[kind] for kind in KINDS},
        "microseconds": spent * 1e6,
        "operations_per_second": total / spent,
        **{f"peak_{kind}": per_second[kind] for kind in KINDS},
        "shortest_microseconds": shortest(operations, per_second) * 1e6,
        "bytes": BYTES,
        "bytes_per_second": BYTES / spent,
        "peak_bytes_per_second": copied,
    }


def told(found: dict[str, Any]) -> str:
    """The measurements of one trajectory as text."""
    lines = [f"trajectory {found['trajectory']}"]
    lines += ["  nodes    us per sample   error against the finest grid   against the reference path"]
    lines += [
        f"  {row['nodes']:5d} {row['microseconds']:14.3f} {row['against_finest']:20.1e}"
        f" {row['against_reference']:28.1e}"
        for row in found["nodes"]
    ]
    lines += [
        f"  refined to {row['tolerance']:.0e}: {row['nodes']} nodes, {row['microseconds']:.3f} us, {row['error']:.1e} "
        f"against the reference path; {row['two_threads_samples_per_second'] / 1e6:.1f} million samples/s on two "
        f"threads, {row['two_threads_efficiency']:.0%} of twice one"
        for row in found["refined"]
    ]
    lines += [f"  with {row['epochs']} epochs: {row['microseconds']:.3f} us" for row in found["epochs"]]
    return "\n".join([*lines, "  " + sentence(found["bound"])])


def sentence(bound: dict[str, float]) -> str:
    """What bounds the kernel, as measured."""
    share = bound["operations_per_second"] / bound["peak_simple"]
    least = bound["shortest_microseconds"] / bound["microseconds"]
    memory = bound["bytes_per_second"] / bound["peak_bytes_per_second"]
    return (
        f"{bound['nodes']:.0f} nodes, {bound['forced_intervals']:.0f} intervals with force: {bound['operations']:,.0f} "
        f"operations a sample in {bound['microseconds']:.3f} us, {bound['operations_per_second'] / 1e9:.0f} billion a "
        f"second. In such a loop one core does {bound['peak_simple'] / 1e9:.0f} billion as fused multiply-adds: "
        f"{share:.0%} of that; with divisions and roots, {least:.0%} of the time at best. Memory moves "
        f"{bound['bytes_per_second'] / 1e9:.2f} GB/s, {memory:.1%} of what a copy does"
    )


if __name__ == "__main__":
    for chosen in [int(argument) for argument in sys.argv[1:]] or TABLE_I:
        print(told(measure(case_of(chosen))), flush=True)
