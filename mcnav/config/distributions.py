"""Entries of ``[errors]``: a sigma, or a table with a distribution, in the unit of the error source.

The models are what both the reading of campaign files and their schema for editors follow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any, ClassVar, Final, Literal

import numpy as np
from pydantic import Field, GetCoreSchemaHandler, GetJsonSchemaHandler, TypeAdapter, ValidationInfo, create_model
from pydantic_core.core_schema import CoreSchema, float_schema, with_info_before_validator_function

from mcnav.config.table_of_values import read_values
from mcnav.contract.quantities import Source
from mcnav.entries.context import FileContext
from mcnav.entries.mistakes import Mistake, refuse, told
from mcnav.entries.quantities import UNIT, JsonSchema, Number, Table
from mcnav.entries.unions import ByType, Family, OrFirst
from mcnav.errors import suggestion
from mcnav.physics.units import quantity
from mcnav.sampler.distributions import Distribution, Fixed, Normal, StudentT, Triangular, TruncatedNormal, Uniform
from mcnav.sampler.scipy_and_tables import ScipyDistribution, continuous_distributions, shape_names

KIND: Final = "distribution"
"""Key that decides about the others."""

SCIPY: Final = "scipy."
"""Prefix of the name of a scipy.stats distribution."""

LARGEST_MULTIPLE: Final = 1e9
"""Multiple of a source's usual size above which an error is refused: a slip of the pen, and a risk of overflow."""

Meaning: Final = Field(
    description=f"Distribution; normal unless given. {SCIPY}NAME is any continuous one of scipy.stats."
)


def implausible(size: float, source: Source) -> str:
    """Return what is wrong with an error that is larger than `LARGEST_MULTIPLE` allows; nothing if it is not.

    An angle is at most half a turn, unless that is no more than its usual size.
    """
    if source.unit == "rad" and abs(size) > np.pi > source.nominal:
        return "at most 180 deg makes sense"
    largest = LARGEST_MULTIPLE * source.nominal
    if abs(size) <= largest:
        return ""
    return f"at most {largest:.3g}{'' if source.unit == '1' else f' {source.unit}'} makes sense"


@dataclass(frozen=True)
class InUnitOfSource:
    """Annotation of a quantity in the unit of an error source, which the validation is given as its context.

    Attributes
    ----------
    limited : bool
        Whether it is refused where it is implausible.
    """

    limited: bool = True

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        def read(entry: object, info: ValidationInfo[Source]) -> float:
            value = quantity(entry, info.context.unit, info.context.shares)
            if self.limited and (wrong := implausible(value, info.context)):
                raise told(f"got {entry!r}; {wrong}")
            return value

        return with_info_before_validator_function(read, float_schema())

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchema:
        return {**handler(schema), UNIT: ""}


Size = Annotated[float, InUnitOfSource()]
Parameter = Annotated[float, InUnitOfSource(limited=False)]
Sigma = Annotated[Size, Field(description="Standard deviation.")]
HalfWidth = Annotated[Size, Field(description="Half of the interval, which is symmetric about zero.")]


class DistributionTable(Table):
    """A table with a distribution."""

    told_by: ClassVar[str] = KIND
    makes: ClassVar[Callable[..., Distribution]]
    """Makes the distribution from the other keys, SI; `ValueError` where it is impossible."""

    def parameters(self) -> dict[str, float]:
        """Return the keys but the first, SI."""
        return {name: getattr(self, name) for name in type(self).model_fields if name != KIND}

    def build(self, source: Source, context: FileContext) -> Distribution:
        """Build the distribution; `ValueError` when it is impossible, `ValuesError` when a file is wrong."""
        return type(self).makes(**self.parameters())


class NormalTable(DistributionTable):
    """``{ mean = "5 km", sigma = "1 km" }``."""

    called: ClassVar[str] = "a normal distribution"
    makes = Normal
    distribution: Annotated[Literal["normal"], Meaning] = "normal"
    sigma: Sigma
    mean: Annotated[Size, Field(description="Mean of the error; zero unless given.")] = 0.0


class UniformTable(DistributionTable):
    """``{ distribution = "uniform", half_width = "1 km" }``."""

    called: ClassVar[str] = "a uniform distribution"
    makes = Uniform
    distribution: Annotated[Literal["uniform"], Meaning]
    half_width: HalfWidth


class TruncatedNormalTable(DistributionTable):
    """``{ distribution = "truncated-normal", sigma = "1 km", limit = "2 km" }``."""

    called: ClassVar[str] = "a truncated-normal distribution"
    makes = TruncatedNormal
    distribution: Annotated[Literal["truncated-normal"], Meaning]
    sigma: Sigma
    limit: Annotated[Size, Field(description="Largest magnitude.")]


class TriangularTable(DistributionTable):
    """``{ distribution = "triangular", half_width = "1 km" }``."""

    called: ClassVar[str] = "a triangular distribution"
    makes = Triangular
    distribution: Annotated[Literal["triangular"], Meaning]
    half_width: HalfWidth


class StudentTTable(DistributionTable):
    """``{ distribution = "student-t", sigma = "1 km", degrees_of_freedom = 5 }``."""

    called: ClassVar[str] = "a student-t distribution"
    makes = StudentT
    distribution: Annotated[Literal["student-t"], Meaning]
    sigma: Sigma
    degrees_of_freedom: Annotated[Number, Field(gt=2.0, description="Degrees of freedom.")]


class FixedTable(DistributionTable):
    """``{ distribution = "fixed", value = "1 km" }``."""

    called: ClassVar[str] = "a fixed distribution"
    makes = Fixed
    distribution: Annotated[Literal["fixed"], Meaning]
    value: Annotated[Size, Field(description="The error, the same in every sample.")]

    def parameters(self) -> dict[str, float]:
        """Return the value as the mean, SI."""
        return {"mean": self.value}


class ValuesTable(DistributionTable):
    """``{ distribution = "table", file = "gyro.csv", column = "drift", unit = "deg/h" }``: CSV or parquet."""

    called: ClassVar[str] = "a table"
    distribution: Annotated[Literal["table"], Meaning]
    file: Annotated[str, Field(description="CSV or parquet file with the values, relative to the campaign file.")]
    column: Annotated[str, Field(description="Column of the file.")]
    unit: Annotated[str, Field(description="Unit of the column.")]
    sha256: Annotated[str | None, Field(description="Digest of the values, which files in run folders have.")] = None

    def build(self, source: Source, context: FileContext) -> Distribution:
        """Read the values; see `DistributionTable`."""
        return read_values(self.file, self.column, f"1 {self.unit}", self.sha256, source, context)


class ScipyParameters(DistributionTable):
    """Keys of every distribution of scipy.stats."""

    distribution: Annotated[str, Field(pattern=r"^scipy\."), Meaning]
    loc: Annotated[Parameter, Field(description="Location, as in scipy.stats; zero unless given.")] = 0.0
    scale: Annotated[Parameter, Field(description="Scale, as in scipy.stats.")]

    def build(self, source: Source, context: FileContext) -> Distribution:
        """Build the distribution; see `DistributionTable`."""
        name, values = self.distribution.removeprefix(SCIPY), self.parameters()
        return ScipyDistribution(
            name, tuple((shape, values[shape]) for shape in shape_names(name)), self.loc, self.scale
        )


class ScipyTable(ScipyParameters, Family, extra="allow"):
    """``{ distribution = "scipy.laplace", scale = "1 km" }``: shape parameters as scipy names them, loc and scale."""

    prefix: ClassVar[str] = SCIPY
    __pydantic_extra__: dict[str, Annotated[Number, Field(description="Shape parameter.")]] = Field(init=False)

    @classmethod
    def member(cls, text: str) -> type[Table]:
        """Return the table of one distribution; see `Family`."""
        name, known = text.removeprefix(SCIPY), continuous_distributions()
        if name not in known:
            close = suggestion(text, [f"{SCIPY}{name}" for name in known])
            meant = f"{close.partition('?')[0]}?" if "did you mean" in close else ""
            message = f"got {text!r}; scipy.stats has no continuous distribution of that name{meant}"
            raise refuse([Mistake(message, (KIND,))])
        return _scipy_table(text)


@lru_cache(maxsize=64)
def _scipy_table(text: str) -> type[ScipyParameters]:
    shapes: dict[str, Any] = dict.fromkeys(shape_names(text.removeprefix(SCIPY)), (Number, ...))
    return create_model(text, __base__=ScipyParameters, called=(ClassVar[str], text), **shapes)


AnyDistribution: Final[Any] = Annotated[
    NormalTable | UniformTable | TruncatedNormalTable | TriangularTable | StudentTTable | FixedTable | ValuesTable
    | ScipyTable,
    ByType(KIND),
    Field(description="Distribution of an error."),
]  # fmt: skip

ENTRY: Final[TypeAdapter[DistributionTable]] = TypeAdapter(
    Annotated[AnyDistribution, OrFirst(NormalTable, "sigma", Size)]
)
"""Form of an entry of ``[errors]``; validation has the source as its context."""
