"""The tables of all outputs together: tests, principal directions, ellipsoids."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from mcnav.analysis.summary import ContainedEntry, HypothesisEntry, Summary
from mcnav.report.columns.result_table import ResultColumn, ResultTable
from mcnav.report.document.table import Cell, Column, five_digits
from mcnav.report.format import fixed, number, probability
from mcnav.report.names import humanize

HYPOTHESES: Final = {
    "covariance_paired": ("Covariance, paired", "cov(y) = cov(P·s)", "F"),
    "covariance": ("Covariance, likelihood ratio", "cov(y) = P·S·Pᵀ", "χ²"),
    "bias_paired": ("Bias, paired T²", "Monte Carlo and linear errors have the same mean", "F"),
    "bias": ("Bias, Hotelling's T²", "the sample mean is the linear one", "F"),
    "nees": ("Distance, Kolmogorov-Smirnov", "squared distance follows χ²", "D"),
    "skewness": ("Mardia's skewness", "the outputs have the symmetry of a normal distribution", "χ²"),
    "kurtosis": ("Mardia's kurtosis", "the outputs have the tails of a normal distribution", "z"),
}
"""Name, hypothesis and symbol of the statistic of each test."""


@dataclass(frozen=True)
class HypothesisRow:
    """A test of all outputs together."""

    key: str
    entry: HypothesisEntry

    @property
    def statistic(self) -> str:
        """The statistic with its symbol; one that contradicts the hypothesis with certainty is infinite."""
        value = self.entry.statistic
        return f"{HYPOTHESES[self.key][2]} = {'∞' if value is None or math.isinf(value) else number(value)}"

    def freedom(self, form: str) -> str:
        """Return the degrees of freedom."""
        return ", ".join(format(each, form) for each in self.entry.degrees_of_freedom if each is not None)


TESTS: Final[tuple[ResultColumn[HypothesisRow], ...]] = (
    ResultColumn("test", lambda row: row.key, (
        Column("Test", lambda row: HYPOTHESES[row.key][0], kind="label"),
        Column("Hypothesis", lambda row: HYPOTHESES[row.key][1], kind="words"),
    )),
    ResultColumn("statistic", lambda row: row.entry.statistic, (Column("Statistic", lambda row: row.statistic),)),
    ResultColumn("degrees_of_freedom", lambda row: row.freedom("g"),
                 (Column("Degrees of freedom", lambda row: row.freedom(",.0f")),)),
    ResultColumn("p_value", lambda row: row.entry.p_value,
                 (Column("p", lambda row: "–" if row.entry.p_value is None else probability(row.entry.p_value)),)),
    ResultColumn("rank", lambda row: row.entry.rank),
)  # fmt: skip


def tests_table(summary: Summary) -> ResultTable:
    """Tabulate the tests of all outputs together that were made."""
    rows = [
        HypothesisRow(key, entry) for key, entry in summary.tests.items() if entry is not None and key in HYPOTHESES
    ]
    caption = (
        "Tests of all outputs together. p is the probability of a statistic at least this extreme if linear analysis "
        "were exact. A small p means that a difference is significant, not that it is large."
    )
    return ResultTable.of_entries("tests", "Tests of all outputs together", 1, TESTS, rows, caption)


@dataclass(frozen=True)
class DirectionRow:
    """A principal direction: sigma ratio, and weights of the outputs in units of their linear sigmas."""

    number: int
    ratio: float
    weights: Sequence[float]


def _weight(name: str, place: int) -> ResultColumn[DirectionRow]:
    shown = Column[DirectionRow](humanize(name), lambda row: fixed(row.weights[place], 3))
    return ResultColumn(name, lambda row: row.weights[place], (shown,))


def directions_table(summary: Summary) -> ResultTable:
    """Tabulate the principal directions of the difference."""
    rows = [
        DirectionRow(number, ratio, weights)
        for number, (ratio, weights) in enumerate(
            zip(summary.principal_ratios.tolist(), summary.principal_directions.tolist(), strict=True)
        )
    ]
    columns: list[ResultColumn[DirectionRow]] = [
        ResultColumn("direction", lambda row: row.number),
        ResultColumn("sigma_ratio", lambda row: row.ratio, (
            Column("σ ratio", lambda row: row.ratio, form=five_digits),)),
        *(_weight(name, place) for place, name in enumerate(summary.names)),
    ]  # fmt: skip
    caption = "Combinations of outputs, in units of their linear sigmas, from the smallest sigma ratio to the largest."
    title = "Principal directions of the difference"
    return ResultTable.of_entries("principal_directions", title, 1, columns, rows, caption)


def _inside(row: ContainedEntry) -> Cell:
    low, high = (math.nan if end is None else 100.0 * end for end in row.interval)
    return Cell(f"{100.0 * row.share:.2f} %", below=f"{low:.2f} to {high:.2f} %")


ELLIPSOIDS: Final[tuple[ResultColumn[ContainedEntry], ...]] = (
    ResultColumn("level", lambda row: row.level,
                 (Column("Ellipsoid", lambda row: f"{100.0 * row.level:g} %", kind="label"),)),
    ResultColumn("share", lambda row: row.share, (Column("Samples inside", _inside),)),
    ResultColumn("from", lambda row: row.interval[0]),
    ResultColumn("to", lambda row: row.interval[1]),
)  # fmt: skip


def ellipsoids_table(summary: Summary) -> ResultTable:
    """Tabulate the shares of the samples within the linear error ellipsoids."""
    caption = "Share of the samples within the linear error ellipsoids, with exact intervals."
    title = "Share of samples within the linear ellipsoids"
    return ResultTable.of_entries("ellipsoids", title, 1, ELLIPSOIDS, summary.contained, caption)
