"""Maps of a user's object: its methods with what they name, the nominal start, the axes of what methods return."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final, Literal

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.scenario import ScenarioError
from mcnav.systems.closed_loop.declarations import Trigger
from mcnav.systems.closed_loop.maps import Event, Impulse, Maps, Sensor
from mcnav.systems.closed_loop.methods import Frame, Method, read_method
from mcnav.systems.closed_loop.own_outputs import ARGUMENTS, read_own_outputs
from mcnav.systems.closed_loop.own_update import COVARIANCE, UPDATE
from mcnav.systems.closed_loop.quantities import Block, Values, spread
from mcnav.systems.closed_loop.readout import standard_outputs
from mcnav.systems.closed_loop.structure import Structure, measurements_of, phases_of, read_structure
from mcnav.systems.guard import call_user, raised_by
from mcnav.systems.sample_loop import format_exception

OF_TRUTH: Final = ("time", "truth", "command", "parameters", "noise")
OF_NAVIGATOR: Final = ("time", "estimate", "sensed", "parameters", "command", "memory")
"""Arguments that ``rates`` and ``sense``, and ``navigate``, may name."""

TRIED: Final = 3
"""Samples with which methods are tried out."""


def read_maps(instance: Any, name: str, decay: Array | None = None, believed_decay: Array | None = None) -> Maps:
    """Read the maps of a user's object; guidance, corrections and sensors are tried out on the nominal start.

    Raises `ScenarioError` when a method is missing or asks for what there is not.
    """
    structure, phases = read_structure(instance, name), tuple(phase.name for phase in phases_of(instance, name))
    also = ("phase",) if phases else ()

    def method(attribute: str, known: tuple[str, ...]) -> Method | None:
        given = getattr(instance, attribute, None)
        return None if given is None else read_method(given, f"{name}.{attribute}", (*known, *also))

    rates = method("rates", OF_TRUTH)
    if rates is None:
        raise ScenarioError("type", f"{name} needs a method rates(self, truth, ...), the derivative of the truth")
    sensors = tuple(
        Sensor(
            each,
            read_method(each.truth, f"truth of {each.name}", ("time", "truth", "parameters", "noise", *also)),
            None
            if each.model is None
            else read_method(each.model, f"model of {each.name}", ("time", "estimate", *also)),
        )
        for each in measurements_of(instance, name)
    )
    impulses = tuple(
        Impulse(
            correction,
            read_method(correction.target, f"target of {correction.name}", ("time", "estimate", *also)),
            None if isinstance(correction.apply, str)
            else read_method(correction.apply, f"apply of {correction.name}", ("time", "truth", "impulse"), "impulse"),
        )
        for correction in instance.corrections
    )  # fmt: skip
    none = np.zeros((structure.markov.size, 1))
    maps = Maps(
        structure,
        rates,
        method("sense", OF_TRUTH),
        method("navigate", OF_NAVIGATOR),
        method("guide", ("time", "estimate", "memory")),
        sensors,
        impulses,
        _read_events(instance),
        instance.cycle is None,
        none if decay is None else decay,
        none if believed_decay is None else believed_decay,
        update=method("update", UPDATE),
        covariance=method("covariance", COVARIANCE),
        phases=phases,
    )
    maps = _sized(maps, read_start(instance, name, structure))
    outputs = method("outputs", ARGUMENTS)
    if outputs is None:
        return maps
    x = np.repeat(read_start(instance, name, maps.structure)[:, None], TRIED, axis=1)
    taken = [output.name for output in standard_outputs(maps.structure, maps.guide is not None)]
    frame = maps.truth_frame(x, np.zeros(TRIED))
    return replace(maps, own_outputs=read_own_outputs(outputs, frame, TRIED, taken))


def _read_events(instance: Any) -> tuple[Event, ...]:
    """Return the corrections, phases and the end that triggers begin."""
    triggers: list[tuple[str, Literal["correction", "phase", "end"], int, Any]] = [
        (correction.name, "correction", number, correction.at) for number, correction in enumerate(instance.corrections)
    ]
    triggers += [(phase.name, "phase", number, phase.begins) for number, phase in enumerate(instance.phases)]
    triggers.append(("end", "end", 0, instance.end))
    known = ("time", "truth", "estimate")
    return tuple(
        Event(name, kind, number, read_method(at.function, f"trigger of {name}", known), at.latest)
        for name, kind, number, at in triggers
        if isinstance(at, Trigger)
    )


def read_start(instance: Any, name: str, structure: Structure) -> Array:
    """Return the nominal X at the start, shape (size,): truth and estimate as ``start`` says, else zero.

    Raises `ScenarioError` when ``start`` does not return states of the truth.
    """
    x = np.zeros(structure.size)
    if hasattr(instance, "start"):
        try:
            started = call_user(instance.start)
            remembered = structure.memory if structure.remembers else Block("what is remembered", ())
            if isinstance(started, Mapping):
                memory = {name: started[name] for name in remembered.names if name in started}
                started = {name: value for name, value in started.items() if name not in memory}
                x[remembered.whole] = spread(remembered, memory, 1, "start")[:, 0]
            before = np.zeros((structure.truth.size, 1))
            x[structure.truth.whole] = spread(structure.truth, started, 1, "start", before)[:, 0]
        except Exception as failure:
            raise ScenarioError("type", f"{name}.start: {raised_by(failure)}") from failure
    places, counterparts = structure.pairs
    x[places] = x[counterparts]
    return x


def _sized(maps: Maps, start: Array) -> Maps:
    """Find the axes of command, memory, impulses and measurements from what methods return at the start."""
    count, time = TRIED, np.zeros(TRIED)
    x = np.repeat(start[:, None], count, axis=1)
    structure = maps.structure
    estimate = Values("estimate", (structure.estimate.views, x))

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
            raise ScenarioError("type", f"{method.where}: {format_exception(failure, '')}") from failure

    command, memory = None, 0
    phase = {"phase": lambda: maps.phases[0]}
    if maps.guide is not None:
        frame = {
            "time": lambda: time,
            "estimate": lambda: estimate,
            "memory": maps.truth_frame(x, time)["memory"],
            **phase,
        }
        returned = tried(maps.guide, frame)
        if isinstance(returned, tuple):
            returned, kept = returned
            memory = 0 if structure.remembers else size_of(kept, "memory of guide") or 1
        command = size_of(returned, "guide")
    frame = {"time": lambda: time, "estimate": lambda: estimate, **phase}
    axes = {
        impulse.declared.name: size_of(tried(impulse.target, frame), impulse.target.where) for impulse in maps.impulses
    }
    truth = maps.truth_frame(x, time)

    def sized(sensor: Sensor) -> Sensor:
        measured = tried(sensor.truth, truth)
        size = size_of(measured, sensor.truth.where, attitude=True) or 1
        return replace(sensor, size=size, attitude=np.ndim(measured) == 3)

    sensors = tuple(map(sized, maps.sensors))
    return replace(maps, structure=structure.resized(command, memory, axes), sensors=sensors)
