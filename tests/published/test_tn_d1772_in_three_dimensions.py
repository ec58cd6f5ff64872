"""The reentries of NASA TN D-1772 by the navigator in three dimensions, and the crossrange that the report leaves out.

On the report's sphere, which does not turn, with an inertial platform heading along the plane of motion, the partial
derivatives of the planar scenario come out of equations that share nothing with it but the truth.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.config.read import parse_campaign
from mcnav.contract.scenario import Scenario
from mcnav.physics.constants import EARTH_RADIUS, GRAVITATIONAL_PARAMETER
from mcnav.systems.ins.imu.instruments import CONSTANTS, OUTPUTS
from mcnav.systems.ins.scenario import Ins

SPHERE = {
    "radius": f"{EARTH_RADIUS} m",
    "gravitational_parameter": f"{GRAVITATIONAL_PARAMETER} m^3/s^2",
    "rotation_rate": "0 rad/s",
}

ACROSS = (
    "position_north", "velocity_north", "tilt_east", "heading", "gyro_bias_x", "gyro_bias_z", "accelerometer_bias_y",
    "accelerometer_scale_factor_y",
)  # fmt: skip
"""Sources whose effect is across the plane, which is that of the equator."""

SIZES = dict(zip(ACROSS, (100.0, 0.3, 1.7e-4, 1.7e-4, 4.8e-8, 4.8e-8, 1e-3, 1e-4), strict=True))


def scenario(**described: object) -> Scenario:
    return parse_campaign({"scenario": described, "errors": {}}, "test.toml", "test").scenario


@lru_cache
def navigator(trajectory: int) -> Ins:
    found = scenario(type="ins", trajectory={"reentry": trajectory}, platform="inertial", earth=SPHERE)
    assert isinstance(found, Ins)
    return found


def polar(found: Ins, time: float) -> tuple[float, float]:
    """Return radius and angular rate of the truth."""
    position, velocity = (each[0] for each in found.navigation.truth.earth_fixed(np.array([time])))
    radius = float(np.linalg.norm(position))
    return radius, float(position[0] * velocity[1] - position[1] * velocity[0]) / radius**2


def in_plane(found: Ins, sources: list[str]) -> tuple[Array, Array]:
    """Return the matrices from the navigator's outputs to the planar ones, and from planar sources to its own.

    Final ranges are arcs on the ground and initial ones arcs at the initial height. A range error turns the local axes,
    in which the navigator's tilt is measured, but not the platform.
    """
    (first, rate), (last, final_rate) = (polar(found, time) for time in (found.navigation.start, found.navigation.end))
    outputs, inputs = np.zeros((4, len(OUTPUTS))), np.zeros((len(CONSTANTS), len(sources)))
    arc = EARTH_RADIUS / last
    for row, name, value in (
        (0, "position_down", -1.0), (1, "position_east", arc), (2, "velocity_down", -1.0), (3, "velocity_east", arc),
        (3, "position_down", arc * final_rate),
    ):  # fmt: skip
        outputs[row, OUTPUTS.index(name)] = value
    for own, planar, value in (
        ("position_down", "altitude", -1.0), ("velocity_east", "altitude", rate), ("position_east", "range", 1.0),
        ("tilt_north", "range", -1.0 / first), ("velocity_down", "altitude_rate", -1.0),
        ("velocity_east", "range_rate", 1.0), ("tilt_north", "misalignment", -1.0), ("gyro_bias_y", "gyro_drift", 1.0),
        ("accelerometer_bias_x", "bias_x", 1.0), ("accelerometer_bias_z", "bias_z", 1.0),
        ("accelerometer_scale_factor_x", "scale_factor_x", 1.0),
        ("accelerometer_scale_factor_z", "scale_factor_z", 1.0),
        ("accelerometer_misalignment_xz", "cross_axis_x", 1.0), ("accelerometer_misalignment_zx", "cross_axis_z", 1.0),
    ):  # fmt: skip
        inputs[CONSTANTS.index(own), sources.index(planar)] = value
    return outputs, inputs


@pytest.mark.parametrize("trajectory", range(1, 8))
def test_the_partial_derivatives_come_out(trajectory: int) -> None:
    """To 1e-5 of each row's largest contribution: the truth's force is splined to 8e-7 g."""
    planar, found = scenario(type="reentry", trajectory=trajectory), navigator(trajectory)
    outputs, inputs = in_plane(found, [source.name for source in planar.sources])
    sizes = np.array([source.nominal for source in planar.sources])
    expected = planar.linear().end.partials * sizes
    own = outputs @ found.linear().end.partials @ inputs * sizes
    assert (np.abs(own - expected) / np.abs(expected).max(axis=1, keepdims=True)).max() < 1e-5


@pytest.mark.parametrize("trajectory", range(1, 8))
def test_crossrange_is_independent_and_stable(trajectory: int) -> None:
    """The claim about crossrange: to first order nothing in the plane acts across it, nor the other way round.

    Stable: a crossrange error oscillates about the orbit's plane, and is never larger than at the start.
    """
    found = navigator(trajectory)
    partials = found.linear().end.partials
    planar = [source.name for source in scenario(type="reentry", trajectory=trajectory).sources]
    outputs, inputs = in_plane(found, planar)
    across = [OUTPUTS.index(name) for name in ("position_north", "velocity_north", "tilt_east", "heading")]
    columns = [CONSTANTS.index(name) for name in ACROSS]
    sizes = np.array(list(SIZES.values()))
    effect = np.abs(partials[np.ix_(across, columns)] * sizes)
    nominal = np.array([source.nominal for source in scenario(type="reentry", trajectory=trajectory).sources])
    assert (np.abs((partials @ inputs)[across] * nominal).max(axis=1) / effect.max(axis=1)).max() < 1e-6
    own = np.abs(outputs @ partials @ inputs * nominal).max(axis=1)
    assert (np.abs((outputs @ partials)[:, columns] * sizes).max(axis=1) / own).max() < 1e-6
    north = OUTPUTS.index("position_north")
    assert np.abs(found.linear_over_time(61).partials[:, north, north]).max() < 1.0 + 1e-9
