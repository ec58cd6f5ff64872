"""Errors throughout the flight: three sigma of linear analysis and of the flights, and percentiles."""

from __future__ import annotations

from functools import partial
from typing import Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from mcnav.analysis.envelopes import Envelopes
from mcnav.report.figures.figure import Figure, Plot, Series, axis_label, mark
from mcnav.report.model import RunAnalysis
from mcnav.report.svg import AREA, FLOWN, LINEAR

LINEAR_3: Final = Series("linear", "linear, mean ± 3σ", LINEAR)
FLOWN_3: Final = Series("flown", "Monte Carlo, mean ± 3σ", FLOWN, "dashed")


def envelopes(content: RunAnalysis) -> Figure | None:
    """Every output that moves; none where errors throughout the flight are not known."""
    known = content.envelopes
    if known is None:
        return None
    moving = [i for i in content.moving if np.any(known.linear_sigma[:, i] > 0.0)]
    if not moving:
        return None
    names, units, scale = content.output_names, content.output_units, content.output_scale
    low, *_, high = known.percentiles
    band = Series("percentiles", f"{low} % to {high} % of {known.stored:,} samples", AREA, "area")
    columns = {known.label: known.times}
    for i in moving:
        for words, values in (
            ("linear mean", known.linear_mean),
            ("linear sigma", known.linear_sigma),
            ("mean", known.mean),
            ("sigma", known.sigma),
        ):
            columns[f"{names[i]}, {words} [{units[i]}]"] = values[:, i] * scale[i]
    return Figure(
        key="envelopes",
        title="Errors over the flight",
        description="Three sigma of each output by linear analysis and Monte Carlo, and percentiles of stored samples.",
        plots=[
            Plot(names[i], partial(_envelope, known=known, output=i, scale=float(scale[i]), unit=units[i], band=band))
            for i in moving
        ],
        series=(LINEAR_3, FLOWN_3, band),
        data=pd.DataFrame(columns),
        caption="Ranges are arc lengths on the earth's surface. Samples outside the fast engine's range of validity "
        "are not included.",
    )


def _envelope(axes: Axes, known: Envelopes, output: int, scale: float, unit: str, band: Series) -> None:
    low, *_, high = (values[:, output] * scale for values in known.percentiles.values())
    band.band(axes, known.times, low, high)
    for sign in (-3.0, 3.0):
        linear = (known.linear_mean + sign * known.linear_sigma)[:, output] * scale
        flown = (known.mean + sign * known.sigma)[:, output] * scale
        LINEAR_3.on(axes, known.times, linear, linewidth=1.8)
        FLOWN_3.on(axes, known.times, flown)
    FLOWN_3.on(axes, known.times, known.mean[:, output] * scale, linestyle="-", linewidth=0.8)
    axes.set(xlabel=axis_label(known.label), ylabel=f"error ({unit})")
    axes.margins(x=0.0)
    for event, place in known.events.items():
        if known.times[0] < place < known.times[-1]:
            mark(axes, place, event)
