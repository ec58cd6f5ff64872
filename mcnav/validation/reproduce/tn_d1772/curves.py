"""The data of Figures 1 to 12 of NASA TN D-1772, and of one more that the report suggests.

Each function returns the table of one figure; its CSV file is that table. Drawing is
`mcnav.validation.reproduce.tn_d1772.figures`.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Final

import numpy as np
import pandas as pd

from mcnav.arrays.types import Array
from mcnav.contract.engine import without_noise
from mcnav.linear.start_times import study_start_times
from mcnav.physics.constants import EARTH_RADIUS, REENTRY_ALTITUDE
from mcnav.systems.reentry.instruments import Error
from mcnav.systems.reentry.outputs import DEVIATIONS
from mcnav.systems.reentry.scenario import SOURCES, Flight, Reentry
from mcnav.systems.reentry.shared_steps import speed_and_angle_errors
from mcnav.systems.reentry.table_i import (
    ALL_ERRORS,
    COLUMNS,
    ERROR_SIZES,
    ERRORS,
    TABLE_I,
    common_start,
    range_from_reentry,
    start_at_angle,
    start_state,
)
from mcnav.systems.reentry.truth import Trajectory, airspeed_and_angle
from mcnav.systems.reentry.vehicle import ConstantLift, VariableLift, Vehicle
from mcnav.validation.reproduce.tn_d1772.ellipse import (
    Ellipse,
    ellipse_of,
    perigee_by_rates,
    perigee_by_speed_and_angle,
)
from mcnav.validation.reproduce.tn_d1772.printed import TO_PRINTED, sums, trajectories
from mcnav.validation.reproduce.tn_d1772.tables import (
    TN_SOURCES,
    absolute_sums,
    linear_model,
    table_i_scenario,
)

POINTS: Final = 400
"""Points of a curve along a flight."""

START_TIMES: Final = 241
EXAMPLE: Final = 4
"""The trajectory on which the report illustrates everything."""

PRINTED_ELLIPSE: Final = Ellipse(2.025e8, 0.9683, 7.099e10)
"""Eq. (17), SI units."""

LIFT_TO_DRAG: Final = (
    0.05, 0.08, 0.11, 0.14, 0.16, 0.18, 0.19, 0.20, 0.21, 0.22, 0.23, 0.24, 0.25, 0.26, 0.27, 0.275, 0.28, 0.285, 0.29,
    0.30, 0.31,
)  # fmt: skip
START_ANGLES: Final = (
    -77.4414, -77.43, -77.42, -77.41, -77.408, -77.4074, -77.4070, -77.40685, -77.4068, -77.40677, -77.40673, -77.4067,
    -77.40667,
)  # fmt: skip
"""Constant lift-to-drag ratios, and start angles (deg) with variable lift, that fill the curves of Figure 4."""

NOMINAL_FINAL_ALTITUDE: Final = 28e3
"""Final altitude (m) of the flights that fill Figure 4: the mean of Table I's."""

MULTIPLES: Final = np.linspace(-100.0, 100.0, 81)
SWITCHING_ALTITUDES: Final = (
    60.0, 65.0, 70.0, *np.arange(75.0, 96.0), *np.arange(96.0, 112.0, 2.0), 115.0, 121.92, 130.0, 150.0, 175.0, 200.0,
)  # fmt: skip


def _times(trajectory: Trajectory) -> Array:
    """Compute times from reentry over a flight, half of them before reentry."""
    before = np.linspace(-trajectory.reentry_time, 0.0, POINTS // 2, endpoint=False)
    return np.concatenate([before, np.linspace(0.0, trajectory.final_time - trajectory.reentry_time, POINTS // 2)])


def figure_1() -> pd.DataFrame:
    """Compute altitude against range of the seven trajectories, km."""
    parts = []
    for number in TABLE_I:
        trajectory = table_i_scenario(number).trajectory
        states = trajectory.states(_times(trajectory) + trajectory.reentry_time)
        at_reentry = trajectory.state(trajectory.reentry_time)
        reach = EARTH_RADIUS * (states[:, 1] - at_reentry[1]) / 1e3
        altitude = (states[:, 0] - EARTH_RADIUS) / 1e3
        parts.append(pd.DataFrame({"trajectory": number, "range [km]": reach, "altitude [km]": altitude}))
    return pd.concat(parts, ignore_index=True)


def figure_2() -> pd.DataFrame:
    """Compute histories of trajectory 4: position and rates, speed and angle, force."""
    trajectory = table_i_scenario(EXAMPLE).trajectory
    times = _times(trajectory)
    states = trajectory.states(times + trajectory.reentry_time)
    forces = trajectory.forces(times + trajectory.reentry_time)
    through_air = np.array([airspeed_and_angle(state) for state in states])
    across = states[:, 0] * states[:, 3]
    return pd.DataFrame(
        {
            "time from reentry [min]": times / 60.0,
            "altitude [km]": (states[:, 0] - EARTH_RADIUS) / 1e3,
            "range [km]": EARTH_RADIUS * states[:, 1] / 1e3,
            "altitude rate [km/s]": states[:, 2] / 1e3,
            "range rate [km/s]": EARTH_RADIUS * states[:, 3] / 1e3,
            "inertial speed [km/s]": np.hypot(states[:, 2], across) / 1e3,
            "inertial flight-path angle [deg]": np.degrees(np.arctan2(states[:, 2], across)),
            "airspeed [km/s]": through_air[:, 0] / 1e3,
            "flight-path angle to the air [deg]": np.degrees(through_air[:, 1]),
            "force per unit mass [m/s^2]": np.hypot(forces[:, 0], forces[:, 1]),
        }
    )


def figure_3() -> pd.DataFrame:
    """Compute the error histories of trajectory 4 with all of the report's errors at once."""
    scenario = table_i_scenario(EXAMPLE)
    times = _times(scenario.trajectory)
    actual, indicated, errors = scenario.error_histories(ALL_ERRORS[None, :], times)
    speed, angle = speed_and_angle_errors(actual, indicated[:, 0])
    return pd.DataFrame(
        {
            "time from reentry [min]": times / 60.0,
            "altitude error [km]": errors[:, 0, 0] / 1e3,
            "range error [km]": errors[:, 0, 1] / 1e3,
            "altitude rate error [m/s]": errors[:, 0, 2],
            "range rate error [m/s]": errors[:, 0, 3],
            "speed error [m/s]": speed,
            "flight-path angle error [mrad]": 1e3 * angle,
        }
    )


def figure_4() -> pd.DataFrame:
    """Compute sums of absolute final errors against final range: as printed, ours, and of flights between them."""
    rows: list[dict[str, object]] = []
    for number, row in TABLE_I.items():
        kind = "constant L/D" if isinstance(row.lift_law, ConstantLift) else "variable L/D"
        printed: dict[str, object] = {"final range [km]": float(trajectories()[number]["final_range_km"])}
        for words, key in (("initial conditions", "ic"), ("equipment", "equipment"), ("all", "all")):
            entries = sums(f"II({'abcdefg'[number - 1]})")[key]
            printed |= {f"{name}, {words} [km]": float(entries[i]) for i, name in enumerate(("altitude", "range"))}
        about: dict[str, object] = {"kind": kind, "trajectory": number}
        rows.append(about | {"source": "printed"} | printed)
        rows.append(about | {"source": "computed"} | _summed(table_i_scenario(number)))
    rows += [{"kind": kind, "source": "between"} | _summed(scenario) for kind, scenario in _between()]
    return pd.DataFrame(rows)


def _summed(scenario: Reentry) -> dict[str, object]:
    """Compute the final range, and sums of absolute final altitude and range errors by P, km."""
    effects = linear_model(scenario).partials[:2] * ERRORS / 1e3
    summed: dict[str, object] = {"final range [km]": range_from_reentry(scenario.trajectory) / 1e3}
    for name, row in zip(("altitude", "range"), effects, strict=True):
        summed |= {f"{name}, {words} [km]": float(total) for words, total in absolute_sums(row).items()}
    return summed


def _between() -> Iterator[tuple[str, Reentry]]:
    """Build the scenarios with other lift-to-drag ratios and start angles."""
    for ratio in LIFT_TO_DRAG:
        vehicle = Vehicle(ConstantLift(ratio))
        yield "constant L/D", Reentry(Flight(tuple(common_start()), vehicle, NOMINAL_FINAL_ALTITUDE))
    for angle in START_ANGLES:
        start = tuple(start_at_angle(np.radians(angle)))
        yield "variable L/D", Reentry(Flight(start, Vehicle(VariableLift()), NOMINAL_FINAL_ALTITUDE))


def figure_5() -> pd.DataFrame:
    """Compute final altitude error of trajectory 4 against initial altitude and range error, flown and linear, km."""
    scenario = table_i_scenario(EXAMPLE)
    linear = scenario.linear().end.partials
    parts = []
    for source in (Error.ALTITUDE, Error.RANGE):
        errors = np.zeros((len(MULTIPLES), len(SOURCES)))
        errors[:, source] = MULTIPLES * ERROR_SIZES[source]
        flown = without_noise(scenario.engine("ensemble", errors))(errors).values
        table = {
            "initial error in": SOURCES[source].name,
            "initial error [km]": errors[:, source] / 1e3,
            "final altitude error, flown [km]": flown[:, 0] / 1e3,
            "final altitude error, linear [km]": linear[0, source] * errors[:, source] / 1e3,
        }
        parts.append(pd.DataFrame(table))
    return pd.concat(parts, ignore_index=True)


@lru_cache
def _partials() -> tuple[Array, Array, Array]:
    """Compute start times (s from reentry) of trajectory 4, and P with axes aligned at each start and at the first.

    P has the report's ten columns.
    """
    scenario = table_i_scenario(EXAMPLE)
    own, fixed = (
        study_start_times(scenario, np.diag(ALL_ERRORS**2), axes, START_TIMES) for axes in ("start", "trajectory")
    )
    return own.times, own.partials[..., COLUMNS], fixed.partials[..., COLUMNS]


def figures_6_to_9(output: int) -> pd.DataFrame:
    """Compute partials of one output of trajectory 4 against start time, SI; both conventions of axes."""
    times, own, fixed = _partials()
    columns = {"start [min from reentry]": times / 60.0}
    for axes, partials in (("axes of that start", own), ("axes of the first start", fixed)):
        for j, source in enumerate(TN_SOURCES):
            unit = f"{DEVIATIONS[output].unit} per {source.unit}"
            columns[f"{source.name}, {axes} [{unit}]"] = partials[:, output, j]
    return pd.DataFrame(columns)


def _on_ellipse() -> tuple[Array, Array]:
    """Compute radii on the way in from the report's start to 121.92 km, and times from there (min)."""
    radii = np.linspace(common_start()[0], EARTH_RADIUS + REENTRY_ALTITUDE, POINTS)
    to_perigee = PRINTED_ELLIPSE.time_to_perigee(radii)
    return radii, (to_perigee[-1] - to_perigee) / 60.0


def figure_10() -> pd.DataFrame:
    """Compute the partial derivatives of the perigee radius in (r, r', theta'): eq. (27) on the ellipse of eq. (17).

    Beside them those of the final altitude of trajectory 4, and of a flight without atmosphere to its perigee, from
    their equations of variation.
    """
    radii, minutes = _on_ellipse()
    speed, angle = PRINTED_ELLIPSE.speed(radii), PRINTED_ELLIPSE.flight_path_angle(radii)
    closed = perigee_by_rates(radii, speed * np.sin(angle), speed * np.cos(angle) / radii)
    with_air, without_air = table_i_scenario(EXAMPLE), drag_free()
    parts = {"closed form": closed.T}
    for name, scenario in (("flown without atmosphere", without_air), ("trajectory 4", with_air)):
        times = np.clip(minutes * 60.0, -scenario.trajectory.reentry_time, None)
        partials = scenario.partials_at(times, "start")[:, 0]
        local = scenario.trajectory.states(times + scenario.trajectory.reentry_time)[:, 0]
        parts[name] = np.column_stack([partials[:, 0], partials[:, 2], partials[:, 3] * local])
    frame = pd.DataFrame({"time from 121.92 km [min]": minutes, "radius [km]": radii / 1e3})
    for name, values in parts.items():
        for column, words in enumerate(("r [1]", "r' [s]", "theta' [1e6 km s/rad]")):
            frame[f"by {words}, {name}"] = values[:, column] * (1e-9 if column == 2 else 1.0)
    return frame


def drag_free() -> Reentry:
    """Build the report's start without atmosphere, down to a millimetre above the perigee of its ellipse."""
    start = common_start()
    perigee = ellipse_of(float(start[0]), float(start[2]), float(start[3])).perigee_radius
    return Reentry(Flight(tuple(start), Vehicle(ConstantLift(0.0), 0.0), perigee - EARTH_RADIUS + 1e-3))


def figure_11() -> pd.DataFrame:
    """Compute the partial derivatives of the perigee radius in (r, V, gamma): eq. (28) on the ellipse of eq. (17)."""
    radii, minutes = _on_ellipse()
    speed, angle = PRINTED_ELLIPSE.speed(radii), PRINTED_ELLIPSE.flight_path_angle(radii)
    by_radius, by_speed, by_angle = perigee_by_speed_and_angle(radii, speed, angle)
    position = {"time from 121.92 km [min]": minutes, "radius [km]": radii / 1e3}
    partials = {"by r [1]": by_radius, "by V [s]": by_speed, "by gamma [km/rad]": by_angle / 1e3}
    return pd.DataFrame(position | partials)


def figure_12() -> pd.DataFrame:
    """Compute altitude and range errors of trajectory 4 against start time: single errors, absolute sums, and RSS."""
    times, own, _ = _partials()
    frame = pd.DataFrame({"start [min from reentry]": times / 60.0})
    for row, name in enumerate(("altitude", "range")):
        effects = own[:, row] * ERRORS * TO_PRINTED[row]
        for j, source in enumerate(TN_SOURCES):
            frame[f"{name} for {source.name} [km]"] = effects[:, j]
        for words, total in absolute_sums(effects.T).items():
            frame[f"{name}, sum of |{words}| [km]"] = total
        frame[f"{name}, root sum square of all [km]"] = np.sqrt((effects**2).sum(axis=1))
    return frame


def switching() -> pd.DataFrame:
    """Compute trajectory 4 with accelerometers off above an altitude: sigma, mean (drag missed), root mean square."""
    row, rows = TABLE_I[EXAMPLE], []
    first_point = start_state(EXAMPLE)
    for altitude in SWITCHING_ALTITUDES:
        flight = Flight(first_point, Vehicle(row.lift_law), row.final_altitude, accelerometers_off_above=1e3 * altitude)
        model = Reentry(flight).linear().end
        sigma = np.sqrt(((model.partials * ALL_ERRORS) ** 2).sum(axis=1))
        result: dict[str, float] = {"off above [km]": altitude}
        for i, output in enumerate(DEVIATIONS):
            scale, unit = TO_PRINTED[i], ("km", "m/s")[i // 2]
            result[f"{output.name}, sigma [{unit}]"] = sigma[i] * scale
            result[f"{output.name}, drag missed [{unit}]"] = model.nominal[i] * scale
            result[f"{output.name}, rms [{unit}]"] = float(np.hypot(sigma[i], model.nominal[i])) * scale
        rows.append(result)
    return pd.DataFrame(rows)
