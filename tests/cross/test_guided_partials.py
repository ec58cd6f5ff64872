"""The guided reentry three ways: by variation with its events, by differences of both engines, and at finite errors."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest

from mcnav.config.read import parse_campaign
from mcnav.contract.errors import ScenarioError
from mcnav.contract.samples import Batch
from mcnav.contract.scenario import Scenario
from mcnav.systems.reentry.guided.scenario import GuidedReentry
from tests.guided import ALL_SIZES, NAMES, errors_of

AGREEMENT = 1e-6
"""Share of each output's largest contribution of one usual error."""

FRACTIONS = (0.02, 0.01)
"""Steps of differences, as shares of usual errors; extrapolated from both, they resolve 1e-7 of a row."""

WHOSE = ("true", "indicated")


def _scenario(number: int, guidance: dict[str, Any], **options: Any) -> Scenario:
    described = {"type": "reentry", "trajectory": number, "guidance": guidance} | options
    return parse_campaign({"scenario": described, "errors": {}}, "test.toml", "test").scenario


def _differences(scenario: Scenario, engine: str, names: list[str], scale: float) -> np.ndarray:
    """Partial derivatives by some errors, shape (outputs, len(names)): ``(4 D(h/2) - D(h)) / 3``."""
    fractions = [scale * fraction for fraction in FRACTIONS]
    steps = np.array([ALL_SIZES[NAMES.index(name)] for name in names])
    units = np.stack([errors_of(**{name: step}) for name, step in zip(names, steps, strict=True)])
    errors = np.concatenate([sign * fraction * units for fraction in fractions for sign in (1.0, -1.0)])
    result = scenario.engine(engine, errors).simulate(Batch(np.arange(len(errors)), errors, 1))
    assert not result.failures
    assert engine == "reference" or result.fallback_count == 0
    up, down, up_half, down_half = result.values.reshape(4, len(names), -1)
    whole, half = (
        (a - b) / (2.0 * fraction) for a, b, fraction in zip((up, up_half), (down, down_half), fractions, strict=True)
    )
    return np.asarray(((4.0 * half - whole) / 3.0 / steps[:, None]).T)


def _apart(scenario: Scenario, engine: str, names: list[str], scale: float = 1.0) -> np.ndarray:
    """Largest difference of partial derivatives of each output, as a share of its largest contribution."""
    partials = scenario.linear().end.partials
    columns = [NAMES.index(name) for name in names]
    largest = np.abs(partials * ALL_SIZES).max(axis=1)
    difference = (_differences(scenario, engine, names, scale) - partials[:, columns]) * ALL_SIZES[columns]
    return np.asarray(np.abs(difference).max(axis=1) / largest)


@pytest.mark.parametrize("engine", ["ensemble", "reference"])
@pytest.mark.parametrize(("fed", "final", "start"), list(product(WHOSE, WHOSE, ("truth", "nominal"))))
def test_variation_and_differences_agree(fed: str, final: str, start: str, engine: str) -> None:
    """On trajectory 2; what the navigator is told at the start changes the columns of the true errors alone."""
    scenario = _scenario(2, {"input": fed, "final": final, "navigator_start": start})
    names = NAMES
    if engine == "reference" and (fed, final, start) != ("indicated", "true", "truth"):  # one flight at a time
        names = [name for name in NAMES if name.startswith("true")] if start == "nominal" else NAMES[::3]
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


@pytest.mark.parametrize("engine", ["ensemble", "reference"])
@pytest.mark.parametrize(("fed", "final"), [("true", "true"), ("indicated", "true"), ("indicated", "indicated")])
def test_they_agree_with_a_law_that_follows_the_nominal_flight(fed: str, final: str, engine: str) -> None:
    """Its polynomials jump at the knots by 1e-5 m/s^2, which the event at the end magnifies to 6e-6 of a row.

    Steps are smaller: its gains are a thousand times those of the trajectory's own law.
    """
    law = {"type": "reference", "limit": 0.8}
    scenario = _scenario(4, {"input": fed, "final": final, "law": law}, start="-10 min")
    names = NAMES if engine == "ensemble" else ["altitude", "bias_z", "true_range_rate", "density"]
    apart = _apart(scenario, engine, names, scale=0.1)
    assert (apart < AGREEMENT).all(), dict(zip([each.name for each in scenario.outputs], apart, strict=True))


@pytest.mark.parametrize(
    ("number", "guidance", "multiple", "failing"),
    [
        (2, {}, 1.0, set()),
        (2, {"input": "true"}, 5.0, {"it skips out"}),
        (2, {"final": "indicated", "navigator_start": "nominal"}, 1.0, {"the vehicle meets the ground before"}),
        (4, {"law": {"type": "reference", "limit": 0.8}}, 0.1, set()),
    ],
)
def test_both_engines_fly_the_same_samples(
    number: int, guidance: dict[str, Any], multiple: float, failing: set[str]
) -> None:
    """With the same failures for the same reasons, and to 2e-5 of each output's dispersion.

    A skip magnifies what the integration of the reference leaves to some 0.2 m of range.
    """
    scenario = _scenario(number, guidance)
    errors = np.random.default_rng(5).standard_normal((24, len(NAMES))) * ALL_SIZES * multiple
    batch = Batch(np.arange(len(errors)), errors, 1)
    fast, slow = (scenario.engine(engine, errors).simulate(batch) for engine in ("ensemble", "reference"))
    assert {row: str(each) for row, each in fast.failures.items()} == {
        row: str(each) for row, each in slow.failures.items()
    }
    for words in failing:
        assert any(str(each).startswith(words) for each in fast.failures.values())
    arrived = np.isfinite(slow.values).all(axis=1)
    difference = np.abs(fast.values - slow.values)[arrived].max(axis=0)
    assert (difference < 2e-5 * slow.values[arrived].std(axis=0)).all()


@pytest.mark.parametrize("fed", ["true", "indicated"])
def test_it_is_read_at_any_time(fed: str) -> None:
    """Before and after reentry as over time, whatever other times are asked for; outside of the flight it says so.

    Behind reentry the solution of the equations of variation is singular: what is read there does not come from it.
    """
    scenario = _scenario(4, {"input": fed})
    assert isinstance(scenario, GuidedReentry)
    over_time = scenario.linear_over_time()
    chosen = [0, 5, 40, 58, 59]
    asked = np.sort(np.append(over_time.times[chosen] * 60.0, [-100.0, 500.0]))
    read = scenario.linear(asked)
    places = np.searchsorted(asked, over_time.times[chosen] * 60.0)
    sizes = np.array([source.nominal for source in scenario.sources])
    known, partials = over_time.partials[chosen] * sizes, read.partials[places] * sizes
    largest = np.abs(known).max(axis=2, keepdims=True)
    assert (np.abs(partials - known) <= 1e-9 * largest).all()
    with pytest.raises(ScenarioError, match=r"^got 1000000 s from reentry; navigation is from -"):
        scenario.linear(np.array([1e6]))
