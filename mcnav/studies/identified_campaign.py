"""Navigation errors of a campaign with the noise that logs identify, and the interval that follows from theirs.

The values that the logs identify replace those of the campaign's ``[imu]``; where its filter believes what the
instruments are, it believes the new values. With the filter's gains as they are then, the variance of an error is

    V(θ) = V_0 + Σ_j Q_j exp(2 δ_j + s_j ε_j)

of the sources that are kept and of each process j; δ_j and ε_j are departures of the logarithms of its size and of its
correlation time from the estimates, s_j the derivative of log Q_j by the latter, by central differences. They are drawn
from the asymptotic normal law of the estimates, each half of which is stretched to the parameter's interval.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from scipy.stats import norm

from mcnav.arrays.types import Array
from mcnav.config.overrides import Value, VariedCampaign
from mcnav.config.read import Campaign
from mcnav.errors import CampaignError, Problem
from mcnav.identification.estimates import relative_covariance
from mcnav.physics.units import conversion
from mcnav.report.results.identified import AxisReport, CampaignSigmas, IdentificationReport, SigmaRow
from mcnav.studies.linear_answers import answer_linearly
from mcnav.systems.ins.imu.instruments import AXES, Imu, Noise, process_sizes
from mcnav.systems.ins.recognition import is_ins
from mcnav.systems.ins.scenario import Ins, Navigation
from mcnav.systems.ins.tables.instrument_tables import INTERVALS, SHORTEST_CORRELATION

DRAWS: Final = 4_000

STEP: Final = 0.05
"""Change of the logarithm of a correlation time by which variances are differenced."""

PROCESSES: Final = {
    "random_walk": "{}_{}_random_walk_{}",
    "instability": "{}_bias_instability_{}",
    "rate_random_walk": "{}_rate_random_walk_{}",
    "quantization": "{}_quantization_{}",
}
"""Names of the processes of linear analysis by those of the parameters, for an instrument, its walk and an axis."""

STAND_IN: Final = ("instability", "correlation_time", "rate_random_walk")
"""Parameters that stand for flicker noise."""

WALKS: Final = {"gyro": "angle", "accelerometer": "velocity"}


def open_campaign(path: Path) -> VariedCampaign:
    """Read a campaign; `CampaignError` when it cannot be read, or is of another type than ``ins``."""
    varied = VariedCampaign(path)
    if not is_ins(varied.campaign.scenario):
        message = "has no inertial measurement unit over the earth; expected a campaign of type ins"
        raise CampaignError([Problem(str(path), "scenario.type", message)])
    return varied


def campaign_sigmas(varied: VariedCampaign, report: IdentificationReport) -> CampaignSigmas:
    """Compute the final navigation errors of a campaign of type ``ins`` with what logs identify."""
    own = varied.campaign
    changes = [_change(axis) for axis in report.axes]
    imu = _merged(_navigation(own).imu, changes)
    campaign = varied.at(_entries(imu, _navigation(own).imu))
    scenario = Ins(_navigation(campaign))
    answer = answer_linearly(campaign)
    variances = np.diag(answer.model.outcome_covariance)
    drawn = variances + _departures(scenario, answer.model.processes, changes)
    low, high = np.sqrt(np.maximum(np.quantile(drawn, (0.025, 0.975), axis=0), 0.0))
    bounded, bounds = _bounded(scenario, changes, variances, answer.model.processes)
    factors = np.array([conversion(output.unit, output.shown_in) for output in scenario.outputs])
    numbers = np.array([answer_linearly(own).sigma, answer.sigma, low, high, bounded]) * factors
    rows = [
        SigmaRow(output.name, output.shown_in, *map(float, column))
        for output, column in zip(scenario.outputs, numbers.T, strict=True)
    ]
    replaced = tuple(name for change in changes for name in change.replaced)
    kept = tuple(name for name in process_sizes(imu) if name not in replaced)
    return CampaignSigmas(own.name, tuple(rows), replaced, kept, bounds, scenario.navigation.filter is not None)


def _navigation(campaign: Campaign) -> Navigation:
    """Return the navigation of a campaign of type ``ins``."""
    if not is_ins(campaign.scenario):
        raise TypeError(campaign.name)
    return campaign.scenario.navigation


@dataclass(frozen=True)
class _Change:
    """Values of a log in place of a campaign's, for one axis.

    Attributes
    ----------
    sizes : mapping of str to float
        By attribute of `Noise`.
    bounds : mapping of str to float
        The same, of what is not identified, at its upper bound.
    places : mapping of str to int
        Places in the model of the parameters that are put in.
    """

    axis: AxisReport
    sizes: Mapping[str, float]
    bounds: Mapping[str, float]
    places: Mapping[str, int]

    @property
    def replaced(self) -> list[str]:
        """Names of the processes whose sizes are put in."""
        return [self.process(name) for name in self.places if name in PROCESSES]

    def process(self, name: str) -> str:
        """Return the name of a process of linear analysis."""
        instrument, pattern = self.axis.instrument, PROCESSES[name]
        words = (
            (instrument, WALKS[instrument], self.axis.axis) if name == "random_walk" else (instrument, self.axis.axis)
        )
        return pattern.format(*words)


def _change(axis: AxisReport) -> _Change:
    """Say what replaces the values of an axis: those of both slow processes, absent ones by zero."""
    estimates = {estimate.name: estimate for estimate in axis.fitted.estimates}
    known = {name for name, estimate in estimates.items() if estimate.identified}
    if not {"instability", "correlation_time"} <= known:
        known -= {"instability", "correlation_time"}
    if not INTERVALS[0] <= axis.interval <= INTERVALS[1]:
        known -= {"quantization"}
    sizes = {name: estimate.value for name, estimate in estimates.items() if name in known}
    if axis.stand_in is not None:
        sizes.pop("flicker")
        sizes |= {name: axis.stand_in.parameters[name] for name in STAND_IN}
    if "correlation_time" in sizes:
        sizes = {"rate_random_walk": 0.0, **sizes}
        sizes["correlation_time"] = max(sizes["correlation_time"], SHORTEST_CORRELATION)
    elif "rate_random_walk" in sizes:
        sizes["instability"] = 0.0
    if "quantization" in sizes:
        sizes["quantization_interval"] = axis.interval
    places = {name: place for place, name in enumerate(axis.fitted.chosen.model.parameters) if name in known}
    if axis.stand_in is not None:  # what stands for flicker noise varies with it
        flicker = places.pop("flicker")
        places = {"instability": flicker, "rate_random_walk": flicker} | places
    return _Change(axis, sizes, _bounds(axis, {*sizes, *known}), places)


def _bounds(axis: AxisReport, known: set[str]) -> dict[str, float]:
    """Return the upper bounds of what an axis does not identify; of a process without a bound, nothing."""
    bounds = dict[str, float]()
    for name in ("rate_random_walk", "quantization"):
        row = next(row for row in axis.parameters if row.key.split(".")[0] == name)
        if name not in known and np.isfinite(row.high):
            bounds[name] = row.high
    estimates = {estimate.name: estimate for estimate in axis.fitted.estimates}
    if "instability" in estimates and "instability" not in known and np.isfinite(estimates["instability"].high):
        bounds |= {
            "instability": estimates["instability"].high,
            "correlation_time": estimates["correlation_time"].value,
        }
    if "quantization" in bounds and INTERVALS[0] <= axis.interval <= INTERVALS[1]:
        bounds["quantization_interval"] = axis.interval
    else:
        bounds.pop("quantization", None)
    return bounds


def _merged(imu: Imu, changes: Sequence[_Change], bounded: bool = False) -> Imu:
    """Put the values of all axes, or their bounds, into an `Imu`."""
    result = {"gyro": imu.gyro, "accelerometer": imu.accelerometer}
    for change in changes:
        noise, place = result[change.axis.instrument], AXES.index(change.axis.axis)
        arrays = dict[str, Array]()
        for name, value in (change.bounds if bounded else change.sizes).items():
            arrays[name] = getattr(noise, name).copy()
            arrays[name][place] = value
        result[change.axis.instrument] = replace(noise, **arrays)
    return replace(imu, gyro=result["gyro"], accelerometer=result["accelerometer"])


def _entries(imu: Imu, before: Imu) -> dict[str, Value]:
    """Write the processes that have changed as ``[imu]`` has them, all axes of a process."""
    entries = dict[str, Value]()
    for instrument, unit, counted in (("gyro", "rad/s", "rad"), ("accelerometer", "m/s^2", "m/s")):
        noise, old = getattr(imu, instrument), getattr(before, instrument)

        def written(values: Array, si: str) -> list[str]:
            return [f"{value!r} {si}" for value in values.tolist()]

        def changed(*names: str, noise: Noise = noise, old: Noise = old) -> bool:
            return any(not np.array_equal(getattr(noise, name), getattr(old, name)) for name in names)

        if changed("random_walk"):
            entries[f"imu.{instrument}.{WALKS[instrument]}_random_walk"] = written(
                noise.random_walk, f"{counted}/sqrt(s)"
            )
        if changed("rate_random_walk"):
            entries[f"imu.{instrument}.rate_random_walk"] = written(noise.rate_random_walk, f"{unit}/sqrt(s)")
        if changed("instability", "correlation_time"):
            entries[f"imu.{instrument}.bias_instability"] = {
                "sigma": written(noise.instability, unit), "correlation_time": written(noise.correlation_time, "s"),
            }  # fmt: skip
        if changed("quantization", "quantization_interval"):
            entries[f"imu.{instrument}.quantization"] = {
                "sigma": written(noise.quantization, counted), "interval": written(noise.quantization_interval, "s"),
            }  # fmt: skip
    return entries


def _departures(scenario: Ins, processes: Mapping[str, Array], changes: Sequence[_Change]) -> Array:
    """Draw departures of the variances of the final errors from those at the estimates, shape (draws, outputs)."""
    generator = np.random.default_rng(0)
    slopes = _time_slopes(scenario, changes)
    total = np.zeros((DRAWS, len(scenario.outputs)))
    for change in changes:
        drawn = _draw(change, generator)
        for name in change.replaced:
            parameter = next(place for place in change.places if place in PROCESSES and change.process(place) == name)
            exponent = 2.0 * drawn[parameter][:, None]
            if parameter == "instability" and "correlation_time" in drawn:
                exponent = exponent + slopes[name] * drawn["correlation_time"][:, None]
            total += np.diag(processes[name]) * np.expm1(exponent)
    return total


def _draw(change: _Change, generator: np.random.Generator) -> dict[str, Array]:
    """Draw departures of the logarithms of an axis's parameters from their estimates."""
    fitted = change.axis.fitted
    covariance = relative_covariance(fitted.chosen)
    normals = generator.multivariate_normal(np.zeros(len(covariance)), covariance, DRAWS, method="eigh")
    reach, drawn = float(norm.ppf(0.975)), dict[str, Array]()
    for name, place in change.places.items():
        estimate = fitted.estimates[place]
        standard = normals[:, place] / np.sqrt(covariance[place, place])
        up, down = np.log(estimate.high / estimate.value) / reach, np.log(estimate.value / estimate.low) / reach
        drawn[name] = standard * np.where(standard > 0.0, up, down)
    return drawn


def _time_slopes(scenario: Ins, changes: Sequence[_Change]) -> dict[str, Array]:
    """Difference the logarithms of variances by those of correlation times, by process; each of shape (outputs,)."""
    timed = [change.process("instability") for change in changes if "correlation_time" in change.places]
    if not timed:
        return {}
    ahead, behind = (
        _processes(scenario, _with_times(scenario.navigation.imu, changes, np.exp(sign * STEP))) for sign in (1.0, -1.0)
    )
    slopes = {}
    for name in timed:
        up, down = np.diag(ahead[name]), np.diag(behind[name])
        known = (up > 0.0) & (down > 0.0)
        slopes[name] = np.where(known, np.log(np.where(known, up, 1.0) / np.where(known, down, 1.0)), 0.0) / (
            2.0 * STEP
        )
    return slopes


def _with_times(imu: Imu, changes: Sequence[_Change], factor: float) -> Imu:
    """Multiply the correlation times of the axes that have one from the logs."""
    moved = [
        replace(change, sizes={"correlation_time": change.sizes["correlation_time"] * factor})
        for change in changes if "correlation_time" in change.places
    ]  # fmt: skip
    return _merged(imu, moved)


def _processes(scenario: Ins, imu: Imu) -> Mapping[str, Array]:
    """Return what each process adds to the final covariance with other instruments and the same filter."""
    moved = Ins(replace(scenario.navigation, imu=imu))
    return moved.linear(moved.reading_times).end.processes


def _bounded(
    scenario: Ins, changes: Sequence[_Change], variances: Array, processes: Mapping[str, Array]
) -> tuple[Array, tuple[str, ...]]:
    """Return the sigmas with what is not identified at its upper bound, and the names of these processes."""
    names = tuple(change.process(name) for change in changes for name in change.bounds if name in PROCESSES)
    if not names:
        return np.sqrt(variances), ()
    at_bounds = _processes(scenario, _merged(scenario.navigation.imu, changes, bounded=True))
    added = [np.diag(at_bounds[name]) - (np.diag(processes[name]) if name in processes else 0.0) for name in names]
    return np.sqrt(variances + np.sum(added, axis=0)), names
