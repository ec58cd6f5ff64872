"""Swaying bases: a vehicle at its mooring, whose attitude and place oscillate about a mean."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import Earth
from mcnav.systems.ins.truth.rows import TrajectoryRows

ANGLES: Final = ("yaw", "pitch", "roll")
"""Oscillations of heading, pitch and roll."""

SHIFTS: Final = ("surge", "drift", "heave")
"""Oscillations of the place: forward, right and down at the mean heading."""

ROWS_OF_PERIOD: Final = 40
"""Rows of the shortest period: a cubic spline through a sine is wrong by 1e-6 of its amplitude."""

FEWEST_ROWS: Final = 10.0
"""Rows of a second at least."""


@dataclass(frozen=True)
class Oscillation:
    """A sine that begins at zero."""

    amplitude: float
    period: float

    def at(self, times: Array) -> Array:
        """Compute its values at times, s."""
        return np.asarray(self.amplitude * np.sin(2.0 * np.pi * times / self.period))


@dataclass(frozen=True)
class Sway:
    """A swaying base.

    Attributes
    ----------
    latitude, longitude : float
        rad.
    altitude : float
        m.
    heading : float
        Mean one, rad.
    duration : float
        s.
    oscillations : tuple of (str, Oscillation)
        By names of `ANGLES`, rad, and of `SHIFTS`, m.
    """

    latitude: float
    longitude: float
    altitude: float
    heading: float
    duration: float
    oscillations: tuple[tuple[str, Oscillation], ...]


def sway_rows(sway: Sway, earth: Earth) -> TrajectoryRows:
    """Compute the rows of a swaying base."""
    periods = [oscillation.period for _, oscillation in sway.oscillations]
    rate = max(FEWEST_ROWS, *(ROWS_OF_PERIOD / period for period in periods)) if periods else FEWEST_ROWS
    times = np.linspace(0.0, sway.duration, int(np.ceil(sway.duration * rate)) + 1)
    values = dict.fromkeys((*ANGLES, *SHIFTS), np.zeros_like(times))
    values |= {name: oscillation.at(times) for name, oscillation in sway.oscillations}
    meridian, prime = earth.curvature_radii(np.array(sway.latitude))
    cosine, sine = np.cos(sway.heading), np.sin(sway.heading)
    north = cosine * values["surge"] - sine * values["drift"]
    east = sine * values["surge"] + cosine * values["drift"]
    latitude = sway.latitude + north / (meridian + sway.altitude)
    longitude = sway.longitude + east / ((prime + sway.altitude) * np.cos(sway.latitude))
    angles = np.stack([sway.heading + values["yaw"], values["pitch"], values["roll"]], axis=-1)
    return TrajectoryRows(times, latitude, longitude, sway.altitude - values["heave"], angles)
