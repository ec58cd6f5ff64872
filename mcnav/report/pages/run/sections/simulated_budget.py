"""The error budget by Monte Carlo beside the linear one: each source alone, all others, and Sobol indices."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from markupsafe import Markup

from mcnav.arrays.types import Array
from mcnav.report.document.parts import Folded, Heading, Note, Part
from mcnav.report.document.table import STRONG, Column, Table
from mcnav.report.figures.sources import SHOWN, flown_shares
from mcnav.report.format import share
from mcnav.report.results.model import RunAnalysis
from mcnav.statistics.estimates import Estimate

NEGLIGIBLE: Final = 1e-3
"""Share by every method below which a source is left out of long tables of shares."""

MOST_ROWS: Final = 1_000
"""Rows of the tables of all outputs, about; of more, those of the largest shares of each output are shown."""

FEWEST: Final = 3
"""Sources of an output that are shown however many outputs there are."""

INTERACTION: Final = 0.01
"""Excess of a total over a first-order Sobol index that counts as an interaction."""

HEADINGS: Final = (
    "Alone, linear", "Alone, Monte Carlo", "All others, linear", "All others, Monte Carlo", "Sobol, first order",
    "Sobol, total",
)  # fmt: skip


def simulated_budget(content: RunAnalysis) -> list[Part]:
    """Tabulate linear and Monte Carlo shares of each source, a table per output; empty when it was not simulated."""
    simulated = content.manifest.model.budget
    if not simulated or not content.dispersed:
        return []
    alone, sobol = simulated["alone"], simulated["sobol"]
    heading = Heading("Linear and Monte Carlo budget")
    if "failed" in alone:
        return [heading, Note(f"The simulations of single sources are not available: {alone['failed']}.")]
    variances = np.diag(content.comparison.covariance_linear)
    active = np.flatnonzero(np.diag(content.model.covariance) > 0.0)
    least, most = (NEGLIGIBLE, max(FEWEST, MOST_ROWS // len(variances))) if len(active) > SHOWN else (0.0, SHOWN)
    tables, largest = [], _largest_shares(content, sobol)
    for i in np.flatnonzero(variances > 0.0).tolist():
        ranked = active[np.argsort(-content.budget.shares[i, active], kind="stable")].tolist()
        kept = sorted(ranked, key=lambda j: largest[i, j], reverse=True)[:most]
        rows = [_Shares(content, i, j, alone, sobol) for j in ranked if j in kept and largest[i, j] >= least]
        tables.append(Folded(content.output_names[i], [_table(rows)]))
    return [heading, _explanation(alone, sobol, least, most), *tables]


@dataclass(frozen=True)
class _Shares:
    """Shares of source j in the variance of output i; ``alone`` and ``sobol`` are the simulations'."""

    content: RunAnalysis
    i: int
    j: int
    alone: Mapping[str, Any]
    sobol: Mapping[str, Any]

    @cached_property
    def cells(self) -> list[str]:
        """The shares in the order of `HEADINGS`."""
        budget = self.content.budget
        linear = float(budget.shares[self.i, self.j]), 1.0 - float(budget.saved[self.i, self.j])
        return [share(linear[0]), self._simulated("alone"), share(linear[1]), self._simulated("without"),
                self._index("first_order"), self._index("total")]  # fmt: skip

    def _simulated(self, key: str) -> str:
        """Write the variance with the source alone or without it, over the linear variance of the output."""
        variance = float(self.content.comparison.covariance_linear[self.i, self.i])
        known, error = self.alone[key], self.alone[key]["standard_error"][self.i][self.j]
        value, error = known["variance"][self.i][self.j] / variance, math.inf if error is None else error / variance
        return self._written(Estimate(value, error, self.alone["degrees_of_freedom"]))

    def _index(self, key: str) -> str:
        """Write a Sobol index."""
        if "failed" in self.sobol or self.sobol[key][self.i][self.j] is None:
            return "–"
        value, error = (self.sobol[name][self.i][self.j] for name in (key, f"{key}_standard_error"))
        return self._written(Estimate(value, error, self.sobol["replicates"] - 1.0))

    def _written(self, estimate: Estimate) -> str:
        half_width = share(estimate.half_width(self.content.criterion.confidence))
        return f"{share(estimate.value)} ± {half_width}".replace(" ", "\N{NO-BREAK SPACE}")


def _table(rows: list[_Shares]) -> Table[_Shares]:
    def number_of(place: int) -> Column[_Shares]:
        return Column(HEADINGS[place], lambda row: row.cells[place])

    source: Column[_Shares] = Column("Source", lambda row: row.content.source_names[row.j], kind="label")
    return Table("", [source, *map(number_of, range(len(HEADINGS)))], rows)


def _explanation(alone: Mapping[str, Any], sobol: Mapping[str, Any], least: float, most: int) -> Note:
    """Say what the shares are, whether sources interact, and what is left out."""
    parts = [Markup.escape(
        "Variance with each source alone, and with all but that source, in per cent of the output's linear variance. "
        f"Linear model, and simulation with the same {alone['samples']:,} samples (paired estimates). Sobol "
        "indices are shares of the nonlinear variance. A total index above the first-order index shows an interaction "
        "with other sources, which a linear budget cannot show."
    )]  # fmt: skip
    if "failed" in sobol:
        parts.append(Markup.escape(f"They are not available: {sobol['failed']}."))
    elif _interacts(sobol):
        parts.append(STRONG("Some sources interact."))
    else:
        parts.append(Markup("No source has a significant interaction above 1 % of the variance."))
    if least:
        parts.append(
            Markup(
                f"At most {most} sources of an output are shown, and none below {100.0 * least:g} % by every method; "
                "summary.json has all."
            )
        )
    return Note(Markup(" ").join(parts))


def _largest_shares(content: RunAnalysis, sobol: Mapping[str, Any]) -> Array:
    """Return the largest share by any method, shape (outputs, sources)."""
    tables = [content.budget.shares, flown_shares(content), *([] if "failed" in sobol else [sobol["total"]])]
    return np.asarray(np.max([np.nan_to_num(np.array(table, dtype=float)) for table in tables], axis=0))


def _interacts(sobol: Mapping[str, Any]) -> bool:
    """Return whether some total index exceeds the first-order one significantly."""
    keys = ("total", "first_order", "total_standard_error", "first_order_standard_error")
    total, first, *errors = (np.array(sobol[key], dtype=float) for key in keys)
    return bool(np.any(total - first > INTERACTION + 4.0 * np.hypot(*errors)))
