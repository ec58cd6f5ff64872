"""The tables of a campaign file as pydantic models: structure, units and ranges.

The tables of ``[scenario]`` are in `mcnav.config.scenarios`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, StringConstraints

from mcnav.sampling.designs import DESIGNS
from mcnav.units import quantity


def read_as(unit: str) -> BeforeValidator:
    """Return the validator of a field that holds a quantity with its unit."""

    def read(value: object) -> float:
        return quantity(value, unit)

    return BeforeValidator(read)


Length = Annotated[float, read_as("m")]
Duration = Annotated[float, read_as("s")]
Speed = Annotated[float, read_as("m/s")]
Acceleration = Annotated[float, read_as("m/s^2")]
AreaPerMass = Annotated[float, read_as("m^2/kg")]
TimePerLength = Annotated[float, read_as("s/m")]
AngularRate = Annotated[float, read_as("rad/s")]
GravitationalParameter = Annotated[float, read_as("m^3/s^2")]
Number = Annotated[float, read_as("1")]
Probability = Annotated[Number, Field(gt=0.0, lt=1.0)]
Text = Annotated[
    str,
    StringConstraints(min_length=1, max_length=200, pattern=r"^[^\x00-\x1f\x7f]*[^\x00-\x20\x7f][^\x00-\x1f\x7f]*$"),
]


class Table(BaseModel):
    """A table whose keys must be known and whose values must have the right type."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class CorrelationTable(Table):
    """An entry of ``[[correlations]]``."""

    between: Annotated[list[str], Field(min_length=2, max_length=2)]
    coefficient: Annotated[Number, Field(ge=-1.0, le=1.0)] | None = None
    rank_coefficient: Annotated[Number, Field(ge=-1.0, le=1.0)] | None = None


class JointTable(Table):
    """An entry of ``[[joint]]``: sources that share their tails."""

    sources: Annotated[list[str], Field(min_length=2)]
    distribution: Literal["student-t"]
    degrees_of_freedom: Number


class StartTimesTable(Table):
    """``[start_times]``; `mcnav.config.start_times` reads weights and errors with their units."""

    count: Annotated[int, Field(ge=2, le=100_000)] = 241
    axes: Literal["start", "trajectory"] = "start"
    check: Annotated[list[Duration], Field(max_length=100)] = []
    samples: Annotated[int, Field(ge=100, le=1_000_000)] = 4_000
    weights: dict[str, Any] = {}
    errors: dict[str, Annotated[list[Any], Field(min_length=1)]] = {}


class QuantileTable(Table):
    """``[[accept.quantile]]``: a quantile of an output's absolute value lies below a limit."""

    output: str
    probability: Probability
    below: Any
    after: Duration | None = None
    during: Any = None
    at: Duration | None = None


class CircularTable(Table):
    """``[[accept.cep]]`` and ``[[accept.r95]]``: 50 or 95 % of all errors in two outputs lie within a circle."""

    outputs: Annotated[list[str], Field(min_length=2, max_length=2)]
    below: Any
    after: Duration | None = None
    during: Any = None
    at: Duration | None = None


class SphericalTable(CircularTable):
    """``[[accept.sep]]``: half of all errors in three outputs lie within a sphere."""

    outputs: Annotated[list[str], Field(min_length=3, max_length=3)]


class BoxTable(Table):
    """``[[accept.box]]``: the absolute values of some outputs lie within limits jointly, with a probability."""

    within: dict[str, Any]
    probability: Probability


class AcceptTable(Table):
    """``[accept]``."""

    sigma_ratio: Annotated[Number, Field(gt=0.0, lt=1.0)] | None = None
    quantile: Annotated[list[QuantileTable], Field(max_length=100)] = []
    cep: Annotated[list[CircularTable], Field(max_length=100)] = []
    r95: Annotated[list[CircularTable], Field(max_length=100)] = []
    sep: Annotated[list[SphericalTable], Field(max_length=100)] = []
    box: Annotated[list[BoxTable], Field(max_length=100)] = []


class UntilTable(Table):
    """``samples = { until = "sigma_ratio 1 %", confidence = 0.95, at_most = 1_000_000 }``."""

    until: str
    confidence: Annotated[Number, Field(ge=0.5, lt=1.0)] = 0.95
    at_most: Annotated[int, Field(ge=2, le=1_000_000_000)]


class CampaignTable(Table):
    """The whole file; `mcnav.config.read` reads ``[scenario]`` and ``[errors]`` by type and units.

    ``[[aiding]]`` and ``[filter]`` are read with the scenario.
    """

    name: Text | None = None
    samples: Annotated[int, Field(ge=2, le=1_000_000_000_000)] = 20_000
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    design: Literal[DESIGNS] = "random"  # type: ignore[valid-type]
    store: Literal["samples", "summary"] = "samples"
    tolerance: Annotated[Number, Field(gt=0.0, lt=1.0)] = 0.05
    confidence: Annotated[Number, Field(ge=0.5, lt=1.0)] = 0.95
    sample_timeout: Annotated[Duration, Field(ge=0.001, le=1e6)] | None = None
    scenario: dict[str, Any]
    imu: dict[str, Any] | None = None
    aiding: Any = None
    filter: Any = None
    errors: dict[str, Any] = {}
    correlations: Annotated[list[CorrelationTable], Field(max_length=1_000)] = []
    joint: Annotated[list[JointTable], Field(max_length=100)] = []
    start_times: StartTimesTable = StartTimesTable()
    accept: AcceptTable | None = None
