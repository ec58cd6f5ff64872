"""Tables of a closed loop's campaign: ``[processes]``, ``[measurements]``, and ``[filter.believes]``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Final

import numpy as np
from pydantic import Field, TypeAdapter, WithJsonSchema

from mcnav._types import Array
from mcnav.contract.scenario import Scenario
from mcnav.entries.axes import AxisSizes
from mcnav.entries.context import FileContext
from mcnav.entries.quantities import Later, Table
from mcnav.entries.validation import validate_entry
from mcnav.errors import suggestion
from mcnav.sampling.error_model import ErrorModel
from mcnav.systems.closed_loop.declarations import ClosedLoop
from mcnav.systems.closed_loop.filter import FilterStates
from mcnav.systems.closed_loop.maps import Maps
from mcnav.systems.closed_loop.quantities import Quantity
from mcnav.systems.closed_loop.scenario import ClosedLoopScenario, without_errors
from mcnav.systems.closed_loop.sizes import LoopSizes, Sizes
from mcnav.systems.closed_loop.strapdown.merged import navigator_of
from mcnav.systems.closed_loop.strapdown.table import read_instruments
from mcnav.systems.description import FurtherTable, ScenarioSpec, ScenarioType
from mcnav.systems.ins.tables.imu import IMU, BelievedImuTable
from mcnav.systems.user import table as user

Size = Annotated[
    Any,
    WithJsonSchema(
        {"description": "A size, sizes by axis, or a table.", "type": ["string", "number", "array", "object"]}
    ),
]
"""Size of a quantity that the class declares, read by its unit and axes."""


class BelievesTable(Table):
    """``[filter.believes]``: sizes by name, where the filter's differ from the true ones."""

    imu: Annotated[
        Any, Later(BelievedImuTable), Field(description="Believed errors of the instruments of a Strapdown.")
    ] = None
    errors: Annotated[dict[str, Size] | None, Field(description="Believed sigmas of error sources, by name.")] = None
    processes: Annotated[dict[str, Size] | None, Field(description="Believed sizes of processes, by name.")] = None
    measurements: Annotated[dict[str, Size] | None, Field(description="Believed sigmas of measurements, by name.")] = (
        None
    )


class LoopFilterTable(Table):
    """``[filter]`` of a closed loop."""

    believes: Annotated[BelievesTable | None, Field(description="What the filter believes.")] = None


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
        "this scenario cannot be aided, which those of type ins can",
    ),
    "imu": IMU,
}
"""Tables besides ``[scenario]`` and ``[errors]`` that a closed loop reads."""

BELIEFS: Final = ("errors", "processes", "measurements", "imu")


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
                context.problem(name, "this scenario is no ClosedLoop, whose sizes this table gives; leave it out")
        return user.scenario_spec(described)
    sizes = without_errors(described.spec)
    scenario = ClosedLoopScenario(described.spec, sizes)
    before = len(context.problems)
    instruments = read_instruments(navigator_of(loop), described.spec.name, context)
    read = _read_sizes(scenario.maps, context, scenario.states)
    if read is None or len(context.problems) > before:
        return None
    sizes, beliefs = read
    sigmas: Mapping[str, float] = {}
    if instruments is not None:
        sizes, sigmas = instruments.sized(sizes, scenario.maps.structure), instruments.true.sigmas
        beliefs = Beliefs({**instruments.believed.sigmas, **beliefs.errors})
    sized = scenario.with_sizes(sizes)

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


def _read_sizes(maps: Maps, context: FileContext, filtered: FilterStates | None) -> tuple[LoopSizes, Beliefs] | None:
    """Read true and believed sizes; mistakes are added to the context, and none is returned."""
    before, content = len(context.problems), context.content
    if filtered is None and "filter" in content:
        context.problem("filter", "this loop has no Filter whose beliefs it could give; leave it out")
    true = _read_noise(maps, Sizes.none(maps), content, "", context)
    table = content.get("filter", {})
    believes = table.get("believes", {}) if isinstance(table, dict) else {}
    if not isinstance(table, dict) or not isinstance(believes, dict):
        context.problem("filter", "expected a table such as [filter.believes.measurements]")
        return None
    context.check_keys(table, ["believes"], "filter", "a closed loop's filter")
    context.check_keys(believes, list(BELIEFS), "filter.believes", "what a filter believes")
    believed = _read_noise(maps, true, believes, "filter.believes.", context)
    given, errors = believes.get("errors", {}), {}
    sources = {source.name: source for source in maps.structure.sources}
    groups: dict[str, list[str]] = {}
    for source in sources.values():
        groups.setdefault(source.group, []).append(source.name)
    for name, entry in given.items() if isinstance(given, dict) else ():
        key = f"filter.believes.errors.{name}"
        members = [name] if name in sources else groups.get(name, [])
        if not members:
            context.problem(key, f"unknown error source{suggestion(name, list(sources))}")
        for member in members:
            errors[member] = float(_read_axes(entry, sources[member].unit, [""], key, context)[0])
    return None if len(context.problems) > before else (LoopSizes(true, believed), Beliefs(errors))


def _read_noise(maps: Maps, known: Sizes, content: Mapping[str, Any], prefix: str, context: FileContext) -> Sizes:
    """Read ``processes`` and ``measurements``; what is not given stays as known."""
    structure = maps.structure
    white, markov, decay = known.white.copy(), known.markov.copy(), known.decay.copy()
    corrections, measurements = list(known.corrections), list(known.measurements)
    of_white = {quantity.name: (quantity, place) for quantity, place in structure.white.places()}
    begin = structure.markov.begin
    of_markov = {
        quantity.name: (quantity, slice(place.start - begin, place.stop - begin))
        for quantity, place in structure.markov.places()
    }
    impulses = {quantity.name: number for number, quantity in enumerate(structure.corrections.quantities)}
    names = [*of_white, *of_markov, *impulses]
    for name, entry in _entries(content, "processes", prefix, context):
        key = f"{prefix}processes.{name}"
        if name in of_white:
            quantity, place = of_white[name]
            white[place] = _read_axes(entry, quantity.unit, quantity.axes or ("",), key, context)
        elif name in of_markov:
            quantity, place = of_markov[name]
            markov[place], decay[place] = _read_markov(entry, quantity, key, context, markov[place], decay[place])
        elif name in impulses:
            quantity = structure.corrections.quantities[impulses[name]]
            corrections[impulses[name]] = _read_axes(entry, quantity.unit, quantity.axes or ("",), key, context)
        else:
            context.problem(key, f"unknown process{suggestion(name, names)}")
    sensors = {sensor.declared.name: number for number, sensor in enumerate(maps.sensors)}
    for name, entry in _entries(content, "measurements", prefix, context):
        key = f"{prefix}measurements.{name}"
        if name not in sensors:
            context.problem(key, f"unknown measurement{suggestion(name, list(sensors))}")
            continue
        sensor = maps.sensors[sensors[name]]
        axes: Sequence[str] = tuple(str(each) for each in range(1, sensor.size + 1))
        measurements[sensors[name]] = _read_axes(entry, sensor.declared.unit, axes, key, context)
    return replace(
        known, white=white, markov=markov, decay=decay, measurements=tuple(measurements), corrections=tuple(corrections)
    )


def _entries(
    content: Mapping[str, Any], table: str, prefix: str, context: FileContext
) -> Sequence[tuple[str, Any]]:  # fmt: skip
    entries = content.get(table, {})
    if not isinstance(entries, dict):
        context.problem(f"{prefix}{table}", "expected a table of sizes by name")
        return ()
    return tuple(entries.items())


def _read_markov(
    entry: object, quantity: Quantity, key: str, context: FileContext, sigma: Array, decay: Array
) -> tuple[Array, Array]:
    """Read ``{ sigma = …, correlation_time = … }``; a belief may leave out the time."""
    given = entry if isinstance(entry, dict) and "sigma" in entry else None
    if given is None:
        if not decay.any():
            context.problem(key, 'expected a table such as { sigma = "1 mg", correlation_time = "100 s" }')
            return sigma, decay
        return _read_axes(entry, quantity.unit, quantity.axes or ("",), key, context), decay
    context.check_keys(given, ["sigma", "correlation_time"], key, "a Gauss-Markov process")
    sigma = _read_axes(given["sigma"], quantity.unit, quantity.axes or ("",), f"{key}.sigma", context)
    if "correlation_time" not in given:
        if not decay.any():
            context.problem(key, "needs a correlation_time")
        return sigma, decay
    time = context.quantity(given["correlation_time"], "s", f"{key}.correlation_time")
    if time is not None and not time > 0.0:
        context.problem(f"{key}.correlation_time", "must be above zero")
    return sigma, np.full(len(sigma), 1.0 / time if time else 0.0)


def _read_axes(entry: object, unit: str, axes: Sequence[str], key: str, context: FileContext) -> Array:
    """Read the sizes of some axes, shape (axes,), zero where none is given; mistakes are added to the context."""
    sizes = validate_entry(TypeAdapter(Annotated[Array, AxisSizes(unit, tuple(axes))]), entry, context, key)
    return np.zeros(len(axes)) if sizes is None else np.nan_to_num(sizes)


USER: Final = ScenarioType(user.UserTable, read_scenario, tables=TABLES)
"""A class in the user's own file, a closed loop or another system: ``type = "my_module.py:Boost"``."""
