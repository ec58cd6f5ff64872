"""Records of inertial sensors: names and units of columns, and what is refused or noted."""

from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from mcnav.logs.imu_log import ImuLog, read_imu_log, remark_on_axes
from mcnav.logs.log_error import LogError
from mcnav.logs.tables import read_table
from mcnav.physics.constants import STANDARD_GRAVITY

ROWS = 400
INTERVAL = 0.005
NAMES = ("time", "gyro_x", "gyro_y", "gyro_z", "acc_x", "acc_y", "acc_z")


def readings(offset: float = 432_000.0) -> np.ndarray:
    """Return time, rates and specific forces at rest, shape (ROWS, 7)."""
    rng = np.random.default_rng(5)
    rates = rng.normal(0.0, 1e-3, (ROWS, 3))
    forces = rng.normal([0.0, 0.0, -STANDARD_GRAVITY], 0.02, (ROWS, 3))
    return np.column_stack([offset + np.arange(ROWS) * INTERVAL, rates, forces])


def write(
    folder: Path, rows: np.ndarray, names: str = ",".join(NAMES), delimiter: str = ",", form: str = "%.12g"
) -> Path:
    path = folder / "imu.csv"
    np.savetxt(path, rows, form, delimiter, header=names, comments="")
    return path


def same(log: ImuLog, rows: np.ndarray, tolerance: float = 1e-9) -> None:
    """Compare a log with rows in SI units, to the digits that are written."""
    np.testing.assert_allclose(log.time, rows[:, 0] - rows[0, 0], atol=1e-8)
    np.testing.assert_allclose(log.gyro, rows[:, 1:4], rtol=tolerance, atol=tolerance)
    np.testing.assert_allclose(log.accelerometer, rows[:, 4:], rtol=tolerance, atol=tolerance)
    assert log.interval == INTERVAL


def refused(path: Path, **given: dict[str, str]) -> str:
    """Return the line in which a log is refused."""
    with pytest.raises(LogError) as refusal:
        read_imu_log(path, **given)
    line = str(refusal.value)
    assert "\n" not in line
    assert str(path) in line
    return line


@pytest.mark.parametrize(
    ("names", "scales"),
    [
        (",".join(NAMES), (1.0, 1.0, 1.0)),
        ("t [s],wx [deg/s],wy [deg/s],wz [deg/s],fx [g],fy [g],fz [g]", (1.0, np.degrees(1.0), 1 / STANDARD_GRAVITY)),
        ("TimeUS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", (1e6, 1.0, 1.0)),
        ("time_ms,gyro_dps_x,gyro_dps_y,gyro_dps_z,acc_x_mg,acc_y_mg,acc_z_mg",
         (1e3, np.degrees(1.0), 1e3 / STANDARD_GRAVITY)),
        ("Time (s),Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),Accelerometer X (g),"
         "Accelerometer Y (g),Accelerometer Z (g)", (1.0, np.degrees(1.0), 1 / STANDARD_GRAVITY)),
    ],
)  # fmt: skip
def test_names_and_units_of_headers_are_understood(tmp_path: Path, names: str, scales: tuple[float, ...]) -> None:
    rows = readings()
    written = rows * np.repeat(scales, (1, 3, 3))
    log = read_imu_log(write(tmp_path, written, names, form="%.15g"))
    same(log, rows)
    assert log.start == pytest.approx(432_000.0)


def test_nanoseconds_since_1970_lose_no_digit(tmp_path: Path) -> None:
    names = (
        "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],"
        "a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]"
    )
    stamps = 1_403_636_579_763_555_584 + 5_000_123 * np.arange(ROWS)
    lines = [
        f"{stamp}," + ",".join(f"{each:.9g}" for each in row[1:]) for stamp, row in zip(stamps, readings(), strict=True)
    ]
    path = tmp_path / "data.csv"
    path.write_text("\n".join([names, *lines]), encoding="utf-8")
    log = read_imu_log(path)
    assert log.time[-1] == (5_000_123 * (ROWS - 1)) / 1e9
    assert log.interval == 0.005000123
    assert log.notes == ()


def test_increments_without_names_are_told_by_gravity(tmp_path: Path) -> None:
    rows = readings()
    increments = rows * np.repeat([1.0, INTERVAL, INTERVAL], (1, 3, 3))
    path = write(tmp_path, increments, "", "   ", "%.15g")
    log = read_imu_log(path)
    same(log, rows)
    assert "increments (as KF-GINS has them)" in log.notes[0]
    assert "divided by the interval of 0.005 s" in log.notes[1]


def test_rates_without_names_are_told_by_gravity(tmp_path: Path) -> None:
    log = read_imu_log(write(tmp_path, readings(), "", " ", "%.15g"))
    same(log, readings())
    assert "of rates" in log.notes[0]


def test_a_mapping_names_columns_negates_them_and_states_units(tmp_path: Path) -> None:
    rows = readings()
    flipped = rows[:, [0, 4, 5, 6, 1, 2, 3]] * [1.0, 1.0, -1.0, -1.0, 1.0, -1.0, -1.0]
    flipped[:, 4:] = np.degrees(flipped[:, 4:])
    path = write(tmp_path, flipped, "", form="%.15g")
    columns = {"time": "1", "gyro_x": "5", "gyro_y": "-6", "gyro_z": "-7"}
    columns |= {"accelerometer_x": "2", "accelerometer_y": "-3", "accelerometer_z": "-4"}
    same(read_imu_log(path, columns, {"gyro": "deg/s", "accelerometer": "m/s^2"}), rows)


def test_an_interval_stands_for_a_column_of_time(tmp_path: Path) -> None:
    path = write(tmp_path, readings()[:, 1:], ",".join(NAMES[1:]), form="%.15g")
    log = read_imu_log(path, {"interval": "5 ms"})
    assert log.interval == INTERVAL
    assert log.time[-1] == pytest.approx(INTERVAL * (ROWS - 1))
    assert "none of them is that of time" in refused(path)


def test_ambiguous_columns_are_refused_with_a_mapping_to_paste(tmp_path: Path) -> None:
    rows = np.column_stack([readings(), readings()[:, 1:4]])
    line = refused(write(tmp_path, rows, ",".join((*NAMES, "gyro2_x", "gyro2_y", "gyro2_z"))))
    assert 'columns = { gyro_x = "gyro_x", gyro_y = "gyro_y", gyro_z = "gyro_z" }' in line
    line = refused(write(tmp_path, readings()[:, :3], "a,b,c"))
    assert 'columns = { time = "…", gyro_x = "…"' in line
    line = refused(write(tmp_path, readings(), "", form="%.15g"), columns={"gyro_x": "2"})
    assert "names gyro_x only; expected gyro_y and gyro_z, too" in line
    line = refused(write(tmp_path, readings()), columns={"giro_x": "2"})
    assert "did you mean 'gyro_x'?" in line
    line = refused(write(tmp_path, readings()), units={"gyro": "rps"})
    assert "units.gyro_x: 'rps': rad/s or rev/s?" in line
    line = refused(write(tmp_path, readings()), units={"gyro": "furlong"})
    assert 'units.gyro_x: \'furlong\' is not a known unit; expected a unit such as "rad/s" or "rad"' in line


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ("falling", "line 102, time: got -0.5 s from the start after 0.495 s"),
        ("repeated", "line 102, time: repeats the time of the row before, 0.495 s from the start, with other values"),
        ("missing", "line 102, time: has no time; leave the row out"),
        ("empty cells", "line 102, gyro_y: has no number, like 300 rows of 400; leave them out"),
        ("deg", 'units = { gyro = "deg/s" }'),
        ("g", 'units = { accelerometer = "g" }'),
        ("ms", 'units = { time = "ms" }'),
        ("us", 'units = { time = "us" }'),
        ("ns", 'units = { time = "ns" }'),
        ("earth", 'the mean rate is 0.004178, that of the earth in deg/s'),
        ("one row", "has 1 row; expected at least two"),
        ("one row at zero", "has 1 row; expected at least two"),
    ],
)  # fmt: skip
def test_bad_logs_are_refused_in_one_line(tmp_path: Path, change: str, told: str) -> None:
    rows = readings(0.0 if change.endswith(("s", "zero")) else 432_000.0)
    if change == "falling":
        rows[100, 0] -= 1.0
    elif change == "repeated":
        rows[100, 0] = rows[99, 0]
    elif change == "missing":
        rows[100, 0] = np.nan
    elif change == "empty cells":
        rows[100:, 2] = np.nan
    elif change == "deg":
        rows[:, 1:4] = np.degrees(rows[:, 1:4] + [0.0, 0.0, 0.3])
    elif change == "g":
        rows[:, 4:] /= STANDARD_GRAVITY
    elif change == "earth":
        rows[:, 1:4] = 4.178e-3 / np.sqrt(3.0) + 1e-3 * (rows[:, 1:4] - rows[:, 1:4].mean(axis=0))
    elif change.startswith("one row"):
        rows = rows[:1]
    else:
        rows[:, 0] *= {"ms": 1e3, "us": 1e6, "ns": 1e9}[change]
    assert told in refused(write(tmp_path, rows, form="%.15g"))


def test_gaps_repeated_rows_missing_readings_and_saturation_are_noted(tmp_path: Path) -> None:
    rows = readings()
    rows[100] = rows[99]
    rows[200:, 0] += 0.5
    rows[250, 2] = np.nan
    rows[300:310, 3] = rows[:, 3].max() + 0.01
    notes = read_imu_log(write(tmp_path, rows, form="%.15g")).notes
    assert notes[0] == "1 row of 400 left out, without a reading (first line 252, gyro_y)"
    assert notes[1] == "1 row left out, the same as the one before"
    assert notes[2] == "3 gaps, the longest of 0.505 s after 0.995 s; 102 rows missing"
    assert notes[-1].startswith("gyro_z saturates at")
    assert notes[-1].endswith("10 rows, the longest run from 2 s")


def test_a_coarse_resolution_is_no_saturation(tmp_path: Path) -> None:
    rows = readings()
    rows[:, 1:4] = np.round(rows[:, 1:4] / 1e-3) * 1e-3
    assert not any("saturates" in note for note in read_imu_log(write(tmp_path, rows)).notes)


def test_seconds_of_the_week_go_on_over_its_end(tmp_path: Path) -> None:
    rows = readings(604_799.0)
    rows[:, 0] %= 604_800.0
    log = read_imu_log(write(tmp_path, rows, form="%.15g"))
    np.testing.assert_allclose(np.diff(log.time), INTERVAL, atol=1e-8)
    assert "the week of GPS time ends" in log.notes[0]


def test_gravity_tells_axes_that_are_swapped() -> None:
    rows = readings()
    log = ImuLog(rows[:, 0], 0.0, INTERVAL, rows[:, 1:4], rows[:, 4:], ())
    assert remark_on_axes(log) is None
    swapped = ImuLog(rows[:, 0], 0.0, INTERVAL, rows[:, 1:4], rows[:, [6, 5, 4]], ())
    assert "begins along -x, for axes forward, right, down it is along -z" in str(remark_on_axes(swapped))
    assert remark_on_axes(swapped, pitch=np.pi / 2.0) is not None
    assert remark_on_axes(swapped, pitch=-np.pi / 2.0) is None


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("", "is empty"),
        ("\n\n", "is empty"),
        ("# a comment\n", "has no rows, only comments"),
        ("time,gyro_x,gyro_y,gyro_z\n", "has a line of names and no rows"),
        ("time,gyro_x,gyro_y,gyro_z\n1,2,3,4\n2,3,x,4\n", "line 3, gyro_y: got 'x'; expected a number"),
        ("time,gyro_x,gyro_y,gyro_z\n1,2,3,4\n2,3,4\n", "line 3: has 3 columns; expected 4"),
        ("time,gyro_x,gyro_y,gyro_y\n1,2,3,4\n", "has 2 columns 'gyro_y'"),
        ("\0\1\2", "is no text"),
    ],
)
def test_damaged_tables_are_refused_in_one_line(tmp_path: Path, content: str, told: str) -> None:
    path = tmp_path / "imu.csv"
    path.write_text(content, encoding="utf-8")
    assert told in refused(path)


def test_a_file_of_a_thousand_million_rows_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = write(tmp_path, np.tile(readings(), (3, 1)), form="%.15g")
    with path.open("r+b") as file:
        file.truncate(path.stat().st_size // (3 * ROWS) * 1_000_000_000)  # a sparse file
    assert "at most 60,000,000 are read, so give a part of it" in refused(path)
    assert "no such file; expected a recorded file (.csv, " in refused(tmp_path / "none.csv")
    assert "is a folder" in refused(tmp_path)


def test_parquet_and_matlab_files_have_the_same_content_as_csv(tmp_path: Path) -> None:
    from scipy.io import savemat

    rows = readings()
    table = read_table(write(tmp_path, rows, form="%.17g"))
    assert tuple(table.columns) == NAMES
    table.to_parquet(tmp_path / "imu.parquet")
    savemat(tmp_path / "imu.mat", {"time": rows[:, 0], "log": {"gyro": rows[:, 1:4], "acc": rows[:, 4:].T}})
    same(read_imu_log(tmp_path / "imu.parquet"), rows, 0.0)
    same(read_imu_log(tmp_path / "imu.mat"), rows, 0.0)
    (tmp_path / "imu.mat").write_bytes(b"MATLAB 5.0 MAT-file" + bytes(200))
    assert "is no MATLAB file that can be read" in refused(tmp_path / "imu.mat")
    for compressed in (False, True):  # 8 MB of zeros are 8 kB
        savemat(tmp_path / "imu.mat", {"log": {"gyro": np.zeros((1_000_000, 1))}}, do_compression=compressed)
        with patch("mcnav.logs.binary_tables.MOST_BYTES", 7_000_000):
            assert "holds over 7,000,000 bytes of variables" in refused(tmp_path / "imu.mat")
        with patch("mcnav.logs.binary_tables.MOST_ROWS", 999_999):
            assert "has 1,000,000 rows; at most 999,999 are read" in refused(tmp_path / "imu.mat")
    (tmp_path / "imu.parquet").write_bytes(b"PAR1" + bytes(200))
    assert "is no parquet file that can be read" in refused(tmp_path / "imu.parquet")


def test_headers_in_the_encoding_of_windows_are_read_and_utf_16_is_refused(tmp_path: Path) -> None:
    rows = readings()
    names = "t [s],wx [°/s],wy [°/s],wz [°/s],fx [m/s²],fy [m/s²],fz [m/s²]"
    degrees = rows * [1.0, *[np.degrees(1.0)] * 3, 1.0, 1.0, 1.0]
    content = write(tmp_path, degrees, "t").read_text("utf-8").removeprefix("t\n")
    for encoding in ("cp1252", "utf-8-sig", "utf-8"):
        (tmp_path / "imu.csv").write_bytes(f"{names}\n{content}".encode(encoding))
        same(read_imu_log(tmp_path / "imu.csv"), rows, 1e-8)
    (tmp_path / "imu.csv").write_bytes(f"{names}\n{content}".encode("utf-16"))
    assert "is UTF-16 text; save it as UTF-8" in refused(tmp_path / "imu.csv")
