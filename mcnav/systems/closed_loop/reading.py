"""Maps of a user's object: its methods with what they name, the nominal start, the axes of what methods return."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import numpy as np

from mcnav._types import Array
from mcnav.contract.scenario import ScenarioError
from mcnav.systems.closed_loop.declarations import Trigger
from mcnav.systems.closed_loop.maps import Impulse, Maps, Sensor, named
from mcnav.systems.closed_loop.methods import Frame, Method, read_method
from mcnav.systems.closed_loop.quantities import Values, spread
from mcnav.systems.closed_loop.structure import Structure, measurements_of, read_structure

_OF_TRUTH: Final = ("time", "truth", "command", "parameters", "noise")


def read_maps(instance: Any, name: str, decay: Array | None = None, believed_decay: Array | None = None) -> Maps:
    """Read the maps of a user's object; guidance, corrections and sensors are tried out on the nominal start.

    Raises `ScenarioError` when a method is missing or asks for what there is not.
    """
    structure = read_structure(instance, name)

    def method(attribute: str, known: tuple[str, ...]) -> Method | None:
        given = getattr(instance, attribute, None)
        return None if given is None else read_method(given, f"{name}.{attribute}", known)

    rates = method("rates", _OF_TRUTH)
    if rates is None:
        raise ScenarioError("type", f"{name} needs a method rates(self, truth, ...), the derivative of the truth")
    sensors = tuple(
        Sensor(
            each,
            read_method(each.truth, f"truth of {each.name}", ("time", "truth", "parameters", "noise")),
            None if each.model is None else read_method(each.model, f"model of {each.name}", ("time", "estimate")),
        )
        for each in measurements_of(instance, name)
    )
    impulses = tuple(
        Impulse(
            each,
            read_method(each.target, f"target of {each.name}", ("time", "estimate")),
            None if isinstance(each.apply, str)
            else read_method(each.apply, f"apply of {each.name}", ("time", "truth", "impulse"), "impulse"),
        )
        for each in instance.corrections
    )  # fmt: skip
    end = instance.end
    none = np.zeros((structure.markov.size, 1))
    maps = Maps(
        structure,
        rates,
        method("sense", _OF_TRUTH),
        method("navigate", ("time", "estimate", "sensed", "parameters", "command")),
        method("guide", ("time", "estimate", "memory")),
        sensors,
        impulses,
        read_method(end.function, "end", ("time", "truth", "estimate")) if isinstance(end, Trigger) else None,
        instance.cycle is None,
        none if decay is None else decay,
        none if believed_decay is None else believed_decay,
    )
    return _sized(maps, read_start(instance, name, structure))


def read_start(instance: Any, name: str, structure: Structure) -> Array:
    """Return the nominal X at the start, shape (size,): truth and estimate as ``start`` says, else zero.

    Raises `ScenarioError` when ``start`` does not return states of the truth.
    """
    x = np.zeros(structure.size)
    if hasattr(instance, "start"):
        try:
            x[structure.truth.whole] = spread(
                structure.truth, instance.start(), 1, "start", np.zeros((structure.truth.size, 1))
            )[:, 0]
        except Exception as failure:
            raise ScenarioError("type", f"{name}.start: {failure}") from failure
    places, counterparts = structure.pairs
    x[places] = x[counterparts]
    return x


def _sized(maps: Maps, start: Array) -> Maps:
    """Find the axes of command, memory, impulses and measurements from what methods return at the start."""
    count, time = 3, np.zeros(3)
    x = np.repeat(start[:, None], count, axis=1)
    structure = maps.structure
    estimate = Values("estimate", named(structure.estimate, x))

    def size_of(returned: Any, where: str, attitude: bool = False) -> int:
        shape = np.shape(returned)
        if attitude and shape == (count, 3, 3):
            return 3
        if len(shape) > 2 or (shape and shape[0] != count):
            raise ScenarioError(
                "type", f"{where} must return shape (n,) or (n, axes) for n samples; got {shape}, n = 3"
            )
        return shape[1] if len(shape) == 2 else 0

    def tried(method: Method, frame: Frame) -> Any:
        try:
            return method(frame)
        except Exception as failure:
            raise ScenarioError("type", f"{method.where}: {type(failure).__name__}: {failure}") from failure

    command, memory = None, 0
    if maps.guide is not None:
        frame = {"time": lambda: time, "estimate": lambda: estimate, "memory": lambda: np.zeros(count)}
        returned = tried(maps.guide, frame)
        if isinstance(returned, tuple):
            returned, kept = returned
            memory = size_of(kept, "memory of guide") or 1
        command = size_of(returned, "guide")
    frame = {"time": lambda: time, "estimate": lambda: estimate}
    axes = {each.declared.name: size_of(tried(each.target, frame), each.target.where) for each in maps.impulses}
    truth = maps.truth_frame(x, time)

    def sized(sensor: Sensor) -> Sensor:
        measured = tried(sensor.truth, truth)
        size = size_of(measured, sensor.truth.where, attitude=True) or 1
        return replace(sensor, size=size, attitude=np.ndim(measured) == 3)

    sensors = tuple(map(sized, maps.sensors))
    return replace(maps, structure=structure.resized(command, memory, axes), sensors=sensors)
