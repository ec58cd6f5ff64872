"""The reference engine of the guided reentry: against cartesian axes, against what is known of it, and how it fails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mcnav.contract.samples import Batch
from mcnav.physics.constants import EARTH_RADIUS
from mcnav.systems.reentry.guided.description import FollowingLaw, Guidance, GuidedNavigation, Whose
from mcnav.systems.reentry.guided.reference import GuidedReferenceEngine, fly_guided, largest_force, simulate_guided
from mcnav.systems.reentry.navigator import simulate_indicated
from mcnav.systems.reentry.outputs import SCALE
from mcnav.systems.reentry.vehicle import ConstantLift, VariableLift, Vehicle
from mcnav.systems.sample_loop import SampleFailed
from tests.cartesian_reentry import CartesianFlight
from tests.guided import ALL_SIZES, errors_of, guided, reference_partials

INTEGRATION = {
    "true_altitude": 1e-5, "true_range": 1e-5, "true_altitude_rate": 1e-8, "true_range_rate": 1e-8,
    "altitude": 1e-5, "range": 1e-5, "altitude_rate": 1e-8, "range_rate": 1e-8,
}  # fmt: skip
"""Errors of the states that DOP853 is allowed to make, m and m/s: 1e-12 of a radius and of a speed."""

LOOPS = [
    Guidance("true", "true", "truth"),
    Guidance("true", "indicated", "nominal"),
    Guidance("indicated", "true", "nominal"),
    Guidance("indicated", "indicated", "truth"),
]


def _draw(multiple: float = 1.0, seed: int = 1963) -> np.ndarray:
    return np.asarray(np.random.default_rng(seed).standard_normal(len(ALL_SIZES)) * ALL_SIZES * multiple)


def _allowed(navigation: GuidedNavigation, errors: np.ndarray) -> np.ndarray:
    """How far outputs move when a state errs by `INTEGRATION`, at the start or at the end, shape (outputs,)."""
    undisturbed = simulate_guided(navigation, errors)
    states = [INTEGRATION[name] for name in ("altitude", "range", "altitude_rate", "range_rate")]
    moved = np.array([*states, *states[4 - (len(undisturbed) - 6) :], 0.0, 0.0])
    for name, size in INTEGRATION.items():
        disturbed = simulate_guided(navigation, errors + errors_of(**{name: 1e3 * size}))
        moved = moved + np.abs(disturbed - undisturbed) / 1e3
    return np.asarray(moved)


def _cartesian(navigation: GuidedNavigation, errors: np.ndarray) -> np.ndarray:
    """Outputs in the order of the description, without the largest force, and this."""
    time, actual, indicated, largest = CartesianFlight(navigation, errors).fly()

    def less(state: np.ndarray, other: np.ndarray) -> np.ndarray:
        difference = state - other
        difference[1] = (difference[1] + np.pi) % (2.0 * np.pi) - np.pi
        return np.asarray(difference * SCALE)

    dispersion = less(actual, navigation.nominal_final)[0 if navigation.guidance.final == "indicated" else 1 :]
    since = time - navigation.trajectory.reentry_time
    return np.concatenate([less(indicated, actual), dispersion, [since, largest]])


def _agree(navigation: GuidedNavigation, errors: np.ndarray) -> None:
    """Outputs agree to ten times what integration may err by; the largest of seventeen a step is no larger.

    The parabola through the largest misses it by the square of a 32nd of a step, 1e-5 of a force that steps resolve.
    """
    polar, cartesian = simulate_guided(navigation, errors), _cartesian(navigation, errors)
    allowed = 10.0 * _allowed(navigation, errors) + 1e-9 * np.abs(polar)
    difference = polar - cartesian
    assert (np.abs(difference) < allowed)[:-1].all(), difference / allowed
    assert -allowed[-1] < difference[-1] < 1e-5 * polar[-1]


@pytest.mark.parametrize(
    ("number", "multiple", "options", "loop"),
    [
        *((2, 1.0, {"accelerometers_off_above": 104e3}, loop) for loop in range(len(LOOPS))),
        (1, 1.0, {"start": -600.0}, 1),
        (4, 1e-3, {}, 2),
        (4, 1e-3, {}, 3),
    ],
)
def test_polar_and_cartesian_equations_fly_the_same(
    number: int, multiple: float, options: dict[str, float], loop: int
) -> None:
    _agree(guided(number, LOOPS[loop], **options), _draw(multiple))


FOLLOWING = FollowingLaw(
    knots=np.array([0.05, 0.3, 0.7]),
    polynomials=np.array(
        [
            [[0.1 + 2e-5 * EARTH_RADIUS, 0.1], [-2e-5, 0.0], [-1e-3, 1e-4], [1e-6, 0.0]],
            [[0.125 + 2e-5 * EARTH_RADIUS, 0.1], [-2e-5, 0.0], [-0.975e-3, -2e-4], [1e-6, 0.0]],
        ]
    ),
    limit=0.3,
    lift_before=0.2,
)
"""A law with two intervals and no purpose; gains of 2e-5 per metre take it to its limits."""


@pytest.mark.parametrize("fed", ["true", "indicated"])
def test_a_law_that_follows_its_reference_flies_the_same_in_both(fed: Whose) -> None:
    navigation = guided(2, Guidance(input=fed, law=FOLLOWING))
    _agree(navigation, _draw())


def test_without_true_errors_and_feedback_it_is_the_navigator_of_the_report() -> None:
    """Both restart at the same kinks; here the truth is integrated with the navigator, there it is shared."""
    navigation, errors = guided(2, Guidance(input="true"), accelerometers_off_above=104e3), _draw()
    errors[12:] = 0.0
    guided_outputs = simulate_guided(navigation, errors)
    unguided = simulate_indicated(navigation.trajectory, errors[:12], navigation.start, navigation.theta_axes)
    allowed = 10.0 * _allowed(navigation, errors)
    assert (np.abs(guided_outputs[:4] - unguided) < allowed[:4]).all()
    assert (np.abs(guided_outputs[4:7]) < allowed[4:7]).all()
    final = navigation.trajectory.final_time - navigation.trajectory.reentry_time
    assert abs(guided_outputs[7] - final) < allowed[7] + 1e-9


def test_density_and_drag_have_equal_partial_derivatives() -> None:
    """C_D A / m and the density occur as a product alone: to 1e-7 of a row, which differences resolve to 1e-8."""
    partials = reference_partials(guided(2), 0.02, ["density", "drag"])
    assert (np.abs(partials[:, 0] - partials[:, 1]) < 1e-7 * np.abs(partials[:, 0]).max()).all()


def test_an_error_of_lift_acts_after_the_limit() -> None:
    """It is a law with that much more gain and limit, and not one with more gain alone."""
    navigation, more = guided(2), 1.03
    law = navigation.vehicle.lift_law
    assert isinstance(law, VariableLift)
    by_error = simulate_guided(navigation, errors_of(lift_to_drag=0.03))
    after, before = (
        simulate_guided(replace(navigation, vehicle=Vehicle(VariableLift(law.gain * more, limit))), errors_of())
        for limit in (law.limit * more, law.limit)
    )
    assert (np.abs(by_error - after) < 10.0 * _allowed(navigation, errors_of())).all()
    assert abs(by_error[4] - before[4]) > 1e3


def test_constant_lift_takes_no_notice_of_the_navigator() -> None:
    """The truth flies as without navigation errors; the error of L/D multiplies the ratio."""
    navigation, errors = guided(3), errors_of(altitude_rate=0.5, lift_to_drag=0.01)
    law = navigation.vehicle.lift_law
    assert isinstance(law, ConstantLift)
    other = replace(navigation, vehicle=Vehicle(ConstantLift(1.01 * law.lift_to_drag)))
    flown, expected = simulate_guided(navigation, errors), simulate_guided(other, errors_of())
    assert (np.abs(flown - expected) < 10.0 * _allowed(navigation, errors_of()))[4:].all()


def test_a_navigator_told_the_nominal_errs_by_the_true_dispersion_too() -> None:
    """Its error at the start is that of its errors less the true ones."""
    errors = _draw()
    told_truth = errors.copy()
    told_truth[:4] -= errors[12:16]
    nominal, truth = (
        simulate_guided(guided(2, Guidance(navigator_start=start)), each)  # type: ignore[arg-type]
        for start, each in (("nominal", errors), ("truth", told_truth))
    )
    np.testing.assert_allclose(nominal, truth, rtol=1e-7)


def test_a_law_with_the_gain_of_the_vehicle_flies_as_the_vehicle() -> None:
    """Knots do not matter where the polynomials are the same on both sides."""
    own = guided(2)
    law = own.vehicle.lift_law
    assert isinstance(law, VariableLift)
    polynomials = np.zeros((3, 4, 2))
    polynomials[:, 2, 0] = -law.gain
    following = FollowingLaw(np.array([-3.0, 0.2, 0.21, 0.5]), polynomials, law.limit)
    errors = _draw()
    same = simulate_guided(guided(2, Guidance(law=following)), errors)
    assert (np.abs(same - simulate_guided(own, errors)) < 10.0 * _allowed(own, errors)).all()


def test_the_largest_deceleration_is_not_missed_between_steps() -> None:
    """No force at a thousand times of each step near the largest is larger, and one of them is as large, to 1e-6."""
    flown = fly_guided(guided(1), _draw())
    largest = largest_force(flown)
    sizes = []
    for phase in flown:
        forces = phase.forces()
        for step in np.flatnonzero(np.maximum(forces[1:], forces[:-1]) > 0.95 * largest):
            times = np.linspace(phase.steps.times[step], phase.steps.times[step + 1], 1000)
            sizes += [phase.force(phase.state(int(step), time)) for time in times]
    assert largest * (1.0 - 1e-6) < max(sizes) < largest * (1.0 + 1e-12)


@pytest.mark.parametrize(
    ("number", "guidance", "errors", "reason"),
    [
        (4, Guidance(), {"true_range_rate": 9.0}, "it skips out: in 24 h the true altitude does not fall to 26.75 km"),
        (2, Guidance(), {"true_altitude": -3e7}, "the true altitude starts below the final altitude"),
        (2, Guidance(final="indicated"), {"altitude": -2e7}, "the indicated altitude starts below the final altitude"),
        (2, Guidance(), {"altitude": -2.48e7}, "the indicated position fell to 64 km from the earth's centre"),
        (2, Guidance(final="indicated"), {"altitude": 1e5}, "the vehicle meets the ground before the indicated"),
        (2, Guidance(), {"bias_x": np.nan}, "the integration broke down"),
    ],
)
def test_a_flight_that_does_not_arrive_says_why(
    number: int, guidance: Guidance, errors: dict[str, float], reason: str
) -> None:
    with pytest.raises(SampleFailed, match=reason):
        simulate_guided(guided(number, guidance), errors_of(**errors))


def test_a_sample_that_fails_leaves_the_others_alone() -> None:
    navigation = guided(2)
    errors = np.stack([_draw(), errors_of(true_altitude=-3e7), _draw()])
    result = GuidedReferenceEngine(navigation, outputs=9).simulate(Batch(np.arange(3), errors, seed=1))
    assert list(result.failures) == [1]
    assert np.isnan(result.values[1]).all()
    np.testing.assert_array_equal(result.values[0], result.values[2])
    np.testing.assert_array_equal(result.values[0], simulate_guided(navigation, errors[0]))
