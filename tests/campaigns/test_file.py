"""Campaign files: what is read, what is refused and in which words."""

from __future__ import annotations

import textwrap
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcnav.campaign.file import parse_campaign, read_campaign
from mcnav.campaign.problems import CampaignError
from mcnav.sampling.distributions import Fixed, StudentT, Triangular, TruncatedNormal, Uniform
from tests.conftest import ROOT, content

CAMPAIGNS = sorted((ROOT / "campaigns").glob("*.toml"))


def _mistakes(described: dict[str, Any]) -> list[str]:
    with pytest.raises(CampaignError) as found:
        parse_campaign(described, "test.toml", "test")
    return str(found.value).splitlines()


def _with(path: str, value: Any) -> dict[str, Any]:
    described: dict[str, Any] = content()
    *tables, key = path.split(".")
    place = described
    for table in tables:
        place = place[table]
    place[key] = value
    return described


@pytest.mark.parametrize("path", CAMPAIGNS, ids=lambda path: path.stem)
def test_every_campaign_is_valid_and_resolves_to_itself(path: Path) -> None:
    campaign = read_campaign(path)
    assert path.read_text(encoding="utf-8").startswith("# Question:")
    again = parse_campaign(tomllib.loads(campaign.to_toml()), str(path), path.stem)
    assert again.resolved == campaign.resolved
    assert np.array_equal(again.errors.covariance, campaign.errors.covariance)
    assert np.array_equal(again.scenario.linearised().partials, campaign.scenario.linearised().partials)


def test_the_campaign_in_the_readme_is_valid() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    shown = text[text.index('    name = "my reentry"') : text.index("Error sources:")]
    campaign = parse_campaign(tomllib.loads(textwrap.dedent(shown)), "README.md", "README")
    assert campaign.name == "my reentry"
    assert np.count_nonzero(campaign.errors.standard_deviations) == 3


def test_there_is_a_campaign_for_every_trajectory() -> None:
    numbers = [tomllib.loads(path.read_text(encoding="utf-8"))["scenario"].get("trajectory") for path in CAMPAIGNS]
    assert set(numbers) >= set(range(1, 8))
    assert numbers[0] == 4


def test_distributions() -> None:
    described = content() | {
        "errors": {
            "altitude": {"distribution": "uniform", "half_width": "3 km"},
            "range": {"distribution": "truncated-normal", "sigma": "1 km", "limit": "2 km"},
            "altitude_rate": {"distribution": "student-t", "sigma": "1 m/s", "degrees_of_freedom": 5},
            "range_rate": {"distribution": "triangular", "half_width": "0.1 m/s"},
            "scale_factor_x": {"distribution": "fixed", "value": "50 ppm"},
            "bias_x": {"sigma": "100 ug"},
        }
    }
    errors = parse_campaign(described, "test.toml", "test").errors
    kinds = [Uniform(3e3), TruncatedNormal(1e3, 2e3), StudentT(1.0, 5.0), Triangular(0.1)]
    assert list(errors.distributions[:4]) == kinds
    assert errors.distributions[8] == Fixed(50 * 1e-6)
    assert errors.standard_deviations[6] == pytest.approx(9.80665e-4)


@pytest.mark.parametrize(
    ("path", "value", "line"),
    [
        ("errors.gyro_drift", "5 km", "errors.gyro_drift: got '5 km', which is a length; expected an angular rate"),
        ("errors.altitude", "-5 km", "errors.altitude: got '-5 km'; sigma must not be negative"),
        ("errors.altitud", "5 km", "errors.altitud: unknown error source; did you mean 'altitude'?"),
        ("errors.range", {"distribution": "gauss"}, "errors.range.distribution: got 'gauss'; expected one of normal"),
        ("errors.range", {"distribution": "uniform"}, "errors.range.half_width: is missing; a uniform distribution"),
        ("errors.range", {"sigma": "1 km", "width": 3}, "errors.range.width: unknown key of a normal distribution"),
        ("errors", 3, "errors: got 3; expected a table"),
        ("sample", 3, "sample: unknown key; did you mean 'samples'?"),
        ("samples", 0, "samples: got 0; expected a number greater than or equal to 2"),
        ("samples", "many", "samples: got 'many'; expected a whole number"),
        ("samples", 1e3, "samples: got 1000.0; expected a whole number"),
        ("seed", -1, "seed: got -1"),
        ("seed", 10**30, "seed: got 1000000000000000000000000000000"),
        ("design", "halton", "design: got 'halton'; expected 'random', 'antithetic', 'latin-hypercube' or"),
        ("confidence", 1.0, "confidence: got 1.0"),
        ("tolerance", "5 km", "tolerance: got '5 km', which is a length"),
        ("name", "a\nb", "name: got 'a\\nb'; expected some text without control characters"),
        ("name", "", "name: got ''"),
        ("name", "  ", "name: got '  '; expected some text"),
        ("errors.altitude", "1e300 km", "errors.altitude: got '1e300 km'; at most 5e+12 m makes sense"),
        ("scenario", None, "scenario: got None; expected a table"),
        ("scenario.type", "cruise", "scenario.type: got 'cruise'"),
        ("scenario.trajectory", 8, "scenario.trajectory: got 8; expected a number less than or equal to 7"),
        ("scenario.axis", "start", "scenario.axis: unknown key; did you mean 'axes'?"),
        ("scenario.start", "-90 min", "scenario.start: -90 min from reentry is not on the trajectory, which runs from"),
        ("scenario.start", "30 min", "scenario.start: 30 min from reentry is not on the trajectory"),
        ("scenario.final_altitude", "122 km", "scenario.final_altitude: 122 km cannot be the end of a reentry"),
        ("scenario.final_altitude", "-1 km", "scenario.final_altitude: -1 km cannot be the end of a reentry"),
        ("scenario.ballistic", "0.1 kg", "scenario.ballistic: got '0.1 kg', which is of dimension [mass]; expected an"),
        ("scenario.lift_law", {"type": "wings"}, "scenario.lift_law: "),
        ("scenario.lift_law", {"type": "constant"}, "scenario.lift_law.lift_to_drag: is missing"),
        ("scenario.first_point", {}, "scenario.first_point.altitude: is missing"),
    ],
)  # fmt: skip
def test_one_mistake_is_one_line(path: str, value: Any, line: str) -> None:
    described = _with(path, value)
    found = _mistakes(described)
    assert found[0].startswith(f"test.toml: {line}"), found
    if path != "scenario.first_point":
        assert len(found) == 1, found


def test_a_trajectory_that_never_comes_down() -> None:
    """Lift that carries it out of the atmosphere for good, at a speed beyond escape."""
    described = content()
    described["scenario"] = {
        "type": "reentry",
        "lift_law": {"type": "constant", "lift_to_drag": 0.3},
        "final_altitude": "30 km",
        "first_point": {"altitude": "1000 km", "range": "0 km", "altitude_rate": "0 m/s", "range_rate": "13 km/s"},
    }
    (line,) = _mistakes(described)
    assert line.startswith("test.toml: scenario.final_altitude: the trajectory never comes down to 30.00 km: in 24 h")


def test_impossible_correlations() -> None:
    pairs = [("altitude", "range", 0.9), ("altitude", "bias_x", 0.9), ("range", "bias_x", -0.9)]
    tables = [{"between": [a, b], "coefficient": c} for a, b, c in pairs]
    (line,) = _mistakes(content(correlations=tables))
    assert line == (
        "test.toml: correlations: together they are no correlation matrix: its smallest eigenvalue is -0.8, and must "
        "not be negative"
    )


@pytest.mark.parametrize(
    ("table", "line"),
    [
        ({"between": ["altitude", "altitude"], "coefficient": 0.5}, "correlations #1.between: got 'altitude' twice"),
        (
            {"between": ["altitude", "speed"], "coefficient": 0.5},
            "correlations #1.between: unknown error source 'speed'",
        ),
        ({"between": ["altitude"], "coefficient": 0.5}, "correlations #1.between: got 1 names; expected two"),
        ({"between": ["altitude", "range"], "coefficient": 1.5}, "correlations #1.coefficient: got 1.5"),
        ({"between": ["altitude", "range"]}, "correlations #1.coefficient: is missing"),
    ],
)
def test_one_wrong_correlation(table: dict[str, Any], line: str) -> None:
    found = _mistakes(content(correlations=[table]))
    assert len(found) == 1
    assert found[0].startswith(f"test.toml: {line}")


def test_a_correlation_with_an_absent_error() -> None:
    described = content(correlations=[{"between": ["altitude", "range"], "coefficient": 0.5}])
    del described["errors"]["range"]
    (line,) = _mistakes(described)
    assert line.startswith("test.toml: correlations #1: range has no dispersion")


def test_several_mistakes_are_listed_together() -> None:
    described = content() | {"seeds": 3, "samples": "ten"}
    described["errors"] |= {"gyro_drift": "5 km", "speed": "1 m/s"}
    described["scenario"] = {"type": "reentry", "trajectory": 4, "start": -20}
    keys = [line.split(": ")[1] for line in _mistakes(described)]
    assert sorted(keys) == ["errors.gyro_drift", "errors.speed", "samples", "scenario.start", "seeds"]


QUANTITIES = st.sampled_from(["5 km", "1 g", "nan m"])
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20) | QUANTITIES,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=12), inner, max_size=3),
    max_leaves=8,
)
PATHS = st.sampled_from(
    [
        "name",
        "samples",
        "seed",
        "design",
        "tolerance",
        "confidence",
        "scenario",
        "errors",
        "correlations",
        "scenario.type",
        "scenario.trajectory",
        "scenario.lift_law",
        "scenario.first_point",
        "scenario.start",
        "scenario.axes",
        "scenario.x",
        "scenario.final_altitude",
        "scenario.ballistic",
        "errors.altitude",
        "errors.gyro_drift",
        "errors.y",
        "z",
    ]
)


@settings(max_examples=400)
@given(PATHS, VALUES)
def test_any_value_is_read_or_refused(path: str, value: Any) -> None:
    """Nothing but a list of mistakes ever comes out of a file that cannot be run, each one printable line."""
    try:
        parse_campaign(_with(path, value), "test.toml", "test")
    except CampaignError as refused:
        for problem in refused.problems:
            assert str(problem).isprintable()
            assert len(str(problem)) < 2000


@pytest.mark.parametrize(
    ("written", "message"),
    [
        (None, "no such file"),
        (b"\xff\xfe", "is not UTF-8 text"),
        (b"name = ", "is not TOML"),
        (b"a = 1\na = 2\n", "is not TOML"),
        (b"a = " + b"[" * 100_000, "is not TOML"),
        (b"#" * 1_000_001, "a campaign file has at most"),
        (b"", "scenario: is missing"),
    ],
)
def test_files_that_are_none(tmp_path: Path, written: bytes | None, message: str) -> None:
    path = tmp_path / "campaign.toml"
    if written is not None:
        path.write_bytes(written)
    with pytest.raises(CampaignError, match=message) as found:
        read_campaign(path)
    assert str(found.value).startswith(str(path))


def test_a_folder_is_no_campaign(tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match="is a folder"):
        read_campaign(tmp_path)
