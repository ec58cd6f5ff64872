"""Rows of the tables on a filter's consistency, in the units shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mcnav._types import Array
from mcnav.analysis.filter_consistency import (
    FilterConsistency,
    Finding,
    Honesty,
    NeglectedError,
    SigmaConsistency,
    Whiteness,
)
from mcnav.analysis.filter_decision import deciding_names
from mcnav.analysis.filter_remarks import group_words, instant
from mcnav.report.figures.consistency import group_title
from mcnav.report.figures.filter_errors import sigmas
from mcnav.report.filter_verdict import LEAST, TONES, worst_sigmas
from mcnav.report.format import number, percent
from mcnav.report.model import RunAnalysis, humanize
from mcnav.report.sentences import more_samples
from mcnav.units import conversion


def answers(content: RunAnalysis, outputs: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Add to the rows of `mcnav.report.tables.outputs` what the filter says of each, at the end and at the worst epoch.

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


def _at(consistency: FilterConsistency, each: SigmaConsistency, place: int) -> dict[str, Any]:
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


def findings(consistency: FilterConsistency) -> dict[str, list[dict[str, Any]]]:
    """List the verdicts on groups of states, on outputs and on other states of the filter, a row each."""
    deciding = deciding_names(group.name for group in consistency.groups)
    outputs, states = (
        [_finding_row(consistency, humanize(each.name), each.finding, each.ratio.value, decides) for each in kind]
        for kind, decides in ((consistency.outputs, True), (consistency.states, False))
    )
    groups = [
        _finding_row(consistency, group_title(each), each.finding, each.ratio.value, each.name in deciding)
        | {"size": each.size}
        for each in consistency.groups
    ]
    return {"groups": groups, "outputs": outputs, "states": states}


def _finding_row(
    consistency: FilterConsistency, name: str, finding: Finding, ratio: Array, decides: bool
) -> dict[str, Any]:
    """Return one row; only what decides has a colour, as the verdict has."""
    known = np.flatnonzero(np.isfinite(ratio))
    needed = finding.samples_needed
    return {
        "name": name,
        "last": float(ratio[known[-1]]) if len(known) else None,
        "factor": finding.factor,
        "worst": "" if finding.worst is None else instant(float(consistency.times[finding.worst]), consistency.label),
        "certain": _span(consistency, finding),
        "verdict": finding.verdict.value,
        "tone": TONES[finding.verdict.value] if decides else "",
        "decides": decides,
        "remark": more_samples(needed, consistency.samples) if needed else finding.remark,
    }


def _span(consistency: FilterConsistency, finding: Finding) -> str:
    if finding.begin is None or finding.end is None:
        return ""
    begin, end = (float(consistency.times[place]) for place in (finding.begin, finding.end))
    return (
        instant(begin, consistency.label)
        if begin == end
        else f"{instant(begin, '')} to {instant(end, consistency.label)}"
    )


def sensors(consistency: FilterConsistency) -> list[dict[str, Any]]:
    """List updates, NIS and whiteness of each sensor."""
    rows = []
    for each in consistency.sensors:
        accepted, rejected = each.updates
        white, whole = each.whiteness, each.nis_whole
        rows.append(
            {
                "name": humanize(each.name),
                "size": each.size,
                "accepted": number(accepted) if accepted else "0",
                "rejected": number(rejected, 3) if rejected else "0",
                "rejected_share": f"{100.0 * rejected / (accepted + rejected):.2g} %" if rejected else "",
                "nis": number(whole),
                "nis_bounds": None if whole is None else [number(end) for end in each.bounds_whole],
                "nis_tone": "" if whole is None else "differs" if each.beyond else "agrees",
                "nis_words": "" if whole is None else "beyond bounds" if each.beyond else "within bounds",
                "correlation": None if white.correlation is None else f"{white.correlation:+.4f}".replace("-", "−"),
                "correlation_bound": number(white.bound, 2),
                "white_tone": _white_tone(white),
                "white_words": "" if white.correlation is None else "correlated" if white.beyond else "white",
            }
        )
    return rows


def _white_tone(white: Whiteness) -> str:
    if white.correlation is None:
        return ""
    return "agrees" if not white.beyond else "partly" if white.expected else "differs"


def neglected(content: RunAnalysis) -> list[dict[str, str]]:
    """List the neglected errors: what each adds to an output, what the filter believes of it, share.

    Those with small shares are one row.
    """
    result = content.filter
    output = next((each for each in result.outputs if each.name == result.neglected_output), None) if result else None
    if result is None or output is None:
        return []
    labels = dict(zip((each.name for each in content.manifest.model.sources), content.source_names, strict=True))
    large = [(labels.get(each.name, humanize(each.name)), each) for each in result.neglected if each.share >= LEAST]
    rest = [each for each in result.neglected if each.share < LEAST]
    if len(rest) == 1:
        large.append((labels.get(rest[0].name, humanize(rest[0].name)), rest[0]))
    elif rest:
        variances = (sum(getattr(each, key) for each in rest) for key in ("true", "believed", "share"))
        large.append((f"{len(rest)} others", NeglectedError("", *variances)))
    scale, unit = conversion(output.unit, output.shown_in), output.shown_in
    return [
        {
            "name": name,
            "true": f"{number(float(np.sqrt(max(each.true, 0.0))) * scale)} {unit}",
            "believed": f"{number(float(np.sqrt(max(each.believed, 0.0))) * scale)} {unit}",
            "share": percent(each.share).removeprefix("+"),
        }
        for name, each in large
    ]
