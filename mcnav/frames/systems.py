"""What can be simulated from Python, as one thing: a function, an object with ``propagate`` or ``fly``, a scenario."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np

from mcnav._threads import one_thread
from mcnav._types import Array
from mcnav.config.campaign import Campaign
from mcnav.config.documents import Described, Description
from mcnav.config.read import campaign_from
from mcnav.contract.engine import Engine, without_noise
from mcnav.contract.failure import Failure, Reason
from mcnav.contract.linear import LinearModel
from mcnav.contract.members import ready_engine
from mcnav.contract.quantities import Output
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.contract.scenario import Scenario
from mcnav.errors import suggestion
from mcnav.linear.partials import partials_by_differences
from mcnav.runner.chunks import simulate_batch
from mcnav.systems.closed_loop.declarations import ClosedLoop
from mcnav.systems.finite_differences import differentiate
from mcnav.systems.sample_loop import simulate_alone, simulate_each
from mcnav.systems.user.scenario import is_users
from mcnav.systems.user.stochastic_scenario import takes_noise

PROBES: Final = 10
"""Samples with which a function is called to find out what it returns."""

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

    @property
    def chunk(self) -> int:
        """See `System`."""
        return ONE_BY_ONE if self.one_by_one else CHUNK

    def simulate(self, batch: Batch) -> SimulationResult:
        """See `System`."""
        errors, width = batch.errors, len(self.outputs)
        if not self.one_by_one:
            try:
                return _result(self.function(errors.copy()), (len(errors), width))
            except MemoryError:
                raise
            except (Exception, SystemExit) as failure:
                warn_repeated(failure)
                one = lambda row: _result(self.function(errors[row : row + 1].copy()), (1, width))  # noqa: E731
                return simulate_alone(one, len(errors), width)
        values = np.empty((len(errors), width))
        failures = simulate_each(lambda row: _row(self.function(errors[row].copy()), width), range(len(errors)), values)
        return SimulationResult(values, failures)

    def linearize(self, sizes: Array) -> Linearized:
        """See `System`; by central differences."""
        differences = differentiate(lambda errors: self.simulate(batch_of(errors)), sizes)
        return Linearized(differences.model, differences.error, {})


def warn_repeated(failure: BaseException) -> None:
    """Warn once that a call with many samples failed, and that each is simulated by itself."""
    words = " ".join(f"{type(failure).__name__}: {failure}".split())
    warnings.warn(f"a call with many samples failed ({words:.200}); each sample is simulated by itself", stacklevel=2)


def batch_of(errors: Array, seed: int = 0) -> Batch:
    """Return samples with the indices 0, 1, …"""
    return Batch(np.arange(len(errors)), errors, seed)


def _result(returned: Any, shape: tuple[int, int]) -> SimulationResult:
    """Check what a function returned for many samples; `ValueError` for another shape."""
    if isinstance(returned, SimulationResult):
        return returned
    values = np.array(returned, dtype=float)
    values = values[:, None] if values.ndim == 1 and shape[1] == 1 else values
    if values.shape != shape:
        raise ValueError(f"the function must return shape {shape}; got {values.shape}")
    lost = np.flatnonzero(~np.isfinite(values).all(axis=1))
    values[lost] = np.nan
    return SimulationResult(values, {int(row): Failure.of(Reason.NOT_FINITE) for row in lost})


def _row(returned: Any, width: int) -> Array:
    values = np.atleast_1d(np.array(returned, dtype=float))
    if values.shape != (width,):
        raise ValueError(f"the function must return shape {(width,)}; got {values.shape}")
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
            return self.scenario.differences.error
        differences = partials_by_differences(without_noise(self.engine), sizes)
        largest = np.abs(partials * sizes).max(axis=1, keepdims=True)
        shares = np.abs(differences - partials) * sizes / np.where(largest > 0.0, largest, np.inf)
        return float(shares.max())


Simulatable = Description | Callable[[Any], Any] | type | Any
"""What can be simulated: a function, a class or object with ``propagate`` or ``fly``, a scenario, a campaign."""


def system_of(
    given: Simulatable, sources: Sequence[str], probes: Array, outputs: Sequence[str | Output] = ()
) -> System:
    """Return what is given as a system.

    Parameters
    ----------
    sources : sequence of str
        Error sources of the columns of ``probes``; a function takes them in this order.
    probes : ndarray, shape (n, sources)
        Some errors, SI: a function that declares no outputs is called with them one by one until it returns some.
    outputs : sequence of str or Output, optional
        Names of what a function returns.

    Raises
    ------
    TypeError, ValueError, CampaignError
        When it is no system, or has no such sources.
    """
    if isinstance(given, Mapping) and "scenario" not in given and "type" in given:
        given = {"scenario": given}
    if isinstance(given, type) or _needs_scenario(given):
        given = {"scenario": given if isinstance(given, type) else type(given)}
    if isinstance(given, (str, Path, Mapping, Campaign, Described)):
        return _scenario_system(campaign_from(given).scenario, sources, probes)
    for method, one_by_one in (("propagate", False), ("fly", True)):
        own: Any = given
        if hasattr(own, method):
            declared = tuple(source.name for source in own.sources)
            function = _InOrder(getattr(own, method), _places(sources, declared), len(declared))
            return FunctionSystem(function, tuple(sources), tuple(own.outputs), one_by_one)
    if not callable(given):
        raise TypeError(
            f"got {type(given).__name__}; expected a function, an object with propagate or fly, or a campaign"
        )
    return FunctionSystem(given, tuple(sources), _outputs_of(given, probes, outputs))


def _needs_scenario(given: Any) -> bool:
    """Return whether an object has more to it than a function of errors: noise, or a loop of its own."""
    return isinstance(given, ClosedLoop) or (hasattr(given, "fly") and takes_noise(given))


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


def _outputs_of(function: Callable[[Any], Any], probes: Array, named: Sequence[str | Output]) -> tuple[Output, ...]:
    """Find the names and number of a function's outputs: as given, as it declares, of a frame, or y1, y2, …"""
    stated = named or getattr(function, "outputs", ())
    if stated:
        return tuple(entry if isinstance(entry, Output) else Output(str(entry), "", "") for entry in stated)
    reason = ""
    for row in range(min(len(probes), PROBES)):
        try:
            returned = function(probes[row : row + 1].copy())
        except Exception as failure:
            reason = f"{type(failure).__name__}: {failure}"
            continue
        if hasattr(returned, "columns"):
            return tuple(Output(str(name), "", "") for name in returned.columns)
        width = np.atleast_2d(np.asarray(returned)).shape[-1]
        return tuple(Output(f"y{number + 1}", "", "") for number in range(width))
    raise ValueError(f"the function failed for each of the first {min(len(probes), PROBES)} samples: {reason:.200}")
