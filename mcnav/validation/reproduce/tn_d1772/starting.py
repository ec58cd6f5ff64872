"""When to start, for all seven trajectories: the report answers for trajectory 4, with one measure, in one set of axes.

Final altitude error against the start of navigation, by two measures (the report's sum of absolute values, and the root
sum of squares of independent errors) and in two sets of coordinates (p. 17, figures 10 and 11). In polar rates an
altitude error leaves radial and angular rate as they are. In speed and flight-path angle it leaves V and gamma as they
are, so that an altitude error dr is an error of the angular rate as well:

    r' = V sin gamma,   r theta' = V cos gamma,   d(r theta') = -theta' dr   for dV = dgamma = 0.

Speed and angle errors are of the sizes that the report's rate errors, taken as independent, give them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import pandas as pd

from mcnav.arrays.types import Array
from mcnav.report.drawing.figure import THIRD, Figure
from mcnav.report.drawing.marks import Axis, Line, Mark, Panel, Points, Series, Span
from mcnav.report.drawing.palette import BAND, INK, MUTED
from mcnav.report.figures.start_times import REENTRY, START
from mcnav.systems.reentry.instruments import Error
from mcnav.systems.reentry.table_i import COLUMNS, ERRORS, TABLE_I
from mcnav.validation.reproduce.tn_d1772.printed import trajectories
from mcnav.validation.reproduce.tn_d1772.tables import table_i_scenario

STEP: Final = 0.5
"""Minutes from one start to the next."""

ADVISED: Final = (-30.0, -20.0)
"""The report's advice, minutes from reentry."""

COORDINATES: Final = ("polar rates", "speed and angle")
MEASURES: Final = ("sum", "root sum of squares")

TRACKED: Final = 0.1
"""Initial errors by radio tracking as a share of the report's: "roughly an order of magnitude" smaller (p. 13)."""

SHRUNK: Final = 1.0 / 3.0
"""Altitude error near reentry as a share of that an hour before: "several times smaller" (p. 18), by the least."""

INITIAL: Final = 4


@dataclass(frozen=True)
class Starts:
    """Effects of the report's ten errors on final altitude by start time.

    Attributes
    ----------
    minutes : ndarray, shape (n,)
        Start times from reentry, the last one zero.
    effects : ndarray, shape (n, 10)
        Of independent errors in the polar state, km.
    converted : ndarray, shape (n, 10)
        Of independent errors in radius, range angle, speed and flight-path angle, km.
    """

    number: int
    minutes: Array
    effects: Array
    converted: Array

    def effects_in(self, coordinates: str) -> Array:
        """Return the effects in one of `COORDINATES`."""
        return self.effects if coordinates == COORDINATES[0] else self.converted

    def curve(self, coordinates: str, measure: str) -> Array:
        """Combine the effects by one of `MEASURES`, shape (n,), km."""
        return combine(self.effects_in(coordinates), measure)

    def at(self, minutes: float) -> int:
        """Return the place of the start nearest to a time."""
        return int(np.abs(self.minutes - minutes).argmin())


def combine(effects: Array, measure: str) -> Array:
    """Add up effects, shape (n, errors), by one of `MEASURES`."""
    summed = np.abs(effects).sum(axis=1) if measure == MEASURES[0] else np.sqrt((effects**2).sum(axis=1))
    return np.asarray(summed)


def in_speed_and_angle(partials: Array, states: Array) -> Array:
    """Change partial derivatives by the polar state into those by (r, range, V, V dgamma), shape (n, outputs, 4).

    Parameters
    ----------
    partials : ndarray, shape (n, outputs, 4)
        By radius, range, radial rate and r theta', SI.
    states : ndarray, shape (n, 4)
        Actual polar states at the starts.
    """
    radius, _, climb, rate = states.T
    speed = np.hypot(climb, radius * rate)
    sine, cosine = climb / speed, radius * rate / speed
    changed = partials.copy()
    changed[..., 0] -= rate[:, None] * partials[..., 3]
    changed[..., 2] = sine[:, None] * partials[..., 2] + cosine[:, None] * partials[..., 3]
    changed[..., 3] = cosine[:, None] * partials[..., 2] - sine[:, None] * partials[..., 3]
    return changed


def speed_and_angle_sizes(states: Array) -> tuple[Array, Array]:
    """Return sigmas of V and of V gamma, m/s, shape (n,) each, by the report's rate errors as independent ones."""
    radius, _, climb, rate = states.T
    sizes = ERRORS[Error.ALTITUDE_RATE], ERRORS[Error.RANGE_RATE]
    speed = np.hypot(climb, radius * rate)
    sine, cosine = climb / speed, radius * rate / speed
    return np.hypot(sine * sizes[0], cosine * sizes[1]), np.hypot(cosine * sizes[0], sine * sizes[1])


@lru_cache
def starts(number: int) -> Starts:
    """Compute the effects for a trajectory of Table I, with starts from its first point to reentry."""
    scenario = table_i_scenario(number)
    trajectory = scenario.trajectory
    minutes = np.arange(-np.floor(trajectory.reentry_time / 60.0 / STEP), 1.0) * STEP
    partials = scenario.partials_at(60.0 * minutes, "start")[:, :1, COLUMNS]
    states = trajectory.states(trajectory.reentry_time + 60.0 * minutes)
    converted = partials.copy()
    converted[..., :INITIAL] = in_speed_and_angle(partials[..., :INITIAL], states)
    sizes = np.tile(ERRORS, (len(minutes), 1))
    sizes[:, 2], sizes[:, 3] = speed_and_angle_sizes(states)
    return Starts(number, minutes, partials[:, 0] * ERRORS / 1e3, converted[:, 0] * sizes / 1e3)


def sum_at(number: int, seconds: float) -> float:
    """Return the report's measure for a start at a time from reentry, km, in polar rates.

    >>> [round(sum_at(number, -3.0), 1) for number in (1, 2, 3)]
    [6.4, 11.2, 26.0]
    """
    effects = table_i_scenario(number).partials_at(np.array([seconds]), "start")[0, 0, COLUMNS] * ERRORS
    return float(np.abs(effects).sum() / 1e3)


def start_times() -> pd.DataFrame:
    """Tabulate final altitude by trajectory, start, coordinates and measure, km, and the altitude error's own part."""
    frames = []
    for number in TABLE_I:
        computed = starts(number)
        table: dict[str, object] = {"trajectory": number, "start [min from reentry]": computed.minutes}
        for coordinates in COORDINATES:
            table |= {f"{measure}, {coordinates} [km]": computed.curve(coordinates, measure) for measure in MEASURES}
            table[f"altitude error alone, {coordinates} [km]"] = computed.effects_in(coordinates)[:, Error.ALTITUDE]
        frames.append(pd.DataFrame(table))
    return pd.concat(frames, ignore_index=True)


def figure_16(frame: pd.DataFrame) -> Figure:
    """Draw both measures in both coordinates, a panel for each trajectory."""
    colours = dict(zip(COORDINATES, (INK, MUTED), strict=True))
    kinds = dict(zip(MEASURES, ("line", "dashed"), strict=True))
    series = {
        (coordinates, measure): Series(
            f"{measure}-{coordinates}".replace(" ", "-"),
            f"{measure}, {coordinates}",
            colours[coordinates],
            kinds[measure],
        )
        for coordinates in COORDINATES
        for measure in MEASURES
    }
    least = Series("least", "least", INK, "triangle")
    advised = Series("advised", "the report's advice", BAND, "area")

    def panel(number: int, flight: pd.DataFrame) -> Panel:
        start = flight["start [min from reentry]"].to_numpy()
        marks: list[Mark] = [Span(advised, *ADVISED, text="the report's advice", opacity=0.6)]
        highest = max(flight[f"{measure}, {coordinates} [km]"].max() for coordinates, measure in series)
        for (coordinates, measure), line in series.items():
            curve = flight[f"{measure}, {coordinates} [km]"].to_numpy()
            best = int(curve.argmin())
            marks += [
                Line(line, start, curve),
                Points(least, [start[best]], [curve[best] + 0.02 * highest], 8.0),
            ]
        title = f"Trajectory {number}, {float(trajectories()[number]['final_range_km']):,.0f} km"
        return Panel(title, START, Axis("altitude error", "km", low=0.0), [*marks, REENTRY])

    return Figure(
        name="tn-16",
        title="When to start: every trajectory",
        description="Final altitude error against the start of navigation for the seven trajectories, by two measures "
        "and in two sets of coordinates. Triangles point at the least.",
        panels=[panel(int(str(number)), flight) for number, flight in frame.groupby("trajectory")],
        key=(*series.values(), least, advised),
        columns=dict(frame.items()),
        size=(THIRD[0], 240.0),
        caption="Not in the report, which has the sum in polar rates for trajectory 4. In speed and angle, an initial "
        "altitude error leaves speed and flight-path angle as they are.",
        file="figure_16.csv",
    )


@dataclass(frozen=True)
class Advice:
    """Best start of a trajectory by one measure in one set of coordinates; minutes from reentry, km."""

    number: int
    coordinates: str
    measure: str
    best: float
    least: float
    early: float
    reentry: float


def advice(frame: pd.DataFrame) -> list[Advice]:
    """Find the best starts of each trajectory in the table of `start_times`.

    ``early`` is the altitude error of a start at -22 min.
    """
    rows = []
    for number, flight in frame.groupby("trajectory"):
        minutes = flight["start [min from reentry]"].to_numpy()
        early = int(np.abs(minutes + 22.0).argmin())
        for coordinates in COORDINATES:
            for measure in MEASURES:
                curve = flight[f"{measure}, {coordinates} [km]"].to_numpy()
                best = int(curve.argmin())
                values = (minutes[best], curve[best], curve[early], curve[-1])
                rows.append(Advice(int(str(number)), coordinates, measure, *map(float, values)))
    return rows


def time_in_words(minutes: float) -> str:
    """Name a start time.

    >>> time_in_words(0.0), time_in_words(-24.5)
    ('at reentry', '24.5 min before reentry')
    """
    return "at reentry" if minutes == 0.0 else f"{-minutes:g} min before reentry"


def sentence(rows: Sequence[Advice]) -> str:
    """Say when to start a trajectory, from its four rows of `advice`: the report's measure and coordinates first."""
    first, squares, converted, converted_squares = (time_in_words(row.best) for row in rows)
    report = rows[0]
    contrast = f"{report.early:.1f} km at −22 min"
    contrast += f", {report.reentry:.1f} km at reentry" if report.best < 0.0 else ""
    answer = f"Trajectory {report.number}: start {first} ({report.least:.1f} km; {contrast})."
    if len({row.best for row in rows}) == 1:
        return f"{answer} Both measures and both sets of coordinates agree."
    return (
        f"{answer} By the root sum of squares, start {squares}. In speed and angle, start {converted} by the sum and "
        f"{converted_squares} by the root sum of squares."
    )
