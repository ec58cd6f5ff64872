"""Where the first order in a delay is not enough, and where measurements cannot tell a delay from a lever arm."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from mcnav.arrays.products import map_covariances
from mcnav.arrays.types import Array, IndexArray
from mcnav.systems.ins.filter.model import NAVIGATION
from mcnav.systems.ins.imu.instruments import AXES, CONSTANTS
from mcnav.systems.ins.linear.closed_loop import ClosedLoop
from mcnav.systems.ins.sensors.aiding import Sensor, aiding_constants
from mcnav.systems.ins.sensors.measurements import measure, white_sigmas

SHARE: Final = 0.1
"""Second order of a delay at three sigma, as a share of the filter's sigma, beyond which the delay is not small."""

THREE: Final = 3.0
"""Sigmas."""

STEP: Final = 0.01
"""Half of the step of the differences of h', s."""


def remarks_on_delays(
    loop: ClosedLoop, readings: IndexArray, mean: Mapping[str, float], sigmas: Mapping[str, float]
) -> tuple[str, ...]:
    """Say of which sensors the delay is not small, or one with the lever arm.

    Parameters
    ----------
    readings : ndarray of int, shape (m,)
        Numbers of the epochs' times.
    mean, sigmas : mapping of str to float
        Of the true constant sources.
    """
    believed = loop.model.beliefs.sigmas
    states = {state.name for state in loop.model.states}
    remarks = list[str]()
    for number, sensor in enumerate(loop.sensors):
        name, arms = sensor.delay_name, [f"{sensor.name}_lever_arm_{axis}" for axis in AXES]
        delay = max(sigmas.get(name, 0.0), believed.get(name, 0.0) if name in states else 0.0)
        size = abs(mean.get(name, 0.0)) + THREE * float(np.hypot(delay, sensor.jitter))
        if size > 0.0 and len(sensor.times):
            remarks += _not_small(loop, readings, number, size)
        uncertain = sensor.has_lever_arm and any(sigmas.get(arm, 0.0) > 0.0 or arm in states for arm in arms)
        if uncertain and delay > 0.0 and _is_one(loop, number, arms, delay):
            remarks.append(_one_with_arm(loop, number, delay))
    return tuple(remarks)


def _not_small(loop: ClosedLoop, readings: IndexArray, number: int, size: float) -> Iterator[str]:
    """Say where half of h'' times the square of a delay is largest beside the filter's sigma, if it is not small."""
    sensor, measured = loop.sensors[number], loop.measurements
    updates = np.flatnonzero(measured.sensors == number)
    times, indices = measured.times[updates], loop.times[readings]
    last = np.searchsorted(times, indices + 1e-9) - 1
    chosen, places = np.unique(last[last >= 0], return_index=True)
    if not len(chosen):
        return
    design = loop.designed(loop.positions(readings, np.ones(len(readings))))
    covariances = design.covariances[last >= 0][places][:, :NAVIGATION, :NAVIGATION]
    rows = measured.rows[updates[chosen]]
    variances = np.diagonal(map_covariances(rows, covariances), axis1=1, axis2=2)
    sigma = np.sqrt(np.maximum(variances, 0.0))
    beyond = 0.5 * np.abs(_curvatures(loop, sensor, times[chosen])) * size**2
    count = len(sensor.components)
    ratios = np.divide(beyond, sigma, out=np.zeros_like(beyond), where=sigma > 0.0)[:, :count]
    at, column = np.unravel_index(int(np.argmax(ratios)), ratios.shape)
    if ratios[at, column] <= SHARE:
        return
    component = sensor.components[int(column)].name.replace("_", " ")
    yield (
        f"the delay of {sensor.name} is not small. {1e3 * size:.3g} ms late, its {component} is wrong by "
        f"{ratios[at, column]:.2g} filter sigmas beyond first order, at {times[chosen][at]:.4g} s. "
        "Linear results may be wrong there; samples hold"
    )


def _curvatures(loop: ClosedLoop, sensor: Sensor, times: Array) -> Array:
    """Return h'' of a sensor's components at times, shape (u, M), by differences of h'."""
    start = float(loop.times[0])
    sides = [
        measure(loop.truth, loop.platform, start, (replace(sensor, times=times + step, faults=()),)).changes
        for step in (STEP, -STEP)
    ]
    return np.asarray((sides[0] - sides[1]) / (2.0 * STEP))


def _is_one(loop: ClosedLoop, number: int, arms: list[str], delay: float) -> bool:
    """Return whether a sensor's measurements know less of its delay, the arm apart, than its sigma says already.

    The responses to the delay less their projection onto those to the arm, in sigmas of white noise, are what tells the
    two apart: their sum of squares times the delay's variance is below one.
    """
    names = (*CONSTANTS, *aiding_constants(loop.sensors))
    measured, count = loop.measurements, len(loop.sensors[number].components)
    updates = np.flatnonzero(measured.sensors == number)
    weights = 1.0 / white_sigmas(loop.sensors, measured)[updates, :count]
    columns = [measured.constants[updates, :count, names.index(name) - len(CONSTANTS)] * weights for name in arms]
    design, late = np.stack([column.ravel() for column in columns], axis=1), measured.changes[updates, :count] * weights
    left = late.ravel() - design @ np.linalg.lstsq(design, late.ravel(), rcond=None)[0]
    return float(left @ left) * delay**2 < 1.0


def _one_with_arm(loop: ClosedLoop, number: int, delay: float) -> str:
    sensor, updates = loop.sensors[number], loop.measurements.sensors == number
    speed = float(np.sqrt(np.mean(np.sum(loop.truth.earth_fixed(loop.measurements.times[updates])[1] ** 2, axis=1))))
    return (
        f"the measurements of {sensor.name} cannot tell its delay from its lever arm. At constant speed the two are "
        f"one: {1e3 * delay:.3g} ms are {speed * delay:.3g} m"
    )
