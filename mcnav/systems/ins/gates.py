"""Gates of an aided navigation's sensors, and its sensors' faults, as `mcnav.contract.gates` has them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.contract.gates import FaultLaw, GateLaw, RejectionLaws, RejectionReading
from mcnav.linear.engine.innovations import InnovationLaw, innovation_laws, measurement_errors
from mcnav.products import transform, transformed_variances
from mcnav.systems.ins.aided import AidedNavigation
from mcnav.systems.ins.filter.model import NAVIGATION
from mcnav.systems.ins.linear.closed_loop import ClosedLoop
from mcnav.systems.ins.linear.covariance import output_map
from mcnav.systems.ins.linear.rejections import WhitenedFilter, next_correlations, rejected_errors
from mcnav.systems.ins.sensors.aiding import Component, Sensor
from mcnav.systems.ins.sensors.faults import Fault
from mcnav.systems.ins.sensors.registry import QUANTITIES

MOST_LAWS: Final = 32
"""Measurements during a fault whose innovations' covariance is computed; others have that of the nearest of them."""

MOST_CHECKED: Final = 16
"""Measurements of a sensor at which innovations are compared with what the filter believes of them."""

BELIEVED: Final = 0.01
"""Departure of innovations' whitened mean squares from one that counts as none.

It changes the probability to be rejected, of 0.001, by 6 % of itself.
"""


@dataclass(frozen=True)
class UpdateLaw:
    """Joint normal law of an innovation of M components and of the outputs' errors after its update.

    Attributes
    ----------
    root : ndarray, shape (M, M)
        Cholesky factor of the innovation's covariance as the filter believes it.
    mean, covariance : ndarray, shapes (M,), (M, M)
        Of the innovation.
    cross : ndarray, shape (M, 9)
    mean_errors, errors : ndarray, shapes (9,), (9, 9)
        Mean and covariance of the errors.
    responses : ndarray, shape (9, M)
        Of the errors to an error of the measurement.
    """

    root: Array
    mean: Array
    covariance: Array
    cross: Array
    mean_errors: Array
    errors: Array
    responses: Array


def update_laws(loop: ClosedLoop, updates: IndexArray, mean: Array, sources: Array) -> list[UpdateLaw]:
    """Compute the laws of updates by their numbers, in any order.

    Parameters
    ----------
    mean, sources : ndarray, shapes (s,), (s, s)
        Mean and covariance of the constant sources.
    """
    designed = loop.designed()
    laws = innovation_laws(loop.timeline, designed.gains, updates)
    return [_law(law, designed.roots[u], mean, sources) for u, law in zip(updates.tolist(), laws, strict=True)]


def _law(law: InnovationLaw, root: Array, mean: Array, sources: Array) -> UpdateLaw:
    """Return the law for constant sources of a mean and a covariance."""
    m, means = law.size, law.partials @ np.append(mean, 1.0)
    covariance = law.noise + transform(law.partials[:, :-1], sources)
    return UpdateLaw(
        root[:m, :m], means[:m], covariance[:m, :m], covariance[:m, m:], means[m:], covariance[m:, m:], law.responses
    )


def _errors_by(loop: ClosedLoop, errors: Array, updates: IndexArray) -> tuple[Array, Array]:
    """Compute what errors of the measurements, shape (U, M, r), add to innovations, and to the outputs after the last.

    Returns
    -------
    innovations, outputs : ndarray, shapes (u, M, r), (9, r)
        Of all updates at the time of the last one.
    """
    last = loop.times_of(updates[-1:])
    end = int(loop.positions(last, np.ones(1))[0])
    return measurement_errors(loop.timeline, loop.designed().gains, errors, updates, end)


def gate_laws(
    navigation: AidedNavigation, sensors: tuple[Sensor, ...], limits: Array, mean: Array, covariance: Array,
    duration: float,
) -> tuple[GateLaw, ...]:  # fmt: skip
    """Compute the laws of all sensors that have a gate, each at its last measurement.

    Parameters
    ----------
    limits : ndarray, shape (sensors,)
        Largest normalized innovations squared that are accepted; infinite without a gate.
    mean, covariance : ndarray, shapes (s,), (s, s)
        Of the constant sources.
    duration : float
        Of a ramp, s.
    """
    loop, found = navigation.loop, []
    for number, sensor in enumerate(sensors):
        rows = _updates_of(loop, number)
        if not np.isfinite(limits[number]) or not len(rows):
            continue
        law, size = update_laws(loop, rows[-1:], mean, covariance)[0], len(sensor.components)
        times = loop.measurements.times[rows]
        during = rows[times > times[-1] - duration + 1e-9]
        elapsed = loop.measurements.times[during] - (times[-1] - duration)
        errors = np.zeros((*loop.measurements.components.shape, size))
        for component in range(size):
            errors[during, component, component] = elapsed
        ramps, ramp_errors = _errors_by(loop, errors, during)
        of_update = law.root, law.mean, law.covariance, law.cross, law.mean_errors, law.errors, law.responses
        of_ramps = duration, _whitened(loop, during, ramps[:, :size]), ramp_errors
        names = tuple(map(_described, sensor.components))
        found.append(GateLaw(sensor.name, float(times[-1]), names, float(limits[number]), *of_update, *of_ramps))
    return tuple(found)


def rejection_laws(
    navigation: AidedNavigation, sensors: tuple[Sensor, ...], limits: Array, mean: Array, covariance: Array,
    times: Array,
) -> RejectionLaws | None:  # fmt: skip
    """Compute the laws of good measurements that are rejected; none where no measurement has a gate.

    Parameters
    ----------
    limits, mean, covariance
        As for `gate_laws`.
    times : ndarray, shape (r,)
        Rising times of the grid at which errors are read out, after their updates, the end last, s.
    """
    loop = navigation.loop
    gated = np.isfinite(limits)[loop.measurements.sensors]
    updates = np.flatnonzero(gated)
    if not len(updates):
        return None
    numbers = loop.measurements.sensors[updates]
    rejected = np.array([0.0 if sensor.gate is None else 1.0 - sensor.gate for sensor in sensors])
    laws = RejectionLaws(
        _doubt(loop, sensors, updates, mean, covariance), tuple(sensors[number].name for number in numbers),
        loop.measurements.times[updates], rejected[numbers], limits[numbers], loop.measurements.sizes[updates],
        np.zeros((0, 0)), (),
    )  # fmt: skip
    if laws.doubt:
        return laws
    whitened = WhitenedFilter.of(loop)
    once, later = np.zeros(len(gated), dtype=np.bool_), gated
    places = np.searchsorted(loop.times, times - 1e-9)
    positions = loop.positions(places, np.ones(len(places)))
    own = loop.designed(positions).covariances[:, :NAVIGATION, :NAVIGATION]
    readings = []
    for place, time, variance in zip(places.tolist(), times.tolist(), own, strict=True):
        to_outputs, so_far = output_map(loop.truth, time), updates[updates < loop.first_updates[place + 1]]
        of_flights = (rejected_errors(whitened, so_far, never, place, to_outputs) for never in (once, later))
        readings.append(RejectionReading(time, transformed_variances(to_outputs, variance), *of_flights))
    return replace(
        laws, correlations=next_correlations(loop, whitened, updates), readings=tuple(readings)
    )  # fmt: skip


def _doubt(loop: ClosedLoop, sensors: tuple[Sensor, ...], updates: IndexArray, mean: Array, covariance: Array) -> str:
    """Say why innovations at gates have another law than the filter believes; nothing where they have that."""
    if any(sensor.faults for sensor in sensors):
        return "faults"
    if not loop.filter.corrected.all():
        return "considers"
    numbers = loop.measurements.sensors[updates]
    of_sensors = (updates[numbers == number] for number in np.unique(numbers))
    chosen = [rows[np.unique(np.linspace(0, len(rows) - 1, MOST_CHECKED).astype(int))] for rows in of_sensors]
    laws = update_laws(loop, np.sort(np.concatenate(chosen)), mean, covariance)
    return "" if all(map(_is_believed, laws)) else "inconsistent"


def _is_believed(law: UpdateLaw) -> bool:
    """Return whether an innovation has the mean squares that the filter believes."""
    inverse = np.asarray(np.linalg.inv(law.root), dtype=np.float64)
    squares = transform(inverse, law.covariance + np.outer(law.mean, law.mean))
    return bool(np.abs(squares - np.eye(len(squares))).max() < BELIEVED)


def fault_laws(
    navigation: AidedNavigation, sensors: tuple[Sensor, ...], limits: Array, mean: Array, covariance: Array
) -> tuple[FaultLaw, ...]:
    """Compute the laws of all faults in which there is a measurement; arguments as those of `gate_laws`."""
    loop, found = navigation.loop, []
    for number, sensor in enumerate(sensors):
        rows = _updates_of(loop, number)
        for fault in sensor.faults:
            during = rows[fault.errors(loop.measurements.times[rows]) != 0.0]
            if len(during):
                found.append(_fault_law(loop, sensor, fault, rows, during, float(limits[number]), mean, covariance))
    return tuple(found)


def _fault_law(
    loop: ClosedLoop, sensor: Sensor, fault: Fault, rows: IndexArray, during: IndexArray, limit: float, mean: Array,
    covariance: Array,
) -> FaultLaw:  # fmt: skip
    size, times = len(sensor.components), loop.measurements.times
    chosen = np.unique(np.linspace(0, len(during) - 1, min(MOST_LAWS, len(during))).round().astype(np.int64))
    laws = update_laws(loop, during[chosen], mean, covariance)
    nearest = np.abs(np.arange(len(during))[:, None] - chosen).argmin(axis=1)
    of_faults = _by_faults(loop, during)[:, :size]
    means = np.stack([laws[n].mean - of_faults[chosen[n]] for n in nearest]) + of_faults
    roots = np.linalg.inv(np.stack([laws[n].root for n in nearest]))
    covariances = transform(roots, np.stack([laws[n].covariance for n in nearest]))
    earlier = rows[rows < during[0]]
    name, unit, shown_in = _described(sensor.components[fault.component])
    return FaultLaw(
        sensor.name, fault.kind, name, unit, shown_in, fault.begin, fault.end, fault.size, float(times[during[0]]),
        float(times[during[-1]]), float(times[earlier[-1]] if len(earlier) else loop.times[0]), limit,
        _whitened(loop, during, means[:, :, None])[:, :, 0], covariances,
    )  # fmt: skip


def _by_faults(loop: ClosedLoop, updates: IndexArray) -> Array:
    """Return what all faults add to the innovations of updates, shape (u, M)."""
    errors = loop.measurements.faults[:, :, None]
    return np.asarray(_errors_by(loop, errors, updates)[0][:, :, 0])


def _updates_of(loop: ClosedLoop, number: int) -> IndexArray:
    return np.flatnonzero(loop.measurements.sensors == number)


def _whitened(loop: ClosedLoop, updates: IndexArray, innovations: Array) -> Array:
    """Divide innovations, shape (u, M, r), by the Cholesky factors of what the filter believes."""
    size = innovations.shape[1]
    return np.asarray(np.linalg.solve(loop.designed().roots[updates][:, :size, :size], innovations))


def _described(component: Component) -> tuple[str, str, str]:
    """Return the name of a component, its SI unit, and the unit in which it is shown."""
    quantity = QUANTITIES[component.quantity]
    return component.name, quantity.unit, quantity.shown_in
