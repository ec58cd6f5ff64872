"""Remarks on a guided reentry: flights that depart from linear analysis, and lift at its limit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from mcnav.arrays.products import transformed_variances
from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine
from mcnav.contract.linear import LinearModel
from mcnav.contract.quantities import Output
from mcnav.contract.samples import Batch
from mcnav.physics.units import conversion
from mcnav.systems.reentry.guided.linear import LinearFlight

FLIGHTS: Final = 128
SEED: Final = 1772

USUAL: Final = 1.0
USUAL_SHARE: Final = 0.5
"""Departure from linear analysis, in linear sigma, that is told where more than this share of the flights have it."""

LARGE: Final = 5.0
LARGE_SHARE: Final = 0.05
"""The same of a departure that a term of second order does not explain."""

ROUNDING: Final = 1e-6
"""Linear sigma of an output, SI, up to which its dispersion is rounding."""


def draw_flights(mean: Array, covariance: Array) -> Batch:
    """Draw errors of `FLIGHTS` samples from the normal distribution of this mean and covariance."""
    variances, axes = np.linalg.eigh(_scaled(covariance))
    drawn = np.random.default_rng(SEED).standard_normal((FLIGHTS, len(mean)))
    root = np.sqrt(np.diag(covariance))[:, None] * axes * np.sqrt(np.maximum(variances, 0.0))
    return Batch(np.arange(FLIGHTS), mean + drawn @ root.T, SEED)


def _scaled(covariance: Array) -> Array:
    """Return the correlation matrix; rows without variance are zero."""
    sigma = np.sqrt(np.diag(covariance))
    inverse = np.divide(1.0, sigma, out=np.zeros_like(sigma), where=sigma > 0.0)
    return np.asarray(covariance * np.outer(inverse, inverse))


def departures_of(
    batch: Batch, engine: Engine, model: LinearModel, covariance: Array, outputs: Sequence[Output]
) -> Iterator[str]:
    """Say in which outputs flights depart from their linear outcomes, the worst first, and how many fail."""
    result, count = engine.simulate(batch), len(batch.errors)
    reached = np.isfinite(result.values).all(axis=1)
    departures = np.abs(result.values - model.nominal - batch.errors @ model.partials.T)[reached]
    sigma = np.sqrt(transformed_variances(model.partials, covariance).clip(min=0.0))
    shares = departures / np.where(sigma > ROUNDING, sigma, np.inf)
    usual, large = (np.count_nonzero(shares > size, axis=0) for size in (USUAL, LARGE))
    wrong = np.flatnonzero((usual > USUAL_SHARE * count) | (large > LARGE_SHARE * count))
    ordered = sorted(wrong.tolist(), key=lambda output: (-large[output], -usual[output]))
    if ordered:
        worst = ordered[0]
        scale, unit = conversion(outputs[worst].unit, outputs[worst].shown_in), outputs[worst].shown_in
        others = [outputs[output].name for output in ordered[1:]]
        yield (
            f"of {count} flights with normal errors {usual[worst]} depart from linear analysis by more than its sigma "
            f"in {outputs[worst].name} ({sigma[worst] * scale:.3g} {unit}), {large[worst]} by more than {LARGE:g}; "
            f"the median departure is {np.median(departures[:, worst]) * scale:.3g} {unit}"
            f"{'; flights depart in ' + _listed(others) + ', too' if others else ''}"
        )
    if result.failures:
        reasons = [failure.message for failure in result.failures.values()]
        commonest = max(dict.fromkeys(reasons), key=reasons.count)
        yield f"{len(reasons)} of {count} flights with normal errors fail (most often: {commonest})"


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def limited_lift(flight: LinearFlight, covariance: Array) -> Iterator[str]:
    """Say when one sigma of the L/D that a law commands exceeds its margin to the limit; nothing of other laws."""
    guidance = flight.navigation.guidance
    if guidance.law is None:
        return
    begin, limit = 4 if guidance.input == "indicated" else 0, guidance.law.limit
    readings = []
    for phase in flight.phases:
        for time in phase.solution.ts if not phase.limited else ():
            joint = phase.solution(time)
            lift, gradient = phase.command(joint[begin : begin + 4])
            by_source = gradient @ joint[8:].reshape(8, -1)[begin : begin + 4]
            readings.append((float(time), float(np.sqrt(by_source @ covariance @ by_source)), limit - abs(lift)))
    if not readings:
        return
    time, sigma, margin = max(readings, key=lambda reading: reading[1] / max(reading[2], 1e-9))
    if sigma > margin:
        minutes = (time + flight.navigation.start - flight.navigation.trajectory.reentry_time) / 60.0
        yield (
            f"one sigma of the commanded L/D is {sigma:.2g} at {minutes:.1f} min from reentry, and its margin to the "
            f"limit of {limit:g} there {margin:.2g}: linear analysis assumes that the limit is never reached"
        )


def doubtful_end(flight: LinearFlight, covariance: Array) -> Iterator[str]:
    """Say when the flight without errors grazes the final altitude: one sigma of altitude is more than it would sink.

    With the altitude rate h' and its own rate h'' > 0 there, it would sink by ``h'^2 / (2 h'')`` more.
    """
    phase, place = flight.phases[-1], 4 if flight.navigation.guidance.final == "indicated" else 0
    joint = phase.solution(phase.end)
    rates, by_source = phase.rates(phase.end, joint), joint[8:].reshape(8, -1)[place]
    rate, turning = float(rates[place]), float(rates[place + 2])
    sigma = float(np.sqrt(by_source @ covariance @ by_source))
    if turning > 0.0 and sigma > rate**2 / (2.0 * turning):
        yield (
            f"the flight without errors grazes the final altitude: it falls through at {abs(rate):.3g} m/s, and would "
            f"sink by {rate**2 / (2.0 * turning):.3g} m more, with a sigma of {sigma:.3g} m; flights end there or much "
            "later"
        )


def rival_maxima(flight: LinearFlight, covariance: Array) -> Iterator[str]:
    """Say when another maximum of deceleration is less than one sigma of their difference below the largest."""
    largest, *others = sorted(flight.peaks, key=lambda peak: -peak.size)
    in_g = conversion("m/s^2", "g")
    for other in others:
        apart, by_source = largest.size - other.size, largest.partials - other.partials
        sigma = float(np.sqrt(by_source @ covariance @ by_source))
        if sigma > apart:
            since = flight.navigation.start - flight.navigation.trajectory.reentry_time
            first, second = sorted((peak.time + since) / 60.0 for peak in (largest, other))
            yield (
                f"the deceleration has two maxima, at {first:.1f} and {second:.1f} min from reentry, that differ by "
                f"{apart * in_g:.2g} g with a sigma of {sigma * in_g:.2g} g: linear analysis follows the larger alone"
            )
            return
