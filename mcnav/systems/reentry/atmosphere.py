"""The 1959 ARDC Model Atmosphere.

NASA TN D-1772 cites its atmosphere only as "reference 4". Its Tables I and II are reproduced by the ARDC model of 1959
and by no later standard (with those of 1962 or 1976 trajectory 3 flies 8700 km instead of 7330 km).

The model is hydrostatic in geopotential altitude ``H = r0 h / (r0 + h)``, with a molecular-scale temperature that is
linear in ``H`` between the breakpoints of `BREAKPOINTS`. Each layer is a handful of coefficients, so that a flight may
be integrated layer by layer with a smooth density: the layer boundaries are kinks that would cap any integrator.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import exp
from typing import Final

import numpy as np

from mcnav.compiled.jit import compiled

GEOPOTENTIAL_RADIUS: Final = 6_356_766.0
"""Effective earth radius of the geopotential altitude, r0, m."""

STANDARD_GRAVITY: Final = 9.80665
GAS_CONSTANT: Final = 8314.39
MOLECULAR_WEIGHT: Final = 28.966
SEA_LEVEL_PRESSURE: Final = 101_325.0
HYDROSTATIC_GRADIENT: Final = STANDARD_GRAVITY * MOLECULAR_WEIGHT / GAS_CONSTANT
"""g0 M0 / R*, K per metre of geopotential altitude."""

BREAKPOINTS: Final = (
    (0.0, 288.16),
    (11_000.0, 216.66),
    (25_000.0, 216.66),
    (47_000.0, 282.66),
    (53_000.0, 282.66),
    (79_000.0, 165.66),
    (90_000.0, 165.66),
    (105_000.0, 225.66),
    (160_000.0, 1325.66),
    (170_000.0, 1425.66),
    (200_000.0, 1575.66),
    (700_000.0, 3325.66),
)
"""Geopotential altitude (m) and molecular-scale temperature (K) of the model's breakpoints."""


@dataclass(frozen=True)
class Layer:
    """One layer of the model: temperature linear in geopotential altitude.

    Attributes
    ----------
    base : float
        Geopotential altitude of the lower boundary, m.
    temperature : float
        Molecular-scale temperature there, K.
    lapse : float
        Temperature gradient, K/m; zero in an isothermal layer.
    density : float
        Density at the lower boundary, kg/m^3.
    """

    base: float
    temperature: float
    lapse: float
    density: float


def _layers() -> tuple[Layer, ...]:
    layers = []
    density = SEA_LEVEL_PRESSURE * MOLECULAR_WEIGHT / (GAS_CONSTANT * BREAKPOINTS[0][1])
    for (base, temperature), (top, top_temperature) in pairwise(BREAKPOINTS):
        lapse = (top_temperature - temperature) / (top - base)
        layers.append(Layer(base, temperature, lapse, density))
        if lapse == 0.0:
            density *= exp(-HYDROSTATIC_GRADIENT * (top - base) / temperature)
        else:
            density *= float((top_temperature / temperature) ** -(1.0 + HYDROSTATIC_GRADIENT / lapse))
    return tuple(layers)


LAYERS: Final = _layers()
"""The layers in rising order. The lowest serves below the ground, the highest above its top, where the density that it
continues is below 1e-13 kg/m^3."""


def geometric_altitude(geopotential: float) -> float:
    """Convert a geopotential altitude H to a geometric one, m: h = r0 H / (r0 - H)."""
    return GEOPOTENTIAL_RADIUS * geopotential / (GEOPOTENTIAL_RADIUS - geopotential)


LAYER_BOUNDARIES: Final = tuple(geometric_altitude(layer.base) for layer in LAYERS[1:])
"""Geometric altitudes between one layer and the next, m, rising; one fewer than the layers."""


@compiled
def layer_density(altitude: float, base: float, temperature: float, lapse: float, base_density: float) -> float:
    """Compute the density (kg/m^3) at a geometric altitude (m), by the coefficients of one layer.

    ``rho = rho_b (T / T_b)^-(1 + g0 M0 / (R* L))`` where the temperature has a gradient, and
    ``rho = rho_b exp(-g0 M0 (H - H_b) / (R* T_b))`` where it has none.
    """
    rise = GEOPOTENTIAL_RADIUS * altitude / (GEOPOTENTIAL_RADIUS + altitude) - base
    if lapse == 0.0:
        return float(base_density * np.exp(-HYDROSTATIC_GRADIENT * rise / temperature))
    ratio = 1.0 + lapse * rise / temperature
    return float(base_density * ratio ** -(1.0 + HYDROSTATIC_GRADIENT / lapse))


def layer_index(altitude: float) -> int:
    """Find the layer in `LAYERS` that holds a geometric altitude (m); a boundary belongs to the layer above."""
    return int(np.searchsorted(np.array(LAYER_BOUNDARIES), altitude, side="right"))


def density(altitude: float) -> float:
    """Compute the density of the ARDC 1959 atmosphere (kg/m^3) at a geometric altitude (m).

    >>> round(density(0.0), 4)
    1.225
    """
    layer = LAYERS[layer_index(altitude)]
    return layer_density(altitude, layer.base, layer.temperature, layer.lapse, layer.density)
