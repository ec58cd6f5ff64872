"""Normalized errors of a filter over time: mean NEES by groups of states, mean NIS by sensor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.filter_consistency import FilterConsistency, GroupConsistency, SensorConsistency
from mcnav.report.columns.filter_columns import GROUP_TITLES
from mcnav.report.drawing.figure import Figure, side_by_side
from mcnav.report.drawing.gapped import areas, curve, known_ends, steps, stretches, upward
from mcnav.report.drawing.marks import Line, Panel, Rule, Series, Span
from mcnav.report.drawing.palette import AREA, BAND, FLOWN, LINEAR, MUTED
from mcnav.report.figures.filter_errors import whole_flight
from mcnav.report.figures.outages import outages, shading_key
from mcnav.report.names import humanize
from mcnav.report.results.model import RunAnalysis

FLOWN_MEAN: Final = Series("flown", "Monte Carlo", FLOWN)
INTERVAL: Final = Series("interval", "its interval", AREA, "area")
BY_LINEAR: Final = Series("linear", "linear", LINEAR)
BOUNDS: Final = Series("bounds", "if consistent", BAND, "area")

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
        description="Mean normalized estimation error squared (NEES) of each group of states against the filter's "
        "covariance, with the bounds of a consistent filter.",
        panels=[_nees_panel(figure, group, shaded) for group in groups],
        key=[FLOWN_MEAN, INTERVAL, *([BY_LINEAR] if linear else []), BOUNDS, *shading_key(shaded)],
        columns=columns,
        size=side_by_side(len(groups), 230.0),
        caption="A consistent filter stays within the bounds, which hold for all epochs together. Above: optimistic.",
    )


def group_title(group: GroupConsistency) -> str:
    """Name a group of states for people."""
    return GROUP_TITLES.get(group.name, humanize(group.name))


def _nees_panel(consistency: FilterConsistency, group: GroupConsistency, shaded: Sequence[Span]) -> Panel:
    linear = None if group.linear is None else group.size * group.linear**2
    low, high = group.nees.each.T
    reach = np.concatenate([group.nees.value, low, high, [] if linear is None else linear, group.bounds_together])
    return Panel(
        f"{group_title(group)}: {group.size}",
        whole_flight(consistency),
        upward("NEES", "", reach),
        [
            Span(BOUNDS, *group.bounds_together, level=True),
            *shaded,
            Rule(float(group.size), level=True, colour=MUTED),
            *areas(INTERVAL, consistency.times, group.nees.each),
            *([] if linear is None else [Line(BY_LINEAR, consistency.times, linear, 1.6)]),
            *curve(FLOWN_MEAN, consistency.times, group.nees.value),
        ],
        about=(group.name,),
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
        caption="Mean over all updates since the epoch before.",
    )


def _nis_panel(consistency: FilterConsistency, sensor: SensorConsistency, shaded: Sequence[Span]) -> Panel:
    parts = stretches(consistency.times, np.asarray(sensor.nis.known & known_ends(sensor.bounds)))
    return Panel(
        f"{humanize(sensor.name)}: {_counted(sensor.size, 'component')}",
        whole_flight(consistency),
        upward("NIS", "", np.append(sensor.nis.value, sensor.bounds.ravel())),
        [
            *(steps(BOUNDS, consistency.times, sensor.bounds, part) for part in parts),
            *shaded,
            Rule(float(sensor.size), level=True, colour=MUTED),
            *(mark for part in parts for mark in curve(FLOWN_MEAN, consistency.times[part], sensor.nis.value[part])),
        ],
    )
