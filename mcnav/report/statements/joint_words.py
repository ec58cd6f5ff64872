"""All outputs together in sentences, from a run's summary: combinations of outputs, their dispersion and mean."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from statistics import NormalDist
from typing import TYPE_CHECKING, Final

import numpy as np

from mcnav.report.format import number, percent
from mcnav.report.names import humanize, shown_units
from mcnav.statistics.power import sensible_step

if TYPE_CHECKING:
    from mcnav.analysis.summary import CombinationEntry, Joint, Summary

LEAST: Final = 0.01
"""Share of a combination's largest term, in linear sigmas, below which a term is not named."""

ROUNDING: Final = 1e-9
"""Share below which a term is rounding."""

LARGE_RATIO: Final = 3.0
"""Sigma ratio above which a difference is given as a multiple, not in per cent."""

CANCELLING: Final = 0.1
"""Linear sigma of a combination over that of its lead output below which the outputs' errors nearly cancel."""

MATCHING: Final = 0.1
"""Relative difference of the sigma of second-order terms from the simulated one that calls an output quadratic."""

NOTABLE: Final = 0.1
"""Share of the mean error in the excess of the mean NEES from which it is named beside the dispersion."""

NAMED: Final = 3
"""Combinations named in one sentence."""

THINNEST: Final = 1.1
"""Variance of a combination over that of the thinnest direction up to which it is called so: sigmas within 5 %."""

BRIEFLY: Final = 2
"""Terms beside the lead output that a cell or a tile has room for."""


def joined(names: Sequence[str]) -> str:
    """Join names by commas and a last *and*."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def combination_words(result: CombinationEntry, summary: Summary, most: int | None = None) -> str:
    """Name a combination of a summary's ``joint``, in the units shown, without terms below `LEAST`.

    ``most`` is the number of terms beside the lead output that are written out, by default all.

    >>> from mcnav.analysis.summary import CombinationEntry, Named, Summary
    >>> two = Summary.model_construct(outputs=[Named(name="y", unit="m"), Named(name="y2", unit="m")])
    >>> of_both = dict(sigma_linear=1.0, sigma_paired=1.1, mean_error=0.0)
    >>> combination_words(CombinationEntry(lead="y2", weights=[-2.0, 1.0], shares=[-1.0, 1.0], **of_both), two)
    'y2 − 2 y'
    """
    units, names = shown_units(summary), summary.names
    scale = units[result.lead][0]
    shares = dict(zip(names, result.shares, strict=True))
    weights = dict(zip(names, result.weights, strict=True))
    others = [name for name in sorted(names, key=lambda name: -abs(shares[name])) if name != result.lead]
    named = [name for name in others if abs(shares[name]) >= LEAST]
    words = humanize(result.lead)
    written = named[:most]
    for name in written:
        size = abs(weights[name]) * scale / units[name][0]
        factor = "" if math.isclose(size, 1.0, rel_tol=5e-5) else f"{_plain(size)} "
        words += f" {'−' if weights[name] < 0.0 else '+'} {factor}{humanize(name)}"
    if len(named) > len(written):
        words += f" and {len(named) - len(written)} more"
    elif any(ROUNDING < abs(shares[name]) < LEAST for name in others):
        words += " and smaller terms"
    own = list(dict.fromkeys(units[name][1] for name in (result.lead, *written)))
    return f"{words} ({', '.join(own)})" if len(own) > 1 else words


def direction_words(result: CombinationEntry, summary: Summary) -> str:
    """Name a combination without its terms: the thinnest direction of the linear ellipsoid where it is that.

    With D the linear sigmas, C the linear covariance and u the combination's terms in sigmas, of length one, its
    variance ``u' D^-1 C D^-1 u`` is then the smallest eigenvalue of the correlation matrix, within `THINNEST`.
    """
    sigma, terms = np.asarray(summary.sigma_linear, dtype=float), np.asarray(result.shares, dtype=float)
    moving = sigma > 0.0
    size = float(np.linalg.norm(terms[moving]))
    if size == 0.0 or moving.sum() < 2:
        return "combination"
    own, along = sigma[moving], terms[moving] / size
    correlation = np.asarray(summary.covariance_linear, dtype=float)[np.ix_(moving, moving)] / np.outer(own, own)
    smallest = float(np.linalg.eigvalsh(correlation)[0])
    return "thinnest direction" if float(along @ correlation @ along) <= THINNEST * smallest else "combination"


def _plain(size: float) -> str:
    """Format a factor to four digits, without trailing zeros."""
    shown = number(size, 4)
    return shown.rstrip("0").rstrip(".") if "." in shown and "·" not in shown else shown


def subject(summary: Summary) -> str:
    """Name what of all outputs together is not that of linear analysis."""
    joint = summary.joint
    if joint is None or joint.shifted is None or joint.cause != "mean" or joint.dispersion_verdict != "agrees":
        return "the joint distribution of the outputs"
    named = [share for share in joint.shifted.shares if abs(share) >= LEAST]
    return f"the mean of {humanize(joint.shifted.lead) if len(named) == 1 else 'the outputs'}"


def shortly(summary: Summary, joint: Joint) -> str:
    """Describe in a few words what differs most in all outputs together."""
    ratio = summary.direction_ratio
    if joint.cause == "unpredicted":
        result = joint.unpredicted[0]
        linear, simulated, _ = _sigmas(result, summary)
        return f"σ {simulated} in place of {linear} in {combination_words(result, summary)}"
    if joint.cause == "mean":
        return f"mean {_shift(summary, joint)}"
    return f"σ ratio {number(ratio, 5)} in {combination_words(_known(joint.differing), summary, BRIEFLY)}"


def _known(combination: CombinationEntry | None) -> CombinationEntry:
    """Refuse a summary without a combination of outputs that the verdict rests on."""
    if combination is None:
        raise ValueError("joint: has no combination of outputs")
    return combination


def explain(summary: Summary) -> str:
    """Explain the verdict on all outputs together; empty where there is none."""
    verdict, joint = summary.verdict_matrix, summary.joint
    if verdict is None:
        return ""
    if verdict == "agrees":
        return _agreement(summary)
    start = f"The joint distribution of the outputs {'differs' if verdict == 'differs' else 'is undecided'}"
    if joint is None:  # a summary of an earlier version
        return f"{start}: {_nees(summary)}."
    parts = {"unpredicted": _of_unpredicted, "mean": _of_mean, "dispersion": _of_dispersion}
    told = parts[joint.cause or ""](summary, joint, start)
    needed = joint.samples_needed
    if verdict == "undecided" and needed:
        told += f" About {sensible_step(needed, summary.samples):,} samples would decide."
    return told


def _nees(summary: Summary) -> str:
    return f"the mean NEES is {_mean_nees(summary):.4g}, and linear analysis predicts {summary.nees_dimension}"


def _mean_nees(summary: Summary) -> float:
    mean = summary.nees_mean_paired
    mean = summary.nees_mean if mean is None or mean <= 0.0 else mean
    return math.nan if mean is None else mean


def _agreement(summary: Summary) -> str:
    """State that the mean NEES agrees, and what is off in spite of it."""
    also = " as well" if summary.verdict == "agrees" else ""
    told = f"The mean NEES of all outputs together agrees{also}: it is {_mean_nees(summary):.4g}, and linear analysis "
    told += f"predicts {summary.nees_dimension}."
    joint, ratio = summary.joint, summary.direction_ratio
    if joint is None:
        return told
    if joint.differing and ratio is not None and abs(ratio - 1.0) > summary.tolerance:
        words = combination_words(joint.differing, summary)
        told += f" It is a mean over all combinations; farthest off is {words}, with a sigma ratio of {number(ratio)}."
    shifted = [
        f"{humanize(name)} ({abs(bias) / sigma:.2g})"
        for name, bias, error, sigma in zip(
            summary.names, summary.bias, summary.bias_standard_error, summary.sigma_linear, strict=False
        )
        if sigma and _is_certain(bias, error, summary.confidence_each) and abs(bias) > summary.tolerance * sigma
    ]
    return f"{told} The mean is off, in sigmas: {joined(shifted)}." if shifted else told


def _is_certain(bias: float, error: float, confidence: float) -> bool:
    """Return whether a bias is not zero; a normal interval, for errors of many samples."""
    return abs(bias) > NormalDist().inv_cdf(0.5 + 0.5 * confidence) * error


def _sigmas(sigmas: CombinationEntry, summary: Summary) -> tuple[str, str, str]:
    """Return linear and simulated sigma of a combination, and the linear one of its lead output, with units."""
    scale, unit = shown_units(summary)[sigmas.lead]
    names = summary.names
    own = summary.sigma_linear[names.index(sigmas.lead)]
    sizes = (sigmas.sigma_linear, sigmas.sigma_paired, own)
    linear, simulated, alone = (f"{number(each * scale, 3)} {unit}".strip() for each in sizes)
    return linear, simulated, alone


def _of_unpredicted(summary: Summary, joint: Joint, start: str) -> str:
    """Name combinations that linear analysis holds fixed; single outputs have a sentence of their own."""
    entries = [each for each in joint.unpredicted if np.count_nonzero(each.weights) > 1]
    verdict = joint.nees_verdict
    rest = {"agrees": "", "differs": ", which differs too", "undecided": ", which is undecided"}[verdict]
    rest = f"In all other directions {_nees(summary)}{rest}."
    if not entries:
        return f"{start} with it. {rest}"
    told, names = [], summary.names
    for unpredicted in entries[:NAMED]:
        linear, simulated, own = _sigmas(unpredicted, summary)
        share = number(100.0 * unpredicted.sigma_paired / summary.sigma_linear[names.index(unpredicted.lead)], 2)
        words = f"{combination_words(unpredicted, summary)}: linear sigma {linear}, simulated {simulated}"
        told.append(f"{words} ({share} % of that of {humanize(unpredicted.lead)}, {own})")
    more = f", and {len(entries) - NAMED} more" if len(entries) > NAMED else ""
    return (
        f"{start}: what linear analysis holds fixed is dispersed. "
        f"{'; '.join(told)}{more}. What depends on this, such as a difference of outputs or an inverse of P·S·Pᵀ, is "
        f"not what linear analysis says. {rest}"
    )


def _shift(summary: Summary, joint: Joint, named: str = "") -> str:
    """State by how many sigmas the mean is off, and in what combination, unless it is ``named``."""
    shift = _known(joint.shifted)
    scale, unit = shown_units(summary)[shift.lead]
    size = f"{number(shift.mean_error * scale, 3)} {unit}".strip()
    return f"off by {joint.mean_error:.3g} sigma in {named or combination_words(shift, summary)} (by {size})"


def _of_mean(summary: Summary, joint: Joint, start: str) -> str:
    """Tell the mean error from the dispersion, which may agree."""
    words = {"agrees": "agrees", "differs": "differs too", "undecided": "is undecided"}
    nees = (
        f"the mean NEES is {_mean_nees(summary):.4g} about the linear mean and {joint.nees_about_mean:.4g} about "
        f"the sample mean, and linear analysis predicts {summary.nees_dimension}"
    )
    of = "the dispersion" if summary.verdict == "agrees" else "the dispersion of all outputs together"
    told = f"The mean is {_shift(summary, joint)}; {of} {words[joint.dispersion_verdict or '']}: {nees}."
    if joint.dispersion_verdict != "agrees":
        return f"{start}. {told}"
    return f"{told} Linear sigmas hold about the sample mean, not about the linear one."


def _of_dispersion(summary: Summary, joint: Joint, start: str) -> str:
    """Describe the combination of outputs whose dispersion differs most, and what that means."""
    ratio = summary.direction_ratio
    dispersion, told = _known(joint.differing), f"{start}: {_nees(summary)}."
    if ratio is None or not math.isfinite(ratio):  # no variance is left in the paired estimate
        return told
    linear, simulated, own = _sigmas(dispersion, summary)
    size = f"{number(ratio, 3)} times as large" if ratio > LARGE_RATIO else f"a difference of {percent(ratio - 1.0)}"
    told += (
        f" It differs most in {combination_words(dispersion, summary)}: linear sigma {linear}, simulated {simulated}, "
    )
    told += size
    alone = sum(abs(share) > ROUNDING for share in dispersion.shares) == 1
    told += "." if alone else f"; the linear sigma of {humanize(dispersion.lead)} alone is {own}."
    if joint.mean_error**2 > NOTABLE * abs(_mean_nees(summary) - summary.nees_dimension):
        same = combination_words(_known(joint.shifted), summary) == combination_words(dispersion, summary)
        told += f" The mean is {_shift(summary, joint, 'it' if same else '')}."
    if summary.verdict_matrix != "differs" or summary.verdict != "agrees" or alone:
        return told
    names = summary.names
    cancels = ratio > 1.0 and dispersion.sigma_linear < CANCELLING * summary.sigma_linear[names.index(dispersion.lead)]
    why = "By linear analysis these errors nearly cancel, in the simulation less so: the" if cancels else "The"
    return f"{told} {why} sigmas of single outputs hold, but an error ellipsoid or an inverse of P·S·Pᵀ does not."


def explain_unpredicted(summary: Summary, names: Sequence[str]) -> str:
    """Explain outputs, by their keys, that linear analysis holds fixed and that are dispersed."""
    units, keys = shown_units(summary), summary.names
    simulated = {name: summary.sigma_sample[keys.index(name)] for name in names}
    shown = [f"{number(simulated[name] * units[name][0], 3)} {units[name][1]}".strip() for name in names]
    one = len(names) == 1
    told = (
        f"Linear analysis predicts no dispersion of {joined([humanize(name) for name in names])}: "
        f"{_reason(summary, [keys.index(name) for name in names])}. The simulated sigma{'' if one else 's'} of "
        f"{summary.samples - summary.failed:,} samples {'is' if one else 'are'} {joined(shown)}."
    )
    quadratic, others = _quadratic(summary, simulated)
    parts = []
    if quadratic:
        subject = f"that of {joined([humanize(name) for name in quadratic])}"
        parts.append(f"Second-order terms explain {subject if others else 'this'}: quadratic there.")
    if others:
        subject = joined([humanize(name) for name in others]) if quadratic else "The output" if one else "The outputs"
        verb = "has" if len(others) == 1 else "have"
        parts.append(f"{subject} {verb} a kink, a flat place or terms of higher order there.")
    return " ".join([
        told, *parts,
        "No linear analysis about this point sees it: take the simulated sigma, or outputs that are linear here.",
    ])  # fmt: skip


def _reason(summary: Summary, rows: Sequence[int]) -> str:
    """Tell partial derivatives of zero from contributions that cancel."""
    spread = np.sqrt(np.maximum(np.diag(summary.start_covariance), 0.0))
    terms = np.abs(summary.partials) * spread
    if np.all(terms[list(rows)] <= ROUNDING * max(float(terms.max(initial=0.0)), 0.0)):
        return "the partial derivatives at the nominal are zero"
    return "at the nominal the partial derivatives are zero, or their contributions cancel"


def _quadratic(summary: Summary, simulated: Mapping[str, float]) -> tuple[list[str], list[str]]:
    """Split outputs into those whose dispersion second-order terms predict, and others."""
    keys, terms = summary.names, summary.second_order and summary.second_order.quadratic
    predicted = np.array(terms or np.zeros((len(keys), len(keys))), dtype=float).diagonal()
    sigma = {name: math.sqrt(max(float(predicted[keys.index(name)]), 0.0)) for name in simulated}
    matching = [name for name, quadratic in simulated.items() if abs(sigma[name] - quadratic) <= MATCHING * quadratic]
    return matching, [name for name in simulated if name not in matching]
