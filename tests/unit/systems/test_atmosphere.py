"""The ARDC 1959 atmosphere."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from mcnav.systems.reentry.atmosphere import (
    BREAKPOINTS,
    GAS_CONSTANT,
    GEOPOTENTIAL_RADIUS,
    LAYER_BOUNDARIES,
    LAYERS,
    MOLECULAR_WEIGHT,
    SEA_LEVEL_PRESSURE,
    STANDARD_GRAVITY,
    density,
    geometric_altitude,
    layer_density,
    layer_index,
)

ROUNDING = 1e-12
"""Relative; a dozen multiplications and a power of up to 40."""


def test_sea_level() -> None:
    """By the gas law from the pressure and temperature that define the model."""
    expected = SEA_LEVEL_PRESSURE * MOLECULAR_WEIGHT / (GAS_CONSTANT * 288.16)
    assert density(0.0) == pytest.approx(expected, rel=ROUNDING)


@pytest.mark.parametrize("boundary", LAYER_BOUNDARIES)
def test_density_is_continuous_across_layers(boundary: float) -> None:
    above = LAYERS[layer_index(boundary)]
    below = LAYERS[layer_index(boundary) - 1]
    values = [layer_density(boundary, x.base, x.temperature, x.lapse, x.density) for x in (below, above)]
    assert values[0] == pytest.approx(values[1], rel=ROUNDING)


@pytest.mark.parametrize("altitude", [3e3, 15e3, 40e3, 50e3, 70e3, 85e3, 95e3, 121.92e3, 165e3, 190e3, 400e3])
def test_hydrostatic_integral(altitude: float) -> None:
    """Against p = p0 exp(-int g0 M0 / (R* T) dH) by numerical quadrature of the temperature profile."""
    top = GEOPOTENTIAL_RADIUS * altitude / (GEOPOTENTIAL_RADIUS + altitude)
    heights, temperatures = np.array(BREAKPOINTS).T
    kinks = heights[(heights > 0.0) & (heights < top)]
    exponent, error = quad(
        lambda height: STANDARD_GRAVITY * MOLECULAR_WEIGHT / (GAS_CONSTANT * np.interp(height, heights, temperatures)),
        0.0, top, points=kinks, epsabs=1e-12, epsrel=1e-12,
    )  # fmt: skip
    temperature = np.interp(top, heights, temperatures)
    expected = SEA_LEVEL_PRESSURE * np.exp(-exponent) * MOLECULAR_WEIGHT / (GAS_CONSTANT * temperature)
    assert density(altitude) == pytest.approx(expected, rel=max(10.0 * error, ROUNDING * 100))


def test_geometric_altitude_inverts_the_geopotential() -> None:
    for height, _ in BREAKPOINTS:
        altitude = geometric_altitude(height)
        assert GEOPOTENTIAL_RADIUS * altitude / (GEOPOTENTIAL_RADIUS + altitude) == pytest.approx(height, rel=ROUNDING)
