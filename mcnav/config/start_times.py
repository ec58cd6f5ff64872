"""The table ``[start_times]`` of a campaign file: the plan of ``mcnav sweep --vary start``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from mcnav.arrays.types import Array
from mcnav.config.schema import StartTimesTable
from mcnav.config.sources import KnownSources
from mcnav.contract.quantities import Output, Source
from mcnav.entries.context import FileContext
from mcnav.errors import suggestion
from mcnav.linear.start_times import ErrorSchedule
from mcnav.sampler.distributions import Distribution


@dataclass(frozen=True)
class StartTimesPlan:
    """A study of start times.

    Attributes
    ----------
    count : int
        Number of start times.
    axes : str
        Convention of the reference axes.
    check : tuple of float
        Start times that Monte Carlo checks, s from the scenario's event; chosen by the study when empty.
    samples : int
        Samples of each check.
    weights : ndarray, optional
        See `mcnav.linear.start_times.StartTimeStudy`.
    """

    count: int
    axes: str
    check: tuple[float, ...]
    samples: int
    weights: Array | None
    schedule: ErrorSchedule


def read_start_times(
    table: StartTimesTable,
    known: KnownSources,
    outputs: Sequence[Output],
    distributions: Mapping[str, Distribution],
    context: FileContext,
) -> StartTimesPlan:
    """Read the plan; mistakes are added to the context."""
    sources = known.sources
    weights = _read_weights(table.weights, outputs, context)
    multiples = {}
    names = [source.name for source in sources]
    for name, entries in table.errors.items():
        key = f"start_times.errors.{name}"
        if name not in names:
            if not known.may_be(name):
                context.problem(key, f"unknown error source{suggestion(name, names)}")
            continue
        stated = distributions.get(name)
        if stated is None and name in context.content.get("errors", ()):
            continue  # its entry is wrong itself
        size = 0.0 if stated is None else stated.standard_deviation or abs(stated.mean)
        if size == 0.0:
            context.problem(key, "changes an error that [errors] does not have; state it there first")
            continue
        points = _read_points(entries, sources[names.index(name)], key, context)
        if points is not None:
            multiples[names.index(name)] = (points[:, 0], points[:, 1] / size)
    return StartTimesPlan(table.count, table.axes, tuple(table.check), table.samples, weights, ErrorSchedule(multiples))


def _read_weights(entries: Mapping[str, Any], outputs: Sequence[Output], context: FileContext) -> Array | None:
    """Return 1 / sigma for each output, with the sigma that counts as one unit of harm; 0 for an output left out."""
    if not entries:
        return None
    units = {output.name: output.unit for output in outputs}
    weights = dict.fromkeys(units, 0.0)
    for name, entry in entries.items():
        key = f"start_times.weights.{name}"
        if name not in units:
            context.problem(key, f"unknown output{suggestion(name, list(units))}")
            continue
        sigma = context.quantity(entry, units[name], key)
        if sigma is not None and sigma <= 0.0:
            context.problem(key, f"got {entry!r}; expected a sigma greater than zero")
        elif sigma is not None:
            weights[name] = 1.0 / sigma
    return np.array(list(weights.values()))


def _read_points(entries: list[list[Any]], source: Source, key: str, context: FileContext) -> Array | None:
    """Read rows (time, one sigma) in SI units; None when there is a mistake."""
    points = []
    for number, entry in enumerate(entries, start=1):
        at = f"{key} #{number}"
        time, sigma = context.quantity(entry[0], "s", at), context.quantity(entry[1], source.unit, at)
        if time is None or sigma is None:
            return None
        if sigma < 0.0:
            context.problem(at, f"got {entry[1]!r}; expected a sigma of at least zero")
            return None
        points.append((time, sigma))
    if any(later[0] <= earlier[0] for earlier, later in pairwise(points)):
        context.problem(key, "expected start times in rising order")
        return None
    return np.array(points)
