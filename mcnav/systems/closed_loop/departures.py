"""Remarks on a loop by its linear analysis: growth, singular targets, and a few samples beside it."""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.products import transformed_variances
from mcnav.arrays.types import Array
from mcnav.contract.linear import LinearSystem
from mcnav.contract.scenario import ScenarioError
from mcnav.systems.closed_loop.setup import Setup
from mcnav.systems.closed_loop.soundness import SAMPLES, SMALL_SHARE, Tried

SMALL_DEPARTURE: Final = 0.05
"""Departure of a sample with small errors from its twin, in its sigma: a term of second order leaves a hundredth."""

DEPARTURE: Final = 0.5
"""Departure of a sample from its twin, in sigma, from which on something bends within one sigma."""

LARGEST: Final = 1e150
"""Numbers whose squares are still known."""

GROWTH: Final = 50.0
"""Growth of a sigma within the second half of a flight: one that grows with the cube of time grows eightfold."""

MAGNIFIED: Final = 10.0
"""Sigma of a correction over what the dispersions call for, from which on its target is nearly singular."""


def departures_from_twins(setup: Setup, tried: Tried, sigma: Array) -> list[str]:
    """Say where samples depart from their twins, with all errors and with a hundredth of them.

    Parameters
    ----------
    sigma : ndarray, shape (outputs,)
        Linear, at the end.
    """
    name, most = _largest(setup, tried, slice(SAMPLES, None), SMALL_SHARE * sigma)
    if most > SMALL_DEPARTURE:
        return [
            f"something bends, jumps or rounds at the nominal. With a hundredth of all errors a sample is still "
            f"{most:.2g} sigma off linear analysis in {name}"
        ]
    name, most = _largest(setup, tried, slice(SAMPLES), sigma)
    if most > DEPARTURE:
        return [
            f"a sample departs from linear analysis by {most:.2g} sigma in {name}. With a hundredth of all errors and "
            "noise it does not: something bends within the spread, such as a limit, a dead band or an event"
        ]
    return []


def _largest(setup: Setup, tried: Tried, rows: slice, sigma: Array) -> tuple[str, float]:
    """Name the output with the largest departure, and return that in sigma; corrections have a law of their own."""
    outputs = setup.readout.outputs
    usual = (sigma > setup.floor) & np.array([not output.size_of for output in outputs])
    shares = np.abs(tried.values - tried.linear)[rows] / np.where(usual, sigma, np.inf)
    most = np.nan_to_num(shares).max(axis=0)
    worst = int(np.argmax(most))
    return outputs[worst].name.replace("_", " "), float(most[worst])


def check_finite(readings: LinearSystem, names: tuple[str, ...]) -> None:
    """Raise `ScenarioError` when a loop's linear system grows beyond all numbers."""
    assert readings.nominal is not None
    known = (np.abs(readings.partials) < LARGEST).all(axis=2) & (np.abs(readings.nominal) < LARGEST)
    for covariance in readings.processes.values():
        known &= np.diagonal(covariance, axis1=1, axis2=2) < LARGEST**2
    if known.all():
        return
    epoch = int(np.argmin(known.all(axis=1)))
    output = names[int(np.argmin(known[epoch]))]
    raise ScenarioError(
        "type",
        f"the loop diverges: the linear sigma of {output} is beyond all numbers at {readings.times[epoch]:.4g} s. Is "
        "the sign of a gain wrong, or the flight too long?",
    )


def growth_of(readings: LinearSystem, names: tuple[str, ...], start: Array) -> list[str]:
    """Say when a sigma grows as those of a loop that diverges do.

    Parameters
    ----------
    start : ndarray, shape (sources, sources)
        Covariance of the sources.
    """
    sigmas = sigmas_of(readings, start)
    middle = int(np.searchsorted(readings.times, 0.5 * readings.times[-1]))
    if middle >= len(sigmas) - 1:
        return []
    before, after = sigmas[middle], sigmas[-1]
    growth = np.where(before > 0.0, after / np.where(before > 0.0, before, 1.0), 0.0)
    growth = np.where([name.startswith("true_") for name in names], growth, 0.0)
    worst = int(np.argmax(growth))
    if not growth[worst] > GROWTH:
        return []
    return [
        f"the loop diverges: the linear sigma of {names[worst]} grows {growth[worst]:.3g} times from "
        f"{readings.times[middle]:.4g} s to {readings.times[-1]:.4g} s"
    ]


def sigmas_of(readings: LinearSystem, start: Array) -> Array:
    """Compute the linear sigmas of the outputs at the epochs, shape (m, outputs)."""
    variances = transformed_variances(readings.partials, start)
    variances = variances + sum(np.diagonal(process, axis1=1, axis2=2) for process in readings.processes.values())
    return np.asarray(np.sqrt(np.maximum(variances, 0.0)))


def singular_corrections(setup: Setup, readings: LinearSystem, names: tuple[str, ...]) -> list[str]:
    """Say which corrections are many times what the dispersions before them call for.

    These are that of the state which the impulse is added to, and of states whose rate it is over the rest of the
    flight.
    """
    maps, told = setup.maps, []
    sigmas = sigmas_of(readings, setup.true.start)
    for number, impulse in enumerate(maps.impulses):
        planned = [moment.time for moment in setup.schedule if number in moment.corrections]
        state = impulse.declared.apply
        if not planned or not isinstance(state, str) or planned[0] >= readings.times[-1]:
            continue
        before = max(int(np.searchsorted(readings.times, planned[0])) - 1, 0)
        usual = 0.0
        for quantity in maps.structure.truth.quantities:
            places = [names.index(f"true_{name}") for name in quantity.names]
            size = float(sigmas[before, places].max())
            if quantity.name == state:
                usual = max(usual, size)
            elif f"{quantity.unit}/s" == impulse.declared.noise:
                usual = max(usual, size / (readings.times[-1] - planned[0]))
        places = [names.index(name) for name in maps.structure.corrections.quantities[number].names]
        worst = max(places, key=lambda place: sigmas[-1, place])
        if usual > 0.0 and sigmas[-1, worst] > MAGNIFIED * usual:
            told.append(
                f"one sigma of {names[worst]} is {sigmas[-1, worst]:.3g} {impulse.declared.noise}, "
                f"{sigmas[-1, worst] / usual:.2g} times what the dispersions call for: its target is nearly singular, "
                "as that of a transfer near 180 degrees"
            )
    return told
