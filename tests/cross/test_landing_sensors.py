"""Landmarks and velocimeters: the ground that beams meet, a matched filter, samples, and what is refused."""

from __future__ import annotations

import tomllib
from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from scipy import stats

from mcnav.config.read import parse_campaign
from mcnav.errors import CampaignError
from mcnav.systems.ins.earth import MARS, MOON, WGS84, Earth
from mcnav.systems.ins.ensemble.aided import simulate_aided
from mcnav.systems.ins.scenario import Ins
from mcnav.systems.ins.sensors import beam_range as beam_distance
from mcnav.systems.ins.sensors import beam_velocity
from mcnav.systems.ins.sensors.beams import beam_range, distances, ground_scales
from mcnav.systems.ins.sensors.surroundings import Surroundings
from tests.conftest import ROOT
from tests.flights import flight

CAMPAIGN = tomllib.loads((ROOT / "campaigns" / "34_lunar_landing.toml").read_text("utf-8"))


@pytest.mark.parametrize("body", [MOON, MARS, WGS84], ids=["moon", "mars", "earth"])
def test_beams_end_on_the_ground(body: Earth) -> None:
    """At its altitude, but for how much the ellipsoid of longer axes departs: at most the height times the flattening.

    Down, the distance is the height above it; beams to the sky, and past the horizon, meet nothing.
    """
    latitude, longitude = np.radians([0.0, 40.0, -75.0]), np.radians([10.0, 20.0, -30.0])
    place = body.from_geodetic(latitude, longitude, np.full(3, 8e3))
    up = np.stack([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)], 1)
    level = np.cross(up, [0.3, -0.5, 0.8])
    level /= np.linalg.norm(level, axis=1, keepdims=True)
    scales, allowed = ground_scales(body, 700.0), 700.0 * body.flattening + 1e-6
    distance, normal = beam_range(scales, place, 0.6 * level - 0.8 * up)
    end = place + distance[:, None] * (0.6 * level - 0.8 * up)
    assert np.abs(body.to_geodetic(end)[:, 2] - 700.0).max() <= allowed
    straight = beam_range(scales, place, -up)[0]
    np.testing.assert_allclose(straight, 7.3e3, atol=allowed)
    outwards = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    assert np.sum(outwards * up, axis=1).min() > 0.999
    assert np.isnan(beam_range(scales, place, up)[0]).all()
    assert np.isnan(beam_range(scales, place, level)[0]).all()


def landing(**changes: Any) -> Ins:
    """Land in the last two minutes with a unit that has biases alone, so that the filter knows all errors."""
    content: dict[str, Any] = deepcopy(CAMPAIGN)
    content["scenario"]["start"] = "600 s"
    content["imu"] = {"gyro": {"bias": "0.01 deg/h"}, "accelerometer": {"bias": "50 ug"}}
    content["filter"] = {"estimates": CAMPAIGN["filter"]["estimates"][:5] + CAMPAIGN["filter"]["estimates"][7:]}
    content["aiding"] = [each for each in content["aiding"] if "crater" not in each.get("name", "")]
    content["aiding"][0] |= {"range": "5 m", "map_error": "10 m", "latitude": "0.01 deg", "longitude": "15.22 deg"}
    content["errors"]["position"] = "5 m"  # the direction to a landmark that is near is not linear in more
    content["filter"]["estimates"] += changes.pop("estimates", [])
    for key, value in changes.items():
        content["aiding"][key == "velocimeter"].update(value)
    campaign = parse_campaign(content, str(ROOT / "campaigns" / "mine.toml"), "mine")
    assert isinstance(campaign.scenario, Ins)
    return campaign.scenario


def test_a_velocimeter_measures_how_its_own_place_moves() -> None:
    """Along each beam, and how far the ground is from there: by differences of its path, in a turn of the vehicle.

    Central differences over 2 h leave h^2 / 6 of the third derivative, below 1e-6 m/s for h = 1 ms, and the rounding of
    places of 6.4e6 m, 1e-9 m / 1 ms.
    """
    truth, arm, step = flight(), np.array([2.0, -1.0, 0.5]), 1e-3
    beams, times = np.array([[0.6, 0.0, 0.8, 0.0], [0.0, -0.6, 0.8, 0.0]]), np.array([610.0, 640.0])

    def places(at: np.ndarray) -> np.ndarray:
        return np.asarray(truth.earth_fixed(at)[0] + truth.attitude(at).as_matrix() @ arm)

    around = Surroundings.at(truth, "strapdown", 600.0, times, arm, beams)
    moves = (places(times + step) - places(times - step)) / (2.0 * step)
    body = truth.attitude(times).as_matrix()
    assert np.linalg.norm(np.cross(around.turning, arm), axis=1).min() > 0.03
    for axis, beam in enumerate(beams):
        expected = np.sum(body @ beam[:3] * moves, axis=1)
        np.testing.assert_allclose(beam_velocity.geometry(around, axis).true, expected, atol=3e-6)
        distance = beam_range(ground_scales(WGS84, 0.0), places(times), body @ beam[:3])[0]
        np.testing.assert_allclose(beam_distance.geometry(around, axis).true, distance, rtol=1e-12)
    np.testing.assert_allclose(distances(truth, times, beams, arm)[:, 1], distance, rtol=1e-12)


def test_a_matched_filter_knows_its_errors_and_samples_have_them() -> None:
    """The recursions of true errors and of the filter's own are equal to 1e-9; one in 1e4 of 500 samples is outside.

    The landmark is 700 m away at last, and its map errs by 10 m: filters whose responses to a shift of the vehicle and
    of the map are not opposite would know the position too well, by a fifth.
    """
    arm = {"lever_arm": ["2 m", "-1 m", "0.5 m"], "lever_arm_error": "5 cm"}
    scenario = landing(velocimeter=arm, estimates=["velocimeter_lever_arm"])
    of = scenario.navigation.aided
    assert of is not None
    sigmas = np.array([scenario.navigation.sigmas[source.name] for source in scenario.sources])
    linear, sources = of.linear, np.diag(sigmas**2)
    true = linear.partials @ sources @ linear.partials.swapaxes(1, 2) + sum(linear.processes.values())
    variances = np.diagonal(true, axis1=1, axis2=2)
    np.testing.assert_allclose(variances, np.diagonal(linear.own, axis1=1, axis2=2), rtol=1e-9)
    count = 500
    errors = np.random.default_rng(4).standard_normal((count, len(sigmas))) * sigmas
    values = simulate_aided(of.tables(1), errors, 5, np.arange(count), True).values[:, -1]
    ratio = np.mean(values**2, axis=0) / variances[-1]
    low, high = stats.chi2.ppf([5e-5 / 9, 1.0 - 5e-5 / 9], count) / count
    assert np.all((low < ratio) & (ratio < high)), ratio


@pytest.mark.parametrize(
    ("sensor", "change", "message"),
    [
        ("velocimeter", {"beams": [[0, 0, 0]]}, "beams: got [[0, 0, 0]]; expected one to three beams such as"),
        ("velocimeter", {"beams": "down"}, "beams: got 'down'; expected one to three beams such as"),
        ("velocimeter", {"beams": [[0, 0, -1]]}, "beams: miss the ground at all instants of the sensor"),
        ("velocimeter", {"reach": "10 m"}, "reach: got '10 m'; the beams are"),
        ("velocimeter", {"beams": [[0, 0, 1]], "velocity": {"2": "1 cm/s"}}, "velocity: names no axis"),
        ("site", {"latitude": "95 deg"}, "latitude: got '95 deg'; expected an angle within 90 deg"),
        ("site", {"longitude": "120 deg"}, "the vehicle is below the landmark's horizon at all instants"),
        ("site", {"reach": "10 m"}, "reach: got '10 m'; the nearest distance above its horizon is"),
    ],
)
def test_what_cannot_be_measured_is_refused(sensor: str, change: dict[str, object], message: str) -> None:
    with pytest.raises(CampaignError) as refusal:
        landing(**{sensor: change})
    assert message in str(refusal.value)
