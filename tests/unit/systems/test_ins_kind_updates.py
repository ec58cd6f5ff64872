"""Updates of other kinds of filters in lanes: against the equations of the reference engine, and both engines flown."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.compiled.blocks import blocks_of
from mcnav.compiled.vectors import LANES, PARTS, room
from mcnav.config.overrides import override
from mcnav.config.read import parse_campaign
from mcnav.config.toml import load_mapping
from mcnav.systems.ins.aided import AidedReferenceEngine
from mcnav.systems.ins.ensemble.filters import begin_covariances, covariances_in_lanes, covariances_of
from mcnav.systems.ins.ensemble.kind_updates import carry_over, kind_rooms, retract
from mcnav.systems.ins.filter.model import EKF, KINDS, LEFT, RIGHT
from mcnav.systems.ins.recognition import is_ins
from mcnav.systems.ins.reference.error_definitions import carried_over, retracted
from tests.filter_kinds import CAMPAIGN

STATES = 4


@pytest.mark.parametrize("kind", [LEFT, RIGHT])
def test_an_invariant_error_is_carried_over_as_in_the_reference_engine(kind: str) -> None:
    """Corrections by up to 2.9 rad, about an earth that turns: velocities over it are those of the reference.

    Elements are sums of some 30 products, each of them at most 100: 1e-12 is rounding.
    """
    generator, spin, size = np.random.default_rng(3), 0.3, 9 + STATES
    root = generator.standard_normal((size, size))
    covariance = root @ root.T
    over_earth = np.eye(size)
    over_earth[3:6, 6:9] = -spin * np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    filters, rooms = covariances_of(STATES), kind_rooms(STATES, kind)
    begin_covariances(blocks_of(covariance), filters)
    changes = generator.standard_normal((LANES, size))
    changes[:, :3] *= np.linspace(0.0, 2.9, LANES)[:, None] / np.linalg.norm(changes[:, :3], axis=1)[:, None]
    filters.correction[:size] = changes.T
    for part in range(PARTS):
        retract(part, kind == LEFT, spin, filters, rooms)
        carry_over(part, filters, rooms)
    lanes = room(size, size)
    covariances_in_lanes(filters, lanes.reshape(size, size, PARTS, -1))
    inverse = np.linalg.inv(over_earth)
    for lane, change in enumerate(changes):
        taken = retracted(kind, over_earth @ change)
        np.testing.assert_allclose(filters.correction[:size, lane], inverse @ taken, rtol=0.0, atol=1e-13)
        expected = carried_over(kind, over_earth @ covariance @ over_earth.T, taken)
        expected = inverse @ expected @ inverse.T
        np.testing.assert_allclose(np.tril(lanes[..., lane]), np.tril(expected), rtol=1e-13, atol=1e-12)


@cache
def _flown(kind: str) -> tuple[Array, Array, Array]:
    """Errors of four samples without noise by both engines, and the sigmas of their filters, shape (4, m, 9)."""
    campaign = parse_campaign(override(load_mapping(CAMPAIGN, "-"), {"filter.kind": kind}), "-", "-")
    scenario = campaign.scenario
    assert is_ins(scenario)
    engine = scenario.engine("reference", np.zeros((1, len(scenario.sources))))
    assert isinstance(engine, AidedReferenceEngine)
    errors = np.random.default_rng(8).standard_normal((4, len(scenario.sources))) * campaign.errors.standard_deviations
    fine = replace(engine.mechanization, longest_filter_step=FINE, longest_step=FINE)
    values, records = (np.stack(of_samples) for of_samples in zip(*map(fine.simulate, errors), strict=True))
    sigmas = np.sqrt(np.diagonal(engine.filter.covariance(records), axis1=2, axis2=3))
    navigation = engine.navigation
    return values, navigation.propagate(navigation.tables(4), errors, True)[0], sigmas


FINE = 0.05
"""Steps of the reference engine, s."""


@pytest.mark.parametrize("kind", KINDS)
def test_both_engines_have_the_same_filter(kind: str) -> None:
    """With 20 degrees of heading kinds differ by half a sigma and more; engines by their steps, 1e-3 of sigma."""
    reference, ensemble, sigmas = _flown(kind)
    assert np.max(np.abs(reference - ensemble) / sigmas) <= 2e-3
    if kind != EKF:
        assert np.max(np.abs(ensemble - _flown(EKF)[1]) / sigmas) > 0.3
