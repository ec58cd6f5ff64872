"""Cruise and hover: two engines, the equations of variation, and exact solutions, which share no equation of motion."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcnav.contract.engine import without_noise
from mcnav.contract.errors import ScenarioError
from mcnav.contract.samples import Batch
from mcnav.numerics.hermite import POSITION_BOUND, VELOCITY_BOUND
from mcnav.numerics.integration import Diverged, integrate
from mcnav.systems.reentry.instruments import Error as PlanarError
from mcnav.systems.reentry.instruments import indicated_force, measured_force
from mcnav.systems.reentry.truth import motion
from mcnav.systems.steady.ensemble import ORDER, highest_rate, simulate_ensemble, simulate_histories
from mcnav.systems.steady.linearized import linearize
from mcnav.systems.steady.navigator import (
    STEEPEST,
    TOLERANCES,
    indicated_rates,
    indicated_start,
    simulate_indicated,
)
from mcnav.systems.steady.scenario import SOURCES, TOLERANCE, Cruise, EnsembleEngine
from mcnav.systems.steady.truth import Earth, Error, SteadyFlight
from mcnav.validation.reproduce.story_of_84_minutes.numbers import CROSS, RANGE, measured_period
from mcnav.validation.reproduce.story_of_84_minutes.schuler import schuler_period

SIZES = np.array([source.nominal for source in SOURCES])
SPEED = 804.672

FLIGHTS = {
    "rest": SteadyFlight(0.0, 0.0, 10_120.0),
    "cruise, inertial platform": SteadyFlight(10e3, SPEED, 10_120.0),
    "cruise, level platform": SteadyFlight(10e3, SPEED, 10_120.0, level=True),
    "fast, level platform": SteadyFlight(0.0, 5_000.0, 8_000.0, level=True),
    "cruise without altimeter": SteadyFlight(10e3, SPEED, 2_000.0, slaved=False),
    "hover": SteadyFlight(0.0, 0.0, 3_000.0, slaved=False, level=True),
}


@pytest.fixture(params=FLIGHTS.values(), ids=FLIGHTS.keys())
def flight(request: pytest.FixtureRequest) -> SteadyFlight:
    return request.param


def _draws(count: int, multiple: float) -> np.ndarray:
    return np.random.default_rng(84).standard_normal((count, len(SIZES))) * SIZES * multiple


@settings(max_examples=50)
@given(st.integers(0, 10_000), st.floats(0.0, 10_000.0))
def test_in_the_plane_it_is_the_navigator_of_the_report(seed: int, time: float) -> None:
    """NASA TN D-1772, eqs. (5)-(9), as `mcnav.systems.reentry.instruments` and `mcnav.systems.reentry.truth` have them,
    to rounding."""
    random = np.random.default_rng(seed)
    flight = SteadyFlight(10e3, SPEED, 1.0, slaved=False)
    whole = np.zeros(len(SIZES))
    common = ["MISALIGNMENT", "GYRO_DRIFT", "BIAS_X", "BIAS_Z", "SCALE_FACTOR_X", "SCALE_FACTOR_Z"]
    planar = np.zeros(len(PlanarError))
    for name in common:
        planar[PlanarError[name]] = whole[Error[name]] = random.standard_normal() * SIZES[Error[name]] * 100.0
    r, theta = flight.radius * random.uniform(0.9, 1.1), random.uniform(-3.0, 3.0)
    r_rate, theta_rate = random.uniform(-1e3, 1e3), random.uniform(-1e-3, 1e-3)
    measured = measured_force(0.0, -flight.effective_gravity, flight.rate * time, time, planar)
    expected = np.empty(4)
    motion(np.array([r, theta, r_rate, theta_rate]), *indicated_force(*measured, theta), expected)
    found = indicated_rates(
        time, np.array([r, theta, 0.0, r_rate, theta_rate, 0.0]), whole, flight.radius, flight.rate,
        flight.effective_gravity, flight.earth.gravitational_parameter, False, False,
    )  # fmt: skip
    np.testing.assert_allclose(found[[0, 1, 3, 4]], expected, rtol=1e-11, atol=1e-13)
    assert found[5] == 0.0


@pytest.mark.parametrize("multiple", [1.0, 100.0])
def test_engines_agree(flight: SteadyFlight, multiple: float) -> None:
    """To what the scheme leaves at 200 steps, 1e-12 and rounding, and the reference's 1e-12 of an earth's radius."""
    errors = _draws(6, multiple * (1.0 if flight.slaved else 0.1))
    reference = np.array([simulate_indicated(flight, row) for row in errors])
    values, valid = simulate_ensemble(flight, errors, 200)
    assert valid.all()
    rounding = np.array([1e-5, 1e-5, 1e-5, 1e-8, 1e-8, 1e-8]) * (30.0 if not flight.slaved else 1.0)
    assert np.all(np.abs(values - reference) < 1e-7 * np.abs(reference).max(axis=0) + rounding)


def test_the_scheme_is_of_eighth_order() -> None:
    """Half the step leaves 2^-8 of the error, within the share h of the next order that a step of 10 minutes keeps."""
    flight, errors = FLIGHTS["cruise, level platform"], _draws(16, 1.0)
    exact = simulate_ensemble(flight, errors, 128)[0]
    left = [
        np.abs(simulate_ensemble(flight, errors, steps)[0] - exact).max(axis=0)[[RANGE, CROSS]] for steps in (16, 32)
    ]
    assert np.all(np.abs(np.log2(left[0] / left[1]) - ORDER) < 0.6)


def test_the_stated_error_is_that_of_the_probes(flight: SteadyFlight) -> None:
    """Twice the steps leave 2^-8 of it, to a tenth and the digits stated; more samples reach a little farther."""
    scenario = Cruise(flight)
    errors = _draws(512, 1.0 if flight.slaved else 0.1)[:, scenario.navigation.sources]
    engine = scenario.engine("ensemble", errors[:64])
    assert isinstance(engine, EnsembleEngine)
    steps, stated = engine.steps, float(re.findall(r"[0-9.]+e-[0-9]+", engine.accuracy)[0])
    exact, _ = scenario.navigation.by_ensemble(errors, 8 * steps)
    off = np.abs(scenario.navigation.by_ensemble(errors, steps)[0] - exact) / exact[:64].std(axis=0)
    assert stated <= TOLERANCE
    assert off[:64].max() == pytest.approx(stated, rel=0.15, abs=1e-12)
    assert off.max() < 5.0 * TOLERANCE


def test_no_errors_are_exactly_none(flight: SteadyFlight) -> None:
    values, _ = simulate_ensemble(flight, np.zeros((2, len(SIZES))), 100)
    assert not values.any()


def test_flights_at_small_errors_are_the_linear_ones(flight: SteadyFlight) -> None:
    """Odd part of flights at a thousandth of the usual sizes: what bends is of third order, 1e-9; asked for, 1e-6."""
    steps = np.diag(SIZES) * 1e-3
    flown = 0.5 * (simulate_ensemble(flight, steps, 200)[0] - simulate_ensemble(flight, -steps, 200)[0]).T
    expected = linearize(flight, np.array([flight.duration]))[0] * SIZES * 1e-3
    largest = np.abs(expected).max(axis=1, keepdims=True)
    assert np.all(np.abs(flown - expected) <= 1e-6 * largest)


def _forces(flight: SteadyFlight, source: Error, time: float) -> tuple[float, float]:
    """What drives the error along and across the track, per unit of a source, written down by hand."""
    felt, angle = flight.effective_gravity, flight.rate * time
    s, c = (0.0, 1.0) if flight.level else (np.sin(angle), np.cos(angle))
    drifted, later = time, 0.0
    if flight.level and flight.rate:
        drifted, later = np.sin(angle) / flight.rate, (1.0 - np.cos(angle)) / flight.rate
    sine, cosine = np.sin(angle), np.cos(angle)
    return {
        Error.MISALIGNMENT: (-felt, 0.0),
        Error.GYRO_DRIFT: (-felt * time, 0.0),
        Error.BIAS_X: (c, 0.0),
        Error.BIAS_Z: (s, 0.0),
        Error.SCALE_FACTOR_X: (felt * s * c, 0.0),
        Error.SCALE_FACTOR_Z: (-felt * s * c, 0.0),
        Error.ROLL_MISALIGNMENT: (0.0, -felt * cosine),
        Error.AZIMUTH_MISALIGNMENT: (0.0, felt * sine),
        Error.ROLL_DRIFT: (0.0, -felt * (drifted * cosine + later * sine)),
        Error.AZIMUTH_DRIFT: (0.0, felt * (drifted * sine - later * cosine)),
        Error.BIAS_Y: (0.0, 1.0),
    }.get(source, (0.0, 0.0))


@pytest.mark.parametrize("name", [name for name, flight in FLIGHTS.items() if flight.slaved])
def test_the_exact_linear_solution(name: str) -> None:
    """Two oscillators, w^2 = g_eff / r along and g / r across, driven by known forces: Duhamel's integral."""
    flight = FLIGHTS[name]
    found = linearize(flight, np.array([flight.duration]))[0]
    rates = np.sqrt([flight.effective_gravity / flight.radius, flight.gravity / flight.radius])
    share = flight.earth.radius / flight.radius
    abscissae, weights = np.polynomial.legendre.leggauss(100)  # exact to rounding for a few swings
    nodes, weights = 0.5 * flight.duration * (1.0 + abscissae), 0.5 * flight.duration * weights
    for axis, (output, rate) in enumerate(zip((RANGE, CROSS), rates, strict=True)):
        phase = rate * flight.duration
        for source in Error:
            if source in (Error.ALTITUDE, Error.ALTITUDE_RATE):
                continue
            forces = np.array([_forces(flight, source, time)[axis] for time in nodes])
            expected = float(np.sum(weights * np.sin(rate * (flight.duration - nodes)) / rate * forces))
            if source == (Error.RANGE, Error.CROSS_RANGE)[axis]:
                expected = np.cos(phase)
            elif source == (Error.RANGE_RATE, Error.CROSS_RANGE_RATE)[axis]:
                expected = np.sin(phase) / rate
            elif source == Error.AZIMUTH_MISALIGNMENT and axis == 1:
                expected += flight.speed * np.sin(phase) / rate
            scale = np.abs(found[output] * SIZES).max() / SIZES[source]
            assert found[output, source] == pytest.approx(share * expected, rel=1e-8, abs=1e-8 * scale), source.name


@pytest.mark.parametrize("speed", [0.0, SPEED, 4_000.0, 7_800.0])
@pytest.mark.parametrize("level", [False, True])
def test_the_period_that_is_measured(speed: float, level: bool) -> None:
    """2 pi sqrt(r / g_eff) along the track within 1e-4, from rest to nearly orbital speed; 2 pi sqrt(r / g) across."""
    flight = SteadyFlight(0.0, speed, 1.0, level=level)
    expected = schuler_period(flight.radius, flight.effective_gravity)
    assert measured_period(flight) == pytest.approx(expected, rel=1e-6)
    if speed < 1_000.0:
        across = schuler_period(flight.radius, flight.gravity)
        assert measured_period(flight, CROSS) == pytest.approx(across, rel=1e-6)


@settings(max_examples=20)
@given(st.floats(-3.0, 3.0), st.floats(0.1, 1.2), st.booleans())
def test_a_launch_in_a_wrong_direction_is_the_flight_turned(azimuth: float, angle: float, level: bool) -> None:
    """However large: the indicated track is the actual one turned about the start."""
    flight = SteadyFlight(0.0, SPEED, 1.0, level=level)
    flight = replace(flight, duration=angle / flight.rate)
    errors = np.zeros((1, len(SIZES)))
    errors[0, Error.AZIMUTH_MISALIGNMENT] = azimuth
    values, _ = simulate_ensemble(flight, errors, 200)
    cross = values[0, CROSS] / flight.earth.radius
    assert np.sin(cross) == pytest.approx(np.sin(azimuth) * np.sin(angle), abs=1e-9)


@settings(max_examples=20)
@given(st.floats(-0.5, 0.5))
def test_a_start_elsewhere_with_the_platform_to_match_is_the_flight_shifted(shift: float) -> None:
    """The indicated flight is the actual one turned about the earth's centre: the range error stays as it was."""
    flight = SteadyFlight(0.0, SPEED, 6_000.0)
    errors = np.zeros((1, len(SIZES)))
    errors[0, Error.RANGE], errors[0, Error.MISALIGNMENT] = shift * flight.radius, -shift
    values, _ = simulate_ensemble(flight, errors, 100)
    np.testing.assert_allclose(values[0], [0.0, shift * flight.radius, 0.0, 0.0, 0.0, 0.0], atol=1e-5)


def test_a_navigator_that_falls_is_a_failure_with_its_reason() -> None:
    flight = SteadyFlight(0.0, 0.0, 6_000.0, slaved=False)
    errors = np.zeros(len(SIZES))
    errors[Error.BIAS_Z] = 0.01
    with pytest.raises(Diverged, match="came near the earth's centre at"):
        simulate_indicated(flight, errors)
    scenario = Cruise(flight)
    outcomes = without_noise(scenario.engine("ensemble", errors[None, :]))(errors[None, :])
    assert outcomes.fallback_count == 1
    assert np.isnan(outcomes.values).all()


def test_a_navigator_that_reaches_the_pole_is_a_failure_with_its_time() -> None:
    """The time is that of the root in scipy's dense output; a step is 50 s there."""
    flight = SteadyFlight(0.0, 0.0, 6_000.0, slaved=False)
    errors = np.zeros(len(SIZES))
    errors[Error.CROSS_RANGE], errors[Error.CROSS_RANGE_RATE] = 1.45 * flight.radius, 7_000.0

    def too_far(time: float, state: np.ndarray, *_: object) -> float:
        return STEEPEST - abs(float(state[2]))

    too_far.terminal = True  # type: ignore[attr-defined]
    earth = flight.earth.gravitational_parameter
    args = (errors, flight.radius, flight.rate, flight.effective_gravity, earth, flight.slaved, flight.level)
    scipy = integrate(
        indicated_rates, (0.0, flight.duration), indicated_start(flight, errors), TOLERANCES, args, events=too_far
    )
    seen: list[float] = []
    message = f"came near the pole of the great circle at {scipy.t[-1]:.0f} s"
    with pytest.raises(Diverged, match=message):
        simulate_indicated(flight, errors, lambda times, states: seen.extend(times))
    assert seen[-1] == pytest.approx(scipy.t[-1], abs=1e-3)


def test_development_ends_with_the_partials() -> None:
    scenario = Cruise(FLIGHTS["cruise, level platform"])
    known = scenario.linear_over_time()
    np.testing.assert_allclose(known.partials[-1], scenario.linear().end.partials, rtol=1e-8, atol=1e-6)
    assert known.times[-1] == pytest.approx(10_120.0 / 60.0)


def test_a_cruise_is_read_at_any_time() -> None:
    """At a time as at the end of a shorter flight, whatever else is asked for; outside of the flight it says so."""
    flight = FLIGHTS["cruise, level platform"]
    read = Cruise(flight).linear(np.array([300.0, 4_000.0]))
    shorter = Cruise(replace(flight, duration=4_000.0)).linear().end.partials
    np.testing.assert_allclose(read.partials[1], shorter, rtol=1e-8, atol=1e-6)
    with pytest.raises(ScenarioError, match=r"^got 10121 s; navigation is from 0 s to 10120 s$"):
        Cruise(flight).linear(np.array([10_121.0]))


def test_errors_of_an_inertial_altitude_grow_over_many_powers_of_ten() -> None:
    """Eighty of them, where the solution becomes singular: at each time as from one integration from the start on.

    Both integrate to 1e-11 of what grows.
    """
    flight = SteadyFlight(1_000.0, 0.0, 100_000.0, slaved=False)
    times = np.linspace(0.0, flight.duration, 31)
    partials = linearize(flight, times)
    assert np.abs(partials).max() > 1e80
    for time, over_time in zip(times[[2, 10, 30]], partials[[2, 10, 30]], strict=True):
        alone = linearize(flight, np.array([time]))[0]
        largest = np.abs(alone).max(axis=1, keepdims=True)
        assert (np.abs(over_time - alone) / largest).max() < 1e-9


def test_histories_are_shorter_flights(flight: SteadyFlight) -> None:
    """At a step what the flight that ends there gives with the same steps, and at the last one its very bits."""
    errors = _draws(40, 1.0)
    stops = np.array([0, 7, 25, 60])
    histories, valid = simulate_histories(flight, errors, 60, stops / 60)
    final, _ = simulate_ensemble(flight, errors, 60)
    assert valid.all()
    np.testing.assert_array_equal(histories[:, -1], final)
    scale = np.abs(histories).max(axis=(0, 1))
    for number, stop in enumerate(stops[1:-1], start=1):
        shorter = replace(flight, duration=flight.duration * stop / 60)
        expected, _ = simulate_ensemble(shorter, errors, int(stop))
        assert np.all(np.abs(histories[:, number] - expected) <= 1e-9 * scale + 1e-12)


@pytest.mark.parametrize("steps", [12, 24])
def test_errors_between_steps_are_off_by_the_interpolation_at_most(flight: SteadyFlight, steps: int) -> None:
    """Against 16 times the steps, of which each time is one: the bound of `mcnav.numerics.hermite` for swings at the
    highest rate, as large as a sample's largest position error, beside what the scheme leaves at its own steps."""
    errors = _draws(40, 1.0 if flight.slaved else 0.1)
    shares = np.arange(16 * steps + 1) / (16 * steps)
    exact, _ = simulate_histories(flight, errors, 16 * steps, shares)
    off = np.abs(simulate_histories(flight, errors, steps, shares)[0] - exact)
    of_scheme, rate = off[:, ::16].max(axis=1), highest_rate(flight)
    share = rate * flight.duration / steps
    bound = np.repeat([POSITION_BOUND * share**9, VELOCITY_BOUND * share**8 * rate], 3)
    size = np.linalg.norm(exact[:, :, :3], axis=2).max(axis=1)
    rounding = 1e-14 * np.repeat([1.0, steps / flight.duration], 3)  # a velocity is a difference of positions
    assert np.all(off.max(axis=1) <= of_scheme + (bound + rounding) * size[:, None])


def test_linear_sigmas_of_a_steady_flight_throughout() -> None:
    """Central differences of histories against the equations of variation, in both kinds of axes."""
    scenario = Cruise(FLIGHTS["cruise, level platform"])
    sizes = np.array([source.nominal for source in scenario.sources])
    engine = scenario.engine("ensemble", np.diag(sizes))
    assert isinstance(engine, EnsembleEngine)
    errors = np.concatenate([np.diag(sizes), -np.diag(sizes)]) * 1e-3
    histories = engine.simulate(Batch(np.arange(len(errors)), errors, 1)).history
    assert histories is not None
    up, down = np.split(histories, 2)
    flown = ((up - down) / 2e-3).transpose(1, 2, 0)
    expected = scenario._partials(engine.epochs.times * 60.0) * sizes
    scale = np.abs(expected).max(axis=(0, 2))[:, None]
    assert len(engine.epochs.times) == 60
    assert np.all(np.abs(flown - expected) < 1e-6 * scale)


def test_the_seeds_earth_may_be_another() -> None:
    """Twice the radius at the same gravity swings sqrt(2) slower."""
    one, other = (SteadyFlight(0.0, 0.0, 1.0, earth=Earth.with_gravity(r, 9.8)) for r in (6.4e6, 12.8e6))
    assert measured_period(other) / measured_period(one) == pytest.approx(np.sqrt(2.0), rel=1e-6)


def test_a_later_start_of_a_hover_leaves_schulers_closed_form() -> None:
    """Started at t_s, a bias b has moved the range by b / w^2 (1 - cos w (T - t_s)), and a tilt by R (1 - cos ...)."""
    hover = Cruise(SteadyFlight(0.0, 0.0, 3_600.0))
    times = hover.start_times(4)
    partials = hover.partials_at(times)
    flight, names = hover.flight, [source.name for source in hover.sources]
    gone = 1.0 - np.cos(np.sqrt(flight.gravity / flight.radius) * (flight.duration - times))
    along = partials[:, [output.name for output in hover.outputs].index("range")]
    np.testing.assert_allclose(along[:, names.index("bias_x")], flight.radius / flight.gravity * gone, rtol=1e-9)
    np.testing.assert_allclose(along[:, names.index("misalignment")], -flight.radius * gone, rtol=1e-9)
    for number, time in enumerate(times.tolist()):
        np.testing.assert_allclose(
            hover.started_at(time, "start").linear().end.partials, partials[number], atol=1e-9 * np.abs(partials).max()
        )


@pytest.mark.parametrize(
    ("time", "axes", "told"), [(-1.0, "start", "from 0 s"), (0.0, "trajectory", "aligned at each")]
)
def test_a_start_that_a_steady_flight_does_not_have_is_refused(time: float, axes: str, told: str) -> None:
    with pytest.raises(ScenarioError, match=told):
        Cruise(SteadyFlight(0.0, 0.0, 3_600.0)).started_at(time, axes)


def test_a_further_epoch_changes_no_sample() -> None:
    """The samples at the other epochs keep their bits, and at the new one they are those of a shorter flight."""
    usual = Cruise(FLIGHTS["cruise, inertial platform"])
    further = usual.with_epochs((3_000.0,))
    errors = np.diag([source.nominal for source in usual.sources])
    batch = Batch(np.arange(len(errors)), errors, 1)
    engines = [each.engine("ensemble", errors) for each in (usual, further)]
    before, after = (engine.simulate(batch).history for engine in engines)
    assert before is not None
    assert after is not None
    new = int(np.flatnonzero(further.reading_times == 3_000.0)[0])
    np.testing.assert_array_equal(np.delete(after, new, axis=1), before)
    shorter = Cruise(replace(usual.flight, duration=3_000.0)).engine("reference", errors).simulate(batch).values
    assert (np.abs(after[:, new] - shorter) / np.abs(shorter).max(axis=0)).max() < 1e-6  # 1e-7, and interpolation
