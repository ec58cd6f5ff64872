"""Synthetic campaigns with process noise, and whether each statement of the program about them is right.

The sources are drawn by the design, the noise by a generator of its own for each campaign. `TWINS` are two campaigns
that are compared with each other, with the same draws or with others.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from mcnav.analysis.comparison import Comparison, compare, correlations
from mcnav.analysis.linear_samples import doubt_noise
from mcnav.analysis.run_comparison import SampleSet, change
from mcnav.analysis.verdict import Verdict
from mcnav.arrays.types import Array
from mcnav.sampler.designs import SamplingDesign, standard_normals
from tests.calibration.cells import LEVEL, Cell, Tally, tally
from tests.calibration.noise_systems import CRITERION, NOISY_SYSTEMS, OUTCOME, NoisySystem, curved

NOISE: Final = "noise"
"""Beginning of the names of the systems."""

DESIGNS: Final = ("random", "antithetic", "latin-hypercube")
"""Designs of campaigns with noise."""

SIZES: Final = (100, 200, 500, 2_000)
TWINS: Final = (0.2, 0.3)
"""Curvatures of two quadratic systems that are compared."""

TWIN: Final = "noise, twins"
DETECTABLE: Final = "plain sigma ratio is not one, larger by the detectable difference"
DOUBTED: Final = "linear outcomes doubted"

Statement = tuple[str, str, bool]


def run_noise_trials(trials: int, jobs: int, designs: Sequence[str] = DESIGNS, sizes: Sequence[int] = SIZES) -> Tally:
    """Simulate so many campaigns of each system, design and size, with seeds 0, 1, ..."""
    return tally(trials, jobs, [(design, size) for design in designs for size in sizes], _count)


def draws(design: str, seed: int, count: int) -> tuple[Array, Array]:
    """Draw sources, shape (n, 3), and noise, shape (n, 2), of one campaign."""
    generator = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=(count, 3))))
    return standard_normals(design, seed, count, 0, count, 3), generator.standard_normal((count, 2))


def _count(kind: tuple[str, int], seeds: Sequence[int], result: Tally) -> None:
    design, count = kind
    sampling = SamplingDesign.of(design, count)
    for seed in seeds:
        given = draws(design, seed, count)
        for name, system in NOISY_SYSTEMS.items():
            simulated, linear = system.simulate(*given)
            judged = compare(system.model, given[0], simulated, CRITERION, sampling, linear)
            for statement in _statements(name, system, judged):
                _add(result, name, statement, kind)
            if design == "random" and name in ("noise, linear", "noise, covariance wrong"):
                doubted = doubt_noise(system.model, given[0], linear, 0.0) is not None
                sort = "false alarm" if name == "noise, linear" else "power"
                _add(result, name, (DOUBTED, sort, doubted), kind)
            if design == "random" and name == "noise, linear":
                _add(result, name, (DETECTABLE, "power", _detected(system, given, judged, sampling)), kind)
        for statement in _twins(design, seed, count, sampling):
            _add(result, TWIN, statement, kind)


def _add(result: Tally, system: str, statement: Statement, kind: tuple[str, int]) -> None:
    words, sort, hit = statement
    result.add(Cell(sort, system, words, "normal", *kind), hit)


def _within(value: float, interval: tuple[float, float] | None) -> bool:
    return interval is not None and interval[0] <= value <= interval[1]


def _statements(name: str, system: NoisySystem, judged: Comparison) -> Iterator[Statement]:
    first = judged.outputs[0]
    if first.plain.interval is None or not np.isfinite(first.plain.interval[1]):
        return
    ratio = float(np.sqrt(system.truth.covariance[0, 0] / OUTCOME[0, 0]))
    if name == "noise, response wrong":
        yield "paired sigma ratio is not one", "power", first.paired.certain
        yield "plain sigma ratio is not one", "power", first.plain.certain
    elif name == "noise, at the tolerance":
        yield "verdict: agrees or differs", "false alarm", first.paired.verdict != Verdict.UNDECIDED
    elif name != "noise, covariance wrong":
        yield "plain sigma ratio", "coverage", _within(ratio, first.plain.interval)
        yield from _jointly(name, system, judged)
        if name != "noise, linear":
            yield "paired sigma ratio", "coverage", _within(ratio, first.paired.interval)
            yield "bias", "coverage", _within(float(system.truth.mean[0]), first.bias.interval(LEVEL))


def _jointly(name: str, system: NoisySystem, judged: Comparison) -> Iterator[Statement]:
    """Yield statements on both outputs together."""
    joint, ellipsoid, truth = judged.joint, judged.ellipsoid, system.truth
    if joint is None or ellipsoid is None:
        return
    if truth.skewness is not None:
        yield "skewness", "coverage", _within(truth.skewness, joint.skewness[0].interval(LEVEL))
    if name == "noise, linear":
        tests = {"covariance, likelihood ratio": joint.covariance, "NEES, Kolmogorov-Smirnov": joint.nees}
        yield from ((test, "false alarm", each.p_value < 1.0 - LEVEL) for test, each in tests.items() if each)
        return
    given = system.model.outcome_covariance
    difference = correlations(truth.covariance)[0, 1] - correlations(given)[0, 1]
    yield "correlation difference", "coverage", _within(difference, joint.correlations[0].difference.interval(LEVEL))
    about = truth.covariance + np.outer(truth.mean, truth.mean)
    expected = float(np.trace(np.linalg.solve(given, about)))
    yield "mean NEES", "coverage", _within(expected, ellipsoid.nees_paired.interval(LEVEL))


def _detected(system: NoisySystem, given: tuple[Array, Array], judged: Comparison, sampling: SamplingDesign) -> bool:
    """Return whether the plain estimate finds a sigma larger by what it is said to detect in 90 % of campaigns."""
    simulated, linear = system.simulate(*given)
    larger = (1.0 + judged.outputs[0].detectable_plain) * simulated
    return compare(system.model, given[0], larger, CRITERION, sampling, linear).outputs[0].plain.certain


def _twins(design: str, seed: int, count: int, sampling: SamplingDesign) -> Iterator[Statement]:
    """Yield whether the interval of the sigma ratio of two campaigns covers it, with common draws and without."""
    before, after = (curved(curvature) for curvature in TWINS)
    true = float(np.sqrt(after.truth.covariance[0, 0] / before.truth.covariance[0, 0]))
    first = _sample_set(before, draws(design, seed, count), sampling)
    for common in (True, False):
        second = _sample_set(after, draws(design, seed if common else seed + 10**6, count), sampling)
        statements = change(first, second, (0, 0), common, LEVEL)
        if np.isfinite(statements.interval[1]) and statements.interval[1] < 1e100:
            words = "with the same draws" if common else "with other draws"
            yield f"sigma ratio of two runs {words}", "coverage", _within(true, statements.interval)


def _sample_set(system: NoisySystem, given: tuple[Array, Array], sampling: SamplingDesign) -> SampleSet:
    simulated, linear = system.simulate(*given)
    return SampleSet(system.model, np.arange(len(linear)), given[0], simulated, sampling, linear)
