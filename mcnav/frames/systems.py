"""What can be simulated from Python, as one thing: a function, an object with ``propagate`` or ``fly``, a scenario."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mcnav.arrays.types import Array
from mcnav.config.campaign import Campaign
from mcnav.config.documents import Described, Description
from mcnav.contract.members import ready_engine
from mcnav.contract.quantities import Output
from mcnav.contract.scenario import Scenario, ScenarioError
from mcnav.errors import suggestion
from mcnav.execution.threads import one_thread
from mcnav.frames.function_system import FunctionSystem, outputs_of
from mcnav.frames.given import class_of, needs_scenario, remedy_for, scenario_of
from mcnav.frames.scenario_system import ScenarioSystem
from mcnav.frames.system import System
from mcnav.physics.units import UnitError, conversion
from mcnav.sampler.errors import Errors
from mcnav.systems.guard import CodeMisbehaved
from mcnav.systems.registry import SCENARIO_TYPES

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
        drawn, expected = ("as a pure number" if written == "1" else f"in {written}" for written in (unit, own))
        raise ValueError(f"{name} is drawn {drawn}; the system has it {expected}") from None


def _system_of(
    given: Simulatable,
    sources: Sequence[str],
    probes: Array,
    outputs: str | Sequence[str | Output],
    errors: Errors | None,
) -> System:
    if isinstance(given, str) and given in SCENARIO_TYPES:
        given = {"type": given}
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
    return FunctionSystem(given, tuple(sources), outputs_of(given, probes, outputs))


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
