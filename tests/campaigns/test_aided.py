"""Campaigns of aided navigation, 18 to 23: their answers, small versions of them by all engines."""

from __future__ import annotations

import re
import tomllib
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from mcnav.analysis.linear_covariance import LinearCovariance
from mcnav.arrays.types import Array
from mcnav.config.read import Campaign, parse_campaign
from mcnav.store.run_folder import RunFolder
from mcnav.studies.linear_covariance import linear_covariance
from mcnav.systems.ins.aided import TOLERANCE
from mcnav.systems.ins.imu.instruments import OUTPUTS
from mcnav.systems.ins.scenario import Ins
from mcnav.workflow.analyse import samples_of
from tests.runs import simulate

FOLDER = Path(__file__).parents[2] / "campaigns"

FOOT = 0.3048
SCHULER = 5060.0
"""Period of the cruise's pendulum as the case prints it, s."""

SPHERE = {
    "radius": "3960 mi",
    "gravitational_parameter": f"{32.2 * FOOT * (3960.0 * 5280.0 * FOOT) ** 2} m^3/s^2",
    "rotation_rate": "0 rad/s",
}
"""The earth of the case, at rest."""

HORIZONTAL = slice(0, 2)
PRODUCTS = 5e-3
"""Products of two errors, in sigmas: three sigmas of the heading, 1.5 mrad, times three sigmas."""

DEVIATIONS = 5.0
"""Standard errors allowed: one test in 1.7 million fails by chance."""

Entries = dict[str, Any]


def entries(number: int) -> Entries:
    (path,) = FOLDER.glob(f"{number}_*.toml")
    return tomllib.loads(path.read_text(encoding="utf-8"))


def run(folder: Path, described: Entries, engine: str | None = None, **changes: Any) -> Entries:
    campaign = parse_campaign(described | changes, str(FOLDER / "small.toml"), "small")
    return dict(simulate(campaign, folder, engine, 1).summary)


def covariance(described: Entries, times: list[float] | None = None) -> LinearCovariance:
    campaign = parse_campaign(described, str(FOLDER / "small.toml"), "small")
    return over_time(campaign, None if times is None else np.array(times))


def over_time(campaign: Campaign, times: Array | None) -> LinearCovariance:
    answer = linear_covariance(campaign, times)
    found = answer.asked or answer.history
    assert found is not None
    return found


def last(found: LinearCovariance, times: list[float]) -> Array:
    """Return the numbers of the readings after the updates at some times."""
    return np.searchsorted(found.readings.times, np.array(times) + 1e-6) - 1


def unaided(described: Entries) -> Entries:
    return {key: value for key, value in deepcopy(described).items() if key not in ("aiding", "filter", "accept")}


def shortened(number: int, end: float, outage: tuple[float, float]) -> Entries:
    """Return campaign 19 or 20 with an earlier end and outage, and without requirements."""
    found = entries(number)
    found["scenario"]["end"] = f"{end} s"
    found["aiding"][0]["outages"] = [[f"{time} s" for time in outage]]
    found.pop("accept", None)
    return found


def test_a_matched_filter_is_consistent(tmp_path: Path) -> None:
    """NEES and NIS are those of chi-square variates, though so few samples decide nothing."""
    accept = {"r95": [{"outputs": ["position_north", "position_east"], "below": "20 m", "during": "outages"}]}
    samples, end, outage = 60, 240.0, (120.0, 180.0)
    summary = run(tmp_path / "run", shortened(19, end, outage), samples=samples, accept=accept)
    assert abs(summary["nees_filter_mean"] - 9.0) < DEVIATIONS * np.sqrt(18.0 / samples)
    updates = end - (outage[1] - outage[0])
    assert abs(summary["nis_mean"]["gnss"] - 6.0) < DEVIATIONS * np.sqrt(12.0 / (samples * updates))
    np.testing.assert_allclose(summary["sigma_filter"], summary["sigma_linear"], rtol=0.01)
    assert not summary["filter_verdict"].startswith("The filter is")  # of 60 samples neither can be said
    (requirement,) = summary["requirements"]
    assert (requirement["finding"], requirement["when"]) == ("met", "during outages")
    assert 60.0 * requirement["time"] == pytest.approx(outage[1], abs=1.0)  # just before its end


def test_errors_that_a_filter_believes_absent(tmp_path: Path) -> None:
    """Their variances are rounding, of either sign; steps are settled by the errors themselves, without a warning."""
    described = shortened(19, 40.0, (20.0, 30.0))
    described["errors"] = {"position": "5 m", "heading": "0.5 mrad"}
    for engine in ("ensemble", "shared-gains"):
        run(tmp_path / engine, described, engine, samples=20)
        accuracy = RunFolder(tmp_path / engine).existing_manifest().accuracy
        stated = re.search(r"numerical error of 8 probe samples (\S+) of the filter's sigma", accuracy)
        assert stated is not None
        assert float(stated[1]) <= TOLERANCE


def test_in_the_outage_the_position_drifts_as_the_file_says() -> None:
    described = entries(19)
    found = covariance(described, [1199.9, 1499.9, 1560.0])
    np.testing.assert_allclose(found.sigma, found.sigma_filter, rtol=1e-9)
    before, within, after = found.sigma[last(found, [1199.9, 1499.9, 1560.0])][:, HORIZONTAL]
    np.testing.assert_allclose(before, 0.45, rtol=0.02)
    np.testing.assert_allclose(within, 6.15, rtol=0.02)
    assert np.all(after < 0.5)
    circle = float(np.sqrt(stats.chi2.ppf(0.95, 2)))
    for requirement, sigma in zip(described["accept"]["r95"], (within, after), strict=True):
        assert circle * sigma.max() < float(requirement["below"].removesuffix(" m"))


def test_neglected_errors_make_a_filter_optimistic(tmp_path: Path) -> None:
    """Linear analysis knows the factor beforehand; Monte Carlo's interval has it, and both name the misalignments."""
    described = shortened(20, 900.0, (300.0, 360.0))
    summary = run(tmp_path / "run", described, samples=40)
    known = summary["filter"]
    assert known["verdict"] == "optimistic"
    assert known["group"] == "attitude"
    found = covariance(described)
    assert found.sigma_filter is not None
    epoch = int(np.argmin(np.abs(found.readings.times - 60.0 * known["worst"])))
    attitude = (found.sigma / found.sigma_filter)[epoch, 6:]
    low, high = known["factor_interval"]
    assert low < attitude.max()
    assert high > attitude.min()
    neglected = [cause["name"] for cause in known["neglected"]]
    assert neglected[0].startswith("gyro_misalignment")
    assert all("misalignment" in name or "scale_factor" in name for name in neglected[:3])
    groups = known["groups"]
    assert groups["navigation"]["ratio_linear"] == pytest.approx(groups["navigation"]["ratio"], rel=0.5)
    assert groups["sensors"]["size"] == groups["navigation"]["size"]
    assert groups["sensors"]["ratio_linear"] is None  # linear analysis has variances of these states, and no covariance


def test_the_mean_of_a_fixed_error_is_named(tmp_path: Path) -> None:
    """A lever arm that is 5 m longer than the filter knows moves all positions alike.

    A gyro's bias, fixed in truth, of which the filter believes the size, is none of the causes.
    """
    described = shortened(19, 300.0, (100.0, 120.0))
    described["errors"] |= {
        "gnss_lever_arm_x": {"distribution": "fixed", "value": "5 m"},
        "gyro_bias_x": {"distribution": "fixed", "value": "0.008 deg/h"},
    }
    del described["imu"]["gyro"]["bias"]
    described["filter"]["believes"] = {"imu": {"gyro": {"bias": "0.008 deg/h"}}}
    summary = run(tmp_path / "run", described, samples=100)
    known = summary["filter"]
    assert (known["verdict"], known["group"]) == ("optimistic", "position")
    assert known["neglected"][0]["name"] == "mean_of_gnss_lever_arm_x"
    assert known["neglected"][0]["share"] > 0.99
    assert not any("gyro_bias_x" in cause["name"] for cause in known["neglected"])
    assert known["neglected_output"].startswith("position_")
    assert "Largest unmodelled error: mean of gnss lever arm x (100 %)." in summary["filter_verdict"]


def test_the_largest_errors_that_are_neglected() -> None:
    """At the worst time of the whole hour, by linear analysis."""
    found = covariance(entries(20))
    assert found.sigma_filter is not None
    ratio = (found.sigma / found.sigma_filter)[:, 6:8]
    assert 10.0 < ratio.max() < 14.0
    epoch, output = np.unravel_index(np.argmax(ratio), ratio.shape)
    shares = {name: variance[epoch, 6 + output] for name, variance in found.variances.items()}
    largest = sorted(shares, key=lambda name: -shares[name])[:2]
    assert all(name.startswith("gyro_misalignment") for name in largest)


def test_an_altimeter_bounds_altitude_alone(tmp_path: Path) -> None:
    described = entries(21)
    aided, free = covariance(described), covariance(unaided(described))
    assert aided.sigma[:, 2].max() < 7.0
    assert free.sigma[-1, 2] > 1e4
    assert np.all(aided.sigma[-1, HORIZONTAL] > 100.0 * aided.sigma[0, HORIZONTAL] / 1.2)
    summary = run(tmp_path / "run", described, samples=100)
    assert set(summary["verdicts"]) == {"agrees"}
    assert abs(summary["nees_filter_mean"] - 9.0) < DEVIATIONS * np.sqrt(18.0 / 100)


def test_an_altimeter_that_alone_holds_the_altitude_leaves_a_pendulum() -> None:
    """Speed errors become position errors dv / w sin(w t) with w² = g / R, to 1 % of gravity and radius."""
    described = entries(21)
    described["imu"] = {"accelerometer": {"velocity_random_walk": {"z": "10 mg/sqrt(Hz)"}}}
    described["errors"] = {"velocity_north": "1 m/s", "velocity_east": "1 m/s", "position_down": "1 m"}
    described["filter"]["estimates"] = ["position", "velocity", "attitude"]
    del described["aiding"][0]["bias"], described["accept"]
    found = covariance(described)
    rate = np.sqrt(9.81 / 6.37e6)
    times = found.readings.times
    speeds = found.variances["velocity_north"] + found.variances["velocity_east"]
    expected = np.sqrt(2.0) / rate * np.abs(np.sin(rate * times))
    np.testing.assert_allclose(np.sqrt(speeds[:, HORIZONTAL].sum(axis=1)), expected, atol=0.02 / rate)


def test_the_cruise_is_that_of_the_story(tmp_path: Path) -> None:
    """On the sphere of the case, and by samples on the ellipsoid that turns."""
    described = entries(18)
    summary = run(tmp_path / "run", described, samples=100)
    assert summary["verdict"] == "agrees"
    assert set(summary["verdicts"]) == {"agrees"}
    assert abs(summary["nees_filter_mean"] - 9.0) < DEVIATIONS * np.sqrt(18.0 / 100)
    described["scenario"]["earth"] = SPHERE
    described["scenario"]["trajectory"]["start"] |= {"latitude": "0 deg", "course": "90 deg"}
    errors = {"range_rate": "1 ft/s", "cross_range_rate": "1 ft/s", "bias_x": "100 ug", "bias_y": "100 ug"}
    errors |= dict.fromkeys(("misalignment", "roll_misalignment", "azimuth_misalignment"), "0.01 deg")
    errors |= dict.fromkeys(("gyro_drift", "roll_drift", "azimuth_drift"), "0.01 deg/h")
    for time in (SCHULER / 2.0, SCHULER):
        cruise = entries(11)
        del cruise["scenario"]["distance"]
        cruise["scenario"]["duration"] = f"{time} s"
        campaign = parse_campaign(cruise | {"errors": errors}, "cruise.toml", "cruise")
        partials = campaign.scenario.linear().end.partials
        variances = np.diag(partials @ campaign.errors.covariance @ partials.T)
        sigmas = dict(zip((output.name for output in campaign.scenario.outputs), np.sqrt(variances), strict=True))
        found = covariance(described, [time])
        north, east = found.sigma[-1, HORIZONTAL]
        assert north == pytest.approx(sigmas["cross_range"], rel=1e-3)  # hardly coupled with the altitude
        assert east == pytest.approx(sigmas["range"], rel=0.02)  # the filter notices what speed along the track weighs


def test_the_turning_earth_turns_the_swing() -> None:
    """After a period, a speed error is as large as at first, turned by the angle of the local axes about the vertical.

    That is the integral of (rate of the earth + rate of longitude) sin(latitude), a Foucault pendulum's of a vehicle.
    """
    described = entries(18)
    campaign = parse_campaign(described, str(FOLDER / "small.toml"), "small")
    scenario = campaign.scenario
    assert isinstance(scenario, Ins)
    names = [source.name for source in scenario.sources]
    found = over_time(campaign, np.array([SCHULER]))
    columns = [names.index(name) for name in ("velocity_north", "velocity_east")]
    kept = found.readings.partials[-1][3:5][:, columns]
    turned = complex(kept[0, 0] + kept[1, 1], kept[1, 0] - kept[0, 1]) / 2.0
    times = np.linspace(0.0, SCHULER, 2001)
    latitude, longitude, _ = scenario.navigation.truth.geodetic(times).T
    rate = 7.292115e-5 + np.gradient(np.unwrap(longitude), times)
    expected = np.trapezoid(rate * np.sin(latitude), times)
    assert abs(turned) == pytest.approx(1.0, abs=0.01)
    assert abs(np.angle(turned)) == pytest.approx(expected, abs=np.radians(1.0))


def test_what_is_true_of_the_factor_of_ten(tmp_path: Path) -> None:
    """Three as it is, more than ten of gyro drift alone, and ten with accelerometers that are ten times better."""
    end = [2.0 * SCHULER]

    def without(described: Entries) -> Entries:
        found = deepcopy(described)
        found["aiding"] = found["aiding"][:1]
        found["filter"]["estimates"].remove("star_tracker_bias")
        return found

    def errors(described: Entries) -> tuple[float, float]:
        found = covariance(described, end)
        drift = sum(each[-1, HORIZONTAL].sum() for name, each in found.variances.items() if name.startswith("gyro"))
        return float(np.hypot(*found.sigma[-1, HORIZONTAL])), float(np.sqrt(drift))

    described = entries(22)
    (whole, drift), (whole_without, drift_without) = errors(described), errors(without(described))
    assert whole == pytest.approx(1412.0, rel=0.01)
    assert whole_without == pytest.approx(4365.0, rel=0.01)
    assert whole_without / whole == pytest.approx(3.1, abs=0.1)
    assert drift_without / drift > 10.0
    described["imu"]["accelerometer"]["bias"] = "10 ug"
    assert errors(without(described))[0] / errors(described)[0] == pytest.approx(11.4, abs=0.3)
    summary = run(tmp_path / "run", entries(22), samples=100)
    assert set(summary["verdicts"]) == {"agrees"}
    assert abs(summary["nees_filter_mean"] - 9.0) < DEVIATIONS * np.sqrt(18.0 / 100)


@pytest.mark.parametrize("minutes", [60.0, 30.0, 5.0])
def test_one_update_starts_navigation_anew(minutes: float) -> None:
    """The errors after the update and those of the instruments, hardly estimated, lead to those at the end.

    The axes of a platform are those at the start, so that scale factors, alike along each axis, would differ.
    """
    update = 3810.6 - 60.0 * minutes
    described = entries(23)
    del described["imu"]["accelerometer"]["scale_factor"]
    described["filter"]["estimates"].remove("accelerometer_scale_factor")
    for sensor in described["aiding"]:
        sensor["instants"] = [f"{update} s"]
    campaign = parse_campaign(described, str(FOLDER / "small.toml"), "small")
    found = over_time(campaign, np.array([update]))
    end = over_time(campaign, np.array([5230.0]))
    assert found.readings.updates[-1] == "after"
    partials = found.readings.partials[-1]
    noise = sum(each[-1] for each in found.readings.processes.values())
    after = partials @ campaign.errors.covariance @ partials.T + noise
    start = unaided(described)
    start["scenario"]["start"] = f"{update} s"
    anew = parse_campaign(start, str(FOLDER / "small.toml"), "small")
    (onwards,) = over_time(anew, np.array([5230.0])).readings.partials
    sizes = anew.errors.covariance.copy()
    sizes[:9, :9] = after
    expected = np.sqrt(np.diag(onwards @ sizes @ onwards.T))
    np.testing.assert_allclose(end.sigma[-1], expected, rtol=0.02)


def test_a_return_that_is_updated_once(tmp_path: Path) -> None:
    summary = run(tmp_path / "run", entries(23), samples=100)
    assert set(summary["verdicts"]) == {"agrees"}
    assert abs(summary["nees_filter_mean"] - 9.0) < DEVIATIONS * np.sqrt(18.0 / 100)
    for name, size in (("tracking", 6.0), ("star_tracker", 3.0)):
        assert abs(summary["nis_mean"][name] - size) < DEVIATIONS * np.sqrt(2.0 * size / 100)
    assert summary["requirements"][0]["finding"] == "met"


def test_the_reference_engine_flies_aided_campaigns(tmp_path: Path) -> None:
    """Its samples keep to their linear twins, by its own mechanization and filterpy's filter."""
    described = shortened(19, 90.0, (40.0, 60.0))
    summary = run(tmp_path / "run", described, engine="reference", samples=4)
    ensemble = run(tmp_path / "ensemble", described, samples=4)
    assert summary["sigma_linear"] == ensemble["sigma_linear"]
    stored = samples_of(tmp_path / "run")
    for output, sigma in zip(OUTPUTS, summary["sigma_linear"], strict=True):
        (outcome,) = [name for name in stored.columns if name.startswith(f"output {output} ")]
        apart = stored[outcome] - stored[outcome.replace("output", "linear")]
        assert np.all(np.abs(apart) < PRODUCTS * sigma)
    np.testing.assert_allclose(summary["sigma_filter"], summary["sigma_linear"], rtol=0.01)


@pytest.mark.parametrize(("engine", "samples"), [("ensemble", 100), ("shared-gains", 100), ("reference", 4)])
def test_a_matched_filter_is_not_judged_by_rounding(engine: str, samples: int, tmp_path: Path) -> None:
    """Without tilt at the start, its variance is what rounding leaves, and its error of second order in position."""
    described = shortened(19, 80.0, (70.0, 75.0))
    described["scenario"]["start"] = "60 s"
    described["errors"] = {"position": "5 m", "heading": "0.5 mrad"}
    summary = run(tmp_path / "run", described, engine, samples=samples)
    assert summary["failed"] == 0
    assert not summary["filter_verdict"].startswith(("The filter is optimistic", "The filter is pessimistic"))
    assert not pd.read_parquet(tmp_path / "run" / "epochs.parquet").iloc[0].filter(regex="filter sigma tilt").any()
