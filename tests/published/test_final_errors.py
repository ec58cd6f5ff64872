"""NASA TN D-1772, Tables II (pp. 24-27) and IV (pp. 28-29): final errors, every entry, on both engines.

No entry is excused. What the errata list of these tables (II(b) run 3, II(d) run 4, IV(b) run 2) either stands
corrected in the transcription, where the report's own sums need it, or lies within the tolerances.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mcnav.systems.reentry.table_i import ERRORS
from mcnav.validation.reproduce.tn_d1772.printed import NAMES, TO_PRINTED
from mcnav.validation.reproduce.tn_d1772.printed import final_errors as printed_errors
from mcnav.validation.reproduce.tn_d1772.tables import propagator
from tests.conftest import TRAJECTORIES, reentry

ENGINES = ("ensemble", "reference")
MULTIPLES = {"IV(a)": -1.0, "IV(b)": 10.0, "IV(c)": 100.0}


def _runs(number: int, engine: str, multiple: float, **options: Any) -> np.ndarray:
    """Runs 1 to 11: each error alone, then all of them; in the units printed."""
    errors = np.vstack([np.diag(ERRORS), ERRORS]) * multiple
    outcomes = propagator(reentry(number, **options), engine, errors)(errors)
    assert not outcomes.failures
    return outcomes.values * np.array(TO_PRINTED)


def _compare(
    table: str, computed: np.ndarray, share: float, least: float, excused: frozenset[tuple[int, str]] = frozenset()
) -> None:
    printed = np.array(printed_errors(table), dtype=float)
    computed = computed[: len(printed)]
    tolerance = np.maximum(share * np.abs(printed).max(axis=0), least)
    wrong = [
        f"{table} run {run + 1} {NAMES[column]}: printed {printed[run, column]}, computed {computed[run, column]:.3f}"
        for run, column in np.argwhere(np.abs(computed - printed) > tolerance)
        if (run + 1, NAMES[column]) not in excused
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("number", TRAJECTORIES)
def test_table_ii(number: int, engine: str) -> None:
    """0.5 % of the column's largest entry, or 0.02 in the printed unit: what the printed start point leaves open."""
    _compare(f"II({'abcdefg'[number - 1]})", _runs(number, engine, 1.0), 0.005, 0.02)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("table", MULTIPLES)
def test_table_iv(table: str, engine: str) -> None:
    """0.2 % of the column's largest entry, from minus one to a hundred times the errors."""
    _compare(table, _runs(4, engine, MULTIPLES[table]), 0.002, 0.0)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("table", "axes"), [("V(a)", "trajectory"), ("V(b)", "start")])
def test_table_v(table: str, axes: str, engine: str) -> None:
    """Navigation from 3.58 min before reentry: part (a) in the axes of the first start, part (b) in axes aligned there.

    The report blames the difference of the parts on inaccurate partial derivatives; each is right in its own axes
    (errata, item 4). 2.5 % of the column's largest entry is what the start time leaves: it is printed to 0.01 min, and
    seemingly counted to another instant than 121.92 km.
    """
    computed = _runs(4, engine, 1.0, start=-3.58 * 60.0, axes=axes)
    _compare(table, computed, 0.025, 0.02)


@pytest.mark.parametrize("engine", ENGINES)
def test_table_vi(engine: str) -> None:
    """Accelerometers off above 121.92 km: 0.5 % of the column's largest entry.

    Excused: the range rates of runs 1 and 6, which contradict run 11 of the same table; the ten printed ones sum to
    2.40 where run 11 prints 6.50 (errata, item 5).
    """
    computed = _runs(4, engine, 1.0, accelerometers_off_above=121_920.0)
    _compare("VI", computed, 0.005, 0.02, frozenset({(1, "range rate"), (6, "range rate")}))
    assert computed[: len(ERRORS), 3].sum() == pytest.approx(6.4, abs=0.1)
