"""An aided navigation of a campaign on recorded flights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.quantities import Output, Source
from mcnav.contract.recorded import FilteredRecord, Recording, RecordingError
from mcnav.contract.scenario import ScenarioError
from mcnav.systems.ins.aided import AidedNavigation
from mcnav.systems.ins.filter.model import EKF
from mcnav.systems.ins.imu.instruments import OUTPUTS
from mcnav.systems.ins.recorded.causes import Campaign
from mcnav.systems.ins.recorded.flight import RecordedFlight, indicated_start
from mcnav.systems.ins.recorded.measurements import QUANTITIES, quantities_of
from mcnav.systems.ins.recorded.simulate import simulate_recording
from mcnav.systems.ins.reference.aided import AidedMechanization


def _recordable(navigation: AidedNavigation | None) -> AidedNavigation:
    """Return the navigation if its filter can be taken through recorded flights."""
    if navigation is None:
        raise ScenarioError("filter", "there is no filter to be judged; add [[aiding]] and [filter]")
    if navigation.platform != "strapdown":
        raise ScenarioError("platform", f"got {navigation.platform!r}; only strapdown readings can be recorded")
    if navigation.filter.kind != EKF:
        raise ScenarioError("filter.kind", f"got {navigation.filter.kind!r}; recorded flights are judged with 'ekf'")
    if navigation.imu.gravity.sizes or navigation.filter.beliefs.imu.gravity.sizes:
        raise ScenarioError("gravity", "recorded flights are not judged with gravity disturbances yet; leave it out")
    if any(sensor.flexure is not None for sensor in navigation.sensors):
        raise ScenarioError("aiding", "recorded flights are not judged with flexure yet; leave it out")
    if any(sensor.faults for sensor in navigation.sensors):
        raise ScenarioError("faults", "recorded flights have the faults that they have; leave out [[faults]]")
    for sensor in navigation.sensors:
        for quantity in quantities_of(sensor):
            if quantity not in QUANTITIES:
                known = ", ".join(QUANTITIES)
                raise ScenarioError("aiding", f"{sensor.name} measures {quantity}; what can be recorded is {known}")
    return navigation


def filter_recording(
    navigation: AidedNavigation | None, sources: Sequence[Source], processes: Sequence[Output], recording: Recording,
    mean: Array, covariance: Array,
) -> FilteredRecord:  # fmt: skip
    """Take the filter of a navigation through a recorded flight.

    Parameters
    ----------
    processes : sequence of Output
        All that there may be, with their units.
    mean, covariance : ndarray, shape (n,), (n, n)
        Of the true sources.
    """
    aided = _recordable(navigation)
    recording, shortened = _until_end(aided, recording)
    names = [sensor.name for sensor in aided.sensors]
    if unknown := [name for name in recording.measurements if name not in names]:
        raise RecordingError(f"there is no sensor named {unknown[0]!r}; the campaign has {', '.join(names)}")
    sensors = tuple(sensor for sensor in aided.sensors if sensor.name in recording.measurements)
    for sensor in sensors:
        _check_measured(sensor.name, quantities_of(sensor), recording)
    absent = {name for sensor in aided.sensors if sensor not in sensors for name in sensor.constants()}
    kept = [n for n, source in enumerate(sources) if source.name not in absent]
    campaign = Campaign.of(
        tuple(sources[n] for n in kept), tuple(processes), mean[kept], covariance[np.ix_(kept, kept)], aided.imu,
        sensors,
    ).with_missing()  # fmt: skip
    flight = RecordedFlight(
        aided.truth.earth, recording, sensors, aided.filter, campaign, _start(aided, recording)
    )  # fmt: skip
    notes = [
        *shortened,
        *(f"{sensor.name} has no measurements and is left out" for sensor in aided.sensors if sensor not in sensors),
    ]
    if aided.imu.quantized:
        notes.append("quantization of the readings is left out of the simulated records")
    return replace(flight.fly(), notes=tuple(notes))


def _until_end(aided: AidedNavigation, recording: Recording) -> tuple[Recording, tuple[str, ...]]:
    """Leave out what was recorded after the end that the campaign states, earlier than its trajectory's."""
    last, of_trajectory = float(aided.times[-1]), float(aided.truth.times[-1])
    duration = last - aided.start
    if last >= of_trajectory - 1e-6 or recording.ends[-1] <= duration:
        return recording, ()
    kept = recording.ends <= duration + 1e-6
    note = f"what was recorded after {duration:g} s is left out: the campaign ends there"
    return replace(
        recording, ends=recording.ends[kept], gyro=recording.gyro[kept], accelerometer=recording.accelerometer[kept]
    ), (note,)


def _check_measured(name: str, quantities: Sequence[str], recording: Recording) -> None:
    values = recording.measurements[name].values
    if absent := [quantity for quantity in quantities if quantity not in values]:
        raise RecordingError(f"{name} measures {' and '.join(quantities)}, and the record lacks {absent[0]}")


def _start(aided: AidedNavigation, recording: Recording) -> Array:
    """Return the indicated state at the start: that of the record, or the trajectory's."""
    earth, start = aided.truth.earth, recording.start
    if start is None:
        engine = _engine(aided, 0.1)
        return engine.navigator.indicated_start(np.zeros(len(OUTPUTS)))
    if start.velocity is None or start.attitude is None:
        raise RecordingError("the start lacks a velocity or an attitude")
    return indicated_start(earth, start.position[0], start.velocity[0], start.attitude[0])


def _engine(aided: AidedNavigation, interval: float) -> AidedMechanization:
    end = np.array([float(aided.times[-1])])
    return AidedMechanization(
        aided.truth, aided.platform, aided.start, float(end[0]), end, aided.sensors, aided.filter, interval
    )


def record_sample(
    navigation: AidedNavigation | None, errors: Array, seed: int, index: int, interval: float
) -> Recording:
    """Record one sample, shape (sources,), with readings over intervals, s."""
    aided = _recordable(navigation)
    return simulate_recording(_engine(aided, interval), errors, seed, index, aided.imu)
