"""Sizes of what a closed loop declares, in the units and by the axes of the declaration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Final

from pydantic import Field, GetCoreSchemaHandler, GetJsonSchemaHandler, TypeAdapter, ValidationInfo
from pydantic_core.core_schema import CoreSchema, with_info_plain_validator_function

from mcnav.arrays.types import Array
from mcnav.entries.axes import AxisSizes
from mcnav.entries.quantities import Duration, JsonSchema, Later, Table
from mcnav.systems.ins.tables.filter import StopsTable
from mcnav.systems.ins.tables.imu import BelievedImuTable
from mcnav.systems.ins.tables.sensor_tables import Gate, OfGate
from mcnav.systems.smoother_table import SmootherEntry


@dataclass(frozen=True)
class Declared:
    """Unit and axes of a quantity that a class declares: the context of a validation; ``("",)`` for a scalar."""

    unit: str
    axes: tuple[str, ...]
    shares: bool = False


@dataclass(frozen=True)
class DeclaredSizes:
    """Annotation of sizes by axis, shape (axes,), SI, NaN where none is given; see `AxisSizes`."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        def read(entry: object, info: ValidationInfo[Declared]) -> Array:
            return AxisSizes(info.context.unit, info.context.axes, shares=info.context.shares).read(entry)

        return with_info_plain_validator_function(read)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchema:
        return {"type": ["string", "number", "array", "object"]}


Sizes = Annotated[Array, DeclaredSizes()]
CorrelationTime = Annotated[Duration, Field(gt=0.0, description="Correlation time of the process.")]


class MarkovTable(Table):
    """Gauss-Markov process: ``{ sigma = "1 mg", correlation_time = "100 s" }``."""

    expected: ClassVar[str] = 'expected a table such as { sigma = "1 mg", correlation_time = "100 s" }'
    called: ClassVar[str] = "a Gauss-Markov process"
    sigma: Annotated[Sizes, Field(description="Sigma of the process.")]
    correlation_time: CorrelationTime


class BelievedMarkovTable(MarkovTable):
    """A process that a filter believes; its correlation time is the true one unless given."""

    correlation_time: CorrelationTime | None = None  # type: ignore[assignment]
    initial: Annotated[Sizes | None, Field(description="Sigma at the start, where it is not the stationary one.")] = (
        None
    )


Size = Annotated[Any, Later(Sizes), Field(description="A size, sizes by axis, or a table.")]
"""Size of a quantity that the class declares, read by its unit and axes."""


class BelievesTable(Table):
    """``[filter.believes]``: sizes by name, where the filter's differ from the true ones."""

    called: ClassVar[str] = "what a filter believes"
    imu: Annotated[
        Any, Later(BelievedImuTable), Field(description="Believed errors of the instruments of a Strapdown.")
    ] = None
    errors: Annotated[dict[str, Size], Field(description="Believed sigmas of error sources, by name.")] = {}
    processes: Annotated[dict[str, Size], Field(description="Believed sizes of processes, by name.")] = {}
    measurements: Annotated[dict[str, Size], Field(description="Believed sigmas of measurements, by name.")] = {}


class LoopFilterTable(Table):
    """``[filter]`` of a closed loop."""

    called: ClassVar[str] = "a closed loop's filter"
    believes: Annotated[BelievesTable, Field(description="What the filter believes.")] = BelievesTable()
    smoother: Annotated[
        SmootherEntry | None,
        Field(description="Smoother that follows the filter, of which linear analysis is known."),
    ] = None
    gate: Annotated[Gate | None, OfGate] = None
    stops: Annotated[
        StopsTable,
        Field(description="With what probability gates stop errors whose size is asked for, and how long ramps are."),
    ] = StopsTable()


class NoiseTable(Table):
    """``[processes]`` and ``[measurements]`` of a campaign."""

    processes: dict[str, Size] = {}
    measurements: dict[str, Size] = {}


SIZES: Final[TypeAdapter[Array]] = TypeAdapter(Sizes)
MARKOV: Final[TypeAdapter[MarkovTable]] = TypeAdapter(MarkovTable)
BELIEVED_MARKOV: Final[TypeAdapter[MarkovTable]] = TypeAdapter(BelievedMarkovTable)
