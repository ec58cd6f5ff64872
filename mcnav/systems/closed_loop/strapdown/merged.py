"""A user's object with what its navigator declares besides: one object that the loop reads."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any, Final

import numpy as np

from mcnav._types import Array
from mcnav.contract.scenario import ScenarioError
from mcnav.systems.closed_loop.methods import Frame, Method, read_method
from mcnav.systems.closed_loop.quantities import Quantity, as_kept
from mcnav.systems.closed_loop.strapdown.navigator import Strapdown
from mcnav.systems.ins.imu.instruments import AXES

MERGED: Final = ("truth", "estimate", "parameters", "processes")
OF_TRUTH: Final = ("time", "truth", "command", "parameters", "noise")
OF_NAVIGATOR: Final = ("time", "estimate", "sensed", "parameters", "command")


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
        self._motion, self._rates = motion, self._read("rates", OF_TRUTH)
        self._navigate = self._read("navigate", OF_NAVIGATOR)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.__dict__["_instance"], name)

    def rates(self, time: Array, truth: Any, command: Array, parameters: Any, noise: Any) -> dict[str, Any]:
        """Return the derivative of the truth: of position, velocity and attitude, and what the class adds."""
        frame = _frame(time=time, truth=truth, command=command, parameters=parameters, noise=noise)
        moved = self._navigator.rates(truth, *self._acting(frame, len(time)))
        return {**moved, **_called(self._rates, frame)}

    def sense(self, time: Array, truth: Any, command: Array, parameters: Any, noise: Any) -> dict[str, Array]:
        """Return what the instruments read."""
        frame = _frame(time=time, truth=truth, command=command, parameters=parameters, noise=noise)
        return self._navigator.sense(*self._acting(frame, len(time)), parameters, noise)

    def navigate(self, time: Array, estimate: Any, sensed: Any, parameters: Any, command: Any) -> dict[str, Any]:
        """Return the derivative of the estimate: the mechanization, and what the class adds."""
        frame = _frame(time=time, estimate=estimate, sensed=sensed, parameters=parameters, command=command)
        return {**self._navigator.navigate(estimate, sensed), **_called(self._navigate, frame)}

    def _acting(self, frame: Frame, count: int) -> tuple[Array, Array]:
        """Return specific force and angular rate in body axes, each of shape (count, 3)."""
        returned = self._motion(frame)
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
        return None if given is None else read_method(given, f"{self._name}.{name}", known)


def _frame(**values: Any) -> Frame:
    return {name: partial(_same, value) for name, value in values.items()}


def _same(value: Any) -> Any:
    return value


def _called(method: Method | None, frame: Frame) -> Mapping[str, Any]:
    """Return the mapping that a method of the class returns; nothing without a method."""
    returned = {} if method is None else method(frame)
    if not isinstance(returned, Mapping):
        raise ValueError("it must return a mapping of names to values")
    return returned
