"""The tables of a campaign file as pydantic models: structure, units and ranges, each mistake with its key."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, StringConstraints

from mcnav.sampling.designs import DESIGNS
from mcnav.units import quantity


def _read(unit: str) -> BeforeValidator:
    def read(value: object) -> float:
        return quantity(value, unit)

    return BeforeValidator(read)


Length = Annotated[float, _read("m")]
Duration = Annotated[float, _read("s")]
Speed = Annotated[float, _read("m/s")]
AreaPerMass = Annotated[float, _read("m^2/kg")]
TimePerLength = Annotated[float, _read("s/m")]
Number = Annotated[float, _read("1")]
Text = Annotated[
    str,
    StringConstraints(min_length=1, max_length=200, pattern=r"^[^\x00-\x1f\x7f]*[^\x00-\x20\x7f][^\x00-\x1f\x7f]*$"),
]


class Table(BaseModel):
    """A table in which every key must be known and every value of its type."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class ConstantLiftTable(Table):
    """``lift_law = { type = "constant", lift_to_drag = 0.235 }``."""

    type: Literal["constant"]
    lift_to_drag: Annotated[Number, Field(ge=-10.0, le=10.0)]


class VariableLiftTable(Table):
    """``lift_law = { type = "variable", gain = "3.281 s/km", limit = 0.5 }``."""

    type: Literal["variable"]
    gain: Annotated[TimePerLength, Field(gt=0.0)]
    limit: Annotated[Number, Field(gt=0.0, le=10.0)]


class FirstPointTable(Table):
    """Where the truth begins, as NASA TN D-1772, eq. (18): ranges are r_E theta and r_E theta_dot."""

    altitude: Annotated[Length, Field(gt=0.0)]
    range: Length
    altitude_rate: Speed
    range_rate: Speed


class ReentryTable(Table):
    """``[scenario]`` of type reentry."""

    type: Literal["reentry"]
    trajectory: Annotated[int, Field(ge=1, le=7)] | None = None
    first_point: FirstPointTable | None = None
    lift_law: Annotated[ConstantLiftTable | VariableLiftTable, Field(discriminator="type")] | None = None
    ballistic: Annotated[AreaPerMass, Field(ge=0.0, le=100.0)] | None = None
    final_altitude: Length | None = None
    start: Duration | None = None
    axes: Literal["start", "trajectory"] = "start"
    accelerometers_off_above: Annotated[Length, Field(gt=0.0)] | None = None


class CorrelationTable(Table):
    """An entry of ``[[correlations]]``."""

    between: Annotated[list[str], Field(min_length=2, max_length=2)]
    coefficient: Annotated[Number, Field(ge=-1.0, le=1.0)]


class CampaignTable(Table):
    """The whole file. The entries of ``[errors]`` are read by `mcnav.campaign.file`, which knows their units."""

    name: Text | None = None
    samples: Annotated[int, Field(ge=2, le=1_000_000_000)] = 20_000
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    design: Literal[DESIGNS] = "random"  # type: ignore[valid-type]
    tolerance: Annotated[Number, Field(gt=0.0, lt=1.0)] = 0.05
    confidence: Annotated[Number, Field(ge=0.5, lt=1.0)] = 0.95
    scenario: ReentryTable
    errors: dict[str, Any] = {}
    correlations: list[CorrelationTable] = []
