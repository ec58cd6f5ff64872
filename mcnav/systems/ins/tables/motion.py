"""Quantities of a vehicle's place and motion, with their limits."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from mcnav.entries.quantities import Acceleration, Length, QuantityIn, Speed

Angle = Annotated[float, QuantityIn("rad")]
Latitude = Annotated[Angle, Field(gt=-np.pi / 2.0, lt=np.pi / 2.0)]
Longitude = Annotated[Angle, Field(ge=-2.0 * np.pi, le=2.0 * np.pi)]
Azimuth = Annotated[Angle, Field(ge=-2.0 * np.pi, le=2.0 * np.pi)]
Height = Annotated[Length, Field(ge=-15e3, le=1e8)]
Forward = Annotated[Speed, Field(ge=0.0, le=20e3)]
Pull = Annotated[Acceleration, Field(gt=0.0, le=1e3)]
