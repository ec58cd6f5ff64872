"""The filter on recorded flights, against the same flight along the truth; recorded values, against their inverse."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.config.read import Campaign
from mcnav.contract.recorded import FilteredRecord, RecordedMeasurements, Recording, RecordingError
from mcnav.contract.scenario import RecordingScenario, ScenarioError, can_be_recorded
from mcnav.judgement.likelihood import whiten, without_corrections
from mcnav.judgement.reduction import present, with_causes
from mcnav.judgement.simulation import recorded
from mcnav.runner.draws import DrawPlan
from mcnav.systems.ins.earth import WGS84
from mcnav.systems.ins.recognition import is_ins
from mcnav.systems.ins.recorded.causes import key_of
from mcnav.systems.ins.recorded.measurements import QUANTITIES, recorded_values, true_state
from mcnav.systems.ins.recorded.readings import gauss_readings
from mcnav.systems.ins.reference.aided import AidedMechanization
from mcnav.systems.ins.reference.collocation import NODES
from mcnav.systems.ins.reference.local_frame import LocalFrame
from mcnav.systems.ins.scenario import Ins
from mcnav.systems.ins.sensors.comparison import Indicated
from tests.every_sensor import every_sensor
from tests.recorded_flights import short_flight

INTERVAL = 0.05


def scenario_of(campaign: Campaign) -> RecordingScenario:
    assert can_be_recorded(campaign.scenario)
    return campaign.scenario


def errors_of(campaign: Campaign, index: int) -> Array:
    draws = DrawPlan(campaign.errors, campaign.design, campaign.seed, campaign.samples)
    return np.asarray(draws.batch(index, index + 1).errors[0])


@cache
def flown(index: int = 0) -> tuple[Campaign, Recording, FilteredRecord]:
    """Return a campaign, the recording of a sample, and the filter's record."""
    campaign = short_flight()
    scenario = scenario_of(campaign)
    recording = scenario.simulate_recording(errors_of(campaign, index), campaign.seed, index, INTERVAL)
    return campaign, recording, filtered(campaign, recording)


def filtered(campaign: Campaign, recording: Recording) -> FilteredRecord:
    mean = np.asarray(campaign.errors.mean)
    return scenario_of(campaign).filter_recording(recording, mean, campaign.errors.covariance)


def along_the_truth(campaign: Campaign, index: int) -> tuple[Array, Array]:
    """Return navigation errors and records of the reference engine with the same steps, at each second."""
    assert is_ins(campaign.scenario)
    ins: Ins = campaign.scenario
    aided = ins.navigation.aided
    assert aided is not None
    times = np.append(np.arange(1.0, aided.times[-1]), aided.times[-1])
    engine = AidedMechanization(
        aided.truth, "strapdown", aided.start, float(times[-1]), times, aided.sensors, aided.filter, INTERVAL
    )
    return engine.simulate(errors_of(campaign, index), engine.draw(aided.imu, campaign.seed, index))


def test_a_recorded_flight_has_the_errors_of_the_same_flight_along_the_truth() -> None:
    """Readings are means over 50 ms in one and exact within a step in the other: 1e-3 of a sigma of GNSS."""
    campaign, _, record = flown()
    errors, _ = along_the_truth(campaign, 0)
    compared = [(round(stage.time), stage.read_out.errors) for stage in record.stages if stage.read_out is not None]
    assert len(compared) >= 20
    for second, against in compared:
        np.testing.assert_allclose(against[:3], errors[second - 1, :3], rtol=0.0, atol=1e-3)
        np.testing.assert_allclose(against[3:6], errors[second - 1, 3:6], rtol=0.0, atol=1e-3)
        np.testing.assert_allclose(against[6:], errors[second - 1, 6:], rtol=0.0, atol=2e-5)


def test_innovations_are_those_of_the_same_flight_along_the_truth() -> None:
    campaign, _, record = flown()
    _, records = along_the_truth(campaign, 0)
    sums = [stage.innovation @ np.linalg.solve(stage.covariance, stage.innovation) for stage in record.stages]
    np.testing.assert_allclose(sums, records[: len(sums), -5], rtol=5e-3)


def test_all_errors_of_a_complete_filter_whiten_innovations_as_the_filter_does() -> None:
    """The filter estimates all errors that there are, so that nothing is left to the model of all of them."""
    _, _, record = flown()
    record = with_causes(record, present(record))
    measured = without_corrections(record, recorded(record))
    for stage, ((whitened,), _) in zip(record.stages, whiten(record, measured, [{}]), strict=True):
        own = np.linalg.solve(np.linalg.cholesky(stage.covariance), stage.innovation)
        np.testing.assert_allclose(whitened[:, 0], own, rtol=0.0, atol=1e-5)


def test_readings_within_an_interval_are_the_parabola_with_the_same_means() -> None:
    """Means of a parabola over equal intervals give the parabola back, but for the first and the last interval."""
    ends = 0.1 * np.arange(1.0, 11.0)
    begins = ends - 0.1
    integral = lambda t: t + t**2 - 0.5 * t**3  # noqa: E731
    means = (integral(ends) - integral(begins)) / 0.1
    values = np.repeat(means[:, None], 3, axis=1)
    recording = Recording(ends, values, -values, {})
    readings = gauss_readings(recording, np.append(0.0, ends))
    at = begins[:, None] + 0.1 * NODES
    expected = 1.0 + 2.0 * at - 1.5 * at**2
    np.testing.assert_allclose(readings[1:-1, :, 0], expected[1:-1], rtol=1e-12)
    np.testing.assert_allclose(readings[..., 3:], -readings[..., :3], rtol=0.0, atol=0.0)
    np.testing.assert_allclose(readings[[0, -1], :, 0], means[[0, -1], None] * np.ones(3), rtol=1e-15)


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_recorded_values_are_those_of_the_state_that_they_are_read_as(quantity: str) -> None:
    """A state recorded without errors, at the antenna, has the same values when it is recorded again."""
    indicated = at_rest()
    sensors = [s for s in every_sensor(20.0) if quantity in {c.quantity for c in s.components}]
    sensor = sensors[0]
    nothing, zero = np.zeros(len(sensor.components)), np.zeros(3)
    values = {"position": [0.8, 0.2, 300.0], "velocity": [3.0, -2.0, 0.5], "altitude": [310.0],
              "attitude": [0.1, -0.2, 1.3], "body_velocity": [9.0, 0.1, -0.2], "heading": [0.7]}  # fmt: skip
    given = {name: np.array([values[name]]) for name in dict.fromkeys(c.quantity for c in sensor.components)}
    true = true_state(WGS84, given, 0, indicated)
    again = recorded_values(WGS84, sensor, true, nothing, nothing, sensor.lever_arm + zero)
    for name, each in given.items():
        np.testing.assert_allclose(again[name], each[0], rtol=1e-9, atol=1e-9)


def at_rest() -> Indicated:
    position = WGS84.from_geodetic(np.array(0.8), np.array(0.2), np.array(300.0))
    frame = LocalFrame.at(WGS84, position)
    return Indicated(position, np.zeros(3), frame.axes, frame, np.zeros(6))


def test_what_a_filter_cannot_go_through_is_refused() -> None:
    campaign, recording, _ = flown()
    few = RecordedMeasurements(*(
        recording.measurements["gnss"].times[:3],
        {name: each[:3] for name, each in recording.measurements["gnss"].values.items()},
    ))  # fmt: skip
    with pytest.raises(RecordingError, match="has 3 measurements in the time of the readings"):
        filtered(campaign, Recording(recording.ends, recording.gyro, recording.accelerometer, {"gnss": few}))
    lacking = RecordedMeasurements(
        recording.measurements["gnss"].times, {"position": recording.measurements["gnss"].values["position"]}
    )
    with pytest.raises(RecordingError, match="gnss measures position and velocity, and the record lacks velocity"):
        filtered(campaign, Recording(recording.ends, recording.gyro, recording.accelerometer, {"gnss": lacking}))
    level = short_flight(('type = "ins"', 'type = "ins"\nplatform = "level"'))
    with pytest.raises(ScenarioError, match="only strapdown readings can be recorded"):
        filtered(level, recording)


@pytest.mark.parametrize(
    ("kind", "key"),
    [
        ("accelerometer_bias_instability", "[imu.accelerometer] bias_instability"),
        ("tilt", "[errors] tilt"),
        ("gnss_position_noise", "[[aiding]] gnss: position"),
        ("gnss_velocity_bias", "[[aiding]] gnss: velocity_bias"),
        ("gnss_lever_arm", "[[aiding]] gnss: lever_arm"),
    ],
)
def test_a_number_is_named_by_its_key(kind: str, key: str) -> None:
    assert is_ins(short_flight().scenario)
    scenario = short_flight().scenario
    assert is_ins(scenario)
    assert key_of(kind, scenario.navigation.sensors) == key
