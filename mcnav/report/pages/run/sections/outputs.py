"""The sections on single outputs: their distributions, their sigmas, and the requirements on them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from markupsafe import Markup

from mcnav.arrays.types import Array
from mcnav.report.columns.output_columns import outputs_table
from mcnav.report.columns.percentiles import percentiles_table, prominence
from mcnav.report.columns.requirements import allowed_by_requirement, requirements_table
from mcnav.report.columns.vector_sizes import sizes_table
from mcnav.report.document import formulas
from mcnav.report.document.parts import Folded, Part, Section, Sentence, headed, joined
from mcnav.report.document.table import CODE, EMPHASIS, Column, Table, five_digits
from mcnav.report.drawing.figure import Figure
from mcnav.report.results.model import RunAnalysis

FARTHEST: Final = 5
"""Samples with the largest NEES that are listed."""

ESTIMATES: Final = (
    "Sampling noise common to both cancels, so the interval is narrower. Verdicts use this estimate. An output agrees "
    "if the whole interval of the ratio lies within ±{tolerance} of one. The {detectable} of the paired ratio from one "
    "is the one detected with a probability of 90 %. The {bias} is the mean of nonlinear minus linear errors, ± one "
    "standard error. The {plain} sigma is the standard deviation of y. The {unscented} sigma uses a few simulations at "
    "fixed points and overestimates quadratic terms. The {higher} sigma is that of a polynomial fitted to a few "
    "simulations, in closed form for normal sources."
)
"""Description of the estimates of a sigma, after the formula of the paired one."""


def dispersion_section(content: RunAnalysis, drawn: Mapping[str, Figure]) -> Section:
    """Arrange the distributions of single outputs, their quantiles, and the largest errors."""
    farthest = _farthest_table(content)
    percentiles = percentiles_table(content.summary, "shown", *_levels(content)).read.foremost(
        prominence, "quantiles", "first those that differ, then those farthest from linear analysis"
    )
    sizes = sizes_table(content.summary, "shown", _levels(content)[0]).read if content.summary.sizes else None
    largest = "Farthest samples" if content.several_kinds else "Largest errors"
    return Section("dispersion", "Single outputs", [
        *joined(drawn.get("histograms")),
        *headed("Normal quantile plots", drawn.get("quantiles")),
        *headed("Size of corrections", sizes),
        Folded("Error percentiles", [percentiles]),
        *headed(largest, farthest if farthest.rows else None),
    ])  # fmt: skip


def _levels(content: RunAnalysis) -> tuple[str, str]:
    """Return confidence and tolerance of all verdicts together."""
    return f"{100.0 * content.summary.confidence:g} %", f"{100.0 * content.summary.tolerance:g} %"


@dataclass(frozen=True)
class _Far:
    """A sample with its NEES and its errors, in the units shown."""

    index: int
    nees: float
    outputs: Array


def _farthest_table(content: RunAnalysis) -> Table[_Far]:
    """Tabulate the samples with the largest NEES."""

    def error(i: int) -> Column[_Far]:
        return Column(
            content.output_names[i], lambda row: float(row.outputs[i]), form=five_digits, unit=content.output_units[i]
        )

    result, rows = content.comparison.ellipsoid, list[_Far]()
    if result is not None:
        numbers = content.index[np.isfinite(content.outputs).all(axis=1)]
        order = np.argsort(-result.values, kind="stable")[:FARTHEST].tolist()
        rows = [_Far(int(numbers[k]), float(result.values[k]), content.flown[k]) for k in order]
    columns: list[Column[_Far]] = [
        Column("Sample", lambda row: str(row.index)),
        Column("Squared distance", lambda row: row.nees),
        *map(error, range(len(content.output_names))),
    ]
    replay = CODE("mcnav replay . SAMPLE")
    caption = Markup(
        "Samples with the largest squared distance to the linear covariance, in sigmas. {} in the run folder simulates "
        "one again."
    ).format(replay)
    return Table(caption, columns, rows)


def requirements_section(content: RunAnalysis, drawn: Mapping[str, Figure]) -> Section | None:
    """Arrange the requirements, their tails, those over time, and the sigmas that each allows; none without any."""
    if not content.summary.requirements:
        return None
    confidence, _ = _levels(content)
    asked = requirements_table(content.summary, "shown", content.time_unit, confidence).read
    allowed = allowed_by_requirement(content.summary)
    folded = [Folded(f"Allowed source sigmas: {words}", [table]) for words, table in allowed.items()]
    figures = joined(drawn.get("tails"), drawn.get("requirements_over_time"))
    return Section("requirements", "Requirements", [asked, *figures, *folded])


def sigmas_section(content: RunAnalysis, drawn: Mapping[str, Figure]) -> Section:
    """Arrange linear and Monte Carlo sigmas, and how the ratios converge."""
    together, tolerance = _levels(content)
    what = content.ends.title if content.several_kinds else "Final navigation errors"
    caption = (
        f"{what}, one sigma: linear and Monte Carlo (paired and plain estimates). Intervals hold at "
        f"{100.0 * content.comparison.confidence_each:.4g} % each and {together} jointly."
    )
    parts: list[Part] = [
        *joined(drawn.get("ratios")),
        Folded("All estimates of each sigma", [outputs_table(content.summary, caption=caption).read]),
        Folded("Definition of the estimates", _definition(tolerance), explains=True),
        *headed("Convergence", drawn.get("convergence")),
    ]
    return Section("linear", "Linear and Monte Carlo sigmas", parts)


def _definition(tolerance: str) -> list[Part]:
    propagated = Markup(
        "The {} estimate propagates the same samples s of the errors by the nonlinear simulation, which gives y, and "
        "by P:"
    ).format(EMPHASIS("paired"))
    words = {"detectable": "smallest detectable difference", "bias": "bias", "plain": "plain",
             "unscented": "unscented", "higher": "higher-order"}  # fmt: skip
    named = {key: EMPHASIS(word) for key, word in words.items()}
    return [Sentence(propagated), formulas.PAIRED, Sentence(Markup(ESTIMATES).format(tolerance=tolerance, **named))]
