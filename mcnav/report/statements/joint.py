"""All outputs together in sentences, from a run's summary: combinations of outputs, their dispersion and mean."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from statistics import NormalDist
from typing import TYPE_CHECKING, Final

import numpy as np

from mcnav.report.format import departure, number
from mcnav.report.names import humanize, shown_units
from mcnav.report.statements.words import joined, more_samples, several

if TYPE_CHECKING:
    from mcnav.analysis.summary import CombinationEntry, Joint, Summary

LEAST: Final = 0.01
"""Share of a combination's largest term, in linear sigmas, below which a term is not named."""

ROUNDING: Final = 1e-9
"""Share below which a term is rounding."""

CANCELLING: Final = 0.1
"""Linear sigma of a combination over that of its lead output below which the outputs' errors nearly cancel."""

MATCHING: Final = 0.1
"""Relative difference of the sigma of second-order terms from the simulated one that calls an output quadratic."""

NOTABLE: Final = 0.1
"""Share of the mean error in the excess of the mean NEES from which it is named beside the dispersion."""

NAMED: Final = 3
"""Combinations that are named."""

THINNEST: Final = 1.1
"""Variance of a combination over that of the thinnest direction up to which it is called so: sigmas within 5 %."""

BRIEFLY: Final = 2
"""Terms beside the lead output that a cell or a tile has room for."""


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


def direction_of(result: CombinationEntry, summary: Summary) -> str:
    """Name a combination with its largest outputs, or the output that it is alone.

    >>> from mcnav.analysis.summary import CombinationEntry, Named, Summary
    >>> two = Summary.model_construct(outputs=[Named(name="y", unit="m"), Named(name="y2", unit="m")],
    ...                               sigma_linear=np.ones(2), covariance_linear=np.eye(2))
    >>> of_both = dict(sigma_linear=1.0, sigma_paired=1.1, mean_error=0.0)
    >>> direction_of(CombinationEntry(lead="y2", weights=[-2.0, 1.0], shares=[-1.0, 1.0], **of_both), two)
    'the thinnest direction of y and y2'
    >>> direction_of(CombinationEntry(lead="y2", weights=[0.0, 1.0], shares=[0.0, 1.0], **of_both), two)
    'y2'
    """
    shares = dict(zip(summary.names, np.abs(result.shares), strict=True))
    named = [humanize(name) for name in sorted(shares, key=lambda name: -shares[name]) if shares[name] >= LEAST]
    return named[0] if len(named) == 1 else f"the {direction_words(result, summary)} of {several(named, BRIEFLY)}"


def _known(combination: CombinationEntry | None) -> CombinationEntry:
    """Refuse a summary without a combination of outputs that the verdict rests on."""
    if combination is None:
        raise ValueError("joint: has no combination of outputs")
    return combination


def explain(summary: Summary) -> str:
    """Explain the verdict on all outputs together, in short sentences; empty where there is none."""
    verdict, joint = summary.verdict_matrix, summary.joint
    if verdict is None:
        return ""
    if verdict == "agrees":
        return _agreement(summary)
    start = f"The full covariance matrix {'differs' if verdict == 'differs' else 'is undecided'}"
    if joint is None:  # a summary of an earlier version
        return f"{start}: {_nees(summary)}."
    parts = {"unpredicted": _of_unpredicted, "mean": _of_mean, "dispersion": _of_dispersion}
    sentences = [*parts[joint.cause or ""](summary, joint, start)]
    if verdict == "undecided" and joint.samples_needed:
        more = more_samples(joint.samples_needed, summary.samples)
        sentences.append(f"{more[:1].upper()}{more[1:]} would decide.")
    return " ".join(sentences)


def _nees(summary: Summary) -> str:
    return (
        f"the mean squared distance in sigmas is {_mean_nees(summary):.4g} where {summary.nees_dimension} is expected"
    )


def _mean_nees(summary: Summary) -> float:
    mean = summary.nees_mean_paired
    mean = summary.nees_mean if mean is None or mean <= 0.0 else mean
    return math.nan if mean is None else mean


def _agreement(summary: Summary) -> str:
    """State that the mean squared distance agrees, and what is off in spite of it."""
    also = " as well" if summary.verdict == "agrees" else ""
    parts = [f"The full covariance matrix agrees{also}: {_nees(summary)}."]
    joint, ratio = summary.joint, summary.direction_ratio
    if joint is None:
        return parts[0]
    if joint.differing and ratio is not None and abs(ratio - 1.0) > summary.tolerance:
        parts.append("This is a mean over all combinations of outputs.")
        parts.append(f"Farthest off is {direction_of(joint.differing, summary)}: sigma ratio {number(ratio)}.")
    shifted = [
        f"{humanize(name)} ({abs(bias) / sigma:.2g})"
        for name, bias, error, sigma in zip(
            summary.names, summary.bias, summary.bias_standard_error, summary.sigma_linear, strict=False
        )
        if sigma and _is_certain(bias, error, summary.confidence_each) and abs(bias) > summary.tolerance * sigma
    ]
    return " ".join([*parts, *([f"The mean is off, in sigmas: {several(shifted)}."] if shifted else [])])


def _is_certain(bias: float, error: float, confidence: float) -> bool:
    """Return whether a bias is not zero; a normal interval, for errors of many samples."""
    return abs(bias) > NormalDist().inv_cdf(0.5 + 0.5 * confidence) * error


def _sigmas(sigmas: CombinationEntry, summary: Summary) -> tuple[str, str, str]:
    """Return linear and simulated sigma of a combination, and the linear one of its lead output, with units."""
    scale, unit = shown_units(summary)[sigmas.lead]
    own = summary.sigma_linear[summary.names.index(sigmas.lead)]
    sizes = (sigmas.sigma_linear, sigmas.sigma_paired, own)
    linear, simulated, alone = (f"{number(size * scale, 3)} {unit}".strip() for size in sizes)
    return linear, simulated, alone


def _of_unpredicted(summary: Summary, joint: Joint, start: str) -> list[str]:
    """Name combinations that linear analysis treats as exact; single outputs have a sentence of their own."""
    entries = [entry for entry in joint.unpredicted if np.count_nonzero(entry.weights) > 1]
    rest = {"agrees": "", "differs": ", which differs too", "undecided": ", which is undecided"}[joint.nees_verdict]
    others = f"In all other directions {_nees(summary)}{rest}."
    if not entries:
        return [f"{start} with it.", others]
    result = [f"{start}: linear analysis treats a combination as exact that varies."]
    for entry in entries[:NAMED]:
        linear, simulated, own = _sigmas(entry, summary)
        share = number(100.0 * entry.sigma_paired / summary.sigma_linear[summary.names.index(entry.lead)], 2)
        size = f"linear sigma {linear}, simulated {simulated} ({share} % of the {own} of {humanize(entry.lead)})"
        result.append(f"{combination_words(entry, summary, BRIEFLY)}: {size}.")
    if len(entries) > NAMED:
        result.append(f"So do {len(entries) - NAMED} more.")
    return [*result, "Do not rely on such a difference of outputs, or on an inverse of P·S·Pᵀ.", others]


def _shift(summary: Summary, joint: Joint, named: str = "") -> str:
    """State by how many sigmas the mean is off, and in what combination, unless it is ``named``."""
    shift = _known(joint.shifted)
    scale, unit = shown_units(summary)[shift.lead]
    size = f"{number(shift.mean_error * scale, 3)} {unit}".strip()
    return f"off by {joint.mean_error:.3g} sigma in {named or direction_of(shift, summary)} (by {size})"


def _of_mean(summary: Summary, joint: Joint, start: str) -> list[str]:
    """Tell the mean error from the dispersion, which may agree."""
    words = {"agrees": "agrees", "differs": "differs too", "undecided": "is undecided"}
    of = "The dispersion" if summary.verdict == "agrees" else "The dispersion of all outputs together"
    result = [
        f"The mean is {_shift(summary, joint)}.",
        f"{of} {words[joint.dispersion_verdict or '']}.",
        f"The mean squared distance in sigmas is {_mean_nees(summary):.4g} about the linear mean. It is "
        f"{joint.nees_about_mean:.4g} about the "
        f"sample mean; {summary.nees_dimension} is expected.",
    ]
    if joint.dispersion_verdict != "agrees":
        return [f"{start}.", *result]
    return [*result, "Linear sigmas hold about the sample mean, not about the linear one."]


def _of_dispersion(summary: Summary, joint: Joint, start: str) -> list[str]:
    """Describe the combination of outputs whose dispersion differs most, and what that means."""
    ratio, dispersion = summary.direction_ratio, _known(joint.differing)
    result = [f"{start}: {_nees(summary)}."]
    if ratio is None or not math.isfinite(ratio):  # no variance is left in the paired estimate
        return result
    linear, simulated, own = _sigmas(dispersion, summary)
    lead = humanize(dispersion.lead)
    alone = sum(abs(share) > ROUNDING for share in dispersion.shares) == 1
    result.append(f"It differs most in {direction_of(dispersion, summary)}.")
    result.append(f"There the simulated sigma is {simulated}, the linear one {linear} ({departure(ratio)}).")
    result += [] if alone else [f"The linear sigma of {lead} alone is {own}."]
    if joint.mean_error**2 > NOTABLE * abs(_mean_nees(summary) - summary.nees_dimension):
        same = combination_words(_known(joint.shifted), summary) == combination_words(dispersion, summary)
        result.append(f"The mean is {_shift(summary, joint, 'the same direction' if same else '')}.")
    if summary.verdict_matrix != "differs" or summary.verdict != "agrees" or alone:
        return result
    lead_sigma = summary.sigma_linear[summary.names.index(dispersion.lead)]
    if ratio > 1.0 and dispersion.sigma_linear < CANCELLING * lead_sigma:
        result.append("By linear analysis these errors nearly cancel; in the simulation they cancel less.")
    return [*result, "The sigmas of single outputs hold. An error ellipsoid or an inverse of P·S·Pᵀ does not."]


def explain_unpredicted(summary: Summary, names: Sequence[str]) -> str:
    """Explain outputs, by their keys, that linear analysis treats as exact and that vary."""
    units, keys = shown_units(summary), summary.names
    simulated = {name: summary.sigma_sample[keys.index(name)] for name in names}
    shown = [f"{number(simulated[name] * units[name][0], 3)} {units[name][1]}".strip() for name in names]
    one = len(names) == 1
    result = [
        f"Linear analysis predicts no dispersion of {several([humanize(name) for name in names])}.",
        f"{_reason(summary, [keys.index(name) for name in names])}.",
        f"The simulated sigma{'' if one else 's'} of {summary.samples - summary.failed:,} samples "
        f"{'is' if one else 'are'} {several(shown)}.",
    ]
    quadratic, others = _quadratic(summary, simulated)
    if quadratic:
        subject = f"the sigma of {several([humanize(name) for name in quadratic])}" if others else "this"
        result.append(f"Second-order terms explain {subject}: quadratic at the nominal.")
    if others:
        subject = joined([humanize(name) for name in others[:NAMED]]) if quadratic else "The output" if one else ""
        verb = "has" if len(others) == 1 else "have"
        result.append(f"{subject or 'The outputs'} {verb} a kink, a flat place or terms of higher order there.")
    return " ".join([
        *result,
        "No linear analysis about this point sees it.",
        "Take the simulated sigma, or outputs that are linear here.",
    ])  # fmt: skip


def _reason(summary: Summary, rows: Sequence[int]) -> str:
    """Tell partial derivatives of zero from contributions that cancel."""
    spread = np.sqrt(np.maximum(np.diag(summary.start_covariance), 0.0))
    terms = np.abs(summary.partials) * spread
    if np.all(terms[list(rows)] <= ROUNDING * max(float(terms.max(initial=0.0)), 0.0)):
        return "The partial derivatives at the nominal are zero"
    return "At the nominal the partial derivatives are zero, or their contributions cancel"


def _quadratic(summary: Summary, simulated: Mapping[str, float]) -> tuple[list[str], list[str]]:
    """Split outputs into those whose dispersion second-order terms predict, and others."""
    keys, terms = summary.names, summary.second_order and summary.second_order.quadratic
    predicted = np.array(terms or np.zeros((len(keys), len(keys))), dtype=float).diagonal()
    sigma = {name: math.sqrt(max(float(predicted[keys.index(name)]), 0.0)) for name in simulated}
    matching = [name for name, quadratic in simulated.items() if abs(sigma[name] - quadratic) <= MATCHING * quadratic]
    return matching, [name for name in simulated if name not in matching]
