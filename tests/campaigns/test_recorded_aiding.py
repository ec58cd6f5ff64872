"""``log`` of ``[[aiding]]``, and trajectories from tracks: samples, sigmas of each measurement, what is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcnav import linear_covariance, run_campaign, samples_of
from mcnav.config.read import Campaign, parse_campaign, read_campaign
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.errors import CampaignError
from mcnav.systems.ins.scenario import Ins

DURATION = 120
SEGMENTS = {
    "rate": "1 Hz",
    "start": {"latitude": "47 deg", "longitude": "9 deg", "altitude": "3 km", "course": "80 deg", "speed": "100 m/s"},
    "segments": [{"straight": "50 s"}, {"turn": "45 deg"}, {"straight": "60 s"}],
}
SENSOR = {"type": "position-fix", "name": "gnss"}
HEADER = "%  GPST latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m) age(s) ratio"
WEEK = 2200 * 604_800
TIMES = np.arange(1, DURATION + 1)


def described(sensor: dict[str, Any], **others: Any) -> dict[str, Any]:
    return {
        "samples": 40,
        "seed": 5,
        "scenario": {"type": "ins", "trajectory": SEGMENTS},
        "imu": {"grade": "tactical"},
        "aiding": [SENSOR | sensor],
        "filter": {"estimates": ["position", "velocity", "attitude", "gyro_bias", "accelerometer_bias"]},
        "errors": {"position": "5 m", "velocity": "0.1 m/s", "tilt": "0.3 mrad", "heading": "2 mrad"},
        **others,
    }


def campaign(folder: Path, sensor: dict[str, Any], **others: Any) -> Campaign:
    return parse_campaign(described(sensor, **others), str(folder / "campaign.toml"), "campaign")


def write_log(folder: Path, sigmas: np.ndarray, times: np.ndarray = TIMES, name: str = "gnss.pos") -> Path:
    """Write positions, which no simulation reads, with sigmas north, east, up."""
    rows = [
        f"2200 {345_600 + time:.3f} 47.0 9.0 3000.0 1 9 {north:.4f} {east:.4f} {up:.4f} 0 0 0 0 9"
        for time, (north, east, up) in zip(times, sigmas, strict=True)
    ]
    path = folder / name
    path.write_text("\n".join([HEADER, *rows, ""]), encoding="utf-8")
    return path


def varying() -> np.ndarray:
    """Sigmas of a receiver that loses its fix for a third of the time."""
    return np.where((TIMES % 30 < 10)[:, None], [10.0, 8.0, 15.0], [1.5, 2.0, 3.0])


def simulate(made: Campaign, engine: str) -> SimulationResult:
    """Simulate three samples, with errors of their campaign's sizes."""
    sizes = np.array(made.errors.standard_deviations)
    errors = np.random.default_rng(3).normal(0.0, 1.0, (3, len(sizes))) * sizes
    return made.scenario.engine(engine, errors).simulate(Batch(np.arange(3), errors, made.seed))


def scenario(made: Campaign) -> Ins:
    assert isinstance(made.scenario, Ins)
    return made.scenario


def test_a_log_with_one_sigma_gives_the_samples_of_an_interval_bit_for_bit(tmp_path: Path) -> None:
    write_log(tmp_path, np.tile([2.0, 2.0, 4.0], (DURATION, 1)))
    brief = {"type": "ins", "trajectory": SEGMENTS, "end": "30 s"}
    sigmas = {"position": {"north": "2 m", "east": "2 m", "down": "4 m"}}
    stated = campaign(tmp_path, {"interval": "1 s", **sigmas}, scenario=brief)
    recorded = campaign(tmp_path, {"log": "gnss.pos", "log_start": "1 s"}, scenario=brief)
    of_log, of_interval = (scenario(each).navigation.sensors[0].times for each in (recorded, stated))
    assert np.array_equal(of_log, of_interval)
    for engine in ("ensemble", "reference"):
        assert np.array_equal(simulate(stated, engine).values, simulate(recorded, engine).values)


def test_sigmas_of_each_measurement_are_those_of_two_sensors_that_share_the_instants(tmp_path: Path) -> None:
    """One sensor of two sigmas is two sensors of one each, whose noise is drawn elsewhere: by linear analysis."""
    write_log(tmp_path, varying())
    recorded = campaign(tmp_path, {"log": "gnss.pos", "log_start": "1 s"})
    end = scenario(recorded).navigation.end
    inside = TIMES[end >= TIMES]
    rough = inside % 30 < 10
    two = [
        SENSOR | {
            "name": name, "instants": [f"{time} s" for time in inside[chosen]],
            "position": dict(zip(("north", "east", "down"), sigmas, strict=True)),
        }
        for name, chosen, sigmas in (
            ("rough", rough, ("10 m", "8 m", "15 m")), ("fine", ~rough, ("1.5 m", "2 m", "3 m")),
        )
    ]  # fmt: skip
    both = campaign(tmp_path, {"log": "gnss.pos"}, aiding=two)
    one, other = (linear_covariance(each).covariance for each in (recorded, both))
    scale = np.sqrt(np.outer(np.diag(one), np.diag(one)))
    assert np.max(np.abs(one - other) / scale) < 1e-9
    mean_square = campaign(tmp_path, {
        "log": "gnss.pos", "log_start": "1 s", "position": {"north": "6 m", "east": "5 m", "down": "9 m"},
    })  # fmt: skip
    assert np.max(np.abs(linear_covariance(mean_square).covariance - one) / scale) > 0.1


@pytest.mark.parametrize("engine", ["ensemble", "reference"])
def test_engines_agree_on_samples_with_sigmas_of_each_measurement(tmp_path: Path, engine: str) -> None:
    """Each sample beside its twin by linear analysis, whose noise and gains it shares."""
    write_log(tmp_path, varying())
    made = campaign(tmp_path, {"log": "gnss.pos", "log_start": "1 s"})
    result = simulate(made, engine)
    assert result.linear_values is not None
    sigma = np.sqrt(np.diag(linear_covariance(made).covariance))
    assert np.max(np.abs(result.values - result.linear_values) / sigma) < 0.02


def test_the_noise_of_each_measurement_has_its_sigma(tmp_path: Path) -> None:
    from mcnav.systems.ins.imu.sample_noise import draw_measurement_errors

    write_log(tmp_path, varying())
    sensors = scenario(campaign(tmp_path, {"log": "gnss.pos", "log_start": "1 s"})).navigation.sensors
    times = sensors[0].times
    drawn = [draw_measurement_errors(sensors, times, 1, index)[0]["gnss"] for index in range(400)]
    normal = np.array(drawn) / varying()[: len(times)]
    # 400 n variates: the mean square departs by 4.5 sigma in one of 150,000
    assert np.mean(normal**2) == pytest.approx(1.0, abs=4.5 * np.sqrt(2.0 / normal.size))
    assert np.allclose(np.std(normal, axis=0), 1.0, atol=5.5 / np.sqrt(800.0))


def test_a_log_that_changes_is_another_run(tmp_path: Path) -> None:
    path = write_log(tmp_path, varying())
    (tmp_path / "campaign.toml").write_text(campaign(tmp_path, {"log": "gnss.pos"}).to_toml(), encoding="utf-8")
    text = (tmp_path / "campaign.toml").read_text(encoding="utf-8")
    assert 'log = "inputs/gnss.pos"' in text
    (tmp_path / "campaign.toml").write_text(text.replace("inputs/", ""), encoding="utf-8")
    run_campaign(tmp_path / "campaign.toml", tmp_path / "one", None, 1, report=False)
    assert (tmp_path / "one" / "inputs" / "gnss.pos").read_bytes() == path.read_bytes()
    again = read_campaign(tmp_path / "one" / "campaign.toml", execute=False)
    first, second = (
        scenario(each).navigation.sensors[0] for each in (read_campaign(tmp_path / "campaign.toml"), again)
    )
    assert np.array_equal(first.times, second.times)
    assert first.components == second.components
    write_log(tmp_path, 2.0 * varying())
    with pytest.raises(Exception, match="holds the results of another run"):
        run_campaign(tmp_path / "campaign.toml", tmp_path / "one", None, 1, report=False)
    assert len(samples_of(tmp_path / "one")) == 40


def test_gaps_of_a_log_are_outages_and_its_first_stamp_is_told(tmp_path: Path) -> None:
    kept = (TIMES <= 40) | (TIMES > 70)
    write_log(tmp_path, varying()[kept], TIMES[kept])
    made = scenario(campaign(tmp_path, {"log": "gnss.pos", "outages": [["5 s", "8 s"]]}))
    (sensor,) = made.navigation.sensors
    assert sensor.outages == ((5.0, 8.0), (40.0, 70.0))
    assert not np.any((sensor.times >= 5.0) & (sensor.times < 8.0))
    assert sensor.times[0] == 1.0
    first, *others = made.remarks
    assert first == (
        "gnss.pos: its first time stamp, 1330905601 s, is taken for the beginning of the trajectory at 0 s; log_start "
        "states another"
    )
    assert "gnss.pos: a gap of 31 s after 39 s; 30 rows missing" in others


@pytest.mark.parametrize(
    ("sensor", "told"),
    [
        ({"log": "none.pos"}, "aiding #1.log: {folder}/none.pos does not exist"),
        ({"log": "../gnss.pos"}, "must lie beside the campaign file"),
        (
            {"log": "gnss.pos", "interval": "1 s"},
            'expected one of interval = "1 s", instants = ["600 s", "1200 s"], log = "gnss.pos"',
        ),
        ({"log": "gnss.pos", "begin": "1 s"}, "aiding #1.begin: limits an interval; leave it out with log"),
        ({"interval": "1 s", "position": "1 m", "log_start": "1 s"}, "belongs to a log"),
        ({"log": "gnss.pos", "log_start": "1 d"}, "has no measurement from 0 s to"),
        (
            {"log": "zero.pos"},
            'has a sigma of zero 1 s after its first time, one of 119; state a sigma instead: position = "…"',
        ),
        ({"log": "gnss.csv"}, "gnss.csv has no sigmas; expected the sigma of position"),
        ({"log": "empty.pos"}, "empty.pos: is empty"),
        ({"log": "gnss.pos", "columns": {"time": "x"}}, "columns.time: has no column 'x'"),
    ],
)
def test_bad_logs_are_one_line(tmp_path: Path, sensor: dict[str, Any], told: str) -> None:
    write_log(tmp_path, varying())
    write_log(tmp_path, 0.0 * varying(), name="zero.pos")
    (tmp_path / "empty.pos").touch()
    rows = np.column_stack([TIMES, np.tile([47.0, 9.0, 3000.0], (DURATION, 1))])
    np.savetxt(tmp_path / "gnss.csv", rows, "%.9g", ",", header="time,lat,lon,alt", comments="")
    with pytest.raises(CampaignError) as refusal:
        campaign(tmp_path, sensor)
    assert told.format(folder=tmp_path) in str(refusal.value)
    assert len(str(refusal.value).splitlines()) == 1


def test_sensors_without_positions_take_the_instants_alone(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "compass.txt", np.column_stack([1e3 * TIMES, 0.0 * TIMES]), "%.0f", " ")
    heading = {"type": "heading", "name": "compass", "log": "compass.txt", "units": {"time": "ms"}, "heading": "1 deg"}
    made = scenario(campaign(tmp_path, {"interval": "1 s"}, aiding=[heading]))
    assert np.array_equal(made.navigation.sensors[0].times, TIMES[: len(made.navigation.sensors[0].times)])


def flown(folder: Path) -> Ins:
    """The flight of segments, and a track of it with a scatter of 2 cm at 5 Hz."""
    from mcnav.systems.ins.truth.rows import rows_from

    made = scenario(campaign(folder, {"interval": "1 s", "position": "2 m"}))
    truth = made.navigation.truth
    times = np.arange(0.0, truth.times[-1], 0.2)
    rows = rows_from(truth, times)
    scatter = np.random.default_rng(1).normal(0.0, 0.02, (len(times), 3))
    latitude = np.degrees(rows.latitude) + scatter[:, 0] / 111_000.0
    longitude = np.degrees(rows.longitude) + scatter[:, 1] / 76_000.0
    height = rows.altitude + scatter[:, 2]
    lines = [
        f"2200 {345600 + time:.3f} {latitude[row]:.9f} {longitude[row]:.9f} {height[row]:.4f} 1 9 .02 .02 .02 0 0 0 0 0"
        for row, time in enumerate(times)
    ]
    (folder / "flight.pos").write_text("\n".join([HEADER, *lines, ""]), encoding="utf-8")
    return made


def test_a_track_without_attitude_flies_as_its_source(tmp_path: Path) -> None:
    made = flown(tmp_path)
    track = {"file": "flight.pos", "attitude": "coordinated-turn"}
    again = scenario(campaign(tmp_path, {"log": "flight.pos"}, scenario={"type": "ins", "trajectory": track}))
    times = np.arange(2.0, made.navigation.truth.times[-1] - 2.0)
    states, others = (each.navigation.truth.states(times, "strapdown", 0.0) for each in (made, again))
    assert np.max(np.abs(states.force - others.force)) < 0.1
    angles, taken = (each.navigation.truth.angles(times) for each in (made, again))
    assert np.max(np.abs(angles - taken)) < np.radians(1.0)
    told = " ".join(again.remarks)
    assert "the attitude is not recorded; it is taken along the velocity, banked as in coordinated turns" in told
    assert "the trajectory keeps within 0.0" in told
    # stamps of the log are those of the trajectory
    assert again.navigation.sensors[0].times[:2].tolist() == [0.2, 0.4]
    level = {"file": "flight.pos", "attitude": "from-velocity"}
    level_one = scenario(campaign(tmp_path, {"log": "flight.pos"}, scenario={"type": "ins", "trajectory": level}))
    assert np.max(np.abs(level_one.navigation.truth.angles(times)[:, 2])) < 1e-6


def test_a_track_needs_an_attitude_and_motion(tmp_path: Path) -> None:
    flown(tmp_path)
    with pytest.raises(CampaignError, match=r'no attitude; trajectory = .* attitude = "from-velocity"'):
        campaign(tmp_path, {"log": "flight.pos"}, scenario={"type": "ins", "trajectory": "flight.pos"})
    write_log(tmp_path, varying())
    still = {"file": "gnss.pos", "attitude": "from-velocity"}
    with pytest.raises(CampaignError, match="moves in 0 rows at more than 1 m/s, which give no attitude"):
        campaign(tmp_path, {"log": "gnss.pos"}, scenario={"type": "ins", "trajectory": still})


def test_an_attitude_that_does_not_belong_to_the_motion_is_noticed(tmp_path: Path) -> None:
    from mcnav.systems.ins.truth.rows import rows_from

    truth = flown(tmp_path).navigation.truth
    times = np.arange(0.0, truth.times[-1])
    rows = rows_from(truth, times)
    place = [times, np.degrees(rows.latitude), np.degrees(rows.longitude), rows.altitude]
    for name, heading in (("north.csv", 0.0 * times), ("along.csv", np.degrees(rows.angles[:, 0]))):
        table = np.column_stack([*place, 0.0 * times, 0.0 * times, heading])
        np.savetxt(tmp_path / name, table, "%.12g", ",", header="time,lat,lon,alt,roll,pitch,heading", comments="")
    sensor = {"interval": "1 s", "position": "2 m"}
    wrong, right = (
        scenario(campaign(tmp_path, sensor, scenario={"type": "ins", "trajectory": name})).remarks
        for name in ("north.csv", "along.csv")
    )
    assert right == ()
    assert wrong[0].startswith("the heading stays the same and departs from the course over ground by 10")
