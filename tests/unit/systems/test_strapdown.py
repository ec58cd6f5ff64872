"""The strapdown navigator of closed loops: its instruments, its equations, its tables, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

from mcnav import Strapdown
from mcnav.arrays.types import Array
from mcnav.config.read import read_campaign
from mcnav.contract.samples import Batch
from mcnav.contract.scenario import ScenarioError
from mcnav.errors import CampaignError
from mcnav.systems.closed_loop.quantities import Values
from mcnav.systems.closed_loop.strapdown.navigator import ERRORS, MOON, PROCESSES
from mcnav.systems.ins.imu.instruments import ACCELEROMETER, GYRO

LOOP = """\
import numpy as np
from mcnav import ClosedLoop, Filter, Measurement, Strapdown


class Hopper(ClosedLoop):
    navigator = Strapdown("moon", (0.4, 0.1), estimates=("gyro_bias", "accelerometer_bias"))
    measurements = (Measurement("fix", "m", interval=5.0, truth=lambda truth: truth.position),)
    filter = Filter(gains="nominal")
    step, end = 2.5, 10.0

    def start(self):
        return {"position": [0.0, 0.0, -500.0], "attitude": np.eye(3)}

    def motion(self, truth):
        return {"force": np.array([0.0, 0.0, -1.6]), "rate": np.array([0.0, 0.01, 0.0])}
"""
TABLES: dict[str, Any] = {
    "samples": 8,
    "seed": 1,
    "scenario": {"type": "hopper.py:Hopper"},
    "imu": {"grade": "navigation"},
    "errors": {"position": "10 m", "velocity": "1 m/s", "attitude": "1 mrad"},
    "measurements": {"fix": "5 m"},
}


def read(folder: Path, changes: str = "", **tables: Any) -> Any:
    (folder / "hopper.py").write_text(LOOP + changes, encoding="utf-8")
    path = folder / "hopper.toml"
    path.write_text(tomli_w.dumps({**TABLES, **tables}), encoding="utf-8")
    return read_campaign(path)


def samples(random: np.random.Generator, count: int, scale: float) -> tuple[Values, Array]:
    """Draw constant errors of the instruments: as methods see them, and in their order, shape (count, 30)."""
    drawn = scale * random.standard_normal((count, len(GYRO) + len(ACCELEROMETER)))
    names, place, values = [*GYRO, *ACCELEROMETER], 0, {}
    for kind, (_, axes) in ERRORS.items():
        assert names[place : place + len(axes)] == [f"{kind}_{axis}" for axis in axes]
        values[kind] = drawn[:, place : place + len(axes)]
        place += len(axes)
    return Values.given("parameters", values), drawn


def test_instruments_read_each_sample_with_its_own_errors() -> None:
    """The equations of the instruments, written out for one sample after the other."""
    random = np.random.default_rng(3)
    parameters, drawn = samples(random, 7, 1e-2)
    force, rate = random.standard_normal((2, 7, 3))
    noise = {name: random.standard_normal((7, 3)) for name in PROCESSES}
    sensed = Strapdown().sense(force, rate, parameters, Values.given("noise", noise))
    for n in range(7):
        for name, own, law, errors in (
            ("rate", rate[n], force[n], drawn[n, :15]), ("force", force[n], force[n] ** 2, drawn[n, 15:]),
        ):  # fmt: skip
            (sx, sy, sz), (xy, xz, yx, yz, zx, zy) = errors[3:6], errors[6:12]
            matrix = np.array([[1 + sx, xy, xz], [yx, 1 + sy, yz], [zx, zy, 1 + sz]])
            instrument = "gyro" if name == "rate" else "accelerometer"
            added = sum(each[n] for process, each in noise.items() if process.startswith(instrument))
            np.testing.assert_allclose(
                sensed[name][n], matrix @ own + errors[:3] + errors[12:] * law + added, rtol=1e-12
            )


def test_what_is_estimated_rightly_is_compensated() -> None:
    """With true estimates of every error but the accelerometers' nonlinearity, readings become the truth again."""
    random = np.random.default_rng(4)
    parameters, _ = samples(random, 5, 1e-2)
    errors = {name: getattr(parameters, name) for name in ERRORS}
    errors["accelerometer_nonlinearity"] = np.zeros((5, 3))
    noise = {name: random.standard_normal((5, 3)) if "instability" in name else np.zeros(3) for name in PROCESSES}
    force, rate = random.standard_normal((2, 5, 3))
    instability = {name: each for name, each in noise.items() if "instability" in name}
    navigator = Strapdown("moon", estimates=(*ERRORS, *instability))
    sensed = navigator.sense(force, rate, Values.given("parameters", errors), Values.given("noise", noise))
    state = {"position": 2e6 * np.eye(3)[[0, 1, 2, 0, 1]], "velocity": random.standard_normal((5, 3)),
             "attitude": np.broadcast_to(np.eye(3), (5, 3, 3))}  # fmt: skip
    moved = navigator.navigate(
        Values.given("estimate", {**state, **errors, **instability}), Values.given("sensed", sensed)
    )
    true = navigator.rates(Values.given("truth", state), force, rate)
    for name, expected in true.items():
        np.testing.assert_allclose(moved[name], expected, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("site", [None, (0.4, 1.1), (-1.2, 2.0, 300.0)])
def test_what_rests_stays_at_rest(site: tuple[float, ...] | None) -> None:
    """A body at rest on the turning moon feels minus its gravity, and turns with it."""
    navigator = Strapdown("moon", site)
    height = 0.0 if site is None else 50.0
    position = np.array([[1.7e6, 2e5, -1e5]]) if site is None else np.array([[0.0, 0.0, -height]])
    away = navigator.frame.origin + position
    pull = -MOON.gravitational_parameter * away / np.linalg.norm(away) ** 3
    spin = MOON.rotation_rate * navigator.frame.to_planet[2]
    state = {"position": position, "velocity": np.zeros((1, 3)), "attitude": np.eye(3)[None]}
    moved = navigator.rates(Values.given("truth", state), np.cross(spin, np.cross(spin, away)) - pull, spin[None])
    for change in moved.values():
        np.testing.assert_allclose(change, 0.0, atol=1e-14)
    above = float(navigator.altitude(position)[0])
    assert above == pytest.approx(np.linalg.norm(away) - MOON.radius, abs=1e-6)
    if site is not None:
        assert above == pytest.approx(height + (*site, 0.0)[2], abs=1e-6)


def test_imu_sizes_errors_and_noise(tmp_path: Path) -> None:
    described = read(tmp_path, imu={"grade": "navigation", "gyro": {"bias": "0.1 deg/h"}})
    sigmas = dict(zip(described.errors.names, described.errors.standard_deviations, strict=True))
    assert sigmas["gyro_bias_y"] == pytest.approx(np.radians(0.1) / 3600.0)
    assert sigmas["accelerometer_scale_factor_x"] == pytest.approx(1e-4)
    names = [process.name for process in described.scenario.processes]
    assert any(name.startswith("gyro_angle_random_walk") for name in names)
    assert any(name.startswith("accelerometer_bias_instability") for name in names)


def test_beliefs_of_the_imu(tmp_path: Path) -> None:
    """The filter believes in other sizes of the instruments where they are stated."""
    believes = {"imu": {"gyro": {"bias": "1 deg/h", "angle_random_walk": "1 deg/sqrt(h)"}}}
    plain, other = (read(tmp_path, filter={"believes": each}).scenario.sizes for each in ({}, believes))
    assert np.array_equal(plain.true.start, other.true.start)
    assert np.array_equal(plain.true.white, other.true.white)
    ratio = np.sqrt(
        np.diag(other.believed.start) / np.where(np.diag(plain.true.start) > 0.0, np.diag(plain.true.start), 1)
    )
    assert sorted(set(ratio.round(6))) == [0.0, 1.0, 125.0]
    assert np.array_equal(np.sort(other.believed.white / plain.true.white).round(6), [1.0] * 3 + [500.0] * 3)


@pytest.mark.parametrize(
    ("changes", "tables", "told"),
    [
        ("    navigator = 3\n", {}, "navigator must be a Strapdown of mcnav; got 3"),
        ("    motion = None\n", {}, "needs a method motion"),
        ("    def motion(self, estimate):\n        return {}\n", {}, "Hopper.motion asks for estimate"),
        ("    def motion(self):\n        return {'force': 0.0}\n", {}, "must return a mapping of force and rate"),
        ("    def motion(self):\n        return {'force': np.zeros(2), 'rate': np.zeros(3)}\n", {}, "force of motion"),
        ("    def sense(self):\n        return 0.0\n", {}, "Hopper.sense is the navigator's; leave it out"),
        ("    truth = {'velocity': ('m/s', 3)}\n", {}, "'velocity' is brought by the navigator"),
        ("    navigator = Strapdown('mars')\n", {}, "planet 'mars'"),
        ("    navigator = Strapdown(estimates=('gyro_bais',))\n", {}, "did you mean 'gyro_bias'"),
        ("    navigator = Strapdown(estimates='gyro_bias')\n", {}, "estimates are several names"),
        ("    navigator = Strapdown(axes='free')\n", {}, "axes are 'fixed' or 'inertial'; got 'free'"),
        ("    navigator = Strapdown(site=(1.0,))\n", {}, "site is latitude and longitude in rad"),
        ("", {"imu": {"gyro": {"bias": "1 deg"}}}, "imu.gyro.bias"),
        ("", {"imu": {}}, "the navigator estimates gyro_bias, which needs a size along x, y, z"),
        ("", {"imu": {"grade": "navigation", "gyro": {"rate_random_walk": "1 deg/h/sqrt(h)"}}},
         "imu.gyro.rate_random_walk: is not modelled in a closed loop"),
        ("", {"imu": {"grade": "navigation", "gyro": {"quantization": "1e-6 rad"}}},
         "imu.gyro.quantization: is not modelled in a closed loop"),
        ("", {"processes": {"gyro_angle_random_walk": "1 rad/sqrt(s)"}}, "is sized by [imu]; leave it out here"),
        ("", {"errors": {"gyro_bias_x": "1 deg/h"}}, "errors.gyro_bias_x: is given in [imu] as well"),
        ("", {"filter": {"believes": {"imu": {"gyro": {"quantization": "1e-6 rad"}}}}}, "filters neglect quantization"),
    ],
)  # fmt: skip
def test_mistakes_get_one_line(tmp_path: Path, changes: str, tables: dict[str, Any], told: str) -> None:
    with pytest.raises((CampaignError, ScenarioError)) as refused:
        read(tmp_path, "\n" + changes, **tables).scenario.linear()
    assert told in str(refused.value)


def test_an_imu_needs_a_navigator(tmp_path: Path) -> None:
    plain = """

class Plain(ClosedLoop):
    truth = {"x": "m"}
    step, end = 1.0, 2.0

    def rates(self):
        return {}
"""
    told = "Plain has no inertial measurement unit; give it navigator = Strapdown"
    tables: dict[str, Any] = {"scenario": {"type": "hopper.py:Plain"}, "errors": {"x": "1 m"}}
    with pytest.raises(CampaignError, match=told):
        read(tmp_path, plain, **tables, measurements={})


def test_errors_are_shown_in_their_usual_units(tmp_path: Path) -> None:
    scenario = read(tmp_path).scenario
    shown = {each.name: each.shown_in for each in (*scenario.sources, *scenario.outputs)}
    assert shown["gyro_bias_x"] == "deg/h"
    assert shown["accelerometer_misalignment_xy"] == "arcsec"
    assert shown["position_north"] == "m"


def test_sources_without_a_size_have_derivatives(tmp_path: Path) -> None:
    """Nothing disperses the true velocity here, and an error of it at the start would."""
    scenario = read(tmp_path).scenario
    outputs, sources = ([each.name for each in listed] for listed in (scenario.outputs, scenario.sources))
    partials, start = scenario.linear().end.partials, scenario.sizes.true.start
    row, column = outputs.index("true_position_north"), sources.index("true_velocity_north")
    assert start[column, column] == 0.0
    gradient = MOON.gravitational_parameter / (MOON.radius + 500.0) ** 3
    assert partials[row, column] == pytest.approx(10.0 - gradient * 10.0**3 / 6.0, rel=1e-6)
    assert not partials[row, sources.index("position_north")]


def test_motion_and_rates_may_name_the_phase(tmp_path: Path) -> None:
    """Ten seconds, of which the first five without thrust: the mass of the class is spent in the others alone."""
    changes = """
    from mcnav import Phase
    phases = (Phase("fall"), Phase("burn", begins=5.0))
    truth = {"mass": "kg"}

    def motion(self, phase):
        return {"force": np.array([0.0, 0.0, -3.0 if phase == "burn" else 0.0]), "rate": np.zeros(3)}

    def rates(self, truth, phase):
        return {"mass": 0.0 * truth.mass - (2.0 if phase == "burn" else 0.0)}
"""
    scenario = read(tmp_path, changes).scenario
    x, truth = scenario.plan.instants[scenario.plan.end].nominal, scenario.maps.structure.truth
    assert x[truth.of("mass")] == pytest.approx(-10.0, rel=1e-9)
    velocity = x[truth.of("velocity")]
    fallen = 10.0 * MOON.gravitational_parameter / MOON.radius**2
    assert velocity[2] == pytest.approx(fallen - 5.0 * 3.0, abs=2e-2)
    assert abs(scenario.linear().end.nominal).max() == 0.0


def test_own_gains_have_the_same_bits_alone(tmp_path: Path) -> None:
    """A sample among others and alone: gains by differences would magnify a product that depends on their number."""
    changes = """
    filter = Filter()

    def guide(self, estimate):
        push = -0.2 * estimate.velocity - self.navigator.fall(estimate.position, estimate.velocity)
        return self.navigator.to_body(estimate.attitude, push)

    def motion(self, command):
        return {"force": command, "rate": np.array([0.0, 0.01, 0.0])}
"""
    described = read(tmp_path, changes)
    engine = described.scenario.engine("vectorised", np.zeros((1, len(described.errors.names))))
    errors = described.errors.standard_deviations * np.random.default_rng(5).standard_normal(
        (3, len(described.errors.names))
    )
    batch = Batch(np.arange(3), errors, 7)
    together, alone = engine.simulate(batch).values, engine.simulate(batch[1:2]).values
    assert np.array_equal(together[1], alone[0])
    assert np.ptp(together, axis=0).max() > 0.0
