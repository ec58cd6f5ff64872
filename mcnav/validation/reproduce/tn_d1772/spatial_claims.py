"""Claims of NASA TN D-1772 tested with the navigator in three dimensions; every number is computed when written."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from scipy import special

from mcnav.systems.reentry.table_i import TABLE_I
from mcnav.validation.reproduce.findings import Finding
from mcnav.validation.reproduce.tn_d1772.in_three_dimensions import (
    CONFIDENCE,
    EXAMPLE,
    SAMPLES,
    TIME,
    UPDATED_SAMPLES,
    Comparison,
    correlations,
    crossing,
    crossrange_history,
)


def spatial_claims(compared: Sequence[Comparison], curves: pd.DataFrame) -> list[Finding]:
    """Examine the claims on start times, switched accelerometers and crossrange, and an update in mid-course."""
    return [
        start_in_three_dimensions(compared, curves),
        update_in_mid_course(compared, curves),
        accelerometers_off_in_three_dimensions(compared),
        crossrange(compared),
    ]


def _find(compared: Sequence[Comparison], part: str, case: str, result: str) -> Comparison:
    """Return the comparison of a result whose case begins with given words."""
    return next(each for each in compared if each.part == part and each.case.startswith(case) and each.result == result)


def _both(each: Comparison) -> str:
    """Write the linear and the simulated number of a comparison, km."""
    return f"{each.linear:.1f} km (samples {each.simulated:.1f})"


def start_in_three_dimensions(compared: Sequence[Comparison], curves: pd.DataFrame) -> Finding:
    """Compare start times of both navigators, and look for the best one with crossrange."""
    flown = [each for each in compared if each.part == "start"]
    planar = [each for each in flown if np.isfinite(each.planar)]
    apart = max(abs(each.linear / each.planar - 1.0) for each in planar)
    sampled = max(abs(each.simulated / each.planar_simulated - 1.0) for each in planar)
    within = sum(each.low <= each.linear <= each.high for each in flown)
    departure = max(abs(each.departure) for each in compared if np.isfinite(each.departure))
    frame = curves[curves["curve"] == "start"]
    early = frame[frame[TIME] <= -10.0]
    best = {name: early.loc[early[f"{name} [km]"].idxmin()] for name in ("altitude", "position")}
    summed = early.loc[early["altitude, sum of |all| [km]"].idxmin()]
    first, last = (_find(compared, "start", f"start at {minutes}", "crossrange") for minutes in ("-63.5", "0.0"))
    return Finding(
        "For altitude, navigation is best started between 20 and 30 minutes before reentry.",
        f"In three dimensions as in the plane: at {len(planar) // 2} starts linear sigmas of altitude and range differ "
        f"by at most {apart:.0e} from those of the planar navigator, and those of the same {SAMPLES:,} samples by at "
        f"most {sampled:.0e}; {within} of {len(flown)} intervals of {100 * CONFIDENCE:g} % contain the linear sigma. "
        f"From those of their linear outcomes the samples' depart by at most {100 * departure:.2f} %, here and in all "
        "cases below. "
        f"The sum of absolute altitude errors is least at {summed[TIME]:.0f} min, their dispersion at "
        f"{best['altitude'][TIME]:.0f} min. Crossrange does not change this: its dispersion falls from {_both(first)} "
        f"with a start at the first point to {_both(last)} with one at reentry, and the root sum square of altitude, "
        f"range and crossrange, {best['position']['position [km]']:.1f} km, is least at {best['position'][TIME]:.0f} "
        "min.",
        "in part",
    )


def update_in_mid_course(compared: Sequence[Comparison], curves: pd.DataFrame) -> Finding:
    """Compare a start with an update of a navigator that has a filter."""
    at_30, at_10 = (_find(compared, "update", f"update at -{minutes}", "altitude")
                    for minutes in (30, 10))  # fmt: skip
    across, no_stars = (_find(compared, "update", "update at -30 min", "crossrange"),
                        _find(compared, "update", "update at -30 min, no stars", "altitude"))  # fmt: skip
    frame = curves[curves["curve"] == "update"]
    best = frame.loc[frame["altitude [km]"].idxmin()]
    own = max(abs(each.own / each.linear - 1.0) for each in compared if each.part == "update" and np.isfinite(each.own))
    flown = [each for each in compared if each.part == "update"]
    within = sum(each.low <= each.linear <= each.high for each in flown)
    return Finding(
        "The start is the time at which the system is updated for the last time, best between 20 and 30 minutes before "
        "reentry.",
        "A navigator that runs from the first point with a filter, and is updated once by tracking and a star tracker "
        "as accurate as the report's initial conditions and alignment, is not one that starts then: the update "
        "calibrates gyros and accelerometers as well. Updated at −30 min it leaves an altitude error of "
        f"{_both(at_30)}, where the start leaves {at_30.planar:.1f} km, and of crossrange {_both(across)}. The best "
        f"update comes later, at {best[TIME]:.0f} min with {best['altitude [km]']:.1f} km; at −10 min {_both(at_10)} "
        f"are left, where the start leaves {at_10.planar:.1f} km. Without the star tracker an update at −30 min leaves "
        f"{_both(no_stars)}. The filter states the linear sigmas to {own:.0e}; {within} of {len(flown)} intervals of "
        f"{UPDATED_SAMPLES} samples contain them.",
        "does not hold",
    )


def accelerometers_off_in_three_dimensions(compared: Sequence[Comparison]) -> Finding:
    """Compare accelerometers on and off above the atmosphere."""
    words = []
    for axis in ("x", "z"):
        on, off = (_find(compared, "switching", f"bias {axis} alone, accelerometers {state}", "altitude")
                   for state in ("on", "off"))  # fmt: skip
        words.append(f"{abs(on.linear):.2f} km of final altitude by bias {axis} become {abs(off.linear):.2f} km")
    sigmas = []
    for result in ("altitude", "range", "crossrange"):
        on, off = (
            _find(compared, "switching", f"all errors, accelerometers {state}", result) for state in ("on", "off")
        )
        sigmas.append(f"{result} from {_both(on)} to {_both(off)}")
    flown = [each for each in compared if each.part == "switching" and np.isfinite(each.planar)]
    apart = max(abs(each.linear - each.planar) for each in flown)
    return Finding(
        "Taking the accelerometers' outputs as zero above the atmosphere greatly reduces the errors due to their bias.",
        f"{words[0]}, {words[1]}. The dispersion of all errors changes in {', '.join(sigmas)}: across the plane the "
        "gyros are what counts, which go on drifting. The planar navigator, which also misses the drag above 121.92 "
        f"km, has the same linear numbers to {1e3 * apart:.1g} m.",
        "holds",
    )


def crossrange(compared: Sequence[Comparison]) -> Finding:
    """Examine stability and independence of crossrange errors."""
    finding = [crossing(number)[0] for number in TABLE_I]
    mixed = max(each.mixed for each in finding)
    history = crossrange_history()
    by_conditions = history["crossrange by initial conditions [km]"]
    finals = [each for each in compared if each.part == "crossrange"]
    four = _find(compared, "crossrange", f"trajectory {EXAMPLE}", "crossrange")
    altitude = _find(compared, "start", "start at -63.5", "altitude")
    own = finding[EXAMPLE - 1]
    seen = max(float(np.abs(correlations(multiple)).max()) for multiple in (1.0, 10.0))
    bound = special.ndtri(0.5 + 0.5 * CONFIDENCE) / np.sqrt(SAMPLES)
    grown = max(each.by_conditions for each in finding)
    return Finding(
        "Crossrange errors are stable, and independent of altitude and downrange errors.",
        "Independent: to first order no error acts across the plane and in it (less than "
        f"{max(mixed, 1e-13):.0e} of the largest effect, on all seven trajectories), and correlations of {SAMPLES:,} "
        f"samples on trajectory {EXAMPLE} are at most {seen:.2f}, also with ten times the errors, where independent "
        f"errors stay below {bound:.2f}. Stable by initial conditions: 0.5 km in position, with the counterparts of "
        f"the report's other errors, fall to {by_conditions.min():.2f} km and end at {own.by_conditions:.2f} km, at "
        f"most {grown:.2f} km on the seven trajectories. Not stable by the instruments: gyro drift of 1e-6 rad/s about "
        f"the two other axes, the report's size, makes {own.by_gyros:.1f} km of it and the bias of the third "
        f"accelerometer {own.by_accelerometer:.1f} km, so that all errors make {_both(four)}, "
        f"{100 * four.linear / altitude.linear:.0f} % of the altitude error, and "
        f"{min(each.linear for each in finals):.0f} to {max(each.linear for each in finals):.0f} km on the seven "
        "trajectories.",
        "in part",
    )
