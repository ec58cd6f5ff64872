"""Choices that are made where a log leaves them open: each is said in a line, with the option that decides."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from mcnav.logs.imu_log import read_imu_log
from mcnav.logs.track import read_track
from tests.unit.logs.test_formats import COUNT, SIGMA, TIME, bag, inertial, nmea, refused, sentence, ulog, written

STAMPS = [1_000_000 + round(1e6 * each) for each in TIME]
IMU = (
    "uint64_t timestamp;uint64_t timestamp_sample;float[3] delta_angle;float[3] delta_velocity;"
    "uint32_t delta_angle_dt;uint32_t delta_velocity_dt;"
)


def of_quality(quality: int, rows: slice) -> list[str]:
    """Return sentences of which some have another quality."""
    lines = nmea(dated=False)
    positions = [place for place, line in enumerate(lines) if "GGA" in line]
    for place in positions[rows]:
        body = lines[place][1:].partition("*")[0].replace("E,4,", f"E,{quality},")
        lines[place] = sentence(body)
    return lines


@pytest.mark.parametrize(("quality", "words"), [(6, "dead reckoning"), (8, "simulated")])
def test_positions_without_a_fix_are_left_out_unless_asked_for(tmp_path: Path, quality: int, words: str) -> None:
    path = written(tmp_path, "a.nmea", of_quality(quality, slice(5, None)))
    track = read_track(path)
    assert len(track.time) == 5
    option = f'columns = {{ topic = "+{quality}" }} keeps them'
    assert f"{COUNT - 5} rows of quality {quality} ({words}) left out: no fixes; {option}" in track.notes
    assert len(read_track(path, {"topic": f"+{quality}"}).time) == COUNT


def test_a_stream_of_two_talkers_asks_for_one(tmp_path: Path) -> None:
    lines = nmea(dated=False)
    others = [sentence(line[1:].partition("*")[0].replace("GPGGA", "GNGGA")) for line in lines if "GGA" in line]
    path = written(tmp_path, "a.nmea", [*lines, *others[:7]])
    assert f'GP ({COUNT}) and GN (7); name one: columns = {{ topic = "GP" or "GN" }}' in refused(path)
    assert len(read_track(path, {"topic": "GN"}).time) == 7
    assert len(read_track(path, {"topic": "GP"}).time) == COUNT
    assert "expected a talker such as GN" in refused(path, columns={"topic": "GP+5"})


def test_increments_are_divided_by_the_integration_time_of_each_message(tmp_path: Path) -> None:
    """The rates are those that were integrated, to the digits of four bytes, however the times vary."""
    rows, durations = [], [5000 + 200 * (row % 3) for row in range(COUNT)]
    for stamp, values, duration in zip(STAMPS, inertial().astype(float), durations, strict=True):
        increments = values * duration * 1e-6
        rows.append(struct.pack("<QQ6fII", stamp + 300, stamp, *increments, duration, duration))
    path = ulog(tmp_path / "a.ulg", {"vehicle_imu": (IMU, rows)})
    log = read_imu_log(path)
    assert log.gyro is not None
    assert log.accelerometer is not None
    np.testing.assert_allclose(np.column_stack([log.gyro, log.accelerometer]), inertial(), rtol=1e-6)
    assert "delta_angle and delta_velocity are divided by the integration time of each message" in log.notes
    both = ulog(tmp_path / "b.ulg", {"vehicle_imu": (IMU, rows), "vehicle_imu.1": (IMU, rows)})
    asked = 'has 2 instances of vehicle_imu; name one: columns = { topic = "vehicle_imu.0" or "vehicle_imu.1" }'
    assert asked in refused(both, read_imu_log)
    assert len(read_imu_log(both, {"topic": "vehicle_imu.1"}).time) == COUNT


def test_gyros_and_accelerometers_of_separate_topics_are_both_read(tmp_path: Path) -> None:
    """Both are lines in time: interpolated, the accelerometers are those of the gyros' times."""
    form = "uint64_t timestamp;float x;float y;float z;"

    def line(offset: int) -> list[bytes]:
        return [struct.pack("<Q3f", stamp + offset, *([1e-6 * (stamp + offset)] * 3)) for stamp in STAMPS]

    path = ulog(tmp_path / "a.ulg", {"sensor_gyro": (form, line(0)), "sensor_accel": (form, line(-50_000))})
    log = read_imu_log(path, units={"gyro": "rad/s", "accelerometer": "m/s^2"})
    assert log.gyro is not None
    assert log.accelerometer is not None
    assert len(log.time) == COUNT - 1
    np.testing.assert_allclose(log.accelerometer, log.gyro, rtol=1e-6)
    assert "sensor_accel is interpolated to the times of sensor_gyro" in log.notes


def test_an_approximated_covariance_is_no_variance(tmp_path: Path) -> None:
    path = bag(tmp_path / "a.mcap", kind_of_covariance=1)
    track = read_track(path)
    assert track.position_sigma is None
    (note,) = [each for each in track.notes if "covariance type" in each]
    assert "not a variance in m^2" in note
    names = {f"sigma_{axis}": f"approximated_sigma_{axis}" for axis in ("north", "east", "down")}
    assert read_track(path, names).position_sigma == pytest.approx(SIGMA[1:])


def test_sigmas_that_no_receiver_has_are_noted(tmp_path: Path) -> None:
    rows = [f"{time:.1f},47.0,8.{row:06d},500.0,1e-6,1e-6,1e-6" for row, time in enumerate(TIME)]
    head = "time [s],latitude [deg],longitude [deg],altitude [m],sigma_north,sigma_east,sigma_down"
    track = read_track(written(tmp_path, "a.csv", [head, *rows]))
    assert any("1e-06 m in the median, which no receiver has; units = { sigma" in note for note in track.notes)


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_decimals_after_commas_are_read(tmp_path: Path, delimiter: str) -> None:
    """As the same numbers with points; a row that is none is named as it is written."""
    names = ["time [s]", *(f"{n}_{a} [{u}]" for n, u in (("gyro", "rad/s"), ("accelerometer", "m/s^2")) for a in "xyz")]
    values = [[f"{each:.6f}" for each in (time, *row)] for time, row in zip(TIME, inertial(), strict=True)]
    lines = [delimiter.join(row).replace(".", ",") for row in values]
    log = read_imu_log(written(tmp_path, "a.csv", [delimiter.join(names), *lines]))
    plain = read_imu_log(written(tmp_path, "b.csv", [",".join(names), *(",".join(row) for row in values)]))
    assert log.notes[0] == "decimals are separated by commas"
    np.testing.assert_array_equal(log.gyro, plain.gyro)
    lines[4] = lines[4].replace(delimiter, f"{delimiter}x", 1)
    wrong = refused(written(tmp_path, "c.csv", [delimiter.join(names), *lines]), read_imu_log)
    assert "line 6, gyro_x [rad/s]: got 'x" in wrong
