"""Gates of a filter's sensors, and the sensors' faults, of any system with a timeline.

The laws are those of `mcnav.contract.gates`; a system says which update is of which sensor.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Final

import numpy as np

from mcnav.arrays.products import transform, transformed_variances
from mcnav.arrays.rows import rows_at
from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.gates import FaultLaw, GateLaw, RejectedErrors, RejectionLaws, RejectionReading
from mcnav.contract.timeline import Timeline
from mcnav.linear.engine.design import Design, filter_of
from mcnav.linear.engine.innovations import InnovationLaw, innovation_laws, measurement_errors, positions_of, states_at
from mcnav.linear.engine.propagate import Propagated, readout_maps
from mcnav.linear.engine.rejected_flights import GateOdds, fly_rejections
from mcnav.linear.engine.rejections import WhitenedFilter, next_correlations, rejected_errors
from mcnav.linear.engine.transitions import bounds
from mcnav.systems.faults import Fault, fault_errors, gate_limit

MOST_LAWS: Final = 32
"""Measurements during a fault whose innovations' covariance is computed; others have that of the nearest of them."""

MOST_CHECKED: Final = 16
"""Measurements of a sensor at which innovations are compared with what the filter believes of them."""

BELIEVED: Final = 0.01
"""Departure of innovations' whitened mean squares from one that counts as none.

It changes the probability to be rejected, of 0.001, by 6 % of itself.
"""

NOTHING: Final = np.zeros((0, 0))

STEERED: Final = 1e-9
"""Share of a row of a transition up to which what corrections do to another state is rounding of differences."""


@dataclass(frozen=True)
class GatedSensor:
    """A sensor as its gate sees it.

    Attributes
    ----------
    components : tuple of (str, str, str)
        Names of what is measured, their SI units, and the units in which they are shown.
    gate : float, optional
        Probability with which a good measurement is accepted; none without a gate.
    """

    name: str
    components: tuple[tuple[str, str, str], ...]
    gate: float | None = None
    faults: tuple[Fault, ...] = ()

    @property
    def limit(self) -> float:
        """Largest normalized innovation squared that is accepted; infinite without a gate."""
        return np.inf if self.gate is None else gate_limit(self.gate, len(self.components))


@dataclass(frozen=True)
class UpdateLaw:
    """Joint normal law of an innovation of M components and of the o outputs after its update.

    Attributes
    ----------
    root : ndarray, shape (M, M)
        Cholesky factor of the innovation's covariance as the filter believes it.
    mean, covariance : ndarray, shapes (M,), (M, M)
        Of the innovation.
    cross : ndarray, shape (M, o)
    mean_errors, errors : ndarray, shapes (o,), (o, o)
        Mean and covariance of the outputs.
    responses : ndarray, shape (o, M)
        Of the outputs to an error of the measurement.
    """

    root: Array
    mean: Array
    covariance: Array
    cross: Array
    mean_errors: Array
    errors: Array
    responses: Array

    @property
    def is_believed(self) -> bool:
        """Whether the innovation has the mean squares that the filter believes."""
        inverse = np.asarray(np.linalg.inv(self.root), dtype=np.float64)
        squares = transform(inverse, self.covariance + np.outer(self.mean, self.mean))
        return bool(np.abs(squares - np.eye(len(squares))).max() < BELIEVED)


@dataclass(frozen=True)
class GatedFilter:
    """A timeline whose filter has gates, or whose sensors have faults, for errors of a mean and a covariance.

    Attributes
    ----------
    timeline : Timeline
    design : callable
        From positions to the filter's gains, and its covariance there.
    sensors : tuple of GatedSensor
    of_sensors : ndarray of int, shape (U,)
        Number of the sensor of each update.
    times : ndarray, shape (U,)
        Of the updates, in the scenario's own time, s.
    mean, covariance : ndarray, shapes (s,), (s, s)
        Of the constant sources.
    planned : bool
        Whether gains are planned, and know of no rejection.
    """

    timeline: Timeline
    design: Callable[[IndexArray], Design]
    sensors: tuple[GatedSensor, ...]
    of_sensors: IndexArray
    times: Array
    mean: Array
    covariance: Array
    planned: bool = False

    @cached_property
    def designed(self) -> Design:
        """Gains of all updates."""
        return self.design(np.zeros(0, dtype=np.int64))

    def updates_of(self, number: int) -> IndexArray:
        """Return the updates of a sensor."""
        return np.flatnonzero(self.of_sensors == number)

    def laws(self, updates: IndexArray, before: Propagated | None = None) -> list[UpdateLaw]:
        """Compute the laws of updates by their numbers, in any order; from X before them, where it is known."""
        designed = self.designed
        laws = innovation_laws(self.timeline, designed.gains, updates, before)
        roots = rows_at(designed.roots, updates)
        return [self._law(law, root) for root, law in zip(roots, laws, strict=True)]

    def _law(self, law: InnovationLaw, root: Array) -> UpdateLaw:
        m, means = law.size, law.partials @ np.append(self.mean, 1.0)
        covariance = law.noise + transform(law.partials[:, :-1], self.covariance)
        return UpdateLaw(
            root[:m, :m], means[:m], covariance[:m, :m], covariance[:m, m:], means[m:], covariance[m:, m:],
            law.responses,
        )  # fmt: skip

    def errors_by(self, errors: Array, updates: IndexArray) -> tuple[Array, Array]:
        """Compute what errors of the measurements, shape (U, M, r), add to innovations, and to outputs after the last.

        Returns
        -------
        innovations, outputs : ndarray, shapes (u, M, r), (o, r)
            Of all updates at the time of the last one.
        """
        instants = self.timeline.instants
        position = int(np.flatnonzero(self.timeline.is_update)[updates[-1]])
        end = int(instants.after[np.searchsorted(instants.after, position, side="right")])
        return measurement_errors(self.timeline, self.designed.gains, errors, updates, end)

    def whitened(self, updates: IndexArray, innovations: Array) -> Array:
        """Divide innovations, shape (u, M, r), by the Cholesky factors of what the filter believes."""
        size = innovations.shape[1]
        return np.asarray(np.linalg.solve(rows_at(self.designed.roots, updates)[:, :size, :size], innovations))

    @cached_property
    def faults(self) -> Array:
        """What faults add to the measurements, shape (U, M)."""
        assert self.timeline.updates is not None
        table = np.zeros(self.timeline.updates.responses.shape[:2])
        for number, sensor in enumerate(self.sensors):
            rows, size = self.updates_of(number), len(sensor.components)
            table[rows, :size] = fault_errors(sensor.faults, self.times[rows], size)
        return table


def gate_laws(gated: GatedFilter, duration: float) -> tuple[GateLaw, ...]:
    """Compute the laws of all sensors that have a gate, each at its last measurement.

    Parameters
    ----------
    duration : float
        Of a ramp, s.
    """
    laws = []
    for number, sensor in enumerate(gated.sensors):
        rows, size = gated.updates_of(number), len(sensor.components)
        if sensor.gate is None or not len(rows):
            continue
        law, times = gated.laws(rows[-1:])[0], gated.times[rows]
        during = rows[times > times[-1] - duration + 1e-9]
        elapsed = gated.times[during] - (times[-1] - duration)
        errors = np.zeros((*gated.faults.shape, size))
        for component in range(size):
            errors[during, component, component] = elapsed
        ramps, ramp_errors = gated.errors_by(errors, during)
        of_update = law.root, law.mean, law.covariance, law.cross, law.mean_errors, law.errors, law.responses
        of_ramps = duration, gated.whitened(during, ramps[:, :size]), ramp_errors
        laws.append(GateLaw(sensor.name, float(times[-1]), sensor.components, sensor.limit, *of_update, *of_ramps))
    return tuple(laws)


def rejection_laws(gated: GatedFilter, times: Array, positions: IndexArray) -> RejectionLaws | None:
    """Compute the laws of good measurements that are rejected; none where no measurement has a gate.

    Parameters
    ----------
    times : ndarray, shape (r,)
        Rising times at which errors are read out, the end last, in the scenario's own time, s.
    positions : ndarray of int, shape (r,)
        Their positions, after their updates.
    """
    sensors, of_sensors = gated.sensors, gated.of_sensors
    has_gate = np.array([sensor.gate is not None for sensor in sensors])[of_sensors]
    updates = np.flatnonzero(has_gate)
    if not len(updates):
        return None
    assert gated.timeline.updates is not None
    doubt, variances = _doubt_and_variances(gated, updates, positions)
    rejected = np.array([0.0 if sensor.gate is None else 1.0 - sensor.gate for sensor in sensors])
    limits = np.array([sensor.limit for sensor in sensors])
    laws = RejectionLaws(
        doubt, tuple(sensors[number].name for number in of_sensors[updates]), gated.times[updates],
        rejected[of_sensors[updates]], limits[of_sensors[updates]], gated.timeline.updates.sizes[updates],
        np.zeros((0, 0)), (),
    )  # fmt: skip
    if laws.doubt:
        return laws
    whitened = WhitenedFilter.of(gated.timeline, gated.designed)
    once, never = (rejected_errors(whitened, positions, later) for later in (np.zeros_like(has_gate), has_gate))
    readings = [
        RejectionReading(time, of_reading, *(RejectedErrors(each.excess[r, so_far], each.responses[r, so_far])
                                            for each in (once, never)))
        for r, (time, of_reading) in enumerate(zip(times.tolist(), variances, strict=True))
        for so_far in [updates[updates < gated.timeline.updates_before[positions[r]]]]
    ]  # fmt: skip
    odds = GateOdds(rejected[of_sensors], limits[of_sensors], gated.timeline.updates.sizes)
    fly = partial(fly_rejections, whitened, odds, positions)
    return replace(laws, correlations=_next(gated, whitened, updates), readings=tuple(readings), fly=fly)


def _next(gated: GatedFilter, whitened: WhitenedFilter, updates: IndexArray) -> Array:
    """Return the correlations of innovations with the sensor's next ones, shape (u, M); NaN where there is none."""
    following = np.full(len(gated.of_sensors), -1, dtype=np.int64)
    for sensor in np.unique(gated.of_sensors[updates]):
        rows = gated.updates_of(int(sensor))
        following[rows[:-1]] = rows[1:]
    has_next = following[updates] >= 0
    correlations = np.full((len(updates), whitened.gains.shape[2]), np.nan)
    correlations[has_next] = next_correlations(whitened, updates[has_next], following[updates[has_next]])
    return correlations


def _doubt_and_variances(gated: GatedFilter, updates: IndexArray, positions: IndexArray) -> tuple[str, Array]:
    """Say why errors after a rejection have another law than the filter believes; nothing where they have that.

    Returns
    -------
    doubt : str
    variances : ndarray, shape (r, o)
        Of the outputs at positions where all measurements are accepted; none with a doubt.
    """
    timeline = gated.timeline
    if any(sensor.faults for sensor in gated.sensors):
        return "faults", NOTHING
    if not filter_of(timeline).corrected.all():
        return "considers", NOTHING
    if gated.planned:
        return "planned", NOTHING
    if _is_steered(timeline):
        return "steered", NOTHING
    numbers = gated.of_sensors[updates]
    of_sensors = (updates[numbers == number] for number in np.unique(numbers))
    chosen = [rows[np.unique(np.linspace(0, len(rows) - 1, MOST_CHECKED).astype(int))] for rows in of_sensors]
    checked = np.sort(np.concatenate(chosen))
    states = states_at(timeline, gated.designed.gains, np.append(positions_of(timeline, checked), positions))
    before = Propagated(states.partials[: len(checked)], states.covariances[: len(checked)])
    if not all(law.is_believed for law in gated.laws(checked, before)):
        return "inconsistent", NOTHING
    maps = np.array([readout_maps(timeline)(position) for position in positions.tolist()])
    read, noise = maps @ states.partials[len(checked) :, :, :-1], states.covariances[len(checked) :].sum(axis=1)
    return "", transformed_variances(read, gated.covariance) + transformed_variances(maps, noise)


def _is_steered(timeline: Timeline) -> bool:
    """Return whether corrections do more than the filter believes: ``A M`` is not ``M F`` in a step."""
    filtered = filter_of(timeline)
    place = filtered.place
    for first, last in bounds(0, int(timeline.steps_before[-1])):
        transitions = timeline.steps(first, last).transitions
        departures = np.abs(transitions @ place - place @ filtered.steps(first, last).transitions)
        if np.any(departures > STEERED * np.abs(transitions).max(axis=2, keepdims=True)):
            return True
    return False


def fault_laws(gated: GatedFilter) -> tuple[FaultLaw, ...]:
    """Compute the laws of all faults in which there is a measurement."""
    laws = []
    for number, sensor in enumerate(gated.sensors):
        rows = gated.updates_of(number)
        for fault in sensor.faults:
            during = rows[fault.errors(gated.times[rows]) != 0.0]
            if len(during):
                laws.append(_fault_law(gated, sensor, fault, rows, during))
    return tuple(laws)


def _fault_law(gated: GatedFilter, sensor: GatedSensor, fault: Fault, rows: IndexArray, during: IndexArray) -> FaultLaw:
    size, times = len(sensor.components), gated.times
    chosen = np.unique(np.linspace(0, len(during) - 1, min(MOST_LAWS, len(during))).round().astype(np.int64))
    laws = gated.laws(during[chosen])
    nearest = np.abs(np.arange(len(during))[:, None] - chosen).argmin(axis=1)
    of_faults = gated.errors_by(gated.faults[:, :, None], during)[0][:, :size, 0]
    means = np.stack([laws[n].mean - of_faults[chosen[n]] for n in nearest]) + of_faults
    roots = np.linalg.inv(np.stack([laws[n].root for n in nearest]))
    covariances = transform(roots, np.stack([laws[n].covariance for n in nearest]))
    earlier = rows[rows < during[0]]
    name, unit, shown_in = sensor.components[fault.component]
    return FaultLaw(
        sensor.name, fault.kind, name, unit, shown_in, fault.begin, fault.end, fault.size, float(times[during[0]]),
        float(times[during[-1]]), float(times[earlier[-1]] if len(earlier) else gated.timeline.instants.times[0]),
        sensor.limit, gated.whitened(during, means[:, :, None])[:, :, 0], covariances,
    )  # fmt: skip
