"""Range of linearity as a page and as tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcnav._types import Array
from mcnav.analysis.linearity import AloneRange, DispersionRange
from mcnav.contract.quantities import Output, Source
from mcnav.report.figures import linearity as drawn
from mcnav.report.html import filled
from mcnav.report.linearity_words import WITHOUT_NOISE, answer, linearity_rows, multiple_words
from mcnav.report.model import humanize, labels_of
from mcnav.report.sentences import JOINT

ALL_AT_ONCE: Final = "all at once"

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


def render(
    campaign: str,
    about: tuple[float, float, int, bool],
    single: AloneRange,
    dispersion: DispersionRange,
    contributions: Array,
    sources: Sequence[Source],
    outputs: Sequence[Output],
) -> str:
    """Render the HTML page.

    ``about`` is tolerance, confidence, samples, and whether noise is left out; ``contributions`` is the linear effect
    of one sigma of each source, SI, shape (sources, outputs).
    """
    tolerance, confidence, samples, without_noise = about
    names = [humanize(output.name) for output in outputs]
    directions = [*labels_of(sources, outputs), ALL_AT_ONCE]
    minor = minor_effects(contributions)
    words = [[multiple_words(value, single.largest) for value in row] for row in single.multiples]
    return filled(
        "linearity.html",
        campaign=campaign,
        answer=answer(names, dispersion, tolerance),
        tolerance=f"{100 * tolerance:g} %",
        confidence=f"{100 * confidence:g} %",
        samples=samples,
        without_noise=WITHOUT_NOISE if without_noise else "",
        together=linearity_rows(names, dispersion),
        alone=[(name, list(zip(words[j], minor[j], strict=True))) for j, name in enumerate(directions)],
        outputs=names,
        ratios=drawn.ratios(dispersion, tolerance, [*names, JOINT]),
        dots=drawn.alone(single, minor, directions, names),
    )


def minor_effects(contributions: Array) -> NDArray[np.bool_]:
    """Mark the minor sources of each output, shape (sources + 1, outputs); the last row, all at once, is not minor."""
    minor = np.abs(contributions) < MINOR * np.sqrt((contributions**2).sum(axis=0))
    return np.vstack([minor, np.zeros(contributions.shape[1], dtype=bool)])
