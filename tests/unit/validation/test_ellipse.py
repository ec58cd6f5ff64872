"""The appendix of NASA TN D-1772: perigee partials in closed form, against differences and against a flown reentry."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from mcnav.physics.constants import EARTH_RADIUS
from mcnav.systems.reentry.scenario import Flight, Reentry
from mcnav.systems.reentry.table_i import common_start
from mcnav.systems.reentry.vehicle import ConstantLift, Vehicle
from mcnav.validation.reproduce.tn_d1772.ellipse import (
    Ellipse,
    ellipse_of,
    perigee_by_rates,
    perigee_by_speed_and_angle,
    perigee_radius,
)

Array = NDArray[np.float64]

PRINTED = Ellipse(2.025e8, 0.9683, 7.099e10)
"""NASA TN D-1772, eq. (17), in SI units."""


def _states() -> list[Array]:
    """(r, r', theta') at eight radii on the way in of the report's ellipse."""
    start = common_start()
    orbit = ellipse_of(float(start[0]), float(start[2]), float(start[3]))
    radii = np.linspace(EARTH_RADIUS + 121_920.0, start[0], 8)
    speeds, angles = orbit.speed(radii), orbit.flight_path_angle(radii)
    return list(np.column_stack([radii, speeds * np.sin(angles), speeds * np.cos(angles) / radii]))


def _differences(function: Callable[..., Array], at: Array) -> Array:
    """Central differences with a step of 1e-5: their error is 1e-10 by the step and 1e-16 / 1e-5 by rounding."""
    steps = np.diag(1e-5 * np.abs(at))
    return np.array([(function(*(at + h)) - function(*(at - h))) / (2.0 * h[k]) for k, h in enumerate(steps)])


@pytest.mark.parametrize("state", _states(), ids=lambda state: f"{state[0] / 1e3:.0f} km")
def test_closed_forms_against_differences(state: Array) -> None:
    np.testing.assert_allclose(perigee_by_rates(*state), _differences(perigee_radius, state), rtol=2e-8)

    def by_speed_and_angle(radius: float, speed: float, angle: float) -> Array:
        return perigee_radius(radius, speed * np.sin(angle), speed * np.cos(angle) / radius)

    across = state[0] * state[2]
    other = np.array([state[0], np.hypot(state[1], across), np.arctan2(state[1], across)])
    np.testing.assert_allclose(
        perigee_by_speed_and_angle(*other), _differences(by_speed_and_angle, other), rtol=2e-8, atol=1e-6
    )


def test_the_printed_ellipse_is_that_of_the_printed_start() -> None:
    """Eq. (17) against eq. (18), to the four digits printed; its perigee is printed as 6.423e3 km, which is not
    a (1 - e) = 6.419e3 km: e has lost a digit that the difference 1 - e needs."""
    start = common_start()
    orbit = ellipse_of(float(start[0]), float(start[2]), float(start[3]))
    assert orbit.semimajor_axis == pytest.approx(PRINTED.semimajor_axis, abs=0.5e5)
    assert orbit.eccentricity == pytest.approx(PRINTED.eccentricity, abs=0.5e-4)
    assert orbit.angular_momentum == pytest.approx(PRINTED.angular_momentum, abs=0.5e7)
    assert orbit.perigee_radius == pytest.approx(6.423e6, abs=0.5e3)
    assert abs(PRINTED.perigee_radius - 6.423e6) > 3e3


def test_perigee_of_its_own_ellipse() -> None:
    """The root of eq. (26) against a (1 - e) of the elements: rounding times 1 / (1 - e)."""
    for state in _states():
        assert perigee_radius(*state) == pytest.approx(ellipse_of(*state).perigee_radius, rel=1e-12)


def test_a_flight_without_atmosphere_has_these_partials() -> None:
    """The propagated P of a drag-free flight that ends a millimetre above its perigee.

    There the altitude still falls at sqrt(2 r'' 1 mm) = 0.14 m/s, and an error that shifts the time of perigee shifts
    the altitude by as much times that: the tolerance, from Kepler's equation by differences.
    """
    start = common_start()
    perigee = float(perigee_radius(start[0], start[2], start[3]))
    flight = Flight(tuple(start), Vehicle(ConstantLift(0.0), 0.0), perigee - EARTH_RADIUS + 1e-3)
    scenario = Reentry(flight)
    trajectory = scenario.trajectory
    sizes = np.array([5e3, 0.5, 0.02 / start[0]])
    for time in np.linspace(0.0, 0.95 * trajectory.final_time, 12):
        state = trajectory.state(time)[[0, 2, 3]]
        partials = scenario.partials_at(np.array([time - trajectory.reentry_time]), "start")[0, 0]
        propagated = partials[[0, 2, 3]] * [1.0, 1.0, state[0]]  # the rate error is an arc's at the start radius

        def time_to_perigee(radius: float, rate: float, angle_rate: float) -> Array:
            return ellipse_of(radius, rate, angle_rate).time_to_perigee(np.array(radius))

        shift = np.abs(_differences(time_to_perigee, state))
        falling = abs(trajectory.state(trajectory.final_time)[2])
        allowed = (1.1 * falling * shift + 1e-7 * np.abs(perigee_by_rates(*state))) * sizes
        assert (np.abs(propagated - perigee_by_rates(*state)) * sizes < allowed).all()
