"""Damaged logs of every format are read, or refused in one line."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mcnav.errors import CampaignError
from mcnav.logs.imu_log import read_imu_log
from mcnav.logs.tables import read_table
from mcnav.logs.track import read_track
from tests.unit.logs.test_formats import (
    HEIGHT,
    LATITUDE,
    LONGITUDE,
    NAMES,
    TIME,
    bag,
    dates,
    gpx,
    nmea,
    pos_rows,
    px4_log,
)
from tests.unit.logs.test_imu_log import readings, write

HEADER = f"%  GPST latitude(deg) longitude(deg) height(m) {NAMES}"


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Return a sound log of each format by the ending of its file."""
    folder = tmp_path_factory.mktemp("sound")
    points = "".join(
        f'<trkpt lat="{LATITUDE[row]}" lon="{LONGITUDE[row]}"><ele>{HEIGHT[row]}</ele>'
        f"<time>2023-03-04T05:06:{row:02d}Z</time></trkpt>"
        for row in range(len(TIME))
    )
    table = write(folder, readings()[:40])
    read_table(table).to_parquet(folder / "a.parquet")
    np.savetxt(folder / "a.txt", readings()[:40], "%.9f", "   ")
    return {
        ".csv": table.read_bytes(),
        ".txt": (folder / "a.txt").read_bytes(),
        ".parquet": (folder / "a.parquet").read_bytes(),
        ".pos": "\n".join([HEADER, *pos_rows(dates())]).encode(),
        ".nmea": "\n".join(nmea()).encode(),
        ".gpx": gpx(points).encode(),
        ".ulg": px4_log(folder / "a.ulg").read_bytes(),
        ".bag": bag(folder / "a.bag").read_bytes(),
    }


def damaged(draw: Any, content: bytes) -> bytes:
    """Cut, overwrite, repeat or insert a piece."""
    at = draw(st.integers(0, len(content)))
    to = draw(st.integers(at, min(at + 60, len(content))))
    written = [b"", b"nan", b"-", b"1e400", b",", b"\n", b"\n\n", b"0", b"9" * 30, b'"', b"<"]
    new = draw(st.one_of(st.binary(max_size=12), st.sampled_from(written)))
    return draw(st.sampled_from([content[:at] + new + content[to:], content[:at], content[:to] + content[at:]]))


@pytest.mark.parametrize("ending", [".csv", ".txt", ".parquet", ".pos", ".nmea", ".gpx", ".ulg", ".bag"])
@settings(max_examples=25, derandomize=True, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_damaged_logs_are_read_or_refused_in_one_line(
    sound: dict[str, bytes], tmp_path_factory: pytest.TempPathFactory, ending: str, data: st.DataObject
) -> None:
    path: Path = tmp_path_factory.getbasetemp() / f"damaged{ending}"
    path.write_bytes(damaged(data.draw, sound[ending]))
    for read in (read_imu_log, read_track):
        try:
            log: Any = read(path)
        except CampaignError as refusal:
            line = str(refusal)
            assert str(path) in line
            assert line.isprintable()
        else:
            assert np.all(np.diff(log.time) > 0.0)
            assert np.isfinite(log.start)
            for values in vars(log).values():
                assert not isinstance(values, np.ndarray) or np.all(np.isfinite(values))
