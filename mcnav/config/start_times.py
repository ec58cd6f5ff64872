"""The table ``[start_times]`` of a campaign file: what ``mcnav start-times`` is to study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from mcnav._types import Array
from mcnav.config.schema import StartTimesTable
from mcnav.errors import Problem, suggestion
from mcnav.lincov.start_times import ErrorSchedule
from mcnav.sampling.distributions import Distribution
from mcnav.scenarios.protocol import Output, Source
from mcnav.units import UnitError, quantity


@dataclass(frozen=True)
class StartTimesPlan:
    """What to study.

    Attributes
    ----------
    count : int
        Start times.
    axes : str
        Convention of the reference axes.
    check : tuple of float
        Start times that Monte Carlo is to check, s from the scenario's event; some are chosen when empty.
    samples : int
        Of each check.
    weights : ndarray, optional
        See `mcnav.lincov.start_times.StartTimeStudy`.
    schedule : ErrorSchedule
    """

    count: int
    axes: str
    check: tuple[float, ...]
    samples: int
    weights: Array | None
    schedule: ErrorSchedule


def read_start_times(
    table: StartTimesTable,
    file: str,
    sources: Sequence[Source],
    outputs: Sequence[Output],
    distributions: Mapping[str, Distribution],
    problems: list[Problem],
) -> StartTimesPlan:
    """The plan that a table describes; mistakes are added to the list."""
    weights = _read_weights(table.weights, file, outputs, problems)
    multiples = {}
    names = [source.name for source in sources]
    for name, entries in table.errors.items():
        key = f"start_times.errors.{name}"
        if name not in names:
            problems.append(Problem(file, key, f"unknown error source{suggestion(name, names)}"))
            continue
        stated = distributions.get(name)
        size = 0.0 if stated is None else stated.standard_deviation or abs(stated.mean)
        if size == 0.0:
            problems.append(Problem(file, key, "changes an error that [errors] does not have; state it there first"))
            continue
        points = _read_points(entries, sources[names.index(name)], file, key, problems)
        if points is not None:
            multiples[names.index(name)] = (points[:, 0], points[:, 1] / size)
    return StartTimesPlan(table.count, table.axes, tuple(table.check), table.samples, weights, ErrorSchedule(multiples))


def _read_weights(
    entries: Mapping[str, Any], file: str, outputs: Sequence[Output], problems: list[Problem]
) -> Array | None:
    """One over the sigma that counts as one unit of harm, for each output; zero for an output left out."""
    if not entries:
        return None
    known = {output.name: output for output in outputs}
    weights = dict.fromkeys(known, 0.0)
    for name, entry in entries.items():
        key = f"start_times.weights.{name}"
        if name not in known:
            problems.append(Problem(file, key, f"unknown output{suggestion(name, list(known))}"))
            continue
        try:
            worth = quantity(entry, known[name].unit)
        except UnitError as wrong:
            problems.append(Problem(file, key, str(wrong)))
            continue
        if worth <= 0.0:
            problems.append(Problem(file, key, f"got {entry!r}; expected a sigma greater than zero"))
            continue
        weights[name] = 1.0 / worth
    return np.array(list(weights.values()))


def _read_points(entries: list[Any], source: Source, file: str, key: str, problems: list[Problem]) -> Array | None:
    """Rows (time, one sigma) in SI units, or none when something is wrong with them."""
    points = []
    for number, entry in enumerate(entries, start=1):
        if not isinstance(entry, list) or len(entry) != 2:
            problems.append(Problem(file, f"{key} #{number}", 'expected a pair ["start time", "one sigma"]'))
            return None
        try:
            points.append((quantity(entry[0], "s"), quantity(entry[1], source.unit)))
        except UnitError as wrong:
            problems.append(Problem(file, f"{key} #{number}", str(wrong)))
            return None
        if points[-1][1] < 0.0:
            problems.append(Problem(file, f"{key} #{number}", f"got {entry[1]!r}; expected a sigma of at least zero"))
            return None
    if any(later[0] <= earlier[0] for earlier, later in pairwise(points)):
        problems.append(Problem(file, key, "expected start times in rising order"))
        return None
    return np.array(points)
