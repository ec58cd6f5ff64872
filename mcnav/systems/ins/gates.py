"""Gates of an aided navigation's sensors, and its sensors' faults, as `mcnav.contract.gates` has them."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.contract.gates import FaultLaw, GateLaw, RejectionLaws, RejectionReading
from mcnav.systems.ins.aided import AidedNavigation
from mcnav.systems.ins.filter.model import NAVIGATION
from mcnav.systems.ins.linear.closed_loop import ClosedLoop, own_covariances
from mcnav.systems.ins.linear.covariance import output_map
from mcnav.systems.ins.linear.gates import UpdateLaw, innovations_by, update_laws
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
        ramps, ramp_errors = innovations_by(loop, errors, during)
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
    own = own_covariances(loop, places, np.ones(len(places)))[:, :NAVIGATION, :NAVIGATION]
    readings = []
    for place, time, variance in zip(places.tolist(), times.tolist(), own, strict=True):
        to_outputs, so_far = output_map(loop.truth, time), updates[updates < loop.first_updates[place + 1]]
        of_flights = (rejected_errors(whitened, so_far, never, place, to_outputs) for never in (once, later))
        readings.append(RejectionReading(time, np.diag(to_outputs @ variance @ to_outputs.T), *of_flights))
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
    inverse = np.linalg.inv(law.root)
    squares = inverse @ (law.covariance + np.outer(law.mean, law.mean)) @ inverse.T
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
    covariances = roots @ np.stack([laws[n].covariance for n in nearest]) @ roots.swapaxes(1, 2)
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
    first = np.flatnonzero(np.any(errors != 0.0, axis=(1, 2)))[:1]
    innovations, _ = innovations_by(loop, errors, np.unique(np.concatenate([first, updates])))
    return np.asarray(innovations[-len(updates) :, :, 0])


def _updates_of(loop: ClosedLoop, number: int) -> IndexArray:
    return np.flatnonzero(loop.measurements.sensors == number)


def _whitened(loop: ClosedLoop, updates: IndexArray, innovations: Array) -> Array:
    """Divide innovations, shape (u, M, r), by the Cholesky factors of what the filter believes."""
    size = innovations.shape[1]
    return np.asarray(np.linalg.solve(loop.roots[updates][:, :size, :size], innovations))


def _described(component: Component) -> tuple[str, str, str]:
    """Return the name of a component, its SI unit, and the unit in which it is shown."""
    quantity = QUANTITIES[component.quantity]
    return component.name, quantity.unit, quantity.shown_in
