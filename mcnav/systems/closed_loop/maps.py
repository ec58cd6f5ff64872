"""Maps of a loop, each of X and of the noise that enters it, vectorised over samples: X has shape (size, n)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from mcnav._types import Array
from mcnav.systems.closed_loop.declarations import Correction, Measurement
from mcnav.systems.closed_loop.methods import Frame, Method
from mcnav.systems.closed_loop.quantities import Block, Quantity, Values, as_kept, as_seen, attitude_kept, spread
from mcnav.systems.closed_loop.rotations import turn_between
from mcnav.systems.closed_loop.structure import Structure

_ROOT_3: Final = float(np.sqrt(3.0))


@dataclass(frozen=True)
class Sensor:
    """A measurement, with its methods, and the size of what it measures; or an attitude."""

    declared: Measurement
    truth: Method
    model: Method | None
    size: int = 1
    attitude: bool = False


@dataclass(frozen=True)
class Impulse:
    """A correction with its methods."""

    declared: Correction
    target: Method
    apply: Method | None


@dataclass(frozen=True)
class Maps:
    """The loop as functions of X.

    Attributes
    ----------
    decay : ndarray, shape (markov.size, 1)
        One over the correlation time of each Gauss-Markov process, 1/s.
    believed_decay : ndarray, shape (markov.size, 1)
        The same as the navigator believes it.
    """

    structure: Structure
    rates: Method
    sense: Method | None
    navigate: Method | None
    guide: Method | None
    sensors: tuple[Sensor, ...]
    impulses: tuple[Impulse, ...]
    end: Method | None
    continuous: bool
    decay: Array
    believed_decay: Array

    def truth_frame(self, x: Array, time: Array, white: Array | None = None, command: Array | None = None) -> Frame:
        """Return what methods of the truth may name; without ``white`` noise has its processes' values alone."""
        structure = self.structure

        def noise() -> Values:
            values = named(structure.markov, x)
            if white is not None:
                values |= named(structure.white, white)
            return Values("noise", values)

        return {
            "time": lambda: time,
            "truth": lambda: Values("truth", named(structure.truth, x)),
            "parameters": lambda: Values("parameters", named(structure.parameters, x)),
            "estimate": lambda: Values("estimate", named(structure.estimate, x)),
            "command": lambda: self._seen_command(x if command is None else command, command is None),
            "noise": noise,
        }

    def navigator_frame(self, x: Array, time: Array, sensed: Any, with_white: bool = False) -> Frame:
        """Return what methods may name when the navigator uses them: its estimates in place of truth and errors."""
        structure = self.structure

        def estimated(block: Block) -> dict[str, Array]:
            values = {}
            for quantity in block.quantities:
                at = structure.estimate.of(quantity.name)
                numbers = np.zeros((quantity.size, x.shape[1])) if at is None else x[at]
                values[quantity.name] = as_seen(numbers, bool(quantity.axes))
            return values

        def noise() -> Values:
            white = np.zeros((structure.white.size, x.shape[1]))
            return Values("noise", estimated(structure.markov) | (named(structure.white, white) if with_white else {}))

        return {
            "time": lambda: time,
            "truth": lambda: Values("the estimate", named(structure.estimate, x)),
            "estimate": lambda: Values("estimate", named(structure.estimate, x)),
            "parameters": lambda: Values("parameters", estimated(structure.parameters)),
            "command": lambda: sensed,
            "sensed": lambda: sensed,
            "noise": noise,
        }

    def step(self, x: Array, time: Array, length: float, white: Array, fraction: Array | float = 1.0) -> Array:
        """Propagate by a step of Runge-Kutta's classical method, or by a fraction of it, shape (n,).

        Attitudes are integrated as rotation vectors from the begin of the step (Munthe-Kaas).

        Parameters
        ----------
        white : ndarray, shape (2, inputs, n)
            The first two Legendre modes, over the whole step, of white noise and of what drives Gauss-Markov processes,
            each with the variance of the density: ``w(s) = (white[0] + sqrt(3) (2 s - 1) white[1]) / sqrt(length)``,
            with s from 0 to 1.
        """
        scale = 1.0 / np.sqrt(length)
        mean, slope = white[0] * scale, white[1] * (_ROOT_3 * scale)
        covered = fraction * length
        begin, middle, end = mean - slope, mean + slope * (fraction - 1.0), mean + slope * (2.0 * fraction - 1.0)
        space = self.structure.space

        def rates(change: Array, after: Array | float, white: Array) -> Array:
            return space.rates_at(change, self.derivative(space.advanced(x, change), time + after, white))

        first = self.derivative(x, time, begin)
        second = rates(0.5 * covered * first, 0.5 * covered, middle)
        third = rates(0.5 * covered * second, 0.5 * covered, middle)
        fourth = rates(covered * third, covered, end)
        total = second  # covered / 6 (first + 2 (second + third) + fourth)
        total += third
        total *= 2.0
        total += first
        total += fourth
        total *= covered / 6.0
        return space.advanced(x, total)

    def derivative(self, x: Array, time: Array, white: Array) -> Array:
        """Compute dX/dt, shape (size, n), an attitude's its angular rate in body axes; commands and the like rest."""
        structure, count = self.structure, x.shape[1]
        command = self.guided(x, time)[0] if self.continuous and self.guide is not None else None
        frame = self.truth_frame(x, time, white, command)
        result = np.zeros_like(x)
        spread(structure.truth, self.rates(frame), count, "rates", into=result[structure.truth.whole])
        markov = structure.markov.whole
        if structure.markov.size:
            result[markov] = -self.decay * x[markov] + white[structure.white.size :]
        sensed = frame["command"]() if self.sense is None else self._sensed(self.sense(frame))
        self._navigate(x, time, sensed, result[structure.estimate.whole])
        return result

    def _navigate(self, x: Array, time: Array, sensed: Any, result: Array) -> None:
        """Set the derivative of the estimate, shape (estimate.size, n), which is zero before."""
        structure = self.structure
        estimate = structure.estimate
        method = self.rates if self.navigate is None else self.navigate
        returned = method(self.navigator_frame(x, time, sensed, with_white=self.navigate is None))
        if self.navigate is None and isinstance(returned, Mapping):  # rates of the truth, of which some are estimated
            returned = {name: each for name, each in returned.items() if name in estimate.names}
        spread(estimate, returned, x.shape[1], "navigate", into=result)
        for quantity, place in structure.markov.places():
            at = estimate.of(quantity.name)
            if at is not None and quantity.name not in returned:
                local = slice(place.start - structure.markov.begin, place.stop - structure.markov.begin)
                result[at.start - estimate.begin : at.stop - estimate.begin] = -self.believed_decay[local] * x[at]

    def _sensed(self, returned: Any) -> Any:
        if isinstance(returned, Mapping):
            return Values("sensed", {name: np.asarray(each, dtype=float) for name, each in returned.items()})
        return np.asarray(returned, dtype=float)

    def _seen_command(self, values: Array, within_x: bool) -> Array:
        (quantity,) = self.structure.command.quantities
        return as_seen(values[self.structure.command.whole] if within_x else values, bool(quantity.axes))

    def guided(self, x: Array, time: Array) -> tuple[Array, Array]:
        """Compute command and memory, shapes (command.size, n) and (memory.size, n)."""
        structure, count = self.structure, x.shape[1]
        assert self.guide is not None
        frame = {
            "time": lambda: time,
            "estimate": lambda: Values("estimate", named(structure.estimate, x)),
            "memory": lambda: self._seen_memory(x),
        }
        returned = self.guide(frame)
        command, memory = returned if isinstance(returned, tuple) else (returned, None)
        commanded = np.broadcast_to(
            as_kept(command, structure.command.quantities[0], count, "guide"), (structure.command.size, count)
        )
        kept = np.zeros((structure.memory.size, count))
        if structure.memory.size:
            kept[:] = as_kept(memory, structure.memory.quantities[0], count, "memory of guide")
        return commanded, kept

    def _seen_memory(self, x: Array) -> Array:
        memory = self.structure.memory
        return as_seen(x[memory.whole], len(memory.quantities[0].axes) > 1) if memory.size else np.zeros(x.shape[1])

    def after_guidance(self, x: Array, time: Array) -> Array:
        """Return X with a new command."""
        if self.guide is None:
            return x
        result = x.copy()
        result[self.structure.command.whole], result[self.structure.memory.whole] = self.guided(x, time)
        return result

    def innovation(self, number: int, x: Array, time: Array) -> Array:
        """Compute what a sensor measures without its noise, less what the navigator expects, shape (size, n)."""
        sensor, count = self.sensors[number], x.shape[1]
        quantity = _component(sensor.declared.name, sensor.size)
        measured = sensor.truth(self.truth_frame(x, time))
        frame = self.navigator_frame(x, time, None)
        expected = sensor.truth(frame) if sensor.model is None else sensor.model(frame)
        where = f"measurement {quantity.name}"
        if sensor.attitude:
            there, origin = (attitude_kept(each, count, where) for each in (measured, expected))
            difference = turn_between(there, origin, "body")
        else:
            difference = as_kept(measured, quantity, count, where) - as_kept(expected, quantity, count, where)
        return np.broadcast_to(difference, (sensor.size, count))

    def corrected(self, number: int, x: Array, time: Array, noise: Array) -> Array:
        """Return X after a correction with its execution error, shape (axes, n)."""
        structure, impulse, count = self.structure, self.impulses[number], x.shape[1]
        quantity, place = list(structure.corrections.places())[number]
        where = f"target of {quantity.name}"
        estimate = Values("estimate", named(structure.estimate, x))
        target = impulse.target({"time": lambda: time, "estimate": lambda: estimate})
        commanded = np.broadcast_to(as_kept(target, quantity, count, where), (quantity.size, count))
        executed = commanded + noise
        known = executed if impulse.declared.known == "executed" else commanded
        result = x.copy()
        result[place] = commanded
        for block, given in ((structure.truth, executed), (structure.estimate, known)):
            result[block.whole] = self._pushed(impulse, block, x, time, as_seen(given, bool(quantity.axes)))
        return result

    def _pushed(self, impulse: Impulse, block: Block, x: Array, time: Array, given: Array) -> Array:
        states = Values(block.what, named(block, x))
        if impulse.apply is None:
            name = str(impulse.declared.apply)
            changed: Any = {name: getattr(states, name) + given} if name in block.names else {}
        else:
            changed = impulse.apply({"time": lambda: time, "truth": lambda: states, "impulse": lambda: given})
            if block is self.structure.estimate and isinstance(changed, Mapping):
                changed = {name: each for name, each in changed.items() if name in block.names}
        return spread(block, changed, x.shape[1], f"apply of {impulse.declared.name}", x[block.whole])

    def triggered(self, method: Method, x: Array, time: Array) -> Array:
        """Compute a trigger's function, shape (n,)."""
        frame = self.truth_frame(x, time)
        value = as_kept(method(frame), Quantity("trigger", "1"), x.shape[1], method.where)
        return np.broadcast_to(value[0], (x.shape[1],))


def _component(name: str, size: int) -> Quantity:
    return Quantity(name, "1", tuple(map(str, range(size))) if size > 1 else ())


def named(block: Block, x: Array) -> dict[str, Array]:
    """Return the values of a block in X by name, as users' methods see them."""
    return {
        quantity.name: as_seen(x[place], bool(quantity.axes), quantity.turns is not None)
        for quantity, place in block.places()
    }
