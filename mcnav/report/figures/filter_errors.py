"""Errors of an aided navigation over time: some samples, and sigmas by Monte Carlo, linear analysis and the filter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.filter_consistency import FilterConsistency, SigmaConsistency
from mcnav.arrays.types import Array
from mcnav.physics.units import conversion
from mcnav.report.drawing.figure import Figure, side_by_side
from mcnav.report.drawing.marks import Axis, Line, Mark, Panel, Series, Span, axis
from mcnav.report.drawing.palette import FILTER, FLOWN, LINEAR, POINT
from mcnav.report.figures.outages import outages, shading_key
from mcnav.report.names import humanize
from mcnav.report.results.model import RunAnalysis

MULTIPLE: Final = 3.0
"""Sigmas from zero to the lines."""

DRAWN: Final = 10
"""Samples drawn."""

SAMPLES: Final = Series("samples", "samples", POINT)
SIGMAS: Final = {
    "linear": Series("linear", "linear", LINEAR),
    "Monte Carlo": Series("flown", "Monte Carlo", FLOWN),
    "filter": Series("filter", "filter", FILTER),
}


def sigmas(consistency: SigmaConsistency) -> dict[str, NDArray[np.float64]]:
    """Return the sigmas of a quantity over time in the unit shown: linear where known, Monte Carlo, the filter's."""
    scale = conversion(consistency.unit, consistency.shown_in)
    linear = {} if consistency.true_linear is None else {"linear": consistency.true_linear * scale}
    return {**linear, "Monte Carlo": consistency.true * scale, "filter": consistency.filter * scale}


def whole_flight(consistency: FilterConsistency) -> Axis:
    """Return the time axis of a filter's diagrams, from the first epoch to the last."""
    return replace(
        axis(consistency.label, link=True), low=float(consistency.times[0]), high=float(consistency.times[-1])
    )


def errors_and_sigmas(content: RunAnalysis, consistency: FilterConsistency) -> Figure | None:
    """Draw every output whose sigmas are known."""
    known = [output for output in consistency.outputs if np.isfinite(output.true).any() and np.any(output.true > 0.0)]
    if not known:
        return None
    expected = [f"{output.name} [{output.unit}]" for output in content.manifest.model.outputs]
    stored = content.folder.histories(DRAWN, expected)
    times, histories = (consistency.times, {}) if stored is None else stored[1:]
    shaded = outages(content)
    columns: dict[str, Sequence[Any] | NDArray[Any]] = {consistency.label: consistency.times}
    for judged in known:
        for whose, values in sigmas(judged).items():
            columns[f"{humanize(judged.name)}, {whose} σ [{judged.shown_in}]"] = values
    listed = [series for name, series in SIGMAS.items() if any(name in sigmas(judged) for judged in known)]
    drawn = [SAMPLES] if any(len(_complete(histories, judged)) for judged in known) else []
    return Figure(
        name="envelopes",
        title="Navigation errors over the flight" if content.several_kinds else "Errors over the flight",
        description="Errors of some samples, and sigmas of each output by Monte Carlo, linear analysis and the filter, "
        "over time.",
        panels=[_panel(consistency, judged, times, _complete(histories, judged), shaded) for judged in known],
        key=[*listed, *drawn, *shading_key(shaded)],
        columns=columns,
        size=side_by_side(len(known)),
        caption="Filter sigma: root of the mean variance over all samples.",
    )


def _complete(histories: Mapping[str, Array], consistency: SigmaConsistency) -> Array:
    """Return the histories of an output without those of failed samples, in the unit shown."""
    result = histories.get(f"{consistency.name} [{consistency.unit}]", np.empty((0, 0)))
    return result[np.isfinite(result).all(axis=1)] * conversion(consistency.unit, consistency.shown_in)


def _panel(
    consistency: FilterConsistency, judged: SigmaConsistency, times: Array, histories: Array, shaded: Sequence[Span]
) -> Panel:
    marks: list[Mark] = [*shaded, *(Line(SAMPLES, times, history, 0.7, silent=True) for history in histories)]
    for whose, values in sigmas(judged).items():
        width = 3.2 if whose == "linear" else 1.6
        marks += [Line(SIGMAS[whose], consistency.times, sign * MULTIPLE * values, width) for sign in (-1.0, 1.0)]
    upward = Axis(f"error, ±{MULTIPLE:g}σ", judged.shown_in)
    return Panel(humanize(judged.name), whole_flight(consistency), upward, marks)
