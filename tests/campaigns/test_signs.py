"""Signs and frames as the documentation states them, of linear analysis and of every engine."""

from __future__ import annotations

import re
import tomllib
from typing import Any

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.config.read import parse_campaign
from mcnav.contract.samples import Batch
from mcnav.docs.pages import page_text
from mcnav.physics.constants import EARTH_RADIUS
from mcnav.physics.units import quantity

GRAVITY = 9.80665

START = 'start = { latitude = "-33 deg", longitude = "-120 deg", altitude = "500 m", course = "0 deg", speed = "%s" }'

SIGNS: list[tuple[str, str, str, str, float]] = [
    # what the vehicle does, error, its size, output, its value to first order
    ("gain", "heading", "10 mrad", "velocity_east", 1.0),
    ("rest", "tilt_north", "1 mrad", "velocity_east", 1e-3 * GRAVITY * 10.0),
    ("rest", "tilt_east", "1 mrad", "velocity_north", -1e-3 * GRAVITY * 10.0),
    ("rest", "accelerometer_bias_x", "100 ug", "velocity_north", 1e-4 * GRAVITY * 10.0),
    ("rest", "accelerometer_bias_y", "100 ug", "velocity_east", 1e-4 * GRAVITY * 10.0),
    ("rest", "accelerometer_bias_z", "100 ug", "velocity_down", 1e-4 * GRAVITY * 10.0),
    ("rest", "accelerometer_scale_factor_z", "100 ppm", "velocity_down", -1e-4 * GRAVITY * 10.0),
    ("rest", "accelerometer_misalignment_xz", "1 mrad", "velocity_north", -1e-3 * GRAVITY * 10.0),
    ("long", "gyro_bias_x", "1 deg/h", "tilt_north", np.radians(0.1)),
    ("long", "gyro_bias_y", "1 deg/h", "tilt_east", np.radians(0.1)),
    ("long", "gyro_bias_z", "1 deg/h", "heading", np.radians(0.1)),
    *(("rest", f"velocity_{axis}", "1 m/s", f"position_{axis}", 10.0) for axis in ("north", "east", "down")),
    *(("rest", f"velocity_{axis}", "1 m/s", f"velocity_{axis}", 1.0) for axis in ("north", "east", "down")),
    *(("rest", f"position_{axis}", "1 m", f"position_{axis}", 1.0) for axis in ("north", "east", "down")),
    *(("rest", name, "1 mrad", name, 1e-3) for name in ("tilt_north", "tilt_east", "heading")),
]

MOTIONS = ("rest", "gain", "long")

FLAT = 'earth = { radius = "1e9 m", gravitational_parameter = "9.80665e18 m^3/s^2", rotation_rate = "0 rad/s" }'
"""It does not turn, and is so large that gravity is the same all along: closed forms hold to what follows."""

TOLERANCE = 3e-4
"""Share: a drift of 1 deg/h moves the position by g b t^3 / 6 = 370 m in 360 s, which turns the local axes by 2.1e-4 of
the tilt; sin(10 mrad) is 2e-5 less than 10 mrad; engines are accurate to 3e-6 of the largest of their probes."""


def campaign(scenario: str, errors: str = "") -> Any:
    return parse_campaign(
        tomllib.loads(f"samples = 16\n{scenario}\n[errors]\n{errors}"), "signs.toml", "signs"
    ).scenario


def vehicle(motion: str) -> Any:
    """Return a strapdown navigator of a vehicle that rests, gains 100 m/s northward, or rests for long."""
    segments, speed = {
        "rest": ('[{ hold = "10 s" }]', "0 m/s"),
        "gain": ('[{ hold = "5 s" }, { speed = "120 m/s" }]', "20 m/s"),
        "long": ('[{ hold = "360 s" }]', "0 m/s"),
    }[motion]
    start = START % speed
    trajectory = f'[scenario.trajectory]\nrate = "10 Hz"\n{start}\nsegments = {segments}\n[imu]'
    return campaign(f'[scenario]\ntype = "ins"\n{FLAT}\n{trajectory}')


def outcomes(scenario: Any, sizes: dict[str, float]) -> dict[str, Array]:
    """Return the outputs with an error each, shape (errors, outputs), by linear analysis and by each engine."""
    names, count = [source.name for source in scenario.sources], len(sizes)
    errors = np.zeros((count, len(names)))
    for row, (name, size) in enumerate(sizes.items()):
        errors[row, names.index(name)] = size
    batch = Batch(np.arange(count), errors, 0)
    found = {name: scenario.engine(name, errors).simulate(batch).values for name in scenario.engines if name != "map"}
    return {"linear": errors @ scenario.linear().partials[-1].T, **found}


@pytest.mark.parametrize("motion", MOTIONS)
def test_signs_of_an_inertial_navigation(motion: str) -> None:
    scenario = vehicle(motion)
    rows = [row for row in SIGNS if row[0] == motion]
    units = {source.name: source.unit for source in scenario.sources}
    sizes = {error: quantity(size, units[error]) for _, error, size, _, _ in rows}
    outputs = [output.name for output in scenario.outputs]
    for engine, values in outcomes(scenario, sizes).items():
        for _, error, _, output, expected in rows:
            value = values[list(sizes).index(error), outputs.index(output)]
            assert value == pytest.approx(expected, rel=TOLERANCE), (engine, error, output)


def test_the_documentation_states_these_signs() -> None:
    """Every row of its table is one of those above: error, size, and the value to the digits that are printed."""
    table = re.findall(r"^\| `(\w+)`(?: ([xyz]))? of (\+\S+ \S+) \| ([^|]+) \| ([a-z ]+) by ([+−]\S+ \S+) \|$",
                       page_text("campaigns"), re.MULTILINE)  # fmt: skip
    assert len(table) == 6
    units = {output.name: output.unit for output in vehicle("rest").outputs}
    known = {(error, size): (output, value) for _, error, size, output, value in SIGNS if output != error}
    for name, axis, size, _, spoken, written in table:
        output, value = known[f"{name}_{axis}" if axis else name, size.removeprefix("+")]
        assert output == spoken.replace(" ", "_")
        assert quantity(written.replace("−", "-"), units[output]) == pytest.approx(value, rel=2e-2)


def test_axes_and_ranges_of_a_cruise() -> None:
    """z points down, so that a tilt is read as a deceleration; initial ranges are arcs at the radius of the start."""
    scenario = campaign('[scenario]\ntype = "cruise"\nspeed = "0 m/s"\nduration = "20 s"\naltitude = "3000 km"')
    sizes = {"misalignment": 1e-3, "roll_misalignment": 1e-3, "bias_x": 1e-3, "range": 2_000.0, "cross_range": 2_000.0}
    outputs = [output.name for output in scenario.outputs]
    radius = EARTH_RADIUS + 3e6
    gravity = GRAVITY * (EARTH_RADIUS / radius) ** 2
    arc = EARTH_RADIUS / radius
    expected = {
        "misalignment": ("range_rate", -1e-3 * gravity * 20.0 * arc),
        "roll_misalignment": ("cross_range_rate", -1e-3 * gravity * 20.0 * arc),
        "bias_x": ("range_rate", 1e-3 * 20.0 * arc),
        "range": ("range", 2_000.0 * arc),
        "cross_range": ("cross_range", 2_000.0 * arc),
    }
    for engine, values in outcomes(scenario, sizes).items():
        for row, (error, (output, value)) in enumerate(expected.items()):
            # the earth of 3,960 miles and 32.2 ft/s^2, and (omega t)^2 / 2 of Schuler
            assert values[row, outputs.index(output)] == pytest.approx(value, rel=5e-3), (engine, error)


def test_ranges_of_a_reentry_are_arcs_at_the_start_and_on_the_surface() -> None:
    scenario = campaign('[scenario]\ntype = "reentry"\ntrajectory = 4')
    names = [source.name for source in scenario.sources]
    errors = np.zeros((1, len(names)))
    errors[0, names.index("range")] = 2_000.0
    start = np.array([scenario.navigation.start - scenario.trajectory.reentry_time])
    actual, _, navigation = scenario.error_histories(errors, start)
    assert navigation[0, 0, 1] == pytest.approx(2_000.0 * EARTH_RADIUS / actual[0, 0], rel=1e-9)
    for page in ("campaigns",):
        assert "are arcs on the\nearth's surface" in page_text(page)
