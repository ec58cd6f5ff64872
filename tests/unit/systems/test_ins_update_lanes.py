"""Corrections of navigators and estimates in lanes against matrix algebra; nothing beyond their rows is written."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mcnav.compiled.vectors import LANES, room
from mcnav.systems.ins.ensemble.steps import deviations_of
from mcnav.systems.ins.ensemble.updates import LARGEST_CORRECTION, estimates_of, feed_back_shared

ROUNDING = 1e-15
"""Of sums of some products of the order of 0.1, in some ten operations."""


@pytest.mark.parametrize("states", [0, 1, 2, 3, 4, 6, 7])
@pytest.mark.parametrize("components", [1, 3])
def test_shared_gains(states: int, components: int) -> None:
    """Half of the lanes have accepted the measurement; the others stay as they are. Another update's gains follow."""
    rng = np.random.default_rng(states)
    samples, own = deviations_of(0, 0), estimates_of(0, 0, 0, 1)
    memory, innovations = room(states + 3), 0.1 * rng.standard_normal((components, LANES))
    memory[:] = before = rng.standard_normal(memory.shape)
    own = own._replace(estimate=memory[:states])
    gains = rng.standard_normal((2, 9 + states, components))
    own.innovation[:components] = innovations
    own.accepted[:] = accepted = np.arange(LANES) % 2.0
    samples.moved[:] = moved = rng.standard_normal(samples.moved.shape)
    samples.turn[0], samples.turn[1:], samples.sound[:] = 1.0, 0.0, 1.0

    feed_back_shared(0, components, gains, samples, own)

    correction = gains[0] @ (accepted * innovations)
    assert np.linalg.norm(correction[:3], axis=0).max() < LARGEST_CORRECTION
    assert samples.sound.all()
    turned = Rotation.from_quat(samples.turn.T, scalar_first=True).as_rotvec().T
    np.testing.assert_allclose(turned, -correction[:3], rtol=0.0, atol=10 * ROUNDING)
    np.testing.assert_allclose(samples.moved, moved - correction[3:9], rtol=0.0, atol=10 * ROUNDING)
    np.testing.assert_allclose(own.estimate, before[:states] + correction[9:], rtol=0.0, atol=10 * ROUNDING)
    assert np.array_equal(memory[states:], before[states:])
