"""Claims of NASA TN D-1772 tested with the lift law fed by the navigator; every number is computed when written."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from mcnav.validation.reproduce.findings import Finding
from mcnav.validation.reproduce.tn_d1772.in_the_closed_loop import (
    GUIDED,
    SHARES,
    SITE,
    SITE_LIMIT,
    SITE_START,
    SKIPPING,
    LoopComparison,
    causes,
    linear_sigma,
    misses,
)
from mcnav.validation.reproduce.tn_d1772.in_three_dimensions import CONFIDENCE, SAMPLES, TIME

LANDING = "landing point [km]"


def loop_claims(compared: Sequence[LoopComparison], curves: pd.DataFrame) -> list[Finding]:
    """Examine what navigation errors do to the landing point, and which advice survives."""
    return [
        landing_point(compared),
        start_in_the_loop(compared, curves),
        accelerometers_off_in_the_loop(compared),
        linear_in_the_loop(compared),
        landing_site(compared),
    ]


def _find(compared: Sequence[LoopComparison], case: str, result: str, fed: str = "indicated") -> LoopComparison:
    """Return the comparison of a result whose case is or begins with given words."""
    return next(
        comparison
        for comparison in compared
        if comparison.case.startswith(case) and (comparison.result, comparison.fed) == (result, fed)
    )


def _both(each: LoopComparison) -> str:
    """Write the linear number of a comparison, and that of samples with its interval, km."""
    return f"{each.linear:.1f} km (samples {each.simulated:.1f}, {each.low:.1f}–{each.high:.1f})"


def landing_point(compared: Sequence[LoopComparison]) -> Finding:
    """Say how far the landing point moves, and by what."""
    landing, position = (_find(compared, "start at -63.3", name) for name in ("landing point", "range error"))
    air, unmoved = (
        _find(compared, case, "landing point", fed) for case, fed in (("density", "true"), ("start at -63.3", "true"))
    )
    largest = list(causes().items())[:3]
    by_each = ", ".join(f"{name.replace('_', ' ')} {abs(effect):.0f} km" for name, effect in largest)
    return Finding(
        "A vehicle is to reach a particular landing site; its lift law is fed with the altitude rate.",
        "Fed with the true altitude rate, as in the report, navigation errors move the landing point by "
        f"{unmoved.linear:.0f} km. Fed with the indicated rate, they move it on trajectory {GUIDED} by "
        f"{_both(landing)}. The navigation error of range stays as in the report to first order, {_both(position)}. "
        f"The landing point moves {landing.linear / position.linear:.1f} times as far, because the indicated altitude "
        f"rate, not the position, makes the lift wrong. The largest sources are {by_each}. The landing point of the "
        f"samples has a correlation of {landing.correlation:.2f} with the final altitude-rate error. A density wrong "
        f"by 5 %, with drag and L/D wrong by 3 %, moves it by {_both(air)}, whoever feeds the law.",
        "in part",
    )


def start_in_the_loop(compared: Sequence[LoopComparison], curves: pd.DataFrame) -> Finding:
    """Look for the start that moves the landing point the least."""
    frame = curves[curves["curve"] == "accelerometers on"]
    early = frame[frame[TIME] <= -10.0]
    best, worst = early.loc[early[LANDING].idxmin()], frame.loc[frame[frame[TIME] > -20.0][LANDING].idxmax()]
    advised = frame[(frame[TIME] >= -30.5) & (frame[TIME] <= -19.5)][LANDING]
    first, sampled, last = (
        _find(compared, f"start at {minutes}", "landing point") for minutes in ("-63.3", "-24.0", "0.0")
    )
    return Finding(
        "For altitude, navigation is best started between 20 and 30 minutes before reentry.",
        f"For the landing point as well. Of the starts up to −10 min the best is at {best[TIME]:.0f} min, with "
        f"{best[LANDING]:.1f} km. At −24 min it is {_both(sampled)}. From −30 to −20 min it is at most "
        f"{100.0 * (advised.max() / best[LANDING] - 1.0):.0f} % more. With a start at the first point it is "
        f"{_both(first)}. A start just before the atmosphere is bad, as the report says: {worst[LANDING]:.1f} km at "
        f"{worst[TIME]:.0f} min. A start at reentry is best, {_both(last)}: errors have no time to grow.",
        "in part",
    )


def accelerometers_off_in_the_loop(compared: Sequence[LoopComparison]) -> Finding:
    """Compare accelerometers on and off above the atmosphere."""
    on, off = causes(), causes(off=True)
    words = [f"bias {axis} from {abs(on[f'bias_{axis}']):.1f} to {abs(off[f'bias_{axis}']):.1f} km"
             for axis in ("x", "z")]  # fmt: skip
    pairs = [
        (_find(compared, f"start at {minutes} min", "landing point"),
         _find(compared, f"start at {minutes} min, accelerometers off", "landing point"))
        for minutes in ("-63.3", "-24.0")
    ]  # fmt: skip
    (first, first_off), (late, late_off) = pairs
    return Finding(
        "Taking the accelerometers' outputs as zero above the atmosphere greatly reduces the errors due to their bias.",
        f"The effects of the biases on the landing point fall: {' and '.join(words)}. Gyro drift still moves it by "
        f"{abs(off['gyro_drift']):.0f} km. All errors together move it by {_both(first_off)} instead of "
        f"{first.linear:.1f} km. With a start at −24 min they move it by {_both(late_off)} instead of "
        f"{late.linear:.1f} km.",
        "holds",
    )


def linear_in_the_loop(compared: Sequence[LoopComparison]) -> Finding:
    """Compare samples with their linear outcomes, and look at the trajectories that skip."""
    flown = [comparison for comparison in compared if comparison.part == "start" and comparison.fed == "indicated"]
    departures = {name: max(abs(flight.departure) for flight in flown if flight.result == name)
                  for name in ("altitude error", "range error", "landing point")}  # fmt: skip
    unguided = max(abs(start.departure) for start in compared
                   if start.part == "start" and start.fed == "true" and np.isfinite(start.departure))  # fmt: skip
    advised = _find(compared, "start at -24.0", "landing point")
    within = [comparison for comparison in compared if np.isfinite(comparison.departure)]
    inside = sum(each.low <= each.linear <= each.high for each in within)
    skips = " and ".join(f"{linear_sigma(number):,.0f} km on trajectory {number}" for number in SKIPPING)
    return Finding(
        "For realistic errors and reentry conditions a linear error analysis will usually be valid.",
        "In the closed loop linear analysis is less accurate. The samples' root mean squares depart from linear by up "
        f"to {100 * departures['landing point']:.1f} % in the landing point, {100 * departures['altitude error']:.1f} "
        f"% in altitude and {100 * departures['range error']:.1f} % in range. With the law fed by the truth they "
        f"depart by {100 * unguided:.2f} %. With a start at −24 min the landing point departs by "
        f"{100 * abs(advised.departure):.2f} %. {inside} of {len(within)} intervals of {100 * CONFIDENCE:g} % from "
        f"{SAMPLES:,} samples contain the linear sigma. Trajectories that leave the atmosphere again have no linear "
        f"model with this law. Their landing points would move by {skips}.",
        "in part",
    )


def landing_site(compared: Sequence[LoopComparison]) -> Finding:
    """Fly to the landing site by a law that follows the nominal flight."""
    case = f"trajectory {SITE} to its site"
    landing, position, altitude = (
        _find(compared, case, name) for name in ("landing point", "range error", "altitude error")
    )
    (_, some, all_of_them), (_, tenth, whole) = map(misses, SHARES), SHARES
    return Finding(
        "A vehicle is to reach a particular landing site, also if it leaves the atmosphere on its way.",
        f"Trajectory {SITE} does if its navigator is good, with a law that follows the nominal flight and L/D up to "
        f"{SITE_LIMIT:g}. With {100 * SHARES[0]:.0f} % of the report's errors and a start at {SITE_START:g} min, the "
        f"landing point moves by {_both(landing)}. The navigation errors are {_both(altitude)} of altitude and "
        f"{_both(position)} of range. With {100 * tenth:.0f} % of the errors half of the samples land within "
        f"{some.median:.1f} km and nine in ten within {some.ninth:.1f} km. The linear sigma is {some.linear:.1f} km. "
        f"With {100 * whole:.0f} % of the errors half of the samples miss by more than {all_of_them.median:,.0f} km. "
        f"The linear sigma, {all_of_them.linear:.0f} km, then means nothing.",
        "in part",
    )
