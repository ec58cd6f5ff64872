"""A study of the range of linearity as one page and as tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import matplotlib as mpl
import numpy as np
import pandas as pd
from markupsafe import Markup
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mcnav.analysis.linearity import AloneRange, DispersionRange
from mcnav.report.content import spoken
from mcnav.report.page import filled
from mcnav.report.svg import FLOWN, LINEAR, MUTED, STYLE, new, svg
from mcnav.report.wording import JOINT, multiple_words
from mcnav.scenarios.protocol import Output, Source

Array = NDArray[np.float64]

ALL_AT_ONCE: Final = "all at once"

MINOR: Final = 0.01
"""A source that moves an output by less than this share of the root sum square of all is minor for it."""

MARKERS: Final = (("o", LINEAR), ("s", FLOWN), ("^", "#009e73"), ("D", "#7b3294"))


def _names(sources: Sequence[Source]) -> list[str]:
    return [*(spoken(source.name) for source in sources), ALL_AT_ONCE]


def alone_table(found: AloneRange, sizes: Array, sources: Sequence[Source], outputs: Sequence[Output]) -> pd.DataFrame:
    """One row for each direction and output: the multiple, its sign, and the error that it makes of a source."""
    rows = []
    for j, name in enumerate(_names(sources)):
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
    together = [
        {
            "name": name,
            "cells": [
                multiple_words(values[k], reached)
                for values in (dispersion.agrees_until, dispersion.departs, dispersion.differs_from)
            ],
        }
        for k, name in enumerate([*(spoken(output.name) for output in outputs), JOINT])
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
        for j, name in enumerate(_names(sources))
    ]
    return filled(
        "linearity.html",
        campaign=campaign,
        tolerance=f"{100 * tolerance:g} %",
        confidence=f"{100 * confidence:g} %",
        samples=samples,
        together=together,
        alone=alone_rows,
        outputs=[spoken(output.name) for output in outputs],
        ratios=Markup(ratio_figure(dispersion, tolerance, outputs)),
        dots=Markup(_dots(single, minor, sources, outputs)),
    )


def minor_effects(contributions: Array) -> NDArray[np.bool_]:
    """Where a source hardly moves an output, shape (sources + 1, outputs); the last row, for all at once, is never."""
    total = np.sqrt((contributions**2).sum(axis=0))
    minor = np.abs(contributions) < MINOR * total
    return np.vstack([minor, np.zeros(len(total), dtype=bool)])


def ratio_figure(found: DispersionRange, tolerance: float, outputs: Sequence[Output]) -> str:
    """Sigma ratio against the multiple, an output a panel, the joint distribution last."""
    names = [*(spoken(output.name) for output in outputs), JOINT]
    with mpl.rc_context(STYLE):
        figure, axes_array = new(9.0, 2.6 * -(-len(names) // 3) + 0.2, -(-len(names) // 3), 3, sharex=True)
        for column, (axes, name) in enumerate(zip(axes_array.flat, names, strict=False)):
            shown = np.isfinite(found.ratios[:, column]) & (np.abs(found.ratios[:, column] - 1.0) < 10.0 * tolerance)
            axes.axhspan(1.0 - tolerance, 1.0 + tolerance, color="#e4eef7", zorder=0)
            axes.fill_between(
                found.multiples[shown],
                found.lower[shown, column],
                np.minimum(found.upper[shown, column], 1.0 + 12.0 * tolerance),
                color=FLOWN,
                alpha=0.25,
                linewidth=0.0,
            )
            axes.plot(found.multiples[shown], found.ratios[shown, column], color=FLOWN)
            axes.axhline(1.0, color=LINEAR, linewidth=1.0)
            if np.isfinite(found.departs[column]):
                axes.axvline(found.departs[column], color=MUTED, linewidth=0.9, linestyle="--")
            axes.set_xscale("log")
            axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
            axes.set_ylim(1.0 - 4.0 * tolerance, 1.0 + 4.0 * tolerance)
            axes.set(title=name)
        for axes in axes_array.flat[len(names) :]:
            axes.set_visible(False)
        for axes in axes_array[:, 0]:
            axes.set_ylabel("sigma ratio")
        for axes in axes_array[-1]:
            axes.set_xlabel("multiple of the stated errors")
        return svg(
            figure,
            "linearity-ratios",
            "Sigma ratio against the size of the errors",
            "Paired sigma ratio with its interval for each output and the joint distribution, against the multiple of "
            "the stated errors; a dashed line marks where it leaves the tolerance.",
        )


def _dots(single: AloneRange, minor: NDArray[np.bool_], sources: Sequence[Source], outputs: Sequence[Output]) -> str:
    names = _names(sources)
    with mpl.rc_context(STYLE):
        figure, axes_array = new(9.0, 1.2 + 0.33 * len(names))
        axes: Axes = axes_array[0, 0]
        for i, output in enumerate(outputs):
            marker, colour = MARKERS[i % len(MARKERS)]
            for faint in (False, True):
                rows = np.flatnonzero(np.isfinite(single.multiples[:, i]) & (minor[:, i] == faint))
                place = rows + 0.14 * (i - 0.5 * (len(outputs) - 1))
                axes.plot(single.multiples[rows, i], place, marker, color=colour, alpha=0.3 if faint else 1.0,
                          label=None if faint else spoken(output.name), linestyle="none", markersize=5)  # fmt: skip
        axes.axvline(1.0, color=MUTED, linewidth=1.0)
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.set_yticks(range(len(names)), names)
        axes.set_ylim(len(names) - 0.5, -0.5)
        axes.set_xlabel("multiple of the stated error at which the final error leaves the linear one")
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.03))
        return svg(
            figure,
            "linearity-alone",
            "Range of linearity of each source alone",
            "For each source and output the multiple of the stated error at which the nonlinear final error departs "
            "from the linear one by the tolerance; faint where the source hardly matters for the output.",
        )
