"""The Story of 84 Minutes: is it 1/100, a wrong gear ratio, how poor an altimeter suffices."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from mcnav.config.campaign import Campaign
from mcnav.config.read import read_campaign
from mcnav.validation.reproduce.story_of_84_minutes.altimeter import (
    GROWTH,
    INTERVALS,
    filtered,
    largest,
    poorest,
    poorest_from_start,
    settled_before,
)
from mcnav.validation.reproduce.story_of_84_minutes.detuned import BIAS, GRAVITY, SHARES, closed_form, simulated
from mcnav.validation.reproduce.story_of_84_minutes.numbers import MILE, MINUTE, PERIOD, RADIUS, SPEED, TIME
from mcnav.validation.reproduce.story_of_84_minutes.reduction import (
    ALL_LARGEST,
    ALL_NOW,
    at_minutes,
    printed_reductions,
    reduction_curves,
)
from tests.conftest import ROOT

AFTER_169_MIN = {"accelerometer": 39, "tilt": 39, "launch velocity": 13, "gyro drift": 26, ALL_NOW: 42, ALL_LARGEST: 37}


@pytest.fixture(scope="module")
def reductions() -> pd.DataFrame:
    return reduction_curves()


def test_reductions_after_two_periods_and_after_a_boost(reductions: pd.DataFrame) -> None:
    """By hand: g t^2 / 4 R for tilt and accelerometer, w t for the velocity, g t^2 / 6 R for the drift."""
    end, boost = at_minutes(reductions, TIME / MINUTE), at_minutes(reductions, 3.0)
    for name, expected in AFTER_169_MIN.items():
        assert round(end[f"{name} [1]"]) == expected
        assert round(boost[f"{name} [1]"]) == 1
    assert end["launch velocity [1]"] == pytest.approx(4.0 * np.pi, rel=1e-6)
    assert end["gyro drift [1]"] == pytest.approx(32.2 / 5280.0 / 3960.0 * TIME**2 / 6.0, rel=1e-3)


def test_misprints_make_the_summary_s_ratios() -> None:
    """Rows without a misprint agree within a slide rule's 0.5 %; a missing 1/2 or 1/6 makes a factor of 2 or 6."""
    for row in printed_reductions():
        if row.misprinted:
            assert 1.9 < row.ratio / row.right < 6.1
        else:
            assert row.ratio == pytest.approx(row.right, rel=5e-3)


@pytest.mark.parametrize("speed", [0.0, SPEED])
@pytest.mark.parametrize("share", SHARES)
def test_detuned_loops_are_their_closed_form(share: float, speed: float) -> None:
    """The sine of a lean L is L less L^3 / 6: a force that drives the pendulum for the flight, at most in resonance."""
    times = np.linspace(0.0, TIME, 41)[1:]
    flown, closed = (function(share, speed, BIAS, times) for function in (simulated, closed_form))
    rate = 2.0 * np.pi / PERIOD
    lean = 2.0 * BIAS / GRAVITY + 2.0 * share * speed / (rate * RADIUS)
    assert np.abs(flown - closed).max() < GRAVITY * lean**3 / 6.0 * TIME / rate + 1e-2


def test_a_wrong_gear_ratio_costs_its_share_of_the_distance() -> None:
    """After two periods of the loop the error is d / (1 + d) of 5,060 miles, and the loop's last swing, V d / W."""
    for share, expected in zip(SHARES[1:], (5.1, 50.1, 441.8), strict=True):
        error = abs(float(simulated(share, SPEED, BIAS, np.array([TIME]))[0])) / MILE
        assert error == pytest.approx(expected, abs=0.05)
        assert error == pytest.approx(5060.0 * share / (1.0 + share), rel=0.05)


def settled_after(sigma: float, interval: float) -> float:
    """The height's sigma after a reading, once settled, m."""
    return float(sigma * np.sqrt(-np.expm1(-2.0 * GROWTH * interval)))


@pytest.mark.parametrize("interval", INTERVALS)
def test_the_filter_settles_at_the_closed_form(interval: float) -> None:
    """After 84 minutes, nine time constants of the growth: what is then left of the bias makes 0.2 %."""
    before, after = filtered(100.0, interval)
    assert before[-1] == pytest.approx(settled_before(100.0, interval), rel=2e-3)
    assert after[-1] == pytest.approx(settled_after(100.0, interval), rel=2e-3)
    assert settled_before(poorest(100.0, interval), interval) == pytest.approx(100.0)


def test_poorest_altimeter_while_the_bias_is_learnt() -> None:
    """At the limit the largest height is the one to be held; ten minutes of 1e-4 g alone are more than 100 m."""
    assert largest(poorest_from_start(100.0, 60.0), 60.0) == pytest.approx(100.0, rel=1e-3)
    assert np.isnan(poorest_from_start(100.0, 600.0))
    assert 0.5 * BIAS * 600.0**2 > 100.0


def test_the_campaign_of_the_altimeter_agrees() -> None:
    """The navigator in three dimensions at its end, 20 s after the last reading, with bias alone: within 1 %.

    On the ellipsoid g / r differs by up to 0.5 %, the rate of growth by half of that, sigma by less. The campaign's
    noise and horizontal errors, of which Coriolis' force makes vertical ones, add 3 %.
    """
    alone = {"imu": {"accelerometer": {"bias": {"z": "100 ug"}}}, "errors": {}}
    path = ROOT / "campaigns" / "38_hover_with_an_altimeter.toml"
    closed = settled_after(100.0, 60.0) * np.exp(20.0 * GROWTH)
    assert _final_height(read_campaign(path, alone)) == pytest.approx(closed, rel=0.01)
    assert 1.0 < _final_height(read_campaign(path)) / closed < 1.05


def _final_height(campaign: Campaign) -> float:
    """Return the sigma of the height at the end by linear analysis, m."""
    model = campaign.scenario.linear().end
    down = [output.name for output in campaign.scenario.outputs].index("position_down")
    covariance = campaign.errors.covariance
    noise = sum(process[down, down] for process in model.processes.values())
    return float(np.sqrt(model.partials[down] @ covariance @ model.partials[down] + noise))
