"""Scenarios and campaigns that many tests share; each is built once."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import settings

from mcnav.config.read import Campaign, parse_campaign
from mcnav.physics.reentry.ensemble.transition import Response, linear_response
from mcnav.physics.reentry.vehicle import Vehicle
from mcnav.progress import Phase
from mcnav.scenarios.reentry import SOURCES, Flight, Reentry
from mcnav.scenarios.table_i import ERRORS, TABLE_I, start_state

settings.register_profile("suite", derandomize=True, deadline=None)
settings.load_profile("suite")

ROOT = Path(__file__).parent.parent
TRAJECTORIES = tuple(TABLE_I)


class Told:
    """Progress that is remembered.

    Attributes
    ----------
    phases : list of (Phase, int or None, str)
    samples, stored : int
        That have become ready, and how many of them were stored already.
    """

    def __init__(self) -> None:
        self.phases: list[tuple[Phase, int | None, str]] = []
        self.samples = self.stored = 0

    def phase(self, phase: Phase, samples: int | None = None, note: str = "") -> None:
        self.phases.append((phase, samples, note))

    def advance(self, samples: int, stored: bool = False) -> None:
        self.samples += samples
        self.stored += samples if stored else 0


@lru_cache
def reentry(trajectory: int, **options: Any) -> Reentry:
    """A trajectory of Table I as a scenario."""
    row = TABLE_I[trajectory]
    return Reentry(Flight(start_state(trajectory), Vehicle(row.lift_law), row.final_altitude, **options))


@lru_cache
def response(scenario: Reentry) -> Response:
    """The linear response from a scenario's start of navigation."""
    navigation = scenario.navigation
    return linear_response(navigation.trajectory, navigation.start, navigation.theta_axes)


def tn_errors(multiple: float = 1.0) -> dict[str, Any]:
    """The ``[errors]`` of NASA TN D-1772, some multiple of them."""
    return {
        source.name: f"{float(size * multiple)!r} {source.unit if source.unit != '1' else ''}".strip()
        for source, size in zip(SOURCES, ERRORS, strict=True)
    }


def content(trajectory: int = 4, multiple: float = 1.0, **entries: Any) -> dict[str, Any]:
    """The content of a campaign file."""
    return {
        "samples": 500,
        "seed": 1772,
        "scenario": {"type": "reentry", "trajectory": trajectory},
        "errors": tn_errors(multiple),
    } | entries


def campaign(trajectory: int = 4, multiple: float = 1.0, **entries: Any) -> Campaign:
    """A campaign at some multiple of the report's errors."""
    return parse_campaign(content(trajectory, multiple, **entries), "test.toml", "test")


@pytest.fixture(params=TRAJECTORIES, ids=lambda number: f"trajectory {number}")
def scenario(request: pytest.FixtureRequest) -> Reentry:
    """Each trajectory of Table I in turn."""
    return reentry(request.param)


@pytest.fixture
def draws() -> Callable[[int, float], np.ndarray]:
    """Normal draws at a multiple of the report's one-sigma errors, shape (count, 10)."""

    def draw(count: int, multiple: float = 1.0) -> np.ndarray:
        return np.random.default_rng(1963).standard_normal((count, len(ERRORS))) * ERRORS * multiple

    return draw
