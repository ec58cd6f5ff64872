"""What explains the verdicts on a run, and what warns of them: short sentences with their numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from mcnav.analysis.filter_consistency import cause_words
from mcnav.analysis.filter_remarks import three_digits
from mcnav.analysis.verdict import LARGEST_FAILED_SHARE, NUMERICAL
from mcnav.contract.failure import message_of
from mcnav.report.columns.vector_sizes import size_sentences
from mcnav.report.format import departure, number, percent
from mcnav.report.names import humanize, labels_in, shown_units
from mcnav.report.statements import joint
from mcnav.report.statements.fields import LEAST, NAMED, no_dispersion, samples_for_sigmas
from mcnav.report.statements.words import several

if TYPE_CHECKING:
    from mcnav.analysis.summary import Summary

NEGLIGIBLE: Final = 1e-3
"""Share of a sigma that failed samples may hide without a warning."""

LEAST_ROOM, MOST_ROOM = 1.1, 30.0
"""Multiples of all errors below which, and above which, no number is told."""

NOT_DISTURBED: Final = "no error source acts on it"
"""Finding for an output without dispersion, linear or Monte Carlo."""

BEYOND: Final = "beyond linear range"
"""Text in place of a linear number that has no meaning."""


def details_on(summary: Summary, subject: str, jointly: bool) -> tuple[str, ...]:
    """Explain the verdict on a subject; ``jointly``: what fails is all outputs together, which comes first."""
    if subject == "filter":
        return _known(summary.filter_verdict, explanation_of_filter(summary))
    if subject != "linear":
        return ()
    apart = () if summary.beyond_range else (not_joint(summary), negligible(summary))
    return _known(
        *findings(summary, jointly), *apart, *size_sentences(summary), certain_but_small(summary), stopping(summary)
    )


def warnings_on(summary: Summary) -> tuple[str, ...]:
    """Return what warns of the results of a run."""
    return _known(caveat(summary), failures(summary), *remarks_in(summary.remarks))


def remarks_in(remarks: Sequence[str]) -> tuple[str, ...]:
    """Return what a scenario remarks of itself, a sentence each.

    >>> remarks_in(["guide has a kink at the nominal"])
    ('Warning: guide has a kink at the nominal.',)
    """
    return tuple(f"Warning: {remark}." for remark in remarks)


def _known(*sentences: str) -> tuple[str, ...]:
    return tuple(sentence for sentence in sentences if sentence)


def findings(summary: Summary, jointly: bool) -> list[str]:
    """Explain the verdicts on single outputs and on all together; what fails, or is undecided, comes first."""
    together = "" if summary.beyond_range else joint.explain(summary)
    ordered = [together, explanation(summary)] if jointly else [explanation(summary), together]
    return [sentence for sentence in ordered if sentence]


def output_words(sigma_linear: float, verdict: str) -> str:
    """Return the verdict on an output as shown.

    An output without dispersion counts as agreeing in a summary, so that it does not affect the overall verdict.

    >>> output_words(1.0, "agrees"), output_words(0.0, "agrees"), output_words(0.0, "differs")
    ('agrees', 'no error source acts on it', 'differs')
    """
    return NOT_DISTURBED if sigma_linear == 0.0 and verdict == "agrees" else str(verdict)


def verdict_words(summary: Summary) -> list[str]:
    """List the verdict on each output as shown; empty when nothing was compared."""
    pairs = zip(summary.sigma_linear, summary.verdicts, strict=False)
    return [output_words(sigma, verdict) for sigma, verdict in pairs]


def explanation(summary: Summary) -> str:
    """Explain the verdict output by output, with numbers."""
    if summary.beyond_range:
        return "Linear sigmas there are not shown, and samples are not compared with them."
    samples = summary.samples - summary.failed
    if not summary.verdicts:
        return f"{samples:,} of {summary.samples:,} samples succeeded, which is too few for a comparison."
    names, words = [humanize(name) for name in summary.names], verdict_words(summary)
    floors = summary.floors or [None] * len(names)
    ratios = {
        name: ratio for name, ratio, floor in zip(names, summary.sigma_ratio_paired, floors, strict=True)
        if ratio is not None and floor is None
    }  # fmt: skip
    wrong = [name for name, word in zip(names, words, strict=True) if word == "differs"]
    unpredicted = [name for name in wrong if name not in ratios]
    undecided = _undecided(summary, [name for name, word in zip(names, words, strict=True) if word == "undecided"])
    if not ratios and not unpredicted:
        return f"All samples have the same outputs: {no_dispersion(summary)}."
    limit, confidence = f"{100.0 * summary.tolerance:g} %", f"{100.0 * summary.confidence:g} % confidence"
    parts: list[str] = []
    if unpredicted:
        parts.append(joint.explain_unpredicted(summary, [n for n in summary.names if humanize(n) in unpredicted]))
    if others := [name for name in wrong if name in ratios]:
        parts.append(
            f"The Monte Carlo sigma of {several(others)} from {samples:,} samples differs from the linear sigma by "
            f"more than {limit} ({confidence})."
        )
    if others or not (wrong or undecided):
        farthest = max(others or ratios, key=lambda name: abs(ratios[name] - 1.0))
        largest = f"Largest difference: {departure(ratios[farthest])}, in {farthest}."
        parts += [largest] if wrong else [*_agreement(summary, limit, confidence), largest]
    elif not wrong and undecided != too_few(summary):
        settled = [name for name, word in zip(names, words, strict=True) if word == "agrees"]
        of_others = f"Within ±{limit} ({confidence}): {several(settled)}." if settled else ""
        return " ".join(filter(None, (undecided, of_others)))
    still = [name for name, word in zip(names, words, strict=True) if word == NOT_DISTURBED]
    alone = f"No error source acts on {several(still)}." if still and not wrong and not undecided else ""
    return " ".join(filter(None, (*parts, undecided, alone)))


def _agreement(summary: Summary, limit: str, confidence: str) -> list[str]:
    """Say that all sigmas are within the tolerance; of a run with many failures, that this is no agreement."""
    samples, other = summary.samples - summary.failed, NOT_DISTURBED in verdict_words(summary)
    every = "Every other" if other else "Every"
    if summary.verdict != "undecided":
        return [f"{every} sigma from {samples:,} samples is within ±{limit} of the linear sigma ({confidence})."]
    return [
        f"{summary.failed:,} of {summary.samples:,} samples failed: agreement is claimed up to "
        f"{100.0 * LARGEST_FAILED_SHARE:g} %, because their errors are not known.",
        f"{every} sigma of the other {samples:,} samples is within ±{limit} of the linear sigma.",
    ]


def _undecided(summary: Summary, names: Sequence[str]) -> str:
    """Name the undecided outputs and the samples that would decide; empty without any."""
    if not names:
        return ""
    concerned = {humanize(name) for name in without_verdict(summary)}
    heavy = [name for name in names if name in concerned]
    result = [f"Undecided for {several(heavy)}: tails too heavy for an interval."] if heavy else []
    others = [name for name in names if name not in concerned]
    if others:
        why = _why_undecided(summary, others)
        result.append(f"Undecided for {several(others)}: {why}." if why else too_few(summary))
    return " ".join(result)


def _why_undecided(summary: Summary, names: Sequence[str]) -> str:
    """Return what would decide some outputs, or why nothing would; empty where there are too few samples."""
    if needed := samples_for_sigmas(summary):
        return f"{needed} would decide"
    intervals = zip(summary.names, summary.sigma_ratio_paired_interval, strict=False)
    if any(ends and _is_finite(*ends) for name, ends in intervals if humanize(name) in names):
        return "too close to a limit of the tolerance for any number of samples"
    return ""


def too_few(summary: Summary) -> str:
    """Say how many samples a verdict takes; of a run whose samples failed in part, so many more."""
    from mcnav.sampler.designs import fewest_samples  # with scipy.special, which a run that is shown does not need

    succeeded = summary.samples - summary.failed
    if succeeded >= fewest_samples(summary.design):
        return "There is no interval for a verdict."
    needed = math.ceil(fewest_samples(summary.design) * summary.samples / max(succeeded, 1))
    return f"{succeeded:,} samples are too few for a verdict: run at least {max(needed, summary.samples + 1):,}."


def _is_finite(low: float | None, high: float | None) -> bool:
    return low is not None and high is not None and math.isfinite(high)


def room_to_grow(summary: Summary) -> str:
    """Estimate by how much all errors may grow before a sigma leaves the tolerance; empty unless all are within it.

    For symmetric errors about zero the ratio of sigmas is 1 + a k² + ... with all errors multiplied by k. The farther
    end of its interval stands for a, so that few samples leave less room.
    """
    if summary.verdict != "agrees" or summary.beyond_range or summary.start_mean.any():
        return ""
    reach = {
        name: max(abs(low - 1.0), abs(high - 1.0))
        for name, ends in zip(summary.names, summary.sigma_ratio_paired_interval, strict=False)
        if ends is not None
        for low, high in [ends]
        if low is not None and high is not None and low > 0.0 and math.isfinite(high)
    }
    if not reach:
        return ""
    name = max(reach, key=lambda name: reach[name])
    multiple = math.sqrt(summary.tolerance / max(reach[name], 1e-12))
    if multiple < LEAST_ROOM:
        return ""
    size = f"more than {MOST_ROOM:g}" if multiple > MOST_ROOM else f"at least {math.floor(10.0 * multiple) / 10.0:g}"
    return (
        f"All errors may grow to {size} times their size before a sigma leaves ±{100.0 * summary.tolerance:g} %, first "
        f"that of {humanize(name)}. This assumes that departures grow with the square of the errors. "
        "mcnav sweep --scale measures it."
    )


def certain_but_small(summary: Summary) -> str:
    """Name the differences that are significant but within the tolerance; empty when there are none."""
    if summary.beyond_range:
        return ""
    ratios, intervals = summary.sigma_ratio_paired, summary.sigma_ratio_paired_interval
    small = [
        f"{humanize(name)} ({percent(ratio - 1.0)})"
        for name, ratio, ends, verdict, floor in zip(
            summary.names, ratios, intervals, summary.verdicts, summary.floors or [None] * len(ratios), strict=False
        )
        if verdict == "agrees" and floor is None and ratio is not None and ends is not None and not _holds_one(*ends)
    ]
    return f"Statistically significant, but within the tolerance: {several(small)}." if small else ""


def _holds_one(low: float | None, high: float | None) -> bool:
    """Return whether an interval holds one; null is an end that is not finite."""
    return (low is None or low - NUMERICAL <= 1.0) and (high is None or high + NUMERICAL >= 1.0)


def failures(summary: Summary) -> str:
    """State how many samples failed and how that may bias the results; empty when none did."""
    if not summary.failed:
        return ""
    result = f"{summary.failed:,} of {summary.samples:,} samples failed and are excluded from all results"
    commonest = message_of(next(iter(summary.failures), ""))
    if commonest:
        result += f" ({'' if len(summary.failures) == 1 else 'most often: '}{commonest})"
    if summary.beyond_range:
        return f"{result}."
    ratios = [] if summary.excluded is None else summary.excluded.sigma_ratio.tolist()
    smallest = [ratio for ratio in ratios if math.isfinite(ratio)]
    if not smallest:
        return f"{result}. If they have the largest errors, the dispersion is underestimated."
    hidden = min(smallest) - 1.0
    if hidden > -NEGLIGIBLE:
        return f"{result}. By the linear model their errors are no larger than the others', so the bias is small."
    return (
        f"{result}. By the linear model their errors are larger: excluding them reduces a sigma by up to "
        f"{percent(-hidden).removeprefix('+')}. If their nonlinear errors are larger still, it is more."
    )


def stopping(summary: Summary) -> str:
    """State why sampling stopped; empty for a fixed number of samples."""
    rule = summary.stopping
    if not rule:
        return ""
    kind = "paired" if rule.quantity.endswith("paired") else "plain"
    goal = f"every {kind} sigma ratio was known to ±{100.0 * rule.precision:g} % with "
    goal += f"{100.0 * rule.confidence:g} % confidence"
    looks = f"The intervals allow for up to {rule.looks} interim looks"
    if rule.reached:
        return f"Sampled until {goal}. It took {summary.samples:,} samples of at most {rule.at_most:,}. {looks}."
    return f"Stopped at the maximum of {summary.samples:,} samples before {goal}. {looks}."


def caveat(summary: Summary) -> str:
    """Warn of sources whose tails are too heavy for the intervals; empty when there are none."""
    labels = dict(zip((source.name for source in summary.sources), labels_in(summary), strict=True))
    heavy = [labels[name] for name in summary.heavy_tailed]
    concerned = [humanize(name) for name in without_verdict(summary)]
    if heavy and concerned:
        of = f" of {several(concerned)}" if len(concerned) < len(summary.names) else ""
        return (
            f"No interval and no verdict is given{of} because of heavy tails ({several(heavy)}). With such errors and "
            "this design, nominal 95 % intervals cover far less in calibration."
        )
    long = [labels[name] for name in summary.long_tailed]
    if long:
        return (
            f"The intervals are approximate because of long tails ({several(long)}). With such errors, nominal 95 % "
            "intervals cover 90 to 95 % in calibration. With 100 samples they cover 86 %, those of skewness 84 %."
        )
    return ""


def negligible(summary: Summary) -> str:
    """Name the outputs whose differences are too small to count, with their floors; empty without any."""
    units = shown_units(summary)
    named = [
        f"{humanize(name)} (up to {number(floor * units[name][0], 2)} {units[name][1]})"
        for name, floor in zip(summary.names, summary.floors, strict=False)
        if floor is not None
    ]
    return f"Differences too small to matter count as agreement: {several(named)}." if named else ""


def not_joint(summary: Summary) -> str:
    """Name the outputs that the joint verdict leaves out, and why; empty where it is on all."""
    withheld = without_verdict(summary)
    heavy = [humanize(name) for name in summary.not_joint if name in withheld]
    small = [humanize(name) for name in summary.not_joint if name not in withheld]
    reasons = [f"{several(small)} (hardly any dispersion)"] if small else []
    reasons += [f"{several(heavy)} (heavy tails)"] if heavy else []
    return f"The joint verdict leaves out {' and '.join(reasons)}." if reasons else ""


def without_verdict(summary: Summary) -> tuple[str, ...]:
    """Return the outputs, by name, that have no verdict because of heavy tails: all in a run of an earlier version."""
    if not summary.heavy_tailed:
        return ()
    return tuple(summary.names if summary.withheld is None else summary.withheld)


def explanation_of_filter(summary: Summary) -> str:
    """Name what makes the filter optimistic, and what else there is to say; empty where there is nothing."""
    result = summary.filter
    if not result:
        return ""
    stated = summary.filter_verdict.lower()
    remarks = [remark for remark in result.remarks if remark.lower() not in stated]
    named = [source for source in result.neglected if source.share >= LEAST][:NAMED]
    shares = [f"{cause_words(source.name)} {100.0 * source.share:.0f} %" for source in named]
    unmodelled = f"Unmodelled errors: {', '.join(shares)}." if len(shares) > 1 else ""
    return " ".join(filter(None, [unmodelled, *remarks]))


def worst_sigmas(name: str, when: str, true: float, stated: float, unit: str) -> str:
    """Compare the true sigma of an output at a time with the filter's; the factor is that of the output alone.

    >>> worst_sigmas("position_north", "25 min", 24.91, 7.53, "m")
    'At 25 min 1σ of position north is 24.9 m; the filter computes 7.53 m (3.31 times).'
    """
    shown = f"{number(true, 3)} {unit}; the filter computes {number(stated, 3)} {unit}"
    factor = max(true, stated) / min(true, stated) if true * stated > 0.0 else 0.0
    return f"At {when} 1σ of {humanize(name)} is {shown}{f' ({three_digits(factor)} times)' if factor else ''}."
