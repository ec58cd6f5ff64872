"""Files that are not what they say, found without a filter: records of `tests.calibration.own_records`."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from mcnav.contract.recorded import RecordedMeasurements, Recording
from mcnav.judgement.column_match import velocity_fault
from mcnav.judgement.low_pass import density_fall, low_pass_remarks
from mcnav.judgement.plain_files import IMU, find_fault
from tests.calibration.named_trials import recording_of
from tests.calibration.own_records import FILE_FAULTS, WRONG, Flown, fly, late_by


@pytest.mark.parametrize("name", FILE_FAULTS)
def test_a_fault_of_the_files_is_named(name: str) -> None:
    change, words = FILE_FAULTS[name]
    fault = find_fault(recording_of(change(fly(1))), 3.0, 0.02)
    assert fault is not None
    assert words in fault.message
    assert "\n" not in fault.message


@pytest.mark.parametrize("name", ["nothing", "0.11 s late", "receiver's clock 1 % slow", "jitter of 60 ms"])
def test_what_a_filter_has_to_tell_is_no_fault_of_the_files(name: str) -> None:
    assert find_fault(recording_of(fly(3, WRONG[name][0])), 3.0, 0.02) is None


def test_noise_of_a_receiver_is_no_fault_of_the_files() -> None:
    """Velocities to 3 m/s: their course turns nine times as much as the vehicle, which is no unit of the gyros."""
    for seed in (1, 2, 4):
        assert find_fault(recording_of(fly(seed, Flown(velocity=3.0, position=10.0))), 3.0, 0.02) is None


def with_gnss(recording: Recording, **values: np.ndarray) -> Recording:
    gnss = recording.measurements["gnss"]
    return replace(
        recording, measurements={"gnss": RecordedMeasurements(gnss.times, {**gnss.values, **values})}
    )  # fmt: skip


def test_positions_and_velocities_alone_show_what_both_together_show() -> None:
    """Of velocities the readings tell exchanged columns; of positions clocks, and where latitude is longitude."""
    recording = recording_of(fly(4))
    gnss = recording.measurements["gnss"]
    velocity = gnss.values["velocity"]
    alone = replace(
        recording, measurements={"gnss": RecordedMeasurements(gnss.times, {"velocity": velocity[:, [1, 0, 2]]})}
    )
    fault = find_fault(alone)
    assert fault is not None
    assert "north and east are exchanged, or one of them has the wrong sign" in fault.message
    late = recording_of(late_by(3.0)(fly(4))).measurements["gnss"]
    positions = replace(
        recording, measurements={"gnss": RecordedMeasurements(late.times, {"position": late.values["position"]})}
    )
    fault = find_fault(positions)
    assert fault is not None
    assert "3 s late against the readings: whole seconds" in fault.message
    fault = find_fault(with_gnss(recording, position=gnss.values["position"][:, [1, 0, 2]]))
    assert fault is not None
    assert "latitude and longitude are exchanged" in fault.message


@pytest.mark.parametrize(
    ("factor", "words"),
    [(3.6, "they are in km/h"), (1.943844, "they are in kn"), (100.0, "in cm/s"), (-1.0, "have the wrong sign")],
)  # fmt: skip
def test_velocities_in_other_units_are_named(factor: float, words: str) -> None:
    gnss = recording_of(fly(5)).measurements["gnss"]
    values = {**gnss.values, "velocity": factor * gnss.values["velocity"]}
    assert words in velocity_fault(RecordedMeasurements(gnss.times, values))
    assert not velocity_fault(gnss)


def test_vertical_columns_that_are_no_measurements_are_named() -> None:
    """Altitudes in feet, and vertical velocities that are zero throughout."""
    gnss = recording_of(fly(5)).measurements["gnss"]
    feet = {**gnss.values, "position": gnss.values["position"] * (1.0, 1.0, 3.28084)}
    assert velocity_fault(RecordedMeasurements(gnss.times, feet)).endswith("it is in ft")
    level = {**gnss.values, "velocity": gnss.values["velocity"] * (1.0, 1.0, 0.0)}
    assert "exactly zero" in velocity_fault(RecordedMeasurements(gnss.times, level))


@pytest.mark.parametrize(
    ("gyro", "force", "words"),
    [
        (180.0 / np.pi, 1.0, "in deg/s"), (1e3, 1.0, "in mrad/s"), (np.pi / 180.0, 1.0, "rad/s, not deg/s"),
        (-1.0, 1.0, "gyro_x, gyro_y and gyro_z have the wrong sign"), (1.0, 1e3 / 9.80665, "it is in mg"),
    ],
)  # fmt: skip
def test_readings_in_other_units_are_named(gyro: float, force: float, words: str) -> None:
    recording = recording_of(fly(6))
    fault = find_fault(
        replace(recording, gyro=gyro * recording.gyro, accelerometer=force * recording.accelerometer)
    )  # fmt: skip
    assert fault is not None
    assert fault.subject == IMU
    assert words in fault.message


def changed(recording: Recording, gyro: np.ndarray, force: np.ndarray) -> Recording:
    return replace(recording, gyro=recording.gyro @ gyro.T, accelerometer=recording.accelerometer @ force.T)


SAME, EXCHANGED = np.eye(3), np.eye(3)[[1, 0, 2]]


@pytest.mark.parametrize(
    ("gyro", "force", "words"),
    [
        (np.diag([-1, 1, 1]), SAME, "same axes: gyro_x has the wrong sign"),
        (np.diag([1, 1, -1]), SAME, "same axes: gyro_z has the wrong sign"),
        (np.diag([1, -1, -1]), SAME, "same axes: gyro_y and gyro_z have the wrong sign"),
        (EXCHANGED, SAME, "gyro_x, gyro_y, gyro_z should be gyro_y, gyro_x, gyro_z"),
        (SAME, np.diag([-1, 1, 1]), "same axes: accelerometer_x has the wrong sign"),
        (SAME, np.diag([1, -1, 1]), "same axes: accelerometer_y has the wrong sign"),
        (SAME, np.diag([1, -1, -1]), "same axes: accelerometer_y and accelerometer_z have the wrong sign"),
        (SAME, -SAME, "accelerometer_x, accelerometer_y and accelerometer_z have the wrong sign"),
        (SAME, EXCHANGED, "should be accelerometer_y, accelerometer_x, accelerometer_z"),
        (1.1 * SAME, SAME, "gyro readings are 1.10 times as large as the motion of the track"),
        (SAME, 0.95 * SAME, "accelerometer readings are 0.95 times as large as the motion of the track"),
    ],
)  # fmt: skip
def test_readings_along_other_axes_are_named(gyro: np.ndarray, force: np.ndarray, words: str) -> None:
    for seed in (6, 7):
        fault = find_fault(changed(recording_of(fly(seed)), gyro, force), 3.0, 0.02)
        assert fault is not None
        assert fault.subject == IMU
        assert words in fault.message


def test_a_scale_within_those_of_the_campaign_is_no_fault() -> None:
    recording = changed(recording_of(fly(6)), 1.1 * SAME, SAME)
    assert find_fault(recording, 3.0, 0.02, 0.05) is None


def rover(turning: float, late: float, seed: int) -> Recording:
    """Return a rover at 1 m/s that winds with a rate, rad/s, shaken by 3 m/s^2 at 50 Hz: no acceleration is seen."""
    rng, ends = np.random.default_rng(seed), 0.02 * np.arange(1.0, 12_001.0)
    rate = turning * np.sin(0.11 * ends) * np.cos(0.047 * ends + 1.0)
    course = np.cumsum(rate) * 0.02
    gyro = np.stack([0.0 * ends, 0.0 * ends, rate], axis=1) + 2e-3 * rng.standard_normal((len(ends), 3)) + 5e-4
    force = np.array([0.0, 0.0, -9.8]) + 3.0 * rng.standard_normal((len(ends), 3))
    stamps = np.arange(5.0, 235.0)
    at = np.interp(stamps, ends, course)
    velocity = np.stack([np.cos(at), np.sin(at), 0.0 * at], axis=1) + 0.05 * rng.standard_normal((len(at), 3))
    return Recording(ends, gyro, force, {"gnss": RecordedMeasurements(stamps + late, {"velocity": velocity})})


def test_turns_tell_clocks_where_accelerations_do_not() -> None:
    """Four seconds late on a winding way are named; on a straight one, and at the right time, nothing is."""
    assert find_fault(rover(0.4, 0.0, 0)) is None
    assert find_fault(rover(0.0, 4.0, 0)) is None
    fault = find_fault(rover(0.4, 4.0, 0))
    assert fault is not None
    assert fault.subject == "gnss"
    late = re.match(r"its stamps are (.*) s late against the gyros: whole seconds; the turns", fault.message)
    assert late is not None
    assert float(late[1]) == pytest.approx(4.0, abs=0.1)


def test_a_vehicle_at_rest_tells_nothing_of_clocks_and_headings() -> None:
    """Nothing moves but by noise, fixes repeat as receivers at rest repeat them: no fault is seen."""
    rng = np.random.default_rng(7)
    count = 6000
    force = np.tile([0.0, 0.0, -9.81], (count, 1)) + 0.01 * rng.standard_normal((count, 3))
    times = np.arange(1.0, 120.0)
    velocity = np.repeat(0.03 * rng.standard_normal((len(times) // 7 + 1, 3)), 7, axis=0)[: len(times)]
    position = np.tile([0.8, 0.2, 300.0], (len(times), 1))
    gnss = RecordedMeasurements(times, {"position": position, "velocity": velocity})
    recording = Recording(
        0.02 * np.arange(1.0, count + 1.0), 1e-3 * rng.standard_normal((count, 3)), force, {"gnss": gnss}
    )
    assert find_fault(recording) is None


@pytest.mark.parametrize(("kept", "expected"), [(0.0, 1.0), (0.5, 4.600)])
def test_low_passed_readings_are_told_from_white_ones(kept: float, expected: float) -> None:
    """Of y <- a y + x the density is 1 / (1 - 2 a cos w + a^2), its mean 4.600 times higher in the first band.

    19 frequencies in 61 segments, which overlap, are some 700 values in a band: a ratio is known to 5.4 %. The least of
    three axes is taken, so that five sigmas are allowed.
    """
    white = np.random.default_rng(8).standard_normal((8000, 3))
    fall = density_fall(lfilter([1.0], [1.0, -kept], white, axis=0))
    assert fall == pytest.approx(expected, rel=0.27)
    recording = recording_of(fly(9))
    assert low_pass_remarks(recording) == ()
    smooth = replace(recording, gyro=lfilter([1.0 - kept], [1.0, -kept], recording.gyro, axis=0))
    assert len(low_pass_remarks(smooth)) == (kept > 0.0)
