"""The navigator of a closed loop against type ``ins``, which shares with it the earth's field and nothing else."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.config.read import parse_campaign
from mcnav.contract.linear import LinearModel, LinearSystem
from mcnav.systems.closed_loop.sizes import LoopSizes
from mcnav.systems.ins.imu.instruments import CONSTANTS, OUTPUTS
from mcnav.systems.ins.reference.axes import ATTITUDE, POSITION, VELOCITY
from mcnav.systems.ins.reference.local_frame import LocalFrame
from tests.strapdown_loops import FILE, LENGTH, flown, tables, true_flight

STATES = ("position", "velocity", "attitude")
PROCESSES = (
    "gyro_angle_random_walk", "gyro_bias_instability", "accelerometer_velocity_random_walk",
    "accelerometer_bias_instability",
)  # fmt: skip
STEPS = (1.0, 0.5)


def to_outputs(time: float) -> Array:
    """Return the map from a loop's errors in earth-fixed axes to the outputs of type ``ins``, shape (9, 9)."""
    truth = true_flight().truth
    position, velocity = truth.earth_fixed(np.array([time]))
    ordered = np.zeros((9, 9))
    for place, number in ((POSITION, 0), (VELOCITY, 1), (ATTITUDE, 2)):
        ordered[place, 3 * number : 3 * number + 3] = np.eye(3)
    return np.asarray(LocalFrame.at(truth.earth, position[0]).to_outputs(velocity[0]) @ ordered)


@lru_cache
def of_ins(aided: bool) -> Any:
    """Return the campaign of type ``ins``."""
    return parse_campaign(flown(aided), str(FILE.with_name("x.toml")), "x")


def end_of(scenario: Any) -> LinearModel:
    system: LinearSystem = scenario.linear()
    return system.at(np.arange(len(system.times)) == len(system.times) - 1).end


@lru_cache
def of_loop(name: str, step: float) -> tuple[Any, Array]:
    """Return the loop with the start covariance of type ``ins``, and the places of the nine errors at its start."""
    described = parse_campaign(tables(name, step), str(FILE.with_name("x.toml")), "x")
    scenario: Any = described.scenario
    names = [source.name for source in scenario.sources]
    axes = ("north", "east", "down") if "Site" in name else ("x", "y", "z")
    places = np.array([names.index(f"{state}_{axis}") for state in STATES for axis in axes])
    start, back = described.errors.covariance.copy(), np.linalg.inv(to_outputs(0.0))
    start[np.ix_(places, places)] = back @ of_ins(False).errors.covariance[:9, :9] @ back.T
    sizes = scenario.sizes
    exact = LoopSizes(replace(sizes.true, start=start), replace(sizes.believed, start=start))
    return scenario.with_sizes(exact), places


def gaps(aided: bool, step: float) -> dict[str, float]:
    """Return the largest difference of the outputs at the end, by cause, as a share of an output's own sigma by it.

    Of constant errors, whose contributions are one sigma times a partial derivative, of a row's largest one.
    """
    expected, sigmas = end_of(of_ins(aided).scenario), of_ins(aided).errors.standard_deviations[: len(CONSTANTS)]
    scenario, places = of_loop("Aided" if aided else "Free", step)
    names, model = [source.name for source in scenario.sources], end_of(scenario)
    map_, back = to_outputs(LENGTH), np.linalg.inv(to_outputs(0.0))
    instruments = [names.index(name) for name in CONSTANTS[len(OUTPUTS) :]]
    partials = map_ @ np.hstack([model.partials[:9, places] @ back, model.partials[:9, instruments]])
    wanted = expected.partials[:, : len(CONSTANTS)] * sigmas
    differences = np.abs(partials * sigmas - wanted).max(axis=1) / np.abs(wanted).max(axis=1)
    result = {"constants": float(differences.max())}
    by_process = {name: [f"{name}_{axis}" for axis in "xyz"] for name in PROCESSES}
    if aided:
        by_process["fix"] = [name for name in expected.processes if name.startswith("position_fix_noise")]
    for name, members in by_process.items():
        covariance = sum((expected.processes[each] for each in members), np.zeros((9, 9)))
        result[name] = _gap(map_ @ model.processes[name][:9, :9] @ map_.T, covariance)
    if aided:
        stated = scenario.filter_prediction().covariance[-1][:9, :9]
        result["own"] = _gap(map_ @ stated @ map_.T, of_ins(True).scenario.filter_prediction().covariance[-1])
    return result


def _gap(covariance: Array, expected: Array) -> float:
    sigma = np.sqrt(np.diag(expected))
    return float(np.abs((covariance - expected) / np.outer(sigma, sigma)).max())


@pytest.mark.parametrize(("aided", "limit"), [(False, 5e-6), (True, 5e-5)])
def test_every_cause_agrees_with_type_ins(aided: bool, limit: float) -> None:
    """Runge-Kutta's fourth order: of half of the step a sixteenth of the gap, here an eighth with what else rounds.

    With steps of a second the gap is at most 4e-5, and 4e-4 where fixes remove most of what a process adds: the flight
    rolls by 5 deg/s into a turn.
    """
    whole, half = (gaps(aided, step) for step in STEPS)
    assert max(whole.values()) < 8.0 * limit
    for cause, gap in half.items():
        assert gap < max(0.125 * whole[cause], 1e-6), cause


@pytest.mark.parametrize("name", ["FreeAtASite", "FreeInInertialAxes"])
def test_axes_do_not_matter(name: str) -> None:
    """The covariance of attitude errors and of positions in other axes is the same, turned."""
    plain, places = of_loop("Free", 1.0)
    other, others = of_loop(name, 1.0)
    turn = true_flight().truth.earth.turned(np.array(LENGTH)) if "Inertial" in name else np.eye(3)
    frame = other._instance.navigator.frame
    turn, start = frame.to_planet.T @ turn, frame.to_planet
    spin = np.array([0.0, 0.0, true_flight().truth.earth.rotation_rate * ("Inertial" in name)])
    whole, first = np.kron(np.eye(3), turn), np.kron(np.eye(3), start)
    rates = np.cross(spin, np.eye(3)).T
    whole[3:6, :3], first_ = turn @ rates, np.eye(9)
    first_[3:6, :3] = -rates
    partials = end_of(plain).partials[:9, places], end_of(other).partials[:9, others]
    expected = whole @ partials[0] @ (first_ @ first)
    scale = np.abs(expected).max(axis=1, keepdims=True)
    np.testing.assert_allclose(partials[1] / scale, expected / scale, atol=5e-6)


def test_truth_is_the_given_flight() -> None:
    """Specific force and angular rate of a flight, integrated, are the flight, up to Runge-Kutta's error."""
    gaps_ = []
    for step in STEPS:
        scenario, _ = of_loop("Free", step)
        x = scenario.plan.instants[scenario.plan.end].nominal
        truth = scenario.maps.structure.truth
        position, velocity = true_flight().truth.earth_fixed(np.array([LENGTH]))
        gaps_.append(
            [np.linalg.norm(x[truth.of("position")] - position), np.linalg.norm(x[truth.of("velocity")] - velocity)]
        )
    assert np.all(np.array(gaps_[0]) < [0.1, 3e-3])
    assert np.all(np.array(gaps_[1]) < 0.1 * np.array(gaps_[0]))


def test_gates_are_those_of_type_ins() -> None:
    """One function serves both: what gates stop, what one rejection leaves, and whether the next one follows.

    Axes differ, so that sums over axes are compared. Each has steps of its own, by which variances differ by 2e-5, and
    what rejections add to them by up to 7e-4.
    """
    imu = {
        "gyro": {"bias": "1 deg/h", "angle_random_walk": "0.1 deg/sqrt(h)"},
        "accelerometer": {"bias": "1 mg", "velocity_random_walk": "0.05 m/s/sqrt(h)"},
    }
    ins, loop = flown(aided=True), tables("OwnAided", 0.5)
    results = []
    for content in (ins, {**loop, "filter": {}}):
        content = {**content, "imu": imu, "filter": {**content["filter"], "gate": 0.99}}
        described = parse_campaign(content, str(FILE.with_name("x.toml")), "x")
        scenario: Any = described.scenario
        (law,) = scenario.gate_laws(described.errors.mean, described.errors.covariance)
        laws = scenario.rejection_laws(
            described.errors.mean, described.errors.covariance, scenario.reading_times[-1:]
        )  # fmt: skip
        assert not laws.doubt
        (reading,) = laws.readings
        positions = [place for place, output in enumerate(scenario.outputs) if output.name.startswith("position_")]
        results.append([
            np.linalg.eigvalsh(law.covariance), np.linalg.eigvalsh(law.root @ law.root.T),
            *(errors.excess[:, positions].sum(axis=1) for errors in (reading.once, reading.never)),
            *((errors.responses[:, positions] ** 2).sum(axis=(1, 2)) for errors in (reading.once, reading.never)),
            laws.correlations,
        ])  # fmt: skip
    assert len(results[0][2]) == 8
    for of_ins, of_loop in zip(*results, strict=True):
        np.testing.assert_allclose(of_loop, of_ins, rtol=5e-3, atol=1e-6)
