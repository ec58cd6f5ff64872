"""Aided navigation: many samples with filters of their own against the closed-loop linear covariance."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from math import prod
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from mcnav.arrays.types import Array
from mcnav.compiled.vectors import room
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.systems.ins import aided
from mcnav.systems.ins.aided import WORDS, AidedEngine, AidedReferenceEngine
from mcnav.systems.ins.ensemble import aided as aided_ensemble
from mcnav.systems.ins.ensemble.aided import simulate_aided
from mcnav.systems.ins.ensemble.filters import BEYOND, INDEFINITE
from mcnav.systems.ins.imu.instruments import Imu, Noise
from mcnav.systems.ins.scenario import Ins, Navigation
from mcnav.systems.ins.sensors.aiding import Sensor
from tests.aided import make_filter, make_sensor, sized
from tests.flights import flight

DEG_PER_HOUR = np.radians(1.0) / 3600.0
START, END = 300.0, 660.0
FALSE_ALARM = 1e-4
"""Of each test here."""

SIGMAS = {
    "position": 10.0, "velocity": 0.1, "tilt": 1e-4, "heading": 3e-4, "gyro_bias": 0.05 * DEG_PER_HOUR,
    "accelerometer_bias": 5e-4,
}  # fmt: skip
NEGLECTED = {"gyro_scale": 3e-4, "accelerometer_scale": 1e-3, "accelerometer_mis": 1e-3}
WALK = Imu(Noise(np.full(3, 6e-7)), Noise(np.full(3, 2e-4)))
KINDS = ("gyro_bias", "accelerometer_bias")


def gnss(gate: float | None = None) -> Sensor:
    """Measure position and velocity each second, with an outage of a minute."""
    times = np.arange(START + 1.0, END + 1.0)
    outage = (480.0, 540.0)
    times = times[(times < outage[0]) | (times >= outage[1])]
    made = make_sensor("gnss", times, {"position": 3.0, "velocity": 0.1}, lever_arm=(2.0, 0.0, -1.0), gate=gate)
    return replace(made, outages=(outage,))


@lru_cache
def scenario(sensors: tuple[str, ...] = ("gnss",), gate: float | None = None) -> Ins:
    """Fly with a filter that models all errors but those neglected."""
    made = {
        "gnss": gnss(gate),
        "altimeter": make_sensor("altimeter", np.arange(START + 5.0, END, 5.0), {"altitude": 5.0}, 10.0, 100.0),
        "stars": make_sensor("stars", np.arange(START + 20.0, END, 20.0), {"attitude": 2e-5}),
        "doppler": make_sensor("doppler", np.arange(START + 2.0, END, 7.0), {"body_velocity": 0.2}),
        "compass": make_sensor("compass", np.arange(START + 3.0, END, 10.0), {"heading": 0.02}),
    }
    chosen = tuple(made[name] for name in sensors)
    kinds = (*KINDS, *(("altimeter_bias",) if "altimeter" in sensors else ()))
    model = make_filter(chosen, WALK, SIGMAS, kinds)
    return Ins(Navigation(flight(1.0), "strapdown", START, END, WALK, chosen, model))


@lru_cache
def engine(name: str = "ensemble", sensors: tuple[str, ...] = ("gnss",), gate: float | None = None) -> AidedEngine:
    of = scenario(sensors, gate)
    made = of.engine(name, draw(8, SIGMAS, 1, of))
    assert isinstance(made, AidedEngine)
    return made


def draw(count: int, sizes: dict[str, float], seed: int, of: Ins | None = None) -> Array:
    sigmas = sized((of or scenario()).navigation.sensors, sizes)
    return np.random.default_rng(seed).standard_normal((count, len(sigmas))) * sigmas


def simulate(count: int, sizes: dict[str, float], seed: int, by: AidedEngine | None = None) -> SimulationResult:
    by = by or engine()
    errors = draw(count, sizes, seed)
    return by.simulate(Batch(np.arange(count), errors, seed))


def column(result: SimulationResult, name: str, place: int = 0) -> Array:
    assert result.filter_values is not None
    return np.asarray(result.filter_values[..., engine().filter.places[name]][..., place])


def test_a_matched_filter_is_consistent_over_a_hundred_seeds() -> None:
    """Mean NEES of 8 samples and their NIS, at 1 %: of 100 seeds no more leave their bounds than chance explains."""
    sizes = engine().filter.groups
    outside = dict.fromkeys([*sizes, "nis"], 0)
    for seed in range(100):
        result = simulate(8, SIGMAS, seed)
        for place, (group, size) in enumerate(sizes.items()):
            low, high = stats.chi2.ppf([0.005, 0.995], 8 * size) / 8
            outside[group] += not low < column(result, "nees", place)[:, -1].mean() < high
        updates = column(result, "sensor:gnss", 1).sum()
        low, high = stats.chi2.ppf([0.005, 0.995], 6 * updates)
        outside["nis"] += not low < column(result, "sensor:gnss", 0).sum() < high
    most = stats.binom.isf(FALSE_ALARM / len(outside), 100, 0.01)
    assert max(outside.values()) <= most, outside


def test_every_sensor_keeps_a_matched_filter_consistent() -> None:
    """Star tracker, Doppler, compass and an altimeter with a correlated error beside a GNSS receiver."""
    names = ("gnss", "altimeter", "stars", "doppler", "compass")
    by = engine("ensemble", names)
    of, count = scenario(names), 64
    errors = draw(count, SIGMAS, 5, of)
    result = by.simulate(Batch(np.arange(count), errors, 5))
    assert not result.failures
    assert result.filter_values is not None
    places, groups = by.filter.places, by.filter.groups
    nees = result.filter_values[:, -1, places["nees"]].mean(axis=0)
    for value, size in zip(nees, groups.values(), strict=True):
        low, high = stats.chi2.ppf([FALSE_ALARM / 2, 1.0 - FALSE_ALARM / 2], count * size) / count
        assert low < value < high
    for name in names:
        nis, accepted, rejected, lag, lags = result.filter_values[:, :, places[f"sensor:{name}"]].sum(axis=(0, 1))
        size = by.filter.sensors[name]
        low, high = stats.chi2.ppf([FALSE_ALARM / 2, 1.0 - FALSE_ALARM / 2], accepted * size)
        assert low < nis < high
        assert rejected == 0
        # products of independent unit normals, their means over components: variance 1 / size each
        assert abs(lag) < stats.norm.isf(FALSE_ALARM / 2) * np.sqrt(lags / size)


def test_states_have_the_numbers_of_the_processes_that_they_model() -> None:
    """Of a bias of the instruments, or of a sensor's component with a correlated error; -1 for none, as documented."""
    tables = engine("ensemble", ("gnss", "altimeter")).tables
    sensors, linked = tables.loop.sensors, tables.loop.filter.processes
    names = [component.error_name("correlated") for sensor in sensors for component in sensor.components]
    drifts = [next((names.index(name) for name in each if name in names), -1) for each in linked]
    np.testing.assert_array_equal(tables.drifts, drifts)
    assert len(tables.ensemble.sizes) == np.count_nonzero(tables.biases >= 0)
    assert max(drifts) >= 0 > min(drifts)
    assert min(tables.biases) == -1


def test_samples_follow_the_true_linear_covariance_of_a_mismatched_filter_not_the_filters_own() -> None:
    count = 200
    result = simulate(count, SIGMAS | NEGLECTED, 3)
    linear = scenario().linear_over_time(61)
    sizes = sized(scenario().navigation.sensors, SIGMAS | NEGLECTED)
    noise = sum(np.diagonal(each, axis1=1, axis2=2) for each in linear.processes.values())
    variance = np.einsum("mis,s->mi", linear.partials**2, sizes**2) + noise
    assert result.history is not None
    square = (result.history**2).mean(axis=0) / variance
    each = FALSE_ALARM / square.size
    low, high = stats.chi2.ppf([each / 2, 1.0 - each / 2], count) / count
    assert np.all((square > low) & (square < high))
    own = scenario().filter_prediction()
    assert own is not None
    believed = (result.history**2).mean(axis=0) / np.diagonal(own.covariance, axis1=1, axis2=2)
    assert np.any(believed > high)
    outages_end = int(np.argmin(np.abs(scenario().navigation.times - 539.0)))
    assert variance[outages_end, 2] > 3.0**2 * own.covariance[outages_end, 2, 2]


def test_each_cause_alone_makes_the_errors_of_its_partial_derivatives() -> None:
    """Without noise; what is not linear is the product of two errors, here less than 1 % of the filter's sigma."""
    made, linear, own = engine(), scenario().linear_over_time(61), scenario().filter_prediction()
    assert own is not None
    sigma = np.sqrt(np.diagonal(own.covariance, axis1=1, axis2=2))
    for kind in ("gyro_bias", "gyro_scale", "accelerometer_scale", "tilt"):
        errors = draw(16, {kind: (SIGMAS | NEGLECTED)[kind]}, 7)
        values, _ = made.navigation.propagate(made.tables, errors, True)
        predicted = np.einsum("mis,ns->nmi", linear.partials, errors)
        assert np.abs(values).max() > 0.0
        assert np.all(np.abs(values - predicted) < 0.01 * sigma)


def test_the_twin_has_the_samples_own_noise() -> None:
    """Nonlinear less linear is small beside the filter's sigma, and the twin has the covariance of linear analysis."""
    result = simulate(64, SIGMAS, 11)
    assert result.linear_values is not None
    own = scenario().filter_prediction()
    assert own is not None
    sigma = np.sqrt(np.diagonal(own.covariance[-1]))
    assert np.all(np.abs(result.values - result.linear_values).max(axis=0) < 0.02 * sigma)


def test_shared_gains_change_little() -> None:
    own, shared = simulate(32, SIGMAS, 2), simulate(32, SIGMAS, 2, engine("shared-gains"))
    assert np.array_equal(own.linear_values, shared.linear_values)
    own_prediction = scenario().filter_prediction()
    assert own_prediction is not None
    sigma = np.sqrt(np.diagonal(own_prediction.covariance[-1]))
    difference = np.abs(own.values - shared.values).max(axis=0) / sigma
    assert np.all(difference < 0.02)
    assert np.any(difference > 0.0)


def test_no_errors_and_no_noise_are_exactly_zero() -> None:
    names = ("gnss", "altimeter", "stars", "doppler", "compass")
    made = engine("ensemble", names)
    width = len(sized(scenario(names).navigation.sensors, {}))
    for own in (True, False):
        values, _ = made.navigation.propagate(made.tables, np.zeros((3, width)), own)
        assert not values.any()


def test_bits_do_not_depend_on_the_batch() -> None:
    whole = simulate(70, SIGMAS, 4)
    errors = draw(70, SIGMAS, 4)
    assert whole.filter_values is not None
    for rows in (np.arange(5, 6), np.arange(3, 44), np.array([69, 2, 33])):
        part = engine().simulate(Batch(rows, errors[rows], 4))
        assert part.values.tobytes() == whole.values[rows].tobytes()
        assert part.filter_values is not None
        assert part.filter_values.tobytes() == whole.filter_values[rows].tobytes()


def test_noise_of_measurements_takes_the_room_of_a_block_of_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the length of the flight: all 300 measurements at once would take 1800 rows of lanes."""
    rows = list[int]()

    def recorded(*shape: int) -> Array:
        rows.append(prod(shape))
        return room(*shape)

    made = engine()
    monkeypatch.setattr(aided_ensemble, "room", recorded)
    simulate(1, SIGMAS, 2, made)
    assert rows
    assert max(rows) < len(scenario().navigation.sensors[0].times)


def test_a_gate_rejects_at_its_rate_and_counts_what_it_rejects() -> None:
    """Of a consistent filter 5 % of the measurements are rejected; innovations are then not quite white."""
    made = engine("ensemble", ("gnss",), 0.95)
    result = made.simulate(Batch(np.arange(32), draw(32, SIGMAS, 6), 6))
    assert result.filter_values is not None
    _, accepted, rejected, _, _ = result.filter_values[:, :, made.filter.places["sensor:gnss"]].sum(axis=(0, 1))
    assert accepted + rejected == 32 * len(scenario().navigation.sensors[0].times)
    low, high = stats.binom.ppf([FALSE_ALARM / 2, 1.0 - FALSE_ALARM / 2], accepted + rejected, 0.05)
    assert low < rejected < high


def test_errors_beyond_the_engine_are_failures_with_a_reason() -> None:
    errors = draw(3, SIGMAS, 8)
    errors[1, 3] = 1e9
    result = engine().simulate(Batch(np.arange(3), errors, 8))
    assert {row: failure.status for row, failure in result.failures.items()} == {1: f"failed: {WORDS[BEYOND]}"}
    assert np.isnan(result.values[1]).all()
    assert np.isfinite(result.values[[0, 2]]).all()


def test_a_covariance_that_is_not_definite_is_a_failure_with_a_reason() -> None:
    """A filter that starts with a negative covariance: innovations without a variance."""
    tables = engine().tables
    filtered = replace(tables.loop.filter, initial=-tables.loop.filter.initial)
    broken = replace(engine(), tables=replace(tables, loop=replace(tables.loop, filter=filtered)))
    result = broken.simulate(Batch(np.arange(3), draw(3, SIGMAS, 8), 8))
    assert {failure.status for failure in result.failures.values()} == {f"failed: {WORDS[INDEFINITE]}"}
    assert list(result.failures) == [0, 1, 2]
    assert np.isnan(result.values).all()


def test_too_many_steps_to_halve_are_told_in_words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The numerical error is not measured then, and is not a number that is none."""
    monkeypatch.setenv("MCNAV_CACHE_DIR", str(tmp_path))
    of = scenario()
    assert of.navigation.aided is not None
    monkeypatch.setattr(aided, "MOST_STEPS", len(of.navigation.aided.grid(1)))
    accuracy = of.engine("ensemble", draw(8, SIGMAS, 1)).accuracy
    assert "Numerical error not measured" in accuracy
    assert "nan" not in accuracy


@pytest.mark.parametrize("sensors", [("gnss",), ("gnss", "altimeter", "stars", "doppler", "compass")])
def test_the_ensemble_agrees_with_the_reference_fed_the_same_noise(sensors: tuple[str, ...]) -> None:
    """Five samples with every sensor and five with one: 1e-4 of the filter's sigma at every epoch.

    The engines share no equation. The reference's filter has steps of 0.2 s whose transition is of second order: with
    0.5 s they differ by 1e-4 in heading, and the difference falls as the square.
    """
    of = scenario(sensors)
    reference = of.engine("reference", np.zeros((1, 1)))
    assert isinstance(reference, AidedReferenceEngine)
    own = of.filter_prediction()
    assert own is not None
    sigma = np.sqrt(np.diagonal(own.covariance, axis1=1, axis2=2))
    tables = of.navigation.aided.tables(1)  # type: ignore[union-attr]
    errors = draw(5, SIGMAS, 17, of)
    for number in range(len(errors)):
        noise = reference.mechanization.draw(WALK, 17, number)
        row = errors[number : number + 1]
        found = simulate_aided(tables, row, 0, np.zeros(1, int), True, reference.given(noise))
        expected, records = reference.mechanization.simulate(errors[number], noise)
        assert np.all(np.abs(found.values[0] - expected) < 1e-4 * sigma)
        assert reference.linear(errors[number], noise) == pytest.approx(found.linear[0], abs=1e-12)
        places = of.filter_schema.places  # type: ignore[union-attr]
        # navigation's NEES: twice the difference of errors in sigmas, times the error in sigmas, some 5 at most
        assert records[:, places["nees"]][:, 1] == pytest.approx(found.records[0, :, 1], rel=2e-3, abs=2e-3)


@pytest.mark.parametrize(("name", "count"), [("ensemble", 400), ("reference", 8)])
def test_quantization_that_the_filter_neglects(name: str, count: int) -> None:
    """Each variance at the end, of the noise alone, lies within the chi-square interval of the closed loop."""
    counted = Imu(
        replace(WALK.gyro, quantization=np.full(3, 2e-5), quantization_interval=np.full(3, 0.1)),
        replace(WALK.accelerometer, quantization=np.full(3, 0.02), quantization_interval=np.full(3, 0.1)),
    )
    of = Ins(replace(scenario().navigation, imu=counted))
    made = of.engine(name, draw(8, SIGMAS, 1, of))
    found = made.simulate(Batch(np.arange(count), np.zeros((count, len(of.sources))), 6))
    processes = of.navigation.linear.processes
    expected = np.diag(sum(each[-1] for each in processes.values()))  # type: ignore[arg-type]
    share = sum(np.diag(each[-1]) for each_name, each in processes.items() if "quantization" in each_name) / expected
    assert share.max() > 0.3
    low, high = stats.chi2.ppf([0.5 * FALSE_ALARM / 18, 1.0 - 0.5 * FALSE_ALARM / 18], count) / count
    for ratio in (found.values**2).mean(axis=0) / expected:
        assert low < ratio < high
    assert found.linear_values is not None
    for ratio in (found.linear_values**2).mean(axis=0) / expected:
        assert low < ratio < high


def test_the_noise_of_the_measurements_alone_has_its_share_of_the_variance() -> None:
    """A navigator without any other error, whose filter believes in all: each variance within its interval."""
    believing = scenario().navigation
    alone = Ins(replace(believing, imu=Imu()))
    made = alone.engine("ensemble", np.zeros((8, len(alone.sources))))
    assert isinstance(made, AidedEngine)
    count = 200
    history = made.simulate(Batch(np.arange(count), np.zeros((count, len(alone.sources))), 21)).history
    whole = scenario().linear_over_time(61).processes
    share = sum(np.diagonal(each, axis1=1, axis2=2) for name, each in whole.items() if name.startswith("gnss"))
    assert history is not None
    ratio = (history**2).mean(axis=0)[1:] / share[1:]
    each = FALSE_ALARM / ratio.size
    low, high = stats.chi2.ppf([each / 2, 1.0 - each / 2], count) / count
    assert np.all((ratio > low) & (ratio < high))


def test_errors_of_estimated_correlated_errors_between_measurements() -> None:
    """A correlated error changes between the last measurement and an epoch, and at the start it is there already."""
    sensor = make_sensor("fix", np.array([350.0, 450.0]), {"position": 3.0}, 10.0, 60.0)
    model = make_filter((sensor,), WALK, SIGMAS, (*KINDS, "fix_bias"))
    of = Ins(Navigation(flight(1.0), "strapdown", START, 520.0, WALK, (sensor,), model))
    count = 400
    errors = draw(count, SIGMAS, 8, of)
    made = of.engine("ensemble", errors[:8])
    assert isinstance(made, AidedEngine)
    record = made.simulate(Batch(np.arange(count), errors, 8)).filter_values
    assert record is not None
    places = made.filter.places
    square = (record[..., places["state_error"]] ** 2).mean(axis=0)
    ratio = square / record[..., places["state_variance"]].mean(axis=0)
    each = FALSE_ALARM / ratio.size
    low, high = stats.chi2.ppf([each / 2, 1.0 - each / 2], count) / count
    assert np.all((ratio > low) & (ratio < high))
    nees = record[..., places["nees"]].mean(axis=0)
    for place, size in enumerate(made.filter.groups.values()):
        low, high = stats.chi2.ppf([each / 2, 1.0 - each / 2], count * size) / count
        assert np.all((nees[:, place] > low) & (nees[:, place] < high))
