"""A sweep in words: measures, where limits are met, whether Monte Carlo confirms it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.accuracy_measures import BOX, DRMS, SIGMA, Measure
from mcnav.analysis.curve_refinement import MOST_ADDED
from mcnav.analysis.examination import Linearity, combine
from mcnav.analysis.sweep import Confirmation, JustMet, Point, Span, Sweep, Variable
from mcnav.report.columns.output_columns import output_rows
from mcnav.report.columns.result_table import Row
from mcnav.report.figures import sweep as drawn
from mcnav.report.format import number, signed
from mcnav.report.names import humanize
from mcnav.report.statements.words import several

OPTIMISTIC: Final = 1.05
"""Ratio of a true value to that of the filter from which it is stated."""

KINDS: Final = {"cep": "CEP", "r95": "R95", "sep": "SEP"}


def title_of(measure: Measure, sweep: Sweep, long: bool = False) -> str:
    """Name a measure for people; ``long`` with its limit."""
    names = [humanize(sweep.outputs[place].name) for place in measure.outputs]
    together = names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
    when = sweep.times[sweep.measures.index(measure)]
    written = measure.name.partition(" <")[0].partition(" at ")[0].partition("(")[0]
    if measure.kind == SIGMA:
        title = f"{together}, {'root mean square' if sweep.has_mean(sweep.measures.index(measure)) else '1σ'}"
    elif measure.kind == DRMS:
        title = f"{humanize(written)}, DRMS" if written != DRMS else f"DRMS of {together}"
    elif measure.kind in KINDS:
        title = f"{KINDS[measure.kind]} of {together}"
    elif measure.kind == BOX:
        title = f"share of {together} within their limits"
    else:
        title = f"{100.0 * measure.probability:g} % of |{together}|"
    at = f" at {when:g} s" if when is not None else ""
    if measure.requirement is not None and ") " in measure.name:
        at = f", {measure.name.partition(') ')[2]}"
    return f"{title}{at}" + (f", {limit_words(measure)}" if long and measure.limits else "")


def limit_words(measure: Measure) -> str:
    """State the limit of a measure."""
    if measure.kind == BOX:
        return f"at least {100.0 * measure.probability:g} %"
    (scale,) = drawn.scales_of([measure])
    return f"at most {drawn.plain(measure.limits[0] * scale)} {measure.shown_in}"


def shown(variable: Variable, value: float) -> str:
    """Write a value of a variable with its unit."""
    if variable.words:
        return variable.words[int(value)]
    return f"{drawn.plain(value)} {variable.unit}".strip()


def met_words(just_met: JustMet, variable: Variable) -> str:
    """Say where a limit is met."""
    if just_met.throughout:
        return f"met at {looked_at_words(just_met)}{closest_words(just_met, variable)}"
    if not just_met.met:
        return f"not met at {looked_at_words(just_met, False)}{closest_words(just_met, variable)}"
    if variable.words:
        return f"met at {', '.join(shown(variable, place) for place, _ in just_met.met if place is not None)}"
    spans = []
    for begin, end in just_met.met:
        if begin is None and end is not None:
            spans.append(f"up to {shown(variable, end)}")
        elif begin is not None and end is None:
            spans.append(f"from {shown(variable, begin)} on")
        elif begin is not None and end is not None:
            spans.append(f"from {shown(variable, begin)} to {shown(variable, end)}")
    return f"met {' and '.join(spans)}"


def looked_at_words(just_met: JustMet, met: bool = True) -> str:
    """Say how many values were looked at."""
    if not just_met.looked_at:
        return "every value looked at" if met else "any value looked at"
    return f"{'all' if met else 'any of the'} {just_met.looked_at:,} values looked at"


def closest_words(just_met: JustMet, variable: Variable) -> str:
    """Say where a limit that is not crossed is closest, and by which factor it is missed or kept there."""
    if just_met.closest is None or not math.isfinite(just_met.closest[1]):
        return ""
    value, margin = just_met.closest
    factor = f"a factor of {math.exp(abs(margin)):.3g}"
    return f"; closest at {shown(variable, value)}, {f'off by {factor}' if margin > 0.0 else f'with {factor} to spare'}"


def tone_of(just_met: JustMet) -> str:
    """Return the tone of a limit: met throughout, nowhere, or in part of the range."""
    return "agrees" if just_met.throughout else "partly" if just_met.met else "differs"


NOT_SIMULATED: Final = "All values are by linear analysis. --confirm N runs Monte Carlo at N points."


NAMED: Final = 3
"""Points that are named."""


def at_words(sweep: Sweep, points: Sequence[Point], among: Sequence[Point]) -> str:
    """Name some of several points by the values of the variables; those from one on together.

    Parameters
    ----------
    among : sequence of Point
        All of them, in order.
    """
    if len(sweep.variables) == 1 and len(points) > 1 and not sweep.variables[0].words:
        (variable,) = sweep.variables
        if list(points) == list(among[-len(points) :]):
            return f"from {variable.path} = {shown(variable, points[0][0])} on"
        return f"at {variable.path} = {several([shown(variable, point[0]) for point in points], NAMED)}"
    return f"at {several([_point_words(sweep, point) for point in points], NAMED)}"


def _point_words(sweep: Sweep, point: Point) -> str:
    return ", ".join(f"{variable.path} = {shown(variable, value)}"
                     for variable, value in zip(sweep.variables, point, strict=True))  # fmt: skip


def examined_words(sweep: Sweep) -> str:
    """Say at how many points flights have examined linear analysis, and where it is not shown to hold."""
    more = f"Others were not examined: {sweep.unexamined}. --examine does it."
    if not sweep.examined:
        return f"Linear analysis was not examined: {sweep.unexamined}. --examine does it." if sweep.unexamined else ""
    count = len(sweep.examined)
    begin = f"Linear analysis, tested with a few simulated flights at {count} point{'s' * (count > 1)}"
    verdicts = {point: sweep.verdict_at(point) for point, _ in sweep.examined}
    said = [
        f"{verdict.value} {at_words(sweep, points, list(verdicts))}"
        for verdict in (Linearity.FAILS, Linearity.UNKNOWN)
        if (points := [point for point, own in verdicts.items() if own == verdict])
    ]
    if not said:
        known = any(own is not None for own in verdicts.values())
        words = "holds at each" if known else "fails at none at the end; other times are not examined"
        return f"{begin}: {words}.{f' {more}' if sweep.unexamined else ''}"
    worst = _worst_ratio(sweep)
    return f"{begin}: {'. It '.join(said)}.{worst}{f' {more}' if sweep.unexamined else ''}"


def _worst_ratio(sweep: Sweep) -> str:
    """Name the output whose sigma is farthest from the linear one; empty where no verdict says so."""
    chosen = {output for measure in sweep.measures for output in measure.members or measure.outputs}
    failing = [
        (abs(math.log(row.ratio)), sweep.outputs[number].name, row.ratio, point)
        for point, examined in sweep.examined
        for number, row in enumerate(examined.outputs)
        if number in chosen and row.verdict == Linearity.FAILS and row.ratio > 0.0
    ]
    if not failing:
        return ""
    _, name, ratio, point = max(failing)
    return f" Worst is {humanize(name)}, true sigma about {ratio:.2f} times, at {_point_words(sweep, point)}."


def doubt_of(sweep: Sweep, just_met: JustMet) -> str:
    """Say that linear analysis is not shown to hold where a limit is just met, or looked at; empty where it is."""
    fixed = () if just_met.fixed is None else (just_met.fixed,)
    points = [(*fixed, value) for value in just_met.values] or [
        point for point, _ in sweep.examined if not fixed or point[:1] == fixed
    ]
    verdicts = [verdict for point in points if (verdict := sweep.verdict_at(point, just_met.measure)) is not None]
    worst = combine(verdicts)
    if worst == Linearity.HOLDS:
        return ""
    return f"linear analysis {worst.value}{' there' if just_met.values else ' in part of the range'}"


def headline(sweep: Sweep) -> tuple[str, str]:
    """State where the limits are met; return the words and their tone, which Monte Carlo may take back."""
    if not sweep.just_met:
        return _unlimited_headline(sweep), ""
    words, tone = _linear_headline(sweep)
    refuted = sweep.confirmations and confirmed_words(sweep)[1] == "differs"
    where, _, closest = words.partition("; closest at ")
    nearest = f". It is closest at {closest}" if closest else ""
    doubts = sorted({doubt for solved in sweep.just_met if (doubt := doubt_of(sweep, solved))}, reverse=True)
    doubt = f". But {doubts[0]}: simulate it" if doubts else ""
    return f"By linear analysis: {where}{nearest}{doubt}", "undecided" if refuted or doubts else tone


def _unlimited_headline(sweep: Sweep) -> str:
    """State how far the first measure goes along a variable, where none has a limit."""
    varied = " and ".join(variable.path for variable in sweep.variables)
    values, (first, *_) = sweep.values[..., 0], sweep.measures
    if len(sweep.variables) > 1 or sweep.variables[0].words or not np.isfinite(values).all():
        return f"Accuracy by linear analysis over {varied}"
    (scale,) = drawn.scales_of([first])
    (variable,) = sweep.variables
    low, high = (f"{number(float(value) * scale, 3)} {first.shown_in}".strip() for value in (values[0], values[-1]))
    begin, end = (shown(variable, float(variable.values[place])) for place in (0, -1))
    return f"By linear analysis {title_of(first, sweep)}: {low} at {varied} = {begin}, {high} at {end}"


def _from_to(sweep: Sweep) -> str:
    """Say over which values a sweep goes: from end to end of numbers."""
    ends = (
        ""
        if variable.words
        else f" from {shown(variable, float(variable.values[0]))} to {shown(variable, float(variable.values[-1]))}"
        for variable in sweep.variables
    )
    return " and ".join(f"for {variable.path}{span}" for variable, span in zip(sweep.variables, ends, strict=True))


def _linear_headline(sweep: Sweep) -> tuple[str, str]:
    tones = [tone_of(allocation) for allocation in sweep.just_met]
    *first, last = sweep.variables
    if len(sweep.just_met) == 1:
        (only,) = sweep.just_met
        return f"{title_of(sweep.measures[only.measure], sweep, True)}: {met_words(only, last)}", tones[0]
    over = " and ".join(variable.path for variable in sweep.variables)
    if set(tones) == {"agrees"}:
        return f"every limit is met {_from_to(sweep)}", "agrees"
    if set(tones) == {"differs"}:
        return f"no limit is met {_from_to(sweep)}", "differs"
    if first:
        return f"limits are met in part of the range of {over}", "partly"
    together = common_spans(sweep)
    if together is None:
        return f"limits are met in parts of the range of {over}", "partly"
    words = met_words(JustMet(0, None, (), together), last)
    return f"all limits together are {words}: {over}", tone_of(JustMet(0, None, (), together))


def common_spans(sweep: Sweep) -> tuple[Span, ...] | None:
    """Return the interval in which all limits along one variable are met; none if one has several intervals."""
    low, high = -np.inf, np.inf
    for allocation in sweep.just_met:
        if len(allocation.met) > 1 or (allocation.met and sweep.variables[-1].words):
            return None
        if not allocation.met:
            return ()
        begin, end = allocation.met[0]
        low, high = max(low, -np.inf if begin is None else begin), min(high, np.inf if end is None else end)
    if low >= high:
        return ()
    return ((None if low == -np.inf else low, None if high == np.inf else high),)


def mean_words(sweep: Sweep) -> str:
    """Say where a mean error exceeds its sigma the most; empty where none does."""
    ratios = sweep.mean_shares
    if sweep.means is None or not (ratios > 1.0).any():
        return ""
    *place, index = np.unravel_index(int(np.argmax(ratios)), ratios.shape)
    measure, (scale,) = sweep.measures[int(index)], drawn.scales_of([sweep.measures[int(index)]])
    values = [variable.values[number] for variable, number in zip(sweep.variables, place, strict=True)]
    at = ", ".join(f"{v.path} = {shown(v, value)}" for v, value in zip(sweep.variables, values, strict=True))
    mean, ratio = float(sweep.means[(*place, index)]) * scale, float(ratios[(*place, index)])
    points = int((ratios > 1.0).any(axis=-1).sum())
    against = "more than a million times its sigma" if math.isinf(ratio) else f"{number(ratio, 3)} times its sigma"
    name = humanize(sweep.outputs[measure.outputs[0]].name)
    return (
        f"At {points} of {ratios[..., 0].size} points a mean error exceeds its sigma: that of {name} is "
        f"{signed(mean)} {measure.shown_in} at {at}, {against}. Root mean squares are compared, not sigmas."
    )


def remarks(sweep: Sweep) -> list[str]:
    """List what must be known of the numbers: points without an answer, measures that a variable does not change."""
    result = [] if sweep.confirmations or not sweep.just_met else [NOT_SIMULATED]
    if words := examined_words(sweep):
        result.append(words)
    result += sweep.remarks
    if sweep.gates:
        result.append(f"{sweep.gates}. No limit is judged.")
    if outside := int(np.isinf(sweep.values).any(axis=-1).sum()):
        points = "1 point" if outside == 1 else f"{outside} points"
        result.append(f"At {points} errors are beyond the range of linear analysis: no value there, and no limit met.")
    missing = int(np.isnan(sweep.values).any(axis=-1).sum())
    if missing:
        points = "1 point has" if missing == 1 else f"{missing} points have"
        result.append(f"{points} no linear answer: a covariance loses its definiteness there.")
    if np.isfinite(sweep.own).any() and not any(drawn.differs(sweep, index) for index in range(len(sweep.measures))):
        result.append("At every point the filter's own values are the true ones.")
    result += _of_filter(sweep)
    if any(not allocation.whole for allocation in sweep.just_met):
        result.append(
            "Some limits are known at the values looked at alone: those between them have no answer, or more than "
            f"{MOST_ADDED} would be needed."
        )
    for axis, variable in enumerate(sweep.variables):
        still = _unchanged(sweep, axis)
        names = [title_of(measure, sweep) for measure, same in zip(sweep.measures, still, strict=True) if same]
        if names:
            every = len(names) == len(sweep.measures)
            of = "every measure" if every else ", ".join(names)
            result.append(f"At all values of {variable.path} that were looked at {of} is the same.")
    return result


def _unchanged(sweep: Sweep, axis: int) -> NDArray[np.bool_]:
    """Return which measures are the same at all values of a variable that were looked at, shape (measures,)."""
    values = sweep.values
    if len(sweep.variables) == 1:
        values = np.vstack([values, *(added for _, added in sweep.added)])
    known = np.isfinite(values)
    low, high = np.where(known, values, np.inf).min(axis=axis), np.where(known, values, -np.inf).max(axis=axis)
    same = known.any(axis=axis) & (high - low <= drawn.CONSTANT * np.abs(high))
    return np.asarray(same.all(axis=tuple(range(same.ndim - 1))))


def _of_filter(sweep: Sweep) -> list[str]:
    """State the largest ratio of a true value to that of the filter, if it is optimistic."""
    ratios = np.divide(sweep.values, sweep.own, out=np.ones_like(sweep.values), where=sweep.own > 0.0)
    ratios[..., [measure.falls for measure in sweep.measures]] = 1.0
    ratios[~np.isfinite(ratios)] = 1.0
    place = np.unravel_index(int(np.argmax(ratios)), ratios.shape)
    if ratios[place] <= OPTIMISTIC:
        return []
    values = [variable.values[number] for variable, number in zip(sweep.variables, place, strict=False)]
    at = ", ".join(f"{v.path} = {shown(v, value)}" for v, value in zip(sweep.variables, values, strict=True))
    name = title_of(sweep.measures[int(place[-1])], sweep)
    return [f"The filter is optimistic by a factor of up to {ratios[place]:.3g}: {name}, at {at}."]


def disagreements(sweep: Sweep, confirmation: Confirmation) -> list[str]:
    """List the requirements on which a run and linear analysis find the opposite."""
    names = []
    for index, measure in enumerate(sweep.measures):
        if measure.requirement is None:
            continue
        finding = confirmation.summary.requirements[measure.requirement].finding
        linear = linear_finding(sweep, (*confirmation.place, index))
        if {finding, linear} == {"met", "not met"}:
            names.append(f"{title_of(measure, sweep)}: linear analysis finds it {linear}, Monte Carlo {finding}")
    return names


def linear_finding(sweep: Sweep, place: tuple[int, ...]) -> str:
    """Return what linear analysis finds on a requirement at a point; undecided where gates let it judge none."""
    margin = sweep.margins[place]
    return "undecided" if np.isnan(margin) else "met" if margin <= 0.0 else "not met"


def confirmation_rows(sweep: Sweep, confirmation: Confirmation) -> list[Row]:
    """List the paired estimates of the outputs that the measures are of."""
    concerned = {sweep.outputs[place].name for measure in sweep.measures for place in measure.outputs}
    rows = output_rows({"": confirmation.summary})
    return [row for row in rows if row["output"] in concerned]


def verdict_at(sweep: Sweep, confirmation: Confirmation) -> str:
    """Return the verdict of Monte Carlo on the outputs and requirements of a sweep at a point."""
    verdicts = [row["verdict"] for row in confirmation_rows(sweep, confirmation)]
    if "differs" in verdicts or disagreements(sweep, confirmation):
        return "differs"
    if confirmation.summary.unsettled or not verdicts or set(verdicts) & {"undecided", None}:
        return "undecided"
    return "agrees"


def confirmed_words(sweep: Sweep) -> tuple[str, str]:
    """State whether Monte Carlo confirms the linear answers; return the words and their tone."""
    count = len(sweep.confirmations)
    verdicts = [verdict_at(sweep, confirmation) for confirmation in sweep.confirmations]
    if wrong := verdicts.count("differs"):
        where = f"{wrong} of {count} points: do not rely on the linear numbers there"
        return f"Monte Carlo disagrees with linear analysis at {where}", "differs"
    if undecided := verdicts.count("undecided"):
        where = f"{undecided} of {count} points whether linear analysis holds: more samples would"
        return f"Monte Carlo does not decide at {where}", "undecided"
    joint = sum(confirmation.summary.verdict_matrix == "differs" for confirmation in sweep.confirmations)
    words = f"Monte Carlo agrees with linear analysis at all {count} points where it was run"
    if others := sum(confirmation.summary.verdict == "differs" for confirmation in sweep.confirmations):
        return f"{words}. Other outputs differ at {others} of them", "partly"
    if joint:
        return f"{words}. The full covariance matrix differs at {joint} of them", "partly"
    return words, "agrees"


def point_words(sweep: Sweep, confirmation: Confirmation, paths: bool = False) -> str:
    """Describe a point by the values of the variables, with their paths or without."""
    values = [shown(variable, value) for variable, value in zip(sweep.variables, confirmation.point, strict=True)]
    if paths:
        values = [f"{variable.path} = {value}" for variable, value in zip(sweep.variables, values, strict=True)]
    return ", ".join(values)
