"""Triggers: where a function of X changes its sign within a step, and what its time does to the linear system."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.scenario import ScenarioError
from mcnav.systems.closed_loop.differences import Derivatives, differentiate_map
from mcnav.systems.closed_loop.maps import Maps
from mcnav.systems.closed_loop.methods import Method
from mcnav.systems.closed_loop.structure import Part

MOST_ITERATIONS: Final = 60
"""Steps of the search for a zero; each that fails to halve the interval is followed by one that does."""

NO_KINK: Final = np.zeros((0, 0), dtype=bool)

TIME_STEP: Final = 1e-2
"""Size of the step of differences by time, s."""


def find_crossings(
    maps: Maps, trigger: Method, at_begin: tuple[Array, Array], length: float, white: Array,
    bracket: tuple[Array, Array, Array],
) -> Array:  # fmt: skip
    """Find the fraction of a step at which a trigger's function is zero, shape (n,), by Illinois' method.

    Parameters
    ----------
    at_begin : tuple of ndarray
        X where the search begins, shape (size, n), and the begin of the whole step, s, shape (n,).
    white : ndarray, shape (2, inputs, n)
        Noise of the whole step: the event lies on each sample's own path.
    bracket : tuple of ndarray
        Fraction where the search begins, shape (n,); the function there and at the end of the step, of different signs.
    """
    (x, time), (since, value, after) = at_begin, bracket
    low, high, at_low, at_high = since.copy(), np.ones_like(value), value.copy(), after.copy()
    best, least, done = high, np.abs(after), np.zeros(len(value), dtype=bool)  # others' searches change nothing
    part: Part = "truth" if maps.triggers_by_truth(trigger) else "both"
    reached, moving = x.copy(), maps.structure.rows(part)
    for number in range(MOST_ITERATIONS):
        secant = (low * at_high - high * at_low) / np.where(at_high != at_low, at_high - at_low, 1.0)
        fraction = np.where((secant > low) & (secant < high) & (number % 8 < 6), secant, 0.5 * (low + high))
        reached[moving] = maps.step(x, time, length, white, fraction, since, part)
        there = maps.triggered(trigger, reached, time + fraction * length)
        nearer = (np.abs(there) < least) & ~done
        best, least = np.where(nearer, fraction, best), np.where(nearer, np.abs(there), least)
        left = np.sign(there) == np.sign(value)
        at_high = np.where(left, 0.5 * at_high, there)
        at_low = np.where(left, there, 0.5 * at_low)
        low, high = np.where(left, fraction, low), np.where(left, high, fraction)
        done |= (least == 0.0) | (high - low < 1e-15)
        if done.all():
            break
    return np.asarray(best)


@dataclass(frozen=True)
class Saltation:
    """Effect of an event about the nominal: ``X+ = value + S dX + M noise``.

    Attributes
    ----------
    value : ndarray, shape (size,)
    state : ndarray, shape (size, size)
        S = J + (J f- + g_t - f+) dt, with the jump ``X+ = g(X, t)``, J its derivative by X, the rates f- and f+ before
        and after it, and ``dt = -psi_X / psi_dot dX``; after an end f+ is zero, and the clock has dt.
    fixed : ndarray, shape (size, size)
        J alone.
    inputs : ndarray, shape (size, k)
        M: derivative by the execution error of a correction.
    """

    value: Array
    state: Array
    fixed: Array
    inputs: Array


def event_map(maps: Maps, number: int, x: Array, time: float, steps: Array, noise: Array) -> Saltation:
    """Linearize an event about the nominal.

    Parameters
    ----------
    noise : ndarray, shape (k,)
        Sizes of the execution errors of a correction.
    """
    event, space = maps.events[number], maps.structure.space
    second = np.array([TIME_STEP])

    def function(states: Array, entering: Array) -> Array:
        return maps.triggered(event.trigger, states, time + entering[0])[None]

    def jump(states: Array, entering: Array) -> Array:
        return maps.happen(number, states, time + entering[-1], entering[:-1])

    def rates(states: Array) -> Array:
        inputs = maps.structure.white.size + maps.structure.markov.size
        rate = maps.derivative(states[:, None], np.array([time]), np.zeros((inputs, 1)))
        return space.deviation_rates(states[:, None], rate)[:, 0]

    psi = differentiate_map(function, x, steps, second, space)
    before = rates(x)
    speed = float(psi.state[0] @ before + psi.inputs[0, 0])
    if not abs(speed) > 0.0 or not np.isfinite(speed):
        told = "the trigger's function is at rest where it is zero; there is no linear model"
        raise ScenarioError("type", f"{event.name}: {told}")
    of_time = -psi.state[0] / speed
    if event.kind == "end" and not maps.continuous:
        after = Derivatives(jump(x[:, None], np.zeros((1, 1)))[:, 0], np.eye(len(x)), np.zeros((len(x), 1)), NO_KINK)
    else:
        after = differentiate_map(jump, x, steps, np.concatenate([noise, second]), space, space)
    rest = 0.0 if event.kind == "end" else rates(after.value)
    saltation = after.state + np.outer(after.state @ before + after.inputs[:, -1] - rest, of_time)
    saltation[maps.structure.clock.begin + number] = of_time
    return Saltation(after.value, saltation, after.state, after.inputs[:, :-1])
