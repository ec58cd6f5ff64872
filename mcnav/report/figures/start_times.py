"""When to start: dispersion and the effect of each source against the start of navigation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from mcnav._types import Array
from mcnav.analysis.comparison import Comparison
from mcnav.lincov.start_times import StartTimeStudy
from mcnav.report.figures.figure import HALF, Figure, Plot, Series, mark, numbered
from mcnav.report.model import humanize
from mcnav.report.svg import FLOWN, INK, LINEAR
from mcnav.scenarios.protocol import Output

START: Final = "start of navigation (min from reentry)"
INITIAL_CONDITIONS: Final = 4
"""The first sources are initial conditions, the others equipment; each kind has a plot of its own."""

SIGMA: Final = Series("linear", "linear, P·S·Pᵀ", LINEAR)
BEST: Final = Series("best", "best start", INK, "triangle")
CHECKED: Final = Series("flown", "Monte Carlo", FLOWN, "ring")


def dispersion(
    study: StartTimeStudy, checks: Mapping[float, Comparison], scale: Array, outputs: Sequence[Output]
) -> Figure:
    """Sigma of each output against the start, linear and where Monte Carlo checked it.

    Parameters
    ----------
    study : StartTimeStudy
    checks : mapping of float to Comparison
        By start time, s.
    scale : ndarray, shape (outputs,)
        What SI values are multiplied by to be shown.
    outputs : sequence of Output
    """
    starts, sigma = study.times / 60.0, study.sigma * scale

    def draw(axes: Axes, i: int) -> None:
        SIGMA.on(axes, starts, sigma[:, i], linewidth=1.6)
        known = [(time / 60.0, c.outputs[i].sigma_paired * scale[i]) for time, c in checks.items() if c.outputs]
        if known:
            CHECKED.on(axes, *np.array(known).T)
        # above the curve, where it hides no flown value
        BEST.on(axes, starts[study.best[i]], sigma[study.best[i], i] + 0.05 * sigma[:, i].max())
        axes.set_ylim(bottom=0.0)
        axes.set(xlabel=START, ylabel=f"1σ ({outputs[i].shown_in})")
        mark(axes, 0.0, "reentry")

    names = [humanize(output.name) for output in outputs]
    columns = [f"{name}, 1σ [{output.shown_in}]" for name, output in zip(names, outputs, strict=True)]
    frame = {"start [min from reentry]": starts} | dict(zip(columns, sigma.T, strict=True))
    return Figure(
        key="dispersion",
        title="Dispersion by start of navigation",
        description="Sigma of each final error against the start time, linear and Monte Carlo; a triangle marks the "
        "best start up to reentry.",
        plots=[Plot(f"final {name}", partial(draw, i=i)) for i, name in enumerate(names)],
        series=(SIGMA, *([CHECKED] if checks else []), BEST),
        data=pd.DataFrame(frame | {"all, weighted [1]": study.weighted}),
        file="start_times.csv",
    )


def effects(study: StartTimeStudy, i: int, scale: float, labels: Sequence[str], output: Output) -> Figure:
    """Draw the effect of one sigma of each source on one output against the start time.

    ``labels`` name the sources.
    """
    starts, values, name = study.times / 60.0, study.effects[:, i] * scale, humanize(output.name)
    series = [numbered(j, label) for j, label in enumerate(labels)]

    def draw(axes: Axes, members: Sequence[int]) -> None:
        for j in members:
            series[j].on(axes, starts, values[:, j])
        axes.set(xlabel=START, ylabel=f"final {name} ({output.shown_in})")
        mark(axes, 0.0, "reentry")

    frame = {f"{each.label} [{output.shown_in}]": values[:, j] for j, each in enumerate(series)}
    return Figure(
        key=f"effects-{output.name}".replace("_", "-"),
        title=f"Final {name} for one sigma of each source",
        description="Partial derivative times one sigma of each source, against the start of navigation.",
        plots=[
            Plot("Initial conditions", partial(draw, members=range(INITIAL_CONDITIONS))),
            Plot("Equipment", partial(draw, members=range(INITIAL_CONDITIONS, len(labels)))),
        ],
        series=series,
        data=pd.DataFrame({"start [min from reentry]": starts} | frame),
        size=(HALF[0], 2.9),
        caption=f"Final error in {name} for one sigma of each source: partial derivative times sigma.",
        file="start_times.csv",
    )
