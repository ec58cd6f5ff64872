"""Start times as a page and as tables."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import pandas as pd

from mcnav.analysis.comparison import Comparison
from mcnav.contract.quantities import Output, Source
from mcnav.lincov.start_times import StartTimeStudy
from mcnav.report.figures import start_times as drawn
from mcnav.report.format import interval
from mcnav.report.html import filled
from mcnav.report.model import humanize, labels_of, scale_of
from mcnav.report.sentences import NOT_DISTURBED, output_words
from mcnav.report.start_time_words import answer, minutes

CONVENTIONS: Final = {
    "start": "The reference axes are aligned at each start.",
    "trajectory": "The reference axes are aligned {}.",
}


def table(study: StartTimeStudy, sources: Sequence[Source], outputs: Sequence[Output]) -> pd.DataFrame:
    """Tabulate all sigmas and partial derivatives by start time, with SI units in the column names."""
    columns = {"start [s]": study.times}
    for i, output in enumerate(outputs):
        columns[f"sigma {output.name} [{output.unit}]"] = study.sigma[:, i]
    columns["weighted sigma [1]"] = study.weighted
    if study.noise is not None:
        for i, output in enumerate(outputs):
            columns[f"sigma {output.name} from noise [{output.unit}]"] = study.noise[:, i]
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
    for output, result in zip(outputs, comparison.outputs, strict=False):
        low, high = result.paired.interval or (math.nan, math.nan)
        rows.append({
            "start [s]": time, "output": output.name, "unit": output.unit, "samples": comparison.samples,
            "failed": comparison.failed, "sigma linear": result.sigma_linear, "sigma paired": result.sigma_paired,
            "paired ratio": result.paired.ratio, "interval from": low, "interval to": high,
            "verdict": output_words(result.sigma_linear, result.paired.verdict.value),
            "sigma plain": result.sigma_sample,
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
    effects = grouped_effects(study, sources, outputs)
    places = {humanize(output.name): int(study.best[i]) for i, output in enumerate(outputs)}
    places |= {"all, weighted": study.best_weighted, "(start at the first point)": 0}
    return filled(
        "start_times.html",
        campaign=campaign,
        answer=answer(study, checks, outputs),
        convention=CONVENTIONS[study.axes].format(study.clock.aligned),
        clock=study.clock.label,
        event=study.clock.event,
        dispersion=drawn.dispersion(study, checks, scale, outputs),
        best=[(name, minutes(study.times[k]), study.sigma[k] * scale) for name, k in places.items()],
        outputs=[(humanize(output.name), output.shown_in) for output in outputs],
        checks=[(minutes(time), each.failed, _cells(time, each, outputs)) for time, each in checks.items()],
        samples=max((comparison.samples for comparison in checks.values()), default=0),
        partials=[
            (humanize(output.name), drawn.effects(study, i, float(scale[i]), effects, output))
            for i, output in enumerate(outputs)
        ],
    )


def grouped_effects(study: StartTimeStudy, sources: Sequence[Source], outputs: Sequence[Output]) -> list[drawn.Effects]:
    """Return the effects of each source, or of each group of sources, as a root sum square, and of the noise."""
    if not any(source.group for source in sources):
        initial = {output.name for output in outputs}
        return [
            drawn.Effects(label, study.effects[:, :, j], source.name in initial)
            for j, (source, label) in enumerate(zip(sources, labels_of(sources, outputs), strict=True))
        ]
    members: dict[str, list[int]] = {}
    for j, source in enumerate(sources):
        members.setdefault(source.group or source.name, []).append(j)
    initial = {source.group or source.name for source in sources if source.name in {each.name for each in outputs}}
    names = list(members)
    labels = [f"initial {humanize(name)}" if name in initial else humanize(name) for name in names]
    sizes = [np.sqrt((study.effects[:, :, members[name]] ** 2).sum(axis=2)) for name in names]
    effects = [
        drawn.Effects(label, size, name in initial, combined=True)
        for name, label, size in zip(names, labels, sizes, strict=True)
    ]
    effects = [each for each in effects if each.sizes.any()] or effects
    return effects if study.noise is None else [*effects, drawn.Effects("noise", study.noise, False, combined=True)]


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
