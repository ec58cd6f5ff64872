"""Initial errors of speed and flight-path angle as sources: the change of coordinates of NASA TN D-1772, p. 17."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.config.read import read_campaign
from mcnav.contract.engine import has_histories, without_noise
from mcnav.contract.history import History
from mcnav.entries.examples import example
from mcnav.errors import CampaignError
from mcnav.systems.reentry.instruments import Error
from mcnav.systems.reentry.scenario import Flight, Reentry
from mcnav.systems.reentry.speed_and_angle import SPEED_AND_ANGLE, SpeedAndAngleReentry, to_polar_rates
from mcnav.systems.reentry.table_i import ALL_ERRORS, TABLE_I, start_state
from mcnav.systems.reentry.vehicle import Vehicle
from mcnav.validation.reproduce.tn_d1772.starting import in_speed_and_angle, speed_and_angle_sizes, starts

SPEED, ANGLE = len(Error), len(Error) + 1
SIZES = np.append(ALL_ERRORS, [source.nominal for source in SPEED_AND_ANGLE])


@lru_cache
def _scenario(number: int, minutes: float, kind: type[Reentry] = SpeedAndAngleReentry) -> Reentry:
    row = TABLE_I[number]
    return kind(Flight(start_state(number), Vehicle(row.lift_law), row.final_altitude, 60.0 * minutes))


def _start(scenario: Reentry) -> Array:
    return scenario.trajectory.departure(scenario.navigation.start)


def _independent(start: Array) -> tuple[Array, Array]:
    """Covariance of the 14 sources where errors of radius, range, speed and angle are independent; and their sigmas."""
    radius, _, climb, rate = start
    speed, angle = np.hypot(climb, radius * rate), np.arctan2(climb, radius * rate)
    of_speed, of_arc = (float(size[0]) for size in speed_and_angle_sizes(start[None]))
    change = np.eye(len(SIZES))
    change[[SPEED, ANGLE], Error.ALTITUDE] = -np.cos(angle) * rate, np.sin(angle) * rate / speed
    sizes = np.append(ALL_ERRORS, [of_speed, of_arc / speed])
    sizes[[Error.ALTITUDE_RATE, Error.RANGE_RATE]] = 0.0
    own = np.append(ALL_ERRORS, [])
    own[[Error.ALTITUDE_RATE, Error.RANGE_RATE]] = of_speed, of_arc
    return change @ np.diag(sizes**2) @ change.T, own


@pytest.mark.parametrize(("number", "minutes"), [(4, 0.0), (2, -22.0)])
def test_the_covariance_of_correlated_sources_is_the_change_of_coordinates(number: int, minutes: float) -> None:
    """P S P' of the 14 sources, against P times the change with the independent sizes, to rounding.

    By the variational equations, and by the adjoint of all start times: both append the two columns.
    """
    scenario, polar = _scenario(number, minutes), _scenario(number, minutes, Reentry)
    start = _start(scenario)
    covariance, own = _independent(start)
    for partials, of_state in (
        (scenario.linear().end.partials, polar.linear().end.partials),
        (scenario.partials_at(np.array([60.0 * minutes]))[0], polar.partials_at(np.array([60.0 * minutes]))[0]),
        (scenario.linear_over_time().partials[3], polar.linear_over_time().partials[3]),
    ):
        changed = of_state.copy()
        changed[:, :4] = in_speed_and_angle(of_state[None, :, :4], start[None])[0]
        expected = (changed * own**2) @ changed.T
        scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
        assert partials @ covariance @ partials.T / scale == pytest.approx(expected / scale, abs=1e-12)


def test_an_altitude_error_that_keeps_speed_and_angle() -> None:
    """Trajectory 4 from reentry: 5 km end at 32.6 km with the polar rates, at 14.2 km with speed and angle.

    On the page of the report; by P S P' with correlations of minus one; and by one flight of the reference engine,
    whose second-order part is of 0.02 km.
    """
    computed = starts(4)
    assert computed.effects[-1, Error.ALTITUDE] == pytest.approx(32.6, abs=0.05)
    assert computed.converted[-1, Error.ALTITUDE] == pytest.approx(14.2, abs=0.05)
    scenario = _scenario(4, 0.0)
    start = _start(scenario)
    radius, _, climb, rate = start
    speed, angle = np.hypot(climb, radius * rate), np.arctan2(climb, radius * rate)
    kept = np.zeros(len(SIZES))
    kept[[Error.ALTITUDE, SPEED, ANGLE]] = 5e3 * np.array([1.0, -np.cos(angle) * rate, np.sin(angle) * rate / speed])
    partials = scenario.linear().end.partials
    final = np.sqrt(np.diag(partials @ np.outer(kept, kept) @ partials.T)) / 1e3
    assert 5.0 * abs(partials[0, Error.ALTITUDE]) == pytest.approx(32.6, abs=0.05)
    assert final[0] == pytest.approx(14.2, abs=0.05)
    flown = without_noise(scenario.engine("reference", kept[None]))(kept[None]).values[0, 0] / 1e3
    assert flown == pytest.approx(14.2, abs=0.07)


def test_the_indicated_start_has_these_errors_exactly() -> None:
    """Also where they are large: a tenth of the speed, and half a radian."""
    start = _start(_scenario(2, -22.0))
    radius, _, climb, rate = start
    speed, angle = np.hypot(climb, radius * rate), np.arctan2(climb, radius * rate)
    errors = np.zeros((1, len(SIZES)))
    errors[0, [SPEED, ANGLE]] = 0.1 * speed, 0.5
    (polar,) = to_polar_rates(errors, start)
    up, across = climb + polar[Error.ALTITUDE_RATE], radius * rate + polar[Error.RANGE_RATE]
    assert (np.hypot(up, across), np.arctan2(up, across)) == pytest.approx((1.1 * speed, angle + 0.5), rel=1e-14)


def test_both_engines_agree_with_each_other_and_with_their_polar_errors() -> None:
    scenario, polar = _scenario(4, 0.0), _scenario(4, 0.0, Reentry)
    errors = np.random.default_rng(5).standard_normal((32, len(SIZES))) * SIZES
    flown = [without_noise(scenario.engine(name, errors))(errors).values for name in scenario.engines]
    converted = to_polar_rates(errors, _start(scenario))
    assert flown[1] == pytest.approx(without_noise(polar.engine("reference", converted))(converted).values, abs=0.0)
    sigma = flown[1].std(axis=0)
    assert flown[0] / sigma == pytest.approx(flown[1] / sigma, abs=1e-5)
    engine = scenario.engine("ensemble", errors)
    assert has_histories(engine)
    histories = engine.histories(errors)
    assert histories[:, -1] / sigma == pytest.approx(flown[1] / sigma, abs=1e-5)
    sums = engine.history_sums(errors)
    assert sums.mean[-1] == pytest.approx(histories[:, -1].mean(axis=0), rel=1e-9)


def test_a_flight_begun_later_with_the_errors_in_force_ends_alike() -> None:
    """Error sets hold speed and angle errors in those of the polar state; histories and replay begin with them."""
    scenario = _scenario(2, -22.0)
    errors = np.random.default_rng(6).standard_normal((3, len(SIZES))) * SIZES
    errors[:, Error.MISALIGNMENT : SPEED] = 0.0  # the instruments' axes would be those of another start
    sets, final = scenario.error_sets(errors, np.array([-1_200.0]))
    assert not sets[..., [SPEED, ANGLE]].any()
    later = scenario.started_at(-1_200.0, "start")
    again = without_noise(later.engine("reference", sets[0]))(sets[0]).values
    assert again == pytest.approx(final, rel=1e-6)
    replayed = scenario.simulate_one(errors[0])
    assert isinstance(replayed, History)
    assert replayed.columns


def test_a_campaign_has_the_sources_where_it_names_one(tmp_path: Path) -> None:
    """Others keep their sources, draws and stored runs; with truths of their own the two are refused."""
    named, others = (read_campaign(example(number)).scenario.sources for number in ("36", "1"))
    assert [source.name for source in named[len(Error) :]] == ["speed", "flight_path_angle"]
    assert len(others) == len(Error)
    file = tmp_path / "guided.toml"
    file.write_text(
        'name = "g"\nsamples = 10\nseed = 1\n[scenario]\ntype = "reentry"\ntrajectory = 2\n[scenario.guidance]\n'
        '[errors]\nspeed = "1 m/s"\n'
    )
    with pytest.raises(CampaignError, match=r"errors.speed: is for samples that share one truth"):
        read_campaign(file)
