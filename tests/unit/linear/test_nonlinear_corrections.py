"""Corrections to the linear model are made in proportion to their cost."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.history import Epochs
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.linear import nonlinear_corrections as corrections
from mcnav.linear.corrections import SimulatedBudget, Uncomputed, UnscentedMoments
from mcnav.linear.partials import QUICK, SimulationFailed
from mcnav.sampler.distributions import Normal
from mcnav.sampler.error_model import ErrorModel


@dataclass(frozen=True)
class Sums:
    """Fast engine whose only output is the sum of the errors; counts what it simulates."""

    parallel: str = "threads"
    chunk: int = QUICK
    accuracy: str = "exact"
    epochs: Epochs | None = None
    noisy: bool = False
    filter: FilterSchema | None = None

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        return SimulationResult(batch.errors.sum(axis=1)[:, None])


def _errors(count: int, still: int = 0) -> ErrorModel:
    names = [f"source_{j}" for j in range(count + still)]
    return ErrorModel(names, {name: Normal(1.0) for name in names[:count]})


def test_too_many_terms_are_refused_before_a_simulation() -> None:
    """The bound is on terms; sources without dispersion have none."""
    order = corrections.HIGHER_ORDER
    most = max(n for n in range(40) if comb(n + order, order) <= corrections.MOST_TERMS)
    found = corrections.polynomial_moments(Sums(), _errors(most, still=5))
    np.testing.assert_allclose(found.sigma, np.sqrt(most), rtol=1e-9)  # least squares of an exact sum
    with pytest.raises(SimulationFailed, match=rf"with {most + 1} sources a polynomial of order 3 has \d+ terms, more"):
        corrections.polynomial_moments(Sums(), _errors(most + 1))


@pytest.mark.parametrize(("chunk", "samples", "computed"), [(8, 24, False), (8, 25, True), (QUICK, 24, True)])
def test_a_slow_engine_simulates_no_more_than_the_samples(chunk: int, samples: int, computed: bool) -> None:
    """Three errors take 25 simulations, ``2 r^2 + 2 r + 1``; those without dispersion none."""
    engine, scenario = Sums(chunk=chunk), SimpleNamespace(sources=[SimpleNamespace(nominal=1.0)] * 5)
    budget = SimulatedBudget(Uncomputed(""), Uncomputed(""))
    found = corrections.nonlinear_corrections(cast(Any, scenario), engine, _errors(3, still=2), budget, samples)
    refused = Uncomputed("it needs 25 simulations, more than the campaign has samples")
    assert (found.second_order == refused) != computed
    assert isinstance(found.unscented, UnscentedMoments)
