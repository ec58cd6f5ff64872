"""Claims of NASA TN D-1772, each tested by solving its own equations again.

Every number in these sentences is computed when they are written.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
import pandas as pd
from scipy.optimize import minimize_scalar

from mcnav.analysis.comparison import Criterion, compare
from mcnav.analysis.linearity import alone
from mcnav.analysis.model import Model
from mcnav.arrays.types import Array
from mcnav.contract.engine import without_noise
from mcnav.contract.quantities import source_labels
from mcnav.linear.partials import Propagate, partials_at_later_starts
from mcnav.physics.constants import GRAVITATIONAL_PARAMETER
from mcnav.report.names import humanize
from mcnav.systems.reentry.engines import ReferenceEngine
from mcnav.systems.reentry.instruments import Error
from mcnav.systems.reentry.navigator import simulate_indicated
from mcnav.systems.reentry.outputs import DEVIATIONS
from mcnav.systems.reentry.scenario import Flight, Reentry
from mcnav.systems.reentry.table_i import (
    ALL_ERRORS,
    COLUMNS,
    ERRORS,
    TABLE_I,
    among_all,
    common_start,
    range_from_reentry,
    start_at_angle,
)
from mcnav.systems.reentry.truth import airspeed_and_angle
from mcnav.systems.reentry.vehicle import Vehicle
from mcnav.validation.reproduce.findings import Finding
from mcnav.validation.reproduce.tn_d1772.printed import TO_PRINTED, final_errors, trajectories
from mcnav.validation.reproduce.tn_d1772.tables import TN_SOURCES, linear_model, propagator, table_i_scenario

SAMPLES: Final = 4_000
SEED: Final = 1772
LINEAR_WITHIN: Final = 0.05
"""Departure from linearity that counts, as a share."""

MATTERS: Final = 0.01
"""A source that moves an output by a smaller share of the root sum square of all is left out of the claim."""

STARTS: Final = 50

EARLY: Final = -10.0
"""Start times up to here (min) are those at which the report looks for the best one."""

ABSOLUTE_ALTITUDE: Final = "altitude, all [km]"
ABSOLUTE_RANGE: Final = "range, all [km]"
ABSOLUTE: Final = "altitude, sum of |all| [km]"
RSS: Final = "altitude, root sum square of all [km]"


def claims(figures: Mapping[str, pd.DataFrame]) -> list[Finding]:
    """Examine the report's conclusions; ``figures`` are the tables of the curves by name."""
    return [
        linear_at_stated_errors(),
        linear_at_ten_times(),
        best_start(figures["12"]),
        what_predominates(figures["12"]),
        against_range(figures["4"]),
        equipment_makes_altitude_errors_fall(figures["4"]),
        accelerometers_off(figures["13"]),
        other_errors_with_accelerometers_off(figures["13"]),
        table_v(),
        perigee_analogy(figures["10"]),
    ]


def settled() -> list[Finding]:
    """List what the report leaves open or contradicts, and how it was decided."""
    return [earth_radius(), axes(), start_of_table_v(), threshold_of_table_vi(), sensitive_angles(), reentry_values(),
            start_times_agree()]  # fmt: skip


def linear_at_stated_errors() -> Finding:
    """Compare all seven trajectories with random errors of the stated size as one sigma."""
    ratios, nees = {}, {}
    for number in TABLE_I:
        scenario = table_i_scenario(number)
        draws = np.random.default_rng(SEED).standard_normal((SAMPLES, len(ERRORS))) * ERRORS
        outcomes = propagator(scenario, "ensemble", draws[:64])(draws).values
        linear = linear_model(scenario)
        model = Model(linear.partials, linear.nominal, np.zeros(len(ERRORS)), np.diag(ERRORS**2))
        finding = compare(model, draws, outcomes, Criterion(LINEAR_WITHIN))
        ratios[number] = [float(output.paired.ratio or np.nan) for output in finding.outputs]
        nees[number] = finding.ellipsoid.nees_paired.value if finding.ellipsoid else np.nan
    rates = np.array([row[3] for row in ratios.values()])
    others = np.array([row[:3] for row in ratios.values()])
    worst = max(nees, key=lambda number: nees[number])
    return Finding(
        "For realistic errors and reentry conditions a linear error analysis will usually be valid.",
        f"Each sigma is right. With {SAMPLES:,} samples on each trajectory, altitude, range and altitude rate are "
        f"within {100 * np.abs(others - 1).max():.2f} % of linear, range rate within "
        f"{100 * np.abs(rates - 1).max():.2f} %. The full covariance matrix is not right: the mean NEES, 4 by linear "
        f"analysis, is {nees[1]:.2f} on trajectory 1 and {nees[worst]:.1f} on trajectory {worst}. Nonlinearity appears "
        "first along the ellipsoid's narrowest axes.",
        "in part",
    )


def linear_at_ten_times() -> Finding:
    """Raise each source alone on trajectory 4 to the multiple at which it departs from linear."""
    scenario = table_i_scenario(4)
    linear = linear_model(scenario)
    directions = np.diag(ERRORS)

    def fly(multiple: float) -> Propagate:
        return propagator(scenario, "ensemble", multiple * np.vstack([directions, -directions]))

    finding = alone(fly, linear, directions, LINEAR_WITHIN, 100.0)
    effects = np.abs(linear.partials * ERRORS)
    matters = (effects >= MATTERS * np.sqrt((effects**2).sum(axis=1, keepdims=True))).T
    labels = source_labels([source.name for source in TN_SOURCES], [output.name for output in DEVIATIONS])
    early = [
        f"{labels[j]} in {humanize(DEVIATIONS[i].name)} ({finding.multiples[j, i]:.2g} times)"
        for j, i in zip(*np.nonzero(matters & (finding.multiples < 10.0)), strict=True)
    ]
    rest = np.where(matters & (finding.multiples >= 10.0), finding.multiples, np.inf).min()
    return Finding(
        "The range of linearity for all of the errors extends beyond ten times their stated values.",
        f"It does on trajectory 4 for every significant effect but {len(early)}, with a limit of "
        f"{100 * LINEAR_WITHIN:.0f} %. The exceptions are {', '.join(early)}. The next effect departs at {rest:.3g} "
        "times its stated value.",
        "in part",
    )


def best_start(frame: pd.DataFrame) -> Finding:
    """Find when altitude dispersion is least."""
    start = frame.iloc[:, 0]
    advised = (start >= -30.0) & (start <= -20.0)
    words = []
    for column, name in ((ABSOLUTE, "sum of absolute values"), (RSS, "root sum square of independent errors")):
        early = frame[start <= EARLY]
        place = int(early[column].argmin())
        least, at = float(early[column].iloc[place]), float(early.iloc[place, 0])
        more = float(frame[column][advised].max()) / least - 1.0
        reentry = float(np.interp(0.0, start, frame[column]))
        words.append(
            f"{name} is least at {at:.1f} min, with {least:.1f} km, and at most {100 * more:.0f} % more from −30 to "
            f"−20 min. It is {frame[column].iloc[0]:.1f} km at the first start and {reentry:.1f} km at reentry."
        )
    return Finding(
        "For altitude, navigation is best started between 20 and 30 minutes before reentry.",
        f"By the report's measure the advice is right, but a start at reentry itself is no worse. The {words[0]} By "
        f"dispersion, the measure of a covariance analysis, the best start is earlier. The {words[1]}",
        "in part",
    )


def what_predominates(frame: pd.DataFrame) -> Finding:
    """Find which kind of error matters for early and for late starts."""
    words, start = [], frame.iloc[:, 0]
    for name in ("altitude", "range"):
        conditions, equipment = (frame[f"{name}, sum of |{kind}| [km]"] for kind in ("initial conditions", "equipment"))
        crossing = start[np.argmax((conditions > equipment) & (start <= 0.0))]
        words.append(f"{crossing:.1f} min in {name}")
    return Finding(
        "Started well before reentry, equipment errors predominate; started just before it, initial conditions do.",
        f"The sums of absolute values change order at {words[0]} and {words[1]}.",
        "holds",
    )


def against_range(frame: pd.DataFrame) -> Finding:
    """Examine figure 4, with flights between and beyond the seven."""
    between = frame[frame["source"] == "between"].sort_values("final range [km]")
    constant, variable = (between[between["kind"] == f"{kind} L/D"] for kind in ("constant", "variable"))
    reach, altitude = (constant[column].to_numpy() for column in ("final range [km]", ABSOLUTE_ALTITUDE))
    bend = int(np.argmax(np.diff(altitude) < 0.0))  # the first maximum
    low = bend + int(altitude[bend:].argmin())
    falls = variable["final range [km]"].to_numpy()[variable[ABSOLUTE_RANGE].to_numpy().argmax()]
    grows = bool((np.diff(constant[ABSOLUTE_RANGE]) > 0.0).all())
    at = variable["final range [km]"].to_numpy()
    excess = np.interp(at, reach, altitude) - variable[ABSOLUTE_ALTITUDE].to_numpy()
    larger_from = float(at[np.argmax(excess > 0.0)])
    return Finding(
        "Range errors grow continuously with final range. Altitude errors pass a maximum, then a minimum slightly "
        "beyond the longest range shown. Constant L/D gives somewhat larger errors than variable L/D.",
        f"With constant L/D range errors {'grow' if grows else 'do not always grow'}. The altitude sum has its "
        f"maximum, {altitude[bend]:.0f} km, at {reach[bend] / 1e3:.1f} thousand km. Its minimum, "
        f"{altitude[low]:.0f} km, is at {reach[low] / 1e3:.1f} thousand km, just beyond trajectory 7 "
        f"({float(trajectories()[7]['final_range_km']) / 1e3:.1f}). With variable L/D range errors grow up to "
        f"{falls / 1e3:.0f} thousand km and then decrease, which the report's three points could not show. Altitude "
        f"errors are larger with constant L/D only beyond {larger_from / 1e3:.0f} thousand km.",
        "in part",
    )


def equipment_makes_altitude_errors_fall(frame: pd.DataFrame) -> Finding:
    """Split the decrease of altitude errors between the two longest constant-L/D trajectories of Table I."""
    shown = frame[frame["source"] == "computed"].set_index("trajectory")
    conditions, equipment = (
        [float(shown.loc[number, f"altitude, {kind} [km]"]) for number in (5, 7)]
        for kind in ("initial conditions", "equipment")
    )
    return Finding(
        "Equipment errors, and not initial conditions, make altitude errors fall at long ranges.",
        f"From trajectory 5 to 7 the sum of equipment errors falls from {equipment[0]:.0f} to {equipment[1]:.0f} km. "
        f"The sum of initial conditions rises from {conditions[0]:.0f} to {conditions[1]:.0f} km.",
        "holds" if equipment[1] < equipment[0] and conditions[1] > conditions[0] else "does not hold",
    )


def accelerometers_off(frame: pd.DataFrame) -> Finding:
    """Examine Table VI and the best switching altitude."""
    on, off = (
        table_i_scenario(4, **options).linear().end.partials * ALL_ERRORS
        for options in ({}, {"accelerometers_off_above": 121_920.0})
    )
    total_on, total_off = (np.sqrt((effects**2).sum(axis=1))[0] / 1e3 for effects in (on, off))
    bias_x, bias_z = ([abs(effects[0, error]) / 1e3 for effects in (on, off)] for error in (Error.BIAS_X, Error.BIAS_Z))
    column = frame["altitude, rms [km]"]
    best = int(column.argmin())
    at_report = float(column[frame["off above [km]"] == 121.92].iloc[0])
    missed = frame.set_index("off above [km]")["altitude, drag missed [km]"].abs()
    return Finding(
        "Taking the accelerometers' outputs as zero above the atmosphere greatly reduces the errors due to their bias.",
        f"Bias x: {bias_x[0]:.2f} km of final altitude become {bias_x[1]:.2f} km. Bias z: {bias_z[0]:.2f} km become "
        f"{bias_z[1]:.2f} km. Altitude dispersion by all errors falls from {total_on:.1f} to {total_off:.1f} km. The "
        f"best switching altitude is {frame.iloc[best, 0]:.0f} km, only {100 * (at_report / column[best] - 1):.2f} % "
        "better than 121.92 km. Below it is a cliff, because drag is not measured. The mean altitude error is "
        f"{missed[100.0]:.1f} km with switching at 100 km, {missed[90.0]:.1f} km at 90 km and {missed[80.0]:.0f} km at "
        "80 km. Sigma hardly changes.",
        "holds",
    )


def other_errors_with_accelerometers_off(frame: pd.DataFrame) -> Finding:
    """Compare Tables II(d) and VI for all errors but the biases."""
    on, off = (
        table_i_scenario(4, **options).linear().end.partials * ALL_ERRORS
        for options in ({}, {"accelerometers_off_above": 121_920.0})
    )
    others = [column for column in COLUMNS if column not in (Error.BIAS_X, Error.BIAS_Z)]
    missed = abs(float(frame.set_index("off above [km]")["altitude, drag missed [km]"][121.92]))
    changes = 100.0 * np.abs(off - on)[:, others].max(axis=1) / np.abs(on).max(axis=1)
    words = ", ".join(
        f"{humanize(output.name)} {share:.1g} %" for output, share in zip(DEVIATIONS, changes, strict=True)
    )
    return Finding(
        "Switching the accelerometers off does not significantly affect the other final errors.",
        f"The largest changes, as shares of the largest effect: {words}. The drag that is not measured adds a mean "
        f"altitude error of {1e3 * missed:.0f} m.",
        "holds" if changes.max() < 100.0 * LINEAR_WITHIN else "in part",
    )


def table_v() -> Finding:
    """Find the cause of the discrepancy between the parts of Table V."""
    own = table_i_scenario(4, start=-214.8)
    fixed = table_i_scenario(4, start=-214.8, axes="trajectory")
    turn = own.navigation.theta_axes - fixed.navigation.theta_axes
    here, there = (
        scenario.linear().end.partials[:, Error.BIAS_X] * ALL_ERRORS[Error.BIAS_X] for scenario in (own, fixed)
    )
    printed_a, printed_b = (float(final_errors(table)[Error.BIAS_X][0]) for table in ("V(a)", "V(b)"))
    return Finding(
        "Parts (a) and (b) of Table V differ for the accelerometers because partial derivatives that had become small "
        "were determined with insufficient accuracy.",
        f"The axes differ. Part (a) uses those of the first start. Part (b) aligns them at the new start, "
        f"{np.degrees(turn):.1f} degrees farther, so that x and z are nearly exchanged. For bias x, final altitude is "
        f"printed as {printed_a:.2f} km in (a) and {printed_b:.2f} km in (b). Computed: {there[0] / 1e3:.2f} km in the "
        f"first axes and {here[0] / 1e3:.2f} km in the new ones. The partial derivatives are accurate to one part in a "
        "million.",
        "does not hold",
    )


def perigee_analogy(frame: pd.DataFrame) -> Finding:
    """Measure how far the ellipse explains the curves."""
    time = frame.iloc[:, 0].to_numpy()
    closed, flown, real = (
        frame[f"by r [1], {name}"].to_numpy() for name in ("closed form", "flown without atmosphere", "trajectory 4")
    )
    by_rate = frame["by r' [s], trajectory 4"].to_numpy()
    off = float(np.abs(flown / closed - 1.0).max())
    return Finding(
        "The curves of final altitude are explained in part by those of the perigee radius of an ellipse.",
        f"The closed forms are correct: without atmosphere the partial derivatives agree within {100 * off:.2f} %, the "
        f"rounding of the printed a and e. The shape in r is similar: the closed form peaks at "
        f"{time[closed.argmax()]:.1f} min with {closed.max():.2f}, trajectory 4 at {time[real.argmax()]:.1f} min with "
        f"{real.max():.2f}. The size differs. For an early altitude-rate error the sign differs as well: "
        f"{by_rate[0]:,.0f} s against {frame.iloc[0, 3]:+.0f} s at the first start.",
        "in part",
    )


def earth_radius() -> Finding:
    """Decide which of two printed radii the report used."""
    start = common_start()
    words = []
    for radius in (6_378.14e3, 6_397.14e3):
        state = start.copy()
        state[0] = radius + 18_476_300.0
        state[3] = 732.9312 / radius
        speed, angle = airspeed_and_angle(state)
        gravity = GRAVITATIONAL_PARAMETER / radius**2
        words.append(
            f"{radius / 1e3:.2f} km gives g = {gravity:.6f} m/s², airspeed {speed / 1e3:.5f} km/s and angle "
            f"{np.degrees(angle):.4f}°"
        )
    return Finding(
        "The earth's radius is 6378.14 km in the notation and 6,397.14 km in the procedure.",
        f"The first radius was used. {words[0]}. {words[1]}. Printed: 9.798597 m/s², 4.79992 km/s, −77.4414°.",
        "settled",
    )


def axes() -> Finding:
    """Decide between the axes of the start and those of reentry."""
    scenario = table_i_scenario(1)
    errors = np.where(np.arange(len(Error)) == Error.BIAS_X, ALL_ERRORS, 0.0)
    at_start = without_noise(ReferenceEngine(scenario.navigation))(errors[None]).values[0, 0] / 1e3
    reentry = float(scenario.trajectory.state(scenario.trajectory.reentry_time)[1])
    at_reentry = simulate_indicated(scenario.trajectory, errors, 0.0, reentry)[0] / 1e3
    return Finding(
        "The inertial axes are horizontal and vertical at the start point, yet eqs. (6) to (9) write −Θ, with Θ = 0 at "
        "reentry.",
        f"Final altitude for bias x on trajectory 1: {at_start:.2f} km with the axes of the start, {at_reentry:.2f} km "
        f"with those of reentry; printed {final_errors('II(a)')[Error.BIAS_X][0]} km.",
        "settled",
    )


def _worst_share(table: str, scenario: Reentry, columns: slice = slice(None)) -> float:
    """Compute the largest difference of ten flights from a printed table, as a share of the column's largest entry."""
    printed = np.array(final_errors(table)[: len(ERRORS)], dtype=float)
    runs = np.diag(ERRORS)
    computed = propagator(scenario, "ensemble", runs)(runs).values * np.array(TO_PRINTED)
    return float((np.abs(computed - printed) / np.abs(printed).max(axis=0))[:, columns].max())


def start_of_table_v() -> Finding:
    """Find which start time fits part (b) best."""
    flown = table_i_scenario(4)

    def misfit(minutes: float) -> float:
        return _worst_share("V(b)", flown.started_at(60.0 * minutes, "start"))

    best = minimize_scalar(misfit, bounds=(-4.4, -3.3), method="bounded", options={"xatol": 1e-3})
    return Finding(
        "Table V starts navigation 3.58 minutes before reentry.",
        f"Part (b) is reproduced within {100 * misfit(-3.58):.1f} % of each column's largest entry with this start, "
        f"and within {100 * best.fun:.1f} % with a start at {best.x:.2f} min. The printed time is therefore "
        "not relative to the passage of 121.92 km.",
        "settled",
    )


def threshold_of_table_vi() -> Finding:
    """Find which switching altitude Table VI used."""
    altitudes = (110.0, 121.92, 130.0)
    shares = [
        _worst_share("VI", table_i_scenario(4, accelerometers_off_above=1e3 * altitude), slice(0, 3))
        for altitude in altitudes
    ]
    return Finding(
        "Table VI has the accelerometers off “above the atmosphere”.",
        f"Off above {altitudes[0]:g}, {altitudes[1]:g} and {altitudes[2]:g} km, altitudes, ranges and altitude rates "
        f"are reproduced within {', '.join(f'{100 * share:.2f}' for share in shares)} % of each column's largest "
        "entry. The range rates of runs 1 and 6 contradict run 11 and are reproduced by none of them.",
        "settled",
    )


def sensitive_angles() -> Finding:
    """Show why trajectories 4 and 6 are solved for their range."""
    row = TABLE_I[4]
    ranges = []
    for angle in (-77.4071, -77.4070, -77.4069):
        start = tuple(start_at_angle(np.radians(angle)))
        ranges.append(range_from_reentry(Reentry(Flight(start, Vehicle(row.lift_law), row.final_altitude)).trajectory))
    solved = np.degrees(airspeed_and_angle(table_i_scenario(4).trajectory.state(0.0))[1])
    return Finding(
        "Trajectory 4 starts at a flight-path angle of −77.4070°.",
        f"One unit of the last printed digit moves the end point by about {(ranges[2] - ranges[0]) / 2e3:,.0f} km, so "
        f"that the printed angle does not define it. Solved for the printed range of 9,780 km the angle is "
        f"{solved:.5f}°; trajectory 6 likewise.",
        "settled",
    )


def reentry_values() -> Finding:
    """Compare the reentry angle and time of Table I and eq. (18)."""
    first, fourth = (table_i_scenario(number).trajectory for number in (1, 4))
    speed, angle = airspeed_and_angle(first.state(first.reentry_time))
    return Finding(
        "From the start of eq. (18) reentry comes after 63.51 min, at 10.51436 km/s and −6.4795°.",
        f"Computed: after {first.reentry_time / 60:.2f} min, at {speed / 1e3:.5f} km/s and {np.degrees(angle):.3f}° "
        f"(trajectory 4: {fourth.reentry_time / 60:.2f} min). Speed agrees; time and angle do not, and seem "
        "to belong to a start angle slightly shallower than the printed one.",
        "settled",
    )


def start_times_agree() -> Finding:
    """Compare the adjoint with eq. (16), in the axes that the latter can have."""
    worst = 0.0
    for number in TABLE_I:
        scenario = table_i_scenario(number)
        trajectory = scenario.trajectory
        times = np.linspace(0.0, 0.999 * trajectory.final_time, STARTS) - trajectory.reentry_time

        def histories(errors: Array, own: Reentry = scenario, at: Array = times) -> tuple[Array, Array]:
            sets, final = own.error_sets(among_all(errors), at)
            return sets[..., COLUMNS], final

        by_runs = partials_at_later_starts(histories, ERRORS)
        by_adjoint = scenario.partials_at(times, "trajectory")[..., COLUMNS]
        largest = np.abs(by_adjoint * ERRORS).max(axis=2, keepdims=True)
        worst = max(worst, float((np.abs(by_runs - by_adjoint) * ERRORS / largest).max()))
    return Finding(
        "The histories of ten runs give the partial derivatives for every start time, eq. (16).",
        f"They do, in the axes of the first start. At {STARTS} start times on each trajectory they agree with one "
        f"backward sweep of the adjoint to {1e6 * worst:.0f} millionths of each row's largest effect. For axes aligned "
        "at the new start they cannot: a scale-factor error in the old axes is not one in the new axes. The adjoint "
        "gives both.",
        "holds",
    )
