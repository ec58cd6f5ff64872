"""Consistency of a filter over time: NEES, NIS, ratios of true to filter sigma, shares within the filter's sigmas."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array, IndexArray
from mcnav.analysis.filter_consistency import Band as Statistic
from mcnav.analysis.filter_consistency import FilterConsistency, GroupConsistency, SensorConsistency, SigmaConsistency
from mcnav.report.figures.axis_groups import Group, curves, same_unit
from mcnav.report.figures.figure import SEVERAL, Figure, side_by_side
from mcnav.report.figures.filter_errors import whole_flight
from mcnav.report.figures.marks import Axis, Band, Line, Mark, Panel, Points, Rule, Series, Span
from mcnav.report.figures.outages import outages, shading_key
from mcnav.report.figures.palette import AREA, BAND, FLOWN, INK, LINEAR, MUTED
from mcnav.report.figures.ticks import limits
from mcnav.report.filter_columns import GROUP_TITLES
from mcnav.report.model import RunAnalysis, humanize

WIDE: Final = 8.0
"""Largest over smallest value from which on an axis is logarithmic."""

USUAL: Final = 1.5
"""Largest distance of neighbouring epochs of a curve, over the median one."""

ABREAST: Final = SEVERAL + 1
"""Panels of which three stand side by side."""

FLOWN_MEAN: Final = Series("flown", "mean of all samples", FLOWN)
INTERVAL: Final = Series("interval", "its interval at each epoch", AREA, "area")
BY_LINEAR: Final = Series("linear", "linear analysis", LINEAR, "dashed")
BOUNDS: Final = Series("bounds", "bounds of a consistent filter, all epochs together", BAND, "area")
TOLERANCE: Final = Series("tolerance", "tolerance", BAND, "area")

Columns = dict[str, Sequence[Any] | NDArray[Any]]


def nees_over_time(content: RunAnalysis) -> Figure | None:
    """Draw the mean NEES of each group of states against time, with the bounds of a consistent filter."""
    figure = content.filter
    if figure is None:
        return None
    groups = [group for group in figure.groups if group.nees.known.any()]
    if not groups:
        return None
    shaded = outages(content)
    columns: Columns = {figure.label: figure.times}
    for group in groups:
        low, high = group.nees.each.T
        columns |= {f"{group_title(group)}, mean NEES": group.nees.value, f"{group_title(group)}, from": low,
                    f"{group_title(group)}, to": high}  # fmt: skip
    linear = any(group.linear is not None for group in groups)
    return Figure(
        name="nees-history",
        title="Mean NEES over time",
        description="Mean normalized estimation error squared of each group of states against the filter's own "
        "covariance, with the bounds in which it lies for a consistent filter.",
        panels=[_nees_panel(figure, group, shaded) for group in groups],
        key=[FLOWN_MEAN, INTERVAL, *([BY_LINEAR] if linear else []), BOUNDS, *shading_key(shaded)],
        columns=columns,
        size=side_by_side(len(groups), 230.0),
        caption="The NEES of a consistent filter is the number of states on average. Above the bounds the filter is "
        "optimistic, below pessimistic.",
    )


def group_title(group: GroupConsistency) -> str:
    """Name a group of states for people."""
    return GROUP_TITLES.get(group.name, humanize(group.name))


def _nees_panel(consistency: FilterConsistency, group: GroupConsistency, shaded: Sequence[Span]) -> Panel:
    linear = None if group.linear is None else group.size * group.linear**2
    low, high = group.nees.each.T
    reach = np.concatenate([group.nees.value, low, high, [] if linear is None else linear, group.bounds_together])
    return Panel(
        f"{group_title(group)}: {_counted(group.size, 'state')}",
        whole_flight(consistency),
        _upward("NEES", "", reach),
        [
            Span(BOUNDS, *group.bounds_together, level=True),
            *shaded,
            Rule(float(group.size), level=True, colour=MUTED),
            *_areas(INTERVAL, consistency.times, group.nees.each),
            *([] if linear is None else [Line(BY_LINEAR, consistency.times, linear, 1.6)]),
            *_curve(FLOWN_MEAN, consistency.times, group.nees.value),
        ],
    )


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun if number == 1 else f'{noun}s'}"


def nis_over_time(content: RunAnalysis) -> Figure | None:
    """Draw the mean NIS of each sensor between epochs, with the bounds of a consistent filter."""
    figure = content.filter
    if figure is None:
        return None
    sensors = [sensor for sensor in figure.sensors if sensor.nis.known.any()]
    if not sensors:
        return None
    shaded = {sensor.name: outages(content, [sensor.name]) for sensor in sensors}
    columns: Columns = {figure.label: figure.times}
    for sensor in sensors:
        name = humanize(sensor.name)
        columns |= {f"{name}, mean NIS": sensor.nis.value, f"{name}, bound from": sensor.bounds[:, 0],
                    f"{name}, to": sensor.bounds[:, 1], f"{name}, accepted updates": sensor.accepted,
                    f"{name}, rejected updates": sensor.rejected}  # fmt: skip
    return Figure(
        name="nis-history",
        title="Mean NIS over time",
        description="Mean normalized innovation squared of each sensor between two epochs, with the bounds in which "
        "it lies for a consistent filter.",
        panels=[_nis_panel(figure, sensor, shaded[sensor.name]) for sensor in sensors],
        key=[FLOWN_MEAN.of_kind("line"), BOUNDS, *shading_key([span for each in shaded.values() for span in each])],
        columns=columns,
        size=side_by_side(len(sensors), 230.0),
        caption="Mean over all updates since the epoch before; the NIS of a consistent filter is the number of "
        "measured components on average. Without updates there is none.",
    )


def _nis_panel(consistency: FilterConsistency, sensor: SensorConsistency, shaded: Sequence[Span]) -> Panel:
    parts = _stretches(consistency.times, np.asarray(sensor.nis.known & _known(sensor.bounds)))
    return Panel(
        f"{humanize(sensor.name)}: {_counted(sensor.size, 'component')}",
        whole_flight(consistency),
        _upward("NIS", "", np.append(sensor.nis.value, sensor.bounds.ravel())),
        [
            *(_steps(BOUNDS, consistency.times, sensor.bounds, part) for part in parts),
            *shaded,
            Rule(float(sensor.size), level=True, colour=MUTED),
            *(mark for part in parts for mark in _curve(FLOWN_MEAN, consistency.times[part], sensor.nis.value[part])),
        ],
    )


def sigma_ratios_over_time(content: RunAnalysis) -> Figure | None:
    """Draw true over filter sigma of each output, those of one unit together, against the tolerance."""
    figure = content.filter
    if figure is None:
        return None
    groups = _drawn(same_unit(figure.outputs))
    if not groups:
        return None
    shaded = outages(content)
    columns: Columns = {figure.label: figure.times}
    for each in figure.outputs:
        name = humanize(each.name)
        columns[f"{name}, true σ over filter σ"] = each.ratio.value
        columns |= {f"{name}, from": each.ratio.each[:, 0], f"{name}, to": each.ratio.each[:, 1]}
        if each.linear is not None:
            columns[f"{name}, linear analysis"] = each.linear
    linear = any(each.linear is not None for each in figure.outputs)
    tolerance = Span(TOLERANCE, 1.0 - figure.tolerance, 1.0 + figure.tolerance, level=True)

    def panel(place: int, title: str, members: Sequence[SigmaConsistency]) -> Panel:
        marks: list[Mark] = [tolerance, *shaded, Rule(1.0, level=True, colour=INK, width=1.0)]
        series = curves(place, members)
        for own, each in zip(series, members, strict=True):
            marks += _areas(own, figure.times, each.ratio.each, 0.15)
        for own, each in zip(series, members, strict=True):
            if each.linear is not None:
                marks.append(Line(own, figure.times, each.linear, 1.3, "dashed"))
            marks += _curve(own, figure.times, each.ratio.value)
        known = [np.append(each.ratio.value, each.ratio.each.ravel()) for each in members]
        upward = _upward("true σ / filter σ", "", np.concatenate([[tolerance.low, tolerance.high], *known]))
        return Panel(title, whole_flight(figure), upward, marks, series)

    return Figure(
        name="sigma-history",
        title="True sigma over the filter's sigma",
        description="Ratio of the sigma of the Monte Carlo errors to the sigma that the filter states, for each output "
        "over time, against the tolerance.",
        panels=[panel(place, *group) for place, group in enumerate(groups)],
        key=[TOLERANCE, *shading_key(shaded)],
        columns=columns,
        size=side_by_side(max(len(groups), ABREAST)),
        caption="Solid: Monte Carlo, with its interval at each epoch."
        + (" Dashed: linear analysis." if linear else "")
        + " Above one the filter is optimistic.",
    )


def shares_within(content: RunAnalysis) -> Figure | None:
    """Draw the share of samples within one and three of their own filter's sigmas, outputs of one unit together."""
    figure = content.filter
    if figure is None:
        return None
    groups = _drawn(same_unit([each for each in figure.outputs if each.within_1 and each.within_3]))
    if not groups:
        return None
    shaded = outages(content)
    columns: Columns = {figure.label: figure.times}
    panels = []
    for multiple in (1, 3):
        for place, (title, members) in enumerate(groups):
            known = [(each, statistic, bounds) for each in members
                     for statistic, bounds in [_within(each, multiple)] if statistic is not None]  # fmt: skip
            columns |= {f"{humanize(each.name)}, within ±{multiple}σ [%]": 100.0 * statistic.value
                        for each, statistic, _ in known}  # fmt: skip
            panels.append(_share_panel(figure, multiple, len(groups) * (multiple > 1) + place, title, known, shaded))
    return Figure(
        name="within-history",
        title="Share of samples within the filter's sigmas",
        description="Share of the samples whose error lies within one and three sigmas of their own filter, for each "
        "output over time, with the bounds of a consistent filter.",
        panels=panels,
        key=[BOUNDS, *shading_key(shaded)],
        columns=columns,
        size=side_by_side(max(len(panels), ABREAST), 250.0),
        caption="Of normally distributed errors 68.27 % lie within ±1σ and 99.73 % within ±3σ.",
    )


def _within(each: SigmaConsistency, multiple: int) -> tuple[Statistic | None, tuple[float, float]]:
    return (each.within_1, each.bounds_1) if multiple == 1 else (each.within_3, each.bounds_3)


def _share_panel(
    consistency: FilterConsistency,
    multiple: int,
    number: int,
    title: str,
    known: Sequence[tuple[SigmaConsistency, Statistic, tuple[float, float]]],
    shaded: Sequence[Span],
) -> Panel:
    low, high = (100.0 * known[0][2][side] for side in (0, 1))
    series = curves(number, [each for each, _, _ in known])
    lines: list[Mark] = []
    for own, (_, statistic, _) in zip(series, known, strict=True):
        lines += _curve(own, consistency.times, 100.0 * statistic.value)
    ends = _ends(np.concatenate([[low, high], *(100.0 * statistic.value for _, statistic, _ in known)]), log=False)
    return Panel(
        f"{title}, ±{multiple}σ",
        whole_flight(consistency),
        Axis(f"within ±{multiple}σ", "%", low=ends[0], high=min(ends[1], 100.0)),
        [Span(BOUNDS, low, high, level=True), *shaded, *lines],
        series,
    )


def _drawn(groups: Sequence[Group]) -> list[Group]:
    """Leave out quantities whose ratio is not known at any epoch."""
    known = [(title, tuple(each for each in members if each.ratio.known.any())) for title, members in groups]
    return [group for group in known if group[1]]


def _upward(label: str, unit: str, reach: Array) -> Axis:
    """Return the upward axis of values that are not negative: logarithmic where they differ much."""
    positive = reach[np.isfinite(reach) & (reach > 0.0)]
    log = bool(positive.size and positive.max() > WIDE * positive.min())
    low, high = _ends(reach, log)
    return Axis(label, unit, log, low, high)


def _ends(reach: Array, log: bool) -> tuple[float, float]:
    """Return the ends of an axis around values that are not negative."""
    low, high = limits(reach, log, 0.06)
    return max(low, 0.0), high


def _curve(series: Series, times: Array, values: Array) -> list[Mark]:
    """Return a curve, and points where a value has no neighbour to be joined to."""
    known = np.isfinite(values)
    beside = np.append(False, known[:-1]) | np.append(known[1:], False)
    alone = known & ~beside
    marks: list[Mark] = [Line(series, times, values, 1.7)]
    return [*marks, Points(series.of_kind("dot"), times[alone], values[alone], 4.0)] if alone.any() else marks


def _known(ends: Array) -> NDArray[np.bool_]:
    return np.asarray(np.isfinite(ends).all(axis=1))


def _runs(known: NDArray[np.bool_]) -> list[slice]:
    """Return the runs of consecutive true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(np.int8)))
    return [slice(int(begin), int(end)) for begin, end in edges.reshape(-1, 2)]


def _areas(series: Series, times: Array, ends: Array, opacity: float = 1.0) -> list[Mark]:
    """Return the areas between the ends of intervals, with gaps where there are none."""
    return [Band(series, times[run], ends[run, 0], ends[run, 1], opacity) for run in _runs(_known(ends))]


def _steps(series: Series, times: Array, ends: Array, part: IndexArray) -> Mark:
    """Return the area between the ends of intervals at some epochs, each since the one before."""
    begins = np.append(times[max(part[0] - 1, 0)], times[part[:-1]])
    across = np.column_stack([begins, times[part]]).ravel()
    return Band(series, across, np.repeat(ends[part, 0], 2), np.repeat(ends[part, 1], 2))


def _stretches(times: Array, known: NDArray[np.bool_]) -> list[IndexArray]:
    """Split the epochs at which something is known where the next one is later than usual.

    A sensor with fewer updates than there are epochs is not known at each.
    """
    places = np.flatnonzero(known)
    gaps = np.diff(times[places])
    usual = float(np.median(gaps)) if gaps.size else 0.0
    return [part for part in np.split(places, np.flatnonzero(gaps > USUAL * usual) + 1) if part.size]
