"""A boost: closed forms of rise and velocity, the pitch program, the gravity turn, and the force of the thrust."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.physics.constants import STANDARD_GRAVITY
from mcnav.systems.ins.earth import WGS84, Earth, local_axes
from mcnav.systems.ins.truth.boost import RAMP, Boost, BoostError, Launch, Stage, boost_truth
from mcnav.systems.ins.truth.rows import rows_from

DEG = np.pi / 180.0
SPHERE = Earth(6_371_000.0, 0.0, 3.986e14, 0.0)
TWO = Boost(28.5 * DEG, -80.5 * DEG, 60.0 * DEG, (Stage(13.0, 35.0, 120.0), Stage(12.0, 30.0, 180.0, 2.0)), coast=100.0)


def test_thrust_is_that_of_constant_mass_flow() -> None:
    """The integral over a stage is the rocket equation: c ln(last / first) with c = a_first T / (1 - first / last)."""
    stage = TWO.stages[0]
    times = np.linspace(RAMP, stage.burn - RAMP, 20_001)
    values = np.array([TWO.thrust(float(time), 9.8) for time in times])
    gained = np.trapezoid(values, times)
    assert gained == pytest.approx(
        stage.first * stage.burn / (1.0 - stage.first / stage.last) * np.log(values[-1] / values[0]), rel=1e-8
    )
    assert TWO.thrust(121.0, 9.8) == 0.0
    assert TWO.thrust(0.0, 9.8) == 9.8
    assert TWO.cutoff == 302.0


@pytest.mark.parametrize("earth", [WGS84, SPHERE])
def test_the_force_is_the_thrust_along_the_body(earth: Earth) -> None:
    truth, launch = boost_truth(TWO, earth), Launch(TWO, earth)
    times = truth.times
    states = truth.states(times, "strapdown", 0.0)
    thrust = np.array([TWO.thrust(float(time), launch.support) for time in times])
    # positions are rounded to 1e-9 m, and the shortest steps 0.05 s: 20 such errors along each of two axes
    np.testing.assert_allclose(states.force[:, 0], thrust, rtol=0.0, atol=40e-9 / 0.05**2)
    np.testing.assert_allclose(states.force[:, 1:], 0.0, rtol=0.0, atol=40e-9 / 0.05**2)
    between = np.linspace(RAMP, 119.0, 4_001)
    thrust = np.array([TWO.thrust(float(time), launch.support) for time in between])
    states = truth.states(between, "strapdown", 0.0)
    found = np.linalg.norm(states.force, axis=1)
    np.testing.assert_allclose(found, thrust, rtol=0.0, atol=2e-6 * STANDARD_GRAVITY)
    free = truth.states(np.linspace(303.0, times[-1], 101), "strapdown", 0.0).force
    np.testing.assert_allclose(free, 0.0, rtol=0.0, atol=1e-6 * STANDARD_GRAVITY)


def test_it_rises_from_rest_then_turns_with_its_velocity() -> None:
    truth = boost_truth(TWO, WGS84)
    assert np.linalg.norm(truth.earth_fixed(np.zeros(1))[1]) < 1e-9
    rows = rows_from(truth, truth.times)
    assert rows.velocity is not None
    assert rows.altitude[0] == pytest.approx(0.0, abs=1e-6)
    pitch, velocity = rows.angles[:, 1], rows.velocity
    climb = np.arctan2(-velocity[:, 2], np.hypot(velocity[:, 0], velocity[:, 1]))
    rising = rows.time <= TWO.rise
    np.testing.assert_allclose(pitch[rising], np.pi / 2.0, rtol=0.0, atol=1e-7)  # arcsin near one loses half the digits
    kicked = np.argmin(np.abs(rows.time - TWO.rise - TWO.kick_time))
    assert pitch[kicked] == pytest.approx(np.pi / 2.0 - TWO.kick, abs=1e-9)
    turning = rows.time > 60.0
    np.testing.assert_allclose(pitch[turning], climb[turning], rtol=0.0, atol=1e-9)
    course = np.arctan2(velocity[turning, 1], velocity[turning, 0])
    np.testing.assert_allclose(rows.angles[turning, 0], course, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(rows.angles[turning, 2], 0.0, rtol=0.0, atol=1e-9)
    assert np.all(np.diff(pitch[turning]) < 0.0)


def test_a_vertical_body_has_its_belly_towards_the_azimuth() -> None:
    """On its launch site, to half of the digits: within these it counts as upright."""
    axes = boost_truth(TWO, WGS84).states(np.zeros(1), "strapdown", 0.0).axes[0]
    local = local_axes(np.array(TWO.latitude), np.array(TWO.longitude))
    azimuth = np.array([np.cos(TWO.azimuth), np.sin(TWO.azimuth), 0.0])
    np.testing.assert_allclose(axes[:, 2] @ local, azimuth, rtol=0.0, atol=2e-6)


def test_energy_is_kept_in_free_flight() -> None:
    truth = boost_truth(TWO, SPHERE)
    states = truth.states(truth.times[truth.times >= TWO.cutoff], "strapdown", 0.0)
    radius = np.linalg.norm(states.position, axis=1)
    energy = 0.5 * np.linalg.norm(states.velocity, axis=1) ** 2 - 3.986e14 / radius
    np.testing.assert_allclose(energy, energy[0], rtol=1e-11)


def test_it_ends_where_it_comes_down() -> None:
    stage = Stage(15.0, 15.0, 40.0)
    truth = boost_truth(Boost(0.5, 0.1, 1.0, (stage,), altitude=200.0, coast=1_000.0), WGS84)
    assert 40.0 < truth.times[-1] < 1_000.0
    assert truth.geodetic(truth.times[-1:])[0, 2] == pytest.approx(200.0, abs=1e-3)


def test_what_cannot_be_flown() -> None:
    with pytest.raises(BoostError, match="too small to lift off") as found:
        boost_truth(Boost(0.5, 0.1, 1.0, (Stage(9.0, 30.0, 100.0),)), WGS84)
    assert found.value.key == "stages #1.acceleration"
    with pytest.raises(BoostError, match="kick less"):
        boost_truth(Boost(0.5, 0.1, 1.0, (Stage(15.0, 15.0, 22.0),), kick=0.8), WGS84)
