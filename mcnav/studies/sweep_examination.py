"""Points of a sweep at which flights examine linear analysis: those that matter, and where it ceases to hold."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise, product

from mcnav.analysis.examination import Linearity
from mcnav.analysis.sweep import Point, Sweep
from mcnav.config.read import Campaign
from mcnav.studies.examined_settings import Examiner


def examine_sweep(sweep: Sweep, campaign_at: Callable[[Point], Campaign], examiner: Examiner) -> Sweep:
    """Examine where limits are just met, then the ends of each curve, or the corners, and all words.

    Between a point of a curve that holds and one that does not, further ones are examined until they are neighbours.
    """

    def look(sweep: Sweep, point: Point) -> Sweep:
        if any(point == known for known, _ in sweep.examined):
            return sweep
        examined = examiner.examine(campaign_at(point))
        if examined is None:
            return sweep
        return replace(sweep, examined=tuple(sorted((*sweep.examined, (point, examined)), key=lambda known: known[0])))

    rows, last = _rows(sweep), sweep.variables[-1]
    crossings = [
        (value,) if solved.fixed is None else (solved.fixed, value)
        for solved in sweep.just_met
        for value in solved.values
    ]
    ends = [point for row in (rows if sweep.curves else (rows[0], rows[-1]))
            for point in (row if last.words else (row[0], row[-1]))]  # fmt: skip
    for point in dict.fromkeys([*crossings, *ends]):
        sweep = look(sweep, point)
    for row in rows if sweep.curves else ():
        while (between := _between(sweep, row)) is not None:
            seen = look(sweep, between)
            if seen is sweep:
                break
            sweep = seen
    return replace(sweep, unexamined=examiner.reason)


def _rows(sweep: Sweep) -> list[list[Point]]:
    """Return the points along the last variable, a row for each value of the first."""
    *first, last = (variable.values.tolist() for variable in sweep.variables)
    return [[(*begin, value) for value in last] for begin in product(*first)]


def _between(sweep: Sweep, row: Sequence[Point]) -> Point | None:
    """Return a point halfway between one that holds and one that does not; none where they are neighbours."""
    verdicts = [(place, sweep.verdict_at(point)) for place, point in enumerate(row)]
    known = [(place, verdict == Linearity.HOLDS) for place, verdict in verdicts if verdict is not None]
    for (low, at_low), (high, at_high) in pairwise(known):
        if at_low != at_high and high > low + 1:
            return row[(low + high) // 2]
    return None
