"""A scenario as a system."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine, without_noise
from mcnav.contract.linear import LinearModel
from mcnav.contract.quantities import Output
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.contract.scenario import Scenario
from mcnav.frames.function_system import error_of
from mcnav.frames.system import Linearized
from mcnav.linear.partials import partials_by_differences
from mcnav.runner.chunks import simulate_batch
from mcnav.systems.user.scenario import is_users

ROUNDING: Final = 1e-12
"""Share of the largest sigma below which an output's change is rounding."""


@dataclass(frozen=True)
class ScenarioSystem:
    """A scenario by one of its engines, the first of which is the fast one."""

    scenario: Scenario
    engine: Engine

    @property
    def sources(self) -> tuple[str, ...]:
        """See `System`."""
        return tuple(source.name for source in self.scenario.sources)

    @property
    def units(self) -> Mapping[str, str]:
        """See `System`."""
        return {source.name: source.unit for source in self.scenario.sources}

    @property
    def outputs(self) -> tuple[Output, ...]:
        """See `System`."""
        return tuple(self.scenario.outputs)

    @property
    def chunk(self) -> int:
        """See `System`."""
        return self.engine.chunk

    @property
    def backend(self) -> str:
        """See `System`."""
        return "threading" if self.engine.parallel == "threads" else "loky"

    def simulate(self, batch: Batch) -> SimulationResult:
        """See `System`."""
        return simulate_batch(self.engine, None, len(self.outputs), batch)

    def linearize(self, sizes: Array) -> Linearized:
        """See `System`; by the scenario's own equations, whose error is their difference from differences."""
        linear = self.scenario.linear().end
        error = self._error(linear.partials, np.where(sizes > 0.0, sizes, [s.nominal for s in self.scenario.sources]))
        return Linearized(LinearModel(linear.partials, linear.nominal), error, dict(linear.processes))

    def _error(self, partials: Array, sizes: Array) -> float:
        if is_users(self.scenario) and not self.scenario.own_partials:
            return error_of(self.scenario.differences)
        differences = partials_by_differences(without_noise(self.engine), sizes)
        largest = np.abs(partials * sizes).max(axis=1, keepdims=True)
        moved = largest > ROUNDING * sizes.max(initial=0.0)
        shares = np.abs(differences - partials) * sizes / np.where(moved, largest, np.inf)
        return float(shares.max())
