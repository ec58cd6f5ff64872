"""Methods and functions of the user's, called with the arguments that they name."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mcnav.contract.scenario import ScenarioError
from mcnav.systems.guard import call_user

Frame = Mapping[str, Callable[[], Any]]
"""Arguments by name, each made when a method names it."""


def made_once(frame: Frame) -> Frame:
    """Return a frame whose arguments are made once, for all methods that name them."""
    return {name: _once(make) for name, make in frame.items()}


def _once(make: Callable[[], Any]) -> Callable[[], Any]:
    made: list[Any] = []  # functools.cache takes ten times as long for a function that is called a few times

    def give() -> Any:
        if not made:
            made.append(make())
        return made[0]

    return give


@dataclass(frozen=True)
class Method:
    """A method or function, and the arguments that it names."""

    function: Callable[..., Any]
    names: tuple[str, ...]
    where: str

    def __call__(self, frame: Frame) -> Any:
        """Call it with what it names."""
        return call_user(self.function, **{name: frame[name]() for name in self.names})


def read_method(function: Any, where: str, known: Sequence[str], other: str = "") -> Method:
    """Read the arguments that a function names; `ScenarioError` when it names one that there is not.

    Parameters
    ----------
    known : sequence of str
        Arguments that it may name.
    other : str
        One of these that it may call as it likes.
    """
    if not callable(function):
        raise ScenarioError("type", f"{where} must be a function; got {function!r:.80}")
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        raise ScenarioError("type", f"{where} must be a function that states its arguments") from None
    required = [
        parameter for parameter in parameters if parameter.default is inspect.Parameter.empty or parameter.name in known
    ]
    names = tuple(parameter.name for parameter in required)
    unknown = [name for name in names if name not in known]
    if other and len(unknown) == 1 and other not in names:
        renamed, given = unknown[0], function
        names = tuple(other if name == renamed else name for name in names)

        def function(**values: Any) -> Any:
            return given(**{renamed if name == other else name: value for name, value in values.items()})

        unknown = []
    positional = all(
        parameter.kind in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY) for parameter in required
    )
    if unknown or not positional:
        expected = f"it may name {', '.join(known)}"
        raise ScenarioError("type", f"{where} asks for {', '.join(unknown) or 'unnamed arguments'}; {expected}")
    return Method(function, names, where)
