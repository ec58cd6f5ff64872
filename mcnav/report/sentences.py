"""The verdict in plain sentences, from a summary."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

from mcnav.report.model import humanize, labels_of
from mcnav.report.summary import tally
from mcnav.scenarios.failure import message_of
from mcnav.statistics.power import sensible_step

LARGE_RATIO: Final = 3.0
"""A sigma ratio above this is told as a multiple, not in per cent."""

NEGLIGIBLE: Final = 1e-3
"""Share of a sigma that failed samples may take off it without being suspected."""

JOINT: Final = "joint distribution"
"""What the NEES speaks of."""


NOT_DISTURBED: Final = "not disturbed by any source"
"""Found of an output without dispersion, linear or flown: there is nothing to agree on."""


def percent(share: float) -> str:
    """A signed difference in per cent: two significant digits below 0.1 %, two decimals to 10 %, one above.

    >>> percent(0.0312), percent(-0.0000213), percent(3.5341)
    ('+3.12 %', '−0.0021 %', '+353.4 %')
    """
    value = 100.0 * share
    if not math.isfinite(value):
        return "–"
    size = abs(value)
    decimals = 1 if size >= 10.0 else 2 if size >= 0.1 or size == 0.0 else 1 - math.floor(math.log10(size))
    return f"{value:+.{decimals}f} %".replace("-", "−")


def tone(summary: Mapping[str, Any]) -> str:
    """``agrees``, ``partly``, ``differs`` or ``undecided``: the verdict on the outputs and on the matrix in a word."""
    if summary.get("unsettled"):
        return "undecided"
    if summary["verdict"] == "agrees" and summary["verdict_matrix"] not in ("agrees", None):
        return "partly"
    return str(summary["verdict"])


def standing(summary: Mapping[str, Any]) -> str:
    """The tone with the requirements: what agrees stands only ``partly`` while a requirement is not met."""
    counts, found = met(summary), tone(summary)
    return "partly" if found == "agrees" and counts and counts["met"] < counts["of"] else found


def met(summary: Mapping[str, Any]) -> dict[str, int] | None:
    """How many requirements are met, not met and undecided; none without requirements."""
    return tally(entry["finding"] for entry in summary.get("requirements") or ())


def verdict_words(summary: Mapping[str, Any]) -> list[str]:
    """The verdict on each output; empty where nothing was compared.

    ``verdicts`` of a summary counts an output that nothing disturbs as one that agrees, so that the verdict on all of
    them rests on the others.
    """
    return [
        output_words(sigma, verdict)
        for sigma, verdict in zip(summary["sigma_linear"], summary["verdicts"], strict=False)
    ]


def output_words(sigma_linear: float, verdict: str) -> str:
    """The verdict on an output as shown.

    >>> output_words(1.0, "agrees"), output_words(0.0, "agrees"), output_words(0.0, "differs")
    ('agrees', 'not disturbed by any source', 'differs')
    """
    return NOT_DISTURBED if sigma_linear == 0.0 and verdict == "agrees" else str(verdict)


def more_samples(needed: int, samples: int) -> str:
    """How many samples would decide, as shown: a sensible step more than there are.

    >>> more_samples(1_001, 1_000), more_samples(15_333, 1_000)
    ('about 1,300 samples', 'about 16,000 samples')
    """
    return f"about {sensible_step(needed, samples):,} samples"


def headline(summary: Mapping[str, Any]) -> str:
    """The answer in a few words: on linear analysis, and on the requirements where there are some."""
    return " ".join(sentence for sentence in (_on_linear(summary), _on_requirements(summary)) if sentence)


def _on_requirements(summary: Mapping[str, Any]) -> str:
    counts = met(summary)
    if counts is None:
        return ""
    rest = [f"{counts[key]} {word}" for key, word in (("not_met", "failed"), ("undecided", "undecided")) if counts[key]]
    told = ", ".join([f"{counts['met']} of {counts['of']} met", *rest])
    return f"Requirements: {told}."


def _on_linear(summary: Mapping[str, Any]) -> str:
    if summary.get("unsettled"):
        return unsettled(summary)
    if tone(summary) == "partly":
        rest = {"differs": "no for their joint distribution", "undecided": "their joint distribution is not decided"}
        return f"Yes for the dispersion of each output; {rest[summary['verdict_matrix']]}."
    if not any(summary["sigma_linear"]) and summary["verdict"] != "differs":
        return f"Nothing to compare: {_nothing(summary)}."
    return {
        "agrees": "Yes: the linear covariance analysis may be trusted here.",
        "differs": "No: the linear covariance analysis does not hold here.",
        "undecided": "Not decided: this campaign cannot tell whether the linear analysis holds.",
    }[summary["verdict"]]


def unsettled(summary: Mapping[str, Any]) -> str:
    """Say that there is no linear model to compare with, and why; empty where there is one.

    >>> found = {"source": "seed", "output": "range", "disagreement": 0.853, "own": False}
    >>> unsettled({"unsettled": found})
    'Partial derivatives are not settled (range by seed: 85 %): the comparison below has no sound linear model.'
    """
    found = summary.get("unsettled")
    if not found:
        return ""
    share = 100.0 * (found["disagreement"] or math.inf)
    size = f"{share:,.0f} %" if share >= 10.0 else f"{share:.2g} %"
    where = f"{humanize(found['output'])} by {humanize(found['source'])}: {size}"
    if found["own"]:
        return (
            f"The scenario's own partial derivatives are not those of its flights ({where}): the comparison below has "
            "no sound linear model."
        )
    return f"Partial derivatives are not settled ({where}): the comparison below has no sound linear model."


def _nothing(summary: Mapping[str, Any]) -> str:
    """Why no output has a dispersion."""
    dispersed = any(row[i] > 0.0 for i, row in enumerate(summary["start_covariance"]))
    return "no output depends on an error" if dispersed else "no error has a dispersion"


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def explanation(summary: Mapping[str, Any]) -> str:
    """Why, output by output, with numbers."""
    flown = summary["samples"] - summary["failed"]
    tolerance = f"±{100 * summary['tolerance']:g} %"
    confidence = f"{100 * summary['confidence']:g} % confidence"
    names = [humanize(output["name"]) for output in summary["outputs"]]
    if not summary["verdicts"]:
        return f"Of {summary['samples']:,} samples {flown:,} could be flown; that is too few to compare anything."
    ratios = {
        name: ratio for name, ratio in zip(names, summary["sigma_ratio_paired"], strict=True) if ratio is not None
    }
    judged = dict(zip(names, summary["verdicts"], strict=True))
    wrong = [name for name in names if judged[name] == "differs"]
    unforeseen = [name for name in wrong if name not in ratios]
    unsure = [name for name in names if judged[name] == "undecided"]
    still = [name for name, words in zip(names, verdict_words(summary), strict=True) if words == NOT_DISTURBED]
    if unforeseen:
        others = [name for name in wrong if name in ratios]
        more = f" That of {_listed(others)} differs by more than {tolerance}." if others else ""
        rest = f" {_not_decided(summary, unsure)}" if unsure else ""
        return (
            f"By linear analysis {_listed(unforeseen)} would have no dispersion at all; in {flown:,} nonlinear flights "
            f"there is some.{more}{rest}"
        )
    if not ratios:
        return f"Every flight is the same: {_nothing(summary)}."
    farthest = max(wrong or ratios, key=lambda name: abs(ratios.get(name, 1.0) - 1.0))
    largest = f"the largest difference is {percent(ratios.get(farthest, 1.0) - 1.0)}, in {farthest}"
    rest = f" {_not_decided(summary, unsure)}" if unsure else ""
    if wrong:
        return (
            f"The dispersion of {_listed(wrong)} in {flown:,} nonlinear flights differs by more than {tolerance} from "
            f"that of P·S·Pᵀ, with {confidence}; {largest}.{rest}"
        )
    if unsure:
        return f"With {flown:,} flights, {confidence} and a tolerance of {tolerance}: {rest.strip()}"
    alone = f" {_listed(still)} {'is' if len(still) == 1 else 'are'} {NOT_DISTURBED}." if still else ""
    return (
        f"In every {'other ' if still else ''}output the dispersion of {flown:,} nonlinear flights lies within "
        f"{tolerance} of that of P·S·Pᵀ, with {confidence}; {largest}.{alone}"
    )


def _not_decided(summary: Mapping[str, Any], unsure: list[str]) -> str:
    """Which outputs are open, and what would decide them."""
    needed = [count for count in summary["samples_needed"] if count]
    if needed:
        return f"Not decided for {_listed(unsure)}: {more_samples(max(needed), summary['samples'])} would."
    if summary["heavy_tailed"]:
        return f"Not decided for {_listed(unsure)}: tails too heavy for an interval."
    return f"Not decided for {_listed(unsure)}: too few independent samples for an interval."


def joint_explanation(summary: Mapping[str, Any]) -> str:
    """What the whole matrix says, with numbers; empty where there is none to judge."""
    verdict, dimension = summary["verdict_matrix"], summary["nees_dimension"]
    if verdict is None:
        return ""
    mean = summary["nees_mean_paired"]
    if mean is None or mean <= 0.0:
        mean = summary["nees_mean"]
    nees = f"the mean NEES is {mean:.4g} where linear analysis expects {dimension}"
    if verdict == "agrees":
        return f"The outputs' joint distribution agrees as well: {nees}."
    ratio = summary["direction_ratio"]
    if ratio is None or not math.isfinite(ratio):  # no variance is left in the paired estimate
        return f"The outputs' joint distribution does not follow P·S·Pᵀ: {nees}."
    size = "larger" if ratio > 1.0 else "smaller"
    direction = f"in one combination of the outputs the flown sigma is {100 * abs(ratio - 1.0):.3g} % {size}"
    if abs(ratio) > LARGE_RATIO:
        direction = f"in one combination of the outputs the flown sigma is {ratio:,.3g} times the linear one"
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
            found.append(f"{humanize(output['name'])} ({percent(ratio - 1.0)})")
    if not found:
        return ""
    return f"Statistically certain, yet within the tolerance: {_listed(found)}."


def failures(summary: Mapping[str, Any]) -> str:
    """What was left out and what that may hide; empty when nothing was."""
    if not summary["failed"]:
        return ""
    told = f"{summary['failed']:,} of {summary['samples']:,} samples failed and are left out of every figure"
    commonest = message_of(next(iter(summary["failures"]), ""))
    if commonest:
        told += f" ({'' if len(summary['failures']) == 1 else 'most often: '}{commonest})"
    smallest = [ratio for ratio in (summary.get("excluded") or {}).get("sigma_ratio", ()) if ratio is not None]
    smallest = [ratio for ratio in smallest if math.isfinite(ratio)]
    if not smallest:
        return f"{told}. If they are the largest errors, the flown dispersion is larger than it looks."
    hidden = min(smallest) - 1.0
    if hidden > -NEGLIGIBLE:
        return f"{told}. By the linear model they are no larger errors than the others, so that little is hidden."
    return (
        f"{told}. By the linear model they are larger errors than the others: leaving them out takes up to "
        f"{percent(-hidden).removeprefix('+')} off a sigma, and flown to the end they might add more."
    )


def stopping(summary: Mapping[str, Any]) -> str:
    """Why there are as many samples as there are; empty for a fixed number."""
    rule = summary.get("stopping")
    if not rule:
        return ""
    kind = "paired" if rule["quantity"].endswith("paired") else "plain"
    wanted = (
        f"every {kind} sigma ratio to ±{100.0 * rule['precision']:g} % with {100.0 * rule['confidence']:g} % confidence"
    )
    held = f"the intervals hold although up to {rule['looks']} looks were taken"
    if rule["reached"]:
        return f"Flown until {wanted}: {summary['samples']:,} samples of at most {rule['at_most']:,}; {held}."
    return f"Flown to the most that were allowed, {summary['samples']:,} samples, without {wanted}; {held}."


def caveat(summary: Mapping[str, Any]) -> str:
    """A remark on sources whose tails are too heavy for the intervals; empty when there are none."""
    labels = dict(zip((entry["name"] for entry in summary["sources"]), labels_of(summary), strict=True))
    heavy = [labels[name] for name in summary["heavy_tailed"]]
    if heavy:
        return (
            f"No interval is given and nothing decided, because of heavy tails ({_listed(heavy)}): with errors like "
            "these and this design, intervals that should cover 95 % were measured to cover far less (mcnav calibrate)."
        )
    long = [labels[name] for name in summary.get("long_tailed", [])]
    if long:
        return (
            f"The intervals are only nearly right, because of long tails ({_listed(long)}): with errors like these, "
            "those that should cover 95 % were measured to cover 91 to 95 %, those of skewness down to 83 %."
        )
    return ""


def multiple_words(value: float, largest: float) -> str:
    """A multiple as shown: none where there is no effect, beyond the largest where it was not reached.

    >>> multiple_words(8.2345, 100.0), multiple_words(float("inf"), 100.0)
    ('8.23', '> 100')
    """
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return f"> {largest:g}"
    return f"{value:.3g}"
