"""The section on why linear and Monte Carlo variances differ: the terms of the difference."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.analysis.variance_breakdown import TERMS, VarianceBreakdown
from mcnav.arrays.types import Array
from mcnav.report.document import formulas
from mcnav.report.document.parts import Folded, Section, Sentence, joined
from mcnav.report.document.table import STRONG, Column, Table
from mcnav.report.format import signed, with_error
from mcnav.report.results.model import RunAnalysis

TERM_NAMES: Final = {
    "sampled_sigmas": "sampling: sigmas of the errors",
    "sampled_correlations": "sampling: correlations of the errors",
    "sampled_noise": "sampling: noise",
    "partials": "partials: finite differences − variational",
    "second_order": "second order, ½ tr(HSHS)",
    "third_order": "third order",
    "rest": "remainder",
}


def causes_section(content: RunAnalysis) -> Section | None:
    """Split the difference of each variance that differs, in per cent of the linear one; none where none does."""
    causes = content.causes
    linear = np.diag(content.comparison.covariance_linear)
    shown = [i for i, output in enumerate(content.comparison.outputs) if linear[i] > 0.0 and output.paired.certain]
    if causes is None or not shown or not content.dispersed:
        return None
    per_cent = np.divide(100.0, linear, out=np.full_like(linear, np.nan), where=linear > 0.0)
    sentence = _largest_difference(content, causes, per_cent, shown)
    assumed = "" if content.manifest.normal else " and assume normal errors, which not all of these are"
    words = (
        "The sampling terms are P(Ŝ−S)Pᵀ where Ŝ is the covariance of the sampled errors; the paired estimate removes "
        "them. Second- and third-order terms are computed by central differences over the range of the errors"
        f"{assumed}. Both are of fourth order in sigma. The remainder contains higher orders and the sampling error of "
        "the paired estimate (± one standard error)."
    )
    definition = Folded("Definition of the terms", [formulas.SAMPLING, Sentence(words)], explains=True)
    table = _table(content, causes, per_cent, shown)
    return Section("causes", "Why they differ", joined(Sentence(sentence) if sentence else None, table, definition))


@dataclass(frozen=True)
class _Term:
    """A term of the difference of each variance, in words."""

    name: str
    values: Sequence[str]


def _table(content: RunAnalysis, causes: VarianceBreakdown, per_cent: Array, shown: list[int]) -> Table[_Term]:
    def term(name: str, values: Array, form: Callable[[str], str] = str) -> _Term:
        return _Term(form(name), [form(signed(value)) for value in (values * per_cent)[shown]])

    def of_output(place: int) -> Column[_Term]:
        return Column(content.output_names[shown[place]], lambda row: row.values[place])

    remainder = zip((causes.terms["rest"] * per_cent)[shown], (causes.standard_error * per_cent)[shown], strict=True)
    rows = [
        *(term(TERM_NAMES[name], causes.terms[name]) for name in TERMS if name in causes.terms and name != "rest"),
        _Term(TERM_NAMES["rest"], [with_error(value, error, sign=True) for value, error in remainder]),
        term("total: plain − linear", causes.total, STRONG),
        term("without sampling: paired − linear", causes.paired),
        term("for comparison: unscented − linear", causes.unscented),
    ]
    caption = (
        "Plain variance minus linear variance, in per cent of the linear variance, and the terms that add up to it."
    )
    name: Column[_Term] = Column("Term", lambda row: row.name, kind="label")
    return Table(caption, [name, *map(of_output, range(len(shown)))], rows)


def _largest_difference(
    content: RunAnalysis, breakdown: VarianceBreakdown, per_cent: Array, shown: Sequence[int]
) -> str:
    """Explain the largest paired difference among some outputs."""
    paired = np.nan_to_num(breakdown.paired * per_cent)
    at = max(shown, key=lambda i: abs(paired[i]))
    error, remainder = breakdown.standard_error[at] * per_cent[at], breakdown.terms["rest"][at] * per_cent[at]
    predicted = (breakdown.terms["second_order"] + breakdown.terms["third_order"])[at] * per_cent[at]
    if not np.isfinite(error) or not np.isfinite(predicted):
        return ""
    difference = (
        f"After removing sampling error, the variance of {content.output_names[at]} differs by {signed(paired[at])} % "
        f"(± {signed(error, 2)[1:]} %)"
    )
    if abs(paired[at]) <= 2.0 * error:
        return f"{difference}, which is not significant."
    difference += f"; second- and third-order terms predict {signed(predicted)} %"
    if abs(remainder) <= 2.0 * error:
        return f"{difference}, which explains it."
    return f"{difference}. The remainder is significant and due to higher orders."
