"""Rates of a guided reentry in polar coordinates: NASA TN D-1772, eqs. (1)-(9), with a lift law that is fed.

The equations of the reference path, `mcnav.systems.reentry.guided.reference`.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import compiled, uncontracted
from mcnav.numerics.dop853 import advance
from mcnav.physics.constants import EARTH_RADIUS
from mcnav.systems.reentry.atmosphere import layer_density
from mcnav.systems.reentry.guided.description import GuidedNavigation
from mcnav.systems.reentry.instruments import indicated_force, measured_force
from mcnav.systems.reentry.truth import motion
from mcnav.systems.reentry.vehicle import ConstantLift, aerodynamic_force


@compiled
def lift_command(state: Array, lift: Array, knot: float) -> float:
    """Compute L/D before its limit at a polar state: ``p_0(s) + p_1(s) r + p_2(s) r' + p_3(s) r_E theta'``.

    Parameters
    ----------
    state : ndarray, shape (4,)
        True or indicated, whichever the law is fed with.
    lift : ndarray, shape (4, m)
        Of each polynomial, by rising powers of ``s = theta - knot``.
    """
    along = state[1] - knot
    total = 0.0
    for i in range(4):
        value = 0.0
        for k in range(lift.shape[1] - 1, -1, -1):
            value = value * along + lift[i, k]
        if i == 0:
            total += value
        elif i == 1:
            total += value * state[0]
        elif i == 2:
            total += value * state[2]
        else:
            total += value * EARTH_RADIUS * state[3]
    return total


@compiled
def guided_force(state: Array, air: Array, lift: Array, knot: float, fed: int) -> tuple[float, float]:
    """Compute the horizontal and vertical (down) specific force on the vehicle in one phase, m/s^2 (eqs. 2-4).

    Parameters
    ----------
    state : ndarray, shape (8,)
        Actual, then indicated.
    air : ndarray, shape (6,)
        Layer base (m), temperature (K), lapse (K/m), density (kg/m^3) times one and its error; C_D A / m (m^2/kg) times
        one and its error; one and the error of L/D.
    fed : int
        Place of the first component of the state that the law is fed with: 0 or 4.
    """
    base, temperature, lapse, base_density, ballistic, lift_factor = air
    density = layer_density(state[0] - EARTH_RADIUS, base, temperature, lapse, base_density)
    lift_to_drag = lift_factor * lift_command(state[fed : fed + 4], lift, knot)
    return aerodynamic_force(state[0], state[2], state[3], density, ballistic, lift_to_drag)


@compiled
def guided_rates(
    time: float, state: Array, air: Array, lift: Array, knot: float, fed: int, on: float, errors: Array, start: float,
    theta_axes: float,
) -> Array:  # fmt: skip
    """Compute rates of the actual (first four) and the indicated state in one phase (NASA TN D-1772, eqs. 1-9)."""
    rates = np.empty(8)
    force_x, force_z = guided_force(state, air, lift, knot, fed)
    motion(state[:4], force_x, force_z, rates[:4])
    # eqs. (6)-(8), (9) and (5)
    measured_x, measured_z = measured_force(force_x, force_z, state[1] - theta_axes, time - start, errors)
    indicated_x, indicated_z = indicated_force(on * measured_x, on * measured_z, state[5] - theta_axes)
    motion(state[4:], indicated_x, indicated_z, rates[4:])
    return rates


@uncontracted
def advance_guided(
    args: Any, bound: float, relative: float, absolute: Array, limits: Array, step: float, times: Array, states: Array
) -> tuple[int, int, float]:
    """Take steps of `guided_rates`; see `mcnav.numerics.dop853.advance`."""
    return advance(guided_rates, args, bound, relative, absolute, limits, step, times, states)


@dataclass(frozen=True)
class LiftStretch:
    """Stretch where the lift law has one set of polynomials, ``lift`` of `lift_command`, up to a range angle, rad."""

    lift: Array
    knot: float = 0.0
    end: float = np.inf


def _alone(p_0: float = 0.0, p_2: float = 0.0, end: float = np.inf) -> LiftStretch:
    """Return a stretch of a law ``L/D = p_0 + p_2 r'``, which are constant."""
    return LiftStretch(np.array([[p_0], [0.0], [p_2], [0.0]]), 0.0, end)


def lift_stretches(navigation: GuidedNavigation) -> tuple[tuple[LiftStretch, ...], float]:
    """List the stretches of a lift law by rising range angle, and state its limit.

    The vehicle's own law, L/D = -k r', has one. A law that follows the nominal flight has those between its knots, one
    before and one after them.
    """
    law, own = navigation.guidance.law, navigation.vehicle.lift_law
    if law is not None:
        stretches = [_alone(p_0=law.lift_before, end=float(law.knots[0]))]
        for lift, (begin, end) in zip(law.polynomials, pairwise(law.knots), strict=True):
            stretches.append(LiftStretch(np.ascontiguousarray(lift), float(begin), float(end)))
        last = stretches[-1]
        held = (last.lift @ (last.end - last.knot) ** np.arange(last.lift.shape[1]))[:, None]
        return (*stretches, LiftStretch(held)), law.limit
    if isinstance(own, ConstantLift):
        return (_alone(p_0=own.lift_to_drag),), np.inf
    return (_alone(p_2=-own.gain),), own.limit
