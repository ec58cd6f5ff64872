"""Synthetic campaigns with errors over time, and whether requirements and quantiles of them are judged rightly.

Three outputs of three constant sources and of random walks, at twelve epochs, all normal; requirements are judged at
the end and at each epoch, with an analyst's numbers of runs.

`errors rising`
    Sigmas grow threefold; the largest quantile is that of the last epoch.
`errors steady`
    All epochs have the same covariance, and are correlated by 0.9: the largest of the estimated quantiles is one of
    twelve that are equal.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mcnav.analysis.comparison import Comparison, Criterion, compare
from mcnav.analysis.model import Model
from mcnav.analysis.requirements import Finding, Requirement, judge_requirement
from mcnav.analysis.requirements_over_time import ErrorHistories, judge_over_time
from mcnav.analysis.tails import tails
from mcnav.arrays.types import Array, IndexArray
from mcnav.sampler.designs import SamplingDesign, standard_normals
from mcnav.statistics.normal_box import normal_box_probability
from mcnav.statistics.normal_size import size_quantile
from tests.calibration.cells import LEVEL, Cell, Tally, tally

TAILS: Final = "errors"
"""Beginning of the names of the systems."""

SIZES: Final = (100, 200, 500, 2_000)
DESIGNS: Final = ("random", "antithetic")
"""Designs whose samples are independent, or of which one of each pair is."""

EPOCHS: Final = 12
CRITERION: Final = Criterion(tolerance=0.05, confidence=LEVEL)
PARTIALS: Final = np.array([[1.0, 0.0, 0.5], [0.3, 0.8, 0.0], [0.0, 0.2, 0.6]])
NOISE: Final = 0.5
"""Variance of the noise of each output at the end."""

MARGIN: Final = 1.3
"""Limit over the true quantile, or the reverse, at which the power is measured."""


@dataclass(frozen=True)
class GrowingErrors:
    """Normal errors at `EPOCHS` epochs: partial derivatives and variance of the noise grow with time.

    Attributes
    ----------
    gains : ndarray, shape (m,)
        Factors of the partial derivatives.
    kept : ndarray, shape (m,)
        Factors by which the noise of the epoch before is kept.
    added : ndarray, shape (m,)
        Variances that are added.
    """

    gains: Array
    kept: Array
    added: Array

    @property
    def covariance(self) -> Array:
        """Covariances of the outputs, shape (m, 3, 3)."""
        variance, covariance = 0.0, []
        for gain, kept, added in zip(self.gains, self.kept, self.added, strict=True):
            variance = kept**2 * variance + added
            covariance.append(gain**2 * PARTIALS @ PARTIALS.T + variance * np.eye(3))
        return np.array(covariance)

    def simulate(self, sources: Array, normals: Array) -> Array:
        """Return errors, shape (n, m, 3), from sources, shape (n, 3), and standard normals, shape (n, m, 3)."""
        noise, own, errors = np.zeros((len(sources), 3)), sources @ PARTIALS.T, np.empty_like(normals)
        for epoch in range(EPOCHS):
            noise = self.kept[epoch] * noise + np.sqrt(self.added[epoch]) * normals[:, epoch]
            errors[:, epoch] = self.gains[epoch] * own + noise
        return errors


_STEADY: Final = 0.9
SYSTEMS: Final = {
    "errors rising": GrowingErrors(
        np.linspace(1.0 / 3.0, 1.0, EPOCHS), np.ones(EPOCHS), np.full(EPOCHS, NOISE / EPOCHS)
    ),
    "errors steady": GrowingErrors(
        np.ones(EPOCHS),
        np.where(np.arange(EPOCHS) > 0, _STEADY, 0.0),
        NOISE * np.where(np.arange(EPOCHS) > 0, 1.0 - _STEADY**2, 1.0),
    ),
}

REQUIREMENTS: Final = {
    "|y| at 95 %": Requirement("quantile", (0,), (1.0,), 0.95),
    "|y| at 99 %": Requirement("quantile", (0,), (1.0,), 0.99),
    "CEP": Requirement("cep", (0, 1), (1.0,), 0.5),
    "R95": Requirement("r95", (0, 1), (1.0,), 0.95),
    "SEP": Requirement("sep", (0, 1, 2), (1.0,), 0.5),
}
"""Requirements on sizes; their limits are set to the true quantile."""

BOX: Final = Requirement("box", (0, 1), (2.5, 2.0), 0.5)
"""Requirement on a probability, which is set to the true one."""

Statement = tuple[str, str, bool]


def true_quantile(covariance: Array, requirement: Requirement) -> float:
    """Return the quantile of the sizes of errors of a normal distribution."""
    picked = np.array(requirement.outputs)
    return size_quantile(np.zeros(len(picked)), covariance[np.ix_(picked, picked)], requirement.probability or 0.5)


def run_tail_trials(trials: int, jobs: int, sizes: Sequence[int] = SIZES) -> Tally:
    """Simulate so many campaigns of each system, design and size, with seeds 0, 1, ..."""
    kinds = [(design, size, name) for design in DESIGNS for size in sizes for name in SYSTEMS]
    return tally(trials, jobs, kinds, _count)


def _count(kind: tuple[str, int, str], seeds: Sequence[int], result: Tally) -> None:
    design, count, name = kind
    system, blocks = SYSTEMS[name], SamplingDesign.of(design, count).blocks(np.arange(count))
    truth = _Truth.of(system)
    for seed in seeds:
        generator = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=(count, 5))))
        sources = standard_normals(design, seed, count, 0, count, 3)
        errors = system.simulate(sources, generator.standard_normal((count, EPOCHS, 3)))
        for statement, sort, hit in _statements(name, truth, errors, blocks):
            result.add(Cell(sort, name, statement, "normal", design, count), hit)


@dataclass(frozen=True)
class _Truth:
    """Linear model, the true quantile of each requirement at the end and over time, and the probability of the box.

    The comparison, of no sample, is what requirements on sizes do not ask for.
    """

    model: Model
    comparison: Comparison
    last: dict[str, float]
    largest: float
    box: float

    @classmethod
    def of(cls, system: GrowingErrors) -> _Truth:
        covariance = system.covariance
        last = {name: true_quantile(covariance[-1], each) for name, each in REQUIREMENTS.items()}
        largest = max(true_quantile(each, REQUIREMENTS["R95"]) for each in covariance)
        picked = np.ix_(BOX.outputs, BOX.outputs)
        box = normal_box_probability(np.zeros(2), covariance[-1][picked], np.array(BOX.limits))
        noise = covariance[-1] - system.gains[-1] ** 2 * PARTIALS @ PARTIALS.T
        model = Model(system.gains[-1] * PARTIALS, np.zeros(3), np.zeros(3), np.eye(3), {"walk": noise})
        nothing = compare(model, np.empty((0, 3)), np.empty((0, 3)), CRITERION)
        return cls(model, nothing, last, largest, box)


def _statements(name: str, truth: _Truth, errors: Array, blocks: IndexArray) -> Iterator[Statement]:
    histories = ErrorHistories(np.arange(float(EPOCHS)), errors, blocks, None, None, len(errors))
    over_time = replace(REQUIREMENTS["R95"], when="throughout", epochs=tuple(range(EPOCHS)))
    low, high = judge_over_time(over_time, histories, LEVEL).interval
    yield from _bounds("R95 at all epochs", low, high, truth.largest)
    for words, limit, wanted in (("met", MARGIN, Finding.MET), ("not met", 1.0 / MARGIN, Finding.NOT_MET)):
        judged = judge_over_time(replace(over_time, limits=(limit * truth.largest,)), histories, LEVEL)
        side = "above" if wanted == Finding.MET else "below"
        yield f"R95 at all epochs {words}, limit 30 % {side}", "power", judged.finding == wanted
    if name != "errors rising":
        return
    last = errors[:, -1]
    for requirement, asked in REQUIREMENTS.items():
        judged = judge_requirement(asked, truth.model, last, blocks, truth.comparison, LEVEL)
        yield from _bounds(requirement, *judged.interval, truth.last[requirement])
    low, high = judge_requirement(BOX, truth.model, last, blocks, truth.comparison, LEVEL).interval
    yield "probability of a box, lower bound", "coverage", low <= truth.box
    yield "probability of a box, upper bound", "coverage", high >= truth.box
    statements = tails(truth.model, last, blocks, ["m", "m", "m"], CRITERION)
    if all(np.isfinite(each.together[1]) for each in statements if each.probability < 0.99):
        right = [each.together[0] <= each.linear <= each.together[1] for each in statements]
        yield "all quantiles of the report", "coverage", all(right)


def _bounds(words: str, low: float, high: float, true: float) -> Iterator[Statement]:
    """Yield whether one-sided bounds hold, where the samples are enough for any."""
    if np.isfinite(high):
        yield f"{words}, upper bound", "coverage", high >= true
    if low > 0.0:
        yield f"{words}, lower bound", "coverage", low <= true
