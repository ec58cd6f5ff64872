"""``trajectory`` of a campaign: every form, and its mistakes with key and remedy."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcnav.entries.context import EarlierFile, FileContext
from mcnav.entries.inputs import content_of
from mcnav.systems.ins.earth import WGS84
from mcnav.systems.ins.tables.trajectories import TrajectorySpec, read_trajectory
from mcnav.systems.ins.tables.trajectory_file import LARGEST_FILE
from tests.unit.config.test_trajectory_file import flight, write_csv

START = {"latitude": "47 deg", "longitude": "9 deg", "altitude": "500 m", "course": "80 deg"}


def read(entry: object, folder: Path, earlier: dict[str, EarlierFile] | None = None) -> TrajectorySpec:
    context = FileContext("mine.toml", folder, earlier or {})
    found = read_trajectory(entry, WGS84, context)
    assert context.problems == []
    assert found is not None
    return found


def refused(entry: object, folder: Path = Path()) -> str:
    context = FileContext("mine.toml", folder)
    assert read_trajectory(entry, WGS84, context) is None
    (problem,) = context.problems
    assert str(problem).isprintable()
    return str(problem)


def test_files(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "flight.csv", flight())
    other = {"latitude" if name == "lat" else name: values for name, values in flight().items()}
    write_csv(tmp_path / "other.csv", other)
    plain = read("flight.csv", tmp_path)
    named = read({"file": "other.csv", "columns": {"lat": "latitude [deg]"}}, tmp_path)
    np.testing.assert_array_equal(plain.rows.latitude, named.rows.latitude)
    assert plain.file is not None
    assert (plain.file.digest, plain.file.size) == content_of(str(path))
    assert (plain.file.name, plain.file.setting) == ("flight.csv", "trajectory")
    assert plain.resolved == "inputs/flight.csv"
    assert named.resolved == {"file": "inputs/other.csv", "columns": {"lat": "latitude [deg]"}}


def test_a_changed_file_is_read_from_its_copy(tmp_path: Path) -> None:
    path, copy = write_csv(tmp_path / "flight.csv", flight()), tmp_path / "copy.csv"
    copy.write_bytes(path.read_bytes())
    earlier = {"trajectory": EarlierFile(content_of(str(copy))[0], copy)}
    write_csv(path, flight(30.0))
    assert len(read("flight.csv", tmp_path, earlier).rows) == len(flight()["time"])


def test_reentry(tmp_path: Path) -> None:
    found = read({"reentry": 1}, tmp_path)
    assert found.file is None
    assert found.truth.times[-1] == pytest.approx(4029.9948, abs=1e-3)
    again = read(found.resolved, tmp_path)
    np.testing.assert_array_equal(again.truth.times, found.truth.times)
    np.testing.assert_array_equal(again.rows.longitude, found.rows.longitude)
    assert np.ptp(read({"reentry": 1, "latitude": "28 deg", "azimuth": "45 deg"}, tmp_path).rows.latitude) > 0.5


def test_segments(tmp_path: Path) -> None:
    segments: list[dict[str, Any]] = [
        {"hold": "10 s"}, {"speed": "80 m/s", "acceleration": "0.2 g"}, {"climb": "500 m", "angle": "6 deg"},
        {"turn": "-30 deg", "bank": "25 deg"}, {"straight": "2 km"}, {"straight": "20 s"},
        {"to": {"latitude": "47.5 deg", "longitude": "9.5 deg"}, "rate": "3 deg/s"},
    ]  # fmt: skip
    found = read({"start": START, "segments": segments, "rate": "5 Hz"}, tmp_path)
    assert found.rows.altitude[-1] == pytest.approx(1_000.0, abs=1e-6)
    assert np.degrees(found.rows.latitude[-1]) == pytest.approx(47.5, abs=1e-6)
    assert np.median(np.diff(found.rows.time)) == pytest.approx(0.2, rel=1e-3)
    assert found.label == "flight of 7 segments"
    np.testing.assert_array_equal(read(found.resolved, tmp_path).rows.time, found.rows.time)


LAUNCH = {
    "latitude": "28.5 deg", "longitude": "-80.5 deg", "azimuth": "60 deg",
    "stages": [{"acceleration": "1.4 g", "last": "3 g", "burn": "60 s"}],
}  # fmt: skip


def test_boost(tmp_path: Path) -> None:
    found = read({"boost": {**LAUNCH, "coast": "20 s"}}, tmp_path)
    assert found.truth.times[-1] == pytest.approx(80.0)
    np.testing.assert_array_equal(read(found.resolved, tmp_path).rows.altitude, found.rows.altitude)


def test_a_swaying_base_is_a_sine_about_a_mean(tmp_path: Path) -> None:
    """The splines through forty rows of a period leave 1e-5 of an amplitude."""
    base = {"latitude": "54 deg", "longitude": "10 deg", "heading": "30 deg", "duration": "60 s"}
    moving = {"roll": {"amplitude": "4 deg", "period": "9 s"}, "heave": {"amplitude": "0.5 m", "period": "2 s"}}
    still = {"yaw": {"amplitude": "0 deg", "period": "14 s"}}
    found = read({"sway": {**base, **moving, **still, "surge": {"amplitude": "2 m", "period": "20 s"}}}, tmp_path)
    times = np.array([7.3, 31.7])
    angles = found.truth.angles(times)
    np.testing.assert_allclose(angles[:, 2], np.radians(4.0) * np.sin(2.0 * np.pi * times / 9.0), atol=1e-6)
    np.testing.assert_allclose(angles[:, :2], [[np.radians(30.0), 0.0]] * 2, atol=1e-6)
    latitude, longitude, altitude = found.truth.geodetic(times).T
    np.testing.assert_allclose(-altitude, 0.5 * np.sin(np.pi * times), atol=1e-5)
    meridian, prime = WGS84.curvature_radii(latitude)
    surge = 2.0 * np.sin(2.0 * np.pi * times / 20.0)
    north, east = np.cos(np.radians(30.0)) * surge, np.sin(np.radians(30.0)) * surge
    np.testing.assert_allclose((latitude - np.radians(54.0)) * meridian, north, atol=1e-5)
    np.testing.assert_allclose((longitude - np.radians(10.0)) * prime * np.cos(latitude), east, atol=1e-5)
    assert "scenario.trajectory.sway.roll.period: is missing" in refused(
        {"sway": {**base, "roll": {"amplitude": "4 deg"}}}
    )


def test_boosts_that_cannot_be_flown() -> None:
    heavy = {**LAUNCH, "stages": [{"acceleration": "0.9 g", "burn": "60 s"}]}
    short = {**LAUNCH, "stages": [{"acceleration": "1.5 g", "burn": "22 s"}]}
    assert "scenario.trajectory.boost.stages #1.acceleration: is too small to lift off" in refused({"boost": heavy})
    assert "boost.kick: the velocity is below the pitch after it" in refused({"boost": {**LAUNCH, "kick": "0.01 deg"}})
    assert "boost.kick: the velocity does not come down" in refused({"boost": {**short, "kick": "50 deg"}})
    assert "boost.stages #1.burn: is missing" in refused({"boost": {**LAUNCH, "stages": [{"acceleration": "2 g"}]}})


def segments(*entries: object) -> dict[str, object]:
    return {"start": START, "segments": list(entries)}


MOVING = {"speed": "80 m/s"}


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        (7, "scenario.trajectory: expected a file in quotes, or a table with file, reentry, segments, boost or"),
        ({}, "scenario.trajectory: has no kind; expected a table with one of file, reentry, segments, boost"),
        ({"reentry": 1, "file": "a.csv"}, "got file and reentry; expected a table with one of"),
        ({"reentry": 8}, "scenario.trajectory.reentry: got 8; expected a number less than or equal to 7"),
        ({"reentry": 1, "latitude": "28 km"}, "scenario.trajectory.latitude: got '28 km', which is a length"),
        ({"reentry": 1, "heading": "28 deg"}, "scenario.trajectory.heading: unknown key"),
        ("missing.csv", "scenario.trajectory: missing.csv does not exist; paths are relative to the campaign file"),
        ("/etc/passwd", "the file must lie beside the campaign file"),
        ("../flight.csv", "the file must lie beside the campaign file"),
        ({"segments": []}, "scenario.trajectory.start: is missing"),
        (segments({"climb": "1 km"}), "scenario.trajectory.segments #1: the vehicle stands still and cannot climb"),
        (segments({"clim": "1 km"}), "scenario.trajectory.segments #1: has no kind: got clim; did you mean 'climb'?"),
        (segments({"climb": "1 km", "turn": "9 deg"}), "segments #1: got climb and turn; it is one of hold, straight"),
        (segments(MOVING, {"climb": "9 deg"}), "segments #2.climb: got '9 deg', which is an angle; expected a length"),
        (segments(MOVING, {"turn": "9 deg", "bank": "95 deg"}), "#2.bank: got '95 deg'; expected at most 80.2141 deg"),
        (segments(MOVING, {"turn": "9 deg", "bank": "9 deg", "rate": "1 deg/s"}), "#2.rate: got with a bank; keep one"),
        (segments(MOVING, {"straight": "5 kg"}), "segments #2.straight: got '5 kg'"),
        (segments(MOVING, {"to": {"latitude": "48 deg"}}), "segments #2.to.longitude: is missing"),
        ({"start": {**START, "latitude": "91 deg"}, "segments": [MOVING]}, "start.latitude: got '91 deg'"),
        ({**segments(MOVING), "rate": "5 s"}, "rate: got '5 s', which is a time; expected a frequency"),
    ],
)  # fmt: skip
def test_mistakes(entry: object, message: str) -> None:
    if entry == {"segments": []}:
        context = FileContext("mine.toml", Path())
        assert read_trajectory(entry, WGS84, context) is None
        assert message in "\n".join(map(str, context.problems))
        return
    assert message in refused(entry)


def test_a_pole_on_the_way() -> None:
    entry = {"start": {**START, "latitude": "89 deg", "course": "0 deg", "speed": "200 m/s"}}
    assert "comes within 10 km of a pole" in refused({**entry, "segments": [{"straight": "120 km"}]})


def test_bad_files_name_file_row_and_column(tmp_path: Path) -> None:
    columns = flight()
    columns["alt"][5] = np.nan
    write_csv(tmp_path / "bad.csv", columns)
    message = refused("bad.csv", tmp_path)
    assert message.startswith(
        f"mine.toml: scenario.trajectory: {tmp_path / 'bad.csv'}: line 7, column alt: got no number"
    )
    os.mkfifo(tmp_path / "pipe.csv")
    assert "is not a regular file" in refused("pipe.csv", tmp_path)
    with (tmp_path / "sparse.csv").open("wb") as file:
        file.truncate(1_000 * LARGEST_FILE)
    assert "is longer than" in refused("sparse.csv", tmp_path)
