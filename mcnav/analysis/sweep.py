"""A sweep as a report shows it: variables, measures of accuracy at every point, and where limits are just met."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.accuracy_measures import Measure
from mcnav.analysis.examination import Examination, Linearity, combine
from mcnav.analysis.mean_errors import UNDISTURBED, in_sigmas
from mcnav.analysis.summary import Summary
from mcnav.arrays.types import Array
from mcnav.contract.quantities import Output
from mcnav.physics.ranges import written

Point = tuple[float, ...]
"""Values of the variables, in their units."""

Span = tuple[float | None, float | None]
"""Begin and end of an interval of values; none at an end of the range."""


@dataclass(frozen=True)
class Variable:
    """A key of a campaign and its values.

    Attributes
    ----------
    path : str
        As `mcnav.config.overrides` reads it.
    values : ndarray, shape (n,)
        Rising, in the unit.
    unit : str
        As written; empty for pure numbers.
    log : bool
        Whether the axis is logarithmic.
    words : tuple of str
        Values that are no numbers, such as grades: ``values`` are then their numbers from zero on.
    """

    path: str
    values: Array
    unit: str
    log: bool
    words: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """Path and unit, such as ``imu.gyro.bias [deg/h]``."""
        return f"{self.path} [{self.unit}]" if self.unit else self.path

    def written(self, value: float) -> str | int | float:
        """Return a value as a campaign file has it; a whole number without a unit is an integer."""
        if self.words:
            return self.words[int(value)]
        return written(value, self.unit)

    def along(self, value: float) -> float:
        """Return the place of a value on the axis: its logarithm on a logarithmic one."""
        return math.log(value) if self.log else value

    def at(self, place: float) -> float:
        """Return the value at a place on the axis."""
        return math.exp(place) if self.log else place


@dataclass(frozen=True)
class JustMet:
    """A value of a variable at which a limit is met.

    Attributes
    ----------
    measure : int
        Number of the measure.
    fixed : float or None
        Value of the first variable, where the second one is varied.
    values : tuple of float
        At which the limit is just met, rising; empty if it is met, or not, at every value looked at.
    met : tuple of Span
        Intervals in which it is met; one without begin and end if it is met at every value looked at.
    looked_at : int
        Values that were looked at, those of the grid and those added between them.
    closest : (float, float) or None
        Value looked at with the smallest margin, and the margin.
    whole : bool
        Whether values were added until no crossing can hide; see `mcnav.analysis.curve_refinement`.
    """

    measure: int
    fixed: float | None
    values: tuple[float, ...]
    met: tuple[Span, ...]
    looked_at: int = 0
    closest: tuple[float, float] | None = None
    whole: bool = True

    @property
    def throughout(self) -> bool:
        """Return whether the limit is met at every value looked at."""
        return self.met == ((None, None),)


@dataclass(frozen=True)
class Confirmation:
    """Monte Carlo at a point.

    Attributes
    ----------
    place : tuple of int
        Of the point in the grid.
    point : tuple of float
        Values of the variables.
    folder : Path
        Run folder.
    summary : mapping
        The content of its ``summary.json``.
    values : ndarray, shape (measures,)
        Paired estimates of sigmas and DRMS at the end, Monte Carlo estimates of requirements; SI, NaN for others.
    """

    place: tuple[int, ...]
    point: Point
    folder: Path
    summary: Summary
    values: Array


@dataclass(frozen=True)
class Sweep:
    """A sweep of one variable with n values, or of two with n and m: its shape is (n,) or (n, m).

    Attributes
    ----------
    campaign : str
        Its name.
    times : tuple of (float or None)
        Time of each measure, in the trajectory's time, s; none for the end or the epochs of a requirement.
    values, own : ndarray, shape (n, [m,] measures)
        Of the true errors, infinite where they are beyond the range of linear analysis, and as the filter states them
        (NaN without one); SI.
    bounds, margins : ndarray, shape (n, [m,] measures)
        At which a limit is just met, and the logarithm of the value over it (of a probability the other way round);
        NaN without a limit.
    present : ndarray, shape (measures,)
        Values of the campaign as it is.
    added : tuple of (Point, ndarray)
        Points looked at besides those of the grid, in order, with their values, shape (measures,), SI.
    exceedances : ndarray, shape (n, [m,] measures), or None
        Linear probability beyond the limits of requirements that allow little, NaN of other measures; see
        `mcnav.analysis.accuracy_measures.Measure.beyond`.
    means : ndarray, shape (n, [m,] measures), or None
        Mean errors in the values of sigmas, which are root mean squares; SI.
    examined : tuple of (Point, Examination)
        Points at which flights have examined linear analysis, in order.
    unexamined : str
        Why others that matter were not examined, a clause; empty where all were.
    gates : str
        What gates do by rejecting good measurements, in words, where linear analysis does not hold for that; then no
        limit is judged.
    remarks : tuple of str
        What is to be noticed, a sentence each: at which setting other ranges are, and what holds at some values.
    """

    campaign: str
    outputs: tuple[Output, ...]
    variables: tuple[Variable, ...]
    measures: tuple[Measure, ...]
    times: tuple[float | None, ...]
    values: Array
    own: Array
    bounds: Array
    margins: Array
    present: Array
    just_met: tuple[JustMet, ...]
    confirmations: tuple[Confirmation, ...] = ()
    added: tuple[tuple[Point, Array], ...] = ()
    exceedances: Array | None = None
    means: Array | None = None
    gates: str = ""
    examined: tuple[tuple[Point, Examination], ...] = ()
    unexamined: str = ""
    remarks: tuple[str, ...] = ()

    @property
    def curves(self) -> bool:
        """Return whether measures are curves over the last variable, and not contours over two."""
        return len(self.variables) == 1 or bool(self.variables[0].words)

    def verdict(self, examined: Examination, measure: int) -> Linearity | None:
        """Return the verdict on a measure; of one at another time than the end none, unless the end does not hold."""
        chosen = self.measures[measure]
        verdict = examined.verdict_on(chosen.members or chosen.outputs)
        at_end = self.times[measure] is None and not chosen.readings
        return verdict if at_end or verdict == Linearity.FAILS else None

    def verdict_at(self, point: Point, measure: int | None = None) -> Linearity | None:
        """Return the verdict on a measure, or on all, at a point; none where it was not examined."""
        examined = dict(self.examined).get(point)
        if examined is None:
            return None
        measures = range(len(self.measures)) if measure is None else [measure]
        verdicts = [verdict for index in measures if (verdict := self.verdict(examined, index)) is not None]
        return combine(verdicts) if verdicts else None

    @property
    def doubted(self) -> bool:
        """Return whether linear analysis is not shown to hold at a point that was examined."""
        return any(self.verdict_at(point) not in (None, Linearity.HOLDS) for point, _ in self.examined)

    def shown_to_hold(self, row: Sequence[Point], measure: int) -> NDArray[np.bool_]:
        """Tell where a curve is as good as it was examined, shape (points,): not beside a point that does not hold.

        Between two points that hold, and where nothing was examined beside, it is.
        """
        verdicts = [self.verdict_at(point, measure) for point in row]
        known = [place for place, verdict in enumerate(verdicts) if verdict is not None]
        held = np.ones(len(row), dtype=bool)
        for place in range(len(row)):
            beside = [*[k for k in known if k <= place][-1:], *[k for k in known if k >= place][:1]]
            held[place] = all(verdicts[k] == Linearity.HOLDS for k in beside)
        return held

    @property
    def mean_shares(self) -> Array:
        """Mean errors over the sigmas beside them, shape (n, [m,] measures); zero where there is none but rounding."""
        if self.means is None:
            return np.zeros_like(self.values)
        means = np.abs(np.nan_to_num(self.means))
        for index, measure in enumerate(self.measures):
            alike = [k for k, other in enumerate(self.measures) if other.unit == measure.unit]
            values = self.values[..., alike]
            largest = np.max(values, where=np.isfinite(values), initial=0.0)
            means[..., index] *= means[..., index] > UNDISTURBED * largest
        sigmas = np.sqrt(np.maximum(np.nan_to_num(self.values, posinf=0.0) ** 2 - means**2, 0.0))
        return in_sigmas(means, sigmas)

    def has_mean(self, measure: int) -> bool:
        """Return whether the mean error of a measure exceeds one sigma at some point."""
        return bool((self.mean_shares[..., measure] > 1.0).any())

    def rare(self, measure: int) -> bool:
        """Return whether the probability beyond the limits of a measure is known at a point."""
        return self.exceedances is not None and bool(np.isfinite(self.exceedances[..., measure]).any())

    @property
    def shape(self) -> tuple[int, ...]:
        """Numbers of values of the variables."""
        return self.values.shape[:-1]
