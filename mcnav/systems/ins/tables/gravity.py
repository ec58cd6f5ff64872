"""The table ``[gravity]``: sizes of the gravity disturbance, which neither navigator nor filter has in its model."""

from __future__ import annotations

from typing import Annotated, ClassVar, Final

import numpy as np
from pydantic import Field

from mcnav.entries.context import FileContext
from mcnav.entries.quantities import Acceleration, Angle, Length, Table
from mcnav.entries.rules import Rule, SomeOf
from mcnav.entries.validation import validate
from mcnav.systems.description import FurtherTable
from mcnav.systems.ins.imu.gravity import GravityDisturbance

LARGEST_DEFLECTION: Final = 0.01
"""Largest sigma of a deflection, rad: twenty times those of high mountains."""

LARGEST_ANOMALY: Final = 0.1
"""Largest sigma of an anomaly, m/s^2."""

LENGTHS: Final = (1e3, 1e8)
"""Shortest and longest correlation length, m."""

Sigma = "Sigma of the process."
Distance = "Distance travelled over which the correlation falls to 1/e."

CorrelationLength = Annotated[Length, Field(ge=LENGTHS[0], le=LENGTHS[1], description=Distance, examples=["30 km"])]
DeflectionSize = Annotated[Angle, Field(ge=0.0, le=LARGEST_DEFLECTION, description=Sigma, examples=["5 arcsec"])]
AnomalySize = Annotated[Acceleration, Field(ge=0.0, le=LARGEST_ANOMALY, description=Sigma, examples=["30 mGal"])]


class DeflectionTable(Table):
    """``deflection = { sigma = "5 arcsec", correlation_length = "30 km" }``."""

    expected: ClassVar[str] = 'expected { sigma = "5 arcsec", correlation_length = "30 km" }'
    called: ClassVar[str] = "a deflection"
    sigma: DeflectionSize
    correlation_length: CorrelationLength


class AnomalyTable(Table):
    """``anomaly = { sigma = "30 mGal", correlation_length = "50 km" }``."""

    expected: ClassVar[str] = 'expected { sigma = "30 mGal", correlation_length = "50 km" }'
    called: ClassVar[str] = "an anomaly"
    sigma: AnomalySize
    correlation_length: CorrelationLength


class BelievedDeflectionTable(Table):
    """A deflection that a filter takes the true one for: what it does not have is that of the truth."""

    rules: ClassVar[tuple[Rule, ...]] = (SomeOf(("sigma", "correlation_length"), 1),)
    expected: ClassVar[str] = 'expected sigma, correlation_length or both, such as { sigma = "5 arcsec" }'
    called: ClassVar[str] = "a deflection"
    sigma: DeflectionSize | None = None
    correlation_length: CorrelationLength | None = None


class BelievedAnomalyTable(Table):
    """An anomaly that a filter takes the true one for: what it does not have is that of the truth."""

    rules: ClassVar[tuple[Rule, ...]] = (SomeOf(("sigma", "correlation_length"), 1),)
    expected: ClassVar[str] = 'expected sigma, correlation_length or both, such as { sigma = "30 mGal" }'
    called: ClassVar[str] = "an anomaly"
    sigma: AnomalySize | None = None
    correlation_length: CorrelationLength | None = None


OfDeflection = Field(description="Deflection of the vertical, north and east, along the distance travelled.")
OfAnomaly = Field(description="Gravity anomaly along the distance travelled.")


class GravityTable(Table):
    """``[gravity]``."""

    rules: ClassVar[tuple[Rule, ...]] = (SomeOf(("deflection", "anomaly"), 1),)
    expected: ClassVar[str] = "expected deflection, anomaly or both"
    deflection: Annotated[DeflectionTable | None, OfDeflection] = None
    anomaly: Annotated[AnomalyTable | None, OfAnomaly] = None


class BelievedGravityTable(Table):
    """``[filter.believes.gravity]``: it replaces values of the true disturbance one by one."""

    expected: ClassVar[str] = "expected deflection, anomaly or both"
    deflection: Annotated[BelievedDeflectionTable | None, OfDeflection] = None
    anomaly: Annotated[BelievedAnomalyTable | None, OfAnomaly] = None


GRAVITY: Final = FurtherTable(
    GravityTable,
    "Gravity disturbance of type ins: what true gravity has besides the model.",
    "this scenario has no gravity disturbance, which those of type ins can have",
)
"""The table of the campaign file."""


def read_gravity(entries: object, context: FileContext) -> GravityDisturbance:
    """Read ``[gravity]``, or nothing for None; mistakes are added to the context."""
    table = None if entries is None else validate(GravityTable, entries, context, "gravity")
    return GravityDisturbance() if table is None else _replaced(table, GravityDisturbance())


def read_believed_gravity(entries: object, true: GravityDisturbance, context: FileContext) -> GravityDisturbance:
    """Read ``[filter.believes.gravity]``, whose values replace the true ones; mistakes are added to the context."""
    table = validate(BelievedGravityTable, entries, context, "filter.believes.gravity")
    if table is None:
        return true
    believed = _replaced(table, true)
    for key, length in (("deflection", believed.deflection_length), ("anomaly", believed.anomaly_length)):
        if getattr(table, key) is not None and not np.isfinite(length):
            message = "is missing, and [gravity] itself has no such process; give it"
            context.problem(f"filter.believes.gravity.{key}.correlation_length", message)
    return believed


def _replaced(table: GravityTable | BelievedGravityTable, below: GravityDisturbance) -> GravityDisturbance:
    """Return the values of a table; what is missing is that of another disturbance."""
    sizes = []
    for part, sigma, length in (
        (table.deflection, below.deflection, below.deflection_length),
        (table.anomaly, below.anomaly, below.anomaly_length),
    ):
        stated = (None, None) if part is None else (part.sigma, part.correlation_length)
        sizes += [sigma if stated[0] is None else stated[0], length if stated[1] is None else stated[1]]
    return GravityDisturbance(*sizes)
