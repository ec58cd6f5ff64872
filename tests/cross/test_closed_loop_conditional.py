"""Noise of closed loops under conditions on what it adds to their linear outcomes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mcnav.contract.engine import conditions_noise
from mcnav.contract.samples import Batch
from mcnav.systems.closed_loop.conditional import noise_partials, rows_of
from mcnav.workflow.prepare import PreparedSystem, prepare_system
from tests.closed_loops import campaign

LOOPS = ("Pendulum", "Landing", "Kicked", "Braking")
"""White noise, Gauss-Markov, sensors, corrections at their times and by triggers, ends by triggers."""


def prepared(name: str) -> PreparedSystem:
    described = replace(campaign(name), design="random", seed=5, samples=64, tolerance=0.2, sample_timeout=None)
    return prepare_system(described, described.scenario.engines[0])


@pytest.mark.parametrize("name", LOOPS)
def test_partials_of_the_noise_and_conditions(name: str) -> None:
    """``N N^T`` is the covariance of a recursion forwards, and linear outcomes have what noise was told to add."""
    system = prepared(name)
    engine: Any = system.engine
    assert conditions_noise(engine)
    setup, outputs = engine.set_up(), len(system.model.outputs)
    forwards = sum((system.model.processes or {}).values(), np.zeros((outputs, outputs)))
    sigma = np.sqrt(np.diag(forwards))
    felt = np.flatnonzero(sigma > 1e-6 * np.sqrt(np.diag(_whole(system))))
    chosen, end = tuple(felt.tolist()), setup.plan.end
    rows, _ = rows_of([noise_partials(setup.plan, setup.maps, setup.true, setup.readout, chosen, end)])
    backwards = rows @ rows.T
    scale = np.outer(sigma[felt], sigma[felt])
    np.testing.assert_allclose(backwards / scale, forwards[np.ix_(felt, felt)] / scale, atol=1e-7)

    (first,) = felt[:1].tolist()
    batch = system.draws.batch(0, 8)
    samples, normals = engine.conditional_noise((first,)), np.linspace(-4.0, 4.0, 8)[:, None]
    added = normals @ samples.factor.T
    result = samples.simulate(batch, normals)
    assert result.linear_values is not None
    told = (system.model.nominal + batch.errors @ system.model.partials.T)[:, first] + added[:, 0]
    np.testing.assert_allclose((result.linear_values[:, first] - told) / sigma[first], 0.0, atol=1e-7)
    pieces = replace(engine, chunk=3).conditional_noise((first,)).simulate(batch, normals)
    np.testing.assert_array_equal(pieces.values, result.values)


def _whole(system: PreparedSystem) -> np.ndarray[Any, Any]:
    model = system.model
    start = model.partials @ model.start_covariance @ model.partials.T
    return np.asarray(start + sum((model.processes or {}).values()))


def test_random_conditions_leave_the_noise_as_it_is() -> None:
    """With what noise adds drawn from its own law, the other outputs have the linear variance (chi-square, 1e-4)."""
    system = prepared("DoubleIntegrator")
    engine: Any = system.engine
    forwards = sum((system.model.processes or {}).values(), np.zeros((1, 1)))
    names = [output.name for output in system.model.outputs]
    one, other = names.index("true_position"), names.index("velocity")
    count = 2_000
    normals = np.random.default_rng(3).standard_normal((count, 1))
    batch = Batch(np.arange(count), np.zeros((count, len(system.model.sources))), 8)
    samples = engine.conditional_noise((one,))
    values = samples.simulate(batch, normals).values
    np.testing.assert_allclose(values[:, one], (normals @ samples.factor.T)[:, 0], atol=1e-9)
    share = np.mean(values[:, other] ** 2) / forwards[other, other]
    assert share == pytest.approx(1.0, abs=3.9 * np.sqrt(2.0 / count))
    cosine = np.mean(values[:, one] * values[:, other])
    expected, spread = forwards[one, other], np.sqrt(forwards[one, one] * forwards[other, other])
    assert cosine == pytest.approx(expected, abs=3.9 * spread * np.sqrt(2.0 / count))
