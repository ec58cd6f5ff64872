"""The section on where the vehicle goes: dispersion of the truth beside that of navigation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mcnav.analysis.comparison import correlations
from mcnav.arrays.types import Array
from mcnav.report.document.parts import Section, headed, joined
from mcnav.report.document.table import Column, Table
from mcnav.report.drawing.figure import Figure
from mcnav.report.format import fixed, number
from mcnav.report.names import humanize
from mcnav.report.results.kinds import quantities
from mcnav.report.results.model import RunAnalysis
from mcnav.statistics.correlation import ROUNDING, fisher_interval

CAPTION: Final = (
    "Correlation of true dispersion and navigation error at the end, and their linear sigmas. Where it is −1 and both "
    "sigmas are equal, the truth misses by minus the navigation error. At 0 neither is a linear function of the other. "
    "Monte Carlo: paired estimate. Intervals hold jointly at {:g} %, on Fisher's scale, without supposing normal "
    "samples. Tested is whether the linear value is inside, not how much a difference matters."
)

NOT_TESTED: Final = "not tested"
INSIDE, OUTSIDE = "inside", "outside"


@dataclass(frozen=True)
class CorrelationRow:
    """Correlation of the truth with the navigation error of a quantity, by both methods, and their linear sigmas."""

    name: str
    linear: float
    flown: float
    sigma_true: float
    sigma_error: float
    unit: str
    ends: tuple[float, float] | None = None

    @property
    def verdict(self) -> str:
        """Verdict on the linear correlation: inside the interval or not."""
        if self.ends is None:
            return NOT_TESTED
        low, high = self.ends
        return INSIDE if low - ROUNDING <= self.linear <= high + ROUNDING else OUTSIDE


def truth_section(content: RunAnalysis, drawn: Mapping[str, Figure]) -> Section | None:
    """Arrange dispersion over time, ellipses and correlations; none without outputs of truth."""
    rows = correlation_rows(content)
    columns: list[Column[CorrelationRow]] = [
        Column("Quantity", lambda row: row.name, kind="label"),
        Column("Linear correlation", lambda row: fixed(row.linear, 6)),
        Column("Monte Carlo correlation", lambda row: fixed(row.flown, 6)),
        Column("Interval", lambda row: "–" if row.ends is None else " to ".join(fixed(end, 6) for end in row.ends)),
        Column("Linear value is", lambda row: row.verdict, kind="text"),
        Column("True σ", lambda row: number(row.sigma_true)),
        Column("Navigation error σ", lambda row: number(row.sigma_error)),
        Column("Unit", lambda row: row.unit, kind="text"),
    ]
    caption = CAPTION.format(100.0 * content.criterion.confidence)
    table = Table(caption, columns, rows) if rows else None
    parts = joined(drawn.get("dispersion_over_time"))
    parts += headed("At the end", drawn.get("landing_ellipses"))
    parts += headed("Correlation of truth and navigation error", table)
    return Section("truth", "Truth and navigation", parts) if parts else None


def correlation_rows(content: RunAnalysis) -> list[CorrelationRow]:
    """List the quantities whose truth and navigation error are both dispersed."""
    linear, flown = content.comparison.covariance_linear, content.comparison.covariance_paired
    sigmas = np.sqrt(np.diag(linear)) * content.output_scale
    rows, pairs = [], []
    for quantity in quantities(content.manifest.model.outputs):
        if quantity.error is None or not (sigmas[quantity.true] > 0.0 and sigmas[quantity.error] > 0.0):
            continue
        pairs.append((min(quantity.true, quantity.error), max(quantity.true, quantity.error)))
        rows.append(CorrelationRow(
            humanize(quantity.name),
            _correlation(linear, quantity.true, quantity.error), _correlation(flown, quantity.true, quantity.error),
            float(sigmas[quantity.true]), float(sigmas[quantity.error]), content.output_units[quantity.true],
        ))  # fmt: skip
    joint = content.comparison.joint
    tested = {correlation.between: correlation for correlation in joint.correlations} if joint else {}
    level = 1.0 - (1.0 - content.criterion.confidence) / max(len(rows), 1)
    return [
        replace(row, ends=fisher_interval(replace(tested[pair].difference, value=row.flown), level))
        if pair in tested
        else row
        for row, pair in zip(rows, pairs, strict=True)
    ]


def _correlation(covariance: Array, one: int, other: int) -> float:
    """Return an entry of a correlation matrix, held within its bounds."""
    return float(np.clip(correlations(covariance)[one, other], -1.0, 1.0))
