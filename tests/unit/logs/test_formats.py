"""Logs of receivers, flight controllers and robots, written by libraries of their formats or by specifications."""

import struct
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcnav.logs.imu_log import read_imu_log
from mcnav.logs.log_error import LogError
from mcnav.logs.tables import read_table
from mcnav.logs.track import Track, read_track

COUNT = 20
TIME = np.arange(COUNT) * 0.2
LATITUDE = 47.0 + 1e-5 * np.arange(COUNT)
LONGITUDE = 8.5 - 2e-5 * np.arange(COUNT)
HEIGHT = 500.0 + 0.25 * np.arange(COUNT)
SIGMA = np.column_stack([0.01 + 0.001 * np.arange(COUNT), 0.02 + 0.001 * np.arange(COUNT), 0.05 + 0.0 * TIME])
WHEN = datetime(2023, 3, 4, 5, 6, 7, tzinfo=UTC)


def check(track: Track, degrees: float = 1e-9, metres: float = 1e-4) -> None:
    """Compare a track with the one that was written, to half of the digits printed."""
    np.testing.assert_allclose(track.time, TIME, atol=1e-6)
    np.testing.assert_allclose(np.degrees(track.latitude), LATITUDE, atol=0.5001 * degrees)
    np.testing.assert_allclose(np.degrees(track.longitude), LONGITUDE, atol=0.5001 * degrees)
    np.testing.assert_allclose(track.altitude, HEIGHT, atol=0.5001 * metres)


def refused(path: Path, read: Any = read_track, **given: Any) -> str:
    with pytest.raises(LogError) as refusal:
        read(path, **given)
    line = str(refusal.value)
    assert "\n" not in line
    return line


def written(folder: Path, name: str, lines: Sequence[str]) -> Path:
    path = folder / name
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")
    return path


POS_HEADER = (
    "% program   : RTKPOST ver.2.4.2",
    "%",
    "% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,ns=# of satellites)",
)
NAMES = "Q  ns   sdn(m)   sde(m)   sdu(m)  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio"


def pos_rows(stamps: Sequence[str]) -> list[str]:
    return [
        f"{stamp}   {LATITUDE[row]:.9f}   {LONGITUDE[row]:.9f}   {HEIGHT[row]:.4f}   1   9  {SIGMA[row, 0]:.4f}  "
        f"{SIGMA[row, 1]:.4f}  {SIGMA[row, 2]:.4f}   0.0010  -0.0010   0.0020   0.00   10.0"
        for row, stamp in enumerate(stamps)
    ]  # fmt: skip


def dates() -> list[str]:
    return [(WHEN + timedelta(seconds=float(each))).strftime("%Y/%m/%d %H:%M:%S.%f")[:-3] for each in TIME]


def test_rtklib_positions_with_dates_in_gps_time(tmp_path: Path) -> None:
    head = f"%  GPST                  latitude(deg) longitude(deg)  height(m)   {NAMES}"
    track = read_track(written(tmp_path, "a.pos", [*POS_HEADER, head, *pos_rows(dates())]))
    check(track)
    assert track.position_sigma == pytest.approx(SIGMA, abs=5e-5)
    seconds = (WHEN - datetime(1980, 1, 6, tzinfo=UTC)).total_seconds()
    assert track.start == seconds
    assert track.notes == ("times are GPS time, s since 1980-01-06",)
    weeks = [f"{int(seconds // 604_800)} {seconds % 604_800 + each:.3f}" for each in TIME]
    same = read_track(written(tmp_path, "b.pos", [*POS_HEADER, head, *pos_rows(weeks)]))
    check(same)
    assert same.start == seconds
    utc = read_track(written(tmp_path, "c.txt", [head.replace("GPST", "UTC "), *pos_rows(dates())]))
    check(utc)
    assert utc.start == WHEN.timestamp()
    without_header = read_track(written(tmp_path, "d.txt", pos_rows(weeks)))
    check(without_header)


def test_rtklib_positions_in_earth_fixed_axes_have_the_same_sigmas(tmp_path: Path) -> None:
    """Written from latitude, longitude and height by the closed form, and a covariance turned by the rotation."""
    from scipy.spatial.transform import Rotation

    latitude, longitude = np.radians([LATITUDE, LONGITUDE])
    squared = 1.0 - (1.0 - 1.0 / 298.257223563) ** 2
    prime = 6_378_137.0 / np.sqrt(1.0 - squared * np.sin(latitude) ** 2)
    lines = []
    for row, stamp in enumerate(dates()):
        phi, lam, height = latitude[row], longitude[row], HEIGHT[row]
        x = (prime[row] + height) * np.cos(phi) * np.cos(lam)
        y = (prime[row] + height) * np.cos(phi) * np.sin(lam)
        z = (prime[row] * (1.0 - squared) + height) * np.sin(phi)
        to_fixed = Rotation.from_euler("ZYX", [lam, -phi - np.pi / 2.0, 0.0]).as_matrix()
        covariance = to_fixed @ np.diag(SIGMA[row] ** 2) @ to_fixed.T
        signed = np.sign(covariance) * np.sqrt(np.abs(covariance))
        places = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
        lines.append(
            f"{stamp} {x:.4f} {y:.4f} {z:.4f} 5 8 " + " ".join(f"{signed[each]:.9f}" for each in places) + " 0 0"
        )
    head = "%  GPST x-ecef(m) y-ecef(m) z-ecef(m) Q ns sdx(m) sdy(m) sdz(m) sdxy(m) sdyz(m) sdzx(m) age(s) ratio"
    track = read_track(written(tmp_path, "a.pos", [head, *lines]))
    check(track, 2e-9, 2e-4)
    assert track.position_sigma == pytest.approx(SIGMA, abs=1e-6)


def test_bad_position_files_are_refused_in_one_line(tmp_path: Path) -> None:
    head = f"%  GPST latitude(deg) longitude(deg) height(m) {NAMES}"
    assert "has no positions" in refused(written(tmp_path, "a.pos", [head]))
    rows = pos_rows(dates())
    assert "line 3: has 4 columns; expected 15" in refused(written(tmp_path, "a.pos", [head, rows[0], rows[1][:50]]))
    assert "line 3, latitude(deg): got 'x'" in refused(
        written(tmp_path, "a.pos", [head, rows[0], rows[1].replace("47.000010000", "x")])
    )
    baselines = "%  GPST e-baseline(m) n-baseline(m) u-baseline(m) Q ns sde sdn sdu sden sdnu sdue age ratio"
    assert "has baselines" in refused(written(tmp_path, "a.pos", [baselines, *rows]))
    assert "times must rise" in refused(written(tmp_path, "a.pos", [head, rows[1], rows[0]]))


def sentence(body: str) -> str:
    return f"${body}*{reduce(lambda total, sign: total ^ ord(sign), body, 0):02X}"


def minutes(angle: float, width: int) -> str:
    return f"{int(angle):0{width}d}{(angle - int(angle)) * 60.0:011.8f}"


def nmea(dated: bool = True) -> list[str]:
    lines = []
    for row, seconds in enumerate(TIME):
        clock = (WHEN + timedelta(seconds=float(seconds))).strftime("%H%M%S.%f")[:-3]
        place = f"{minutes(LATITUDE[row], 2)},N,{minutes(LONGITUDE[row], 3)},E"
        lines.append(sentence(f"GPGGA,{clock},{place},4,12,0.8,{HEIGHT[row] - 46.9:.4f},M,46.9,M,,"))
        if dated:
            lines.append(sentence(f"GNRMC,{clock},A,{place},10.0,90.0,040323,,,A"))
        north, east, up = SIGMA[row]
        lines.append(sentence(f"GPGST,{clock},0.5,0.1,0.1,0.0,{north:.4f},{east:.4f},{up:.4f}"))
    return lines


def test_nmea_sentences_of_one_time_are_one_position(tmp_path: Path) -> None:
    track = read_track(written(tmp_path, "a.nmea", nmea()))
    check(track, 1e-9, 2e-4)
    assert track.start == WHEN.timestamp()
    assert track.position_sigma == pytest.approx(SIGMA, abs=5e-5)
    assert track.notes == ("times are UTC, s since 1970-01-01",)
    assert read_table(tmp_path / "a.nmea")["speed [m/s]"][0] == pytest.approx(10.0 * 1852.0 / 3600.0)
    undated = read_track(written(tmp_path, "b.txt", nmea(False)))
    assert undated.start == 5 * 3600 + 6 * 60 + 7
    assert "seconds of the day" in undated.notes[0]


def test_nmea_goes_on_after_midnight_and_leaves_out_wrong_checksums(tmp_path: Path) -> None:
    clocks = ("235959.00", "000000.00", "000001.00")
    lines = [sentence(f"GPGGA,{clock},4700.0,N,00830.0,E,1,8,1.0,500.0,M,,M,,") for clock in clocks]
    lines.append(lines[-1].replace("4700.0", "4800.0"))
    lines.append(sentence("GPGGA,000002.00,,,,,0,,,,M,,M,,"))
    track = read_track(written(tmp_path, "a.nmea", lines))
    assert track.time.tolist() == [0.0, 1.0, 2.0]
    assert "1 sentence of a wrong checksum left out" in track.notes
    assert "1 sentence without a position left out" in track.notes
    assert "3 rows without a separation of the geoid: altitudes above sea level" in track.notes
    assert "has no GGA sentence" in refused(written(tmp_path, "b.nmea", ["$GPGSV,1,1,00*79"]))


def gpx(points: str) -> str:
    return (
        '<?xml version="1.0"?><gpx version="1.1" xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>'
        f"{points}</trkseg></trk></gpx>"
    )


def test_gpx_tracks(tmp_path: Path) -> None:
    points = "".join(
        f'<trkpt lat="{LATITUDE[row]:.9f}" lon="{LONGITUDE[row]:.9f}"><ele>{HEIGHT[row]:.4f}</ele>'
        f"<time>{(WHEN + timedelta(seconds=float(TIME[row]))).isoformat().replace('+00:00', 'Z')}</time></trkpt>"
        for row in range(COUNT)
    )
    track = read_track(written(tmp_path, "a.gpx", [gpx(points)]))
    check(track)
    assert track.start == WHEN.timestamp()
    assert "usually above sea level" in track.notes[1]
    no_time = gpx('<trkpt lat="47" lon="8"><ele>1</ele></trkpt>')
    assert "point 1: has no time; a trajectory needs it" in refused(written(tmp_path, "b.gpx", [no_time]))
    assert "has no track points" in refused(written(tmp_path, "c.gpx", [gpx("")]))
    assert "is no XML" in refused(written(tmp_path, "d.gpx", ["<gpx><trk>"]))


def ulog(path: Path, topics: dict[str, tuple[str, list[bytes]]]) -> Path:
    """Write a ULog by its specification: header, flags, formats, subscriptions, data.

    A number behind the name of a topic, as in ``sensor_gyro.1``, is that of its instance.
    """

    def message(kind: str, body: bytes) -> bytes:
        return struct.pack("<HB", len(body), ord(kind)) + body

    content = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + message("B", bytes(40))
    for name, (form, _) in topics.items():
        if "." not in name:
            content += message("F", f"{name}:{form}".encode())
    for number, name in enumerate(topics):
        topic, _, instance = name.partition(".")
        content += message("A", struct.pack("<BH", int(instance or 0), number) + topic.encode())
    for number, (_, rows) in enumerate(topics.values()):
        content += b"".join(message("D", struct.pack("<H", number) + row) for row in rows)
    path.write_bytes(content)
    return path


def inertial() -> np.ndarray:
    return np.random.default_rng(1).normal([0.0, 0.0, 0.0, 0.0, 0.0, -9.8], 0.01, (COUNT, 6)).astype(np.float32)


def px4_log(path: Path) -> Path:
    """A log with inertial sensors, a receiver's positions of both generations, and an attitude."""
    stamps = [1_000_000 + round(1e6 * each) for each in TIME]
    combined = [struct.pack("<Q6f", stamp, *row) for stamp, row in zip(stamps, inertial(), strict=True)]
    heights = np.round(1e3 * HEIGHT).astype(int)
    places = np.round(1e7 * np.stack([LATITUDE, LONGITUDE])).astype(int)
    coded = np.stack([*places, heights - 46_900, heights], axis=1).tolist()
    old = [
        struct.pack("<Q4i5fB", stamp, *coded[row], 0.5, 1.5, 1.0, 2.0, 3.0, 3 if row else 2)
        for row, stamp in enumerate(stamps)
    ]
    fused = [
        struct.pack("<Qddf", stamp, LATITUDE[row], LONGITUDE[row], HEIGHT[row]) for row, stamp in enumerate(stamps)
    ]
    half = np.radians(30.0) / 2.0
    attitude = [struct.pack("<Q4f", stamp, np.cos(half), 0.0, 0.0, np.sin(half)) for stamp in stamps]
    return ulog(path, {
        "sensor_combined": ("uint64_t timestamp;float[3] gyro_rad;float[3] accelerometer_m_s2;", combined),
        "vehicle_gps_position": (
            "uint64_t timestamp;int32_t lat;int32_t lon;int32_t alt;int32_t alt_ellipsoid;float eph;float epv;"
            "float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;uint8_t fix_type;", old,
        ),
        "vehicle_global_position": ("uint64_t timestamp;double lat;double lon;float alt;", fused),
        "vehicle_attitude": ("uint64_t timestamp;float[4] q;", attitude),
    })  # fmt: skip


def test_px4_logs_hold_inertial_sensors_positions_and_attitude(tmp_path: Path) -> None:
    path = px4_log(tmp_path / "flight.ulg")
    log = read_imu_log(path)
    assert log.start == 1.0
    assert log.interval == 0.2
    assert np.array_equal(np.column_stack([log.gyro, log.accelerometer]), inertial())
    track = read_track(path)
    np.testing.assert_allclose(np.degrees(track.latitude), LATITUDE[1:], atol=0.51e-7)
    np.testing.assert_allclose(track.altitude, HEIGHT[1:], atol=1e-9)
    assert np.all(track.velocity == [1.0, 2.0, 3.0])
    assert np.all(track.position_sigma == [0.5, 0.5, 1.5])
    assert "1 row without a fix in three dimensions left out" in track.notes
    fused = read_track(path, {"topic": "vehicle_global_position"})
    check(fused, 1e-9, 1e-4)
    np.testing.assert_allclose(fused.attitude, np.radians([0.0, 0.0, 30.0]) + np.zeros((COUNT, 3)), atol=1e-6)
    from pyulog import ULog

    again = tmp_path / "again.ulg"
    ULog(str(path)).write_ulog(str(again))
    assert np.array_equal(read_imu_log(again).gyro, log.gyro)


def test_a_topic_that_is_not_there_is_refused_with_those_that_are(tmp_path: Path) -> None:
    path = px4_log(tmp_path / "flight.ulg")
    told = "sensor_combined, vehicle_global_position, vehicle_gps_position, vehicle_attitude"
    assert f"has no topic 'sensor_baro'; it has {told}" in refused(path, read_imu_log, columns={"topic": "sensor_baro"})
    assert f'has several topics; name one: columns = {{ topic = "…" }}, of {told}' in refused(path, read_table)
    path.write_bytes(path.read_bytes()[:12])
    assert "is no PX4 log that can be read" in refused(path, read_imu_log)
    bare = ulog(tmp_path / "bare.ulg", {"cpuload": ("uint64_t timestamp;float load;", [struct.pack("<Qf", 1, 0.5)])})
    assert "has none of sensor_combined" in refused(bare, read_imu_log)
    assert list(read_table(bare)["load"]) == [0.5]


def bag(path: Path, second: bool = False, kind_of_covariance: int = 2) -> Path:
    """Write a bag of ROS 1 or 2 by rosbags, by the ending of its path."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    first = path.suffix == ".bag"
    store = get_typestore(Stores.ROS1_NOETIC if first else Stores.ROS2_HUMBLE)
    kinds = store.types
    header, time, vector = (
        kinds[each] for each in ("std_msgs/msg/Header", "builtin_interfaces/msg/Time", "geometry_msgs/msg/Vector3")
    )
    sequence = {"seq": 0} if first else {}

    def head(row: int) -> Any:
        nanoseconds = 1_678_000_000_000_000_000 + round(1e9 * TIME[row])
        return header(stamp=time(*divmod(nanoseconds, 10**9)), frame_id="imu", **sequence)

    zero = np.zeros(9)
    plugin = StoragePlugin.MCAP if path.suffix == ".mcap" else StoragePlugin.SQLITE3
    writer: Any = Writer1(path) if first else Writer2(path, version=9, storage_plugin=plugin)
    with writer:
        topics = {}
        for name, kind in {"/imu": "Imu", "/fix": "NavSatFix", **({"/imu2": "Imu"} if second else {})}.items():
            topics[name] = writer.add_connection(name, f"sensor_msgs/msg/{kind}", typestore=store)
        serialize = store.serialize_ros1 if first else store.serialize_cdr
        for row, values in enumerate(inertial().astype(float)):
            turned = kinds["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
            imu = kinds["sensor_msgs/msg/Imu"](
                head(row), turned, zero, vector(*values[:3]), zero, vector(*values[3:]), zero
            )
            status = kinds["sensor_msgs/msg/NavSatStatus"](status=0 if row else -1, service=1)
            covariance = np.diag(SIGMA[row][[1, 0, 2]] ** 2).reshape(-1)
            fix = kinds["sensor_msgs/msg/NavSatFix"](
                head(row), status, LATITUDE[row], LONGITUDE[row], HEIGHT[row], covariance, kind_of_covariance
            )
            for name, connection in topics.items():
                message, kind = (fix, "NavSatFix") if name == "/fix" else (imu, "Imu")
                writer.write(connection, 5 + row, serialize(message, f"sensor_msgs/msg/{kind}"))
    return path


@pytest.mark.parametrize("name", ["a.bag", "a.sqlite", "a.mcap"])
def test_bags_of_ros_hold_inertial_sensors_and_positions(tmp_path: Path, name: str) -> None:
    path = bag(tmp_path / name)
    places = [path] if path.is_file() else [path, *path.glob("*.db3"), *path.glob("*.mcap")]
    assert len(places) == (1 if name == "a.bag" else 2)
    for place in places:
        log = read_imu_log(place)
        assert log.start == 1_678_000_000.0
        assert log.interval == 0.2
        assert np.array_equal(np.column_stack([log.gyro, log.accelerometer]), inertial().astype(float))
        track = read_track(place)
        assert np.array_equal(np.degrees(track.latitude), LATITUDE[1:]) or np.allclose(
            np.degrees(track.latitude), LATITUDE[1:], rtol=1e-15
        )
        assert track.position_sigma == pytest.approx(SIGMA[1:], rel=1e-12)
        assert "1 row without a fix left out" in track.notes


def test_several_topics_of_a_bag_are_refused_with_their_names(tmp_path: Path) -> None:
    path = bag(tmp_path / "a.bag", second=True)
    told = "/fix (sensor_msgs/msg/NavSatFix), /imu (sensor_msgs/msg/Imu), /imu2 (sensor_msgs/msg/Imu)"
    assert f'name one: columns = {{ topic = "…" }}, of {told}' in refused(path, read_imu_log)
    assert read_imu_log(path, {"topic": "/imu2"}).interval == 0.2
    assert f"has no topic '/gps'; it has {told}" in refused(path, read_imu_log, columns={"topic": "/gps"})
    path.write_bytes(path.read_bytes()[:5000])
    assert "is no ROS bag that can be read" in refused(path, read_imu_log)


def test_text_files_of_kf_gins_are_told_by_the_number_of_their_columns(tmp_path: Path) -> None:
    gnss = np.column_stack([456_300.0 + TIME, LATITUDE, LONGITUDE, HEIGHT, SIGMA])
    np.savetxt(tmp_path / "GNSS_RTK.txt", gnss, "%.12f", "  ")
    track = read_track(tmp_path / "GNSS_RTK.txt")
    check(track, 1e-11, 1e-11)
    assert track.start == 456_300.0
    assert track.position_sigma == pytest.approx(SIGMA)
    motion = np.tile([1.0, 2.0, -0.5, 0.1, 0.2, 359.0], (COUNT, 1))
    navigation = np.column_stack([0.0 * TIME, 456_300.0 + TIME, LATITUDE, LONGITUDE, HEIGHT, motion])
    np.savetxt(tmp_path / "KF_GINS_Navresult.nav", navigation, "%.12f", " ")
    track = read_track(tmp_path / "KF_GINS_Navresult.nav")
    check(track, 1e-11, 1e-11)
    assert track.velocity == pytest.approx(motion[:, :3])
    assert track.attitude == pytest.approx(np.radians(motion[:, 3:]))
    np.savetxt(tmp_path / "imu.txt", np.column_stack([TIME, inertial()]), "%.12f", " ")
    assert "between 0 and 1e+09" in refused(tmp_path / "imu.txt")


def test_tracks_in_tables_ask_for_what_their_names_do_not_tell(tmp_path: Path) -> None:
    rows = np.column_stack([TIME, np.radians(LATITUDE), np.radians(LONGITUDE), HEIGHT])
    np.savetxt(tmp_path / "a.csv", rows, "%.17g", ",", header="t,lat,lon,h", comments="")
    assert 'state it: units = { position = "rad" }' in refused(tmp_path / "a.csv")
    check(read_track(tmp_path / "a.csv", units={"position": "rad"}))
    np.savetxt(tmp_path / "b.csv", rows, "%.17g", ",", header="t,lat [rad],lon [rad],h,vn,ve"[:-6], comments="")
    check(read_track(tmp_path / "b.csv"))
    named = {"time": "t", "latitude": "a", "longitude": "b", "altitude": "-c"}
    np.savetxt(tmp_path / "c.csv", rows * [1, 1, 1, -1], "%.17g", ",", header="t,a,b,c", comments="")
    assert "none of them is latitude or longitude or altitude by its name" in refused(tmp_path / "c.csv")
    check(read_track(tmp_path / "c.csv", named, {"position": "rad"}))
    rows[5, 2] = np.nan
    np.savetxt(tmp_path / "d.csv", rows, "%.17g", ",", header="t,lat,lon,h", comments="")
    assert "line 7, lon: has no number" in refused(tmp_path / "d.csv")


def test_tracks_in_nautical_miles_and_knots(tmp_path: Path) -> None:
    def track(length: str, speed: str) -> Path:
        names = f"time,lat,lon,alt [{length}],vel_north [{speed}],vel_east [{speed}],vel_down [{speed}]"
        rows = [f"{t},{a:.9f},{o:.9f},{h / 1852.0:.12f},36,0,-3.6"
                for t, a, o, h in zip(TIME, LATITUDE, LONGITUDE, HEIGHT, strict=True)]  # fmt: skip
        return written(tmp_path, "track.csv", [names, *rows])

    for length, speed in (("NM", "kn"), ("nmi", "kt"), ("NM", "KTS")):
        found = read_track(track(length, speed))
        check(found)
        assert found.velocity is not None
        np.testing.assert_allclose(
            found.velocity, np.broadcast_to([18.52, 0.0, -1.852], found.velocity.shape), rtol=1e-14
        )
    assert "NM or nmi?" in refused(track("nm", "kn"))


def test_missing_libraries_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    path = px4_log(tmp_path / "flight.ulg")
    monkeypatch.setitem(sys.modules, "pyulog", None)
    assert "needs pyulog: pip install 'mcnav[logs]'" in refused(path, read_imu_log)
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    (tmp_path / "a.bag").write_bytes(b"#ROSBAG V2.0\n")
    assert "needs rosbags: pip install 'mcnav[logs]'" in refused(tmp_path / "a.bag", read_imu_log)
