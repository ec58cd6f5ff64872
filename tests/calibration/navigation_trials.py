"""Small campaigns of inertial navigation with noise, simulated and analysed as a run is.

Seven minutes of flight with a turn; the truth that statements are compared with is linear analysis, whose error is far
below that of so few samples.

`free navigation`
    Without aiding, with biases and random walks.
`aided navigation, matched`
    With GNSS every five seconds, and a filter that believes the truth.
`aided navigation, considering`
    A filter that considers a bias of the velocity that GNSS measures without estimating it.
`aided navigation, scale factors neglected`
    A filter that knows nothing of scale factors and misalignments.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from functools import lru_cache
from typing import Any, Final

import numpy as np

from mcnav.analysis.comparison import Criterion, compare
from mcnav.analysis.filter_assessment import assess_filter
from mcnav.analysis.filter_causes import largest_departure, neglected_errors
from mcnav.analysis.filter_decision import outputs_of
from mcnav.analysis.filter_evidence import FilterEvidence, LinearFilter, MeanSquares
from mcnav.analysis.requirements import Requirement, judge_requirement, linear_quantile
from mcnav.analysis.requirements_over_time import ErrorHistories, judge_over_time, largest_linear_quantile
from mcnav.arrays.types import Array
from mcnav.config.read import parse_campaign
from mcnav.contract.samples import SimulationResult
from mcnav.numerics.power_sums import sum_powers_about_zero
from mcnav.sampler.designs import SamplingDesign
from mcnav.statistics.filter_sums import FilterMeans, FilterSums
from mcnav.workflow.filter_evidence import linear_filter
from mcnav.workflow.prepare import PreparedSystem, prepare_system
from mcnav.workflow.recorded_model import RecordedModel
from tests.calibration.cells import LEVEL, Cell, Tally, tally
from tests.calibration.kalman_trials import alarms, covered, detected, out_of_bounds

NAVIGATION: Final = "free navigation"
AIDED: Final = "aided navigation"
"""Beginnings of the names of the systems."""

SIZES: Final = (100, 200)
SHARE: Final = 3
"""Number of campaigns of another kind for each one of these, which take longer."""

TOLERANCE: Final = 0.05
HORIZONTAL: Final = (0, 1)
FIRST: Final = 1_000_000
"""Seed of the first campaign; those of preparation are small."""

FLIGHT: Final[Mapping[str, Any]] = {
    "samples": 100,
    "scenario": {
        "type": "ins",
        "trajectory": {
            "rate": "1 Hz",
            "start": {"latitude": "47 deg", "longitude": "9 deg", "altitude": "500 m", "course": "80 deg",
                      "speed": "80 m/s"},
            "segments": [{"straight": "2 min"}, {"turn": "90 deg"}, {"straight": "5 min"}],
        },
    },
    "imu": {
        "gyro": {"bias": "0.05 deg/h", "angle_random_walk": "0.02 deg/sqrt(h)"},
        "accelerometer": {"bias": "100 ug", "velocity_random_walk": "50 ug/sqrt(Hz)"},
    },
    "errors": {"position": "5 m", "velocity": "0.05 m/s", "tilt": "0.05 mrad", "heading": "0.5 mrad"},
}  # fmt: skip

GNSS: Final[Mapping[str, Any]] = {"type": "gnss", "interval": "5 s", "position": "3 m", "velocity": "0.1 m/s"}
ESTIMATES: Final = ["position", "velocity", "attitude", "gyro_bias", "accelerometer_bias"]
NEGLECTED: Final[Mapping[str, Any]] = {
    "gyro": {"scale_factor": "100 ppm", "misalignment": "100 arcsec"},
    "accelerometer": {"scale_factor": "500 ppm", "misalignment": "100 arcsec"},
}
"""Sizes of errors that a filter does not know."""

MATCHED, CONSIDERING = f"{AIDED}, matched", f"{AIDED}, considering"
NEGLECTING: Final = f"{AIDED}, scale factors neglected"
SYSTEMS: Final = (NAVIGATION, MATCHED, CONSIDERING, NEGLECTING)

Statement = tuple[str, str, bool]


def run_navigation_trials(trials: int, jobs: int, sizes: Sequence[int] = SIZES) -> Tally:
    """Simulate so many campaigns of each system and size."""
    return tally(trials, jobs, [(name, size) for name in SYSTEMS for size in sizes], _count)


def description(name: str) -> dict[str, Any]:
    """Return the campaign of a system as a campaign file holds it."""
    content = deepcopy(dict(FLIGHT))
    if name == NAVIGATION:
        return content
    content["aiding"], content["filter"] = [dict(GNSS)], {"estimates": ESTIMATES}
    if name == CONSIDERING:
        content["aiding"][0]["velocity_bias"] = "0.1 m/s"
        content["filter"]["considers"] = ["gnss_velocity_bias"]
    elif name == NEGLECTING:
        for instrument, sizes in NEGLECTED.items():
            content["imu"][instrument] |= sizes
    return content


@lru_cache(maxsize=len(SYSTEMS))
def prepared(name: str) -> PreparedSystem:
    """Prepare a system for simulation, with its linear model, as a run does."""
    campaign = parse_campaign(description(name), f"{name}.toml", name)
    return prepare_system(replace(campaign, tolerance=TOLERANCE), "ensemble")


def _count(kind: tuple[str, int], seeds: Sequence[int], outcome: Tally) -> None:
    name, count = kind
    system = prepared(name)
    engine, judged = system.engine, _Free(system) if name == NAVIGATION else None
    for seed in seeds:
        batch = replace(system.draws, seed=FIRST + seed, samples=count).batch(0, count)
        result = engine.simulate(batch)
        statements = _filtered(name, system, result) if judged is None else judged.statements(batch.errors, result)
        for statement, sort, hit in statements:
            outcome.add(Cell(sort, name, statement, "normal", "random", count), hit)


class _Free:
    """Judgement of campaigns of free navigation, and the true quantiles by linear analysis."""

    def __init__(self, system: PreparedSystem) -> None:
        linear = RecordedModel(system.model, system.linear).over_time
        assert linear is not None
        self.model = system.linear
        self.outputs = [output.name for output in system.scenario.outputs]
        # every interval at the level: nine outputs and the matrix share what is left
        self.criterion = Criterion(TOLERANCE, 1.0 - (len(self.outputs) + 1) * (1.0 - LEVEL))
        self.times, self.moments = linear.record.times, (linear.mean, linear.covariance)
        self.epochs = tuple(range(1, len(self.times)))
        self.last = Requirement("r95", HORIZONTAL, (linear_quantile(self.model, HORIZONTAL, 0.95),), 0.95)
        largest = largest_linear_quantile(self._histories(np.zeros((1, 1, 1))), HORIZONTAL, self.epochs, 0.95)
        self.over_time = replace(self.last, limits=(largest,), when="throughout", epochs=self.epochs)

    def _histories(self, errors: Array) -> ErrorHistories:
        return ErrorHistories(self.times, errors, np.arange(len(errors)), *self.moments, len(errors))

    def statements(self, errors: Array, result: SimulationResult) -> Iterator[Statement]:
        """Yield kind, statement, and whether it is right or made."""
        assert result.history is not None
        statements = compare(self.model, errors, result.values, self.criterion, SamplingDesign(), result.linear_values)
        for name in ("position_north", "heading"):
            interval = statements.outputs[self.outputs.index(name)].plain.interval
            assert interval is not None
            yield f"plain sigma ratio, {name.replace('_', ' ')}", "coverage", interval[0] <= 1.0 <= interval[1]
        joint = statements.joint
        assert joint is not None
        tests = {
            "covariance, likelihood ratio": joint.covariance, "NEES, Kolmogorov-Smirnov": joint.nees,
            "bias, Hotelling": joint.bias,
        }  # fmt: skip
        for statement, test in tests.items():
            if test is not None:
                yield statement, "false alarm", test.p_value < 1.0 - LEVEL
        yield "verdict: agrees, on all outputs", "power", statements.verdict.value == "agrees"
        blocks = np.arange(len(errors))
        low, high = judge_requirement(self.last, self.model, result.values, blocks, statements, LEVEL).interval
        yield "R95, upper bound", "coverage", high >= self.last.limits[0]
        yield "R95, lower bound", "coverage", low <= self.last.limits[0]
        low, high = judge_over_time(self.over_time, self._histories(result.history), LEVEL).interval
        yield "R95 at all epochs, upper bound", "coverage", high >= self.over_time.limits[0]
        yield "R95 at all epochs, lower bound", "coverage", low <= self.over_time.limits[0]


def _filtered(name: str, system: PreparedSystem, result: SimulationResult) -> Iterator[Statement]:
    linear = _linear(name)
    statements = assess_filter(evidence(system, result, linear), Criterion(TOLERANCE, LEVEL))
    yield from covered(statements, "attitude" if name == NEGLECTING else "position")
    if name == NEGLECTING:
        yield from detected(statements, _cause())
        return
    yield from alarms(statements)
    if name == MATCHED:
        yield from out_of_bounds(statements)


def evidence(system: PreparedSystem, result: SimulationResult, linear: LinearFilter) -> FilterEvidence:
    """Form the evidence of a campaign as `mcnav.workflow.analyse` does, from its samples in place of a run folder."""
    record = system.model.filter
    assert record is not None
    assert result.history is not None
    assert result.filter_values is not None
    return FilterEvidence(
        label=record.label,
        times=record.times,
        outputs=system.scenario.outputs,
        means=FilterMeans.of(record.columns, FilterSums.of(record.columns, result.filter_values)),
        true=MeanSquares.of(sum_powers_about_zero(result.history)),
        failed=len(result.failures),
        linear=linear,
    )


@lru_cache(maxsize=len(SYSTEMS))
def _linear(name: str) -> LinearFilter:
    model = prepared(name).model
    assert model.filter is not None
    recorded = RecordedModel(model, prepared(name).linear)
    linear = linear_filter(recorded, model.filter, recorded.over_time)
    assert linear is not None
    return linear


@lru_cache(maxsize=1)
def _cause() -> str:
    """Return the largest neglected error of the attitude by linear analysis, which every campaign should name."""
    names, linear = [output.name for output in prepared(NEGLECTING).scenario.outputs], _linear(NEGLECTING)
    departure = largest_departure(linear, outputs_of("attitude", names), TOLERANCE)
    assert departure is not None
    return neglected_errors(linear, departure)[0].name
