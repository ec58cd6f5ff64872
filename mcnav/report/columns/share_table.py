"""The table of an error budget: share of each cause in the variances, and the final errors that it causes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mcnav.analysis.budget import ErrorBudget
from mcnav.arrays.types import Array
from mcnav.contract.quantities import KINDS, Output, kinds_of
from mcnav.report.document.parts import Part, Sentence
from mcnav.report.document.table import Cell, Column, Table
from mcnav.report.figures.sources import Contributor
from mcnav.report.format import ROUNDING, number, share
from mcnav.report.names import humanize
from mcnav.store.manifest import Variable

SMALLEST: Final = 1e-12
"""Contribution of correlations, as a share of a variance, up to which it is rounding."""


@dataclass(frozen=True)
class ShareRow:
    """A cause or several together: shares of the variances, and the final errors caused, in the units shown.

    Of a single cause, ``sigma`` and ``mean`` are its own, in ``unit``; noise has none.
    """

    name: str
    shares: Array
    caused: Array | None
    sigma: float | None = None
    mean: float | None = None
    unit: str = ""

    def of(self, members: Sequence[int]) -> ShareRow:
        """Return the row of some outputs."""
        chosen = list(members)
        return replace(self, shares=self.shares[chosen], caused=None if self.caused is None else self.caused[chosen])


def share_tables(
    caption: str,
    heading: str,
    outputs: Sequence[Variable | Output],
    rows: Sequence[ShareRow],
    cross_terms: Array,
    *,
    sigmas: bool = False,
    means: bool = False,
) -> list[Part]:
    """Tabulate shares as `share_table` does, outputs of each kind by themselves with the causes that disperse them."""
    kinds, cross_terms = kinds_of(outputs), np.asarray(cross_terms)
    if not any(kinds):
        return [share_table(caption, heading, outputs, rows, cross_terms, sigmas=sigmas, means=means)]
    shares = np.array([row.shares for row in rows]).reshape(len(rows), len(outputs))
    matters = np.abs(np.nan_to_num(shares)) > ROUNDING
    parts: list[Part] = [Sentence(caption)]
    for kind in KINDS:
        members = [i for i, each in enumerate(kinds) if each == kind and matters[:, i].any()]
        if members:
            causes = [row.of(members) for row, some in zip(rows, matters[:, members].any(axis=1), strict=True) if some]
            of_kind, cross = [outputs[i] for i in members], cross_terms[members]
            parts.append(share_table(f"{kind}.", heading, of_kind, causes, cross, sigmas=sigmas, means=means))
    return parts


def share_table(
    caption: str,
    heading: str,
    outputs: Sequence[Variable | Output],
    rows: Sequence[ShareRow],
    cross_terms: Array,
    *,
    sigmas: bool = False,
    means: bool = False,
) -> Table[ShareRow]:
    """Tabulate shares in per cent with the final errors below them, and what correlations contribute.

    ``heading`` is that of the causes, ``cross_terms`` are of `ErrorBudget`; if ``sigmas`` and ``means``, there are
    columns of those of the causes.
    """

    def of_output(i: int) -> Column[ShareRow]:
        def content(row: ShareRow) -> Cell:
            caused = None if row.caused is None else 0.0 if abs(row.shares[i]) < ROUNDING else row.caused[i]
            return Cell(share(row.shares[i]), below="" if caused is None else number(caused))

        return Column(f"{humanize(outputs[i].name)}, %", content, unit=outputs[i].shown_in)

    correlated = bool(np.nanmax(np.abs(cross_terms), initial=0.0) > SMALLEST)
    correlations = [ShareRow("correlations", cross_terms, None)] if correlated else []
    sigma: Column[ShareRow] = Column("σ", lambda row: "" if row.caused is None else number(row.sigma))
    mean: Column[ShareRow] = Column("Mean", lambda row: "" if row.caused is None else number(row.mean))
    columns: list[Column[ShareRow]] = [
        Column(heading, lambda row: Cell(row.name, row.unit), kind="label"),
        *([sigma] if sigmas else []),
        *([mean] if means else []),
        *map(of_output, range(len(outputs))),
    ]
    return Table(caption, columns, [*rows, *correlations], style="shares")


def together(budget: ErrorBudget, caused: Array, contributors: Iterable[Contributor]) -> list[ShareRow]:
    """List contributors with their shares and final errors, of several causes the root sum square.

    ``caused`` are the final errors in the units shown, shape (outputs, causes).
    """
    rows = []
    for contributor in contributors:
        members = list(contributor.members)
        final = caused[:, members]
        error = final[:, 0] if len(members) == 1 else np.sqrt((final**2).sum(axis=1))
        rows.append(ShareRow(contributor.label, budget.shares[:, members].sum(axis=1), error))
    return rows


def each_cause(
    budget: ErrorBudget,
    caused: Array,
    names: Sequence[str],
    sources: Sequence[tuple[float, float, str]],
    listed: Sequence[bool],
) -> list[ShareRow]:
    """List single causes, the largest mean share first.

    ``sources`` are sigma, mean and unit of each source; ``listed`` says which causes are.
    """
    own: list[tuple[float | None, float | None, str]] = [*sources]
    own += [(None, None, "")] * (len(names) - len(sources))  # noise has no sigma of one number
    return [
        ShareRow(names[j], budget.shares[:, j], caused[:, j], *own[j])
        for j in np.argsort(-np.nan_to_num(budget.shares).mean(axis=0), kind="stable").tolist()
        if listed[j]
    ]
