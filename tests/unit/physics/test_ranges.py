"""Ranges as they are written, and what is refused; the sweep's tests read them too."""

from __future__ import annotations

import pytest

from mcnav.physics.ranges import Range, is_range, read_range
from mcnav.physics.units import UnitError


@pytest.mark.parametrize(
    ("text", "span"),
    [
        ("0.5..2 deg/h", Range(0.5, 2.0, "deg/h")),
        (" 1e-3 .. 1e1 m", Range(1e-3, 10.0, "m")),
        ("-2..2 m", Range(-2.0, 2.0, "m")),
        ("500 m..2 km", Range(0.5, 2.0, "km")),
        ("0.1 1/m..2 1/m", Range(0.1, 2.0, "1/m")),
        ("2..2 m", Range(2.0, 2.0, "m")),
        ("1..5", Range(1.0, 5.0, "")),
    ],
)
def test_ranges(text: str, span: Range) -> None:
    assert is_range(text)
    assert read_range(text) == span


@pytest.mark.parametrize("text", ["1.5 m", "../flight.csv", "1..2..3 m", "..", "", "gps..imu", 3.0, None])
def test_what_is_no_range(text: object) -> None:
    assert not is_range(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("2..1 m", "which is empty"),
        ("1 km..2 deg/h", "is a length; expected an angular rate"),
        ("1..1e999 m", "expected finite values"),
    ],
)
def test_refusals(text: str, message: str) -> None:
    with pytest.raises(UnitError, match=message):
        read_range(text)


def test_values_between_the_ends() -> None:
    """Over a decade they are spaced by their logarithm; ends are as written, to the bit."""
    span = Range(0.1, 10.0, "m")
    assert (span.at(0.0), span.at(0.5), span.at(1.0)) == (0.1, 1.0, 10.0)
    assert Range(0.1, 0.7, "m").at(0.5) == 0.4
    assert [span.value_of(span.written(span.at(k / 7.0))) for k in range(8)] == [span.at(k / 7.0) for k in range(8)]
