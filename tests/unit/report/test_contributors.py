"""Contributors to the error budget: every source in one of them, small ones combined, none hidden that matters."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.report.figures.sources import SHOWN, SMALL, contributors

KINDS = [f"{unit} {kind}" for unit in ("gyro", "accelerometer") for kind in ("bias", "noise", "scale factor")]


def content(names: list[str], shares: Array, simulated: Array | None = None, still: int = 0) -> Any:
    """What contributors are computed from: some sources, of which the last have no dispersion."""
    count = len(names)
    sigma = np.where(np.arange(count) < count - still, 1.0, 0.0)
    alone = {"alone": {"alone": {"variance": None if simulated is None else simulated.tolist()}}}
    return SimpleNamespace(
        cause_names=names,
        moving=list(range(len(shares))),
        development=None,
        budget=SimpleNamespace(shares=shares * sigma),
        model=SimpleNamespace(covariance=np.diag(sigma**2), partials=np.sqrt(shares)),
        comparison=SimpleNamespace(covariance_linear=np.eye(len(shares))),
        manifest=SimpleNamespace(model=SimpleNamespace(budget=None if simulated is None else alone)),
    )


@pytest.mark.parametrize("count", [1, 5, SHOWN, SHOWN + 1, 18, 45, 200])
def test_every_source_belongs_to_one(count: int) -> None:
    """As many as there are colours at most, and one for the others; the largest mean share comes first."""
    names = [f"{KINDS[j // 3 % len(KINDS)]} {j // 18 or ''} {'xyz'[j % 3]}".replace("  ", " ") for j in range(count)]
    shares = np.random.default_rng(count).dirichlet(np.full(count, 0.3), 4)
    found = contributors(content(names, shares))
    assert sorted(j for each in found for j in each.members) == list(range(count))
    shown = [each for each in found if not each.other]
    assert len(shown) <= SHOWN
    assert len(found) - len(shown) <= 1
    assert len({each.series.name for each in found}) == len(found)
    mean = [shares[:, each.members].sum(axis=1).mean() for each in shown]
    assert mean == sorted(mean, reverse=True)


def test_a_source_without_dispersion_is_none() -> None:
    found = contributors(content(["a", "b", "c"], np.array([[0.5, 0.5, 0.9]]), still=1))
    assert [each.label for each in found] == ["a", "b"]


def test_small_ones_are_combined_unless_simulations_see_them() -> None:
    """A source below the limit by the linear model alone is small; by Monte Carlo it may matter."""
    shares = np.array([[1.0 - 2.5 * SMALL, 0.9 * SMALL, 0.8 * SMALL, 0.8 * SMALL]])
    assert [each.label for each in contributors(content(list("abcd"), shares))] == ["a", "other 3 causes"]
    simulated = shares.copy()
    simulated[0, 2] = 0.5
    assert [each.label for each in contributors(content(list("abcd"), shares, simulated))] == [
        "a",
        "c",
        "other 2 causes",
    ]


def test_a_single_small_source_keeps_its_name() -> None:
    shares = np.array([[1.0 - 0.5 * SMALL, 0.5 * SMALL]])
    assert [each.label for each in contributors(content(["a", "b"], shares))] == ["a", "b"]
