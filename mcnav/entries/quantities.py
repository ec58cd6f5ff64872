"""Fields of a campaign file as pydantic models: quantities with their units, and tables whose keys must be known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Final

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    StringConstraints,
    WithJsonSchema,
)
from pydantic_core.core_schema import CoreSchema, no_info_before_validator_function

from mcnav.units import quantity

UNIT: Final = "x-unit"
"""Key of a JSON schema that stands for a quantity: its SI unit; `mcnav.config.json_schema` writes it out."""


@dataclass(frozen=True)
class QuantityIn:
    """Annotation of a field that holds a quantity with its unit, which is read into an SI unit."""

    unit: str

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return no_info_before_validator_function(lambda value: quantity(value, self.unit), handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {**handler(schema), UNIT: self.unit}


Length = Annotated[float, QuantityIn("m")]


Duration = Annotated[float, QuantityIn("s")]


Speed = Annotated[float, QuantityIn("m/s")]


Acceleration = Annotated[float, QuantityIn("m/s^2")]


AreaPerMass = Annotated[float, QuantityIn("m^2/kg")]


TimePerLength = Annotated[float, QuantityIn("s/m")]


AngularRate = Annotated[float, QuantityIn("rad/s")]


GravitationalParameter = Annotated[float, QuantityIn("m^3/s^2")]


Number = Annotated[float, QuantityIn("1")]


Probability = Annotated[Number, Field(gt=0.0, lt=1.0)]


Written = Annotated[Any, WithJsonSchema({UNIT: ""})]
"""A quantity whose unit another part of the file decides; it is read later."""


Text = Annotated[
    str,
    StringConstraints(min_length=1, max_length=200, pattern=r"^[^\x00-\x1f\x7f]*[^\x00-\x20\x7f][^\x00-\x1f\x7f]*$"),
]


class Table(BaseModel):
    """A table whose keys must be known and whose values must have the right type."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)
