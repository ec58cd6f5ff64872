"""Period of a slaved navigator during a vertical climb under constant thrust: footnote (a) of the document.

The vehicle rises along one vertical with a constant specific force f, so that its radius obeys r'' = f - mu / r^2. Its
navigator is given the radius and indicates the angle e, with a start error (NASA TN D-1772, eqs. 5 and 9):
``r e'' = f_xi - 2 r' e'`` with the specific force f_xi along the indicated horizontal.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.integrate import DOP853, solve_ivp

from mcnav.arrays.types import Array
from mcnav.systems.reentry.instruments import indicated_force
from mcnav.systems.steady.truth import Earth

SMALL: Final = 1e-6
"""Start error of the indicated angle, rad."""

HALF: Final = 0.25
"""Half of the time over which an acceleration is measured, s."""


def climb_periods(earth: Earth, force: float, times: Array) -> Array:
    """Compute the momentary period of the navigator's error during a climb, s, shape (n,).

    Two solutions with different start errors determine both coefficients of the linear equation
    ``e'' + p e' + q e = 0`` at each time; the period is 2 pi / sqrt(q). The force is the upward specific force, m/s^2;
    times, shape (n,), are from the start at rest on the surface, s, and at least `HALF`.
    """

    def rates(time: float, state: Array) -> list[float]:
        radius, climb, first, first_rate, second, second_rate = state
        along = [indicated_force(0.0, -force, angle)[0] for angle in (first, second)]
        swung = [
            (push - 2.0 * climb * rate) / radius for push, rate in zip(along, (first_rate, second_rate), strict=True)
        ]
        up = force - earth.gravitational_parameter / radius**2
        return [climb, up, first_rate, swung[0], second_rate, swung[1]]

    solution = solve_ivp(
        rates,
        (0.0, float(times[-1]) + HALF),
        [earth.radius, 0.0, SMALL, 0.0, 0.0, SMALL * np.sqrt(force / earth.radius)],
        method=DOP853,
        rtol=1e-12,
        atol=[1e-6, 1e-9, 1e-20, 1e-23, 1e-20, 1e-23],
        t_eval=np.unique(np.concatenate([times - HALF, times, times + HALF])),
    )
    periods = []
    for time in times:
        before, now, after = (solution.y[2:, np.argmin(np.abs(solution.t - time - at))] for at in (-HALF, 0.0, HALF))
        turned = (after - before)[[1, 3]] / (2.0 * HALF)
        _, stiffness = np.linalg.solve(np.column_stack([now[[1, 3]], now[[0, 2]]]), -turned)
        periods.append(2.0 * np.pi / np.sqrt(stiffness))
    return np.array(periods)
