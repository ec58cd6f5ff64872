"""Figures of a sweep: curves over one variable, contours over two, with limits and Monte Carlo."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, Final

import numpy as np
from contourpy import contour_generator
from numpy.typing import NDArray

from mcnav.analysis.accuracy_measures import Measure
from mcnav.analysis.examination import Linearity
from mcnav.analysis.sweep import JustMet, Point, Sweep, Variable
from mcnav.arrays.types import Array
from mcnav.physics.units import conversion
from mcnav.report.drawing.figure import HALF, Figure, side_by_side
from mcnav.report.drawing.marks import Axis, Line, Mark, Panel, Points, Series, Text, numbered
from mcnav.report.drawing.palette import FILTER, FLOWN, INK, LINEAR, MUTED
from mcnav.report.drawing.ticks import linear_ticks
from mcnav.report.format import number

WIDE: Final = 8.0
"""Largest over smallest value from which on an axis, or the levels of contours, are logarithmic."""

LEVELS: Final = 8
"""Contours in a panel, at most."""

FEWER: Final = 6
"""Those evenly spaced, which may be close together."""

CONSTANT: Final = 1e-9
"""Relative change of a value that is rounding."""

SAME: Final = 1e-4
"""Relative difference below which the curves of a filter and of the true errors are one."""

MANTISSAS: Final = ((1.0, 1.5, 2.0, 3.0, 5.0, 7.0), (1.0, 2.0, 5.0), (1.0, 3.0), (1.0,))
"""Factors of the levels of contours, from dense to sparse."""

TRUE: Final = Series("linear", "linear analysis, true errors", LINEAR)
OWN: Final = Series("filter", "as the filter states it", FILTER)
LIMIT: Final = Series("limit", "limit", INK)
BOUNDARY: Final = Series("limit", "limit", INK)
MET: Final = Series("met", "point of the grid that meets it", MUTED, "dot")
ADDED: Final = Series("added", "value added between those of the grid", LINEAR, "dot")
SOLVED: Final = Series("solved", "limit just met, solved", INK, "dot")
DOUBTED: Final = Series("doubted", "linear analysis, not shown to hold", LINEAR, "dashed")
FAILING: Final = Series("failing", "linear analysis not shown to hold", INK, "square")
CHECKED: Final = Series("flown", "Monte Carlo", FLOWN, "ring")


def axis_of(variable: Variable) -> Axis:
    """Return the axis of a variable."""
    if variable.words:
        return Axis(variable.path, names=variable.words)
    return Axis(variable.path, variable.unit, variable.log, margin=0.02, link=variable.path)


def scales(sweep: Sweep) -> Array:
    """Return the factors from SI to the units shown, shape (measures,)."""
    return scales_of(sweep.measures)


def scales_of(measures: Sequence[Measure]) -> Array:
    """Return the factors from SI to the units shown of some measures."""
    return np.array([conversion(measure.unit, measure.shown_in) for measure in measures])


def figure(sweep: Sweep, titles: Sequence[str], columns: Mapping[str, NDArray[Any]]) -> Figure:
    """Draw all measures of a sweep, a panel each.

    Parameters
    ----------
    titles : sequence of str
        Of the measures.
    columns : mapping of str to ndarray
        The numbers behind it.
    """
    draw = _curve if len(sweep.variables) == 1 else _family if sweep.curves else _contours
    panels = [draw(sweep, number, title) for number, title in enumerate(titles)]
    return Figure(
        name="sweep",
        title="Accuracy over " + " and ".join(variable.path for variable in sweep.variables),
        description="Each measure of accuracy by linear analysis over the values that are varied, with its limit and "
        "the points at which Monte Carlo was run.",
        panels=panels,
        key=_key(sweep),
        columns=columns,
        size=side_by_side(len(panels), 300.0) if sweep.curves else (HALF[0], 330.0),
        file="sweep.csv",
    )


def _key(sweep: Sweep) -> list[Series]:
    """Return the series that some panel has."""
    limits: list[Series] = []
    along = len(sweep.variables) == 1 and not sweep.variables[0].words
    doubted = [DOUBTED if along else FAILING] if sweep.doubted else []
    if len(sweep.variables) == 2 and sweep.variables[0].words:
        limits = [LIMIT] if np.isfinite(sweep.bounds).any() else []
        solved = [SOLVED] if any(allocation.values for allocation in sweep.just_met) else []
        return [
            *(numbered(place, word) for place, word in enumerate(sweep.variables[0].words)),
            *doubted,
            *limits,
            *solved,
        ]
    if len(sweep.variables) == 1:
        limits = [LIMIT] if np.isfinite(sweep.bounds).any() else []
    elif (met := sweep.margins <= 0.0).any():
        crossed = (met & np.isfinite(sweep.margins)).any(axis=(0, 1)) & (sweep.margins > 0.0).any(axis=(0, 1))
        limits = [*([BOUNDARY] if crossed.any() else []), MET]
    checked = any(np.isfinite(confirmation.values).any() for confirmation in sweep.confirmations)
    of_words = bool(sweep.variables[0].words)
    return [
        TRUE.of_kind("dot") if of_words else TRUE,
        *doubted,
        *(
            [OWN.of_kind("dot") if of_words else OWN]
            if any(differs(sweep, index) for index in range(len(sweep.measures)))
            else []
        ),
        *limits,
        *([ADDED] if sweep.added and len(sweep.variables) == 1 else []),
        *([SOLVED] if any(allocation.values for allocation in sweep.just_met) else []),
        *([CHECKED] if checked else []),
    ]


def differs(sweep: Sweep, index: int) -> bool:
    """Return whether the filter states other values of a measure than the true ones."""
    true, own = sweep.values[..., index], sweep.own[..., index]
    known = np.isfinite(true) & np.isfinite(own)
    return bool((np.abs(own - true)[known] > SAME * np.abs(true[known])).any())


def _curve(sweep: Sweep, number: int, title: str) -> Panel:
    """Draw a measure over the only variable."""
    (variable,) = sweep.variables
    measure, scale = sweep.measures[number], scales(sweep)[number]
    values, own, bounds = (sizes[:, number] * scale for sizes in (sweep.values, sweep.own, sweep.bounds))
    marks: list[Mark] = []
    if np.isfinite(bounds).any():
        marks.append(Line(LIMIT, variable.values, bounds, 1.6))
    places = np.array([point[0] for point, _ in sweep.added])
    added = np.array([panel[number] for _, panel in sweep.added]) * scale
    order = np.argsort(np.concatenate([variable.values, places]), kind="stable")
    across, along = np.concatenate([variable.values, places])[order], np.concatenate([values, added])[order]
    if variable.words:
        marks.append(Points(TRUE.of_kind("dot"), across, along, 7.0))
        marks += _failing(sweep, number, values, variable.values)
    else:
        marks += _shown_to_hold(sweep, number, across, along)
    if len(added):
        marks.append(Points(ADDED, places, added, 2.4, 0.7))
    if differs(sweep, number):
        marks.append(
            Points(OWN.of_kind("dot"), across, own, 5.0) if variable.words else Line(OWN, variable.values, own, 1.7)
        )
    solved = [value for allocation in sweep.just_met if allocation.measure == number for value in allocation.values]
    at_solved = np.interp(variable_places(variable, solved), variable_places(variable, variable.values), bounds)
    if solved:
        texts = [f"limit just met at {plain(value)} {variable.unit}" for value in solved]
        marks.append(Points(SOLVED, solved, at_solved, 7.0, texts=texts))
    checked = np.array(
        [(confirmation.point[0], confirmation.values[number] * scale) for confirmation in sweep.confirmations]
    ).reshape(-1, 2)
    if np.isfinite(checked[:, 1]).any():
        marks.append(Points(CHECKED, checked[:, 0], checked[:, 1], 8.0))
    known = np.concatenate([along, own, bounds, checked[:, 1]])
    known = known[np.isfinite(known)]
    log = bool(len(known)) and known.min() > 0.0 and known.max() > WIDE * known.min()
    return Panel(title, axis_of(variable), Axis("", measure.shown_in, log, None if log else 0.0), marks)


def _shown_to_hold(sweep: Sweep, number: int, across: Array, along: Array) -> list[Mark]:
    """Draw a curve, dashed where linear analysis is not shown to hold."""
    held = sweep.shown_to_hold([(float(value),) for value in across], number)
    near = ~held | np.append(~held[1:], False) | np.append(False, ~held[:-1])
    dashed = [Line(DOUBTED, across, np.where(near, along, np.nan), 2.2, "dashed")] if near.any() else []
    return [Line(TRUE, across, np.where(held, along, np.nan), 2.2), *dashed]


def _failing(sweep: Sweep, number: int, values: Array, across: Array, begin: Point = ()) -> list[Mark]:
    """Mark the points along the last variable at which linear analysis is not shown to hold."""
    held = sweep.shown_to_hold([(*begin, float(value)) for value in across], number)
    return [] if held.all() else [Points(FAILING, across[~held], values[~held], 6.0)]


def _family(sweep: Sweep, number: int, title: str) -> Panel:
    """Draw a measure over the second variable, a curve for each word of the first."""
    first, variable = sweep.variables
    measure, scale = sweep.measures[number], scales(sweep)[number]
    values, bounds = (sizes[..., number] * scale for sizes in (sweep.values, sweep.bounds))
    marks: list[Mark] = []
    if np.isfinite(bounds).any():
        marks.append(Line(LIMIT, variable.values, bounds[0], 1.6))
    for place, word in enumerate(first.words):
        series = numbered(place, word)
        line = Points(series, variable.values, values[place], 7.0) if variable.words else None
        marks.append(line or Line(series, variable.values, values[place], 2.0))
        marks += _failing(sweep, number, values[place], variable.values, (float(place),))
    solved = [
        (allocation.fixed, value)
        for allocation in sweep.just_met
        if allocation.measure == number
        for value in allocation.values
    ]
    if solved:
        at = [float(np.interp(variable_places(variable, [value])[0], variable_places(variable, variable.values),
                              bounds[int(fixed or 0)])) for fixed, value in solved]  # fmt: skip
        just_met = "limit just met at"
        texts = [f"{first.words[int(word or 0)]}: {just_met} {plain(value)} {variable.unit}" for word, value in solved]
        marks.append(Points(SOLVED, [value for _, value in solved], at, 7.0, texts=texts))
    known = np.concatenate([values.ravel(), bounds.ravel()])
    known = known[np.isfinite(known)]
    log = bool(len(known)) and known.min() > 0.0 and known.max() > WIDE * known.min()
    return Panel(title, axis_of(variable), Axis("", measure.shown_in, log, None if log else 0.0), marks)


def plain(value: float) -> str:
    """Format a value to four digits without zeros at its end.

    >>> plain(0.5), plain(12.3456), plain(2e-7)
    ('0.5', '12.35', '2.000·10⁻⁷')
    """
    text = number(value, 4)
    return text.rstrip("0").rstrip(".") if "." in text and "·" not in text else text


def variable_places(variable: Variable, values: Any) -> Array:
    """Return the places of values along an axis, which are logarithms on a logarithmic one."""
    places = np.asarray(values, dtype=float)
    return np.asarray(np.log(places) if variable.log else places)


def _contours(sweep: Sweep, index: int, title: str) -> Panel:
    """Draw a measure over two variables as lines of equal values."""
    across, up = sweep.variables
    measure, scale = sweep.measures[index], scales(sweep)[index]
    values, own = sweep.values[..., index] * scale, sweep.own[..., index] * scale
    levels = contour_levels(values)
    marks: list[Mark] = []
    for level in levels:
        lines = contour_lines(across, up, values, level)
        marks += [Line(TRUE, x, y, 1.5) for x, y in lines]
        if differs(sweep, index):
            marks += [Line(OWN, x, y, 1.2) for x, y in contour_lines(across, up, own, level)]
        if lines:
            x, y = max(lines, key=lambda line: len(line[0]))
            middle = len(x) // 2
            marks.append(Text(plain(level), float(x[middle]), float(y[middle]), colour=LINEAR))
    margins = sweep.margins[..., index]
    if np.isfinite(margins).any():
        i, j = np.nonzero(margins <= 0.0)
        marks.append(Points(MET, across.values[i], up.values[j], 2.4, 0.7))
        refined, at_refined = boundary_table(sweep, index)
        marks += [Line(BOUNDARY, x, y, 3.0) for x, y in contour_lines(across, refined, at_refined, 0.0, False)]
    solved = [
        (allocation.fixed, value)
        for allocation in sweep.just_met
        if allocation.measure == index
        for value in allocation.values
    ]
    if solved:
        x, y = np.array(solved, dtype=float).T
        marks.append(Points(SOLVED, x, y, 6.5))
    checked = [confirmation for confirmation in sweep.confirmations if np.isfinite(confirmation.values[index])]
    if checked:
        texts = [f"Monte Carlo {number(float(check.values[index] * scale))} {measure.shown_in}" for check in checked]
        x, y = np.array([check.point for check in checked]).T
        marks.append(Points(CHECKED, x, y, 8.0, texts=texts))
    failing = [point for point, _ in sweep.examined if sweep.verdict_at(point, index) not in (None, Linearity.HOLDS)]
    if failing:
        x, y = np.array(failing).T
        marks.append(Points(FAILING, x, y, 6.5))
    corners = ([across.values[0], across.values[-1]], [up.values[0], up.values[-1]])
    marks.append(Line(TRUE, *corners, 0.0, silent=True))  # the axes reach over the whole grid
    unit = f" [{measure.shown_in}]" if measure.shown_in else ""
    return Panel(f"{title}{unit}", axis_of(across), axis_of(up), marks)


def boundary_table(sweep: Sweep, index: int) -> tuple[Variable, Array]:
    """Return margins over two variables that vanish where a limit is just met, and the second one with these values.

    Between the points of the grid a margin is no straight line: its zero is not where the limit is just met. The values
    at which it is, found along the second variable, are therefore added to the grid, and halfway between two that no
    point of the grid parts a margin of the right sign.
    """
    across, up = sweep.variables
    margins, places = sweep.margins[..., index], variable_places(up, up.values)
    curves = []
    for column, value in enumerate(across.values):
        just_met = [
            allocation for allocation in sweep.just_met if allocation.measure == index and allocation.fixed == value
        ]
        zeros = [variable_places(up, [at])[0] for allocation in just_met for at in allocation.values]
        nodes = dict(zip(places.tolist(), margins[column].tolist(), strict=True)) | dict.fromkeys(zeros, 0.0)
        size = float(np.nanmax(np.abs(margins[column]), initial=0.0))
        for low, high in pairwise(sorted(zeros)):
            if not ((places > low) & (places < high)).any():
                middle = 0.5 * (low + high)
                nodes[middle] = -size if _is_met(just_met, float(np.exp(middle) if up.log else middle)) else size
        curves.append(nodes)
    every = np.array(sorted(set().union(*curves)))
    table = [np.interp(every, sorted(nodes), [nodes[place] for place in sorted(nodes)]) for nodes in curves]
    return replace(up, values=np.exp(every) if up.log else every), np.array(table)


def _is_met(just_met: Sequence[JustMet], value: float) -> bool:
    """Return whether a value lies in a span in which a limit is met."""
    spans = [span for allocation in just_met for span in allocation.met]
    return any((begin is None or begin <= value) and (end is None or value <= end) for begin, end in spans)


def contour_levels(values: Array) -> list[float]:
    """Choose round levels within the range of some values.

    >>> contour_levels(np.array([0.9, 120.0]))
    [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0]
    """
    known = values[np.isfinite(values)]
    if not len(known):
        return []
    low, high = float(known.min()), float(known.max())
    if high - low <= CONSTANT * max(abs(low), abs(high)):
        return []
    if low <= 0.0 or high <= 2.0 * low:
        return [tick for tick in linear_ticks(low, high, FEWER)[0] if low < tick < high]
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    levels: list[float] = []
    for mantissas in MANTISSAS:
        every = (float(f"{mantissa}e{power}") for power in powers for mantissa in mantissas)
        levels = [level for level in every if low < level < high]
        if len(levels) <= LEVELS:
            break
    return levels


def contour_lines(
    across: Variable, up: Variable, values: Array, level: float, positive: bool = True
) -> list[tuple[Array, Array]]:
    """Find the lines on which values, shape (n, m), are equal to a level, as pairs of coordinates.

    Between the points of the grid values are interpolated along the axes, those that are ``positive`` by logarithm.
    """
    log = positive and bool(np.nanmin(values) > 0.0)
    z = np.log(values) if log else values
    if not np.isfinite(z).any() or min(values.shape) < 2:
        return []
    masked = np.ma.masked_invalid(z.T)
    result = contour_generator(variable_places(across, across.values), variable_places(up, up.values), masked)
    back_x, back_y = (np.exp if sizes.log else np.asarray for sizes in (across, up))
    lines: Any = result.lines(float(np.log(level)) if log else level)
    return [(back_x(line[:, 0]), back_y(line[:, 1])) for line in lines]
