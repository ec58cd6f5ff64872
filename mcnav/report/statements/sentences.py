"""The verdict in sentences, from a run's summary."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal

from mcnav.analysis.filter_remarks import instant
from mcnav.analysis.verdict import LARGEST_FAILED_SHARE, NUMERICAL
from mcnav.contract.failure import message_of
from mcnav.report.columns.vector_sizes import size_sentences
from mcnav.report.format import percent
from mcnav.report.names import humanize, labels_in
from mcnav.report.statements import apart_words, filter_verdict, joint_words
from mcnav.report.statements.mean_words import large_means_of, mean_sentence
from mcnav.statistics.power import sensible_step

if TYPE_CHECKING:
    from mcnav.analysis.summary import Beyond, Summary, Tally, Unsettled

NEGLIGIBLE: Final = 1e-3
"""Share of a sigma that failed samples may hide without a warning."""

JOINT: Final = "joint distribution"
"""Name of the NEES test among the outputs."""

BEYOND: Final = "beyond linear range"
"""Text in place of a linear number that has no meaning."""

LEAST_ROOM, MOST_ROOM = 1.1, 30.0
"""Multiples of all errors below which, and above which, no number is told."""

Subject = Literal["means", "linear", "requirements", "filter", "smoother"]
"""Subjects of verdicts."""

SUBJECTS: Final[tuple[Subject, ...]] = ("means", "linear", "requirements", "filter", "smoother")

WORST: Final = ("differs", "partly", "undecided", "agrees")
"""Tones of verdicts, the worst first."""

NOT_DISTURBED: Final = "not disturbed by any cause"
"""Finding for an output without dispersion, linear or Monte Carlo."""


def tone(summary: Summary) -> str:
    """Combine the verdicts on outputs and covariance matrix: ``agrees``, ``partly``, ``differs`` or ``undecided``.

    Beyond its range linear analysis differs, whatever the samples show.
    """
    if summary.unsettled:
        return "undecided"
    if summary.beyond_range:
        return "differs"
    if summary.verdict == "agrees" and summary.verdict_matrix not in ("agrees", None):
        return "partly"
    return summary.verdict


def tone_of(counts: Tally) -> str:
    """Return ``agrees`` when all requirements are met, ``differs`` when one is not met, else ``undecided``."""
    return "differs" if counts.not_met else "agrees" if counts.met == counts.of else "undecided"


@dataclass(frozen=True)
class Statement:
    """A verdict on a run in words: what it is on, its tone, what explains it, and what warns of it."""

    subject: Subject
    words: str
    tone: str
    details: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


def statements(summary: Summary) -> list[Statement]:
    """State the verdicts on linear analysis, on the requirements, on the filter and on its smoother, the worst first.

    Where linear analysis agrees and a requirement is not met, its tone is ``partly``: nothing is green. Mean errors
    that exceed one sigma are said before all verdicts, which are on sigmas.
    """
    apart = () if summary.beyond_range else (apart_words.not_joint(summary), apart_words.negligible(summary))
    details = _known(
        *findings(summary), *apart, *size_sentences(summary), certain_but_small(summary), stopping(summary)
    )
    warnings = _known(caveat(summary), failures(summary), *noticed(summary.remarks))
    linear = Statement("linear", _on_linear(summary), standing(summary), details, warnings)
    stated = [(tone(summary), linear)]
    if (counts := summary.counts) is not None:
        met = tone_of(counts)
        stated.append((met, Statement("requirements", _on_requirements(counts), met)))
    if verdict := filter_verdict.verdict(summary):
        words, honesty = filter_verdict.headline(summary), filter_verdict.TONES[verdict]
        explained = _known(filter_verdict.explanation(summary))
        stated.append((honesty, Statement("filter", words, honesty, explained)))
    if summary.smoother:
        honesty = filter_verdict.TONES[summary.smoother.verdict]
        stated.append((honesty, Statement("smoother", summary.smoother_verdict, honesty)))
    means = [Statement("means", words, "partly")] if (words := mean_sentence(summary)) else []
    return [*means, *(statement for _, statement in sorted(stated, key=lambda each: WORST.index(each[0])))]


def noticed(remarks: Sequence[str]) -> tuple[str, ...]:
    """Return what a scenario notices of itself, a sentence each.

    >>> noticed(["guide has a kink at the nominal"])
    ('Noticed: guide has a kink at the nominal.',)
    """
    return tuple(f"Noticed: {remark}." for remark in remarks)


def _known(*sentences: str) -> tuple[str, ...]:
    return tuple(sentence for sentence in sentences if sentence)


def headline(summary: Summary, subjects: Sequence[Subject] = SUBJECTS) -> str:
    """State the verdicts on a run, the worst first."""
    return " ".join(statement.words for statement in statements(summary) if statement.subject in subjects)


def standing(summary: Summary) -> str:
    """Combine the tone with the requirements: an agreeing run is ``partly`` unless all requirements are met.

    It is so, too, where a mean error exceeds one sigma.
    """
    counts, result = summary.counts, tone(summary)
    open_ = (counts is not None and counts.met < counts.of) or bool(large_means_of(summary))
    return "partly" if result == "agrees" and open_ else result


def verdict_words(summary: Summary) -> list[str]:
    """List the verdict on each output as shown; empty when nothing was compared.

    In ``verdicts`` of a summary an output without dispersion counts as agreeing, so that it does not affect the overall
    verdict.
    """
    pairs = zip(summary.sigma_linear, summary.verdicts, strict=False)
    return [output_words(sigma, verdict) for sigma, verdict in pairs]


def output_words(sigma_linear: float, verdict: str) -> str:
    """Return the verdict on an output as shown.

    >>> output_words(1.0, "agrees"), output_words(0.0, "agrees"), output_words(0.0, "differs")
    ('agrees', 'not disturbed by any cause', 'differs')
    """
    return NOT_DISTURBED if sigma_linear == 0.0 and verdict == "agrees" else str(verdict)


def more_samples(needed: int, samples: int) -> str:
    """Round the number of samples needed for a decision to a sensible step above the present number.

    >>> more_samples(1_001, 1_000), more_samples(15_333, 1_000)
    ('about 1,300 samples', 'about 16,000 samples')
    """
    return f"about {sensible_step(needed, samples):,} samples"


def _on_requirements(counts: Tally) -> str:
    others = (
        (counts.not_met, "not met"), (counts.undecided, "undecided"), (counts.met_as_known, "met for the known ways")
    )  # fmt: skip
    rest = [f"{count} {words}" for count, words in others if count]
    requirements = ", ".join([f"{counts.met} of {counts.of} met", *rest])
    return f"Requirements: {requirements}."


def _on_linear(summary: Summary) -> str:
    if summary.unsettled:
        return unsettled(summary.unsettled)
    if summary.beyond_range:
        return beyond_range(summary.beyond_range)
    if tone(summary) == "partly":
        answer = "No" if summary.verdict_matrix == "differs" else "Undecided"
        return f"{answer} for {joint_words.subject(summary)}; yes for the dispersion of each output."
    if not any(summary.sigma_linear) and summary.verdict != "differs":
        return f"Nothing to compare: {_no_dispersion(summary)}."
    return {
        "agrees": "Yes: the linear covariance analysis can be trusted here.",
        "differs": "No: the linear covariance analysis does not hold here.",
        "undecided": "Undecided: the samples do not show whether the linear covariance analysis holds.",
    }[summary.verdict]


def unsettled(reason: Unsettled) -> str:
    """Explain why there is no valid linear model to compare with.

    >>> from mcnav.analysis.summary import Unsettled
    >>> unsettled(Unsettled(source="seed", output="range", disagreement=0.853, own=False))
    'Partial derivatives do not converge (range by seed: 85 %): the comparison below has no valid linear model.'
    """
    share = 100.0 * (reason.disagreement or math.inf)
    size = f"{share:,.0f} %" if share >= 10.0 else f"{share:.2g} %"
    where = f"{humanize(reason.output)} by {humanize(reason.source)}: {size}"
    if reason.noise:
        named = f"{humanize(reason.output)}: {size} of its sigma"
        causes = {
            "fly_linear": "The scenario's own linear simulations disagree with its simulations",
            "noise_covariance": "The scenario's own noise covariance disagrees with its linear simulations",
        }
        cause = f"{causes.get(reason.noise, 'The response to noise is not linear')} ({named})"
    elif reason.own:
        cause = f"The scenario's own partial derivatives disagree with finite differences ({where})"
    else:
        cause = f"Partial derivatives do not converge ({where})"
    return f"{cause}: the comparison below has no valid linear model."


def beyond_range(beyond: Beyond) -> str:
    """Say from when on linear errors have no meaning.

    >>> from mcnav.analysis.summary import Beyond
    >>> beyond_range(Beyond(outputs=["position_down"], begin=120.0, time="time [min]"))
    'No: errors are beyond the range of linear analysis from 120 min on (position down).'
    """
    since = "at the end" if beyond.begin is None else f"from {instant(beyond.begin, beyond.time or '')} on"
    names = _join([humanize(name) for name in beyond.outputs])
    return f"No: errors are beyond the range of linear analysis {since} ({names})."


def _no_dispersion(summary: Summary) -> str:
    """Explain why no output has a dispersion."""
    dispersed = any(row[i] > 0.0 for i, row in enumerate(summary.start_covariance))
    return "no output depends on an error" if dispersed else "no error has a dispersion"


def _join(names: Sequence[str]) -> str:
    return joint_words.joined(names)


def explanation(summary: Summary) -> str:
    """Explain the verdict output by output, with numbers."""
    samples = summary.samples - summary.failed
    limit = f"{100.0 * summary.tolerance:g} %"
    confidence = f"{100.0 * summary.confidence:g} % confidence"
    names = [humanize(name) for name in summary.names]
    if summary.beyond_range:
        return "Linear sigmas there are not shown, and samples are not compared with them."
    if not summary.verdicts:
        return f"{samples:,} of {summary.samples:,} samples succeeded, which is too few for a comparison."
    floors = summary.floors or [None] * len(names)
    ratios = {
        name: ratio for name, ratio, floor in zip(names, summary.sigma_ratio_paired, floors, strict=True)
        if ratio is not None and floor is None
    }  # fmt: skip
    verdicts = dict(zip(names, summary.verdicts, strict=True))
    wrong = [name for name in names if verdicts[name] == "differs"]
    only_nonlinear = [name for name in wrong if name not in ratios]
    still = [name for name, words in zip(names, verdict_words(summary), strict=True) if words == NOT_DISTURBED]
    undecided = _undecided(summary, [name for name in names if verdicts[name] == "undecided"])
    rest = f" {undecided}" if undecided else ""
    if only_nonlinear:
        others = [name for name in wrong if name in ratios]
        more = f" The sigma of {_join(others)} differs by more than {limit}." if others else ""
        keys = [name for name in summary.names if humanize(name) in only_nonlinear]
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
        if undecided == too_few(summary):
            return undecided
        decided = [name for name in names if verdicts[name] == "agrees" and name not in still]
        of_others = f" The Monte Carlo sigma of {_join(decided)} is within it." if decided else ""
        return f"With {samples:,} samples, {confidence} and a tolerance of ±{limit}: {undecided}{of_others}"
    alone = f" {_join(still)} {'is' if len(still) == 1 else 'are'} {NOT_DISTURBED}." if still else ""
    if summary.verdict == "undecided":  # although every output agrees: too many samples failed
        return (
            f"{summary.failed:,} of {summary.samples:,} samples failed, more than the "
            f"{100.0 * LARGEST_FAILED_SHARE:g} % up to which agreement is claimed: their errors are not known. Of the "
            f"{samples:,} samples that did not fail the Monte Carlo sigma in every {'other ' if still else ''}output "
            f"is within ±{limit} of the linear sigma; {largest}.{alone}"
        )
    return (
        f"In every {'other ' if still else ''}output the Monte Carlo sigma from {samples:,} samples is within "
        f"±{limit} of the linear sigma ({confidence}); {largest}.{alone}"
    )


def _undecided(summary: Summary, names: Sequence[str]) -> str:
    """Name the undecided outputs and the samples that would decide; empty without any."""
    if not names:
        return ""
    concerned = {humanize(name) for name in apart_words.without_verdict(summary)}
    heavy = [name for name in names if name in concerned]
    result = [f"Undecided for {_join(heavy)}: tails too heavy for an interval."] if heavy else []
    others = [name for name in names if name not in concerned]
    if others:
        why = _why_undecided(summary, others)
        result.append(f"Undecided for {_join(others)}: {why}." if why else too_few(summary))
    return " ".join(result)


def _why_undecided(summary: Summary, names: Sequence[str]) -> str:
    """Return what would decide some outputs, or why nothing would; empty where there are too few samples."""
    needed = [count for count in summary.samples_needed if count]
    if needed:
        return f"{more_samples(max(needed), summary.samples)} would decide"
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


def joint_explanation(summary: Summary) -> str:
    """Explain the verdict on all outputs together, with numbers; empty where there is none."""
    return "" if summary.beyond_range else joint_words.explain(summary)


def findings(summary: Summary) -> list[str]:
    """Explain the verdicts on single outputs and on all together; what fails, or is undecided, comes first."""
    alone, together = explanation(summary), joint_explanation(summary)
    ordered = [together, alone] if tone(summary) == "partly" else [alone, together]
    return [sentence for sentence in ordered if sentence]


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
    name = max(reach, key=lambda each: reach[each])
    multiple = math.sqrt(summary.tolerance / max(reach[name], 1e-12))
    if multiple < LEAST_ROOM:
        return ""
    told = f"more than {MOST_ROOM:g}" if multiple > MOST_ROOM else f"at least {math.floor(10.0 * multiple) / 10.0:g}"
    return (
        f"All errors may grow to {told} times their size before a sigma may leave ±{100.0 * summary.tolerance:g} %, "
        f"first that of {humanize(name)}, if departures grow with the square of the errors, as those of smooth systems "
        "do at first; mcnav sweep --scale measures it."
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
    return f"Statistically significant, but within the tolerance: {_join(small)}." if small else ""


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
        f"{result}. By the linear model their errors are larger than the others': excluding them reduces a sigma by up "
        f"to {percent(-hidden).removeprefix('+')}, and by more if their nonlinear errors are larger still."
    )


def stopping(summary: Summary) -> str:
    """State why sampling stopped; empty for a fixed number of samples."""
    rule = summary.stopping
    if not rule:
        return ""
    kind = "paired" if rule.quantity.endswith("paired") else "plain"
    goal = f"every {kind} sigma ratio was known to ±{100.0 * rule.precision:g} % with "
    goal += f"{100.0 * rule.confidence:g} % confidence"
    looks = f"the intervals allow for up to {rule.looks} interim looks"
    if rule.reached:
        return f"Sampled until {goal}: {summary.samples:,} samples of at most {rule.at_most:,}; {looks}."
    return f"Stopped at the maximum of {summary.samples:,} samples before {goal}; {looks}."


def caveat(summary: Summary) -> str:
    """Warn of sources whose tails are too heavy for the intervals; empty when there are none."""
    labels = dict(zip((source.name for source in summary.sources), labels_in(summary), strict=True))
    heavy = [labels[name] for name in summary.heavy_tailed]
    concerned = [humanize(name) for name in apart_words.without_verdict(summary)]
    if heavy and concerned:
        of = f" of {_join(concerned)}" if len(concerned) < len(summary.names) else ""
        return (
            f"No interval and no verdict is given{of} because of heavy tails ({_join(heavy)}): with such errors and "
            "this design, nominal 95 % intervals cover far less in calibration."
        )
    long = [labels[name] for name in summary.long_tailed]
    if long:
        return (
            f"The intervals are approximate because of long tails ({_join(long)}): with such errors, nominal 95 % "
            "intervals cover 90 to 95 % in calibration, with 100 samples 86 %, and those of skewness as little as 84 %."
        )
    return ""
