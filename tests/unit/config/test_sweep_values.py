"""Ranges and lists of a sweep: spacing, units, and one line for each mistake."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.config.sweep_values import MOST_POINTS, read_variables, split_varied
from mcnav.errors import CampaignError


def one(written: object, points: int = 5) -> tuple[list[float], str, bool]:
    (found,) = read_variables({"imu.gyro.bias": written}, points)  # type: ignore[dict-item]
    return found.values.tolist(), found.unit, found.log


def mistake(varied: dict[str, object], points: int = 5) -> str:
    with pytest.raises(CampaignError) as caught:
        read_variables(varied, points)  # type: ignore[arg-type]
    (line,) = str(caught.value).splitlines()
    assert line.startswith("--vary: ")
    return line


@pytest.mark.parametrize(
    ("written", "values", "unit", "log"),
    [
        ("0.01..100 deg/h", [0.01, 0.1, 1.0, 10.0, 100.0], "deg/h", True),
        ("1..10 deg/h", np.geomspace(1.0, 10.0, 5), "deg/h", True),
        ("1..9 deg/h", [1.0, 3.0, 5.0, 7.0, 9.0], "deg/h", False),
        ("0..4 m", [0.0, 1.0, 2.0, 3.0, 4.0], "m", False),
        ("-2..2 m", [-2.0, -1.0, 0.0, 1.0, 2.0], "m", False),
        ("1e-3 .. 1e1 m", [1e-3, 1e-2, 1e-1, 1.0, 10.0], "m", True),
        ("500 m..2 km", [0.5, 0.875, 1.25, 1.625, 2.0], "km", False),
        ("1..5", [1.0, 2.0, 3.0, 4.0, 5.0], "", False),
        ("5, 1, 2 deg/h", [1.0, 2.0, 5.0], "deg/h", False),
        ("1 deg/h, 20 deg/h", [1.0, 20.0], "deg/h", True),
        (["1 deg/h", "2 deg/h"], [1.0, 2.0], "deg/h", False),
        ([4, 7], [4.0, 7.0], "", False),
    ],
)
def test_values(written: object, values: list[float], unit: str, log: bool) -> None:
    """Inner values of a range are rounded to twelve digits."""
    found = one(written)
    assert found[0] == pytest.approx(values, rel=1e-11)
    assert found[1:] == (unit, log)


def test_the_ends_of_a_range_are_as_written() -> None:
    values, _, _ = one("0.1..0.7 m", 7)
    assert values[0] == 0.1
    assert values[-1] == 0.7


def test_values_are_written_as_a_campaign_file_has_them() -> None:
    (bias,), (row,) = read_variables({"a": "0.1..0.2 deg/h"}), read_variables({"b": "1, 2"})
    assert (bias.written(0.1), row.written(2.0), row.written(1.5)) == ("0.1 deg/h", 2, 1.5)
    assert (bias.label, row.label) == ("a [deg/h]", "b")


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ("2..1 deg/h", "imu.gyro.bias: got '2..1 deg/h', which is empty"),
        ("1..1 deg/h", "is empty"),
        ("1..2..3 deg/h", "expected a range such as"),
        ("one..two", "expected a range such as"),
        ("", "expected a range such as"),
        ("1 deg/h", "got '1 deg/h'; expected at least two different values: a range such as"),
        ("1, 1 deg/h", "expected at least two different values"),
        ("1, 1, 2 deg/h", "a value occurs twice"),
        ("1 km..2 deg/h", "'km' is a length; expected an angular rate"),
        ("1 parsecs..2 km", "'parsecs' is not a known unit"),
        ("1..1e999", "expected finite values"),
    ],
)
def test_mistakes(written: str, message: str) -> None:
    assert message in mistake({"imu.gyro.bias": written})


def test_one_or_two_keys_and_not_too_many_points() -> None:
    assert "got 0 keys; expected one or two" in mistake({})
    assert "got 3 keys; expected one or two" in mistake({"a": "1..2", "b": "1..2", "c": "1..2"})
    assert f"got 200 x 200 points; at most {MOST_POINTS:,}" in mistake({"a": "1..2", "b": "1..2"}, 200)


def test_options_are_keys_and_values() -> None:
    assert split_varied(["a.b=1..2 m", "c = 3, 4"]) == {"a.b": "1..2 m", "c": " 3, 4"}
    for options, message in (
        (["a.b"], "expected KEY=VALUES"),
        (["=1"], "expected KEY=VALUES"),
        (["a=1", "a=2"], "twice"),
    ):
        with pytest.raises(CampaignError, match=message):
            split_varied(options)


def test_words_come_before_numbers() -> None:
    first, second = read_variables({"imu.gyro.bias": "1..9 deg/h", "imu.grade": "navigation, tactical"})
    assert (first.path, first.words, first.values.tolist()) == ("imu.grade", ("navigation", "tactical"), [0.0, 1.0])
    assert first.written(1.0) == "tactical"
    assert second.path == "imu.gyro.bias"
    assert "a value occurs twice" in mistake({"imu.grade": "tactical, tactical"})
    assert "two to 12 words" in mistake({"imu.grade": "tactical"})
    assert "expected a range such as" in mistake({"imu.gyro.bias": "1 deg/h, tactical"})
