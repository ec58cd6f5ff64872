"""Files that are no trajectory as this program reads it, recognised by their look, with what would do.

Positions of a receiver have no attitude, and a table may have other separators, or no line of names.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Final

from mcnav.physics.units import printable
from mcnav.systems.ins.truth.rows import COLUMNS

EXPECTED: Final = (
    "expected CSV or parquet with the columns time [s], lat, lon [deg], alt [m], roll, pitch, heading [deg]"
)

BEGINNING: Final = 4_096
"""Bytes of a file in which its format is sought."""

SHOWN: Final = 60
"""Characters of a line that are shown."""

SEPARATE: Final = "put commas between its columns, as sed 's/^ *//; s/  */,/g' does"

ADD_NAMES: Final = "add a first line of names, such as time,lat,lon,alt,roll,pitch,heading"

NUMBER: Final = re.compile(r"[-+]?[\d.,:/-]*\d[\d.,:/-]*([eE][-+]?\d+)?Z?")
"""A number, a date or a time of day."""

_POSITIONS: Final = "write its times in s and its positions into a CSV file, beside roll, pitch and heading"
_TRACK: Final = 'state its attitude beside file: attitude = "from-velocity" or "coordinated-turn"'
_LOG: Final = "export its navigation solution"

_FORMATS: Final[tuple[tuple[bytes, str, str], ...]] = (
    (
        rb"% program\s*:.*RTKLIB|\A%.*\(lat/lon/height=|\A% +(GPST|UTC|JST) +(latitude|x-ecef|e-baseline)"
        rb"|\A\s*(\d{4}/\d\d?/\d\d? \d\d?:\d\d:\d\d|\d{4} +\d{1,6})(\.\d+)?"
        rb"( +-?\d+\.\d+){3} +[1-6] +\d+( +-?\d+\.\d+){6}",
        "an RTKLIB position file (.pos)",
        _TRACK,
    ),
    (rb"\A\s*(\\[^\\\n]*\\)?[$!](P[A-Z]{3}|[A-Z]{2}[A-Z0-9]{3})[A-Z0-9]*,", "a log of NMEA sentences", _TRACK),
    (rb"\A\s*[#%](INSPVA|BESTPOS|BESTVEL|INSATT|RAWIMU|BESTGNSSPOS)\w*,", "a NovAtel log", _LOG),
    (rb"<gpx[\s>]", "a GPX file", _TRACK),
    (rb"<kml[\s>]", "a KML file", _POSITIONS),
    (rb"\A.{60}RINEX VERSION", "a RINEX file", "compute positions from it first"),
    (rb"\A#[a-d][PV]\d{4} ", "an SP3 file of satellite orbits", _POSITIONS),
    (rb"\A\s*<(\?xml|!DOCTYPE|html)", "an XML or HTML file", "export its table"),
    (rb'\A\s*(\{\s*["}]|\[\s*[\[{"])', "a JSON file", "write its table as CSV"),
    (rb"\APK\x03\x04", "a ZIP file, as those of spreadsheets and of numpy are", "export its table as CSV"),
    (rb"\A\xd0\xcf\x11\xe0", "a spreadsheet", "export its table as CSV"),
    (rb"\A\x1f\x8b", "compressed by gzip", "decompress it first"),
    (rb"\AMATLAB 5\.0|\A\x89HDF", "a MATLAB or HDF5 file", "write its table as CSV, such as with writematrix"),
    (rb"\A\x93NUMPY", "a numpy file", "write its table as CSV, such as with numpy.savetxt"),
    (rb"\A\xb5\x62", "a u-blox log (UBX)", _LOG),
    (rb"\AULog\x01|\A\xa3\x95|\A#ROSBAG", "the log of a flight controller", _LOG),
    (rb"\A(\xff\xfe|\xfe\xff)", "UTF-16 text", "save it as UTF-8"),
)  # fmt: skip
"""Pattern, name and remedy of each format."""


def foreign_format(content: bytes) -> str | None:
    """Name the format of a file, and what to do with it; nothing where it may be a table of text.

    >>> foreign_format(b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47")[:28]
    'is a log of NMEA sentences; '
    >>> foreign_format(b"time,lat,lon,alt,roll,pitch,heading")
    """
    beginning = content[:BEGINNING].removeprefix(b"\xef\xbb\xbf")
    for pattern, name, remedy in _FORMATS:
        if re.search(pattern, beginning):
            return f"is {name}; {remedy} ({EXPECTED})"
    return None


def why_no_header(line: str, header: Iterable[str], wanted: Iterable[str]) -> str | None:
    """Say what the first line of a file is that has none of the wanted names; nothing where it may be a header.

    Parameters
    ----------
    line : str
        The first line.
    header : iterable of str
        Its entries, separated by commas, semicolons or tabs.
    wanted : iterable of str
        Names of columns, without units.

    Examples
    --------
    >>> why_no_header("0.0 47.0 8.0", ["0.0 47.0 8.0"], ["time", "lat"])[:22]
    'is separated by blanks'
    >>> why_no_header("moment,width", ["moment", "width"], ["time", "lat"])
    """
    entries, names, words = [entry.strip() for entry in header], set(wanted), line.lstrip("#% ").split()
    if names & {entry.partition("[")[0].strip() for entry in entries}:
        return None
    shown = printable(line.strip(), SHOWN)
    if len(entries) == 1 < len(words) and names & set(words):
        return f"is separated by blanks: its first line is '{shown}'; {SEPARATE}"
    if len(entries) == 1 < len(words) and _mostly_numbers(words):
        add = "" if len(words) == len(COLUMNS) else f"; {ADD_NAMES}"
        return f"is separated by blanks, without a header: its first line is '{shown}'; {SEPARATE}{add}"
    if len(entries) > 1 and _mostly_numbers(entries):
        return f"has no header: its first line is '{shown}'; {ADD_NAMES}"
    if line.lstrip().startswith(("#", "%")):
        return f"begins with the comment '{shown}'; expected the names of its columns in the first line"
    return None


def _mostly_numbers(entries: Sequence[str]) -> bool:
    """Tell whether most entries are numbers, dates or times of day."""
    return 2 * sum(NUMBER.fullmatch(entry) is not None for entry in entries) > len(entries)
