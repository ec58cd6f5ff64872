"""Captions of the figures of a run's report, a sentence each, from the numbers that it draws.

A sentence claims no more than the data: that something is certain where an interval says so, and otherwise what the
estimate is.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np
from scipy import special

from mcnav.analysis.comparison import correlations
from mcnav.analysis.filter_consistency import FilterConsistency
from mcnav.report.columns.requirements import RequirementRow, requirement_rows
from mcnav.report.figures import captions_over_time as over_time
from mcnav.report.figures import filter_captions
from mcnav.report.figures.matrices import certain_differences
from mcnav.report.figures.sources import contributors
from mcnav.report.format import number, rounded, signed
from mcnav.report.names import humanize, shown_units
from mcnav.report.results.kinds import planes
from mcnav.report.results.model import RunAnalysis
from mcnav.report.statements.joint import direction_words
from mcnav.report.statements.words import joined, several

TAIL: Final = 0.05
"""Share of the samples beyond a point of the chi-square distribution that is compared with what is expected."""


def words_on(name: str, content: RunAnalysis) -> str:
    """Return the sentence on a figure, by its name in `mcnav.report.pages.run.page`; empty if there is none."""
    return WORDS[name](content) if name in WORDS else ""


def _flight(content: RunAnalysis) -> str:
    """Say from where to where the first diagram goes."""
    history = content.history
    columns = history.panels[0].y if history.panels else ()
    if not columns:
        return ""
    name, _, unit = columns[0].partition(" [")
    values = np.asarray(history.columns[columns[0]], dtype=float)
    known = values[np.isfinite(values)]
    if not len(known):
        return ""
    begin, end = (f"{rounded(float(each))} {unit.removesuffix(']')}".strip() for each in known[[0, -1]])
    subject = f"{humanize(name)[:1].upper()}{humanize(name)[1:]}"
    return f"{subject} stays at {begin}." if np.ptp(known) == 0.0 else f"{subject} goes from {begin} to {end}."


def _ratios(content: RunAnalysis) -> str:
    """Say which paired intervals lie within the tolerance, across its limits, and beyond it."""
    tolerance, names = content.criterion.tolerance, content.output_names
    sides: dict[str, list[str]] = {"within": [], "across": [], "beyond": []}
    for name, output in zip(names, content.comparison.outputs, strict=True):
        ends = output.paired.interval
        if ends is None or not np.isfinite(ends).all():
            continue
        low, high = (float(end) for end in ends)
        within = 1.0 - tolerance <= low and high <= 1.0 + tolerance
        outside = high < 1.0 - tolerance or low > 1.0 + tolerance
        sides["within" if within else "beyond" if outside else "across"].append(name)
    band = f"±{100.0 * tolerance:g} %"
    if not any(sides.values()):
        return ""
    if not (sides["across"] or sides["beyond"]):
        return f"All paired ratios stay within {band}, with their intervals."
    parts = [
        f"the interval{'s' if len(some) > 1 else ''} of {several(some)} {verb[len(some) > 1]} {where} {band}"
        for some, verb, where in (
            (sides["beyond"], ("lies", "lie"), "beyond"), (sides["across"], ("reaches", "reach"), "across a limit of"),
        )
        if some
    ]  # fmt: skip
    text = "; ".join(parts)
    return f"{text[:1].upper()}{text[1:]}."


def _nees(content: RunAnalysis) -> str:
    """Compare the share of large values with that of the chi-square distribution."""
    ellipsoid = content.comparison.ellipsoid
    if ellipsoid is None or not len(ellipsoid.values):
        return ""
    limit = float(special.chdtri(ellipsoid.dimension, TAIL))
    share = float(np.mean(ellipsoid.values > limit))
    return (
        f"{100.0 * share:.3g} % of the samples have a squared distance above {rounded(limit)}; linear analysis expects "
        f"{100.0 * TAIL:g} %."
    )


def _matrices(content: RunAnalysis) -> str:
    """Name the correlation that certainly differs most."""
    certain = np.triu(certain_differences(content.comparison, content.criterion.confidence)[1], 1)
    if content.comparison.joint is None or not content.comparison.joint.correlations:
        return ""
    if not certain.any():
        return "No correlation differs from the linear one by more than its interval."
    paired, linear = (
        correlations(each) for each in (content.comparison.covariance_paired, content.comparison.covariance_linear)
    )
    apart = np.where(certain, np.abs(paired - linear), 0.0)
    i, j = np.unravel_index(int(np.argmax(apart)), apart.shape)
    names, total = content.output_names, len(content.comparison.joint.correlations)
    return (
        f"{int(certain.sum())} of {total} correlations certainly differ from the linear ones, most that of {names[i]} "
        f"and {names[j]}, by {signed(paired[i, j] - linear[i, j])} from {number(linear[i, j], 3)}."
    )


def _budget(content: RunAnalysis) -> str:
    """Name the largest share of a contributor."""
    shares = np.nan_to_num(content.budget.attributed)
    known = [contributor for contributor in contributors(content) if not contributor.other]
    if not known or not content.moving:
        return ""
    table = np.column_stack([shares[content.moving][:, each.members].sum(axis=1) for each in known])
    i, k = np.unravel_index(int(np.argmax(table)), table.shape)
    output = content.output_names[content.moving[i]]
    return f"The largest share is that of {known[k].label} in {output}: {100.0 * table[i, k]:.3g} %."


def _scatter(content: RunAnalysis) -> str:
    """Name the most correlated pair."""
    moving, names = content.moving, content.output_names
    related = np.nan_to_num(correlations(content.comparison.covariance_sample))[np.ix_(moving, moving)]
    if len(moving) < 2:
        return ""
    size = np.triu(np.abs(related), 1)
    i, j = np.unravel_index(int(np.argmax(size)), size.shape)
    value = f"{related[i, j]:.3f}".replace("-", "−")
    return f"The most correlated pair are {names[moving[i]]} and {names[moving[j]]}: {value} in the samples."


def _histograms(content: RunAnalysis) -> str:
    """Name the sample farthest from the linear mean."""
    sigma = np.sqrt(np.diag(content.comparison.covariance_linear)) * content.output_scale
    shown = [i for i in content.moving if sigma[i] > 0.0]
    if not shown or not len(content.flown):
        return ""
    away = np.abs(content.flown[:, shown] - (content.model.outcome_mean * content.output_scale)[shown]) / sigma[shown]
    row, k = np.unravel_index(int(np.argmax(away)), away.shape)
    number = int(content.index[np.isfinite(content.outputs).all(axis=1)][row])
    output = content.output_names[shown[k]]
    return f"The farthest sample, {number}, is {rounded(float(away[row, k]))} linear sigmas from the mean, in {output}."


def _quantiles(content: RunAnalysis) -> str:
    """Name the output whose skewness or kurtosis is certain; else say that none is."""
    tests = content.comparison.joint
    if tests is None or not tests.skewness:
        return ""
    confidence = content.comparison.confidence_each
    bent = [
        name
        for name, *estimates in zip(content.output_names, tests.skewness, tests.excess_kurtosis, strict=True)
        if any(not low <= 0.0 <= high for low, high in (estimate.interval(confidence) for estimate in estimates))
    ]
    if not bent:
        return "No output has a skewness or kurtosis that its interval tells from that of a normal distribution."
    return f"Skewness or kurtosis of {joined(bent)} {'is' if len(bent) == 1 else 'are'} not those of a normal " + (
        "distribution, by their intervals."
    )


def _combination(content: RunAnalysis) -> str:
    """State sigma or mean along the combination."""
    joint = content.summary.joint
    foremost = None if joint is None else joint.foremost
    if joint is None or foremost is None:
        return ""
    name = direction_words(foremost, content.summary)
    scale, unit = shown_units(content.summary)[foremost.lead]
    if joint.cause == "mean":
        return f"The mean along the {name} is off by {rounded(joint.mean_error)} linear sigmas."
    simulated, linear = (f"{rounded(each * scale)} {unit}".strip() for each in (foremost.sigma_paired,
                                                                              foremost.sigma_linear))  # fmt: skip
    return f"1σ along the {name} is {simulated} by Monte Carlo, {linear} by linear analysis."


def _tails(content: RunAnalysis) -> str:
    """Compare the methods at the limit of the requirement whose estimate is the largest share of what it allows."""
    rows = requirement_rows(content.summary, "shown", content.time_unit)
    drawn = [
        (row, tail_curve) for row, tail_curve in zip(rows, content.tail_curves, strict=False) if tail_curve is not None
    ]
    if not drawn:
        return ""

    def used(row: RequirementRow) -> float:
        known = row.entry.exceedance
        return math.inf if known is None or known.estimate is None else known.estimate / _allowed(row)

    row, curve = max(drawn, key=lambda pair: used(pair[0]))
    known, (linear, curved) = row.entry.exceedance, curve.at_limit
    parts = [f"{curve.beyond:,} of {curve.samples:,} samples lie beyond" if curve.beyond else
             f"none of {curve.samples:,} samples lies beyond"]  # fmt: skip
    if math.isfinite(linear):
        more = f", with curvature {curved:.3g}" if math.isfinite(curved) else ""
        parts.append(f"linear analysis expects {linear:.3g}{more}")
    if known is not None and known.estimate is not None:
        parts.append(f"the flights chosen give {known.estimate:.3g}, where {_allowed(row):.2g} is allowed")
    return f"At the limit of {', '.join(map(humanize, row.entry.outputs))} {'; '.join(parts)}."


def _allowed(row: RequirementRow) -> float:
    """Return the probability beyond its limits that a requirement allows."""
    return 1.0 - (0.5 if row.entry.probability is None else row.entry.probability)


def _ellipses(content: RunAnalysis) -> str:
    """State the sigmas of the first pair's truth."""
    pairs = planes(content.manifest.model.outputs)
    if not pairs:
        return ""
    sigma = np.sqrt(np.diag(content.comparison.covariance_sample)) * content.output_scale
    shown = [f"{rounded(float(sigma[pair.true]))} {content.output_units[pair.true]}" for pair in pairs[0]]
    names = [humanize(pair.name) for pair in pairs[0]]
    return f"One sigma of the truth is {shown[0]} in {names[0]} and {shown[1]} in {names[1]}, by Monte Carlo."


def _of_filter(words: Callable[[FilterConsistency], str]) -> Callable[[RunAnalysis], str]:
    return lambda content: "" if content.filter is None else words(content.filter)


WORDS: Final[dict[str, Callable[[RunAnalysis], str]]] = {
    "flight": _flight, "ratios": _ratios, "nees": _nees, "matrices": _matrices, "budget": _budget,
    "development": over_time.development, "envelopes": over_time.envelopes, "scatter": _scatter,
    "histograms": _histograms, "quantiles": _quantiles, "convergence": over_time.convergence,
    "combination": _combination, "requirements_over_time": over_time.requirements, "tails": _tails,
    "dispersion_over_time": over_time.dispersion, "landing_ellipses": _ellipses,
    "nees_history": _of_filter(filter_captions.nees_history),
    "nis_history": _of_filter(filter_captions.nis_history),
    "sigma_history": _of_filter(filter_captions.sigma_history),
    "within_history": _of_filter(filter_captions.within_history),
    "estimation": _of_filter(filter_captions.estimation),
}  # fmt: skip
"""Sentences by the names of the figures."""
