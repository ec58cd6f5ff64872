"""A range of linearity in words: the answer, multiples, and what a study without noise leaves out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final, Literal

import numpy as np

from mcnav.analysis.linearity import DispersionRange

JOINT: Final = "joint distribution"
"""Name of the NEES test among the outputs."""

WITHOUT_NOISE: Final = (
    "The scenario has noise, which is left out here: the range is that of the constant errors. "
    "A run compares linear covariance and samples with noise."
)
"""Note on the range of linearity of a scenario whose noise cannot be multiplied."""

NoiseUse = Literal["", "scaled", "left out"]
"""Treatment of the noise of a scenario, if it has any."""

OF_NOISE: Final[Mapping[NoiseUse, str]] = {
    "": "",
    "scaled": (
        "Noise is multiplied like the errors, and so is what a filter believes of both. Each source alone is simulated "
        "without noise."
    ),
    "left out": WITHOUT_NOISE,
}


def without_sigma(names: Sequence[str]) -> str:
    """Name sizes that are zero in the nominal; empty for none."""
    if not names:
        return ""
    return (
        f"Linear analysis has no σ of sizes that are zero in the nominal, and they have no range: {', '.join(names)}."
    )


def multiple_words(value: float, largest: float) -> str:
    """Format a multiple: a dash where there is no effect, a lower bound where it was not reached.

    >>> multiple_words(8.2345, 100.0), multiple_words(float("inf"), 100.0)
    ('8.23', '> 100')
    """
    if math.isnan(value):
        return "–"
    return f"> {largest:g}" if math.isinf(value) else f"{value:.3g}"


def linearity_rows(names: Sequence[str], dispersion_range: DispersionRange) -> list[tuple[str, list[str]]]:
    """List the multiples up to which each output and the joint distribution agrees, departs, and differs."""
    columns = zip(
        [*names, JOINT],
        dispersion_range.agrees_until,
        dispersion_range.departs,
        dispersion_range.differs_from,
        strict=True,
    )
    smallest, largest = (float(dispersion_range.multiples[end]) for end in (0, -1))

    def words(value: float) -> str:
        return f"< {smallest:g}" if value <= smallest else multiple_words(value, largest)

    return [(name, [words(float(value)) for value in values]) for name, *values in columns]


def answer(names: Sequence[str], dispersion_range: DispersionRange, tolerance: float) -> str:
    """Say by what factor the stated errors may grow, by the sigmas of all outputs and by their joint distribution."""
    agrees, within = dispersion_range.agrees_until[:-1], f"within ±{100.0 * tolerance:g} % of the linear one"
    if np.isnan(agrees).all():
        return "No error source acts on any output: there is nothing to compare."
    first = int(np.flatnonzero(agrees == np.nanmin(agrees))[0])
    value, smallest, largest = (
        float(agrees[first]),
        float(dispersion_range.multiples[0]),
        float(dispersion_range.multiples[-1]),
    )
    if math.isinf(value):
        tried = f"by a factor of {largest:g}, the largest tried"
        sigmas = f"All errors may grow {tried}: every sigma is shown to be {within}."
    elif value <= smallest:
        tried = f"the smallest multiple tried, {smallest:g}"
        sigmas = f"At no multiple is every sigma shown to be {within}: {names[first]} is not at {tried}."
    elif value < 1.0:
        factor = f"{value:.3g} times them is every sigma shown to be {within}"
        sigmas = f"The errors are too large: only up to {factor}. First beyond: {names[first]}."
    else:
        sigmas = (
            f"All errors may grow by a factor of {value:.3g}: up to it every sigma is shown to be {within}. With "
            f"larger errors {names[first]} is the first to fail."
        )
    return f"{sigmas} {_joint(float(dispersion_range.agrees_until[-1]), smallest)}".strip()


def _joint(multiple: float, smallest: float) -> str:
    """Say up to which multiple the joint distribution agrees; empty where it was not tested."""
    if math.isnan(multiple):
        return ""
    if math.isinf(multiple):
        return "The full covariance matrix agrees at all multiples tried."
    if multiple <= smallest:
        return f"The full covariance matrix is not shown to agree even at {smallest:g} times the stated errors."
    if multiple < 1.0:
        return f"The full covariance matrix agrees only up to {multiple:.3g} times the stated errors."
    return f"The full covariance matrix agrees up to a factor of {multiple:.3g}."
