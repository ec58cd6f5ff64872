"""Errors throughout the flight: three sigma of linear analysis and of the flights, and percentiles."""

from __future__ import annotations

from functools import partial
from typing import Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from mcnav.analysis.envelopes import Envelopes
from mcnav.report.content import Content
from mcnav.report.drawings.drawing import Drawing, Plot, Series, axis_label
from mcnav.report.svg import AREA, FLOWN, INK, LINEAR, MUTED

LINEAR_3: Final = Series("linear", "linear, mean ± 3σ", LINEAR)
FLOWN_3: Final = Series("flown", "Monte Carlo, mean ± 3σ", FLOWN, "dashed")


def envelopes(content: Content) -> Drawing | None:
    """Every output that moves; none where errors throughout the flight are not known."""
    known = content.envelopes
    if known is None:
        return None
    moving = [i for i in content.moving if np.any(known.linear_sigma[:, i] > 0.0)]
    if not moving:
        return None
    names, units, scale = content.output_names, content.output_units, content.output_scale
    low, *_, high = known.percentiles
    band = Series("percentiles", f"{low} % to {high} % of {known.stored:,} flights", AREA, "area")
    columns = {known.label: known.times}
    for i in moving:
        for words, values in (
            ("linear mean", known.linear_mean),
            ("linear sigma", known.linear_sigma),
            ("mean", known.mean),
            ("sigma", known.sigma),
        ):
            columns[f"{names[i]}, {words} [{units[i]}]"] = values[:, i] * scale[i]
    return Drawing(
        key="envelopes",
        title="Errors throughout the flight",
        description="For each output three sigma by linear analysis and of all flights, and percentiles of some.",
        plots=[
            Plot(names[i], partial(_envelope, known=known, output=i, scale=float(scale[i]), unit=units[i], band=band))
            for i in moving
        ],
        series=(LINEAR_3, FLOWN_3, band),
        data=pd.DataFrame(columns),
        caption="Ranges are arc lengths on the earth's surface. Samples that left the fast engine's validity are not "
        "followed.",
    )


def _envelope(axes: Axes, known: Envelopes, output: int, scale: float, unit: str, band: Series) -> None:
    low, *_, high = (values[:, output] * scale for values in known.percentiles.values())
    axes.fill_between(known.times, low, high, color=AREA, linewidth=0.0, zorder=0, gid=band.gid)
    for sign in (-3.0, 3.0):
        linear = (known.linear_mean + sign * known.linear_sigma)[:, output] * scale
        flown = (known.mean + sign * known.sigma)[:, output] * scale
        axes.plot(known.times, linear, color=LINEAR, linewidth=1.8, gid=LINEAR_3.gid)
        axes.plot(known.times, flown, "--", color=FLOWN, linewidth=1.4, gid=FLOWN_3.gid)
    axes.plot(known.times, known.mean[:, output] * scale, color=FLOWN, linewidth=0.8, gid=FLOWN_3.gid)
    for event, place in known.events.items():
        if known.times[0] < place < known.times[-1]:
            axes.axvline(place, color=MUTED, linewidth=1.0, linestyle=":")
            axes.annotate(f" {event}", (place, 0.02), xycoords=("data", "axes fraction"), color=INK, fontsize=8)
    axes.set(xlabel=axis_label(known.label), ylabel=f"error ({unit})")
    axes.margins(x=0.0)
