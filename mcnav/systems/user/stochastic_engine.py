"""Engine of a user-defined scenario with noise, with errors over time, or with a filter: calls ``fly`` of the class."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine
from mcnav.contract.failure import Failure, Reason
from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.history import Epochs
from mcnav.contract.linear import LinearModel
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.contract.scenario import ScenarioError
from mcnav.systems.conditions import Conditions
from mcnav.systems.guard import LINEARIZING, call_user, simulating
from mcnav.systems.sample_loop import SampleFailed, simulate_each
from mcnav.systems.timeouts import Result, SampleTimeout, within_limit
from mcnav.systems.user.code import UserScenarioSpec
from mcnav.systems.user.returned import numbers_of
from mcnav.systems.user.sample_noise import NORMALS, SAMPLES, GivenNoise, ScaledNoise, sample_noise
from mcnav.systems.user.simulated import Simulated, record_of

MOST_NORMALS: Final = 2_000
"""Standard normals of a sample's noise, each of which takes a flight or two to see what it adds."""

SCALE: Final = 0.01
"""Scale of the noise in differences: the third-order term, their error, falls with its square to 1e-4, and rounding or
an integrator's error grows a hundredfold."""


@dataclass(frozen=True)
class StochasticUserEngine:
    """Engine of the user's class; it is sent to workers as the text of the file.

    Attributes
    ----------
    outputs : tuple of str
        Names.
    noisy : bool
        Whether ``fly`` takes noise.
    linear : LinearModel, optional
        Linear model at the end. With it, the samples of a class with noise have linear outcomes.
    filter : FilterSchema, optional
        Columns of the records of the class's filter.
    groups : mapping of str to sequence of str
        Groups of outputs whose NEES is recorded besides that of all.
    """

    spec: UserScenarioSpec
    outputs: tuple[str, ...]
    epochs: Epochs | None
    noisy: bool
    chunk: int
    accuracy: str
    linear: LinearModel | None = None
    filter: FilterSchema | None = None
    groups: Mapping[str, Sequence[str]] = field(default_factory=dict)
    parallel: str = "processes"

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of what ``fly`` returns."""
        return (len(self.outputs),) if self.epochs is None else (len(self.epochs.times), len(self.outputs))

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        """Simulate samples, with their noise or without."""
        with self.spec.running(simulating(batch, noise)):
            if not noise:
                return self.without_noise(batch.errors)[0]
            return self.with_noise_of(batch, lambda row: sample_noise(batch.seed, int(batch.index[row])))

    def with_noise_of(self, batch: Batch, noise: Callable[[int], np.random.Generator]) -> SimulationResult:
        """Simulate samples with the noise of a generator for each row."""
        instance = self.spec.build().value
        count, outputs, times = (
            len(batch.errors),
            len(self.outputs),
            0 if self.epochs is None else len(self.epochs.times),
        )
        values = np.empty((count, outputs))
        linear = np.full((count, outputs), np.nan) if self.noisy and self.linear is not None else None
        history = np.full((count, times, outputs), np.nan) if times else None
        schema = self.filter
        records = None if schema is None else np.full((count, times, schema.width), np.nan)

        def simulate(row: int) -> Array:
            key, errors = (batch.seed, int(batch.index[row])), batch.errors[row]
            simulated = self._fly(instance, errors, noise(row))
            over_time = simulated.errors.reshape(-1, outputs)
            if not np.isfinite(over_time[-1]).all():
                raise SampleFailed(Failure.of(Reason.NOT_FINITE))
            record = None
            if schema is not None and self.epochs is not None:
                record = record_of(simulated, schema, self.epochs, self.outputs, self.groups)
            if linear is not None:
                linear[row] = self._linear_outcome(instance, errors, key)
            if history is not None:
                history[row] = over_time
            if records is not None:
                records[row] = record
            return np.asarray(over_time[-1])

        failures = simulate_each(simulate, range(count), values, file=self.spec.code.file)
        return SimulationResult(values, failures, linear_values=linear, history=history, filter_values=records)

    def without_noise(self, errors: Array) -> tuple[SimulationResult, Array]:
        """Simulate samples without noise, shape (n, sources); return their outcomes, and their errors over time.

        The latter have shape (n, m, outputs), with m = 1 where the class gives final errors alone; NaN for a sample
        that failed.
        """
        instance, outputs = self.spec.build().value, len(self.outputs)
        over_time = np.full((len(errors), 1 if self.epochs is None else len(self.epochs.times), outputs), np.nan)
        values = np.empty((len(errors), outputs))

        def simulate(row: int) -> Array:
            simulated = self._fly(instance, errors[row], ScaledNoise(0, 0, 0.0))
            over_time[row] = simulated.errors.reshape(-1, outputs)
            return np.asarray(over_time[row, -1])

        failures = simulate_each(simulate, range(len(errors)), values, file=self.spec.code.file)
        over_time[list(failures)] = np.nan
        return SimulationResult(values, failures), over_time

    def conditional_noise(self, outputs: tuple[int, ...], epochs: tuple[int, ...] | None = None) -> ConditionalFlights:
        """Return the samples with conditions on what noise adds to some outputs.

        There are none where the class draws no normals, or more than `MOST_NORMALS`: all noise is random then. Raises
        `ScenarioError` where a flight with one of them fails.
        """
        with self.spec.running(LINEARIZING):
            of_normals = self._of_normals()
        last = of_normals.shape[1] - 1
        rows = of_normals[:, [last] * len(outputs) if epochs is None else list(epochs), list(outputs)]
        return ConditionalFlights(replace(self, linear=None, filter=None), Conditions.on(rows.T))

    def _of_normals(self) -> Array:
        """Compute what each standard normal of the noise adds by the linear system, shape (Z, m, outputs).

        By ``fly_linear``, or by differences of ``fly`` about a flight without normals.
        """
        instance = self.spec.build().value
        none, fly, step = np.zeros(len(instance.sources)), self._fly_linear, 1.0
        if not self.own_linear:
            step = SCALE

            def fly(instance: Any, errors: Array, noise: np.random.Generator) -> Array:
                return np.asarray(self._fly(instance, errors, noise).errors.reshape(-1, len(self.outputs)))

        counted = GivenNoise(0, 0, np.zeros(0), 0.0)
        noiseless = fly(instance, none, counted)
        if not 0 < counted.used <= MOST_NORMALS:
            return np.zeros((0, *noiseless.shape))

        def derivative(normal: int) -> Array:
            impulse = np.append(np.zeros(normal), step)
            up = fly(instance, none, GivenNoise(0, 0, impulse, 0.0))
            down = noiseless if self.own_linear else fly(instance, none, GivenNoise(0, 0, -impulse, 0.0))
            return np.asarray((up - down) / (step if self.own_linear else 2.0 * step)).ravel()

        derivatives = np.empty((counted.used, noiseless.size))
        failures = simulate_each(derivative, range(counted.used), derivatives, file=self.spec.code.file)
        for failure in failures.values():
            raise ScenarioError("type", f"a flight with one normal of its noise failed: {failure}")
        return derivatives.reshape(counted.used, *noiseless.shape)

    def nominal(self) -> Simulated:
        """Simulate without errors and noise; what ``fly`` raises is raised."""
        instance = self.spec.build().value
        return self._once(lambda: self._fly(instance, np.zeros(len(instance.sources)), ScaledNoise(0, 0, 0.0)))

    def flight(self, errors: Array, noise: np.random.Generator) -> Array:
        """Call ``fly`` of the class with the errors of one sample, shape (sources,); return shape (m, outputs)."""
        simulated = self._once(lambda: self._fly(self.spec.build().value, errors, noise))
        return np.asarray(simulated.errors.reshape(-1, len(self.outputs)))

    def response(self, seed: int, index: int, stream: int = SAMPLES, scale: float = SCALE) -> Array:
        """Compute the linear response to a sample's noise by differences, shape (m, outputs)."""
        return self._once(lambda: self._response(self.spec.build().value, (seed, index, stream), scale))

    def linear_flight(self, errors: Array, noise: np.random.Generator) -> Array:
        """Call ``fly_linear`` of the class with the errors of one sample, shape (sources,); return shape (m, outputs).

        Raises `ValueError` when it returns something else than finite numbers of that shape.
        """
        return self._once(lambda: self._fly_linear(self.spec.build().value, errors, noise))

    def _once(self, call: Callable[[], Result]) -> Result:
        """Call a function that simulates once; `TimeoutError` when it exceeds the time limit of a sample."""
        with self.spec.running(LINEARIZING):
            try:
                return within_limit(call)
            except SampleTimeout as late:
                raise TimeoutError(str(late)) from None

    @cached_property
    def own_linear(self) -> bool:
        """Return whether the class has ``fly_linear``."""
        return self.spec.gives("fly_linear")

    def _linear_outcome(self, instance: Any, errors: Array, key: tuple[int, int]) -> Array:
        """Compute the final errors of one sample by the linear system with the same noise, shape (outputs,)."""
        assert self.linear is not None
        if self.own_linear:
            return np.asarray(self._fly_linear(instance, errors, sample_noise(*key))[-1])
        response = self._response(instance, (*key, SAMPLES), SCALE)[-1]
        return np.asarray(self.linear.nominal + self.linear.partials @ errors + response)

    def _fly_linear(self, instance: Any, errors: Array, noise: np.random.Generator) -> Array:
        values = numbers_of(call_user(instance.fly_linear, errors.copy(), noise), "fly_linear")
        if values.shape != self.shape or not np.isfinite(values).all():
            raise ValueError(f"fly_linear must return finite numbers of shape {self.shape}; got {values.shape}")
        return values.reshape(-1, len(self.outputs))

    def _response(self, instance: Any, key: tuple[int, int, int], scale: float) -> Array:
        seed, index, stream = key
        none = np.zeros(len(instance.sources))
        up, down = (
            self._fly(instance, none, ScaledNoise(seed, index, each, stream)).errors for each in (scale, -scale)
        )
        values = ((up - down) / (2.0 * scale)).reshape(-1, len(self.outputs))
        if not np.isfinite(values).all():
            raise ValueError("the linear response to the noise is not finite")
        return np.asarray(values)

    def _fly(self, instance: Any, errors: Array, noise: np.random.Generator) -> Simulated:
        """Call ``fly`` with the errors of one sample; `ValueError` when the shape of what it returns is wrong."""
        returned = call_user(instance.fly, errors.copy(), *((noise,) if self.noisy else ()))
        simulated = returned if isinstance(returned, Simulated) else Simulated(returned)
        values = numbers_of(simulated.errors, "fly")
        if values.shape != self.shape:
            raise ValueError(f"fly must return shape {self.shape}; got {values.shape}")
        return replace(simulated, errors=values)


@dataclass(frozen=True)
class ConditionalFlights:
    """Samples of the user's class with conditions on what the normals of its noise add to some outputs."""

    engine: StochasticUserEngine
    conditions: Conditions

    @property
    def factor(self) -> Array:
        """Additions of the normals to the outcomes."""
        return self.conditions.factor

    def simulate(self, batch: Batch, normals: Array) -> SimulationResult:
        """Simulate samples with these normals of their noise, shape (n, r); final errors, and those at epochs."""
        known = self.conditions.directions.shape[1]

        def noise(row: int) -> np.random.Generator:
            key = batch.seed, int(batch.index[row])
            drawn = sample_noise(*key, NORMALS).standard_normal((1, known))
            return GivenNoise(*key, self.conditions.met(drawn, normals[row : row + 1])[0])

        with self.engine.spec.running(simulating(batch, noise=True)):
            return self.engine.with_noise_of(batch, noise)


def without_linear(engine: Engine) -> Engine:
    """Return an engine of a user's class that does without its samples' linear outcomes."""
    return replace(engine, linear=None) if type(engine) is StochasticUserEngine else engine
