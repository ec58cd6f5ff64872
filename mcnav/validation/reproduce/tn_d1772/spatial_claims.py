"""Claims of NASA TN D-1772 tested with the navigator in three dimensions; every number is computed when written."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from scipy import special

from mcnav.report.format import number
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
    return next(
        comparison
        for comparison in compared
        if comparison.part == part and comparison.case.startswith(case) and comparison.result == result
    )


def _both(each: Comparison) -> str:
    """Write the linear and the simulated number of a comparison, km."""
    return f"{each.linear:.1f} km (samples {each.simulated:.1f})"


def start_in_three_dimensions(compared: Sequence[Comparison], curves: pd.DataFrame) -> Finding:
    """Compare start times of both navigators, and look for the best one with crossrange."""
    flown = [comparison for comparison in compared if comparison.part == "start"]
    planar = [flight for flight in flown if np.isfinite(flight.planar)]
    apart = max(abs(each.linear / each.planar - 1.0) for each in planar)
    sampled = max(abs(each.simulated / each.planar_simulated - 1.0) for each in planar)
    within = sum(flight.low <= flight.linear <= flight.high for flight in flown)
    departure = max(abs(comparison.departure) for comparison in compared if np.isfinite(comparison.departure))
    frame = curves[curves["curve"] == "start"]
    early = frame[frame[TIME] <= -10.0]
    best = {name: early.loc[early[f"{name} [km]"].idxmin()] for name in ("altitude", "position")}
    summed = early.loc[early["altitude, sum of |all| [km]"].idxmin()]
    first, last = (_find(compared, "start", f"start at {minutes}", "crossrange") for minutes in ("-63.5", "0.0"))
    return Finding(
        "For altitude, navigation is best started between 20 and 30 minutes before reentry.",
        "In three dimensions as in the plane. The sum of absolute altitude errors is least at "
        f"{summed[TIME]:.0f} min, their dispersion at {best['altitude'][TIME]:.0f} min. Crossrange does not change "
        f"this. It is {_both(first)} with a start at the first point, and {_both(last)} with one at reentry. The "
        f"root sum square of altitude, range and crossrange is least at {best['position'][TIME]:.0f} min, with "
        f"{best['position']['position [km]']:.1f} km. Both navigators agree at {len(planar) // 2} starts: linear "
        f"sigmas within {number(apart, 1)}, those of the same {SAMPLES:,} samples within {number(sampled, 1)}. "
        f"{within} of {len(flown)} intervals of {100 * CONFIDENCE:g} % contain the linear sigma. The samples' root "
        f"mean squares depart from linear by at most {100 * departure:.2f} %, here and in all cases below.",
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
    own = max(
        abs(comparison.own / comparison.linear - 1.0)
        for comparison in compared
        if comparison.part == "update" and np.isfinite(comparison.own)
    )
    flown = [comparison for comparison in compared if comparison.part == "update"]
    within = sum(flight.low <= flight.linear <= flight.high for flight in flown)
    return Finding(
        "The start is the time of the last update, best between 20 and 30 minutes before reentry.",
        "An update is better than a start, because it also calibrates gyros and accelerometers. The navigator runs "
        "from the first point with a filter. Tracking and a star tracker update it once, as accurately as the report's "
        f"initial conditions and alignment. At −30 min the update leaves an altitude error of {_both(at_30)}, where "
        f"the start leaves {at_30.planar:.1f} km. The crossrange error is then {_both(across)}. At −10 min it leaves "
        f"{_both(at_10)}, where the start leaves {at_10.planar:.1f} km. The best update comes at {best[TIME]:.0f} min, "
        f"with {best['altitude [km]']:.1f} km. Without the star tracker, an update at −30 min leaves "
        f"{_both(no_stars)}. The filter sigmas are the linear ones to {number(own, 1)}. {within} of {len(flown)} "
        f"intervals of {UPDATED_SAMPLES} samples contain them.",
        "does not hold",
    )


def accelerometers_off_in_three_dimensions(compared: Sequence[Comparison]) -> Finding:
    """Compare accelerometers on and off above the atmosphere."""
    words = []
    for axis in ("x", "z"):
        on, off = (_find(compared, "switching", f"bias {axis} alone, accelerometers {state}", "altitude")
                   for state in ("on", "off"))  # fmt: skip
        words.append(f"bias {axis} from {abs(on.linear):.2f} to {abs(off.linear):.2f} km")
    sigmas = []
    for result in ("altitude", "range", "crossrange"):
        on, off = (
            _find(compared, "switching", f"all errors, accelerometers {state}", result) for state in ("on", "off")
        )
        sigmas.append(f"{result.capitalize()}: {_both(on)} become {_both(off)}.")
    flown = [comparison for comparison in compared if comparison.part == "switching" and np.isfinite(comparison.planar)]
    apart = max(abs(flight.linear - flight.planar) for flight in flown)
    return Finding(
        "Taking the accelerometers' outputs as zero above the atmosphere greatly reduces the errors due to their bias.",
        f"Final altitude errors fall by {words[0]}, by {words[1]}. By all errors: {' '.join(sigmas)} Across the plane "
        "the gyros dominate, which go on drifting. The planar navigator also misses the drag above 121.92 km; its "
        f"linear numbers are the same to {1e3 * apart:.1g} m.",
        "holds",
    )


def crossrange(compared: Sequence[Comparison]) -> Finding:
    """Examine stability and independence of crossrange errors."""
    finding = [crossing(trajectory)[0] for trajectory in TABLE_I]
    mixed = max(each.mixed for each in finding)
    history = crossrange_history()
    by_conditions = history["crossrange by initial conditions [km]"]
    finals = [comparison for comparison in compared if comparison.part == "crossrange"]
    four = _find(compared, "crossrange", f"trajectory {EXAMPLE}", "crossrange")
    altitude = _find(compared, "start", "start at -63.5", "altitude")
    own = finding[EXAMPLE - 1]
    seen = max(float(np.abs(correlations(multiple)).max()) for multiple in (1.0, 10.0))
    bound = special.ndtri(0.5 + 0.5 * CONFIDENCE) / np.sqrt(SAMPLES)
    grown = max(each.by_conditions for each in finding)
    return Finding(
        "Crossrange errors are stable, and independent of altitude and downrange errors.",
        "Independent, yes: to first order no error acts both across the plane and in it, on any trajectory (less than "
        f"{number(max(mixed, 1e-13), 1)} of the largest effect). Correlations of {SAMPLES:,} samples on trajectory "
        f"{EXAMPLE} are at most {seen:.2f}, also with ten times the errors; independent errors stay below "
        f"{bound:.2f}. Stable by initial conditions: 0.5 km in position fall to {by_conditions.min():.2f} km and end "
        f"at {own.by_conditions:.2f} km, at most {grown:.2f} km on the seven trajectories. Not stable by the "
        f"instruments: gyro drift of 1e-6 rad/s about the two other axes makes {own.by_gyros:.1f} km of crossrange. "
        f"The bias of the third accelerometer makes {own.by_accelerometer:.1f} km. All errors make {_both(four)}, "
        f"{100 * four.linear / altitude.linear:.0f} % of the altitude error, and "
        f"{min(each.linear for each in finals):.0f} to {max(each.linear for each in finals):.0f} km on the seven "
        "trajectories.",
        "in part",
    )
