"""Fits of noise models to the record of one axis, each the best of several starts, and the choice among them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.identification.choice import CLOSE, MODELS, ambiguity, slow_processes
from mcnav.identification.estimates import Candidate, Estimate
from mcnav.identification.likelihood import Maximum, maximize, maximize_many
from mcnav.identification.processes import GAUSS_MARKOV, QUANTIZATION, Grid, Model, Process
from mcnav.identification.spectrum import Bands, Record, in_bands

ROUGHLY: Final = 1e-2
"""Decrement of −2 log L at which a first maximum, from which others start, is near enough."""


@dataclass(frozen=True)
class AxisFit:
    """Models of one axis fitted to its record.

    Attributes
    ----------
    record : Record
    candidates : tuple of Candidate
        The best first.
    """

    record: Record
    candidates: tuple[Candidate, ...]

    @property
    def chosen(self) -> Candidate:
        """The best candidate."""
        return self.candidates[0]

    @property
    def margin(self) -> float:
        """By how much the criterion of the next candidate is larger."""
        return self.candidates[1].criterion - self.candidates[0].criterion

    @property
    def alike(self) -> tuple[Candidate, ...]:
        """Candidates besides the chosen one with its fast noise, or with less: quantization may be a slow process."""
        fast = QUANTIZATION in self.chosen.model.processes
        return tuple(
            candidate for candidate in self.candidates[1:] if fast or QUANTIZATION not in candidate.model.processes
        )

    @property
    def rivals(self) -> tuple[Candidate, ...]:
        """Candidates with slow processes that lack a process of the chosen one, and fit nearly as well."""
        own, limit = set(self.chosen.model.processes), self.chosen.criterion + CLOSE
        return tuple(
            candidate for candidate in self.alike
            if candidate.criterion < limit and slow_processes(candidate.model) and own - set(candidate.model.processes)
        )  # fmt: skip

    @property
    def ambiguities(self) -> list[str]:
        """List in words the models that the record cannot tell apart."""
        return [ambiguity(self.chosen.model, rival.model) for rival in self.rivals]

    @cached_property
    def estimates(self) -> tuple[Estimate, ...]:
        """Parameters of the chosen candidate; certain are those that all rivals have."""
        names = set(self.chosen.model.parameters).intersection(*(rival.model.parameters for rival in self.rivals))
        estimates = self.chosen.estimates(self.alike)
        return tuple(replace(estimate, certain=estimate.name in names) for estimate in estimates)


def fit(record: Record) -> AxisFit:
    """Fit every candidate to a record and choose."""
    rough = in_bands(record)
    first = [_best(model, rough) for model in MODELS]
    pilot = min(zip(MODELS, first, strict=True), key=lambda pair: pair[1].deviance)

    def weight(grid: Grid) -> Array:
        return pilot[0].variances(grid, pilot[1].logs)[0]

    bands = in_bands(record, weight)
    candidates = [
        Candidate(model, maximize(model, bands, start.logs), bands) for model, start in zip(MODELS, first, strict=True)
    ]
    return AxisFit(record, tuple(sorted(candidates, key=lambda candidate: candidate.criterion)))


def _best(model: Model, bands: Bands) -> Maximum:
    """Find the largest of the maxima that several starts lead to."""
    starts = _starts(model, bands)
    sums = np.repeat(bands.sums[None], len(starts), axis=0)
    logs, deviances = maximize_many(model, bands.grid, bands.numbers, sums, starts, converged=ROUGHLY)
    best = int(np.argmin(deviances))
    return Maximum(logs[best], float(deviances[best]))


def _starts(model: Model, bands: Bands) -> Array:
    """Guess parameters: each process as large as the spectrum allows, the slow ones at several correlation times."""
    level = bands.sums / bands.numbers
    duration = bands.grid.duration
    times = [duration / 3.0, duration / 30.0, duration / 300.0] if GAUSS_MARKOV in model.processes else [0.0]
    starts = []
    for time in times:
        logs: list[float] = []
        for process in model.processes:
            logs += _allowed(process, bands, level, time)
        starts.append(np.array(logs))
    return np.array(starts)


def _allowed(process: Process, bands: Bands, level: Array, time: float) -> list[float]:
    """Return the logarithm of a process's size such that it explains the spectrum where its share is largest."""
    shape = process.spectrum(bands.grid, time) if process.timed else process.spectrum(bands.grid)
    ratio = level / shape
    smooth = np.sort(ratio)[: max(1, len(ratio) // 8)]
    size = 0.5 * float(np.log(np.median(smooth)))
    return [size, float(np.log(time))] if process.timed else [size]
