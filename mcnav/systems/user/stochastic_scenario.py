"""User-defined scenarios with noise, with errors over time, or with a filter of their own.

See `mcnav.systems.user.scenario`.

``fly(self, errors, noise)`` of the class takes a generator, from which it draws all that is random. The linear outcome
of a sample has the same noise: by ``fly_linear(self, errors, noise)`` of the class, or by differences of ``fly`` with
its noise scaled down. The covariance of the noise is what ``noise_covariance`` of the class returns, or it is measured
from linear simulations. ``epochs`` declares instants at which errors are returned.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, Final, TypeGuard

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine
from mcnav.contract.filter_record import FilterPrediction, FilterSchema
from mcnav.contract.history import Epochs
from mcnav.contract.linear import LinearSystem
from mcnav.contract.quantities import Output
from mcnav.contract.questions import TimelineParts
from mcnav.contract.scenario import Scenario, ScenarioError, is_differenced
from mcnav.physics.units import UnitError, conversion
from mcnav.systems.finite_differences import SHARES
from mcnav.systems.guard import LINEARIZING
from mcnav.systems.sample_loop import SampleFailed, format_exception
from mcnav.systems.user.code import UserScenarioSpec
from mcnav.systems.user.kept_noise import noise_of
from mcnav.systems.user.kept_simulations import simulate_for_differences
from mcnav.systems.user.measured_noise import MeasuredNoise
from mcnav.systems.user.returned import numbers_of
from mcnav.systems.user.scenario import SINGLE_CHUNK, UserScenario
from mcnav.systems.user.settings import NAME
from mcnav.systems.user.simulated import Simulated, record_of, schema_of, spread_out
from mcnav.systems.user.stochastic_engine import StochasticUserEngine

NOISE: Final = "noise"
"""Parameter of ``fly``, and name of a process whose covariance has no name."""

MOST_EPOCHS: Final = 1_000

INDEFINITE: Final = 1e-9
"""Share of the largest eigenvalue of a correlation matrix by which rounding may make the lowest one negative."""


def user_scenario(spec: UserScenarioSpec) -> UserScenario:
    """Build the scenario of a user's class, as its members ask for.

    Raises `ScenarioError` when the class does not follow the protocol.
    """
    spec.build_current()
    if spec.gives("epochs"):
        return TimedUserScenario(spec)
    return StochasticUserScenario(spec) if _takes_noise(spec) else UserScenario(spec)


def _takes_noise(spec: UserScenarioSpec) -> bool:
    """Return whether ``fly`` of a user's object takes noise; `ScenarioError` when its code fails."""
    where, instance = f"{spec.name}.fly", spec.build().value
    return spec.ask(f"while it gave {where}", where, takes_noise, instance)


def takes_noise(instance: Any) -> bool:
    """Return whether ``fly`` has a parameter ``noise`` that has no value of its own."""
    try:
        parameter = inspect.signature(instance.fly).parameters.get(NOISE)
    except (AttributeError, TypeError, ValueError):  # no fly, or none that states its parameters
        return False
    return parameter is not None and parameter.default in (inspect.Parameter.empty, None)


class StochasticUserScenario(UserScenario):
    """A scenario made of the user's class whose ``fly`` takes noise, or gives errors over time.

    Raises
    ------
    ScenarioError
        When the class does not follow the protocol.
    """

    def __init__(self, spec: UserScenarioSpec, sizes: Array | None = None) -> None:
        super().__init__(spec, sizes)
        self._draws = _takes_noise(spec)
        if self.engines == ("vectorised",):
            message = f"{spec.name}.propagate takes errors alone; noise and epochs need fly, without a propagate"
            raise ScenarioError("type", message)
        self.engines = ("single",)
        self.epochs = self._epochs()

    @property
    def noisy(self) -> bool:
        """True where samples have noise."""
        return self._draws

    @property
    def parts(self) -> TimelineParts:
        """What is known of its timeline."""
        return TimelineParts("end", self.noisy)

    def _epochs(self) -> Epochs | None:
        return None

    @cached_property
    def _engine(self) -> StochasticUserEngine:
        accuracy = f"{self.spec.code.file}, class {self.spec.name}, one by one"
        names = tuple(output.name for output in self.outputs)
        spec = self.spec.pinned(self._object)
        return StochasticUserEngine(spec, names, self.epochs, self.noisy, self.chunk(SINGLE_CHUNK), accuracy)

    @property
    def processes(self) -> tuple[Output, ...]:
        """Processes of the noise, by name; one without a name when the class's covariance of them is wrong."""
        if not self.noisy:
            return ()
        try:
            return tuple(Output(name, "1", "1") for name in self.noise) if self.gives_noise_covariance else (_UNNAMED,)
        except ScenarioError:  # what asks whether there is noise is not told why its covariance is wrong
            return (_UNNAMED,)

    @property
    def gives_noise_covariance(self) -> bool:
        """Return whether the class provides the covariance of its noise."""
        return self.spec.gives("noise_covariance")

    @cached_property
    def noise(self) -> Mapping[str, Array]:
        """Covariance that each process of noise adds, shape (*leading_shape, outputs, outputs); none without noise.

        Raises `ScenarioError` when the class returns no covariance, or a simulation fails from which it is measured.
        """
        if not self.noisy:
            return {}
        if not self.gives_noise_covariance:
            covariance = self.measured_noise.covariance
            return {NOISE: covariance.reshape(*self.leading_shape, *covariance.shape[1:])}
        with self._object.recording(self.spec.code.file, LINEARIZING):
            covariance = self.spec.ask(LINEARIZING, "noise_covariance", lambda: self._instance.noise_covariance())
        named = covariance if isinstance(covariance, Mapping) else {NOISE: covariance}
        if not named:
            raise ScenarioError("type", "noise_covariance must name at least one process; got none")
        taken = {source.name for source in self.sources}
        for name in named:
            if not isinstance(name, str) or not NAME.fullmatch(name) or name in taken:
                message = f"noise_covariance: {name!r} is not a name of letters, digits and _, or is that of a source"
                raise ScenarioError("type", message)
        return {name: self._covariance(name, covariance) for name, covariance in named.items()}

    def _covariance(self, name: str, returned: Any) -> Array:
        """Check one covariance that the class returned."""
        shape = (*self.leading_shape, len(self.outputs), len(self.outputs))
        try:
            covariance = numbers_of(returned, "noise_covariance")
        except ValueError as wrong:
            raise ScenarioError("type", f"{wrong} of {name}") from None
        if covariance.shape != shape or not np.isfinite(covariance).all():
            message = f"noise_covariance must return finite numbers of shape {shape}; got {covariance.shape} of {name}"
            raise ScenarioError("type", message)
        sigma = np.sqrt(np.maximum(np.diagonal(covariance, axis1=-2, axis2=-1), 0.0))
        scale = np.divide(1.0, sigma, out=np.zeros_like(sigma), where=sigma > 0.0)
        correlation = covariance * scale[..., :, None] * scale[..., None, :]
        lost = np.any(covariance[sigma[..., :, None] * sigma[..., None, :] == 0.0] != 0.0)
        gap = np.abs(correlation - np.swapaxes(correlation, -1, -2)).max()
        if lost or gap > INDEFINITE or np.linalg.eigvalsh(correlation).min() < -INDEFINITE * len(self.outputs):
            raise ScenarioError("type", f"noise_covariance: that of {name} is not symmetric and positive semidefinite")
        return np.asarray(0.5 * (covariance + np.swapaxes(covariance, -1, -2)))

    @property
    def measured_noise(self) -> MeasuredNoise:
        """Covariance of the noise from linear simulations without errors, measured once and kept.

        Raises `ScenarioError` when a simulation fails.
        """
        return noise_of(self._object, self.spec, self._engine, len(self.sources))

    @property
    def own_linear(self) -> bool:
        """Return whether the class provides linear simulations, ``fly_linear``."""
        return self._engine.own_linear

    def flight(self, errors: Array, noise: np.random.Generator) -> Array:
        """Call ``fly`` for one sample, shape (m, outputs); `ScenarioError` when it fails."""
        try:
            return self._engine.flight(errors, noise)
        except Exception as failure:
            message = f"its flight without any error failed: {format_exception(failure, self.spec.code.file)}"
            raise ScenarioError("type", message) from failure

    def linear_flight(self, errors: Array, noise: np.random.Generator) -> Array:
        """Call ``fly_linear`` for one sample, shape (m, outputs); `ScenarioError` when it fails."""
        try:
            return self._engine.linear_flight(errors, noise)
        except Exception as failure:
            message = f"fly_linear: {format_exception(failure, self.spec.code.file)}"
            raise ScenarioError("type", message) from failure

    def response(self, seed: int, index: int, stream: int, *scale: float) -> Array:
        """Compute the linear response to noise by differences, shape (m, outputs); `ScenarioError` when they fail."""
        try:
            return self._engine.response(seed, index, stream, *scale)
        except Exception as failure:
            message = f"with its noise scaled down: {format_exception(failure, self.spec.code.file)}"
            raise ScenarioError("type", message) from failure

    def linear(self, times: Array | None = None) -> LinearSystem:
        """Return the linear system at the end, with the covariance of the noise; see `UserScenario.linear`."""
        model, size = super().linear(times).end, len(self.outputs)
        noise = {name: covariance.reshape(-1, size, size)[-1] for name, covariance in self.noise.items()}
        return LinearSystem.at_end(model.partials, model.nominal, noise)

    def engine(self, engine: str, probes: Array) -> Engine:
        """Return the only engine; see `UserScenario.engine`."""
        model = self.linear().end
        spec = self.spec.pinned(self._object)
        return replace(self._engine, spec=spec, accuracy=self.accuracy, linear=replace(model, processes={}))

    @property
    def accuracy(self) -> str:
        """Describe how samples are simulated and linearized."""
        if not self.noisy:
            return super().accuracy
        twins = "by fly_linear" if self.own_linear else "by differences of fly with its noise scaled down"
        covariance = "the class's own" if self.gives_noise_covariance else str(self.measured_noise)
        return f"{super().accuracy}; linear outcomes {twins}; covariance of the noise {covariance}"


_UNNAMED: Final = Output(NOISE, "1", "1")


class TimedUserScenario(StochasticUserScenario):
    """A scenario made of the user's class that declares ``epochs``: ``fly`` returns errors at each of them.

    With ``Simulated`` in place of an array it returns the covariance and the innovations of a filter as well.
    """

    epochs: Epochs

    @property
    def parts(self) -> TimelineParts:
        """What is known of its timeline."""
        return TimelineParts("epochs", self.noisy, filter=True)

    def _epochs(self) -> Epochs:
        """Read the class's epochs: `Epochs`, or times in seconds."""
        given = self.spec.member("epochs")
        given = self.spec.ask(f"while it gave {self.spec.name}.epochs", "epochs", given) if callable(given) else given
        try:
            epochs = given if isinstance(given, Epochs) else Epochs("time [s]", given)
            times = numbers_of(epochs.times, "epochs")
            events = {str(name): float(time) for name, time in epochs.events.items()}
        except Exception as failure:
            raise ScenarioError("type", f"epochs: {format_exception(failure, self.spec.code.file)}") from failure
        rising = times.ndim == 1 and np.isfinite(times).all() and bool(np.all(np.diff(times) > 0.0))
        if not rising or not 2 <= len(times) <= MOST_EPOCHS or not str(epochs.label).strip():
            message = f"{self.spec.name}.epochs must be Epochs of mcnav with 2 to {MOST_EPOCHS:,} rising times"
            raise ScenarioError("type", message)
        return Epochs(str(epochs.label), times, events)

    @cached_property
    def _second(self) -> float | None:
        """Seconds in the unit of the epochs' label, such as ``time [min]``; none when it is no time."""
        unit = re.search(r"\[([^\]]+)\]\s*$", self.epochs.label)
        try:
            return conversion(unit[1], "s") if unit else None
        except UnitError:
            return None

    @property
    def reading_times(self) -> Array:
        """The epochs, s; none where they are no times."""
        return np.zeros(0) if self._second is None else np.asarray(self.epochs.times * self._second)

    @property
    def leading_shape(self) -> tuple[int, ...]:
        """Return the axis of epochs."""
        return self.epochs.times.shape

    @cached_property
    def _partials_over_time(self) -> Array:
        """Partial derivatives at every epoch, shape (m, outputs, sources).

        Differences have the steps that were chosen for the errors at the end. Raises `ScenarioError` when a simulation
        fails.
        """
        if self.own_partials:
            return self.given_partials
        steps = np.array(SHARES)[self.differences.chosen + 1] * self.sizes
        errors = np.concatenate([np.diag(steps), -np.diag(steps)])
        result, over_time = simulate_for_differences(
            self._object, self.spec, self._engine.without_noise, errors, together=False
        )
        for failure in result.failures.values():
            raise ScenarioError("type", f"a flight for the partial derivatives failed: {failure}")
        forward, backward = np.split(over_time, 2)
        return np.asarray(((forward - backward) / (2.0 * steps[:, None, None])).transpose(1, 2, 0))

    def linear_over_time(self, count: int | None = None) -> LinearSystem:
        """Return the linear system at all epochs, or at so many, evenly chosen."""
        last = len(self.epochs.times) - 1
        chosen = np.unique(np.linspace(0, last, min(count or last + 1, last + 1)).round().astype(int))
        processes = {name: covariance[chosen] for name, covariance in self.noise.items()}
        times, partials = self.epochs.times[chosen], self._partials_over_time[chosen]
        nominal = np.asarray(self._nominal.errors, dtype=float).reshape(len(self.epochs.times), -1)[chosen]
        return LinearSystem(times, partials, nominal, processes, label=self.epochs.label)

    @property
    def groups(self) -> Mapping[str, tuple[str, ...]]:
        """Return the class's groups of outputs; `ScenarioError` when they are no table."""
        given = self.spec.member("groups", {})
        try:
            return {name: tuple(members) for name, members in given.items()}
        except (AttributeError, TypeError):
            message = f"{self.spec.name}.groups must list outputs for each name; got {given!r:.80}"
            raise ScenarioError("type", message) from None

    @property
    def filter_outputs(self) -> tuple[str, ...]:
        """Return the outputs of which the class's filter states a covariance, by default all navigation errors.

        Raises `ScenarioError` when they are not outputs of the class.
        """
        names = tuple(output.name for output in self.outputs)
        given = self.spec.member("filter_outputs")
        if given is None:
            return tuple(output.name for output in self.outputs if output.of == "navigation")
        listed = () if isinstance(given, str) else tuple(given)
        if not listed or not set(listed) <= set(names) or len(set(listed)) < len(listed):
            message = f"{self.spec.name}.filter_outputs must list outputs, each once; got {given!r:.80}"
            raise ScenarioError("type", message)
        return tuple(name for name in names if name in listed)

    @property
    def believed(self) -> Mapping[str, float]:
        """Return the class's shares of variances that its filter believes in; `ScenarioError` when they are wrong."""
        given = self.spec.member("believed", {})
        known = {source.name for source in self.sources} | self.noise.keys()
        try:
            shares = {name: float(share) for name, share in given.items()}
        except (AttributeError, TypeError, ValueError):
            shares = {"": np.nan}
        if not shares.keys() <= known or not all(0.0 <= share < np.inf for share in shares.values()):
            message = "must give a share of variance, from zero on, for names of sources and processes"
            raise ScenarioError("type", f"{self.spec.name}.believed {message}; got {given!r:.80}")
        return shares

    @cached_property
    def _nominal(self) -> Simulated:
        with self._object.recording(self.spec.code.file, LINEARIZING):
            try:
                return self._engine.nominal()
            except Exception as failure:
                message = f"its flight without any error failed: {format_exception(failure, self.spec.code.file)}"
                raise ScenarioError("type", message) from failure

    @cached_property
    def filter_schema(self) -> FilterSchema | None:
        """Columns of the records of the class's filter; none when ``fly`` returns errors alone.

        Raises `ScenarioError` when the record without errors and noise cannot be made.
        """
        names, groups = self._engine.outputs, self.groups
        try:
            schema = schema_of(self._nominal, names, groups, self.filter_outputs)
            if schema is not None:
                record_of(self._nominal, schema, self.epochs, names, groups)
        except (SampleFailed, ValueError, TypeError) as wrong:
            raise ScenarioError("type", f"its flight without any error: {wrong}") from None
        return schema

    def filter_prediction(self) -> FilterPrediction | None:
        """Return the filter's covariance along the flight without errors and noise; none when there is no filter."""
        schema = self.filter_schema
        if schema is None:
            return None
        times = self.epochs.times
        return FilterPrediction(
            label=self.epochs.label,
            times=times,
            covariance=spread_out(np.array(self._nominal.covariance, dtype=float), schema.known, schema.outputs),
            state_variance=np.zeros((len(times), 0)),
            state_partials=np.zeros((len(times), 0, len(self.sources))),
            state_processes={name: np.zeros((len(times), 0)) for name in self.noise},
            believed=self.believed,
        )

    def engine(self, engine: str, probes: Array) -> Engine:
        """Return the only engine; see `UserScenario.engine`."""
        prepared = super().engine(engine, probes)
        assert isinstance(prepared, StochasticUserEngine)
        return replace(prepared, filter=self.filter_schema, groups=self.groups)


def is_users_with_noise(scenario: Scenario) -> TypeGuard[StochasticUserScenario]:
    """Return whether a scenario is made of a user's class with noise."""
    return is_differenced(scenario) and scenario.parts.noise
