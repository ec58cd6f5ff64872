"""A study of the range of linearity as one page and as tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcnav._types import Array
from mcnav.analysis.linearity import AloneRange, DispersionRange
from mcnav.report.figures import linearity as drawn
from mcnav.report.model import humanize
from mcnav.report.page import filled
from mcnav.report.sentences import JOINT, multiple_words
from mcnav.scenarios.protocol import Output, Source, source_labels

ALL_AT_ONCE: Final = "all at once"

MINOR: Final = 0.01
"""A source that moves an output by less than this share of the root sum square of all is minor for it."""


def alone_table(found: AloneRange, sizes: Array, sources: Sequence[Source], outputs: Sequence[Output]) -> pd.DataFrame:
    """One row for each direction and output: the multiple, its sign, and the error that it makes of a source."""
    rows = []
    for j, name in enumerate([*(humanize(source.name) for source in sources), ALL_AT_ONCE]):
        for i, output in enumerate(outputs):
            multiple, sign = found.multiples[j, i], found.signs[j, i]
            row = {"source": name, "output": output.name, "multiple": multiple, "sign": sign}
            if j < len(sources):
                row |= {"error": sign * multiple * sizes[j] if sign else np.nan, "unit": sources[j].unit}
            rows.append(row)
    return pd.DataFrame(rows)


def dispersion_table(found: DispersionRange, outputs: Sequence[Output]) -> pd.DataFrame:
    """One row for each multiple and output: sigma ratio and its interval."""
    names = [*(output.name for output in outputs), "joint"]
    return pd.DataFrame(
        [
            {
                "multiple": multiple,
                "of": name,
                "ratio": found.ratios[row, column],
                "interval from": found.lower[row, column],
                "interval to": found.upper[row, column],
            }
            for row, multiple in enumerate(found.multiples)
            for column, name in enumerate(names)
        ]
    )


def render(
    campaign: str,
    about: tuple[float, float, int],
    single: AloneRange,
    dispersion: DispersionRange,
    contributions: Array,
    sources: Sequence[Source],
    outputs: Sequence[Output],
) -> str:
    """The page. ``about``: tolerance, confidence, samples; ``contributions``, shape (sources, outputs): linear, SI."""
    tolerance, confidence, samples = about
    reached = float(dispersion.multiples[-1])
    names = [humanize(output.name) for output in outputs]
    directions = [*source_labels([each.name for each in sources], [each.name for each in outputs]), ALL_AT_ONCE]
    together = [
        {
            "name": name,
            "cells": [
                multiple_words(values[k], reached)
                for values in (dispersion.agrees_until, dispersion.departs, dispersion.differs_from)
            ],
        }
        for k, name in enumerate([*names, JOINT])
    ]
    minor = minor_effects(contributions)
    alone_rows = [
        {
            "name": name,
            "cells": [
                {"text": multiple_words(single.multiples[j, i], single.largest), "minor": bool(minor[j, i])}
                for i in range(len(outputs))
            ],
        }
        for j, name in enumerate(directions)
    ]
    return filled(
        "linearity.html",
        campaign=campaign,
        tolerance=f"{100 * tolerance:g} %",
        confidence=f"{100 * confidence:g} %",
        samples=samples,
        together=together,
        alone=alone_rows,
        outputs=names,
        ratios=drawn.ratios(dispersion, tolerance, [*names, JOINT]),
        dots=drawn.alone(single, minor, directions, names),
    )


def minor_effects(contributions: Array) -> NDArray[np.bool_]:
    """Where a source hardly moves an output, shape (sources + 1, outputs); the last row, for all at once, is never."""
    total = np.sqrt((contributions**2).sum(axis=0))
    minor = np.abs(contributions) < MINOR * total
    return np.vstack([minor, np.zeros(len(total), dtype=bool)])
