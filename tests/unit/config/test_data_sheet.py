"""Numbers of a data sheet: what a file gives, their multiples, and the next grade of the catalogue."""

from __future__ import annotations

from typing import Any

import pytest

from mcnav.config.data_sheet import DataSheetNumber, data_sheet_numbers, next_grade, owners_of, round_down, shown
from mcnav.systems.ins.scenario import SOURCES

IMU: dict[str, Any] = {
    "grade": "tactical",
    "gyro": {
        "bias": ["1 deg/h", "2 deg/h", "3 deg/h"],
        "bias_instability": {"allan_minimum": "0.5 deg/h", "correlation_time": "1 h"},
    },
}
CONTENT: dict[str, Any] = {
    "imu": IMU,
    "errors": {
        "position": "5 m",
        "position_down": {"distribution": "truncated-normal", "sigma": "10 m", "limit": "20 m"},
        "heading": "0 mrad",
    },
    "aiding": [
        {"type": "gnss", "name": "receiver", "interval": "1 s", "position": "3 m", "lever_arm": ["1 m", "0 m", "0 m"],
         "position_correlated": {"sigma": "2 m", "correlation_time": "100 s"}},
    ],
}  # fmt: skip


def numbers() -> dict[str, DataSheetNumber]:
    return {number.path: number for number in data_sheet_numbers(CONTENT, SOURCES)}


def test_numbers_of_a_file() -> None:
    """Those of the file and, below them, the grade; none that are zero, and no lever arm, which is known."""
    found = numbers()
    assert found["imu.gyro.bias"].text == "1 deg/h, 2 deg/h, 3 deg/h"
    assert found["imu.gyro.angle_random_walk"].text == "0.125 deg/sqrt(h)"
    assert found["imu.gyro.bias_instability"].text == "0.5 deg/h"
    assert found["aiding.receiver.position_correlated"].text == "2 m"
    assert not {"errors.heading", "aiding.receiver.lever_arm", "aiding.receiver.interval"} & found.keys()


def test_causes() -> None:
    found = numbers()
    assert found["imu.gyro.bias"].covers("gyro_bias_x")
    assert not found["imu.gyro.bias"].covers("gyro_bias_instability_x")
    assert found["imu.gyro.bias_instability"].covers("gyro_bias_instability_x")
    assert found["errors.position"].covers("position_north")
    assert not found["errors.position"].covers("position_down")
    assert found["errors.position_down"].covers("position_down")


def test_multiples() -> None:
    found = numbers()
    assert found["imu.gyro.bias"].multiplied(0.5) == {"imu.gyro.bias": ["0.5 deg/h", "1 deg/h", "1.5 deg/h"]}
    assert found["aiding.receiver.position_correlated"].multiplied(2.0) == {
        "aiding.receiver.position_correlated": {"sigma": "4 m", "correlation_time": "100 s"}
    }
    own = CONTENT["errors"]["position_down"]
    assert found["errors.position"].multiplied(3.0) == {"errors.position": "15 m", "errors.position_down": own}
    changed = found["errors.position_down"].multiplied(0.1)["errors.position_down"]
    assert changed == {"distribution": "truncated-normal", "sigma": "1 m", "limit": "2 m"}


@pytest.mark.parametrize(("value", "expected"), [(0.123999, 0.123), (9999.0, 9990.0), (0.3, 0.3), (0.0, 0.0)])
def test_numbers_are_rounded_down(value: float, expected: float) -> None:
    assert round_down(value) == pytest.approx(expected, rel=1e-12)


def test_a_proposed_number_has_three_digits() -> None:
    """One quantity is rounded itself; of several, their factor is."""
    single = DataSheetNumber("errors.tilt", "0.07 mrad", frozenset(), {})
    factor = single.rounded(0.123456)
    assert single.multiplied(factor) == {"errors.tilt": "0.00864 mrad"}
    assert numbers()["imu.gyro.bias"].rounded(0.123456) == pytest.approx(0.123)


def test_next_grades() -> None:
    """The next finer grade is the coarsest whose value is below the largest axis'."""
    found = numbers()
    finer, coarser = (next_grade(found["imu.gyro.bias"], each) for each in (True, False))
    assert finer is not None
    assert coarser is not None
    assert (finer.grade, coarser.grade) == ("tactical", "consumer")
    walk = next_grade(found["imu.gyro.angle_random_walk"], True)
    assert walk is not None
    assert (walk.grade, shown(walk.entry)) == ("navigation", "0.002 deg/sqrt(h)")
    misaligned = next_grade(found["imu.gyro.misalignment"], True)
    assert misaligned is not None
    assert (misaligned.grade, shown(misaligned.entry)) == ("navigation", "0.1 mrad")
    assert next_grade(found["imu.gyro.g_sensitivity"], True) is None  # no finer grade states one
    assert next_grade(found["errors.position"], True) is None


def test_a_grade_leaves_axes_that_are_beyond_it() -> None:
    """The larger axis alone moves to the next finer grade, the smaller one alone to the next coarser."""
    content = {"imu": {"accelerometer": {"bias": {"x": "100 ug", "y": "1200 ug"}}}}
    (number,) = data_sheet_numbers(content, SOURCES)
    finer, coarser = (next_grade(number, each) for each in (True, False))
    assert finer is not None
    assert finer.entry == {"x": "100 ug", "y": "1 mg"}
    assert coarser is not None
    assert coarser.grade == "consumer"
    content = {"imu": {"accelerometer": {"bias": ["100 ug", "1200 ug", "1500 ug"]}}}
    (number,) = data_sheet_numbers(content, SOURCES)
    finer = next_grade(number, True)
    assert finer is not None
    assert finer.entry == ["100 ug", "1 mg", "1 mg"]


def test_a_number_is_shown_with_all_that_is_multiplied() -> None:
    """A mean and a limit grow with the sigma: a reader who changes the sigma alone has another distribution."""
    number = numbers()["errors.position_down"]
    assert number.text == "sigma 10 m, limit 20 m"


def test_a_number_of_errors_owns_the_axis_that_it_names() -> None:
    found = numbers()
    causes = ["position_down", "position_north", "gyro_bias_x", "gyro_bias_instability_x", "gravity_anomaly"]
    expected = ["errors.position_down", "errors.position", "imu.gyro.bias", "imu.gyro.bias_instability", None]
    assert owners_of(causes, list(found.values())) == [path and found[path] for path in expected]


def test_owners_of_many_causes_take_time_linear_in_their_number(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each cause is asked of the numbers of its kind alone: one, of 100."""
    asked, covers = list[str](), DataSheetNumber.covers

    def counted(number: DataSheetNumber, cause: str) -> bool:
        asked.append(cause)
        return covers(number, cause)

    monkeypatch.setattr(DataSheetNumber, "covers", counted)
    causes = [f"s{place}" for place in range(100)]
    sheet = [DataSheetNumber(f"errors.{cause}", "1 m", frozenset({cause}), {}) for cause in causes]
    assert owners_of(causes, sheet) == sheet
    assert asked == causes
