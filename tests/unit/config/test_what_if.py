"""Numbers of a campaign file that can be changed, and the file with them changed."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np

from mcnav.analysis.changeable_campaign import ChangeableCampaign
from mcnav.config.what_if import changeable_campaign
from mcnav.contract.quantities import Source


def of(content: dict[str, Any], names: list[str], processes: tuple[str, ...] = ()) -> ChangeableCampaign:
    """Return the changeable campaign of sources of one metre, whose filter has the believes of the file."""
    sources = [Source(name, "m", "m", 1.0, group=name.rpartition("_")[0]) for name in names]
    return changeable_campaign(content, sources, processes, np.zeros(len(names)), np.eye(len(names)), {"any": 1.0})


def test_a_bias_and_its_instability_are_two_numbers() -> None:
    """Though the name of the one begins as that of the other."""
    content = {
        "imu": {"gyro": {"bias": "1 deg/h", "bias_instability": {"sigma": "0.1 deg/h", "correlation_time": "1 h"}}}
    }
    found = of(content, ["gyro_bias_x"], ("gyro_bias_instability", "gyro_bias_instability_x"))
    assert found.source_numbers.tolist() == [0]
    assert found.process_numbers == {"gyro_bias_instability": 1, "gyro_bias_instability_x": 1}


def test_errors_of_beams_have_their_number() -> None:
    beams = {"type": "velocimeter", "interval": "1 s", "beams": [[0.0, 0.0, 1.0]], "velocity": "5 cm/s"}
    content = {"aiding": [{**beams, "range": "1 m", "range_bias": "2 m"}]}
    found = of(content, ["velocimeter_range_bias_1"], ("velocimeter_velocity_noise_1", "velocimeter_range_noise_1"))
    assert [slider.path.removeprefix("aiding.velocimeter.") for slider in found.sliders] == [
        "velocity", "range", "range_bias",
    ]  # fmt: skip
    assert (found.source_numbers.tolist(), list(found.process_numbers.values())) == ([2], [0, 1])


def test_an_error_with_an_entry_of_its_own() -> None:
    """Of an axis that the unit's table does not name."""
    content = {
        "imu": {"gyro": {"bias": {"x": "1 deg/h"}}},
        "errors": {"gyro_bias_y": "2 deg/h", "gyro_bias": "0 deg/h"},
    }
    found = of(content, ["gyro_bias_x", "gyro_bias_y"])
    assert [slider.path for slider in found.sliders] == ["imu.gyro.bias", "errors.gyro_bias_y"]
    assert found.source_numbers.tolist() == [0, 1]


def test_a_location_without_a_scale_is_no_size() -> None:
    """Its mean would move, and its sigma would not."""
    moved = {"errors": {"range": {"distribution": "scipy.norm", "loc": "1 m"}}}
    assert not of(moved, ["range"]).sliders
    sized = {"errors": {"range": {"distribution": "scipy.norm", "loc": "9 m", "scale": "1 m"}}}
    (slider,) = of(sized, ["range"]).sliders
    assert (slider.sizes[slider.shown].text, slider.axes) == ("1 m", 1)
    entry = tomllib.loads(of(sized, ["range"]).written([2.0]))["errors"]["range"]
    assert entry == {"distribution": "scipy.norm", "loc": "18 m", "scale": "2 m"}


def test_the_file_is_the_campaigns_where_nothing_changes() -> None:
    """Digits of a number included; of a grade the values are spelled out."""
    content = {
        "imu": {"grade": "tactical", "gyro": {"misalignment": ["1 mrad"] * 6}},
        "errors": {"position": "33.333333333333336 m", "range": 2},
        "aiding": [{"type": "gnss", "interval": "1 s", "position": {"north": "3 m"}}],
        "filter": {"estimates": ["position"], "believes": {"errors": {"position": "3 m"}}},
    }
    found = of(content, ["position_north", "range", "gyro_misalignment_xy"], ("gnss_position_noise_north",))
    written = tomllib.loads(found.written([1.0] * len(found.sliders)))
    imu = written.pop("imu")
    assert imu["gyro"]["misalignment"] == ["1 mrad"] * 6
    assert written == {name: entry for name, entry in content.items() if name != "imu"}
    changed = tomllib.loads(found.written([2.0] * len(found.sliders)))
    assert changed["errors"] == {"position": "66.6666666667 m", "range": 4}
    assert changed["aiding"][0]["position"] == {"north": "6 m"}
    believes = changed["filter"]["believes"]
    assert believes["errors"] == {"position": "3 m", "range": "1.0 m"}
    assert believes["aiding"]["gnss"]["position"] == {"north": "3 m"}
    assert believes["imu"]["gyro"]["misalignment"] == ["1 mrad"] * 6


def test_grades_of_the_catalogue() -> None:
    """Each by the factor that leads to it."""
    content = {"imu": {"gyro": {"bias": "0.01 deg/h"}}}
    (slider,) = of(content, ["gyro_bias_x"]).sliders
    factors = dict(slider.grades)
    assert list(factors) == ["strategic", "navigation", "tactical", "consumer"]
    assert np.allclose([factors["tactical"], factors["navigation"]], [100.0, 0.8], rtol=1e-12)
