"""``smoother`` of ``[filter]``: ``"fixed-interval"``, or ``{ lag = "60 s" }``."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from mcnav.entries.quantities import Duration, Table
from mcnav.entries.unions import ByForm


class LagTable(Table):
    """``smoother = { lag = "60 s" }``."""

    expected: ClassVar[str] = 'expected "fixed-interval" or { lag = "60 s" }'
    called: ClassVar[str] = "a smoother"
    lag: Annotated[
        Duration,
        Field(gt=0.0, le=1e7, description="How long after an instant measurements count.", examples=["60 s"]),
    ]


SmootherEntry = Annotated[Literal["fixed-interval"] | LagTable, ByForm()]


def lag_of(smoother: Literal["fixed-interval"] | LagTable | None) -> float | None:
    """Return the lag of a smoother, s; infinite where it uses all measurements, none without one."""
    if smoother is None:
        return None
    return smoother.lag if isinstance(smoother, LagTable) else math.inf
