"""Mean errors that exceed one sigma in words: a sigma alone does not tell such an error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from mcnav.analysis.mean_errors import LargeMean, large_means
from mcnav.arrays.types import Array
from mcnav.contract.quantities import Of
from mcnav.report.format import number, signed
from mcnav.report.names import humanize, shown_units
from mcnav.report.statements.words import several

if TYPE_CHECKING:
    from mcnav.analysis.summary import Summary

DIGITS: Final = 3
"""Significant digits in sentences."""


def large_means_of(summary: Summary) -> tuple[LargeMean, ...]:
    """List the mean errors of a run that exceed one sigma with its confidence, the largest in sigmas first.

    Of a run of an earlier version it is the linear mean of navigation errors.
    """
    sigma = _numbers(summary.sigma_paired) if len(summary.sigma_paired) else np.asarray(summary.sigma_linear)
    if summary.beyond_range or not len(sigma) == len(summary.mean_linear) == len(summary.outputs):
        return ()
    if not summary.mean_error:
        are_errors = np.array([output.of == "navigation" for output in summary.outputs], dtype=bool) & (sigma > 0.0)
        mean = np.where(are_errors, summary.mean_linear, np.nan)
        return large_means(mean, sigma, np.zeros(len(mean)))
    mean = _numbers(summary.mean_error)
    ends = np.array([_numbers(ends_of_one or (None, None)) for ends_of_one in summary.mean_error_interval])
    least = np.where(ends[:, 0] > 0.0, ends[:, 0], np.where(ends[:, 1] < 0.0, -ends[:, 1], 0.0))
    return large_means(mean, sigma, _numbers(summary.mean_rounding), least)


def _numbers(values: Sequence[float | None]) -> Array:
    return np.array([math.nan if value is None else value for value in values], dtype=float)


def mean_sentence(summary: Summary) -> str:
    """Say which mean errors of a run exceed one sigma; empty where none does."""
    units = shown_units(summary)
    named = [(output.name, output.of, *units[output.name]) for output in summary.outputs]
    return sentence_on(large_means_of(summary), named)


def sentence_on(large: Sequence[LargeMean], named: Sequence[tuple[str, Of, float, str]]) -> str:
    """Say which mean errors exceed one sigma, the largest in sigmas first; empty where none does.

    Parameters
    ----------
    named : sequence of (str, str, float, str)
        Of the outputs: name, what they are of, factor from SI to the unit shown, and that unit.

    >>> sentence_on([LargeMean(0, 387e3, 21.5e3)], [("altitude", "navigation", 1e-3, "km")])
    'The mean error of altitude is +387 km, 18.0 times its sigma of 21.5 km. The sigma alone understates the error.'
    """
    if not large:
        return ""
    first, *others = large
    name, of, scale, unit = named[first.output]
    what = f"mean error of {humanize(name)}" if of == "navigation" else f"mean of {humanize(name)} off the nominal"
    shown = f"The {what} is {signed(first.mean * scale, DIGITS)} {unit}, {against(first, scale, unit)}"
    if not others:
        return f"{shown}. The sigma alone understates the error."
    listed = several([humanize(named[other.output][0]) for other in others])
    too = "The mean of {} exceeds its sigma too" if len(others) == 1 else "The means of {} exceed their sigmas too"
    return f"{shown}. {too.format(listed)}. Sigmas alone understate these errors."


def against(large: LargeMean, scale: float, unit: str) -> str:
    """Compare a mean error with its sigma."""
    if math.isinf(large.ratio):
        return "and its sigma is zero" if large.sigma == 0.0 else "more than a million times its sigma"
    return f"{number(large.ratio, DIGITS)} times its sigma of {number(large.sigma * scale, DIGITS)} {unit}"
