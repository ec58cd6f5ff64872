"""Claims of "The Story of 84 Minutes", each with a verdict. Numbers are computed when the sentences are written."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
import pandas as pd

from mcnav.report.format import number
from mcnav.systems.steady.truth import Error
from mcnav.validation.reproduce.findings import Finding
from mcnav.validation.reproduce.story_of_84_minutes import schuler
from mcnav.validation.reproduce.story_of_84_minutes.detuned import SHARES
from mcnav.validation.reproduce.story_of_84_minutes.numbers import (
    CROSS,
    DISTANCE,
    DRIFT,
    FOOT,
    GRAVITY,
    MILE,
    MINUTE,
    PERIOD,
    RADIUS,
    RANGE,
    RATIO,
    TIME,
    cruising,
    simulated,
)
from mcnav.validation.reproduce.story_of_84_minutes.reduction import (
    ALL_LARGEST,
    ALL_NOW,
    RATE,
    at_minutes,
    printed_reductions,
)

BOOST: Final = 180.0
"""A boost of "about three minutes", s."""

THRUST: Final = 9.0
"""Thrust of the footnote's climb over weight."""


def claims(tables: Mapping[str, pd.DataFrame]) -> list[Finding]:
    """Examine the document's statements; ``tables`` are those of the page by the names of their files."""
    return [
        less_than_a_hundredth(tables["reduction.csv"]),
        drift_by_more_than_a_hundred(),
        bounded_accelerometer_error(),
        drift_more_serious(),
        drift_grows_linearly(),
        ten_times_as_long(),
        period(tables["periods.csv"]),
        infinite_at_satellite_speed(tables["periods.csv"]),
        period_of_a_low_satellite(),
        climb(tables["climb.csv"]),
        boost_of_three_minutes(),
        gear_ratio(tables["detuning.csv"]),
        tilts_exactly_similar(),
        azimuth_without_pendulum(),
        hovering_diverges(tables["hover.csv"]),
        altimeter_needed(tables["altimeter.csv"]),
        star_tracker(),
    ]


def answer(frame: pd.DataFrame) -> str:
    """Answer the document's headline."""
    end = at_minutes(frame, TIME / MINUTE)
    return (
        f"The pendulum reduces the error of the {DISTANCE / MILE:,.0f}-mile cruise to "
        f"1/{end[f'{ALL_NOW} [1]']:.0f}, not to less than 1/100. Three misprints make the "
        "factor look larger."
    )


def less_than_a_hundredth(frame: pd.DataFrame) -> Finding:
    """Compare the headline with the reductions."""
    boost, end = (at_minutes(frame, minutes) for minutes in (BOOST / MINUTE, TIME / MINUTE))
    rows = {row.source: row for row in printed_reductions()}
    printed = ", ".join(f"{row.source} {row.ratio:.0f}" for row in rows.values() if row.misprinted)
    return Finding(
        "The pendulum reduced the target error of a 5,000-mile cruise missile to less than 1/100 of what the simple "
        "theory expects.",
        f"After {TIME / MINUTE:.0f} min the error is 1/{end[f'{ALL_NOW} [1]']:.0f} for all error sources together, "
        f"and 1/{end[f'{ALL_LARGEST} [1]']:.0f} where the largest error so far counts. By error source the factor is: "
        f"accelerometer {end['accelerometer [1]']:.0f}, tilt {end['tilt [1]']:.0f}, launch velocity "
        f"{end['launch velocity [1]']:.0f}, gyro drift {end['gyro drift [1]']:.0f}, azimuth {end['azimuth [1]']:.1f}. "
        f"After {BOOST / MINUTE:.0f} min it is {boost[f'{ALL_NOW} [1]']:.2f}. The printed numbers give larger factors "
        f"because of misprints: {printed}.",
        "does not hold",
    )


def drift_by_more_than_a_hundred() -> Finding:
    """Compare the printed reduction of the drift's error."""
    (row,) = [row for row in printed_reductions() if row.source == "gyro drift"]
    return Finding(
        "The pendulum has reduced the error due to gyro drift by a factor of more than 100.",
        f"The factor is {row.right:.0f}. The printed {row.ratio:.0f} lacks the factor 1/6 of its own formula.",
        "does not hold",
    )


def bounded_accelerometer_error() -> Finding:
    """Simulate the accelerometer's error on a level and on an inertial platform."""
    level, inertial = (abs(simulated(cruising(TIME, level=kept), Error.BIAS_X, RANGE)) for kept in (True, False))
    return Finding(
        "The largest error due to an accelerometer is 2 k R, whatever the flight time.",
        "True for a platform that is kept level: the error returns to zero every period. After two periods "
        f"{level / FOOT:.0f} ft remain for the simulated missile, whose period is half a percent longer. On a platform "
        f"with fixed inertial directions {inertial / FOOT:,.0f} ft remain.",
        "in part",
    )


def drift_more_serious() -> Finding:
    """Find the flight time from which gyro drift makes a larger error than the accelerometer so far."""
    times = np.linspace(0.0, TIME, 10_121)[1:]
    drift = schuler.drift_spherical(DRIFT, RADIUS, RATE, times)
    bias = np.maximum.accumulate(schuler.bias_spherical(RATIO * RATE**2 * RADIUS, RATE, times))
    crossing = float(times[np.argmax(drift > bias)]) / MINUTE
    return Finding(
        "Gyro drift is an even more serious source of error than the accelerometer.",
        f"On a cruise, yes: from {crossing:.0f} min on, and after {TIME / MINUTE:.0f} min it is "
        f"{drift[-1] / bias[-1]:.1f} times as large. In a boost of three minutes the accelerometer makes "
        f"{bias[179] / drift[179]:.0f} times the error of gyro drift.",
        "in part",
    )


def drift_grows_linearly() -> Finding:
    """Compare the growth of the drift's error for short and for long times."""
    spans = np.array([[60.0, 120.0], [10.0 * PERIOD, 20.0 * PERIOD]])
    errors = schuler.drift_spherical(1.0, RADIUS, RATE, spans)
    short, long = np.log2(errors[:, 1] / errors[:, 0])
    return Finding(
        "The error due to gyro drift grows with the first power of time for long times, and with the third for short.",
        f"From one minute to two the power is {short:.2f}, from ten periods to twenty {long:.2f}.",
        "holds",
    )


def ten_times_as_long() -> Finding:
    """Compare errors of thirty minutes with those of three."""
    times = np.array([BOOST, 10.0 * BOOST])
    by_bias, by_drift = (
        function[1] / function[0]
        for function in (
            schuler.bias_spherical(1.0, RATE, times),
            schuler.drift_spherical(1.0, RADIUS, RATE, times),
        )
    )
    return Finding(
        "Fly ten times as long and the range error is 100 times as great, by gyro drift 1,000 times (Dr. X).",
        f"From 3 to 30 min it is {by_bias:.0f} times as great by an accelerometer, and {by_drift:.0f} times by gyro "
        "drift. The rule is good for a boost and a glide, and wrong for a cruise.",
        "in part",
    )


def period(frame: pd.DataFrame) -> Finding:
    """Compare simulated periods with the formula."""
    rest, missile = frame["period along the track, flown [min]"][:2]
    return Finding(
        "The platform oscillates with 2π√(R/g) = 84.4 min; for a missile at speed V, g − V²/r is in place of g.",
        f"Simulated: {rest:.2f} min at rest and {missile:.2f} min for the missile along its track. From rest to 98 % "
        f"of orbital speed the formula holds within {number(float(frame['difference, share'].abs().max()), 1)} of the "
        "period. Across the track the period stays that of g.",
        "holds",
    )


def infinite_at_satellite_speed(frame: pd.DataFrame) -> Finding:
    """Look at the period near orbital speed."""
    last = frame.iloc[-1]
    return Finding(
        "The period approaches infinity as the speed approaches the satellite's.",
        f"At {np.sqrt(last['V^2 / g r']):.2f} of orbital speed the simulated period is "
        f"{last['period along the track, flown [min]']:.0f} min.",
        "holds",
    )


def period_of_a_low_satellite() -> Finding:
    """Compare the period of the pendulum with those of circular orbits at the surface and 100 miles above it."""
    surface, low = (
        2.0 * np.pi * np.sqrt((RADIUS + height * MILE) ** 3 / (GRAVITY * RADIUS**2)) / MINUTE for height in (0.0, 100.0)
    )
    return Finding(
        "84 minutes is also the period of a low earth satellite (Dr. X).",
        f"Of one at the surface: {surface:.2f} min. At a height of 100 miles it is {low:.1f} min.",
        "holds",
    )


def climb(frame: pd.DataFrame) -> Finding:
    """Compare the period of a climb at 9 g at its beginning and its end."""
    first, last = frame["period [min]"].iloc[[0, -1]]
    return Finding(
        "In a vertical climb with a thrust of nine times the weight the period is 28 min.",
        f"It is {first:.2f} min at the beginning, and {last:.1f} min after three minutes, when the missile has risen.",
        "in part",
    )


def boost_of_three_minutes() -> Finding:
    """Compute what the pendulum does in three minutes, at rest and at nine g."""

    def share(rate: float) -> float:
        flat, spherical = schuler.bias_flat(1.0, BOOST), schuler.bias_spherical(1.0, rate, BOOST)
        return 100.0 * (flat / spherical - 1.0)

    return Finding(
        "A boost lasts about three minutes, so that the pendulum is of less importance for ballistic missiles.",
        f"In three minutes it reduces the error of an accelerometer or a tilt by {share(RATE):.1f} %. With the 28 min "
        f"of the climb it reduces it by {share(np.sqrt(THRUST) * RATE):.1f} %.",
        "holds",
    )


def gear_ratio(frame: pd.DataFrame) -> Finding:
    """Examine the condition on the gear ratio with loops that miss it."""
    by_share = frame.set_index("gear ratio wrong by [%]")
    ends = [abs(float(by_share["cruising, at the end [mi]"][100.0 * share])) for share in SHARES[1:]]
    resting, periods = (
        [float(by_share[column][100.0 * share]) for share in (SHARES[0], SHARES[-1])]
        for column in ("at rest, largest [mi]", "period [min]")
    )
    return Finding(
        "The gear ratio from distance to platform angle is set to 1/R.",
        f"In flight it must be. A ratio wrong by 0.1 %, 1 % and 10 % leaves {ends[0]:.1f}, {ends[1]:.0f} and "
        f"{ends[2]:.0f} miles after {DISTANCE / MILE:,.0f} miles: the missile's own travel tilts the platform. At rest "
        f"it hardly matters. There 10 % change the period from {periods[0]:.1f} to {periods[1]:.1f} min. The largest "
        f"error by 10⁻⁴ g goes from {resting[0]:.2f} to {resting[1]:.2f} miles. Tuning keeps the vehicle's own motion "
        "out of the error; the 84 minutes come with it.",
        "holds",
    )


def tilts_exactly_similar() -> Finding:
    """Simulate the cross-range error due to a tilt about the track after two periods."""
    after = simulated(cruising(TIME), Error.ROLL_MISALIGNMENT, CROSS) / FOOT
    return Finding(
        "Errors of a tilt about the track are exactly similar to those of a tilt about the cross axis.",
        f"At rest only. A tilt keeps its direction in inertial space, so that after 73 degrees part of it is an "
        f"azimuth error. The cross-range error ends at {after:,.0f} ft, not at zero.",
        "in part",
    )


def azimuth_without_pendulum() -> Finding:
    """Simulate the wrong launch direction."""
    flown = simulated(cruising(TIME), Error.AZIMUTH_MISALIGNMENT, CROSS) / FOOT
    closed = schuler.azimuth_spherical(np.radians(0.01), RADIUS, DISTANCE) / FOOT
    return Finding(
        "A wrong launch direction does not follow the pendulum; its error is R sin φ Δθ.",
        f"Simulated {flown:,.1f} ft, by the formula {closed:,.1f} ft.",
        "holds",
    )


def hovering_diverges(frame: pd.DataFrame) -> Finding:
    """Look at the height errors after 84 minutes."""
    last = frame.iloc[-1]
    up, down = abs(last["flown, +1e-04 g [mi]"]), abs(last["flown, -1e-04 g [mi]"])
    return Finding(
        "Inertial instruments cannot find the altitude: small errors diverge rapidly.",
        f"An error of 10⁻⁴ g grows to {up:.0f} miles upwards or {down:.0f} miles downwards in 84 minutes. Linear "
        f"analysis has {last['linear, 1e-4 g [mi]']:.0f} miles in both directions.",
        "holds",
    )


def altimeter_needed(frame: pd.DataFrame) -> Finding:
    """Ask how poor an altimeter suffices."""
    by_interval = frame.set_index("interval [s]")
    settled = by_interval["altimeter to hold 100 m, settled [m]"]
    learning = by_interval["altimeter to hold 100 m, from the start [m]"]
    return Finding(
        "Some other altitude measuring device, a barometer or a radar altimeter, is necessary.",
        "A poor one suffices. To hold 100 m, one sigma, it may err by "
        f"{settled[1.0]:,.0f} m with a reading a second, and {settled[60.0]:.0f} m with one a minute. While the "
        f"filter learns an accelerometer bias of 10⁻⁴ g, it must be better: {learning[1.0]:,.0f} and "
        f"{learning[60.0]:.0f} m. With a reading every ten minutes none suffices at the start. A constant altimeter "
        "error remains in full.",
        "holds",
    )


def star_tracker() -> Finding:
    """Refer to the campaign that has one."""
    return Finding(
        "A star tracker gains a factor of ten in accuracy.",
        "True for gyro drift, not for the whole system, whose accelerometer bias remains. "
        "Campaign 22_navaho computes both.",
        "in part",
    )
