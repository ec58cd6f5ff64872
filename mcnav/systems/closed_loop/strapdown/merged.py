"""A user's object with what its navigator declares besides: one object that the loop reads."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from inspect import Parameter, Signature
from operator import is_
from typing import Any, Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.scenario import ScenarioError
from mcnav.systems.closed_loop.methods import Frame, Method, read_method
from mcnav.systems.closed_loop.quantities import Quantity, as_kept
from mcnav.systems.closed_loop.reading import OF_NAVIGATOR, OF_TRUTH
from mcnav.systems.closed_loop.strapdown.navigator import Strapdown
from mcnav.systems.ins.imu.instruments import AXES

MERGED: Final = ("truth", "estimate", "parameters", "processes")


def navigator_of(instance: Any) -> Strapdown | None:
    """Return the navigator that a user's object declares; `ScenarioError` when it is none."""
    navigator = getattr(instance, "navigator", None)
    if navigator is None or isinstance(navigator, Strapdown):
        return navigator
    raise ScenarioError("type", f"navigator must be a Strapdown of mcnav; got {navigator!r:.80}")


def with_navigator(instance: Any) -> Any:
    """Return the object itself, or with what its navigator brings."""
    navigator = navigator_of(instance)
    return instance if navigator is None else WithNavigator(instance, navigator)


class WithNavigator:
    """Declarations and methods of a user's object, with those of its navigator.

    Raises
    ------
    ScenarioError
        When ``motion`` is missing, the class has a ``sense`` of its own, or declares what the navigator brings.
    """

    def __init__(self, instance: Any, navigator: Strapdown) -> None:
        self._instance, self._navigator = instance, navigator
        self._name = type(instance).__name__
        if not callable(getattr(instance, "motion", None)):
            raise ScenarioError(
                "type",
                f"{self._name} needs a method motion(self, truth, ...), which returns force and rate in body axes",
            )
        if hasattr(instance, "sense"):
            raise ScenarioError("type", f"{self._name}.sense is the navigator's; leave it out")
        for attribute in MERGED:
            setattr(self, attribute, self._merged(attribute))
        motion = self._read("motion", OF_TRUTH)
        assert motion is not None
        self._acted: tuple[list[Any], tuple[Array, Array]] = [], (np.zeros((0, 3)), np.zeros((0, 3)))
        self._motion, self._rates, self._navigate = (
            motion, self._read("rates", OF_TRUTH), self._read("navigate", OF_NAVIGATOR),
        )  # fmt: skip
        self.rates = _naming(self._all_rates, "time", "truth", *motion.names, *_names(self._rates))
        self.sense = _naming(self._sensed, "time", "parameters", "noise", *motion.names)
        self.navigate = _naming(self._all_navigated, "estimate", "sensed", *_names(self._navigate))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.__dict__["_instance"], name)

    def _all_rates(self, frame: Frame) -> dict[str, Any]:
        """Return the derivative of the truth: of position, velocity and attitude, and what the class adds."""
        return {**self._navigator.rates(frame["truth"](), *self._acting(frame)), **_called(self._rates, frame)}

    def _sensed(self, frame: Frame) -> dict[str, Array]:
        """Return what the instruments read."""
        return self._navigator.sense(*self._acting(frame), frame["parameters"](), frame["noise"]())

    def _all_navigated(self, frame: Frame) -> dict[str, Any]:
        """Return the derivative of the estimate: the mechanization, and what the class adds."""
        return {
            **self._navigator.navigate(frame["estimate"](), frame["sensed"]()), **_called(self._navigate, frame),
        }  # fmt: skip

    def _acting(self, frame: Frame) -> tuple[Array, Array]:
        """Return specific force and angular rate in body axes, each of shape (n, 3): once for rates and readings."""
        given = [frame[name]() for name in self._motion.names]
        known, acting = self._acted
        if known and all(map(is_, given, known)):
            return acting
        acting = self._act(frame)
        self._acted = given, acting
        return acting

    def _act(self, frame: Frame) -> tuple[Array, Array]:
        returned, count = self._motion(frame), len(frame["time"]())
        if not isinstance(returned, Mapping) or set(returned) != {"force", "rate"}:
            raise ValueError("motion must return a mapping of force and rate")
        force, rate = (
            as_kept(returned[name], Quantity(name, unit, AXES), count, f"{name} of motion")
            for name, unit in (("force", "m/s^2"), ("rate", "rad/s"))
        )
        shape = (3, count)
        return np.broadcast_to(force, shape).T, np.broadcast_to(rate, shape).T

    def _merged(self, attribute: str) -> dict[str, Any]:
        """Return declarations of the navigator and of the class; the navigator's come first."""
        brought, own = getattr(self._navigator, attribute), getattr(self._instance, attribute) or {}
        if not isinstance(own, Mapping):
            raise ScenarioError("type", f"{self._name}.{attribute} must give a unit for each name; got {own!r:.80}")
        both = brought.keys() & own.keys()
        if both:
            raise ScenarioError("type", f"{self._name}.{attribute}: {min(both)!r} is brought by the navigator")
        return {**brought, **own}

    def _read(self, name: str, known: tuple[str, ...]) -> Method | None:
        given = getattr(self._instance, name, None)
        also = ("phase",) if self._instance.phases else ()
        return None if given is None else read_method(given, f"{self._name}.{name}", (*known, *also))


def _names(method: Method | None) -> tuple[str, ...]:
    return () if method is None else method.names


def _naming(function: Callable[[Frame], Any], *names: str) -> Callable[..., Any]:
    """Return a method that names arguments, and calls a function with all of them by name."""

    def method(**values: Any) -> Any:
        return function({name: partial(_same, value) for name, value in values.items()})

    parameters = [Parameter(name, Parameter.KEYWORD_ONLY) for name in dict.fromkeys(names)]
    method.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    return method


def _same(value: Any) -> Any:
    return value


def _called(method: Method | None, frame: Frame) -> Mapping[str, Any]:
    """Return the mapping that a method of the class returns; nothing without a method."""
    returned = {} if method is None else method(frame)
    if not isinstance(returned, Mapping):
        raise ValueError("it must return a mapping of names to values")
    return returned
