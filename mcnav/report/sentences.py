"""The verdict in sentences, from a run's summary."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

from mcnav.analysis.comparison import LARGEST_FAILED_SHARE
from mcnav.analysis.filter_remarks import instant
from mcnav.analysis.verdict import ROUNDING
from mcnav.contract.failure import message_of
from mcnav.report import joint_words
from mcnav.report.format import percent
from mcnav.report.model import humanize, labels_in
from mcnav.report.summary import tally
from mcnav.statistics.power import sensible_step

NEGLIGIBLE: Final = 1e-3
"""Share of a sigma that failed samples may hide without a warning."""

JOINT: Final = "joint distribution"
"""Name of the NEES test among the outputs."""

BEYOND: Final = "beyond linear range"
"""What stands in place of a linear number that has no meaning."""

NOT_DISTURBED: Final = "not disturbed by any source"
"""Finding for an output without dispersion, linear or Monte Carlo."""


def tone(summary: Mapping[str, Any]) -> str:
    """Combine the verdicts on outputs and covariance matrix: ``agrees``, ``partly``, ``differs`` or ``undecided``.

    Beyond its range linear analysis differs, whatever the samples show.
    """
    if summary.get("unsettled"):
        return "undecided"
    if summary.get("beyond_range"):
        return "differs"
    if summary["verdict"] == "agrees" and summary["verdict_matrix"] not in ("agrees", None):
        return "partly"
    return str(summary["verdict"])


def standing(summary: Mapping[str, Any]) -> str:
    """Combine the tone with the requirements: an agreeing run is ``partly`` unless all requirements are met."""
    counts, result = met(summary), tone(summary)
    return "partly" if result == "agrees" and counts and counts["met"] < counts["of"] else result


def met(summary: Mapping[str, Any]) -> dict[str, int] | None:
    """Count the requirements of a summary by finding; none without requirements."""
    return tally(entry["finding"] for entry in summary.get("requirements") or ())


def verdict_words(summary: Mapping[str, Any]) -> list[str]:
    """List the verdict on each output as shown; empty when nothing was compared.

    In ``verdicts`` of a summary an output without dispersion counts as agreeing, so that it does not affect the overall
    verdict.
    """
    pairs = zip(summary["sigma_linear"], summary["verdicts"], strict=False)
    return [output_words(sigma, verdict) for sigma, verdict in pairs]


def output_words(sigma_linear: float, verdict: str) -> str:
    """Return the verdict on an output as shown.

    >>> output_words(1.0, "agrees"), output_words(0.0, "agrees"), output_words(0.0, "differs")
    ('agrees', 'not disturbed by any source', 'differs')
    """
    return NOT_DISTURBED if sigma_linear == 0.0 and verdict == "agrees" else str(verdict)


def more_samples(needed: int, samples: int) -> str:
    """Round the number of samples needed for a decision to a sensible step above the present number.

    >>> more_samples(1_001, 1_000), more_samples(15_333, 1_000)
    ('about 1,300 samples', 'about 16,000 samples')
    """
    return f"about {sensible_step(needed, samples):,} samples"


def headline(summary: Mapping[str, Any]) -> str:
    """Summarize the verdict on linear analysis and, where there are some, on the requirements."""
    return " ".join(sentence for sentence in (_on_linear(summary), _on_requirements(summary)) if sentence)


def _on_requirements(summary: Mapping[str, Any]) -> str:
    counts = met(summary)
    if counts is None:
        return ""
    others = (("not_met", "not met"), ("undecided", "undecided"))
    rest = [f"{counts[key]} {words}" for key, words in others if counts[key]]
    requirements = ", ".join([f"{counts['met']} of {counts['of']} met", *rest])
    return f"Requirements: {requirements}."


def _on_linear(summary: Mapping[str, Any]) -> str:
    if summary.get("unsettled"):
        return unsettled(summary)
    if summary.get("beyond_range"):
        return beyond_range(summary)
    if tone(summary) == "partly":
        answer = "No" if summary["verdict_matrix"] == "differs" else "Undecided"
        return f"{answer} for {joint_words.subject(summary)}; yes for the dispersion of each output."
    if not any(summary["sigma_linear"]) and summary["verdict"] != "differs":
        return f"Nothing to compare: {_no_dispersion(summary)}."
    return {
        "agrees": "Yes: the linear covariance analysis can be trusted here.",
        "differs": "No: the linear covariance analysis does not hold here.",
        "undecided": "Undecided: the samples do not show whether the linear covariance analysis holds.",
    }[summary["verdict"]]


def unsettled(summary: Mapping[str, Any]) -> str:
    """Explain why there is no valid linear model to compare with; empty where there is one.

    >>> found = {"source": "seed", "output": "range", "disagreement": 0.853, "own": False}
    >>> unsettled({"unsettled": found})
    'Partial derivatives do not converge (range by seed: 85 %): the comparison below has no valid linear model.'
    """
    result = summary.get("unsettled")
    if not result:
        return ""
    share = 100.0 * (result["disagreement"] or math.inf)
    size = f"{share:,.0f} %" if share >= 10.0 else f"{share:.2g} %"
    where = f"{humanize(result['output'])} by {humanize(result['source'])}: {size}"
    if noise := result.get("noise"):
        named = f"{humanize(result['output'])}: {size} of its sigma"
        causes = {
            "fly_linear": "The scenario's own linear simulations disagree with its simulations",
            "noise_covariance": "The scenario's own noise covariance disagrees with its linear simulations",
        }
        cause = f"{causes.get(noise, 'The response to noise is not linear')} ({named})"
    elif result["own"]:
        cause = f"The scenario's own partial derivatives disagree with finite differences ({where})"
    else:
        cause = f"Partial derivatives do not converge ({where})"
    return f"{cause}: the comparison below has no valid linear model."


def beyond_range(summary: Mapping[str, Any]) -> str:
    """Say from when on linear errors have no meaning; empty where all are within their range.

    >>> found = {"outputs": ["position_down"], "begin": 120.0, "time": "time [min]"}
    >>> beyond_range({"beyond_range": found})
    'No: errors are beyond the range of linear analysis from 120 min on (position down).'
    """
    result = summary.get("beyond_range")
    if not result:
        return ""
    begin, label = result["begin"], result["time"]
    since = "at the end" if begin is None else f"from {instant(begin, label or '')} on"
    names = _join([humanize(name) for name in result["outputs"]])
    return f"No: errors are beyond the range of linear analysis {since} ({names})."


def _no_dispersion(summary: Mapping[str, Any]) -> str:
    """Explain why no output has a dispersion."""
    dispersed = any(row[i] > 0.0 for i, row in enumerate(summary["start_covariance"]))
    return "no output depends on an error" if dispersed else "no error has a dispersion"


def _join(names: Sequence[str]) -> str:
    return joint_words.joined(names)


def explanation(summary: Mapping[str, Any]) -> str:
    """Explain the verdict output by output, with numbers."""
    samples = summary["samples"] - summary["failed"]
    limit = f"{100.0 * summary['tolerance']:g} %"
    confidence = f"{100.0 * summary['confidence']:g} % confidence"
    names = [humanize(output["name"]) for output in summary["outputs"]]
    if summary.get("beyond_range"):
        return "Linear sigmas there are not shown, and samples are not compared with them."
    if not summary["verdicts"]:
        return f"{samples:,} of {summary['samples']:,} samples succeeded, which is too few for a comparison."
    ratios = {
        name: ratio for name, ratio in zip(names, summary["sigma_ratio_paired"], strict=True) if ratio is not None
    }
    verdicts = dict(zip(names, summary["verdicts"], strict=True))
    wrong = [name for name in names if verdicts[name] == "differs"]
    only_nonlinear = [name for name in wrong if name not in ratios]
    still = [name for name, words in zip(names, verdict_words(summary), strict=True) if words == NOT_DISTURBED]
    undecided = _undecided(summary, [name for name in names if verdicts[name] == "undecided"])
    rest = f" {undecided}" if undecided else ""
    if only_nonlinear:
        others = [name for name in wrong if name in ratios]
        more = f" The sigma of {_join(others)} differs by more than {limit}." if others else ""
        keys = [output["name"] for output in summary["outputs"] if humanize(output["name"]) in only_nonlinear]
        return f"{joint_words.explain_unpredicted(summary, keys)}{more}{rest}"
    if not ratios:
        return f"All samples have the same outputs: {_no_dispersion(summary)}."
    farthest = max(wrong or ratios, key=lambda name: abs(ratios.get(name, 1.0) - 1.0))
    largest = f"the largest difference is {percent(ratios.get(farthest, 1.0) - 1.0)}, in {farthest}"
    if wrong:
        return (
            f"The Monte Carlo sigma of {_join(wrong)} from {samples:,} samples differs from the linear sigma by more "
            f"than {limit} ({confidence}); {largest}.{rest}"
        )
    if undecided:
        return f"With {samples:,} samples, {confidence} and a tolerance of ±{limit}: {undecided}"
    alone = f" {_join(still)} {'is' if len(still) == 1 else 'are'} {NOT_DISTURBED}." if still else ""
    if summary["verdict"] == "undecided":  # although every output agrees: too many samples failed
        return (
            f"{summary['failed']:,} of {summary['samples']:,} samples failed, more than the "
            f"{100.0 * LARGEST_FAILED_SHARE:g} % up to which agreement is claimed: their errors are not known. Of the "
            f"{samples:,} samples that did not fail the Monte Carlo sigma in every {'other ' if still else ''}output "
            f"is within ±{limit} of the linear sigma; {largest}.{alone}"
        )
    return (
        f"In every {'other ' if still else ''}output the Monte Carlo sigma from {samples:,} samples is within "
        f"±{limit} of the linear sigma ({confidence}); {largest}.{alone}"
    )


def _undecided(summary: Mapping[str, Any], names: Sequence[str]) -> str:
    """Name the undecided outputs and the samples that would decide; empty without any."""
    if not names:
        return ""
    needed = [count for count in summary["samples_needed"] if count]
    if needed:
        reason = f"{more_samples(max(needed), summary['samples'])} would decide"
    elif any(ends and None not in ends and math.isfinite(ends[1]) for ends in summary["sigma_ratio_paired_interval"]):
        reason = "too close to a limit of the tolerance for any number of samples"
    elif summary["heavy_tailed"]:
        reason = "tails too heavy for an interval"
    else:
        reason = "too few independent samples for an interval"
    return f"Undecided for {_join(names)}: {reason}."


def joint_explanation(summary: Mapping[str, Any]) -> str:
    """Explain the verdict on all outputs together, with numbers; empty where there is none."""
    return "" if summary.get("beyond_range") else joint_words.explain(summary)


def findings(summary: Mapping[str, Any]) -> list[str]:
    """Explain the verdicts on single outputs and on all together; what fails, or is undecided, comes first."""
    alone, together = explanation(summary), joint_explanation(summary)
    ordered = [together, alone] if tone(summary) == "partly" else [alone, together]
    return [sentence for sentence in ordered if sentence]


def certain_but_small(summary: Mapping[str, Any]) -> str:
    """Name the differences that are significant but within the tolerance; empty when there are none."""
    keys = ("outputs", "sigma_ratio_paired", "sigma_ratio_paired_interval", "verdicts")
    small = [
        f"{humanize(output['name'])} ({percent(ratio - 1.0)})"
        for output, ratio, interval, verdict in zip(*(summary[key] for key in keys), strict=False)
        if verdict == "agrees" and interval is not None and not interval[0] - ROUNDING <= 1.0 <= interval[1] + ROUNDING
    ]
    return f"Statistically significant, but within the tolerance: {_join(small)}." if small else ""


def failures(summary: Mapping[str, Any]) -> str:
    """State how many samples failed and how that may bias the results; empty when none did."""
    if not summary["failed"]:
        return ""
    result = f"{summary['failed']:,} of {summary['samples']:,} samples failed and are excluded from all results"
    commonest = message_of(next(iter(summary["failures"]), ""))
    if commonest:
        result += f" ({'' if len(summary['failures']) == 1 else 'most often: '}{commonest})"
    if summary.get("beyond_range"):
        return f"{result}."
    ratios = (summary.get("excluded") or {}).get("sigma_ratio", ())
    smallest = [ratio for ratio in ratios if ratio is not None and math.isfinite(ratio)]
    if not smallest:
        return f"{result}. If they have the largest errors, the dispersion is underestimated."
    hidden = min(smallest) - 1.0
    if hidden > -NEGLIGIBLE:
        return f"{result}. By the linear model their errors are no larger than the others', so the bias is small."
    return (
        f"{result}. By the linear model their errors are larger than the others': excluding them reduces a sigma by up "
        f"to {percent(-hidden).removeprefix('+')}, and by more if their nonlinear errors are larger still."
    )


def stopping(summary: Mapping[str, Any]) -> str:
    """State why sampling stopped; empty for a fixed number of samples."""
    rule = summary.get("stopping")
    if not rule:
        return ""
    kind = "paired" if rule["quantity"].endswith("paired") else "plain"
    goal = f"every {kind} sigma ratio was known to ±{100.0 * rule['precision']:g} % with "
    goal += f"{100.0 * rule['confidence']:g} % confidence"
    looks = f"the intervals allow for up to {rule['looks']} interim looks"
    if rule["reached"]:
        return f"Sampled until {goal}: {summary['samples']:,} samples of at most {rule['at_most']:,}; {looks}."
    return f"Stopped at the maximum of {summary['samples']:,} samples before {goal}; {looks}."


def caveat(summary: Mapping[str, Any]) -> str:
    """Warn of sources whose tails are too heavy for the intervals; empty when there are none."""
    labels = dict(zip((entry["name"] for entry in summary["sources"]), labels_in(summary), strict=True))
    heavy = [labels[name] for name in summary["heavy_tailed"]]
    if heavy:
        return (
            f"No interval and no verdict is given because of heavy tails ({_join(heavy)}): with such errors and this "
            "design, nominal 95 % intervals cover far less in calibration (mcnav calibrate)."
        )
    long = [labels[name] for name in summary.get("long_tailed", [])]
    if long:
        return (
            f"The intervals are approximate because of long tails ({_join(long)}): with such errors, nominal 95 % "
            "intervals cover 90 to 95 % in calibration, with 100 samples 86 %, and those of skewness as little as 84 % "
            "(mcnav calibrate)."
        )
    return ""
