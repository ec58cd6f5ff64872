"""What can be simulated from Python, as one thing: a function, an object with ``propagate`` or ``fly``, a scenario."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np

from mcnav._threads import one_thread
from mcnav._types import Array
from mcnav.config.campaign import Campaign
from mcnav.config.documents import Described, Description
from mcnav.contract.engine import Engine, without_noise
from mcnav.contract.failure import Failure, Reason
from mcnav.contract.linear import LinearModel
from mcnav.contract.members import ready_engine
from mcnav.contract.quantities import Output
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.contract.scenario import Scenario, ScenarioError
from mcnav.errors import suggestion
from mcnav.frames.given import class_of, needs_scenario, remedy_for, scenario_of
from mcnav.linear.partials import partials_by_differences
from mcnav.runner.chunks import simulate_batch
from mcnav.sampler.errors import Errors
from mcnav.systems.finite_differences import SHORT, DifferencedModel, differentiate
from mcnav.systems.guard import TRYING, CodeMisbehaved, call_user, in_user_code, raised_by, simulating
from mcnav.systems.sample_loop import simulate_alone, simulate_each
from mcnav.systems.user.returned import numbers_of
from mcnav.systems.user.scenario import is_users
from mcnav.units import UnitError, conversion

PROBES: Final = 10
"""Samples with which a function is called to find out what it returns."""

KINK: Final = 0.01
"""Jump of a slope at no errors, as a share of the largest, that is a kink: curvature as large as the linear effect of
one sigma is taken for one of a thousandth."""

ROUNDING: Final = 1e-12
"""Share of the largest sigma below which an output's change is rounding."""

CHUNK: Final = 8_192
"""Samples that a function is given at once: part of the system, so that results do not depend on workers."""

ONE_BY_ONE: Final = 128
"""Samples of a chunk where each is simulated by itself."""


@dataclass(frozen=True)
class Linearized:
    """Partials and nominal outputs, an estimate of the partials' error, covariances that processes of noise add.

    The error is the largest difference from other steps, or from another method, as a share of the largest
    contribution of one sigma in its row.
    """

    model: LinearModel
    error: float
    processes: Mapping[str, Array]


class System(Protocol):
    """A system with named sources and outputs."""

    @property
    def sources(self) -> tuple[str, ...]:
        """Error sources, in the order of the columns of errors."""

    @property
    def chunk(self) -> int:
        """Samples that are simulated at once: part of the system, never of the number of workers."""

    @property
    def backend(self) -> str:
        """Workers of joblib that it needs: ``loky`` for processes, ``threading`` for threads."""

    @property
    def outputs(self) -> tuple[Output, ...]:
        """Outputs, in the order of the columns of results."""

    def simulate(self, batch: Batch) -> SimulationResult:
        """Simulate samples whose errors have the order of `sources`, SI."""

    @property
    def units(self) -> Mapping[str, str]:
        """SI unit of each source, where it is known."""

    def linearize(self, sizes: Array) -> Linearized:
        """Linearize about no errors, with one sigma of each source, shape (sources,), SI."""


@dataclass(frozen=True)
class FunctionSystem:
    """A function of errors, shape (n, sources) to (n, outputs), or of the errors of one sample.

    Attributes
    ----------
    one_by_one : bool
        Whether it takes one sample, shape (sources,) to (outputs,).
    """

    function: Callable[[Any], Any]
    sources: tuple[str, ...]
    outputs: tuple[Output, ...]
    one_by_one: bool = False
    backend: str = "loky"
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def chunk(self) -> int:
        """See `System`."""
        return ONE_BY_ONE if self.one_by_one else CHUNK

    def simulate(self, batch: Batch) -> SimulationResult:
        """See `System`."""
        with in_user_code("the function", simulating(batch, noise=True)):
            return self._simulate(batch.errors, len(self.outputs))

    def _simulate(self, errors: Array, width: int) -> SimulationResult:
        if not self.one_by_one:
            try:
                return _result(self._call(errors), (len(errors), width))
            except (MemoryError, OutputsError):
                raise
            except Exception as failure:
                warn_repeated(raised_by(failure))
                one = lambda row: _result(self._call(errors[row : row + 1]), (1, width))  # noqa: E731
                return simulate_alone(one, len(errors), width)
        values = np.empty((len(errors), width))
        failures = simulate_each(lambda row: _row(self._call(errors[row]), width), range(len(errors)), values)
        return SimulationResult(values, failures)

    def _call(self, errors: Array) -> Any:
        return call_user(self.function, errors.copy())

    def linearize(self, sizes: Array) -> Linearized:
        """See `System`; by central differences."""
        differences = differentiate(lambda errors: self.simulate(batch_of(errors)), sizes)
        return Linearized(differences.model, _error_of(differences), {})


def _error_of(differences: DifferencedModel) -> float:
    """Return the error of differences: between steps, or the jump of a slope at no errors, where there is a kink.

    Central differences see nothing of a kink, which moves an output to the same side both ways by a share `SHORT` of
    its effect; curvature does so by the square of it.
    """
    largest = np.maximum(
        np.nan_to_num(np.abs(differences.contributions)).max(axis=(0, 1)), differences.moved.max(axis=0)
    )
    jump = float((differences.uneven.max(axis=0) / np.where(largest > 0.0, SHORT * largest, np.inf)).max(initial=0.0))
    return max(differences.error, min(jump, 1.0) if jump > KINK else 0.0)


def warn_repeated(failure: BaseException) -> None:
    """Warn once that a call with many samples failed, and that each is simulated by itself."""
    words = " ".join(f"{type(failure).__name__}: {failure}".split())
    warnings.warn(f"a call with many samples failed ({words:.200}); each sample is simulated by itself", stacklevel=2)


def batch_of(errors: Array, seed: int = 0) -> Batch:
    """Return samples with the indices 0, 1, …"""
    return Batch(np.arange(len(errors)), errors, seed)


class OutputsError(ValueError):
    """Mistake of a function that does not return a row of numbers for each sample. No single sample causes it."""


def _numbers(returned: Any) -> Array:
    """Return what a function returned as an array of its own; `OutputsError` when these are no real numbers."""
    try:
        return numbers_of(returned.to_numpy() if hasattr(returned, "to_numpy") else returned, "the function")
    except ValueError as wrong:
        raise OutputsError(str(wrong)) from None


def _result(returned: Any, shape: tuple[int, int]) -> SimulationResult:
    """Check what a function returned for many samples; `OutputsError` for another shape."""
    if isinstance(returned, SimulationResult):
        return returned
    values = _numbers(returned)
    values = values[:, None] if values.ndim == 1 and shape[1] == 1 else values
    if values.shape != shape:
        raise OutputsError(
            f"the function must return shape {shape}, a row a sample and a column an output; got shape {values.shape}"
        )
    lost = np.flatnonzero(~np.isfinite(values).all(axis=1))
    values[lost] = np.nan
    return SimulationResult(values, {int(row): Failure.of(Reason.NOT_FINITE) for row in lost})


def _row(returned: Any, width: int) -> Array:
    values = np.atleast_1d(_numbers(returned))
    if values.shape != (width,):
        raise ValueError(f"fly must return shape {(width,)}; got {values.shape}")
    return values


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
            return _error_of(self.scenario.differences)
        differences = partials_by_differences(without_noise(self.engine), sizes)
        largest = np.abs(partials * sizes).max(axis=1, keepdims=True)
        moved = largest > ROUNDING * sizes.max(initial=0.0)
        shares = np.abs(differences - partials) * sizes / np.where(moved, largest, np.inf)
        return float(shares.max())


Simulatable = Description | Callable[[Any], Any] | type | Any
"""What can be simulated: a function, a class or object with ``propagate`` or ``fly``, a scenario, a campaign."""


def system_of(
    given: Simulatable,
    sources: Mapping[str, str],
    probes: Array,
    outputs: str | Sequence[str | Output] = (),
    errors: Errors | None = None,
) -> System:
    """Return what is given as a system.

    Parameters
    ----------
    sources : mapping of str to str
        Error sources of the columns of ``probes``, and their units where these are known; a function takes them in
        this order.
    probes : ndarray, shape (n, sources)
        Some errors, SI: a function that declares no outputs is called with them one by one until it returns some.
    outputs : str, or sequence of str or Output, optional
        Names of what a function returns.
    errors : Errors, optional
        What a filter believes where its campaign has no errors.

    Raises
    ------
    TypeError, ValueError, CampaignError
        When it is no system, has no such sources, or has them in another unit.
    """
    try:
        system = _system_of(given, tuple(sources), probes, outputs, errors)
    except CodeMisbehaved as wrong:
        raise ValueError(str(wrong)) from None
    for name, unit in sources.items():
        _check_unit(name, unit, system.units.get(name, ""))
    return system


def _check_unit(name: str, unit: str, own: str) -> None:
    """Raise `ValueError` when an error source is drawn in another unit than the system has it."""
    if not unit or not own:
        return
    try:
        conversion(unit, own)
    except UnitError:
        drawn, expected = ("as a pure number" if each == "1" else f"in {each}" for each in (unit, own))
        raise ValueError(f"{name} is drawn {drawn}; the system has it {expected}") from None


def _system_of(
    given: Simulatable,
    sources: Sequence[str],
    probes: Array,
    outputs: str | Sequence[str | Output],
    errors: Errors | None,
) -> System:
    if isinstance(given, Mapping) and "scenario" not in given and "type" in given:
        given = {"scenario": given}
    if not isinstance(given, type) and needs_scenario(given):
        given = class_of(given)
    if isinstance(given, (type, str, Path, Mapping, Campaign, Described)):
        try:
            return _scenario_system(scenario_of(given, errors), sources, probes)
        except ScenarioError as wrong:
            raise ValueError(f"{wrong}{remedy_for(given)}") from None
    for method, one_by_one in (("propagate", False), ("fly", True)):
        own: Any = given
        if hasattr(own, method):
            declared = tuple(source.name for source in own.sources)
            function = _InOrder(getattr(own, method), _places(sources, declared), len(declared))
            units = {source.name: source.unit for source in own.sources}
            return FunctionSystem(function, tuple(sources), tuple(own.outputs), one_by_one, units=units)
    if not callable(given):
        raise TypeError(
            f"got {type(given).__name__}; expected a function, an object with propagate or fly, or a campaign"
        )
    return FunctionSystem(given, tuple(sources), _outputs_of(given, probes, outputs))


def _scenario_system(scenario: Scenario, sources: Sequence[str], probes: Array) -> ScenarioSystem:
    names = [source.name for source in scenario.sources]
    placed = np.zeros((len(probes), len(names)))
    placed[:, _places(sources, names)] = probes
    with one_thread():
        return ScenarioSystem(scenario, ready_engine(scenario, scenario.engines[0], placed))


def _places(sources: Sequence[str], declared: Sequence[str]) -> list[int]:
    """Return the numbers of some sources among the declared ones; `ValueError` for one that is not declared."""
    for name in sources:
        if name not in declared:
            raise ValueError(f"the system has no error source {name!r}{suggestion(name, list(declared))}")
    return [list(declared).index(name) for name in sources]


@dataclass(frozen=True)
class _InOrder:
    """A method of an object, given errors in another order than it declares; those that are left out are zero."""

    method: Callable[[Any], Any]
    places: Sequence[int]
    count: int

    def __call__(self, errors: Array) -> Any:
        placed = np.zeros((*errors.shape[:-1], self.count))
        placed[..., self.places] = errors
        return self.method(placed)


def _outputs_of(
    function: Callable[[Any], Any], probes: Array, named: str | Sequence[str | Output]
) -> tuple[Output, ...]:
    """Find the names and number of a function's outputs: as given, as it declares, of a frame, or y1, y2, …"""
    stated = named or getattr(function, "outputs", ())
    stated = (stated,) if isinstance(stated, (str, Output)) else stated
    if stated:
        known = tuple(entry if isinstance(entry, Output) else Output(str(entry), "", "") for entry in stated)
        if len({output.name for output in known}) < len(known):
            raise ValueError(f"outputs must have different names; got {', '.join(output.name for output in known)}")
        return known
    reason = ""
    for row in range(min(len(probes), PROBES)):
        try:
            with in_user_code("the function", TRYING):
                returned = call_user(function, probes[row : row + 1].copy())
        except CodeMisbehaved:
            raise
        except Exception as failure:
            raised = raised_by(failure)
            reason = f"{type(raised).__name__}: {raised}"
            continue
        if hasattr(returned, "columns"):
            return tuple(Output(str(name), "", "") for name in returned.columns)
        width = np.atleast_2d(_numbers(returned)).shape[-1]
        return tuple(Output(f"y{number + 1}", "", "") for number in range(width))
    raise ValueError(
        f"the function failed for each of the first {min(len(probes), PROBES)} samples: {reason:.200}; it is given "
        f"errors of shape (n, {probes.shape[1]}), a row a sample"
    )
