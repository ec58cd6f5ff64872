"""The section on where the vehicle goes: dispersion of the truth beside that of navigation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.analysis.comparison import correlations
from mcnav.report.document import Column, Section, Table, headed, joined
from mcnav.report.figures.figure import Figure
from mcnav.report.format import fixed, number
from mcnav.report.kinds import quantities
from mcnav.report.model import RunAnalysis, humanize

CAPTION: Final = (
    "Correlation of true dispersion and navigation error at the end, and their linear sigmas. Where it is −1 and both "
    "sigmas are equal, the truth misses by minus the navigation error; at 0 neither is a linear function of the other. "
    "Monte Carlo: paired estimate."
)


@dataclass(frozen=True)
class CorrelationRow:
    """Correlation of the truth with the navigation error of a quantity, by both methods, and their linear sigmas."""

    name: str
    linear: float
    flown: float
    sigma_true: float
    sigma_error: float
    unit: str


def truth_section(content: RunAnalysis, drawn: Mapping[str, Figure]) -> Section | None:
    """Arrange dispersion over time, ellipses and correlations; none without outputs of truth."""
    rows = correlation_rows(content)
    columns: list[Column[CorrelationRow]] = [
        Column("Quantity", lambda row: row.name, kind="label"),
        Column("Linear correlation", lambda row: fixed(row.linear, 6)),
        Column("Monte Carlo correlation", lambda row: fixed(row.flown, 6)),
        Column("True σ", lambda row: number(row.sigma_true)),
        Column("Navigation error σ", lambda row: number(row.sigma_error)),
        Column("Unit", lambda row: row.unit, kind="text"),
    ]
    table = Table(CAPTION, columns, rows) if rows else None
    parts = joined(drawn.get("dispersion_over_time"))
    parts += headed("At the end", drawn.get("landing_ellipses"))
    parts += headed("Correlation of truth and navigation error", table)
    return Section("truth", "Truth and navigation", parts) if parts else None


def correlation_rows(content: RunAnalysis) -> list[CorrelationRow]:
    """List the quantities whose truth and navigation error are both dispersed."""
    linear, flown = content.comparison.covariance_linear, content.comparison.covariance_paired
    sigmas = np.sqrt(np.diag(linear)) * content.output_scale
    return [
        CorrelationRow(
            humanize(each.name),
            _correlation(linear, each.true, each.error), _correlation(flown, each.true, each.error),
            float(sigmas[each.true]), float(sigmas[each.error]), content.output_units[each.true],
        )
        for each in quantities(content.manifest.model.outputs)
        if each.error is not None and sigmas[each.true] > 0.0 and sigmas[each.error] > 0.0
    ]  # fmt: skip


def _correlation(covariance: Array, one: int, other: int) -> float:
    """Return an entry of a correlation matrix, held within its bounds."""
    return float(np.clip(correlations(covariance)[one, other], -1.0, 1.0))
