"""The verdict in plain sentences, from a summary."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from mcnav.report.content import spoken


def percent(share: float) -> str:
    """A signed difference in per cent, with two significant digits below one per cent and two decimals above.

    >>> percent(0.0312), percent(-0.0000213)
    ('+3.12 %', '−0.0021 %')
    """
    value = 100.0 * share
    decimals = 2 if value == 0.0 or abs(value) >= 0.1 else 1 - math.floor(math.log10(abs(value)))
    return f"{value:+.{decimals}f} %".replace("-", "−")


def tone(summary: Mapping[str, Any]) -> str:
    """``agrees``, ``partly``, ``differs`` or ``undecided``: the verdict on the outputs and on the matrix in a word."""
    if summary["verdict"] == "agrees" and summary["verdict_matrix"] not in ("agrees", None):
        return "partly"
    return str(summary["verdict"])


def headline(summary: Mapping[str, Any]) -> str:
    """The answer in a few words."""
    if tone(summary) == "partly":
        rest = {"differs": "no for their joint distribution", "undecided": "their joint distribution is not decided"}
        return f"Yes for the dispersion of each output; {rest[summary['verdict_matrix']]}."
    return {
        "agrees": "Yes: the linear covariance analysis may be trusted here.",
        "differs": "No: the linear covariance analysis does not hold here.",
        "undecided": "Not decided: this campaign cannot tell whether the linear analysis holds.",
    }[summary["verdict"]]


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def explanation(summary: Mapping[str, Any]) -> str:
    """Why, output by output, with numbers."""
    flown = summary["samples"] - summary["failed"]
    tolerance = f"±{100 * summary['tolerance']:g} %"
    confidence = f"{100 * summary['confidence']:g} % confidence"
    names = [spoken(output["name"]) for output in summary["outputs"]]
    if not summary["verdicts"]:
        return f"Of {summary['samples']:,} samples {flown:,} could be flown; that is too few to compare anything."
    ratios = {
        name: ratio for name, ratio in zip(names, summary["sigma_ratio_paired"], strict=True) if ratio is not None
    }
    if not ratios:
        return "No error source has a dispersion, and so there is none to compare."
    farthest = max(ratios, key=lambda name: abs(ratios[name] - 1.0))
    largest = f"the largest difference is {percent(ratios[farthest] - 1.0)}, in {farthest}"
    judged = dict(zip(names, summary["verdicts"], strict=True))
    if summary["verdict"] == "agrees":
        return (
            f"In every output the dispersion of {flown:,} nonlinear flights lies within {tolerance} of that of P·S·Pᵀ, "
            f"with {confidence}; {largest}."
        )
    if summary["verdict"] == "differs":
        wrong = [name for name in names if judged[name] == "differs"]
        return (
            f"The dispersion of {_listed(wrong)} in {flown:,} nonlinear flights differs by more than {tolerance} from "
            f"that of P·S·Pᵀ, with {confidence}; {largest}."
        )
    needed = [count for count in summary["samples_needed"] if count]
    more = f" About {max(needed):,} samples would decide." if needed else ""
    open_ones = [name for name in names if judged[name] == "undecided"]
    return (
        f"With {flown:,} flights the interval for {_listed(open_ones)} reaches across the tolerance of {tolerance} at "
        f"{confidence}.{more}"
    )


def joint_explanation(summary: Mapping[str, Any]) -> str:
    """What the whole matrix says, with numbers; empty where there is none to judge."""
    verdict, dimension = summary["verdict_matrix"], summary["nees_dimension"]
    if verdict is None:
        return ""
    nees = f"the mean NEES is {summary['nees_mean_paired']:.2f} where linear analysis expects {dimension}"
    if verdict == "agrees":
        return f"The outputs' joint distribution agrees as well: {nees}."
    ratio = summary["direction_ratio"]
    if ratio is None:
        return f"The outputs' joint distribution does not follow P·S·Pᵀ: {nees}."
    size = "larger" if ratio > 1.0 else "smaller"
    direction = f"in one combination of the outputs the flown sigma is {100 * abs(ratio - 1.0):.1f} % {size}"
    if verdict == "differs":
        return (
            f"The outputs' joint distribution differs: {nees}, and {direction}, so that P·S·Pᵀ is no error ellipsoid "
            "to rely on."
        )
    return f"The outputs' joint distribution is not decided: {nees}, and {direction}."


def certain_but_small(summary: Mapping[str, Any]) -> str:
    """A remark on differences that are certain and yet within the tolerance; empty when there are none."""
    found = []
    rows = zip(
        summary["outputs"],
        summary["sigma_ratio_paired"],
        summary["sigma_ratio_paired_interval"],
        summary["verdicts"],
        strict=False,
    )
    for output, ratio, interval, verdict in rows:
        if verdict == "agrees" and interval is not None and not interval[0] <= 1.0 <= interval[1]:
            found.append(f"{spoken(output['name'])} ({percent(ratio - 1.0)})")
    if not found:
        return ""
    return f"Statistically certain, yet within the tolerance: {_listed(found)}."


def failures(summary: Mapping[str, Any]) -> str:
    """What was left out; empty when nothing was."""
    if not summary["failed"]:
        return ""
    return (
        f"{summary['failed']:,} of {summary['samples']:,} samples failed and are left out of every figure. If they are "
        "the largest errors, the flown dispersion is larger than it looks."
    )
