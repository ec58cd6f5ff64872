"""Tables I to VI of NASA TN D-1772, every printed number beside the computed one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from enum import StrEnum
from functools import lru_cache
from typing import Any, Final

import numpy as np

from mcnav._dataclasses import dataclass
from mcnav._types import Array
from mcnav.constants import EARTH_RATE, TN_GRAVITY
from mcnav.contract.engine import without_noise
from mcnav.contract.linear import LinearModel
from mcnav.linear.partials import Propagate
from mcnav.systems.reentry.scenario import SOURCES, Flight, Reentry
from mcnav.systems.reentry.table_i import COLUMNS, ERRORS, TABLE_I, among_all, range_from_reentry, start_state
from mcnav.systems.reentry.truth import Trajectory, airspeed_and_angle
from mcnav.systems.reentry.vehicle import Vehicle
from mcnav.validation.reproduce.tn_d1772.printed import NAMES, SUMS, TO_PRINTED, UNITS, final_errors, sums, trajectories

TN_SOURCES: Final = tuple(SOURCES[column] for column in COLUMNS)
"""The report's ten errors."""

INITIAL_CONDITIONS: Final = 4
RUNS: Final = (
    "altitude", "range", "altitude rate", "range rate", "misalignment", "gyro drift", "bias x", "bias z",
    "scale factor x", "scale factor z", "all",
)  # fmt: skip
"""Error that each run applies."""


class Mark(StrEnum):
    """Relation of a computed number to the printed one."""

    DIGITS = "agrees to the printed digits"
    TOLERANCE = "within the tolerance"
    INCONSISTENT = "the printed value is inconsistent"
    DIFFERS = "differs"


@dataclass(frozen=True)
class Cell:
    """One printed number, which the report itself may contradict; computed numbers are in the printed unit.

    The reason says why printed and computed number differ, where that is known. ``second`` is the number computed on
    the ensemble engine; NaN where only one engine computes it.
    """

    table: str
    row: str
    column: str
    unit: str
    printed: str
    computed: float
    tolerance: float
    reason: str = ""
    contradicted: bool = False
    second: float = np.nan

    @property
    def difference(self) -> float:
        """Computed less printed."""
        return self.computed - float(self.printed)

    @property
    def mark(self) -> Mark:
        """Relation of the two."""
        decimals = len(self.printed.partition(".")[2])
        if abs(self.difference) <= 0.5 * 10.0**-decimals * (1.0 + 1e-9):
            return Mark.DIGITS
        if abs(self.difference) <= self.tolerance:
            return Mark.TOLERANCE
        return Mark.INCONSISTENT if self.contradicted else Mark.DIFFERS


@dataclass(frozen=True)
class Case:
    """A table of final errors: a trajectory with options of `Flight`, flown with a multiple of the report's errors.

    The tolerance is a share of the column's largest entry, and at least ``least``, in the printed unit.
    """

    table: str
    trajectory: int
    multiple: float = 1.0
    share: float = 0.005
    least: float = 0.02
    options: tuple[tuple[str, Any], ...] = ()


CASES: Final = (
    *(Case(f"II({letter})", number) for letter, number in zip("abcdefg", TABLE_I, strict=True)),
    Case("IV(a)", 4, -1.0, 0.002, 0.0),
    Case("IV(b)", 4, 10.0, 0.002, 0.0),
    Case("IV(c)", 4, 100.0, 0.002, 0.0),
    Case("V(a)", 4, share=0.025, options=(("start", -3.58 * 60.0), ("axes", "trajectory"))),
    Case("V(b)", 4, share=0.025, options=(("start", -3.58 * 60.0), ("axes", "start"))),
    Case("VI", 4, options=(("accelerometers_off_above", 121_920.0),)),
)
"""Tables II, IV, V and VI. Part (a) of Table V keeps the axes of the first start; part (b) has its own."""

CONTRADICTIONS: Final = {
    ("II(a)", "sum of |equipment|", "range rate"): "the six printed runs sum to {total:.2f}",
    ("II(a)", "sum of |all|", "range rate"): "the ten printed runs sum to {total:.2f}",
    ("IV(b)", "algebraic sum", "range"):
        "it counts run 8 with the sign reversed; the ten printed runs sum to {total:.2f}",
    ("VI", "1: altitude", "range rate"): "contradicts run 11 of the table, to which the ten printed runs do not sum",
    ("VI", "6: gyro drift", "range rate"): "contradicts run 11 of the table, to which the ten printed runs do not sum",
    ("VI", "algebraic sum", "range rate"): "sums the two runs that contradict run 11",
    ("VI", "sum of |initial conditions|", "range rate"): "sums run 1, which contradicts run 11",
    ("VI", "sum of |equipment|", "range rate"): "sums run 6, which contradicts run 11",
    ("VI", "sum of |all|", "range rate"): "sums the two runs that contradict run 11",
}  # fmt: skip
"""Printed numbers that contradict others of the report, and how; ``total`` is what the printed runs really sum to."""

SUM_NAMES: Final = dict(
    zip(SUMS, ("algebraic sum", "sum of |initial conditions|", "sum of |equipment|", "sum of |all|"), strict=True)
)


@lru_cache
def table_i_scenario(number: int, **options: Any) -> Reentry:
    """Build a trajectory of Table I, with options of `Flight`."""
    row = TABLE_I[number]
    return Reentry(Flight(start_state(number), Vehicle(row.lift_law), row.final_altitude, **options))


def propagator(scenario: Reentry, engine: str, probes: Array) -> Propagate:
    """Prepare an engine for the report's ten errors, shape (n, 10), its accuracy settled on probes of that shape."""
    ready = scenario.engine(engine, among_all(probes))
    return lambda errors: without_noise(ready)(among_all(errors))


def linear_model(scenario: Reentry) -> LinearModel:
    """Compute partial derivatives by the report's ten errors, shape (4, 10)."""
    model = scenario.linear().end
    return LinearModel(model.partials[:, COLUMNS], model.nominal)


def absolute_sums(effects: Array) -> dict[str, Array]:
    """Sum the sizes of ten effects, shape (10, ...): those of initial conditions, of the equipment, and all."""
    sizes = np.abs(effects)
    conditions, equipment = sizes[:INITIAL_CONDITIONS].sum(axis=0), sizes[INITIAL_CONDITIONS:].sum(axis=0)
    return {"initial conditions": conditions, "equipment": equipment, "all": conditions + equipment}


def _sums(values: Array) -> dict[str, Array]:
    """Compute the four summary rows of ten runs, shape (10, ...)."""
    return dict(zip(SUMS, (values.sum(axis=0), *absolute_sums(values).values()), strict=True))


def final_error_cells(case: Case) -> Iterator[Cell]:
    """Compute a table of final errors and the sums under it by two engines; the reference engine is compared.

    A sum's tolerance is that of an entry times the square root of the entries summed, their errors being independent.
    """
    errors = np.vstack([np.diag(ERRORS), ERRORS]) * case.multiple
    scenario = table_i_scenario(case.trajectory, **dict(case.options))
    by_engine = [propagator(scenario, name, errors)(errors).values for name in ("reference", "ensemble")]
    both = np.stack(by_engine, axis=-1) * np.array(TO_PRINTED)[:, None]
    printed = final_errors(case.table)
    largest = np.abs(np.array(printed, dtype=float)).max(axis=0)
    tolerance = np.maximum(case.share * largest, case.least)

    runs = len(ERRORS)
    of_printed = _sums(np.array(printed[:runs], dtype=float))

    def cell(row: str, column: int, text: str, values: Array, allowed: float, total: float = np.nan) -> Cell:
        name = NAMES[column]
        reason = CONTRADICTIONS.get((case.table, row, name), "").format(total=total)
        first, by_second = map(float, values)
        return Cell(case.table, row, name, UNITS[column], text, first, allowed, reason, bool(reason), by_second)

    for run, entries in enumerate(printed):
        for column, text in enumerate(entries):
            yield cell(f"{run + 1}: {RUNS[run]}", column, text, both[run, column], float(tolerance[column]))
    counts = {"algebraic": runs, "ic": INITIAL_CONDITIONS, "equipment": runs - INITIAL_CONDITIONS, "all": runs}
    for name, values in _sums(both[:runs]).items():
        for column, text in enumerate(sums(case.table)[name]):
            allowed = float(tolerance[column] * np.sqrt(counts[name]))
            yield cell(SUM_NAMES[name], column, text, values[column], allowed, float(of_printed[name][column]))


def table_i_cells() -> Iterator[Cell]:
    """Compute Table I: ranges and times within 0.2 %, which the start point's printed digits leave open.

    The peak deceleration is that of the whole aerodynamic force, within 3 %: the report had it at its print steps only.
    Its reentry angles differ by 0.014 deg from what its own eqs. (18) give.
    """
    for number, row in trajectories().items():
        trajectory = table_i_scenario(number).trajectory
        load, drag = _peak_loads(trajectory)
        at_start = airspeed_and_angle(trajectory.state(0.0))
        at_reentry = airspeed_and_angle(trajectory.state(trajectory.reentry_time))
        minutes = (trajectory.final_time - trajectory.reentry_time) / 60.0
        of_drag = f"the peak of drag alone is {drag:.2f}; where lift varies, the report seems to print drag"
        of_angle = "the start that flies the printed range reenters steeper: the two numbers are not of one flight"
        columns = (
            ("final_range_km", "final range", "km", range_from_reentry(trajectory) / 1e3, 0.002, ""),
            ("final_time_after_reentry_min", "final time", "min", minutes, 0.002, ""),
            ("peak_deceleration_g", "peak deceleration", "g", load, 0.03, of_drag),
            ("gamma_A_start_deg", "start angle", "deg", float(np.degrees(at_start[1])), 1e-5, ""),
            ("gamma_A_reentry_deg", "reentry angle", "deg", float(np.degrees(at_reentry[1])), 0.003, of_angle),
            ("speed_A_start_km_s", "start speed", "km/s", at_start[0] / 1e3, 1e-5, ""),
            ("speed_A_reentry_km_s", "reentry speed", "km/s", at_reentry[0] / 1e3, 2e-4, ""),
        )
        for key, name, unit, value, share, remark in columns:
            cell = Cell("I", f"trajectory {number}", name, unit, row[key], value, share * abs(float(row[key])))
            yield replace(cell, reason=remark) if cell.mark == Mark.DIFFERS else cell


def _peak_loads(trajectory: Trajectory) -> tuple[float, float]:
    """Compute the largest aerodynamic force and largest drag after reentry, in the report's g."""
    times = np.linspace(trajectory.reentry_time, trajectory.final_time, 4_000)
    force_x, force_z = trajectory.forces(times).T
    states = trajectory.states(times)
    eastward = states[:, 0] * (states[:, 3] - EARTH_RATE)
    drag = (force_z * states[:, 2] - force_x * eastward) / np.hypot(eastward, states[:, 2])
    return float(np.hypot(force_x, force_z).max() / TN_GRAVITY), float(drag.max() / TN_GRAVITY)


def all_cells() -> list[Cell]:
    """Compute every cell of Tables I to VI in their order.

    Table III repeats the altitude and range columns of the absolute sums of Table II.
    """
    second = [(case.trajectory, cell) for case in CASES[: len(TABLE_I)] for cell in final_error_cells(case)]
    third = [
        replace(cell, table="III", row=f"trajectory {trajectory}: {cell.row}", second=np.nan)
        for trajectory, cell in second
        if cell.row.startswith("sum of") and cell.column in NAMES[:2]
    ]
    others = [cell for case in CASES[len(TABLE_I) :] for cell in final_error_cells(case)]
    return [*table_i_cells(), *(cell for _, cell in second), *third, *others]
