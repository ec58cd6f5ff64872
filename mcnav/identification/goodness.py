"""Test of fit: does a record look like its model?

Four tests, each of what the model forbids, and one answer: the model is rejected at 5 % when the smallest of their
p-values p is so small that ``1 − (1 − p)³ < 0.05`` (Šidák 1967). They are as good as three independent ones, because
the model is chosen from the same record: what might be a trend is often taken for a slow process. Of 1,000 short
simulated records with up to two slow processes 5.1 % are rejected, of 480 of the catalogue's grades 4.6 %. The exponent
was chosen by earlier ones. Where the spectrum alone rejects a model it is tested by itself, as one of the four.

    line       the largest ordinate over its variance, of m independent χ²₁: P = 1 − F(x)^m; the m ordinates are those
               with `PERIODS` periods or more in the record: fewer are no line, but a slow process or a trend
    shape      sums of ordinates over their variances, in octaves, against their numbers; the estimates' own share by
               simulation of the bands with one step of scoring each
    trend      −2 log L with and without a linear trend of the readings (`mcnav.identification.trend`)
    steadiness mean squares of differences of readings over time, in segments, against their mean (Bartlett)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.stats import chi2

from mcnav.arrays.types import Array
from mcnav.identification.estimates import Candidate
from mcnav.identification.processes import Grid
from mcnav.identification.spectrum import Bands, Record, in_bands
from mcnav.identification.trend import trend_p_value

SIMULATIONS: Final = (500, 3500)
"""Simulations of the test of shape: the second ones only where a tenth or less of the first are as large."""

SEGMENTS: Final = 50
"""Segments of the test of steadiness."""

PERIODS: Final = 5
"""Fewest periods of a spectral line in the record; an ordinate of order j has j/2."""

SIZE: Final = 0.05

INDEPENDENT: Final = 3.0
"""Number of independent tests that the four are as good as."""

SINGLE: Final = float(-np.expm1(np.log1p(-SIZE) / INDEPENDENT))
"""P-value of a single test below which the model is rejected."""

WHERE: Final = {
    "line": "at {:.3g} Hz", "shape": "at {:.3g} Hz", "trend": "of {:.3g} per second", "steadiness": "at {:.3g} s",
}  # fmt: skip
"""Words of the places where a record departs from its model."""


@dataclass(frozen=True)
class Finding:
    """A test of fit.

    Attributes
    ----------
    name : str
    p : float
    at : float
        Where the record departs most from the model: a frequency (Hz), a time (s) or a slope per second.
    """

    name: str
    p: float
    at: float

    def __str__(self) -> str:
        """Say where the record departs from the model."""
        return f"{self.name} {WHERE[self.name].format(self.at)}"


@dataclass(frozen=True)
class Goodness:
    """All tests of fit."""

    findings: tuple[Finding, ...]

    @property
    def p(self) -> float:
        """P-value of all tests together."""
        smallest = min(finding.p for finding in self.findings)
        return float(-np.expm1(INDEPENDENT * np.log1p(-min(smallest, 1.0 - 1e-16))))

    @property
    def rejected(self) -> bool:
        """True if the record does not look like its model."""
        return self.p < SIZE

    @property
    def worst(self) -> Finding:
        """The test with the smallest p."""
        return min(self.findings, key=lambda finding: finding.p)


def check_spectrum(candidate: Candidate, record: Record) -> Goodness:
    """Test a model against the spectrum of its record alone: lines, and the shape."""
    return Goodness((_check_line(candidate, record), _check_shape(candidate)))


def check_fit(candidate: Candidate, record: Record, readings: Array, whole: Record | None = None) -> Goodness:
    """Test a model against its record, and against the ``whole`` one where that has the lower ordinates alone."""
    return Goodness(
        (
            *check_spectrum(candidate, record).findings,
            Finding("trend", *trend_p_value(candidate.model, candidate.bands, candidate.best, record)),
            _check_steadiness(candidate, record, readings, None if whole is None else in_bands(whole)),
        )
    )


def _variances(candidate: Candidate, grid: Grid) -> Array:
    return candidate.model.variances(grid, candidate.best.logs)[0]


def _check_line(candidate: Candidate, record: Record) -> Finding:
    """Look for a spectral line."""
    first = 2 * PERIODS - 1
    largest, order, step = 0.0, first + 1, 1 << 18
    for begin in range(first, len(record.ordinates), step):
        part = record.ordinates[begin : begin + step]
        grid = Grid(record.interval, record.count, np.arange(begin + 1.0, begin + 1.0 + len(part)))
        ratio = part / _variances(candidate, grid)
        at = int(np.argmax(ratio))
        if ratio[at] > largest:
            largest, order = float(ratio[at]), begin + at + 1
    p = -np.expm1((len(record.ordinates) - first) * np.log1p(-chi2.sf(largest, 1)))
    return Finding("line", float(p), 0.5 * order / record.duration)


def _check_shape(candidate: Candidate) -> Finding:
    """Compare sums of ordinates by octave with the model's."""
    bands = candidate.bands
    variances, slopes = candidate.model.variances(bands.grid, candidate.best.logs)
    relative = slopes / variances[:, None]
    octave = np.floor(np.log2(bands.grid.order)).astype(int)
    groups = np.equal.outer(np.unique(octave), octave).astype(float)
    numbers = groups @ bands.numbers
    projection = np.linalg.pinv(0.5 * (relative.T * bands.numbers) @ relative, rcond=1e-10)
    generator = np.random.default_rng(0)

    def statistic(sums: Array) -> Array:
        # after one step of scoring, so that what the estimates take away is taken away alike
        step = 0.5 * ((sums - bands.numbers) @ relative) @ projection
        ratio = (sums * np.exp(-np.clip(step @ relative.T, -3.0, 3.0))) @ groups.T / numbers
        return np.asarray((numbers * (ratio - 1.0 - np.log(ratio))).sum(axis=1))

    sums = bands.sums / variances
    own = float(statistic(sums[None])[0])
    as_large = total = 0
    for simulations in SIMULATIONS:
        draws = generator.gamma(0.5 * bands.numbers, 2.0, (simulations, len(bands.numbers)))
        as_large += int(np.count_nonzero(statistic(draws) >= own))
        total += simulations
        if as_large > 0.1 * total:
            break
    p = (1.0 + as_large) / (1.0 + total)
    ratio = groups @ sums / numbers
    worst = int(np.argmax(numbers * (ratio - 1.0 - np.log(ratio))))
    middle = np.exp((groups[worst] @ np.log(bands.grid.frequency)) / groups[worst].sum())
    return Finding("shape", float(p), float(middle))


def _check_steadiness(candidate: Candidate, record: Record, readings: Array, measured: Bands | None) -> Finding:
    """Compare mean squares of differences of readings in segments of time, with a measured spectrum or the model's."""
    segments = min(SEGMENTS, record.count // 100)
    if segments < 2:
        return Finding("steadiness", 1.0, 0.0)
    length = record.count // segments
    differences = np.diff(readings[: segments * length].reshape(segments, length), axis=1)
    squares = np.einsum("ij,ij->i", differences, differences) / (length - 1)
    # gamma_k of differences by the model: sums of s lambda over all angles; var(mean square) = 2 sum gamma_k^2 / length
    angles = Grid(record.interval, record.count, np.linspace(0.5, record.count - 0.5, 4096))
    if measured is None:
        level = _variances(candidate, angles)
    else:
        level = np.interp(angles.order, measured.grid.order, measured.sums / measured.numbers)
    density = 4.0 * np.sin(angles.half) ** 2 * level
    own = density.mean()
    freedom = (length - 1) * own**2 / np.square(density).mean()
    mean = squares.mean()
    # Bartlett's statistic for equal degrees of freedom
    statistic = freedom * segments * (np.log(mean) - np.log(squares).mean())
    statistic /= 1.0 + (segments + 1.0) / (3.0 * segments * freedom)
    worst = int(np.argmax(np.abs(np.log(squares / mean))))
    return Finding("steadiness", float(chi2.sf(statistic, segments - 1)), (worst + 0.5) * length * record.interval)
