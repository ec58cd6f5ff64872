"""Constants of the seed documents and of their standards, in SI units and radians.

The earth is that of NASA TN D-1772 (notation and eq. 17 ff.). The procedure section of the report prints another earth
radius, 6397.14 km, which contradicts its start speed and angle (eq. 19) and is not used.
"""

from __future__ import annotations

from typing import Final

GRAVITATIONAL_PARAMETER: Final = 3.986135e14
"""Gravitational parameter of the earth, mu, m^3/s^2 (NASA TN D-1772, notation)."""

EARTH_RADIUS: Final = 6_378_140.0
"""Radius of the spherical earth, r_E, m (NASA TN D-1772, notation)."""

EARTH_RATE: Final = 7.29211e-5
"""Angular rate of the earth and of its atmosphere, rad/s (NASA TN D-1772, notation)."""

TN_GRAVITY: Final = GRAVITATIONAL_PARAMETER / EARTH_RADIUS**2
"""Accelerometer unit of the report, g = mu / r_E^2 = 9.798597 m/s^2 (not the standard 9.80665)."""

STANDARD_GRAVITY: Final = 9.80665
"""Unit ``g`` of campaign files and reports, m/s^2 (3rd CGPM, 1901)."""

REENTRY_ALTITUDE: Final = 121_920.0
"""Altitude at which reentry begins, 400,000 ft, m (NASA TN D-1772, notation)."""

BALLISTIC_COEFFICIENT: Final = 4.1e-3
"""C_D A / m of the vehicle of NASA TN D-1772, m^2/kg (4.1e-9 km^2/kg)."""
