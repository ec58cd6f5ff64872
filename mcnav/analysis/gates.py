"""Errors that gates stop: the smallest spike and ramp of each sensor, the error of what passes, and its risk."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.analysis.requirements import Requirement
from mcnav.arrays.products import transform
from mcnav.arrays.types import Array
from mcnav.contract.gates import FaultLaw, GateLaw, GateQuestion
from mcnav.contract.scenario import Scenario, has_gates
from mcnav.statistics.gates import LARGEST, GatedError, acceptance, check_stopped, largest_of, smallest_stopped
from mcnav.statistics.refusals import or_withheld

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
    """Answer for each component of each sensor that has a gate, but for those whose numbers a check refuses."""
    limits = _limits(requirements)
    answers = [
        or_withheld(_answer, law, component, question.probability, limits, instead=None)
        for law in laws for component in range(len(law.components))
    ]  # fmt: skip
    return tuple(answer for answer in answers if answer is not None)


def _limits(requirements: Sequence[Requirement]) -> Mapping[int, float]:
    """Return the smallest limit of each output that has a requirement of its own on the filter's errors."""
    limits: dict[int, float] = {}
    for requirement in requirements:
        if requirement.kind in ("quantile", "box") and not requirement.of:
            for output, limit in zip(requirement.outputs, requirement.limits, strict=True):
                limits[output] = min(limit, limits.get(output, np.inf))
    return limits


def _answer(law: GateLaw, component: int, probability: float, limits: Mapping[int, float]) -> GateAnswer:
    inverse = np.asarray(np.linalg.inv(law.root), dtype=np.float64)
    whitened = transform(inverse, law.covariance)
    sigmas = np.sqrt(np.maximum(np.diag(law.errors), 0.0))
    allowed = np.array([limits.get(output, SIGMAS * sigma) for output, sigma in enumerate(sigmas.tolist())])
    shares = np.abs(law.responses[:, component]) / np.where(allowed > 0.0, allowed, np.inf)
    output = int(np.argmax(shares))
    # a spike b takes b from the innovation: in sigmas as the filter believes them
    direction = -inverse[:, component]
    scale = 1.0 / float(np.linalg.norm(direction))

    signs = np.array([1.0, -1.0])
    mean, cross = inverse @ law.mean, inverse @ law.cross[:, output]
    if not law.mean.any() and not law.mean_errors[output]:
        signs = signs[:1]  # the other one is alike

    def accepted(size: float, rough: bool = True) -> float:
        return float(acceptance(law.limit, mean + np.outer(signs * size * scale, direction), whitened, rough).max())

    def risk(sizes: Array, rough: bool = True) -> Array:
        spikes = np.outer(sizes * scale, signs).ravel()
        errors = law.mean_errors[output] + spikes * law.responses[output, component]
        means = mean + np.outer(spikes, direction)
        gated = GatedError(law.limit, means, whitened, cross, errors, float(sigmas[output]))
        unnoticed = gated.unnoticed_beyond(float(allowed[output]), rough)
        return np.asarray(unnoticed.reshape(-1, len(signs)).max(axis=1))

    spike = smallest_stopped(accepted, probability)
    if 0.0 < spike < np.inf:
        check_stopped(accepted(spike, rough=False), probability)
    worst = largest_of(risk, min(smallest_stopped(accepted, 1.0 - BEYOND), LARGEST))
    at_worst = float(risk(np.array([worst]), rough=False)[0])
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
    usual = float(acceptance(limit, np.zeros((1, means.shape[1])), covariance)[0])

    def accepted(size: float, rough: bool = True) -> float:
        """Return the probability that all are accepted: innovations without a fault are independent of one another."""
        return float(np.prod(acceptance(limit, means * (size / largest), covariance, rough) / usual))

    stopped = smallest_stopped(accepted, probability)
    if 0.0 < stopped < np.inf:
        check_stopped(accepted(stopped, rough=False), probability)
    return stopped / largest


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


def predict_faults(scenario: Scenario, mean: Array, covariance: Array) -> list[tuple[FaultLaw, FaultPrediction]]:
    """Predict what gates stop of a scenario's faults, with errors of a mean and covariance; nothing without gates.

    A fault of which a check refuses the probabilities is left out.
    """
    laws = scenario.fault_laws(mean, covariance) if has_gates(scenario) else ()
    predicted = [(law, or_withheld(predict_fault, law, instead=None)) for law in laws]
    return [(law, prediction) for law, prediction in predicted if prediction is not None]


def predict_fault(law: FaultLaw) -> FaultPrediction:
    """Predict what the gate of a sensor stops of a fault; white innovations are independent of one another."""
    covariances, number = np.unique(law.covariances, axis=0, return_inverse=True)
    passed = np.zeros(len(law.means))
    for place, covariance in enumerate(covariances):
        alike = number.ravel() == place
        passed[alike] = acceptance(law.limit, law.means[alike], covariance)
    return FaultPrediction(float(np.sum(1.0 - passed)), float(1.0 - np.prod(passed)))
