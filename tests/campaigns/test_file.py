"""Campaign files: what is read, what is refused and in which words."""

from __future__ import annotations

import pickle
import shutil
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcnav.config.read import parse_campaign, read_campaign
from mcnav.config.stopping import StoppingRule
from mcnav.errors import CampaignError
from mcnav.sampler.distributions import Fixed, StudentT, Triangular, TruncatedNormal, Uniform
from mcnav.systems.closed_loop.scenario import ClosedLoopScenario
from mcnav.systems.registry import SCENARIO_TYPES
from tests.conftest import ROOT, content

TYPES = ", ".join(SCENARIO_TYPES)
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
def test_every_campaign_is_valid_and_resolves_to_itself(path: Path, tmp_path: Path) -> None:
    """A closed loop has the same sizes, for its class and file; any other scenario the same linear system."""
    campaign = read_campaign(path)
    assert path.read_text(encoding="utf-8").startswith("# Question:")
    place = path
    for file in campaign.files:  # a run folder has them in a folder of its own
        place = tmp_path / path.name
        (tmp_path / "inputs").mkdir(exist_ok=True)
        shutil.copy(file.path, tmp_path / "inputs" / file.name)
    again = parse_campaign(tomllib.loads(campaign.to_toml()), str(place), path.stem)
    assert again.resolved == campaign.resolved
    assert np.array_equal(again.errors.covariance, campaign.errors.covariance)
    first, second = campaign.scenario, again.scenario
    if isinstance(first, ClosedLoopScenario):
        assert isinstance(second, ClosedLoopScenario)
        assert pickle.dumps(first.sizes) == pickle.dumps(second.sizes)
    else:
        assert np.array_equal(first.linear().end.partials, second.linear().end.partials)


def test_there_is_a_campaign_for_every_trajectory() -> None:
    numbers = [tomllib.loads(path.read_text(encoding="utf-8"))["scenario"].get("trajectory") for path in CAMPAIGNS]
    assert {number for number in numbers if isinstance(number, int)} >= set(range(1, 8))
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
        ("errors.altitude", "-5 km", "errors.altitude: got '-5 km'; a sigma must not be negative"),
        ("errors.altitud", "5 km", "errors.altitud: unknown error source; did you mean 'altitude'?"),
        ("errors.range", {"distribution": "gauss"}, "errors.range.distribution: got 'gauss'; expected one of normal"),
        ("errors.range", {"distribution": "uniform"}, "errors.range.half_width: is missing; a uniform distribution"),
        ("errors.range", {"distribution": "uniform", "sigma": "1 km"},
         "errors.range.sigma: unknown key of a uniform distribution; expected half_width"),
        ("errors.misalignment", "400 deg", "errors.misalignment: got '400 deg'; at most 180 deg makes sense"),
        ("errors.range", {"sigma": "1 km", "width": 3}, "errors.range.width: unknown key of a normal distribution"),
        ("errors.range", {"distribution": "scipy.laplac"},
         "errors.range.distribution: got 'scipy.laplac'; scipy.stats has no continuous"),
        ("errors.range", {"distribution": "scipy.os"}, "errors.range.distribution: got 'scipy.os'; scipy.stats has no"),
        ("errors.range", {"distribution": "scipy.laplace"}, "errors.range.scale: is missing; scipy.laplace needs"),
        ("errors.range", {"distribution": "scipy.laplace", "scale": "1 s"},
         "errors.range.scale: got '1 s', which is a time; expected a length"),
        ("errors.range", {"distribution": "scipy.gamma", "scale": "1 km", "b": 3},
         "errors.range.b: unknown key of scipy.gamma"),
        ("errors.range", {"distribution": "scipy.cauchy", "scale": "1 km"},
         "errors.range: got scale = '1 km'; cauchy has no finite mean and variance"),
        ("errors.range", {"distribution": "scipy.laplace", "scale": "1e300 km"}, "errors.range: its mean or sigma is"),
        ("errors.range", {"distribution": "table"}, "errors.range.file: is missing; a table needs file and column and"),
        ("errors.range", {"distribution": "table", "file": "no.csv", "column": "x", "unit": "km"},
         "errors.range.file: no.csv: no such file; paths are relative to the campaign file"),
        ("errors.range", {"distribution": "table", "file": "no.txt", "column": "x", "unit": "km"},
         "errors.range.file: got 'no.txt'; expected a file that ends in .csv or .parquet"),
        ("errors.range", {"distribution": "table", "file": "no.csv", "column": "x", "unit": "s"},
         "errors.range.unit: got '1 s', which is a time"),
        ("errors.range", {"distribution": "table", "file": 3, "column": "x", "unit": "km"},
         "errors.range.file: got 3; expected text in quotes"),
        ("errors", 3, "errors: got 3; expected a table"),
        ("sample", 3, "sample: unknown key; did you mean 'samples'?"),
        ("samples", 0, "samples: got 0; expected a number greater than or equal to 2"),
        ("samples", "many", "samples: got 'many'; expected a whole number"),
        ("samples", 1e3, "samples: got 1000.0; expected a whole number"),
        ("samples", {"until": "sigma_ratio 1 %"}, "samples.at_most: is missing"),
        ("samples", {"until": "sigma_ratio 1 km", "at_most": 1000}, "samples.until: got '1 km', which is a length"),
        ("samples", {"until": "sigma_ratio", "at_most": 1000}, "samples.until: got ''; expected a pure number"),
        ("samples", {"until": "sigma_ratio 0", "at_most": 1000}, "samples.until: got 'sigma_ratio 0'; expected a prec"),
        ("samples", {"until": "bias 1 %", "at_most": 1000}, "samples.until: got 'bias 1 %'; expected a quantity and"),
        ("samples", {"until": 3, "at_most": 1000}, "samples.until: got 3; expected text in quotes"),
        ("samples", {"until": "sigma_ratio 1 %", "at_most": "many"}, "samples.at_most: got 'many'; expected a whole"),
        ("samples", {"until": "sigma_ratio 1 %", "at_most": 99, "atmost": 3},
         "samples.atmost: unknown key of a stopping rule; did you mean 'at_most'?"),
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
        ("scenario.type", "orbit", f"scenario.type: got 'orbit'; expected one of {TYPES},"),
        ("scenario.trajectory", 8, "scenario.trajectory: got 8; expected a number less than or equal to 7"),
        ("scenario.axis", "start", "scenario.axis: unknown key; did you mean 'axes'?"),
        ("scenario.start", "-90 min", "scenario.start: -90 min from reentry is not on the trajectory, which runs from"),
        ("scenario.start", "30 min", "scenario.start: 30 min from reentry is not on the trajectory"),
        ("scenario.final_altitude", "122 km", "scenario.final_altitude: 122 km cannot be the end of a reentry"),
        ("scenario.final_altitude", "-1 km", "scenario.final_altitude: -1 km cannot be the end of a reentry"),
        ("scenario.ballistic", "0.1 kg", "scenario.ballistic: got '0.1 kg', which is of dimension [mass]; expected an"),
        (
            "scenario.lift_law",
            {"type": "wings"},
            "scenario.lift_law.type: got 'wings'; expected one of constant, variable",
        ),
        ("scenario.lift_law", {"type": "constant"}, "scenario.lift_law.lift_to_drag: is missing"),
        ("accept", 5, "accept: got 5; expected a table"),
        ("accept", {"sigma": 5}, "accept.sigma: unknown key; did you mean 'sigma_ratio'?"),
        ("accept", {"sigma_ratio": "5 km"}, "accept.sigma_ratio: got '5 km', which is a length"),
        ("accept", {"sigma_ratio": 0}, "accept.sigma_ratio: got 0"),
        ("accept", {"quantile": [{"output": "altitud", "probability": 0.9, "below": "1 km"}]},
         "accept.quantile #1.output: unknown output 'altitud'; did you mean 'altitude'?"),
        ("accept", {"quantile": [{"output": "altitude", "probability": 1.5, "below": "1 km"}]},
         "accept.quantile #1.probability: got 1.5"),
        ("accept", {"quantile": [{"output": "altitude", "probability": 0.9, "below": "1 m/s"}]},
         "accept.quantile #1.below: got '1 m/s', which is a speed; expected a length"),
        ("accept", {"quantile": [{"output": "altitude", "probability": 0.9, "below": "-1 km"}]},
         "accept.quantile #1.below: got '-1 km'; expected a limit above zero"),
        ("accept", {"quantile": [{"output": "altitude", "probability": 0.9}]}, "accept.quantile #1.below: is missing"),
        ("accept", {"quantile": [{"output": "range", "probability": 0.9, "below": "1 km", "abov": 3}]},
         "accept.quantile #1.abov: unknown key; did you mean 'about'? It is one of output, probability, below"),
        ("accept", {"cep": [{"outputs": ["altitude"], "below": "1 km"}]},
         "accept.cep #1.outputs: got a list of length 1; expected at"),
        ("accept", {"cep": [{"outputs": ["altitude", "altitude"], "below": "1 km"}]},
         "accept.cep #1.outputs: got 'altitude' twice"),
        ("accept", {"cep": [{"outputs": ["altitude", "range_rate"], "below": "1 km"}]},
         "accept.cep #1.outputs: altitude and range_rate have different units"),
        ("accept", {"box": [{"within": {}, "probability": 0.9}]}, "accept.box #1.within: is empty"),
        ("accept", {"box": [{"within": {"speed": "1 km"}, "probability": 0.9}]},
         "accept.box #1.within: unknown output 'speed'"),
        ("accept", {"box": [{"within": {"range": "1 deg"}, "probability": 0.9}]},
         "accept.box #1.within.range: got '1 deg', which is an angle; expected a length"),
        ("scenario.first_point", {}, "scenario.first_point.altitude: is missing"),
    ],
)  # fmt: skip
def test_one_mistake_is_one_line(path: str, value: Any, line: str) -> None:
    described = _with(path, value)
    found = _mistakes(described)
    assert found[0].startswith(f"test.toml: {line}"), found
    if path != "scenario.first_point" and "is missing; " not in line and "scipy.gamma" not in line:
        assert len(found) == 1, found


CRUISE = {"type": "cruise", "speed": "250 m/s", "duration": "2 h"}
HOVER = {"type": "hover", "duration": "20 min"}


@pytest.mark.parametrize(
    ("scenario", "line"),
    [
        (CRUISE | {"speed": "250 m"}, "scenario.speed: got '250 m', which is a length; expected a speed"),
        (CRUISE | {"speed": "8 km/s"}, "scenario.speed: 8000 m/s is not below the 7905.5 m/s of a satellite at this"),
        (CRUISE | {"speed": "-1 m/s"}, "scenario.speed: got '-1 m/s'; expected at least 0 m/s"),
        (CRUISE | {"distance": "9 km"}, "scenario.distance: got with a duration; keep one"),
        ({"type": "cruise", "speed": "9 m/s"}, "scenario.duration: is missing; give it, or a distance"),
        ({"type": "cruise", "speed": "0 m/s", "distance": "9 km"}, "scenario.distance: takes more than ten days"),
        (CRUISE | {"platform": "flat"}, "scenario.platform: got 'flat'; expected 'inertial' or 'level'"),
        (CRUISE | {"altitud": "1 km"}, "scenario.altitud: unknown key; did you mean 'altitude'?"),
        (HOVER | {"speed": "1 m/s"}, "scenario.speed: unknown key"),
        (HOVER | {"gravity": "1 km"}, "scenario.gravity: got '1 km', which is a length; expected an acceleration"),
        ({"type": "hover"}, "scenario.duration: is missing"),
        ({"type": 3}, f"scenario.type: got 3; expected one of {TYPES}, or a file and class such as"),
        ({}, f"scenario.type: is missing; it is one of {TYPES}, or a file and class such as"),
    ],
)
def test_one_mistake_of_a_steady_flight(scenario: dict[str, Any], line: str) -> None:
    (found,) = _mistakes({"scenario": scenario, "errors": {"bias_x": "100 ug"}})
    assert found.startswith(f"test.toml: {line}"), found


def test_a_slaved_altitude_has_no_error() -> None:
    errors = {"altitude": "10 m", "range": "10 m"}
    (found,) = _mistakes({"scenario": CRUISE, "errors": errors})
    assert found.startswith("test.toml: errors.altitude: unknown error source; expected one of range, cross_range")
    run = parse_campaign({"scenario": CRUISE | {"altitude_channel": "inertial"}, "errors": errors}, "test.toml", "test")
    assert [source.name for source in run.scenario.sources][:2] == ["altitude", "range"]


def test_a_distance_is_flown_along_the_ground() -> None:
    """5,060 miles at half a mile a second: 10,120 s on the ground, a share h / R more at height."""
    table = {"type": "cruise", "speed": "2640 ft/s", "distance": "5060 mi"}
    low, high = (
        parse_campaign({"scenario": table | {"altitude": height}}, "test.toml", "test").scenario.flight.duration
        for height in ("0 km", "63.7814 km")
    )
    assert low == pytest.approx(10_120.0)
    assert high == pytest.approx(10_120.0 * 1.01)


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
        "test.toml: correlations: together they are not a correlation matrix: its smallest eigenvalue is -0.8; "
        "expected none below zero"
    )


@pytest.mark.parametrize(
    ("table", "line"),
    [
        ({"between": ["altitude", "altitude"], "coefficient": 0.5}, "correlations #1.between: got 'altitude' twice"),
        (
            {"between": ["altitude", "speed"], "coefficient": 0.5},
            "correlations #1.between: unknown error source 'speed'",
        ),
        (
            {"between": ["altitude"], "coefficient": 0.5},
            "correlations #1.between: got a list of length 1; expected at",
        ),
        ({"between": ["altitude", "range"], "coefficient": 1.5}, "correlations #1.coefficient: got 1.5"),
        ({"between": ["altitude", "range"]}, "correlations #1: got neither; expected coefficient (Pearson's) or rank_"),
        (
            {"between": ["altitude", "range"], "coefficient": 0.5, "rank_coefficient": 0.5},
            "correlations #1: got both; expected coefficient (Pearson's) or rank_coefficient (Spearman's)",
        ),
        (
            {"between": ["altitude", "range"], "rang_coefficient": 0.5},
            "correlations #1.rang_coefficient: unknown key; did you mean 'rank_coefficient'",
        ),
    ],
)
def test_one_wrong_correlation(table: dict[str, Any], line: str) -> None:
    found = _mistakes(content(correlations=[table]))
    assert len(found) == 1
    assert found[0].startswith(f"test.toml: {line}")


def test_errors_that_share_their_tails() -> None:
    """Written as TOML and read again it is the same; the sigmas and correlations stated stay."""
    tail = {"sources": ["altitude", "bias_x"], "distribution": "student-t", "degrees_of_freedom": 5}
    pair = {"between": ["altitude", "bias_x"], "coefficient": 0.5}
    found = parse_campaign(content(joint=[tail], correlations=[pair]), "test.toml", "test")
    alone = parse_campaign(content(correlations=[pair]), "test.toml", "test")
    assert np.array_equal(found.errors.covariance, alone.errors.covariance)
    assert found.errors.heavy_tailed("random") == ("altitude", "bias_x")
    again = parse_campaign(tomllib.loads(found.to_toml()), "test.toml", "test")
    assert again.resolved == found.resolved
    assert np.array_equal(again.errors.draw("random", 1, 9, 0, 9), found.errors.draw("random", 1, 9, 0, 9))
    assert "joint" not in alone.resolved


@pytest.mark.parametrize(
    ("changed", "line"),
    [
        ({"sources": ["altitude", "speed"]}, "joint #1.sources: unknown error source 'speed'"),
        ({"sources": ["altitude", "altitude"]}, "joint #1.sources: altitude is named twice"),
        ({"degrees_of_freedom": 2}, "joint #1.degrees_of_freedom: got 2; expected a number greater than 2"),
        ({"distribution": "normal"}, "joint #1.distribution: got 'normal'; expected 'student-t'"),
        ({"degrees_of_fredom": 2}, "joint #1.degrees_of_fredom: unknown key; did you mean 'degrees_of_freedom'"),
    ],
)
def test_one_wrong_group(changed: dict[str, Any], line: str) -> None:
    tail = {"sources": ["altitude", "bias_x"], "distribution": "student-t", "degrees_of_freedom": 5} | changed
    (found,) = _mistakes(content(joint=[tail]))
    assert found.startswith(f"test.toml: {line}")


def test_a_stopping_rule() -> None:
    rule = {"until": "sigma_ratio_paired 0.5 %", "at_most": 50_000}
    found = parse_campaign(content(samples=rule), "test.toml", "test")
    assert found.until == StoppingRule("sigma_ratio_paired", 0.005, 0.95, 50_000)
    assert found.samples == 50_000
    assert parse_campaign(tomllib.loads(found.to_toml()), "test.toml", "test").until == found.until
    both = _mistakes(content(samples={"until": "1 %"}))
    assert any("got '1 %'; expected a quantity" in line for line in both)
    assert any("a stopping rule needs until and at_most" in line for line in both)
    (line,) = _mistakes(content(samples=rule, design="sobol"))
    assert line.startswith("test.toml: samples.until: needs design random or antithetic: the samples of sobol change")


def _table(path: Path, **entry: Any) -> dict[str, Any]:
    described = content()
    described["errors"]["range"] = {"distribution": "table", "file": path.name, "column": "x", "unit": "km"} | entry
    return described


@pytest.mark.parametrize(
    ("text", "entry", "line"),
    [
        ("x\n1\n2\n", {"column": "y"}, "column: {} has no column 'y'; expected x"),
        ("x\n1\nb\n", {}, "column: {}, 'x': contains an entry that is not a number"),
        ('x\n1\n""\n3\n', {}, "column: {}, 'x': a value is missing or not finite"),
        ("x\n1\n1\n", {}, "column: {}, 'x': expected at least two different values"),
        ("x\n", {}, "column: {}, 'x': expected at least two different values"),
        ("", {}, "file: {}: is not a table: No columns to parse from file"),
        ("x\n1\n2\n", {"sha256": "0"}, "sha256: the values in {} have changed since the run"),
        ("x\n1\n2\n", {"colour": "0"}, "colour: unknown key of a table"),
    ],
)
def test_tables_that_are_none(text: str, entry: dict[str, Any], line: str, tmp_path: Path) -> None:
    path = tmp_path / "values.csv"
    path.write_text(text)
    with pytest.raises(CampaignError) as found:
        parse_campaign(_table(path, **entry), str(tmp_path / "test.toml"), "test")
    (told,) = str(found.value).splitlines()
    assert told.startswith(f"{tmp_path / 'test.toml'}: errors.range.{line.format(path)}")


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_a_table_is_read_in_its_unit(kind: str, tmp_path: Path) -> None:
    frame = pd.DataFrame({"x": [1.0, 2.5, -3.0], "other": ["a", "b", "c"]})
    path = tmp_path / f"values.{kind}"
    (frame.to_csv if kind == "csv" else frame.to_parquet)(path)
    found = parse_campaign(_table(path), str(tmp_path / "test.toml"), "test")
    assert found.errors.standard_deviations[1] == pytest.approx(1000.0 * frame["x"].std(ddof=0))
    assert found.errors.mean[1] == pytest.approx(1000.0 * frame["x"].mean())
    entry = found.resolved["errors"]["range"]
    assert (entry["file"], entry["column"], entry["unit"], len(entry["sha256"])) == (
        "tables/range.csv",
        "value",
        "m",
        64,
    )
    again = tmp_path / "elsewhere"
    (again / "tables").mkdir(parents=True)
    (again / "tables" / "range.csv").write_bytes(found.tables["tables/range.csv"])
    same = parse_campaign(tomllib.loads(found.to_toml()), str(again / "campaign.toml"), "test")
    assert same.resolved == found.resolved
    assert same.tables == found.tables


def test_requirements() -> None:
    accept = {
        "sigma_ratio": "5 %",
        "quantile": [{"output": "altitude", "probability": 0.9973, "below": "120 km"}],
        "cep": [{"outputs": ["altitude", "range"], "below": "60 km"}],
        "box": [{"within": {"altitude": "100 km", "range_rate": "1 km/s"}, "probability": 0.99}],
    }
    found = parse_campaign(content(accept=accept), "test.toml", "test")
    assert [entry.to_json() for entry in found.requirements] == [
        {"kind": "sigma_ratio", "outputs": ["altitude", "range", "altitude_rate", "range_rate"], "limits": [0.05],
         "probability": None},
        {"kind": "quantile", "outputs": ["altitude"], "limits": [120e3], "probability": 0.9973},
        {"kind": "cep", "outputs": ["altitude", "range"], "limits": [60e3], "probability": 0.5},
        {"kind": "box", "outputs": ["altitude", "range_rate"], "limits": [100e3, 1e3], "probability": 0.99},
    ]  # fmt: skip
    assert parse_campaign(tomllib.loads(found.to_toml()), "test.toml", "test").requirements == found.requirements


def test_a_correlation_with_an_absent_error() -> None:
    described = content(correlations=[{"between": ["altitude", "range"], "coefficient": 0.5}])
    del described["errors"]["range"]
    (line,) = _mistakes(described)
    assert line.startswith("test.toml: correlations #1: range has no dispersion")


def test_several_mistakes_are_listed_together() -> None:
    described = content() | {"seeds": 3, "samples": "ten"}
    described["errors"] |= {"gyro_drift": "5 km", "sped": "1 m/s"}
    described["scenario"] = {"type": "reentry", "trajectory": 4, "start": -20}
    keys = [line.split(": ")[1] for line in _mistakes(described)]
    assert sorted(keys) == ["errors.gyro_drift", "errors.sped", "samples", "scenario.start", "seeds"]


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
        "joint",
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
        "accept",
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
        (b"\xff\xfe\x00", "no whole UTF-16 text either; save it as UTF-8"),
        ('name = "a"'.encode("utf-16-le"), "seems to be UTF-16; save it as UTF-8"),
        (
            'name = "a"\ntitle = "1 °"'.encode("cp1252"),
            "line 2 has the byte 0xb0, which is '°' in Windows-1252; save it",
        ),
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
