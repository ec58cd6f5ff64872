"""``mcnav identify`` from logs to the page, the table [imu] and navigation errors; mistakes in one line each.

Logs are of a generator of this file's own: sums of normal variates at a tenth of the interval.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

import mcnav
from mcnav.arrays.types import Array
from mcnav.studies.identify import IdentifyPlan, identify_logs
from mcnav.systems.ins.recognition import is_ins
from tests.calibration.static_records import TrueNoise, simulate_record
from tests.commands import invoke

GRAVITY = 9.80665
FINE = 10
INTERVAL = 0.2
N = {"gyro": 4.4e-5, "accelerometer": 1e-3}
"""rad/sqrt(s), m/s/sqrt(s): 0.15 deg/sqrt(h), 0.06 m/s/sqrt(h)."""

SIGMA, TIME = 4e-3, 20.0
"""Gauss-Markov process of the accelerometers: m/s^2, s."""

UNITS = ("--unit", "gyro=rad/s", "--unit", "accelerometer=m/s^2")

CAMPAIGN = """
name = "Ten minutes"
samples = 100
seed = 1
[scenario]
type = "ins"
[scenario.trajectory]
rate = "1 Hz"
start = {{ latitude = "47 deg", longitude = "9 deg", altitude = "3 km", course = "80 deg", speed = "100 m/s" }}
segments = [{{ straight = "10 min" }}]
{imu}
[errors]
position = "5 m"
"""


def means(fine: Array) -> Array:
    """Return means over intervals of values at a tenth of them."""
    return np.asarray(fine.reshape(-1, FINE).mean(axis=1))


def log(
    path: Path, count: int = 12_000, seed: int = 0, bias: float = 0.0, missing: slice | None = None, axes: int = 6
) -> Path:
    """Write a log of a unit at rest: white noise; of the accelerometers a Gauss-Markov process, too."""
    rng, step = np.random.default_rng(seed), INTERVAL / FINE
    white = rng.standard_normal((6, count * FINE)) * (np.repeat([*N.values()], 3) / np.sqrt(step))[:, None]
    kept, driven = 1.0 - step / TIME, SIGMA * rng.standard_normal((3, count * FINE))
    driven[:, 1:] *= np.sqrt(1.0 - kept**2)
    white[3:] += lfilter([1.0], [1.0, -kept], driven, axis=1) + np.array([[0.1], [-0.2], [-GRAVITY]])
    white[:3] += bias
    columns = [1e5 + np.arange(count) * INTERVAL, *map(means, white)]
    table = np.column_stack(columns[: axes + 1])
    if missing is not None:
        table = np.delete(table, missing, axis=0)
    names = ",".join(["time", *(f"{kind}_{axis}" for kind in ("gyro", "accelerometer") for axis in "xyz")][: axes + 1])
    np.savetxt(path, table, delimiter=",", header=names, comments="", fmt="%.9g")
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with a log, a campaign, and what the command writes of them."""
    made = tmp_path_factory.mktemp("identify")
    log(made / "static.csv")
    imu = '[imu]\ngrade = "tactical"\n[imu.gyro]\nrate_random_walk = "0.1 deg/h/sqrt(h)"'
    (made / "choice.toml").write_text(CAMPAIGN.format(imu=imu))
    words = ("identify", "static.csv", *UNITS, "--campaign", "choice.toml", "--full", "--out", "unit")
    done = invoke(*words, cwd=made)
    assert done.returncode == 0, done.stderr
    (made / "printed.txt").write_text(done.stdout)
    return made


def test_what_was_simulated_comes_back(folder: Path) -> None:
    """Twelve values of six axes, each within 3.9 sigmas as its 95 % interval has them: 1e-4 each."""
    result = json.loads((folder / "unit" / "identify.json").read_text())
    true = {
        ("gyro", "angle_random_walk"): N["gyro"], ("accelerometer", "velocity_random_walk"): N["accelerometer"],
        ("accelerometer", "bias_instability", "sigma"): SIGMA,
        ("accelerometer", "bias_instability", "correlation_time"): TIME,
    }  # fmt: skip
    for names, value in true.items():
        entries = result
        for name in names:
            entries = entries[name]
        for axis in "xyz":
            entry = entries[axis]
            side = "to" if value > entry["value"] else "from"
            assert abs(np.log(value / entry["value"])) < 2.0 * abs(np.log(entry[side] / entry["value"]))
    assert result["gyro"]["angle_random_walk"]["x"]["unit"] == "rad/sqrt(s)"


def test_a_screen_has_the_answer(folder: Path) -> None:
    """Estimates, models and the first remarks in 25 lines of 80 columns; what is left out is told."""
    done = invoke("identify", "static.csv", *UNITS, cwd=folder)
    lines = done.stdout.splitlines()
    assert len(lines) <= 25
    assert max(map(len, lines)) <= 120  # remarks are wrapped by the terminal
    assert sum(line.startswith(("angle_random_walk", "velocity_random_walk")) for line in lines) == 2
    assert "--full" in done.stdout


def test_what_the_log_does_not_show_is_bounded(folder: Path) -> None:
    result = json.loads((folder / "unit" / "identify.json").read_text())
    unidentified = [entry for entry in result["gyro"]["rate_random_walk"].values() if entry["value"] is None]
    assert unidentified
    for entry in unidentified:
        assert entry["to"] > 0.0
        assert entry["hours_wanted"] > 12_000 * INTERVAL / 3600.0
    assert "record at least" in (folder / "printed.txt").read_text()


def test_the_table_can_be_pasted(folder: Path) -> None:
    """The pasted table is read as the numbers of identify.json, to its four digits."""
    table = (folder / "unit" / "imu.toml").read_text()
    (folder / "pasted.toml").write_text(CAMPAIGN.format(imu=table))
    campaign = mcnav.read_campaign(folder / "pasted.toml")
    result = json.loads((folder / "unit" / "identify.json").read_text())
    assert is_ins(campaign.scenario)
    noise = campaign.scenario.navigation.imu.accelerometer
    for place, axis in enumerate("xyz"):
        own = result["accelerometer"]
        assert noise.random_walk[place] == pytest.approx(own["velocity_random_walk"][axis]["value"], rel=1e-3)
        assert noise.instability[place] == pytest.approx(own["bias_instability"]["sigma"][axis]["value"], rel=1e-3)


def test_flicker_noise_is_written_as_what_a_campaign_has(folder: Path) -> None:
    """The Allan variance of the pasted table beside N²/τ + (2 ln 2/π) B²: as near as imu.toml says, and B is held."""
    true, table = TrueNoise(4e-5, flicker=2e-5), {"time": np.arange(20_000) * 0.1}
    for place, axis in enumerate("xyz"):
        table[f"gyro_{axis}"] = simulate_record(np.random.default_rng(place), 20_000, 0.1, true)
    np.savetxt(folder / "flicker.csv", np.column_stack(list(table.values())), delimiter=",", header=",".join(table),
               comments="", fmt="%.9g")  # fmt: skip
    done = invoke("identify", "flicker.csv", *UNITS[:2], "--out", "flicker", cwd=folder)
    assert done.returncode == 0, done.stderr
    result = json.loads((folder / "flicker" / "identify.json").read_text())["gyro"]
    text = (folder / "flicker" / "imu.toml").read_text()
    (folder / "with_flicker.toml").write_text(CAMPAIGN.format(imu=text))
    campaign = mcnav.read_campaign(folder / "with_flicker.toml")
    assert is_ins(campaign.scenario)
    noise, times = campaign.scenario.navigation.imu.gyro, np.geomspace(0.1, 500.0, 30)
    assert sum(result["flicker"][axis]["from"] < 2e-5 < result["flicker"][axis]["to"] for axis in "xyz") >= 2
    written = 0
    for place, axis in enumerate("xyz"):
        stands = result["record"][axis]["stand_in"]
        if result["record"][axis]["model"] != "white noise, flicker noise" or stands is None:
            continue
        written += 1
        ratio = times / noise.correlation_time[place]
        markov = 2.0 / ratio * (1.0 - (3.0 - 4.0 * np.exp(-ratio) + np.exp(-2.0 * ratio)) / (2.0 * ratio))
        white = noise.random_walk[place] ** 2 / times
        stood = white + noise.instability[place] ** 2 * markov + noise.rate_random_walk[place] ** 2 * times / 3.0
        exact = white + 2.0 * np.log(2.0) / np.pi * result["flicker"][axis]["value"] ** 2
        error = np.abs(np.sqrt(stood / exact) - 1.0).max()
        assert error == pytest.approx(stands["error"], abs=0.01)  # at other cluster times
        assert error < 0.2
    assert written >= 2


def test_the_errors_of_a_campaign_follow(folder: Path) -> None:
    """With the pasted table in place of its noise, the campaign has the sigma that is said to follow."""
    rows = {
        row["output"]: row for row in json.loads((folder / "unit" / "identify.json").read_text())["campaign"]["rows"]
    }
    own = mcnav.linear_covariance(folder / "choice.toml")
    names = [output.name for output in own.outputs]
    place = names.index("velocity_north")
    row = rows["velocity_north"]
    assert row["own"] == pytest.approx(own.sigma[place], rel=1e-9)
    assert row["low"] < row["sigma"] < row["high"] <= 1.5 * row["sigma"]
    assert row["bounded"] >= row["sigma"]
    assert row["sigma"] != pytest.approx(row["own"], rel=1e-3)


def test_the_interval_of_a_velocity_is_that_of_the_process(folder: Path) -> None:
    """Downward velocity after a minute: N² t + 2 σ² T (t - T (1 - exp(-t/T))), and gravity's gradient, 1 %."""
    imu = '[imu.accelerometer]\nvelocity_random_walk = "0.06 m/s/sqrt(h)"'
    text = CAMPAIGN.format(imu=imu).replace('position = "5 m"', 'velocity = "0 m/s"').replace("10 min", "1 min")
    (folder / "noise.toml").write_text(text)
    plan = IdentifyPlan({}, {"gyro": "rad/s", "accelerometer": "m/s^2"}, campaign=folder / "noise.toml")
    report = identify_logs([folder / "static.csv"], plan)
    assert report.sigmas is not None
    row = next(each for each in report.sigmas.rows if each.output == "velocity_down")
    axis = next(each for each in report.axes if each.name == "accelerometer z")
    estimates = {each.name: each for each in axis.fitted.estimates}
    sigma, time, walk = (estimates[name].value for name in ("instability", "correlation_time", "random_walk"))
    exact = 60.0 * walk**2 + 2.0 * sigma**2 * time * (60.0 - time * -np.expm1(-60.0 / time))
    assert row.sigma**2 == pytest.approx(exact, rel=0.02)
    # a minute of T = 20 s sees σ² and σ² T, which the log knows to about sqrt(2 T / duration) and sqrt(8 T / duration)
    least, most = (2.0 * 1.96 * np.sqrt(factor * TIME / 2_400.0) / 2.0 for factor in (2.0, 8.0))
    assert 0.7 * least < np.log(row.high / row.low) < 1.3 * most


def test_the_page_opens(folder: Path) -> None:
    page = (folder / "unit" / "identify.html").read_text()
    for words in (
        "Allan deviation",
        "Spectral density",
        "To paste into a campaign",
        "Not included",
    ):
        assert words in page
    assert page.count("<svg") >= 12


def test_several_logs_have_noise_in_common_and_a_repeatability(folder: Path) -> None:
    bias = 1e-5
    for number in (1, 2, 3):
        log(folder / f"on_{number}.csv", 3_000, number, bias * (number - 2.0), axes=3)
    done = invoke("identify", *(f"on_{number}.csv" for number in (1, 2, 3)), *UNITS[:2], "--format", "json", cwd=folder)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    entry = result["gyro"]["bias"]["x"]
    # the means are known to N / sqrt(600 s) = 1.8e-6
    assert entry["value"] == pytest.approx(bias, rel=0.5)
    assert entry["from"] < bias < entry["to"]
    assert result["gyro"]["record"]["x"]["agreement"] > 1e-4
    assert any("attitude" in note for note in result["notes"])


def test_what_is_wrong_with_readings_is_noticed(folder: Path) -> None:
    """A gap, an axis that stands still, and one that is rounded."""
    table = np.loadtxt(log(folder / "gap.csv", 5_000, 4, missing=slice(1_500, 1_520)), delimiter=",", skiprows=1)
    table[:, 1] = 5e-5 * np.round(table[:, 1] / 5e-5)
    table[:, 2] = 0.0
    header = (folder / "gap.csv").read_text().partition("\n")[0]
    np.savetxt(folder / "wrong.csv", table[:, :4], delimiter=",", header=header[: header.index(",acc")], comments="",
               fmt="%.9g")  # fmt: skip
    done = invoke("identify", "wrong.csv", *UNITS[:2], "--full", cwd=folder)
    assert done.returncode == 0, done.stderr
    for words in (
        "1 gap; the longest stretch without one is used, from 304 to 999.8 s, 69.9 % of the readings",
        "gyro y is left out: all of its readings are the same",
        "gyro x: resolution 10.3 deg/h: rounding adds 2.98 deg/h to a reading, 2.1 % of the variance of the white",
    ):
        assert words in done.stdout


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("static.csv", "--from", "4000"), "error: static.csv: --from, --to: got 4000 to 2399.8 s"),
        (("static.csv", "--from", "2 apples"), "error: --from: "),
        (("static.csv", "--to", "20 s"), "gyro x: expected at least 1,000 readings of one axis"),
        (("static.csv", "--column", "gyro_x"), "error: --column: got 'gyro_x'; expected NAME=COLUMN"),
        (("static.csv", "faster.csv"), "error: faster.csv: has an interval of 0.1 s between readings, and static.csv"),
        (("static.csv", "--campaign", "missing.toml"), "error: missing.toml: "),
        (("nothing.csv",), "error: nothing.csv: "),
        (("flight.csv",), "error: flight.csv: is not at rest: the angular rate changes by "),
        (("flight.csv", "--from", "0", "--to", "1000"), "error: flight.csv: is not at rest: "),
    ],
)  # fmt: skip
def test_mistakes_are_told_in_one_line(folder: Path, words: tuple[str, ...], told: str) -> None:
    table = np.loadtxt(folder / "static.csv", delimiter=",", skiprows=1, max_rows=1_500)
    table[:, 0] = np.arange(1_500) * 0.1
    header = (folder / "static.csv").read_text().partition("\n")[0]
    np.savetxt(folder / "faster.csv", table, delimiter=",", header=header, comments="", fmt="%.9g")
    moving = np.loadtxt(folder / "static.csv", delimiter=",", skiprows=1)
    late = moving[:, 0] - moving[0, 0] > 800.0
    moving[:, 1] += np.where(late, 0.3 * np.sin(0.02 * moving[:, 0]), 0.0)
    np.savetxt(folder / "flight.csv", moving, delimiter=",", header=header, comments="", fmt="%.9g")
    done = invoke("identify", *words, *UNITS, cwd=folder)
    assert done.returncode == 2
    assert told in done.stderr
    assert len(done.stderr.splitlines()) == 1
