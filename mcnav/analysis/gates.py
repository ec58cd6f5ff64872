"""Errors that gates stop: the smallest spike and ramp of each sensor, the error of what passes, and its risk."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.analysis.requirements import Requirement
from mcnav.contract.gates import FaultLaw, GateLaw, GateQuestion
from mcnav.statistics.gates import GatedError, acceptance, largest_of, run_acceptance, smallest_stopped

SIGMAS: Final = 4.0
"""Limit of an output without a requirement of its own, in true sigmas after the measurement."""

BEYOND: Final = 1e-9
"""Probability of acceptance at which the search for the worst spike ends."""


@dataclass(frozen=True)
class GateAnswer:
    """Errors of one component that the gate of a sensor stops, at its last measurement; SI.

    Attributes
    ----------
    sensor, component, unit, shown_in : str
    time : float
        Of the measurement, in the scenario's own time, s.
    probability : float
        With which spike and ramp are stopped.
    spike : float
        Smallest one that is; infinite where the gate stops none.
    output : int
        Number of the output that a spike harms the most, by its limit.
    spike_error : float
        Mean error that this spike adds to it where it passes.
    limit : float
        Of the output: of a requirement on it alone, or `SIGMAS`.
    required : bool
        Whether it is of a requirement.
    worst : float
        Spike that is the most probable to pass and leave the error beyond the limit.
    risk : float
        This probability.
    duration : float
        Of a ramp, s.
    ramp : float
        Smallest slope that is stopped within it, in units a second.
    ramp_output : int
        Number of the output that a ramp harms the most.
    ramp_error : float
        Error that it adds to this output at its end, if it passes.
    """

    sensor: str
    component: str
    unit: str
    shown_in: str
    time: float
    probability: float
    spike: float
    output: int
    spike_error: float
    limit: float
    required: bool
    worst: float
    risk: float
    duration: float
    ramp: float
    ramp_output: int
    ramp_error: float


def answer_gates(
    laws: Sequence[GateLaw], question: GateQuestion, requirements: Sequence[Requirement]
) -> tuple[GateAnswer, ...]:
    """Answer for each component of each sensor that has a gate."""
    limits = _limits(requirements)
    return tuple(
        _answer(law, component, question.probability, limits)
        for law in laws for component in range(len(law.components))
    )  # fmt: skip


def _limits(requirements: Sequence[Requirement]) -> Mapping[int, float]:
    """Return the smallest limit of each output that has a requirement of its own on the filter's errors."""
    limits: dict[int, float] = {}
    for each in requirements:
        if each.kind in ("quantile", "box") and not each.of:
            for output, limit in zip(each.outputs, each.limits, strict=True):
                limits[output] = min(limit, limits.get(output, np.inf))
    return limits


def _answer(law: GateLaw, component: int, probability: float, limits: Mapping[int, float]) -> GateAnswer:
    inverse = np.linalg.inv(law.root)
    whitened = inverse @ law.covariance @ inverse.T
    sigmas = np.sqrt(np.maximum(np.diag(law.errors), 0.0))
    allowed = np.array([limits.get(output, SIGMAS * sigma) for output, sigma in enumerate(sigmas.tolist())])
    shares = np.abs(law.responses[:, component]) / np.where(allowed > 0.0, allowed, np.inf)
    output = int(np.argmax(shares))
    # a spike b takes b from the innovation: in sigmas as the filter believes them
    direction = -inverse[:, component]
    scale = 1.0 / float(np.linalg.norm(direction))

    def accepted(size: float) -> float:
        ends = [inverse @ law.mean + sign * size * scale * direction for sign in (1.0, -1.0)]
        return max(acceptance(law.limit, end, whitened) for end in ends)

    def risk(size: float) -> float:
        spike, response = size * scale, float(law.responses[output, component])
        risks = [
            GatedError(
                law.limit, inverse @ law.mean + sign * spike * direction, whitened, inverse @ law.cross[:, output],
                float(law.mean_errors[output]) + sign * spike * response, float(sigmas[output]),
            ).unnoticed_beyond(float(allowed[output]))
            for sign in (1.0, -1.0)
        ]  # fmt: skip
        return max(risks)

    spike = smallest_stopped(accepted, probability)
    worst, at_worst = largest_of(risk, smallest_stopped(accepted, 1.0 - BEYOND))
    ramp = _ramp(law, component, whitened, probability)
    by_ramp = np.abs(law.ramp_errors[:, component]) / np.where(allowed > 0.0, allowed, np.inf)
    harmed = int(np.argmax(by_ramp))
    name, unit, shown_in = law.components[component]
    return GateAnswer(
        law.sensor, name, unit, shown_in, law.time, probability, spike * scale, output,
        abs(spike * scale * float(law.responses[output, component])), float(allowed[output]), output in limits,
        worst * scale, at_worst, law.duration, ramp, harmed, abs(ramp * float(law.ramp_errors[harmed, component])),
    )  # fmt: skip


def _ramp(law: GateLaw, component: int, covariance: Array, probability: float) -> float:
    """Return the smallest slope of which a measurement is rejected until its end with a probability."""
    means, limit = law.ramps[:, :, component], law.limit
    largest = float(np.linalg.norm(means, axis=1).max(initial=0.0))
    if largest <= 0.0:
        return float("inf")
    # what is rejected of measurements without a fault does not count
    usual = acceptance(limit, np.zeros(means.shape[1]), covariance)

    def accepted(size: float) -> float:
        return run_acceptance(limit, means * (size / largest), covariance, usual)

    return smallest_stopped(accepted, probability) / largest


@dataclass(frozen=True)
class FaultPrediction:
    """Expectation of linear analysis about the gate during a fault.

    Attributes
    ----------
    rejections : float
        Measurements that are rejected on average, as if all before were accepted.
    alarm : float
        Probability that any is rejected.
    """

    rejections: float
    alarm: float


def predict_fault(law: FaultLaw) -> FaultPrediction:
    """Predict what the gate of a sensor stops of a fault; white innovations are independent of one another."""
    passed = np.array(
        [acceptance(law.limit, mean, covariance) for mean, covariance in zip(law.means, law.covariances, strict=True)]
    )
    return FaultPrediction(float(np.sum(1.0 - passed)), float(1.0 - np.prod(passed)))
