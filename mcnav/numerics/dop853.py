"""DOP853 for compiled equations of motion: scipy's scheme and control of steps, without Python between the stages.

For equations of a few states scipy's own integrator takes some twenty times as long as the equations, when these are
compiled. `advance` takes the same steps within compiled code. Each motion has an entry that calls it with its own
equations: numba cannot store a function that is given others.

Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I (1993), section II.5.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

from mcnav.arrays.types import Array
from mcnav.compiled.jit import compiled_with_caller, uncontracted
from mcnav.numerics.integration import Tolerances

STAGES: Final = DOP853.n_stages
WEIGHTS: Final = np.vstack([DOP853.A, DOP853.B])
"""Weights of the stages before each stage; those of the last, at the end of the step, are those of the step itself."""
TIMES: Final = np.append(DOP853.C, 1.0)
FIFTH: Final = DOP853.E5.copy()
THIRD: Final = DOP853.E3.copy()
"""Weights of the stages in the two estimates of the error."""
ORDER: Final = DOP853.error_estimator_order

SAFETY: Final = 0.9
LEAST_FACTOR: Final = 0.2
LARGEST_FACTOR: Final = 10.0
"""A step is this share of the one that would meet the tolerance, and changes by factors between these."""

ROOM: Final = 256
"""Steps that compiled code takes before it returns, so that signals are answered."""

UNDERWAY: Final = 0
REACHED: Final = 1
LEFT: Final = 2
TOO_SMALL: Final = 3
"""Reasons for which `advance` returns: no room for more steps, the end, limits of the state, a step below rounding."""


@compiled_with_caller
def advance(
    rates: Any, args: Any, bound: float, relative: float, absolute: Array, limits: Array, step: float, times: Array,
    states: Array,
) -> tuple[int, int, float]:  # fmt: skip
    """Take steps of `rates` from the first of ``times`` and ``states`` to a later time, as far as there is room.

    Parameters
    ----------
    rates : compiled function
        ``rates(time, state, *args)``, shape (n,).
    limits : ndarray, shape (2, n)
        Lower and upper ones; the step that leaves them is the last.
    step : float
        s; zero for the first one, which is chosen.
    times : ndarray, shape (m + 1,)
    states : ndarray, shape (m + 1, n)

    Returns
    -------
    status, count : int
        Number of steps taken.
    step : float
        That would be tried next, s.
    """
    n = states.shape[1]
    slopes, trial, scale = np.empty((STAGES + 1, n)), np.empty(n), np.empty(n)
    slope = rates(times[0], states[0], *args)
    for i in range(n):
        slopes[0, i] = slope[i]
    if step == 0.0:
        step = _first_step(rates, args, bound, relative, absolute, times[0], states[0], slopes[0], trial)
    for taken in range(len(times) - 1):
        time, state, reached = times[taken], states[taken], states[taken + 1]
        least = 10.0 * (np.nextafter(time, np.inf) - time)
        step = max(step, least)
        largest = LARGEST_FACTOR
        while True:
            if not step >= least:
                return TOO_SMALL, taken, step
            end = min(time + step, bound)
            step = end - time
            # stages k_s = f(t + c_s h, x + h sum of a_sj k_j); the last is at the end, with the step's own weights
            for stage in range(1, STAGES + 1):
                for i in range(n):
                    change = 0.0
                    for k in range(stage):
                        change += WEIGHTS[stage, k] * slopes[k, i]
                    trial[i] = state[i] + step * change
                slope = rates(time + TIMES[stage] * step, trial, *args)
                for i in range(n):
                    slopes[stage, i] = slope[i]
            for i in range(n):
                scale[i] = absolute[i] + relative * max(abs(state[i]), abs(trial[i]))
            # accepted below 1; otherwise the step shrinks as error^(-1/8)
            error = _error_of(slopes, scale, step)
            if error < 1.0:
                break
            shrunk = SAFETY * error ** (-1.0 / (ORDER + 1))
            step *= shrunk if shrunk > LEAST_FACTOR else LEAST_FACTOR  # also where the error is not a number
            largest = 1.0
        if error > 0.0:
            largest = min(largest, SAFETY * error ** (-1.0 / (ORDER + 1)))
        step *= largest
        # the last stage's slope is the next step's first
        times[taken + 1] = end
        for i in range(n):
            reached[i], slopes[0, i] = trial[i], slope[i]
        for i in range(n):
            if not limits[0, i] <= trial[i] <= limits[1, i]:
                return LEFT, taken + 1, step
        if end == bound:
            return REACHED, taken + 1, step
    return UNDERWAY, len(times) - 1, step


@uncontracted
def _error_of(slopes: Array, scale: Array, step: float) -> float:
    """Combine the two estimates of a step's error, in units of the tolerance."""
    fifth = third = 0.0
    for i in range(len(scale)):
        of_fifth = of_third = 0.0
        for k in range(STAGES + 1):
            # components of both estimates, in units of the tolerance
            of_fifth += FIFTH[k] * slopes[k, i]
            of_third += THIRD[k] * slopes[k, i]
        fifth += (of_fifth / scale[i]) ** 2
        third += (of_third / scale[i]) ** 2
    if fifth == 0.0 and third == 0.0:
        return 0.0
    return float(step * fifth / np.sqrt((fifth + 0.01 * third) * len(scale)))


@compiled_with_caller
def _first_step(
    rates: Any, args: Any, bound: float, relative: float, absolute: Array, time: float, state: Array, slope: Array,
    trial: Array,
) -> float:  # fmt: skip
    """Choose the first step, s, by the size of the state, its rate and the change of the rate; overwrites ``trial``."""
    size = rate = change = 0.0
    for i in range(len(state)):
        scale = absolute[i] + relative * abs(state[i])
        size += (state[i] / scale) ** 2
        rate += (slope[i] / scale) ** 2
    size, rate = np.sqrt(size / len(state)), np.sqrt(rate / len(state))
    # a step in which the state changes by a hundredth of its size
    small = min(1e-6 if size < 1e-5 or rate < 1e-5 else 0.01 * size / rate, bound - time)
    for i in range(len(state)):
        trial[i] = state[i] + small * slope[i]
    later = rates(time + small, trial, *args)
    for i in range(len(state)):
        change += ((later[i] - slope[i]) / (absolute[i] + relative * abs(state[i]))) ** 2
    change = np.sqrt(change / len(state)) / small
    # one in which a term of eighth order, by the second derivative, stays at a hundredth
    larger = max(1e-6, 1e-3 * small)
    if max(rate, change) > 1e-15:
        larger = (0.01 / max(rate, change)) ** (1.0 / (ORDER + 1))
    return min(100.0 * small, larger, bound - time)


@dataclass(frozen=True)
class Steps:
    """Steps of an integration.

    Attributes
    ----------
    status : int
        `REACHED`, `LEFT` or `TOO_SMALL`.
    times : ndarray, shape (m,)
        s; the last is the end, the time at which the state meets its limits, or where the steps became too small.
    states : ndarray, shape (m, n)
    """

    status: int
    times: Array
    states: Array


def integrate_compiled(
    entry: Callable[..., tuple[int, int, float]],
    span: tuple[float, float],
    state: Array,
    tolerances: Tolerances,
    limits: Array,
    args: tuple[object, ...],
) -> Steps:
    """Integrate a state over a span of time (s) until it leaves its limits.

    Parameters
    ----------
    entry : compiled function
        Calls `advance` with the rates.
    limits : ndarray, shape (2, n)
    """
    begin, end = span
    relative, absolute = tolerances
    allowed = np.broadcast_to(absolute, np.shape(state)).astype(float)
    status, step = UNDERWAY, 0.0
    blocks: list[tuple[Array, Array]] = [(np.array([begin]), np.array(state, dtype=float)[None])]
    while status == UNDERWAY:
        times, states = np.empty(ROOM + 1), np.empty((ROOM + 1, len(state)))
        times[0], states[0] = blocks[-1][0][-1], blocks[-1][1][-1]
        status, count, step = entry(args, end, relative, allowed, limits, step, times, states)
        blocks.append((times[1 : count + 1], states[1 : count + 1]))
    times, states = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
    if status == LEFT:
        times[-1], states[-1] = _meet_limits(entry, times[-2:], states[-2], tolerances, limits, args)
    return Steps(status, times, states)


def _meet_limits(
    entry: Callable[..., tuple[int, int, float]],
    times: Array,
    state: Array,
    tolerances: Tolerances,
    limits: Array,
    args: tuple[object, ...],
) -> tuple[float, Array]:
    """Find when a state that leaves its limits between two times meets them, s, and the state then."""
    begin, unlimited = float(times[0]), np.outer([-np.inf, np.inf], np.ones(len(state)))

    def at(time: float) -> Array:
        if time == begin:
            return state
        steps = integrate_compiled(entry, (begin, time), state, tolerances, unlimited, args)
        return np.asarray(steps.states[-1])

    def margin(time: float) -> float:
        there = at(time)
        return float(min((there - limits[0]).min(), (limits[1] - there).min()))

    end = float(times[1])
    met = float(brentq(margin, begin, end)) if margin(begin) * margin(end) < 0.0 else end
    return met, at(met)
