"""A scenario with a filter: a position that walks at random, fixed once a second by a scalar Kalman filter.

Truth q = 1 m²/s, fixes r = 4 m²; a filter that believes in q = 0.25 m²/s has in the steady state the gain 0.2206955546
and the variance 0.8827822185 m², where the true one is 2.0427120591 m²: mean NEES 2.313948, mean NIS 1.372104. Samples
start in the steady state, so that these hold at every epoch.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from mcnav.arrays.types import Array
from mcnav.config.campaign import Campaign
from mcnav.config.read import parse_campaign
from mcnav.contract.engine import Engine
from mcnav.contract.failure import Failure, Reason
from mcnav.contract.filter_record import FilterPrediction, FilterSchema
from mcnav.contract.history import Epochs, History
from mcnav.contract.linear import LinearSystem
from mcnav.contract.quantities import Output, Source
from mcnav.contract.questions import TimelineParts
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.contract.scenario import PlainScenario
from mcnav.sampler.distributions import Normal
from mcnav.sampler.error_model import ErrorModel

WALK, FIX = 1.0, 4.0
"""Variances that the truth gains in a second, and of a fix's noise."""

SCHEMA = FilterSchema({"all": 1, "position": 1}, outputs=1, sensors={"fix": 1, "spare": 1})
TIMES = np.arange(0.0, 101.0, 5.0)
LABEL = "time [s]"


def steady_variance(walk: float) -> float:
    """Variance of the optimal filter after its update: P = p r / (p + r), with p = P + q."""
    before = 0.5 * (walk + math.sqrt(walk**2 + 4.0 * walk * FIX))
    return before * FIX / (before + FIX)


def true_variance(gain: float) -> float:
    """Steady variance of errors that are multiplied by 1 - K: V = (1 - K)² (V + q) + K² r."""
    kept = (1.0 - gain) ** 2
    return (kept * WALK + gain**2 * FIX) / (1.0 - kept)


@dataclass(frozen=True)
class FilterThatBelieves:
    """Engine of the filter; samples whose index is in ``failing`` fail."""

    walk: float
    failing: frozenset[int] = frozenset()
    filter: FilterSchema | None = SCHEMA
    parallel: str = "threads"
    chunk: int = 100
    accuracy: str = "exact"
    noisy: bool = True

    @property
    def epochs(self) -> Epochs:
        return Epochs(LABEL, TIMES)

    @property
    def gain(self) -> float:
        return steady_variance(self.walk) / FIX

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        """The variance does not change; it is the same in every sample."""
        if not noise:
            return SimulationResult(batch.errors * (1.0 - self.gain) ** TIMES[-1])
        count, own, gain = len(batch.errors), steady_variance(self.walk), self.gain
        drawn = [
            np.random.Generator(np.random.Philox(key=[batch.seed, int(each)])).standard_normal((int(TIMES[-1]), 2))
            for each in batch.index
        ]
        given = np.stack(drawn) * np.sqrt([WALK, FIX])
        error, history = batch.errors[:, 0], np.empty((count, len(TIMES), 1))
        records = np.zeros((count, len(TIMES), SCHEMA.width))
        nis, lag, before, lags = np.zeros(count), np.zeros(count), None, 0
        for epoch, time in enumerate(TIMES):
            for second in range(int(TIMES[epoch - 1]) if epoch else 0, int(time)):
                predicted = error + given[:, second, 0]
                whitened = (predicted - given[:, second, 1]) / math.sqrt(own + self.walk + FIX)
                error = (1.0 - gain) * predicted + gain * given[:, second, 1]
                nis = nis + whitened**2
                if before is not None:
                    lag, lags = lag + whitened * before, lags + 1
                before = whitened
            history[:, epoch, 0] = error
            place = SCHEMA.places
            records[:, epoch, place["nees"]] = (error**2 / own)[:, None]
            records[:, epoch, place["covariance"]] = own
            for name, size in (("within_1", 1.0), ("within_3", 3.0)):
                records[:, epoch, place[name]] = (np.abs(error) <= size * math.sqrt(own))[:, None]
            updates = float(time - (TIMES[epoch - 1] if epoch else time))
            rows = np.stack([nis, np.full(count, updates), np.zeros(count), lag, np.full(count, float(lags))], axis=1)
            records[:, epoch, place["sensor:fix"]] = rows
            nis, lag, lags = np.zeros(count), np.zeros(count), 0
        values = history[:, -1].copy()
        lost = [row for row, index in enumerate(batch.index) if int(index) in self.failing]
        values[lost] = history[lost] = records[lost] = np.nan
        failures = {row: Failure(Reason.STATED, "the filter diverged") for row in lost}
        return SimulationResult(values, failures, 0, values, history, None if self.filter is None else records)


@dataclass(frozen=True)
class ScalarFilter(PlainScenario):
    """The scenario."""

    walk: float = 0.25
    failing: frozenset[int] = frozenset()
    schema: FilterSchema | None = SCHEMA

    sources: ClassVar = (Source("initial", "m", "m", 1.0),)
    outputs: ClassVar = (Output("position", "m", "m"),)
    processes: ClassVar = (Output("walk", "m/sqrt(s)", "m/sqrt(s)"), Output("fix_noise", "m", "m"))
    engines: ClassVar = ("exact",)
    parts: ClassVar = TimelineParts("epochs", noise=True, filter=True)

    @property
    def filter_schema(self) -> FilterSchema | None:
        return self.schema

    @property
    def _engine(self) -> FilterThatBelieves:
        return FilterThatBelieves(self.walk, self.failing, self.schema)

    @property
    def initial_sigma(self) -> float:
        """Of the steady state."""
        return math.sqrt(true_variance(self._engine.gain))

    def engine(self, engine: str, probes: Array) -> Engine:
        return self._engine

    def linear(self, times: Array | None = None) -> LinearSystem:
        return self.linear_over_time()

    def nominal(self) -> History:
        return History({LABEL: TIMES})

    def linear_over_time(self, count: int | None = None) -> LinearSystem:
        gain = self._engine.gain
        kept = (1.0 - gain) ** (2.0 * TIMES)
        added = (1.0 - kept) / (1.0 - (1.0 - gain) ** 2)
        processes = {"walk": (1.0 - gain) ** 2 * WALK * added, "fix_noise": gain**2 * FIX * added}
        partials = ((1.0 - gain) ** TIMES)[:, None, None]
        noise = {name: each[:, None, None] for name, each in processes.items()}
        return LinearSystem(TIMES, partials, np.zeros((len(TIMES), 1)), noise, label=LABEL)

    def filter_prediction(self) -> FilterPrediction:
        own, count = steady_variance(self.walk), len(TIMES)
        believed = {"walk": self.walk / WALK, "initial": own / self.initial_sigma**2}
        return FilterPrediction(
            LABEL,
            TIMES,
            np.full((count, 1, 1), own),
            np.empty((count, 0)),
            np.empty((count, 0, 1)),
            believed=believed,
        )


def campaign(samples: int, walk: float = 0.25, seed: int = 3, **changes: Any) -> Campaign:
    """A campaign of the scalar filter in the place of another scenario; ``filtered`` is whether it has a record."""
    failing = frozenset(changes.pop("failing", ()))
    schema = SCHEMA if changes.pop("filtered", True) else None
    entries: Mapping[str, Any] = {
        "samples": samples,
        "seed": seed,
        "scenario": {"type": "reentry", "trajectory": 1},
        "errors": {"range": "1 m"},
        **changes,
    }
    scenario = ScalarFilter(walk, failing, schema)
    errors = ErrorModel(["initial"], {"initial": Normal(scenario.initial_sigma)})
    return replace(parse_campaign(entries, "test.toml", "test"), scenario=scenario, errors=errors)
