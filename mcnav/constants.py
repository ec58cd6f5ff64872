"""Constants of the two seed documents and of the standards they rest on, in SI units and radians.

The values of the earth are those of NASA TN D-1772 (notation and eq. 17 ff.); the report's procedure section prints
another earth radius, 6397.14 km, which contradicts its own start speed and angle (eq. 19) and is not used.
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
"""The report's accelerometer unit, g = mu / r_E^2 = 9.798597 m/s^2 (not the standard 9.80665)."""

STANDARD_GRAVITY: Final = 9.80665
"""The unit ``g`` of campaign files and reports, m/s^2 (3rd CGPM, 1901)."""

REENTRY_ALTITUDE: Final = 121_920.0
"""Altitude at which reentry is counted, 400,000 ft, m (NASA TN D-1772, notation)."""

BALLISTIC_COEFFICIENT: Final = 4.1e-3
"""C_D A / m of the report's vehicle, m^2/kg (4.1e-9 km^2/kg)."""
