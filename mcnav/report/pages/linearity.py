"""Range of linearity as a page, in the terminal, and as tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import pandas as pd
from markupsafe import Markup
from numpy.typing import NDArray

from mcnav.analysis.linearity import AloneRange, DispersionRange
from mcnav.arrays.types import Array
from mcnav.contract.quantities import Output, Source, end_words
from mcnav.report.document.parts import Note, Page, Part, Section, Sentence, Verdict, joined
from mcnav.report.document.table import EMPHASIS, Cell, Column, Table
from mcnav.report.figures import linearity as drawn
from mcnav.report.names import humanize, labels_of
from mcnav.report.pages.screen import answered
from mcnav.report.statements.linearity import (
    JOINT,
    OF_NOISE,
    NoiseUse,
    answer,
    linearity_rows,
    multiple_words,
    without_sigma,
)

ALL_AT_ONCE: Final = "all at once"

OF_RATIOS: Final = (
    "Up to the first multiple the whole interval of the σ ratio is within ±{} of one. From the last multiple on the "
    "whole interval is outside. In between the result is undecided. The joint distribution is tested by the square "
    "root of the mean NEES."
)

OF_SOURCES: Final = Markup(
    "Grey values and rings: the source contributes less than 1 % of the output's total dispersion, so its nonlinearity "
    "hardly matters. {}: every source at plus one sigma, as in run 11 of NASA TN D-1772. Contributions of opposite "
    "sign may cancel there, so that small differences become large relative to the sum."
).format(EMPHASIS("All at once"))

MINOR: Final = 0.01
"""Share of the root sum square of all sources below which a source is minor for an output."""


def alone_table(
    alone_range: AloneRange, sizes: Array, sources: Sequence[Source], outputs: Sequence[Output]
) -> pd.DataFrame:
    """Tabulate the multiple, its sign and the resulting error of each source and output."""
    rows = []
    for j, name in enumerate([*(humanize(source.name) for source in sources), ALL_AT_ONCE]):
        for i, output in enumerate(outputs):
            multiple, sign = alone_range.multiples[j, i], alone_range.signs[j, i]
            row = {"source": name, "output": output.name, "multiple": multiple, "sign": sign}
            if j < len(sources):
                row |= {"error": sign * multiple * sizes[j] if sign else np.nan, "unit": sources[j].unit}
            rows.append(row)
    return pd.DataFrame(rows)


def dispersion_table(dispersion_range: DispersionRange, outputs: Sequence[Output]) -> pd.DataFrame:
    """Tabulate the sigma ratio and its interval for each multiple and output."""
    names, multiples = [*(output.name for output in outputs), "joint"], dispersion_range.multiples
    columns = {
        "ratio": dispersion_range.ratios,
        "interval from": dispersion_range.lower,
        "interval to": dispersion_range.upper,
    }
    return pd.DataFrame(
        {"multiple": np.repeat(multiples, len(names)), "of": np.tile(names, len(multiples))}
        | {name: values.ravel() for name, values in columns.items()}
    )


@dataclass(frozen=True)
class About:
    """Parts of the page of a study; as its attributes of these names."""

    tolerance: float
    confidence: float
    samples: int
    noise: NoiseUse
    sizes_alone: tuple[int, ...]


def remarks(outputs: Sequence[Output], noise: NoiseUse, sizes_alone: Sequence[int]) -> list[str]:
    """Say what becomes of noise, and of sizes without a linear sigma."""
    sizes = [humanize(outputs[number].name) for number in sizes_alone]
    return [sentence for sentence in (OF_NOISE[noise], without_sigma(sizes)) if sentence]


def page(
    campaign: str,
    about: About,
    single: AloneRange,
    dispersion: DispersionRange,
    contributions: Array,
    sources: Sequence[Source],
    outputs: Sequence[Output],
) -> Page:
    """Return the page.

    ``contributions`` is the linear effect of one sigma of each source, SI, shape (sources, outputs).
    """
    tolerance = about.tolerance
    names, within = [humanize(output.name) for output in outputs], f"{100 * tolerance:g} %"
    directions, minor = [*labels_of(sources, outputs), ALL_AT_ONCE], minor_effects(contributions)
    caption = (
        f"Multiples of the stated errors, from {about.samples:,} samples, which are the same at each multiple except "
        f"for scale. Intervals hold jointly at {100 * about.confidence:g} % for any one multiple."
    )
    question = f"By what factor can the stated errors grow before linear covariance analysis is wrong by {within}?"
    verdict = Verdict(answer(names, dispersion, tolerance))
    figure = drawn.ratios(dispersion, tolerance, [*names, JOINT])
    together: list[Part] = [
        figure, together_table(names, dispersion, tolerance, caption),
        Note(OF_RATIOS.format(within)),
    ]  # fmt: skip
    alone: list[Part] = [
        drawn.alone(single, minor, directions, names, end_words(outputs).one),
        _alone_multiples(single, minor, directions, names, f"nonlinear {end_words(outputs).one}", within),
        Note(OF_SOURCES),
    ]
    head = joined(verdict, Sentence(question), *map(Sentence, remarks(outputs, about.noise, about.sizes_alone)))
    sections = [
        Section("together", "All errors scaled together", together),
        Section("alone", "Each source alone", alone),
    ]
    whole = Page(f"{campaign}: range of linearity", "Range of linearity", campaign, head, sections)
    return answered(whole, drawn.foremost_ratio(figure, dispersion))


def terminal(outputs: Sequence[Output], dispersion: DispersionRange, tolerance: float) -> list[Part]:
    """List what the terminal shows: by what factor errors may grow, and of which sigmas."""
    names = [humanize(output.name) for output in outputs]
    return [Verdict(answer(names, dispersion, tolerance)), together_table(names, dispersion, tolerance)]


def together_table(
    names: Sequence[str], dispersion: DispersionRange, tolerance: float, caption: str = ""
) -> Table[tuple[str, list[str]]]:
    """Tabulate the multiples of all errors at which sigmas leave the tolerance."""

    def multiple(place: int, heading: str) -> Column[tuple[str, list[str]]]:
        return Column(heading, lambda row: row[1][place])

    headings = ("agrees up to", "exceeds tolerance at", "differs from")
    columns: list[Column[tuple[str, list[str]]]] = [
        Column("σ of", lambda row: row[0], "1σ of", "label"), *(multiple(*heading) for heading in enumerate(headings)),
    ]  # fmt: skip
    title = f"Multiple of the stated errors at which a sigma differs from the linear one by {100 * tolerance:g} %"
    return Table(caption, columns, linearity_rows(names, dispersion), title)


def _alone_multiples(
    single: AloneRange,
    minor: NDArray[np.bool_],
    directions: Sequence[str],
    names: Sequence[str],
    what: str,
    within: str,
) -> Table[int]:
    """Tabulate the multiples of each direction, a row each; values of minor sources are grey."""

    def of_output(i: int) -> Column[int]:
        return Column(
            names[i],
            lambda j: Cell(multiple_words(float(single.multiples[j, i]), single.largest), minor=bool(minor[j, i])),
        )

    columns = [Column("Source", lambda j: directions[j], kind="label"), *map(of_output, range(len(names)))]
    caption = f"Multiple of one sigma, of either sign, at which the {what} differs from the linear one by {within}."
    return Table(caption, columns, range(len(directions)))


def minor_effects(contributions: Array) -> NDArray[np.bool_]:
    """Mark the minor sources of each output, shape (sources + 1, outputs); the last row, all at once, is not minor."""
    minor = np.abs(contributions) < MINOR * np.sqrt((contributions**2).sum(axis=0))
    return np.vstack([minor, np.zeros(contributions.shape[1], dtype=bool)])
