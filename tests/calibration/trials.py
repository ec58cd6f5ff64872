"""Synthetic campaigns, and whether each statement of the program about them is right."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np
from scipy import special

from mcnav.analysis.comparison import Comparison, Criterion, compare, correlations
from mcnav.analysis.requirements import Finding, Requirement, independent_samples, judge_requirement
from mcnav.arrays.types import Array, IndexArray
from mcnav.sampler.designs import SamplingDesign, standard_normals
from mcnav.sampler.distributions import Distribution, Normal, StudentT
from mcnav.statistics.hypothesis_test import HypothesisTest
from tests.calibration.cells import LEVEL, Cell, Tally, tally
from tests.calibration.systems import SYSTEMS, SyntheticSystem, Truth

CRITERION: Final = Criterion(tolerance=0.01, confidence=1.0 - 3.0 * (1.0 - LEVEL))
"""Joint confidence that gives each of three statements (two outputs and the matrix) `LEVEL`."""

SIZES: Final = (100, 500, 1000, 2000, 5000)
TAIL: Final = 0.99
"""Quantile whose upper bound is tested."""

SOURCES: Final[dict[str, tuple[Distribution, float, float]]] = {
    "normal": (Normal(1.0), 3.0, 15.0),
    "student-t 10": (StudentT(1.0, 10.0), 4.0, 40.0),
    "student-t 5": (StudentT(1.0, 5.0), 9.0, math.inf),
}
"""Distributions of all sources with their fourth and sixth moments."""

HELD_FIXED: Final = {"dependent": "false alarm", "bent": "power"}
"""Systems of dependent outputs, and what the verdict on their combination shows."""

HEAVIEST: Final = "student-t 5"
"""Distribution used with the quadratic system only, to show the effect of its tails."""


def run_trials(trials: int, jobs: int, designs: Sequence[str], sizes: Sequence[int] = SIZES) -> Tally:
    """Simulate so many campaigns for each system, distribution, design and size, with seeds 0, 1, ..."""
    return tally(trials, jobs, [(design, size) for design in designs for size in sizes], _count)


def _count(kind: tuple[str, int], seeds: Sequence[int], result: Tally) -> None:
    design, count = kind
    blocks = SamplingDesign.of(design, count).blocks(np.arange(count))
    for seed in seeds:
        normals = standard_normals(design, seed, count, 0, count, 3)
        for sources, (distribution, fourth, sixth) in SOURCES.items():
            errors = distribution.transform(normals)
            for name, system in SYSTEMS.items():
                if sources == HEAVIEST and name != "quadratic":
                    continue
                outputs = system.simulate(errors, fourth)
                normal = sources == "normal"
                judged = compare(system.model, errors, outputs, CRITERION, SamplingDesign.of(design, count, normal))
                truth = system.truth(fourth, sixth)
                for statement, sort, hit in _statements(name, system, truth, judged, outputs, blocks, sources):
                    result.add(Cell(sort, name, statement, sources, design, count), hit)


Statement = tuple[str, str, bool]


def _statements(
    name: str, system: SyntheticSystem, truth: Truth, comparison: Comparison, outputs: Array, blocks: IndexArray,
    sources: str,
) -> Iterator[Statement]:  # fmt: skip
    if name == "corrupted":
        yield from _powers(comparison)
        return
    if name in HELD_FIXED:
        if comparison.ellipsoid is not None:
            yield "verdict: what is held fixed is dispersed", HELD_FIXED[name], comparison.ellipsoid.surprised
        return
    yield from _covered(name, system, truth, comparison)
    if name in ("linear", "disguised"):
        yield from _alarms(name, comparison, sources)
    if name == "linear" and sources == "normal":
        yield from _tail(system, comparison, outputs, blocks)


def _within(value: float, interval: tuple[float, float] | None) -> bool:
    return interval is not None and interval[0] <= value <= interval[1]


def _covered(name: str, system: SyntheticSystem, truth: Truth, comparison: Comparison) -> Iterator[Statement]:
    """Yield whether intervals cover the truth; differences that are exactly zero have no interval."""
    linear = system.model.outcome_covariance
    ratios = np.sqrt(np.diag(truth.covariance) / np.diag(linear))
    first = comparison.outputs[0]
    if first.plain.interval is None or not math.isfinite(first.plain.interval[1]):
        return
    yield "plain sigma ratio", "coverage", _within(ratios[0], first.plain.interval)
    joint, ellipsoid = comparison.joint, comparison.ellipsoid
    if joint is not None and truth.skewness is not None:
        yield "skewness", "coverage", _within(truth.skewness, joint.skewness[0].interval(LEVEL))
    if name == "linear":
        return
    yield "paired sigma ratio", "coverage", _within(ratios[0], first.paired.interval)
    yield "bias", "coverage", _within(truth.mean[0], first.bias.interval(LEVEL))
    if joint is not None:
        difference = correlations(truth.covariance)[0, 1] - correlations(linear)[0, 1]
        interval = joint.correlations[0].difference.interval(LEVEL)
        yield "correlation difference", "coverage", _within(difference, interval)
    if ellipsoid is not None:
        about = truth.covariance + np.outer(truth.mean, truth.mean)
        expected = float(np.trace(np.linalg.solve(linear, about)))
        yield "mean NEES", "coverage", _within(expected, ellipsoid.nees_paired.interval(LEVEL))


def _alarms(name: str, comparison: Comparison, sources: str) -> Iterator[Statement]:
    """Yield whether tests reject true hypotheses."""
    joint = comparison.joint
    if joint is None:
        return
    tests: dict[str, HypothesisTest | None] = {"bias, Hotelling": joint.bias}
    if name == "disguised":
        tests = {"covariance, paired": joint.covariance_paired, "bias, paired": joint.bias_paired}
    elif sources == "normal":
        normality = joint.normality
        tests |= {
            "covariance, likelihood ratio": joint.covariance,
            "NEES, Kolmogorov-Smirnov": joint.nees,
            "Mardia's skewness": normality.skewness_test if normality else None,
            "Mardia's kurtosis": normality.kurtosis_test if normality else None,
        }
    yield from _rejections(tests, "false alarm")


def _rejections(tests: Mapping[str, HypothesisTest | None], kind: str) -> Iterator[Statement]:
    for statement, test in tests.items():
        if test is not None:
            yield statement, kind, test.p_value < 1.0 - LEVEL


def _tail(system: SyntheticSystem, comparison: Comparison, outputs: Array, blocks: IndexArray) -> Iterator[Statement]:
    """Yield whether the upper bound of a quantile holds: a limit at the quantile is met only if the bound is wrong."""
    limit = float(special.ndtri(0.5 + 0.5 * TAIL))
    required = Requirement("quantile", (0,), (limit,), TAIL)
    if not independent_samples(blocks)[1]:
        judged = judge_requirement(required, system.model, outputs, blocks, comparison, LEVEL)
        yield f"|y| at {100.0 * TAIL:g} %, upper bound", "coverage", judged.finding != Finding.MET


def _powers(comparison: Comparison) -> Iterator[Statement]:
    """Yield whether the wrong matrix is detected."""
    first, joint = comparison.outputs[0], comparison.joint
    yield "plain sigma ratio is not one", "power", first.plain.certain
    yield "paired sigma ratio is not one", "power", first.paired.certain
    yield "verdict: differs by more than 1 %", "power", first.paired.verdict.value == "differs"
    if joint is not None:
        tests = {"covariance, likelihood ratio": joint.covariance, "covariance, paired": joint.covariance_paired}
        yield from _rejections(tests, "power")
