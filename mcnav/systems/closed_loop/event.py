"""Triggers: where a function of X changes its sign within a step, and what its time does to the linear system."""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.contract.scenario import ScenarioError
from mcnav.systems.closed_loop.differences import differentiate_map
from mcnav.systems.closed_loop.maps import Maps

MOST_ITERATIONS: Final = 60
"""Of the search for a zero; each that fails to halve the interval is followed by one that does."""


def find_crossings(maps: Maps, x: Array, time: Array, length: float, white: Array, value: Array, after: Array) -> Array:
    """Find the fraction of a step at which the trigger's function is zero, shape (n,), by Illinois' method.

    Parameters
    ----------
    x, time : ndarray, shapes (size, n) and (n,)
        At the begin of the step.
    white : ndarray, shape (2, inputs, n)
        Noise of the whole step: the event lies on each sample's own path.
    value, after : ndarray, shape (n,)
        The function at begin and end, of different signs.
    """
    assert maps.end is not None
    low, high, at_low, at_high = np.zeros_like(value), np.ones_like(value), value.copy(), after.copy()
    best, least = high, np.abs(after)
    for number in range(MOST_ITERATIONS):
        secant = (low * at_high - high * at_low) / np.where(at_high != at_low, at_high - at_low, 1.0)
        fraction = np.where((secant > low) & (secant < high) & (number % 8 < 6), secant, 0.5 * (low + high))
        there = maps.triggered(maps.end, maps.step(x, time, length, white, fraction), time + fraction * length)
        nearer = np.abs(there) < least
        best, least = np.where(nearer, fraction, best), np.where(nearer, np.abs(there), least)
        left = np.sign(there) == np.sign(value)
        at_high = np.where(left, 0.5 * at_high, there)
        at_low = np.where(left, there, 0.5 * at_low)
        low, high = np.where(left, fraction, low), np.where(left, high, fraction)
        if np.all((least == 0.0) | (high - low < 1e-15)):
            break
    return np.asarray(best)


def crossing_within(maps: Maps, x: Array, time: float, length: float, sign: float) -> float | None:
    """Return the fraction of a step of the nominal at which the trigger happens; none when it does not."""
    assert maps.end is not None
    inputs = maps.structure.white.size + maps.structure.markov.size
    white, begin = np.zeros((2, inputs, 1)), np.array([time])
    after = maps.step(x[:, None], begin, length, white)
    there = maps.triggered(maps.end, after, begin + length)
    if np.sign(there[0]) == sign or not np.isfinite(there[0]):
        return None
    value = maps.triggered(maps.end, x[:, None], begin)
    if np.sign(value[0]) != sign:
        raise ScenarioError("type", f"end: an update at {time:g} s jumps over the trigger in the flight without errors")
    return float(find_crossings(maps, x[:, None], begin, length, white, value, there)[0])


def event_map(maps: Maps, x: Array, time: float, steps: Array) -> Array:
    """Linearize the event: ``dt = -psi_X / psi_dot dX``, ``S = 1 + X_dot dt``, shape (size, size); the clock has dt."""
    end = maps.end
    assert end is not None

    def function(states: Array, entering: Array) -> Array:
        return maps.triggered(end, states, time + entering[0])[None]

    space = maps.structure.space
    result = differentiate_map(function, x, steps, np.array([1e-2]), space)
    inputs = maps.structure.white.size + maps.structure.markov.size
    rates = maps.derivative(x[:, None], np.array([time]), np.zeros((inputs, 1)))
    rate = space.deviation_rates(x[:, None], rates)[:, 0]
    speed = float(result.state[0] @ rate + result.inputs[0, 0])
    if not abs(speed) > 0.0 or not np.isfinite(speed):
        raise ScenarioError("type", "end: the trigger's function is at rest where it is zero; there is no linear model")
    of_time = -result.state[0] / speed
    saltation = np.eye(len(x)) + np.outer(rate, of_time)
    saltation[maps.structure.clock.whole] = of_time
    return saltation
