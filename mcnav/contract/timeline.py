"""The timeline of a system: its linear transitions, from which every linear answer is computed.

X has n states: deviations of the truth, errors of the navigator, its memory, biases of the processes of noise. c has
the s error sources and a last element 1, which stands for what is deterministic: faults and nominal innovations. w_j
and v_j belong to process j. A timeline has T transitions, each a step or an update::

    step     X+ = A X + B c + sum_j w_j              w_j has the covariance Q_j
    update   n  = H X + D c + sum_j v_j              X+ = X - M K n;  v_j has independent components
    reading  y  = C X

A *position* is a place between two transitions, from 0 (the start) to T (the end). What is read "before" and "after" an
update is read at two positions. Where there is a filter, it computes, with its own F, Q, H_f and R_f::

    step     P+ = F P F' + Q
    update   S = H_f P H_f' + R_f      K = P H_f' S^-1, zero for states not corrected      P+ by Joseph's form

and its states have the true errors ``z = W X + E c``, in the sign of ``n = H_f z + v`` for a filter that knows the
truth. Gains are not part of a timeline: one timeline serves every tuning and every start.

Steps are guidance, corrections and kinks as well: whatever is linear and measures nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.rows import Table
from mcnav.arrays.types import Array, IndexArray


def _check_shape(name: str, table: Table | IndexArray | NDArray[np.bool_], expected: tuple[int, ...]) -> None:
    if table.shape != expected:
        raise ValueError(f"{name}: got shape {table.shape}, expected {expected}")


@dataclass(frozen=True)
class StepNoise:
    """Noise that a process adds to r of the states in k steps: a covariance, or a factor G of it with ``Q = G G'``.

    Attributes
    ----------
    rows : ndarray of int, shape (r,)
        The states.
    covariance : ndarray, shape (k, r, r), optional
    factor : ndarray, shape (k, r, c), optional
        Of c independent standard normals.
    """

    rows: IndexArray
    covariance: Array | None = None
    factor: Array | None = None

    def __post_init__(self) -> None:
        if (self.covariance is None) == (self.factor is None):
            raise ValueError("noise of a step: give either covariance or factor")

    @property
    def covariances(self) -> Array:
        """Q of each step, shape (k, r, r), whichever is given."""
        if self.factor is not None:
            return np.asarray(self.factor @ self.factor.swapaxes(1, 2))
        assert self.covariance is not None
        return self.covariance


@dataclass(frozen=True)
class Steps:
    """Some steps in order, k of them.

    Attributes
    ----------
    transitions : ndarray, shape (k, n, n)
        A.
    inputs : ndarray, shape (k, n, s + 1)
        B.
    noise : mapping of str to StepNoise
        By process; processes that add nothing may be absent.
    """

    transitions: Array
    inputs: Array
    noise: Mapping[str, StepNoise] = field(default_factory=dict)

    def __post_init__(self) -> None:
        count, states = self.transitions.shape[:2]
        _check_shape("steps.transitions", self.transitions, (count, states, states))
        _check_shape("steps.inputs", self.inputs, (count, states, self.inputs.shape[-1]))


@dataclass(frozen=True)
class Updates:
    """All updates in order, U of them, with at most M components; what is beyond a size is zero.

    The engine asks for the rows of a few updates at a time, which may be computed then (`mcnav.arrays.rows.Rows`).

    Attributes
    ----------
    sizes : ndarray of int, shape (U,)
        Components of each.
    responses : ndarray or Rows, shape (U, M, n)
        H.
    disturbances : ndarray or Rows, shape (U, M, s + 1)
        D.
    variances : mapping of str to ndarray or Rows, shape (U, M)
        Of v_j by process; processes that add nothing may be absent.
    """

    sizes: IndexArray
    responses: Table
    disturbances: Table
    variances: Mapping[str, Table] = field(default_factory=dict)

    def __post_init__(self) -> None:
        count, most = self.responses.shape[:2]
        _check_shape("updates.sizes", self.sizes, (count,))
        _check_shape("updates.disturbances", self.disturbances, (count, most, self.disturbances.shape[-1]))
        for name, variances in self.variances.items():
            _check_shape(f"updates.variances of {name}", variances, (count, most))

    def between(self, first: int, last: int) -> Updates:
        """Return the updates from the first to before the last."""
        variances = {name: table[first:last] for name, table in self.variances.items()}
        return Updates(self.sizes[first:last], self.responses[first:last], self.disturbances[first:last], variances)

    @classmethod
    def none(cls, states: int, sources: int) -> Updates:
        """Return no updates, of n states and s sources."""
        return cls(np.zeros(0, dtype=np.int64), np.zeros((0, 0, states)), np.zeros((0, 0, sources + 1)))


@dataclass(frozen=True)
class Start:
    """The start of a navigator at a position.

    Attributes
    ----------
    partials : ndarray, shape (n, s + 1)
        Of X to c.
    noise : mapping of str to ndarray, shape (n, n)
        Covariance of X by process; processes that have none there may be absent.
    constants : ndarray, shape (s + 1, s + 1), optional
        E, where a start there makes other constants of the sources: transitions after it have ``E c`` in place of c.
    filter_covariance : ndarray, shape (f, f), optional
        P there; none where it is that of the filter's own start.
    """

    partials: Array
    noise: Mapping[str, Array] = field(default_factory=dict)
    constants: Array | None = None
    filter_covariance: Array | None = None


@dataclass(frozen=True)
class Instants:
    """Times at which a timeline can be read, K + 1 of them.

    Attributes
    ----------
    times : ndarray, shape (K + 1,)
        Rising, s.
    before, after : ndarray of int, shape (K + 1,)
        Positions before and after the updates and corrections at each time; the same where there are none.
    """

    times: Array
    before: IndexArray
    after: IndexArray

    def __post_init__(self) -> None:
        _check_shape("instants.before", self.before, self.times.shape)
        _check_shape("instants.after", self.after, self.times.shape)


def add_up_noise(noise: Mapping[str, StepNoise], sizes: Mapping[str, float], count: int, states: int) -> Array:
    """Add up what all processes add in k steps to n states, each of its size, shape (k, n, n)."""
    total = np.zeros((count, states, states))
    for name, added in noise.items():
        if (size := sizes.get(name, 1.0)) == 0.0 or not len(added.rows):
            continue
        covariances = added.covariances if size == 1.0 else size * added.covariances
        first, last = int(added.rows[0]), int(added.rows[-1]) + 1
        if np.array_equal(added.rows, np.arange(first, last)):
            total[:, first:last, first:last] += covariances
        else:
            total[:, added.rows[:, None], added.rows] += covariances
    return total


@dataclass(frozen=True)
class FilterSteps:
    """Some steps of a filter in order, k of them.

    Attributes
    ----------
    transitions : ndarray, shape (k, f, f)
        F.
    noise : mapping of str to StepNoise
        What Q adds up, by process as the filter knows them.
    """

    transitions: Array
    noise: Mapping[str, StepNoise] = field(default_factory=dict)

    @classmethod
    def of(cls, transitions: Array, noise: Array) -> FilterSteps:
        """Return steps whose noise is that of one process: F and Q, shape (k, f, f)."""
        return cls(transitions, {"all": StepNoise(np.arange(noise.shape[1]), noise)})


@dataclass(frozen=True)
class TimelineFilter:
    """A filter of f states along a timeline, with the same steps and updates.

    Attributes
    ----------
    steps : callable
        From the first and past the last number of steps to those.
    responses : ndarray or Rows, shape (U, M, f)
        H_f.
    variances : ndarray or Rows, shape (U, M)
        The diagonal of R_f.
    covariance : ndarray, shape (f, f)
        P at the start.
    corrected : ndarray, shape (f,)
        1 for estimated states, 0 for considered ones, whose rows of K are zero.
    place : ndarray, shape (n, f)
        M: what an update does to X is ``-M K n``.
    true_errors : callable
        From a position to W and E, shapes (f, n), (f, s + 1).
    sizes : mapping of str to float
        As those of a timeline, for the noise of the filter's steps.
    """

    steps: Callable[[int, int], FilterSteps]
    responses: Table
    variances: Table
    covariance: Array
    corrected: Array
    place: Array
    true_errors: Callable[[int], tuple[Array, Array]]
    sizes: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        count, most, size = self.responses.shape
        _check_shape("filter.variances", self.variances, (count, most))
        _check_shape("filter.covariance", self.covariance, (size, size))
        _check_shape("filter.corrected", self.corrected, (size,))
        _check_shape("filter.place", self.place, (len(self.place), size))


@dataclass(frozen=True)
class Timeline:
    """Linear transitions of a system, from its start to its end.

    The least that a system states is ``start``, ``is_update``, ``steps``, ``instants`` and ``readout``: it then has a
    budget over time, start times and rows for rare events. With a filter it has gains, the filter's own covariance,
    NEES, gates, faults and a smoother.

    Attributes
    ----------
    start : Start
        At position 0.
    is_update : ndarray of bool, shape (T,)
        The order: whether each transition is an update, or a step. Steps and updates are numbered in this order.
    steps : callable
        From the first and past the last number of steps to those, in memory for a while only.
    instants : Instants
    readout : callable
        From a position and its time to C, shape (outputs, n).
    processes : tuple of str
        Names of the processes of noise, in order.
    biases : mapping of str to ndarray of int
        States by process that no other process moves, directly or through others. The covariance of a process is kept
        on these and on the states that are nobody's.
    updates : Updates
    filter : TimelineFilter, optional
    begin : callable, optional
        From a position to the start of a navigator there; none where it cannot start later.
    refined : callable, optional
        From rising times to the same timeline with these among its instants; none where instants are all there are.
    sizes : mapping of str to float
        Variances that multiply the noise of steps and starts by process, one where absent. Timelines that differ in
        sizes, in variances of updates, and in their filter's covariance and variances are *tunings* of one another,
        which the engine answers in one pass where they share ``steps``, the filter's ``steps`` and the updates'
        ``responses``.
    """

    start: Start
    is_update: NDArray[np.bool_]
    steps: Callable[[int, int], Steps]
    instants: Instants
    readout: Callable[[int, float], Array]
    processes: tuple[str, ...] = ()
    biases: Mapping[str, IndexArray] = field(default_factory=dict)
    updates: Updates | None = None
    filter: TimelineFilter | None = None
    begin: Callable[[int], Start] | None = None
    refined: Callable[[Array], Timeline] | None = None
    sizes: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        count = 0 if self.updates is None else len(self.updates.sizes)
        if int(self.is_update.sum()) != count:
            raise ValueError(f"is_update: has {int(self.is_update.sum())} updates, expected {count}")
        measured = {} if self.updates is None else self.updates.variances
        named = {*self.start.noise, *self.biases, *self.sizes, *measured}
        if unknown := named - set(self.processes):
            raise ValueError(f"processes: {sorted(unknown)} are not among {list(self.processes)}")
        if self.updates is not None:
            sized = self.updates.responses.shape[:2]
            _check_shape("updates.responses", self.updates.responses, (*sized, self.states))
            _check_shape("updates.disturbances", self.updates.disturbances, (*sized, self.sources + 1))
            if self.filter is not None:
                _check_shape("filter.place", self.filter.place, (self.states, len(self.filter.covariance)))
                _check_shape("filter.variances", self.filter.variances, self.updates.responses.shape[:2])

    @property
    def states(self) -> int:
        """Number n of states."""
        return len(self.start.partials)

    @property
    def sources(self) -> int:
        """Number s of error sources."""
        return int(self.start.partials.shape[1]) - 1

    @property
    def end(self) -> int:
        """Last position, T."""
        return len(self.is_update)

    @cached_property
    def updates_before(self) -> IndexArray:
        """Number of updates before each position, shape (T + 1,); it is that of an update that begins there."""
        return np.concatenate([[0], np.cumsum(self.is_update)]).astype(np.int64)

    @cached_property
    def steps_before(self) -> IndexArray:
        """Number of steps before each position, shape (T + 1,)."""
        return np.arange(len(self.is_update) + 1) - self.updates_before

    def sized(self, noise: Mapping[str, Array]) -> dict[str, Array]:
        """Return covariances by process, such as those of a start, in their sizes."""
        return {name: self.sizes.get(name, 1.0) * covariance for name, covariance in noise.items()}

    def time_at(self, position: int) -> float:
        """Return the time of a position; between two updates it is that of both."""
        instant = int(np.searchsorted(self.instants.before, position, side="right")) - 1
        return float(self.instants.times[max(instant, 0)])

    def positions(self, times: Array, side: Literal["before", "after"] = "after") -> IndexArray:
        """Return the positions of times that are instants; ValueError where one is not."""
        places = np.searchsorted(self.instants.times, times)
        places = np.minimum(places, len(self.instants.times) - 1)
        missing = self.instants.times[places] != times
        if missing.any():
            raise ValueError(f"times: {np.asarray(times)[missing][0]:g} s is not among the instants of the timeline")
        return np.asarray(getattr(self.instants, side)[places])
