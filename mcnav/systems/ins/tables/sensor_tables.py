"""``[[aiding]]`` and ``[filter.believes.aiding]``: tables that follow from the types of sensors."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterator, Mapping, Set
from dataclasses import dataclass
from functools import cache, reduce
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import AfterValidator, BeforeValidator, Field, PlainValidator, WithJsonSchema, create_model

from mcnav.arrays.types import Array
from mcnav.entries.axes import AxisSizes, Fault, within
from mcnav.entries.mistakes import Mistake, told
from mcnav.entries.quantities import UNIT, Later, OneOf, QuantityIn, Table
from mcnav.entries.rules import SomeOf
from mcnav.entries.unions import ByTypeIn, Either
from mcnav.entries.validation import AnyTable
from mcnav.physics.units import dimension_of, printable, quantity
from mcnav.systems.ins.imu.instruments import AXES
from mcnav.systems.ins.sensors.quantity import OFFSETS, FurtherKey, QuantityDefinition, SensorType
from mcnav.systems.ins.sensors.registry import QUANTITIES, SENSOR_TYPES
from mcnav.systems.ins.sensors.sources import LEVER_ARM, SCALE_FACTOR
from mcnav.systems.ins.tables.instants import InstantRule, InstantsTable

MULTIPLE: Final = 1e9
"""Multiple of an error's usual size, and share of it, beyond which a size is refused: a slip of the pen."""

SHORTEST_CORRELATION: Final = 1e-15
"""Correlation time, s; its reciprocal is the longest one."""

LONGEST_LEVER_ARM: Final = 1e5
"""m."""

LARGEST_FLEXURE: Final = 0.3
"""rad."""

NEVER_LATE: Final = "the vehicle is at rest, and nothing that it measures changes: it cannot be late; leave it out"

LONGEST_DELAY: Final = 60.0
"""Sigma of a delay, s."""

MOST_SENSORS: Final = 100

NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}")

Fields = Mapping[str, tuple[Any, Any]]
"""Fields of a table by key, each with its type and default."""


def _read_name(entry: object) -> str:
    if not isinstance(entry, str) or not NAME.fullmatch(entry):
        raise told(f"got {entry!r}; expected at most 40 letters, digits and _, a letter first")
    return entry


def _read_gate(entry: object) -> float:
    gate = quantity(entry, "1")
    if not 0.0 < gate < 1.0:
        raise told(f"got {entry!r}; expected a probability between 0 and 1, such as 0.999")
    return gate


def _read_delay(entry: object) -> float:
    size = quantity(entry, "s")
    if wrong := within(0.0, LONGEST_DELAY, "s")(size):
        raise told(f"got {entry!r}; {wrong}")
    return size


OfName: Final = WithJsonSchema({"type": "string", "pattern": f"^{NAME.pattern}$"})
SensorName = Annotated[str, PlainValidator(_read_name), OfName]
Gate = Annotated[
    float,
    PlainValidator(_read_gate),
    WithJsonSchema({UNIT: "1", "gt": 0.0, "lt": 1.0, "examples": [0.999]}),
]
Delay = Annotated[
    float,
    PlainValidator(_read_delay),
    WithJsonSchema({UNIT: "s", "ge": 0.0, "le": LONGEST_DELAY, "examples": ["20 ms"]}),
]
OfGate: Final = Field(description="Probability with which an expected measurement is accepted.")


@dataclass(frozen=True)
class MeasuresOne:
    """At least one of a sensor's quantities is measured; see `Rule`."""

    quantities: tuple[str, ...]

    def broken(self, given: Set[str], expected: str) -> Mistake | None:
        """See `Rule`."""
        missing = f"is missing; expected the sigma of {' or '.join(self.quantities)}"
        return None if given & {*self.quantities, "log"} else Mistake(missing, self.quantities[:1])

    @property
    def schema(self) -> Mapping[str, object]:
        """See `Rule`."""
        return {"anyOf": [{"required": [key]} for key in (*self.quantities, "log")]}


class NamedTable(Table):
    """A type, and a name."""

    type: str
    name: Annotated[SensorName | None, Field(description="Name of its own; its type unless given.")] = None


class SensorTable(InstantsTable, NamedTable):
    """An entry of ``[[aiding]]`` but for what follows from its type; a type and a name are its first keys."""

    gate: Annotated[Gate | None, OfGate] = None


class CorrelatedTable(Table):
    """First-order Gauss-Markov error: ``{ sigma = "2 m", correlation_time = "100 s" }``."""

    sigma: Any = None
    correlation_time: Any = None


def _model(name: str, base: type[AnyTable], **fields: Any) -> type[AnyTable]:
    """Return a table with further fields, each a type and a default."""
    return create_model(name, __base__=base, **fields)


def _sizes(unit: str, axes: tuple[str, ...], fault: Fault, description: str, *examples: str) -> tuple[Any, Any]:
    """Return the field of sizes by axis."""
    sizes = Annotated[Array, AxisSizes(unit, axes, fault)]
    return Annotated[sizes | None, Field(description=description, examples=list(examples) or None)], None


def _correlated(measured: str, of: QuantityDefinition, believed: bool) -> tuple[Any, Any]:
    """Return the field of a Gauss-Markov error; one that a filter believes may have one of its sizes alone."""
    keys = ("sigma", "correlation_time")

    def expected(sigma: str) -> str:
        return f'expected {{ sigma = "{sigma}", correlation_time = "100 s" }}'

    def refuse_text(entry: object) -> object:
        if isinstance(entry, str):
            raise told(f"got {entry!r}; {expected(printable(entry, 20))}")
        return entry

    positive = within(SHORTEST_CORRELATION, 1.0 / SHORTEST_CORRELATION, "s", "expected a time above zero")
    table = _model(
        "CorrelatedTable",
        base=CorrelatedTable,
        rules=(ClassVar[Any], (SomeOf(keys, 1 if believed else 2),)),
        expected=(ClassVar[str], expected(dimension_of(of.unit).example)),
        sigma=_sizes(of.unit, of.axes, within(0.0, MULTIPLE * of.usual, of.unit), "Sigma of the process."),
        correlation_time=_sizes("s", of.axes, positive, "Correlation time of the process.", "100 s"),
    )
    described = Field(description=f"First-order Gauss-Markov error of the {measured}.")
    return Annotated[Annotated[table, BeforeValidator(refuse_text)] | None, described], None


def _errors(kind: SensorType, believed: bool = False) -> Fields:
    """Return the fields of a sensor's errors."""
    measured = {key: QUANTITIES[name] for key, name in kind.quantities.items()}
    fields: dict[str, tuple[Any, Any]] = {}
    for key, of in measured.items():
        fault = within(of.usual / MULTIPLE, MULTIPLE * of.usual, of.unit, "expected a sigma above zero")
        fields[key] = _sizes(of.unit, of.axes, fault, f"Sigma of the white noise of one measurement of the {key}.")
    for key, of in measured.items():
        if kind.errors:
            fault = within(0.0, MULTIPLE * of.usual, of.unit)
            bias = _sizes(of.unit, of.axes, fault, f"Sigma of the constant bias of the {key}.")
            fields[kind.key(key, "bias")] = bias
            fields[kind.key(key, "correlated")] = _correlated(key, of, believed)
        if of.scaled:
            unit, _, usual = SCALE_FACTOR
            scale = _sizes(
                unit, of.axes, within(0.0, MULTIPLE * usual, unit), f"Sigma of the scale factor of the {key}."
            )
            fields[kind.key(key, "scale_factor")] = scale
    if kind.lever_arm:
        fields["lever_arm"] = _lever_arm()
        fault = within(0.0, MULTIPLE * LEVER_ARM[2], LEVER_ARM[0])
        fields["lever_arm_error"] = _sizes(LEVER_ARM[0], AXES, fault, "Sigma of the lever arm's error.", "1 cm")
    for offset in kind.offsets:
        axes, unit, _, usual = OFFSETS[offset]
        fault = within(0.0, MULTIPLE * usual, unit)
        fields[f"{offset}_error"] = _sizes(unit, axes, fault, f"Sigma of the error of the {offset}.")
    if kind.flexure:
        fields["flexure"] = _flexure()
    if kind.delays:
        fields["delay"] = _delay("Sigma of a constant delay: how much later than it was measured a value is stamped.")
        fields["jitter"] = _delay("Sigma of a delay of its own of each measurement, common to all that it measures.")
    return fields


def _delay(description: str) -> tuple[Any, Any]:
    return Annotated[Delay | None, Field(description=description)], None


def _lever_arm() -> tuple[Any, Any]:
    fault = within(-LONGEST_LEVER_ARM, LONGEST_LEVER_ARM, "m", f"at most {LONGEST_LEVER_ARM:.3g} m makes sense")
    expected = 'expected lengths forward, right and down such as ["1 m", "0 m", "-0.5 m"]'
    arm = Annotated[Array, AxisSizes(LEVER_ARM[0], AXES, fault, one_by_one=expected)]
    return Annotated[arm | None, Field(description="From the unit to the antenna, forward, right and down.")], None


def _read_flexure(table: FlexureTable) -> FlexureTable:
    given = {name for name in ("frequency", "damping", "correlation_time") if getattr(table, name) is not None}
    if "correlation_time" in given and len(given) > 1:
        raise told("got a frequency or a damping and a correlation_time; expected frequency and damping, or the other")
    return table


class FlexureTable(Table):
    """Second-order Gauss-Markov angles: ``{ sigma = "1 mrad", frequency = "2 Hz", damping = 0.1 }``."""

    expected: ClassVar[str] = 'expected { sigma = "1 mrad", frequency = "2 Hz", damping = 0.1 }'
    called: ClassVar[str] = "a flexure"
    sigma: Annotated[
        Annotated[Array, AxisSizes("rad", AXES, within(0.0, LARGEST_FLEXURE, "rad", "expected small angles"))] | None,
        Field(description="Sigma of the angle about each axis of the body.", examples=["1 mrad"]),
    ] = None
    frequency: Annotated[
        Annotated[float, QuantityIn("1/s")] | None,
        Field(gt=0.0, le=1e4, description="Natural frequency, Hz.", examples=["2 Hz"]),
    ] = None
    damping: Annotated[
        float | None, Field(gt=0.0, le=1.0, description="Damping ratio, at most 1; 1 unless given.", examples=[0.1])
    ] = None
    correlation_time: Annotated[
        Annotated[float, QuantityIn("s")] | None,
        Field(gt=0.0, le=1e6, description="In place of a frequency: that of critical damping.", examples=["5 s"]),
    ] = None


def _flexure() -> tuple[Any, Any]:
    described = Field(description="Flexure of the structure between the unit and the sensor.")
    return Annotated[Annotated[FlexureTable, AfterValidator(_read_flexure)] | None, described], None


def _further(key: FurtherKey) -> tuple[Any, Any]:
    """Return the field of a key that the type of sensor reads itself."""
    form = Annotated[str, OneOf(key.choices)] if key.choices else Annotated[float, QuantityIn(key.unit)]
    form = form if key.form is None else key.form
    return Annotated[Any, Later(form), Field(description=key.meaning)], None


def _sensor_table(kind: SensorType) -> type[SensorTable]:
    return _model(
        f"{kind.name} sensor",
        base=SensorTable,
        rules=(ClassVar[Any], (InstantRule(), MeasuresOne(tuple(kind.quantities)))),
        called=(ClassVar[str], f"type {kind.name}"),
        refused=_refused(kind),
        type=(Annotated[Literal[kind.name], Field(description=kind.words)], ...),
        **_errors(kind),
        **{key: _further(entry) for key, entry in kind.further.items()},
    )


def _refused(kind: SensorType) -> tuple[Any, Any]:
    """Return the keys that a type of sensor refuses with a reason."""
    return ClassVar[Mapping[str, str]], {} if kind.delays else dict.fromkeys(("delay", "jitter"), NEVER_LATE)


def _believed_table(kind: SensorType) -> type[Table]:
    fields = {key: field for key, field in _errors(kind, believed=True).items() if key != "lever_arm"}
    return _model(f"believed {kind.name} sensor", base=Table, refused=_refused(kind), **fields)


class Tables(Mapping[str, type[Table]]):
    """Tables by type of sensor, each made when it is asked for: one takes 3 ms."""

    def __init__(self, make: Callable[[SensorType], type[Table]]) -> None:
        self._make = cache(lambda name: make(SENSOR_TYPES[name]))

    def __getitem__(self, name: str) -> type[Table]:
        return self._make(name)

    def __iter__(self) -> Iterator[str]:
        return iter(SENSOR_TYPES)

    def __len__(self) -> int:
        return len(SENSOR_TYPES)


SENSORS: Final = Tables(_sensor_table)
"""Tables of ``[[aiding]]`` by type of sensor."""

BELIEVED: Final = Tables(_believed_table)
"""Tables of ``[filter.believes.aiding]`` by type of sensor."""

OfSensor: Final = Field(description="A sensor, its instants, and the sizes of its errors.")
AnySensor: Final[Any] = Annotated[SensorTable, ByTypeIn(SENSORS), OfSensor]
Sensors: Final[Any] = Annotated[list[AnySensor], Field(max_length=MOST_SENSORS)]
"""``[[aiding]]``."""


def believed_sensor() -> Any:
    """Return the type of an entry of ``[filter.believes.aiding]``, whose sensor ``[[aiding]]`` describes."""
    described = Field(description="Errors that the filter takes others for.")
    return Annotated[reduce(operator.or_, BELIEVED.values()), Either(), described]
