"""A study of start times as one page and as tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import pandas as pd

from mcnav._types import Array
from mcnav.analysis.comparison import Comparison
from mcnav.lincov.start_times import StartTimeStudy
from mcnav.report.figures import start_times as drawn
from mcnav.report.format import number
from mcnav.report.model import humanize
from mcnav.report.page import filled
from mcnav.report.sentences import NOT_DISTURBED, output_words
from mcnav.scenarios.protocol import Output, Source, source_labels
from mcnav.units import conversion

CONVENTIONS: Final = {
    "start": "The reference axes are aligned at each start.",
    "trajectory": "The reference axes are those aligned at the first point of the trajectory throughout.",
}


def table(study: StartTimeStudy, sources: Sequence[Source], outputs: Sequence[Output]) -> pd.DataFrame:
    """One row a start time: every partial derivative and every sigma, SI units in the column names."""
    columns = {"start [s]": study.times}
    for i, output in enumerate(outputs):
        columns[f"sigma {output.name} [{output.unit}]"] = study.sigma[:, i]
    columns["weighted sigma [1]"] = study.weighted
    for i, output in enumerate(outputs):
        for j, source in enumerate(sources):
            unit = f"{output.unit} per {source.unit}"
            columns[f"d {output.name} / d {source.name} [{unit}]"] = study.partials[:, i, j]
    return pd.DataFrame(columns)


def check_table(checks: Mapping[float, Comparison], outputs: Sequence[Output]) -> pd.DataFrame:
    """One row for each output at each start time that Monte Carlo checked, SI."""
    rows = []
    for time, comparison in checks.items():
        for output, found in zip(outputs, comparison.outputs, strict=False):
            low, high = found.paired.interval or (float("nan"), float("nan"))
            rows.append(
                {
                    "start [s]": time,
                    "output": output.name,
                    "unit": output.unit,
                    "samples": comparison.samples,
                    "failed": comparison.failed,
                    "sigma linear": found.sigma_linear,
                    "sigma paired": found.sigma_paired,
                    "paired ratio": found.paired.ratio,
                    "interval from": low,
                    "interval to": high,
                    "verdict": output_words(found.sigma_linear, found.paired.verdict.value),
                    "sigma plain": found.sigma_sample,
                }
            )
    return pd.DataFrame(rows)


def render(
    campaign: str,
    study: StartTimeStudy,
    checks: Mapping[float, Comparison],
    sources: Sequence[Source],
    outputs: Sequence[Output],
) -> str:
    """The page. ``checks`` are Monte Carlo comparisons by start time, s."""
    scale = np.array([conversion(output.unit, output.shown_in) for output in outputs])
    labels = source_labels([source.name for source in sources], [output.name for output in outputs])
    curves = [
        (humanize(output.name), drawn.effects(study, i, float(scale[i]), labels, output))
        for i, output in enumerate(outputs)
    ]
    return filled(
        "start_times.html",
        campaign=campaign,
        convention=CONVENTIONS[study.axes],
        dispersion=drawn.dispersion(study, checks, scale, outputs),
        best=_best_rows(study, scale, outputs),
        outputs=[(humanize(output.name), output.shown_in) for output in outputs],
        checks=_check_rows(checks, scale),
        flown=max((comparison.samples for comparison in checks.values()), default=0),
        partials=curves,
    )


def minutes(seconds: float) -> str:
    """A time from the event in minutes, as shown."""
    return f"{seconds / 60.0:.1f}".replace("-", "−")


def _best_rows(study: StartTimeStudy, scale: Array, outputs: Sequence[Output]) -> list[dict[str, Any]]:
    """For each output, and for all of them weighted: the best start and the dispersion in each output then."""
    places = [*((humanize(output.name), int(study.best[i])) for i, output in enumerate(outputs))]
    places += [("all, weighted", study.best_weighted), ("(start at the first point)", 0)]
    return [
        {"name": name, "time": minutes(study.times[place]), "sigma": [number(v) for v in study.sigma[place] * scale]}
        for name, place in places
    ]


def _bounds(interval: tuple[float, float] | None) -> str:
    return "" if interval is None or not np.isfinite(interval[1]) else " to ".join(number(end) for end in interval)


def _check_rows(checks: Mapping[float, Comparison], scale: Array) -> list[dict[str, Any]]:
    rows = []
    for time, comparison in checks.items():
        cells = [
            {
                "linear": number(found.sigma_linear * scale[i]),
                "flown": number(found.sigma_paired * scale[i]),
                "ratio": number(found.paired.ratio),
                "interval": _bounds(found.paired.interval),
                "verdict": (words := output_words(found.sigma_linear, found.paired.verdict.value)),
                "tone": "" if words == NOT_DISTURBED else found.paired.verdict.value,
            }
            for i, found in enumerate(comparison.outputs)
        ]
        rows.append({"time": minutes(time), "failed": comparison.failed, "cells": cells})
    return rows
