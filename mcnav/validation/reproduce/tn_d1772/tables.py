"""Tables I to VI of NASA TN D-1772, every printed number beside the computed one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import lru_cache
from typing import Any, Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.engine import without_noise
from mcnav.contract.linear import LinearModel
from mcnav.linear.partials import Propagate
from mcnav.physics.constants import EARTH_RATE, TN_GRAVITY
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
    SMALL = "not larger than the tolerance"
    INCONSISTENT = "the printed value is inconsistent"
    DIFFERS = "differs"


@dataclass(frozen=True)
class Cell:
    """One printed number, which the report itself may contradict; computed numbers are in the printed unit.

    The reason says why the printed number is wrong or differs, where that is known. ``second`` is the number computed
    on the ensemble engine; NaN where only one engine computes it.
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
        """Relation of the two.

        A number that the report contradicts never counts as agreeing. A printed number within the tolerance of zero
        confirms little, because a computed zero would be accepted as well.
        """
        if self.contradicted:
            return Mark.INCONSISTENT
        to_digits = abs(self.difference) <= half_a_digit(self.printed) * (1.0 + 1e-9)
        if not to_digits and abs(self.difference) > self.tolerance:
            return Mark.DIFFERS
        if abs(float(self.printed)) <= self.tolerance:
            return Mark.SMALL
        return Mark.DIGITS if to_digits else Mark.TOLERANCE

    @property
    def wrong_sign(self) -> bool:
        """Whether printed and computed number have opposite signs."""
        return float(self.printed) * self.computed < 0.0


def in_words(items: Sequence[object]) -> str:
    """Join items with commas and ``and``.

    >>> in_words([1, 2, 3])
    '1, 2 and 3'
    """
    words = [str(item) for item in items]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def half_a_digit(printed: str) -> float:
    """Return half a unit of the last printed digit.

    >>> half_a_digit("-12.30"), half_a_digit("7")
    (0.005, 0.5)
    """
    return 0.5 * 10.0 ** -len(printed.partition(".")[2])


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
    ("VI", "1: altitude", "range rate"): "contradicts run 11 of the table, to which the ten printed runs do not sum",
    ("VI", "6: gyro drift", "range rate"): "contradicts run 11 of the table, to which the ten printed runs do not sum",
    ("VI", "algebraic sum", "range rate"): "sums the two runs that contradict run 11",
    ("VI", "sum of |initial conditions|", "range rate"): "sums run 1, which contradicts run 11",
    ("VI", "sum of |equipment|", "range rate"): "sums run 6, which contradicts run 11",
    ("VI", "sum of |all|", "range rate"): "sums the two runs that contradict run 11",
}
"""Printed numbers that contradict run 11 of their table, and how. Printed sums are compared with their printed runs."""

SIGN_REVERSED: Final = {("IV(b)", "algebraic sum", "range"): "it counts run 8 with the sign reversed; "}
"""What is known of how a printed sum came to differ from its runs."""

SUM_NAMES: Final = dict(
    zip(SUMS, ("algebraic sum", "sum of |initial conditions|", "sum of |equipment|", "sum of |all|"), strict=True)
)


SUMMED_RUNS: Final = {
    "algebraic": slice(0, 10), "ic": slice(0, 4), "equipment": slice(4, 10), "all": slice(0, 10),
}  # fmt: skip
"""Runs that each sum adds up."""


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


def contradicted_sum(printed: str, runs: Sequence[str], absolute: bool) -> str:
    """Say what the printed runs add up to where their printed sum cannot be that; empty where it can.

    Every run and the sum are rounded to their printed digits, and the report added before it rounded.

    >>> contradicted_sum("5.6", ["2.5", "-3.0"], absolute=True), contradicted_sum("5.7", ["2.5", "-3.0"], absolute=True)
    ('', 'the 2 printed runs sum to 5.50')
    """
    values = np.array(runs, dtype=float)
    total = float(np.abs(values).sum() if absolute else values.sum())
    rounding = half_a_digit(printed) + sum(map(half_a_digit, runs))
    if abs(float(printed) - total) <= rounding * (1.0 + 1e-9):
        return ""
    return f"the {len(runs)} printed runs sum to {total:.2f}"


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

    def cell(row: str, column: int, text: str, values: Array, allowed: float, wrong_sum: str = "") -> Cell:
        name = NAMES[column]
        place = (case.table, row, name)
        reason = SIGN_REVERSED.get(place, "") + wrong_sum if wrong_sum else CONTRADICTIONS.get(place, "")
        first, by_second = map(float, values)
        return Cell(case.table, row, name, UNITS[column], text, first, allowed, reason, bool(reason), by_second)

    for run, entries in enumerate(printed):
        for column, text in enumerate(entries):
            yield cell(f"{run + 1}: {RUNS[run]}", column, text, both[run, column], float(tolerance[column]))
    for name, values in _sums(both[:runs]).items():
        for column, text in enumerate(sums(case.table)[name]):
            summed = [entries[column] for entries in printed[SUMMED_RUNS[name]]]
            allowed = float(tolerance[column] * np.sqrt(len(summed)))
            wrong = contradicted_sum(text, summed, absolute=name != "algebraic")
            yield cell(SUM_NAMES[name], column, text, values[column], allowed, wrong)


TABLE_I_TOLERANCES: Final = {
    "final range": 2e-3,
    "final time": 2e-3,
    "peak deceleration": 3e-2,
    "start angle": 1e-5,
    "reentry angle": 1e-5,
    "start speed": 1e-5,
    "reentry speed": 2e-4,
}
"""Tolerances of Table I as shares of the printed number.

Ranges and times: what the printed digits of the start point leave open. Peak deceleration: the report had it at its
print steps only.
"""

SOLVED: Final = tuple(number for number, row in TABLE_I.items() if row.final_range is not None)
"""Trajectories whose start angle is solved for the printed range."""


def tolerance_in_words(table: str) -> str:
    """State the tolerance of a table's numbers.

    >>> tolerance_in_words("V(b)")
    "Tolerance: 2.5 % of the column's largest entry, at least 0.02; for sums of n runs √n times as much."
    """
    if table == "I":
        named = {share: [name for name, own in TABLE_I_TOLERANCES.items() if own == share]
                 for share in TABLE_I_TOLERANCES.values()}  # fmt: skip
        shares = ", ".join(f"{in_words(names)} {100.0 * share:g} %" for share, names in named.items())
        return f"Tolerances, of the printed number: {shares}."
    if table == "III":
        return "Tolerance: that of the sums of Table II."
    (case,) = [case for case in CASES if case.table == table]
    least = f", at least {case.least:g}" if case.least else ""
    share = f"Tolerance: {100.0 * case.share:g} % of the column's largest entry{least}"
    return f"{share}; for sums of n runs √n times as much."


def table_i_cells() -> Iterator[Cell]:
    """Compute Table I within the tolerances of `TABLE_I_TOLERANCES`.

    The peak deceleration is that of the whole aerodynamic force. The printed reentry angles differ by 0.014 deg and
    more from what the start of the report's own eqs. (18) gives: an exception, which no tolerance covers.
    """
    for number, row in trajectories().items():
        trajectory = table_i_scenario(number).trajectory
        load, drag = _peak_loads(trajectory)
        at_start = airspeed_and_angle(trajectory.state(0.0))
        at_reentry = airspeed_and_angle(trajectory.state(trajectory.reentry_time))
        minutes = (trajectory.final_time - trajectory.reentry_time) / 60.0
        of_load = (
            f"unexplained: the largest total force is {load:.2f} g, the largest drag alone {drag:.2f} g; neither gives "
            "the printed peaks of all three trajectories with variable lift"
        )
        of_angle = (
            "the start that flies the printed range reenters steeper: the two numbers are not of one flight"
            if number in SOLVED
            else "one exception for the five trajectories with this start: eqs. (18) give the computed angle"
        )
        columns = (
            ("final_range_km", "final range", "km", range_from_reentry(trajectory) / 1e3, ""),
            ("final_time_after_reentry_min", "final time", "min", minutes, ""),
            ("peak_deceleration_g", "peak deceleration", "g", load, of_load),
            ("gamma_A_start_deg", "start angle", "deg", float(np.degrees(at_start[1])), ""),
            ("gamma_A_reentry_deg", "reentry angle", "deg", float(np.degrees(at_reentry[1])), of_angle),
            ("speed_A_start_km_s", "start speed", "km/s", at_start[0] / 1e3, ""),
            ("speed_A_reentry_km_s", "reentry speed", "km/s", at_reentry[0] / 1e3, ""),
        )
        for key, name, unit, value, remark in columns:
            tolerance = TABLE_I_TOLERANCES[name] * abs(float(row[key]))
            cell = Cell("I", f"trajectory {number}", name, unit, row[key], value, tolerance)
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
