"""Engine of a user-defined scenario: calls ``propagate`` or ``fly`` of the user's class."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.failure import Failure, Reason
from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.history import Epochs
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.systems.guard import call_user, simulating
from mcnav.systems.sample_loop import simulate_alone, simulate_each
from mcnav.systems.timeouts import SampleTimeout, within_limit
from mcnav.systems.user.code import UserScenarioSpec
from mcnav.systems.user.returned import numbers_of


@dataclass(frozen=True)
class UserEngine:
    """Engine of the user's class; it is sent to workers as the text of the file."""

    spec: UserScenarioSpec
    outputs: int
    parallel: str
    chunk: int
    accuracy: str
    epochs: Epochs | None = None
    noisy: bool = False
    filter: FilterSchema | None = None

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        """Simulate samples."""
        with self.spec.running(simulating(batch, noise)):
            return self._simulate(batch.errors)

    def _simulate(self, errors: Array) -> SimulationResult:
        instance, file = self.spec.build().value, self.spec.code.file
        if not hasattr(instance, "propagate"):
            values = np.empty((len(errors), self.outputs))
            failures = simulate_each(
                lambda row: _check_row(call_user(instance.fly, errors[row].copy()), self.outputs),
                range(len(errors)), values, file=file,
            )  # fmt: skip
            return SimulationResult(values, failures)

        def propagate(errors: Array) -> SimulationResult:
            return self._result(call_user(instance.propagate, errors), len(errors))

        try:
            return within_limit(lambda: propagate(errors.copy()))
        except MemoryError:
            raise
        except (Exception, SampleTimeout):
            rows = len(errors)
            alone = simulate_alone(lambda row: propagate(errors[row : row + 1].copy()), rows, self.outputs, file)
            return replace(alone, fallback_count=rows if rows > 1 else 0)

    def _result(self, returned: Any, count: int) -> SimulationResult:
        """Check what ``propagate`` returned, and give every row without finite outputs a reason."""
        reasons: Mapping[int, Failure] = {}
        if isinstance(returned, SimulationResult):
            returned, reasons = returned.values, returned.failures
        values = numbers_of(returned, "propagate")
        if values.shape != (count, self.outputs):
            raise ValueError(f"propagate must return shape {(count, self.outputs)}; got {values.shape}")
        failed = np.asarray(~np.isfinite(values).all(axis=1))
        failed[list(reasons)] = True
        values[failed] = np.nan
        failures = {int(row): Failure.of(reasons.get(int(row), Reason.NOT_FINITE)) for row in np.flatnonzero(failed)}
        return SimulationResult(values, failures)


def _check_row(returned: Any, outputs: int) -> Array:
    values = numbers_of(returned, "fly")
    if values.shape != (outputs,):
        raise ValueError(f"fly must return shape {(outputs,)}; got {values.shape}")
    return values
