"""What a filter says of each output, and where it is farthest off, in the units shown."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mcnav.analysis.filter_consistency import FilterConsistency, Honesty, SigmaConsistency
from mcnav.analysis.filter_remarks import group_words, instant
from mcnav.report.figures.filter_errors import sigmas
from mcnav.report.filter_verdict import TONES, worst_sigmas
from mcnav.report.model import RunAnalysis, humanize
from mcnav.report.result_table import Row


def answers(content: RunAnalysis, outputs: Sequence[Row]) -> list[Row]:
    """Add to the rows of `mcnav.report.tables.answers` what the filter says of each, at the end and at the worst epoch.

    The worst epoch is that of the largest true sigma after the start.
    """
    result = content.filter
    known = {} if result is None else {each.name: each for each in result.outputs}
    rows = []
    for row, output in zip(outputs, content.manifest.model.outputs, strict=False):
        each = known.get(output.name)
        if result is None or each is None:
            return []
        whose, place = sigmas(each), _worst(each)
        filter_sigma = float(whose["filter"][-1])
        rows.append(
            {
                **row,
                "sigma_filter": filter_sigma,
                "true_over_filter": (row["sigma_paired"] or np.nan) / filter_sigma if filter_sigma > 0.0 else None,
                "worst": None if place is None or place == len(result.times) - 1 else _at(result, each, place),
                "worst_time": None if place is None else float(result.times[place]),
                "honesty": each.finding.verdict.value,
                "honesty_tone": TONES[each.finding.verdict.value],
            }
        )
    return rows


def _worst(each: SigmaConsistency) -> int | None:
    """Return the epoch of the largest true sigma after the start, by linear analysis where it is known."""
    values = each.true if each.true_linear is None else each.true_linear
    later = np.where(np.isfinite(values[1:]), values[1:], -np.inf)
    return int(np.argmax(later)) + 1 if np.isfinite(later).any() else None


def _at(consistency: FilterConsistency, each: SigmaConsistency, place: int) -> Row:
    whose = {name: float(values[place]) for name, values in sigmas(each).items()}
    return {
        "when": instant(float(consistency.times[place]), consistency.label),
        "linear": whose.get("linear"),
        "flown": whose["Monte Carlo"],
        "filter": whose["filter"],
        "ratio": float(each.ratio.value[place]),
    }


def at_worst(consistency: FilterConsistency) -> str:
    """Compare the true sigma with the filter's where they differ most; empty where nothing is known."""
    output = next((each for each in consistency.outputs if each.name == consistency.output), None)
    departure = consistency.departing_output
    if consistency.worst is None or consistency.factor is None:
        return ""
    if consistency.verdict in (Honesty.CONSISTENT, Honesty.UNDECIDED):
        where = f"{group_words(consistency.group)} as a group" if consistency.group else humanize(consistency.output)
        farthest = f"{consistency.factor:.3f}, at {instant(consistency.worst, consistency.label)}"
        if consistency.verdict == Honesty.CONSISTENT:
            return f"The ratio farthest from one is that of {where}: {farthest}."
        return f"The most samples are needed for {where}: its ratio farthest from one is {farthest}."
    if output is None:
        return ""
    worst = consistency.worst if departure is None else departure.worst
    place, when = int(np.argmin(np.abs(consistency.times - worst))), instant(worst, consistency.label)
    whose = {name: float(values[place]) for name, values in sigmas(output).items()}
    return worst_sigmas(output.name, when, whose["Monte Carlo"], whose["filter"], output.shown_in)
