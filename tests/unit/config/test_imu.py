"""The table ``[imu]``: values by axis, grades, conventions, and one line for each mistake."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcnav.entries.context import FileContext
from mcnav.systems.ins.imu.instruments import process_sizes
from mcnav.systems.ins.tables.imu import ImuSizes, read_imu
from mcnav.systems.ins.tables.imu_catalogue import ALLAN_MINIMUM, catalogue

DEG_PER_HOUR = np.radians(1.0) / 3600.0


def read(entries: Any) -> ImuSizes:
    context = FileContext("mine.toml", Path())
    found = read_imu(entries, context)
    assert not context.problems, context.problems
    assert found is not None
    return found


def mistakes(entries: Any) -> list[str]:
    context = FileContext("mine.toml", Path())
    assert read_imu(entries, context) is None
    return [str(problem) for problem in context.problems]


def test_a_value_holds_for_each_axis_or_some() -> None:
    found = read(
        {
            "gyro": {"bias": "2 deg/h", "misalignment": ["1 mrad", "2 mrad", "3 mrad", "4 mrad", "5 mrad", "6 mrad"]},
            "accelerometer": {"scale_factor": {"y": "300 ppm"}, "nonlinearity": "10 ug/g^2"},
        }
    ).sigmas
    assert [found[f"gyro_bias_{axis}"] for axis in "xyz"] == pytest.approx([2.0 * DEG_PER_HOUR] * 3)
    pairs = ("xy", "xz", "yx", "yz", "zx", "zy")
    assert [found[f"gyro_misalignment_{pair}"] for pair in pairs] == pytest.approx([k * 1e-3 for k in range(1, 7)])
    assert [found[f"accelerometer_scale_factor_{axis}"] for axis in "xyz"] == pytest.approx([0.0, 3e-4, 0.0])
    assert found["accelerometer_nonlinearity_z"] == pytest.approx(1e-5 / 9.80665)


def test_processes_in_the_units_of_data_sheets() -> None:
    """A density per root hertz is N itself; an Allan minimum is 0.617 of the sigma of the process."""
    instability = {"allan_minimum": "1 deg/h", "correlation_time": ["1 h", "2 h", "3 h"]}
    found = read(
        {
            "gyro": {"angle_random_walk": "0.06 deg/sqrt(h)", "bias_instability": instability},
            "accelerometer": {"velocity_random_walk": "100 ug/sqrt(Hz)", "rate_random_walk": "1 mg/sqrt(h)"},
        }
    ).processes
    assert found.gyro.random_walk == pytest.approx(np.full(3, np.radians(0.001)))
    assert found.gyro.instability == pytest.approx(np.full(3, DEG_PER_HOUR / ALLAN_MINIMUM))
    assert found.gyro.correlation_time == pytest.approx([3600.0, 7200.0, 10800.0])
    assert found.accelerometer.random_walk == pytest.approx(np.full(3, 1e-4 * 9.80665))
    assert found.accelerometer.rate_random_walk == pytest.approx(np.full(3, 9.80665e-3 / 60.0))


def test_a_rate_random_walk_with_a_correlation_time_is_a_gauss_markov_process() -> None:
    """Its variance follows from dP/dt = -2 P / tau + K^2 in the steady state; far below tau its sigma is K sqrt(t)."""
    found = read(
        {
            "gyro": {"rate_random_walk": {"density": "0.1 deg/h/sqrt(h)", "correlation_time": "1000 s"}},
            "accelerometer": {"rate_random_walk": {"density": {"y": "1 mg/sqrt(h)"}, "correlation_time": "1 h"}},
        }
    ).processes
    density, time = 0.1 * DEG_PER_HOUR / 60.0, 1000.0
    assert found.gyro.instability**2 * 2.0 / time == pytest.approx(np.full(3, density**2))
    assert found.gyro.correlation_time == pytest.approx(np.full(3, time))
    assert not found.gyro.rate_random_walk.any()
    assert found.accelerometer.instability == pytest.approx([0.0, 9.80665e-3 / 60.0 * np.sqrt(1800.0), 0.0])
    assert {name.rpartition("_")[0] for name in process_sizes(found)} == {
        "gyro_bias_instability",
        "accelerometer_bias_instability",
    }
    plain = read({"gyro": {"rate_random_walk": {"density": "0.1 deg/h/sqrt(h)"}}}).processes
    assert plain.gyro.rate_random_walk == pytest.approx(np.full(3, density))


def test_a_filter_believes_in_a_walk_with_a_correlation_time() -> None:
    true = read({"gyro": {"rate_random_walk": "0.2 deg/h/sqrt(h)"}}).processes
    context = FileContext("mine.toml", Path())
    walk = {"density": "0.1 deg/h/sqrt(h)", "correlation_time": "1000 s"}
    believed = read_imu({"gyro": {"rate_random_walk": walk}}, context, "filter.believes.imu", true)
    assert believed is not None
    assert not believed.processes.gyro.rate_random_walk.any()
    assert believed.processes.gyro.instability == pytest.approx(np.full(3, DEG_PER_HOUR / 600.0 * np.sqrt(500.0)))


def test_an_axis_has_one_gauss_markov_process() -> None:
    walk = {"density": "0.1 deg/h/sqrt(h)", "correlation_time": "1000 s"}
    instability = {"sigma": ["0 deg/h", "0 deg/h", "1 deg/h"], "correlation_time": "1 h"}
    (line,) = mistakes({"gyro": {"rate_random_walk": walk, "bias_instability": instability}})
    assert "imu.gyro.rate_random_walk: with a correlation time stands beside bias_instability" in line
    assert mistakes({"gyro": {"rate_random_walk": {"density": "1 deg/h", "correlation_time": "1 h"}}})
    assert mistakes({"gyro": {"rate_random_walk": {"correlation_time": "1 h"}}})


def test_a_misalignment_is_an_angle_or_a_share() -> None:
    """Data sheets state cross-axis sensitivities in percent: the share of an input that another axis reads."""
    found = read(
        {"gyro": {"misalignment": "1 %"}, "accelerometer": {"misalignment": {"xy": "100 ppm", "yz": "2 mrad"}}}
    )
    assert found.sigmas["gyro_misalignment_zx"] == 0.01
    assert found.sigmas["accelerometer_misalignment_xy"] == pytest.approx(1e-4)
    assert found.sigmas["accelerometer_misalignment_yz"] == 2e-3
    (line,) = mistakes({"gyro": {"misalignment": "0.01"}})
    assert 'without a unit; expected an angle such as "40 arcsec" or a share such as "1 %"' in line


def test_quantization_is_a_sigma_or_a_step() -> None:
    """A step is the root of twelve times the sigma of an error that is even within it."""
    found = read(
        {
            "gyro": {"quantization": ["1e-6 rad", "2e-6 rad", "0 rad"]},
            "accelerometer": {"quantization": {"step": {"z": "1 mm/s"}, "interval": "5 ms"}},
        }
    ).processes
    assert found.gyro.quantization == pytest.approx([1e-6, 2e-6, 0.0])
    assert found.gyro.quantization_interval == pytest.approx(np.full(3, 0.01))
    assert found.accelerometer.quantization == pytest.approx([0.0, 0.0, 1e-3 / np.sqrt(12.0)])
    assert found.accelerometer.quantization_interval == pytest.approx(np.full(3, 0.005))
    kinds = {name.rpartition("_")[0] for name in process_sizes(found)}
    assert kinds == {"gyro_quantization", "accelerometer_quantization"}


def test_a_catalogue_entry_has_its_quantization() -> None:
    """Levels of rates that an interval makes steps: 1e-6 rad/s and 5e-5 m/s^2 over 0.01 s."""
    found = read({"grade": "Groves aviation"}).processes
    assert found.gyro.quantization * np.sqrt(12.0) == pytest.approx(np.full(3, 1e-8))
    assert found.accelerometer.quantization * np.sqrt(12.0) == pytest.approx(np.full(3, 5e-7))


def test_a_filter_does_not_believe_in_quantization() -> None:
    """It is refused by name; of a grade, and of the instrument itself, the filter has the other values."""
    true = read({"gyro": {"quantization": {"sigma": "1 urad", "interval": "5 ms"}}}).processes
    context = FileContext("mine.toml", Path())
    assert read_imu({"gyro": {"quantization": "2 urad"}}, context, "filter.believes.imu", true) is None
    (problem,) = context.problems
    assert "filter.believes.imu.gyro.quantization: filters neglect quantization; leave it out" in str(problem)
    graded = read_imu({"grade": "Groves aviation"}, FileContext("mine.toml", Path()), "filter.believes.imu", true)
    assert graded is not None
    assert graded.processes.gyro.quantization == pytest.approx(true.gyro.quantization)
    assert np.all(graded.processes.gyro.random_walk > 0.0)


def test_the_maximum_of_the_allan_deviation() -> None:
    """Of a Gauss-Markov process, from its closed form, to the five digits of the convention."""
    x = np.linspace(1.8, 2.0, 20_001)
    variance = (2.0 * x - 3.0 + 4.0 * np.exp(-x) - np.exp(-2.0 * x)) / x**2
    assert np.sqrt(variance.max()) == pytest.approx(ALLAN_MINIMUM, abs=5e-6)
    assert x[variance.argmax()] == pytest.approx(1.8926, abs=1e-4)


@pytest.mark.parametrize("grade", catalogue())
def test_every_grade_is_read_and_keys_replace_its_values(grade: str) -> None:
    whole = read({"grade": grade})
    assert any(size > 0.0 for size in (*whole.sigmas.values(), *process_sizes(whole.processes).values()))
    own = read({"grade": grade, "gyro": {"bias": "7 deg/h"}})
    assert own.sigmas["gyro_bias_y"] == pytest.approx(7.0 * DEG_PER_HOUR)
    assert {**own.sigmas, **{f"gyro_bias_{axis}": 0.0 for axis in "xyz"}} == {
        **whole.sigmas,
        **{f"gyro_bias_{axis}": 0.0 for axis in "xyz"},
    }


@pytest.mark.parametrize(
    ("entries", "line"),
    [
        ({"grade": "navigaton"}, "imu.grade: got 'navigaton'; did you mean 'navigation'?"),
        ({"grade": 3}, "imu.grade: got 3"),
        ({"gyros": {}}, "imu.gyros: unknown key; did you mean 'gyro'?"),
        ({"gyro": 3}, "imu.gyro: got 3; expected a table"),
        ({"gyro": {"bais": "1 deg/h"}}, "imu.gyro.bais: unknown key; did you mean 'bias'?"),
        ({"gyro": {"nonlinearity": "1 ug"}}, "imu.gyro.nonlinearity: unknown key"),
        ({"gyro": {"quantization": "1 deg/h"}}, "imu.gyro.quantization: got '1 deg/h', which is an"),
        ({"gyro": {"quantization": {"step": "1 urad", "w": "1 s"}}}, "imu.gyro.quantization.w: unknown key"),
        ({"gyro": {"quantization": {"interval": "1 s"}}}, "imu.gyro.quantization: got interval; expected { sigma ="),
        (
            {"gyro": {"quantization": {"sigma": "1 urad", "step": "3 urad"}}},
            "imu.gyro.quantization: got sigma, step; expected { sigma =",
        ),
        (
            {"accelerometer": {"quantization": {"step": "1 mm/s", "interval": "1 us"}}},
            "imu.accelerometer.quantization.interval: got '1 us'; at least 0.001 s makes sense",
        ),
        ({"gyro": {"bias": "1 mg"}}, "imu.gyro.bias: got '1 mg', which is an acceleration; expected an angular rate"),
        ({"gyro": {"bias": 3.0}}, "imu.gyro.bias: got 3.0 without a unit; expected an angular rate"),
        ({"gyro": {"bias": "-1 deg/h"}}, "imu.gyro.bias: got '-1 deg/h'; a size must not be negative"),
        ({"gyro": {"bias": ["1 deg/h", "2 deg/h"]}}, "imu.gyro.bias: got a list of 2; expected 3, for x, y, z"),
        ({"gyro": {"bias": ["1 deg/h", "x", "2 deg/h"]}}, "imu.gyro.bias #2: got 'x'"),
        ({"gyro": {"bias": {"w": "1 deg/h"}}}, "imu.gyro.bias.w: unknown axis; expected x, y, z"),
        ({"gyro": {"angle_random_walk": "0.1 deg/h"}}, "imu.gyro.angle_random_walk: got '0.1 deg/h', which is an"),
        ({"gyro": {"bias_instability": "1 deg/h"}}, "imu.gyro.bias_instability: got '1 deg/h'; expected { sigma ="),
        ({"gyro": {"bias_instability": {"sigma": "1 deg/h"}}}, "imu.gyro.bias_instability: got sigma; expected"),
        (
            {"gyro": {"bias_instability": {"sigma": "1 deg/h", "correlation_time": "-1 h"}}},
            "imu.gyro.bias_instability.correlation_time: got '-1 h'; a size must not be negative",
        ),
        (
            {"gyro": {"bias_instability": {"sigma": "1 deg/h", "correlation_time": "1 ms"}}},
            "imu.gyro.bias_instability.correlation_time: got '1 ms'; expected at least 0.1 s, white noise is shorter",
        ),
    ],
)  # fmt: skip
def test_one_mistake_is_one_line(entries: Any, line: str) -> None:
    (found,) = mistakes(entries)
    assert found.startswith(f"mine.toml: {line}"), found
