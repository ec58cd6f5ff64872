"""The navigator in three dimensions as the reproduction of NASA TN D-1772 uses it: errors, joined legs, updates."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.config.read import parse_campaign
from mcnav.physics.constants import EARTH_RADIUS, GRAVITATIONAL_PARAMETER
from mcnav.systems.ins.imu.instruments import CONSTANTS, OUTPUTS
from mcnav.systems.ins.scenario import Ins
from mcnav.systems.reentry.table_i import ALL_ERRORS
from mcnav.validation.reproduce.tn_d1772.globe import ACROSS, ALTITUDE, RESULTS, STARS, TRACKING, draw, simulate
from mcnav.validation.reproduce.tn_d1772.in_three_dimensions import ACCELEROMETERS, _joined, _until, example, spread
from mcnav.validation.reproduce.tn_d1772.tables import table_i_scenario


@pytest.mark.parametrize("minutes", [-np.inf, -25.0, 0.0])
def test_the_plane_comes_out_for_every_start(minutes: float) -> None:
    """Altitude and range by the planar navigator, to 1e-5 of each row's largest effect: the truth's force is splined.

    Nothing in the plane acts across it, to the rounding of a sum of 39 products.
    """
    globe = example()
    time = globe.time(minutes)
    partials = globe.navigation.started_at(time, "start").linear().end.partials
    planar, across = globe.results(partials, time)
    flat = table_i_scenario(4) if np.isinf(minutes) else table_i_scenario(4).started_at(60.0 * minutes, "start")
    expected = flat.linear().end.partials[:2] * ALL_ERRORS
    largest = np.abs(expected).max(axis=1, keepdims=True)
    assert (np.abs(planar[:2] - expected) < 1e-5 * largest).all()
    assert np.abs(planar[2]).max() < 1e-10 * np.abs(across[2]).max()
    assert np.abs(across[:2]).max() < 1e-10 * largest.min()


def _one_of_each(globe_errors: Array) -> Array:
    """Add an error of each accelerometer, 1e-4 g or 1e-4, to samples."""
    errors = globe_errors.copy()
    for name in ("bias_x", "bias_y", "bias_z", "scale_factor_x"):
        errors[:, CONSTANTS.index(f"accelerometer_{name}")] += 1e-4
    return errors


def test_legs_join_to_the_whole_flight() -> None:
    """With accelerometers on in both legs, errors at reentry are the second leg's initial ones: linear and simulated.

    Linear to 1e-6 of the largest effect (two responses by quadrature on grids of their own); samples to twice what
    either engine leaves of its steps, 3e-6 of an output's dispersion, over the amplification of 7 after reentry.
    """
    globe = example()
    first, whole = _until(globe.navigation, globe.reentry), globe.navigation
    later = globe.navigation.started_at(globe.reentry, "trajectory")
    joined = later.linear().end.partials[:, : len(OUTPUTS)] @ first.linear().end.partials
    joined[:, len(OUTPUTS) :] += later.linear().end.partials[:, len(OUTPUTS) :]
    sizes = np.array([source.nominal for source in whole.sources])
    expected = whole.linear().end.partials * sizes
    assert (np.abs(joined * sizes - expected) <= 1e-6 * np.abs(expected).max(axis=1, keepdims=True)).all()
    errors = _one_of_each(globe.errors(whole.navigation.start, *draw(60, 3)))
    middle, _ = simulate(first, errors, 0)
    flown, _ = simulate(later, np.hstack([middle, errors[:, len(OUTPUTS) :]]), 0)
    straight, _ = simulate(whole, errors, 0)
    assert (np.abs(flown - straight) <= 2.0 * 3e-6 * 7.0 * straight.std(axis=0)).all()


def test_accelerometers_that_are_off_have_no_errors_before_reentry() -> None:
    """What acts then is what acts later alone; initial errors and gyros act as ever."""
    globe = example()
    coasting = _until(globe.navigation, globe.reentry).linear().end.partials
    later = globe.navigation.started_at(globe.reentry, "trajectory").linear().end.partials
    joined, whole = _joined(coasting, later), globe.navigation.linear().end.partials
    assert (joined[:, ACCELEROMETERS] == later[:, ACCELEROMETERS]).all()
    others = [number for number in range(len(CONSTANTS)) if number not in ACCELEROMETERS]
    sizes = np.array([source.nominal for source in globe.navigation.sources])
    apart = np.abs((joined - whole) * sizes)[:, others]
    assert (apart <= 1e-6 * np.abs(whole * sizes).max(axis=1, keepdims=True)).all()


def _written(minutes: float) -> Ins:
    """Describe the updated navigator as a campaign file does."""
    globe = example()
    instant = f"{globe.time(minutes)!r} s"
    sizes = {**ACROSS, "accelerometer_bias": ACROSS["accelerometer_bias_y"]}
    tracking = {
        quantity: [f"{sigma!r} {unit}" for sigma in TRACKING[quantity]]
        for quantity, unit in (("position", "m"), ("velocity", "m/s"))
    }
    campaign = parse_campaign(
        {
            "scenario": {
                "type": "ins",
                "trajectory": {"reentry": 4},
                "platform": "inertial",
                "earth": {
                    "radius": f"{EARTH_RADIUS} m",
                    "gravitational_parameter": f"{GRAVITATIONAL_PARAMETER} m^3/s^2",
                    "rotation_rate": "0 rad/s",
                },
            },
            "imu": {
                "gyro": {"bias": f"{sizes['gyro_bias_x']} rad/s"},
                "accelerometer": {"bias": f"{sizes['accelerometer_bias']!r} m/s^2", "scale_factor": "100 ppm"},
            },
            "errors": {
                "position_north": "500 m",
                "velocity_north": "0.02 m/s",
                "tilt_east": "0.2 mrad",
                "heading": "0.2 mrad",
            },
            "aiding": [
                {"type": "gnss", "name": "tracking", "instants": [instant], **tracking},
                {"type": "star-tracker", "name": "stars", "instants": [instant], "attitude": f"{STARS} rad"},
            ],
            "filter": {
                "estimates": [
                    "position", "velocity", "attitude", "gyro_bias", "accelerometer_bias", "accelerometer_scale_factor",
                ]
            },
        },
        "test.toml",
        "test",
    )  # fmt: skip
    assert isinstance(campaign.scenario, Ins)
    return campaign.scenario


def test_an_update_is_that_of_a_campaign_file() -> None:
    """Across the plane, where nothing of the plane acts: crossrange of both filters, to 1e-9."""
    globe, by_file = example(), _written(-30.0)
    own = globe.updated(globe.time(-30.0))
    north = OUTPUTS.index("position_north")
    expected, found = (each.filter_prediction() for each in (by_file, own))
    assert expected is not None
    assert found is not None
    assert found.covariance[-1, north, north] == pytest.approx(expected.covariance[-1, north, north], rel=1e-9)
    assert [each.name for each in own.navigation.sensors] == [each.name for each in by_file.navigation.sensors]


def test_draws_have_the_sizes_of_the_report() -> None:
    """Within five standard errors of each sigma, 5 / sqrt(2 n)."""
    planar, across = draw(20_000, 1)
    kept = ALL_ERRORS > 0.0
    assert (planar[:, ~kept] == 0.0).all()
    for values, sizes in ((planar[:, kept], ALL_ERRORS[kept]), (across, np.array(list(ACROSS.values())))):
        assert np.abs(values.std(axis=0) / sizes - 1.0).max() < 5.0 / np.sqrt(40_000)


def test_an_interval_of_a_root_mean_square() -> None:
    """In kilometres; of equal squares it is that of chi-square, which contains the value."""
    value, low, high = spread(np.array([3000.0, -3000.0] * 50))
    assert value == pytest.approx(3.0)
    assert low < value < high


def test_results_are_arcs_on_the_ground() -> None:
    globe = example()
    matrix = globe.to_results
    assert matrix.shape == (len(RESULTS), len(OUTPUTS))
    assert matrix[ALTITUDE, OUTPUTS.index("position_down")] == -1.0
    assert matrix[1].sum() == matrix[2].sum() == pytest.approx(6378.14 / (6378.14 + 26.75), rel=1e-9)
