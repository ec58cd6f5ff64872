"""Further outputs of a reentry: by both engines, over time, and by linear analysis, on every output that there is."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.contract.engine import without_noise
from mcnav.contract.quantities import Output
from mcnav.systems.reentry.engines import EnsembleEngine
from mcnav.systems.reentry.outputs import DEVIATIONS, FURTHER, FurtherOutput, append_errors
from mcnav.systems.reentry.scenario import Flight, Reentry
from mcnav.systems.reentry.table_i import TABLE_I, start_state
from mcnav.systems.reentry.vehicle import Vehicle
from tests.conftest import SIZES

STEP = 1e-3
"""Steps of differences, in usual errors."""


def _speed(states: np.ndarray) -> np.ndarray:
    return np.asarray(np.hypot(states[..., 2], states[..., 0] * states[..., 3]))


def _speed_gradient(states: np.ndarray) -> np.ndarray:
    radius, _, radius_rate, angle_rate = np.moveaxis(states, -1, 0)
    by_state = (radius * angle_rate**2, 0.0 * radius, radius_rate, radius**2 * angle_rate)
    return np.stack(by_state, axis=-1) / _speed(states)[..., None]


EXAMPLE = FurtherOutput(Output("test_speed", "m/s", "m/s"), _speed, _speed_gradient)
ALL = (EXAMPLE, *FURTHER)


@pytest.fixture(scope="module", params=[None, 104e3], ids=["always on", "off above 104 km"])
def scenario(request: pytest.FixtureRequest) -> Reentry:
    """Return trajectory 4 with all further outputs, with and without an error of a perfect system."""
    row = TABLE_I[4]
    flight = Flight(start_state(4), Vehicle(row.lift_law), row.final_altitude, accelerometers_off_above=request.param)
    return Reentry(flight, ALL)


@pytest.fixture(scope="module")
def errors() -> np.ndarray:
    """Return twenty samples, shape (20, sources)."""
    return np.random.default_rng(1963).standard_normal((20, len(SIZES))) * SIZES


@pytest.fixture(scope="module")
def ensemble(scenario: Reentry, errors: np.ndarray) -> EnsembleEngine:
    ready = scenario.engine("ensemble", errors)
    assert isinstance(ready, EnsembleEngine)
    return ready


def test_both_engines_agree(scenario: Reentry, ensemble: EnsembleEngine, errors: np.ndarray) -> None:
    """To 1e-5 of each output's sigma, which is claimed for the errors of the polar state."""
    fast = without_noise(ensemble)(errors).values
    slow = without_noise(scenario.engine("reference", errors))(errors).values
    assert fast.shape == (len(errors), len(scenario.outputs))
    assert (np.abs(fast - slow) < 1e-5 * slow.std(axis=0)).all()


def test_histories_and_their_sums_end_in_the_final_errors(ensemble: EnsembleEngine, errors: np.ndarray) -> None:
    """To 1e-3 of sigma, which is claimed of a history; the sums are those of the histories."""
    histories, final = ensemble.histories(errors), without_noise(ensemble)(errors).values
    assert (np.abs(histories[:, -1] - final) < 1e-3 * final.std(axis=0)).all()
    sums = ensemble.history_sums(errors)
    np.testing.assert_allclose(sums.mean, histories.mean(axis=0), rtol=1e-9, atol=1e-9)


def test_partial_derivatives_are_those_of_differences(scenario: Reentry) -> None:
    """Central differences of the reference engine: their third-order term is a millionth of the second-order one."""
    steps = STEP * np.diag(SIZES)
    ready = without_noise(scenario.engine("reference", steps))
    differences = 0.5 * (ready(steps).values - ready(-steps).values).T / STEP
    partials = scenario.linear().end.partials * SIZES
    assert (np.abs(differences - partials).max(axis=1) < 1e-5 * np.abs(partials).max(axis=1)).all()
    nominal = ready(np.zeros((1, len(SIZES)))).values[0]
    np.testing.assert_allclose(scenario.linear().end.nominal, nominal, rtol=1e-5, atol=1e-6)


def test_partial_derivatives_over_time_end_in_those_of_the_end(scenario: Reentry) -> None:
    end = scenario.linear().end.partials
    np.testing.assert_allclose(scenario.linear_over_time().partials[-1], end, rtol=1e-6, atol=1e-9 * np.abs(end).max())


def test_start_times_have_a_row_for_every_output(scenario: Reentry) -> None:
    """The adjoint begins at the first point as the variational equations do, unless a perfect system has an error."""
    rows = scenario.partials_at(np.array([-scenario.trajectory.reentry_time]))[0]
    end = scenario.linear().end
    if not end.nominal.any():
        largest = np.abs(end.partials * SIZES).max(axis=1)
        assert (np.abs((rows - end.partials) * SIZES).max(axis=1) < 1e-5 * largest).all()
    assert rows.shape == end.partials.shape


def test_one_sample_shows_every_output(scenario: Reentry) -> None:
    assert "test speed error [m/s]" in scenario.simulate_one(SIZES).columns


def test_without_further_outputs_errors_stay_what_they_are() -> None:
    deviations = np.ones((3, len(DEVIATIONS)))
    assert append_errors((), deviations, np.ones(4)) is deviations
