"""Tables of a closed loop's campaign: ``[processes]``, ``[measurements]``, and ``[filter.believes]``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from pydantic import TypeAdapter

from mcnav.arrays.types import Array
from mcnav.contract.gates import GateQuestion
from mcnav.contract.quantities import may_be_share
from mcnav.contract.questions import UNMEASURED
from mcnav.contract.scenario import Scenario
from mcnav.entries.context import FileContext
from mcnav.entries.validation import validate, validate_entry
from mcnav.errors import suggestion
from mcnav.sampler.error_model import ErrorModel
from mcnav.systems.closed_loop.declarations import ClosedLoop
from mcnav.systems.closed_loop.filter import FilterStates
from mcnav.systems.closed_loop.gates import LoopGates, component_names, times_of
from mcnav.systems.closed_loop.maps import Maps
from mcnav.systems.closed_loop.quantities import Quantity
from mcnav.systems.closed_loop.scenario import ClosedLoopScenario, without_errors
from mcnav.systems.closed_loop.schedule import Instant
from mcnav.systems.closed_loop.size_tables import (
    BELIEVED_MARKOV,
    MARKOV,
    SIZES,
    BelievesTable,
    Declared,
    LoopFilterTable,
    MarkovTable,
    NoiseTable,
    Size,
)
from mcnav.systems.closed_loop.sizes import LoopSizes, Sizes
from mcnav.systems.closed_loop.strapdown.merged import navigator_of
from mcnav.systems.closed_loop.strapdown.table import read_instruments
from mcnav.systems.description import FurtherTable, ScenarioSpec, ScenarioType
from mcnav.systems.faults import Fault
from mcnav.systems.ins.tables.faults import (
    FAULTS,
    MOST_FAULTS,
    NO_AIDING,
    BiasTable,
    RampTable,
    SpikeTable,
    WrongError,
    read_error,
)
from mcnav.systems.ins.tables.imu import IMU
from mcnav.systems.smoother_table import lag_of
from mcnav.systems.user import table as user

TABLES: Final[Mapping[str, FurtherTable]] = {
    "processes": FurtherTable(
        dict[str, Size],
        "Sizes of a closed loop's processes of noise and of its corrections' errors.",
        "this scenario has no processes of its own, which closed loops have",
    ),
    "measurements": FurtherTable(
        dict[str, Size],
        "Sigmas of the noise of a closed loop's measurements.",
        "this scenario has no measurements of its own, which closed loops have",
    ),
    "filter": FurtherTable(
        LoopFilterTable,
        "Error-state Kalman filter of an aided navigation, or beliefs of a closed loop's filter.",
        NO_AIDING,
    ),
    "imu": IMU,
    "faults": FurtherTable(FAULTS.form, FAULTS.description, FAULTS.absent),
}
"""Tables besides ``[scenario]`` and ``[errors]`` that a closed loop reads."""


ERRONEOUS: Final = TypeAdapter[SpikeTable | RampTable | BiasTable](WrongError)
"""Faults of a loop's sensors; outages are instants of its measurements."""


@dataclass(frozen=True)
class Beliefs:
    """Sigmas of sources that the filter believes, by name, SI."""

    errors: Mapping[str, float]


def read_scenario(table: user.UserTable, entries: Mapping[str, Any], context: FileContext) -> ScenarioSpec | None:
    """Build the scenario of a user's class: a closed loop, or one that propagates errors.

    Raises `ScenarioError` when the file cannot be read or executed, or the class does not follow the protocol.
    """
    described = user.read_class(table, entries, context)
    if described is None:
        return None
    loop = described.spec.build_current().value
    if not isinstance(loop, ClosedLoop):
        for name in TABLES:
            if name in context.content:
                reason = f"{UNMEASURED}; " if name in ("filter", "faults") else ""
                context.problem(name, f"{reason}this is no ClosedLoop, whose sizes this table gives; leave it out")
        return user.scenario_spec(described)
    sizes = without_errors(described.spec)
    scenario = ClosedLoopScenario(described.spec, sizes)
    before = len(context.problems)
    instruments = read_instruments(navigator_of(loop), described.spec.name, context)
    read = _read_sizes(scenario.maps, scenario.schedule, context, scenario.states)
    if read is None or len(context.problems) > before:
        return None
    sizes, beliefs, lag, gates = read
    sigmas: Mapping[str, float] = {}
    if instruments is not None:
        sizes, sigmas = instruments.sized(sizes, scenario.maps.structure), instruments.true.sigmas
        beliefs = Beliefs({**instruments.believed.sigmas, **beliefs.errors})
    sized = scenario.with_sizes(sizes).with_filter(lag, gates)

    def complete(scenario: Scenario, errors: ErrorModel) -> Scenario:
        return _with_errors(beliefs, sized, errors)

    return ScenarioSpec(
        sized, described.resolved, described.spec.code, inputs=described.files, complete=complete, sigmas=sigmas,
        tables=dict.fromkeys(sigmas, "[imu]"),
    )  # fmt: skip


def _with_errors(beliefs: Beliefs, scenario: ClosedLoopScenario, errors: ErrorModel) -> ClosedLoopScenario:
    """Return the scenario with the statistics of its errors; the filter believes other sigmas of some of them."""
    start = np.asarray(errors.covariance + np.outer(errors.mean, errors.mean))
    sigmas = np.sqrt(np.diag(start))
    believed = np.array([beliefs.errors.get(name, sigma) for name, sigma in zip(errors.names, sigmas, strict=True)])
    scaled = start * np.outer(*[np.divide(believed, sigmas, out=np.ones_like(sigmas), where=sigmas > 0.0)] * 2)
    unknown = sigmas == 0.0
    scaled[unknown, unknown] = believed[unknown] ** 2
    sizes = scenario.sizes
    return scenario.with_sizes(LoopSizes(replace(sizes.true, start=start), replace(sizes.believed, start=scaled)))


def _read_sizes(
    maps: Maps, schedule: tuple[Instant, ...], context: FileContext, filtered: FilterStates | None
) -> tuple[LoopSizes, Beliefs, float | None, LoopGates] | None:
    """Read true and believed sizes, the smoother's lag, and gates; mistakes are added, and none is returned."""
    before, content = len(context.problems), context.content
    if filtered is None and "filter" in content:
        context.problem("filter", "this loop has no Filter whose beliefs it could give; leave it out")
    given = {name: content[name] for name in NoiseTable.model_fields if name in content}
    stated = validate(NoiseTable, given, context)
    filter_table = validate(LoopFilterTable, content.get("filter", {}), context, "filter")
    if stated is None or filter_table is None:
        return None
    believes = filter_table.believes
    true = _Noise(maps, "", context).read(Sizes.none(maps), stated)
    believed = _Noise(maps, "filter.believes.", context).read(true, believes)
    errors = _believed_errors(maps, believes.errors, context)
    lag = lag_of(filter_table.smoother)
    if lag is not None and filtered is not None and len(filtered.considered):
        message = "is not defined with considers, whose errors the filter's gains leave out; estimate them"
        context.problem("filter.smoother", message)
    question = GateQuestion(filter_table.stops.probability, filter_table.stops.ramp)
    gates = LoopGates(filter_table.gate, question, _read_faults(maps, schedule, context, filtered))
    if len(context.problems) > before:
        return None
    return LoopSizes(true, believed), Beliefs(errors), lag, gates


def _read_faults(
    maps: Maps, schedule: tuple[Instant, ...], context: FileContext, filtered: FilterStates | None
) -> dict[str, tuple[Fault, ...]]:
    """Read the faults of sensors by name; mistakes are added to the context."""
    entries = context.content.get("faults", [])
    if entries and filtered is None:
        context.problem("faults", "this loop has no Filter that uses measurements; leave it out")
        return {}
    if not isinstance(entries, list) or len(entries) > MOST_FAULTS:
        context.problem("faults", f"expected at most {MOST_FAULTS} tables [[faults]]")
        return {}
    numbers = {sensor.declared.name: number for number, sensor in enumerate(maps.sensors)}
    faults: dict[str, tuple[Fault, ...]] = {}
    for place, entry in enumerate(entries, start=1):
        key = f"faults #{place}"
        table = validate_entry(ERRONEOUS, entry, context, key)
        if table is None:
            continue
        number = numbers.get(table.sensor)
        if number is None:
            known = suggestion(table.sensor, list(numbers))
            context.problem(f"{key}.sensor", f"got {table.sensor!r}; no sensor has this name{known}")
            continue
        sensor = maps.sensors[number]
        measured = dict.fromkeys(component_names(sensor), sensor.declared.unit)
        fault = read_error(table, entry, measured, times_of(schedule, number), key, context)
        if fault is not None:
            faults[table.sensor] = (*faults.get(table.sensor, ()), fault)
    return faults


def _believed_errors(maps: Maps, entries: Mapping[str, Any], context: FileContext) -> dict[str, float]:
    """Read believed sigmas by source, or group of sources."""
    sources = {source.name: source for source in maps.structure.sources}
    groups: dict[str, list[str]] = {}
    for source in sources.values():
        groups.setdefault(source.group, []).append(source.name)
    errors = {}
    for name, entry in entries.items():
        key = f"filter.believes.errors.{name}"
        members = [name] if name in sources else groups.get(name, [])
        if not members:
            context.problem(key, f"unknown error source{suggestion(name, list(sources))}")
        for member in members:
            unit = sources[member].unit
            declared = Declared(unit, ("",), may_be_share(unit, sources[member].group))
            errors[member] = float(_read_axes(entry, declared, key, context)[0])
    return errors


@dataclass(frozen=True)
class _Noise:
    """Reads sizes of processes and measurements; ``prefix`` is the beginning of their keys."""

    maps: Maps
    prefix: str
    context: FileContext

    def read(self, known: Sizes, given: NoiseTable | BelievesTable) -> Sizes:
        """Read both tables; what is not given stays as known."""
        return self._measurements(self._processes(known, given.processes), given.measurements)

    def _processes(self, known: Sizes, entries: Mapping[str, Any]) -> Sizes:
        structure, context = self.maps.structure, self.context
        white, markov, decay = known.white.copy(), known.markov.copy(), known.decay.copy()
        initial = known.markov_at_start.copy()
        corrections = list(known.corrections)
        of_white = {quantity.name: (quantity, place) for quantity, place in structure.white.places()}
        of_markov = {quantity.name: (quantity, place) for quantity, place in structure.markov.places()}
        impulses = {quantity.name: number for number, quantity in enumerate(structure.corrections.quantities)}
        names = [*of_white, *of_markov, *impulses]
        for name, entry in entries.items():
            key = f"{self.prefix}processes.{name}"
            if name in of_white:
                quantity, place = of_white[name]
                white[place] = _read_axes(entry, _declared(quantity), key, context)
            elif name in of_markov:
                quantity, of_state = of_markov[name]
                place = slice(of_state.start - structure.markov.begin, of_state.stop - structure.markov.begin)
                markov[place], decay[place], initial[place] = self._markov(entry, quantity, key, decay[place])
            elif name in impulses:
                quantity = structure.corrections.quantities[impulses[name]]
                corrections[impulses[name]] = _read_axes(entry, _declared(quantity), key, context)
            else:
                context.problem(key, f"unknown process{suggestion(name, names)}")
        return replace(
            known, white=white, markov=markov, decay=decay, corrections=tuple(corrections),
            initial=None if np.array_equal(initial, markov) else initial,
        )  # fmt: skip

    def _markov(self, entry: object, quantity: Quantity, key: str, decay: Array) -> tuple[Array, Array, Array]:
        """Read sigmas of a Gauss-Markov process, one over its correlation time, and sigmas at the start.

        A belief may leave out the time, and the sigmas at the start, which are then the stationary ones.
        """
        declared, known = _declared(quantity), bool(decay.any())
        if known and not (isinstance(entry, dict) and entry.keys() & MarkovTable.model_fields.keys()):
            sigmas = _read_axes(entry, declared, key, self.context)
            return sigmas, decay, sigmas
        table = validate_entry(BELIEVED_MARKOV if known else MARKOV, entry, self.context, key, declared)
        if table is None:
            return np.zeros(quantity.size), decay, np.zeros(quantity.size)
        if table.correlation_time is not None:
            decay = np.full(quantity.size, 1.0 / table.correlation_time)
        sigmas, initial = np.nan_to_num(table.sigma), getattr(table, "initial", None)
        return sigmas, decay, sigmas if initial is None else np.nan_to_num(initial)

    def _measurements(self, known: Sizes, entries: Mapping[str, Any]) -> Sizes:
        sensors = {sensor.declared.name: number for number, sensor in enumerate(self.maps.sensors)}
        measurements = list(known.measurements)
        for name, entry in entries.items():
            key = f"{self.prefix}measurements.{name}"
            if name not in sensors:
                self.context.problem(key, f"unknown measurement{suggestion(name, list(sensors))}")
                continue
            sensor = self.maps.sensors[sensors[name]]
            axes = tuple(str(number) for number in range(1, sensor.size + 1))
            measurements[sensors[name]] = _read_axes(entry, Declared(sensor.declared.unit, axes), key, self.context)
        return replace(known, measurements=tuple(measurements))


def _declared(quantity: Quantity) -> Declared:
    return Declared(quantity.unit, quantity.axes or ("",))


def _read_axes(entry: object, declared: Declared, key: str, context: FileContext) -> Array:
    """Read the sizes of some axes, shape (axes,), zero where none is given; mistakes are added to the context."""
    sizes = validate_entry(SIZES, entry, context, key, declared)
    return np.zeros(len(declared.axes)) if sizes is None else np.nan_to_num(sizes)


USER: Final = ScenarioType(user.UserTable, read_scenario, tables=TABLES)
"""A class in the user's own file, a closed loop or another system: ``type = "my_module.py:Boost"``."""
