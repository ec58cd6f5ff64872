"""Start times as a page and as tables."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import pandas as pd

from mcnav.analysis.comparison import Comparison
from mcnav.lincov.start_times import StartTimeStudy
from mcnav.report.figures import start_times as drawn
from mcnav.report.format import interval
from mcnav.report.model import humanize, labels_of, scale_of
from mcnav.report.page import filled
from mcnav.report.sentences import NOT_DISTURBED, output_words
from mcnav.scenarios.protocol import Output, Source

CONVENTIONS: Final = {
    "start": "The reference axes are aligned at each start.",
    "trajectory": "The reference axes are aligned at the first point of the trajectory.",
}


def table(study: StartTimeStudy, sources: Sequence[Source], outputs: Sequence[Output]) -> pd.DataFrame:
    """Tabulate all sigmas and partial derivatives by start time, with SI units in the column names."""
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
    """Tabulate the Monte Carlo checks by start time and output, SI."""
    return pd.DataFrame([row for time, each in checks.items() for row in _check_rows(time, each, outputs)])


def _check_rows(time: float, comparison: Comparison, outputs: Sequence[Output]) -> list[dict[str, Any]]:
    rows = []
    for output, found in zip(outputs, comparison.outputs, strict=False):
        low, high = found.paired.interval or (math.nan, math.nan)
        rows.append({
            "start [s]": time, "output": output.name, "unit": output.unit, "samples": comparison.samples,
            "failed": comparison.failed, "sigma linear": found.sigma_linear, "sigma paired": found.sigma_paired,
            "paired ratio": found.paired.ratio, "interval from": low, "interval to": high,
            "verdict": output_words(found.sigma_linear, found.paired.verdict.value), "sigma plain": found.sigma_sample,
        })  # fmt: skip
    return rows


def render(
    campaign: str,
    study: StartTimeStudy,
    checks: Mapping[float, Comparison],
    sources: Sequence[Source],
    outputs: Sequence[Output],
) -> str:
    """Render the HTML page; ``checks`` are Monte Carlo comparisons by start time, s."""
    scale = scale_of(outputs)
    labels = labels_of(sources, outputs)
    places = {humanize(output.name): int(study.best[i]) for i, output in enumerate(outputs)}
    places |= {"all, weighted": study.best_weighted, "(start at the first point)": 0}
    return filled(
        "start_times.html",
        campaign=campaign,
        convention=CONVENTIONS[study.axes],
        dispersion=drawn.dispersion(study, checks, scale, outputs),
        best=[(name, minutes(study.times[k]), study.sigma[k] * scale) for name, k in places.items()],
        outputs=[(humanize(output.name), output.shown_in) for output in outputs],
        checks=[(minutes(time), each.failed, _cells(time, each, outputs)) for time, each in checks.items()],
        samples=max((comparison.samples for comparison in checks.values()), default=0),
        partials=[
            (humanize(output.name), drawn.effects(study, i, float(scale[i]), labels, output))
            for i, output in enumerate(outputs)
        ],
    )


def minutes(seconds: float) -> str:
    """Format a time from the event in minutes."""
    return f"{seconds / 60.0:.1f}".replace("-", "−")


def _cells(time: float, comparison: Comparison, outputs: Sequence[Output]) -> list[dict[str, Any]]:
    return [
        {
            "linear": row["sigma linear"] * factor,
            "paired": row["sigma paired"] * factor,
            "ratio": row["paired ratio"],
            "interval": interval(row["interval from"], row["interval to"]),
            "verdict": row["verdict"],
            "tone": "" if row["verdict"] == NOT_DISTURBED else row["verdict"],
        }
        for row, factor in zip(_check_rows(time, comparison, outputs), scale_of(outputs), strict=False)
    ]
