"""The linear system of a scenario: errors as a linear function of the errors going in, and of noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.products import transform
from mcnav.arrays.types import Array

Update = Literal["before", "after"] | None
"""Side of a reading, before or after an update of aiding that falls on its time; none without one."""


TRAJECTORY_TIME: Final = "time of the trajectory [s]"
"""Label of the times of a trajectory, in which campaigns state outages and requirements."""


LARGEST: Final = 1e70
"""Magnitude to which linear errors are limited: beyond the range of any output, with covariances whose squares are
finite."""


def limited(values: Array, largest: float = LARGEST) -> Array:
    """Limit values that a long divergence has let grow, as those of an inertial altitude over days."""
    return np.asarray(np.clip(values, -largest, largest)) if np.any(np.abs(values) > largest) else values


@dataclass(frozen=True)
class LinearSystem:
    """The linear system read out at rising times, r of them, the last being the end: ``nominal + partials @ errors``.

    Attributes
    ----------
    times : ndarray, shape (r,)
        In the unit of the label.
    partials : ndarray, shape (r, outputs, sources)
        SI: at each time the matrix P of NASA TN D-1772, eq. (13).
    nominal : ndarray, shape (r, outputs), optional
        Errors of a system without errors and noise; none where they are not known over time.
    processes : mapping of str to ndarray, shape (r, outputs, outputs)
        Covariance Q_j that each process of noise has added, by name.
    updates : tuple of str or None
        ``before`` or ``after`` where an update of aiding falls on the time.
    own : ndarray, shape (r, outputs, outputs), optional
        Covariance that the navigator's filter states; NaN for outputs that it does not know.
    own_outputs : tuple of int
        Numbers of the outputs that it knows.
    label : str
        What the times are, as ``name [unit]``.
    believed : mapping of str to float
        As in `FilterPrediction`.
    origin : ndarray, shape (r, outputs), optional
        What outputs are measured from: values on the nominal flight of those that are departures from it, zero of
        others; none where all are zero. A state of the truth is its origin plus its output.
    """

    times: Array
    partials: Array
    nominal: Array | None = None
    processes: Mapping[str, Array] = field(default_factory=dict)
    updates: tuple[Update, ...] = ()
    own: Array | None = None
    own_outputs: tuple[int, ...] = ()
    label: str = "time [s]"
    believed: Mapping[str, float] = field(default_factory=dict)
    origin: Array | None = None

    def __post_init__(self) -> None:
        if not self.updates:
            object.__setattr__(self, "updates", (None,) * len(self.times))
        object.__setattr__(self, "partials", limited(self.partials))
        object.__setattr__(
            self, "processes", {name: limited(added, LARGEST**2) for name, added in self.processes.items()}
        )

    @classmethod
    def at_end(
        cls, partials: Array, nominal: Array, processes: Mapping[str, Array] | None = None, time: float = np.nan
    ) -> LinearSystem:
        """Return the system of the end alone: partials of shape (outputs, sources), and so on."""
        noise = {name: process[None] for name, process in (processes or {}).items()}
        return cls(np.array([time]), partials[None], nominal[None], noise)

    @property
    def nominal_errors(self) -> Array:
        """Errors of a system without errors and noise, shape (r, outputs); zero where they are not known."""
        return np.zeros(self.partials.shape[:2]) if self.nominal is None else self.nominal

    @property
    def end(self) -> LinearModel:
        """The system at the end."""
        last = {name: process[-1] for name, process in self.processes.items()}
        origin = None if self.origin is None else self.origin[-1]
        return LinearModel(self.partials[-1], self.nominal_errors[-1], last, origin)

    def at(self, readings: NDArray[np.bool_]) -> LinearSystem:
        """Return the same at some of the readings, shape (r,)."""
        updates = tuple(update for update, taken in zip(self.updates, readings, strict=True) if taken)
        return replace(
            self,
            times=self.times[readings],
            partials=self.partials[readings],
            nominal=None if self.nominal is None else self.nominal[readings],
            origin=None if self.origin is None else self.origin[readings],
            processes={name: added[readings] for name, added in self.processes.items()},
            updates=updates,
            own=None if self.own is None else self.own[readings],
        )

    def mean(self, start: Array) -> Array:
        """Compute the mean errors at every time, shape (r, outputs), from the mean errors going in."""
        return np.asarray(self.nominal_errors + self.partials @ start)

    def covariance(self, start: Array) -> Array:
        """Compute ``P S P^T + sum Q_j`` at every time, shape (r, outputs, outputs), from the start covariance S."""
        return np.asarray(sum(self.processes.values(), transform(self.partials, start)))


@dataclass(frozen=True)
class LinearModel:
    """One reading of a linear system; shapes as those of `LinearSystem` without the first axis."""

    partials: Array
    nominal: Array
    processes: Mapping[str, Array] = field(default_factory=dict)
    origin: Array | None = None


@dataclass
class SharedTables:
    """Tables of the last scenario that was read out, for the next one along the same truth; not for several threads."""

    tables: object = None


@dataclass(frozen=True)
class CovarianceReadings:
    """Mean and covariance of the errors by the linear system at some times, r of them, after updates of aiding.

    Attributes
    ----------
    times : ndarray, shape (r,)
        In the scenario's own time, s.
    mean : ndarray, shape (r, outputs)
    covariance : ndarray, shape (r, outputs, outputs)
    own : ndarray, shape (r, outputs, outputs), optional
        As the navigator's filter states it.
    nominal, origin : ndarray, shape (r, outputs), optional
        As those of a `LinearSystem`.
    """

    times: Array
    mean: Array
    covariance: Array
    own: Array | None = None
    nominal: Array | None = None
    origin: Array | None = None
