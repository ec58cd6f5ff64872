"""Monte Carlo at some points of a sweep: the campaign's ordinary run, each in a folder of its own."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Final

import numpy as np

from mcnav.analysis.accuracy_measures import DRMS, SIGMA, Measure
from mcnav.analysis.summary import Summary
from mcnav.analysis.sweep import Confirmation, Point
from mcnav.errors import CampaignError, Problem
from mcnav.execution.progress import Progress
from mcnav.studies.sweep_points import LinearPoints
from mcnav.workflow.run import run_campaign

MOST: Final = 100
"""Points that are confirmed."""

FOLDER: Final = "confirm"


def check_count(count: int, shape: tuple[int, ...]) -> None:
    """Refuse a number of points that leaves out corners, or is larger than the grid."""
    corners, total = 2 ** len(shape), int(np.prod(shape))
    where = "the ends of the range" if len(shape) == 1 else "the corners of the grid"
    most = min(MOST, total)
    if count < corners:
        raise CampaignError([Problem("--confirm", "", f"got {count}; expected at least {corners}, {where}")])
    if count > most:
        raise CampaignError([Problem("--confirm", "", f"got {count}; expected at most {most}")])


def choose_points(shape: tuple[int, ...], crossings: Sequence[tuple[float, ...]], count: int) -> list[tuple[int, ...]]:
    """Choose points of a grid: its corners, those next to crossings, then those that are farthest from all others.

    Parameters
    ----------
    crossings : sequence of tuple of float
        Places along the axes of the grid, counted in its points.

    >>> choose_points((9,), [(2.4,)], 4)
    [(0,), (8,), (2,), (5,)]
    """
    chosen = list(product(*((0, size - 1) for size in shape)))
    for crossing in crossings:
        nearest = tuple(round(place) for place in crossing)
        if len(chosen) < count and nearest not in chosen:
            chosen.append(nearest)
    every = np.array(list(product(*map(range, shape))), dtype=float)
    scale = np.maximum(np.array(shape) - 1.0, 1.0)
    while len(chosen) < count:
        apart = np.linalg.norm((every[:, None] - np.array(chosen)[None]) / scale, axis=2).min(axis=1)
        chosen.append(tuple(every[int(np.argmax(apart))].astype(int).tolist()))
    return chosen


def confirm(
    points: LinearPoints,
    measures: Sequence[Measure],
    final: Sequence[bool],
    chosen: Sequence[tuple[tuple[int, ...], Point]],
    path: Path,
    jobs: int,
    progress: Progress,
) -> list[Confirmation]:
    """Run the campaigns of some points; runs that are stored are resumed. The result is in the order of the grid.

    Parameters
    ----------
    final : sequence of bool
        Whether a measure is of the end, or of a requirement.
    """
    confirmations = []
    for place, point in chosen:
        folder = path / FOLDER / "_".join(f"{number + 1:02d}" for number in place)
        summary = run_campaign(points.campaign_at(point), folder, None, jobs, progress=progress).results
        values = [_value(measure, summary) if known else np.nan for measure, known in zip(measures, final, strict=True)]
        confirmations.append(Confirmation(place, point, folder, summary, np.array(values)))
    return sorted(confirmations, key=lambda confirmation: confirmation.place)


def _value(measure: Measure, summary: Summary) -> float:
    """Return the Monte Carlo estimate of a measure; NaN where a run has none."""
    if measure.requirement is not None:
        estimate = summary.requirements[measure.requirement].estimate
        return float("nan") if estimate is None else estimate
    if measure.kind not in (SIGMA, DRMS):
        return float("nan")
    picked = list(measure.outputs)
    variance = summary.covariance_paired[np.ix_(picked, picked)].trace()
    mean = summary.mean_linear[picked]
    if measure.kind == SIGMA:
        mean_error = summary.mean_error[picked[0]] if summary.mean_error else None
        mean = np.nan_to_num(np.array([mean_error or 0.0]))
    return float(np.sqrt(variance + (mean**2).sum()))
