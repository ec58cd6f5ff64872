"""A study of start times as one page and as a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import matplotlib as mpl
import numpy as np
import pandas as pd
from markupsafe import Markup
from numpy.typing import NDArray

from mcnav.linear.start_times import StartTimeStudy
from mcnav.report.content import spoken
from mcnav.report.page import filled, number
from mcnav.report.svg import FLOWN, LINEAR, MUTED, SOURCE_COLOURS, STYLE, new, svg
from mcnav.scenarios.protocol import Output, Source
from mcnav.units import conversion

Array = NDArray[np.float64]

CONVENTIONS: Final = {
    "start": "The reference axes are alined at each start.",
    "trajectory": "The reference axes are those alined at the first point of the trajectory throughout.",
}
INITIAL_CONDITIONS: Final = 4
"""The first sources are initial conditions, the others equipment; each kind has a panel of its own."""


def table(study: StartTimeStudy, sources: Sequence[Source], outputs: Sequence[Output]) -> pd.DataFrame:
    """One row a start time: every partial derivative and every sigma, SI units in the column names."""
    columns = {"start [s]": study.times}
    for i, output in enumerate(outputs):
        columns[f"sigma {output.name} [{output.unit}]"] = study.sigma[:, i]
    for i, output in enumerate(outputs):
        for j, source in enumerate(sources):
            unit = f"{output.unit} per {source.unit}"
            columns[f"d {output.name} / d {source.name} [{unit}]"] = study.partials[:, i, j]
    return pd.DataFrame(columns)


def render(
    campaign: str, study: StartTimeStudy, sources: Sequence[Source], outputs: Sequence[Output], sizes: Array
) -> str:
    """The page. ``sizes``, shape (sources,), are the errors whose effects the curves show: one sigma of each, SI."""
    minutes = study.times / 60.0
    scale = np.array([conversion(output.unit, output.shown_in) for output in outputs])
    rows = [
        {
            "name": spoken(output.name),
            "unit": output.shown_in,
            "time": f"{minutes[study.best[i]]:.1f}".replace("-", "−"),
            "sigma": number(study.sigma[study.best[i], i] * scale[i]),
            "first": number(study.sigma[0, i] * scale[i]),
        }
        for i, output in enumerate(outputs)
    ]
    effects = study.partials * sizes * scale[:, None]
    curves = [
        (spoken(output.name), Markup(_effects(minutes, effects[:, i], sources, output)))
        for i, output in enumerate(outputs)
    ]
    return filled(
        "start_times.html",
        campaign=campaign,
        convention=CONVENTIONS[study.axes],
        dispersion=Markup(_dispersion(minutes, study.sigma * scale, outputs, study.best)),
        best=rows,
        partials=curves,
    )


def _dispersion(minutes: Array, sigma: Array, outputs: Sequence[Output], best: Array) -> str:
    with mpl.rc_context(STYLE):
        figure, axes_array = new(9.0, 5.2, -(-len(outputs) // 2), 2)
        for i, (axes, output) in enumerate(zip(axes_array.flat, outputs, strict=False)):
            axes.plot(minutes, sigma[:, i], color=LINEAR)
            axes.plot(minutes[best[i]], sigma[best[i], i], "o", color=FLOWN, markersize=5)
            axes.axvline(0.0, color=MUTED, linewidth=0.8, linestyle="--")
            axes.set_ylim(bottom=0.0)
            axes.set(title=f"final {spoken(output.name)}", ylabel=f"sigma ({output.shown_in})")
            axes.set_xlabel("start of navigation (min from reentry)")
        return svg(
            figure,
            "start-dispersion",
            "Dispersion against the start of navigation",
            "Linear sigma of each final error against the start time; a dot marks the best start up to reentry.",
        )


def _effects(minutes: Array, effects: Array, sources: Sequence[Source], output: Output) -> str:
    """What one sigma of each source does to one output, against the start time: two panels."""
    with mpl.rc_context(STYLE):
        figure, axes_array = new(9.0, 3.4, 1, 2)
        kinds = (
            ("initial conditions", range(INITIAL_CONDITIONS)),
            ("equipment", range(INITIAL_CONDITIONS, len(sources))),
        )
        for axes, (title, members) in zip(axes_array[0], kinds, strict=True):
            for j in members:
                colour = SOURCE_COLOURS[j % len(SOURCE_COLOURS)]
                axes.plot(minutes, effects[:, j], color=colour, label=spoken(sources[j].name))
            axes.axvline(0.0, color=MUTED, linewidth=0.8, linestyle="--")
            axes.set(title=title, xlabel="start of navigation (min from reentry)")
            axes.legend(loc="best", fontsize=8)
        axes_array[0, 0].set_ylabel(f"{spoken(output.name)} for one sigma ({output.shown_in})")
        return svg(
            figure,
            f"start-{output.name}",
            f"Final {spoken(output.name)} for one sigma of each source",
            "Partial derivative times one sigma of each source, against the start of navigation.",
        )
