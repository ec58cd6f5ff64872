"""Trajectory files: every form gives the same rows, and what is wrong is told in one line with row and column."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import WGS84
from mcnav.systems.ins.tables import trajectory_file
from mcnav.systems.ins.tables.trajectory_file import read_trajectory_file
from mcnav.systems.ins.truth.rows import COLUMNS, TrajectoryError, TrajectoryRows

RATE = 10.0
"""Rows per second."""


def flight(seconds: float = 40.0, rate: float = RATE) -> dict[str, Array]:
    """A climbing turn at about 150 m/s, with velocities by the closed-form derivative, in the units of a file."""
    time = np.round(np.arange(0.0, seconds, 1.0 / rate), 9)
    turn = 2.0 * np.pi / 120.0
    latitude = np.radians(47.0) + 4.5e-4 * np.sin(turn * time)
    longitude = np.radians(9.0) - 6.6e-4 * np.cos(turn * time)
    altitude = 3_000.0 + 5.0 * time
    meridian, prime = WGS84.curvature_radii(latitude)
    north = (meridian + altitude) * 4.5e-4 * turn * np.cos(turn * time)
    east = (prime + altitude) * np.cos(latitude) * 6.6e-4 * turn * np.sin(turn * time)
    heading = np.degrees(np.arctan2(east, north)) % 360.0
    columns = (time, np.degrees(latitude), np.degrees(longitude), altitude, north, east, np.full_like(time, -5.0))
    return dict(zip(COLUMNS, (*columns, np.full_like(time, 10.0), np.full_like(time, 2.0), heading), strict=True))


def write_csv(path: Path, columns: Mapping[str, Array], header: bool = True, delimiter: str = ",") -> Path:
    lines = [delimiter.join(columns)] if header else []
    lines += [delimiter.join(repr(float(value)) for value in row) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def write_parquet(path: Path, columns: Mapping[str, object]) -> Path:
    pq.write_table(pa.table(dict(columns)), path)
    return path


def refused(path: Path, columns: Mapping[str, str] | None = None) -> str:
    with pytest.raises(TrajectoryError) as found:
        read_trajectory_file(path, columns)
    message = str(found.value)
    assert message.isprintable(), "one line that any terminal can show"
    return message


def assert_rows_equal(found: TrajectoryRows, columns: Mapping[str, Array]) -> None:
    """Compare to rounding: a conversion of degrees is a product."""
    close = {"rtol": 1e-15, "atol": 0.0}
    np.testing.assert_allclose(found.time, columns["time"], **close)
    np.testing.assert_allclose(found.latitude, np.radians(columns["lat"]), **close)
    np.testing.assert_allclose(found.longitude, np.radians(columns["lon"]), **close)
    np.testing.assert_allclose(found.altitude, columns["alt"], **close)
    angles = np.radians([columns[name] for name in ("heading", "pitch", "roll")]).T
    np.testing.assert_allclose(found.angles, angles, **close)
    if found.velocity is not None:
        velocity = np.array([columns[name] for name in ("VN", "VE", "VD")]).T
        np.testing.assert_allclose(found.velocity, velocity, **close)


def test_csv_with_and_without_header_and_parquet(tmp_path: Path) -> None:
    columns = flight()
    paths = [
        write_csv(tmp_path / "a.csv", columns),
        write_csv(tmp_path / "b.csv", columns, header=False),
        write_csv(tmp_path / "c.txt", columns, delimiter=";"),
        write_csv(tmp_path / "d.csv", dict(reversed(columns.items()))),
        write_csv(tmp_path / "e.csv", {"extra": columns["alt"], **columns}),
        write_parquet(tmp_path / "f.parquet", columns),
    ]
    for path in paths:
        rows = read_trajectory_file(path)
        assert rows.velocity is not None
        assert_rows_equal(rows, columns)


@pytest.mark.parametrize("end", [b"\r\n", b"\r"])
def test_other_ends_of_lines(end: bytes, tmp_path: Path) -> None:
    path = write_csv(tmp_path / "flight.csv", flight())
    expected = read_trajectory_file(path)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", end))
    np.testing.assert_array_equal(read_trajectory_file(path).latitude, expected.latitude)


def test_velocities_may_be_missing(tmp_path: Path) -> None:
    columns = {name: values for name, values in flight().items() if not name.startswith("V")}
    rows = read_trajectory_file(write_csv(tmp_path / "flight.csv", columns))
    assert rows.velocity is None
    assert rows.disagreement(rows.truth(WGS84)) is None
    assert_rows_equal(rows, columns)
    partly = {**columns, "VN": flight()["VN"]}
    assert "has VN only; give VN, VE and VD, or none" in refused(write_csv(tmp_path / "partly.csv", partly))


def test_other_names_and_units(tmp_path: Path) -> None:
    columns = flight()
    other = {
        "t": columns["time"] / 60.0,
        "latitude": np.radians(columns["lat"]), "lon [mrad]": 1e3 * np.radians(columns["lon"]),
        "height": columns["alt"] / 0.3048, "vn": columns["VN"] * 3.6, **{name: columns[name] for name in COLUMNS[5:]},
    }  # fmt: skip
    named = {"time": "t [min]", "lat": "latitude [rad]", "alt": "height [ft]", "VN": "vn [km/h]"}
    rows = read_trajectory_file(write_csv(tmp_path / "other.csv", other), named)
    expected = {name: np.radians(columns[name]) for name in ("lat", "lon")}
    # a unit there and back, and the decimal text between them: a few roundings
    np.testing.assert_allclose(rows.latitude, expected["lat"], rtol=1e-15)
    np.testing.assert_allclose(rows.longitude, expected["lon"], rtol=1e-15)
    np.testing.assert_allclose(rows.time, columns["time"], rtol=1e-15)
    np.testing.assert_allclose(rows.altitude, columns["alt"], rtol=1e-15)
    assert rows.velocity is not None
    np.testing.assert_allclose(rows.velocity[:, 0], columns["VN"], rtol=1e-15)


def test_nautical_miles_and_knots(tmp_path: Path) -> None:
    columns = flight()
    knots = {f"{name} [kn]": columns[name] * 3600.0 / 1852.0 for name in ("VN", "VE", "VD")}
    others = {name: columns[name] for name in COLUMNS if name not in ("alt", "VN", "VE", "VD")}
    rows = read_trajectory_file(
        write_csv(tmp_path / "nautical.csv", {"alt [NM]": columns["alt"] / 1852.0, **others, **knots})
    )
    np.testing.assert_allclose(rows.altitude, columns["alt"], rtol=1e-15)
    assert rows.velocity is not None
    # a quotient in the file and a factor that is one: a few roundings
    np.testing.assert_allclose(rows.velocity[:, 1], columns["VE"], rtol=1e-15)
    line = refused(write_csv(tmp_path / "nano.csv", {"alt [nm]": columns["alt"], **others, **knots}))
    assert "columns.alt: 'nm': NM or nmi?" in line


def test_integers_and_short_floats_of_parquet(tmp_path: Path) -> None:
    columns: dict[str, object] = {**flight()}
    columns["alt"] = np.full(len(flight()["alt"]), 3_000, dtype=np.int32)
    columns["VD"] = np.zeros(len(flight()["alt"]), dtype=np.float32)
    rows = read_trajectory_file(write_parquet(tmp_path / "flight.parquet", columns))
    assert rows.altitude.dtype == np.float64
    assert np.all(rows.altitude == 3_000.0)


def test_wrapping_longitudes_and_headings_are_harmless(tmp_path: Path) -> None:
    """A flight across 180 deg is the flight across 9 deg, turned with the earth."""
    columns = flight()
    shifted = columns["lon"] - columns["lon"][200] + 180.0
    wrapped = np.where(shifted > 180.0, shifted - 360.0, shifted)
    assert np.ptp(wrapped) > 359.0
    heading = np.where(np.arange(len(wrapped)) % 2, columns["heading"], columns["heading"] - 360.0)
    rows = read_trajectory_file(write_csv(tmp_path / "wrap.csv", {**columns, "lon": wrapped, "heading": heading}))
    plain = read_trajectory_file(write_csv(tmp_path / "plain.csv", columns))
    time = np.linspace(0.0, columns["time"][-1], 97)
    found, expected = (each.truth(WGS84).states(time, "strapdown", 0.0) for each in (rows, plain))
    # second derivatives amplify rounding of 1e-9 m positions by the square of the rate, times a few
    np.testing.assert_allclose(found.force, expected.force, atol=20 * 1e-9 * RATE**2)


def test_disagreement_of_velocities_is_reported(tmp_path: Path) -> None:
    columns = flight()
    rows = read_trajectory_file(write_csv(tmp_path / "flight.csv", columns))
    found = rows.disagreement(rows.truth(WGS84))
    assert found is not None
    # the derivative of a cubic spline is wrong by h^3 x'''' / 24 inside and some ten times as much at its ends
    size = 150.0 * (2.0 * np.pi / 120.0) ** 3 / RATE**3 / 24.0
    assert found.largest < 20.0 * size
    columns["VE"] = columns["VE"] + np.where(np.arange(len(columns["VE"])) == 123, 5.0, 0.0)
    rows = read_trajectory_file(write_csv(tmp_path / "off.csv", columns))
    found = rows.disagreement(rows.truth(WGS84))
    assert found is not None
    assert (found.row, found.time) == (124, pytest.approx(12.3))
    assert found.largest == pytest.approx(5.0, abs=20.0 * size)
    assert found.rms == pytest.approx(5.0 / np.sqrt(len(rows)), rel=0.01)


def _at(column: str, row: int, value: float) -> Callable[[dict[str, Array]], None]:
    def change(columns: dict[str, Array]) -> None:
        columns[column] = columns[column].copy()
        columns[column][row] = value

    return change


def _scaled(factor: float, *names: str) -> Callable[[dict[str, Array]], None]:
    return lambda columns: columns.update({name: factor * columns[name] for name in names})


def _swapped(columns: dict[str, Array]) -> None:
    columns["lat"], columns["lon"] = columns["lon"] + 100.0, columns["lat"]


def _gap(columns: dict[str, Array]) -> None:
    columns.update({name: np.delete(values, slice(100, 112)) for name, values in columns.items()})


def _pole(columns: dict[str, Array]) -> None:
    columns["lat"] = 89.5 + np.linspace(0.0, 0.45, len(columns["lat"]))


def _jump(size: float) -> Callable[[dict[str, Array]], None]:
    def change(columns: dict[str, Array]) -> None:
        columns["lon"] = columns["lon"] + np.where(
            np.arange(len(columns["lon"])) >= 150, np.degrees(size / 4.35e6), 0.0
        )

    return change


def _without_velocities(change: Callable[[dict[str, Array]], None]) -> Callable[[dict[str, Array]], None]:
    def both(columns: dict[str, Array]) -> None:
        change(columns)
        for name in ("VN", "VE", "VD"):
            del columns[name]

    return both


PER_RADIAN = float(np.degrees(1.0))


def test_the_specific_force_of_a_jump_is_told(tmp_path: Path) -> None:
    """At rest, 60 m up within 0.2 s after a step of 0.1 s: 60 / 0.2 / 0.15 m/s^2 and gravity, 9.81 m/s^2, in g."""
    rows, jump = 50, 20
    time = 0.1 * np.arange(rows) + np.where(np.arange(rows) > jump, 0.1, 0.0)
    columns = {name: np.zeros(rows) for name in COLUMNS if not name.startswith("V")}
    columns |= {"time": time, "lat": np.full(rows, 47.0), "alt": np.where(np.arange(rows) > jump, 160.0, 100.0)}
    force = (60.0 / 0.2 / 0.15 + 9.81) / 9.80665
    told = f"line 22, column alt: the positions around it imply a specific force of {force:.4g} g, above the limit of"
    assert told in refused(write_csv(tmp_path / "flight.csv", columns))


BAD: dict[str, tuple[Callable[[dict[str, Array]], None], str]] = {
    "repeated time": (_at("time", 7, 0.6), "line 9, column time: got 0.6 s, the same time as in the row before"),
    "falling time": (_at("time", 7, 0.55), "line 9, column time: got 0.55 s, which falls from 0.6 s"),
    "gap": (_gap, "line 102, column time: follows a gap of 1.3 s, where the median step is 0.1 s"),
    "no number": (_at("alt", 20, np.nan), "line 22, column alt: got no number; expected a finite number"),
    "infinite": (_at("VE", 0, np.inf), "line 2, column VE: got inf; expected a finite number"),
    "pole": (_pole, "comes within 10 km of a pole"),
    "beyond the pole": (_at("lat", 3, 95.0), "line 5, column lat: got 95 deg; it lies between -90 and 90 deg"),
    "swapped": (_swapped, "lat and lon may be swapped"),
    "longitude": (_at("lon", 9, 400.0), "line 11, column lon: got 400 deg"),
    "altitude": (_at("alt", 9, -2e4), "line 11, column alt: got -20000 m; altitudes are positive upwards"),
    "pitch": (_at("pitch", 9, 91.0), "line 11, column pitch: got 91 deg"),
    "radians": (_scaled(1.0 / PER_RADIAN, "lat", "lon"), "columns lat and lon: the positions' derivative differs"),
    "latitude in radians": (_scaled(1.0 / PER_RADIAN, "lat"), "column lat: the positions' derivative differs"),
    "headings in radians": (_scaled(1.0 / PER_RADIAN, "heading"), "column heading: departs from the course"),
    "a jump against velocities": (_jump(60.0), "line 152, column lon: the position jumps: from the row before"),
    "a jump without velocities": (_without_velocities(_jump(60.0)), "line 151, column lon: the positions around it"),
    "other velocities": (_scaled(3.28084, "VN", "VE", "VD"), "are not the derivative of the positions"),
    "turned by half": (_at("heading", 77, 250.0), "line 79, column heading: the attitude turns by"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_bad_rows(case: str, form: str, tmp_path: Path) -> None:
    columns = flight()
    change, message = BAD[case]
    change(columns)
    path = tmp_path / f"bad.{form}"
    write = write_csv if form == "csv" else write_parquet
    if form == "parquet":  # whose rows have no lines
        message = re.sub(r"line (\d+)", lambda place: f"row {int(place[1]) - 1}", message)
    assert message in refused(write(path, columns))


def test_degrees_read_as_radians(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "flight.csv", flight())
    named = {"lat": "lat [rad]", "lon": "lon [rad]"}
    assert "column lat: got 2692.9" in refused(path, named)
    assert "degrees that are read as radians" in refused(path, named)
    assert "degrees that are read as radians" in refused(path, {"heading": "heading [rad]"})


RTKLIB = (
    "2011/03/27 12:00:00.000   35.717456030  139.796223990    58.3012   1   8   0.0042   0.0033   0.0094"
    "   0.0009  -0.0012  -0.0031   0.00   12.4\n"
)

TEXTS: dict[str, tuple[str | bytes, str]] = {
    "empty": ("", "is empty; expected a trajectory as CSV or parquet"),
    "blank lines": ("\n\n\n", "is empty"),
    "header only": (",".join(COLUMNS) + "\n", "has a header and no rows"),
    "three rows": (",".join(COLUMNS) + "\n" + "".join(f"{k},47,9,100,0,0,0,0,0,0\n" for k in range(3)), "has 3 rows"),
    "text": (
        ",".join(COLUMNS) + "\n" + "".join(f"{k},47,9,{'high' if k == 4 else 100},0,0,0,0,0,0\n" for k in range(9)),
        "line 6, column alt: got 'high'; expected a number",
    ),
    "empty cell": (
        ",".join(COLUMNS) + "\n" + "".join(f"{k},47,{'' if k == 4 else 9},100,0,0,0,0,0,0\n" for k in range(9)),
        "line 6, column lon: got no number",
    ),
    "short row": (
        ",".join(COLUMNS) + "\n" + "".join(f"{k},47,9,100,0,0,0{',0,0,0' if k != 3 else ''}\n" for k in range(9)),
        "line 5: has 7 columns; expected 10",
    ),
    "seven columns": ("0,47,9,100,0,0,0\n" * 5, "has no header and 7 columns; without a header the 10 are time, lat"),
    "no latitude": ("time,lon,alt,roll,pitch,heading\n0,9,100,0,0,0\n", "has no column 'lat'"),
    "twice": ("time,lat,lat,lon,alt,roll,pitch,heading\n0,9,100,0,0,0,0,0\n", "has 2 columns 'lat'"),
    "control characters": ("time,\x08at,lon,alt,roll,pitch,heading\n0,9,100,0,0,0,0\n", "It is one of time, \\x08at"),
    "an open quote": ('time,"lat,lon\n0,0,0\n', "has no column 'lat'"),
    "huge numbers": ("0,47,9,1e308,0,0,0,0,0,0\n" * 5, "line 1, column alt: got 1e+308; expected a finite number"),
    "binary": (bytes(range(128, 256)) * 50, "is neither CSV nor parquet"),
    "one long line": ("1" * 50_000, "is no table: its first line is longer"),
    "damaged parquet": (b"PAR1" + bytes(100), "is no parquet file that can be read"),
    "blanks and names": (
        "time lat lon alt roll pitch heading\n0 47 9 100 0 0 0\n",
        "is separated by blanks: its first line is 'time lat lon alt roll pitch heading'; put commas between",
    ),
    "blanks without names": (
        "  456250.000   47.0   9.0  100.0  0.0  0.0  0.0\n" * 5,
        "is separated by blanks, without a header: its first line is '456250.000   47.0   9.0",
    ),
    "times of day without names": (
        "2024-05-03T12:00:00Z,47,9,100,0,0,0\n" * 5,
        "has no header: its first line is '2024-05-03T12:00:00Z,47,9,100,0,0,0'; add a first line of names",
    ),
    "a comment": ("# flight of May 3, 2024\ntime,lat\n", "begins with the comment '# flight of May 3, 2024'"),
    "RTKLIB": (
        "% program   : RTKLIB ver.2.4.2\n%  GPST   latitude(deg) longitude(deg)  height(m)   Q  ns\n",
        "is an RTKLIB position file (.pos); state its attitude beside file: attitude = ",
    ),
    "RTKLIB without a header": (RTKLIB, "is an RTKLIB position file"),
    "RTKLIB in weeks": (RTKLIB.replace("2011/03/27 12:00:00.000", "1629 43200.000"), "is an RTKLIB position file"),
    "NMEA": ("$GNGGA,123519.00,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\n", "is a log of NMEA sentences;"),
    "GPX": ('<?xml version="1.0"?>\n<gpx version="1.1"><trk><trkseg></trkseg></trk></gpx>\n', "is a GPX file;"),
    "KML": ('<?xml version="1.0"?>\n<kml xmlns="http://www.opengis.net/kml/2.2">\n', "is a KML file;"),
    "JSON": ('{"time": [0, 1]}', "is a JSON file;"),
    "a spreadsheet": (b"PK\x03\x04" + bytes(100), "is a ZIP file, as those of spreadsheets"),
    "UTF-16": ("time,lat".encode("utf-16"), "is UTF-16 text; save it as UTF-8"),
}  # fmt: skip


@pytest.mark.parametrize("case", TEXTS)
def test_bad_files(case: str, tmp_path: Path) -> None:
    content, message = TEXTS[case]
    path = tmp_path / "bad.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    assert message in refused(path)


def test_numbers_that_pyarrow_does_not_read(tmp_path: Path) -> None:
    """A leading plus, and exponents of three digits as MATLAB writes them."""
    lines = [f"{k},+47,1.0e-009,100,0,0,0,0,0,0" for k in range(5)]
    path = tmp_path / "plus.csv"
    path.write_text("\n".join(["# " + ", ".join(COLUMNS), *lines]), encoding="utf-8")
    rows = read_trajectory_file(path)
    assert np.all(rows.latitude == np.radians(47.0))
    np.testing.assert_allclose(rows.longitude, np.radians(1e-9), rtol=1e-15)


def test_places_without_a_table(tmp_path: Path) -> None:
    """None of them is waited for: a pipe would never end."""
    os.mkfifo(tmp_path / "pipe.csv")
    assert "is a pipe or device" in refused(tmp_path / "pipe.csv")
    assert "is a pipe or device" in refused(Path(os.devnull))
    assert "is a folder" in refused(tmp_path)
    assert "no such file" in refused(tmp_path / "missing.csv")


def test_size_is_limited_before_reading(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sparse = tmp_path / "sparse.csv"
    with sparse.open("wb") as file:
        file.truncate(10**12)
    assert "is longer than 1,000,000,000 bytes" in refused(sparse)
    monkeypatch.setattr(trajectory_file, "MOST_ROWS", 300)
    for path in (write_csv(tmp_path / "a.csv", flight()), write_parquet(tmp_path / "a.parquet", flight())):
        assert "rows; at most 300 are read" in refused(path)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"lat": "latitud"}, "has no column 'latitud'"),
        ({"latitude": "lat"}, "columns.latitude: no such column of a trajectory; expected one of time, lat, lon"),
        ({"alt": "alt [deg]"}, "columns.alt: got '1 deg', which is an angle; expected a length"),
        ({"alt": "alt [furlong]"}, "columns.alt: 'furlong' is not a known unit"),
    ],
)
def test_bad_names(columns: dict[str, str], message: str, tmp_path: Path) -> None:
    assert message in refused(write_csv(tmp_path / "flight.csv", flight()), columns)
    assert "has no header" in refused(write_csv(tmp_path / "bare.csv", flight(), header=False), columns)


def test_parquet_of_the_wrong_type(tmp_path: Path) -> None:
    columns: dict[str, object] = {**flight()}
    columns["lat"] = [str(value) for value in flight()["lat"]]
    assert "column lat: holds string; expected numbers" in refused(write_parquet(tmp_path / "a.parquet", columns))
    columns["lat"] = [None, *flight()["lat"][1:]]
    assert "row 1, column lat: got no number" in refused(write_parquet(tmp_path / "b.parquet", columns))
