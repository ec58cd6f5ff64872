"""Maps of a loop, each of X and of the noise that enters it, vectorised over samples: X has shape (size, n)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.systems.closed_loop.declarations import Correction, Measurement
from mcnav.systems.closed_loop.methods import Frame, Method, made_once
from mcnav.systems.closed_loop.own_outputs import OwnOutputs
from mcnav.systems.closed_loop.quantities import Block, Quantity, Values, as_kept, as_seen, attitude_kept, spread
from mcnav.systems.closed_loop.rotations import turn_between
from mcnav.systems.closed_loop.structure import Part, Structure
from mcnav.systems.user.returned import real_numbers

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
class Event:
    """An event that a trigger begins.

    Attributes
    ----------
    kind : str
        ``correction``, ``phase`` or ``end``.
    number : int
        Of the correction or phase.
    latest : float
        Time by which a sample must have met it, s.
    """

    name: str
    kind: Literal["correction", "phase", "end"]
    number: int
    trigger: Method
    latest: float


@dataclass(frozen=True)
class Maps:
    """The loop as functions of X.

    Attributes
    ----------
    events : tuple of Event
        Those by trigger, an end last; as many as there are numbers of the structure's clock.
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
    events: tuple[Event, ...]
    continuous: bool
    decay: Array
    believed_decay: Array
    own_outputs: OwnOutputs | None = None
    update: Method | None = None
    covariance: Method | None = None
    phases: tuple[str, ...] = ()

    @cached_property
    def as_believed(self) -> Maps:
        """The loop with the correlation times that the navigator believes: that from which its filter's F and Q are."""
        same = np.array_equal(self.decay, self.believed_decay)
        return self if same else replace(self, decay=self.believed_decay)

    @property
    def ends(self) -> bool:
        """True where a trigger ends flights."""
        return bool(self.events) and self.events[-1].kind == "end"

    def phase_of(self, x: Array) -> str:
        """Return the phase of samples that are all in the same."""
        return self.phases[int(self.phase_numbers(x[:, :1])[0])]

    def _in_one_phase(self, x: Array) -> bool:
        """Return whether all samples are in the same phase."""
        numbers = x[self.structure.phase.begin]
        return bool((numbers == numbers[:1]).all())

    def phase_numbers(self, x: Array) -> NDArray[np.intp]:
        """Return the number of the phase of each sample, shape (n,)."""
        numbers = np.nan_to_num(x[self.structure.phase.begin])
        return np.asarray(np.clip(np.rint(numbers), 0, len(self.phases) - 1), dtype=np.intp)

    def by_phase(self, function: Callable[..., Array], x: Array, *arrays: Array) -> Array:
        """Call a function of X and other arrays, shape (..., n), for the samples of each phase by itself."""
        if not self.phases or self._in_one_phase(x):
            return function(x, *arrays)
        numbers = self.phase_numbers(x)
        present = np.unique(numbers)
        if len(present) < 2:
            return function(x, *arrays)
        result = np.zeros((0, x.shape[1]))
        for number in present:
            chosen = numbers == number
            part = function(x[:, chosen], *(array[..., chosen] for array in arrays))
            if not len(result):
                result = np.empty((*part.shape[:-1], x.shape[1]))
            result[..., chosen] = part
        return result

    def truth_frame(
        self, x: Array, time: Array, white: Array | None = None, command: Array | None = None,
        parameters: Values | None = None,
    ) -> Frame:  # fmt: skip
        """Return what methods of the truth may name; without ``white`` noise has its processes' values alone."""
        structure = self.structure

        def noise() -> Values:
            entering = () if white is None else ((structure.white.views, white),)
            return Values("noise", (structure.markov.views, x), *entering)

        return made_once({
            "time": lambda: time,
            "truth": lambda: Values("truth", (structure.truth.views, x)),
            "parameters": lambda: parameters or Values("parameters", (structure.parameters.views, x)),
            "estimate": lambda: Values("estimate", (structure.estimate.views, x)),
            "command": lambda: self._seen_command(x if command is None else command, command is None),
            "noise": noise,
            "memory": lambda: self._seen_memory(x),
            "phase": lambda: self.phase_of(x),
        })  # fmt: skip

    def navigator_frame(self, x: Array, time: Array, sensed: Any, with_white: bool = False) -> Frame:
        """Return what methods may name when the navigator uses them: its estimates in place of truth and errors."""
        estimate = self.structure.estimate.views

        return {
            "time": lambda: time,
            "truth": lambda: Values("the estimate", (estimate, x)),
            "estimate": lambda: Values("estimate", (estimate, x)),
            "parameters": lambda: Values("parameters", (self.structure.known_parameters, x)),
            "command": lambda: sensed,
            "sensed": lambda: sensed,
            "noise": lambda: Values("noise", (self.structure.known_noise(with_white), x)),
            "memory": lambda: self._seen_memory(x),
            "phase": lambda: self.phase_of(x),
        }

    def triggers_by_truth(self, trigger: Method) -> bool:
        """Return whether a trigger's function follows from the truth, which no navigator moves within a step."""
        return "estimate" not in trigger.names and not (self.continuous and self.guide is not None)

    @property
    def apart(self) -> bool:
        """True where truth and navigator ignore each other within a step: commands rest, and nothing is sensed."""
        return self.sense is None and not (self.continuous and self.guide is not None)

    def step(
        self, x: Array, time: Array, length: Array | float, white: Array, fraction: Array | float = 1.0,
        since: Array | float = 0.0, part: Part = "both",
    ) -> Array:  # fmt: skip
        """Propagate by a step of Runge-Kutta's classical method, or from one fraction of it to another, shape (n,).

        Attitudes are integrated as rotation vectors from the begin of the step (Munthe-Kaas). Of a loop whose truth
        and navigator are `apart` one part can be propagated alone; its rows are returned.

        Parameters
        ----------
        time : ndarray, shape (n,)
            At the begin of the whole step, s.
        length : ndarray, shape (n,), or float
            Of the whole step, s.
        white : ndarray, shape (2, inputs, n)
            The first two Legendre modes, over the whole step, of white noise and of what drives Gauss-Markov processes,
            each with the variance of the density: ``w(s) = (white[0] + sqrt(3) (2 s - 1) white[1]) / sqrt(length)``,
            with s from 0 to 1.
        """
        scale = 1.0 / np.sqrt(length)
        mean, slope = white[0] * scale, white[1] * (_ROOT_3 * scale)
        covered, time = (fraction - since) * length, time + since * length
        begin, end = mean + slope * (2.0 * since - 1.0), mean + slope * (2.0 * fraction - 1.0)
        middle = mean + slope * (since + fraction - 1.0)
        space, rows, alone = self.structure.spaces[part], self.structure.rows(part), part != "both"
        advanced = space.advancing(x[rows])

        def rates(change: Array, after: Array | float, white: Array) -> Array:
            there = advanced(change)
            if alone:
                moved, there = there, x.copy()
                there[rows] = moved
            return space.turn_rates(change, self.derivative(there, time + after, white, part, parameters))

        parameters = Values("parameters", (self.structure.parameters.views, x))  # at rest
        first = self.derivative(x, time, begin, part, parameters)
        second = rates(0.5 * covered * first, 0.5 * covered, middle)
        third = rates(0.5 * covered * second, 0.5 * covered, middle)
        fourth = rates(covered * third, covered, end)
        total = second  # covered / 6 (first + 2 (second + third) + fourth)
        total += third
        total *= 2.0
        total += first
        total += fourth
        total *= covered / 6.0
        return advanced(total)

    def derivative(
        self, x: Array, time: Array, white: Array, part: Part = "both", parameters: Values | None = None
    ) -> Array:
        """Compute dX/dt of the rows of a part, shape (size, n) for both, of samples in any phase.

        ``parameters`` are those of X, where they are known already.
        """
        if parameters is not None and (not self.phases or self._in_one_phase(x)):
            return self._derivative(part, x, time, white, parameters)
        return self.by_phase(partial(self._derivative, part), x, time, white)

    def _derivative(self, part: Part, x: Array, time: Array, white: Array, parameters: Values | None = None) -> Array:
        """Compute dX/dt, shape (size, n), an attitude's its angular rate in body axes; commands and the like rest."""
        structure, count, rows = self.structure, x.shape[1], self.structure.rows(part)
        command = (
            self._guided(x, time)[: structure.command.size] if self.continuous and self.guide is not None else None
        )
        frame = self.truth_frame(x, time, white, command, parameters)
        result = np.zeros((rows.stop - rows.start, count))
        if part != "navigator":
            spread(structure.truth, self.rates(frame), count, "rates", into=result[structure.truth.whole])
            markov = structure.markov.whole
            if structure.markov.size:
                result[markov] = -self.decay * x[markov] + white[structure.white.size :]
        if part != "truth":
            sensed = frame["command"]() if self.sense is None else self._sensed(self.sense(frame))
            self._navigate(x, time, sensed, result, rows.start)
        return result

    def _navigate(self, x: Array, time: Array, sensed: Any, result: Array, begin: int) -> None:
        """Set the derivatives of the estimate and of what is remembered in a result of zeros, of X from a row on."""
        structure = self.structure
        estimate, memory = structure.estimate, structure.memory
        method = self.rates if self.navigate is None else self.navigate
        returned = method(self.navigator_frame(x, time, sensed, with_white=self.navigate is None))
        named = isinstance(returned, Mapping)
        if self.navigate is None and named and not returned.keys() <= estimate.name_set:  # some are not estimated
            returned = {name: value for name, value in returned.items() if name in estimate.names}
        if structure.remembers and named:
            remembered = {name: value for name, value in returned.items() if name in memory.names}
            returned = {name: value for name, value in returned.items() if name not in remembered}
            spread(memory, remembered, x.shape[1], "navigate", into=_from(result, memory.whole, begin))
        spread(estimate, returned, x.shape[1], "navigate", into=_from(result, estimate.whole, begin))
        for quantity, place in structure.markov.places():
            at = estimate.of(quantity.name)
            if at is not None and quantity.name not in returned:
                local = slice(place.start - structure.markov.begin, place.stop - structure.markov.begin)
                _from(result, at, begin)[:] = -self.believed_decay[local] * x[at]

    def _sensed(self, returned: Any) -> Any:
        if isinstance(returned, Mapping):
            return Values.given(
                "sensed", {name: real_numbers(value, f"sense, {name},") for name, value in returned.items()}
            )
        return real_numbers(returned, "sense")

    def _seen_command(self, values: Array, within_x: bool) -> Array:
        (quantity,) = self.structure.command.quantities
        return as_seen(values[self.structure.command.whole] if within_x else values, bool(quantity.axes))

    def _guided(self, x: Array, time: Array) -> Array:
        """Compute command and, below it, memory, shape (command.size + memory.size, n)."""
        structure, count = self.structure, x.shape[1]
        assert self.guide is not None
        frame = {
            "time": lambda: time,
            "estimate": lambda: Values("estimate", (structure.estimate.views, x)),
            "memory": lambda: self._seen_memory(x),
            "phase": lambda: self.phase_of(x),
        }
        returned = self.guide(frame)
        command, memory = returned if isinstance(returned, tuple) else (returned, None)
        commanded = np.broadcast_to(
            as_kept(command, structure.command.quantities[0], count, "guide"), (structure.command.size, count)
        )
        if structure.remembers:
            before = x[structure.memory.whole]
            kept = spread(structure.memory, {} if memory is None else memory, count, "guide", before)
            return np.concatenate([commanded, kept])
        kept = np.zeros((structure.memory.size, count))
        if structure.memory.size:
            kept[:] = as_kept(memory, structure.memory.quantities[0], count, "memory of guide")
        return np.concatenate([commanded, kept])

    def _seen_memory(self, x: Array) -> Any:
        memory = self.structure.memory
        if self.structure.remembers:
            return Values("memory", (memory.views, x))
        return as_seen(x[memory.whole], len(memory.quantities[0].axes) > 1) if memory.size else np.zeros(x.shape[1])

    def after_guidance(self, x: Array, time: Array) -> Array:
        """Return X with a new command."""
        if self.guide is None:
            return x
        result = x.copy()
        result[self.structure.command.begin : self.structure.memory.whole.stop] = self.by_phase(self._guided, x, time)
        return result

    def innovation(self, number: int, x: Array, time: Array) -> Array:
        """Compute an innovation without noise, shape (size, n), of samples in any phase."""
        return self.by_phase(partial(self._innovation, number), x, time)

    def _innovation(self, number: int, x: Array, time: Array) -> Array:
        """Compute what a sensor measures without its noise, less what the navigator expects, shape (size, n)."""
        sensor, count = self.sensors[number], x.shape[1]
        quantity = _component(sensor.declared.name, sensor.size)
        measured = sensor.truth(self.truth_frame(x, time))
        frame = self.navigator_frame(x, time, None)
        expected = sensor.truth(frame) if sensor.model is None else sensor.model(frame)
        where = f"measurement {quantity.name}"
        if sensor.attitude:
            there, origin = (attitude_kept(attitude, count, where) for attitude in (measured, expected))
            difference = turn_between(there, origin, "body")
        else:
            difference = as_kept(measured, quantity, count, where) - as_kept(expected, quantity, count, where)
        return np.broadcast_to(difference, (sensor.size, count))

    def corrected(self, number: int, x: Array, time: Array, noise: Array) -> Array:
        """Return X after a correction, of samples in any phase."""
        return self.by_phase(partial(self._corrected, number), x, time, noise)

    def _corrected(self, number: int, x: Array, time: Array, noise: Array) -> Array:
        """Return X after a correction with its execution error, shape (axes, n)."""
        structure, impulse, count = self.structure, self.impulses[number], x.shape[1]
        quantity, place = list(structure.corrections.places())[number]
        where = f"target of {quantity.name}"
        estimate = Values("estimate", (structure.estimate.views, x))
        target = impulse.target({"time": lambda: time, "estimate": lambda: estimate, "phase": lambda: self.phase_of(x)})
        commanded = np.broadcast_to(as_kept(target, quantity, count, where), (quantity.size, count))
        executed = commanded + noise
        known = executed if impulse.declared.known == "executed" else commanded
        result = x.copy()
        result[place] = commanded
        for block, given in ((structure.truth, executed), (structure.estimate, known)):
            result[block.whole] = self._pushed(impulse, block, x, time, as_seen(given, bool(quantity.axes)))
        return result

    def _pushed(self, impulse: Impulse, block: Block, x: Array, time: Array, given: Array) -> Array:
        states = Values(block.what, (block.views, x))
        if impulse.apply is None:
            name = str(impulse.declared.apply)
            changed: Any = {name: getattr(states, name) + given} if name in block.names else {}
        else:
            changed = impulse.apply({"time": lambda: time, "truth": lambda: states, "impulse": lambda: given})
            if block is self.structure.estimate and isinstance(changed, Mapping):
                changed = {name: value for name, value in changed.items() if name in block.names}
        return spread(block, changed, x.shape[1], f"apply of {impulse.declared.name}", x[block.whole])

    def happen(self, number: int, x: Array, time: Array, noise: Array) -> Array:
        """Return X after an event at a time, shape (n,); a correction has its execution error, shape (axes, n)."""
        event = self.events[number]
        result = self.corrected(event.number, x, time, noise) if event.kind == "correction" else x.copy()
        result[self.structure.clock.begin + number] = time
        if event.kind == "phase":
            return self.begin_phase(event.number, result)
        return self.after_guidance(result, time) if event.kind == "end" and self.continuous else result

    def begin_phase(self, number: int, x: Array) -> Array:
        """Return X in a phase."""
        result = x.copy()
        result[self.structure.phase.begin] = float(number)
        return result

    def own_values(self, x: Array, time: Array) -> Array:
        """Compute the outputs of the user's own, shape (outputs, n)."""
        own = self.own_outputs
        assert own is not None
        return self.by_phase(lambda x, time: own.values(self.truth_frame(x, time), x.shape[1]), x, time)

    def triggered(self, method: Method, x: Array, time: Array) -> Array:
        """Compute a trigger's function, shape (n,)."""
        frame = self.truth_frame(x, time)
        value = as_kept(method(frame), Quantity("trigger", "1"), x.shape[1], method.where)
        return np.broadcast_to(value[0], (x.shape[1],))


def _from(rows: Array, place: slice, begin: int) -> Array:
    """Return a place in X of its rows from one on."""
    return rows[place.start - begin : place.stop - begin]


def _component(name: str, size: int) -> Quantity:
    return Quantity(name, "1", tuple(map(str, range(size))) if size > 1 else ())
