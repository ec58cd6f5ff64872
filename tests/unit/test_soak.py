"""The checks of a soak: growth of memory, and moments that are those of linear covariance but for chance."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tests.benchmarks.soak import RECORD, Look, check_growth, check_moments

SAMPLES, CHUNKS = 10_000_000, 40


def looks(leak: float, noise: float = 3e6) -> list[Look]:
    """Return what is seen of a run that leaks so many bytes a sample, with noise of its memory."""
    chance = np.random.default_rng(5)
    done = np.linspace(0, SAMPLES, 200).astype(int)
    memory = 3e8 + leak * done + noise * chance.standard_normal(200)
    return [
        Look(float(k), int(count), int(held), 0, 1, 8, 0)
        for k, (count, held) in enumerate(zip(done, memory, strict=True))
    ]


def test_steady_memory_is_found_steady() -> None:
    assert check_growth(looks(0.0), SAMPLES, CHUNKS)[0]
    assert check_growth(looks(RECORD * CHUNKS / SAMPLES), SAMPLES, CHUNKS)[0]


def test_a_leak_is_found() -> None:
    """Of two bytes a sample: 20 MB over the run, with a standard error of about 1 MB."""
    steady, told = check_growth(looks(2.0), SAMPLES, CHUNKS)
    assert not steady
    assert told.startswith("memory: +")


def test_few_looks_say_nothing() -> None:
    assert "not known" in check_growth(looks(2.0)[::20], SAMPLES, CHUNKS)[1]


def summary(scale: float, place: float) -> dict[str, Any]:
    """Return a summary whose sigma and mean are off by so many standard errors."""
    return {
        "samples": SAMPLES,
        "failed": 0,
        "outputs": [{"name": "range", "unit": "m"}],
        "sigma_linear": [2.0],
        "sigma_ratio": [1.01 * (1.0 + scale / math.sqrt(2.0 * SAMPLES))],
        "sigma_ratio_paired": [1.01],
        "mean_sample": [5.0 + 0.1 + place * 2.0 / math.sqrt(SAMPLES)],
        "mean_linear": [5.0],
        "bias": [0.1],
    }


@pytest.mark.parametrize(("scale", "place", "sound"), [(2.0, -2.0, True), (6.0, 0.0, False), (0.0, -6.0, False)])
def test_moments_are_judged_by_their_standard_errors(scale: float, place: float, sound: bool) -> None:
    """A nonlinear part of 1 %, which both estimates have, is no fault."""
    assert check_moments(summary(scale, place))[0] == sound
