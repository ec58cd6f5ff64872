"""Members that the protocols of the contract ask for, and what an object lacks of them."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from functools import cache, cached_property
from typing import Any, Final, Protocol
from weakref import WeakKeyDictionary

from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine, HistoryEngine, ScalableEngine
from mcnav.contract.scenario import (
    Capability,
    CovarianceScenario,
    GatedScenario,
    RecordingScenario,
    Replayable,
    Scenario,
    ScenarioError,
)

PROTOCOLS: Final[Mapping[Capability, type]] = {
    Capability.COVARIANCE: CovarianceScenario,
    Capability.GATES: GatedScenario,
    Capability.REPLAY: Replayable,
    Capability.TRAJECTORY: RecordingScenario,
}
"""Protocols of scenarios with some capabilities."""


@cache
def members(protocol: type) -> Mapping[str, Any]:
    """Return the members of a protocol by name, with those of the protocols that it extends.

    >>> sorted(members(Engine))
    ['accuracy', 'chunk', 'epochs', 'filter', 'noisy', 'parallel', 'simulate']
    """
    protocols = [base for base in protocol.__mro__ if getattr(base, "_is_protocol", False) and base is not Protocol]
    return {
        name: member
        for protocol in reversed(protocols)
        for name, member in vars(protocol).items()
        if not name.startswith("_")
    }


def lacks(instance: object, protocol: type) -> list[str]:
    """Return what an object lacks of a protocol, a line for each member; no property is computed.

    A class is looked at once for all objects that have the same attributes and no method of their own, because a sweep
    reads its campaign some hundred times.
    """
    wanted = members(protocol)
    own = frozenset(wanted.keys() & getattr(instance, "__dict__", {}).keys())
    if any(inspect.isfunction(wanted[name]) for name in own):
        return _lines(instance, protocol)
    known = _KNOWN.setdefault(type(instance), {})
    if (protocol, own) not in known:
        known[protocol, own] = _lines(instance, protocol)
    return known[protocol, own]


_KNOWN: Final[WeakKeyDictionary[type, dict[tuple[type, frozenset[str]], list[str]]]] = WeakKeyDictionary()
"""What objects of a class lack, by protocol and by the members that are attributes of the object."""


def _lines(instance: object, protocol: type) -> list[str]:
    kind = type(instance)
    given = {**dict(inspect.getmembers_static(kind)), **getattr(instance, "__dict__", {})}
    lines = []
    for name, wanted in members(protocol).items():
        if name not in given:
            lines.append(f"{kind.__name__} lacks {name}: {_meaning(wanted)}")
        elif wrong := _wrong_parameters(instance, name, given[name], wanted):
            lines.append(f"{kind.__name__}.{name} {wrong}")
    return lines


def lacks_scenario(scenario: Scenario) -> list[str]:
    """Return what a scenario lacks of `Scenario`, and of what it says that it can, a line for each member."""
    lines = list(lacks(scenario, Scenario))
    for capability, protocol in PROTOCOLS.items() if not lines else ():
        if capability in scenario.can:
            lines += lacks(scenario, protocol)
    return list(dict.fromkeys(lines))


def lacks_engine(engine: Engine) -> list[str]:
    """Return what an engine lacks of `Engine`, and of what it has a member of besides, a line for each member."""
    further = {"histories": HistoryEngine, "with_noise": ScalableEngine}
    asked = [Engine, *(protocol for member, protocol in further.items() if hasattr(engine, member))]
    return list(dict.fromkeys(line for protocol in asked for line in lacks(engine, protocol)))


def ready_engine(scenario: Scenario, engine: str, probes: Array) -> Engine:
    """Prepare an engine of a scenario; see `Scenario.engine`.

    Raises `ScenarioError` when the engine lacks a member of the contract.
    """
    ready = scenario.engine(engine, probes)
    if lines := lacks_engine(ready):
        raise ScenarioError("type", f"its engine {engine!r} is not complete: {'; '.join(lines)}")
    return ready


def _meaning(member: Any) -> str:
    text = inspect.getdoc(member.fget if isinstance(member, property) else member) or ""
    return " ".join(text.partition("\n\n")[0].split()).removesuffix(".")


def _wrong_parameters(instance: object, name: str, static: Any, wanted: Any) -> str:
    """Return what is wrong with the parameters of a method; nothing if it can be called as the contract does."""
    if not inspect.isfunction(wanted) or isinstance(static, property | cached_property):
        return ""
    given = getattr(instance, name)
    if not callable(given):
        return "must be a method"
    needed, optional = _parameters(wanted)
    try:
        signature = inspect.signature(given)
        if any(parameter.kind is parameter.VAR_POSITIONAL for parameter in signature.parameters.values()):
            return ""  # it hands on whatever it gets
        signature.bind(*needed, **dict.fromkeys(optional))
    except TypeError:
        return f"must have the parameters ({', '.join((*needed, *(f'{name}=…' for name in optional)))})"
    except ValueError:  # a method of C, whose parameters are not known
        return ""
    return ""


@cache
def _parameters(wanted: Callable[..., Any]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of a method's parameters, those without a default and those with one."""
    _, *asked = inspect.signature(wanted).parameters.values()
    return (
        tuple(parameter.name for parameter in asked if parameter.default is parameter.empty),
        tuple(parameter.name for parameter in asked if parameter.default is not parameter.empty),
    )
