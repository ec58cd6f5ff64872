"""Error sources from Python: forms of a size, units, correlations, draws; each equal to what a campaign file has."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import pint
import pytest
from scipy import stats

import mcnav as mc
from mcnav.sampler.distributions import Normal, Uniform
from mcnav.sampler.error_model import Correlation, ErrorModel

PINT: pint.UnitRegistry[float] = pint.UnitRegistry()


@pytest.mark.parametrize(
    ("size", "sigma", "unit"),
    [
        (2e-4, 2e-4, ""),
        (np.float32(2.0), 2.0, ""),
        ("5 km", 5000.0, "m"),
        ("0.2 deg/h", math.radians(0.2) / 3600.0, "rad/s"),
        ("100 ppm", 1e-4, "1"),
        (PINT.Quantity(5.0, "km"), 5000.0, "m"),
        (PINT.Quantity(0.2, "deg/hour"), math.radians(0.2) / 3600.0, "rad/s"),
        (PINT.Quantity(3.0, "m/s**2"), 3.0, "m/s^2"),
        (mc.uniform("3 m"), math.sqrt(3.0), "m"),
        (mc.triangular("6 m"), math.sqrt(6.0), "m"),
        (mc.student_t(2.0, 5), 2.0, ""),
        (mc.fixed("1 km"), 0.0, "m"),
        (mc.table([1.0, 3.0], unit="km"), 1000.0, "m"),
        (stats.laplace(scale=2.0), 2.0 * math.sqrt(2.0), ""),
        (stats.gamma(4.0, 0.0, 3.0), 6.0, ""),
    ],
)
def test_forms_of_a_size(size: Any, sigma: float, unit: str) -> None:
    errors = mc.Errors({"source": size})
    assert errors.standard_deviations["source"] == pytest.approx(sigma, rel=1e-12)
    assert errors.units == {"source": unit}


@pytest.mark.parametrize(
    ("size", "message"),
    [
        (True, "source: got True; expected an SI number, text with a unit"),
        (None, "source: got None; expected an SI number"),
        (math.nan, "source: got nan; expected a finite number"),
        (-1.0, "source: a sigma must not be negative"),
        ("5 parsecks", "source: 'parsecks' is not a known unit"),
        ("km", "source: got 'km'; expected a quantity"),
        ("5 K", "source: 'K' is not a known unit"),
    ],
)
def test_a_wrong_size_names_its_source(size: Any, message: str) -> None:
    with pytest.raises(ValueError, match=f"^{message}"):
        mc.Errors({"source": size})


def test_correlations_are_those_of_a_campaign() -> None:
    errors = mc.Errors({"a": 2.0, "b": mc.uniform(3.0), "c": 1.0}, correlations={("a", "b"): 0.5})
    model = ErrorModel("abc", {"a": Normal(2.0), "b": Uniform(3.0), "c": Normal(1.0)}, [Correlation(("a", "b"), 0.5)])
    np.testing.assert_array_equal(errors.covariance, model.covariance)
    np.testing.assert_array_equal(errors.draw(100, seed=3), model.draw("random", 3, 100, 0, 100))
    assert errors.correlation_entries == [{"between": ["a", "b"], "coefficient": 0.5}]


@pytest.mark.parametrize(
    ("correlations", "message"),
    [
        ({("a", "d"): 0.5}, "correlations: .*'d'.* does not name two of a, b"),
        ({("a", "a"): 0.5}, "correlations: "),
        ({("a", "b"): 1.5}, "correlation of a and b: expected -1 to 1; got 1.5"),
        ({("a", "b"): 0.999}, "correlation of a and b: errors of these distributions can be correlated"),
    ],
)
def test_a_wrong_correlation_names_its_sources(correlations: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        mc.Errors({"a": mc.uniform(1.0), "b": 1.0}, correlations=correlations)


def test_draws_carry_what_intervals_depend_on() -> None:
    draws = mc.Errors({"a": mc.student_t(1.0, 5)}).draw(64, seed=7, design="antithetic")
    assert draws.attrs["sampling"] == {
        "design": "antithetic", "seed": 7, "samples": 64, "normal": False, "heavy_tailed": True,
    }  # fmt: skip
    np.testing.assert_array_equal(draws[::2].to_numpy(), -draws[1::2].to_numpy())
    for wrong in ({"samples": 1}, {"samples": 10, "seed": -1}, {"samples": 10, "design": "none"}, {"samples": True}):
        with pytest.raises(ValueError, match="must be"):
            mc.Errors({"a": 1.0}).draw(**wrong)  # type: ignore[arg-type]


def test_an_empty_mapping_is_refused() -> None:
    with pytest.raises(ValueError, match="one or more error sources"):
        mc.Errors({})


def test_values_of_a_file(tmp_path: Any) -> None:
    file = tmp_path / "gyro.csv"
    pd.DataFrame({"drift": [1.0, 2.0, 6.0]}).to_csv(file, index=False)
    errors = mc.Errors({"gyro": mc.table(str(file), "drift", "deg/h")})
    assert errors.mean["gyro"] == pytest.approx(math.radians(3.0) / 3600.0, rel=1e-12)
    with pytest.raises(ValueError, match="has no column 'bias'; it has drift"):
        mc.table(str(file), "bias", "deg/h")
