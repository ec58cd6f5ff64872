"""Rows of a file as lines of an editor."""

from __future__ import annotations

from pathlib import Path

import pytest

from mcnav.files.lines import place_of_row

TEXTS = {
    "a header": ("time,rate\n0,1\n1,WRONG\n", 1),
    "no header": ("0,1\nWRONG,2\n", 1),
    "comments, an empty line and a header": ("# log\n\ntime\trate\n0\t1\n\n1\tWRONG\n", 1),
    "a date in every row": ("2011/03/27,1,1\n2011/03/27,WRONG,2\n", 1),
    "the first row after blanks": ("\n\n 0  WRONG 2\n 1 2 3\n", 0),
    "a row that is commented out": ("time,rate\n0,1\n#WRONG,2\n", 1),
}


@pytest.mark.parametrize("case", TEXTS)
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_the_line_is_that_of_an_editor(case: str, end: str, tmp_path: Path) -> None:
    text, row = TEXTS[case]
    (path := tmp_path / "log.csv").write_bytes(text.replace("\n", end).encode("utf-8-sig"))
    (line,) = (number for number, each in enumerate(text.split("\n"), start=1) if "WRONG" in each)
    assert place_of_row(path, row) == f"line {line}"


def test_comments_between_the_rows_of_a_position_file(tmp_path: Path) -> None:
    (path := tmp_path / "a.pos").write_text("% lat lon\n1 2 3\n% lat lon\n4 5 6\n")
    assert place_of_row(path, 1) == "line 4"


@pytest.mark.parametrize("written", [b"PAR1 1\n2\n", b"1\0\n2\n", b"<gpx>\n", b"$GPGGA,1\n$GPGGA,2\n", b"1,2\n"])
def test_rows_of_other_formats_are_no_lines(written: bytes, tmp_path: Path) -> None:
    """The last is a text without such a row."""
    (path := tmp_path / "log").write_bytes(written)
    assert place_of_row(path, 1) == "row 2"
