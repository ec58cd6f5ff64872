"""Work against precision: microseconds per sample and core, and the largest error as a share of sigma.

    python -m tests.benchmarks.work_precision [TRAJECTORY ...]

Three parts for each trajectory, on the same draws of the report's errors: the ensemble on rising numbers of nodes; the
ensemble as a campaign would refine it, on one thread and two; and scipy's DOP853 on the polar equations, at several
tolerances. The ensemble's own finest grid is the measure of its convergence, the reference path that of its truth.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from unittest.mock import patch

import numpy as np

from mcnav.linear.covariance import propagated_covariance
from mcnav.physics import navigator
from mcnav.physics.ensemble import fly_ensemble
from mcnav.physics.grid import shared_grid
from mcnav.physics.refinement import FINEST, refined_grid
from mcnav.scenarios.tn_d1772 import ERRORS, TABLE_I
from tests.conftest import reentry, response

NODES = (24, 34, 48, 68, 96, 136, 192)
TOLERANCES = (1e-8, 1e-10, 1e-12)
"""Of DOP853; looser ones lose the truths that skip altogether."""
REPEATS = 9
FLOWN, COMPARED, BY_SCIPY = 65_536, 200, 5


def fastest(work: Callable[[], object]) -> float:
    """The shortest of several runs, s: what other processes took from the rest does not count."""
    times = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return min(times)


def measure(number: int) -> None:
    """Print the table of one trajectory."""
    scenario = reentry(number)
    navigation = scenario.navigation
    generator = np.random.default_rng(1772)
    samples = generator.standard_normal((FLOWN, len(ERRORS))) * ERRORS
    compared = samples[:COMPARED]
    sigma = np.sqrt(np.diag(propagated_covariance(scenario.linearised().partials, np.diag(ERRORS**2))))
    flown = navigation.by_reference(compared, range(COMPARED)).values
    truth = np.array([flown[row] for row in range(COMPARED)])
    finest, _ = fly_ensemble(shared_grid(response(scenario), FINEST), compared)

    def share(values: np.ndarray, best: np.ndarray) -> float:
        return float((np.abs(values - best[: len(values)]) / sigma).max())

    print(f"trajectory {number}")
    print("  nodes    us per sample   error against the finest grid   against the reference path")
    for nodes in NODES:
        grid = shared_grid(response(scenario), nodes)
        values, _ = fly_ensemble(grid, compared)
        spent = fastest(lambda grid=grid: fly_ensemble(grid, samples[:8192])) / 8192
        print(f"  {nodes:5d} {spent * 1e6:14.3f} {share(values, finest):20.1e} {share(values, truth):28.1e}")

    for tolerance in (1e-5, 1e-6):
        refined = refined_grid(navigation.trajectory, navigation.start, navigation.theta_axes, samples[:64], tolerance)
        alone = fastest(lambda grid=refined.grid: fly_ensemble(grid, samples)) / FLOWN
        fly, chunks = partial(fly_ensemble, refined.grid), np.split(samples, 8)
        with ThreadPoolExecutor(2) as pool:
            both = fastest(lambda pool=pool, fly=fly, chunks=chunks: list(pool.map(fly, chunks)))
        values, _ = fly_ensemble(refined.grid, compared)
        print(
            f"  refined to {tolerance:.0e}: {refined.nodes} nodes, {alone * 1e6:.3f} us, {share(values, truth):.1e} "
            f"against the reference path; {FLOWN / both / 1e6:.1f} million samples/s on two threads"
        )

    for tolerance in TOLERANCES:
        with patch.object(navigator, "RELATIVE_TOLERANCE", tolerance):
            begin = time.perf_counter()
            by_scipy = navigation.by_reference(compared, range(BY_SCIPY)).values
            spent = (time.perf_counter() - begin) / BY_SCIPY
        values = np.array([by_scipy[row] for row in range(BY_SCIPY)])
        print(f"  scipy's DOP853 at {tolerance:.0e}: {spent * 1e6:.0f} us, {share(values, truth):.1e}")


if __name__ == "__main__":
    for chosen in [int(argument) for argument in sys.argv[1:]] or TABLE_I:
        measure(chosen)
