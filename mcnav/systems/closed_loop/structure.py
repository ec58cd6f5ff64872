"""Structure of a loop: the blocks of X, the counterparts of what is estimated, and the sources of errors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.contract.quantities import Of
from mcnav.contract.scenario import ScenarioError
from mcnav.errors import suggestion
from mcnav.systems.closed_loop.declarations import Correction, GaussMarkov, Measurement, Phase, Trigger, White
from mcnav.systems.closed_loop.quantities import Block, Quantity, View, read_axes, read_quantities
from mcnav.systems.closed_loop.rotations import Space
from mcnav.systems.user.settings import NAME, check_unit

Part = Literal["both", "truth", "navigator"]
"""Parts of a loop that move within a step: truth with its processes, navigator with what it remembers, or both."""

PARTS: Final[tuple[Part, ...]] = ("both", "truth", "navigator")


@dataclass(frozen=True)
class LoopSource:
    """A constant error: its name and unit, and where it moves X by one."""

    name: str
    unit: str
    group: str
    of: Of
    moves: tuple[int, ...]
    sign: float = 1.0


@dataclass(frozen=True)
class Structure:
    """Blocks of X, in their order, and the white noise that enters.

    The last blocks are the clock, times of events by trigger, and the number of the phase, where there are several.
    """

    truth: Block
    parameters: Block
    markov: Block
    estimate: Block
    command: Block
    memory: Block
    corrections: Block
    clock: Block
    phase: Block
    white: Block
    navigator_start: str = "truth"

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Blocks of X in their order."""
        return (
            self.truth, self.parameters, self.markov, self.estimate, self.command, self.memory, self.corrections,
            self.clock, self.phase,
        )  # fmt: skip

    @property
    def size(self) -> int:
        """Numbers of X."""
        return self.phase.begin + self.phase.size

    @cached_property
    def space(self) -> Space:
        """Sums and differences of X."""
        return Space(tuple(attitude for block in self.blocks for attitude in block.attitudes))

    def rows(self, part: Part) -> slice:
        """Return the rows of X that move within a step, with others between them; all of X for both."""
        return self._rows[part]

    @cached_property
    def _rows(self) -> dict[Part, slice]:
        truth = slice(self.truth.begin, self.markov.whole.stop)
        navigator = slice(self.estimate.begin, self.memory.whole.stop)
        return {"both": slice(0, self.size), "truth": truth, "navigator": navigator}

    @cached_property
    def spaces(self) -> dict[Part, Space]:
        """Sums and differences of the rows of each part."""
        return {part: self.space.within(self.rows(part)) for part in PARTS}

    @cached_property
    def pairs(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Places in X of what is estimated, and of its counterparts, each of shape (estimate.size,)."""
        counterparts: list[int] = []
        for quantity in self.estimate.quantities:
            block = self.home(quantity.name)
            place = None if block is None else block.of(quantity.name)
            twin = None if block is None else next(each for each in block.quantities if each.name == quantity.name)
            if place is None or twin is None or (twin.size, twin.turns) != (quantity.size, quantity.turns):
                known = (*self.truth.names, *self.parameters.names, *self.markov.names)
                told = f"estimate: {quantity.name!r} has no counterpart of its size and kind{suggestion('', known)}"
                raise ScenarioError("type", told)
            counterparts += range(place.start, place.stop)
        return np.arange(self.estimate.begin, self.estimate.whole.stop), np.array(counterparts, dtype=np.intp)

    @cached_property
    def navigator(self) -> NDArray[np.intp]:
        """Places in X of what a navigator keeps: estimate and memory."""
        estimate, memory = self.estimate.whole, self.memory.whole
        return np.concatenate([np.arange(rows.start, rows.stop) for rows in (estimate, memory)])

    def navigation_errors(self, x: Array) -> Array:
        """Return ``x_hat - x``, shape (estimate.size, n), of attitudes as rotation vectors."""
        places, counterparts = self.pairs
        aligned = x.copy()
        aligned[places] = x[counterparts]
        return self.space.minus(x, aligned)[self.estimate.whole]

    @cached_property
    def known_parameters(self) -> dict[str, View]:
        """Parameters as the navigator sees them: as it estimates them, else zero."""
        return self._known(self.parameters)

    def known_noise(self, with_white: bool) -> dict[str, View]:
        """Return how the navigator sees processes: as it estimates them, else zero; white noise is zero."""
        return self._known_processes if with_white else self._known_markov

    @cached_property
    def _known_markov(self) -> dict[str, View]:
        return self._known(self.markov)

    @cached_property
    def _known_processes(self) -> dict[str, View]:
        return self._known_markov | self._known(self.white)

    def _known(self, block: Block) -> dict[str, View]:
        return {
            quantity.name: View(self.estimate.of(quantity.name) or quantity.size, bool(quantity.axes))
            for quantity in block.quantities
        }

    @property
    def remembers(self) -> bool:
        """True where what is remembered has names."""
        return self.memory.size > 0 and self.memory.names != ("memory",)

    def home(self, name: str) -> Block | None:
        """Return the block of the truth, the parameters or the processes that has a name."""
        return next((block for block in (self.truth, self.parameters, self.markov) if name in block.names), None)

    @cached_property
    def sources(self) -> tuple[LoopSource, ...]:
        """Errors at the start: of the truth, of the estimate alone, and parameters."""
        follows = self.navigator_start == "truth"
        sources = []
        for quantity, place in self.truth.places():
            estimated = self.estimate.of(quantity.name)
            for offset, name in enumerate(quantity.names):
                also = (estimated.start + offset,) if estimated is not None and follows else ()
                moves = (place.start + offset, *also)
                sources.append(LoopSource(f"true_{name}", quantity.unit, f"true_{quantity.name}", "truth", moves))
        for quantity, place in self.estimate.places():
            if quantity.name in self.truth.names:
                for offset, name in enumerate(quantity.names):
                    sources.append(
                        LoopSource(name, quantity.unit, quantity.name, "navigation", (place.start + offset,))
                    )
        for quantity, place in self.parameters.places():
            for offset, name in enumerate(quantity.names):
                sources.append(LoopSource(name, quantity.unit, quantity.name, "truth", (place.start + offset,)))
        return tuple(sources)

    def started(self, start: Array, errors: Array, deviation: Array) -> Array:
        """Return X at the start with deviations, shape (size, n), that errors of the sources, (n, sources), cause.

        Attitudes turn by the errors of the truth first, then by those of the estimate.
        """
        x = start[:, None] + deviation
        if self.space.attitudes:
            alone = np.array([source.of == "navigation" for source in self.sources])
            of_truth, of_estimate = (self.start_partials[:, chosen] @ errors[:, chosen].T for chosen in (~alone, alone))
            turned = self.space.plus(self.space.plus(start[:, None], of_truth), of_estimate)
            for place, _ in self.space.attitudes:
                x[place] = turned[place]
        return x

    @cached_property
    def start_partials(self) -> Array:
        """Partial derivatives of X at the start by the sources, shape (size, sources)."""
        partials = np.zeros((self.size, len(self.sources)))
        for column, source in enumerate(self.sources):
            partials[list(source.moves), column] = 1.0
        return partials

    def resized(self, command: int | None, memory: int, corrections: Mapping[str, int]) -> Structure:
        """Return the structure with the axes that guidance and corrections turned out to have; none for scalars."""
        (quantity,) = self.command.quantities
        if command is not None and len(quantity.axes) != command:
            quantity = replace(quantity, axes=read_axes("command", command))
        begin = self.command.begin
        commands = Block("command", (quantity,), begin)
        memories = (Quantity("memory", "1", tuple(str(number) for number in range(memory))),) if memory else ()
        kept = Block("memory", self.memory.quantities or memories, commands.whole.stop)
        impulses = tuple(
            replace(quantity, axes=read_axes(quantity.name, size))
            if (size := corrections.get(quantity.name, 0))
            else quantity
            for quantity in self.corrections.quantities
        )
        done = Block("correction", impulses, kept.whole.stop)
        clock = replace(self.clock, begin=done.whole.stop)
        phase = replace(self.phase, begin=clock.whole.stop)
        return replace(self, command=commands, memory=kept, corrections=done, clock=clock, phase=phase)


def read_structure(instance: Any, name: str) -> Structure:
    """Read the structure of a user's object, with scalars for commands and corrections.

    Raises `ScenarioError` when its declarations are wrong.
    """
    truth = read_quantities(f"{name}.truth", instance.truth)
    if not truth:
        raise ScenarioError("type", f"{name}.truth must name at least one state with its unit")
    given = instance.estimate
    estimate = truth if given is None else read_quantities(f"{name}.estimate", given)
    parameters = read_quantities(f"{name}.parameters", instance.parameters)
    white, markov = _read_processes(f"{name}.processes", instance.processes)
    memory = read_quantities(f"{name}.memory", instance.memory)
    (command,) = read_quantities(f"{name}.command", {"command": instance.command})
    for quantity in (*parameters, *white, *markov, *memory, command):
        if quantity.turns is not None:
            raise ScenarioError(
                "type", f"{name}: {quantity.name} is an Attitude, which only states can be; give its axes"
            )
    impulses = tuple(
        Quantity(correction.name, correction.noise) for correction in _listed(instance, name, "corrections", Correction)
    )
    for impulse in impulses:
        check_unit(f"{name}.corrections", impulse.unit, impulse.unit)
    attitudes = [attitude.name for attitude in truth if attitude.turns is not None]
    for correction in instance.corrections:
        if correction.apply in attitudes:
            told = f"{name}.corrections: {correction.name} turns {correction.apply}; apply must be a function"
            raise ScenarioError("type", f"{told} that returns the matrices after it")
    _check_names(name, instance, truth, parameters, white, markov, impulses, memory)
    if instance.navigator_start not in ("truth", "nominal"):
        raise ScenarioError("type", f"{name}.navigator_start is 'truth' or 'nominal'; got {instance.navigator_start!r}")
    blocks: list[Block] = []
    phases = phases_of(instance, name)
    moments = [
        *((correction.name, correction.at) for correction in instance.corrections),
        *((phase.name, phase.begins) for phase in phases),
    ]
    clock = tuple(
        Quantity(f"{each}_time", "s") for each, at in (*moments, ("final", instance.end)) if isinstance(at, Trigger)
    )
    phase = (Quantity("phase", "1"),) if phases else ()
    kinds = (
        "state of the truth", "parameter", "process", "estimated state", "command", "what is remembered", "correction",
        "time", "phase",
    )  # fmt: skip
    all_blocks = (truth, parameters, markov, estimate, (command,), memory, impulses, clock, phase)
    for what, quantities in zip(kinds, all_blocks, strict=True):
        blocks.append(Block(what, quantities, blocks[-1].whole.stop if blocks else 0))
    of_truth, of_parameters, of_markov, of_estimate, of_command, of_memory, of_impulses, of_clock, of_phase = blocks
    structure = Structure(
        of_truth, of_parameters, of_markov, of_estimate, of_command, of_memory, of_impulses, of_clock,
        of_phase, Block("process", white), str(instance.navigator_start),
    )  # fmt: skip
    _ = structure.pairs
    return structure


def _read_processes(where: str, processes: Any) -> tuple[tuple[Quantity, ...], tuple[Quantity, ...]]:
    if not isinstance(processes, Mapping):
        raise ScenarioError("type", f"{where} must give White(unit) or GaussMarkov(unit) for each name")
    kinds: dict[type, list[Quantity]] = {White: [], GaussMarkov: []}
    for name, process in processes.items():
        if type(process) not in kinds:
            raise ScenarioError(
                "type", f"{where}: {name} must be White(unit) or GaussMarkov(unit); got {process!r:.80}"
            )
        (quantity,) = read_quantities(where, {name: (process.unit, process.axes)})
        kinds[type(process)].append(quantity)
    return tuple(kinds[White]), tuple(kinds[GaussMarkov])


def _listed(instance: Any, name: str, attribute: str, kind: type) -> tuple[Any, ...]:
    given = getattr(instance, attribute)
    entries = tuple(given) if isinstance(given, (tuple, list)) else (given,)
    if not all(isinstance(entry, kind) for entry in entries):
        raise ScenarioError("type", f"{name}.{attribute} must be {kind.__name__} of mcnav; got {given!r:.80}")
    for entry in entries:
        if not isinstance(entry.name, str) or not NAME.fullmatch(entry.name):
            raise ScenarioError("type", f"{name}.{attribute}: {entry.name!r} is not a name of letters, digits and _")
    return entries


def phases_of(instance: Any, name: str) -> tuple[Phase, ...]:
    """Return the phases of a user's object; `ScenarioError` when they are none, or begin in another order."""
    phases: tuple[Phase, ...] = _listed(instance, name, "phases", Phase)
    last = 0.0
    for number, phase in enumerate(phases):
        if (phase.begins is None) != (number == 0):
            told = "begins with the flight" if number == 0 else "needs a time or a Trigger at which it begins"
            raise ScenarioError("type", f"{name}.phases: {phase.name} {told}")
        if [other.name for other in phases].count(phase.name) > 1:
            raise ScenarioError("type", f"{name}.phases: {phase.name} is there twice")
        time = phase.begins.latest if isinstance(phase.begins, Trigger) else phase.begins
        if number and (not isinstance(time, (int, float)) or isinstance(time, bool) or not last < time < np.inf):
            told = f"must begin at a time after {last:g} s, or by a Trigger whose latest is; got {time!r:.40}"
            raise ScenarioError("type", f"{name}.phases: {phase.name} {told}")
        last = last if isinstance(phase.begins, Trigger) or time is None else float(time)
    for before, after in pairwise(phases):
        latest = before.begins.latest if isinstance(before.begins, Trigger) else 0.0
        if isinstance(after.begins, (int, float)) and latest > after.begins:
            told = f"may begin as late as {latest:g} s, and {after.name} begins at {after.begins:g} s"
            raise ScenarioError("type", f"{name}.phases: {before.name} {told}")
    return phases


def measurements_of(instance: Any, name: str) -> tuple[Measurement, ...]:
    """Return the measurements of a user's object; `ScenarioError` when they are none."""
    entries: tuple[Measurement, ...] = _listed(instance, name, "measurements", Measurement)
    for entry in entries:
        check_unit(f"{name}.measurements", entry.unit, entry.unit)
        if (entry.interval is None) == (entry.instants is None):
            raise ScenarioError("type", f"{name}.measurements: {entry.name} needs an interval or instants")
    return entries


def _check_names(name: str, instance: Any, *groups: tuple[Quantity, ...]) -> None:
    names = [quantity.name for group in groups for quantity in group]
    names += [measurement.name for measurement in measurements_of(instance, name)]
    taken = {"command", "final_time", "memory", "phase"}
    taken |= {f"{moment.name}_time" for moment in (*instance.corrections, *phases_of(instance, name))}
    for each in names:
        if each in taken or each.startswith(("true_", "navigated_")):
            raise ScenarioError("type", f"{name}: the name {each!r} is taken, or begins with true_ or navigated_")
        taken.add(each)
