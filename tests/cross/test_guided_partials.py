"""The guided reentry three ways: by variation with its events, by differences of both engines, and at finite errors."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest

from mcnav.config.read import parse_campaign
from mcnav.contract.samples import Batch
from mcnav.contract.scenario import Scenario
from tests.guided import ALL_SIZES, NAMES, errors_of

AGREEMENT = 1e-6
"""Share of each output's largest contribution of one usual error."""

FRACTIONS = (0.02, 0.01)
"""Steps of differences, as shares of usual errors; extrapolated from both, they resolve 1e-7 of a row."""

WHOSE = ("true", "indicated")


def _scenario(number: int, guidance: dict[str, Any], **options: Any) -> Scenario:
    described = {"type": "reentry", "trajectory": number, "guidance": guidance} | options
    return parse_campaign({"scenario": described, "errors": {}}, "test.toml", "test").scenario


def _differences(scenario: Scenario, engine: str, names: list[str]) -> np.ndarray:
    """Partial derivatives by some errors, shape (outputs, len(names)): ``(4 D(h/2) - D(h)) / 3``."""
    steps = np.array([ALL_SIZES[NAMES.index(name)] for name in names])
    units = np.stack([errors_of(**{name: step}) for name, step in zip(names, steps, strict=True)])
    errors = np.concatenate([sign * fraction * units for fraction in FRACTIONS for sign in (1.0, -1.0)])
    result = scenario.engine(engine, errors).simulate(Batch(np.arange(len(errors)), errors, 1))
    assert not result.failures
    assert engine == "reference" or result.fallback_count == 0
    up, down, up_half, down_half = result.values.reshape(4, len(names), -1)
    whole, half = (
        (a - b) / (2.0 * fraction) for a, b, fraction in zip((up, up_half), (down, down_half), FRACTIONS, strict=True)
    )
    return np.asarray(((4.0 * half - whole) / 3.0 / steps[:, None]).T)


def _apart(scenario: Scenario, engine: str, names: list[str]) -> np.ndarray:
    """Largest difference of partial derivatives of each output, as a share of its largest contribution."""
    partials = scenario.linear().end.partials
    columns = [NAMES.index(name) for name in names]
    largest = np.abs(partials * ALL_SIZES).max(axis=1)
    difference = (_differences(scenario, engine, names) - partials[:, columns]) * ALL_SIZES[columns]
    return np.asarray(np.abs(difference).max(axis=1) / largest)


@pytest.mark.parametrize("engine", ["ensemble", "reference"])
@pytest.mark.parametrize(("fed", "final", "start"), list(product(WHOSE, WHOSE, ("truth", "nominal"))))
def test_variation_and_differences_agree(fed: str, final: str, start: str, engine: str) -> None:
    """On trajectory 2; what the navigator is told at the start changes the columns of the true errors alone."""
    scenario = _scenario(2, {"input": fed, "final": final, "navigator_start": start})
    names = NAMES if start == "truth" or engine == "ensemble" else [n for n in NAMES if n.startswith("true")]
    apart = _apart(scenario, engine, names)
    assert (apart < AGREEMENT).all(), dict(zip([each.name for each in scenario.outputs], apart, strict=True))


@pytest.mark.parametrize("engine", ["ensemble", "reference"])
@pytest.mark.parametrize(
    ("number", "guidance", "options"),
    [
        (2, {"final": "indicated"}, {"accelerometers_off_above": "104 km", "start": "-20 min"}),
        (1, {}, {}),
    ],
    ids=["accelerometers off above 104 km", "constant lift"],
)
def test_they_agree_with_other_kinks(
    number: int, guidance: dict[str, Any], options: dict[str, Any], engine: str
) -> None:
    """The accelerometers' switch jumps; without a variable lift the largest deceleration is smooth."""
    scenario = _scenario(number, guidance, **options)
    apart = _apart(scenario, engine, NAMES)
    assert (apart < AGREEMENT).all(), dict(zip([each.name for each in scenario.outputs], apart, strict=True))
